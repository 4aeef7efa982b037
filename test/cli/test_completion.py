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

"""Completion in a shell: verbs, options and the ids of requirements."""

from pathlib import Path
import subprocess

from cli.command import command, environment, Here, PUMP
import fret_monitor
import pytest


def completions(line: str, folder: Path) -> list[str]:
    """Return what a shell is offered at the end of a line."""
    pytest.importorskip('argcomplete')
    answer = folder / 'completions'
    subprocess.run(command(), check=True, capture_output=True, env=environment(
        _ARGCOMPLETE='1', _ARGCOMPLETE_IFS='\n', _ARGCOMPLETE_STDOUT_FILENAME=str(answer),
        _ARGCOMPLETE_SUPPRESS_SPACE='1', COMP_LINE=line, COMP_POINT=str(len(line)),
        COMP_TYPE='9'))
    return [word.strip() for word in answer.read_text().split('\n')]


def test_verbs_options_and_ids_are_completed(here: Here) -> None:
    bundle = here.file('pump.yaml', PUMP.replace('R,2', 'R-2'))
    assert completions('fret-monitor expl', here.folder) == ['explain']
    assert completions('fret-monitor simulate --fail', here.folder) == ['--fail-on-violation']
    assert completions(f'fret-monitor explain {bundle} R-', here.folder) == ['R-1', 'R-2']
    assert completions(f'fret-monitor explain {here.folder}/none.yaml R', here.folder) == ['']


def test_the_marker_is_where_argcomplete_looks_for_it() -> None:
    main = Path(fret_monitor.__file__).parent / 'cli' / 'main.py'
    assert b'\n# PYTHON_ARGCOMPLETE_OK\n' in main.read_bytes()[:1024]


def test_without_argcomplete_nothing_is_run(here: Here) -> None:
    hidden = here.file('argcomplete.py', 'raise ImportError\n')
    env = environment(_ARGCOMPLETE='1', COMP_LINE='fret-monitor ch')
    env['PYTHONPATH'] = f'{hidden.parent}:{env["PYTHONPATH"]}'
    done = subprocess.run(command(), env=env, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (1, '', '')
