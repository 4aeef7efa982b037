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

"""Write whole folders: a folder appears with all its files, or not at all."""

from collections.abc import Collection, Iterator
from contextlib import contextmanager
import ctypes
import os
from pathlib import Path
import shutil
import tempfile

from fret_monitor.model.diagnostics import refuse

_AT_FDCWD, _RENAME_EXCHANGE = -100, 2  # of Linux


def check_replaceable(directory: Path, former: Collection[Path] | None, maker: str) -> None:
    """
    Refuse to replace a folder that contains anything else than what `maker` wrote there.

    `former` are the paths within the folder that `maker` wrote, None if it did not write the
    folder. `maker` is the verb of the command line. An empty folder is replaced.

    Raises
    ------
    CompileError
        if `directory` is a file, the current folder, or holds other files.
    """
    place = Path(os.path.realpath(directory))
    with refusing(directory):
        if place.is_dir() and former is None and any(place.iterdir()):
            refuse(f"'{directory}' holds other files", help='name an empty folder, or a new one')
        for other in () if former is None else _others(place, former):
            refuse(f"'{directory}' holds '{other}', which `{maker}` did not write",
                   help='move it away, or name a new folder')
        if place.exists() and not place.is_dir():
            refuse(f"'{directory}' is a file", help='name a folder')
        if place == Path.cwd():
            refuse(f"'{directory}' is the current folder",
                   help='it would be replaced as a whole: name a new folder')


def _others(place: Path, former: Collection[Path]) -> Iterator[Path]:
    """Yield what is in a folder besides `former` and their parents."""
    known = {*former, *(parent for path in former for parent in path.parents)}
    yield from (found for found in sorted(path.relative_to(place) for path in place.rglob('*'))
                if found not in known)


@contextmanager
def replaced_folder(directory: Path) -> Iterator[Path]:
    """
    Yield an empty folder that takes the place of `directory` when the block ends.

    After an exception, `directory` is as it was. If it is a symbolic link, the folder it points to
    is replaced.

    Raises
    ------
    CompileError
        if the folder cannot be written.
    """
    place = Path(os.path.realpath(directory))
    with refusing(directory):
        place.parent.mkdir(parents=True, exist_ok=True)
        unfinished = Path(tempfile.mkdtemp(prefix='.fret_monitor-', dir=place.parent))
        try:
            unfinished.chmod(0o755)
            yield unfinished
            _put_in_place(unfinished, place)
        finally:
            shutil.rmtree(unfinished, ignore_errors=True)


@contextmanager
def refusing(directory: Path) -> Iterator[None]:
    """Turn an error of the file system into a `CompileError` that names a folder."""
    try:
        yield
    except FileExistsError as error:
        refuse(f"cannot write '{directory}': '{error.filename}' is a file")
    except OSError as error:
        refuse(f"cannot write '{directory}': {error.strerror or error}")


def _put_in_place(folder: Path, directory: Path) -> None:
    if not directory.exists():
        folder.rename(directory)
        return
    if _exchange(folder, directory):
        shutil.rmtree(folder, ignore_errors=True)
        return
    # A process that is killed between the two leaves the former folder under its other name.
    former = folder.with_name(folder.name + '-former')
    directory.rename(former)
    try:
        folder.rename(directory)
    except OSError:
        former.rename(directory)
        raise
    shutil.rmtree(former, ignore_errors=True)


def _exchange(one: Path, other: Path) -> bool:
    """Exchange the names of two folders at once; return False where the system cannot."""
    try:
        rename = ctypes.CDLL(None).renameat2
    except (AttributeError, OSError, TypeError):
        return False
    done: int = rename(_AT_FDCWD, os.fsencode(one), _AT_FDCWD, os.fsencode(other),
                       _RENAME_EXCHANGE)
    return done == 0
