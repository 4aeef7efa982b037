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

"""Single stages of the way from a text to a formula, as tests call them."""

from collections.abc import Iterable, Mapping
from fractions import Fraction
from pathlib import Path

from fret_monitor.bundle.bundle import Bundle
from fret_monitor.bundle.reader import survey_bundle
from fret_monitor.elaboration.durations import STEPS, TimeScale
from fret_monitor.elaboration.elaborator import Elaborator
from fret_monitor.elaboration.equations import equations_term
from fret_monitor.elaboration.scope import Declaration, Role, Scope
from fret_monitor.elaboration.terms import formula_of, TypedTerm, Vocabulary
from fret_monitor.language.expression import Equations, Expression
from fret_monitor.logic.formula import Constant, Feedback, Formula, Variable
from fret_monitor.logic.numbers import ExactNumber
from fret_monitor.messages.definitions import parse_definition
from fret_monitor.messages.layout import MessageLayout
from fret_monitor.model.diagnostics import Problems, Source, Span, Text
from fret_monitor.model.values import ValueType

_NOWHERE = Span(Source('<scope>', ''), 0, 0)


def text_of(text: str) -> Text:
    """Return a text with its places, as the parsers take it."""
    return Text.whole(Source('formula', text))


def read_bundle(path: Path) -> Bundle:
    """Read a bundle; raise all its problems."""
    problems = Problems()
    bundle = survey_bundle(path, problems)
    problems.raise_errors()
    assert bundle is not None
    return bundle


def parse_message(text: str, package: str, name: str = 'Message') -> MessageLayout:
    """Parse the text of a `.msg` file of a package."""
    whole = f'{package}/msg/{name}'
    return parse_definition(Source(whole, text), whole, ())['']


def scope_of(variables: Iterable[Variable] = (),
             constants: Mapping[str, bool | int | Fraction] | None = None,
             values: Mapping[str, tuple[tuple[str, int | str], ...]] | None = None) -> Scope:
    """
    Return a scope without a bundle.

    A constant is a bool, an int (a whole number) or a Fraction (a real number); `values` maps a
    variable to the names of its values.
    """
    scope = Scope()
    for variable in variables:
        pairs = (values or {}).get(variable.name)
        vocabulary = Vocabulary(pairs) if pairs else None
        scope.declare(variable.name,
                      Declaration(Role.INPUT, TypedTerm(variable, _NOWHERE, vocabulary)))
    for name, value in (constants or {}).items():
        found = Constant(value, ValueType.BOOL) if isinstance(value, bool) else \
            ExactNumber(Fraction(value), isinstance(value, Fraction))
        scope.declare(name, Declaration(Role.CONSTANT, TypedTerm(found, _NOWHERE)))
    return scope


def elaborate(tree: Expression | Equations, scope: Scope, problems: Problems | None = None,
              feedback: dict[Feedback, Formula] | None = None,
              scale: TimeScale = STEPS) -> Formula:
    """
    Return the formula of an expression, or of the result of some equations; raise its mistakes.

    `problems` receives the warnings, `feedback` the equations of the formula's `Feedback` nodes.
    """
    found = Problems()
    term = (equations_term(tree, scope, found, '', {} if feedback is None else feedback, scale)
            if isinstance(tree, Equations) else Elaborator(scope, found, scale=scale).term(tree))
    found.raise_errors()
    if problems is not None:
        problems.extend(found.warnings)
    return formula_of(term)
