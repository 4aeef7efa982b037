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
Find the bundle that the parameter `spec` names.

`spec` is a path, `package://PKG/PATH` in the share folder of an installed package, or the name of
a file in this package's `config/`.
"""

from collections.abc import Iterator
import os
from pathlib import Path
import sys

import fret_monitor

_SCHEME = 'package://'
_OWN = 'fret_monitor'


def find_bundle(spec: str) -> Path:
    """
    Return the file that `spec` names.

    A path without a file is returned unchanged.

    Raises
    ------
    FileNotFoundError
        if there is no such package, or the package has no such file; the message says which.
    """
    if spec.startswith(_SCHEME):
        return _in_package(spec)
    path = Path(spec).expanduser()
    if path.exists() or not _is_name(path):
        return path
    return next((folder / path for folder in config_folders() if (folder / path).is_file()), path)


def where_searched(path: Path) -> str:
    """Return the folders that `find_bundle` searched for a relative path, for an error message."""
    folders = [Path.cwd(), *(config_folders() if _is_name(path) else ())]
    return ' nor in '.join(map(str, folders))


def config_folders() -> list[Path]:
    """Return the folders of the bundles that come with this package."""
    return [folder / 'config' for folder in _shares(_OWN) if (folder / 'config').is_dir()]


def _is_name(path: Path) -> bool:
    return len(path.parts) == 1


def _in_package(spec: str) -> Path:
    package, _, inside = spec.removeprefix(_SCHEME).partition('/')
    folders = list(_shares(package))
    if not folders:
        raise FileNotFoundError(f"'{spec}': the package '{package}' is not installed, or its "
                                'workspace is not sourced')
    for folder in folders:
        if inside and (folder / inside).exists():
            return folder / inside
    raise FileNotFoundError(f"'{spec}': there is no file '{inside}' in {folders[0]}")


def _shares(package: str) -> Iterator[Path]:
    """Yield the share folders of a package; for this package its source tree comes first."""
    source = Path(fret_monitor.__file__).resolve().parents[1]
    if package == _OWN and (source / 'package.xml').is_file():
        yield source
    prefixes = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    for prefix in filter(None, [*prefixes, sys.prefix]):
        share = Path(prefix) / 'share' / package
        if package and share.is_dir():
            yield share
