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
The files that are open in an editor: their texts, as they are there, and their changes.

pygls keeps texts, too, but splits lines at characters at which editors do not.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

from fret_monitor.bundle.source_file import read_source
from fret_monitor.editing import EditorPosition, PositionMap
from fret_monitor.model.diagnostics import Source


@dataclass(frozen=True)
class OpenFile:
    """A file that is open: its name as the editor has it, its path, version and text."""

    uri: str
    path: Path
    version: int
    text: str


def path_of(uri: str) -> Path:
    """Return the path of a file; of what is no file, such as a new buffer, its name."""
    parts = urlsplit(uri)
    return Path(unquote(parts.path) if parts.scheme == 'file' else unquote(uri))


def changed(text: str, changes: Iterable[Any], encoding: str) -> str:
    """Return a text after changes of the protocol: of a range each, or of all of it."""
    for change in changes:
        place = getattr(change, 'range', None)
        if place is None:
            text = change.text
            continue
        lines = PositionMap(text, encoding)
        start, end = (lines.offset(EditorPosition(at.line, at.character))
                      for at in (place.start, place.end))
        text = text[:start] + change.text + text[max(start, end):]
    return text


@dataclass
class OpenFiles:
    """All files that are open; `generation` counts their changes."""

    by_uri: dict[str, OpenFile] = field(default_factory=dict)
    generation: int = 0

    def put(self, file: OpenFile) -> None:
        """Open a file, or replace its text."""
        self.by_uri[file.uri] = file
        self.generation += 1

    def close(self, uri: str) -> None:
        """Close a file: what is on disk counts again."""
        self.by_uri.pop(uri, None)
        self.generation += 1

    def uri(self, path: Path) -> str:
        """Return the name of a file as the editor has it, or would have it."""
        return next((item.uri for item in self.by_uri.values() if item.path == path),
                    path.absolute().as_uri())

    def reader(self) -> 'Snapshot':
        """Return what reads files as they are now: those that are open from the editor."""
        return Snapshot({item.path: item.text for item in self.by_uri.values()})


@dataclass(frozen=True)
class Snapshot:
    """Texts of open files at one time."""

    texts: dict[Path, str]

    def __call__(self, path: Path) -> Source:
        """Read a file, as `read_source`."""
        if path in self.texts:
            return Source(str(path), self.texts[path])
        return read_source(path)
