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

"""Bundles of config/ on traces: an unknown value, NaN, violates the requirements on it."""

import csv
from io import StringIO

from cli.command import Here, PACKAGE
import pytest

CONFIG = PACKAGE.parent / 'config'
if not CONFIG.is_dir():
    pytest.skip('needs the source tree', allow_module_level=True)

# Rows without a fault, enough for all bounds.
BASE = {'nearest': '2', 'commanded': '0.3', 'speed': '0.3', 'turning': '0', 'odometry_time': '1'}
ARM = {'joints': '6', 'elbow': '0', 'fastest': '0', 'slowest': '0', 'velocities': '0',
       'load': '3', 'stop': '0'}
STEPS = 60


def violated(here: Here, bundle: str, row: dict[str, str], change: dict[str, str]) -> set[str]:
    """Return what is violated once rows without a fault are followed by changed ones."""
    rows = [row.values()] + [{**row, **change}.values()] * STEPS
    trace = here.file('trace.csv', '\n'.join(map(','.join, [row, *rows])) + '\n')
    done = here.run('simulate', CONFIG / bundle, '--trace', trace)
    assert (done.status, done.err) == (0, '')
    told = list(csv.DictReader(StringIO(done.out)))
    return {name for verdicts in told for name, verdict in verdicts.items()
            if name != 'step' and verdict == '0'}


@pytest.mark.parametrize(('bundle', 'row'), [('mobile_base.yaml', BASE), ('arm.yaml', ARM)])
def test_no_fault_violates_nothing(here: Here, bundle: str, row: dict[str, str]) -> None:
    assert not violated(here, bundle, row, {})


@pytest.mark.parametrize(('change', 'handlers'), [
    ({'nearest': 'nan'}, {'BASE-002'}),
    ({'nearest': 'nan', 'speed': '0'}, set()),
    ({'nearest': 'inf'}, set()),
    ({'nearest': '-inf'}, {'BASE-002'}),
    ({'commanded': 'nan'}, {'BASE-003'}),
    ({'commanded': '0', 'speed': 'nan'}, {'BASE-001', 'BASE-003'}),
    ({'turning': 'nan'}, {'BASE-001'}),
    ({'odometry_time': 'nan'}, {'BASE-004'})])
def test_an_unknown_value_of_the_base_violates_the_requirements_on_it(
    here: Here, change: dict[str, str], handlers: set[str],
) -> None:
    assert violated(here, 'mobile_base.yaml', BASE, change) == handlers


@pytest.mark.parametrize(('change', 'handlers'), [
    ({'elbow': 'nan'}, {'ARM-001'}),
    ({'velocities': 'nan'}, {'ARM-002'}),
    ({'fastest': 'nan', 'slowest': 'nan', 'velocities': 'nan', 'stop': '1'},
     {'ARM-002', 'ARM-003', 'ARM-004'}),
    ({'velocities': 'nan', 'stop': '1'}, {'ARM-002', 'ARM-003', 'ARM-004'}),
    ({'load': 'nan'}, {'ARM-005'})])
def test_an_unknown_value_of_the_arm_violates_the_requirements_on_it(
    here: Here, change: dict[str, str], handlers: set[str],
) -> None:
    assert violated(here, 'arm.yaml', ARM, change) == handlers
