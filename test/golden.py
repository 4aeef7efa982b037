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
"""
Golden files: outputs of the package that a person has reviewed.

`test/golden/FOLDER/NAME.yaml` is the input, and `NAME.txt` beside it the expected output. With
`FRET_MONITOR_UPDATE_GOLDEN=1` in the environment the outputs are written again (read the
difference before you commit it); nothing else writes them.
"""

import os
from pathlib import Path

FOLDER = Path(__file__).resolve().parent / 'golden'
UPDATE = 'FRET_MONITOR_UPDATE_GOLDEN'


def cases(folder: str, suffix: str = '.yaml') -> list[Path]:
    """Return the inputs in a folder of golden files, by name."""
    return sorted((FOLDER / folder).glob(f'*{suffix}'))


def check(path: Path, answer: str) -> None:
    """Compare an output with the golden file of its input, or write that file."""
    expected = path.with_suffix('.txt')
    if os.environ.get(UPDATE) == '1':
        expected.write_text(answer, encoding='utf-8')
    assert expected.is_file(), f'{expected} is missing: {UPDATE}=1 writes it'
    assert answer == expected.read_text(encoding='utf-8')
