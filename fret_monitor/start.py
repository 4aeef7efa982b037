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
Build a bundle, or find again what it was built to, without reading or generating anything.

What a bundle becomes is decided by its files, the message definitions its inputs come from, the
overrides, the compiler, and this package itself. A note in the folder of built libraries says
what all of these were; it is used only if every one is as it was, and the library is whole.
"""

from collections.abc import Iterator
from fractions import Fraction
from hashlib import sha256
import json
import os
from pathlib import Path
import tempfile
from typing import Any, TYPE_CHECKING

from fret_monitor.messages.definitions import find_message
from fret_monitor.model.diagnostics import CompileError
from fret_monitor.model.manifest import Manifest, ManifestError
from fret_monitor.model.policies import Policy
from fret_monitor.native.cache import (
    cache_directory, csrc_directory, forget, is_kept, is_ours, note_use,
)
from fret_monitor.native.compiler import find_compiler
from fret_monitor.native.errors import NativeError
from fret_monitor.native.monitor import CompiledMonitor

if TYPE_CHECKING:
    from fret_monitor.build import Reading

_NOTES = 'bundles'
_MOST_NOTES = 1000  # beyond which the longest unused go


def start(path: Path, *, policy: Policy | None = None,
          period: Fraction | None = None) -> CompiledMonitor:
    """
    Return a bundle compiled; `policy` and `period` (seconds) stand in for the bundle's.

    Raises
    ------
    CompileError
        with all that is wrong with the bundle.
    NativeError
        if there is no C compiler, it fails, or the cache is not safe to use.
    """
    note = _note(path, policy, period)
    found = _recall(note, path) if note else None
    return found or _build(path, policy, period, note)


def manifest_of(path: Path, *, policy: Policy | None = None,
                period: Fraction | None = None) -> Manifest:
    """
    Return what is known of a bundle, as `start` would; nothing is compiled, nor a compiler needed.

    Raises
    ------
    CompileError
        with all that is wrong with the bundle.
    """
    try:
        note = _note(path, policy, period)
        found = _recall(note, path) if note else None
    except NativeError:
        found = None  # without a compiler no note can be found; it only saves time
    if found:
        return found.manifest
    from fret_monitor.build import generate_monitor, read
    return generate_monitor(read(path, policy=policy, period=period)).manifest


def _build(path: Path, policy: Policy | None, period: Fraction | None,
           note: Path | None) -> CompiledMonitor:
    # Imported here: parsers and generator cost more than all else at a start that needs none.
    from fret_monitor.build import compile_monitor, generate_monitor, read
    reading = read(path, policy=policy, period=period)
    compiled = compile_monitor(generate_monitor(reading))
    if note:
        _remember(note, compiled, reading)
    return compiled


def _note(path: Path, policy: Policy | None, period: Fraction | None) -> Path | None:
    """Return where the note on a bundle is; None if the bundle cannot even be read."""
    try:
        text = path.read_bytes()
    except OSError:
        return None
    parts = [os.fsencode(Path.cwd() / path), os.fsencode(path), text, repr(policy).encode(),
             repr(period).encode(), find_compiler().identity.encode(), *_package()]
    return cache_directory() / _NOTES / f'{_hash(b"".join(map(_framed, parts)))}.json'


def _package() -> Iterator[bytes]:
    """Yield what tells this version of the package from any other."""
    package = Path(__file__).parent
    for folder in (package, csrc_directory()):
        for file in sorted(folder.rglob('*')):
            if file.suffix in ('.py', '.lark', '.c', '.h'):
                yield os.fsencode(file)
                yield file.read_bytes()


def _framed(part: bytes) -> bytes:
    return b'%d:%b' % (len(part), part)


def _hash(data: bytes) -> str:
    return sha256(data).hexdigest()


# -- recalling ------------------------------------------------------------------------------------


def _recall(note: Path, path: Path) -> CompiledMonitor | None:
    """Return what a note tells of, if all of it still holds; a damaged note is none."""
    try:
        if not is_ours(note.parent) or not is_ours(note):
            return None  # whoever can write it says what topics to listen to
        content = json.loads(note.read_text(encoding='utf-8'))
        manifest = Manifest.from_json(content['manifest'])
        library = Path(content['library'])
        warnings = tuple(str(item) for item in list(content['warnings']))
        holds = is_kept(library) and _are_same(path, content['files']) \
            and content['messages'] == _messages(manifest)
        if not holds:
            return None
        note_use(note)
        sources = tuple(Path(name) for name, _ in content['files'])
        return CompiledMonitor(manifest, library, warnings, sources)
    except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError,
            ManifestError, CompileError):
        return None


def _are_same(path: Path, files: Any) -> bool:
    """Whether the files of a bundle say what was read of them when it was built."""
    return str(Path.cwd() / path) == files[0][0] \
        and all(_read(Path(name)) == digest for name, digest in files)


def _read(file: Path) -> str:
    """Return the hash of what a reader of bundles sees in a file."""
    return _hash(file.read_bytes().removeprefix(b'\xef\xbb\xbf'))


def _messages(manifest: Manifest) -> dict[str, str]:
    """Return, by name, what tells the messages that a bundle reads from others."""
    types = {item.message_type for item in manifest.inputs if item.message_type is not None}
    return {name: find_message(name).fingerprint for name in types}


# -- remembering ----------------------------------------------------------------------------------


def _remember(note: Path, compiled: CompiledMonitor, reading: 'Reading') -> None:
    """Write a note, as a whole; without one the next start takes longer, and that is all."""
    try:
        if not is_kept(compiled.library):
            return
        content = json.dumps({
            'manifest': compiled.manifest.to_json(),
            'library': str(compiled.library),
            'warnings': list(compiled.warnings),
            # Of what was read then: what the files say by now may not be what was built.
            'files': [[str(Path.cwd() / file), digest] for file, digest in reading.files],
            'messages': dict(reading.messages),
        })
        note.parent.mkdir(mode=0o700, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=note.parent)
        with open(handle, 'w', encoding='utf-8') as written:
            written.write(content)
        os.replace(name, note)
        forget({file: file.stat().st_mtime for file in note.parent.iterdir()}, _MOST_NOTES)
    except OSError:
        pass
