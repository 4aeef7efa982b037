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

"""Lustre for JKind, as FRET writes it to check realizability: nodes with properties."""

from pathlib import Path

from fret_monitor.importing import import_bundles, Imported
from fret_monitor.model.diagnostics import CompileError
import pytest

PUMP = """--Historically
node H(X:bool) returns (Y:bool);
let
    Y = X -> (X and (pre Y));
tel

node PumpSpec( level, limit:real; on:bool; flow:int; alarm:bool ) returns ( );

var full:bool; was_on:bool; R1:bool;
 R2:bool; FTP: bool;
let
FTP = true->false;
full = level > limit;
was_on = false -> pre on;
(* Req text: Pump shall always satisfy full => alarm  *)
R1 = (H((full => alarm)));
R2 = H(was_on => flow >= 0); -- H(false)
assert limit > 0.0;
 --%PROPERTY R1;
 --%PROPERTY R2;
 --%PROPERTY "no flow" H(not on => flow = 0);
 --%PROPERTY H(flow < 100);
--%REALIZABLE level, limit,
  on;
tel
"""


def imported(text: str, folder: Path) -> Imported:
    (folder / 'pump.lus').write_text(text, encoding='utf-8')
    found, = import_bundles([folder / 'pump.lus'], folder / 'pump.yaml')
    return found


def test_properties_are_requirements_and_other_equations_definitions(tmp_path: Path) -> None:
    draft = imported(PUMP, tmp_path).draft
    assert draft.component == 'Pump'
    assert {item.id: item.text for item in draft.requirements} == {
        'PumpSpec_1': 'limit > 0.0', 'R1': 'Pump shall always satisfy full => alarm',
        'R2': 'H(was_on => flow >= 0)', 'no flow': 'H(not on => flow = 0)',
        'PumpSpec_5': 'H(flow < 100)'}
    text = imported(PUMP, tmp_path).text
    assert 'cocospec: "level > limit"' in text and 'cocospec: "false -> pre on"' in text
    assert 'assume: true' in text and 'FTP' not in text
    outputs = text.partition('inputs:')[2].partition('definitions:')[0].split('role: output')
    assert len(outputs) == 3  # flow and alarm


@pytest.mark.parametrize('listed', ['--%REALIZABLE;', ''])
def test_without_a_list_all_are_outputs_and_without_the_line_none(
        listed: str, tmp_path: Path) -> None:
    before, _, after = PUMP.partition('--%REALIZABLE')
    text = imported(before + listed + after.partition(';')[2], tmp_path).text
    assert text.count('role: output') == (5 if listed else 0)


@pytest.mark.parametrize(('old', 'new', 'message'), [
    ('was_on = false', '(was_on, x) = false', 'this node cannot be read'),
    ('limit,\n', 'limit +\n', "a variable, ',' or ';' was expected"),
    ('var full:bool;', 'var full;', "',' or ':' was expected"),
    ('--%PROPERTY', '--', 'has no contract')])
def test_what_cannot_be_read_has_its_place(old: str, new: str, message: str,
                                           tmp_path: Path) -> None:
    with pytest.raises(CompileError, match=message):
        imported(PUMP.replace(old, new), tmp_path)
