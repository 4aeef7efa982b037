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
"""What pictures read from the pages: examples and tables."""

from pathlib import Path
import re

ROOT = Path(__file__).resolve().parent.parent.parent


def page(name: str) -> str:
    """Return the text of a page."""
    return (ROOT / name).read_text(encoding='utf-8')


def block(name: str, file: str) -> str:
    """Return an example of a page that begins with a comment of its file's name."""
    found = re.search(rf'^```\w+\n# {re.escape(file)}\n(.*?)^```', page(name),
                      re.MULTILINE | re.DOTALL)
    assert found is not None
    return found[1]


def rows(name: str, heading: str) -> list[list[str]]:
    """Return the cells of the table whose first row is a heading."""
    body = page(name).split(f'\n{heading}\n', 1)[1].splitlines()[1:]
    end = next(number for number, line in enumerate(body) if not line.startswith('|'))
    return [[cell.strip() for cell in line.strip('|').split('|')] for line in body[:end]]
