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
Reads a bundle with its `signals` files: YAML in, a frozen `Bundle` out.

`parse_bundle` raises one `CompileError` with all problems of all files. `survey_bundle` returns
what can be used of a bundle that has problems, so that the problems of its formulas can be
reported in the same run.
"""

from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
import os
from pathlib import Path

from fret_monitor.bundle.actions import read_actions
from fret_monitor.bundle.bundle import (
    ActionEntry, Bundle, ConstantEntry, DECLARING, Definition, GateEntry, InputEntry,
    InstanceVariable,
)
from fret_monitor.bundle.constants import read_constant, report_decimal_comma
from fret_monitor.bundle.declared_name import declared_name, DeclaredName
from fret_monitor.bundle.formulas import read_definition
from fret_monitor.bundle.gates import read_gates
from fret_monitor.bundle.inputs import (
    BLOCK_KEYS, check_topics, INPUT_KEYS, read_block, read_field, read_input,
)
from fret_monitor.bundle.instances import (
    check_topic_mentions, check_variables, read_variable, VARIABLE_EXAMPLE, with_mentions,
)
from fret_monitor.bundle.requirements import Ids, read_requirements
from fret_monitor.bundle.source_file import read_source, ReadFile
from fret_monitor.bundle.yaml_shape import (
    HERTZ, is_empty, line_of, mapping_of, SECONDS, Shape, text_of,
)
from fret_monitor.bundle.yaml_tree import (
    Node, read_tree, Unread, YamlList, YamlMapping, YamlScalar,
)
from fret_monitor.model.diagnostics import CompileError, Problems, Source, Span, Text
from fret_monitor.model.names import (
    fret_name, LONGEST_PATH, name_fault, quoted_name_fault, shown,
)
from fret_monitor.model.policies import Policy, Stamp

FORMAT = '1'

_SHORTEST_PERIOD_S = Fraction(1, 10 ** 9)  # ROS counts time in nanoseconds
_LONGEST_PERIOD_S = Fraction(10 ** 9)
SIGNALS_KEYS = ('format', 'title', 'description', 'constants', 'inputs', 'topics')
BUNDLE_KEYS = (
    'format', 'component', 'title', 'description', 'signals', 'for_each', 'constants', 'inputs',
    'topics', 'definitions', 'evaluation', 'report', 'severity', 'confidence', 'actions',
    'on_violation', 'on_end', 'gates', 'requirements')
_LONGEST_REORDER_S = Fraction(3600)
USUAL_REORDER_S = Fraction(1, 10)
_TIMED_KEYS = ('unit', 'stamp', 'reorder')
EVALUATION_KEYS = ('policy', 'period', 'rate', *_TIMED_KEYS)
_ELSEWHERE = {
    **dict.fromkeys(
        ('policy', 'period', 'rate'),
        'it belongs under evaluation, as in\nevaluation: {policy: periodic, period: 0.1}'),
    **dict.fromkeys(
        _TIMED_KEYS, 'it belongs under evaluation, as in\nevaluation: {policy: timed, unit: 1}'),
}
_EXAMPLE = """\
format: 1
inputs:
  speed: {topic: speed, type: std_msgs/msg/Float32}
requirements:
  - id: R1
    ptltl: "H (speed <= 2.0)\""""
_TOPICS_EXAMPLE = 'odom: {type: nav_msgs/msg/Odometry, fields: {height: pose.pose.position.z}}'
_SIGNALS_EXAMPLE = 'inputs:\n  speed: {topic: speed, type: std_msgs/msg/Float32}'


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


def survey_bundle(path: Path, problems: Problems, *, needs_period: bool = True,
                  read_file: ReadFile = read_source) -> Bundle | None:
    """
    Read the usable parts of a bundle, and add the errors to `problems`.

    Declared names that cannot be used are in `Bundle.unreadable`, so that formulas with these
    names are not reported, too. Returns None if nothing is usable. With `needs_period=False`, a
    bundle with the policy periodic may omit its period. `read_file` is as `read_source`, such as
    for texts that an editor has not saved.
    """
    try:
        source = read_file(path)
    except CompileError as error:
        problems.extend(error.diagnostics)
        return None
    return _BundleReader(path.parent, problems, needs_period, read_file).bundle(source)


class _BundleReader:
    """Reads the usable parts of a bundle, and collects the problems."""

    def __init__(self, directory: Path, problems: Problems, needs_period: bool = True,
                 read_file: ReadFile = read_source) -> None:
        self._directory = directory
        self._read_file = read_file
        self._problems = problems
        self._needs_period = needs_period
        self._declared: dict[str, DeclaredName] = {}
        self._unreadable: set[str] = set()
        self._cut: set[str] = set()
        self._signals_sources: list[Source] = []
        self._variables: dict[str, InstanceVariable | None] = {}
        self._has_policy = True  # whether it is known what formulas mean

    def bundle(self, source: Source) -> Bundle | None:
        """Read a bundle; return None if nothing of it is usable."""
        mapping = self._root(source, 'the bundle', _EXAMPLE)
        if mapping is None or not self._has_format(mapping, is_required=True):
            return None
        shape = Shape(mapping, 'a bundle', BUNDLE_KEYS, self._problems, elsewhere=_ELSEWHERE)
        self._for_each(shape)
        read = self._contents(source, shape)
        shared = self._signals(source, shape)
        definitions = tuple(self._definitions(shape))
        ids = Ids()
        requirements = tuple(read_requirements(shape, self._problems, ids))
        if not ids.are_all:
            self._cut.add('requirements')
        if not self._has_policy:
            definitions, requirements = (), ()
        inputs = (*read.inputs, *(item for part in shared for item in part.inputs))
        check_topics(inputs, self._problems)
        variables = tuple(item for item in self._variables.values() if item)
        if 'inputs' not in self._cut and 'topics' not in self._cut:
            check_variables(variables, inputs, self._problems)
        return replace(
            self._acting(shape, read),
            sources=(source, *self._signals_sources),
            constants=(*read.constants, *(item for part in shared for item in part.constants)),
            inputs=inputs,
            definitions=definitions,
            requirements=requirements,
            unreadable=frozenset(self._unreadable),
            ids=tuple(dict.fromkeys(ids.found)),
            cut=frozenset(self._cut),
            instance_variables=variables,
        )

    def _root(self, source: Source, what: str, example: str) -> YamlMapping | None:
        problems = Problems()
        root = read_tree(source, problems)
        self._problems.extend(problems.errors)
        if isinstance(root, YamlMapping):
            return root
        if root is None and not problems.errors or root is not None and is_empty(root):
            self._problems.error(f'{what} is empty', Span(source, 0, 0),
                                 help=f'it begins like this:\n{example}')
        elif root is not None:
            mapping_of(root, what, self._problems, f'it begins like this:\n{example}')
        return None

    def _has_format(self, mapping: YamlMapping, is_required: bool) -> bool:
        """Return whether the format is supported; of others nothing more is read."""
        for key, node in mapping.entries:
            if key.value == 'format':
                text = text_of(node, "'format'", self._problems)
                if text is not None and text.value != FORMAT:
                    self._problems.error(f'format {shown(text.value)} is not supported', text.span,
                                         f'this version reads format {FORMAT}', 'format: 1')
                return text is None or text.value == FORMAT
        if is_required:
            self._problems.error("the bundle has no 'format'", mapping.span,
                                 'write this line first', 'format: 1')
        return True

    def _contents(self, source: Source, shape: Shape) -> Bundle:
        """Read all but signals, definitions and requirements."""
        self._cut.update(filter(shape.may_hide, (*DECLARING, 'actions')))
        return self._evaluation(shape, Bundle(
            name=Path(source.name).stem,
            sources=(source,),
            component=shape.text('component'),
            title=shape.free_text('title'),
            description=shape.free_text('description'),
            constants=tuple(self._constants(shape)),
            inputs=(*self._inputs(shape), *self._topics(shape)),
            definitions=(),
            policy=Policy.EVERY_MESSAGE,
            period=None,
            requirements=(),
        ))

    def _acting(self, shape: Shape, bundle: Bundle) -> Bundle:
        """Return the bundle with its actions and gates."""
        actions: list[ActionEntry] = []
        gates: list[GateEntry] = []
        names: set[str] = set()
        written = shape.node('actions')
        if written and not isinstance(written, YamlMapping) and not is_empty(written):
            self._cut.add('actions')
        for name, action in read_actions(shape, self._problems):
            names.add(name.value)
            actions += [action] if action else []
        types = {item.topic.value: item.type.value for item in bundle.inputs
                 if item.topic and item.type}
        for name, gate in read_gates(shape, types, self._problems):
            names.add(name.value)
            gates += [gate] if gate else []
        return replace(bundle, actions=tuple(actions), gates=tuple(gates),
                       acting_names=frozenset(names))

    def _evaluation(self, shape: Shape, bundle: Bundle) -> Bundle:
        """Return the bundle with what stands under `evaluation`."""
        node = shape.node('evaluation')
        word = node.value if isinstance(node, YamlScalar) else ''
        is_policy = any(word == item.value for item in Policy)
        mapping = mapping_of(
            node, "'evaluation'", self._problems,
            f'evaluation: {{policy: {word}}}' if is_policy else 'policy: every_message')
        if mapping is None:
            self._has_policy &= node is None
            return bundle
        part = Shape(mapping, "'evaluation'", EVALUATION_KEYS, self._problems)
        choice = part.choice('policy', Policy)
        policy = choice or Policy.EVERY_MESSAGE
        is_known = part.lacks('policy') or choice is not None
        self._has_policy &= is_known
        place = shape.key('evaluation')
        written = part.text('policy') if choice else None
        bundle = replace(bundle, policy_place=written.span if written else None)
        bundle = replace(bundle, policy=policy, period=self._period(
            part, place.span if place else part.span, policy, is_known))
        return self._timed(part, bundle, is_known)

    def _timed(self, part: Shape, bundle: Bundle, is_known: bool) -> Bundle:
        """Return the bundle with the keys of the policy timed; all are read, to be checked."""
        unit = part.number('unit', SECONDS, _SHORTEST_PERIOD_S, _LONGEST_PERIOD_S)
        stamp = part.choice('stamp', Stamp) or Stamp.RECEIVED
        reorder = part.number('reorder', SECONDS, Fraction(0), _LONGEST_REORDER_S)
        if reorder is None:
            # Without any, every message would be late.
            reorder = USUAL_REORDER_S if stamp is Stamp.HEADER else Fraction(0)
        nanoseconds = reorder * 10 ** 9
        if nanoseconds.denominator != 1 and (text := part.text('reorder')):
            self._problems.error("'reorder' must be a whole number of nanoseconds", text.span,
                                 'at most nine digits behind the point')
        if bundle.policy is Policy.TIMED:
            if (key := part.key('reorder')) and reorder and stamp is Stamp.RECEIVED:
                self._problems.warning(
                    'reorder has no effect with stamp: received', key.span, 'no effect',
                    'write stamp: header to order messages by their stamps')
            return replace(bundle, unit=unit, stamp=stamp, reorder=int(nanoseconds))
        for key in (part.key(name) for name in _TIMED_KEYS):
            if key is not None and is_known:
                self._problems.error(
                    f"'{key.value}' applies to the policy timed only", key.span,
                    f'the policy is {bundle.policy.value}', 'policy: timed')
        return bundle

    def _period(self, part: Shape, place: Span, policy: Policy,
                is_known: bool) -> Fraction | None:
        """Read `period` or `rate`; both are read so that both are checked."""
        period = part.number('period', SECONDS, _SHORTEST_PERIOD_S, _LONGEST_PERIOD_S)
        rate = part.number('rate', HERTZ, 1 / _LONGEST_PERIOD_S, 1 / _SHORTEST_PERIOD_S)
        keys = [key for key in (part.key('period'), part.key('rate')) if key]
        if len(keys) == 2:
            self._problems.error("'period' and 'rate' are both given", keys[1].span,
                                 f"'{keys[0].value}' is already given", 'remove one of them')
        elif keys and is_known and policy is not Policy.PERIODIC:
            self._problems.error(
                f"'{keys[0].value}' applies to the policy periodic only", keys[0].span,
                f'the policy is {policy.value}',
                'remove it: a step is one nanosecond' if policy is Policy.TIMED else
                'policy: periodic')
        elif (part.lacks('period', 'rate') and policy is Policy.PERIODIC
              and self._needs_period):
            self._problems.error("the policy periodic needs a 'period' or a 'rate'", place,
                                 help='period: 0.1   # seconds')
        if policy is not Policy.PERIODIC:
            return None
        return 1 / rate if rate is not None else period

    def _for_each(self, shape: Shape) -> None:
        """Read the instance variables, which inputs of all files may mention."""
        for name, node in self._named(shape, 'for_each', VARIABLE_EXAMPLE):
            problems = Problems()
            self._declare(name, problems)
            variable = read_variable(name, node, problems)
            is_usable = self._is_usable(name, node, problems)
            self._variables[name.value] = variable if is_usable else None

    def _constants(self, shape: Shape) -> Iterator[ConstantEntry]:
        before: tuple[DeclaredName, Node] | None = None
        for name, node in self._named(shape, 'constants', 'cc_t: 15.0'):
            if before and is_empty(node) and report_decimal_comma(
                    before[0], before[1], name, self._problems):
                continue
            before = name, node
            problems = Problems()
            self._declare(name, problems)
            text = read_constant(node, f'the constant {shown(name.value)}', problems)
            if self._is_usable(name, node, problems) and text is not None:
                yield ConstantEntry(name.text, text)

    def _named(self, shape: Shape, key: str,
               example: str) -> Iterator[tuple[DeclaredName, Node]]:
        """Yield the entries under `constants`, `inputs`, `topics` or `definitions`."""
        mapping = mapping_of(shape.node(key), f"'{key}'", self._problems, example)
        if mapping is None and shape.key(key):
            self._cut.add(key)
        for name, node in mapping.entries if mapping else ():
            yield declared_name(name), node

    def _declare(self, name: DeclaredName, problems: Problems) -> None:
        """Declare a name; names with equal FRET spellings (`a.b` and `a_DOT_b`) are duplicates."""
        fault = (quoted_name_fault if name.is_quoted else name_fault)(name.value)
        other = self._declared.setdefault(fret_name(name.value), name)
        if fault is not None:
            problems.error(fault.reason, name.span, 'not a name', fault.help)
        elif other is not name:
            first, second = other, name
            if first.span.source is second.span.source and first.span.start > second.span.start:
                first, second = second, first  # sections may be written in any order
            problems.error(
                f'{shown(second.value)} is declared twice', second.span,
                f'first in {line_of(first.text, second.span)}',
                'choose another name for one of them', first.span)

    def _is_usable(self, name: DeclaredName, node: Node, problems: Problems) -> bool:
        """Pass on the problems of an entry; return whether it has none."""
        self._problems.extend((*problems.errors, *problems.warnings))
        is_usable = not problems.errors and not isinstance(node, Unread)
        if not is_usable:
            self._unreadable.add(name.value)
        return is_usable

    def _inputs(self, shape: Shape) -> Iterator[InputEntry]:
        example = 'speed: {topic: speed, type: std_msgs/msg/Float32}'
        for name, node in self._indented(shape, 'inputs', INPUT_KEYS, example):
            problems = Problems()
            self._declare(name, problems)
            damaged = {'name'} if problems.errors else set()
            what = f'the input {shown(name.value)}'
            mapping = mapping_of(node, what, problems,
                                 f'{name.value}: {{topic: speed, type: std_msgs/msg/Float32}}')
            entry = read_input(name, mapping, problems) if mapping else None
            if entry is not None:
                check_topic_mentions(entry.topic, self._variables, problems)
                entry = with_mentions(entry, (entry.topic, entry.field, entry.where),
                                      self._variables, problems)
            self._is_usable(name, node, problems)
            if entry is not None:
                yield replace(entry, damaged=entry.damaged | damaged)

    def _topics(self, shape: Shape) -> Iterator[InputEntry]:
        """Read the entries under `topics`; each field of one is an input."""
        for topic, node in self._indented(shape, 'topics', BLOCK_KEYS, _TOPICS_EXAMPLE):
            problems = Problems()
            mapping = mapping_of(node, f'the topic {shown(topic.value)}', problems,
                                 _TOPICS_EXAMPLE)
            block, fields = read_block(topic.key, mapping, problems) if mapping else (None, None)
            if block is not None:
                check_topic_mentions(block.topic, self._variables, problems)
                block = with_mentions(block, (block.topic, block.where), self._variables, problems)
            self._problems.extend((*problems.errors, *problems.warnings))
            is_refused = bool(problems.errors) or isinstance(node, Unread)
            if is_refused and fields is None:
                self._cut.add('topics')
            for key, field in fields.entries if fields else ():
                name = declared_name(key)
                if is_refused:
                    self._unreadable.add(name.value)
                if block is not None:
                    yield from self._field(block, name, field)

    def _field(self, block: InputEntry, name: DeclaredName, node: Node) -> Iterator[InputEntry]:
        problems = Problems()
        self._declare(name, problems)
        damaged = {'name'} if problems.errors else set()
        entry = read_field(block, name, node, problems)
        if entry is not None:
            entry = with_mentions(entry, (entry.field,), self._variables, problems)
        self._is_usable(name, node, problems)
        if entry is not None:
            yield replace(entry, damaged=entry.damaged | damaged)

    def _indented(self, shape: Shape, key: str, inner: tuple[str, ...],
                  example: str) -> Iterator[tuple[DeclaredName, Node]]:
        """Yield the entries of mappings under a key; report their own keys among them."""
        what = {'inputs': 'an input', 'topics': 'a topic'}[key]
        found = list(self._named(shape, key, example))
        for (name, node), (following, after) in zip(found, [*found[1:], *found[-1:]]):
            if isinstance(node, YamlScalar) and name.value in inner:
                self._problems.error(
                    f"'{name.value}' is a key of {what}, not {what}", name.span,
                    f'not indented under the name of {what}',
                    f'indent it deeper than the name of its {key[:-1]}')
                self._unreadable.add(name.value)
            elif is_empty(node) and isinstance(after, YamlScalar) and following.value in inner:
                self._unreadable.add(name.value)
            else:
                yield name, node

    def _definitions(self, shape: Shape) -> Iterator[Definition]:
        for name, node in self._named(shape, 'definitions', 'fast: speed > 2.0'):
            problems = Problems()
            self._declare(name, problems)
            language, text = read_definition(name, node, problems)
            if self._is_usable(name, node, problems) and text is not None:
                yield Definition(name.text, language, text)

    def _signals(self, source: Source, shape: Shape) -> list[Bundle]:
        """Read the `signals` files, each as a bundle that has inputs and constants only."""
        found: list[Bundle] = []
        read = {Path(source.name).resolve()}
        for text in self._signals_names(shape.node('signals')):
            path = self._directory / text.value
            if _resolved(path) in read:
                self._problems.error('this file is already listed', text.span)
                continue
            read.add(_resolved(path))
            part = self._signals_file(path, text)
            if part is None:
                self._cut.add('signals')
            else:
                found.append(part)
        return found

    def _signals_names(self, node: Node | None) -> Iterator[Text]:
        nodes = node.items if isinstance(node, YamlList) else (node,) if node else ()
        for item in nodes:
            text = text_of(item, "a file of 'signals'", self._problems)
            if text is None:
                self._cut.add('signals')
            else:
                yield text

    def _signals_file(self, path: Path, text: Text) -> Bundle | None:
        if os.path.exists(path) and not os.path.isfile(path) and not os.path.isdir(path):
            # Reading a pipe could block forever.
            self._problems.error(f'{shown(str(path), LONGEST_PATH)} is not a regular file',
                                 text.span)
            return None
        try:
            source = self._read_file(path)
        except CompileError as error:
            for item in error.diagnostics:
                self._problems.extend([item if item.span else replace(item, span=text.span)])
            return None
        self._signals_sources.append(source)
        mapping = self._root(source, 'the signals file', _SIGNALS_EXAMPLE)
        if mapping is None or not self._has_format(mapping, is_required=False):
            return None
        return self._contents(
            source, Shape(mapping, 'a signals file', SIGNALS_KEYS, self._problems))


def _resolved(path: Path) -> Path:
    try:
        return path.resolve()
    except (OSError, ValueError, RuntimeError):
        return path
