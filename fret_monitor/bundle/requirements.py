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

"""Reads the list of requirements: each with an id, one formula, and the bundle's defaults."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction

from fret_monitor.bundle.actions import read_names
from fret_monitor.bundle.bundle import Language, Requirement
from fret_monitor.bundle.formulas import FORMULA_KEYS, FORMULA_SLIPS, read_one_formula
from fret_monitor.bundle.yaml_shape import kind_of, mapping_of, Quantity, report_fault, Shape
from fret_monitor.bundle.yaml_tree import Node, Unread, YamlList, YamlMapping, YamlScalar
from fret_monitor.model.diagnostics import Problems, Source, Text
from fret_monitor.model.names import handler_fault, shown
from fret_monitor.model.policies import Report, Severity
from fret_monitor.model.probability import LEAST, USUAL_CONFIDENCE

REQUIREMENT_KEYS = ('id', *FORMULA_KEYS, 'title', 'rationale', 'source', 'report', 'severity',
                    'assume', 'on_violation', 'on_end', 'confidence')
_PROBABILITY = Quantity('certainty', '0.999', {})
_NO_TEXT = Text('', Source('', ''), [0])


@dataclass(frozen=True)
class _Defaults:
    """What the bundle says for all requirements."""

    report: Report | None
    severity: Severity
    on_violation: tuple[Text, ...]
    on_end: tuple[Text, ...]
    confidence: Fraction


@dataclass
class Ids:
    """The ids of all requirements; not `are_all` if one could not be read."""

    found: list[str] = field(default_factory=list)
    are_all: bool = True


def read_requirements(shape: Shape, problems: Problems, seen: Ids) -> Iterator[Requirement]:
    """Yield the requirements that can be used; add the ids of all to `seen`."""
    node = shape.node('requirements')
    defaults = _Defaults(
        shape.choice('report', Report), shape.choice('severity', Severity) or Severity.ERROR,
        read_names(shape, 'on_violation', problems) or (),
        read_names(shape, 'on_end', problems) or (), _confidence(shape) or USUAL_CONFIDENCE)
    ids: dict[str, Requirement] = {}
    handlers: dict[str, Requirement] = {}
    seen.are_all = (isinstance(node, YamlList) and bool(node.items)
                    and not shape.may_hide('requirements'))
    for item in _requirement_nodes(shape, node, problems):
        found = _requirement(item, defaults, problems) if item else None
        if found is None:
            seen.are_all = False
        else:
            seen.found.append(found.id.value)
            _check_id(found, ids, handlers, problems)
            if found.text is not _NO_TEXT:
                yield found


def _confidence(shape: Shape) -> Fraction | None:
    return shape.number('confidence', _PROBABILITY, Fraction(1, 2), 1 - LEAST)


def _requirement_nodes(shape: Shape, node: Node | None,
                       problems: Problems) -> Iterator[YamlMapping | None]:
    if isinstance(node, YamlList) and node.items:
        for item in node.items:
            yield _requirement_node(item, problems)
    elif isinstance(node, YamlList) or isinstance(node, YamlScalar) and node.is_missing or (
            node is None and shape.lacks('requirements')):
        problems.error('a bundle needs at least one requirement',
                       node.span if node else shape.span, 'none is given',
                       'requirements:\n  - id: R1\n    ptltl: "H (speed <= 2.0)"')
    elif node is not None and not isinstance(node, Unread):
        problems.error("the 'requirements' must be a list", node.span, f'this is {kind_of(node)}',
                       '- id: R1\n  ptltl: "H (speed <= 2.0)"')


def _check_id(item: Requirement, ids: dict[str, Requirement],
              handlers: dict[str, Requirement], problems: Problems) -> None:
    same = ids.setdefault(item.id.value, item)
    clash = handlers.setdefault(item.handler, item)
    if same is not item:
        problems.error(f'the id {shown(item.id.value)} is given twice', item.id.span,
                       f'first in line {same.id.span.line}', related=same.id.span)
    elif clash is not item:
        problems.error(
            f'two ids have the same handler, {shown(item.handler)}', item.id.span,
            f'{shown(clash.id.value)} in line {clash.id.span.line} has it too',
            "ids must differ in letters or digits: every other character becomes '_'",
            related=clash.id.span)


def _requirement_node(node: Node, problems: Problems) -> YamlMapping | None:
    if isinstance(node, YamlScalar) and node.is_missing:
        problems.error('this requirement is empty', node.span,
                       help='- id: R1\n  ptltl: "H (speed <= 2.0)"')
        return None
    return mapping_of(node, 'a requirement', problems,
                      '- id: R1\n  ptltl: "H (speed <= 2.0)"')


def _requirement(mapping: YamlMapping, defaults: _Defaults,
                 problems: Problems) -> Requirement | None:
    """
    Read a requirement.

    Returns None without an id, and `_NO_TEXT` for a formula that cannot be used.
    """
    shape = Shape(mapping, 'a requirement', REQUIREMENT_KEYS, problems, FORMULA_SLIPS)
    name = _id(shape, problems)
    what = f'the requirement {shown(name.value)}' if name else 'this requirement'
    place = name.span if name else shape.span
    language, text = read_one_formula(shape, what, place, problems)
    on_violation = read_names(shape, 'on_violation', problems)
    on_end = read_names(shape, 'on_end', problems)
    found = Requirement(
        id=name or _NO_TEXT,
        language=language,
        text=text or _NO_TEXT,
        title=shape.free_text('title'),
        rationale=shape.free_text('rationale'),
        report=shape.choice('report', Report) or defaults.report,
        severity=shape.choice('severity', Severity) or defaults.severity,
        on_violation=defaults.on_violation if on_violation is None else on_violation,
        on_end=defaults.on_end if on_end is None else on_end,
        is_assumption=shape.truth('assume'),
        confidence=_confidence(shape) or defaults.confidence,
        has_confidence=shape.key('confidence') is not None,
        source=shape.free_text('source'),
    )
    return found if name else None


def _id(shape: Shape, problems: Problems) -> Text | None:
    if shape.lacks('id'):
        problems.error("a requirement needs an 'id'", shape.span, 'this one has none', 'id: R1')
    text = shape.text('id')
    if text is None:
        return None
    if not text.value.isprintable() or text.value != text.value.strip():
        problems.error('an id must be one line, without spaces at its ends', text.span)
        return None
    found = Requirement(text, Language.PTLTL, text, '', '', None, Severity.ERROR)
    report_fault(handler_fault(found.handler), text, problems)
    return text
