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

"""The command line as users run it: in a process of its own or, for speed, in this process."""

from collections.abc import Mapping
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
import io
import os
from pathlib import Path
import subprocess
import sys

import fret_monitor
from fret_monitor.cli.main import main
import pytest

START = 'import sys; from fret_monitor.cli.main import main; sys.exit(main())'
PACKAGE = Path(fret_monitor.__file__).resolve().parent

PUMP = """\
format: 1
inputs:
  p: {type: bool}
  x: {type: float32}
  n: {type: int8}
  mode: {type: uint8, values: {IDLE: 0, LANDING: 7}}
  word: {type: string, topic: state, values: {stopped: halt, moving: go}}
requirements:
  - {id: R-1, ptltl: "p | x > 0.1"}
  - {id: "R,2", ptltl: "mode = LANDING -> O[0,1] word = moving"}
  - {id: 'R"3', ptltl: "n < 5"}
"""
HEADING = 'p,x,n,mode,word\n'


@dataclass(frozen=True)
class Done:
    """The exit status and output of a command."""

    status: int
    out: str
    err: str


def command(*arguments: object) -> list[str]:
    """Return the command that runs `fret-monitor` with these arguments."""
    return [sys.executable, '-c', START, *map(str, arguments)]


def environment(**changes: str) -> dict[str, str]:
    """Return the environment in which this package is found from any folder."""
    known = os.environ.get('PYTHONPATH')
    path = os.pathsep.join([str(PACKAGE.parent), *([known] if known else [])])
    return {**os.environ, 'PYTHONPATH': path, **changes}


def run(*arguments: object, cwd: Path | None = None, env: Mapping[str, str] | None = None,
        stdin: str = '') -> Done:
    """Run `fret-monitor` in a process of its own; a traceback fails the test."""
    done = subprocess.run(command(*arguments), cwd=cwd, env=env or environment(), input=stdin,
                          capture_output=True, encoding='utf-8', check=False)
    assert 'Traceback' not in done.stderr, done.stderr
    return Done(done.returncode, done.stdout, done.stderr)


def _status(arguments: tuple[object, ...]) -> int:
    """Run `fret-monitor` in this process; any exception other than SystemExit fails the test."""
    try:
        return main([str(item) for item in arguments])
    except SystemExit as end:  # raised by argparse
        return end.code if isinstance(end.code, int) else 1


def run_here(*arguments: object) -> Done:
    """Run `fret-monitor` in this process, where no fixture captures; as `run` otherwise."""
    out, err = (io.TextIOWrapper(io.BytesIO(), 'utf-8', newline='') for _ in range(2))
    with redirect_stdout(out), redirect_stderr(err):
        status = _status(arguments)
    said = []
    for file in (out, err):
        file.flush()
        file.seek(0)
        said.append(file.read())
    return Done(status, *said)


class Here:
    """Runs the command line in this process."""

    def __init__(self, capture: pytest.CaptureFixture[str], folder: Path) -> None:
        """Take the fixture that captures output, and a folder for files."""
        self._capture = capture
        self.folder = folder

    def run(self, *arguments: object) -> Done:
        """Run one command."""
        self._capture.readouterr()
        status = _status(arguments)
        said = self._capture.readouterr()
        return Done(status, said.out, said.err)

    def file(self, name: str, content: str | bytes) -> Path:
        """Write a file in the folder."""
        path = self.folder / name
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path
