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
Compile specifications with any C compiler and flags, and run them over traces.

The loop over the steps is C (`run.c` beside this file), so that traces can be long. It uses only
`csrc/generated/fret_monitor.h`; the evaluator and `native` are tested elsewhere.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
import ctypes
from functools import cache
from importlib.util import find_spec
from pathlib import Path
import shutil
import subprocess
import tempfile
from typing import Any

from fret_monitor.codegen.module import CModule, generate
from fret_monitor.logic.evaluate import evaluate_all
from fret_monitor.logic.specification import Property, Signal, Specification
from fret_monitor.model.values import ValueType
from fret_monitor.native import cache as library_cache
from fret_monitor.native import compiler as library_compiler
from fret_monitor.native.compiled import CompiledMonitor
from fret_monitor.program.layout import lay_out
from fret_monitor.program.lower import lower
import pytest
from strategies import Trace

HERE = Path(__file__).resolve().parent
CSRC = HERE.parent.parent / 'csrc' / 'generated'
# As the monitors are built; no contraction, so that a * b + c rounds twice everywhere.
FLAGS = ('-std=c99', '-O1', '-fPIC', '-fvisibility=hidden', '-ffp-contract=off')
WARNINGS = ('-Wall', '-Wextra', '-Wpedantic', '-Wconversion', '-Wshadow', '-Wswitch-enum',
            '-Werror')
# Of code that is not optimised: it compiles in a sixth of the time, and nothing is optimised away.
SANITIZERS = ('-fsanitize=address,undefined', '-fno-sanitize-recover=all', '-g1', '-O0')

_ZIGLANG = find_spec('ziglang')
# The program itself: `python -m ziglang` would start an interpreter for each file.
ZIG = str(Path(_ZIGLANG.origin).with_name('zig')) if _ZIGLANG and _ZIGLANG.origin else 'zig'

_C_TYPES: dict[ValueType, Any] = {
    ValueType.BOOL: ctypes.c_bool,
    ValueType.INT8: ctypes.c_int8,
    ValueType.INT16: ctypes.c_int16,
    ValueType.INT32: ctypes.c_int32,
    ValueType.INT64: ctypes.c_int64,
    ValueType.UINT8: ctypes.c_uint8,
    ValueType.UINT16: ctypes.c_uint16,
    ValueType.UINT32: ctypes.c_uint32,
    ValueType.UINT64: ctypes.c_uint64,
    ValueType.FLOAT32: ctypes.c_float,
    ValueType.FLOAT64: ctypes.c_double,
}


@cache
def gcc() -> tuple[str, ...] | None:
    """Return the command of gcc, None where there is none."""
    found = shutil.which('gcc') or shutil.which('cc')
    return (found,) if found else None


@cache
def clang() -> tuple[str, ...] | None:
    """Return the command of clang, installed or inside ziglang; None where there is none."""
    found = shutil.which('clang')
    if found:
        return (found,)
    return ('sh', str(HERE / 'zig_clang.sh'), ZIG) if shutil.which(ZIG) else None


@cache
def clang_check() -> tuple[str, ...] | None:
    """Return the command with which clang only warns, of many files at once; None without it."""
    found = shutil.which('clang')
    if found:
        return (found, '-fsyntax-only')
    if shutil.which(ZIG) is None:
        return None
    return (ZIG, 'clang', '-fsyntax-only', f'-isystem{Path(ZIG).with_name("lib") / "include"}')


@contextmanager
def unoptimised() -> Iterator[None]:
    """Let `native` compile monitors without optimisation, and refuse warnings."""
    flags = (*library_compiler.COMPILE_FLAGS, '-O0', '-Werror')
    evaluator, build = library_cache.evaluator_library(), library_cache.build_library

    def build_others(sources: Mapping[str, str], *, name: str, **more: Any) -> Path:
        return evaluator if name == 'fm_evaluator' else build(sources, name=name, **more)

    with pytest.MonkeyPatch.context() as patch:
        for module in (library_cache, library_compiler):
            patch.setattr(module, 'COMPILE_FLAGS', flags)
        patch.setattr(library_cache, 'build_library', build_others)
        yield


def c_module(specification: Specification) -> CModule:
    """Write the C of a specification."""
    program = lower(specification)
    return generate(program, tuple(lay_out(group) for group in program.groups))


def write_module(module: CModule, folder: Path) -> list[Path]:
    """Write the header and the sources to a folder; return the paths of the sources."""
    for name, text in (module.header, *module.sources):
        (folder / name).write_text(text, encoding='utf-8')
    return [folder / name for name, _ in module.sources]


def compile_c(command: Sequence[str | Path]) -> None:
    """Run a compiler; a failure shows its output."""
    result = subprocess.run([str(word) for word in command], capture_output=True, text=True,
                            check=False)
    assert result.returncode == 0, f'{command}\n{result.stderr[-4000:]}'
    assert result.stderr == ''


@cache
def driver(name: str) -> Any:
    """Return the library of one of the C files beside this one."""
    chosen = gcc() or clang()
    assert chosen is not None
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / 'driver.so'
        compile_c([*chosen, *FLAGS, '-shared', f'-I{CSRC}', HERE / name, '-o', library])
        return ctypes.CDLL(str(library))


def load(specification: Specification, *, compiler: Sequence[str] | None = None,
         flags: Sequence[str] = FLAGS) -> Any:
    """Compile a specification; return its `fm_monitor`."""
    module = c_module(specification)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        library = folder / 'monitor.so'
        sources = write_module(module, folder)
        chosen = compiler or gcc() or clang()
        assert chosen is not None
        compile_c([*chosen, *flags, '-shared', f'-I{CSRC}', f'-I{folder}', *sources, '-lm',
                   '-o', library])
        return _monitor_in(library, module.symbol)


def _monitor_in(library: Path, symbol: str) -> Any:
    entry = ctypes.CDLL(str(library))[symbol]
    entry.restype = ctypes.c_void_p
    return entry()


def reference(properties: Sequence[Property], trace: Trace) -> list[list[bool]]:
    """Return the verdicts of the reference; it evaluates what requirements share once."""
    found: dict[int, list[bool]] = {}
    for feedback in dict.fromkeys(item.feedback for item in properties):
        alike = [number for number, item in enumerate(properties) if item.feedback == feedback]
        columns = evaluate_all([properties[number].formula for number in alike], trace, feedback)
        for number, column in zip(alike, columns, strict=True):
            found[number] = [value is True for value in column]
    return [found[number] for number in range(len(properties))]


def c_columns(signals: Sequence[Signal], trace: Mapping[str, Sequence[Any]],
              steps: int) -> list[Any]:
    """Return an array in C for each input; zeros for one that the trace does not have."""
    return [(_C_TYPES[item.type] * steps)(*trace.get(item.name, ())) for item in signals]


class Compiled:
    """A specification compiled and loaded; one state, at its start."""

    def __init__(self, specification: Specification, *, compiler: Sequence[str] | None = None,
                 flags: Sequence[str] = FLAGS, built: CompiledMonitor | None = None) -> None:
        """Load what `native` has built, or else compile with `compiler`, by default gcc."""
        self._signals = specification.signals
        self._count = len(specification.properties)
        self._monitor = _monitor_in(built.library, built.manifest.symbol) if built \
            else load(specification, compiler=compiler, flags=flags)
        self._run = driver('run.c').differential_run
        self._run.argtypes = (ctypes.c_void_p, ctypes.c_void_p, ctypes.c_uint64,
                              ctypes.c_void_p, ctypes.c_void_p)
        self._run.restype = ctypes.c_bool

    def run(self, trace: Trace, resets: Sequence[int] = ()) -> list[list[bool]]:
        """Return the verdicts of each requirement over a trace; reset before each of `resets`."""
        steps = len(next(iter(trace.values())))
        columns = c_columns(self._signals, trace, steps)
        pointers = (ctypes.c_void_p * len(columns))(*map(ctypes.addressof, columns))
        afresh = (ctypes.c_bool * steps)()
        for t in resets:
            afresh[t] = True
        out = (ctypes.c_bool * (steps * self._count))()
        assert self._run(self._monitor, pointers, steps, afresh, out)
        return [list(out[number::self._count]) for number in range(self._count)]
