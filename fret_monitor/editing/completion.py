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

"""What may be written at a place of a bundle."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
import re
from typing import TypeAlias

from fret_monitor.bundle.bundle import Language
from fret_monitor.editing.edited_bundle import EditedBundle
from fret_monitor.editing.formulas import formula_at, FormulaPlace, written_name
from fret_monitor.editing.keys import keys_at, values_at
from fret_monitor.editing.outline import OutlinePlace
from fret_monitor.editing.words import meanings_of, OVER_INSTANCES
from fret_monitor.elaboration.functions import FUNCTIONS
from fret_monitor.elaboration.languages import what_follows
from fret_monitor.language.continuation import Continuation
from fret_monitor.messages.definitions import field_comment
from fret_monitor.messages.installed import installed_types, nested_layout
from fret_monitor.messages.layout import MessageLayout
from fret_monitor.model.diagnostics import CompileError, Span
from fret_monitor.model.manifest import REDUCTIONS
from fret_monitor.model.names import PLAIN_TYPES

RunningTopics: TypeAlias = Callable[[], Mapping[str, Sequence[str]]]
"""Returns the topics of the running graph, each with its types."""

_PARTIAL = re.compile(r'"?[A-Za-z_$][\w$.%]*$|"[^"]*$')
_COMPARED = re.compile(r'(?P<name>[A-Za-z_$][\w$.%]*|"[^"]*")\s*(?:=|!=|==)\s*$')
_CALLED = re.compile(r'^\s*\w+\s*\(')
_INDEX = re.compile(r'\[[^]]*\]')
_LONGEST_NAME = 300  # characters before a place that are searched for a name
_TOPIC_KEYS = frozenset({'topic', 'from', 'publishers', 'subscribers'})


class ProposalKind(Enum):
    """What a proposal is."""

    KEY = 'key'
    VALUE = 'value'
    INPUT = 'input'
    CONSTANT = 'constant'
    DEFINITION = 'definition'
    WORD = 'word'
    FUNCTION = 'function'
    TYPE = 'type'
    FIELD = 'field'
    TOPIC = 'topic'
    NAME = 'name'


@dataclass(frozen=True)
class Proposal:
    """Text that may replace what is written in `place`; `detail` says what it is."""

    kind: ProposalKind
    label: str
    detail: str
    place: Span
    text: str


def complete(edited: EditedBundle, offset: int,
             topics: RunningTopics | None = None) -> tuple[Proposal, ...]:
    """Return what may be written at an offset, in place of what is written before it."""
    place = edited.place_at(offset)
    formula = formula_at(place)
    if formula is not None:
        return tuple(_in_formula(edited, place, formula, offset))
    found = _Proposals(edited, Span(edited.source, place.start, offset))
    if place.is_key:
        return (*found.keys(place.path, place.others), *found.topics(place, topics))
    return (*found.values(place), *found.topics(place, topics),
            *found.keys(place.path, frozenset()))


@dataclass(frozen=True)
class _Proposals:
    """Makes the proposals for one place outside of formulas."""

    edited: EditedBundle
    place: Span

    def _of(self, kind: ProposalKind, words: Mapping[str, str]) -> Iterator[Proposal]:
        yield from (Proposal(kind, word, detail, self.place, word)
                    for word, detail in words.items())

    def keys(self, path: Sequence[str], others: frozenset[str]) -> Iterator[Proposal]:
        found = keys_at(path, self.edited.is_signals)
        yield from (Proposal(ProposalKind.KEY, key, detail, self.place, f'{key}: ')
                    for key, detail in found.items() if key not in others)

    def values(self, place: OutlinePlace) -> Iterator[Proposal]:
        path, bundle = place.path, self.edited.bundle
        listed = values_at(path, self.edited.is_signals)
        yield from self._of(ProposalKind.VALUE, dict.fromkeys(listed, ''))
        match path:
            case (*_, 'type'):
                yield from self._of(ProposalKind.TYPE, dict.fromkeys(_types(path), ''))
            case ('inputs', name, 'field'):
                yield from self._fields(name, place.beginning)
            case ('topics', _, 'fields', name, *_):
                yield from self._fields(name, place.beginning)
            case (*_, 'keep') | (*_, 'keep', _):
                yield from self._of(ProposalKind.NAME, dict.fromkeys(
                    bundle.ids if bundle else (), 'requirement'))
            case (*_, 'on_violation' | 'on_end') | (*_, 'on_violation' | 'on_end', _):
                yield from self._of(ProposalKind.NAME, {
                    item.name.value: item.kind.value for item in bundle.actions}
                    if bundle else {})
            case _:
                pass

    def _fields(self, name: str, beginning: str) -> Iterator[Proposal]:
        """Yield the fields of a message, behind a path that is written already."""
        entry = self.edited.inputs.get(name)
        if entry is None or entry.type is None:
            return
        before, dot, _ = _CALLED.sub('', beginning).rpartition('.')
        layout = _inside(self.edited, entry.type.value, before)
        if layout is None:
            return
        written = len(beginning) - len(_CALLED.sub('', beginning)) + len(before) + len(dot)
        place = Span(self.edited.source, min(self.place.start + written, self.place.end),
                     self.place.end)
        for item in layout.fields:
            comment = field_comment(layout, item.name)
            detail = f'{item.type}  {comment}' if comment else str(item.type)
            yield Proposal(ProposalKind.FIELD, item.name, detail, place, item.name)
        if not written:
            yield from (Proposal(ProposalKind.FUNCTION, f'{word}()', 'of a field', place,
                                 f'{word}(') for word in REDUCTIONS)

    def topics(self, place: OutlinePlace,
               running: RunningTopics | None) -> Iterator[Proposal]:
        is_topic = place.path == ('topics',) if place.is_key else place.path[-1:] and \
            place.path[-1] in _TOPIC_KEYS and place.path[0] in ('inputs', 'topics', 'gates')
        if running is None or not is_topic:
            return
        found = {name: ', '.join(types) for name, types in running().items()}
        ending = ': ' if place.is_key else ''
        yield from (Proposal(ProposalKind.TOPIC, name, types, self.place, name + ending)
                    for name, types in found.items())


def _types(path: Sequence[str]) -> Iterable[str]:
    """Return the types that a key `type` may have."""
    match path:
        case ('inputs', *_):
            return (*PLAIN_TYPES, *installed_types())
        case ('gates', *_) | ('actions', _, 'call', *_):
            services = installed_types('srv')
            return services if path[0] == 'actions' else (*installed_types(), *services)
        case _:
            return installed_types()


def _inside(edited: EditedBundle, name: str, path: str) -> MessageLayout | None:
    """Return the layout of the message at the end of a path, None if there is none."""
    try:
        layout = edited.find_message(name)
        for step in filter(None, _INDEX.sub('', path).split('.')):
            item = layout.find_field(step.strip())
            if item is None or not item.type.is_message:
                return None
            layout = nested_layout(layout, item.type)
        return layout
    except CompileError:
        return None


def _in_formula(edited: EditedBundle, place: OutlinePlace, formula: FormulaPlace,
                offset: int) -> Iterator[Proposal]:
    match = _PARTIAL.search(place.beginning[-_LONGEST_NAME:])
    partial = match[0] if match else ''
    beginning = place.beginning[:len(place.beginning) - len(partial)]
    span = Span(edited.source, max(offset - len(partial), place.start), offset)
    compared = _COMPARED.search(beginning[-_LONGEST_NAME:])
    if compared is not None:
        vocabulary = edited.vocabulary(compared['name'].strip('"'))
        for name, value in vocabulary.named if vocabulary else ():
            yield Proposal(ProposalKind.VALUE, name, str(value), span, name)
    follows = what_follows(formula.language, beginning, is_definition=formula.is_definition)
    if follows is not None:
        yield from _following(edited, follows, formula, span)
    else:
        yield from _names(edited, formula.language, span)


def _following(edited: EditedBundle, follows: Continuation, formula: FormulaPlace,
               span: Span) -> Iterator[Proposal]:
    if follows.is_component:
        yield from (Proposal(ProposalKind.NAME, name, 'component', span, name)
                    for name in _components(edited))
    if follows.is_operand or follows.is_mode:
        yield from _names(edited, formula.language, span)
    if follows.is_operand:
        yield from _functions(edited, formula.language, span)
    for word in follows.words:
        detail = ' '.join(f'{item.shape}: {item.meaning}' if item.meaning else item.shape
                          for item in meanings_of(formula.language, word)[:1])
        yield Proposal(ProposalKind.WORD, word, detail, span, word)


def _components(edited: EditedBundle) -> Iterable[str]:
    """Return the component of a bundle, or those that its sentences name."""
    if edited.bundle is not None and edited.bundle.component is not None:
        return (edited.bundle.component.value,)
    properties = edited.reading.specification.properties if edited.reading else ()
    return dict.fromkeys(item.sentence.component.name for item in properties if item.sentence)


def _functions(edited: EditedBundle, language: Language, span: Span) -> Iterator[Proposal]:
    variables = edited.bundle.instance_variables if edited.bundle else ()
    for name, function in FUNCTIONS.items():
        detail = ' '.join(f'{item.shape}: {item.meaning}' for item in meanings_of(
            language, name)[:1])
        yield Proposal(ProposalKind.FUNCTION, f'{name}({function.forms[0]})', detail, span,
                       f'{name}(')
    for variable in variables:
        for name in sorted(OVER_INSTANCES):
            yield Proposal(ProposalKind.FUNCTION, f'{name}({variable.name.value}: ...)',
                           'over all instances', span, f'{name}({variable.name.value}: ')


def _names(edited: EditedBundle, language: Language, span: Span) -> Iterator[Proposal]:
    """Yield the names that a formula may use."""
    bundle = edited.bundle
    if bundle is None:
        return

    def proposal(kind: ProposalKind, name: str, detail: str) -> Proposal:
        return Proposal(kind, name, detail, span, written_name(name, language))

    for entry in bundle.inputs:
        signal = edited.signal(entry.name.value)
        kind = 'text' if signal and signal.is_string else signal.type.value if signal else ''
        topic = entry.topic.value if entry.topic and not entry.made else ''
        yield proposal(ProposalKind.INPUT, entry.name.value,
                       ' '.join(filter(None, (kind, topic))))
    for constant in bundle.constants:
        yield proposal(ProposalKind.CONSTANT, constant.name.value, constant.value.value)
    for item in bundle.definitions:
        yield proposal(ProposalKind.DEFINITION, item.name.value,
                       ' '.join(item.text.value.split()))
