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

"""Packages of ROS: where they are looked for, their share folders, and how to install one."""

from collections.abc import Iterator
import os
from pathlib import Path
import sys

import fret_monitor
from fret_monitor.model.diagnostics import pip_install

_OWN = 'fret_monitor'

# The wheels of `ros-jazzy-common-interfaces`. Other messages may have no wheels.
_WHEELS = frozenset({
    'actionlib_msgs', 'diagnostic_msgs', 'geometry_msgs', 'nav_msgs', 'sensor_msgs', 'shape_msgs',
    'std_msgs', 'std_srvs', 'stereo_msgs', 'trajectory_msgs', 'visualization_msgs'})


def search_path() -> tuple[Path, ...]:
    """Return where packages are looked for: `AMENT_PREFIX_PATH`, then the Python environment."""
    prefixes = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    found = [Path(prefix) for prefix in [*prefixes, sys.prefix] if prefix]
    return tuple(dict.fromkeys(found))


def share_folders(package: str) -> Iterator[Path]:
    """Yield the share folders of a package; for this package its source tree comes first."""
    source = Path(fret_monitor.__file__).resolve().parents[1]
    if package == _OWN and (source / 'package.xml').is_file():
        yield source
    for prefix in search_path():
        share = prefix / 'share' / package
        if package not in ('', '.', '..') and share.is_dir():
            yield share


def installed_packages() -> set[str]:
    """Return the names of all packages that are found, and of this one."""
    found = (path.parent.name for prefix in search_path()
             for path in (prefix / 'share').glob('*/package.xml'))
    return {_OWN, *found}


def how_to_install(package: str) -> str:
    """Return what a user can do who needs a package: a command where there is one."""
    command = _command(package)
    return (f'install it ({command}), or source the workspace that has it' if command else
            'source the workspace that has it')


def _command(package: str) -> str:
    """
    Return what installs a package of ROS: pip if ROS itself came as wheels, else apt.

    It is empty if there may be no wheel of the package.
    """
    distribution = os.environ.get('ROS_DISTRO') or 'jazzy'
    name = f'ros-{distribution}-{package.replace("_", "-")}'
    has_wheels = (Path(sys.prefix) / 'share' / 'rclpy').is_dir()
    is_sourced = bool(os.environ.get('AMENT_PREFIX_PATH'))
    if is_sourced and not has_wheels:
        return f'sudo apt install {name}'
    return pip_install(name) if package in _WHEELS else ''
