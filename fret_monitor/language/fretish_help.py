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


"""Errors for an invalid FRETish sentence: the place, what fits there, and what was meant."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import NoReturn

from fret_monitor.language._lalr import (
    as_written, check_unit, Lexeme, open_brackets, OPERAND_ENDS, OPERAND_STARTS, short,
)
from fret_monitor.language.fretish_words import ABBREVIATIONS, TIME, TIME_UNITS, WORDS
from fret_monitor.language.sentence import ProbabilityPhrase
from fret_monitor.language.tables import END
from fret_monitor.model.diagnostics import refuse, Span, Text
from fret_monitor.model.probability import LEAST, RELATIONS

WRITE = {'and': '&', 'or': '|', 'not': '!', 'implies': '=>', 'iff': '<=>', 'xor': 'xor',
         'unequal': '!='}
_TIMES = 'microseconds, milliseconds, seconds, minutes, hours'
_DIGITS = {word: str(number) for number, word in enumerate(
    ('zero', 'one', 'two', 'three', 'four', 'five', 'six', 'seven', 'eight', 'nine', 'ten'))}
_FOREIGN = {
    '&&': 'write &', '||': 'write |', '==': 'write =', '<>': 'write !=',
    '%': 'the remainder is mod: x mod 3; a probability is a number from 0 to 1: '
         'with probability > 0.98',
    '.': 'a full stop ends the sentence; each sentence is a requirement of its own',
    ';': 'a sentence ends without a semicolon, or with a full stop',
    ':': 'put a name with special characters in quotes; a value over instances, such as '
         'count(robot: p), in a definition',
    '[': 'an element of an array is an input of its own: field: NAME[INDEX]',
    '{': 'write an enumeration as (x = A | x = B)',
}
# Common words that are not FRETish, each with the FRETish one.
_MEANT = {
    **ABBREVIATIONS,
    **dict.fromkeys(('should', 'must', 'will', 'can', 'may', 'has', 'does'), 'shall'),
    **dict.fromkeys(('ensure', 'guarantee', 'be', 'meet', 'fulfil', 'fulfill', 'hold',
                     'maintain', 'satisfies'), 'satisfy'),
    **dict.fromkeys(('step', 'steps', 'cycle', 'cycles', 'message', 'messages', 'samples',
                     'timepoints', 'timestep', 'timesteps'), 'ticks'),
    **dict.fromkeys(('provided', 'given', 'assuming'), 'if'),
    **dict.fromkeys(('soon', 'once'), 'upon'),
    **dict.fromkeys(('globally', 'continuously', 'constantly', 'permanently'), 'always'),
    **dict.fromkeys(('sometime', 'someday', 'later'), 'eventually'),
    **dict.fromkeys(('instantly', 'directly', 'now', 'simultaneously'), 'immediately'),
    **dict.fromkeys(('following', 'subsequent'), 'next'),
    **dict.fromkeys(('state', 'phase'), 'mode'),
}
_POINTS = frozenset({'time', 'timestep', 'point', 'instant', 'step', 'moment'})
_SYMBOLS = {'AND': '&', 'OR': '|', 'NEGATION': '!'}
_OPERATORS = {
    'implies': 'write =>', 'iff': 'write <=>', 'equals': 'write =', 'plus': 'write +',
    'minus': 'write -', 'times': 'write *', 'div': 'write /',
    **dict.fromkeys(('H', 'O', 'Y', 'Z', 'S', 'T', 'SI', 'G', 'F', 'X', 'U'),
                    'use a timing (always, eventually, within ...), persisted or occurred, '
                    'or the key ptltl:'),
}
_EXPECTATIONS = (
    ({'NAME', 'LPAR'}, 'an expression'),
    ({'DURING'}, 'a scope (in m mode, while p, before p, after p)'),
    ({'QUALIFIER'}, 'a condition (when p, if p, upon p, whenever p)'),
    ({'THE', 'SHALL'}, "the component and 'shall'"),
    ({'THE', 'NAME'}, 'the component'),
    ({'THE'}, "'the'"),
    ({'SHALL'}, "'shall'"),
    ({'PLAIN'}, 'a timing (always, within 3 UNIT, until p, at the next timepoint)'),
    ({'UNIT'}, 'a unit (UNITS)'),
    ({'SATISFY'}, "'satisfy'"),
    ({'TIMEPOINT'}, "'timepoint'"),
    ({'WHICH', 'NEXT', 'PREVIOUS'}, "'first', 'same', 'next', 'last', or 'previous occurrence'"),
    ({'WHICH', 'NEXT'}, "'first', 'same', 'next' or 'last'"),
    ({'PREVIOUS'}, "'previous'"),
    ({'OCCURRENCE'}, "'occurrence'"),
    ({'OF'}, "'of'"),
    ({'PROBABILITY'}, "'probability'"),
    ({'IN'}, "'in'"),
    ({'MODE', 'NAME'}, 'a mode'),
    ({'NAME'}, 'a name'),
    ({'NUMBER'}, 'a number'),
    ({'RELATION', 'INFIX'}, 'an operator'),
    ({'RELATION'}, 'a comparison'),
    ({'THEN'}, "'then'"),
    ({'RPAR'}, "')'"),
    ({END}, 'the end'),
)
# Kinds that the phrase of another kind includes.
_IMPLIED = {
    'LPAR': ('NUMBER',), 'DURING': ('IN',), 'SHALL': ('NAME',), 'THE': ('NAME',),
}
_PLACES = frozenset({'IN', 'DURING', 'WHILE', 'AFTER', 'BEFORE', 'ONLY', 'EXCEPT'})
_QUALIFIERS = frozenset({'QUALIFIER', 'WHEN', 'IF', 'UNLESS'})


@dataclass(frozen=True, eq=False)
class Misfit:
    """
    The kinds allowed at the unexpected lexeme `index` (`fitting`), one before (`earlier`).

    With `is_timed` the policy is timed: ticks are refused.
    """

    text: Text
    lexemes: Sequence[Lexeme]
    index: int
    fitting: frozenset[str]
    earlier: frozenset[str]
    is_timed: bool

    @property
    def found(self) -> Lexeme:
        """The unexpected lexeme."""
        return self.lexemes[self.index]

    @property
    def before(self) -> Lexeme | None:
        """The lexeme before it."""
        return self.lexemes[self.index - 1] if self.index else None

    @property
    def example(self) -> str:
        """The advice to write a sentence such as this one."""
        return _example(self.is_timed)

    def written(self, lexeme: Lexeme) -> str:
        """Return a lexeme as the user wrote it."""
        return as_written(self.text, lexeme)


def _example(is_timed: bool) -> str:
    unit = 'seconds' if is_timed else 'ticks'
    return f'a sentence is like: when p the COMPONENT shall within 3 {unit} satisfy q'


def check_sentence(text: Text, lexemes: Sequence[Lexeme], is_timed: bool) -> None:
    """Refuse an empty sentence, and free text in quotes."""
    if not lexemes:
        refuse('the sentence is empty', text.span, 'nothing to read here', _example(is_timed))
    if len(lexemes) == 1 and text.value[lexemes[0].start] == '"':
        refuse('free text cannot be monitored', text.span, 'this is text in quotes',
               _example(is_timed))


def check_expression(lexemes: Sequence[Lexeme]) -> None:
    """Refuse a sentence in place of an expression."""
    for lexeme in lexemes:
        if lexeme.type in ('SHALL', 'SATISFY'):
            refuse('a definition must be an expression, not a sentence', lexeme.span,
                   'not allowed here', 'write a condition, as in x > 3 & p')


def refuse_future(phrase: Span) -> NoReturn:
    """Refuse `at the next occurrence of`."""
    refuse('the future cannot be monitored', phrase, 'refers to the future',
           'write at the previous occurrence of p, q; or make p the condition: upon p ... satisfy')


def check_probability(phrase: ProbabilityPhrase, relation: Span, number: Span) -> None:
    """Refuse a probability that no number of trials can test."""
    if phrase.relation not in RELATIONS:
        refuse('a probability needs a bound on one side', relation,
               'trials cannot show what a probability is exactly', 'write >, >=, < or <=')
    if not 0 <= phrase.bound <= 1:
        refuse('a probability is between 0 and 1', number, 'this is not')
    if phrase.bound in (0, 1):
        refuse('a probability of 0 or 1 is not tested', number,
               'a test needs a bound between 0 and 1',
               'leave the probability out: each trigger then needs its response')
    if min(phrase.bound, 1 - phrase.bound) < LEAST:
        refuse('a probability must differ from 0 and 1 by 1e-12 or more', number, 'this is closer')


def refuse_negative(phrase: Span) -> NoReturn:
    """Refuse `within -3 ticks`."""
    refuse('a duration cannot be negative', phrase, 'less than 0')


def refuse_lexeme(misfit: Misfit) -> NoReturn:
    """Refuse an unexpected lexeme; suggest what was probably meant."""
    _check_english(misfit)
    _check_order(misfit)
    _check_known_slips(misfit)
    _check_duration(misfit)
    _check_units(misfit)
    _check_brackets(misfit)
    meant = _meant(misfit)
    if meant is not None:
        lexeme, word = meant
        if lexeme is misfit.found and misfit.before and misfit.before.type == 'NUMBER':
            word = f'{misfit.written(misfit.before)} {word}'
        refuse(f"'{misfit.written(lexeme)}' is not a word that FRETish allows here", lexeme.span,
               _expectation(misfit, misfit.fitting if lexeme is misfit.found else
                            misfit.earlier),
               f"did you mean '{word}'?")
    found = misfit.found
    if found.type == END:
        refuse('the sentence ends too early', found.span, _expectation(misfit, misfit.fitting),
               _help(misfit))
    refuse(_title(misfit), found.span, _expectation(misfit, misfit.fitting), _help(misfit))


def _title(misfit: Misfit) -> str:
    found = misfit.found
    shown = misfit.written(found)
    if _is_word(found) and _wants_operand(misfit):
        return f"'{shown}' is a keyword of FRETish, not a name"
    return f"unexpected '{shown}'"


def _wants_operand(misfit: Misfit) -> bool:
    return {'NAME', 'LPAR'} <= misfit.fitting and 'INFIX' not in misfit.fitting


def _is_article(misfit: Misfit) -> bool:
    """Whether `the` stands before an operand, which FRETish does not read."""
    following = misfit.lexemes[misfit.index + 1:misfit.index + 3]
    return (misfit.found.type == 'THE' and _wants_operand(misfit) and len(following) == 2
            and following[0].type == 'NAME' and following[1].type != 'SHALL')


def _is_word(lexeme: Lexeme) -> bool:
    return lexeme.text in WORDS and lexeme.type == WORDS[lexeme.text]


# English that is not FRETish: `v is less than 1`

_RELATIONS = {
    '<': ('is less than', 'is smaller than', 'is lower than', 'is below', 'is under'),
    '>': ('is greater than', 'is more than', 'is larger than', 'is higher than', 'is above',
          'is over', 'exceeds'),
    '<=': ('is less than or equal to', 'is at most', 'is no more than', 'is not more than',
           'is not greater than', 'is not above'),
    '>=': ('is greater than or equal to', 'is at least', 'is no less than', 'is not less than',
           'is not below'),
    '=': ('is equal to', 'equals', 'is'),
    '!=': ('is not equal to', 'is unequal to', 'is not', 'differs from'),
}
_VERBS = ('is', 'must be', 'should be', 'stays')
_PHRASES = sorted({(tuple(phrase.replace('is', verb, 1).split()), sign)
                   for sign, phrases in _RELATIONS.items() for phrase in phrases
                   for verb in (_VERBS if phrase.startswith('is') else ('is',))},
                  key=lambda item: (-len(item[0]), item))
_LONGEST_PHRASE = len(_PHRASES[0][0])


def _check_english(misfit: Misfit) -> None:
    """Report a comparison in words where one of its words, or `the` before it, is unexpected."""
    lexemes = misfit.lexemes
    last = misfit.index + (2 if _is_article(misfit) else 0)
    for start in range(max(1, misfit.index - _LONGEST_PHRASE), min(last + 1, len(lexemes))):
        words = tuple(misfit.written(lexeme).lower()
                      for lexeme in lexemes[start:start + _LONGEST_PHRASE])
        found = next(((phrase, sign) for phrase, sign in _PHRASES
                      if words[:len(phrase)] == phrase), None)
        if found is not None and lexemes[start - 1].type in OPERAND_ENDS:
            _refuse_english(misfit, start, *found)


def _refuse_english(misfit: Misfit, start: int, phrase: tuple[str, ...], sign: str) -> None:
    lexemes, end = misfit.lexemes, start + len(phrase)
    after = end + 1 if lexemes[min(end, len(lexemes) - 1)].type == 'THE' else end
    left, right = lexemes[start - 1], lexemes[min(after, len(lexemes) - 1)]
    if misfit.index > after or right.type not in OPERAND_STARTS | {'MINUS'}:
        return
    shown = misfit.written(left), misfit.written(right)
    first = lexemes[start].span
    help_ = f'write {sign}'
    if right.type in ('TRUE', 'FALSE') and sign in ('=', '!='):
        help_ = f"write {'' if (right.type == 'TRUE') == (sign == '=') else '!'}{shown[0]}"
    elif left.type in ('NAME', 'NUMBER') and right.type in ('NAME', 'NUMBER'):
        help_ = f'write {shown[0]} {sign} {shown[1]}'
    refuse(f"'{' '.join(phrase)}' is not FRETish",
           Span(first.source, first.start, lexemes[end - 1].span.end), 'not an operator', help_)


# Parts in the wrong order: `shall satisfy p within 2 seconds`

_LONGEST = 400
_TIMINGS = frozenset({'SPAN', 'UNTIL', 'BEFORE', 'AFTER', 'AT', 'PLAIN'})


def _check_order(misfit: Misfit) -> None:
    """Report a timing or a condition after the response, with the sentence to write."""
    found = misfit.found
    kinds = [lexeme.type for lexeme in misfit.lexemes[:misfit.index]]
    if kinds[-1:] == ['SATISFY'] and found.type in _TIMINGS and not _is_compared(misfit):
        _refuse_misplaced_timing(misfit)
    if 'SHALL' not in kinds or 'SATISFY' not in kinds or 'INFIX' not in misfit.fitting:
        return
    if found.type in _TIMINGS:
        _refuse_late_timing(misfit, kinds)
    if found.type in ('WHEN', 'IF', 'UNLESS', 'QUALIFIER') and not _QUALIFIERS & set(kinds):
        whole = misfit.text.value
        sentence = f'{whole[found.start:].strip()} {whole[:found.start].strip()}'
        refuse('the condition must come before the component', found.span, 'after the response',
               _to_write(misfit, sentence))


def _is_compared(misfit: Misfit) -> bool:
    """Whether an operator follows, so that the word is meant as a name."""
    following = misfit.lexemes[misfit.index + 1:misfit.index + 2]
    return any(item.type in ('RELATION', 'INFIX', 'MINUS') for item in following)


def _refuse_misplaced_timing(misfit: Misfit) -> NoReturn:
    """Refuse `satisfy always p`."""
    found, whole, lexemes = misfit.found, misfit.text.value, misfit.lexemes
    end = misfit.index + (1 if found.type == 'PLAIN' else 3)
    kinds = [item.type for item in lexemes[misfit.index:end]]
    help_ = misfit.example
    if kinds in (['PLAIN'], ['SPAN', 'NUMBER', 'UNIT']) and end < len(lexemes):
        satisfy, response = lexemes[misfit.index - 1].start, lexemes[end].start
        help_ = _to_write(misfit, f'{whole[:satisfy]}{whole[found.start:response].strip()} '
                                  f'satisfy {whole[response:]}')
    refuse("the timing must come before 'satisfy'", found.span, "after 'satisfy'", help_)


def _refuse_late_timing(misfit: Misfit, kinds: Sequence[str]) -> NoReturn:
    found, whole = misfit.found, misfit.text.value
    shall, satisfy = kinds.index('SHALL'), kinds.index('SATISFY')
    earlier = next((lexeme for lexeme in misfit.lexemes[shall:satisfy]
                    if lexeme.type in _TIMINGS), None)
    if earlier is not None:
        refuse('a sentence can have only one timing', found.span,
               f"'{misfit.written(earlier)}' is already given",
               'write a separate requirement for the second one')
    before = misfit.lexemes[satisfy].start
    sentence = (f'{whole[:before]}{whole[found.start:].strip()} '
                f'{whole[before:found.start].strip()}')
    refuse("the timing must come before 'satisfy'", found.span, 'after the response',
           _to_write(misfit, sentence))


def _to_write(misfit: Misfit, sentence: str) -> str:
    """Return the advice to write the corrected sentence; an example if more is misplaced."""
    rest = {lexeme.type for lexeme in misfit.lexemes[misfit.index + 1:]}
    if rest & (_TIMINGS | _QUALIFIERS | _PLACES) or len(sentence) > _LONGEST:
        return misfit.example
    return f"write {' '.join(sentence.split())}"


# Common mistakes

def _check_known_slips(misfit: Misfit) -> None:
    found = misfit.found
    if found.type == 'FOREIGN':
        title = (f"unexpected '{found.text}'" if found.text in '.;' else
                 f"'{found.text}' is not FRETish")
        refuse(title, found.span, _expectation(misfit, misfit.fitting),
               _FOREIGN.get(found.text, ''))
    if found.type in _SYMBOLS and _in_expression(misfit):
        refuse(f"'{misfit.written(found)}' cannot join expressions in FRETish", found.span,
               _expectation(misfit, misfit.fitting), f'write {_SYMBOLS[found.type]}')
    if found.type == 'THEN':
        refuse("unexpected 'then'", found.span, _expectation(misfit, misfit.fitting),
               'leave it out: if p the COMPONENT shall ... satisfy q')
    if found.type == 'NEGATION':
        refuse("unexpected 'not'", found.span, _expectation(misfit, misfit.fitting),
               _negated_response(misfit) or 'write when not in m mode, or except in m mode')
    _check_operators(misfit)


def _negated_response(misfit: Misfit) -> str:
    """Return what to write for `shall always not satisfy p`; '' for any other `not`."""
    before = misfit.before
    if before is None or 'SATISFY' not in misfit.fitting:
        return ''
    if before.text in ('shall', 'always'):
        return 'write shall never satisfy p, or shall always satisfy !p'
    return 'negate the response: satisfy !p'


def _in_expression(misfit: Misfit) -> bool:
    return bool({'INFIX', 'NUMBER'} & misfit.fitting) and 'UNIT' not in misfit.fitting


def _check_operators(misfit: Misfit) -> None:
    found, before = misfit.found, misfit.before
    if found.type == 'RELATION' and before is not None and before.type == 'RELATION':
        refuse('an operand is missing between two comparisons', found.span,
               f"after '{before.text}'", 'the comparisons are < <= = != >= >')
    for lexeme in (found, before):
        if lexeme is None or lexeme.type != 'NAME' or 'INFIX' not in misfit.fitting:
            continue
        advice = _OPERATORS.get(lexeme.text) or _OPERATORS.get(lexeme.text.lower())
        if advice is not None:
            refuse(f"'{misfit.written(lexeme)}' is not an operator of FRETish", lexeme.span,
                   'not in this language', advice)


def _check_duration(misfit: Misfit) -> None:
    """Refuse `within 10 satisfy`."""
    number = misfit.before
    if (number is None or number.type != 'NUMBER' or 'UNIT' not in misfit.fitting
            or misfit.found.type not in ('SATISFY', 'COMMA', END)):
        return
    written = misfit.written(number)
    help_ = (f'write a time, such as {written} milliseconds or {written} seconds'
             if misfit.is_timed else f'write {written} ticks for steps, or one of ticks, {_TIMES}')
    refuse('a duration needs a unit', number.span, 'this number has none', help_)


def _check_units(misfit: Misfit) -> None:
    """Refuse units of numbers, and durations of conditions: `when p for 3 seconds`."""
    for index, fitting in ((misfit.index, misfit.fitting), (misfit.index - 1, misfit.earlier)):
        if 'INFIX' in fitting and index > 0:
            check_unit(misfit.text, misfit.lexemes, index, TIME_UNITS)
    found, following = misfit.found, misfit.lexemes[misfit.index + 1:misfit.index + 3]
    kinds = [item.type for item in following]
    if (found.text in ('for', 'within') and found.type == 'SPAN' and kinds == ['NUMBER', 'UNIT']
            and {'INFIX', 'SHALL'} <= misfit.fitting):
        time = ' '.join(map(misfit.written, following))
        function = 'persisted' if found.text == 'for' else 'occurred'
        refuse('a condition has no timing', found.span, 'not allowed here',
               f'write {function}({time}, p), p the condition')
    if found.type == 'NUMBER' and misfit.before is not None and misfit.before.type == 'UNIT' and (
            kinds[:1] == ['UNIT']):
        refuse('a duration is one number with one unit', found.span, 'a second number',
               'add them up, as in 1300 milliseconds for 1 second and 300 milliseconds')


def _check_brackets(misfit: Misfit) -> None:
    found, opened = misfit.found, open_brackets(misfit.lexemes[:misfit.index])
    if found.type == 'RPAR' and not opened:
        refuse("')' is unmatched", found.span, 'no bracket is open here')
    if opened and 'RPAR' in misfit.fitting and (found.type == END or _is_word(found)):
        refuse("'(' is not closed", opened[-1].span, 'opened here',
               f"a ')' is missing before '{misfit.written(found)}'"
               if found.type != END else '')


# Misspelled words

def _meant(misfit: Misfit) -> tuple[Lexeme, str] | None:
    """Return the misspelled lexeme, and the word that was meant."""
    found, before = misfit.found, misfit.before
    if found.type == 'NAME' and (word := _closest(found.text, misfit.fitting, misfit.is_timed)):
        return found, word
    if before is not None and before.type == 'NAME' and (
            word := _closest(before.text, misfit.earlier, misfit.is_timed)):
        return before, word
    return None


def _closest(name: str, fitting: frozenset[str], is_timed: bool) -> str | None:
    words = [word for word, kind in WORDS.items() if kind in fitting
             and not (is_timed and word in ('tick', 'ticks'))]
    if 'TIMEPOINT' in fitting and name.lower() in _POINTS:
        return 'timepoint'
    meant = _MEANT.get(name.lower())
    if meant in words:
        return meant
    if len(name) > 40:
        return None
    close = get_close_matches(name.lower(), words, n=1, cutoff=0.7 if len(name) > 3 else 0.8)
    return close[0] if close else None


def _help(misfit: Misfit) -> str:
    found = misfit.found
    at = [lexeme for lexeme in misfit.lexemes[max(0, misfit.index - 3):misfit.index]
          if lexeme.type == 'AT']
    if at and {'THE', 'TIMEPOINT', 'WHICH'} & misfit.fitting:
        return f"did you mean 'at the {_point(misfit)} timepoint'?"
    if found.type in _PLACES and any(lexeme.type in _QUALIFIERS for lexeme in
                                     misfit.lexemes[:misfit.index]):
        return 'the scope comes first: in m mode when p the COMPONENT shall ...'
    if _is_article(misfit):
        first, second = map(misfit.written, misfit.lexemes[misfit.index + 1:misfit.index + 3])
        is_two = misfit.lexemes[misfit.index + 2].type == 'NAME'
        return (f'leave it out; a name is one word, such as {first}_{second}' if is_two
                else f'leave it out: write {first}')
    if found.type == 'THE' and _wants_operand(misfit):
        return misfit.example
    if _is_word(found) and _wants_operand(misfit):
        return _quoted_name(misfit)
    if 'SHALL' in misfit.fitting or {'THE', 'NAME'} <= misfit.fitting:
        return misfit.example
    if 'SATISFY' in misfit.fitting and found.type == 'NAME':
        return _verb_help(misfit)
    if misfit.fitting <= {'SATISFY', 'COMMA'} and found.type in OPERAND_STARTS:
        return f'write satisfy before {misfit.written(found)}'
    if 'NUMBER' in misfit.fitting and 'LPAR' not in misfit.fitting:
        return _number_help(misfit)
    return ''


def _verb_help(misfit: Misfit) -> str:
    """Return what to write for `shall keep x < 1` and `shall stop within 3 seconds`."""
    word, text = misfit.written(misfit.found), misfit.text.value
    after = misfit.lexemes[misfit.index + 1:]
    if after and after[0].type in OPERAND_STARTS:
        return f'write satisfy in place of {word}'
    if not misfit.fitting <= {'SATISFY', 'COMMA'} or not after:
        timing = text[after[0].start:].strip() if after else ''
        before = text[:misfit.found.start].strip()
        return 'say what holds: ' + ' '.join(filter(None, (before, timing, 'satisfy', word)))
    return f'write satisfy before {word}'


def _number_help(misfit: Misfit) -> str:
    """Return what to write for `within three seconds` and `within "3 seconds"`."""
    found = misfit.found
    if TIME.fullmatch(found.text):
        return f'write it without quotes: {short(found.text)}'
    following = misfit.lexemes[misfit.index + 1:misfit.index + 2]
    unit = next((item.text for item in following if item.type == 'UNIT'),
                'seconds' if misfit.is_timed else 'ticks')
    number = _DIGITS.get(found.text.lower(), '3')
    return f'write the number in digits, as FRET requires: {number} {unit}'


def _quoted_name(misfit: Misfit) -> str:
    """Return the advice to write a keyword in quotes, with the comparison that it begins."""
    name = f'"{misfit.written(misfit.found)}"'
    following = misfit.lexemes[misfit.index + 1:misfit.index + 3]
    if [item.type for item in following] in (['RELATION', 'NAME'], ['RELATION', 'NUMBER']):
        help_ = f"write {' '.join([name, *map(misfit.written, following)])} if it is a name"
    else:
        help_ = f'write {name}, in quotes, if it is a name'
    start = misfit.text.span.start
    is_in_quotes = misfit.text.source.text[max(start - 1, 0):start] == '"'
    return f'{help_}, and put the sentence in single quotes' if is_in_quotes else help_


def _point(misfit: Misfit) -> str:
    near = misfit.lexemes[max(0, misfit.index - 3):misfit.index + 2]
    return next((item.text for item in near if item.type in ('WHICH', 'NEXT')), 'next')


def _expectation(misfit: Misfit, fitting: frozenset[str]) -> str:
    units = _TIMES if misfit.is_timed else f'ticks, {_TIMES}'
    unit = 'seconds' if misfit.is_timed else 'ticks'
    shown = [phrase.replace('UNITS', units).replace('UNIT', unit) for phrase in _phrases(fitting)]
    if not shown:
        return 'not allowed here'
    return 'expected ' + ' or '.join([', '.join(shown[:-1]), shown[-1]] if shown[1:] else shown)


def _phrases(fitting: frozenset[str]) -> Iterator[str]:
    # After an operand, a name or a bracket does not mean that an expression fits.
    left = fitting - {'LPAR'} if 'INFIX' in fitting else fitting
    for kinds, phrase in _EXPECTATIONS:
        if kinds <= left:
            left -= kinds.union(*(_IMPLIED.get(kind, ()) for kind in kinds))
            yield phrase
