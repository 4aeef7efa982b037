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
What a bundle is made of, as a picture: topics, inputs, definitions, requirements, actions, gates.

A link leads from what is read to what reads it, and from a requirement to what it causes.
"""

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import Enum

from fret_monitor.bundle.bundle import Bundle, InputEntry
from fret_monitor.editing.edited_bundle import EditedBundle
from fret_monitor.model.diagnostics import Diagnostic, Level, Span, Text
from fret_monitor.model.names import fret_name


class PictureKind(Enum):
    """What a node of a picture is, from the left to the right."""

    TOPIC = 'topic'
    INPUT = 'input'
    DEFINITION = 'definition'
    REQUIREMENT = 'requirement'
    ACTION = 'action'
    GATE = 'gate'


@dataclass(frozen=True)
class PictureNode:
    """A node; `places` are its texts, the first its name. `level` is that of its worst problem."""

    kind: PictureKind
    name: str
    detail: str
    places: tuple[Span, ...]
    level: Level | None = None


@dataclass(frozen=True)
class Picture:
    """Nodes, and links between two of them (indices)."""

    nodes: tuple[PictureNode, ...]
    links: tuple[tuple[int, int], ...]


def picture(edited: EditedBundle) -> Picture:
    """Return the picture of a bundle, as far as it can be read."""
    if edited.bundle is None:
        return Picture((), ())
    nodes = tuple(_with_problems(_nodes(edited.bundle), edited.diagnostics))
    places = {(node.kind, fret_name(node.name)): place for place, node in enumerate(nodes)}
    links = dict.fromkeys(
        (places[begin], places[end]) for begin, end in _links(edited, nodes)
        if begin in places and end in places)
    return Picture(nodes, tuple(links))


def _nodes(bundle: Bundle) -> Iterator[PictureNode]:
    topics: dict[str, InputEntry] = {}
    for item in bundle.inputs:
        if name := _topic(item):
            topics.setdefault(name, item)
    for name, item in topics.items():
        yield PictureNode(PictureKind.TOPIC, name, _value(item.type), _spans(
            item.topic, item.type))
    for item in bundle.inputs:
        yield PictureNode(PictureKind.INPUT, item.name.value, _value(item.field), _spans(
            item.name, item.field))
    for entry in bundle.definitions:
        yield PictureNode(PictureKind.DEFINITION, entry.name.value, _value(entry.text), _spans(
            entry.name, entry.text))
    for found in bundle.requirements:
        yield PictureNode(PictureKind.REQUIREMENT, found.id.value, _value(found.text), _spans(
            found.id, found.text, *found.on_violation, *found.on_end))
    for action in bundle.actions:
        yield PictureNode(PictureKind.ACTION, action.name.value, ' '.join(filter(None, (
            action.kind.value, _value(action.target)))), _spans(action.name, action.target))
    for gate in bundle.gates:
        ways = ' to '.join(filter(None, map(_value, (gate.source, gate.target))))
        yield PictureNode(PictureKind.GATE, gate.name.value, ways, _spans(
            gate.name, gate.source, gate.target, *gate.keep))


def _topic(item: InputEntry) -> str:
    """Return the name of the topic of an input, or of what is seen in the graph."""
    return item.made.topic if item.made is not None else _value(item.topic)


def _value(text: Text | None) -> str:
    return '' if text is None else ' '.join(text.value.split())


def _spans(*texts: Text | None) -> tuple[Span, ...]:
    return tuple(text.span for text in texts if text is not None)


_Key = tuple[PictureKind, str]


def _links(edited: EditedBundle, nodes: Sequence[PictureNode]) -> Iterator[tuple[_Key, _Key]]:
    bundle = edited.bundle
    assert bundle is not None, 'there are nodes'
    for item in bundle.inputs:
        yield (PictureKind.TOPIC, fret_name(_topic(item))), (
            PictureKind.INPUT, fret_name(item.name.value))
    yield from _uses(edited, nodes)
    for found in bundle.requirements:
        for text in (*found.on_violation, *found.on_end):
            yield (PictureKind.REQUIREMENT, fret_name(found.id.value)), (
                PictureKind.ACTION, fret_name(text.value))
    for gate in bundle.gates:
        for text in gate.keep:
            yield (PictureKind.REQUIREMENT, fret_name(text.value)), (
                PictureKind.GATE, fret_name(gate.name.value))


def _uses(edited: EditedBundle, nodes: Sequence[PictureNode]) -> Iterator[tuple[_Key, _Key]]:
    """Yield the links from inputs and definitions to the formulas that name them."""
    formulas = sorted(((node.places[1].source.name, node.places[1].start, node.places[1].end,
                        (node.kind, fret_name(node.name))) for node in nodes
                       if node.kind in (PictureKind.DEFINITION, PictureKind.REQUIREMENT)),
                      key=lambda item: item[:2])
    begins = [item[:2] for item in formulas]
    for use in edited.uses:
        place = bisect_right(begins, (use.span.source.name, use.span.start)) - 1
        if place >= 0 and use.span.start < formulas[place][2] \
                and use.span.source.name == formulas[place][0]:
            for kind in (PictureKind.INPUT, PictureKind.DEFINITION):
                yield (kind, fret_name(use.text)), formulas[place][3]


def _with_problems(nodes: Iterator[PictureNode],
                   diagnostics: Sequence[Diagnostic]) -> Iterator[PictureNode]:
    spans = [(item.span, item.level) for item in diagnostics if item.span is not None]
    for node in nodes:
        levels = {level for span, level in spans for place in node.places
                  if span.source.name == place.source.name
                  and place.start <= span.start <= place.end}
        yield replace(node, level=Level.ERROR if Level.ERROR in levels else
                      Level.WARNING if levels else None)
