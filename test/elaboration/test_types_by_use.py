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

"""The types of undeclared names, by their use."""

from itertools import pairwise

from fret_monitor.elaboration.types_by_use import TypesByUse
from fret_monitor.language.cocospec import parse_cocospec
from fret_monitor.language.expression import Equations
from fret_monitor.model.diagnostics import Source, Text
from fret_monitor.model.values import ValueType
import pytest

BOOL, INT64, FLOAT64 = ValueType.BOOL, ValueType.INT64, ValueType.FLOAT64


def types_of(*formulas: str) -> TypesByUse:
    """Return what the uses of names in properties show, after each formula."""
    types = TypesByUse()
    for formula in formulas:
        tree = parse_cocospec(Text.whole(Source('f', formula)))
        assert not isinstance(tree, Equations)
        types.add_property(tree)
    return types


@pytest.mark.parametrize('formula, truths, numbers', [
    ('H(pump => speed < 3)', 'pump', 'speed'),
    ('if pump then armed else ready', 'pump armed ready', ''),
    ('speed + drift = total', '', 'speed drift total'),
    ('pump = (speed > drift)', 'pump', 'speed drift'),
    ('pump = armed and armed = (not ready)', 'pump armed ready', ''),
    ('speed = drift and drift = 1', '', 'speed drift'),
    ('(false -> pre pump) or (0.0 -> pre speed) > drift', 'pump', 'speed drift'),
    ('preBool(false, pump) and preReal(0.0, speed) > -drift', 'pump', 'speed drift'),
    ('persisted(3, pump) and OT(3, 0, armed) and S(ready, pump)', 'pump armed ready', ''),
    ('ite(pump, speed, drift) > max(total, 1)', 'pump', 'speed drift total'),
    ('heldAt(pump, speed) = drift and drift > 1.5', 'pump', 'speed drift'),
    ('pump = FTP', 'pump', ''),
    ('unknown(pump) and pump', 'pump', '')])
def test_the_use_of_names_shows_their_types(formula: str, truths: str, numbers: str) -> None:
    types = types_of(formula)
    for name in truths.split():
        assert types.type_of(name) is BOOL
    for name in numbers.split():
        assert types.type_of(name) is FLOAT64


@pytest.mark.timeout(10)
def test_names_that_are_compared_again_and_again_are_of_one_type() -> None:
    # Names as long as people's: Python keeps one-letter strings once, others as often as read.
    types = types_of('speed = speed', *['speed = velocity', 'velocity = speed'] * 3)
    assert types.type_of('speed') is None
    types.declare('velocity', BOOL)
    assert types.type_of('speed') is BOOL


def test_what_nothing_shows_is_not_known() -> None:
    types = types_of('speed = drift')
    assert types.type_of('speed') is None
    types.declare('drift', ValueType.FLOAT32)
    assert types.type_of('speed') is FLOAT64


def test_a_name_is_one_in_each_of_its_spellings() -> None:
    assert types_of('wheel.on = pump', 'not wheel_DOT_on').type_of('pump') is BOOL


@pytest.mark.parametrize('formula', [
    'preInt(0, level) > 1 and level < 2.5', 'level < 2.5 and preInt(0, level) > 1',
    'level = depth and depth < 2.5 and absInt(depth) > 1'])
def test_a_number_is_whole_where_only_that_will_do(formula: str) -> None:
    assert types_of(formula).type_of('level') is INT64


def test_a_contradiction_does_not_spread() -> None:
    types = types_of('not pump', 'speed > 1', 'pump = speed', 'speed = drift', 'armed = pump')
    assert {name: types.type_of(name) for name in ('pump', 'armed', 'speed', 'drift')} == {
        'pump': BOOL, 'armed': BOOL, 'speed': FLOAT64, 'drift': FLOAT64}


@pytest.mark.timeout(20)
def test_long_chains_of_names_take_little_time() -> None:
    names = [f'name{number}' for number in range(3000)]
    equalities = [f'{one} = {other}' for one, other in pairwise(names)]
    types = types_of(' and '.join([*equalities, f'not {names[-1]}']))
    assert types.type_of(names[0]) is BOOL
