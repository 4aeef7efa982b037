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
The node that `export --to ros2` writes, built here by `cc` against the wheels or an installation.

The hand-written C is compiled once in a process of tests, and each bundle's own C once.
"""

from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
import hashlib
from importlib.util import find_spec
import os
from pathlib import Path
import re
import shutil
import subprocess
import sys
from tempfile import TemporaryDirectory, TemporaryFile

import bench.ros
from differential.compiled import SANITIZERS
from fret_monitor import build
from fret_monitor.build import GeneratedMonitor
from fret_monitor.export.content import Options
from fret_monitor.export.folder import assemble
from fret_monitor.export.ros2 import NODE_PACKAGES, ros2
from fret_monitor.export.ros2_table import node_table, packages_of
from fret_monitor.model.parts import NodePart, UNGATED
from fret_monitor.native import csrc_directory, csrc_file, csrc_includes
from fret_monitor.native.cache import EVALUATOR_SOURCES
from fret_monitor.native.compiler import COMPILE_FLAGS, find_compiler
from fret_monitor.native.ros_files import (
    linked, NODE_LIBRARIES, prefixes, rmw_library, searched,
)
from ros import forked
from ros.harness import NodeProcess

ROOT = Path(__file__).resolve().parents[2]
_FLAGS = (*(flag for flag in COMPILE_FLAGS if flag not in (
    '-O2', '-fPIC', '-fvisibility=hidden')), '-O1', '-Werror')


@cache
def _folder() -> 'TemporaryDirectory[str]':
    return TemporaryDirectory(prefix='exported-')


def _compiled(sources: Iterable[Path], folder: Path, flags: Sequence[str]) -> list[Path]:
    """Compile C files with all warnings as errors."""
    includes = [*csrc_includes(), f'-I{folder}']
    folder.mkdir(parents=True, exist_ok=True)

    def compiled(source: Path) -> Path:
        made = folder / f'{source.stem}.o'
        done = subprocess.run(
            [*find_compiler().command, *_FLAGS, *flags, *includes, *searched(),
             '-c', source, '-o', made],
            capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return made

    with ThreadPoolExecutor(2) as pool:
        return list(pool.map(compiled, sources))


@cache
def hand_written(flags: tuple[str, ...]) -> list[Path]:
    """Return the object files of all C that is the same for every bundle."""
    unused = {'csv.c', 'records.c', 'thinning.c'}
    rooms = [csrc_directory() / room for room in ('reporting', 'node')]
    sources = [*sorted({*(path for room in rooms for path in room.glob('*.c')),
                        *(csrc_file(name) for name in EVALUATOR_SOURCES if name not in unused)}),
               ROOT / 'bench' / 'ros' / 'no_python.c']
    folder = Path(_folder().name) / f'hand-{"".join(flags) or "plain"}'
    return _compiled(sources, folder, flags)


_BUILT: dict[str, Path] = {}


def exported_node(generated: GeneratedMonitor, flags: tuple[str, ...] = ()) -> Path:
    """Return the program of a bundle's node."""
    files = {**generated.module.files, 'node_table.c': node_table(generated)}
    key = hashlib.sha256(repr((sorted(files.items()), flags)).encode()).hexdigest()[:20]
    if key not in _BUILT:
        folder = Path(_folder().name) / key
        folder.mkdir(exist_ok=True)  # it is left behind by C that does not compile
        for name, text in files.items():
            (folder / name).write_text(text, encoding='utf-8')
        objects = _compiled(sorted(folder.glob('*.c')), folder, flags)
        packages = sorted({*NODE_PACKAGES, *packages_of(generated.manifest)})
        _BUILT[key] = _linked([*objects, *hand_written(flags)], packages, folder / 'node', flags)
    return _BUILT[key]


def _linked(objects: Sequence[Path], packages: Sequence[str], program: Path,
            flags: Sequence[str]) -> Path:
    return bench.ros.compiled(program, [
        *flags, *map(str, objects),
        *linked([*NODE_LIBRARIES, rmw_library()], packages),
        '-lm', '-pthread'])


def exported_bundle(bundle: Path, flags: tuple[str, ...] = SANITIZERS,
                    part: NodePart = UNGATED) -> Path:
    """Return the program of the node of a bundle; an error of memory, or a leak, ends it."""
    return exported_node(build.generate_monitor(build.read(bundle, part=part)), flags)


def exported_parts(bundle: Path, name: str) -> Path:
    """Return a program of `test/csrc` in place of main.c; the linker wraps what it replaces."""
    node = exported_bundle(bundle)
    flags = (*SANITIZERS, '-Wno-reserved-identifier')
    source = ROOT / 'test' / 'csrc' / f'{name}.c'
    wrapped = sorted(set(re.findall(r'__wrap_(\w+)\(', source.read_text(encoding='utf-8'))))
    program, = _compiled([source], node.parent / 'parts', flags)
    objects = [*node.parent.glob('*.o'), *(
        item for item in hand_written(SANITIZERS) if item.stem != 'main')]
    return _linked([program, *objects], sorted({*NODE_PACKAGES, 'sensor_msgs'}),
                   node.parent / name,
                   (*SANITIZERS, *(f'-Wl,--wrap={function}' for function in wrapped)))


# The targets of the wheels name paths of the machine that made them.
_DROP_MISSING = """
function(drop_missing)
  get_property(targets DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR} PROPERTY IMPORTED_TARGETS)
  foreach(target IN LISTS targets)
    foreach(property INTERFACE_INCLUDE_DIRECTORIES INTERFACE_LINK_LIBRARIES)
      get_target_property(found ${target} ${property})
      set(kept)
      foreach(item IN LISTS found)
        if(NOT IS_ABSOLUTE "${item}" OR EXISTS "${item}")
          list(APPEND kept "${item}")
        endif()
      endforeach()
      if(found)
        set_target_properties(${target} PROPERTIES ${property} "${kept}")
      endif()
    endforeach()
  endforeach()
endfunction()
cmake_language(DEFER CALL drop_missing)
"""


def has_ament_cmake() -> bool:
    """Return whether CMake and ament_cmake are installed, with what they need of Python."""
    return shutil.which('cmake') is not None and any(
        (prefix / 'share' / 'ament_cmake').is_dir() for prefix in prefixes()) and all(
        find_spec(name) is not None for name in ('ament_package', 'catkin_pkg'))


def cmake_build(bundle: Path, folder: Path) -> Path:
    """Export a bundle, build the package with CMake, install it, and return its program."""
    generated = build.generate_monitor(build.read(bundle, part=UNGATED))
    files = assemble('ros2', generated, Options(), ros2(generated, Options()))
    for name, text in files.items():
        (folder / 'package' / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / 'package' / name).write_text(text, encoding='utf-8')
    (folder / 'drop.cmake').write_text(_DROP_MISSING, encoding='utf-8')
    no_python = folder / 'no_python.o'
    bench.ros.compiled(no_python, ['-c', str(ROOT / 'bench' / 'ros' / 'no_python.c')])
    places = [str(prefix) for prefix in prefixes()]
    for command in (
            ('cmake', '-S', folder / 'package', '-B', folder / 'build',
             f'-DCMAKE_PREFIX_PATH={";".join(places)}', f'-DPython3_EXECUTABLE={sys.executable}',
             f'-DCMAKE_PROJECT_INCLUDE={folder / "drop.cmake"}',
             f'-DCMAKE_EXE_LINKER_FLAGS={no_python} {" ".join(linked((), ()))}'),
            ('cmake', '--build', folder / 'build', '--parallel', '2'),
            ('cmake', '--install', folder / 'build', '--prefix', folder / 'installed')):
        done = subprocess.run(
            [*map(str, command)], capture_output=True, text=True, check=False,
            env={**os.environ, 'AMENT_PREFIX_PATH': os.pathsep.join(places)})
        assert done.returncode == 0, f'{done.stdout}\n{done.stderr}'
    return next((folder / 'installed' / 'lib').glob('*/monitor'))


class ExportedNode(NodeProcess):
    """The node as a process."""

    def __init__(self, program: Path, *arguments: str,
                 environment: dict[str, str] | None = None) -> None:
        """Start it with these ROS arguments; the caller sets ROS_DOMAIN_ID and the like."""
        self.name = 'exported'
        self._file = TemporaryFile()  # noqa: SIM115  closed by `kill`
        self.process = subprocess.Popen(
            [program, '--ros-args', *arguments], stdin=subprocess.DEVNULL, stdout=self._file,
            stderr=subprocess.STDOUT, env={**forked.environment(), **(environment or {})})


@contextmanager
def running(program: Path, *arguments: str,
            environment: dict[str, str] | None = None) -> Iterator[ExportedNode]:
    """Start the node and wait until it is ready; it must end well if the test succeeds."""
    node = ExportedNode(program, *arguments, environment=environment)
    try:
        node.wait_for('watching')
        yield node
        if node.process.poll() is None:
            assert node.end() == 0, node.output
    finally:
        node.kill()
