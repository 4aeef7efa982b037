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
The stack use and call graph of C functions, as reported by the compiler.

gcc 10 and later write a call graph with the frame size of every function
(`-fcallgraph-info=su`); other compilers have no such option. A frame includes the return address.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
import re
import subprocess
import tempfile

from fret_monitor.native.cache import csrc_file, runtime_headers
from fret_monitor.native.compiler import COMPILE_FLAGS, Compiler, find_compiler, TIMEOUT

INDIRECT = '__indirect_call'

_NODE = re.compile(r'node: \{ title: "([^"]*)" label: "((?:[^"\\]|\\.)*)"')
_EDGE = re.compile(r'edge: \{ sourcename: "([^"]*)" targetname: "([^"]*)"')
_FRAME = re.compile(r'(\d+) bytes \((.*?)\)')
_EVALUATOR = (
    'evaluator.c', 'deadlines.c', 'measures.c', 'steps.c', 'due.c', 'tables.c', 'instance.c')
_EVALUATOR_HEADERS = (
    'evaluator.h', 'measures.h', 'steps.h', 'due.h', 'tables.h', 'instance.h')


class StackError(Exception):
    """The stack has no bound: there is recursion, or a frame whose size is not fixed."""


@dataclass(frozen=True)
class CallGraph:
    """
    The functions of some C files: the bytes of their frames, and the functions they call.

    A called function without a frame is defined elsewhere; `INDIRECT` is a call through a pointer.
    The name of a static function begins with that of its file.
    """

    frames: Mapping[str, int]
    calls: Mapping[str, frozenset[str]]

    @property
    def external(self) -> frozenset[str]:
        """The called functions that are not defined here, except calls through pointers."""
        called = {name for names in self.calls.values() for name in names}
        return frozenset(called - self.frames.keys() - {INDIRECT})

    def depth(self, entry: str, indirect: int = 0) -> int:
        """
        Return the most bytes of stack that a call of `entry` takes, its own frame included.

        A function that is not defined here counts as 0 bytes, a call through a pointer as
        `indirect` bytes.

        Raises
        ------
        StackError
            if a function may call itself.
        """
        return self._depth(entry, indirect, ())

    def _depth(self, name: str, indirect: int, path: tuple[str, ...]) -> int:
        if name in path:
            raise StackError(f'{" calls ".join((*path, name))}')
        if name not in self.frames:
            return indirect if name == INDIRECT else 0
        below = (self._depth(called, indirect, (*path, name))
                 for called in self.calls.get(name, ()))
        return self.frames[name] + max(below, default=0)


@dataclass(frozen=True)
class WorstStack:
    """
    The most bytes of stack that a step takes, in the monitors' code and in the evaluator's.

    `library` names the functions of the C library that are called; their stack is not included.
    """

    monitor: int
    evaluator: int
    library: tuple[str, ...]


def worst_stack(sources: Mapping[str, str]) -> WorstStack | None:
    """
    Return the most stack that a step takes; None if the compiler cannot report it (only gcc can).

    `sources` are the texts of the generated C by file name. Errors are those of `find_compiler`
    and `call_graph`.
    """
    files = {**runtime_headers(), **sources}
    for name in (*_EVALUATOR, *_EVALUATOR_HEADERS):
        files[name] = csrc_file(name).read_text(encoding='utf-8')
    compiler = find_compiler()
    monitor = call_graph(compiler, files, [name for name in sources if name.endswith('.c')])
    evaluator = call_graph(compiler, files, _EVALUATOR)
    if monitor is None or evaluator is None:
        return None
    below = max(map(monitor.depth, monitor.frames))
    total = max(evaluator.depth(name, below) for name in evaluator.frames)
    functions = (monitor.external | evaluator.external) - monitor.frames.keys()
    return WorstStack(below, total - below, tuple(sorted(functions)))


def call_graph(compiler: Compiler, files: Mapping[str, str],
               sources: Iterable[str]) -> CallGraph | None:
    """
    Compile C files as `compile_library` does, and return their call graph.

    `files` are the texts of sources and headers by file name. None: the compiler cannot report it.

    Raises
    ------
    StackError
        if a frame has no fixed size.
    """
    with tempfile.TemporaryDirectory(prefix='fret_monitor-') as name:
        folder = Path(name)
        for file, text in files.items():
            (folder / file).write_text(text, encoding='utf-8')
        graphs = []
        for source in sources:
            done = subprocess.run(
                [*compiler.command, *COMPILE_FLAGS, '-fcallgraph-info=su', '-c', source,
                 '-o', f'{source}.o'], cwd=folder, capture_output=True, stdin=subprocess.DEVNULL,
                timeout=TIMEOUT, check=False)
            graph = next(folder.glob(f'{source.removesuffix(".c")}*.ci'), None)
            if done.returncode or graph is None:
                return None
            graphs.append(graph.read_text(encoding='utf-8', errors='replace'))
            graph.unlink()
    return parse('\n'.join(graphs))


def parse(text: str) -> CallGraph:
    """Read call graphs as gcc writes them; errors as `call_graph`."""
    frames: dict[str, int] = {}
    calls: dict[str, set[str]] = {}
    for title, label in _NODE.findall(text):
        frame = _FRAME.search(label)
        if frame is None:
            continue
        if frame[2] not in ('static', 'dynamic,bounded'):
            raise StackError(f'the frame of {title} has no fixed size')
        frames[title] = int(frame[1])
    for source, target in _EDGE.findall(text):
        calls.setdefault(source, set()).add(target)
    return CallGraph(frames, {name: frozenset(called) for name, called in calls.items()})
