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

"""The tables of the parsers are those of the grammars."""

from importlib.util import find_spec
import os
from pathlib import Path
import subprocess
import sys

from fret_monitor.language.tables import read_tables
import pytest
from tools.parser_tables import LANGUAGE, STARTS

ROOT = LANGUAGE.parent.parent
WRITE = 'import sys, tools.parser_tables as t; sys.stdout.write(t.tables_text(sys.argv[1]))'


def _fetch_lark(folder: Path) -> None:
    """
    Install lark from PyPI in a folder of its own, or skip the test; in CI, fail.

    In the environment it would overwrite the `lark-parser` of ROS 2.
    """
    done = subprocess.run(
        [sys.executable, '-m', 'pip', 'install', '--quiet', '--disable-pip-version-check',
         '--no-deps', '--target', str(folder), 'lark>=1,<2'],
        capture_output=True, text=True, check=False)
    if done.returncode:
        refuse = pytest.fail if os.environ.get('CI') else pytest.skip
        refuse(f'lark is missing and cannot be installed: {done.stderr.strip()[-300:]}')


@pytest.fixture(scope='module')
def lark_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with lark, an empty one if the environment has it."""
    folder = tmp_path_factory.mktemp('lark')
    if find_spec('lark') is None:
        _fetch_lark(folder)
    return folder


@pytest.mark.parametrize('grammar', sorted(STARTS))
def test_the_tables_are_those_of_the_grammar(grammar: str, lark_folder: Path) -> None:
    done = subprocess.run(
        [sys.executable, '-c', WRITE, grammar], capture_output=True, text=True, check=True,
        env={**os.environ, 'PYTHONPATH': f'{lark_folder}{os.pathsep}{ROOT}'})
    file = LANGUAGE / f'{grammar}.json'
    assert done.stdout == file.read_text(encoding='utf-8'), 'run: python3 tools/parser_tables.py'


@pytest.mark.parametrize(
    ('ci', 'outcome'), [('true', pytest.fail.Exception), ('', pytest.skip.Exception)])
def test_without_lark_and_network_ci_fails_and_others_skip(
        ci: str, outcome: type[BaseException], tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv('PIP_NO_INDEX', '1')
    monkeypatch.setenv('CI', ci)
    with pytest.raises(outcome, match='cannot be installed'):
        _fetch_lark(tmp_path)


@pytest.mark.parametrize('grammar', sorted(STARTS))
def test_every_method_of_a_rule_is_one_of_the_builder(grammar: str) -> None:
    from fret_monitor.language import cocospec, fretish, smv
    syntax = {'cocospec': cocospec._SYNTAX, 'fretish': fretish._SYNTAX, 'smv': smv.SYNTAX}[grammar]
    builder = syntax.builder
    methods = {rule.method for rule in read_tables(grammar).rules} - {None}
    assert [method for method in methods if not hasattr(builder, str(method))] == []
