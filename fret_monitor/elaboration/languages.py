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
"""The parser of each language of formulas."""

import re
from typing import assert_never

from fret_monitor.bundle.bundle import Language
from fret_monitor.language.cocospec import continue_cocospec, parse_cocospec
from fret_monitor.language.continuation import Continuation
from fret_monitor.language.expression import Equations, Expression
from fret_monitor.language.fretish import (
    continue_fretish, parse_fretish, parse_fretish_expression,
)
from fret_monitor.language.mltl import continue_mltl, parse_mltl
from fret_monitor.language.sentence import Sentence
from fret_monitor.language.smv import continue_smv, parse_smv
from fret_monitor.model.diagnostics import CompileError, Diagnostic, Text


def read_formula(language: Language, text: Text, *,
                 is_timed: bool = False) -> Expression | Equations | Sentence:
    """
    Parse the text of a requirement: a sentence in FRETish, an expression in other languages.

    With `is_timed`, for the policy timed, errors advise times instead of ticks.

    Raises
    ------
    CompileError
        if the text is not in its language.
    """
    try:
        if language is Language.FRETISH:
            return parse_fretish(text, is_timed=is_timed)
        return read_expression(language, text)
    except CompileError:
        other = _language_of(text, language)
        if other is None:
            raise
    raise CompileError([Diagnostic(
        f'this is {_KINDS[other]}', text.span, f"under '{language.value}'",
        f'write {other.value}: instead of {language.value}:')])


_KINDS = {
    Language.FRETISH: 'a sentence of FRETish', Language.PTLTL: 'a formula, not a sentence',
    Language.COCOSPEC: 'a formula of CoCoSpec, not a sentence',
    Language.MLTL: 'a formula of the future, not a sentence',
}
_SHALL = re.compile(r'\bshall\b', re.IGNORECASE)


def _language_of(text: Text, tried: Language) -> Language | None:
    """Return the language of a text that failed to parse, if it is clearly another one."""
    if _SHALL.search(text.value):
        return None if tried is Language.FRETISH else Language.FRETISH
    if tried is not Language.FRETISH or text.value.strip().startswith('"'):
        return None  # other languages read quoted text as a name
    others = (Language.PTLTL, Language.COCOSPEC, Language.MLTL)
    return next((other for other in others if _reads(other, text)), None)


def what_follows(language: Language, beginning: str, *,
                 is_definition: bool = False) -> Continuation | None:
    """Return what may follow the beginning of a formula; None if that is wrong already."""
    match language:
        case Language.PTLTL:
            return continue_smv(beginning)
        case Language.COCOSPEC:
            return continue_cocospec(beginning)
        case Language.MLTL:
            return continue_mltl(beginning)
        case Language.FRETISH:
            return continue_fretish(beginning, is_expression=is_definition)
        case _:
            assert_never(language)


def _reads(language: Language, text: Text) -> bool:
    try:
        read_expression(language, text)
    except CompileError:
        return False
    return True


def read_expression(language: Language, text: Text) -> Expression | Equations:
    """
    Parse a definition; in FRETish it is an expression, not a sentence.

    Raises
    ------
    CompileError
        if the text is not in its language.
    """
    match language:
        case Language.PTLTL:
            return parse_smv(text)
        case Language.COCOSPEC:
            return parse_cocospec(text)
        case Language.MLTL:
            return parse_mltl(text)
        case Language.FRETISH:
            return parse_fretish_expression(text)
        case _:
            assert_never(language)
