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


"""A sentence for each of FRET's template keys, and ways to its formula."""

from fret_monitor.elaboration.fretish import sentence_term
from fret_monitor.elaboration.scope import Scope
from fret_monitor.elaboration.terms import formula_of
from fret_monitor.language.fretish import parse_fretish
from fret_monitor.language.sentence import Sentence
from fret_monitor.logic.formula import Formula, Variable
from fret_monitor.model.diagnostics import Problems, Source, Text
from fret_monitor.model.values import ValueType
from stages import scope_of

INPUTS = tuple(Variable(name, ValueType.BOOL) for name in 'mcrs')
_SCOPES = {
    'null': '', 'in': 'in m mode', 'notin': 'when not in m mode', 'onlyIn': 'only in m mode',
    'before': 'before m', 'after': 'after m', 'onlyBefore': 'only before m',
    'onlyAfter': 'only after m',
}
_CONDITIONS = {'null': '', 'regular': 'upon c', 'holding': 'whenever c'}
_TIMINGS = {
    'null': '', 'next': 'at the next timepoint', 'until': 'until s', 'before': 'before s',
    'within': 'within {n} ticks', 'for': 'for {n} ticks', 'after': 'after {n} ticks',
}


def sentence_for(key: tuple[str, str, str], duration: int) -> str:
    """Return a sentence with a template key, about the inputs m, c, r and s."""
    scope, condition, timing = key
    words = _TIMINGS.get(timing, timing).format(n=duration)
    return f'{_SCOPES[scope]} {_CONDITIONS[condition]} the sw shall {words} satisfy r'


def parse(sentence: str) -> Sentence:
    """Return the parts of a sentence."""
    return parse_fretish(Text.whole(Source('<sentence>', sentence)))


def formalise(sentence: str, scope: Scope | None = None) -> Formula:
    """Return the formula of a sentence, by default about the inputs m, c, r and s."""
    problems = Problems()
    term = sentence_term(parse(sentence), scope or scope_of(INPUTS), problems)
    problems.raise_errors()
    return formula_of(term)
