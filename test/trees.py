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

"""Trees of formulas for tests: as texts with all parentheses, and random ones."""

from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
import time
from typing import assert_never

from fret_monitor.language.expression import (
    Boolean, Bound, Call, Conditional, Duration, Expression, Infix, Name, Number, Prefix,
)
from fret_monitor.model.diagnostics import CompileError, Source, Span, Text
import pytest

_TOO_LONG_S = 20.0


@contextmanager
def in_time() -> Iterator[None]:
    """Fail if the block takes too much processor time."""
    started = time.process_time()
    yield
    assert time.process_time() - started < _TOO_LONG_S


def garbage(piece: str) -> str:
    """Return thirty thousand characters of a piece that is not a formula."""
    return (piece * (30_000 // len(piece) + 1))[:30_000] + ' &'


def check_infix(parse: Callable[[Text], object], first: str, level: Mapping[str, int],
                from_right: Collection[str], in_tree: Mapping[str, str]) -> None:
    """
    Check that of an infix operator and each other one the tighter takes the operand between them.

    `in_tree` are the spellings of operators in a tree, where they differ.
    """
    for second in level:
        formula = f'a {first} b {second} c'
        if level[first] == level[second] == level['<']:
            assert 'chained' in str(refusal(parse, formula))
            continue
        to_the_left = level[first] < level[second] or (
            level[first] == level[second] and first not in from_right)
        one, two = in_tree.get(first, first), in_tree.get(second, second)
        found = parse(text(formula))
        assert isinstance(found, Infix)
        assert show(found) == (f'((a {one} b) {two} c)' if to_the_left
                               else f'(a {one} (b {two} c))')


def check_places[T](parse: Callable[[Text], T], spans: Callable[[T], list[Span]],
                    formula: str) -> None:
    """Check that a text is a formula, or is refused, and that all places are within it."""
    try:
        found = spans(parse(text(formula)))
    except CompileError as caught:
        assert caught.diagnostics[0].title
        str(caught)
        span = caught.diagnostics[0].span
        assert span is not None
        found = [span]
    assert all(0 <= span.start <= span.end <= len(formula) for span in found)


def text(value: str) -> Text:
    """Return a text that is all of a source."""
    return Text.whole(Source('<formula>', value))


def written(span: Span) -> str:
    """Return what stands at a span."""
    return span.source.text[span.start:span.end]


def refusal(parse: Callable[[Text], object], formula: str | Text) -> CompileError:
    """Return the error of a text that a parser refuses; it tells one thing, at a place."""
    with pytest.raises(CompileError) as caught:
        parse(text(formula) if isinstance(formula, str) else formula)
    (diagnostic,) = caught.value.diagnostics
    assert diagnostic.span is not None
    return caught.value


def show(node: Expression) -> str:
    """Write a tree with all parentheses, operators spelled as the tree has them."""
    match node:
        case Name():
            return node.text
        case Number():
            return node.text
        case Duration(number, unit):
            return f'{number} {unit.value}'
        case Boolean():
            return str(node.value)
        case Prefix():
            return f'({node.operator}{_bound(node.bound)} {show(node.argument)})'
        case Infix():
            operator = f'{node.operator}{_bound(node.bound)}'
            return f'({show(node.left)} {operator} {show(node.right)})'
        case Call():
            return f'{node.function}({", ".join(map(show, node.arguments))})'
        case Conditional():
            return f'(if {show(node.condition)} then {show(node.yes)} else {show(node.no)})'
        case _:
            assert_never(node)


def _bound(bound: Bound | None) -> str:
    if bound is None:
        return ''
    if bound.relation == '[]':
        return f'[{_end(bound.low)},{_end(bound.high or "")}]'
    return f'[{bound.relation}{_end(bound.low)}]'


def _end(end: str | Expression) -> str:
    return end if isinstance(end, str) else show(end)
