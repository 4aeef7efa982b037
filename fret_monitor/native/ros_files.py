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

"""Where the headers and libraries of ROS 2 are, for a C compiler: an installation, or wheels."""

from collections.abc import Iterator, Sequence
from glob import glob
import os
from pathlib import Path
import sys

NODE_LIBRARIES = ('rcl', 'rcl_lifecycle', 'rcl_yaml_param_parser', 'rcutils', 'rmw',
                  'rosidl_runtime_c')
"""The libraries of a node in C, besides those of messages and of the middleware."""

_HEADER = 'include/rcl/rcl/rcl.h'


def prefixes() -> list[Path]:
    """Return the prefixes of ROS 2: the sourced installation first, then the wheels."""
    sourced = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    return [Path(name) for name in (*filter(None, sourced), sys.prefix)]


def has_headers() -> bool:
    """Return whether the headers of rcl are installed."""
    return any((prefix / _HEADER).is_file() for prefix in prefixes())


def searched() -> list[str]:
    """Return the arguments by which a C compiler finds the headers of ROS."""
    return [f'-isystem{place}' for prefix in prefixes()
            for place in sorted(glob(f'{prefix}/include/*/'))]


def linked(libraries: Sequence[str], packages: Sequence[str]) -> list[str]:
    """Return the arguments to link libraries of ROS, and the messages of packages."""
    places = [place for prefix in prefixes()
              for place in (f'{prefix}/lib', *sorted(glob(f'{prefix}/lib/python*/*/ros_*.libs')))
              if Path(place).is_dir()]
    return [
        *(f'-L{place}' for place in places),
        # DT_RPATH, unlike DT_RUNPATH, is also used for the dependencies of libraries.
        '-rdynamic', '-Wl,--as-needed', '-Wl,--disable-new-dtags',
        '-Wl,--unresolved-symbols=ignore-in-shared-libs',
        *(f'-Wl,-rpath,{place}' for place in places), *(f'-l{name}' for name in libraries),
        *(f'-l{package}__rosidl_{kind}_c' for package in packages
          for kind in ('typesupport', 'generator'))]


def rmw_library() -> str:
    """Return the library with the functions of rmw: the wheels have no rmw_implementation."""
    has_choice = any((prefix / 'lib' / 'librmw_implementation.so').is_file()
                     for prefix in prefixes())
    return 'rmw_implementation' if has_choice else \
        os.environ.get('RMW_IMPLEMENTATION') or 'rmw_fastrtps_cpp'


def identity() -> str:
    """Return a text that changes when the libraries of ROS that a node is linked to change."""
    return '\n'.join(_identities())


def _identities() -> Iterator[str]:
    yield rmw_library()
    for prefix in prefixes():
        for name in (*NODE_LIBRARIES, rmw_library()):
            try:
                status = (prefix / 'lib' / f'lib{name}.so').stat()
            except OSError:
                continue
            yield f'{prefix} {name} {status.st_size} {status.st_mtime_ns}'
