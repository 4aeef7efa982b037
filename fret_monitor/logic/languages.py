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

from typing import assert_never

from fret_monitor.diagnostics import Text
from fret_monitor.syntax.bundle import Language
from fret_monitor.syntax.cocospec import parse_cocospec
from fret_monitor.syntax.expression import Equations
from fret_monitor.syntax.expression import Expression
from fret_monitor.syntax.fretish import parse_fretish
from fret_monitor.syntax.fretish import parse_fretish_expression
from fret_monitor.syntax.sentence import Sentence
from fret_monitor.syntax.smv import parse_smv


def read_formula(language: Language, text: Text) -> Expression | Equations | Sentence:
    """
    Return what a requirement says: a sentence in FRETish, a tree in the other languages.

    Raises
    ------
    CompileError
        if the text is not of its language.
    """
    if language is Language.FRETISH:
        return parse_fretish(text)
    return read_expression(language, text)


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
