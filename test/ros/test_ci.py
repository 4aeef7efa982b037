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
from time import sleep
from xml.etree import ElementTree

from bag.recordings import Message, write
import fret_monitor
from fret_monitor import testing
from fret_monitor.testing import next_report, Watched, watching
import pytest
from ros.harness import BEST_EFFORT, Partner, wait_until
from std_msgs.msg import Float32, Float64
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


def run_pytest(folder: Path, file: str = 'test_tank.py') -> 'subprocess.CompletedProcess[str]':
    return subprocess.run(
        [sys.executable, '-m', 'pytest', '-q', '-p', 'no:cacheprovider', '--basetemp=kept',
         '-W', 'ignore', file], cwd=folder, text=True, capture_output=True, check=False,
        timeout=120)


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


@pytest.mark.usefixtures('forking')
def test_a_test_in_which_nothing_was_published_fails(folder: Path, domain: int) -> None:
    words = '^FULL was never evaluated: no value yet of level$'
    with pytest.raises(AssertionError, match=words), watching('tank.yaml') as monitor:
        assert monitor.violations == []


@pytest.mark.usefixtures('forking')
def test_an_error_in_the_block_is_not_replaced_and_has_the_violations_as_a_note(
        folder: Path, partner: Partner) -> None:
    publisher = partner.publisher(Float64, 'level')
    with pytest.raises(KeyError, match='simulation') as caught, watching(
            'tank.yaml', '-p', 'log_violations:=false') as monitor:
        while not monitor.violations:
            publisher.publish(Float64(data=0.95))
            sleep(0.1)
        raise KeyError('simulation')
    [note] = caught.value.__notes__
    assert note.startswith('violations before that:\nFULL violated at ')
    assert monitor.violations  # the process and its files are gone


SILENT = """
format: 1
inputs:
  beat: {topic: beat, type: std_msgs/msg/Float64, timeout: 0.6, startup: 20, stale: violate}
requirements:
  - {id: ALIVE, ptltl: "beat < 0.9"}
"""
DUE = """
format: 1
inputs:
  level: {topic: level, type: std_msgs/msg/Float64}
evaluation: {policy: timed}
requirements:
  - {id: DUE, fretish: "when level > 0.7 the tank shall within 0.4 seconds satisfy level < 0.5"}
"""


@pytest.mark.usefixtures('forking')
def test_what_happens_after_the_end_of_the_block_does_not_count(
        folder: Path, partner: Partner) -> None:
    (folder / 'silent.yaml').write_text(SILENT, encoding='utf-8')
    (folder / 'due.yaml').write_text(DUE, encoding='utf-8')
    level, beat = partner.publisher(Float64, 'level'), partner.publisher(Float64, 'beat')
    with (pytest.raises(AssertionError) as caught,
          watching('[tank.yaml, silent.yaml, due.yaml]') as monitor):
        wait_until(lambda: level.get_subscription_count() == 2, 'a match')
        for _ in range(15):
            beat.publish(Float64(data=0.5))
            sleep(0.05)
        level.publish(Float64(data=0.95))  # of which the monitor may not know yet
    lines = str(caught.value).splitlines()
    assert len(lines) == 1, lines
    [line] = lines
    assert line.startswith('FULL violated at ')
    assert monitor.violations == [line]


def test_a_violation_counts_until_the_end_of_the_block_and_a_message_a_moment_longer() -> None:
    monitor = Watched.__new__(Watched)
    monitor._output = """
[ERROR] A violated at 10.000: x [step 2: x = 1]
[WARN] B violated at 10.050: x [step 2: x = 1]
[ERROR] C violated at 10.050: x [step 3, no message for x: x = 1]
[ERROR] D violated at 10.200: x [step 2: x = 1]
[INFO] A satisfied again at 9.000: x [step 2: x = 1]
"""
    assert [line[0] for line in monitor._violations(10.0)] == ['A', 'B']
    assert [line[0] for line in monitor._violations(None)] == ['A', 'B', 'C', 'D']


OTHER = """
format: 1
inputs:
  one: {topic: one, type: std_msgs/msg/Float64}
  two: {topic: two, type: std_msgs/msg/Float64, qos: {reliability: reliable}}
requirements:
  - {id: ONE, ptltl: "one < 0.9"}
  - {id: TWO, ptltl: "two < 0.9"}
"""


@pytest.mark.usefixtures('forking')
def test_messages_that_were_not_received_fail_the_test_and_every_bundle_is_waited_for(
        folder: Path, partner: Partner) -> None:
    (folder / 'other.yaml').write_text(OTHER, encoding='utf-8')
    level = partner.publisher(Float64, 'level')
    with (pytest.raises(AssertionError) as caught,
          watching('[tank.yaml, other.yaml]') as monitor):
        one, two = partner.publisher(Float32, 'one'), partner.publisher(
            Float64, 'two', BEST_EFFORT)
        wait_until(lambda: level.get_subscription_count() == 1, 'a match')
        for word in ('publishes', 'does not match'):
            wait_until(lambda: word in monitor.output, word)  # noqa: B023  called in the loop
        for publisher in (one, two):
            partner.node.destroy_publisher(publisher)
        level.publish(Float64(data=0.5))
        level.publish(b'\0\1\0\0\0')  # too short
        wait_until(lambda: 'cannot be decoded' in monitor.output, 'the short message')
    lines = str(caught.value).splitlines()
    for words in ('ONE was never evaluated: no value yet of one',
                  'TWO was never evaluated: no value yet of two',
                  'publishes std_msgs/msg/Float32 on /one, where the bundle says',
                  'does not match the subscription to /two: it offers',
                  'topic /level for tank: 1 messages cannot be decoded'):
        assert len([line for line in lines if words in line]) == 1, lines
    assert len(lines) == 5


def test_lost_messages_fail_the_test_unless_they_are_allowed(
        monkeypatch: pytest.MonkeyPatch) -> None:
    monitor = Watched.__new__(Watched)
    monitor._output = 'watching 1 requirement, by the stamps of headers, reordered within 2.5 s, x'
    monitor.node_name, monitor._seconds = 'node', 1.0
    slept: list[float] = []
    monkeypatch.setattr(testing, 'sleep', slept.append)
    report = next_report.NodeReport(
        (next_report.RequirementReport('R', 'satisfied', 3, 0),),
        (next_report.TopicReport('topic /x', 0, 2), next_report.TopicReport('topic /y', 0, 0)))
    monkeypatch.setattr(next_report, 'next_report', lambda *_: report)
    monitor._allow_losses = False
    with pytest.raises(AssertionError, match=r'^topic /x: 2 messages were lost'):
        monitor.check()
    monitor._allow_losses = True
    monitor.check()
    assert slept == [2.6, 2.6]  # until the last messages are evaluated


def test_bundles_in_the_arguments_are_refused() -> None:
    with (pytest.raises(ValueError, match='the first argument has all bundles'),
          watching('a.yaml', '-p', 'spec:=[a.yaml, b.yaml]')):
        pytest.fail('it begins')


def test_two_monitors_of_a_test_have_two_names(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(subprocess, 'Popen', lambda *_, **__: None)
    made = [Watched('tank.yaml', (), 1.0) for _ in range(2)]
    for monitor in made:
        monitor._file.close()
    assert made[0].node_name != made[1].node_name


WITHOUT_BLOCK = """
import pytest

def test_not_called(monitored):
    pass

def test_called_without_with(monitored):
    monitored('tank.yaml')

def test_has_failed(monitored):
    assert False

def test_is_skipped(monitored):
    pytest.skip()
"""


def test_a_test_that_watches_nothing_fails(folder: Path) -> None:
    (folder / 'test_nothing.py').write_text(WITHOUT_BLOCK, encoding='utf-8')
    done = run_pytest(folder, 'test_nothing.py')
    assert 'ERROR test_nothing.py::test_not_called - Failed: the test has watched' in done.stdout
    assert 'ERROR test_nothing.py::test_called_without_with' in done.stdout
    assert '1 failed, 2 passed, 1 skipped, 2 errors' in done.stdout


@pytest.mark.usefixtures('forking')
def test_a_parameter_that_is_ignored_fails_the_test(folder: Path, domain: int) -> None:
    words = "^ignored parameter 'polcy': did you mean 'policy'"
    with pytest.raises(AssertionError, match=words), watching('tank.yaml', '-p', 'polcy:=timed'):
        pytest.fail('it begins')


@pytest.mark.usefixtures('forking')
def test_a_monitor_that_cannot_start_fails_the_test(folder: Path, domain: int) -> None:
    replace(folder / 'tank.yaml', 'level < 0.9', 'level <')
    words = r'(?s)does not start:.*tank\.yaml:6'
    with pytest.raises(AssertionError, match=words), watching('tank.yaml'):
        pass


@pytest.mark.usefixtures('forking')
def test_a_monitor_that_dies_fails_the_test(folder: Path, domain: int) -> None:
    words = '^the monitor was killed by SIGKILL:'
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
