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

"""What an editor says of a word is what the pages say."""

from pathlib import Path
import re

from fret_monitor.bundle.bundle import Language
from fret_monitor.editing.words import meanings_of
from fret_monitor.elaboration.functions import FUNCTIONS
from fret_monitor.language.fretish_words import WORDS
import pytest

DOCS = Path(__file__).resolve().parents[2] / 'docs'
PAGES = ('language.md', 'fretish.md', 'future.md', 'over_time.md', 'for_each.md')
NAMES = {Language.FRETISH: tuple(WORDS), Language.PTLTL: tuple('HOYZST') + ('SI', 'FTP'),
         Language.MLTL: tuple('GFXURV'), Language.COCOSPEC: (
             'S', 'SI', 'T', 'OT', 'HT', 'ST', 'SIT', 'YtoPre', 'ZtoPre')}

if not DOCS.is_dir():
    pytest.skip('needs the pages', allow_module_level=True)

ROWS = [line for page in PAGES for line in (DOCS / page).read_text(encoding='utf-8').splitlines()
        if line.startswith('| ')]


def follow(words: list[str], row: list[str]) -> bool:
    """Return whether words are in a row of a table, in their order."""
    rest = iter(row)
    return all(word in rest for word in words)


def says(row: str, shape: str, meaning: str) -> bool:
    """Return whether a row says this of a shape; of several shapes each has its part."""
    cells = row.replace('\\|', '\0')[2:-2].split(' | ')
    shapes = re.findall('`([^`]+)`', cells[0])
    if shape not in shapes or not follow(tokens(meaning), tokens(row)):
        return False
    for separator in ('; ', ', '):
        parts = re.split('; (?:the result|also)', cells[-1])[0].split(separator)
        if len(parts) == len(shapes) > 1:
            own = set(tokens(parts[shapes.index(shape)])) - {'or'}
            return own <= set(tokens(meaning))
    return True


def tokens(text: str) -> list[str]:
    return re.findall(r"[\w+<>=!\[\]'-]+", text.replace('\\|', '|'))


@pytest.mark.parametrize('language', Language)
def test_a_word_means_what_its_page_says(language: Language) -> None:
    known = {*NAMES[language], *(name for name in FUNCTIONS if not name.endswith(('Int', 'Real')))}
    found = [item for word in sorted(known) for item in meanings_of(language, word)]
    assert len(found) > 30
    wrong = [item.shape for item in found if not any(
        says(row, item.shape, item.meaning) for row in ROWS)]
    assert wrong == ['[scope] [condition] the COMPONENT shall [timing] satisfy EXPRESSION'] * len(
        wrong)


def test_every_operator_and_function_has_a_meaning() -> None:
    without = [word for language in (Language.PTLTL, Language.MLTL, Language.COCOSPEC)
               for word in (*NAMES[language], *FUNCTIONS) if not meanings_of(language, word)]
    assert without == []
