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
Elaborate a parsed bundle into a specification: resolve names, infer types, check bounds.

`specify` reports all mistakes of a bundle in one `CompileError`, each once and at its place. A
name that has a mistake is not reported again where it is used. The rules of types and numbers are
in docs/numbers.md; in short:

* The small integer types are promoted to INT64 in arithmetic and comparisons.
* FLOAT32 with FLOAT32 is FLOAT32; any other pair with a float is FLOAT64. UINT64 with UINT64 or
  a whole literal >= 0 is UINT64; any other pair of integers is INT64. (In arithmetic this
  converts the UINT64 modulo 2^64; a comparison does not convert it, and is by value.)
* Arithmetic between literals is exact. A literal with a typed operand is rounded once to the
  common type. A real literal (`1.0`, `1e3`) with an integer makes both FLOAT64.
* `a = b` and `a != b` take two numbers, two Booleans, or a text input and a name of its values.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import TypeAlias

from fret_monitor.bundle.bundle import (
    Bundle, ConstantEntry, DECLARING, Definition, InputEntry, Language, Requirement,
)
from fret_monitor.elaboration.acting import check_judged, resolve_acting
from fret_monitor.elaboration.aggregates import Aggregates
from fret_monitor.elaboration.durations import TimeScale
from fret_monitor.elaboration.elaborator import Elaborator, FindVocabulary, uses
from fret_monitor.elaboration.equations import equations_term
from fret_monitor.elaboration.fretish import probability_of, sentence_term
from fret_monitor.elaboration.future import from_horizon
from fret_monitor.elaboration.implied_inputs import ImpliedInputs
from fret_monitor.elaboration.instances import check_instances, described_variable
from fret_monitor.elaboration.languages import read_expression, read_formula
from fret_monitor.elaboration.memory import RequirementMemory
from fret_monitor.elaboration.scope import Declaration, Role, Scope
from fret_monitor.elaboration.signals import constant_declaration, FindMessage, input_declaration
from fret_monitor.elaboration.terms import (
    Broken, describe, formula_of, truth_help, TypedTerm, Vocabulary,
)
from fret_monitor.language.expression import Equations, Expression, Name
from fret_monitor.language.quoted_text import QuotedText
from fret_monitor.language.sentence import ComponentPhrase, Sentence
from fret_monitor.logic.formula import Feedback, Formula, postorder
from fret_monitor.logic.specification import (
    InstanceAggregate, Property, Signal, Specification,
)
from fret_monitor.messages.installed import find_message as find_installed
from fret_monitor.model.diagnostics import CompileError, Diagnostic, Problems, Source, Span, Text
from fret_monitor.model.graph import components, cycle, is_cyclic
from fret_monitor.model.made import MadeKind
from fret_monitor.model.names import fret_name
from fret_monitor.model.policies import Stamp
from fret_monitor.model.probability import Probability

_HEADER = 'std_msgs/msg/Header'
_MANY = 8
_MEANT = 3
KnownTrees: TypeAlias = Mapping[Text, Expression | Equations | Sentence]
_Trees: TypeAlias = Mapping[str, Expression | Equations | None]


def specify(bundle: Bundle, find_message: FindMessage | None = None,
            problems: Problems | None = None, memory: RequirementMemory | None = None,
            trees: KnownTrees | None = None
            ) -> tuple[Specification, tuple[Diagnostic, ...]]:
    """
    Return the specification of a bundle, and warnings.

    `find_message` returns the layout of a message type; the default searches the installed ROS
    packages. `problems` are those that `survey_bundle` found; they are reported together with
    those found here. `memory` has the requirements of an earlier version, `trees` are those of
    texts that were parsed before.

    Raises
    ------
    CompileError
        with all mistakes of the bundle.
    """
    reading = _Reading(problems or Problems(), bundle, trees)
    reading.skip(bundle.unreadable)
    signals = reading.read_inputs(bundle, find_message or find_installed)
    reading.read_definitions(bundle.definitions)
    properties = reading.read_requirements(memory)
    known = tuple(signal for signal in signals if signal)
    actions, gates = resolve_acting(bundle, known, find_message or find_installed,
                                    reading.problems)
    check_instances(bundle, (item for item in properties if item),
                    (*known, *reading.implied.added, *reading.aggregated), reading.aggregates,
                    reading.problems)
    reading.problems.raise_errors()
    check_judged([item for item in properties if item], gates, known, bundle, reading.problems)
    reading.problems.raise_errors()
    specification = Specification(
        name=bundle.name,
        component=bundle.component.value if bundle.component else '',
        signals=(*known, *reading.implied.added, *reading.aggregated),
        properties=tuple(item for item in properties if item),
        policy=bundle.policy,
        period=bundle.period,
        definitions=reading.shown(bundle.definitions),
        unit=bundle.unit,
        stamp=bundle.stamp,
        reorder=bundle.reorder,
        actions=actions,
        gates=gates,
        instance_variables=tuple(map(described_variable, bundle.instance_variables)),
        aggregates=reading.aggregates,
    )
    return specification, reading.problems.warnings


def name_uses(bundle: Bundle, find_message: FindMessage | None = None) -> tuple[Name, ...]:
    """
    Return where the formulas of a bundle refer to names, as far as they can be parsed.

    A name of a value, as LANDING in `state = LANDING`, is none. Arguments as of `specify`.
    """
    reading = _Reading(Problems(), bundle)
    reading.skip(bundle.unreadable)
    reading.read_inputs(bundle, find_message or find_installed)
    return tuple(reading.uses())


def _references(tree: Expression | Equations | Sentence | None,
                vocabulary_of: FindVocabulary, in_bounds: bool = False) -> dict[str, Span]:
    found: dict[str, Span] = {}
    for name in _uses(tree, vocabulary_of, in_bounds):
        found.setdefault(name.text, name.span)
    return found


def _uses(tree: Expression | Equations | Sentence | None,
          vocabulary_of: FindVocabulary, in_bounds: bool = False) -> Iterator[Name]:
    """Yield the names that a formula refers to, without those that its equations define."""
    parts: Iterable[Expression] = ()
    local: set[str] = set()
    match tree:
        case Sentence():
            parts = tree.expressions
        case Equations():
            parts = [item.expression for item in tree.equations]
            local = {item.name for item in tree.equations}
        case None:
            pass
        case _:
            parts = (tree,)
    yield from (name for part in parts for name in uses(part, vocabulary_of, in_bounds=in_bounds)
                if name.text not in local)


class _Reading:
    """The elaboration of one bundle: the names declared so far, and the problems found."""

    def __init__(self, problems: Problems, bundle: Bundle,
                 trees: KnownTrees | None = None) -> None:
        self.problems = problems
        self._known = trees or {}
        self._bundle = bundle
        self._scale = TimeScale(bundle.policy, bundle.period, bundle.unit)
        declared: list[InputEntry | ConstantEntry | Definition] = [
            *bundle.inputs, *bundle.constants, *bundle.definitions]
        self._declared = frozenset(item.name.value for item in bundle.inputs)
        self.implied = ImpliedInputs(item.name.value for item in declared)
        self._aggregates = Aggregates(
            (item.name.value for item in bundle.instance_variables), self.implied)
        self._scope = Scope(is_cut=bool(bundle.cut & set(DECLARING)), implied=self.implied,
                            aggregates=self._aggregates)
        self._feedback: dict[Feedback, Formula] = {}
        self._names_of: dict[str, set[str]] = {}  # that a definition refers to, by its FRET name

    @property
    def aggregates(self) -> tuple[InstanceAggregate, ...]:
        """The aggregates that formulas read."""
        return tuple(replace(item, feedback=self._reached(item.operand))
                     for item in self._aggregates.all)

    @property
    def aggregated(self) -> tuple[Signal, ...]:
        """The inputs that stand for aggregates."""
        return tuple(item.signal for item in self._aggregates.all)

    def skip(self, names: Iterable[str]) -> None:
        """Declare names whose entries the parser refused, so that uses are not reported."""
        nowhere = Span(Source('', ''), 0, 0)
        for name in names:
            self._scope.declare(name, Declaration(Role.INPUT, TypedTerm(Broken(), nowhere)))

    def read_inputs(self, bundle: Bundle, find_message: FindMessage) -> list[Signal | None]:
        """Declare constants and inputs; return the inputs in order, None for an unusable one."""
        for constant in bundle.constants:
            self._scope.declare(constant.name.value,
                                constant_declaration(constant, self.problems))
        signals = []
        for entry in bundle.inputs:
            signal, declaration = input_declaration(entry, find_message, self.problems)
            if bundle.stamp is Stamp.HEADER and signal is not None and signal.made:
                self.problems.error(
                    f"'{entry.name}' is {signal.made.kind.words}, which does not go with "
                    'stamp: header', entry.name.span, 'its links have stamps of their own'
                    if signal.made.kind is MadeKind.TRANSFORM else
                    'its messages have no header of their own',
                    'stamp: received   # under evaluation')
            elif bundle.stamp is Stamp.HEADER and signal is not None:
                self._check_header(entry, signal)
            if 'name' not in entry.damaged:
                self._scope.declare(entry.name.value, declaration)
            if signal is not None:
                self.implied.declare(signal)
            signals.append(signal)
        return signals

    def _check_header(self, entry: InputEntry, signal: Signal) -> None:
        """Refuse an input whose message has no stamp, with `stamp: header`."""
        if signal.layout is None or entry.type is None:
            return
        field = signal.layout.find_field('header')
        if field is None or str(field.type) != _HEADER:
            self.problems.error(
                f"'{entry.owner}' has no stamp: {signal.layout.name} has no field 'header' of the "
                f'type {_HEADER}', entry.type.span, 'stamp: header needs one',
                'write stamp: received under evaluation, or take a stamped message')

    def read_definitions(self, definitions: Iterable[Definition]) -> None:
        """Declare all definitions in the order of their dependencies; report cycles."""
        known = {item.name.value: item for item in definitions}
        trees = {name: self._tree(item.language, item.text) for name, item in known.items()}
        uses = self._used_definitions(trees)
        vocabulary_of = self._vocabularies(trees)
        self._names_of = {
            fret_name(name): {*map(fret_name, _references(tree, vocabulary_of, True))}
            for name, tree in trees.items()}
        graph = {name: list(used) for name, used in uses.items()}
        for component in components(graph):
            if is_cyclic(component, graph):
                self._report_cycle(cycle(component, graph), uses)
                trees.update(dict.fromkeys(component))
            for name in component:
                self._define(known[name], trees[name])

    def _define(self, item: Definition, tree: Expression | Equations | None) -> None:
        term = self._term(item.language, item.text, tree, item.name.value)
        if term.horizon:
            self.problems.error('a definition cannot refer to the future', term.span,
                                'this is known later', 'write it in the requirement, under mltl:')
            term = TypedTerm(Broken(), term.span)
        self._scope.declare(item.name.value, Declaration(Role.DEFINITION, term))

    def uses(self) -> Iterator[Name]:
        """Yield the names that definitions and requirements refer to."""
        trees = {item.name.value: self._tree(item.language, item.text)
                 for item in self._bundle.definitions}
        vocabulary_of = self._vocabularies(trees)
        for tree in (*trees.values(), *map(self._formula, self._bundle.requirements)):
            yield from _uses(tree, vocabulary_of, in_bounds=True)

    def _used_definitions(self, trees: '_Trees') -> dict[str, dict[str, Span]]:
        """Return for each definition those that it uses, each with the place of its first use."""
        vocabulary_of = self._vocabularies(trees)
        names = {fret_name(name): name for name in trees}
        uses: dict[str, dict[str, Span]] = {name: {} for name in trees}
        for name, tree in trees.items():
            for written, span in _references(tree, vocabulary_of).items():
                if fret_name(written) in names:
                    uses[name].setdefault(names[fret_name(written)], span)
        return uses

    def _vocabularies(self, trees: '_Trees') -> FindVocabulary:
        """Return a look-up of an input's names of values, also by a definition that renames it."""
        renamed = {fret_name(name): tree.text for name, tree in trees.items()
                   if isinstance(tree, Name)}

        def vocabulary_of(name: str) -> Vocabulary | None:
            seen: set[str] = set()
            while (spelled := fret_name(name)) in renamed and spelled not in seen:
                seen.add(spelled)
                name = renamed[spelled]
            return self._scope.vocabulary_of(name)

        return vocabulary_of

    def _report_cycle(self, way: list[str], uses: Mapping[str, Mapping[str, Span]]) -> None:
        shown = way if len(way) <= _MANY else [*way[:_MANY - 1], '...', way[-1]]
        self.problems.error(f"the definition '{way[0]}' uses itself", uses[way[0]][way[1]],
                            ' -> '.join(shown))

    def read_requirements(self, memory: RequirementMemory | None) -> list[Property | None]:
        """Return the requirements, None for one with a mistake."""
        items = self._bundle.requirements
        if memory is None:
            return [self.read_requirement(item) for item in items]
        memory.begin(self._bundle)
        return [memory.find(item) or self._remembered(item, memory) for item in items]

    def _remembered(self, item: Requirement, memory: RequirementMemory) -> Property | None:
        """Read a requirement, and keep it if it adds nothing to what the others can see."""
        def noted() -> tuple[int, ...]:
            return (len(self.problems.errors), len(self.problems.warnings), len(self._feedback),
                    len(self.implied.added), len(self.aggregates))

        before = noted()
        found = self.read_requirement(item)
        if found is not None and noted() == before and not found.feedback and all(
                name in self._declared for name in found.inputs):
            memory.keep(item, found)
        return found

    def read_requirement(self, item: Requirement) -> Property | None:
        """Return a requirement with its formula, or None if it has a mistake."""
        tree = self._formula(item)
        term = self._property(item, tree)
        if term.is_broken:
            return None
        if not term.is_boolean:
            self.problems.error('a requirement must be true or false', term.span,
                                f'this is {describe(term)}', truth_help(term))
            return None
        if term.undefined:
            self.problems.warning(
                "this 'pre' has no value at the first step", term.origin,
                'false or 0 is used there', 'write its first value, as in 0 -> pre x')
        formula = from_horizon(formula_of(term), term.horizon)
        return Property(
            id=item.id.value,
            handler=item.handler,
            text=' '.join(item.text.value.split()),
            title=item.title,
            formula=formula,
            report=item.report or self._bundle.policy.default_report,
            severity=item.severity,
            feedback=self._reached(formula),
            place=item.text.span,
            bounds=tuple(sorted(term.bounds)),
            sentence=tree if isinstance(tree, Sentence) else None,
            id_place=item.id.span,
            is_assumption=item.is_assumption,
            constants=self._constants_of(tree),
            horizon=term.horizon,
            probability=self._probability(item, tree),
            on_violation=tuple(name.value for name in item.on_violation),
            on_end=tuple(name.value for name in item.on_end),
        )

    def _probability(self, item: Requirement,
                     tree: Expression | Equations | Sentence | None) -> Probability | None:
        found = probability_of(tree, item.confidence) if isinstance(tree, Sentence) else None
        if found is None and item.has_confidence:
            self.problems.error(f"{item.id.value} has a 'confidence' and no probability",
                                item.id.span, 'its verdict is of each run, not of many trials',
                                'leave it out; or: shall with probability > 0.98 ...')
        return found

    def _constants_of(self, tree: Expression | Equations | Sentence | None) -> tuple[str, ...]:
        """Return the constants that a text names, itself or in definitions, as declared."""
        found: set[str] = set()
        waiting = [*map(fret_name, _references(
            tree, self._scope.vocabulary_of, True))]
        while waiting:
            name = waiting.pop()
            if name not in found:
                found.add(name)
                waiting.extend(self._names_of.get(name, ()))
        return tuple(name for name in self._scope.constants if fret_name(name) in found)

    def _formula(self, item: Requirement) -> Expression | Equations | Sentence | None:
        if item.text in self._known:
            return self._known[item.text]
        try:
            return read_formula(item.language, item.text, is_timed=self._scale.is_timed)
        except CompileError as error:
            self.problems.extend(map(self._with_help, error.diagnostics))
            return None

    def _property(self, item: Requirement,
                  tree: Expression | Equations | Sentence | None) -> TypedTerm:
        if not isinstance(tree, Sentence):
            return self._term(item.language, item.text, tree, item.id.value)
        self._check_component(tree.component)
        return sentence_term(tree, self._scope, self.problems, self._scale, item.confidence)

    def _check_component(self, found: ComponentPhrase) -> None:
        expected = self._bundle.component
        if expected is not None and found.name != expected.value:
            self.problems.error(f"the component of this bundle is '{expected.value}'", found.span,
                                'this is another component',
                                f'write {expected.value}, or leave out component: in the '
                                'bundle, for any')

    def _tree(self, language: Language, text: Text) -> Expression | Equations | None:
        try:
            return read_expression(language, text)
        except CompileError as error:
            self.problems.extend(map(self._with_help, error.diagnostics))
            return None

    def _with_help(self, found: Diagnostic) -> Diagnostic:
        """Add help that needs the bundle: its names for a text."""
        if isinstance(found, QuotedText):
            meant = [f'{name} = {value}' for name, vocabulary in self._scope.vocabularies.items()
                     for value, of in vocabulary.named if found.text in (value, str(of))]
            return replace(found, help=f"write {' or '.join(meant[:_MEANT])}") if meant else found
        return found

    def _term(self, language: Language, text: Text, tree: Expression | Equations | None,
              owner: str) -> TypedTerm:
        if tree is None:
            return TypedTerm(Broken(), text.span)
        if isinstance(tree, Equations):
            return equations_term(tree, self._scope, self.problems, owner, self._feedback,
                                  self._scale)
        is_lustre = language is Language.COCOSPEC
        return Elaborator(self._scope, self.problems, is_lustre=is_lustre,
                          scale=self._scale, counters=self._feedback).term(tree)

    def _reached(self, formula: Formula) -> tuple[tuple[Feedback, Formula], ...]:
        """Return the equations of all `Feedback` nodes that a formula reaches, transitively."""
        found: dict[Feedback, Formula] = {}
        todo = [formula] if self._feedback else []
        while todo:
            for node in postorder([todo.pop()]):
                if isinstance(node, Feedback) and node not in found:
                    found[node] = self._feedback[node]
                    todo.append(found[node])
        return tuple(found.items())

    def shown(self, definitions: Iterable[Definition]) -> tuple[tuple[str, Formula], ...]:
        """Return the formulas of definitions, except literals that are outside every type."""
        names = self._scope.names
        terms = {item.name.value: names[item.name.value].term for item in definitions}
        found = []
        for name, term in terms.items():
            try:
                found.append((name, formula_of(term)))
            except CompileError:
                continue
        return tuple(found)
