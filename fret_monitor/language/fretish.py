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
Reads FRETish, FRET's structured English (the key `fretish`).

A `Text` goes in, a `Sentence` comes out: its parts, with places, and no meaning. The grammar is
in `fretish.lark`, the error messages are in `fretish_help.py`. Precedence is that of SMV, as in
FRET, which rewrites `if p then q` textually to `p -> q`. Beyond FRET it accepts `true` and `false`
in any case and anywhere, `x-3` for `x - 3`, and the component before the condition.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
import re
from typing import Any, NamedTuple, NoReturn, TypeAlias

from fret_monitor.language import _lalr, fretish_help
from fret_monitor.language._lalr import join, Lexeme
from fret_monitor.language.continuation import Continuation
from fret_monitor.language.expression import Call, Duration, Expression, Infix, Name, Prefix
from fret_monitor.language.fretish_words import (
    OPERATORS, TIME_UNITS, UNITS, WORDS,
)
from fret_monitor.language.if_then import remarks
from fret_monitor.language.precedence import Chain, Operator, Pending
from fret_monitor.language.sentence import (
    ComponentPhrase, ConditionKind, ConditionPhrase, ProbabilityPhrase, Qualifier, ScopeKind,
    ScopePhrase, Sentence, TimingKind, TimingPhrase,
)
from fret_monitor.language.smv import PRECEDENCE
from fret_monitor.model.diagnostics import Span, Text

_POINTS = {'first': TimingKind.IMMEDIATELY, 'same': TimingKind.IMMEDIATELY,
           'next': TimingKind.NEXT, 'last': TimingKind.FINALLY,
           'initially': TimingKind.IMMEDIATELY}
_END_OF_NUMBER = r'(?![\w.$])'


class _OperandRun(NamedTuple):
    """A sequence of operands and operators that is not a tree yet."""

    start: Span
    pieces: tuple[Any, ...]


class _Mode(NamedTuple):
    mode: Expression
    is_named: bool
    span: Span


_Piece: TypeAlias = Operator | Expression | Pending


def _pattern() -> re.Pattern[str]:
    operators = '|'.join(map(re.escape, sorted(OPERATORS, key=len, reverse=True)))
    # FRET reads `3seconds` as two words; `3s` is two as well, for a better error.
    units = '|'.join(sorted(TIME_UNITS, key=len, reverse=True))
    number = _lalr.NUMBER.replace(_END_OF_NUMBER, rf'(?:{_END_OF_NUMBER}|(?=(?i:{units})\b))')
    return re.compile(rf'\s+|{number}|{_lalr.NAME}|{_lalr.QUOTED}'
                      f'|(?P<OPERATOR>{operators})|(?P<BAD>.)', re.ASCII | re.DOTALL)


class _FretishBuilder(_lalr.ExpressionBuilder):

    # Expressions. `if` and `then` do not group their operands (FRET rewrites them to `=>`), so a
    # sequence stays flat until it ends.

    def finish(self, part: Any) -> Expression:
        if not isinstance(part, _OperandRun | Pending):
            tree: Expression = part
            return tree
        chain = Chain(self._precedence)
        for piece in _flat(part):
            if isinstance(piece, Operator):
                chain.add_infix(piece)
            else:
                chain.add_operand(piece)
        tree = chain.close()
        start = part.start if isinstance(part, _OperandRun) else tree.span
        return _lalr.placed(tree, join(start, tree.span))

    def more(self, parts: list[Any]) -> Any:
        left, operator, right = parts
        infix = Operator(operator.text, None, operator.span)
        return _OperandRun(_start(left), (left, infix, right))

    def conditional(self, parts: list[Any]) -> Any:
        if_, condition, then, consequence = parts
        return _OperandRun(if_.span, (condition, Operator('->', None, then.span), consequence))

    def prefixed(self, parts: list[Any]) -> Any:
        operator, operand = parts
        pending = Pending(Operator(operator.text, None, operator.span), operand)
        if isinstance(operand, _OperandRun):
            return _OperandRun(operator.span, (pending,))
        return pending

    def occurrence(self, parts: list[Any]) -> Expression:
        phrase = join(parts[0].span, parts[4].span)
        if parts[2].type == 'NEXT':
            fretish_help.refuse_future(phrase)
        event, then = self.finish(parts[5]), self.finish(parts[7])
        return Call('prevOcc', (event, then), phrase, join(phrase, then.span))

    # Parts of the sentence

    def definition(self, parts: list[Any]) -> Expression:
        return self.finish(parts[0])

    def mode(self, parts: list[Any]) -> _Mode:
        name = next(part for part in parts if part.type == 'NAME')
        return _Mode(Name(name.text, name.span), True, join(parts[0].span, parts[-1].span))

    def moment(self, parts: list[Any]) -> _Mode:
        mode = self.finish(parts[0])
        return _Mode(mode, isinstance(mode, Name), mode.span)

    def inside(self, parts: list[Any]) -> ScopePhrase:
        last = parts[-1]
        mode = last if isinstance(last, _Mode) else self.moment([last])
        is_named = isinstance(last, _Mode)
        span = join(parts[0].span, mode.span)
        return ScopePhrase(ScopeKind.IN, mode.mode, is_named, span)

    def outside(self, parts: list[Any]) -> ScopePhrase:
        mode = parts[-1]
        return ScopePhrase(ScopeKind.NOT_IN, mode.mode, mode.is_named,
                           join(parts[0].span, mode.span))

    def place(self, parts: list[Any]) -> ScopePhrase:
        *words, mode = parts
        if not words:
            phrase: ScopePhrase = mode
            return phrase
        kind = _PLACES[tuple(word.type for word in words)]
        return ScopePhrase(kind, mode.mode, mode.is_named, join(words[0].span, mode.span))

    def scope(self, parts: list[Any]) -> ScopePhrase:
        phrase: ScopePhrase = parts[0]
        return phrase

    def qualifier(self, parts: list[Any]) -> Qualifier:
        word, part, *truth = parts
        expression = self.finish(part)
        is_false = bool(truth) and truth[-1].type == 'FALSE'
        end = truth[-1].span if truth else expression.span
        return Qualifier(word.text, '&', expression, (word.type == 'UNLESS') != is_false,
                         join(word.span, end))

    def chain(self, parts: list[Any]) -> list[Qualifier]:
        chain: list[Qualifier] = parts[0] if isinstance(parts[0], list) else []
        link = parts[-1]
        kinds = [part.type for part in parts if isinstance(part, Lexeme)]
        joint = '|' if 'OR' in kinds else '&'
        chain.append(Qualifier(link.word, joint, link.expression, link.is_negated, link.span))
        return chain

    def condition(self, parts: list[Any]) -> ConditionPhrase:
        chain = next(part for part in parts if isinstance(part, list))
        is_holding = all(link.word == 'whenever' for link in chain)
        kind = ConditionKind.HOLDING if is_holding else ConditionKind.REGULAR
        return ConditionPhrase(kind, tuple(chain), _joined(chain),
                               join(chain[0].span, chain[-1].span))

    def component(self, parts: list[Any]) -> ComponentPhrase:
        return ComponentPhrase(parts[-1].text, parts[-1].span)

    def probability(self, parts: list[Any]) -> ProbabilityPhrase:
        words = {part.type: part for part in parts}
        relation, number = words['RELATION'], words['NUMBER']
        bound = Fraction(number.text)
        if 'MINUS' in words:
            bound = -bound
        phrase = ProbabilityPhrase(relation.text, bound, join(words['WITH'].span, number.span))
        fretish_help.check_probability(phrase, relation.span, number.span)
        return phrase

    def duration(self, parts: list[Any]) -> Duration:
        number, unit = parts
        return Duration(number.text, UNITS[unit.text], join(number.span, unit.span))

    def negative_duration(self, parts: list[Any]) -> None:
        fretish_help.refuse_negative(join(parts[0].span, parts[-1].span))

    def lasting(self, parts: list[Any]) -> TimingPhrase:
        word, duration = parts
        return TimingPhrase(TimingKind(word.text), duration, None,
                            join(word.span, duration.span))

    def stopping(self, parts: list[Any]) -> TimingPhrase:
        stop = self.finish(parts[1])
        return TimingPhrase(TimingKind(parts[0].text), None, stop, join(parts[0].span, stop.span))

    def at_point(self, parts: list[Any]) -> TimingPhrase:
        return TimingPhrase(_POINTS[parts[2].text], None, None,
                            join(parts[0].span, parts[-1].span))

    def plain(self, parts: list[Any]) -> TimingPhrase:
        word = parts[0].text
        return TimingPhrase(_POINTS.get(word) or TimingKind(word), None, None, parts[0].span)

    def timing(self, parts: list[Any]) -> TimingPhrase:
        phrase: TimingPhrase = next(part for part in parts if isinstance(part, TimingPhrase))
        return phrase

    def body(self, parts: list[Any]) -> tuple[list[Any], Expression]:
        return parts[:-1], self.finish(parts[-1])

    def sentence(self, parts: list[Any]) -> Sentence:
        phrases, response = parts[-1]
        return Sentence(
            _first(parts, ScopePhrase), _first(parts, ConditionPhrase),
            _first(parts, ComponentPhrase), _first(phrases, TimingPhrase), response,
            join(parts[0].span, response.span),
            probability=_first(phrases, ProbabilityPhrase))


_PLACES = {
    ('ONLY',): ScopeKind.ONLY_IN, ('EXCEPT',): ScopeKind.NOT_IN,
    ('AFTER',): ScopeKind.AFTER, ('BEFORE',): ScopeKind.BEFORE,
    ('ONLY', 'AFTER'): ScopeKind.ONLY_AFTER, ('ONLY', 'BEFORE'): ScopeKind.ONLY_BEFORE,
}


def _first(parts: Sequence[Any], kind: type) -> Any:
    return next((part for part in parts if isinstance(part, kind)), None)


def _start(part: Any) -> Span:
    match part:
        case _OperandRun():
            return part.start
        case Pending():
            return part.operator.span
        case _:
            span: Span = part.span
            return span


def _flat(part: Any) -> Iterator[_Piece]:
    """Yield the operands, each with its prefix operators, and the operators between them."""
    prefixes: list[Operator] = []
    stack = [part]
    while stack:
        piece = stack.pop()
        if isinstance(piece, _OperandRun):
            stack.extend(reversed(piece.pieces))
        elif isinstance(piece, Pending):
            prefixes.append(piece.operator)
            stack.append(piece.operand)
        elif isinstance(piece, Operator):
            yield piece
        else:
            while prefixes:
                piece = Pending(prefixes.pop(), piece)
            yield piece


def _joined(chain: Sequence[Qualifier]) -> Expression:
    """Return a chain as one expression, left-associative as in FRET."""
    whole: Expression | None = None
    for link in chain:
        part = link.expression
        if link.is_negated:
            part = Prefix('!', None, part, link.span, part.span)
        whole = part if whole is None else Infix(
            link.joint, None, whole, part, link.span, join(whole.span, part.span))
    assert whole is not None
    return whole


_SYNTAX = _lalr.Syntax('fretish', _FretishBuilder(PRECEDENCE, TIME_UNITS), _pattern(), {},
                       OPERATORS, {}, {}, fretish_help.WRITE, lambda text, lexemes, index: None)


def parse_fretish(text: Text, *, is_timed: bool = False) -> Sentence:
    """
    Return the parts of a sentence; raises `CompileError` with the place of the first error.

    With `is_timed`, for the policy timed, errors advise times instead of ticks.
    """
    text = _without_stop(text)
    lexemes = _scan(text)
    fretish_help.check_sentence(text, lexemes, is_timed)
    sentence: Sentence = _lalr.parse(_SYNTAX, text, lexemes, 'sentence',
                                     _refuse_at('sentence', is_timed))
    return replace(sentence, remarks=remarks(sentence, lexemes))


def parse_fretish_expression(text: Text) -> Expression:
    """Return the tree of an expression of FRETish; raises `CompileError` as `parse_fretish`."""
    lexemes = _scan(text)
    fretish_help.check_expression(lexemes)
    tree: Expression = _lalr.parse(_SYNTAX, text, lexemes, 'definition', _refuse_at('definition'))
    return tree


def continue_fretish(beginning: str, *,
                     is_expression: bool = False) -> Continuation | None:
    """Return what may follow the beginning of a sentence or expression, as `continue_smv`."""
    return _lalr.continuation(_SYNTAX, 'definition' if is_expression else 'sentence', beginning,
                              _scan, WORDS)


def _refuse_at(start: str, is_timed: bool = False) -> _lalr.RefuseAt:
    def refuse_at(text: Text, lexemes: Sequence[Lexeme], index: int) -> NoReturn:
        fitting = _lalr.fitting(_SYNTAX, start, lexemes[:index])
        earlier = _lalr.fitting(_SYNTAX, start, lexemes[:index - 1]) if index else frozenset()
        fretish_help.refuse_lexeme(
            fretish_help.Misfit(text, lexemes, index, fitting, earlier, is_timed))

    return refuse_at


def _without_stop(text: Text) -> Text:
    """Leave out the full stop at the end."""
    value = text.value.rstrip()
    if not value.endswith('.'):
        return text
    value = value[:-1].rstrip()
    return Text(value, text.source, text.offsets[:len(value) + 1])


def _scan(text: Text) -> list[Lexeme]:
    lexemes = [_worded(text, lexeme) for lexeme in _lalr.scan(_SYNTAX, text)]
    return _lalr.join_times(_lalr.join_signs(lexemes), TIME_UNITS)


def _worded(text: Text, lexeme: Lexeme) -> Lexeme:
    """Return a name as a keyword if it is one, in any case; a quoted one stays a name."""
    word = lexeme.text.lower()
    if lexeme.type != 'NAME' or word not in WORDS or text.value[lexeme.start] == '"':
        return lexeme
    return lexeme._replace(type=WORDS[word], text=word)
