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

"""A requirement whose verdict no message can change is reported."""

from pathlib import Path

from fret_monitor import build
import pytest

BUNDLE = """
format: 1
inputs:
  p: {type: bool}
  u: {type: uint8}
requirements:
  - {id: R, ptltl: "FORMULA"}
"""


@pytest.mark.parametrize(('formula', 'told'), [
    ('2 ^ 3 = 9', 'R is false at every step'),
    ('p | !p', 'R is true at every step'),
    ('H (p & !p)', 'R is false at every step'),
    ('p', ''),
    ('FTP', ''),
    ('Y TRUE', ''),
])
def test_a_verdict_that_no_message_changes_is_reported(
    formula: str, told: str, tmp_path: Path,
) -> None:
    bundle = tmp_path / 'bundle.yaml'
    bundle.write_text(BUNDLE.replace('FORMULA', formula), encoding='utf-8')
    warnings = [item.render() for item in build.generate_monitor(build.read(bundle)).warnings]
    assert [told in item for item in warnings if 'at every step' in item] == [True] * bool(told)
