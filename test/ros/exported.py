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

The hand-written C is compiled once in a run of tests, and each bundle's own C once.
"""

from collections.abc import Iterator, Mapping, Sequence
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
from fret_monitor.export.content import Options
from fret_monitor.export.folder import assemble
from fret_monitor.export.ros2 import (
    hand_written_sources, NODE_PACKAGES, ros2, ros2_of_several,
)
from fret_monitor.export.ros2_table import node_table, node_tables, packages_of
from fret_monitor.model.parts import NodePart, UNGATED
from fret_monitor.native import csrc_directory
from fret_monitor.native.ros_files import (
    linked, NODE_LIBRARIES, prefixes, rmw_library, searched,
)
import objects
from ros import forked
from ros.harness import ending_well, NodeProcess

ROOT = Path(__file__).resolve().parents[2]
NODES = ('rclpy', 'rcl')


@cache
def _folder() -> 'TemporaryDirectory[str]':
    return TemporaryDirectory(prefix='exported-')


def _command(flags: Sequence[str], folder: Path) -> list[str]:
    return [*objects.command(flags), f'-I{folder}', *searched()]


@cache
def hand_written() -> list[Path]:
    """Return the object files of all C that is the same for every bundle."""
    engine = objects.engine(SANITIZERS)
    node = sorted({path for room in ('reporting', 'node')
                   for path in (csrc_directory() / room).glob('*.c')} - {*engine})
    return [
        *(made for source, made in engine.items() if source.name in hand_written_sources()),
        *objects.compiled_once([*node, ROOT / 'bench' / 'ros' / 'no_python.c'],
                               [*objects.command(SANITIZERS), *searched()])]


_BUILT: dict[str, Path] = {}


def exported_bundle(bundle: Path, part: NodePart = UNGATED, *, margins: bool = False) -> Path:
    """Return the program of the node of a bundle; an error of memory, or a leak, ends it."""
    reading = build.read(bundle, part=part, takes_instances=True)
    generated = build.generate_monitor(build.with_margins(reading) if margins else reading)
    return _built({**generated.c_sources, **generated.c_headers,
                   'node_table.c': node_table(generated), 'node_tables.c': node_tables()},
                  packages_of(generated.manifest))


def exported_bundles(*bundles: Path) -> Path:
    """Return the program of the node of several bundles, as `exported_bundle`."""
    return _exported([(path, UNGATED, path.stem) for path in bundles])


def exported_gates(bundle: Path, *names: str) -> Path:
    """Return the program of the node of several gates of a bundle, as `exported_bundle`."""
    return _exported([(bundle, NodePart(name), name) for name in names])


def _exported(parts: Sequence[tuple[Path, NodePart, str]]) -> Path:
    monitors = [build.generate_monitor(build.with_name(
        build.read(path, part=part, takes_instances=True), f'b{number}_{name}'))
        for number, (path, part, name) in enumerate(parts)]
    made = ros2_of_several(monitors, Options(name='several')).generated
    names = {name: Path(name).name for name in made}
    return _built({names[name]: text for name, text in made.items()
                   if names[name] not in hand_written_sources()},
                  [name for item in monitors for name in packages_of(item.manifest)])


def _built(files: Mapping[str, str], more_packages: Sequence[str]) -> Path:
    key = hashlib.sha256(repr(sorted(files.items())).encode()).hexdigest()[:20]
    if key not in _BUILT:
        folder = Path(_folder().name) / key
        folder.mkdir(exist_ok=True)  # it is left behind by C that does not compile
        for name, text in files.items():
            (folder / name).write_text(text, encoding='utf-8')
        made = objects.compiled(sorted(folder.glob('*.c')), folder, _command(SANITIZERS, folder))
        packages = sorted({*NODE_PACKAGES, *more_packages})
        _BUILT[key] = _linked([*made, *hand_written()], packages, folder / 'node', SANITIZERS)
    return _BUILT[key]


def _linked(files: Sequence[Path], packages: Sequence[str], program: Path,
            flags: Sequence[str]) -> Path:
    return bench.ros.compiled(program, [
        *flags, *map(str, files),
        *linked([*NODE_LIBRARIES, rmw_library()], packages),
        '-lm', '-pthread'])


def exported_parts(bundle: Path, name: str) -> Path:
    """Return a program of `test/csrc` in place of main.c; the linker wraps what it replaces."""
    node = exported_bundle(bundle)
    flags = (*SANITIZERS, '-Wno-reserved-identifier')
    source = ROOT / 'test' / 'csrc' / f'{name}.c'
    wrapped = sorted(set(re.findall(r'__wrap_(\w+)\(', source.read_text(encoding='utf-8'))))
    folder = node.parent / 'parts'
    program, = objects.compiled([source], folder, _command(flags, folder))
    others = [*node.parent.glob('*.o'), *(
        item for item in hand_written() if item.stem != 'main')]
    return _linked([program, *others], sorted({*NODE_PACKAGES, 'sensor_msgs'}),
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
            environment: dict[str, str] | None = None) -> Iterator[NodeProcess]:
    """Start the node and wait until it is ready; it must end well if the test succeeds."""
    with ending_well(ExportedNode(program, *arguments, environment=environment)) as node:
        yield node


def start(node: str, bundle: Path, *arguments: str) -> NodeProcess:
    """Start a node of `NODES`, or that on rclpy with a value of `hot_path`, for a bundle."""
    if node == 'rcl':
        return ExportedNode(exported_bundle(bundle), *arguments)
    way = () if node == 'rclpy' else ('-p', f'hot_path:={node}')
    return NodeProcess('monitor', '-p', f'spec:={bundle}', *way, *arguments)


@contextmanager
def monitoring(node: str, bundle: Path, *arguments: str) -> Iterator[NodeProcess]:
    """Start as `start`, and wait until it is ready; it must end well if the test succeeds."""
    with ending_well(start(node, bundle, *arguments)) as process:
        yield process
