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
For tests of robots: a monitor beside a simulation, which fails the test on a violation.

The fixture needs this line in `conftest.py` (docs/ci.md):

    pytest_plugins = ['fret_monitor.testing']

ROS is imported only when a monitor was started.
"""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from itertools import count
import os
from pathlib import Path
import re
import signal
import subprocess
import sys
from tempfile import TemporaryFile
from time import monotonic, sleep, time

import pytest

_MONITOR = ('import sys; from fret_monitor.ros.monitor import main; '
            'sys.argv[0] = "monitor"; sys.exit(main())')
_READY = re.compile(r'watching (?P<number>\d+) requirement')
_IGNORED = re.compile(r"\[WARN\] (?P<line>ignored parameter '(?P<name>[^']*)'.*)")
_VIOLATED = re.compile(
    r'\[(?:ERROR|WARN)\] (?P<line>(?P<id>\S+) violated at (?P<stamp>-?\d+\.\d+): .*)')
_UNSEEN = re.compile(
    r'\[ERROR\] (.* its messages are not received|.* does not match the subscription to .*)')
_SILENT = ', nothing comes of '  # in the line of a violation by an input that is too old
_REORDERED = re.compile(r'reordered within (?P<seconds>[\d.e+-]+) s')
_NAME = 'fret_monitor'
_NUMBERS = count(1)  # of the monitors of this process
_ARRIVAL_S = 0.1  # after the end of a block, for messages that were published before
_LOG_S = 3.0  # after a violation, until it is logged
_HAS_PASSED = pytest.StashKey[bool]()


class Watched:
    """A monitor that runs as a process, and what it has logged."""

    def __init__(self, bundle: str | os.PathLike[str], arguments: tuple[str, ...],
                 seconds: float, *, allow_losses: bool = False) -> None:
        """Start it with further ROS arguments; all waits end after some seconds."""
        self.node_name = f'{_NAME}_{os.getpid()}_{next(_NUMBERS)}'
        self._arguments = arguments
        self._seconds = seconds
        self._allow_losses = allow_losses
        self._until: float | None = None  # s since the epoch: when the block ended
        self._file = TemporaryFile()  # noqa: SIM115  closed by `end`
        self._output: str | None = None  # all of it, after `end`
        self.process = subprocess.Popen(
            [sys.executable, '-c', _MONITOR, '--ros-args', '-r', f'__node:={self.node_name}',
             '-p', f'spec:={os.fspath(bundle)}', *arguments, '-p', 'log_violations:=true'],
            stdin=subprocess.DEVNULL, stdout=self._file, stderr=subprocess.STDOUT,
            env={**os.environ, 'RCUTILS_COLORIZED_OUTPUT': '0',
                 'RCUTILS_CONSOLE_OUTPUT_FORMAT': '[{severity}] {message}'})

    @property
    def output(self) -> str:
        """What it has written so far."""
        if self._output is not None:
            return self._output
        size = os.fstat(self._file.fileno()).st_size
        return os.pread(self._file.fileno(), size, 0).decode(errors='replace')

    @property
    def violations(self) -> list[str]:
        """
        Lines with requirement, time and values; at most one a second of each requirement.

        After the block, those until its end.
        """
        return self._violations(self._until)

    def _violations(self, until: float | None) -> list[str]:
        """Return the lines of the violations until a time; of all, if that is None."""
        return [match['line'] for match in _VIOLATED.finditer(self.output)
                if until is None or float(match['stamp']) <= until + (
                    0 if _SILENT in match['line'] else _ARRIVAL_S)]

    def wait(self) -> None:
        """
        Wait until it has subscribed to all topics.

        Raises
        ------
        AssertionError
            if it does not start, or ignores a parameter in the arguments.
        """
        end = monotonic() + self._seconds
        while not _READY.search(self.output):
            if not self._is_running() or monotonic() > end:
                raise AssertionError(f'the monitor does not start:\n{self.output}')
            sleep(0.02)
        # Other nodes may use what a file of parameters has beside the monitor's.
        given = {text.partition(':=')[0].rpartition(':')[2] for text in self._arguments}
        lines = [match['line'] for match in _IGNORED.finditer(self.output)
                 if match['name'] in given]
        if lines:
            raise AssertionError('\n'.join(lines))

    def check(self) -> None:
        """
        Judge what happened until now.

        Raises
        ------
        AssertionError
            if a requirement was violated, or never evaluated; or if messages were not received.
        """
        self._check(time())

    def end_block(self) -> None:
        """Judge what happened until now, as `check`; what comes later does not count."""
        self._until = time()
        self._check(self._until)

    def _check(self, until: float) -> None:
        from fret_monitor.ros.next_report import next_report
        reorder = max((float(match['seconds']) for match in _REORDERED.finditer(self.output)),
                      default=0.0)  # messages wait so long before they are evaluated
        sleep(_ARRIVAL_S + reorder)
        ready = _READY.search(self.output)
        report = next_report(self.node_name, int(ready['number']) if ready else 0,
                             self._seconds, self._is_running)
        if report is None:
            raise AssertionError(
                f'{self._ending() or "the monitor does not report any more"}:\n{self.output}')
        announced = {item.id: item.announced for item in report.requirements if item.announced}
        unlogged = self._unlogged(announced)
        lines = self._violations(until)
        lines += [f'{item} violated {announced[item]} times' for item in unlogged]
        lines += [f'{item.id} was never evaluated: {item.message}' for item in report.requirements
                  if not item.steps and not item.announced]
        lines += _UNSEEN.findall(self.output)
        lines += [f'{item.name}: {item.undecodable} messages cannot be decoded'
                  for item in report.topics if item.undecodable]
        lines += [f'{item.name}: {item.lost} messages were lost (allow_losses=True allows that)'
                  for item in report.topics if item.lost and not self._allow_losses]
        if lines:
            raise AssertionError('\n'.join(lines))

    def _unlogged(self, announced: dict[str, int]) -> list[str]:
        """Return the requirements whose violations have no line; wait a while for the lines."""
        end = monotonic() + _LOG_S
        while True:
            logged = {match['id'] for match in _VIOLATED.finditer(self.output)}
            missing = [item for item in announced if item not in logged]
            if not missing or monotonic() > end:
                return missing
            sleep(0.05)

    def add_notes(self, error: BaseException) -> None:
        """Add to an exception what the monitor has found before."""
        if self.violations:
            error.add_note('\n'.join(['violations before that:', *self.violations]))
        if self._ending():
            error.add_note(self._ending())

    def _is_running(self) -> bool:
        return self.process.poll() is None

    def _ending(self) -> str:
        """Return how it ended; an empty text if it runs."""
        status = self.process.poll()
        if status is None:
            return ''
        if status < 0:
            return f'the monitor was killed by {signal.Signals(-status).name}'
        return f'the monitor has ended with exit status {status}'

    def end(self) -> None:
        """End the process."""
        if self._is_running():
            self.process.send_signal(signal.SIGINT)
        try:
            self.process.wait(self._seconds)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self._output = self.output
        self._file.close()


@contextmanager
def watching(bundle: str | os.PathLike[str], *arguments: str, blackbox: Path | None = None,
             seconds: float = 30.0, allow_losses: bool = False) -> Iterator[Watched]:
    """
    Run a monitor for a bundle during a `with` block, which begins when it watches.

    Parameters
    ----------
    bundle
        as the parameter `spec` of the monitor.
    arguments
        further ROS arguments, such as `'-r', 'level:=/tank/level'`.
    blackbox
        a folder for the last messages before a violation.
    seconds
        after which waiting for the monitor fails.
    allow_losses
        whether messages may be lost.

    Raises
    ------
    ValueError
        if the arguments have another bundle.
    AssertionError
        at the end of the block, if a requirement was violated until then, or never evaluated, or
        if messages were not received; or if the monitor does not start, ignores a parameter, or
        does not run.
    """
    if any(text.startswith('spec:=') for text in arguments):  # rcl drops a list after a text
        raise ValueError("the first argument has all bundles, such as '[a.yaml, b.yaml]'")
    box = () if blackbox is None else ('-p', f'blackbox:={blackbox}')
    watched = Watched(bundle, (*box, *arguments), seconds, allow_losses=allow_losses)
    try:
        watched.wait()
        try:
            yield watched
        except BaseException as error:  # noqa: B902  raised again
            watched.add_notes(error)
            raise
        watched.end_block()
    finally:
        watched.end()


class Monitors:
    """Makes monitors for a test, and counts the blocks that it has begun."""

    def __init__(self, blackbox: Path) -> None:
        """Write the last messages before a violation to a folder."""
        self._blackbox = blackbox
        self.calls = self.begun = 0

    def __call__(self, *arguments: str | os.PathLike[str],
                 **options: object) -> AbstractContextManager[Watched]:
        """Return `watching`, with a black box."""
        self.calls += 1
        return self._watching(*arguments, **{'blackbox': self._blackbox, **options})

    @contextmanager
    def _watching(self, *arguments: object, **options: object) -> Iterator[Watched]:
        self.begun += 1
        begin: Callable[..., AbstractContextManager[Watched]] = watching
        with begin(*arguments, **options) as watched:
            yield watched


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Iterator[None]:
    """Keep for the fixture whether the test has passed."""
    outcome = yield
    report = outcome.get_result()  # type: ignore[attr-defined]
    if report.when == 'call':
        item.stash[_HAS_PASSED] = report.passed


@pytest.fixture
def monitored(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Monitors]:
    """Return `watching`, with a black box in the folder of the test; it must be used."""
    monitors = Monitors(tmp_path / 'blackbox')
    yield monitors
    if request.node.stash.get(_HAS_PASSED, False) and not 0 < monitors.calls <= monitors.begun:
        pytest.fail('the test has watched nothing: write `with monitored(...):`', pytrace=False)
