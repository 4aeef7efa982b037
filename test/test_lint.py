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
Style and types: ruff, what the linters of ament check besides, and mypy in its strict mode.

A tool that is not installed (ruff, on a ROS 2 installation) is skipped; on one, the real ament
linters run too.
"""

import ast
from importlib import import_module
import os
from pathlib import Path
import re
import subprocess
import sys

import pytest

ROOT = Path(__file__).resolve().parent.parent
TOOLS = {
    'mypy': [],
    'ruff': ['check', '--no-cache', '.'],
}
# What flake8 checks with ament's settings and plugins, and ruff does not: how a line is continued,
# blind excepts by a regular expression, and an empty line before the first method of a class. The
# order of imports has a test of its own. Ruff has the rest, in a hundredth of the time.
LINES = ['E122', 'E124', 'E125', 'E127', 'E128', 'E129', 'E131', 'B901', 'B902', 'CNL1']
AMENT = {
    'ament_copyright': [],
    'ament_flake8': ['--config', 'setup.cfg'],
    'ament_xmllint': ['package.xml'],
}


@pytest.mark.parametrize('tool', sorted(TOOLS))
def test_the_tool_reports_nothing(tool: str) -> None:
    pytest.importorskip(tool)
    # Without the colours and coverage hooks of the surrounding test run.
    environment = {**os.environ, 'NO_COLOR': '1', 'TERM': 'dumb'}
    done = subprocess.run([sys.executable, '-m', tool, *TOOLS[tool]], cwd=ROOT, text=True,
                          capture_output=True, env=environment, check=False)
    assert done.returncode == 0, f'{done.stdout}{done.stderr}'


def _files() -> list[Path]:
    """Return the modules, but for that which is generated."""
    pytest.importorskip('ruff', reason='a ROS 2 installation has ament_flake8')
    skipped = {'build', 'install', 'log', 'fret_monitor/native/binding.py',
               'fret_monitor/native/words.py'}
    return [ROOT / 'setup.py', *(
        path for folder in ROOT.glob('[!.]*') if folder.name not in skipped
        for path in folder.rglob('*.py') if str(path.relative_to(ROOT)) not in skipped)]


def test_lines_are_as_ament_flake8_wants_them() -> None:
    files = _files()
    pycodestyle = import_module('pycodestyle')
    pycodestyle.register_check(
        import_module('flake8_blind_except').check_blind_except, ['B901', 'B902'])
    pycodestyle.register_check(
        import_module('flake8_class_newline').new_line_checker, ['CNL1'])  # it reads four letters
    style = pycodestyle.StyleGuide(select=LINES, max_line_length=99)
    assert style.check_files(map(str, files)).total_errors == 0


def _head(text: str) -> ast.Module:
    """Return what comes before functions and classes; ruff reports imports after them (E402)."""
    head = re.split(r'^(?:@|async |class |def )', text, maxsplit=1, flags=re.MULTILINE)[0]
    try:
        return ast.parse(head)
    except SyntaxError:  # cut in a string
        return ast.parse(text)


def test_imports_are_ordered_as_ament_flake8_wants_them() -> None:
    files = _files()
    checker = import_module('flake8_import_order.checker').ImportOrderChecker
    google = import_module('flake8_import_order.styles').lookup_entry_point('google')
    checker.options = {'import_order_style': google}
    wrong = []
    for file in files:
        tree = _head(file.read_text(encoding='utf-8'))
        # Those of functions have no order.
        tree.body = [statement for statement in tree.body
                     if isinstance(statement, ast.If | ast.Import | ast.ImportFrom)]
        wrong += [f'{file}:{error.lineno}: {error.code} {error.message}'
                  for error in checker(str(file), tree).check_order() if error.code != 'I202']
    assert wrong == []


def test_lines_of_c_have_at_most_99_characters() -> None:
    files = [path for folder in ('bench', 'csrc', 'examples', 'test')
             for ending in ('c', 'cpp', 'h') for path in (ROOT / folder).rglob(f'*.{ending}')]
    assert files
    assert [f'{file}:{number}' for file in files if 'golden' not in file.parts
            for number, line in enumerate(file.read_text(encoding='utf-8').splitlines(), start=1)
            if len(line) > 99] == []


@pytest.mark.parametrize('linter', sorted(AMENT))
def test_the_linter_of_ros_reports_nothing(
    linter: str, monkeypatch: pytest.MonkeyPatch,
) -> None:
    pytest.importorskip(linter)
    monkeypatch.chdir(ROOT)
    assert import_module(f'{linter}.main').main(argv=AMENT[linter]) == 0
