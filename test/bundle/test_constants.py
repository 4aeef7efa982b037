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

"""Other values for constants: what takes effect, and what is refused."""

from pathlib import Path

from fret_monitor.bundle.constants import override_constants
from fret_monitor.bundle.reader import parse_bundle
from fret_monitor.model.diagnostics import Problems, Source, Text
import pytest

BUNDLE = """format: 1
constants: {v_max: 0.5, n: 3, is_outdoors: false, a.b: 1}
inputs:
  v: {type: float32}
requirements:
  - {id: R, ptltl: v < v_max}
"""


def overridden(**values: str) -> tuple[dict[str, str], list[str]]:
    """Return the constants of the bundle with these values, and the rendered errors."""
    problems = Problems()
    bundle = override_constants(
        parse_bundle(Source('base.yaml', BUNDLE), Path()),
        {name: Text.whole(Source(f'parameter {name}', value)) for name, value in values.items()},
        problems)
    return ({item.name.value: item.value.value for item in bundle.constants},
            [item.render() for item in problems.errors])


def test_a_value_takes_the_place_of_the_one_in_the_bundle() -> None:
    values, errors = overridden(v_max='-1.5e3', n='2.5', is_outdoors='True', a_DOT_b='2')
    assert not errors
    assert values == {'v_max': '-1.5e3', 'n': '2.5', 'is_outdoors': 'True', 'a.b': '2'}


def test_a_whole_number_in_place_of_a_real_one_stays_real() -> None:
    assert overridden(v_max='1', n='4')[0] == {
        'v_max': '1.0', 'n': '4', 'is_outdoors': 'false', 'a.b': '1'}


@pytest.mark.parametrize(('name', 'value', 'line', 'help_'), [
    ('v_mx', '1', "base.yaml has no constant 'v_mx'", "did you mean 'v_max'?"),
    ('w', '1', "base.yaml has no constant 'w'", 'the constants are v_max, n, is_outdoors, a.b'),
    ('v_max', 'fast', "the constant 'v_max' must be a number, true or false, and is the text "
                      "'fast'", ''),
    ('v_max', 'nan', "the constant 'v_max' must be a number, true or false, and is the text "
                     "'nan'", 'NaN and infinity cannot be written as a number'),
    ('v_max', '', "the constant 'v_max' must be a number, true or false, and is empty", ''),
    ('v_max', 'true', "the constant 'v_max' must be a number, as in the bundle",
     'in base.yaml, line 2, it is 0.5'),
    ('is_outdoors', '1', "the constant 'is_outdoors' must be true or false, as in the bundle",
     'in base.yaml, line 2, it is false'),
])
def test_a_value_that_the_bundle_could_not_have_is_refused_at_its_parameter(
    name: str, value: str, line: str, help_: str,
) -> None:
    values, (error,) = overridden(**{name: value})
    assert error.startswith(f'parameter {name}:1:1: error: {line}\n')
    assert help_ in error
    assert values == overridden()[0]
