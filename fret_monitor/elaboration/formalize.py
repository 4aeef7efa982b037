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
One FRETish sentence alone to the text of its formula, without a bundle that declares its names.

A name is true or false where it is used so, a whole number where only one will do (`preInt`), and
else a real number; names that are compared by `=`, or chosen from, are of one kind.
"""

from collections.abc import Iterator
from typing import Literal, TypeAlias

from fret_monitor.elaboration.elaborator import gives_truth
from fret_monitor.elaboration.fretish import sentence_term
from fret_monitor.elaboration.scope import Scope, scope_of
from fret_monitor.elaboration.terms import formula_of
from fret_monitor.language.expression import (
    Boolean, Call, Conditional, Expression, Infix, Name, postorder, Prefix,
)
from fret_monitor.language.sentence import Sentence
from fret_monitor.logic.formula import Variable
from fret_monitor.logic.printing import to_cocospec, to_smv
from fret_monitor.model.diagnostics import Diagnostic, Problems, refuse
from fret_monitor.model.values import ValueType

_LIMIT = 1_000_000
_NUMERIC = frozenset({'+', '-', '*', '/', 'mod', '^', '<', '<=', '>', '>='})
_ALIKE = frozenset({'=', '!='})
_Key: TypeAlias = Expression | str


def formalize(sentence: Sentence, language: Literal['smv', 'cocospec'] = 'smv',
              ) -> tuple[str, tuple[Diagnostic, ...]]:
    """
    Return the formula of a sentence as text on one line, and the warnings about it.

    Raises
    ------
    CompileError
        if the sentence uses a name in two ways, or has a formula of more than a million
        characters.
    """
    problems = Problems()
    term = sentence_term(sentence, scope_by_use(sentence), problems)
    problems.raise_errors()
    shown = (to_smv if language == 'smv' else to_cocospec)(formula_of(term), _LIMIT)
    if shown.endswith(' ...'):
        refuse('the formula is too long to be shown', sentence.span,
               f'more than {_LIMIT:,} characters')
    return shown, problems.warnings


def scope_by_use(sentence: Sentence) -> Scope:
    """Return a scope that declares the names of a sentence by how they are used."""
    uses = _Uses()
    for root in sentence.expressions:
        uses.add(root)
    return scope_of(uses.variables())


class _Uses:
    """What the uses of names say of their kinds: sets of expressions that are of one kind."""

    def __init__(self) -> None:
        self._of: dict[_Key, _Key] = {}
        self._kinds: dict[_Key, ValueType] = {}
        self._names: dict[str, None] = {}
        self._found: list[tuple[_Key, ValueType]] = []

    def add(self, root: Expression) -> None:
        """Look at an expression that is true or false."""
        self._found.append((root, ValueType.BOOL))
        for node in postorder(root):
            if isinstance(node, Name):
                self._join(node, node.text)
                self._names.setdefault(node.text)
            self._found += _kinds(node)
            for one, other in _alike(node):
                self._join(one, other)

    def variables(self) -> list[Variable]:
        """Return the names, each with its type; the first use decides."""
        for key, kind in self._found:
            self._kinds.setdefault(self._root(key), kind)
        return [Variable(name, self._kinds.get(self._root(name), ValueType.FLOAT64))
                for name in self._names if name != 'FTP']

    def _join(self, one: _Key, other: _Key) -> None:
        self._of[self._root(one)] = self._root(other)

    def _root(self, key: _Key) -> _Key:
        while (above := self._of.get(key, key)) is not key:
            self._of[key] = self._of.get(above, above)
            key = above
        return key


def _kinds(node: Expression) -> Iterator[tuple[_Key, ValueType]]:
    """Yield what an operator says of its operands, and of its result if that is sure."""
    match node:
        case Boolean() | Name(text='FTP'):
            yield node, ValueType.BOOL
        case Prefix():
            yield node.argument, ValueType.FLOAT64 if node.operator == '-' else ValueType.BOOL
        case Infix(operator) if operator in _NUMERIC:
            yield from ((side, ValueType.FLOAT64) for side in (node.left, node.right))
        case Infix(operator) if operator not in _ALIKE:
            yield from ((side, ValueType.BOOL) for side in (node.left, node.right))
        case Conditional():
            yield node.condition, ValueType.BOOL
        case Call():
            yield from _argument_kinds(node)
    if gives_truth(node):
        yield node, ValueType.BOOL


def _argument_kinds(node: Call) -> Iterator[tuple[_Key, ValueType]]:
    name, arguments = node.function, node.arguments
    if name.endswith('Int'):
        yield from ((argument, ValueType.INT64) for argument in arguments)
    elif name.endswith('Real') or name in ('abs', 'min', 'max'):
        yield from ((argument, ValueType.FLOAT64) for argument in arguments)
    elif name in ('preBool', 'prevOcc'):
        yield from ((argument, ValueType.BOOL) for argument in arguments)
    elif name in ('persisted', 'occurred'):
        yield from ((argument, ValueType.BOOL) for argument in arguments[-1:])
    elif name == 'ite':
        yield from ((argument, ValueType.BOOL) for argument in arguments[:1])


def _alike(node: Expression) -> Iterator[tuple[Expression, Expression]]:
    """Yield pairs that are of one kind, whichever that is."""
    match node:
        case Infix(operator) if operator in _ALIKE:
            yield node.left, node.right
        case Call('ite', (_, yes, no)):
            yield yes, no
            yield node, yes
        case Conditional():
            yield node.yes, node.no
            yield node, node.yes
