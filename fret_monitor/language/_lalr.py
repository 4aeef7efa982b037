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
What the parsers of formulas share: text to lexemes, lexemes to a tree, error messages.

A `Syntax` names a grammar (`tables` has its LALR tables) and its spellings. `scan` splits a `Text`
into `Lexeme`s, each with its place; `parse` feeds them to the tables, which build the tree bottom
up: no recursion, linear time. Errors are `CompileError`s with their places.
"""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
import math
import re
from typing import Any, NamedTuple, NoReturn, TypeAlias

from fret_monitor.language.continuation import Continuation
from fret_monitor.language.expression import (
    Boolean, Call, Duration, Expression, Name, Number, Prefix, Unit,
)
from fret_monitor.language.misplaced import refuse_measure, refuse_time_last, TIMES_FIRST
from fret_monitor.language.precedence import Chain, Operator, Pending, Precedence
from fret_monitor.language.quoted_text import QuotedText
from fret_monitor.language.tables import END, Parser, read_tables, UnexpectedLexemeError
from fret_monitor.model.diagnostics import (
    CompileError, Diagnostic, did_you_mean, refuse, Source, Span, Text,
)

OPERAND_ENDS = frozenset({'NAME', 'NUMBER', 'NEGATIVE', 'TRUE', 'FALSE', 'RPAR'})
OPERAND_STARTS = frozenset({'NAME', 'NUMBER', 'NEGATIVE', 'TRUE', 'FALSE', 'LPAR', 'NOT', 'PAST',
                            'DELAY', 'PRE', 'IF'})
_CLOSES = {'RPAR': 'LPAR', 'RBRACK': 'LBRACK'}
_OPENS = frozenset(_CLOSES.values())

# An invalid number (with a letter, a second point, a leading zero) is refused as a whole.
NUMBER = (r'(?P<NUMBER>(?:(?:0|[1-9][0-9]*)(?:\.[0-9]+)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)'
          r'(?![\w.$])|(?P<NOTNUMBER>\.?[0-9][\w.$]*)')
# FRET's identifiers have points and percent signs inside; it writes them as _DOT_ and _PRC_.
NAME = r'(?P<NAME>[A-Za-z_$][\w$]*(?:[.%][\w$]+)*)'
QUOTED = r'(?P<QUOTED>"(?:[^"\\\x00-\x1f\x7f]|\\[^\x00-\x1f\x7f])*")'


def time_pattern(units: Iterable[str]) -> str:
    """Return the pattern of a number with a unit of time right behind it: `2.5s`."""
    return (rf'(?P<TIME>(?:[0-9]{{1,20}}\.)?[0-9]{{1,20}}(?i:{"|".join(units)}))(?![\w.$])')


# Kind and one spelling of the operators that all languages have.
OPERATORS = {
    '|': ('INFIX', '|'), '&': ('INFIX', '&'), '!': ('NOT', '!'), '~': ('NOT', '!'),
    **{sign: ('RELATION', sign) for sign in ('<=', '>=', '!=', '<', '>')},
    **{sign: ('INFIX', sign) for sign in '+*/^'}, '-': ('MINUS', '-'),
    '(': ('LPAR', '('), ')': ('RPAR', ')'), ',': ('COMMA', ','),
}
_LOOKALIKES = {
    '\u2227': 'and', '\u2228': 'or', '\u00ac': 'not', '\u2192': 'implies', '\u21d2': 'implies',
    '\u2194': 'iff', '\u21d4': 'iff', '\u2264': '<=', '\u2265': '>=', '\u2260': 'unequal',
    '\u2295': 'xor', '\u00d7': '*', '\u00b7': '*', '\u00f7': '/', '\u2212': '-', '\u2013': '-',
    '\u2014': '-', '\u201c': '"', '\u201d': '"', '\uff08': '(', '\uff09': ')',
}


class Lexeme(NamedTuple):
    """A piece of text with its kind; `text` is its one spelling (`&` for `&&`)."""

    type: str
    text: str
    start: int
    end: int
    span: Span


@dataclass(frozen=True, eq=False)
class Syntax:
    """
    The spelling and grammar of one formula language.

    `pattern` splits the text, by the groups NUMBER, NAME, QUOTED, OPERATOR, TIME, COMMENT and BAD;
    matches without a group are skipped. `words` and `operators` give the kind and the canonical
    spelling. `refused` are words and characters with the text to write instead; `foreign` are
    likewise words of other languages, which are names here, for errors where no name fits.
    `write` is the spelling of the logical operators. `explain` may return a more specific error
    for an unexpected lexeme.
    """

    grammar: str
    builder: Any
    pattern: re.Pattern[str]
    words: Mapping[str, tuple[str, str]]
    operators: Mapping[str, tuple[str, str]]
    refused: Mapping[str, str]
    foreign: Mapping[str, str]
    write: Mapping[str, str]
    explain: Callable[[Text, Sequence[Lexeme], int], Diagnostic | None]


def scan(syntax: Syntax, text: Text,
         pattern: re.Pattern[str] | None = None) -> list[Lexeme]:
    """Split a text into lexemes, by another pattern if given; raises `CompileError`."""
    lexemes = []
    for match in (pattern or syntax.pattern).finditer(text.value):
        kind = match.lastgroup
        if kind is not None and kind != 'COMMENT':
            lexemes.append(_lexeme(syntax, text, kind, match.start(kind), match.end(kind)))
        elif kind == 'COMMENT':
            _check_comment(text, match.start(), match.end())
    return lexemes


def _lexeme(syntax: Syntax, text: Text, kind: str, start: int, end: int) -> Lexeme:
    word = text.value[start:end]
    span = text.at(start, end)
    match kind:
        case 'NUMBER' | 'TIME':
            return Lexeme(kind, word, start, end, span)
        case 'NAME':
            if word in syntax.refused:
                refuse(f"'{word}' is not an operator here", span, 'not in this language',
                       syntax.refused[word])
            kind, word = syntax.words.get(word, ('NAME', word))
            return Lexeme(kind, word, start, end, span)
        case 'OPERATOR':
            kind, word = syntax.operators[_unescape(word)]
            return Lexeme(kind, word, start, end, span)
        case 'QUOTED' if len(word) > 2:
            word = re.sub(r'\\(.)', r'\1', word[1:-1])
        case _:
            if word == "'":
                _refuse_apostrophe(text, start)
            if kind == 'NOTNUMBER' and (match := _WITH_UNIT.fullmatch(word)) and (
                    _END_OF_TIME.match(text.value, end)):
                _refuse_unit(match[1], match[2], span, syntax.builder.units)
            _refuse_text(syntax, word, span)
    return Lexeme('NAME', word, start, end, span)


def _unescape(operator: str) -> str:
    """Read `&lt;`, `&gt;` and `&amp;` of HTML."""
    if ';' not in operator or operator == ';':
        return operator
    return operator.replace('&lt;', '<').replace('&gt;', '>').replace('&amp;', '&')


def _refuse_text(syntax: Syntax, word: str, span: Span) -> NoReturn:
    if word[0].isdigit() or (word[0] == '.' and len(word) > 1):
        refuse_number(word, span)
    if word == '""':
        refuse('a name is missing between the quotes', span, 'empty')
    if word == '"':
        refuse('the quoted name does not end', span, "no closing '\"' on this line")
    if word in ('/*', '(*'):
        refuse('the comment does not end', span, 'opened here')
    if word in _LOOKALIKES:
        meant = _LOOKALIKES[word]
        refuse(f"'{word}' cannot be used here", span, 'not an operator',
               f'write {syntax.write.get(meant, meant)}')
    if word.isspace():
        refuse(f'a special space (U+{ord(word):04X}) cannot be used here', span,
               'looks like a space, but is not one', 'delete it and type a space')
    shown = f"'{word}'" if word.isprintable() else f'the character U+{ord(word):04X}'
    refuse(f'{shown} cannot be used in a formula', span, 'not allowed here',
           syntax.refused.get(word, ''))


def _refuse_apostrophe(text: Text, start: int) -> NoReturn:
    match = re.compile(r"'([^'\n]*)'").match(text.value, start)
    raise CompileError([QuotedText(
        'an apostrophe cannot be used in a formula',
        text.at(start, match.end() if match else start + 1), 'not allowed here',
        'a name of a value is written without quotes: mode = LANDED',
        text=match[1] if match else '')])


def refuse_number(word: str, span: Span) -> NoReturn:
    """Refuse a word that begins like a number."""
    refuse(f"'{short(word)}' is not a number", span, 'not a number', _number_help(word))


def _number_help(word: str) -> str:
    if match := re.fullmatch(r'0+([0-9]+)', word):
        return f'write {short(match[1])}'
    if match := re.fullmatch(r'([0-9]+)\.', word):
        return f'write {short(match[1])}.0'
    if re.fullmatch(r'0[xX][0-9a-fA-F]{1,16}', word):
        return f'write {int(word, 16)}'
    if match := re.fullmatch(r'([0-9]+)(_?[A-Za-z]\w*)', word):
        if match[2] in _PHYSICAL:
            return _without_unit(match[1], match[2], is_time=False)
        number, unit = map(short, match.groups())
        return f'a number has no unit; write {number}, or put an operator before {unit}'
    return ''


def _check_comment(text: Text, start: int, end: int) -> None:
    # YAML's '>' joins lines: the comment would include the lines after it.
    span = text.at(start, end)
    if text.value.startswith('--', start) and '\n' in text.source.text[span.start:span.end]:
        refuse('the comment would swallow the lines after it', text.at(start, start + 2),
               'YAML has joined this line with the next ones',
               "write '|' instead of '>' after the key, so that lines stay lines")


def parse(syntax: Syntax, text: Text, lexemes: Sequence[Lexeme], start: str,
          refuse_at: 'RefuseAt | None' = None) -> Any:
    """
    Return what the language's builder makes of the lexemes; raises `CompileError`.

    `refuse_at` raises the language's own error for the unexpected lexeme at an index.
    """
    parser = Parser(read_tables(syntax.grammar), start, syntax.builder)
    tree = None
    for index, lexeme in enumerate(ended := [*lexemes, _end(text, lexemes)]):
        try:
            tree = parser.feed(lexeme)
        except UnexpectedLexemeError as unexpected:
            if refuse_at is not None:
                refuse_at(text, ended, index)
            _refuse_lexeme(syntax, text, ended, index, unexpected.expected)
    return tree


RefuseAt: TypeAlias = Callable[[Text, Sequence[Lexeme], int], NoReturn]


def fitting(syntax: Syntax, start: str, lexemes: Sequence[Lexeme]) -> frozenset[str]:
    """Return the kinds of lexemes, including `END`, that may follow some valid lexemes."""
    parser = Parser(read_tables(syntax.grammar), start, syntax.builder)
    for lexeme in lexemes:
        parser.feed(lexeme)
    return parser.fitting()


def continuation(syntax: Syntax, start: str, beginning: str,
                 scan: Callable[[Text], Sequence[Lexeme]],
                 words: Mapping[str, str]) -> Continuation | None:
    """Return what may follow; `words` have kinds. None if the beginning is wrong already."""
    try:
        kinds = fitting(syntax, start, scan(Text.whole(Source('', beginning))))
    except (CompileError, UnexpectedLexemeError):
        return None
    is_operand, is_mode = {'NAME', 'LPAR'} <= kinds, {'NAME', 'MODE'} <= kinds
    return Continuation(
        tuple(word for word, kind in words.items() if kind in kinds and word.isalpha()),
        is_operand, 'NAME' in kinds and not is_operand and not is_mode, is_mode)


def spelled(syntax: Syntax) -> dict[str, str]:
    """Return the words of a language with their kinds, each in one spelling."""
    return {word: kind for word, (kind, text) in syntax.words.items()
            if word == text or text not in syntax.words}


def join_signs(lexemes: Sequence[Lexeme]) -> list[Lexeme]:
    """Join a sign and an adjacent number before `^` to one lexeme, as FRET reads them."""
    joined: list[Lexeme] = []
    for index, lexeme in enumerate(lexemes):
        if lexeme.text == '^' and _is_signed(lexemes[max(0, index - 3):index]):
            sign, number = joined[-2:]
            joined[-2:] = [Lexeme('NEGATIVE', '-' + number.text, sign.start, number.end,
                                  join(sign.span, number.span))]
        joined.append(lexeme)
    return joined


def join_times(lexemes: Sequence[Lexeme], units: Collection[str]) -> list[Lexeme]:
    """
    Join a number and a unit of time to one lexeme, where it is an end of a bound or an argument.

    A number before a name has no other meaning there.
    """
    joined: list[Lexeme] = []
    for lexeme in lexemes:
        if lexeme.type in ('COMMA', 'RBRACK') and len(joined) > 2:
            before, number, unit = joined[-3:]
            is_unit = unit.type in ('NAME', 'UNIT') and unit.text.lower() in units
            if is_unit and number.type == 'NUMBER' and before.type in _BEFORE_TIMES:
                joined[-2:] = [Lexeme('TIME', f'{number.text} {unit.text}', number.start, unit.end,
                                      join(number.span, unit.span))]
        joined.append(lexeme)
    return joined


_WITH_UNIT = re.compile('([0-9]+(?:[.][0-9]+)?)([A-Za-z]+)')
_END_OF_TIME = re.compile(r'\s*[],]')
_BEFORE_TIMES = frozenset({'LBRACK', 'LPAR', 'COMMA', 'RELATION'})
_TIME = re.compile('(.*?) ?([A-Za-z]+)')


def _is_signed(lexemes: Sequence[Lexeme]) -> bool:
    if len(lexemes) < 2 or lexemes[-1].type != 'NUMBER' or lexemes[-2].type != 'MINUS':
        return False
    subtracts = len(lexemes) == 3 and lexemes[0].type in OPERAND_ENDS
    return not subtracts and lexemes[-2].end == lexemes[-1].start


def _end(text: Text, lexemes: Sequence[Lexeme]) -> Lexeme:
    """Return the lexeme `END`, just after the last one."""
    end = lexemes[-1].end if lexemes else 0
    place = lexemes[-1].span.end if lexemes else text.span.start
    return Lexeme(END, '', end, end, Span(text.source, place, place))


def _refuse_lexeme(syntax: Syntax, text: Text, lexemes: Sequence[Lexeme], index: int,
                   expected: frozenset[str]) -> NoReturn:
    """Refuse the lexeme at `index`, where one of `expected` is allowed."""
    found = lexemes[index]
    if len(lexemes) == 1:
        refuse('the formula is empty', text.span, 'nothing to read here')
    if explained := syntax.explain(text, lexemes, index):
        raise CompileError([explained])
    opened = open_brackets(lexemes[:index])
    if found.type in _CLOSES:
        _check_closing(text, found, opened)
    if 'NAME' in expected and 'LPAR' in expected:
        _refuse_missing_operand(text, lexemes, index)
    if found.type == END and opened:
        refuse(f"'{as_written(text, opened[-1])}' is not closed", opened[-1].span, 'opened here')
    check_unit(text, lexemes, index, syntax.builder.units)
    if found.type in OPERAND_STARTS and lexemes[index - 1].type in OPERAND_ENDS:
        _refuse_missing_operator(syntax, text, lexemes[index - 1], found)
    title = 'the formula ends too early' if found.type == END else (
        f"unexpected '{as_written(text, found)}'")
    refuse(title, found.span, _expectation(expected, lexemes[:index], opened))


def check_unit(text: Text, lexemes: Sequence[Lexeme], index: int,
               units: Iterable[str]) -> None:
    """Refuse a misspelt unit of time, and a unit where numbers have none: `x > 0.5 m`."""
    number, unit = lexemes[index - 1], lexemes[index]
    if index == 0 or number.type != 'NUMBER' or unit.type not in ('NAME', 'UNIT'):
        return
    word = as_written(text, unit)
    opened = open_brackets(lexemes[:index])[-1:]
    is_time = (lexemes[index + 1].type in ('COMMA', 'RBRACK')
               and lexemes[index - 2].type in _BEFORE_TIMES
               and (lexemes[index - 2].type != 'RELATION' or lexemes[index - 3] in opened))
    if is_time and opened and word.lower() not in units:
        _refuse_unit(number.text, word, unit.span, units)
    function = next((before.text for before, after in pairwise(lexemes) if after in opened), '')
    if word.lower() in units and function == 'rate':
        refuse_measure(join(number.span, unit.span))
    if word.lower() in units and function in TIMES_FIRST and lexemes[index - 2].type == 'COMMA':
        refuse_time_last(function, text.value[opened[0].end:lexemes[index - 2].start],
                         join(number.span, unit.span))
    if (word.lower() in units and function.isidentifier() and lexemes[index - 2].type == 'MINUS'
            and lexemes[index - 3] in opened):
        refuse('a time cannot be negative', join(lexemes[index - 2].span, unit.span), 'below 0',
               f'write {number.text} {word}')
    if word in _PHYSICAL or word.lower() in units:
        refuse('a number has no unit here', unit.span, 'a unit',
               _without_unit(number.text, word, word.lower() in units))


def _without_unit(number: str, unit: str, is_time: bool) -> str:
    """Return what to write for `5 cm`: a bare 5 would be another value where fields are in m."""
    write = 'write the value in the unit of its message field, and no unit'
    if unit in ('deg', 'degrees') and math.isfinite(float(number)):
        return f'{write}: {short(number)} {unit} are {math.radians(float(number)):.7g} in radians'
    only = 'only bounds, and functions such as persisted, take times'
    return f'{write}; {only}' if is_time else write


_PHYSICAL = frozenset({'m', 'cm', 'mm', 'km', 'kg', 'g', 'rad', 'deg', 'degrees', 'Hz', 'N', 'Nm',
                       'V', 'A', 'W', 'K', 'Pa', 'bar', 'meters', 'metres', 'radians', 'percent'})


def _refuse_unit(number: str, word: str, place: Span, units: Iterable[str]) -> NoReturn:
    refuse(f"'{word}' is not a unit of time", place,
           'the units are ns, us, ms, s, min, h, and words such as seconds',
           _unit_help(number, word, units))


def _unit_help(number: str, word: str, units: Iterable[str]) -> str:
    if word == 'm':
        return 'write ms for milliseconds, min for minutes'
    if word.lower() == 'hz' and float(number):
        return f'write the period instead of the rate: {1 / float(number):g} s'
    return did_you_mean(word.lower(), units)


def open_brackets(lexemes: Sequence[Lexeme]) -> list[Lexeme]:
    """Return the brackets that are open at the end, outermost first."""
    opened = []
    for lexeme in lexemes:
        if lexeme.type in _OPENS:
            opened.append(lexeme)
        elif lexeme.type in _CLOSES:
            opened.pop()
    return opened


def _check_closing(text: Text, found: Lexeme, opened: Sequence[Lexeme]) -> None:
    written = as_written(text, found)
    if not opened:
        refuse(f"'{written}' is unmatched", found.span, 'no bracket is open here')
    if opened[-1].type != _CLOSES[found.type]:
        refuse(f"'{as_written(text, opened[-1])}' is not closed", opened[-1].span,
               f"'{written}' comes first and does not close it")


def _refuse_missing_operand(text: Text, lexemes: Sequence[Lexeme], index: int) -> NoReturn:
    found = lexemes[index]
    wanted = "expected a name, a number or '('"
    if found.type == END:
        refuse('the formula ends too early', found.span,
               f"{wanted} after '{as_written(text, lexemes[index - 1])}'")
    refuse('an operand is missing', found.span, f"{wanted} before '{as_written(text, found)}'")


def _refuse_missing_operator(syntax: Syntax, text: Text, before: Lexeme,
                             found: Lexeme) -> NoReturn:
    for lexeme in (before, found):
        if lexeme.type == 'NAME' and lexeme.text in syntax.foreign:
            refuse(f"'{lexeme.text}' is not an operator here", lexeme.span, 'not in this language',
                   syntax.foreign[lexeme.text])
    refuse('an operator is missing', found.span,
           f"expected an operator before '{as_written(text, found)}'")


def as_written(text: Text, lexeme: Lexeme) -> str:
    return short(text.value[lexeme.start:lexeme.end])


def short(word: str) -> str:
    return word if len(word) <= 40 else word[:37] + '...'


_SHOWN = {
    'NAME': 'a name', 'NUMBER': 'a number', 'LPAR': "'('", 'RPAR': "')'", 'LBRACK': "'['",
    'RBRACK': "']'", 'COMMA': "','", 'SEMI': "';'", 'COLON': "':'", 'EQUAL': "'='",
    'THEN': "'then'", 'ELSE': "'else'", 'LET': "'let'", 'TEL': "'tel'", 'RETURNS': "'returns'",
    'VAR': "'var'", 'NODE': "'node'", 'FUNCTION': "'function'",
}


def _expectation(expected: frozenset[str], before: Sequence[Lexeme],
                 opened: Sequence[Lexeme]) -> str:
    # LALR tables merge states: a closing bracket may be named where none is open.
    out_of_place = frozenset() if opened else frozenset({'RPAR', 'COMMA'})
    if all(lexeme.type != 'IF' for lexeme in before):
        out_of_place |= {'THEN', 'ELSE'}
    after_operand = 'INFIX' in expected
    if after_operand:
        out_of_place |= {'LPAR', 'EQUAL'}
    shown = ['an operator'] * after_operand
    shown += [word for kind, word in _SHOWN.items() if kind in expected - out_of_place]
    if not shown:
        return 'expected the end' if END in expected else 'not allowed here'
    return 'expected ' + ' or '.join([', '.join(shown[:-1]), shown[-1]] if shown[1:] else shown)


class ExpressionBuilder:
    """
    Builds the tree: a method for each rule of the grammar, with its name.

    The parser calls it with the lexemes and trees of the rule, in order, of any type.
    """

    def __init__(self, precedence: Precedence, units: Mapping[str, Unit]) -> None:
        """Take the precedence of the operators, and the units of time."""
        self._precedence = precedence
        self.units = units

    def finish(self, part: Any) -> Expression:
        """Return the tree of a complete expression."""
        if isinstance(part, Pending):
            part = self._chain(part)
        tree: Expression = part.close() if isinstance(part, Chain) else part
        return tree

    def _chain(self, operand: Expression | Pending) -> Chain:
        chain = Chain(self._precedence)
        chain.add_operand(operand)
        return chain

    def start(self, parts: list[Any]) -> Expression:
        """Return the whole tree."""
        return self.finish(parts[0])

    def more(self, parts: list[Any]) -> Chain:
        """Add an infix operator, its bound if any, and an operand."""
        chain = parts[0] if isinstance(parts[0], Chain) else self._chain(parts[0])
        chain.add_infix(_operator(parts[1:-1]))
        chain.add_operand(parts[-1])
        return chain

    def prefixed(self, parts: list[Any]) -> Pending:
        """Put a prefix operator, with its bound if any, before an operand."""
        return Pending(_operator(parts[:-1]), parts[-1])

    def name(self, parts: list[Any]) -> Name:
        """Build a name."""
        return Name(parts[0].text, parts[0].span)

    def number(self, parts: list[Any]) -> Number:
        """Build a number."""
        return Number(parts[0].text, parts[0].span)

    def time(self, parts: list[Any]) -> Duration:
        """Build a number with a unit of time."""
        match = _TIME.fullmatch(parts[0].text)
        assert match is not None, parts[0]
        return Duration(match[1], self.units[match[2].lower()], parts[0].span)

    def negative(self, parts: list[Any]) -> Prefix:
        """Build a number with its sign."""
        span = parts[0].span
        sign = Span(span.source, span.start, span.start + 1)
        number = Number(parts[0].text[1:], Span(span.source, span.start + 1, span.end))
        return Prefix('-', None, number, sign, span)

    def boolean(self, parts: list[Any]) -> Boolean:
        """Build a truth value."""
        return Boolean(parts[0].type == 'TRUE', parts[0].span)

    def arguments(self, parts: list[Any]) -> tuple[Expression, ...]:
        """Return the arguments of a call."""
        return tuple(self.finish(part) for part in parts if not isinstance(part, Lexeme))

    def call(self, parts: list[Any]) -> Expression:
        """Build `function(arguments)`."""
        arguments: tuple[Any, ...] = parts[2] if len(parts) == 4 else ()
        names = [item.variable if isinstance(item, _OfKey) else item for item in arguments]
        found = [place for place, item in enumerate(arguments) if isinstance(item, _OfKey)]
        if found and (len(found) > 1 or not isinstance(arguments[-1], _OfKey)
                      or not all(isinstance(name, Name) for name in names)):
            refuse('a colon stands after the instance variables', arguments[found[0]].span, '',
                   'write count(robot: p), or of pairs count(robot, person: p)')
        return Call(parts[0].text, (arguments[-1].argument,) if found else arguments,
                    parts[0].span, join(parts[0].span, parts[-1].span),
                    tuple(names) if found else ())

    def of_key(self, parts: list[Any]) -> '_OfKey':
        """Build `variable: expression`, the last argument of a function over instances."""
        name, _, argument = parts
        return _OfKey(Name(name.text, name.span), self.finish(argument), name.span)

    def group(self, parts: list[Any]) -> Expression:
        """Return the expression in parentheses; its place includes them."""
        return placed(self.finish(parts[1]), join(parts[0].span, parts[2].span))


@dataclass(frozen=True)
class _OfKey:
    """What of the instances of a variable is aggregated: `robot: p`."""

    variable: Name
    argument: Expression
    span: Span


def _operator(parts: list[Any]) -> Operator:
    lexeme, bound = parts if len(parts) == 2 else (parts[0], None)
    span = lexeme.span if bound is None else join(lexeme.span, bound.span)
    return Operator(lexeme.text, bound, span)


def placed(node: Expression, span: Span) -> Expression:
    """Return a node of several parts with another place."""
    is_single = isinstance(node, Name | Number | Boolean)
    return node if is_single else replace(node, span=span)


def join(first: Span, last: Span) -> Span:
    """Return the place from the start of one span to the end of another."""
    return Span(first.source, first.start, last.end)
