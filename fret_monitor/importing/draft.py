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
The draft of a component's bundle: inputs with their topics, definitions and requirements.

`draft` takes a component and the connections of its inputs, and returns a `Draft`. Parts that
cannot be used are left out, with a warning and an entry in the list of manual tasks. The rest is
checked by `specify`, which also elaborates bundles, so the written bundle is valid. The bundle
contains the first valid wording of each requirement; the other valid ones are compared with it.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import chain, count
from typing import TypeAlias

from fret_monitor.bundle.bundle import (
    Bundle, ConstantEntry, Definition, InputEntry, Language, Requirement, ValueEntry,
)
from fret_monitor.elaboration.elaborate import specify
from fret_monitor.elaboration.signals import input_declaration
from fret_monitor.elaboration.types_by_use import TypesByUse
from fret_monitor.importing.component import (
    bare, ComponentRequirement, ComponentVariable, ImportedComponent, VariableRole,
)
from fret_monitor.importing.parsed_wording import (
    add_uses, names_in, parse_wording, ParsedWording, rename, Tree, used_names,
)
from fret_monitor.importing.topics import Connection
from fret_monitor.importing.type_names import message_for, plain_type
from fret_monitor.language.expression import Unit
from fret_monitor.logic.specification import Property, Signal
from fret_monitor.messages.installed import find_message
from fret_monitor.model.diagnostics import (
    CompileError, Diagnostic, did_you_mean, Level, Problems, refuse, Source, Text,
)
from fret_monitor.model.graph import components, is_cyclic
from fret_monitor.model.names import fret_name, name_fault, number_fault, quoted_name_fault, shown
from fret_monitor.model.policies import Policy, Report, Severity
from fret_monitor.model.values import ValueType

_STRING = 'std_msgs/msg/String'


@dataclass(frozen=True)
class DraftInput:
    """
    An input of the bundle; `topic` and `field` are None if they are omitted.

    `values` are names of its values, each with a number, or a string in quotes.
    """

    name: str
    type: str
    topic: str | None
    field: str | None
    signal: Signal
    is_output: bool = False
    values: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class DraftDefinition:
    """A definition of the bundle."""

    name: str
    language: Language
    text: str


@dataclass(frozen=True)
class DraftRequirement:
    """A requirement in its first valid wording; `title` is the sentence if that is another."""

    id: str
    language: Language
    text: str
    title: str
    rationale: str
    is_assumption: bool = False
    source: str = ''


@dataclass(frozen=True)
class Comparison:
    """The valid wordings of one requirement; the first one is in the bundle."""

    id: str
    properties: tuple[tuple[str, Property], ...]


@dataclass(frozen=True)
class Draft:
    """
    The content of a bundle.

    `left_out` are the omitted requirements with the reasons. `todo` are manual tasks: the first
    line is the task, the following lines are text to paste. `renamed` maps reserved names to their
    replacements. `keys` are further keys of the bundle, as of `ImportedComponent`.
    """

    component: str
    files: tuple[str, ...]
    constants: tuple[tuple[str, str], ...]
    inputs: tuple[DraftInput, ...]
    definitions: tuple[DraftDefinition, ...]
    requirements: tuple[DraftRequirement, ...]
    left_out: tuple[tuple[ComponentRequirement, str], ...]
    unused: tuple[str, ...]
    todo: tuple[str, ...]
    comparisons: tuple[Comparison, ...]
    renamed: tuple[tuple[str, str], ...] = ()
    times: 'Times | None' = None
    keys: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class Times:
    """
    The requirements with durations in units of time, which a bundle can read as times.

    `ids` are these requirements, `refused` all that the policy timed cannot read, and
    `evaluation` is the line that the bundle needs for the others.
    """

    ids: tuple[str, ...]
    refused: tuple[str, ...]
    evaluation: str


def draft(component: ImportedComponent, connections: Mapping[str, Connection],
          problems: Problems) -> Draft:
    """
    Return the draft of a component's bundle; add warnings to `problems`.

    Raises
    ------
    CompileError
        if there is no requirement that can be monitored.
    """
    return _Drafter(component, connections, problems).draft()


# A wording with its meaning.
_Usable: TypeAlias = tuple[ParsedWording, Property]


class _Drafter:
    """Sorts one component into the parts of a bundle."""

    def __init__(self, component: ImportedComponent, connections: Mapping[str, Connection],
                 problems: Problems) -> None:
        self._component = component
        self._connections = connections
        self._problems = problems
        self._readings = [[parse_wording(item) for item in requirement.wordings]
                          for requirement in component.requirements]
        self._assignments = {fret_name(item.name): [parse_wording(one) for one in item.assignments]
                             for item in component.variables}
        self._renamed: dict[str, str] = {}
        self._rename_reserved()
        self._todo: list[str] = []
        self._missing: dict[str, str] = {}
        self._constants: dict[str, tuple[str, str]] = {}
        self._definitions: dict[str, tuple[str, ParsedWording]] = {}
        self._inputs: dict[str, ComponentVariable] = {}
        self._types = TypesByUse()
        self._failed: dict[ParsedWording, list[Diagnostic]] = {}
        self._instead: dict[tuple[str, str, str], list[str]] = {}

    def draft(self) -> Draft:
        self._sort_variables()
        self._infer_types()  # while definitions are still single expressions
        self._close_cycles()
        self._add_undeclared()
        inputs = {key: self._input(item) for key, item in self._inputs.items()}
        meanings = self._meanings(inputs)
        usable = [self._usable(requirement, readings, meanings) for requirement, readings
                  in zip(self._component.requirements, self._readings, strict=True)]
        self._refuse_empty(usable)
        used = self._used(usable)
        left_out = list(self._left_out(usable))
        self._list_requirements(left_out)
        self._todo += [task for key, task in self._missing.items() if key in used]
        self._list_inputs([item for key, item in inputs.items() if key in used])
        return Draft(
            component=self._component.name,
            files=self._component.files,
            constants=tuple(self._constants.values()),
            inputs=tuple(item for key, item in inputs.items() if key in used),
            definitions=tuple(DraftDefinition(name, reading.language, reading.wording.text)
                              for name, reading in self._definitions.values()),
            requirements=tuple(self._written(requirement, readings[0]) for requirement, readings
                               in zip(self._component.requirements, usable, strict=True)
                               if readings),
            left_out=tuple(left_out),
            unused=tuple(item.name for key, item in inputs.items() if key not in used),
            renamed=tuple(self._renamed.items()),
            todo=tuple(self._todo),
            comparisons=tuple(self._comparisons(usable)),
            times=self._times(usable, inputs),
            keys=self._component.keys,
        )

    # Names

    def _rename_reserved(self) -> None:
        """Rename variables whose names are operators in a bundle (`pre`, `H`)."""
        readings = [*chain(*self._readings, *self._assignments.values())]
        names = {fret_name(name): name for reading in readings for name in names_in(reading)}
        taken = {*names, *(fret_name(item.name) for item in self._component.variables)}
        new = {key: free_name(name, taken) for key, name in names.items()
               if written_name(name) is None}
        if not new:
            return
        self._renamed = {names[key]: name for key, name in new.items()}
        for old, name in self._renamed.items():
            fault = name_fault(bare(old))
            self._problems.warning(f"'{bare(old)}' is named '{name}' in the bundle", None, '',
                                   fault.reason if fault else '')
        self._readings = [[rename(one, new) for one in items] for items in self._readings]
        self._assignments = {new.get(key, key): [rename(one, new) for one in items]
                             for key, items in self._assignments.items()}
        self._connections = {new.get(key, key): item for key, item in self._connections.items()}
        self._component = replace(
            self._component,
            variables=tuple(replace(item, name=new.get(fret_name(item.name), item.name))
                            for item in self._component.variables),
            requirements=tuple(
                replace(item, modes=tuple(new.get(fret_name(name), name) for name in item.modes))
                for item in self._component.requirements))

    def _sort_variables(self) -> None:
        """Sort the variables into constants, definitions and inputs."""
        for item in self._component.variables:
            name = written_name(item.name)
            if item.role is VariableRole.FUNCTION:
                continue
            if name is None:
                fault = name_fault(item.name)
                self._problems.warning(f'the variable {shown(item.name)} is left out', None,
                                       fault.reason if fault else '', 'rename it in FRET')
            elif not self._take_value(item, name):
                self._inputs[fret_name(item.name)] = replace(item, name=name)

    def _take_value(self, item: ComponentVariable, name: str) -> bool:
        """Add a variable with a value as a constant or a definition; False if it has none."""
        readings = self._assignments[fret_name(item.name)]
        found = next((reading for reading in readings if reading.tree), None)
        key = fret_name(item.name)
        if found is None:
            for reading in readings[:1]:
                self._warn(reading.diagnostics)
            if readings or item.role is VariableRole.INTERNAL:
                self._undefined(item, name)
            return False
        number = _number(found.wording.text)
        if number is not None:
            self._constants[key] = (name, number)
        else:
            self._definitions[key] = (name, found)
        return True

    def _close_cycles(self) -> None:
        """Turn definitions that depend on themselves or on one another into equations."""
        used = {key: used_names(reading) for key, (_, reading) in self._definitions.items()}
        graph = {key: [other for other in names if other in used] for key, names in used.items()}
        for group in components(graph):
            if is_cyclic(group, graph):
                texts = {key: f'{name} = {reading.wording.text};'
                         for key, (name, reading) in self._definitions.items() if key in group}
                for key in group:
                    name, reading = self._definitions[key]
                    others = [text for other, text in texts.items() if other != key]
                    self._definitions[key] = (name, _equations([*others, texts[key]], reading))

    def _undefined(self, item: ComponentVariable, name: str) -> None:
        why = 'it has no value in FRET' if not item.assignments else 'its value cannot be read'
        self._missing[fret_name(item.name)] = (
            f"'{name}' is {_article(item.role)}, and {why}: define it, or map it to a topic"
            f'\ndefinitions:\n  {name}: ...')

    def _infer_types(self) -> None:
        for item in self._inputs.values():
            kind = plain_type(item.type) or plain_type(self._connection(item.name).type)
            if item.role is VariableRole.MODE:
                self._types.declare(item.name, ValueType.BOOL)
            elif kind:
                self._types.declare(item.name, kind)
        for key, (_, number) in self._constants.items():
            is_truth = number in ('true', 'false')
            self._types.declare(key, ValueType.BOOL if is_truth else ValueType.FLOAT64)
        for key, (_, reading) in self._definitions.items():
            add_uses(reading, key, self._types)
        for readings in self._readings:
            for reading in readings:
                add_uses(reading, '', self._types)
        for requirement in self._component.requirements:
            for name in requirement.modes:
                self._types.declare(name, ValueType.BOOL)

    def _add_undeclared(self) -> None:
        """Add an input for each name that is used but not declared in any file."""
        known = {*self._constants, *self._definitions, *self._inputs}
        known.update(fret_name(name) for item in self._inputs.values() for name, _ in item.values)
        readings = [item for items in self._readings for item in items]
        readings += [item for _, item in self._definitions.values()]
        for reading in readings:
            for name in names_in(reading):
                if fret_name(name) not in known:
                    known.add(fret_name(name))
                    self._inputs[fret_name(name)] = ComponentVariable(
                        written_name(name) or name, VariableRole.INPUT)

    def _connection(self, name: str) -> Connection:
        return self._connections.get(fret_name(name)) or Connection(name)

    # Inputs

    def _input(self, item: ComponentVariable) -> DraftInput:
        """Return an input with its topic and type, if they are known."""
        link = self._connection(item.name)
        kind = (plain_type(item.type) or plain_type(link.type)
                or self._types.type_of(item.name) or ValueType.FLOAT64)
        is_output = item.role is VariableRole.OUTPUT
        if link.topic is None:
            return DraftInput(item.name, kind.value, None, None, _signal(item.name, kind),
                              is_output, item.values)
        message = link.message_type or message_for(kind)
        values = self._values(item, message, link.field)
        entry = _entry(item.name, message, link.field, values)
        problems = Problems()
        signal, _ = input_declaration(entry, find_message, problems)
        self._list_message_error(item.name, link, problems.errors)
        return DraftInput(item.name, message, link.topic, link.field,
                          signal or _signal(item.name, kind), is_output, values)

    def _values(self, item: ComponentVariable, message: str,
                field: str | None) -> tuple[tuple[str, str], ...]:
        """Return the names of an input's values that its message does not have."""
        if message == _STRING:
            return tuple((name, f'"{name}"') for name, _ in item.values)
        entry = _entry(item.name, message, field)
        _, declared = input_declaration(entry, find_message, Problems())
        vocabulary = declared.term.vocabulary
        known = vocabulary.numbers if vocabulary else {}
        strange = [name for name, _ in item.values if name not in known]
        if len(strange) in (0, len(item.values)):
            return item.values if strange else ()
        refuse(f"'{item.name}' has no value {strange[0]} in {message}",
               help=did_you_mean(strange[0], known) or f'its values are {vocabulary}')

    def _list_message_error(self, name: str, link: Connection,
                            errors: Sequence[Diagnostic]) -> None:
        for error in errors[:1]:
            hint = '\n' + error.help if error.help else ''
            self._todo.append(f"the input '{name}' on {link.topic}: {error.title}{hint}")

    def _list_requirements(self, left_out: Sequence[tuple[ComponentRequirement, str]]) -> None:
        """Add tasks for requirements that are left out, or not in their first wording."""
        reasons: dict[str, list[str]] = {}
        for item, reason in left_out:
            reasons.setdefault(reason, []).append(item.id)
        for reason, ids in reasons.items():
            self._todo.append(f'not monitored ({reason}), only a comment: {", ".join(ids)}')
        for (written, taken, reason), ids in self._instead.items():
            self._todo.append(f"'{taken}' is used, because the '{written}' cannot be "
                              f'({reason}): {", ".join(ids)}')

    def _list_inputs(self, inputs: Sequence[DraftInput]) -> None:
        """Add tasks for inputs without a topic, and for inputs whose types are guesses."""
        missing = [item for item in inputs if item.topic is None]
        if missing:
            lines = [f'  {item.name}: {{topic: ..., type: {message_for(item.signal.type)}}}'
                     + (f'   # {link.note}' if (link := self._connection(item.name)).note else '')
                     for item in missing]
            self._todo.append('\n'.join([f'no file gives the topic of {_these(missing)}; replace '
                                         'the type by:', *lines]))
        for item in inputs:
            if item.values and '"' not in item.values[0][1]:
                self._todo.append(f"the numbers of the values of '{item.name}' are guessed: "
                                  + ', '.join(f'{name} = {value}' for name, value in item.values))
        guessed = [item for item in inputs if not self._is_typed(item)]
        if guessed:
            types = ', '.join(f'{item.name} ({item.signal.type.value})' for item in guessed)
            self._todo.append(f'no file gives the type of {_these(guessed)}; guessed from the '
                              f'use: {types}')
        for item in inputs:
            if item.topic and self._connection(item.name).message_type is None:
                self._todo.append(
                    f"the message type of {item.topic} ('{item.name}') is guessed: {item.type}")

    def _is_typed(self, item: DraftInput) -> bool:
        """Whether a file gives the type of an input, or it is a mode."""
        link, known = self._connection(item.name), self._inputs.get(fret_name(item.name))
        is_declared = known is not None and (
            known.role is VariableRole.MODE or plain_type(known.type) is not None)
        return is_declared or link.message_type is not None or plain_type(link.type) is not None

    # Meanings

    def _meanings(self, inputs: dict[str, DraftInput]) -> dict[ParsedWording, Property]:
        """Return the property of each valid wording; store the errors of the others."""
        active = {reading: f'{number}' for number, reading in enumerate(
            item for items in self._readings for item in items if item.tree)}
        while active:
            try:
                specification, _ = specify(self._bundle(active, inputs), trees=_trees(active))
            except CompileError as error:
                self._remove_wrong(error, active, inputs)
            else:
                properties = {item.id: item for item in specification.properties}
                return {reading: properties[number] for reading, number in active.items()}
        return {}

    def _remove_wrong(self, error: CompileError, active: dict[ParsedWording, str],
                      inputs: dict[str, DraftInput]) -> None:
        """Remove wordings with errors; turn definitions with errors into inputs."""
        wrong: dict[Source, list[Diagnostic]] = {}
        for item in error.diagnostics:
            wrong.setdefault(item.span.source if item.span else Source('', ''), []).append(item)
        before = len(active) + len(self._definitions)
        for reading in [item for item in active if item.text.source in wrong]:
            self._failed.setdefault(reading, wrong[reading.text.source])
            del active[reading]
        for key, (name, reading) in list(self._definitions.items()):
            if reading.text.source in wrong:
                del self._definitions[key]
                self._warn(wrong[reading.text.source])
                variable = next(item for item in self._component.variables
                                if fret_name(item.name) == key)
                self._undefined(variable, name)
                inputs[key] = self._input(replace(variable, name=name))
        if before == len(active) + len(self._definitions):
            raise error

    def _bundle(self, active: Mapping[ParsedWording, str],
                inputs: Mapping[str, DraftInput]) -> Bundle:
        return Bundle(
            name=self._component.name,
            sources=(),
            component=_text(self._component.name) if self._component.name else None,
            title='',
            description='',
            constants=tuple(ConstantEntry(_text(bare(name)), _text(value))
                            for name, value in self._constants.values()),
            inputs=tuple(_entry(bare(item.name), item.signal.message_type or
                                item.signal.type.value, item.field if item.signal.message_type
                                else None, item.values) for item in inputs.values()),
            definitions=tuple(Definition(_text(bare(name)), reading.language, reading.text)
                              for name, reading in self._definitions.values()),
            policy=Policy.EVERY_MESSAGE,
            period=None,
            requirements=tuple(
                Requirement(_text(number), reading.language, reading.text, '', '',
                            Report.EVERY_STEP, Severity.ERROR)
                for reading, number in active.items()),
        )

    # Requirements

    def _usable(self, requirement: ComponentRequirement, readings: Sequence[ParsedWording],
                meanings: Mapping[ParsedWording, Property]) -> list[_Usable]:
        """Return the valid wordings; warn about the others."""
        found = [(item, meanings[item]) for item in readings if item in meanings]
        failed = [item for item in readings if item not in meanings]
        for item in failed if found else failed[:1]:
            self._warn(self._diagnostics_of(item)[:1])
        if failed and found and failed[0] is readings[0]:
            self._instead.setdefault(
                (failed[0].language.value, found[0][0].language.value, self._reason(failed[0])),
                []).append(requirement.id)
        return found

    def _diagnostics_of(self, reading: ParsedWording) -> Sequence[Diagnostic]:
        return reading.diagnostics or self._failed.get(reading, ())

    def _reason(self, reading: ParsedWording) -> str:
        diagnostics = self._diagnostics_of(reading)
        return diagnostics[0].title if diagnostics else 'it is empty'

    def _left_out(self, usable: Sequence[Sequence[_Usable]]
                  ) -> Iterator[tuple[ComponentRequirement, str]]:
        for requirement, readings, found in zip(
                self._component.requirements, self._readings, usable, strict=True):
            if not found:
                yield requirement, (self._reason(readings[0]) if readings
                                    else 'it has no formula')

    def _refuse_empty(self, usable: Iterable[Sequence[_Usable]]) -> None:
        if any(usable):
            return
        errors = [item for readings in self._readings for reading in readings[:1]
                  for item in self._diagnostics_of(reading)[:1]]
        if errors:
            raise CompileError([replace(item, level=Level.ERROR) for item in errors])
        whose = shown(self._component.name or ', '.join(self._component.files))
        refuse(f'no requirement of {whose} has a formula or a sentence')

    def _used(self, usable: Iterable[Sequence[_Usable]]) -> set[str]:
        """Return the keys of all names that the bundle uses."""
        readings = [found[0][0] for found in usable if found]
        readings += [reading for _, reading in self._definitions.values()]
        return {key for reading in readings for key in used_names(reading)}

    def _written(self, requirement: ComponentRequirement,
                 found: _Usable) -> DraftRequirement:
        reading = found[0]
        sentence = next((item.text for item in requirement.wordings
                         if item.languages == (Language.FRETISH,)), '')
        title = requirement.title or (
            '' if reading.language is Language.FRETISH else sentence)
        return DraftRequirement(requirement.id, reading.language, reading.wording.text, title,
                                requirement.rationale, requirement.is_assumption,
                                ' '.join(requirement.source.split()))

    def _times(self, usable: Sequence[Sequence[_Usable]],
               inputs: Mapping[str, DraftInput]) -> Times | None:
        """Return what the bundle would be in time; None if no sentence has a unit of time."""
        chosen = {found[0][0]: requirement.id for requirement, found in zip(
            self._component.requirements, usable, strict=True) if found}
        timed = [requirement.id for requirement, found in zip(
            self._component.requirements, usable, strict=True)
            if found and _has_time(found[0][1])]
        if not timed:
            return None
        for unit in (None, Fraction(1)):
            bundle = replace(self._bundle(chosen, inputs), policy=Policy.TIMED, unit=unit)
            refused = tuple(_refused(bundle, chosen))
            if not refused:
                break
        line = 'policy: timed' + (', unit: 1' if unit else '')
        return Times(tuple(timed), refused, f'evaluation: {{{line}}}')

    def _comparisons(self, usable: Sequence[Sequence[_Usable]]
                     ) -> Iterator[Comparison]:
        for requirement, found in zip(self._component.requirements, usable, strict=True):
            alike = [(reading, meaning) for reading, meaning in found
                     if meaning.horizon == found[0][1].horizon]  # a step has one verdict
            labels = Counter(reading.wording.label for reading, _ in alike)
            named = tuple((reading.wording.label if labels[reading.wording.label] == 1 else
                           f'{reading.wording.label}, {reading.language.value}', meaning)
                          for reading, meaning in alike)
            if len(named) > 1:
                yield Comparison(requirement.id, named)

    def _warn(self, diagnostics: Iterable[Diagnostic]) -> None:
        self._problems.extend(replace(item, level=Level.WARNING) for item in diagnostics)


def _has_time(item: Property) -> bool:
    timing = item.sentence.timing if item.sentence else None
    return timing is not None and timing.duration is not None and (
        timing.duration.unit is not Unit.TICK)


def _trees(readings: Iterable[ParsedWording]) -> dict[Text, Tree]:
    """Return the trees of wordings by their texts, so that they are not parsed again."""
    return {item.text: item.tree for item in readings if item.tree is not None}


def _refused(bundle: Bundle, chosen: Mapping[ParsedWording, str]) -> Iterator[str]:
    """Yield the ids of the requirements that have mistakes in a bundle."""
    try:
        specify(bundle, trees=_trees(chosen))
    except CompileError as error:
        wrong = {item.span.source for item in error.diagnostics if item.span}
        yield from (name for reading, name in chosen.items() if reading.text.source in wrong)


def written_name(name: str) -> str | None:
    """Return a name in a bundle's syntax, quoted if necessary; None if it is invalid."""
    inner = bare(name)
    if inner == name and name_fault(name) is None:
        return name
    return f'"{inner}"' if quoted_name_fault(inner) is None and name_fault(inner) and not (
        inner.replace('_', '').isalnum()) else None if name_fault(inner) else inner


def free_name(name: str, taken: set[str]) -> str:
    """Return a valid, unused name in place of a reserved one, and add it to `taken`."""
    base = f'{bare(name)}_value'
    found = next(free for free in chain([base], (f'{base}_{number}' for number in count(2)))
                 if free not in taken)
    taken.add(found)
    return found


def _number(text: str) -> str | None:
    """Return a number, true or false in a bundle's syntax; None for other expressions."""
    word = text.strip()
    while word.startswith('(') and word.endswith(')') and '(' not in word[1:]:
        word = word[1:-1].strip()
    if word.lower() in ('true', 'false'):
        return word.lower()
    sign, rest = ('-', word[1:].strip()) if word.startswith('-') else ('', word)
    number = f'{sign}{rest}'
    mended = number if not rest.endswith('.') else f'{number}0'
    return mended if number_fault(mended) is None else None


def _equations(texts: Sequence[str], reading: ParsedWording) -> ParsedWording:
    """Return equations as one wording; the last equation is that of the definition itself."""
    found = parse_wording(replace(reading.wording, languages=(Language.COCOSPEC,),
                                  text=' '.join(texts)))
    return found if found.tree else reading


def _these(inputs: Sequence[DraftInput]) -> str:
    return 'these inputs' if len(inputs) > 1 else 'this input'


def _article(role: VariableRole) -> str:
    return f'an {role.value}' if role.value[0] in 'aeiou' else f'a {role.value}'


def _text(value: str) -> Text:
    return Text.whole(Source(value, value))


def _entry(name: str, kind: str, field: str | None,
           values: Iterable[tuple[str, str]] = ()) -> InputEntry:
    return InputEntry(
        _text(name), type=_text(kind), field=_text(field) if field else None,
        values=tuple(ValueEntry(_text(one), _text(value.strip('"')), value[0] == '"')
                     for one, value in values))


def _signal(name: str, kind: ValueType) -> Signal:
    return Signal(bare(name), kind, None, None, (), (), None, ())
