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
The node of `export --to ros2` as a program in the cache, for `monitor` with `native:=true`.

What is the same for every bundle is compiled once, to two object files, one of which is that of
the evaluator's library; of several bundles of a node, each to one of its own.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from fret_monitor.build import GeneratedMonitor
from fret_monitor.export.content import csrc_files
from fret_monitor.export.ros2 import (
    hand_written_sources, NODE_PACKAGES, refuse_what_no_node_has,
)
from fret_monitor.export.ros2_table import (
    node_table, node_tables, OneOfSeveral, packages_of,
)
from fret_monitor.model.manifest import Manifest
from fret_monitor.native.cache import build_library, evaluator_object, EVALUATOR_SOURCES
from fret_monitor.native.compiler import LIBRARIES, Linking, OBJECT
from fret_monitor.native.errors import NativeError
from fret_monitor.native.ros_files import (
    has_headers, identity, linked, NODE_LIBRARIES, rmw_library, searched,
)

# The wheels' librcl names two variables of Python, which it never uses.
_NO_PYTHON = """\
#define VISIBLE __attribute__((visibility("default")))
extern VISIBLE void * PyExc_RuntimeError;
extern VISIBLE void * _Py_TrueStruct[8];
VISIBLE void * PyExc_RuntimeError;
VISIBLE void * _Py_TrueStruct[8];
"""


def node_program(generated: GeneratedMonitor, origin: str) -> Path:
    """
    Build the program of a bundle's node, or return it from the cache.

    `origin` is the bundle's file, for the log.

    Raises
    ------
    CompileError
        if an input that a requirement reads has no topic.
    NativeError
        if there are no headers of ROS or no C compiler, it fails, or the cache cannot be written.
    """
    refuse_what_no_node_has(generated)
    if not has_headers():
        raise NativeError('the headers of rcl are not installed here')
    return _linked({**generated.c_sources, 'node_table.c': node_table(generated, origin),
                    'node_tables.c': node_tables()}, [generated.manifest],
                   _same_for_all(), generated.c_headers)


def table_object(generated: GeneratedMonitor, origin: str, place: OneOfSeveral) -> Path:
    """
    Build the object file of one of the bundles of a node, or return it from the cache.

    Raises as `node_program`.
    """
    refuse_what_no_node_has(generated)
    if not has_headers():
        raise NativeError('the headers of rcl are not installed here')
    return build_library(
        {**generated.c_sources, 'node_table.c': node_table(generated, origin, place)},
        headers={**_headers(), **generated.c_headers}, name='bundle',
        identity=identity(), linking=_object())


def program_of_several(objects: Sequence[Path], manifests: Sequence[Manifest]) -> Path:
    """Link the objects of `table_object` to a program, or return it; raises `NativeError`."""
    return _linked({'node_tables.c': node_tables(len(objects))}, manifests,
                   [*_same_for_all(), *objects], {})


def _linked(sources: Mapping[str, str], manifests: Sequence[Manifest], objects: Sequence[Path],
            headers: Mapping[str, str]) -> Path:
    packages = sorted({*NODE_PACKAGES, *(
        name for manifest in manifests for name in packages_of(manifest))})
    return build_library(
        sources, headers={**_headers(), **headers}, name='monitor', identity=identity(),
        linking=Linking('{}', tuple(searched()), tuple(map(str, objects)), (
            *linked([*NODE_LIBRARIES, rmw_library()], packages), *LIBRARIES), is_kept=True))


def _headers() -> dict[str, str]:
    return {name: text for name, text in csrc_files(*hand_written_sources()).items()
            if name.endswith('.h')}


def _object() -> Linking:
    return replace(OBJECT, searched=tuple(searched()), is_kept=True)


def _same_for_all() -> list[Path]:
    files = csrc_files(*(name for name in hand_written_sources()
                         if name.endswith('.c') and name not in EVALUATOR_SOURCES))
    node = build_library({**files, 'no_python.c': _NO_PYTHON}, headers=_headers(), name='node',
                         identity=identity(), linking=_object())
    return [node, evaluator_object()]
