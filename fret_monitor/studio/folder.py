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

"""The bundles of one folder, as a page may see them: nothing outside, links included."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from difflib import SequenceMatcher
from hashlib import sha256
import os
from pathlib import Path
import re
import stat

from fret_monitor.editing import looks_like_a_bundle
from fret_monitor.model.diagnostics import CompileError, refuse, Source
from fret_monitor.model.output import open_output

MOST_BYTES = 2_000_000
MOST_RECORDING_BYTES = 2_000_000_000
_SUFFIXES = ('.yaml', '.yml')
_RECORDINGS = ('.mcap', '.db3', '.bag')
_METADATA = 'metadata.yaml'
_MOST_FILES = 500
_BYTE_ORDER_MARK = '\ufeff'
_LINE_END = re.compile(r'(\r\n|\r|\n)')


@dataclass(frozen=True)
class StoredFile:
    """A file of the folder; `stamp` changes with its content, `mark` stands before the text."""

    text: str
    stamp: str
    mark: str


@dataclass(frozen=True)
class Folder:
    """A folder whose bundles can be read and written; `root` has no links."""

    root: Path

    def names(self) -> list[str]:
        """Return the names of the files that are meant as bundles, without folders inside."""
        return sorted(self._bundles())[:_MOST_FILES]

    def _bundles(self) -> Iterator[str]:
        for entry in os.scandir(self.root):
            if not entry.name.endswith(_SUFFIXES):
                continue
            try:
                text = self.read(entry.name).text
            except ValueError:
                continue
            if looks_like_a_bundle(text):
                yield entry.name

    def path(self, name: str) -> Path:
        """
        Return the path of a bundle of this folder, which may not exist yet.

        Raises
        ------
        ValueError
            if the name leads out of the folder, or is not that of a bundle.
        """
        _check_name(name)
        if not name.endswith(_SUFFIXES):
            raise ValueError(f"'{name}' does not end with .yaml")
        path = self.root / name
        if path.resolve() != path:
            raise ValueError(f"'{name}' is a link")
        return path

    def recordings(self) -> list[str]:
        """Return the names of the recordings: files, and folders of rosbag2."""
        found = (entry.name for entry in os.scandir(self.root)
                 if not entry.is_symlink() and (
                     entry.name.endswith(_RECORDINGS) if entry.is_file()
                     else entry.is_dir() and Path(entry, _METADATA).is_file()))
        return sorted(found)[:_MOST_FILES]

    def recording(self, name: str) -> Path:
        """
        Return the path of a recording of this folder; nothing of it is a link.

        Raises
        ------
        ValueError
            if the name leads out of the folder, or the recording cannot be read in a page.
        """
        _check_name(name)
        path = self.root / name
        try:
            size = sum(map(_recorded_bytes, [path, *path.iterdir()] if path.is_dir() else [path]))
        except OSError as error:
            raise ValueError(f"cannot read '{name}': {error.strerror or error}") from None
        if size > MOST_RECORDING_BYTES:
            raise ValueError(f"'{name}' has more than {MOST_RECORDING_BYTES:,} bytes: use "
                             '`fret-monitor bag --report`')
        return path

    def read(self, name: str) -> StoredFile:
        """Return a file; raises `ValueError` with the reason."""
        path = self.path(name)
        try:
            return _stored(_bytes_of(path))
        except OSError as error:
            raise ValueError(f"cannot read '{name}': {error.strerror or error}") from None

    def write(self, name: str, text: str, stamp: str | None, like: str | None = None) -> str:
        """
        Replace a file, or make it if `stamp` is None, and return its new stamp.

        Lines end as those of the file `like` do, which the text was before it was changed, and
        a byte order mark of that file stays at the begin.

        Raises
        ------
        ValueError
            if the file is not the one of that stamp any more, or cannot be written.
        """
        path = self.path(name)
        present = self.stamp(name)
        if present != stamp or stamp is None and os.path.lexists(path):
            raise ValueError(f"'{name}' is there already" if stamp is None else
                             f"'{name}' has changed on disk since it was read")
        if like is not None:
            with suppress(ValueError):  # it is not there any more
                old = self.read(like)
                text = old.mark + ended_as(old.text, text)
        data = text.encode()
        if len(data) > MOST_BYTES:
            raise ValueError(f"'{name}' would have more than {MOST_BYTES:,} bytes")
        try:
            with open_output(path) as file:
                file.write(text)
                if present is not None:
                    os.fchmod(file.fileno(), stat.S_IMODE(path.stat().st_mode))
        except CompileError as error:
            raise ValueError(error.diagnostics[0].title) from None
        except OSError as error:
            raise ValueError(f"cannot write '{name}': {error.strerror or error}") from None
        return _stamp(data)

    def stamp(self, name: str) -> str | None:
        """Return the stamp of a file, None if there is none that can be read."""
        try:
            return self.read(name).stamp
        except ValueError:
            return None

    def read_source(self, path: Path) -> Source:
        """Read another file of a bundle, such as its signals; as `read_source`, but inside."""
        try:
            inside = path.resolve().relative_to(self.root)
        except ValueError:
            refuse(f"'{path}' is outside of the folder of this page")
        try:
            return Source(str(path), _stored(_bytes_of(self.root / inside)).text)
        except (OSError, ValueError) as error:
            reason = getattr(error, 'strerror', None) or error
            refuse(f"cannot read '{path}': {reason}")


def ended_as(old: str, text: str) -> str:
    """
    Return a text, of which lines end with a newline, with the line ends of an older one.

    Lines that were there keep theirs; others have that of the line before them.
    """
    parts, lines = _LINE_END.split(old), text.split('\n')
    ends = parts[1::2]
    if all(end == '\n' for end in ends):
        return text
    if len(set(ends)) == 1:
        return ends[0].join(lines)
    found, end = [''] * len(lines), ends[0]
    for tag, first, _, begin, stop in SequenceMatcher(
            None, parts[::2], lines).get_opcodes():
        for place in range(begin, stop):
            if tag == 'equal' and first + place - begin < len(ends):
                end = ends[first + place - begin]
            found[place] = end
    return ''.join(line + end for line, end in zip(lines, [*found[:-1], ''], strict=True))


def _check_name(name: str) -> None:
    """Refuse what is not the name of something in a folder."""
    if '/' in name or '\0' in name or name in ('', '.', '..'):
        raise ValueError(f"'{name}' is not the name of a file of this folder")


def _recorded_bytes(path: Path) -> int:
    """Return the size of a file of a recording, or of the folder itself."""
    state = path.lstat()
    if not (stat.S_ISREG(state.st_mode) or stat.S_ISDIR(state.st_mode)):
        raise ValueError(f"'{path.name}' is a link, or is not a file")
    return state.st_size


def _bytes_of(path: Path) -> bytes:
    """Return what is in a file; no link, no device, not more than fits."""
    # A pipe without a writer would hold the server for ever.
    descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    with open(descriptor, 'rb') as file:
        state = os.fstat(descriptor)
        if not stat.S_ISREG(state.st_mode):
            raise ValueError(f"'{path.name}' is not a file")
        data = file.read(MOST_BYTES + 1)
    if len(data) > MOST_BYTES:
        raise ValueError(f"'{path.name}' has more than {MOST_BYTES:,} bytes")
    return data


def _stored(data: bytes) -> StoredFile:
    try:
        whole = data.decode()
    except UnicodeDecodeError:
        raise ValueError('it is not UTF-8') from None
    text = whole.removeprefix(_BYTE_ORDER_MARK)
    return StoredFile(text, _stamp(data), whole[:len(whole) - len(text)])


def _stamp(data: bytes) -> str:
    return sha256(data).hexdigest()
