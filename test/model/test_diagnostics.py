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

"""The command that installs a package for the running Python interpreter."""

from pathlib import Path
import sys

from fret_monitor.model.diagnostics import pip_install
import pytest


@pytest.mark.parametrize(('is_virtual', 'is_managed', 'has_pip', 'command'), [
    (True, True, True, '{python} -m pip install z3-solver'),
    (False, False, True, '{python} -m pip install z3-solver'),
    (False, True, True,
     '{python} -m pip install --user --break-system-packages z3-solver'),
    (False, True, False, 'sudo apt install python3-pip && '
     '{python} -m pip install --user --break-system-packages z3-solver')])
def test_it_is_one_that_this_interpreter_does_not_refuse(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_virtual: bool, is_managed: bool,
        has_pip: bool, command: str) -> None:
    monkeypatch.setattr(sys, 'prefix', str(tmp_path) if is_virtual else sys.base_prefix)
    monkeypatch.setattr('sysconfig.get_path', lambda name: str(tmp_path / name))
    monkeypatch.setattr('fret_monitor.model.diagnostics.find_spec', lambda name: has_pip or None)
    (tmp_path / 'stdlib').mkdir()
    if is_managed:
        (tmp_path / 'stdlib' / 'EXTERNALLY-MANAGED').touch()
    assert pip_install('z3-solver') == command.format(python=sys.executable)
