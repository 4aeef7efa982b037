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
"""Object files of csrc for programs in C, compiled once in a run of tests by all its workers."""

from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
import fcntl
from functools import cache
import hashlib
import os
from pathlib import Path
import subprocess
from tempfile import TemporaryDirectory

from fret_monitor.native import csrc_file, csrc_includes
from fret_monitor.native.cache import EVALUATOR_SOURCES
from fret_monitor.native.compiler import COMPILE_FLAGS, find_compiler

RUN = 'FRET_MONITOR_TEST_RUN'
"""The environment variable with a folder that the workers of a run share."""

_FLAGS = (*(flag for flag in COMPILE_FLAGS if flag not in (
    '-O2', '-fPIC', '-fvisibility=hidden')), '-O1', '-Werror')


def command(flags: Sequence[str]) -> list[str]:
    """Return a command that compiles C files with all warnings as errors."""
    return [*find_compiler().command, *_FLAGS, *flags, *csrc_includes()]


def compiled(sources: Iterable[Path], folder: Path, words: Sequence[str]) -> list[Path]:
    """Compile C files into a folder, with a command."""
    folder.mkdir(parents=True, exist_ok=True)

    def made_of(source: Path) -> Path:
        made = folder / f'{source.stem}.o'
        done = subprocess.run([*words, '-c', source, '-o', made],
                              capture_output=True, text=True, check=False)
        assert (done.returncode, done.stdout + done.stderr) == (0, ''), done.stderr
        return made

    with ThreadPoolExecutor(2) as pool:
        return list(pool.map(made_of, sources))


def compiled_once(sources: Sequence[Path], words: Sequence[str]) -> list[Path]:
    """Compile C files that no test changes; the first worker does, and the others wait for it."""
    key = hashlib.sha256(repr((sources, words)).encode()).hexdigest()[:20]
    folder = _folder() / key
    with Path(f'{folder}.lock').open('w', encoding='utf-8') as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not folder.exists():
            with TemporaryDirectory(dir=_folder()) as unfinished:
                compiled(sources, Path(unfinished) / 'o', words)
                (Path(unfinished) / 'o').rename(folder)
    return [folder / f'{source.stem}.o' for source in sources]


def engine_sources() -> list[Path]:
    """Return the sources of the evaluator, the engine and what stands on them without ROS."""
    return [csrc_file(name) for name in EVALUATOR_SOURCES]


def engine(flags: Sequence[str]) -> dict[Path, Path]:
    """Return the object file of each of these sources."""
    sources = engine_sources()
    return dict(zip(sources, compiled_once(sources, command(flags)), strict=True))


def _folder() -> Path:
    return Path(os.environ.get(RUN) or _own_folder().name)


@cache
def _own_folder() -> 'TemporaryDirectory[str]':
    return TemporaryDirectory(prefix='objects-')
