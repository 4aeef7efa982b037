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
Reads bounded future-time MLTL (the key `mltl`).

A `Text` goes in, an `Expression` comes out. It is the grammar of `smv.py` with the operators `G`,
`F`, `X`, `U` and `R` (also `V`) beside those of the past, in the spelling of FRET's exports for
MLTL and R2U2 and of R2U2's own files (C2PO). Whether a bound is finite is checked by elaboration,
which knows the constants in it.
"""

from collections.abc import Sequence
from dataclasses import replace

from fret_monitor.language import smv
from fret_monitor.language._lalr import Lexeme
from fret_monitor.language.continuation import Continuation
from fret_monitor.language.expression import Expression
from fret_monitor.language.fretish_words import TIME_UNITS
from fret_monitor.language.precedence import Precedence
from fret_monitor.model.diagnostics import Diagnostic, Text

_FUTURE = {'G': ('PAST', 'G'), 'F': ('PAST', 'F'), 'X': ('DELAY', 'X'), 'U': ('SINCE', 'U'),
           'R': ('SINCE', 'R'), 'V': ('SINCE', 'R')}
PRECEDENCE = Precedence(
    infix={**smv.PRECEDENCE.infix, 'U': 6, 'R': 6},
    prefix={**smv.PRECEDENCE.prefix, **dict.fromkeys('GFX', 7)},
    right=smv.PRECEDENCE.right, single=smv.PRECEDENCE.single, conjunction='&')
"""How tight operators bind: `G F X` as `H O Y`, `U R` as `S T`."""

_WRITE = {
    **dict.fromkeys(('globally', 'always'), 'write G[0,n] p'),
    **dict.fromkeys(('finally', 'eventually'), 'write F[0,n] p'),
    'next': 'write X p', 'until': 'write p U[0,n] q', 'release': 'write p R[0,n] q',
}


def _explain(text: Text, lexemes: Sequence[Lexeme], index: int) -> Diagnostic | None:
    found = lexemes[index]
    before = lexemes[index - 1] if index else found
    if found.type == 'SINCE' and found.text in _FUTURE:
        return Diagnostic(f"'{found.text}' must stand between two operands", found.span,
                          'an operand is missing before it', f'write p {found.text}[0,n] q')
    if found.type == 'LBRACK' and before.type == 'DELAY' and before.text == 'X':
        return Diagnostic("'X' takes no bound", found.span, 'it looks exactly one step ahead',
                          'write F[n,n] p for n steps ahead')
    return smv.explain(text, lexemes, index)


class _MltlBuilder(smv.SmvBuilder):
    one_number_help = 'write [0,{0}] for up to {1}, [{0},{0}] for exactly {1}'
    foreign = _WRITE | {'UI': 'write p U[0,n] (p & q)'}


_SYNTAX = replace(
    smv.SYNTAX, builder=_MltlBuilder(PRECEDENCE, TIME_UNITS), explain=_explain,
    words={**smv.SYNTAX.words, **_FUTURE},
    foreign={**{word: help_ for word, help_ in smv.SYNTAX.foreign.items() if word not in _FUTURE},
             **_WRITE})


def parse_mltl(text: Text) -> Expression:
    """Return the tree of a formula; raises `CompileError` with the place of the first error."""
    return smv.parse_with(_SYNTAX, text)


def continue_mltl(beginning: str) -> Continuation | None:
    """Return what may follow the beginning of a formula; None if that is wrong already."""
    return smv.continue_smv(beginning, _SYNTAX)
