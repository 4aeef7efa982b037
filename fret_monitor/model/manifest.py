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
The manifest: the data of a compiled bundle that the run-time needs, stored as JSON.

A node needs only the manifest and the shared library. The manifest has topics, types, fields, step
groups, ids, texts and policy, so that a robot needs neither parser nor compiler. The JSON has a
format number; other formats are refused.
"""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from enum import Enum
from fractions import Fraction
from itertools import product
import json
import math
import re
from typing import NoReturn, TypeVar

from fret_monitor.model.frozen import frozen
from fret_monitor.model.made import Made, MadeKind
from fret_monitor.model.names import HANDLER_TOPIC, margin_topic, pair_key
from fret_monitor.model.paths import FieldPath, LookUp, path_text, Sector, Slice, Step
from fret_monitor.model.payload import PartKind, PayloadPart
from fret_monitor.model.policies import (
    ActionKind, InputSource, Otherwise, OverInstances, Policy, Report, Severity, Stale, Stamp,
)
from fret_monitor.model.probability import LEAST, Probability, RELATIONS
from fret_monitor.model.values import ValueType

FORMAT = 16
_FRACTION = re.compile(r'\d{1,40}/[1-9]\d{0,40}')

EVENTS = '/_service_event'  # after the name of a service: the topic of its calls
EVENT_SUFFIX = '_Event'  # after the type of a service: that of the messages on this topic
SECONDS = 'seconds'  # of a builtin_interfaces/msg/Time or Duration
ANGLES = ('yaw', 'pitch', 'roll')  # of a quaternion
REDUCTIONS = ('len', 'min', 'max', 'sum', 'mean', 'any', 'all', 'norm', *ANGLES)

_SYMBOL = re.compile('[A-Za-z_][A-Za-z0-9_]*')
_HEX = re.compile('([0-9a-f]{2})*')
_HEADER_BYTES = 4  # of a serialized message
_MOST_BYTES = 2 ** 31
_Choice = TypeVar('_Choice', bound=Enum)


def events_of(service: str) -> str:
    """Return the topic on which the calls of a service are published."""
    return service + EVENTS


class ManifestError(Exception):
    """A manifest that cannot be read: not JSON, another format, incomplete or damaged."""


@dataclass(frozen=True)
class ManifestInput:
    """
    One input, in the order of the C struct.

    `value_type` is the type in which it is stored. `values` are the names of its values: (name,
    number or string); a string input is stored as int32, the index of its string in `values`.
    `initial` is its value before the first message, as stored, or None. `path` is the field path
    within the message, as in `model.paths`. `reduction` is the function applied to the array,
    string or message at the end of the path: one of `REDUCTIONS`, or `SECONDS`; '' for the field's
    own value. `timeout` is the longest time without a message, in seconds; None: no limit.
    `startup` is the same before the first message; None: as `timeout`. With the source `received`,
    `path` is empty; with `age`, it leads to the stamp. A `rate` is that of the last `window`
    nanoseconds, and has room for the times of `room` messages.
    """

    name: str
    value_type: ValueType
    topic: str | None
    message_type: str | None
    path: FieldPath
    values: tuple[tuple[str, int | str], ...]
    initial: bool | int | float | None
    reduction: str = ''
    timeout: float | None = None
    stale: Stale = Stale.WARN
    startup: float | None = None
    source: InputSource = InputSource.FIELD
    window: int = 0
    room: int = 0

    @property
    def is_string(self) -> bool:
        """Whether the message field is a string, mapped through `values`."""
        return any(isinstance(value, str) for _, value in self.values)

    @property
    def stored_values(self) -> tuple[tuple[str, int], ...]:
        """The names of its values, each with the number that is stored."""
        is_string = self.is_string
        return tuple((name, place if is_string else int(value))
                     for place, (name, value) in enumerate(self.values))

    @property
    def is_timed_out(self) -> bool:
        """Whether a time without a message is too long: an input without a topic has none."""
        return self.timeout is not None and self.topic is not None

    @property
    def first_timeout(self) -> float:
        """The longest time without a first message, in seconds; 0: no limit."""
        return self.startup or self.timeout or 0.0

    @property
    def field(self) -> str:
        """The field as a bundle names it, such as `min(ranges[3:9])`."""
        path = path_text(self.path)
        return f'{self.reduction}({path})' if self.reduction not in ('', SECONDS) else path


@dataclass(frozen=True)
class ManifestVariable:
    """
    An instance variable: its keys, or how many are there at once at most.

    `keys` are listed; empty: they are found. `forget`: nanoseconds after the last message of a key
    at which its instance ends; 0: never.
    """

    name: str
    keys: tuple[str, ...]
    most: int
    forget: int = 0


@dataclass(frozen=True)
class ManifestAggregate:
    """
    A value over all instances of a kind: a function of the operand that each has.

    `kind` is an index, `operand` that of a requirement of the kind, and `input` that of the input
    of the bundle's scope.
    """

    function: OverInstances
    kind: int
    operand: int
    input: int


@dataclass(frozen=True)
class ManifestComparison:
    """A comparison that margins can rest on, as written, and the indices of its inputs."""

    text: str
    inputs: tuple[int, ...]


@dataclass(frozen=True)
class ManifestTopic:
    """
    A mapped topic: its type, the indices of its inputs, and the bundle's `qos` for it.

    `made` is what the monitor makes its messages of; None: they are received. `where` is what
    selects its messages, as written, '' without; several topics may then have one name. The name
    may contain an instance variable in braces.
    """

    name: str
    message_type: str
    inputs: tuple[int, ...]
    qos: tuple[tuple[str, str | int], ...]
    made: Made | None = None
    where: str = ''


@dataclass(frozen=True)
class ManifestGroup:
    """A step group: the inputs it reads and the requirements it holds, as indices."""

    inputs: tuple[int, ...]
    requirements: tuple[int, ...]
    state_bytes: int
    operations: int


@dataclass(frozen=True)
class ManifestRequirement:
    """
    A requirement, with the texts that the run-time shows. `inputs` and `group` are indices.

    `constants` are those that its text names, itself or in definitions, as indices.
    `on_violation` and `on_end` are the actions that follow a violation and its end, as indices. A
    lock, which follows both, is in `on_violation`. `horizon`: its verdict is about so many steps
    ago, under the policy timed nanoseconds. `probability`: it is about how often trials succeed.
    """

    id: str
    handler: str
    text: str
    title: str
    formula: str
    report: Report
    severity: Severity
    group: int
    inputs: tuple[int, ...]
    on_violation: tuple[int, ...] = ()
    on_end: tuple[int, ...] = ()
    constants: tuple[int, ...] = ()
    horizon: int = 0
    probability: Probability | None = None

    @property
    def topic(self) -> str:
        """The topic of its violations, relative to the namespace of the node."""
        return HANDLER_TOPIC + self.handler

    @property
    def shown(self) -> str:
        """Its title, or its text if it has none, in one line."""
        return ' '.join((self.title or self.text).split())

    @property
    def sentence(self) -> str:
        """Its title and its text, for the log, in one line."""
        text = ' '.join(self.text.split())
        return f'{self.shown} ({text})' if self.title else text


@frozen
class ManifestAction:
    """
    An action. Times are in nanoseconds, 0 if the bundle gives none.

    `target` is the topic of a lock or of `publish`, the service of `call`, or the node of
    `transition`. `interface` is the type of that topic or service; '' for `transition`. `payload`
    is the serialized message or request (CDR with its header of four bytes, little endian), and
    `stamp_at` the offset of a stamp in it to be filled in when it is sent; `parts` are those of a
    message with keys, which is an action of each instance. `period`: between two messages, 0: one
    message only. `duration`: of publishing at a rate. `timeout`: of each try of a call or
    transition, of which there are `retries` after the first. `after`: how long the violation lasts
    before the action starts. `cooldown`: the least time between two starts. `state`: the state
    that a transition leads to, such as `inactive`.
    """

    name: str
    kind: ActionKind
    target: str
    interface: str
    payload: bytes = b''
    stamp_at: int | None = None
    period: int = 0
    duration: int = 0
    timeout: int = 0
    retries: int = 0
    after: int = 0
    cooldown: int = 0
    state: str = ''
    parts: tuple[PayloadPart, ...] = ()

    @property
    def payload_type(self) -> str:
        """The type of the message in `payload`; '' if there is none."""
        match self.kind:
            case ActionKind.PUBLISH:
                return self.interface
            case ActionKind.CALL:
                return f'{self.interface}_Request'
            case _:
                return ''


@frozen
class ManifestGate:
    """
    A gate. Times are in nanoseconds, 0 if the bundle gives none.

    `source` is the topic that it reads, and `target` the one that it publishes; of a service, the
    one that it offers and the one that it calls. `interface` is the type of both. `topic` is the
    index of `source` in `Manifest.topics` (of a service, of its events); None if no requirement of
    the gate reads it. `hold`:
    how long the last good message is repeated. `substitute` is the serialized message, or the
    response of a service, that is sent instead (CDR with its header of four bytes, little endian);
    `period` is the time between two of these, 0: one for each message withheld. `stamp_at` is the
    offset of a stamp that is filled in when a substitute or held message is sent.
    `open_after`: of a latch, the time without a violation after which it opens. `timeout`: of a
    service, how long a request waits for its answer.
    """

    name: str
    source: str
    target: str
    interface: str
    is_service: bool
    topic: int | None
    otherwise: Otherwise
    hold: int = 0
    substitute: bytes = b''
    period: int = 0
    stamp_at: int | None = None
    is_open_when_stale: bool = False
    latches: bool = False
    open_after: int = 0
    timeout: int = 0

    @property
    def judged_topic(self) -> str:
        """The topic whose inputs are fields of what is judged; of a service, that of its calls."""
        return events_of(self.source) if self.is_service else self.source

    @property
    def payload_type(self) -> str:
        """The type of the message in `substitute`."""
        return f'{self.interface}_Response' if self.is_service else self.interface


@dataclass(frozen=True)
class Manifest:
    """
    The data of a compiled bundle that the run-time needs.

    `symbol` is the exported function that returns the description of the monitor. `bundle_hash`
    is the SHA-256 of what was compiled (bundle, signals files, message definitions),
    `source_hash` of the C text; `sources` are the file names of the generated C. `period` is in
    seconds. `readers` is the exported function that returns the extractors of the topics, '' if
    there are none. `stamp` and `reorder` (nanoseconds) belong to the policy timed. `constants` are
    names with the values that were compiled in, as written. `gate` is the gate that this monitor
    judges for; None: it only reports. `kept` are the gates of the bundle with the ids that they
    keep, which this monitor therefore leaves out. `kinds` are the monitors of the instances of
    `variables`; what stands beside them is of the bundle. `ids` are then those of the requirements
    of all, in the bundle's order. `outputs` is the exported function that returns the outputs of
    the monitor of a kind, '' if there are none, `tests` that which returns the tests of
    probabilities, and `margins` that which returns the margins, '' without; `comparisons` are
    what they number.
    """

    name: str
    symbol: str
    component: str
    policy: Policy
    period: float | None
    inputs: tuple[ManifestInput, ...]
    topics: tuple[ManifestTopic, ...]
    groups: tuple[ManifestGroup, ...]
    requirements: tuple[ManifestRequirement, ...]
    state_bytes: int
    bundle_hash: str
    source_hash: str
    sources: tuple[str, ...]
    readers: str = ''
    stamp: Stamp = Stamp.RECEIVED
    reorder: int = 0
    constants: tuple[tuple[str, str], ...] = ()
    actions: tuple[ManifestAction, ...] = ()
    gate: ManifestGate | None = None
    kept: tuple[tuple[str, tuple[str, ...]], ...] = ()
    variables: tuple[ManifestVariable, ...] = ()
    kinds: tuple['ManifestKind', ...] = ()
    aggregates: tuple[ManifestAggregate, ...] = ()
    ids: tuple[str, ...] = ()
    outputs: str = ''
    tests: str = ''
    margins: str = ''
    comparisons: tuple[ManifestComparison, ...] = ()

    @property
    def margin_topics(self) -> tuple[str, ...]:
        """The topic of the margins of each requirement, as numbered; () without margins."""
        return tuple(margin_topic(item.handler) for item in self.numbered) \
            if self.has_margins else ()

    @property
    def has_margins(self) -> bool:
        """Whether it is compiled with margins."""
        return any((self.margins, *(kind.manifest.margins for kind in self.kinds)))

    @property
    def numbered(self) -> tuple[ManifestRequirement, ...]:
        """The requirements as an engine numbers them: of the bundle's scope, then of the kinds."""
        return (*self.requirements, *(item for kind in self.kinds
                                      for item in kind.manifest.requirements[:kind.n_reported]))

    @property
    def kind_of(self) -> tuple[int | None, ...]:
        """Of each of these, the index of its kind; None of the bundle's scope."""
        return (None,) * len(self.requirements) + tuple(
            place for place, kind in enumerate(self.kinds) for _ in range(kind.n_reported))

    @property
    def variables_of(self) -> tuple[tuple[str, ...], ...]:
        """Of each of these, the instance variables; () of the bundle's scope."""
        return tuple(() if place is None else tuple(
            item.name for item in self.mentioned(place)) for place in self.kind_of)

    def mentioned(self, kind: int) -> tuple[ManifestVariable, ...]:
        """Return the variables of a kind: one, or the two of pairs."""
        return tuple(self.variables[place] for place in self.kinds[kind].variables)

    def most(self, kind: int) -> int:
        """Return how many instances of a kind there are at one time at most."""
        return math.prod(item.most for item in self.mentioned(kind))

    def forget(self, kind: int) -> int:
        """Return when an instance of a kind ends after the last message of its key; 0: never."""
        return min((item.forget for item in self.mentioned(kind) if item.forget), default=0)

    def listed(self, kind: int) -> list[bytes]:
        """Return the keys of the instances of a kind that are there from the start."""
        keys = [[key.encode() for key in item.keys] for item in self.mentioned(kind)]
        return [pair_key(*pair) if len(pair) > 1 else pair[0]
                for pair in product(*keys)] if self.base_of(kind) == kind else []

    def halves(self, kind: int) -> 'list[ManifestHalf]':
        """Return the two halves of a kind of pairs; [] of one variable."""
        mentioned = self.kinds[kind].variables
        return [self._half(kind, place) for place in mentioned] if len(mentioned) > 1 else []

    def _half(self, kind: int, variable: int) -> 'ManifestHalf':
        single = next((place for place, item in enumerate(self.kinds)
                       if item.variables == (variable,)), None)
        names = [] if single is None else [
            None if shared is not None else item.name for item, shared in zip(
                self.kinds[single].manifest.inputs, self.kinds[single].shared, strict=True)]
        return ManifestHalf(self.variables[variable], single, tuple(
            names.index(item.name) if item.name in names else None
            for item in self.kinds[kind].manifest.inputs))

    def base_of(self, kind: int) -> int:
        """Return the first kind whose instances a kind has: they begin and end together."""
        return next(place for place, item in enumerate(self.kinds)
                    if item.variables == self.kinds[kind].variables)

    @property
    def bases(self) -> list[tuple[int, 'ManifestKind']]:
        """The kinds that are their own base, each with its index, those of pairs at last."""
        return sorted(((place, item) for place, item in enumerate(self.kinds)
                       if self.base_of(place) == place), key=lambda item: len(item[1].variables))

    def keyed(self, kind: int, topic: int) -> tuple[int, ...]:
        """Return the inputs with a value for each key that a topic feeds; none with a base."""
        own = self.own_inputs(kind)
        return tuple(index for index in self.kinds[kind].manifest.topics[topic].inputs
                     if index in own)

    def own_inputs(self, kind: int) -> list[int]:
        """Return the inputs with a value for each key, or for each pair; none with a base."""
        halves = self.halves(kind)
        return [index for index, shared in enumerate(self.kinds[kind].shared)
                if shared is None and all(half.inputs[index] is None for half in halves)] \
            if self.base_of(kind) == kind else []

    def of_base(self, kind: int) -> tuple[int | None, ...] | None:
        """Return, of each input with a value for each key, the same of the base; None: no base."""
        base = self.base_of(kind)
        if base == kind:
            return None
        names = [item.name for item in self.kinds[base].manifest.inputs]
        own = self.kinds[kind]
        return tuple(names.index(item.name) if own.shared[place] is None else None
                     for place, item in enumerate(own.manifest.inputs))

    def key_of(self, topic: ManifestTopic) -> ManifestVariable | None:
        """Return the instance variable in a topic's name: it is then many topics of ROS."""
        return next((item for item in self.variables if f'{{{item.name}}}' in topic.name), None)

    @property
    def read(self) -> set[int]:
        """The inputs of the bundle's scope that requirements read, but for aggregates."""
        found = {index for group in self.groups for index in group.inputs}
        found |= {index for kind in self.kinds for index in kind.shared if index is not None}
        return found - {item.input for item in self.aggregates}

    def operand_of(self, item: ManifestAggregate) -> int:
        """Return the operand as an engine numbers it: a requirement, of a number its output."""
        if item.function.takes_truth:
            return item.operand
        return sum(other.kind == item.kind and not other.function.takes_truth
                   and other.operand < item.operand for other in self.aggregates)

    @property
    def made(self) -> frozenset[int]:
        """The indices of the topics whose messages the monitor makes."""
        return frozenset(index for index, topic in enumerate(self.topics) if topic.made)

    @property
    def received(self) -> tuple[ManifestTopic, ...]:
        """The topics of ROS, whose messages are received."""
        return tuple(topic for topic in self.topics if not topic.made)

    def made_of(self, kind: MadeKind) -> dict[int, tuple[str, ...]]:
        """Return the topics whose messages are made of a kind of thing, with its names."""
        return {index: topic.made.names for index, topic in enumerate(self.topics)
                if topic.made and topic.made.kind is kind}

    @property
    def in_graph(self) -> dict[int, Made]:
        """The topics whose messages are made of what is in the graph of ROS."""
        return {index: topic.made for index, topic in enumerate(self.topics)
                if topic.made and topic.made.kind.is_in_graph}

    @property
    def watched(self) -> dict[int, Made]:
        """What is looked for in the graph of ROS: it is there, or is asked when it is."""
        return {index: topic.made for index, topic in enumerate(self.topics)
                if topic.made and topic.made.kind is not MadeKind.TRANSFORM}

    @property
    def derived(self) -> dict[int, tuple[Made, int]]:
        """The topics whose messages are made of another one's, which comes second."""
        places = {topic.name: index for index, topic in enumerate(self.topics)}
        return {index: (topic.made, places[topic.made.sources[0].name])
                for index, topic in enumerate(self.topics)
                if topic.made and topic.made.kind.is_asked_for}

    @property
    def subscribed(self) -> tuple[ManifestTopic, ...]:
        """What a node subscribes to: `received`, then the source of a gate that no input reads."""
        return (*self.received, *self.judged)

    @property
    def judged(self) -> tuple[ManifestTopic, ...]:
        """The source of a gate that no input reads, if there is one."""
        gate = self.gate
        if gate is None or gate.is_service or gate.topic is not None:
            return ()
        return (ManifestTopic(gate.source, gate.interface, (), ()),)

    def to_json(self) -> str:
        """Return the JSON text; equal manifests give equal texts."""
        content = {'format': FORMAT, **asdict(self)}
        return json.dumps(content, indent=1, default=_plain, ensure_ascii=False) + '\n'

    @classmethod
    def from_json(cls, text: str) -> 'Manifest':
        """
        Read what `to_json` wrote.

        Raises
        ------
        ManifestError
            if the text is not JSON, has another format number, or a value is invalid; the message
            contains the key of that value.
        """
        try:
            content = _Value('', json.loads(text))
        except (ValueError, RecursionError) as error:
            raise ManifestError(f'not a manifest of fret_monitor ({error})') from None
        number = content['format'].natural()
        if number != FORMAT:
            raise ManifestError(f'manifest has format {str(number)[:20]}, this version reads '
                                f'{FORMAT}: compile the bundle again')
        return _manifest(content)


@dataclass(frozen=True)
class ManifestHalf:
    """
    One of the two variables of a kind of pairs.

    `kind` is that of the variable alone, None if there is none; `inputs` has the index there of
    each input of the kind of pairs that mentions the variable alone, None of the others.
    """

    variable: ManifestVariable
    kind: int | None
    inputs: tuple[int | None, ...]


@dataclass(frozen=True)
class ManifestKind:
    """
    The monitor of what there is one of for each key of some variables (indices): of one, or two.

    `shared` has the index of each input in the bundle's scope; None for one that has a value for
    each key. The first `n_reported` requirements are those of the bundle; the others are operands
    of aggregates. The topics of `manifest` feed aggregates, too: those with an operand that reads
    an input of them. A kind that reads aggregates comes after those of their operands; there may
    be one before it with the same variables, its base.
    """

    variables: tuple[int, ...]
    manifest: Manifest
    shared: tuple[int | None, ...]
    n_reported: int


def shared_handlers(
    manifests: Sequence[Manifest],
) -> Iterator[tuple[tuple[int, ManifestRequirement], tuple[int, ManifestRequirement]]]:
    """Yield two requirements that one handler would announce, each with its bundle's number."""
    first: dict[str, tuple[int, ManifestRequirement]] = {}
    for number, manifest in enumerate(manifests):
        for item in manifest.numbered:
            other = first.setdefault(item.handler, (number, item))
            if other[1] is not item:
                yield other, (number, item)


def followed(manifest: Manifest) -> list[tuple[tuple[int, ...], tuple[int, ...]]]:
    """
    Return the actions on violation and on end of each requirement, without locks.

    They are numbered as the actions that are no locks.
    """
    others = [place for place, item in enumerate(manifest.actions)
              if item.kind is not ActionKind.LOCK]
    numbers = {place: number for number, place in enumerate(others)}

    def of(places: tuple[int, ...]) -> tuple[int, ...]:
        return tuple(numbers[place] for place in places if place in numbers)
    return [(of(item.on_violation), of(item.on_end)) for item in manifest.numbered]


def _plain(value: object) -> object:
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, bytes):
        return value.hex()
    if isinstance(value, Fraction):
        return str(value)
    raise TypeError(f'{value!r} is not part of a manifest')


@dataclass(frozen=True)
class _Value:
    """A value of the JSON text with its key; each method checks the type and returns it."""

    key: str
    found: object

    def refuse(self, wanted: str) -> NoReturn:
        shown = ascii(self.found) if isinstance(self.found, str | int | float | None) \
            else type(self.found).__name__
        raise ManifestError(f"not a manifest of fret_monitor ({self.key or 'the whole'} must be "
                            f'{wanted}, not {shown[:40]})')

    def __getitem__(self, name: str) -> '_Value':
        key = f'{self.key}.{name}' if self.key else name
        if not isinstance(self.found, dict):
            self.refuse('an object')
        if name not in self.found:
            raise ManifestError(f'not a manifest of fret_monitor ({key} is missing)')
        return _Value(key, self.found[name])

    def share(self) -> Fraction:
        """Return a number between 0 and 1, as a fraction."""
        text = self.text()
        if not _FRACTION.fullmatch(text) or not LEAST <= Fraction(text) <= 1 - LEAST:
            self.refuse('a fraction between 0 and 1')
        return Fraction(text)

    def items(self) -> list['_Value']:
        if not isinstance(self.found, list):
            self.refuse('a list')
        return [_Value(f'{self.key}[{place}]', item) for place, item in enumerate(self.found)]

    def pairs(self) -> list[tuple['_Value', '_Value']]:
        found = []
        for item in self.items():
            pair = item.items()
            if len(pair) != 2:
                item.refuse('a list of two')
            found.append((pair[0], pair[1]))
        return found

    def text(self) -> str:
        if not isinstance(self.found, str):
            self.refuse('a text')
        try:
            self.found.encode()
        except UnicodeEncodeError:
            self.refuse('a text in Unicode')  # half of a surrogate pair
        return self.found

    def symbol(self) -> str:
        text = self.text()
        if not _SYMBOL.fullmatch(text):
            self.refuse('a name in C')
        return text

    def symbol_or_empty(self) -> str:
        return '' if self.found == '' else self.symbol()

    def text_or_none(self) -> str | None:
        return None if self.found is None else self.text()

    def whole(self, wanted: str = 'a whole number') -> int:
        if not isinstance(self.found, int) or isinstance(self.found, bool):
            self.refuse(wanted)
        return self.found

    def whole_or_none(self) -> int | None:
        return None if self.found is None else self.whole()

    def truth(self) -> bool:
        return self.found if isinstance(self.found, bool) else self.refuse('true or false')

    def natural(self) -> int:
        number = self.whole('a whole number from 0')
        return number if number >= 0 else self.refuse('a whole number from 0')

    def nanoseconds(self) -> int:
        number = self.natural()
        return number if number < 2 ** 62 else self.refuse('a whole number of nanoseconds')

    def natural_or_none(self) -> int | None:
        return None if self.found is None else self.natural()

    def data(self) -> bytes:
        text = self.text()
        return bytes.fromhex(text) if _HEX.fullmatch(text) else self.refuse('bytes in hexadecimal')

    def text_or_whole(self) -> str | int:
        return self.text() if isinstance(self.found, str) else self.whole('a text or whole number')

    def step(self) -> Step:
        if isinstance(self.found, str):
            return self.text()
        if not isinstance(self.found, dict):
            return self.natural()
        if {'start', 'stop'} & self.found.keys():
            return Slice(self['start'].whole_or_none(), self['stop'].whole_or_none())
        if {'first', 'width'} & self.found.keys():
            return Sector(float(self['first'].number('a number')),
                          float(self['width'].number('a number')), self['written'].text())
        key = tuple(item.text() for item in self['key'].items()) or self['key'].refuse('a path')
        return LookUp(key, self['name'].text(), self['is_parallel'].truth(),
                      self['variable'].text())

    def index(self, count: int) -> int:
        number = self.natural()
        return number if number < count else self.refuse(f'an index below {count}')

    def indices(self, count: int) -> tuple[int, ...]:
        return tuple(item.index(count) for item in self.items())

    def choice(self, kind: type[_Choice]) -> _Choice:
        return kind(self.one_of([str(member.value) for member in kind]))

    def one_of(self, words: Sequence[str]) -> str:
        if not isinstance(self.found, str) or self.found not in words:
            self.refuse('one of ' + ', '.join(filter(None, words)))
        return self.found

    def number(self, wanted: str) -> int | float:
        if not isinstance(self.found, int | float) or isinstance(self.found, bool):
            self.refuse(wanted)
        try:
            float(self.found)
        except OverflowError:
            self.refuse(wanted)
        return self.found

    def period(self, policy: Policy) -> float | None:
        return self.seconds(is_optional=policy is not Policy.PERIODIC)

    def seconds(self, is_optional: bool = True) -> float | None:
        if self.found is None and is_optional:
            return None
        wanted = 'a number of seconds above 0'
        seconds = self.number(wanted)
        return seconds if 0 < seconds < math.inf else self.refuse(wanted)

    def initial(self, kind: ValueType) -> bool | int | float | None:
        if self.found is None:
            return None
        if kind is ValueType.BOOL:
            return self.truth()
        if kind.is_float:
            return self.number('a number')
        low, high = kind.limits
        number = self.whole()
        return number if low <= number <= high else self.refuse(f'a number of {kind.value}')


def _manifest(content: _Value) -> Manifest:
    inputs = tuple(_input(item) for item in content['inputs'].items())
    groups, requirements = content['groups'].items(), content['requirements'].items()
    topics = content['topics'].items()
    actions = tuple(_action(item, len(content['variables'].items()))
                    for item in content['actions'].items())
    policy = content['policy'].choice(Policy)
    constants = tuple((name.text(), value.text()) for name, value in content['constants'].pairs())
    return Manifest(
        name=content['name'].text(),
        symbol=content['symbol'].symbol(),
        component=content['component'].text(),
        policy=policy,
        period=content['period'].period(policy),
        inputs=inputs,
        topics=tuple(_topic(item, len(inputs)) for item in topics),
        groups=tuple(_group(item, len(inputs), len(requirements)) for item in groups),
        requirements=tuple(
            _requirement(item, len(inputs), len(groups), len(actions), len(constants))
            for item in requirements),
        state_bytes=content['state_bytes'].natural(),
        bundle_hash=content['bundle_hash'].text(),
        source_hash=content['source_hash'].text(),
        sources=tuple(item.text() for item in content['sources'].items()),
        readers=content['readers'].symbol_or_empty(),
        stamp=content['stamp'].choice(Stamp),
        reorder=content['reorder'].nanoseconds(),
        constants=constants,
        actions=actions,
        gate=None if content['gate'].found is None else _gate(content['gate'], len(topics)),
        kept=tuple((name.text(), tuple(item.text() for item in ids.items()))
                   for name, ids in content['kept'].pairs()),
        variables=tuple(map(_variable, content['variables'].items())),
        kinds=tuple(_kind(item, len(content['variables'].items()), len(inputs))
                    for item in content['kinds'].items()),
        aggregates=tuple(_aggregate(item, content['kinds'].items(), len(inputs))
                         for item in content['aggregates'].items()),
        ids=tuple(item.text() for item in content['ids'].items()),
        outputs=content['outputs'].symbol_or_empty(),
        tests=content['tests'].symbol_or_empty(),
        margins=content['margins'].symbol_or_empty(),
        comparisons=tuple(
            ManifestComparison(item['text'].text(), item['inputs'].indices(len(inputs)))
            for item in content['comparisons'].items()),
    )


def _variable(item: _Value) -> ManifestVariable:
    return ManifestVariable(item['name'].text(), tuple(key.text() for key in item['keys'].items()),
                            item['most'].natural(), item['forget'].nanoseconds())


def _kind(item: _Value, variables: int, inputs: int) -> ManifestKind:
    manifest = _manifest(item['manifest'])
    return ManifestKind(
        item['variables'].indices(variables), manifest,
        tuple(None if place.found is None else place.index(inputs)
              for place in item['shared'].items()),
        item['n_reported'].index(len(manifest.requirements) + 1))


def _aggregate(item: _Value, kinds: list[_Value], inputs: int) -> ManifestAggregate:
    kind = item['kind'].index(len(kinds))
    operands = len(kinds[kind]['manifest']['requirements'].items())
    return ManifestAggregate(item['function'].choice(OverInstances), kind,
                             item['operand'].index(operands), item['input'].index(inputs))


def _input(item: _Value) -> ManifestInput:
    value_type = item['value_type'].choice(ValueType)
    return ManifestInput(
        name=item['name'].text(),
        value_type=value_type,
        topic=item['topic'].text_or_none(),
        message_type=item['message_type'].text_or_none(),
        path=tuple(step.step() for step in item['path'].items()),
        values=tuple((name.text(), value.text_or_whole())
                     for name, value in item['values'].pairs()),
        initial=item['initial'].initial(value_type),
        reduction=item['reduction'].one_of(('', SECONDS, *REDUCTIONS)),
        timeout=item['timeout'].seconds(),
        stale=item['stale'].choice(Stale),
        startup=item['startup'].seconds(),
        source=item['source'].choice(InputSource),
        window=item['window'].nanoseconds(),
        room=item['room'].index(2 ** 32),
    )


def _topic(item: _Value, inputs: int) -> ManifestTopic:
    return ManifestTopic(
        name=item['name'].text(),
        message_type=item['message_type'].text(),
        inputs=item['inputs'].indices(inputs),
        qos=tuple((key.text(), value.text_or_whole()) for key, value in item['qos'].pairs()),
        made=None if item['made'].found is None else _made(item['made']),
        where=item['where'].text(),
    )


def _made(item: _Value) -> Made:
    return Made(item['kind'].choice(MadeKind),
                tuple(name.text() for name in item['names'].items()),
                item['patience'].seconds(is_optional=False) or 0.0)


def _group(item: _Value, inputs: int, requirements: int) -> ManifestGroup:
    return ManifestGroup(
        inputs=item['inputs'].indices(inputs),
        requirements=item['requirements'].indices(requirements),
        state_bytes=item['state_bytes'].natural(),
        operations=item['operations'].natural(),
    )


def _requirement(item: _Value, inputs: int, groups: int, actions: int,
                 constants: int) -> ManifestRequirement:
    return ManifestRequirement(
        id=item['id'].text(),
        handler=item['handler'].text(),
        text=item['text'].text(),
        title=item['title'].text(),
        formula=item['formula'].text(),
        report=item['report'].choice(Report),
        severity=item['severity'].choice(Severity),
        group=item['group'].index(groups),
        inputs=item['inputs'].indices(inputs),
        constants=item['constants'].indices(constants),
        on_violation=item['on_violation'].indices(actions),
        on_end=item['on_end'].indices(actions),
        horizon=item['horizon'].natural(),
        probability=_probability(item['probability']),
    )


def _probability(item: _Value) -> Probability | None:
    if item.found is None:
        return None
    relation = item['relation'].text()
    if relation not in RELATIONS:
        item['relation'].refuse(f'one of {" ".join(RELATIONS)}')
    return Probability(relation, item['bound'].share(), item['confidence'].share())


def _parts(item: _Value, payload: bytes, variables: int) -> tuple[PayloadPart, ...]:
    found = tuple(_part(each, variables) for each in item.items())
    of_bytes = [part for part in found if part.kind is PartKind.BYTES]
    if sum(part.size for part in of_bytes) > max(0, len(payload) - _HEADER_BYTES) or any(
            part.at + part.size > len(payload) for part in of_bytes):
        item.refuse('parts of the payload')
    return found


def _part(item: _Value, variables: int) -> PayloadPart:
    if item['align'].found not in (1, 2, 4, 8):
        item['align'].refuse('1, 2, 4 or 8')
    if item['kind'].found == PartKind.NUMBER.value and item['size'].found not in (1, 2, 4, 8):
        item['size'].refuse('1, 2, 4 or 8')
    return PayloadPart(
        item['kind'].choice(PartKind), item['align'].natural(), item['at'].index(_MOST_BYTES),
        item['size'].index(_MOST_BYTES), item['keys'].indices(variables))


def _action(item: _Value, variables: int) -> ManifestAction:
    payload = item['payload'].data()
    return ManifestAction(
        name=item['name'].text(),
        kind=item['kind'].choice(ActionKind),
        target=item['target'].text(),
        interface=item['interface'].text(),
        payload=payload,
        parts=_parts(item['parts'], payload, variables),
        stamp_at=item['stamp_at'].natural_or_none(),
        period=item['period'].nanoseconds(),
        duration=item['duration'].nanoseconds(),
        timeout=item['timeout'].nanoseconds(),
        retries=item['retries'].natural(),
        after=item['after'].nanoseconds(),
        cooldown=item['cooldown'].nanoseconds(),
        state=item['state'].text(),
    )


def _gate(item: _Value, topics: int) -> ManifestGate:
    return ManifestGate(
        name=item['name'].text(),
        source=item['source'].text(),
        target=item['target'].text(),
        interface=item['interface'].text(),
        is_service=item['is_service'].truth(),
        topic=None if item['topic'].found is None else item['topic'].index(topics),
        otherwise=item['otherwise'].choice(Otherwise),
        hold=item['hold'].nanoseconds(),
        substitute=item['substitute'].data(),
        period=item['period'].nanoseconds(),
        stamp_at=item['stamp_at'].natural_or_none(),
        is_open_when_stale=item['is_open_when_stale'].truth(),
        latches=item['latches'].truth(),
        open_after=item['open_after'].nanoseconds(),
        timeout=item['timeout'].nanoseconds(),
    )
