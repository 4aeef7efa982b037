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

"""The page docs/ci.md: its test beside a simulation, and its workflow on recordings."""

from collections.abc import Iterator
import os
from pathlib import Path
import re
import subprocess
import sys
from xml.etree import ElementTree

from bag.recordings import Message, write
import fret_monitor
from fret_monitor.testing import watching
import pytest
import yaml

SOURCE = Path(fret_monitor.__file__).parent.parent
PAGE = SOURCE / 'docs' / 'ci.md'
FILE = re.compile(r'^```\w+\n(# (\S+\.(?:py|yaml))\n.*?)^```$', re.MULTILINE | re.DOTALL)
SECOND = 10**9

if not PAGE.is_file():
    pytest.skip('needs the source tree', allow_module_level=True)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder with the files of the page, which is the working directory."""
    for match in FILE.finditer(PAGE.read_text(encoding='utf-8')):
        (tmp_path / match[2]).write_text(match[1], encoding='utf-8')
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv('PYTHONPATH', os.pathsep.join([str(SOURCE), *sys.path]))
    return tmp_path


def replace(file: Path, old: str, new: str) -> None:
    text = file.read_text(encoding='utf-8')
    assert old in text
    file.write_text(text.replace(old, new), encoding='utf-8')


def run_pytest(folder: Path) -> 'subprocess.CompletedProcess[str]':
    return subprocess.run(
        [sys.executable, '-m', 'pytest', '-q', '-p', 'no:cacheprovider', '--basetemp=kept',
         'test_tank.py'], cwd=folder, text=True, capture_output=True, check=False, timeout=120)


def test_the_test_of_the_page_fails_on_a_violation_only(folder: Path, domain: int) -> None:
    done = run_pytest(folder)
    assert done.returncode == 0, done.stdout
    replace(folder / 'simulation.py', '0.5 + 0.01', '0.75 + 0.01')
    done = run_pytest(folder)
    assert done.returncode == 1, done.stdout
    assert re.search(r'FULL violated at \d+\.\d+: level < 0\.9 \[step 1[0-9]: level = 0\.9',
                     done.stdout), done.stdout
    [path] = folder.glob('kept/*0/blackbox/*.mcap')  # `*current` is a link
    assert path.name.endswith('_FULL.mcap')


def test_a_test_in_which_nothing_was_published_fails(folder: Path, domain: int) -> None:
    words = '^FULL was never evaluated: no value yet of level$'
    with pytest.raises(AssertionError, match=words), watching('tank.yaml') as monitor:
        assert monitor.violations == []


def test_an_error_in_the_block_is_not_replaced(folder: Path, domain: int) -> None:
    with pytest.raises(KeyError, match='simulation'), watching('tank.yaml'):
        raise KeyError('simulation')


def test_a_monitor_that_cannot_start_fails_the_test(folder: Path, domain: int) -> None:
    replace(folder / 'tank.yaml', 'level < 0.9', 'level <')
    words = r'(?s)does not start:.*tank\.yaml:6'
    with pytest.raises(AssertionError, match=words), watching('tank.yaml'):
        pass


def test_a_monitor_that_dies_fails_the_test(folder: Path, domain: int) -> None:
    words = 'does not report any more'
    with pytest.raises(AssertionError, match=words), watching('tank.yaml') as monitor:
        monitor.process.kill()
        monitor.process.wait()


def test_the_module_loads_no_ros() -> None:
    script = 'import sys, fret_monitor.testing; print("rclpy" in sys.modules)'
    done = subprocess.run([sys.executable, '-c', script], text=True, capture_output=True,
                          check=True, env={**os.environ, 'PYTHONPATH': str(SOURCE)})
    assert done.stdout == 'False\n'


def commands(folder: Path) -> Iterator[str]:
    """Yield what the workflow runs, except the installation."""
    workflow = yaml.safe_load((folder / 'bags.yaml').read_text(encoding='utf-8'))
    for job in workflow['jobs'].values():
        yield from (step['run'] for step in job['steps']
                    if 'run' in step and step['name'] != 'install')


def run_workflow(folder: Path) -> 'subprocess.CompletedProcess[str]':
    path = f'{Path(sys.executable).parent}{os.pathsep}{os.environ["PATH"]}'
    [command] = commands(folder)
    return subprocess.run(['bash', '-e', '-c', command], cwd=folder, text=True, check=False,
                          capture_output=True, env={**os.environ, 'PATH': path})


def test_the_workflow_of_the_page_judges_recordings(folder: Path) -> None:
    (folder / 'bags').mkdir()
    good: list[Message] = [('/level', number * SECOND, 0.5) for number in range(5)]
    write(folder / 'bags' / 'first', good)
    done = run_workflow(folder)
    assert done.returncode == 0, done.stderr
    write(folder / 'bags' / 'second', [*good, ('/level', 5 * SECOND, 0.95)])
    done = run_workflow(folder)
    assert done.returncode == 1
    suite = ElementTree.parse(folder / 'violations.xml')
    assert [case.get('name') for case in suite.iter('testcase')] == ['FULL', 'FULL']
    assert len(list(suite.iter('failure'))) == 1
    assert (folder / 'report').exists()
