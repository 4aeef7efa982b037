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

"""Reads ZIP archives (workbooks, ReqIF) block by block: a small one takes little memory."""

from collections.abc import Iterator
import zipfile

from fret_monitor.model.diagnostics import refuse

_MOST_PARTS = 10_000
_BLOCK = 2 ** 20
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)


def parts_of(file: zipfile.ZipFile, name: str, max_bytes: int) -> list[zipfile.ZipInfo]:
    """
    Return the parts of an archive; `name` is that of its file, in quotes.

    Raises
    ------
    CompileError
        if it says that it unpacks to more than `max_bytes`, has very many parts, or packs them in
        a way that cannot be unpacked block by block.
    """
    parts = file.infolist()
    if len(parts) > _MOST_PARTS or sum(part.file_size for part in parts) > max_bytes:
        refuse(f'{name} unpacks to more than {max_bytes // 2 ** 20} MiB, or has more than '
               f'{_MOST_PARTS:,} files')
    if any(part.compress_type not in _METHODS for part in parts):
        refuse(f'{name} is packed in an unusual way', help='pack it with deflate')
    return parts


def blocks_of(file: zipfile.ZipFile, part: zipfile.ZipInfo) -> Iterator[bytes]:
    """
    Yield the content of a part, a block at a time.

    One that unpacks to more than it says is cut off there, and raises `BadZipFile`.
    """
    with file.open(part) as content:
        while block := content.read(_BLOCK):
            yield block
