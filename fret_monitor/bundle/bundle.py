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
The bundle as written: every scalar with its place, checked for shape, with no meaning yet.

`read_bundle` takes a file and returns a frozen `Bundle`, with its `signals` files merged in; all
problems of shape are told in one `CompileError`. What names and formulas mean, and whether types
fit, is for `logic`. `survey_bundle` returns what can be used of a bundle that has problems, so
that the problems of its formulas can be told in the same run.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from enum import Enum
from fractions import Fraction
import os
from pathlib import Path
import re

from fret_monitor.bundle.yaml_repair import quoted_line, tell_misread
from fret_monitor.bundle.yaml_shape import kind_of, mapping_of, Shape, tell_choice, text_of
from fret_monitor.bundle.yaml_tree import (
    Node, read_tree, Unread, YamlList, YamlMapping, YamlScalar,
)
from fret_monitor.model.diagnostics import CompileError, Problems, refuse, Source, Span, Text
from fret_monitor.model.names import (
    exact, Fault, fret_name, handler_fault, is_integer, LONGEST_PATH, looks_like_number,
    name_fault, number_fault, PLAIN_TYPES, quoted_name_fault, shown, topic_fault, type_fault,
)
from fret_monitor.model.policies import Policy, Report, Severity, Stale


class Language(Enum):
    """The language of a requirement or definition; the value is its key in the bundle."""

    FRETISH = 'fretish'
    PTLTL = 'ptltl'
    COCOSPEC = 'cocospec'


@dataclass(frozen=True, eq=False)
class ConstantEntry:
    """`name: value` under `constants`; `value` is a number or true/false as written."""

    name: Text
    value: Text


@dataclass(frozen=True, eq=False)
class ValueEntry:
    """One `NAME: value` under an input's `values`; a quoted value is a string."""

    name: Text
    value: Text
    is_string: bool


@dataclass(frozen=True, eq=False)
class InputEntry:
    """
    An input; `field` is the path as written, None where it was left out.

    `damaged` are the keys whose values were refused, and 'name' where its name was; `places` says
    where the keys are that inputs on one topic must agree in.
    """

    name: Text
    topic: Text | None
    type: Text | None
    field: Text | None
    initial: Text | None
    values: tuple[ValueEntry, ...]
    qos: tuple[tuple[Text, Text], ...]
    timeout: Fraction | None
    stale: Stale | None
    damaged: frozenset[str] = frozenset()
    places: tuple[tuple[str, Span], ...] = ()


@dataclass(frozen=True, eq=False)
class Definition:
    """A named expression."""

    name: Text
    language: Language
    text: Text


@dataclass(frozen=True, eq=False)
class Requirement:
    """An id and a property in one of the languages; `report` and `severity` with defaults in."""

    id: Text
    language: Language
    text: Text
    title: str
    rationale: str
    report: Report
    severity: Severity

    @property
    def handler(self) -> str:
        """The name of its handler, as `handler_name` says."""
        return handler_name(self.id.value)


def handler_name(id: str) -> str:
    """Return `handlerprop` and the id, with `_` for what C and ROS refuse."""
    letters = (c if c.isascii() and (c.isalnum() or c == '_') else '_' for c in id)
    return 'handlerprop' + ''.join(letters)


@dataclass(frozen=True, eq=False)
class Bundle:
    """
    A whole bundle. `sources` are the files it was read from, the bundle itself first.

    `name` is the file's stem. `period` is in seconds, exact, None but with the policy periodic.
    `unreadable` are names that are declared in a way that was refused (see `survey_bundle`); an
    input of these is in `inputs` all the same, with what could be read of it.
    """

    name: str
    sources: tuple[Source, ...]
    component: Text | None
    title: str
    description: str
    constants: tuple[ConstantEntry, ...]
    inputs: tuple[InputEntry, ...]
    definitions: tuple[Definition, ...]
    policy: Policy
    period: Fraction | None
    requirements: tuple[Requirement, ...]
    unreadable: frozenset[str] = frozenset()


FORMAT = '1'
MAX_BYTES = 16 * 2 ** 20

_SHORTEST = Fraction(1, 10 ** 9)  # seconds: ROS counts time in nanoseconds
_SHORTEST_TIMEOUT = Fraction(1, 10 ** 3)  # seconds: nobody looks more often
_LONGEST = Fraction(10 ** 9)
_FORMULA_KEYS = tuple(language.value for language in Language)
_FORMULA_SLIPS = {
    'formula': 'ptltl', 'smv': 'ptltl', 'ltl': 'ptltl', 'mtl': 'ptltl', 'ptmtl': 'ptltl',
    'pastltl': 'ptltl', 'lustre': 'cocospec', 'text': 'fretish', 'sentence': 'fretish',
    'name': 'id', 'reqid': 'id',
}
_SIGNALS_KEYS = ('format', 'title', 'description', 'constants', 'inputs')
_BUNDLE_KEYS = (
    'format', 'component', 'title', 'description', 'signals', 'constants', 'inputs',
    'definitions', 'evaluation', 'report', 'severity', 'requirements')
_ELSEWHERE = dict.fromkeys(
    ('policy', 'period', 'rate'),
    'it stands under evaluation, as in\nevaluation: {policy: periodic, period: 0.1}')
_INPUT_KEYS = ('topic', 'type', 'field', 'initial', 'values', 'qos', 'timeout', 'stale')
_REQUIREMENT_KEYS = ('id', *_FORMULA_KEYS, 'title', 'rationale', 'report', 'severity')
_QOS = {
    'reliability': ('reliable', 'best_effort'),
    'durability': ('volatile', 'transient_local'),
    'history': ('keep_last', 'keep_all'),
    'depth': (),
}
_COMMENT = re.compile(r'[ \t]+(#[^\r\n]*)')
_EXAMPLE = """\
format: 1
inputs:
  speed: {topic: speed, type: std_msgs/msg/Float32}
requirements:
  - id: R1
    ptltl: "H (speed <= 2.0)\""""


def read_bundle(path: Path) -> Bundle:
    """
    Read a bundle from a file, with its `signals` files.

    Raises
    ------
    CompileError
        with all problems of all files, if there are any.
    """
    problems = Problems()
    bundle = survey_bundle(path, problems)
    problems.raise_errors()
    assert bundle is not None, 'a bundle that cannot be read has a problem'
    return bundle


def parse_bundle(source: Source, directory: Path) -> Bundle:
    """
    Read a bundle from a text; `signals` files are looked for in `directory`.

    Raises
    ------
    CompileError
        with all problems of all files, if there are any.
    """
    problems = Problems()
    bundle = _BundleReader(directory, problems).bundle(source)
    problems.raise_errors()
    assert bundle is not None, 'a bundle that cannot be read has a problem'
    return bundle


def survey_bundle(path: Path, problems: Problems, *,
                  needs_period: bool = True) -> Bundle | None:
    """
    Read what can be used of a bundle, and add what is wrong with it to `problems`.

    The names that were declared but cannot be used are in `Bundle.unreadable`: formulas that use
    them have no problem of their own, unless what was refused of an input does not matter to
    them. Returns None where nothing can be used. A bundle with the policy periodic has to say a
    period unless that is given otherwise: without `needs_period`.
    """
    try:
        source = read_source(path)
    except CompileError as error:
        problems.extend(error.diagnostics)
        return None
    return _BundleReader(path.parent, problems, needs_period).bundle(source)


def read_source(path: Path, max_bytes: int = MAX_BYTES) -> Source:
    """
    Read a text file of at most `max_bytes` in UTF-8, with or without a byte order mark.

    Raises
    ------
    CompileError
        if there is no such file, or it is something else.
    """
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
           'it is in UTF-16' if is_wide else 'this byte begins no character',
           'save it as UTF-8')


class _BundleReader:
    """Reads one bundle: what it finds goes into the bundle or, told, into the problems."""

    def __init__(self, directory: Path, problems: Problems, needs_period: bool = True) -> None:
        self._directory = directory
        self._problems = problems
        self._needs_period = needs_period
        self._declared: dict[str, Text] = {}
        self._unreadable: set[str] = set()

    def bundle(self, source: Source) -> Bundle | None:
        """Read a bundle, None where nothing of it can be used."""
        mapping = self._root(source, 'the bundle', _EXAMPLE)
        if mapping is None or not self._has_format(mapping, is_required=True):
            return None
        shape = Shape(mapping, 'a bundle', _BUNDLE_KEYS, self._problems, elsewhere=_ELSEWHERE)
        read = self._contents(source, shape)
        shared = self._signals(source, shape)
        definitions = tuple(self._definitions(shape))
        inputs = (*read.inputs, *(item for part in shared for item in part.inputs))
        self._check_topics(inputs)
        return replace(
            read,
            sources=(source, *(part.sources[0] for part in shared)),
            constants=(*read.constants, *(item for part in shared for item in part.constants)),
            inputs=inputs,
            definitions=definitions,
            requirements=tuple(self._requirements(shape)),
            unreadable=frozenset(self._unreadable),
        )

    def _root(self, source: Source, what: str, example: str) -> YamlMapping | None:
        problems = Problems()
        root = read_tree(source, problems)
        self._problems.extend(problems.errors)
        if isinstance(root, YamlMapping):
            return root
        if root is None and not problems.errors or root is not None and _is_empty(root):
            self._problems.error(f'{what} is empty', Span(source, 0, 0),
                                 help=f'it begins like this:\n{example}')
        elif root is not None:
            mapping_of(root, what, self._problems, f'it begins like this:\n{example}')
        return None

    def _has_format(self, mapping: YamlMapping, is_required: bool) -> bool:
        """Return whether this is a format we read; of another nothing more can be said."""
        for key, node in mapping.entries:
            if key.value == 'format':
                text = text_of(node, "'format'", self._problems)
                if text is not None and text.value != FORMAT:
                    self._problems.error(f'format {shown(text.value)} is not known', text.span,
                                         f'this version reads format {FORMAT}', 'format: 1')
                return text is None or text.value == FORMAT
        if is_required:
            self._problems.error("the bundle does not say its 'format'", mapping.span,
                                 'write this line first', 'format: 1')
        return True

    def _contents(self, source: Source, shape: Shape) -> Bundle:
        """Read all but signals, definitions and requirements."""
        policy, period = self._evaluation(shape)
        return Bundle(
            name=Path(source.name).stem,
            sources=(source,),
            component=shape.text('component'),
            title=shape.free_text('title'),
            description=shape.free_text('description'),
            constants=tuple(self._constants(shape)),
            inputs=tuple(self._inputs(shape)),
            definitions=(),
            policy=policy,
            period=period,
            requirements=(),
        )

    def _evaluation(self, shape: Shape) -> tuple[Policy, Fraction | None]:
        node = shape.node('evaluation')
        mapping = mapping_of(node, "'evaluation'", self._problems, 'policy: every_message')
        if mapping is None:
            return Policy.EVERY_MESSAGE, None
        part = Shape(mapping, "'evaluation'", ('policy', 'period', 'rate'), self._problems)
        text = part.text('policy')
        words = [policy.value for policy in Policy]
        if text is not None and text.value not in words:
            tell_choice(text, 'policy', words, self._problems)
        is_known = part.lacks('policy') or text is not None and text.value in words
        policy = Policy(text.value) if text and is_known else Policy.EVERY_MESSAGE
        key = shape.key('evaluation')
        return policy, self._period(part, key.span if key else part.span, policy, is_known)

    def _period(self, part: Shape, place: Span, policy: Policy,
                is_known: bool) -> Fraction | None:
        """Read `period` or `rate`; both are read so that both are checked."""
        period = part.positive('period', 'seconds', _SHORTEST, _LONGEST)
        rate = part.positive('rate', 'steps a second (Hz)', 1 / _LONGEST, 1 / _SHORTEST)
        keys = [key for key in (part.key('period'), part.key('rate')) if key]
        if len(keys) == 2:
            self._problems.error("'period' and 'rate' say the same", keys[1].span,
                                 f"'{keys[0].value}' is there already", 'remove one of them')
        elif keys and is_known and policy is not Policy.PERIODIC:
            self._problems.error(
                f"'{keys[0].value}' goes with the policy periodic only", keys[0].span,
                f'the policy is {policy.value}', 'policy: periodic')
        elif (part.lacks('period', 'rate') and policy is Policy.PERIODIC
              and self._needs_period):
            self._problems.error("the policy periodic needs a 'period' or a 'rate'", place,
                                 help='period: 0.1   # seconds')
        if policy is not Policy.PERIODIC:
            return None
        return 1 / rate if rate is not None else period

    def _constants(self, shape: Shape) -> Iterator[ConstantEntry]:
        for name, node in self._named(shape, 'constants', 'cc_t: 15.0'):
            problems = Problems()
            self._declare(name, problems)
            text = text_of(node, f'the constant {shown(name.value)}', problems)
            if text is not None and text.value.lower() not in ('true', 'false'):
                _tell(number_fault(text.value), text, problems)
            if self._is_usable(name, node, problems) and text is not None:
                yield ConstantEntry(name.text, text)

    def _named(self, shape: Shape, key: str, example: str) -> Iterator[tuple['_Name', Node]]:
        """Yield what stands under `constants`, `inputs` or `definitions`."""
        mapping = mapping_of(shape.node(key), f"'{key}'", self._problems, example)
        for name, node in mapping.entries if mapping else ():
            yield _name(name), node

    def _declare(self, name: '_Name', problems: Problems) -> None:
        """Take a name; two may not differ in FRET's spelling only (`a.b` and `a_DOT_b`)."""
        fault = (quoted_name_fault if name.is_quoted else name_fault)(name.value)
        first = self._declared.setdefault(fret_name(name.value), name.text)
        if fault is not None:
            problems.error(fault.reason, name.span, 'not a name', fault.help)
        elif first is not name.text:
            problems.error(
                f'{shown(name.value)} is declared twice', name.span,
                f'first in {_line_of(first, name.span)}', 'choose another name for one of them')

    def _is_usable(self, name: '_Name', node: Node, problems: Problems) -> bool:
        """Pass on the problems of an entry; return whether it has none."""
        self._problems.extend(problems.errors)
        is_usable = not problems.errors and not isinstance(node, Unread)
        if not is_usable:
            self._unreadable.add(name.value)
        return is_usable

    def _inputs(self, shape: Shape) -> Iterator[InputEntry]:
        inputs = list(self._named(
            shape, 'inputs', 'speed: {topic: speed, type: std_msgs/msg/Float32}'))
        for (name, node), (following, after) in zip(inputs, [*inputs[1:], *inputs[-1:]]):
            if isinstance(node, YamlScalar) and name.value in _INPUT_KEYS:
                self._tell_outdented(name)
                continue
            problems = Problems()
            if (_is_empty(node) and isinstance(after, YamlScalar)
                    and following.value in _INPUT_KEYS):
                self._unreadable.add(name.value)
                continue
            self._declare(name, problems)
            damaged = {'name'} if problems.errors else set()
            what = f'the input {shown(name.value)}'
            mapping = mapping_of(node, what, problems,
                                 f'{name.value}: {{topic: speed, type: std_msgs/msg/Float32}}')
            entry = _input(name, mapping, problems) if mapping else None
            self._is_usable(name, node, problems)
            if entry is not None:
                yield replace(entry, damaged=entry.damaged | damaged)

    def _tell_outdented(self, name: '_Name') -> None:
        """Tell a key of an input that stands beside the input's name."""
        self._problems.error(
            f"'{name.value}' is a key of an input, and no input", name.span,
            'not indented under the name of one', 'indent it deeper than the name of its input')
        self._unreadable.add(name.value)

    def _check_topics(self, inputs: Iterable[InputEntry]) -> None:
        """Hold together what inputs on one topic say of it."""
        first: dict[str, InputEntry] = {}
        for item in inputs:
            if item.topic is not None:
                self._check_topic(item, item.topic, first.setdefault(item.topic.value, item))

    def _check_topic(self, item: InputEntry, topic: Text, first: InputEntry) -> None:
        for key, aspect in _TOPIC_ASPECTS:
            if key not in item.damaged | first.damaged and aspect(item) != aspect(first):
                place = dict(item.places).get(key, topic.span)
                self._problems.error(
                    f"inputs on one topic must agree in '{key}'", place,
                    f'{shown(first.name.value)} in {_line_of(first.name, place)} '
                    f'says {_said(first, key)}, {shown(item.name.value)} {_said(item, key)}')

    def _definitions(self, shape: Shape) -> Iterator[Definition]:
        for name, node in self._named(shape, 'definitions', 'fast: speed > 2.0'):
            problems = Problems()
            self._declare(name, problems)
            language, text = _definition(name, node, problems)
            if self._is_usable(name, node, problems) and text is not None:
                yield Definition(name.text, language, text)

    def _requirements(self, shape: Shape) -> Iterator[Requirement]:
        node = shape.node('requirements')
        report = shape.choice('report', Report, Report.EVERY_STEP)
        severity = shape.choice('severity', Severity, Severity.ERROR)
        ids: dict[str, Requirement] = {}
        handlers: dict[str, Requirement] = {}
        for item in self._requirement_nodes(shape, node):
            found = _requirement(item, report, severity, self._problems)
            if found is not None:
                self._check_id(found, ids, handlers)
                if found.text is not _NO_TEXT:
                    yield found

    def _requirement_nodes(self, shape: Shape, node: Node | None) -> Iterator[YamlMapping]:
        if isinstance(node, YamlList) and node.items:
            for item in node.items:
                mapping = _requirement_node(item, self._problems)
                if mapping is not None:
                    yield mapping
        elif isinstance(node, YamlList) or isinstance(node, YamlScalar) and node.is_missing or (
                node is None and shape.lacks('requirements')):
            self._problems.error('a bundle has at least one requirement',
                                 node.span if node else shape.span, 'there is none',
                                 'requirements:\n  - id: R1\n    ptltl: "H (speed <= 2.0)"')
        elif node is not None and not isinstance(node, Unread):
            self._problems.error("'requirements' is a list", node.span, f'this is {kind_of(node)}',
                                 '- id: R1\n  ptltl: "H (speed <= 2.0)"')

    def _check_id(self, item: Requirement, ids: dict[str, Requirement],
                  handlers: dict[str, Requirement]) -> None:
        same = ids.setdefault(item.id.value, item)
        clash = handlers.setdefault(item.handler, item)
        if same is not item:
            self._problems.error(f'the id {shown(item.id.value)} is given twice', item.id.span,
                                 f'first in line {same.id.span.line}')
        elif clash is not item:
            self._problems.error(
                f'two ids give one handler, {shown(item.handler)}', item.id.span,
                f'{shown(clash.id.value)} in line {clash.id.span.line} gives it too',
                "letters, digits and '_' tell ids apart; other characters do not")

    def _signals(self, source: Source, shape: Shape) -> list[Bundle]:
        """Read the `signals` files, each as a bundle that has inputs and constants only."""
        found: list[Bundle] = []
        read = {Path(source.name).resolve()}
        for text in self._signals_names(shape.node('signals')):
            path = self._directory / text.value
            if _resolved(path) in read:
                self._problems.error('this file is read already', text.span)
                continue
            read.add(_resolved(path))
            part = self._signals_file(path, text)
            if part is not None:
                found.append(part)
        return found

    def _signals_names(self, node: Node | None) -> Iterator[Text]:
        nodes = node.items if isinstance(node, YamlList) else (node,) if node else ()
        for item in nodes:
            text = text_of(item, "a file of 'signals'", self._problems)
            if text is not None:
                yield text

    def _signals_file(self, path: Path, text: Text) -> Bundle | None:
        if os.path.exists(path) and not os.path.isfile(path) and not os.path.isdir(path):
            # A bundle that names a pipe would have a start wait for ever.
            self._problems.error(f'{shown(str(path), LONGEST_PATH)} is not a regular file',
                                 text.span)
            return None
        try:
            source = read_source(path)
        except CompileError as error:
            for item in error.diagnostics:
                self._problems.extend([item if item.span else replace(item, span=text.span)])
            return None
        mapping = self._root(source, 'the signals file', _SIGNALS_EXAMPLE)
        if mapping is None or not self._has_format(mapping, is_required=False):
            return None
        return self._contents(
            source, Shape(mapping, 'a signals file', _SIGNALS_KEYS, self._problems))


_SIGNALS_EXAMPLE = 'inputs:\n  speed: {topic: speed, type: std_msgs/msg/Float32}'
_NO_TEXT = Text('', Source('', ''), [0])


def _resolved(path: Path) -> Path:
    try:
        return path.resolve()
    except (OSError, ValueError, RuntimeError):
        return path


def _line_of(text: Text, here: Span) -> str:
    """Say in which line a text stands, with its file where that is another."""
    file = '' if text.source is here.source else f'{text.source.name}, '
    return f'{file}line {text.span.line}'


def _tell(fault: Fault | None, text: Text, problems: Problems, label: str = '') -> None:
    if fault is not None:
        problems.error(fault.reason, text.span, label, fault.help)


def _qos_of(item: InputEntry) -> object:
    return sorted((key.value, value.value) for key, value in item.qos)


def _said(item: InputEntry, key: str) -> str:
    """Return what is written under a key of an input."""
    place = dict(item.places).get(key)
    if place is None:
        return 'nothing'
    if key == 'qos':
        return ', '.join(f'{name.value}: {value.value}' for name, value in item.qos) or 'nothing'
    return shown(place.source.text[place.start:place.end])[1:-1]


_TOPIC_ASPECTS: tuple[tuple[str, Callable[[InputEntry], object]], ...] = (
    ('type', lambda item: item.type.value if item.type else None),
    ('qos', _qos_of),
    ('timeout', lambda item: item.timeout),
    ('stale', lambda item: item.stale or Stale.WARN),
)


@dataclass(frozen=True, eq=False)
class _Name:
    """
    A name that is declared, as formulas know it.

    FRET's names in quotes (`"hello world"`) have their quotes in the bundle's key as well.
    """

    text: Text
    key: YamlScalar
    is_quoted: bool

    @property
    def value(self) -> str:
        return self.text.value

    @property
    def span(self) -> Span:
        return self.key.span


def _is_empty(node: Node) -> bool:
    return isinstance(node, YamlScalar) and node.is_missing


def _name(key: YamlScalar) -> _Name:
    value = key.value
    if len(value) < 2 or not value.startswith('"') or not value.endswith('"'):
        return _Name(key.text, key, False)
    inner = Text(value[1:-1], key.text.source, key.text.offsets[1:len(value)])
    return _Name(inner, key, True)


def _input(name: _Name, mapping: YamlMapping, problems: Problems) -> InputEntry:
    shape = Shape(mapping, 'an input', _INPUT_KEYS, problems,
                  {'message': 'type', 'message_type': 'type', 'msg': 'type', 'path': 'field'})
    faults = {key: Problems() for key in ('values', 'qos')}
    entry = InputEntry(
        name=name.text,
        topic=_checked(shape, 'topic', topic_fault, problems),
        type=_checked(shape, 'type', type_fault, problems),
        field=shape.text('field'),
        initial=shape.text('initial'),
        values=tuple(_values(shape.node('values'), faults['values'])),
        qos=tuple(_qos(shape.node('qos'), faults['qos'])),
        timeout=shape.positive('timeout', 'seconds', _SHORTEST_TIMEOUT, _LONGEST),
        stale=_stale(shape, problems),
    )
    damaged = {key for key in _INPUT_KEYS if shape.is_cut or not shape.lacks(key) and (
        shape.key(key) is None or getattr(entry, key) is None)}
    for key, found in faults.items():
        problems.extend(found.errors)
        damaged.update([key] if found.errors or isinstance(shape.node(key), Unread) else ())
    damaged |= _check_input(entry, shape, problems)
    places = tuple((key, node.span if isinstance(node, YamlScalar) else written.span)
                   for key, _ in _TOPIC_ASPECTS
                   if (node := shape.node(key)) and (written := shape.key(key)))
    return replace(entry, damaged=frozenset(damaged), places=places)


def _checked(shape: Shape, key: str, find_fault: Callable[[str], Fault | None],
             problems: Problems) -> Text | None:
    text = shape.text(key)
    fault = find_fault(text.value) if text is not None else None
    if text is not None:
        _tell(fault, text, problems)
    return text if fault is None else None


def _check_input(entry: InputEntry, shape: Shape, problems: Problems) -> set[str]:
    """Look at what the keys of an input need of one another; return those that were refused."""
    damaged = set()
    if shape.lacks('type'):
        damaged.add('type')
        problems.error(
            f'the input {shown(entry.name.value)} has no type', entry.name.span,
            help='type: float64' if shape.lacks('topic') else 'type: std_msgs/msg/Float32')
    if entry.field and entry.type and entry.type.value in PLAIN_TYPES:
        damaged.add('field')
        problems.error(f"'{entry.type.value}' has no fields", entry.field.span,
                       'a field of nothing', "remove 'field', or name a message type")
    stale = shape.key('stale')
    if stale and shape.lacks('timeout'):
        problems.error("'stale' needs a 'timeout'", stale.span, 'stale after how long?',
                       'timeout: 0.5   # seconds')
    return damaged


def _stale(shape: Shape, problems: Problems) -> Stale | None:
    text = shape.text('stale')
    words = [stale.value for stale in Stale]
    if text is not None and text.value not in words:
        tell_choice(text, 'stale', words, problems)
        return None
    return Stale(text.value) if text else None


def _values(node: Node | None, problems: Problems) -> Iterator[ValueEntry]:
    mapping = mapping_of(node, "'values'", problems, 'values: {IDLE: 0, LANDING: 1}')
    if mapping is None:
        return
    if not mapping.entries:
        problems.error("'values' names no value", mapping.span,
                       help='values: {IDLE: 0, LANDING: 1}')
    found = [entry for key, item in mapping.entries if (entry := _value(key, item, problems))]
    _check_values(found, problems)
    yield from found


def _value(key: YamlScalar, node: Node, problems: Problems) -> ValueEntry | None:
    """Read one name of a value: what is in quotes, or no number, is a string."""
    _tell(name_fault(key.value), key.text, problems)
    if isinstance(node, YamlScalar) and node.style:
        return ValueEntry(key.text, node.text, is_string=True)
    text = text_of(node, f'the value {shown(key.value)}', problems)
    if text is None:
        return None
    is_string = not looks_like_number(text.value)
    if not is_string and not is_integer(text.value):
        fault = number_fault(text.value)
        problems.error('a value with a name is a whole number or a string', text.span,
                       'this is neither', fault.help if fault and fault.help else
                       f'{key.value}: "{text.value}"   # if it is a string')
    return ValueEntry(key.text, text, is_string)


def _check_values(entries: list[ValueEntry], problems: Problems) -> None:
    firsts: dict[str | Fraction, ValueEntry] = {}
    for item in entries:
        if item.is_string != entries[0].is_string:
            first = entries[0].name.value
            problems.error("'values' are all numbers, or all strings", item.value.span,
                           f'unlike {shown(first)}')
            return
        number = None if item.is_string else exact(item.value.value)
        same = firsts.setdefault(item.value.value if number is None else number, item)
        if same is not item:
            kind = 'string' if item.is_string else 'number'
            problems.error(f'two names for one {kind}', item.value.span,
                           f'{shown(same.name.value)} stands for it already')


def _qos(node: Node | None, problems: Problems) -> Iterator[tuple[Text, Text]]:
    mapping = mapping_of(node, "'qos'", problems, 'qos: {reliability: best_effort, depth: 10}')
    if mapping is None:
        return
    shape = Shape(mapping, "'qos'", _QOS, problems)
    for key, words in _QOS.items():
        name, text = shape.key(key), shape.text(key)
        if name is None or text is None:
            continue
        if words and text.value not in words:
            tell_choice(text, key, words, problems)
        elif not words and not (is_integer(text.value) and 0 < _whole(text.value) < 2 ** 31):
            problems.error(f"'{key}' is a number of messages, at least 1", text.span)
        else:
            yield name.text, text


def _whole(text: str) -> int:
    return int(text) if len(text) < 20 else 0


def _definition(name: _Name, node: Node, problems: Problems) -> tuple[Language, Text | None]:
    if not isinstance(node, YamlMapping):
        return Language.PTLTL, _formula(name.key, node, problems)
    if node.is_flow and not any(key.value in _FORMULA_KEYS for key, _ in node.entries):
        return Language.PTLTL, _formula(name.key, node, problems)
    shape = Shape(node, f'the definition {shown(name.value)}', _FORMULA_KEYS, problems,
                  _FORMULA_SLIPS)
    return _one_formula(shape, f'the definition {shown(name.value)}', shape.span, problems)


def _one_formula(shape: Shape, what: str, place: Span,
                 problems: Problems) -> tuple[Language, Text | None]:
    """Read the formula under the one key that names a language."""
    keys = [key for name in _FORMULA_KEYS if (key := shape.key(name))]
    keys.sort(key=lambda key: key.span.start)
    if not keys and shape.lacks(*_FORMULA_KEYS):
        problems.error(f'{what} has no formula', place, 'one of ' + ', '.join(_FORMULA_KEYS),
                       'ptltl: "H (speed <= 2.0)"')
    for key in keys[1:]:
        problems.error(f'{what} has two formulas', key.span,
                       f"'{keys[0].value}' is there already", 'remove one of them')
    if not keys:
        return Language.PTLTL, None
    node = shape.node(keys[0].value)
    assert node is not None, 'a key has a node'
    return Language(keys[0].value), _formula(keys[0], node, problems)


def _formula(key: YamlScalar, node: Node, problems: Problems) -> Text | None:
    """Read a formula, and see that YAML left it as it was written."""
    source = key.span.source
    if isinstance(node, Unread):
        return None
    if not isinstance(node, YamlScalar):
        if not (node.items if isinstance(node, YamlList) else node.entries):
            problems.error('there is no formula', key.span, f'this is {kind_of(node)}, and empty')
        elif source.text[node.span.start] in '[{':
            tell_misread(source, node.span.start, problems)
        else:
            problems.error('a formula is a text', node.span, f'this is {kind_of(node)}')
        return None
    comment = None if node.style else _COMMENT.match(source.text, max(
        node.span.end, key.span.end + (1 if node.is_missing else 0)))
    if not node.value.strip():
        problems.error('there is no formula', key.span,
                       "a '#' starts a comment: put the formula in quotes" if comment else
                       'nothing is written behind it')
        return None
    if comment:
        written = ' '.join(node.value.split())
        problems.error(
            "'#' starts a comment in YAML and ends the formula",
            Span(source, comment.start(1), comment.end(1)), 'not part of the formula: put the '
            'formula in quotes', quoted_line(source, node.span.start, written) + '  ' + comment[1])
        return None
    return node.text


def _requirement_node(node: Node, problems: Problems) -> YamlMapping | None:
    if isinstance(node, YamlScalar) and node.is_missing:
        problems.error('this requirement is empty', node.span,
                       help='- id: R1\n  ptltl: "H (speed <= 2.0)"')
        return None
    return mapping_of(node, 'a requirement', problems,
                      '- id: R1\n  ptltl: "H (speed <= 2.0)"')


def _requirement(mapping: YamlMapping, report: Report, severity: Severity,
                 problems: Problems) -> Requirement | None:
    """
    Read a requirement, with the bundle's `report` and `severity` where it has none.

    Returns None without an id, and `_NO_TEXT` for a formula that cannot be used.
    """
    shape = Shape(mapping, 'a requirement', _REQUIREMENT_KEYS, problems, _FORMULA_SLIPS)
    name = _id(shape, problems)
    what = f'the requirement {shown(name.value)}' if name else 'this requirement'
    place = name.span if name else shape.span
    language, text = _one_formula(shape, what, place, problems)
    found = Requirement(
        id=name or _NO_TEXT,
        language=language,
        text=text or _NO_TEXT,
        title=shape.free_text('title'),
        rationale=shape.free_text('rationale'),
        report=shape.choice('report', Report, report),
        severity=shape.choice('severity', Severity, severity),
    )
    return found if name else None


def _id(shape: Shape, problems: Problems) -> Text | None:
    if shape.lacks('id'):
        problems.error("a requirement has an 'id'", shape.span, 'this one has none', 'id: R1')
    text = shape.text('id')
    if text is None:
        return None
    if not text.value.isprintable() or text.value != text.value.strip():
        problems.error('an id is one line, with no blank at its ends', text.span)
        return None
    found = Requirement(text, Language.PTLTL, text, '', '', Report.EVERY_STEP, Severity.ERROR)
    _tell(handler_fault(found.handler), text, problems)
    return text
