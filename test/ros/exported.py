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
from glob import glob
import hashlib
import os
from pathlib import Path
import subprocess
import sys
from tempfile import TemporaryDirectory, TemporaryFile

from fret_monitor import build
from fret_monitor.build import GeneratedMonitor
from fret_monitor.export.ros2_table import node_table, packages_of
from fret_monitor.native import csrc_directory
from fret_monitor.native.cache import EVALUATOR_SOURCES
from fret_monitor.native.compiler import COMPILE_FLAGS, find_compiler
from ros import forked
from ros.harness import NodeProcess

ROOT = Path(__file__).resolve().parents[2]
_OF_NODE = ('diagnostic_msgs', 'lifecycle_msgs', 'rcl_interfaces', 'rosgraph_msgs', 'std_msgs',
            'std_srvs')
_LIBRARIES = ('rcl', 'rcl_lifecycle', 'rcl_yaml_param_parser', 'rcutils', 'rmw',
              'rosidl_runtime_c')
# The wheels have rmw_fastrtps_cpp in place of rmw_implementation, and a library in which two
# symbols of Python are not defined.
_FLAGS = (*(flag for flag in COMPILE_FLAGS if flag not in (
    '-O2', '-fPIC', '-fvisibility=hidden')), '-O1', '-Werror')


def prefixes() -> list[Path]:
    """Return the prefixes of ROS 2: the sourced installation first, then the wheels."""
    sourced = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    return [Path(name) for name in (*filter(None, sourced), sys.prefix)]


@cache
def _folder() -> 'TemporaryDirectory[str]':
    return TemporaryDirectory(prefix='exported-')


def _compiled(sources: Iterable[Path], folder: Path, flags: Sequence[str]) -> list[Path]:
    """Compile C files with all warnings as errors."""
    csrc = csrc_directory()
    searched = [f'-I{place}' for place in (csrc, csrc / 'ros', csrc / 'node', folder)]
    searched += [f'-isystem{place}' for prefix in prefixes()
                 for place in sorted(glob(f'{prefix}/include/*/'))]
    folder.mkdir(parents=True, exist_ok=True)

    def compiled(source: Path) -> Path:
        made = folder / f'{source.stem}.o'
        done = subprocess.run(
            [*find_compiler().command, *_FLAGS, *flags, *searched, '-c', source, '-o', made],
            capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return made

    with ThreadPoolExecutor(2) as pool:
        return list(pool.map(compiled, sources))


@cache
def hand_written(flags: tuple[str, ...]) -> list[Path]:
    """Return the object files of all C that is the same for every bundle."""
    csrc = csrc_directory()
    unused = {'records.c', 'thinning.c', 'ros/in_place.c'}
    sources = [*sorted(csrc.glob('node/*.c')),
               *(csrc / name for name in EVALUATOR_SOURCES if name not in unused),
               ROOT / 'bench' / 'ros' / 'no_python.c']
    folder = Path(_folder().name) / f'hand-{"".join(flags) or "plain"}'
    return _compiled(sources, folder, flags)


_BUILT: dict[str, Path] = {}


def exported_node(generated: GeneratedMonitor, flags: tuple[str, ...] = ()) -> Path:
    """Return the program of a bundle's node."""
    files = {**generated.module.files, 'node_table.c': node_table(generated, 'fret_monitor')}
    key = hashlib.sha256(repr((sorted(files.items()), flags)).encode()).hexdigest()[:20]
    if key not in _BUILT:
        folder = Path(_folder().name) / key
        folder.mkdir()
        for name, text in files.items():
            (folder / name).write_text(text, encoding='utf-8')
        objects = _compiled(sorted(folder.glob('*.c')), folder, flags)
        packages = sorted({*_OF_NODE, *packages_of(generated.manifest)})
        _BUILT[key] = _linked([*objects, *hand_written(flags)], packages, folder / 'node', flags)
    return _BUILT[key]


def _linked(objects: Sequence[Path], packages: Sequence[str], program: Path,
            flags: Sequence[str]) -> Path:
    places = [place for prefix in prefixes()
              for place in (f'{prefix}/lib', *sorted(glob(f'{prefix}/lib/python*/*/ros_*.libs')))
              if Path(place).is_dir()]
    has_choice = any(Path(place, 'librmw_implementation.so').is_file() for place in places)
    libraries = [*_LIBRARIES, 'rmw_implementation' if has_choice else 'rmw_fastrtps_cpp',
                 *(f'{package}__rosidl_{kind}_c' for package in packages
                   for kind in ('typesupport', 'generator'))]
    done = subprocess.run(
        [*find_compiler().command, *flags, *objects, '-o', program,
         *(f'-L{place}' for place in places), *(f'-Wl,-rpath,{place}' for place in places),
         # DT_RPATH, unlike DT_RUNPATH, is also used for the dependencies of libraries.
         '-rdynamic', '-Wl,--as-needed', '-Wl,--disable-new-dtags',
         '-Wl,--unresolved-symbols=ignore-in-shared-libs',
         *(f'-l{name}' for name in libraries), '-lm', '-pthread'],
        capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return program


def exported_bundle(bundle: Path, flags: tuple[str, ...] = ()) -> Path:
    """Return the program of the node of a bundle."""
    return exported_node(build.generate_monitor(build.read(bundle)), flags)


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
