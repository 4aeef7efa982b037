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
The user's pages are correct: their commands are run, and their files written.

A fenced block whose first line is a comment with the name of a file is that file, as is one that
is marked with a language and a name, as in `json db.json`. In a block marked `console`, a line
after `$ ` is a command, and what follows is its output, in which `...` stands for anything.
"""

from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
import io
import os
from pathlib import Path
import re
import shlex
import shutil
import subprocess
import sys

from fret_monitor.cli.main import main
import pytest

ROOT = Path(__file__).resolve().parent.parent
PAGES = [ROOT / 'README.md', *sorted((ROOT / 'docs').glob('*.md'))]
FENCE = re.compile(r'^```(?P<kind>\w*)(?: (?P<file>\S+))?\n(?P<text>.*?)^```$',
                   re.MULTILINE | re.DOTALL)
FILE = re.compile(r'# (\S+\.(?:yaml|csv|c|py))\n')

if not PAGES[0].is_file():
    pytest.skip('needs the source tree', allow_module_level=True)


@dataclass(frozen=True)
class Session:
    """A command of a page and the output that the page gives."""

    line: int
    command: str
    output: str


def sessions(text: str, start: int) -> Iterator[Session]:
    """Yield the commands of one block, which starts at a line of the page."""
    for part in re.split(r'^\$ ', text, flags=re.MULTILINE)[1:]:
        command, _, output = part.partition('\n')
        yield Session(start, command, output)


def matches(said: str, printed: str) -> bool:
    """Return whether the output is that of the page, where `...` matches anything."""
    first, *pieces = without_trailing_spaces(said).split('...')
    text = without_trailing_spaces(printed)
    if not pieces:
        return text == first
    *between, last = pieces
    place = len(first)
    # Match each piece as early as possible: this leaves the most text for the next ones.
    for piece in between:
        found = text.find(piece, place)
        if found < 0:
            return False
        place = found + len(piece)
    return text.startswith(first) and text.endswith(last) and place <= len(text) - len(last)


def without_trailing_spaces(text: str) -> str:
    """Return the lines of a text without trailing spaces."""
    return '\n'.join(line.rstrip() for line in text.rstrip().splitlines())


def output_of(command: str) -> str:
    """Return what a command prints; a plain `fret-monitor` runs in this process, for speed."""
    words = list(shlex.shlex(command, posix=True, punctuation_chars=True))
    if words[0] != 'fret-monitor' or any(not set(word) - set('();<>|&') for word in words):
        return subprocess.run(
            ['bash', '-c', command], text=True, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT, check=False).stdout
    printed = io.StringIO()
    with redirect_stdout(printed), redirect_stderr(printed):
        main(shlex.split(command)[1:])
    return printed.getvalue()


@pytest.mark.parametrize('page', [page for page in PAGES if '```console\n' in page.read_text()],
                         ids=lambda page: page.name)
def test_the_commands_of_a_page_print_what_it_says(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    text = page.read_text(encoding='utf-8')
    for folder in ('config', 'examples'):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv('NO_COLOR', '1')
    monkeypatch.setenv('COLUMNS', '80')
    monkeypatch.setenv('PATH', str(Path(sys.executable).parent), prepend=os.pathsep)
    for block in FENCE.finditer(text):
        named = FILE.match(block['text'])
        name = block['file'] or (named[1] if named else None)
        if name:
            (tmp_path / name).write_text(block['text'], encoding='utf-8')
        if block['kind'] != 'console':
            continue
        for each in sessions(block['text'], text.count('\n', 0, block.start()) + 1):
            # Each command runs in a shell of its own here, but all in one terminal of the user.
            assert not re.match(r'(cd|export) ', each.command), each.command
            printed = output_of(each.command)
            assert matches(each.output, printed), (
                f'{page.name}, block at line {each.line}\n$ {each.command}\n{printed}')


def test_the_readme_installs_the_packages_of_the_extras() -> None:
    setup = (ROOT / 'setup.py').read_text(encoding='utf-8')
    lists = re.findall(
        r'^(?:BAG|PROVE|ANALYZE|STUDIO|LSP|METRICS|XLSX) = \[.*?^\]|^Z3 = .*?$', setup,
        re.MULTILINE | re.DOTALL)
    needed = set(re.findall(r"'([\w-]+)>=", ''.join(lists)))
    readme = PAGES[0].read_text(encoding='utf-8')
    commands = [shlex.split(command)
                for command in re.findall(r'pip install (?:--\S+ )*(.*)', readme)]
    assert [{word.partition('>=')[0] for word in command} for command in commands] == [
        needed, needed]
    bounds = {word for command in commands for word in command if '>=' in word}
    assert bounds and all(f"'{word}'" in setup for word in bounds)


@pytest.mark.parametrize('page', PAGES, ids=lambda page: page.name)
def test_the_links_of_a_page_lead_to_files(page: Path) -> None:
    links = re.findall(r'\]\((?!\w+:|#)([^)#]+)', page.read_text(encoding='utf-8'))
    assert [link for link in links if not (page.parent / link).exists()] == []


def test_dots_match_anything_and_other_text_only_itself() -> None:
    assert matches('a ... c\nd\n', 'a bb c  \nd\n')
    assert matches('...\nend', 'one\ntwo\nend\n')
    assert not matches('a c', 'a bb c')
    assert not matches('a\n', 'a\nb\n')
    assert not matches('ab...bc', 'abc')
    assert not matches('a...b...c', 'a c b')
    assert matches('a...b...c', 'a b b c')


def test_long_rows_of_dots_are_compared_quickly() -> None:
    row = '.' * 3000 + 'x'
    assert matches(row * 3, row * 3)
    assert not matches(row * 3, row * 2 + 'y')
