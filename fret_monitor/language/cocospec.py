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
Reads CoCoSpec, the Lustre that FRET and Ogma write (the key `cocospec`).

A `Text` goes in; an `Expression` comes out, or `Equations` for a Lustre node and for several
equations. The grammar is in `cocospec.lark`; precedence is Lustre's, where `not`, `pre` and unary
minus bind tightest (`not x > 5` is `(not x) > 5`, and `-x ^ 2` is `(-x) ^ 2`, as FRET writes it).

FRET's functions become operators: `S(p, q)` is `q S p`, `ST(hi, lo, p, q)` is `q S[lo,hi] p`, and
so on; `OT(n, LessThan, p)` is `O[<n] p`. `Y` and `Z`, Ogma's, are `YtoPre` and `ZtoPre`. Beside
Lustre's spelling it takes `&`, `&&`, `|`, `||`, `!`, `~`, `==`, `!=`.
"""

from collections.abc import Sequence
from itertools import pairwise
import re
from typing import Any

from fret_monitor.language import _lalr
from fret_monitor.language._lalr import join, Lexeme
from fret_monitor.language.bounds import bound_end
from fret_monitor.language.continuation import Continuation
from fret_monitor.language.expression import (
    Bound, Call, Conditional, Equations, Expression, Infix, LustreEquation, LustreVariable, Name,
    Prefix,
)
from fret_monitor.language.fretish_words import TIME_UNITS
from fret_monitor.language.precedence import Precedence
from fret_monitor.language.tables import END
from fret_monitor.model.diagnostics import Diagnostic, refuse, Text

_WORDS = {
    'H': ('PAST', 'H'), 'O': ('PAST', 'O'), 'Y': ('DELAY', 'Y'), 'Z': ('DELAY', 'Z'),
    'YtoPre': ('DELAY', 'Y'), 'ZtoPre': ('DELAY', 'Z'), 'pre': ('PRE', 'pre'),
    'not': ('NOT', '!'), 'and': ('INFIX', '&'), 'or': ('INFIX', '|'), 'xor': ('INFIX', 'xor'),
    'div': ('INFIX', '/'), 'mod': ('INFIX', 'mod'), 'if': ('IF', 'if'),
    'then': ('THEN', 'then'), 'else': ('ELSE', 'else'), 'node': ('NODE', 'node'),
    'function': ('FUNCTION', 'function'), 'returns': ('RETURNS', 'returns'),
    'var': ('VAR', 'var'), 'let': ('LET', 'let'), 'tel': ('TEL', 'tel'),
    **dict.fromkeys(('true', 'TRUE', 'True'), ('TRUE', 'TRUE')),
    **dict.fromkeys(('false', 'FALSE', 'False'), ('FALSE', 'FALSE')),
}
_OPERATORS = {
    **_lalr.OPERATORS,
    '->': ('INFIX', 'arrow'), '=>': ('INFIX', '->'), '||': ('INFIX', '|'), '&&': ('INFIX', '&'),
    '=': ('EQUAL', '='), '==': ('EQUAL', '='), '<>': ('RELATION', '!='), '[': ('LBRACK', '['),
    ']': ('RBRACK', ']'), ';': ('SEMI', ';'), ':': ('COLON', ':'), '.': ('DOT', '.'),
    '<->': ('IFF', '<->'), '<=>': ('IFF', '<->'),
}
PRECEDENCE = Precedence(
    infix={'arrow': 1, '->': 2, '|': 3, 'xor': 3, '&': 4,
           **dict.fromkeys(('<', '<=', '=', '!=', '>', '>='), 5), '+': 6, '-': 6, '*': 7, '/': 7,
           'mod': 7, '^': 8},
    prefix=dict.fromkeys(('-', '!', 'pre', 'H', 'O', 'Y', 'Z'), 9),
    right=frozenset({'arrow', '->', '^'}),
    single=frozenset({'<', '<=', '=', '!=', '>', '>='}),
    conjunction='and')
"""How tight Lustre's operators bind (Lustre V6, Kind 2)."""

_WRITE = {'and': 'and', 'or': 'or', 'not': 'not', 'implies': '=>', 'iff': '=', 'xor': 'xor',
          'unequal': '<>'}
_REFUSED = {
    '%': 'the remainder is mod: x mod 3',
    '{': 'only bool, int and real are known',
}
_CLOCKS = 'a monitor has one clock, its step: leave it out'
_FOREIGN = {
    **{word: f'write {_WRITE[word.lower()]}'
       for word in ('AND', 'And', 'OR', 'Or', 'NOT', 'Not', 'XOR', 'Xor', 'implies', 'iff')},
    'fby': 'write initial -> pre x',
    **dict.fromkeys(('when', 'current', 'merge'), _CLOCKS),
    **dict.fromkeys(('assert', 'assume', 'guarantee', 'contract'),
                    'a requirement is one formula, and each guarantee a requirement of its own'),
    'const': 'write constants under constants: in the bundle',
    'type': 'only bool, int and real are known',
}
# FRET's names of relations, as it writes them in OT(0.5, LessThan, p).
_RELATIONS = {'LessThan': '<', 'LessThanOrEqual': '<=', 'Equal': '=', 'GreaterThan': '>',
              'GreaterThanOrEqual': '>='}
RELATIONS = {relation: name for name, relation in _RELATIONS.items()}
"""FRET's names of relations, by relation."""

# FRET's functions: their operators, and their numbers of arguments.
_SINCE = {'S': 'S', 'SI': 'SI', 'T': 'T'}
_TIMED_PAST = {'OT': 'O', 'HT': 'H'}
_TIMED_SINCE = {'ST': 'S', 'SIT': 'SI', 'TT': 'T'}
_TAKES = {
    **{name: f'{name}(p, q), which is q {name} p' for name in _SINCE},
    **{name: f'{name}(high, low, p), which is {operator}[low,high] p'
       for name, operator in _TIMED_PAST.items()},
    **{name: f'{name}(high, low, p, q), which is q {operator}[low,high] p'
       for name, operator in _TIMED_SINCE.items()},
}
_ARITY = {**dict.fromkeys(_SINCE, 2), **dict.fromkeys(_TIMED_PAST, 3),
          **dict.fromkeys(_TIMED_SINCE, 4)}

RESERVED = frozenset({*_WORDS, *(word for word in _REFUSED if word.isalpha()), *_ARITY, 'FTP'})
"""Words that are no names in this language, unless in quotes."""


def _pattern() -> re.Pattern[str]:
    operators = '|'.join(map(re.escape, sorted(_OPERATORS, key=len, reverse=True)))
    comment = r'(?P<COMMENT>--[^\n]*|/\*.*?\*/|\(\*.*?\*\))|(?P<OPEN>/\*|\(\*)'
    time = _lalr.time_pattern(TIME_UNITS)
    return re.compile(rf'\s+|{comment}|{time}|{_lalr.NUMBER}|{_lalr.NAME}|{_lalr.QUOTED}'
                      f'|(?P<OPERATOR>{operators})|(?P<BAD>.)', re.ASCII | re.DOTALL)


class _CocospecBuilder(_lalr.ExpressionBuilder):

    def formula(self, parts: list[Any]) -> Expression:
        return self.finish(parts[0])

    def conditional(self, parts: list[Any]) -> Conditional:
        condition, yes, no = (self.finish(part) for part in parts[1::2])
        return Conditional(condition, yes, no, join(parts[0].span, no.span))

    def call(self, parts: list[Any]) -> Expression:
        call = super().call(parts)
        return _operator(call) if isinstance(call, Call) and call.function in _ARITY else call

    def declared(self, parts: list[Any]) -> list[LustreVariable]:
        *names, _, type_ = parts
        return [LustreVariable(name.text, type_.text, name.span)
                for name in names if name.type == 'NAME']

    def declarations(self, parts: list[Any]) -> list[LustreVariable]:
        return [item for part in parts if isinstance(part, list) for item in part]

    def locals(self, parts: list[Any]) -> list[LustreVariable]:
        return self.declarations(parts)

    def head(self, parts: list[Any]) -> tuple[list[LustreVariable], list[LustreVariable], Lexeme]:
        inputs, outputs = ([], *(part for part in parts if isinstance(part, list)))[-2:]
        return inputs, outputs, parts[0]

    def equation(self, parts: list[Any]) -> LustreEquation:
        expression = self.finish(parts[2])
        return LustreEquation(parts[0].text, expression, parts[0].span,
                              join(parts[0].span, expression.span))

    def equations(self, parts: list[Any]) -> Equations:
        _check_distinct(parts)
        return Equations(tuple(parts), parts[-1], (), (), join(parts[0].span, parts[-1].span))

    def body(self, parts: list[Any]) -> list[Any]:
        return parts

    def node(self, parts: list[Any]) -> Equations:
        (inputs, outputs, first), variables, body = parts
        if len(outputs) != 1:
            refuse('the node has more than one output', outputs[1].span, 'a second output',
                   'a requirement is one Boolean: declare the others under var')
        equations = [part for part in body if isinstance(part, LustreEquation)]
        _check_distinct([*inputs, *outputs, *variables])
        _check_distinct(equations)
        _check_defined(equations, [*outputs, *variables])
        result = next(item for item in equations if item.name == outputs[0].name)
        return Equations(tuple(equations), result, tuple(inputs), (*variables, *outputs),
                         join(first.span, body[-1].span))


def _operator(call: Call) -> Expression:
    """Return the operator of one of FRET's functions."""
    name, arguments = call.function, call.arguments
    if len(arguments) != _ARITY[name]:
        refuse(f"'{name}' takes {_ARITY[name]} arguments, not {len(arguments)}",
               call.function_span, f'{len(arguments)} given', f'write {_TAKES[name]}')
    if name in _SINCE:
        right, left = arguments
        return Infix(name, None, left, right, call.function_span, call.span)
    bound = _bound(arguments[0], arguments[1])
    place = join(call.function_span, bound.span)
    if name in _TIMED_PAST:
        return Prefix(_TIMED_PAST[name], bound, arguments[2], place, call.span)
    return Infix(_TIMED_SINCE[name], bound, arguments[3], arguments[2], place, call.span)


def _bound(high: Expression, low: Expression) -> Bound:
    span = join(high.span, low.span)
    if isinstance(low, Name) and low.text == 'NotEqual':
        refuse("a bound cannot have 'NotEqual'", low.span, 'not a range of steps')
    if isinstance(low, Name) and low.text in _RELATIONS:
        return Bound(_RELATIONS[low.text], bound_end(high), None, span)
    return Bound('[]', bound_end(low), bound_end(high), span)


def _check_distinct(items: Sequence[LustreEquation | LustreVariable]) -> None:
    seen: set[str] = set()
    for item in items:
        if item.name in seen:
            verb = 'defined' if isinstance(item, LustreEquation) else 'declared'
            span = item.name_span if isinstance(item, LustreEquation) else item.span
            refuse(f"'{item.name}' is {verb} twice", span, f'{verb} before')
        seen.add(item.name)


def _check_defined(equations: Sequence[LustreEquation],
                   declared: Sequence[LustreVariable]) -> None:
    names = {item.name for item in declared}
    for equation in equations:
        if equation.name not in names:
            refuse(f"'{equation.name}' is not declared", equation.name_span,
                   'neither the output nor under var', f'write var {equation.name}: bool;')
    defined = {equation.name for equation in equations}
    for item in declared:
        if item.name not in defined:
            refuse(f"'{item.name}' has no equation", item.span, 'declared here',
                   f'write {item.name} = ...; between let and tel')


def _explain(text: Text, lexemes: Sequence[Lexeme], index: int) -> Diagnostic | None:
    found = lexemes[index]
    before = lexemes[index - 1] if index else found
    if found.type == 'TIME':
        _lalr.refuse_number(found.text, found.span)
    for lexeme in (found, before):
        if lexeme.type == 'NAME' and lexeme.text in _SINCE and index:
            return Diagnostic(f"'{lexeme.text}' is a function here", lexeme.span,
                              'not between two operands', f'write {_TAKES[lexeme.text]}')
    match before.type, found.type:
        case _, 'IFF':
            return Diagnostic('Lustre has no such operator', found.span, 'not in this language',
                              'write p = q')
        case 'NAME', 'LBRACK' if before.text in ('H', 'O'):
            return Diagnostic('a bound is written as two arguments', found.span,
                              'not allowed here', f'write {_TAKES[before.text + "T"]}')
        case 'SEMI', 'NAME' | 'PAST' | 'DELAY' | 'NOT' | 'PRE' | 'LPAR' | 'IF':
            return Diagnostic('expected a single formula', found.span, 'a second formula',
                              'join them with and, or name each: a = p; b = a and q;')
        case _, 'COMMA' if before.type in _lalr.OPERAND_ENDS:
            return Diagnostic("unexpected ','", found.span, 'not among the arguments of a '
                              'function', _bound_help(lexemes[:index]))
        case 'TEL' | 'DOT', _ if found.type in ('NODE', 'FUNCTION'):
            return Diagnostic('one node is expected', found.span, 'a second one',
                              'put its equations into the first one')
    return None


def _bound_help(lexemes: Sequence[Lexeme]) -> str:
    """Return what to write for `O(5, p)`, of which the lexemes before the comma are given."""
    opened = _lalr.open_brackets(lexemes)[-1:]
    names = [lexeme.text for lexeme, after in pairwise(lexemes)
             if after in opened and lexeme.type == 'PAST']
    name = names[0] if names else 'O'
    return f'write {_TAKES[name + "T"]}, or {name}(p) without a bound'


_SYNTAX = _lalr.Syntax('cocospec', _CocospecBuilder(PRECEDENCE, TIME_UNITS), _pattern(), _WORDS,
                       _OPERATORS, _REFUSED, _FOREIGN, _WRITE, _explain)


def parse_cocospec(text: Text) -> Expression | Equations:
    """
    Return the tree of a formula, or the equations of a node or of `a = p; b = a and q;`.

    `p = q;` is an equation, `p = q` a comparison. Raises `CompileError` with the place of the
    first error.
    """
    lexemes = _lalr.join_times(_lalr.scan(_SYNTAX, text), TIME_UNITS)
    is_node = _is_node([lexeme.type for lexeme in lexemes])
    lexemes = _rename(text, lexemes, frozenset() if is_node else _NODE_WORDS)
    start = 'program' if is_node or _is_equations(lexemes) else 'formula'
    tree: Expression | Equations = _lalr.parse(_SYNTAX, text, lexemes, start)
    return tree


def continue_cocospec(beginning: str) -> Continuation | None:
    """Return what may follow the beginning of a formula; None if that is wrong already."""
    return _lalr.continuation(_SYNTAX, 'formula', beginning, lambda text: _rename(
        text, _lalr.scan(_SYNTAX, text), _NODE_WORDS), _lalr.spelled(_SYNTAX))


_NODE_WORDS = frozenset({'NODE', 'FUNCTION', 'RETURNS', 'VAR', 'LET', 'TEL'})


def _is_node(kinds: Sequence[str]) -> bool:
    has_head = kinds[:1] in (['NODE'], ['FUNCTION']) and kinds[2:3] == ['LPAR']
    return has_head or ('LET' in kinds and 'TEL' in kinds)


def _is_equations(lexemes: Sequence[Lexeme]) -> bool:
    kinds = [lexeme.type for lexeme in lexemes]
    return 'SEMI' in kinds and kinds[:2] == ['NAME', 'EQUAL']


def _rename(text: Text, lexemes: list[Lexeme], names: frozenset[str]) -> list[Lexeme]:
    """
    Turn the kinds in `names`, and H, O, Y and Z without an operand, into names.

    They are names in Lustre; an input may be called `node` or `var`.
    """
    kinds = [END, *(lexeme.type for lexeme in lexemes), END]
    return [lexeme._replace(type='NAME', text=text.value[lexeme.start:lexeme.end])
            if lexeme.type in names or _is_letter(before, lexeme.type, after) else lexeme
            for before, lexeme, after in zip(kinds, lexemes, kinds[2:])]


def _is_letter(before: str, kind: str, after: str) -> bool:
    is_name = before in ('NODE', 'FUNCTION') or after not in _lalr.OPERAND_STARTS
    return kind in ('PAST', 'DELAY') and is_name
