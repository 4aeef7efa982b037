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
from functools import partial
import os
from pathlib import Path
import re
import signal
import subprocess
import sys
from tempfile import TemporaryFile
from time import monotonic, sleep

import pytest

_MONITOR = ('import sys; from fret_monitor.ros.monitor import main; '
            'sys.argv[0] = "monitor"; sys.exit(main())')
_READY = 'watching '
_VIOLATED = re.compile(r'\[(?:ERROR|WARN)\] (?P<line>(?P<id>\S+) violated at .*)')
_NAME = 'fret_monitor'


class Watched:
    """A monitor that runs as a process, and what it has logged."""

    def __init__(self, bundle: str | os.PathLike[str], arguments: tuple[str, ...],
                 seconds: float) -> None:
        """Start it with further ROS arguments; all waits end after some seconds."""
        self.node_name = f'{_NAME}_{os.getpid()}'
        self._seconds = seconds
        self._file = TemporaryFile()  # noqa: SIM115  closed by `end`
        self.process = subprocess.Popen(
            [sys.executable, '-c', _MONITOR, '--ros-args', '-r', f'__node:={self.node_name}',
             '-p', f'spec:={os.fspath(bundle)}', *arguments],
            stdin=subprocess.DEVNULL, stdout=self._file, stderr=subprocess.STDOUT,
            env={**os.environ, 'RCUTILS_COLORIZED_OUTPUT': '0',
                 'RCUTILS_CONSOLE_OUTPUT_FORMAT': '[{severity}] {message}'})

    @property
    def output(self) -> str:
        """What it has written so far."""
        size = os.fstat(self._file.fileno()).st_size
        return os.pread(self._file.fileno(), size, 0).decode(errors='replace')

    @property
    def violations(self) -> list[str]:
        """Lines with requirement, time and values; at most one a second of each requirement."""
        return [match['line'] for match in _VIOLATED.finditer(self.output)]

    def wait(self) -> None:
        """Wait until it has subscribed to all topics."""
        end = monotonic() + self._seconds
        while _READY not in self.output:
            if self.process.poll() is not None or monotonic() > end:
                raise AssertionError(f'the monitor does not start:\n{self.output}')
            sleep(0.02)

    def check(self) -> None:
        """Raise an `AssertionError` if a requirement was violated, or never evaluated."""
        from fret_monitor.ros.next_report import next_report
        reports = next_report(self.node_name, self._seconds, self._is_running)
        if not reports:
            raise AssertionError(f'the monitor does not report any more:\n{self.output}')
        lines = self.violations
        logged = {line.partition(' ')[0] for line in lines}
        lines += [f'{item.id} violated {item.announced} times' for item in reports
                  if item.announced and item.id not in logged]
        lines += [f'{item.id} was never evaluated: {item.message}' for item in reports
                  if not item.steps and not item.announced]
        if lines:
            raise AssertionError('\n'.join(lines))

    def _is_running(self) -> bool:
        return self.process.poll() is None

    def end(self) -> None:
        """End the process."""
        if self._is_running():
            self.process.send_signal(signal.SIGINT)
        try:
            self.process.wait(self._seconds)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self._file.close()


@contextmanager
def watching(bundle: str | os.PathLike[str], *arguments: str, blackbox: Path | None = None,
             seconds: float = 30.0) -> Iterator[Watched]:
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

    Raises
    ------
    AssertionError
        at the end of the block, if a requirement was violated, or never evaluated; or if the
        monitor does not start or run.
    """
    box = () if blackbox is None else ('-p', f'blackbox:={blackbox}')
    watched = Watched(bundle, (*box, *arguments), seconds)
    try:
        watched.wait()
        yield watched
        watched.check()
    finally:
        watched.end()


@pytest.fixture
def monitored(tmp_path: Path) -> Callable[..., AbstractContextManager[Watched]]:
    """Return `watching`, with a black box in the folder of the test."""
    return partial(watching, blackbox=tmp_path / 'blackbox')
