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
A cache of libraries built from C text, so that a second start compiles nothing.

An entry is the folder `$ROS_HOME/fret_monitor/KEY/` (`ROS_HOME` is `~/.ros` when unset). It holds
the library, its sources and a seal: the name and SHA-256 of the library. KEY is the SHA-256 of
everything that determines the library: sources, headers, compiler, flags, machine; for a copy, the
SHA-256 of the library. An entry is built under a temporary name and renamed when it is complete:
two processes may build the same library, and a killed process leaves no incomplete entry. Whoever
can write to the cache can run code as the user, so that a cache or entry that others own or can
write is refused. If the cache cannot be written, libraries are built for one run only.

The modification time of a seal is the time of the library's last use. After a build, libraries
that were not used for 90 days are removed; of those left, all but the 200 most recently used. A
library used within the last day is never removed. A process that has loaded a library can go on
using it after its removal.
"""

import atexit
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, replace
from functools import cache
from hashlib import sha256
import json
import os
from pathlib import Path
import shlex
import shutil
import stat
import sys
import time

from fret_monitor.native.compiler import (
    COMPILE_FLAGS, compile_library, Compiler, find_compiler, Linking, OBJECT, SHARED, TIMEOUT,
)
from fret_monitor.native.elf import is_cut_short
from fret_monitor.native.errors import CacheError, CompilerError, LibraryError, NativeError

#: The sources of the library with the evaluator, the engine and the receivers.
EVALUATOR_SOURCES = (
    'instance.c', 'tables.c', 'due.c', 'steps.c', 'measures.c', 'deadlines.c', 'evaluator.c',
    'gate.c', 'states.c', 'keys.c', 'pairs.c', 'heap.c', 'aggregates.c', 'pool.c',
    'scopes_steps.c', 'scopes_due.c', 'scopes_making.c', 'scopes.c', 'schedule.c', 'handover.c',
    'outbox.c', 'schedules.c', 'payload.c', 'reorder.c', 'blackbox.c', 'mcap.c', 'blackbox_file.c',
    'blackbox_writer.c', 'thread.c', 'scheduling.c', 'engine_clock.c', 'engine_findings.c',
    'engine_message.c', 'engine_scopes.c', 'engine_due.c', 'engine_backlog.c', 'engine_delivery.c',
    'transforms.c', 'seen.c', 'engine_graph.c', 'engine_transforms.c', 'engine_gate.c', 'engine.c',
    'snapshot.c', 'records.c', 'text.c', 'figures.c', 'lines.c', 'given.c', 'subscription.c',
    'spelling.c', 'overrides.c', 'gate_target.c', 'details.c', 'violation_log.c',
    'condition_log.c', 'graph_lines.c', 'instance_lines.c', 'input_log.c', 'start_lines.c',
    'shared_names.c', 'health.c', 'review.c', 'verdicts.c', 'sign_of_life.c', 'thinning.c',
    'csv.c', 'keyed_rows.c', 'serialized.c', 'receiver.c', 'in_place.c', 'in_place_versions.c',
    'announcer.c', 'verdict_thread.c', 'reports.c', 'service_call.c', 'action_call.c',
    'actions.c', 'relay.c', 'question.c', 'graph.c', 'keyed_topics.c',
)

#: The folders of csrc whose files may call those of the folders before them, and no others.
CSRC_ROOMS = ('generated', 'evaluator', 'engine', 'reporting', 'traces', 'ros', 'node')

_SEAL = 'seal.json'
_UNFINISHED = '.building-'
_LITTER_AGE = 24 * 3600.0  # seconds after which an unfinished folder is removed
_UNUSED_AGE = 90 * 24 * 3600.0  # seconds after which an unused library is removed
_MOST = 200  # libraries that are kept, not counting those used within a day
_FULL = 1 << 20  # with fewer free bytes, a failed build is attributed to a full disk


def build_library(
    sources: Mapping[str, str], *, name: str, headers: Mapping[str, str] | None = None,
    compiler: Compiler | None = None, timeout: float = TIMEOUT,
    linking: Linking = SHARED, identity: str = '',
    objects: Callable[[], Sequence[Path]] = lambda: (),
) -> Path:
    """
    Compile C files to one shared library, or return it from the cache.

    With another `linking` than `SHARED` they become another file. It depends on `identity`, too.

    Parameters
    ----------
    sources
        file name (no folders) to text of each C file; at least one, or there are `objects`.
    name
        the library's file is `libNAME.so`; letters, digits and `_`.
    headers
        file name to text of the headers they include; `runtime_headers` when None.
    compiler
        the result of `find_compiler` when None.
    timeout
        seconds for the compiler.
    linking
        what the objects are linked to.
    identity
        a text that changes with what the result depends on besides.
    objects
        makes object files to link besides, where the library is not there yet. They follow from
        `headers`, `sources` and `identity`.

    Returns
    -------
    Path
        the library: in the cache, or in a temporary folder that is removed when this process ends.

    Raises
    ------
    CompilerError
        if there is no compiler, or it fails.
    CacheError
        if other users can write to the cache, or it is a link; or it cannot be written, and
        what is linked is kept.
    """
    compiler = compiler or find_compiler()
    texts = {**(runtime_headers() if headers is None else headers), **sources}
    files = {file: text.encode() for file, text in texts.items()}
    build = _Build(files, tuple(sources), linking, name, compiler, timeout, objects)
    entry = _Entry(build.key(identity), build.library, build.fill, _warn_once)
    return entry.kept() or (
        entry.make_to_keep() if linking.is_kept else entry.make())


def private_copy(library: Path) -> Path:
    """
    Copy a library into the cache, under the hash of its content, and return the copy.

    The original may then be overwritten or removed while the copy is in use. dlopen returns the
    library that is already open if the path is the same; a changed file gets another path here. If
    the cache cannot be used, the copy exists until this process ends. If there is no place for a
    copy, or the copy cannot be loaded from its place, the original is returned, with a warning.

    Raises
    ------
    LibraryError
        if the file cannot be read.
    """
    try:
        content = library.read_bytes()
    except OSError as error:
        raise LibraryError(f'cannot read {library}: {error.strerror or error}') from None

    def fill(folder: Path) -> None:
        (folder / library.name).write_bytes(content)

    entry = _Entry(sha256(content).hexdigest(), library.name, fill)
    try:
        try:
            copy = entry.kept() or entry.make()
        except ForeignCacheError:
            copy = entry.make_for_now('it is a link, or others can write there')
    except CacheError as error:
        _warn_shared(library.parent, str(error))
        return library
    return _loadable(copy, library)


def _loadable(copy: Path, library: Path) -> Path:
    """Return the copy, or the original if only that can be loaded: a disk may refuse code."""
    from fret_monitor.native.monitor import Library
    try:
        Library(copy)
    except LibraryError as error:
        with suppress(LibraryError):
            Library(library)
            _warn_shared(library.parent, str(error))
            return library
    return copy


@cache
def _warn_shared(folder: Path, reason: str) -> None:
    """Warn that the libraries of a folder are not copied, once for each reason."""
    _warn(
        '%s is used in place, without a copy (%s): do not change it while this process runs',
        folder, reason)


@cache
def _warn_once(root: Path, reason: str) -> None:
    """Warn that the cache cannot be written, once for all libraries."""
    _warn(
        '%s cannot be written (%s): the library is built for this run only, and every start will '
        'compile again: make it writable, make room, or set ROS_HOME to another folder',
        root, reason)


def _warn(text: str, *arguments: object) -> None:
    import logging  # here, as others: a start from the cache does without it
    logging.getLogger(__name__).warning(text, *arguments)


def is_kept(library: Path) -> bool:
    """
    Return whether a library is an undamaged entry of the cache; note its use.

    Raises
    ------
    CacheError
        if other users can write to the cache, or it is a link.
    """
    root = cache_directory()
    try:
        refuse_foreign(root)
        if library.parent.parent != root or not is_ours(library.parent) or not is_ours(library):
            return False
        seal = json.loads((library.parent / _SEAL).read_text(encoding='utf-8'))
        if seal != _seal(library):
            return False
    except (OSError, ValueError, RecursionError):
        return False
    note_use(library.parent / _SEAL)
    return True


def is_ours(path: Path) -> bool:
    """Return whether only this user can write a file or folder; False for a link."""
    status = path.lstat()
    return not stat.S_ISLNK(status.st_mode) and status.st_uid == os.geteuid() \
        and not stat.S_IMODE(status.st_mode) & 0o022


def note_use(file: Path) -> None:
    """Set the modification time of a file to now; do nothing if that fails."""
    with suppress(OSError):
        os.utime(file)


def forget(dates: Mapping[Path, float], most: int) -> None:
    """
    Remove files or folders unused for 90 days, and all but the `most` most recently used.

    `dates` are the times of their last use, in seconds since the epoch. Those used within the last
    day are kept.
    """
    now = time.time()
    by_age = sorted(dates, key=lambda path: dates[path], reverse=True)
    for number, path in enumerate(by_age):
        age = now - dates[path]
        if age > _UNUSED_AGE or (number >= most and age > _LITTER_AGE):
            with suppress(OSError):  # another process removed it first
                # Renamed first, so that no process finds a folder that is partly removed.
                doomed = path.with_name(f'{_UNFINISHED}{os.getpid()}-{path.name}')
                path.rename(doomed)
                _remove(doomed)


def runtime_headers() -> dict[str, str]:
    """Return the headers of csrc that generated C may include, by file name."""
    return {file.name: file.read_text(encoding='utf-8')
            for file in sorted(csrc_directory().glob('generated/*.h'))}


def csrc_file(name: str) -> Path:
    """Return a file of csrc, but for those of exports; a name is used once."""
    return _csrc_files()[name]


@cache
def _csrc_files() -> dict[str, Path]:
    return {path.name: path for room in CSRC_ROOMS for path in (csrc_directory() / room).iterdir()}


def csrc_includes() -> list[str]:
    """Return the arguments of a C compiler with which it finds all headers of csrc."""
    return [f'-I{csrc_directory() / room}' for room in CSRC_ROOMS]


@cache
def evaluator_files() -> Mapping[str, str]:
    """Return the sources of the evaluator's library and all headers, by file name."""
    csrc = csrc_directory()
    headers = [path for room in CSRC_ROOMS if room != 'node'
               for path in sorted((csrc / room).glob('*.h'))]
    return {file.name: file.read_text(encoding='utf-8')
            for file in (*headers, *map(csrc_file, EVALUATOR_SOURCES))}


def evaluator_library() -> Path:
    """Return the library of the evaluator and the engine; errors as `build_library`."""
    return build_library({}, headers=evaluator_files(), name='fm_evaluator',
                         objects=lambda: (evaluator_object(),))


def evaluator_object() -> Path:
    """Return that library as an object file, which the node in C has too; errors likewise."""
    files = evaluator_files()
    headers = {name: text for name, text in files.items() if name.endswith('.h')}
    return build_library({name: text for name, text in files.items() if name not in headers},
                         headers=headers, name='fm_evaluator', linking=OBJECT)


@cache
def csrc_directory() -> Path:
    """
    Return the folder of the hand-written C.

    It is `csrc` beside the package in a source tree, else `share/fret_monitor/csrc` in an
    installation prefix.

    Raises
    ------
    NativeError
        if there is none, because the package is only partly installed.
    """
    candidates = _csrc_candidates()
    for folder in candidates:
        if (folder / 'evaluator' / 'evaluator.c').is_file():
            return folder
    looked = '\n'.join(f'  {folder}' for folder in candidates)
    raise NativeError(f'the C sources of fret_monitor are not installed; looked in\n{looked}')


def _csrc_candidates() -> list[Path]:
    package = Path(__file__).resolve().parents[1]
    prefixes = [*package.parents[1:]]
    prefixes += map(Path, filter(None, os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)))
    prefixes.append(Path(sys.prefix))
    installed = [prefix / 'share' / 'fret_monitor' / 'csrc' for prefix in prefixes]
    return [package.parent / 'csrc', *dict.fromkeys(installed)]


def cache_directory() -> Path:
    """Return the folder of the cache; it need not exist."""
    home = os.environ.get('ROS_HOME') or os.path.join(os.path.expanduser('~'), '.ros')
    return Path(os.path.abspath(home)) / 'fret_monitor'


class _Build:
    """The sources, compiler and settings that a library is built from."""

    def __init__(
        self, files: Mapping[str, bytes], sources: tuple[str, ...], linking: Linking,
        name: str, compiler: Compiler, timeout: float, objects: Callable[[], Sequence[Path]],
    ) -> None:
        self.library = linking.file.format(name)
        self._linking = linking
        self._files = files
        self._sources = sources
        self._compiler = compiler
        self._timeout = timeout
        self._objects = objects

    def key(self, identity: str) -> str:
        """Return the hash of everything that determines the library."""
        decisive = [
            {file: sha256(text).hexdigest() for file, text in sorted(self._files.items())},
            self._sources, self.library, self._compiler.identity,
            COMPILE_FLAGS, asdict(self._linking), identity, os.uname().machine, sys.platform]
        return sha256(json.dumps(decisive).encode()).hexdigest()

    def fill(self, folder: Path) -> None:
        """Write the sources to a folder and compile them there."""
        for file, text in self._files.items():
            (folder / file).write_bytes(text)
        linking = replace(self._linking, libraries=(
            *map(str, self._objects()), *self._linking.libraries))
        compile_library(
            self._compiler, self._sources, self.library, folder=folder, timeout=self._timeout,
            linking=linking)
        for made in folder.glob('*.o'):
            made.unlink()
        _refuse_garbage(folder / self.library, self._compiler)


class _Entry:
    """An entry of the cache: its key, its library, and the function that makes the library."""

    def __init__(self, key: str, library: str, fill: Callable[[Path], None],
                 warn: Callable[[Path, str], None] | None = None) -> None:
        self._library = library
        self._fill = fill
        self._warn = warn
        self._root = cache_directory()
        self._folder = self._root / key

    def kept(self) -> Path | None:
        """Return the library if it is in the cache and undamaged; note its use."""
        try:
            refuse_foreign(self._root)
        except OSError:
            return None  # the cache does not exist, or cannot be accessed
        library = self._folder / self._library
        return library if is_kept(library) else None

    def make(self) -> Path:
        """Make the library in the cache or, if that fails, in a private folder."""
        try:
            return self._make_kept()
        except OSError as error:
            return self.make_for_now(error.strerror or str(error))
        except CompilerError:
            if not _is_full(self._root):
                raise
            return self.make_for_now('the disk is full')

    def make_to_keep(self) -> Path:
        """Make the library in the cache; raises `CacheError` if it cannot be written."""
        try:
            return self._make_kept()
        except OSError as error:
            raise CacheError(f'{self._root} cannot be written '
                             f'({error.strerror or error})') from None

    def make_for_now(self, reason: str) -> Path:
        """Make the library in a private folder, until the process ends."""
        import tempfile
        if self._warn is not None:
            self._warn(self._root, reason)
        try:
            folder = Path(tempfile.mkdtemp(prefix='fret_monitor-'))
            atexit.register(shutil.rmtree, folder, ignore_errors=True)
            self._complete(folder)
        except OSError as error:
            raise CacheError(
                f'there is no place to put a library: neither {self._root} ({reason}) nor '
                f'{tempfile.tempdir or "a temporary folder"} ({error.strerror or error}) can be '
                'written: make room, or set ROS_HOME or TMPDIR to another folder') from None
        return folder / self._library

    def _make_kept(self) -> Path:
        import tempfile
        self._root.mkdir(mode=0o700, parents=True, exist_ok=True)
        refuse_foreign(self._root)
        _sweep(self._root)
        unfinished = Path(tempfile.mkdtemp(prefix=_UNFINISHED, dir=self._root))
        try:
            self._complete(unfinished)
            self._publish(unfinished)
        finally:
            shutil.rmtree(unfinished, ignore_errors=True)
        _evict(self._root)
        return self._folder / self._library

    def _complete(self, folder: Path) -> None:
        self._fill(folder)
        (folder / self._library).chmod(0o755)  # with a umask of 002 the group could write it
        seal = json.dumps(_seal(folder / self._library))
        (folder / _SEAL).write_text(seal, encoding='utf-8')

    def _publish(self, unfinished: Path) -> None:
        """Rename the finished folder, unless another process made the entry meanwhile."""
        try:
            unfinished.rename(self._folder)
        except OSError:
            if is_kept(self._folder / self._library):
                return
            # The existing entry is damaged. Renamed first, so that no process finds it half
            # removed.
            damaged = unfinished.with_name(f'{unfinished.name}-damaged')
            self._folder.rename(damaged)
            unfinished.rename(self._folder)
            _remove(damaged)


def _refuse_garbage(library: Path, compiler: Compiler) -> None:
    """
    Raise if the compiler did not write a complete library: the cache would keep the file.

    The library may be for another machine, since a robot's may be cross-compiled.
    """
    what = 'none at all'
    if library.is_file():
        with library.open('rb') as file:
            is_library = file.read(4) == b'\x7fELF' or sys.platform != 'linux'
        if is_library and not is_cut_short(library):
            return
        what = 'a part of one' if is_library else 'something else'
    raise CompilerError(f'the C compiler reported no error, but wrote no library, but {what}:\n'
                        f'  {shlex.join(compiler.command)}')


def _seal(library: Path) -> dict[str, str]:
    """Return the content of the seal of a library."""
    return {'library': library.name, 'sha256': sha256(library.read_bytes()).hexdigest()}


class ForeignCacheError(CacheError):
    """Other users can write to the cache, or it is a link."""


def refuse_foreign(folder: Path) -> None:
    """Raise `ForeignCacheError` if others can write to a folder; `OSError` if it is none."""
    status = folder.lstat()
    if stat.S_ISLNK(status.st_mode):
        raise ForeignCacheError(
            f'{folder} is a link, and the folder it points to could be another at the next start: '
            'remove the link, or set ROS_HOME to the folder that should contain the cache')
    if status.st_uid != os.geteuid():
        raise ForeignCacheError(
            f'{folder} belongs to another user, who could put a library there for you to run: '
            'set ROS_HOME to a folder of your own')
    if stat.S_IMODE(status.st_mode) & 0o022:
        raise ForeignCacheError(
            f'{folder} can be written by others, who could put a library there for you to run:\n'
            f'  chmod 700 {folder}')


def _sweep(root: Path) -> None:
    """Remove unfinished folders that killed processes left."""
    for left in root.glob(f'{_UNFINISHED}*'):
        try:
            if time.time() - left.lstat().st_mtime > _LITTER_AGE:
                _remove(left)
        except OSError:
            continue  # another process removed it first


def _evict(root: Path) -> None:
    """Remove libraries that have not been used for a long time."""
    dates = {}
    for seal in root.glob(f'*/{_SEAL}'):
        with suppress(OSError):
            dates[seal.parent] = seal.stat().st_mtime
    forget(dates, _MOST)


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def _is_full(root: Path) -> bool:
    try:
        return shutil.disk_usage(root).free < _FULL
    except OSError:
        return False
