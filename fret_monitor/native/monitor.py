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
Load a compiled bundle: open its library and compare it with its manifest.

With the wrong library, a violation of one requirement could be announced as that of another.
Loading therefore compares the interface number, the hash of the sources, the names and types of
the inputs, the ids of the requirements, and the groups.
"""

from collections.abc import Iterator
from dataclasses import dataclass
import os
from pathlib import Path
from typing import Any, TypeAlias

from fret_monitor.model.manifest import Manifest
from fret_monitor.model.values import ValueType
from fret_monitor.native.binding import ffi
from fret_monitor.native.elf import is_cut_short
from fret_monitor.native.errors import LibraryError

CData: TypeAlias = Any  # objects of cffi have C types, which Python's type checker cannot see

_FLAGS = ffi.RTLD_NOW | ffi.RTLD_LOCAL
_C_LIBRARY: Any = ffi.dlopen(None)
# Looked up at import: cffi looks a function up at its first use, which would clear the error that
# dlerror is to return.
_dlopen, _dlsym, _dlclose, _dlerror = (
    _C_LIBRARY.dlopen, _C_LIBRARY.dlsym, _C_LIBRARY.dlclose, _C_LIBRARY.dlerror)


class Library:
    """A shared library, open while this object lives. Its symbols are local to it."""

    def __init__(self, path: Path, *, origin: Path | None = None) -> None:
        """
        Open it; errors name `origin` if `path` is a copy of it.

        Raises
        ------
        LibraryError
            if it is missing, or is not a library for this machine.
        """
        self.path = origin or path
        if is_cut_short(path):
            raise LibraryError(f'cannot load {self.path}: the file is cut short')
        # dlopen searches other folders for a name without a slash.
        handle = _dlopen(os.fsencode(os.path.abspath(path)), _FLAGS)
        if handle == ffi.NULL:
            raise LibraryError(f'cannot load {self.path}: {_reason()}')
        self._handle = ffi.gc(handle, _dlclose)

    def find(self, symbol: str) -> CData:
        """Return the address of an exported name; raises `LibraryError` if there is none."""
        address = _dlsym(self._handle, symbol.encode())
        if address == ffi.NULL:
            raise LibraryError(f"{self.path} does not export '{symbol}'")
        return address


def _reason() -> str:
    message = _dlerror()
    return 'unknown error' if message == ffi.NULL else _text(message)


def _text(characters: CData) -> str:
    found = ffi.string(characters)
    return found if isinstance(found, str) else found.decode(errors='replace')


@dataclass(frozen=True, eq=False)
class Monitor:
    """
    A loaded bundle. `pointer` is its `const struct fm_monitor *`.

    `readers` is its `const struct fm_readers *`, None if it has no topics. Both are constant: any
    number of evaluators, in any threads, may use them. The library stays open while this object or
    an evaluator made from it lives. `kinds` are those of the manifest. `tests` is its
    `const struct fm_tests *`, and `margins` its `const struct fm_margins *`, or NULL.
    """

    manifest: Manifest
    library: Library
    pointer: CData
    readers: CData | None = None
    kinds: tuple['MonitorKind', ...] = ()
    tests: CData = ffi.NULL
    margins: CData = ffi.NULL

    @property
    def state_bytes(self) -> int:
        """The size of the struct of state."""
        return int(self.pointer.state_bytes)


@dataclass(frozen=True, eq=False)
class MonitorKind:
    """The monitor of a kind of instances, and its `const struct fm_outputs *` or NULL."""

    monitor: Monitor
    outputs: CData


def load(library: Path, manifest: Manifest, *, origin: Path | None = None) -> Monitor:
    """
    Load the compiled bundle that a manifest describes.

    Parameters
    ----------
    library
        the shared library of the generated C.
    manifest
        the manifest that was written with it; `manifest.symbol` is the exported function.
    origin
        the file that `library` is a copy of, named in errors.

    Raises
    ------
    LibraryError
        if the library cannot be loaded, or does not match the manifest.
    """
    return _monitor(Library(library, origin=origin), manifest)


def _monitor(opened: Library, manifest: Manifest) -> Monitor:
    enter = ffi.cast('const struct fm_monitor * (*)(void)', opened.find(manifest.symbol))
    kinds = tuple(MonitorKind(_monitor(opened, kind.manifest), _outputs(opened, kind.manifest))
                  for kind in manifest.kinds)
    monitor = Monitor(manifest, opened, enter(), _readers(opened, manifest), kinds,
                      _tests(opened, manifest), _margins(opened, manifest))
    for difference in _differences(monitor):
        raise LibraryError(
            f'{opened.path} does not fit its manifest ({difference}): compile the bundle again')
    return monitor


def _outputs(opened: Library, manifest: Manifest) -> CData:
    if not manifest.outputs:
        return ffi.NULL
    return ffi.cast('const struct fm_outputs * (*)(void)', opened.find(manifest.outputs))()


def _tests(opened: Library, manifest: Manifest) -> CData:
    if not manifest.tests:
        return ffi.NULL
    return ffi.cast('const struct fm_tests * (*)(void)', opened.find(manifest.tests))()


def _margins(opened: Library, manifest: Manifest) -> CData:
    if not manifest.margins:
        return ffi.NULL
    return ffi.cast('const struct fm_margins * (*)(void)', opened.find(manifest.margins))()


def _readers(opened: Library, manifest: Manifest) -> CData | None:
    if not manifest.readers:
        return None
    return ffi.cast('const struct fm_readers * (*)(void)', opened.find(manifest.readers))()


def load_evaluator(library: Path, *, origin: Path | None = None) -> CData:
    """
    Load the evaluator's library; the result has its functions as attributes.

    Errors name `origin` if `library` is a copy of it.

    Raises
    ------
    LibraryError
        if it cannot be loaded, or is not an evaluator of this version.
    """
    opened = Library(library, origin=origin)
    try:
        number = ffi.cast('uint32_t (*)(void)', opened.find('fm_engine_abi'))
    except LibraryError:
        raise LibraryError(f'{opened.path} was compiled by an earlier version of fret_monitor: '
                           'compile the bundle again') from None
    if (found := number()) != (wanted := ffi.integer_const('FM_ENGINE_ABI')):
        raise LibraryError(f"the engine in '{opened.path}' has interface {found}, this version "
                           f'has {wanted}: compile the bundle again')
    # Never unloaded: at exit a thread of the middleware may still run its code.
    return ffi.dlopen(os.path.abspath(library), _FLAGS | ffi.RTLD_NODELETE)


def _differences(monitor: Monitor) -> Iterator[str]:
    """Yield the differences; each check relies on those before it."""
    pointer, manifest = monitor.pointer, monitor.manifest
    if pointer == ffi.NULL:
        yield 'it describes no monitor'
    elif pointer.abi != ffi.integer_const('FM_ABI'):
        yield (f'it was compiled for interface {pointer.abi}, '
               f'this version has {ffi.integer_const("FM_ABI")}')
    elif (found := _text(pointer.source_hash)) != manifest.source_hash:
        yield (f'it was made of other sources, {found[:12] or "unknown"} '
               f'instead of {manifest.source_hash[:12] or "unknown"}')
    else:
        yield from _input_differences(pointer, manifest)
        yield from _requirement_differences(pointer, manifest)
        yield from _group_differences(pointer, manifest)
        if monitor.readers is not None:
            yield from _reader_differences(monitor.readers, manifest)


def _input_differences(pointer: CData, manifest: Manifest) -> Iterator[str]:
    if pointer.n_inputs != len(manifest.inputs):
        yield f'it has {pointer.n_inputs} inputs instead of {len(manifest.inputs)}'
        return
    for index, expected in enumerate(manifest.inputs):
        found = pointer.inputs[index]
        if (name := _text(found.name)) != expected.name:
            yield f"input {index} is '{name}' instead of '{expected.name}'"
        if found.type != type_number(expected.value_type):
            yield f"input '{expected.name}' is not of type {expected.value_type.value}"


def _requirement_differences(pointer: CData, manifest: Manifest) -> Iterator[str]:
    if pointer.n_requirements != len(manifest.requirements):
        yield (f'it has {pointer.n_requirements} requirements '
               f'instead of {len(manifest.requirements)}')
        return
    for index, expected in enumerate(manifest.requirements):
        found = pointer.requirements[index]
        if (name := _text(found.id)) != expected.id:
            yield f"requirement {index} is '{name}' instead of '{expected.id}'"
        if found.group != expected.group:
            yield f"requirement '{expected.id}' is in another group"


def _group_differences(pointer: CData, manifest: Manifest) -> Iterator[str]:
    if pointer.n_groups != len(manifest.groups):
        yield f'it has {pointer.n_groups} groups instead of {len(manifest.groups)}'
        return
    for index, expected in enumerate(manifest.groups):
        found = pointer.groups[index]
        if _indices(found.inputs, found.n_inputs) != expected.inputs:
            yield f'group {index} reads other inputs'
        if _indices(found.requirements, found.n_requirements) != expected.requirements:
            yield f'group {index} holds other requirements'


def _reader_differences(readers: CData, manifest: Manifest) -> Iterator[str]:
    if readers == ffi.NULL:
        yield 'it has no readers of messages'
    elif readers.abi != ffi.integer_const('FM_ABI'):
        yield f'its readers of messages were compiled for interface {readers.abi}'
    elif readers.n_topics != len(manifest.topics):
        yield f'it reads {readers.n_topics} topics instead of {len(manifest.topics)}'
    else:
        for index, topic in enumerate(manifest.topics):
            if (found := readers.topics[index].n_inputs) != len(topic.inputs):
                yield f"of the topic '{topic.name}' it reads {found} inputs " \
                      f'instead of {len(topic.inputs)}'


def _indices(pointer: CData, count: int) -> tuple[int, ...]:
    return tuple(pointer[0:count]) if count else ()


def type_number(value_type: ValueType) -> int:
    """Return the `enum fm_type` of a type."""
    return ffi.integer_const(f'FM_{value_type.name}')
