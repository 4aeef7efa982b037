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

"""Unpacks a ReqIF archive (`.reqifz`: ZIP), in memory and within limits."""

from pathlib import Path
import zipfile
import zlib

from fret_monitor.importing.archive import blocks_of, parts_of
from fret_monitor.importing.tables import decoded_bytes
from fret_monitor.model.diagnostics import refuse
from fret_monitor.model.names import shown

SUFFIX = '.reqifz'
_BROKEN = (zipfile.BadZipFile, zlib.error, RuntimeError, NotImplementedError, EOFError, OSError,
           ValueError)


def unpacked(path: Path, max_bytes: int) -> list[tuple[str, str]]:
    """
    Return the name and the text of each ReqIF file in an archive; other files in it are ignored.

    Raises
    ------
    CompileError
        if it is no archive, is encrypted, has no ReqIF file, or unpacks to more than `max_bytes`.
    """
    name = shown(str(path))
    try:
        with zipfile.ZipFile(path) as file:
            found = [(part.filename, decoded_bytes(b''.join(blocks_of(file, part)),
                                                   f'{name}, {shown(part.filename)}'))
                     for part in parts_of(file, name, max_bytes)
                     if part.filename.lower().endswith('.reqif')]
    except _BROKEN as error:
        refuse(f'{name} cannot be read as a ZIP archive: {" ".join(str(error).split())}')
    if not found:
        refuse(f'{name} has no file that ends in .reqif')
    return found
