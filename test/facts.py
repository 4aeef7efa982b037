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
The facts from FRET and Ogma that some tests read, where they are present.

They are data of other projects and no part of this one: a folder `shared/data` beside the
repository, or where `FRET_MONITOR_FACTS` says. Without it, the tests that need it are skipped.
"""

import json
import os
from pathlib import Path
from typing import Any

import pytest

FOLDER = Path(os.environ.get('FRET_MONITOR_FACTS')
              or Path(__file__).resolve().parents[2] / 'shared' / 'data')


def path(name: str) -> Path:
    """Return the path of a file of facts, or skip the test."""
    found = FOLDER / name
    if not found.is_file():
        pytest.skip(f'{name} is not here')
    return found


def read(name: str) -> Any:
    """Return what a JSON file of facts holds, or skip the test."""
    return json.loads(path(name).read_text(encoding='utf-8'))


def templates() -> list[dict[str, Any]]:
    """Return FRET's 288 template keys with their formulas, or skip the test."""
    found: list[dict[str, Any]] = read('fret/templates.json')['templates']
    assert len(found) == 288
    return found


def requirements() -> list[dict[str, Any]]:
    """Return real requirements with FRET's formulas, or skip the test."""
    found: list[dict[str, Any]] = read('fret/requirements.json')['requirements']
    assert len(found) == 130
    return found
