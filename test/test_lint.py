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
Style and types: the tools of ament with its settings, ruff, and mypy in its strict mode.

A tool that is not installed (ruff, on a ROS 2 installation) is skipped; on one, the real ament
linters run too.
"""

from importlib import import_module
from importlib.metadata import distributions
import os
from pathlib import Path
import subprocess
import sys

import pytest

ROOT = Path(__file__).resolve().parent.parent
TOOLS = {
    'flake8': ['--statistics', '.'],
    'mypy': [],
    'ruff': ['check', '--no-cache', '.'],
}
# The plugins that ament_flake8 depends on; flake8 silently skips the checks of a missing plugin.
# But for those whose checks ruff has too, in a hundredth of the time: builtins (A),
# comprehensions (C4), docstrings (D), quotes (Q).
PLUGINS = {
    'flake8-blind-except', 'flake8-class-newline', 'flake8-deprecated', 'flake8-import-order',
}
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


def test_flake8_has_the_plugins_of_ament() -> None:
    pytest.importorskip('flake8')
    pytest.importorskip('ruff', reason='a ROS 2 installation has what rosdep brings')
    installed = {each.metadata['Name'].lower().replace('_', '-') for each in distributions()}
    assert PLUGINS - installed == set()


@pytest.mark.parametrize('linter', sorted(AMENT))
def test_the_linter_of_ros_reports_nothing(
    linter: str, monkeypatch: pytest.MonkeyPatch,
) -> None:
    pytest.importorskip(linter)
    monkeypatch.chdir(ROOT)
    assert import_module(f'{linter}.main').main(argv=AMENT[linter]) == 0
