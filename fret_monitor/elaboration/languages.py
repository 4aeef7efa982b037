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
"""The languages of formulas: the one place that knows which reader reads which."""

import re
from typing import assert_never

from fret_monitor.bundle.bundle import Language
from fret_monitor.language.cocospec import parse_cocospec
from fret_monitor.language.expression import Equations, Expression
from fret_monitor.language.fretish import parse_fretish, parse_fretish_expression
from fret_monitor.language.sentence import Sentence
from fret_monitor.language.smv import parse_smv
from fret_monitor.model.diagnostics import CompileError, Diagnostic, Text


def read_formula(language: Language, text: Text) -> Expression | Equations | Sentence:
    """
    Return what a requirement says: a sentence in FRETish, a tree in the other languages.

    Raises
    ------
    CompileError
        if the text is not of its language.
    """
    try:
        if language is Language.FRETISH:
            return parse_fretish(text)
        return read_expression(language, text)
    except CompileError:
        other = _language_of(text, language)
        if other is None:
            raise
    raise CompileError([Diagnostic(
        f'this is {_KINDS[other]}', text.span, f"under '{language.value}'",
        f'write {other.value}: instead of {language.value}:')])


_KINDS = {
    Language.FRETISH: 'a sentence of FRETish', Language.PTLTL: 'a formula, and no sentence',
    Language.COCOSPEC: 'a formula of CoCoSpec, and no sentence',
}
_SHALL = re.compile(r'\bshall\b', re.IGNORECASE)


def _language_of(text: Text, tried: Language) -> Language | None:
    """Return the language that a text is in, if it is clearly not the one that was tried."""
    if _SHALL.search(text.value):
        return None if tried is Language.FRETISH else Language.FRETISH
    if tried is not Language.FRETISH or text.value.strip().startswith('"'):
        return None  # text in quotes would be a name, as a formula
    return next((other for other in (Language.PTLTL, Language.COCOSPEC) if _reads(other, text)),
                None)


def _reads(language: Language, text: Text) -> bool:
    try:
        read_expression(language, text)
    except CompileError:
        return False
    return True


def read_expression(language: Language, text: Text) -> Expression | Equations:
    """
    Return the tree of an expression, as definitions are; in FRETish it is no sentence.

    Raises
    ------
    CompileError
        if the text is not of its language.
    """
    match language:
        case Language.PTLTL:
            return parse_smv(text)
        case Language.COCOSPEC:
            return parse_cocospec(text)
        case Language.FRETISH:
            return parse_fretish_expression(text)
        case _:
            assert_never(language)
