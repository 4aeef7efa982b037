# Copyright 2026 The fret_monitor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Small exports, written for the tests in the shapes that FRET and Ogma write."""

import json
from pathlib import Path
from typing import Any

from fret_monitor.importing import import_bundles, Imported
from fret_monitor.model.diagnostics import CompileError
import pytest


def requirement(id: str, sentence: str, ptltl: str = '', cocospec: str = '',
                component: str = 'rover', project: str = 'Moon', **more: Any) -> dict[str, Any]:
    """Return a requirement as a project has it."""
    return {
        'reqid': id, 'parent_reqid': '', 'project': project, 'rationale': '',
        'fulltext': sentence, '_id': f'{project}-{id}', **more,
        'semantics': {'type': 'nasa', 'component_name': component, 'ptExpanded': ptltl,
                      'CoCoSpecCode': cocospec, 'variables': []},
    }


def variable(name: str, role: str, kind: str, assignment: str = '', component: str = 'rover',
             project: str = 'Moon') -> dict[str, Any]:
    """Return a variable as a project has it."""
    return {'project': project, 'component_name': component, 'variable_name': name,
            'idType': role, 'dataType': kind, 'assignment': assignment, 'copilotAssignment': '',
            'modeRequirement': '', 'modeldoc': False}


PROJECT = {
    'requirements': [
        requirement('R-1', 'rover shall always satisfy speed <= top', '(H (speed <= top))',
                    'H((speed <= top))', rationale='Wheels wear.', comments='See the manual.'),
        requirement('R-2', 'in hold mode rover shall always satisfy speed = 0.0',
                    '', ''),
        requirement('R-3', 'rover shall within 2 ticks satisfy armed & fast', '', ''),
    ],
    'variables': [
        variable('speed', 'Input', 'double'),
        variable('armed', 'Output', 'boolean'),
        variable('unread', 'Input', 'boolean'),
        variable('top', 'Internal', 'double', '2.5'),
        variable('fast', 'Internal', 'boolean', 'speed > top and not armed;'),
        variable('hold', 'Mode', 'boolean'),
        {'project': 'Moon', 'component_name': 'rover', 'modeldoc': True, 'idType': 'Internal',
         'variable_name': 'model_port', 'dataType': ['double']},
    ],
}

SPECIFICATION = {
    'roverSpec': {
        'Internal_variables': [
            {'name': 'top', 'type': 'real', 'assignmentLustre': '2.5', 'assignmentCopilot': ''}],
        'Other_variables': [{'name': 'speed', 'type': 'real'}, {'name': 'armed', 'type': 'bool'}],
        'Functions': [],
        'Requirements': [
            {'name': 'R-1', 'fretish': 'rover shall always satisfy speed <= top', 'PCTL': '',
             'ptLTL': '(H (speed <= top))', 'CoCoSpecCode': 'H((speed <= top))'}],
    },
}

DOCUMENT = {
    'Example': {
        'internal_variables': [{'name': 'high', 'type': 'Bool', 'meaning': 'level > 3'}],
        'external_variables': [{'name': 'level', 'type': 'Int32'}],
        'properties': [
            {'id': 'Level', 'formula': 'level >= 1 && !high', 'text': 'neither low nor high',
             'result_type': 'double', 'result_formula': 'level + 1'}],
    },
}

DATABASE: dict[str, Any] = {
    'inputs': [
        {'name': 'speed', 'type': 'float',
         'connections': [{'scope': 'ros/message', 'topic': '/wheels/speed'}]},
        {'name': 'armed', 'type': 'bool',
         'connections': [{'scope': 'ros/message', 'topic': '/battery', 'field': 'present'}]},
        {'name': 'level', 'type': 'int32_t',
         'connections': [{'scope': 'cfs', 'topic': 'LEVEL_MID'}]}],
    'topics': [
        {'scope': 'ros/message', 'topic': '/wheels/speed', 'type': 'std_msgs::msg::Float32'},
        {'scope': 'ros/message', 'topic': '/battery', 'type': 'sensor_msgs::msg::BatteryState'}],
    'types': [],
}

LUSTRE = """\
-- Historically
node H(X: bool) returns (Y: bool);
let
  Y = X -> (X and (pre Y));
tel

(*@contract roverSpec (speed: real; armed, on: bool; ) returns (out: real; );

let
var top: real = 2.5;
var last: real = 0.0 -> pre speed;
var fast: bool = speed > top  -- as on Earth
    and not armed;

mode slow_mode (
  require not fast;
  ensure "slow" out <= top;
);

(* Req text: rover shall always satisfy speed <= top  *)
guarantee "R-1" H((speed <= top));

(* Req text: a note that no one wrote in FRETish  *)
assume "R-assumption" (last >= 0.0);
weakly assume on => armed;
tel
*)
"""


def written(folder: Path, **files: object) -> list[Path]:
    """Write files (`name_json`, `name_lus`, `name_txt`) and return their paths."""
    paths = []
    for name, content in files.items():
        path = folder / '.'.join(name.rsplit('_', 1))
        path.write_text(content if isinstance(content, str) else json.dumps(content), 'utf-8')
        paths.append(path)
    return paths


def imported(folder: Path, **files: object) -> Imported:
    """Import files as one bundle."""
    return import_bundles(written(folder, **files), folder / 'bundle.yaml')[0]


def refused(folder: Path, **files: object) -> str:
    """Return what an import is refused with."""
    with pytest.raises(CompileError) as raised:
        import_bundles(written(folder, **files), folder / 'bundle.yaml')
    return str(raised.value)
