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
Reads past-time MTL as FRET writes it for SMV (the key `ptltl`).

A `Text` goes in, an `Expression` comes out; the grammar is in `smv.lark`. Beyond FRET's spelling
it accepts that of SMV and C: `=>`, `<=>`, `&&`, `||`, `==` and `~`; `xor`, `mod`, `TRUE`
and `FALSE` in any case; `.5`. HTML tags and entities in old exports of FRET are ignored.
FRET's sign is part of a number: `-3 ^ 2` is `(-3) ^ 2`, while `-x ^ 2` is `-(x ^ 2)`.
"""

from collections.abc import Mapping, Sequence
from itertools import product
import re
from typing import Any, NoReturn

from fret_monitor.language import _lalr
from fret_monitor.language._lalr import join, Lexeme
from fret_monitor.language.bounds import bound_end
from fret_monitor.language.continuation import Continuation
from fret_monitor.language.expression import Bound, Duration, Expression
from fret_monitor.language.fretish_words import TIME_UNITS
from fret_monitor.language.precedence import Precedence
from fret_monitor.model.diagnostics import Diagnostic, refuse, Text


def _any_case(word: str) -> list[str]:
    return [''.join(letters) for letters in product(*zip(word.lower(), word.upper()))]


_WORDS = {
    'H': ('PAST', 'H'), 'O': ('PAST', 'O'), 'Y': ('DELAY', 'Y'), 'Z': ('DELAY', 'Z'),
    'S': ('SINCE', 'S'), 'T': ('SINCE', 'T'), 'SI': ('SINCE', 'SI'),
    **dict.fromkeys(_any_case('xor'), ('INFIX', 'xor')),
    **dict.fromkeys(_any_case('mod'), ('INFIX', 'mod')),
    **dict.fromkeys(_any_case('true'), ('TRUE', 'TRUE')),
    **dict.fromkeys(_any_case('false'), ('FALSE', 'FALSE')),
}
_OPERATORS = {
    **_lalr.OPERATORS,
    '<->': ('INFIX', '<->'), '<=>': ('INFIX', '<->'), '->': ('INFIX', '->'),
    '=>': ('INFIX', '->'), '||': ('INFIX', '|'), '&&': ('INFIX', '&'), '==': ('RELATION', '='),
    '=': ('RELATION', '='), '[': ('LBRACK', '['), ']': ('RBRACK', ']'),
    ':': ('COLON', ':'),
}
PRECEDENCE = Precedence(
    infix={'<->': 1, '->': 2, 'xor': 3, '|': 4, '&': 5, 'S': 6, 'T': 6, 'SI': 6,
           **dict.fromkeys(('<', '<=', '=', '!=', '>', '>='), 8), '+': 9, '-': 9, '*': 10,
           '/': 10, 'mod': 10, '^': 12},
    prefix={**dict.fromkeys(('!', 'H', 'O', 'Y', 'Z'), 7), '-': 11},
    right=frozenset({'->', '^'}),
    single=frozenset({'<', '<=', '=', '!=', '>', '>='}),
    conjunction='&')
"""How tight SMV's operators bind, see docs/language.md."""

_WRITE = {'and': '&', 'or': '|', 'not': '!', 'implies': '->', 'iff': '<->', 'xor': 'xor',
          'unequal': '!='}
_REFUSED = {
    **{word: f'write {_WRITE[word]}' for word in ('and', 'or', 'not')},
    **dict.fromkeys(('if', 'then', 'else'), 'write p -> q for "if p then q", and ite(p, x, y) '
                    'for a choice of values'),
    'pre': 'write Y for a Boolean, preInt(init, x) or preReal(init, x) for a number',
    '%': 'the remainder is mod: x mod 3',
    ';': 'a formula of this language ends without a semicolon',
    '{': 'write an enumeration as (x = A | x = B)',
}


def _past(write: str, ahead: str) -> str:
    return f'a monitor sees only the past: {write}; under mltl: it is {ahead}'


_FOREIGN = {
    **{word: f'write {_WRITE[word.lower()]}'
       for word in ('AND', 'And', 'OR', 'Or', 'NOT', 'Not', 'implies', 'IMPLIES', 'iff', 'IFF')},
    # Future operators, which FRET's grammar has too, each with the closest past operator.
    **dict.fromkeys(('G', 'globally', 'always'), _past(
        'write H p, true while p has held at every step so far', 'G[0,n] p')),
    **dict.fromkeys(('F', 'finally', 'eventually'), _past(
        'write O p, true once p has held at some step so far', 'F[0,n] p')),
    **dict.fromkeys(('X', 'next'), _past('write Y p, p one step ago', 'X p')),
    **dict.fromkeys(('U', 'UI', 'until'), _past(
        'write p S q, p at every step since q held', 'p U[0,n] q')),
    **dict.fromkeys(('V', 'R', 'release'), _past('write p T q', 'p R[0,n] q')),
    **dict.fromkeys(('historically', 'Historically', 'HISTORICALLY'),
                    'write H p, or H[a,b] p for the steps from b to a steps ago'),
    **dict.fromkeys(('once', 'Once', 'ONCE'),
                    'write O p, or O[a,b] p for the steps from b to a steps ago'),
    **dict.fromkeys(('since', 'Since', 'SINCE'), 'write p S q'),
    **dict.fromkeys(('triggered', 'Triggered', 'TRIGGERED', 'trigger'), 'write p T q'),
    **dict.fromkeys(('yesterday', 'Yesterday', 'previous', 'previously', 'prev', 'Previous'),
                    'write Y p, p one step ago'),
}
_BOUNDED = ('PAST', 'SINCE')
_COCOSPEC = frozenset({'YtoPre', 'ZtoPre', 'OT', 'HT', 'ST', 'SIT', 'TT'})

RESERVED = frozenset({*_WORDS, *(word for word in _REFUSED if word.isalpha()), *_COCOSPEC, 'FTP'})
"""Words that are no names in this language, unless in quotes."""

_HTML = {'<': '(?:<|&lt;)', '>': '(?:>|&gt;)', '&': '(?:&amp;|&(?!(?:lt|gt|amp);))'}


def _pattern(blank: str) -> re.Pattern[str]:
    spelled = sorted(_OPERATORS, key=len, reverse=True)
    operators = '|'.join(''.join(_HTML.get(char, re.escape(char)) for char in operator)
                         for operator in spelled)
    time = _lalr.time_pattern(TIME_UNITS)
    return re.compile(f'(?:{blank})+|{time}|{_lalr.NUMBER}|{_lalr.NAME}|{_lalr.QUOTED}'
                      f'|(?P<OPERATOR>{operators})|(?P<BAD>.)', re.ASCII | re.DOTALL)


class SmvBuilder(_lalr.ExpressionBuilder):
    """Builds the tree of a formula with bounds in square brackets."""

    foreign: Mapping[str, str] = _FOREIGN
    one_number_help = 'write [0,{0}] for the last {1}, [={0}] for exactly {1} ago'

    def window(self, parts: list[Any]) -> Bound:
        low, high = self._end(parts[1]), self._end(parts[3])
        return Bound('[]', low, high, join(parts[0].span, parts[4].span))

    def one_sided(self, parts: list[Any]) -> Bound:
        relation = parts[1]
        if relation.text == '!=':
            refuse("a bound cannot have '!='", relation.span, 'not a range of steps')
        return Bound(relation.text, self._end(parts[2]), None,
                     join(parts[0].span, parts[3].span))

    def one_number(self, parts: list[Any]) -> NoReturn:
        end = self._end(parts[1])
        place = join(parts[0].span, parts[2].span)
        if isinstance(end, Duration):
            time = end.span.written
            refuse('a bound must have two times, or a relation', place, 'this is one time',
                   self.one_number_help.format(time, time).replace('[0,', '[0, '))
        number = end if isinstance(end, str) else 'n'
        refuse('a bound must have two numbers, or a relation', place,
               'this is one number', self.one_number_help.format(number, f'{number} steps'))

    def _end(self, part: Any) -> str | Expression:
        return bound_end(self.finish(part))

    def call(self, parts: list[Any]) -> Expression:
        if parts[0].text in _COCOSPEC:
            refuse(f"'{parts[0].text}' is an operator of CoCoSpec", parts[0].span,
                   'not in this language', 'use the key cocospec: instead of ptltl:')
        if parts[0].text in self.foreign:
            refuse(f"'{parts[0].text}' is not an operator here", parts[0].span,
                   'not in this language', self.foreign[parts[0].text])
        return super().call(parts)


def explain(text: Text, lexemes: Sequence[Lexeme], index: int) -> Diagnostic | None:
    """Return a more specific error for the lexeme at an index, or None."""
    found = lexemes[index]
    before = lexemes[index - 1] if index else found
    if found.type == 'SINCE':
        return Diagnostic(f"'{found.text}' must stand between two operands", found.span,
                          'an operand is missing before it', f'write p {found.text} q; '
                          f"CoCoSpec's {found.text}(p, q) is q {found.text} p here")
    if found.type == 'RELATION' and before.type == 'RELATION':
        return Diagnostic('an operand is missing between two comparisons', found.span,
                          f"after '{before.text}'", 'the comparisons are < <= = != >= >')
    return (_explain_time(text, lexemes, index) or _explain_open_bound(text, lexemes, index)
            or _explain_round_bound(lexemes, index) or _explain_bracket(before, found))


def _explain_time(text: Text, lexemes: Sequence[Lexeme], index: int) -> Diagnostic | None:
    """Report a time that is no end of a bound by itself; elsewhere, an invalid number."""
    found = lexemes[index]
    before = lexemes[index - 1] if index else found
    is_unit = before.type == 'NUMBER' and found.text.lower() in TIME_UNITS
    if all(lexeme.type != 'LBRACK' for lexeme in _lalr.open_brackets(lexemes[:index])):
        if found.type == 'TIME':
            _lalr.refuse_number(found.text, found.span)
        return None
    if not is_unit and found.type != 'TIME':
        return None
    place = join(before.span, found.span) if is_unit else found.span
    sign = lexemes[index - 2 if is_unit else index - 1]
    if sign.type == 'MINUS' and lexemes[lexemes.index(sign) - 1].type not in _lalr.OPERAND_ENDS:
        time = text.value[(before if is_unit else found).start:found.end]
        return Diagnostic('a bound cannot be negative', join(sign.span, place),
                          'counts into the past', f'[0, {time}] is the last {time}')
    return Diagnostic('a time must stand alone in a bound', place, 'part of an expression',
                      'write it as one number and a unit, as in [0, 2.5 s]')


def _explain_open_bound(text: Text, lexemes: Sequence[Lexeme], index: int) -> Diagnostic | None:
    """Report a bound without its comma, or not closed where an operand begins: H[0,10 p."""
    found, opened = lexemes[index], _lalr.open_brackets(lexemes[:index])
    is_operand = found.type in _lalr.OPERAND_STARTS
    before = [lexeme.type for lexeme in lexemes[max(index - 2, 0):index]]
    if before == ['LBRACK', 'NUMBER'] and found.type == 'NUMBER':
        ends = join(lexemes[index - 1].span, found.span)
        return Diagnostic("a ',' is missing", ends, 'between the ends of a bound')
    if not opened or opened[-1].type != 'LBRACK' or not is_operand or (
            lexemes[index - 1].type not in _lalr.OPERAND_ENDS
            or lexemes[index + 1].type in ('COMMA', 'RBRACK')):
        return None
    return Diagnostic("'[' is not closed", opened[-1].span, 'opened here',
                      f"a ']' is missing before '{_lalr.as_written(text, found)}'")


def _explain_bracket(before: Lexeme, found: Lexeme) -> Diagnostic | None:
    if found.type == 'LBRACK' and before.type == 'DELAY':
        instead = 'O' if before.text == 'Y' else 'H'
        return Diagnostic(f"'{before.text}' takes no bound", found.span,
                          'it looks exactly one step back',
                          f'write {instead}[=n] p for n steps back')
    if found.type == 'LBRACK' and before.text in _FOREIGN:
        return Diagnostic(f"'{before.text}' is not an operator here", before.span,
                          'not in this language', _FOREIGN[before.text])
    if found.type == 'LBRACK' and before.type == 'NAME':
        return Diagnostic('a name cannot have an index', found.span, 'not allowed here',
                          'an element of an array is an input of its own: field: NAME[INDEX]')
    if found.type == 'COMMA' and before.type in _lalr.OPERAND_ENDS:
        return Diagnostic("unexpected ','", found.span, 'not among the arguments of a '
                          'function', 'H O Y Z take one operand; S T SI stand between two')
    return None


def _explain_round_bound(lexemes: Sequence[Lexeme], index: int) -> Diagnostic | None:
    """Report a bound in round brackets: H(0,2) p."""
    window = lexemes[max(index - 3, 0):index + 3]
    if [lexeme.type for lexeme in window] not in (
            [operator, 'LPAR', 'NUMBER', 'COMMA', 'NUMBER', 'RPAR'] for operator in _BOUNDED):
        return None
    operator, opened, low, _, high, closed = window
    return Diagnostic('a bound must be in square brackets', join(opened.span, closed.span),
                      'these are round', f'write {operator.text}[{low.text},{high.text}] p')


SYNTAX = _lalr.Syntax('smv', SmvBuilder(PRECEDENCE, TIME_UNITS), _pattern(r'\s'), _WORDS,
                      _OPERATORS, _REFUSED, _FOREIGN, _WRITE, explain)
"""The language; `mltl` adds the operators of the future."""
_TAGGED = _pattern(r'\s|</?[bi]>')


def parse_smv(text: Text) -> Expression:
    """Return the tree of a formula; raises `CompileError` with the place of the first error."""
    return parse_with(SYNTAX, text)


def parse_with(syntax: _lalr.Syntax, text: Text) -> Expression:
    """Return the tree of a formula in a language with this grammar, as `parse_smv`."""
    lexemes = _lalr.scan(syntax, text, _TAGGED if '</' in text.value else None)
    lexemes = _lalr.join_times(_lalr.join_signs(lexemes), TIME_UNITS)
    tree: Expression = _lalr.parse(syntax, text, lexemes, 'start')
    return tree


def continue_smv(beginning: str, syntax: _lalr.Syntax = SYNTAX) -> Continuation | None:
    """Return what may follow the beginning of a formula; None if that is wrong already."""
    return _lalr.continuation(syntax, 'start', beginning, lambda text: _lalr.scan(syntax, text),
                              _lalr.spelled(syntax))
