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
Reads recordings: rosbag2 folders and files, and ROS 1 bags, as serialized messages.

`rosbags` reads the files, except messages of sqlite3 and in chunks of MCAP, where it takes longer.
Messages are taken from each storage itself: by way of a folder's metadata, `rosbags` yields
nothing if the storage spells the QoS of a topic in another way.
"""

from array import array
from bisect import bisect_left
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, suppress
from dataclasses import dataclass, replace
from heapq import merge
from itertools import chain, islice, pairwise
from operator import itemgetter
from pathlib import Path, PurePath
import sys
from tempfile import mkdtemp, TemporaryDirectory
from typing import Any, NoReturn, Self

from fret_monitor.bag import chunks
from fret_monitor.bag.integrity import damage, has_checksums
from fret_monitor.bag.moments import LAST_TIME
from fret_monitor.bag.restarts import Restart, restarts
from fret_monitor.messages.installed import find_message
from fret_monitor.messages.layout import MessageLayout
from fret_monitor.model.diagnostics import counted, refuse
from fret_monitor.model.packages import search_path
from fret_monitor.model.times import seconds
from fret_monitor.native.monitor import Monitor
from fret_monitor.runtime.engine import Engine
from fret_monitor.runtime.evaluator import Violation
from fret_monitor.runtime.thinning import Thinning
from rosbags.interfaces import Connection, MessageDefinitionFormat
from rosbags.rosbag1 import Reader as Reader1
from rosbags.rosbag2 import Reader as Reader2
from rosbags.rosbag2.storage_mcap import McapReader
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader
from rosbags.typesys import get_types_from_idl, get_types_from_msg, get_typestore, Stores
import yaml

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

_FIRST_MESSAGES = 8  # of the first batch; later ones are as large as messages were so far
_MOST_MESSAGES = 512  # of a batch
_MOST_BYTES = 1 << 20  # of a batch, unless its messages are larger than those before
_SEPARATOR = '=' * 80 + '\n'
_CDR = 'cdr'
_HEADER = 'std_msgs/msg/Header'
_FILES = ('.mcap', '.db3', '.bag')
_RECORDINGS = 'a folder of rosbag2, or a file .mcap, .db3 or .bag'
_COMPRESSED = '.zstd'
_UNFINISHED = ('-wal', '-journal')  # what SQLite has not put into its file yet
_CUT_OFF = ('magic', 'footer', 'truncated', 'malformed', 'not a database', 'index', 'end of file')
_METADATA, _INFORMATION, _NAMES = (
    'metadata.yaml', 'rosbag2_bagfile_information', 'relative_file_paths')
_Message = tuple[Connection, int, bytes] | tuple[int, int, bytes]
"""A connection or the number of its topic, a time (ns), and a serialized message."""


class DamagedRecording(Exception):
    """A part of a recording that cannot be read."""


@dataclass(frozen=True)
class Batch:
    """
    Messages in the order of their times.

    `topics` are the numbers given for the topics, `times` nanoseconds, `sizes` the lengths of the
    messages, which lie one after another in `messages`. `keys` are those in the names of the
    topics, one after another, with their lengths; None: no name has one.
    """

    topics: 'array[int]'
    times: 'array[int]'
    sizes: 'array[int]'
    messages: bytes
    keys: bytes = b''
    key_sizes: 'array[int] | None' = None

    def before(self, time: int) -> 'Batch':
        """Return the messages before a time."""
        return self._part(0, bisect_left(self.times, time))

    def after(self, count: int) -> 'Batch':
        """Return the messages after the first `count`."""
        return self._part(count, len(self.times))

    def deliver(self, engine: Engine, counts: 'array[int]', *,
                most: int) -> Iterator[list[Violation]]:
        """Deliver the messages to an engine, as `Engine.records`."""
        keys = None if self.key_sizes is None else (self.keys, self.key_sizes)
        return engine.records(
            self.topics, self.times, self.sizes, self.messages, counts, most=most, keys=keys)

    def add_to(self, thinning: Thinning, engine: Engine) -> None:
        """Put the values of the messages into windows."""
        thinning.add(engine, self.topics, self.times, self.sizes, self.messages)

    def at(self, times: 'array[int]') -> 'Batch':
        """Return the messages at other times."""
        return replace(self, times=times)

    def _part(self, begin: int, end: int) -> 'Batch':
        first = sum(self.sizes[:begin])
        part = Batch(self.topics[begin:end], self.times[begin:end], self.sizes[begin:end],
                     self.messages[first:first + sum(self.sizes[begin:end])])
        if self.key_sizes is None:
            return part
        sizes = self.key_sizes[begin:end]
        first = sum(self.key_sizes[:begin])
        return replace(part, keys=self.keys[first:first + sum(sizes)], key_sizes=sizes)


class Recording(AbstractContextManager['Recording']):
    """
    An open recording; a context manager.

    `types` has the types under which each topic was recorded (by its full name), `recorded` the
    number of its messages as the recording says it; `errors` names the files of a folder that are
    missing or cannot be opened, and are left out. `formats` has the topics that were not
    serialized as CDR, with their format. `start` and `end` are the times of the first and the
    last message (ns; both 0 if there is none). With `has_checksums`, each message is under one;
    without `is_end_known`, the recording says that it ends after `LAST_TIME`. `left_out` counts
    messages so far without a time up to that.
    """

    is_trace = False
    warnings: tuple[str, ...] = ()

    def __init__(self, path: Path) -> None:
        """
        Open a recording.

        Raises
        ------
        CompileError
            if it is none, or no file of it can be opened.
        """
        self.path = path
        self._stack = ExitStack()
        self._is_ros1 = path.suffix == '.bag' and not path.is_dir()
        self._check_path()
        self.errors: tuple[str, ...] = ()
        self._reader = self._open()
        self._typestore = get_typestore(Stores.EMPTY)
        self._definitions: Path | None = None
        self.left_out = 0
        try:
            self._survey(self._reader)
            found = restarts(self._storages)
        except Exception as error:  # noqa: B902  # what a damaged file says may be of any type
            self._refuse(error)
        if found:
            self._stack.close()
            _refuse_runs(path, found)

    def _survey(self, reader: Any) -> None:
        """Find out what was recorded, and whether it is all there."""
        path = self.path
        self.errors += tuple(_unfinished(path))
        if path.is_dir() and not self.errors:
            self.errors = tuple(_unlisted(path, reader))
        self._mode = None if self._is_ros1 else reader.compression_mode
        self._storages: list[Any] = getattr(
            getattr(reader, 'storage', None), 'storages', None) or [
                reader if self._is_ros1 else reader.storage]
        self.types: dict[str, set[str]] = {}
        self.recorded: Counter[str] = Counter()
        self.formats: dict[str, str] = {}
        for item in reader.connections:
            topic = full_name(item.topic)
            if (name := getattr(item.ext, 'serialization_format', _CDR)) != _CDR:
                self.formats[topic] = name
                continue
            self.types.setdefault(topic, set()).add(_full_type(item.msgtype))
            self.recorded[topic] += item.msgcount
        self.errors += tuple(text for item in self._storages for text in damage(item))
        self.has_checksums = all(map(has_checksums, self._storages))
        self._spans = {id(item): _span(item) for item in self._storages}
        spans = [(first, end) for first, end in self._spans.values() if first < end]
        self.start = min((first for first, _ in spans), default=0)
        end = max((end for _, end in spans), default=1) - 1
        self.end = min(end, LAST_TIME)
        self.is_end_known = end <= LAST_TIME

    def __enter__(self) -> Self:
        """Return the recording, which is open."""
        return self

    def __exit__(self, *error: object) -> None:
        """Close the recording."""
        self._stack.close()

    def _check_path(self) -> None:
        path = self.path
        if not path.exists():
            refuse(f"there is no recording '{path}'")
        if path.is_dir() and not (path / _METADATA).is_file():
            within = sorted(item for item in path.iterdir()
                            if item.suffix in _FILES or (item / _METADATA).is_file())
            refuse(f"'{path}' is not a recording: it has no metadata.yaml",
                   help=f'name the recordings in it: {path}/*' if len(within) > 1 else
                   f"name the recording in it: '{within[0]}'" if within else '')
        for item in path.iterdir() if path.is_dir() else (path,):
            if item.exists() and not (item.is_file() or item.is_dir()):
                # To open a named pipe would wait for a process that writes to it.
                refuse(f"'{item}' is a named pipe or a device, not a file of a recording")
        if path.is_file() and path.suffix == _COMPRESSED:
            refuse(f"'{path}' is a compressed file of a recording",
                   help=f'name its folder, or decompress it: zstd -d {path.name}')
        if path.is_file() and path.suffix == '.csv':
            refuse(f"'{path}' is a table of values, which has no topics",
                   help=f'name {_RECORDINGS}; `bag` and `simulate` read tables')
        if path.is_file() and path.suffix not in _FILES:
            refuse(f"'{path}' is not a recording",
                   help=f'a recording is {_RECORDINGS}; `bag` reads a table of values, too (.csv)')

    def _open(self) -> Any:
        try:
            return self._stack.enter_context(
                Reader1(self.path) if self._is_ros1 else Reader2(self.path))
        except Exception as error:  # noqa: B902  # of whichever library reads the format
            with suppress(Exception):
                return self._open_others()
            self._refuse(error)

    def _refuse(self, error: Exception) -> NoReturn:
        self._stack.close()
        reason = _reason(error)
        is_cut_off = any(word in reason.lower() for word in _CUT_OFF)
        refuse(f"cannot read the recording '{self.path}': {reason}",
               help='a recording that was cut off can be repaired with `ros2 bag reindex` or '
               '`mcap recover`' if is_cut_off else '')

    def _open_others(self) -> Any:
        """Open those files of a folder that can be opened; raises any exception if none can."""
        folder = Path(self._stack.enter_context(TemporaryDirectory()))
        metadata = _metadata(self.path)
        names = [PurePath(name).name for name in metadata[_INFORMATION][_NAMES]]
        problems = {name: _problem(self.path, _folder_of([name], self.path, metadata, folder))
                    for name in names}
        self.errors = tuple(filter(None, problems.values()))
        if len(self.errors) == len(names):
            raise DamagedRecording
        return self._stack.enter_context(Reader2(_folder_of(
            [name for name in names if not problems[name]], self.path, metadata, folder)))

    def prepare(self, monitor: Monitor) -> Monitor:
        """Return a monitor as it is to be run over the recording."""
        return monitor

    def find_message(self, name: str, *_: object) -> MessageLayout:
        """
        Find a message type in the recording, or what is installed.

        Raises
        ------
        CompileError
            if it is in neither.
        """
        if self._definitions is None:
            self._definitions = Path(self._stack.enter_context(TemporaryDirectory()))
            self._write_definitions(self._definitions)
        return find_message(name, (self._definitions, *search_path()))

    def _write_definitions(self, folder: Path) -> None:
        """
        Write the message definitions that it contains to `folder`/share/PKG/msg/NAME.msg.

        One that cannot be read is left out: what is installed is used then.
        """
        for connection in self._connections():
            definition = connection.msgdef
            if definition.format is MessageDefinitionFormat.MSG and not self._is_ros1:
                _write_text(folder, connection.msgtype, definition.data)
            elif definition.format is not MessageDefinitionFormat.NONE:
                with suppress(Exception):
                    self._register(connection)
                    text, _ = self._typestore.generate_msgdef(connection.msgtype, ros_version=2)
                    _write_text(folder, connection.msgtype, text)

    def _connections(self) -> Iterable[Connection]:
        """Return a connection of each type, with its definition if there is one."""
        found: dict[str, Connection] = {}
        for connection in self._reader.connections:
            known = found.get(connection.msgtype)
            if known is None or known.msgdef.format is MessageDefinitionFormat.NONE:
                found[connection.msgtype] = connection
        return found.values()

    def _register(self, connection: Connection) -> None:
        definition = connection.msgdef
        if definition.format is MessageDefinitionFormat.MSG:
            types = get_types_from_msg(definition.data, connection.msgtype)
        else:
            parts = definition.data.split(_SEPARATOR)
            types = {}
            if len(parts) > 1:  # each under a line `IDL: name`
                parts = [part.partition('\n')[2] for part in parts[1:]]
            for part in parts:
                types.update(get_types_from_idl(part))
        if self._is_ros1 and _HEADER in types:  # rosbags leaves its `seq` out of what it converts
            constants, fields = types[_HEADER]
            types[_HEADER] = constants, [item for item in fields if item[0] != 'seq']
        self._typestore.register(
            {name: kind for name, kind in types.items() if name not in self._typestore.fielddefs})

    def batches(self, wanted: Mapping[tuple[str, str], int],
                until: int | None = None) -> Iterator[Batch]:
        """
        Yield the messages of topics in the order of their times, many at a time.

        Parameters
        ----------
        wanted
            a number for each name and type of a topic; the others are left out.
        until
            nanoseconds: messages after that are left out.

        Raises
        ------
        DamagedRecording
            after the last batch, if a part of it cannot be read.
        """
        numbers = {id(item): wanted[key] for storage in self._storages
                   for item in storage.connections
                   if (key := (full_name(item.topic), _full_type(item.msgtype))) in wanted}
        # They are opened when the first one is read: what fails then is damage too.
        messages = chain.from_iterable(
            map(self._messages, [numbers], [None if until is None else until + 1]))
        count = _FIRST_MESSAGES
        damage: Exception | None = None
        while damage is None:
            found: list[_Message] = []
            try:
                found.extend(islice(messages, count))  # keeps those before an exception
            except Exception as error:  # noqa: B902  # of whichever library reads the format
                damage = error
            if not found:
                break
            batch = self._batch(found, numbers)
            size = max(1, len(batch.messages) // len(found))
            found.clear()
            if batch.times:
                yield batch
            del batch  # large messages take the memory of those before
            count = min(_MOST_MESSAGES, max(1, _MOST_BYTES // size))
        if damage is not None:
            raise DamagedRecording(_reason(damage)) from None

    def _batch(self, found: list[_Message], numbers: Mapping[int, int]) -> Batch:
        """Return messages as a batch, without those that have no time, or are no bytes."""
        try:
            if found[-1][1] <= LAST_TIME:
                return _batch(found, numbers)
        except (TypeError, OverflowError):
            pass
        usable = [item for item in found
                  if _are_times(item[1]) and isinstance(item[2], bytes)]
        self.left_out += len(found) - len(usable)
        return _batch(usable, numbers) if usable else Batch(
            array('I'), array('q'), array('Q'), b'')

    def _messages(self, numbers: Mapping[int, int], stop: int | None) -> Iterator[_Message]:
        storages = sorted((item for item in self._storages
                           if self._spans[id(item)][0] < self._spans[id(item)][1]),
                          key=lambda item: self._spans[id(item)])
        streams = (self._stream(storage, numbers, stop) for storage in storages)
        spans = [self._spans[id(storage)] for storage in storages]
        if all(end <= begin for (_, end), (begin, _) in pairwise(spans)):
            return chain.from_iterable(streams)
        return merge(*streams, key=itemgetter(1))

    def _stream(self, storage: Any, numbers: Mapping[int, int],
                stop: int | None) -> Iterator[_Message]:
        chosen = [item for item in storage.connections if id(item) in numbers]
        if not chosen:
            return iter(())
        convert = self._conversion(chosen)
        if convert is None and getattr(storage, 'dbconn', None) is not None:
            return _rows(storage.dbconn, {item.id: numbers[id(item)] for item in chosen}, stop)
        messages: Iterator[tuple[Connection, int, bytes]] = (
            chunks.messages(storage, chosen, stop)
            if isinstance(storage, McapReader) and storage.chunks
            else storage.messages(chosen, None, stop))
        if convert is None:
            return messages
        return ((item, time, convert(data, item.msgtype)) for item, time, data in messages)

    def _conversion(
        self, connections: Iterable[Connection],
    ) -> Callable[[bytes, str], bytes] | None:
        if self._is_ros1:
            for connection in connections:
                self._register(connection)
            return lambda data, name: bytes(self._typestore.ros1_to_cdr(data, name))
        if self._mode == 'message':
            return lambda data, name: zstd.decompress(data)
        return None


def full_name(topic: str) -> str:
    """Return the name of a topic as ROS has it; some programs record it without the slash."""
    return topic if topic.startswith('/') else f'/{topic}'


def _full_type(name: str) -> str:
    """Return the name of a message type with `msg`, which the first recorders left out."""
    return name if name.count('/') != 1 else name.replace('/', '/msg/')


def _refuse_runs(path: Path, found: Sequence[Restart]) -> NoReturn:
    first = found[0]
    refuse(f"time goes back in '{path}', {counted(len(found), 'restart')}: in {first.file}, a "
           f'message of {first.topic} at {seconds(first.before)} s is followed by one at '
           f'{seconds(first.after)} s',
           help='these are runs whose times overlap, such as of a simulation that was reset: '
           'record each by itself')


def files_of(path: Path) -> list[Path]:
    """Return the files that a recording consists of, by name."""
    return sorted(item for item in path.iterdir() if item.is_file()) if path.is_dir() else [path]


def _metadata(folder: Path) -> Any:
    return yaml.safe_load((folder / _METADATA).read_text(encoding='utf-8'))


def _folder_of(names: Sequence[str], path: Path, metadata: Any, parent: Path) -> Path:
    """Return a new folder in `parent`, a recording of some files of the one at `path`."""
    folder = Path(mkdtemp(dir=parent))
    for name in names:
        (folder / name).symlink_to(path.resolve() / name)
    content = {_INFORMATION: {**metadata[_INFORMATION], _NAMES: list(names)}}
    (folder / _METADATA).write_text(yaml.safe_dump(content), encoding='utf-8')
    return folder


def _problem(path: Path, folder: Path) -> str:
    """Return what is wrong with the file in a folder of one, which belongs to `path`."""
    file, = (item for item in folder.iterdir() if item.is_symlink())
    if not file.exists():
        return f'{file.name} is missing'
    try:
        with Reader2(folder):
            return ''
    except Exception as error:  # noqa: B902  # of whichever library reads the format
        reason = _reason(error).replace(str(folder), str(path))
        return f'{file.name} cannot be opened: {reason}'


def _unfinished(path: Path) -> Iterator[str]:
    """Yield what is wrong with files whose last messages SQLite has elsewhere."""
    for file in files_of(path):
        for ending in _UNFINISHED:
            beside = file.with_name(file.name + ending)
            if file.suffix == '.db3' and beside.is_file() and beside.stat().st_size:
                yield (f'{beside.name} has messages that are not in {file.name} yet: end the '
                       f'recorder, or run: sqlite3 {file.name} "PRAGMA wal_checkpoint(TRUNCATE)"')


def _unlisted(path: Path, reader: Any) -> Iterator[str]:
    """Yield what metadata.yaml does not say of a folder, or says in two ways."""
    names = _metadata(path)[_INFORMATION][_NAMES]
    listed = {PurePath(name).name.removesuffix(_COMPRESSED) for name in names}
    for file in files_of(path):
        name = file.name.removesuffix(_COMPRESSED)
        if PurePath(name).suffix in _FILES and name not in listed:
            yield f'{file.name} is not listed in metadata.yaml: its messages are left out'
    by_topic = sum(item.msgcount for item in reader.connections)
    if reader.message_count != by_topic:
        yield (f'metadata.yaml counts {counted(reader.message_count, "message")}, and '
               f'{by_topic:,} by topic')


def _span(storage: Any) -> tuple[int, int]:
    """Return the times of the first and after the last message of a storage; 0, 0 without any."""
    if isinstance(storage, Reader1):
        return storage.start_time, storage.end_time
    first, end = storage.metadata.start_time, storage.metadata.end_time
    if isinstance(storage, Sqlite3Reader) and not (_are_times(first, end) and first < end):
        assert storage.dbconn is not None  # SQLite keeps values of any type in any column
        (first, end), = storage.dbconn.execute(
            'SELECT min(timestamp), max(timestamp) + 1 FROM messages '
            "WHERE typeof(timestamp) = 'integer' AND timestamp <= ?", (LAST_TIME,))
        return (0, 0) if first is None else (first, end)
    return first, end


def _are_times(*times: object) -> bool:
    return all(isinstance(time, int) and time <= LAST_TIME for time in times)


def _rows(database: Any, numbers: Mapping[int, int], stop: int | None) -> Iterator[_Message]:
    """Yield messages of topics of a file of SQLite, as rosbags does; without a loop of Python."""
    cases = ' '.join('WHEN ? THEN ?' for _ in numbers)
    wanted = ','.join('?' for _ in numbers)
    before = '' if stop is None else 'AND timestamp < ? '
    rows: Iterator[_Message] = database.execute(
        f'SELECT CASE topic_id {cases} END, timestamp, data FROM messages '
        f'WHERE topic_id IN ({wanted}) {before}ORDER BY timestamp',
        [*chain.from_iterable(numbers.items()), *numbers, *(() if stop is None else (stop,))])
    return rows


def _batch(found: list[_Message], numbers: Mapping[int, int]) -> Batch:
    # No loop of Python over the messages: it would take as long as reading them.
    connections, times, parts = zip(*found)
    if len(numbers) == 1:
        topics = array('I', numbers.values()) * len(parts)
    elif isinstance(connections[0], int):
        topics = array('I', connections)
    else:
        topics = array('I', map(numbers.__getitem__, map(id, connections)))
    return Batch(topics, array('q', times), array('Q', map(len, parts)), b''.join(parts))


def _write_text(folder: Path, name: str, text: str) -> None:
    """Write the definition of a message, and those that follow it in `text`."""
    first, *others = text.split(_SEPARATOR)
    found = [(name, first)]
    for other in others:
        head, _, body = other.partition('\n')
        found.append((head.removeprefix('MSG:').strip(), body))
    for title, body in found:
        package, _, rest = title.partition('/')
        kind, _, short = rest.rpartition('/')
        if (kind or 'msg') != 'msg' or not package.isidentifier() or not short.isidentifier():
            continue  # of a service or action: what is installed is used
        file = folder / 'share' / package / 'msg' / f'{short}.msg'
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(body, encoding='utf-8')


def _reason(error: Exception) -> str:
    text = ' '.join(str(error).partition(' Please report')[0].split())
    return f'there is no {text}' if isinstance(error, KeyError) else (
        text or type(error).__name__).rstrip('.')
