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
Build a bundle, or reuse an earlier build without loading parser and code generator.

The result depends on the bundle's files, the definitions of its messages, the overrides, the
compiler, and this package. A note in the cache records all of them; it is used only if none has
changed and the library is intact.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from hashlib import sha256
import json
import os
from pathlib import Path
from typing import Any, TYPE_CHECKING

from fret_monitor.messages.installed import find_message, fingerprint
from fret_monitor.model.diagnostics import CompileError, Diagnostic, Level, Source, Span, Text
from fret_monitor.model.manifest import Manifest, ManifestError
from fret_monitor.model.parts import NodePart
from fret_monitor.model.policies import Policy
from fret_monitor.native.cache import (
    cache_directory, csrc_directory, evaluator_library, forget, is_kept, is_ours, note_use,
    refuse_foreign,
)
from fret_monitor.native.compiled import CompiledMonitor
from fret_monitor.native.compiler import find_compiler
from fret_monitor.native.errors import NativeError

if TYPE_CHECKING:
    from fret_monitor.build import GeneratedMonitor, Reading
    from fret_monitor.elaboration.signals import FindMessage

_NOTES = 'bundles'
_MOST_NOTES = 1000  # beyond this the least recently used are removed


@dataclass(frozen=True)
class Variant:
    """
    What is compiled in place of a bundle's own requirements.

    `make` makes it of what was read, and of a function that finds message types; the cache knows
    it by its `name`.
    """

    name: str
    make: Callable[['Reading', 'FindMessage'], 'Reading']


def start(path: Path, *, policy: Policy | None = None, period: Fraction | None = None,
          constants: Mapping[str, Text] | None = None,
          part: NodePart | None = None, takes_instances: bool = False,
          margins: bool = False, variant: Variant | None = None) -> CompiledMonitor:
    """
    Return a compiled bundle, or a part of one, with the library of the evaluator.

    `policy`, `period` (seconds) and `constants` override the bundle's; `takes_instances` is as in
    `build.read`. With `margins`, its steps compute margins too. With a `variant`, that is
    compiled.

    Raises
    ------
    CompileError
        with all problems of the bundle.
    NativeError
        if there is no C compiler, it fails, or the cache is not safe to use.
    """
    return _start(path, _Overrides(policy, period, constants or {}, part,
                                   takes_instances=takes_instances, margins=margins,
                                   variant=variant))


def start_program(path: Path, make: Callable[['GeneratedMonitor'], Path], identity: str, *,
                  policy: Policy | None = None, period: Fraction | None = None,
                  constants: Mapping[str, Text] | None = None,
                  part: NodePart | None = None, name: str | None = None,
                  margins: bool = False) -> CompiledMonitor:
    """
    Do as `start`, with a file of the cache that `make` builds in place of the library.

    `identity` is a text that changes with what `make` depends on besides. `name`: what all names
    in C begin with, unless the bundle's own. `margins` as of `start`.
    """
    overrides = _Overrides(policy, period, constants or {}, part, f'program {identity}',
                           takes_instances=True, name=name, margins=margins)
    return _start(path, overrides, make)


def manifest_of(path: Path, *, policy: Policy | None = None, period: Fraction | None = None,
                constants: Mapping[str, Text] | None = None,
                part: NodePart | None = None, margins: bool = False,
                variant: Variant | None = None) -> Manifest:
    """
    Return the manifest of a bundle or a part of one, as `start` would; needs no compiler.

    Raises
    ------
    CompileError
        with all problems of the bundle.
    """
    overrides = _Overrides(policy, period, constants or {}, part, takes_instances=True,
                           margins=margins, variant=variant)
    try:
        note = _note(path, overrides)
        found = _recall(note, path) if note else None
    except NativeError:
        found = None  # without a compiler there is no note: its name depends on it
    if found:
        return found.manifest
    from fret_monitor.build import generate_monitor
    return generate_monitor(overrides.read(path)).manifest


def _start(path: Path, overrides: '_Overrides',
           make: Callable[['GeneratedMonitor'], Path] | None = None) -> CompiledMonitor:
    note = _note(path, overrides)
    found = _recall(note, path) if note else None
    return found or _build(path, overrides, note, make)


@dataclass(frozen=True)
class _Overrides:
    policy: Policy | None
    period: Fraction | None
    constants: Mapping[str, Text]
    part: NodePart | None
    program: str = ''
    takes_instances: bool = False
    name: str | None = None
    margins: bool = False
    variant: Variant | None = None

    def read(self, path: Path) -> 'Reading':
        from fret_monitor.build import read, with_margins, with_name
        reading = read(path, policy=self.policy, period=self.period, constants=self.constants,
                       part=self.part, takes_instances=self.takes_instances)
        if self.margins:
            reading = with_margins(reading)
        if self.variant is not None:
            reading = self.variant.make(reading, find_message)
        return reading if self.name is None else with_name(reading, self.name)

    def texts(self) -> Iterator[str]:
        """Yield all that distinguishes these overrides from others."""
        yield from (repr(self.policy), repr(self.period), repr(self.part), self.program,
                    repr(self.takes_instances), repr(self.name), repr(self.margins),
                    repr(self.variant and self.variant.name))
        for name, text in sorted(self.constants.items()):
            yield from (name, text.source.name, text.value)


def _build(path: Path, overrides: _Overrides, note: Path | None,
           make: Callable[['GeneratedMonitor'], Path] | None) -> CompiledMonitor:
    # Imported here: loading parsers and generator takes longer than a start from a note.
    from fret_monitor.build import compile_monitor, generate_monitor
    reading = overrides.read(path)
    generated = generate_monitor(reading)
    compiled = CompiledMonitor(
        generated.manifest, make(generated), generated.warnings, generated.sources,
    ) if make else replace(compile_monitor(generated), evaluator=evaluator_library())
    if note:
        _remember(note, compiled, reading)
    return compiled


def _absolute(path: Path) -> Path:
    """Return the path from the root; the working directory may be gone, if nothing is in it."""
    return path if path.is_absolute() else Path.cwd() / path


def _note(path: Path, overrides: _Overrides) -> Path | None:
    """Return the file of the note on a bundle; None if the bundle cannot be read."""
    try:
        text = path.read_bytes()
    except OSError:
        return None
    parts = [os.fsencode(_absolute(path)), os.fsencode(path), text,
             find_compiler().identity.encode(), _package(),
             *(item.encode('utf-8', 'surrogatepass') for item in overrides.texts())]
    # Each part with its length, so that different parts never give the same text.
    name = _hash(b''.join(b'%d:%b' % (len(part), part) for part in parts))
    return cache_directory() / _NOTES / f'{name}.json'


@cache
def _package() -> bytes:
    """
    Return a hash of path and content of all code of this package: each build depends on it.

    It is made once in a process, which goes on running what it has loaded. The cache has it for
    files whose sizes and dates are the same, since to read all of them takes three times as long.
    """
    states = sorted(_code())
    kept = cache_directory() / _NOTES / f'{_hash(repr(states).encode())}.package'
    with suppress(OSError, NativeError):
        refuse_foreign(cache_directory())
        if is_ours(kept.parent) and is_ours(kept):
            note_use(kept)
            return kept.read_bytes()
    found = sha256()
    for path, *_ in states:
        with open(path, 'rb') as file:
            data = file.read()
        found.update(b'%b:%d:' % (os.fsencode(path), len(data)))
        found.update(data)
    with suppress(OSError, NativeError):
        refuse_foreign(cache_directory())
        _write(kept, found.digest())
    return found.digest()


def _code() -> Iterator[tuple[str, int, int]]:
    """Yield path, date (ns) and size of each file of code, without pathlib, which is slow."""
    folders = [os.path.dirname(__file__), str(csrc_directory())]
    for folder in folders:
        with os.scandir(folder) as entries:
            for item in entries:
                if item.is_dir(follow_symlinks=False):
                    folders.append(item.path)
                elif item.name.endswith(('.py', '.json', '.c', '.h')):
                    state = item.stat()
                    yield item.path, state.st_mtime_ns, state.st_size


def _hash(data: bytes) -> str:
    return sha256(data).hexdigest()


# -- recalling ------------------------------------------------------------------------------------


def _recall(note: Path, path: Path) -> CompiledMonitor | None:
    """Return the build that a note records if it is still valid; a damaged note is ignored."""
    try:
        if not is_ours(note.parent) or not is_ours(note):
            return None  # a forged note could choose what is subscribed
        content = json.loads(note.read_text(encoding='utf-8'))
        manifest = Manifest.from_json(content['manifest'])
        library, evaluator = Path(content['library']), content['evaluator']
        evaluator = None if evaluator is None else Path(evaluator)
        sources = _unchanged(path, content['files'])
        if sources is None or not is_kept(library) \
                or not (evaluator is None or is_kept(evaluator)) \
                or content['messages'] != _messages(manifest):
            return None
        warnings = tuple(_unpacked(item, sources) for item in list(content['warnings']))
        note_use(note)
        files = tuple(Path(place) for place, _, _ in content['files'])
        return CompiledMonitor(manifest, library, warnings, files, evaluator)
    except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError,
            ManifestError, CompileError):
        return None


def _unchanged(path: Path, files: Any) -> list[Source] | None:
    """Return the files of a bundle; None if one has changed since it was built."""
    if str(_absolute(path)) != files[0][0]:
        return None
    sources = []
    for place, name, digest in files:
        data = Path(place).read_bytes().removeprefix(b'\xef\xbb\xbf')
        if _hash(data) != digest:
            return None
        sources.append(Source(name, data.decode()))
    return sources


def _messages(manifest: Manifest) -> dict[str, str]:
    """Return the fingerprint of each message type that a bundle reads or writes."""
    manifests = (manifest, *(kind.manifest for kind in manifest.kinds))
    types = {item.message_type for one in manifests for item in one.inputs
             if item.message_type is not None}
    types |= {item.payload_type for item in manifest.actions if item.payload_type}
    types |= {manifest.gate.payload_type} if manifest.gate else set()
    return {name: fingerprint(find_message(name)) for name in types}


def _unpacked(item: list[Any], sources: list[Source]) -> Diagnostic:
    title, place, label, advice = item
    span = None if place is None else Span(sources[place[0]], place[1], place[2])
    return Diagnostic(title, span, label, advice, Level.WARNING)


# -- remembering ----------------------------------------------------------------------------------


def _remember(note: Path, compiled: CompiledMonitor, reading: 'Reading') -> None:
    """Write a note atomically; if that fails, the next start only takes longer."""
    try:
        if not all(is_kept(item) for item in (compiled.library, compiled.evaluator) if item):
            return
        names = [str(file) for file, _ in reading.files]
        content = json.dumps({
            'manifest': compiled.manifest.to_json(),
            'library': str(compiled.library),
            'evaluator': compiled.evaluator and str(compiled.evaluator),
            'warnings': [_packed(item, names) for item in compiled.warnings],
            # The hashes are of what was read; the files may have changed since.
            'files': [[str(_absolute(file)), str(file), digest]
                      for file, digest in reading.files],
            'messages': dict(reading.messages),
        })
        _write(note, content.encode())
        forget({file: file.stat().st_mtime for file in note.parent.iterdir()}, _MOST_NOTES)
    except (OSError, ValueError):
        pass


def _write(file: Path, content: bytes) -> None:
    """Write a file of the folder of notes at once; raises `OSError`."""
    import tempfile  # a start from a note does without it
    file.parent.mkdir(mode=0o700, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=file.parent)
    with open(handle, 'wb') as written:
        written.write(content)
    os.replace(name, file)


def _packed(warning: Diagnostic, names: list[str]) -> list[Any]:
    """Return a warning for JSON; raises `ValueError` if its file is not one of the bundle."""
    span = warning.span
    place = None if span is None else [names.index(span.source.name), span.start, span.end]
    return [warning.title, place, warning.label, warning.help]
