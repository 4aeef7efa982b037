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

"""What there is to know about a place of a bundle, in Markdown: of inputs, words, requirements."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from fret_monitor.bundle.bundle import InputEntry, Requirement
from fret_monitor.editing.edited_bundle import EditedBundle
from fret_monitor.editing.formulas import formula_at, FormulaPlace, owner_at, word_at, WordPlace
from fret_monitor.editing.keys import described
from fret_monitor.editing.outline import ITEM, OutlinePlace
from fret_monitor.editing.words import meanings_of
from fret_monitor.explain.report import meanings
from fret_monitor.logic.printing import to_smv
from fret_monitor.logic.scopes import one_instance
from fret_monitor.logic.specification import Signal
from fret_monitor.messages.definitions import field_comment
from fret_monitor.messages.installed import nested_layout
from fret_monitor.model.diagnostics import CompileError, Span
from fret_monitor.model.manifest import ANGLES, SECONDS
from fret_monitor.model.names import fret_name
from fret_monitor.model.policies import InputSource, Policy

_WIDTH = 500
_UNITS = {InputSource.AGE: 'seconds', InputSource.PERIOD: 'seconds',
          InputSource.RATE: 'messages a second'}


@dataclass(frozen=True)
class HoverText:
    """Text in Markdown about a range of the file."""

    place: Span
    markdown: str


def hover(edited: EditedBundle, offset: int) -> HoverText | None:
    """Return what there is to know about the word at an offset, None if that is nothing."""
    place = edited.place_at(offset)
    if place.scalar is None:
        return None
    formula = formula_at(place)
    if formula is not None:
        word = word_at(place.scalar.text, offset)
        return word and _of_word(edited, word, formula)
    lines = [*_of_scalar(edited, place, place.scalar.value)]
    return HoverText(place.scalar.span, '\n\n'.join(lines)) if lines else None


def _of_word(edited: EditedBundle, word: WordPlace, formula: FormulaPlace) -> HoverText | None:
    is_quoted = word.text.startswith('"')
    lines = [*_of_name(edited, word.text.strip('"'))]
    if not lines and not is_quoted:
        lines = [f'`{item.shape}`' + (f': {item.meaning}' if item.meaning else '')
                 for item in meanings_of(formula.language, word.text)]
    return HoverText(word.place, '\n\n'.join(lines)) if lines else None


def _of_scalar(edited: EditedBundle, place: OutlinePlace, value: str) -> Iterator[str]:
    """Yield the paragraphs about a key or value outside of formulas."""
    match (place.path, place.is_key):
        case ((('inputs' | 'constants' | 'definitions'),), True):
            yield from _of_name(edited, value.strip('"'))
        case (('topics', _, 'fields'), True):
            yield from _of_name(edited, value.strip('"'))
        case (('requirements', step, 'id'), False) if step == ITEM:
            yield from _of_requirement(edited, place)
        case (_, True):
            yield from described((*place.path, value), edited.is_signals)
        case ((*_, 'type'), False):
            yield from _of_type(edited, value)
        case _:
            pass


def _of_name(edited: EditedBundle, name: str) -> Iterator[str]:
    """Yield the paragraphs about a declared name, in either spelling."""
    bundle = edited.bundle
    if bundle is None:
        return
    for entry in bundle.inputs:
        if fret_name(entry.name.value) == fret_name(name):
            yield from _of_input(edited, entry)
    for constant in bundle.constants:
        if fret_name(constant.name.value) == fret_name(name):
            yield f'`{constant.name.value}`: constant {constant.value.value}'
    for item in bundle.definitions:
        if fret_name(item.name.value) == fret_name(name):
            yield f'`{item.name.value}`: definition, `{" ".join(item.text.value.split())}`'
            yield from _formula_of(edited, item.name.value)


def _formula_of(edited: EditedBundle, name: str) -> Iterator[str]:
    if edited.reading is None:
        return
    specification = edited.reading.specification
    values = {signal.name: signal.values for signal in specification.signals if signal.values}
    for defined, formula in specification.definitions:
        if defined == name:
            text = to_smv(formula, _WIDTH, values,
                          is_timed=specification.policy is Policy.TIMED)
            yield f'`{text}`'


def _of_input(edited: EditedBundle, entry: InputEntry) -> Iterator[str]:
    signal = edited.signal(entry.name.value)
    kind = f', {signal.type.value}' if signal and not signal.is_string else ''
    yield f'`{entry.name.value}`: input{kind}'
    source = ', '.join(part for part in (
        f'topic `{entry.topic.value}`' if entry.topic and not entry.made else '',
        f'`{entry.type.value}`' if entry.type and '/' in entry.type.value else '',
        f'field `{entry.field.value}`' if entry.field else '') if part)
    if source:
        yield source
    if signal is not None:
        yield from _unit(signal)
    vocabulary = edited.vocabulary(entry.name.value)
    if vocabulary is not None and vocabulary.named:
        yield 'values ' + ', '.join(f'`{name}` = {value}' for name, value in vocabulary.named)


def _unit(signal: Signal) -> Iterator[str]:
    """Yield the unit of an input, as its message's definition or its function has it."""
    if signal.source in _UNITS:
        yield f'in {_UNITS[signal.source]}'
    elif signal.reduction == SECONDS:
        yield 'in seconds'
    elif signal.reduction in ANGLES:
        yield 'in radians'
    layout = signal.layout
    try:
        for step in signal.path:
            item = layout.find_field(step) if layout and isinstance(step, str) else None
            if layout is None or item is None:
                continue
            comment = field_comment(layout, item.name)
            inside = nested_layout(layout, item.type) if item.type.is_message else None
            if step == [name for name in signal.path if isinstance(name, str)][-1] and comment:
                yield f'{layout.name}: "{comment}"'
            layout = inside
    except CompileError:
        return


def _of_type(edited: EditedBundle, name: str) -> Iterator[str]:
    if '/' not in name:
        return
    try:
        layout = edited.find_message(name)
    except CompileError:
        return
    yield f'`{layout.name}`'
    fields = '\n'.join(f'{item.type} {item.name}' for item in layout.fields)
    yield f'```\n{fields}\n```'


def _of_requirement(edited: EditedBundle, place: OutlinePlace) -> Iterator[str]:
    """Yield a requirement's fields, words and formula."""
    assert place.scalar is not None, 'hover has one'
    owner = owner_at(edited, place.scalar.span.start)
    if not isinstance(owner, Requirement) or edited.reading is None:
        return
    reading = replace(edited.reading, specification=one_instance(edited.reading.specification))
    try:
        found = meanings(reading, edited.find_message, [owner.id.value])[owner.id.value]
    except CompileError:
        return
    yield f'**{owner.id.value}**' + (f' {owner.title}' if owner.title else '')
    yield from (f'{name}: {text}' for name, text in (*found.fields, *found.meaning))
    yield f'`{found.formula}`'
