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
Nodes as processes that need to import less: more than half of a start is imports.

A server imports what nodes import, without the middleware, and forks for each node. Such a node
has its own arguments, environment, folder, output, signal handlers and end, like one that is
started anew. It loads the middleware itself, since Fast DDS makes names when it is loaded that
have to differ between nodes.
"""

import atexit
from collections.abc import Mapping, Sequence
from contextlib import suppress
import ctypes
import faulthandler
from functools import cache
import gc
from importlib import import_module
from importlib.machinery import SourceFileLoader
from importlib.util import find_spec
import json
import os
from pathlib import Path
import re
import signal
import socket
import subprocess
import sys
from tempfile import TemporaryFile
from time import monotonic, sleep
from types import CodeType
from typing import Any

import fret_monitor

_MODULES = (
    'ament_index_python.packages', 'builtin_interfaces.msg', 'concurrent.futures.thread',
    'diagnostic_msgs.msg', 'fret_monitor.build', 'fret_monitor.model.bundle_files',
    'fret_monitor.model.output', 'fret_monitor.native.folder',
    'fret_monitor.ros.signals', 'fret_monitor.runtime',
    'fret_monitor.runtime.fields', 'fret_monitor.runtime.reporting', 'fret_monitor.start',
    'lifecycle_msgs.msg', 'lifecycle_msgs.srv', 'numpy', 'rcl_interfaces.msg',
    'rcl_interfaces.srv', 'rosgraph_msgs.msg', 'rosidl_generator_py', 'service_msgs.msg',
    'std_msgs.msg', 'std_srvs.srv', 'type_description_interfaces.msg',
    'type_description_interfaces.srv', 'yaml')
_MIDDLEWARE = re.compile(r'/lib(rmw|fastrtps|rcl)')
_MOST_BYTES = 1 << 17
_PR_SET_CHILD_SUBREAPER = 36
_POLL_S = 0.005


def environment() -> dict[str, str]:
    """Return the variables with which other processes find this package."""
    source = str(Path(fret_monitor.__file__).parent.parent)
    paths = [source, *filter(None, [os.environ.get('PYTHONPATH')])]
    return {**os.environ, 'PYTHONPATH': os.pathsep.join(paths)}


class ForkedProcess:
    """A process as `subprocess.Popen` would return it, as far as the tests need that."""

    def __init__(self, module: str, arguments: Sequence[str], files: Mapping[int, int],
                 environment: Mapping[str, str] | None = None,
                 folder: Path | None = None) -> None:
        """Run `main` of a module; `files` has file descriptors of the caller by their new ones."""
        request = json.dumps((module, arguments, list(files), dict(environment or os.environ),
                              str(folder or Path.cwd())))
        server = _server()
        socket.send_fds(server, [request.encode()], list(files.values()))
        self.pid = int(server.recv(20))
        self.returncode: int | None = None

    def poll(self) -> int | None:
        """Return the exit status, None while it runs."""
        if self.returncode is None:
            ended, status = os.waitpid(self.pid, os.WNOHANG)
            self.returncode = os.waitstatus_to_exitcode(status) if ended else None
        return self.returncode

    def wait(self, timeout: float = float('inf')) -> int:
        """Wait until it ends; raise `TimeoutExpired` if it does not in time."""
        end = monotonic() + timeout
        while (status := self.poll()) is None:
            if monotonic() > end:
                raise subprocess.TimeoutExpired(str(self.pid), timeout)
            sleep(_POLL_S)
        return status

    def send_signal(self, number: int) -> None:
        """Send a signal, unless it has ended."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """Kill it."""
        self.send_signal(signal.SIGKILL)


class ForkedNode(ForkedProcess):
    """A node, as the executable of this name would start it."""

    def __init__(self, name: str, arguments: Sequence[str], output: int,
                 environment: Mapping[str, str] | None = None,
                 folder: Path | None = None) -> None:
        """Start it with these ROS arguments; it writes to the file descriptor `output`."""
        super().__init__(f'fret_monitor.ros.{name}', [name, '--ros-args', *arguments],
                         {1: output, 2: output}, environment, folder)


class ForkedScript(ForkedProcess):
    """A script of this folder that is driven by lines on standard input."""

    def __init__(self, name: str, *arguments: str,
                 environment: Mapping[str, str] | None = None) -> None:
        """Start it with these arguments."""
        reading, standard_input = os.pipe()
        standard_output, writing = os.pipe()
        self.stdin = os.fdopen(standard_input, 'w', encoding='utf-8')
        self.stdout = os.fdopen(standard_output, encoding='utf-8')
        super().__init__(name, [name, *arguments], {0: reading, 1: writing}, environment)
        os.close(reading)
        os.close(writing)

    def kill(self) -> None:
        """Kill it, wait for its end, and close the pipes."""
        super().kill()
        self.wait()
        with suppress(BrokenPipeError):  # something was left to be written
            self.stdin.close()
        self.stdout.close()


def run(program: str, *arguments: str,
        timeout: float) -> 'subprocess.CompletedProcess[str]':
    """Run a program as `python -c` does; return its exit status and what it has written."""
    with TemporaryFile('w+') as out, TemporaryFile('w+') as err:
        process = ForkedProcess('ros.program', [program, *arguments],
                                {1: out.fileno(), 2: err.fileno()})
        try:
            status = process.wait(timeout)
        finally:
            process.kill()
        for file in (out, err):
            file.seek(0)
        return subprocess.CompletedProcess((), status, out.read(), err.read())


_Popen = subprocess.Popen


def popen(command: Sequence[str], *, stdout: Any = None,
          env: Mapping[str, str] | None = None, **options: Any) -> Any:
    """Fork if the command starts a node of this package, otherwise call `subprocess.Popen`."""
    match = re.search(r'(?:fret_monitor/|fret_monitor\.ros\.)(monitor|gate|logger)\b',
                      ' '.join(map(str, command)))
    if match is None or '--ros-args' not in command:
        return _Popen(command, stdout=stdout, env=env, **options)
    arguments = command[command.index('--ros-args') + 1:]
    return ForkedNode(match[1], arguments, stdout.fileno(), env)


@cache
def _server() -> socket.socket:
    """Start the server of this process; return the connection to it."""
    # Nodes become children of this process when those that forked them end.
    libc: Any = ctypes.CDLL(None, use_errno=True)
    if libc.prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0) != 0:
        raise OSError(ctypes.get_errno(), 'prctl')
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with theirs:
        process = subprocess.Popen(
            [sys.executable, __file__, str(theirs.fileno())], pass_fds=[theirs.fileno()],
            stdin=subprocess.DEVNULL,
            # Threads of numpy's library would not survive a fork.
            env={**environment(), 'OPENBLAS_NUM_THREADS': '1'})

    def end() -> None:
        ours.close()
        process.wait()

    atexit.register(end)
    return ours


def _keep_code() -> None:
    """Read the code of modules that only a node can import, since they load the middleware."""
    kept = {}
    for package in ('fret_monitor.ros', 'rclpy'):
        spec = find_spec(package)
        assert spec is not None and spec.submodule_search_locations
        for path in map(str, Path(spec.submodule_search_locations[0]).rglob('*.py')):
            kept[path] = SourceFileLoader('', path).get_code('')
    read = SourceFileLoader.get_code

    def get_code(self: SourceFileLoader, name: str) -> CodeType | None:
        return kept.get(self.path) or read(self, name)

    SourceFileLoader.get_code = get_code  # type: ignore[assignment,method-assign]


def _serve(connection: socket.socket) -> None:
    """Fork for each request, until the connection is closed; run the node in the child."""
    sys.path.append(str(Path(__file__).parents[1]))  # of the scripts
    for name in _MODULES:
        import_module(name)
    _keep_code()
    import_module('fret_monitor.start')._package()  # each start of a node needs this hash
    assert not _MIDDLEWARE.search(Path('/proc/self/maps').read_text(encoding='utf-8'))
    # A collection in a node would visit all these objects, which copies the pages they are on.
    gc.collect()
    gc.freeze()
    while True:
        request, files, _, _ = socket.recv_fds(connection, _MOST_BYTES, 2)
        if not request:
            return
        reading, writing = os.pipe()
        between = os.fork()
        if between == 0:
            node = os.fork()
            if node == 0:
                connection.close()
                sys.exit(_run(files, *json.loads(request)))
            os.write(writing, str(node).encode())
            os._exit(0)
        os.waitpid(between, 0)
        connection.send(os.read(reading, 20))
        for descriptor in (reading, writing, *files):
            os.close(descriptor)


def _run(files: Sequence[int], module: str, arguments: list[str], targets: Sequence[int],
         environment: dict[str, str], folder: str) -> int:
    for source, target in zip(files, targets, strict=True):
        os.dup2(source, target)
    for source in {*files}:
        os.close(source)
    faulthandler.enable()
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    sys.argv = arguments
    status: int = import_module(module).main()
    return status


if __name__ == '__main__':
    _serve(socket.socket(fileno=int(sys.argv[1])))
