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
What the words of the languages mean, one line each, as the pages have it (test/editing).

A meaning of an operator is what is true at step t of a trace, of a scope where a requirement is in
force, of a condition from where its timing counts, of a timing what is required from there.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from fret_monitor.bundle.bundle import Language
from fret_monitor.elaboration.functions import FUNCTIONS
from fret_monitor.model.policies import OverInstances


@dataclass(frozen=True)
class WordMeaning:
    """How a word is used, and what that means."""

    shape: str
    meaning: str


_PAST = {
    'Y': (WordMeaning('Y p', 't > 0 and p at t-1'),),
    'Z': (WordMeaning('Z p', 't = 0 or p at t-1'),),
    'O': (WordMeaning('O p', 'p at some step 0 to t'),
          WordMeaning('O[a,b] p', 'p at some step k >= 0 with a <= t-k <= b')),
    'H': (WordMeaning('H p', 'p at every step 0 to t'),
          WordMeaning('H[a,b] p', 'p at every such step; true if there is no such step')),
    'S': (WordMeaning('p S q', 'q at some k <= t, and p at every step k+1 to t'),
          WordMeaning('p S[a,b] q', 'q at some such k, and p at every step k+1 to t')),
    'T': (WordMeaning('p T q', '`!(!p S !q)`'),),
    'SI': (WordMeaning('p SI q', '`p S (p & q)`'),),
    'FTP': (WordMeaning('FTP', 't = 0'),),
}
_FUTURE = {
    'G': (WordMeaning('G[a,b] p', 'p at every step from t+a to t+b'),),
    'F': (WordMeaning('F[a,b] p', 'p at some step from t+a to t+b'),),
    'U': (WordMeaning('p U[a,b] q', 'q at some t+i with a <= i <= b, and p at every step from t+a '
                                    'to t+i-1'),),
    'R': (WordMeaning('p R[a,b] q', '`!(!p U[a,b] !q)`: q at every step from t+a to t+b, up to '
                                    'one at which p is true too'),),
    'X': (WordMeaning('X p', 'p at step t+1'),),
}
_FUTURE['V'] = _FUTURE['R']
_COCOSPEC = {
    'S': (WordMeaning('S(p, q)', '`q S p`'),),
    'SI': (WordMeaning('SI(p, q)', '`q SI p`'),),
    'T': (WordMeaning('T(p, q)', '`q T p`'),),
    'OT': (WordMeaning('OT(hi, lo, p)', '`O[lo,hi] p`'),),
    'HT': (WordMeaning('HT(hi, lo, p)', '`H[lo,hi] p`'),),
    'ST': (WordMeaning('ST(hi, lo, p, q)', '`q S[lo,hi] p`'),),
    'SIT': (WordMeaning('SIT(hi, lo, p, q)', '`q SI[lo,hi] p`'),),
    'YtoPre': _PAST['Y'], 'ZtoPre': _PAST['Z'],
}
_IN = 'in each stretch of consecutive steps at which m, or the expression p, holds'
_NOT_IN = 'in each stretch at which it does not hold'
_BECOMES = ('each step in the scope at which p becomes true, and the first step of the scope if p '
            'is true there')
_AT_ONCE = 'the response holds at that step'
_EVENTUALLY = 'it holds at some step'
_FINALLY = 'it holds at the last step'
_SENTENCE = '[scope] [condition] the COMPONENT shall [timing] satisfy EXPRESSION'
_FRETISH = {
    **{word: (WordMeaning(_SENTENCE, ''),) for word in ('shall', 'the', 'satisfy')},
    'in': (WordMeaning('in m mode', _IN),), 'during': (WordMeaning('during m', _IN),),
    'while': (WordMeaning('while p', _IN),), 'mode': (WordMeaning('in m mode', _IN),),
    'except': (WordMeaning('except in m', _NOT_IN),),
    'before': (WordMeaning('before m', 'before it first holds; throughout, if it never does'),
               WordMeaning('before s', 'at some step before s first holds')),
    'after': (WordMeaning('after m', 'after its first stretch has ended'),
              WordMeaning('after 3 ticks', 'it does not hold up to and including 3 steps later, '
                                           'and holds at the next step')),
    'only': (WordMeaning('only in m', 'outside that scope, where the response must *not* be met '
                                      'at that timing'),),
    **{word: (WordMeaning(f'{word} p', _BECOMES),) for word in ('upon', 'when', 'where', 'if')},
    'unless': (WordMeaning('unless p', 'is `if !p`'),),
    'whenever': (WordMeaning('whenever p', 'each step in the scope at which p holds'),),
    **{word: (WordMeaning(word, _AT_ONCE),) for word in ('immediately', 'initially')},
    'first': (WordMeaning('at the first timepoint', _AT_ONCE),),
    'same': (WordMeaning('at the same timepoint', _AT_ONCE),),
    'next': (WordMeaning('at the next timepoint', 'it holds at the following step'),),
    'last': (WordMeaning('at the last timepoint', _FINALLY),),
    'always': (WordMeaning('always', 'it holds at every step'),),
    'never': (WordMeaning('never', 'at no step'),),
    'eventually': (WordMeaning('eventually', _EVENTUALLY),),
    'finally': (WordMeaning('finally', _FINALLY),),
    'within': (WordMeaning('within 3 ticks', 'it holds at some step up to 3 steps later; nothing '
                                             'is required if the scope ends earlier'),),
    'for': (WordMeaning('for 3 ticks', 'it holds at every step up to 3 steps later'),),
    'until': (WordMeaning('until s', 'it holds at every step before s first holds'),),
}
_OF_FUNCTIONS = {
    'persisted': (
        WordMeaning('persisted(n, p)', 'p held now and for the last n steps, all since the left '
                                       'end'),
        WordMeaning('persisted(m, n, p)', 'p held from n to m steps ago, all since the left end')),
    'occurred': (
        WordMeaning('occurred(n, p)', 'p held now or at one of the last n steps, since the left '
                                      'end'),
        WordMeaning('occurred(m, n, p)', 'p held at a step from n to m steps ago, since the left '
                                         'end')),
    'prevOcc': (WordMeaning('prevOcc(p, q)', 'q held when p last held before this step, since the '
                                             'left end; true if p did not hold'),),
    **{name: (WordMeaning(f'{name}(i, {"p" if name == "preBool" else "x"})',
                          'the value one step ago; i at step 0'),)
       for name in ('preBool', 'preInt', 'preReal')},
    'ite': (WordMeaning('ite(p, x, y)', 'x if p is true, else y; both numbers or both truth '
                                        'values'),),
    **{name: (WordMeaning(f'{name}(x)', meaning),) for name, meaning in (
        ('sqrt', 'the root'), ('exp', 'the exponential'), ('log', 'the natural logarithm'),
        ('floor', 'the next whole number below'), ('ceil', 'the next whole number above'),
        ('round', 'the next whole number nearest (a half away from zero)'))},
    'maxOver': (WordMeaning('maxOver(d, x)', 'the greatest x in the window'),),
    'minOver': (WordMeaning('minOver(d, x)', 'the least x in the window'),),
    'meanOver': (WordMeaning('meanOver(d, x)', 'the mean of x in the window'),),
    'sumOver': (WordMeaning('sumOver(d, x)', 'the sum of x in the window'),),
    'countOver': (WordMeaning('countOver(d, p)', 'how often p held in the window'),),
    'timeOver': (WordMeaning('timeOver(d, p)', 'for how many seconds of the last d p held'),),
    'changeOver': (WordMeaning('changeOver(d, x)', 'x now minus x at d ago'),),
    'derivative': (WordMeaning('derivative(x)', 'the change of x per second'),),
    'heldAt': (WordMeaning('heldAt(p, x)', 'x at the last step at which p held'),),
}
_OVER_INSTANCES = {
    'count': WordMeaning('count(robot: p)', 'in how many instances p holds'),
    'any': WordMeaning('any(robot: p)', 'whether it holds in one'),
    'all': WordMeaning('all(robot: p)', 'whether it holds in all'),
    'sum': WordMeaning('sum(robot: x)', 'the sum, exact and rounded once'),
    'min': WordMeaning('min(robot: x)', 'the least; NaN if one is NaN'),
    'max': WordMeaning('max(robot: x)', 'the greatest; NaN if one is NaN'),
}
OVER_INSTANCES = frozenset(item.value for item in OverInstances)
"""The functions over all instances of a variable."""


def meanings_of(language: Language, word: str) -> tuple[WordMeaning, ...]:
    """Return what a word, operator or function means in a language; () if it is none there."""
    in_instances = _OVER_INSTANCES.get(word)
    over = (in_instances,) if in_instances else ()
    if word in FUNCTIONS:
        return (*_OF_FUNCTIONS.get(word, (_call(word),)), *over)
    return _words(language).get(
        word.lower() if language is Language.FRETISH else word, ()) or over


def _call(name: str) -> WordMeaning:
    return WordMeaning(f'{name}({FUNCTIONS[name].forms[0]})', 'as in mathematics')


def _words(language: Language) -> Mapping[str, tuple[WordMeaning, ...]]:
    match language:
        case Language.FRETISH:
            return _FRETISH
        case Language.COCOSPEC:
            return _PAST | _COCOSPEC
        case Language.MLTL:
            return _PAST | _FUTURE
        case Language.PTLTL:
            return _PAST
