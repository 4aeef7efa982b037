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

"""Installed packages of ROS: where they are looked for, and their share folders."""

from collections.abc import Iterator
import os
from pathlib import Path
import sys

import fret_monitor

_OWN = 'fret_monitor'


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
        if package and share.is_dir():
            yield share


def installed_packages() -> set[str]:
    """Return the names of all packages that are found, and of this one."""
    found = (path.parent.name for prefix in search_path()
             for path in (prefix / 'share').glob('*/package.xml'))
    return {_OWN, *found}
