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
Formalize one FRETish sentence without a bundle, as text.

The types of the names are inferred from their use; the default is a real number.
"""

from typing import Literal

from fret_monitor.elaboration.durations import STEPS, TimeScale
from fret_monitor.elaboration.fretish import sentence_term
from fret_monitor.elaboration.scope import Declaration, Role, Scope
from fret_monitor.elaboration.terms import formula_of, TypedTerm
from fret_monitor.elaboration.types_by_use import TypesByUse
from fret_monitor.language.expression import Name, postorder
from fret_monitor.language.sentence import Sentence
from fret_monitor.logic.formula import Variable
from fret_monitor.logic.printing import to_cocospec, to_smv
from fret_monitor.model.diagnostics import Diagnostic, Problems, refuse
from fret_monitor.model.names import fret_name
from fret_monitor.model.values import ValueType

_LIMIT = 1_000_000


def formalize(sentence: Sentence, language: Literal['smv', 'cocospec'] = 'smv',
              scale: TimeScale = STEPS) -> tuple[str, tuple[Diagnostic, ...]]:
    """
    Return the formula of a sentence as text on one line, and the warnings about it.

    `scale` says what durations and counts mean; the default counts steps, as in FRET.

    Raises
    ------
    CompileError
        if the sentence uses a name in two ways, has a probability, or has a formula of more than
        a million characters.
    """
    problems = Problems()
    if sentence.probability is not None:
        refuse('a probability has no formula of past-time MTL', sentence.probability.span,
               'trials are counted and tested', 'put it into a bundle: fret-monitor explain says '
               'what it means')
    term = sentence_term(sentence, scope_by_use(sentence), problems, scale)
    problems.raise_errors()
    formula = formula_of(term)
    shown = to_smv(formula, _LIMIT, is_timed=scale.is_timed, has_typed_names=True) \
        if language == 'smv' else to_cocospec(formula, _LIMIT, is_timed=scale.is_timed)
    if shown.endswith(' ...'):
        refuse('the formula is too long to be shown', sentence.span,
               f'more than {_LIMIT:,} characters')
    return shown, problems.warnings


def scope_by_use(sentence: Sentence) -> Scope:
    """Return a scope that declares the names of a sentence by how they are used."""
    types = TypesByUse()
    names: dict[str, str] = {}
    for expression in sentence.expressions:
        types.add_property(expression)
        for node in postorder(expression):
            if isinstance(node, Name) and node.text != 'FTP':
                names.setdefault(fret_name(node.text), node.text)
    scope = Scope()
    for name in names.values():
        variable = Variable(name, types.type_of(name) or ValueType.FLOAT64)
        scope.declare(name, Declaration(Role.INPUT, TypedTerm(variable, sentence.span)))
    return scope
