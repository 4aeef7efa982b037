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

"""Reads a UTF-8 text file of limited size; errors name the file."""

from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias

from fret_monitor.model.bundle_files import refuse_irregular
from fret_monitor.model.diagnostics import refuse, Source, Span
from fret_monitor.model.names import LONGEST_PATH, shown

MAX_BYTES = 16 * 2 ** 20
ReadFile: TypeAlias = Callable[[Path], Source]


def read_source(path: Path, max_bytes: int = MAX_BYTES) -> Source:
    """
    Read a text file of at most `max_bytes` in UTF-8, with or without a byte order mark.

    Raises
    ------
    CompileError
        if there is no such file, it is a named pipe or a device, or no such text.
    """
    refuse_irregular(path)
    try:
        with path.open('rb') as file:
            data = file.read(max_bytes + 1)
    except (OSError, ValueError) as error:
        refuse(_unreadable(path, error))
    if len(data) > max_bytes:
        refuse(f'{shown(str(path), LONGEST_PATH)} is larger than {max_bytes // 2 ** 20} MiB')
    return _decoded(path, data)


def _unreadable(path: Path, error: OSError | ValueError) -> str:
    name = shown(str(path), LONGEST_PATH)
    match error:
        case FileNotFoundError():
            return f'there is no file {name}'
        case IsADirectoryError():
            return f'{name} is a directory, not a file'
        case OSError():
            return f'{name} cannot be read: {error.strerror}'
        case _:
            return f'{name} is not the name of a file'


def _decoded(path: Path, data: bytes) -> Source:
    try:
        return Source(str(path), data.decode('utf-8').removeprefix('\ufeff'))
    except UnicodeDecodeError as error:
        good = data[:error.start].decode('utf-8')
        rest = data[error.start:].decode('utf-8', 'replace')
    is_wide = data.startswith((b'\xff\xfe', b'\xfe\xff'))
    source = Source(str(path), good + rest)
    refuse('the file is not in UTF-8', Span(source, len(good), len(good) + 1),
           'it is in UTF-16' if is_wide else 'this byte is not part of a UTF-8 character',
           'save it as UTF-8')
