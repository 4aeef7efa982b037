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
Find the bundle that a user names: the argument BUNDLE of a verb, or the parameter `spec`.

It is a path, `package://PKG/PATH` in the share folder of an installed package, or the name of a
file in this package's `config/`.
"""

from collections.abc import Iterable
import os
from pathlib import Path
import stat

from fret_monitor.model.diagnostics import close_matches, did_you_mean, refuse, suggestion
from fret_monitor.model.names import LONGEST_PATH, shown
from fret_monitor.model.packages import installed_packages, share_folders

BUNDLE_HELP = "a file, package://PKG/PATH, or the name of a file in this package's config folder"

_SCHEME = 'package://'
_OWN = 'fret_monitor'
_SHELL_PIPES = ('/dev/stdin', '/dev/null')
_MISSPELLED = 0.9  # similar packages are often two packages, of which one is not installed


def find_bundle(name: str) -> Path:
    """
    Return the file of a bundle; a path without a file is returned unchanged.

    Raises
    ------
    CompileError
        if there is no such package, the package has no such file, or the path leaves its folder.
    """
    if name.startswith(_SCHEME):
        return _in_package(name)
    path = Path(os.path.expanduser(name))
    if os.path.exists(path) or not _is_name(path):
        return path
    found = (folder / path for folder in config_folders())
    return next((item for item in found if os.path.isfile(item)), path)


def existing_bundle(name: str) -> Path:
    """Return the file of a bundle; raises `CompileError` if there is none."""
    path = find_bundle(name)
    refuse_missing(path)
    return path


def refuse_missing(path: Path) -> None:
    """
    Raise `CompileError` if there is no such file: where it was searched, and what is there.

    Raises it for a named pipe or a device too, as `refuse_irregular`.
    """
    try:
        path.stat()
    except (FileNotFoundError, NotADirectoryError):
        pass
    except (OSError, ValueError):
        return  # reading it gives the reason
    else:
        refuse_irregular(path)
        return
    folders = [path.parent, *(config_folders() if _is_name(path) else ())]
    place = '' if path.is_absolute() else ' in ' + ' nor in '.join(
        [_working_directory(), *map(str, folders[1:])])
    refuse(f'there is no file {shown(str(path), LONGEST_PATH)}{place}', help=_near(path, folders))


def refuse_irregular(path: Path) -> None:
    """
    Raise `CompileError` if there is a named pipe or a device: reading it could wait for ever.

    The pipes of the shell, `<(command)` and `/dev/stdin`, have no name, and a writer that is
    there. What does not exist, or cannot be reached, is left to whoever opens it.
    """
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError):
        return
    is_shell = str(path) in _SHELL_PIPES or os.path.realpath(path).startswith('/proc/')
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode) or is_shell):
        kind = 'named pipe' if stat.S_ISFIFO(mode) else 'device'
        refuse(f'{shown(str(path), LONGEST_PATH)} is a {kind}, not a file')


def _working_directory() -> str:
    try:
        return str(Path.cwd())
    except FileNotFoundError:
        return 'the current folder (it was deleted)'


def config_folders() -> list[Path]:
    """Return the folders of the bundles that come with this package."""
    return [folder / 'config' for folder in share_folders(_OWN) if (folder / 'config').is_dir()]


def _is_name(path: Path) -> bool:
    return len(path.parts) == 1


def _in_package(name: str) -> Path:
    package, _, inside = name.removeprefix(_SCHEME).partition('/')
    folders = list(share_folders(package))
    if not folders:
        refuse(f"{shown(name, LONGEST_PATH)}: the package '{package}' is not installed, or its "
               'workspace is not sourced',
               help=did_you_mean(package, installed_packages(), _MISSPELLED))
    if not inside:
        refuse(f'{shown(name, LONGEST_PATH)} names no file',
               help=f'write {_SCHEME}{package}/PATH')
    if os.path.isabs(inside) or '..' in Path(inside).parts:
        refuse(f"{shown(name, LONGEST_PATH)} is not in the share folder of '{package}'",
               help=f'write {_SCHEME}{package}/PATH with a path inside that folder, without ..; '
               'or name the file itself')
    for folder in folders:
        if os.path.exists(folder / inside):
            return folder / inside
    refuse(f"{shown(name, LONGEST_PATH)}: there is no file '{inside}' in {folders[0]}",
           help=_near(Path(inside), [(folder / inside).parent for folder in folders]))


def _near(path: Path, folders: Iterable[Path]) -> str:
    """Return a help text that names the bundles in the folders with the most similar names."""
    stems = {item.stem: item.name for folder in folders for item in _bundles(folder)}
    return suggestion(stems[stem] for stem in close_matches(path.stem, stems))


def _bundles(folder: Path) -> list[Path]:
    try:
        return [item for item in folder.iterdir() if item.suffix in ('.yaml', '.yml')]
    except (OSError, ValueError):
        return []  # only a hint
