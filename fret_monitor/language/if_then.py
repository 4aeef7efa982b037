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
Warns where FRET reads `if p then q` in an unexpected way.

FRET replaces `then` by `=>`, so that `p & if q then r` is `(p & q) -> r`, and `if p then q <-> r`
is `(p -> q) <-> r`. This package does the same; parentheses avoid the difference.
"""

from collections.abc import Iterator, Sequence

from fret_monitor.language._lalr import Lexeme
from fret_monitor.language.expression import children, Expression, Infix, postorder
from fret_monitor.language.sentence import Sentence
from fret_monitor.model.diagnostics import Diagnostic, Level, Span


def remarks(sentence: Sentence, lexemes: Sequence[Lexeme]) -> tuple[Diagnostic, ...]:
    """Return a warning for each `if ... then` of a sentence that is read in an unexpected way."""
    conditionals = dict(_conditionals(lexemes))
    if not conditionals:
        return ()
    return tuple(
        Diagnostic("'if ... then' does not group its operands", span,
                   "FRET drops 'if' and reads 'then' as =>",
                   'put parentheses: (if p then (q))', Level.WARNING)
        for root in sentence.expressions for span in _torn(root, conditionals))


def _conditionals(lexemes: Sequence[Lexeme]) -> Iterator[tuple[int, tuple[Lexeme, int, int]]]:
    """Yield the place of each `then`, its `if`, and the possible start of its condition."""
    open_: list[int] = []
    for index, lexeme in enumerate(lexemes):
        if lexeme.type == 'IF':
            open_.append(index)
        elif lexeme.type == 'THEN' and open_:
            start = open_.pop()
            first = start + 1
            while lexemes[first].type == 'LPAR':
                first += 1
            places = (lexemes[start], lexemes[start + 1].span.start, lexemes[first].span.start)
            yield lexeme.span.start, places


def _torn(root: Expression, conditionals: dict[int, tuple[Lexeme, int, int]]) -> Iterator[Span]:
    for node in postorder(root):
        found = _conditional(node, conditionals)
        if found and not found[1] <= node.left.span.start <= found[2]:  # type: ignore[union-attr]
            yield found[0].span
        for child in children(node):
            inner = _conditional(child, conditionals)
            if inner and isinstance(node, Infix) and child is node.left and (
                    child.span.start >= inner[0].span.start):
                yield inner[0].span


def _conditional(node: Expression, conditionals: dict[int, tuple[Lexeme, int, int]],
                 ) -> tuple[Lexeme, int, int] | None:
    return conditionals.get(node.operator_span.start) if isinstance(node, Infix) else None
