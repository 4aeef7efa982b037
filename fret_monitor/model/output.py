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

"""Write text files atomically, never over a file that the command reads or through a link."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
import os
from pathlib import Path
from secrets import token_hex
import sys
from typing import TextIO

from fret_monitor.model.diagnostics import refuse

_STREAMS = {'/dev/stdout': 1, '/dev/stderr': 2}


def refuse_overwriting(path: Path, read: Iterable[Path] = ()) -> None:
    """
    Refuse to write to a file that was read, also if its path differs, or through a link.

    In a folder like `/tmp` somebody else may have made the link. Links to folders, pipes and
    devices are allowed.

    Raises
    ------
    CompileError
        if `path` is one of the files in `read`, or a link to a file or to nothing.
    """
    for source in read:
        if _is_same_file(path, source):
            name = '' if path == source else f" as '{source}'"
            refuse(f"cannot write '{path}': this command reads it{name}",
                   help='name another file to write')
    if path.is_symlink() and _is_file_or_missing(path) and str(path) not in _STREAMS:
        refuse(f"cannot write '{path}': it is a link to '{path.readlink()}'",
               help='remove the link, or name that file itself')


def refuse_existing(path: Path, *, force: bool) -> None:
    """
    Refuse to write where something is: without `force` anything, with it what is no file.

    A pipe could wait for ever for its reader. Standard output and error are no files that could
    be lost.

    Raises
    ------
    CompileError
        as said; a path that cannot be reached is left to whoever writes there.
    """
    try:
        if str(path) in _STREAMS or not path.exists():
            return
        is_file = path.is_file()
    except (OSError, ValueError):
        return
    if not is_file:
        refuse(f"cannot write '{path}': it is no file", help='name another file to write')
    if not force:
        refuse(f"'{path}' exists", help='--force overwrites it')


def _is_file_or_missing(path: Path) -> bool:
    try:
        return path.is_file() or not path.exists()
    except OSError:
        return True  # such as a link to itself


def _is_same_file(one: Path, other: Path) -> bool:
    try:
        return one.is_file() and one.samefile(other)
    except OSError:
        return False  # one of them does not exist, or cannot be reached


@contextmanager
def open_output(path: Path, read: Iterable[Path] = ()) -> Iterator[TextIO]:
    """
    Yield a text file that is renamed to `path` when the block ends without an exception.

    A pipe, a device, standard output and standard error are written directly.

    Raises
    ------
    CompileError
        as `refuse_overwriting`, or if `path` cannot be written.
    """
    refuse_overwriting(path, read)
    try:
        if str(path) in _STREAMS:
            with open(os.dup(_STREAMS[str(path)]), 'w', encoding='utf-8') as file:
                yield file
        elif path.exists() and not path.is_file():
            with path.open('w', encoding='utf-8') as file:
                yield file
        else:
            yield from _replace(path)
    except BrokenPipeError:
        raise  # the reader of a pipe has gone; not a problem with the path
    except OSError as error:
        refuse(f"cannot write '{path}': {error.strerror or error}")


def _replace(path: Path) -> Iterator[TextIO]:
    """Yield a new file in the same folder, then rename it to `path`."""
    temporary = path.with_name(f'.fret_monitor-{token_hex(8)}')
    try:
        with temporary.open('x', encoding='utf-8') as file:
            yield file
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def drop_output() -> None:
    """Discard buffered output, so that flushing it at exit does not fail again."""
    with open(os.devnull, 'w', encoding='utf-8') as nowhere:
        os.dup2(nowhere.fileno(), sys.stdout.fileno())
