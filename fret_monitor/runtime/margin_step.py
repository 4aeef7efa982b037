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
A function that takes a row and returns a margin, for loops in Python.

It is made of C (`python_step.c`) by Python's stable C interface, since a call through cffi takes
many times as long as the step.
"""

from collections.abc import Callable
import ctypes
from typing import Any, TypeAlias

from fret_monitor.model.policies import InputSource
from fret_monitor.native.binding import ffi
from fret_monitor.native.cache import build_library, csrc_file
from fret_monitor.native.compiler import Linking
from fret_monitor.native.monitor import CData, Monitor
from fret_monitor.runtime.evaluator import ALIGNMENT, NEVER

MarginStep: TypeAlias = Callable[..., float]
"""Takes a value of each input; under `timed` after the time (ns)."""

_LINKING = Linking('lib{}.so', flags=('-shared',), libraries=())
"""Python's functions are those of the process."""

_FAST_CALL = 0x80  # METH_FASTCALL: positional arguments, in an array


class _PythonMethod(ctypes.Structure):
    """Python's PyMethodDef."""

    _fields_ = (('name', ctypes.c_char_p), ('function', ctypes.c_void_p),
                ('flags', ctypes.c_int), ('text', ctypes.c_char_p))


class _PythonStep(ctypes.Structure):
    """`struct fm_python_step`."""

    _fields_ = (*((name, ctypes.c_void_p) for name in (
        'group', 'state', 'verdicts', 'margin', 'inputs', 'next', 'cells', 'types')),
        ('inputs_bytes', ctypes.c_uint64), ('n_values', ctypes.c_uint64),
        ('start', ctypes.c_int64), ('last', ctypes.c_int64), ('due', ctypes.c_int64),
        ('turn', ctypes.c_uint64))


def margin_step(monitor: Monitor, requirement: str) -> MarginStep:
    """
    Return a function that takes a row of a trace, and returns the margin of a requirement.

    Its arguments are a value of each input, in the order of the manifest; under `timed` after the
    time in nanoseconds, later than that of the row before. A text is its place in the `values` of
    the input, from 0. Every row is a step; nothing is counted
    or reported, and no input is ever silent. It returns NaN where the margin is not known. It
    holds Python's interpreter lock, and raises as `Evaluator.store`, ValueError for a time that is
    not later, and RuntimeError where code that converts a value has let another call begin; then
    no row was taken.

    Raises
    ------
    ValueError
        if there is no such requirement, it is of instances, the monitor has no margins, or inputs
        are not fields of messages.
    NativeError
        if the function cannot be built.
    """
    manifest, pointer = monitor.manifest, monitor.pointer
    ids = [item.id for item in manifest.requirements]
    if obstacle := _obstacle(monitor, requirement, ids):
        raise ValueError(f"there are no margins of '{requirement}': {obstacle}")
    others = [item.name for item in manifest.inputs if item.source is not InputSource.FIELD]
    if others:
        raise ValueError(f"'{others[0]}' has its values from the times of messages")
    number = ids.index(requirement)
    group: Any = ffi.addressof(pointer.groups, pointer.requirements[number].group)
    state, verdicts = (ffi.new('int64_t[]', size // 8 + 2) for size in (
        monitor.state_bytes, pointer.n_requirements + pointer.n_more_verdicts))
    inputs, row = (ffi.new('int64_t[]', pointer.inputs_bytes // 8 + 1) for _ in range(2))
    items = pointer.inputs[0:pointer.n_inputs]
    cells = ffi.new('void *[]', [*(ffi.cast('char *', row) + item.offset for item in items),
                                 ffi.NULL])
    types = ffi.new('uint8_t[]', [*(item.type for item in items), 0])
    margin = ffi.cast('char *', _aligned(state)) + monitor.margins.margins[number]
    group.reset(_aligned(state))
    blocks = group, _aligned(state), verdicts, margin, inputs, row, cells, types
    made = _PythonStep(*map(_address, blocks), pointer.inputs_bytes, len(items), 0, -1, NEVER)
    return _function(bytearray(made), (
        monitor, state, verdicts, inputs, row, cells, types))


def _obstacle(monitor: Monitor, requirement: str, ids: list[str]) -> str:
    """Return why a requirement has no margins here; '' if it has."""
    if requirement not in ids:
        is_keyed = any(item.id == requirement for item in monitor.manifest.numbered)
        return 'each key has its own' if is_keyed else f'the requirements are {", ".join(ids)}'
    return 'write start(BUNDLE, margins=True)' if monitor.margins == ffi.NULL else ''


def _aligned(block: CData) -> CData:
    address = _address(block)
    return ffi.cast('void *', address + -address % ALIGNMENT)


def _address(pointer: CData) -> int:
    return int(ffi.cast('uintptr_t', pointer))


def _function(step: bytearray, kept: object) -> MarginStep:
    text = csrc_file('python_step.c').read_text(encoding='utf-8')
    library = ctypes.CDLL(str(build_library(
        {'python_step.c': text}, name='fm_python_step', linking=_LINKING)))
    function = ctypes.cast(library.fm_python_step, ctypes.c_void_p).value
    method = _PythonMethod(b'step', function, _FAST_CALL, None)
    make = ctypes.pythonapi.PyCFunction_NewEx
    make.restype, make.argtypes = ctypes.py_object, (
        ctypes.c_void_p, ctypes.py_object, ctypes.c_void_p)
    found: Any = make(ctypes.addressof(method), (step, kept, method, library), None)
    return found  # type: ignore[no-any-return]
