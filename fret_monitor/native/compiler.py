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
Find, identify and run the C compiler.

`compile_library` takes a folder with C files and writes a shared library there, or raises a
`CompilerError` with the command and the compiler's output. Nothing is cached here.
"""

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
import os
from pathlib import Path
from selectors import DefaultSelector, EVENT_READ
import shlex
import shutil
import signal
import subprocess
from threading import Lock, Thread
import time

from fret_monitor.native.elf import is_machine_code
from fret_monitor.native.errors import CompilerError

# No -march=native, because a library may be copied to another machine. No -ffast-math and no
# contraction, so that verdicts are the same on every machine and equal the reference evaluator's.
COMPILE_FLAGS = (
    '-std=c99', '-O2', '-fPIC', '-fvisibility=hidden', '-ffp-contract=off',
    # A constant-folded or inlined call may differ from the library's.
    *(f'-fno-builtin-{name}' for name in (
        'pow', 'sin', 'cos', 'tan', 'asin', 'acos', 'atan', 'atan2', 'sqrt', 'exp', 'log', 'floor',
        'ceil', 'round')),
    '-Wall', '-Wextra', '-Wpedantic', '-Wconversion', '-Wshadow', '-Wswitch-enum',
)
LINK_FLAGS = ('-shared', '-Wl,-z,defs')
LIBRARIES = ('-lm', '-pthread')


@dataclass(frozen=True)
class Linking:
    """
    What object files are linked to: `file` with the name in place of `{}`.

    `searched` are arguments with which the headers are found; `flags` come before the objects, and
    `libraries` after them. With `is_kept` the file outlives this process: it is made in the cache
    only.
    """

    file: str
    searched: tuple[str, ...] = ()
    flags: tuple[str, ...] = LINK_FLAGS
    libraries: tuple[str, ...] = LIBRARIES
    is_kept: bool = False


SHARED = Linking('lib{}.so')
"""A shared library."""

OBJECT = Linking('{}.rel', (), ('-r', '-nostdlib'), ())
"""One object file."""

TIMEOUT = 600.0  # seconds for all commands of one library

_SEARCHED = ('CPATH', 'C_INCLUDE_PATH', 'LIBRARY_PATH')  # environment variables with search paths
_LAST_LINES = 30
_LAST_BYTES = 1 << 16  # of a compiler's output that are kept, so that it cannot fill the memory
_VERSION_TIMEOUT = 20.0


@dataclass(frozen=True)
class Compiler:
    """
    A C compiler: the command that starts it, and its identity.

    `identity` changes when the compiler does. It consists of the path, size and date of its file,
    the output of `--version`, and the environment variables with its search paths. It is part of
    the key of libraries in the cache.
    """

    command: tuple[str, ...]
    identity: str


def find_compiler(environment: Mapping[str, str] | None = None) -> Compiler:
    """
    Find the C compiler: `CC` (which may hold arguments), else cc, gcc or clang on `PATH`.

    Raises
    ------
    CompilerError
        if there is none, or `CC` names one that cannot be run.
    """
    environment = os.environ if environment is None else environment
    path = environment.get('PATH', os.defpath)
    wanted = environment.get('CC', '').strip()
    if wanted:
        return _wanted(wanted, environment)
    for name in ('cc', 'gcc', 'clang'):
        found = shutil.which(name, path=path)
        if found:
            return _identified((found,), environment)
    raise CompilerError('no C compiler found: install gcc (sudo apt install gcc) or set CC')


def _wanted(wanted: str, environment: Mapping[str, str]) -> Compiler:
    try:
        words = shlex.split(wanted)
    except ValueError as error:
        raise CompilerError(f"CC is set to '{wanted}', which is no command ({error})") from None
    path = environment.get('PATH', os.defpath)
    found = shutil.which(words[0], path=path) if words else None
    if found is None:
        raise CompilerError(
            f"CC is set to '{wanted}', which cannot be run: "
            'install it, or unset CC to use cc, gcc or clang')
    return _identified((found, *words[1:]), environment)


def _identified(command: tuple[str, ...], environment: Mapping[str, str]) -> Compiler:
    file = os.path.realpath(command[0])
    status = os.stat(file)
    content = (file, str(status.st_size), str(status.st_mtime_ns))
    # A script may start one compiler or another.
    version = (_version_of_program(command, content) if is_machine_code(file) else
               _version(command))
    return Compiler(command, '\n'.join((
        *command, *content, *(f'{name}={environment.get(name)!r}' for name in _SEARCHED),
        version)))


@cache
def _version_of_program(command: tuple[str, ...], content: tuple[str, ...]) -> str:
    return _version(command)


def _version(command: Sequence[str]) -> str:
    """Return the output of `--version`, also if the compiler does not support the option."""
    try:
        # In a process group of its own, so that killing it also kills its children.
        process = subprocess.Popen(
            [*command, '--version'], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL, env=_environment(), process_group=0)
    except OSError as error:
        raise CompilerError(f'{command[0]} cannot be run: {error.strerror}') from None
    with process:
        try:
            answer, _ = process.communicate(timeout=_VERSION_TIMEOUT)
        except subprocess.TimeoutExpired:
            raise CompilerError(
                f'{shlex.join(command)} --version gave no answer in {_VERSION_TIMEOUT:g} s: '
                'set CC to another C compiler') from None
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
    return answer.decode(errors='replace')


def _environment() -> dict[str, str]:
    """Return the environment with the C locale, so that messages are always in English."""
    return {**os.environ, 'LC_ALL': 'C'}


def compile_library(
    compiler: Compiler, sources: Sequence[str], library: str, *, folder: Path,
    timeout: float = TIMEOUT, linking: Linking = SHARED,
) -> None:
    """
    Compile C files of a folder, several at a time, and link them to a shared library there.

    With another `linking` they become an object file or a program.

    Parameters
    ----------
    compiler
        the result of `find_compiler`.
    sources
        file names in `folder`; none if `linking` has what is linked.
    library
        the file name of the library in `folder`.
    folder
        where the compiler runs. It gets relative names, so that the library contains no path.
    timeout
        seconds for all commands together.
    linking
        what the objects are linked to.

    Raises
    ------
    CompilerError
        if a command fails, or the time is over; no process is left running.
    """
    deadline = time.monotonic() + timeout
    compile_one = (*compiler.command, *COMPILE_FLAGS, *linking.searched)
    link = (*compile_one, *linking.flags, '-o', library)
    if len(sources) == 1:
        _run([(*link, *sources, *linking.libraries)], folder, deadline)
        return
    objects = [f'{source}.o' for source in sources]
    _run([(*compile_one, '-c', '-o', made, source)
          for source, made in zip(sources, objects)], folder, deadline)
    _run([(*link, *objects, *linking.libraries)], folder, deadline)


@dataclass(frozen=True, eq=False)
class _Running:
    """A running command; `output` is the last part of its output so far."""

    command: tuple[str, ...]
    process: subprocess.Popen[bytes]
    output: bytearray


def _run(commands: Iterable[tuple[str, ...]], folder: Path, deadline: float) -> None:
    """Run commands, as many at a time as there are processors; raise for the first that fails."""
    waiting = deque(commands)
    running = _RunningCommands(folder)
    with DefaultSelector() as selector:
        try:
            while waiting or running.commands:
                while waiting and len(running.commands) < (os.cpu_count() or 1):
                    started = running.start(waiting.popleft())
                    assert started.process.stdout is not None
                    selector.register(started.process.stdout, EVENT_READ, started)
                for ended in _ended(running.commands, selector, deadline):
                    running.commands.remove(ended)
                    _judge(ended)
        finally:
            running.kill()


class _RunningCommands:
    """
    The commands that run in a folder.

    A signal handler that raises an exception interrupts the main thread between any two of its
    instructions. Another thread therefore starts and records a command: none is left running.
    """

    def __init__(self, folder: Path) -> None:
        self.commands: set[_Running] = set()
        self._folder = folder
        self._lock = Lock()
        self._is_over = False

    def start(self, command: tuple[str, ...]) -> _Running:
        outcome: list[_Running | OSError] = []

        def start_here() -> None:
            with self._lock:
                if self._is_over:
                    return
                try:
                    started = _Running(command, self._spawn(command), bytearray())
                except OSError as error:
                    outcome.append(error)
                else:
                    self.commands.add(started)
                    outcome.append(started)

        thread = Thread(target=start_here, daemon=True)
        thread.start()
        thread.join()
        if isinstance(outcome[0], OSError):
            raise CompilerError(f'{command[0]} cannot be run: {outcome[0].strerror}')
        return outcome[0]

    def _spawn(self, command: tuple[str, ...]) -> subprocess.Popen[bytes]:
        # In a process group of its own, so that killing it also kills its children.
        return subprocess.Popen(
            command, cwd=self._folder, env=_environment(), stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, process_group=0)

    def kill(self) -> None:
        """Kill what runs, and start nothing more."""
        with self._lock:
            self._is_over = True
        for left in self.commands:
            _kill(left)


def _ended(
    running: Iterable[_Running], selector: DefaultSelector, deadline: float,
) -> Iterable[_Running]:
    """Wait for output of a command; yield the commands that have closed their output."""
    ready = selector.select(max(0.0, deadline - time.monotonic()))
    if not ready:
        raise _too_slow(next(iter(running)))
    for key, _ in ready:
        output = os.read(key.fd, 65536)
        if output:
            key.data.output.extend(output)
            del key.data.output[:-_LAST_BYTES]
        else:
            selector.unregister(key.fileobj)
            _await(key.data, deadline)
            yield key.data


def _await(running: _Running, deadline: float) -> None:
    try:
        running.process.wait(max(0.1, deadline - time.monotonic()))
    except subprocess.TimeoutExpired:
        raise _too_slow(running) from None


def _too_slow(running: _Running) -> CompilerError:
    return CompilerError(
        f'the C compiler did not end in time and was stopped:\n  {shlex.join(running.command)}')


def _judge(ended: _Running) -> None:
    _close(ended)
    status = ended.process.returncode
    if status == 0:
        return
    how = f'exit status {status}' if status > 0 else f'killed by {_signal_name(-status)}'
    output = bytes(ended.output).decode(errors='replace').splitlines()[-_LAST_LINES:]
    raise CompilerError('\n'.join((
        f'the C compiler failed ({how}):', f'  {shlex.join(ended.command)}', *output)))


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f'signal {number}'


def _kill(running: _Running) -> None:
    try:
        os.killpg(running.process.pid, signal.SIGKILL)
    except ProcessLookupError:
        pass  # it has already ended
    running.process.wait()
    _close(running)


def _close(running: _Running) -> None:
    if running.process.stdout is not None:
        running.process.stdout.close()
