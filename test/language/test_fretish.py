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


"""The reader of FRETish: every part of a sentence, and any text in bounded time."""

from pathlib import Path
from random import Random
import time

from fret_monitor.elaboration.formalize import formalize
from fret_monitor.language.expression import (
    Boolean, Call, Expression, Infix, Name, Number, postorder, Prefix, Unit,
)
from fret_monitor.language.fretish import parse_fretish, parse_fretish_expression
from fret_monitor.language.fretish_words import OPERATORS, WORDS
from fret_monitor.language.sentence import Sentence
from fret_monitor.model.diagnostics import CompileError, Source, Text
import golden
from hypothesis import given
from hypothesis import strategies as st
import pytest
from strategies import some


def text_of(sentence: str) -> Text:
    return Text.whole(Source('<sentence>', sentence))


def parse(sentence: str) -> Sentence:
    return parse_fretish(text_of(sentence))


def error(sentence: str) -> CompileError:
    with pytest.raises(CompileError) as caught:
        formalize(parse_fretish(text_of(sentence)))
    return caught.value


def shown(root: Expression) -> str:
    """Return an expression with all parentheses."""
    done: dict[Expression, str] = {}
    for node in postorder(root):
        match node:
            case Name() | Number():
                done[node] = node.text
            case Boolean():
                done[node] = str(node.value)
            case Prefix():
                done[node] = f'({node.operator}{done[node.argument]})'
            case Infix():
                done[node] = f'({done[node.left]} {node.operator} {done[node.right]})'
            case Call():
                done[node] = f'{node.function}({", ".join(done[it] for it in node.arguments)})'
            case _:
                raise AssertionError(node)
    return done[root]


def response(expression: str) -> str:
    return shown(parse(f'the sw shall always satisfy {expression}').response)


# Parts

@pytest.mark.parametrize(('phrase', 'kind'), [
    ('in m mode', 'in'), ('in mode m', 'in'), ('in m', 'in'), ('during m,', 'in'),
    ('when in m mode', 'in'), ('if in m', 'in'), ('while m', 'in'), ('WHILE m,', 'in'),
    ('when not in m mode', 'notin'), ('if not in m', 'notin'), ('unless in m', 'notin'),
    ('except in m', 'notin'), ('except during m', 'notin'), ('except when in m', 'notin'),
    ('except if in m', 'notin'), ('except while m', 'notin'),
    ('only in m mode', 'onlyIn'), ('only during m', 'onlyIn'), ('only when in m', 'onlyIn'),
    ('only if in mode m', 'onlyIn'), ('only while m', 'onlyIn'),
    ('before m', 'before'), ('before mode m', 'before'), ('only before m mode', 'onlyBefore'),
    ('after m', 'after'), ('after m mode,', 'after'), ('only after m', 'onlyAfter'), ('', 'null'),
])
def test_each_scope_is_read(phrase: str, kind: str) -> None:
    sentence = parse(f'{phrase} the sw shall always satisfy r')
    assert sentence.scope_kind.value == kind
    assert sentence.scope is None or shown(sentence.scope.mode) == 'm'


@pytest.mark.parametrize('place', ['while', 'after', 'before', 'only while', 'only after',
                                   'only before', 'except while'])
def test_scopes_of_time_take_expressions(place: str) -> None:
    scope = parse(f'{place} p & x > 3 the sw shall always satisfy r').scope
    assert scope is not None
    assert shown(scope.mode) == '(p & (x > 3))'
    assert not scope.is_named


@pytest.mark.parametrize(('phrase', 'kind', 'expression'), [
    ('upon p', 'regular', 'p'), ('when p', 'regular', 'p'), ('where p,', 'regular', 'p'),
    ('if p', 'regular', 'p'), ('whenever p', 'holding', 'p'), ('unless p', 'regular', '(!p)'),
    ('and when p', 'regular', 'p'), ('when p is true', 'regular', 'p'),
    ('when p & q is FALSE', 'regular', '(!(p & q))'), ('unless p is False', 'regular', 'p'),
    ('when p and if q', 'regular', '(p & q)'), ('when p, if q,', 'regular', '(p & q)'),
    ('when p or if q', 'regular', '(p | q)'), ('when p, or if q', 'regular', '(p | q)'),
    ('when p unless q', 'regular', '(p & (!q))'),
    ('when p or if q and when r', 'regular', '((p | q) & r)'),
    ('whenever p and whenever q', 'holding', '(p & q)'),
    ('whenever p when q', 'regular', '(p & q)'), ('when p whenever q', 'regular', '(p & q)'),
    ('when if p then q', 'regular', '(p -> q)'),
])
def test_each_condition_is_read(phrase: str, kind: str, expression: str) -> None:
    for scope in ('', 'in m mode ', 'in m, '):
        condition = parse(f'{scope}{phrase} the sw shall immediately satisfy s').condition
        assert condition is not None
        assert condition.kind.value == kind
        assert shown(condition.expression) == expression


@pytest.mark.parametrize(('phrase', 'kind'), [
    ('', 'null'), ('immediately', 'immediately'), ('initially', 'immediately'),
    ('at the first timepoint', 'immediately'), ('at the same timepoint', 'immediately'),
    ('at the next timepoint', 'next'), ('at the last timepoint', 'finally'),
    ('finally', 'finally'), ('eventually', 'eventually'), ('always', 'always'),
    ('never', 'never'), ('until p & q', 'until'), ('before p', 'before'),
    ('within 3 ticks', 'within'), ('for 3 seconds', 'for'), ('after 3 hours', 'after'),
])
def test_each_timing_is_read_with_and_without_commas(phrase: str, kind: str) -> None:
    for written in (phrase, f', {phrase},', f', {phrase}', f'{phrase} ,') if phrase else ('',):
        assert parse(f'the sw shall {written} satisfy r').timing_kind.value == kind


@pytest.mark.parametrize(('words', 'unit'), [
    ('tick ticks Ticks', Unit.TICK),
    ('microsec microsecs microsecond microseconds', Unit.MICROSECOND),
    ('millisec millisecs MILLISEC millisecond milliseconds', Unit.MILLISECOND),
    ('sec secs second seconds', Unit.SECOND), ('minute minutes', Unit.MINUTE),
    ('hour hours', Unit.HOUR),
])
def test_each_unit_is_read(words: str, unit: Unit) -> None:
    for word in words.split():
        timing = parse(f'the sw shall within 5 {word} satisfy r').timing
        assert timing is not None and timing.duration is not None
        assert (timing.duration.number, timing.duration.unit) == ('5', unit)


def test_a_unit_may_touch_its_number() -> None:
    assert parse('the sw shall within 3seconds satisfy r').key == 'null,null,within'
    assert "did you mean '3 seconds'?" in str(error('the sw shall within 3s satisfy r'))
    assert 'not a number' in str(error('the sw shall always satisfy x > 3x'))


@pytest.mark.parametrize('sentence', [
    'when p the sw shall always satisfy r', 'when p shall the sw always satisfy r',
    'when p sw shall always satisfy r.', 'the sw when p shall always satisfy r',
    'the sw, when p, shall always satisfy r', 'WHEN p THE sw SHALL ALWAYS SATISFY r .',
    '  when\tp\n the sw\n\nshall always satisfy r  ',
])
def test_the_component_may_come_before_or_after_the_condition(sentence: str) -> None:
    found = parse(sentence)
    assert found.key == 'null,regular,always'
    assert found.component.name == 'sw'
    assert shown(found.response) == 'r'


def test_parts_know_their_places() -> None:
    text = 'in m mode when p & q the sw shall within 3 ticks satisfy x > 3.'
    sentence = parse(text)
    assert sentence.scope and sentence.condition and sentence.timing and sentence.timing.duration
    spans = (sentence.scope.span, sentence.condition.span, sentence.component.span,
             sentence.timing.span, sentence.timing.duration.span, sentence.response.span)
    assert [text[span.start:span.end] for span in spans] == [
        'in m mode', 'when p & q', 'sw', 'within 3 ticks', '3 ticks', 'x > 3']


# Expressions

@pytest.mark.parametrize(('written', 'read'), [
    ('p & q | r', '((p & q) | r)'), ('p -> q -> r', '(p -> (q -> r))'),
    ('p <-> q -> r', '(p <-> (q -> r))'), ('p <=> q <=> r', '((p <-> q) <-> r)'),
    ('p xor q | r', '(p xor (q | r))'), ('! x > 3', '(!(x > 3))'), ('~p & q', '((!p) & q)'),
    ('x-3>0', '((x - 3) > 0)'), ('x -3 > 0', '((x - 3) > 0)'), ('x - -3 > 0', '((x - (-3)) > 0)'),
    ('x ^ 2 ^ y > 0', '((x ^ (2 ^ y)) > 0)'), ('-x ^ 2 > 0', '((-(x ^ 2)) > 0)'),
    ('-3 ^ 2 > x', '(((-3) ^ 2) > x)'), ('x / y * z mod 3 > 0', '((((x / y) * z) mod 3) > 0)'),
    ('p = TRUE', '(p = True)'), ('False', 'False'), ('if p then q', '(p -> q)'),
    ('if p & q then r | s', '((p & q) -> (r | s))'),
    ('if p then if q then r', '(p -> (q -> r))'), ('(if p then q) & r', '((p -> q) & r)'),
    ('p & if q then r', '((p & q) -> r)'), ('!if p then q', '((!p) -> q)'),
    ('if p then q <-> r', '((p -> q) <-> r)'),
    ('at the previous occurrence of p, q & r', 'prevOcc(p, (q & r))'),
    ('FTP => p', '(FTP -> p)'), ('a.b > c%d', '(a.b > c%d)'), ('"hello world" > 3.5e-2',
                                                               '(hello world > 3.5e-2)'),
    ('"mode" = "next"', '(mode = next)'), ('absReal(x - y) < 0.1', '(absReal((x - y)) < 0.1)'),
    ('foo()', 'foo()'),
])
def test_expressions_bind_as_in_fret(written: str, read: str) -> None:
    assert response(written) == read


@pytest.mark.parametrize('written', [
    'p & if q then r', '!if p then q', 'if p then q <-> r', 'if p -> q then r'])
def test_an_if_that_fret_splits_gets_a_warning(written: str) -> None:
    (remark,) = parse(f'the sw shall always satisfy {written}').remarks
    assert remark.span is not None
    assert remark.span.column == 29 + written.index('if')


@pytest.mark.parametrize('written', [
    'if p then q', 'if p & q then r | s', 'if (p) then q', 'if ((p) -> q) then r', 'if !p then q',
    'if p then (q <-> r)', 'p & (if q then r)', 'if p then if q then r',
    '(if p then q) <-> r', 'if p then q -> r'])
def test_an_if_that_fret_does_not_split_gets_no_warning(written: str) -> None:
    assert parse(f'the sw shall always satisfy {written}').remarks == ()


def test_an_expression_alone_is_no_sentence() -> None:
    assert shown(parse_fretish_expression(text_of('p & if q then r'))) == '((p & q) -> r)'
    with pytest.raises(CompileError):
        parse_fretish_expression(text_of('the sw shall satisfy r'))


# Errors

@pytest.mark.parametrize('case', golden.cases('fretish', '.fretish'), ids=lambda path: path.stem)
def test_errors_say_where_and_what_to_write(case: Path) -> None:
    sentences = case.read_text(encoding='utf-8').rstrip('\n').split('\n')
    golden.check(case, '\n\n'.join(str(error(sentence)) for sentence in sentences) + '\n')


def test_a_step_is_a_tick_or_a_timepoint() -> None:
    assert "did you mean '3 ticks'?" in str(error('the sw shall within 3 step satisfy r'))
    assert "did you mean 'timepoint'?" in str(error('the sw shall at the next step satisfy r'))


def test_an_empty_text_is_refused_with_an_example() -> None:
    for text in ('', '  \n ', '.', ' . '):
        assert 'the sentence is empty' in str(error(text))


# Any text

def check_any(text: str) -> None:
    try:
        formalize(parse_fretish(text_of(text)))
    except CompileError as refused:
        for item in refused.diagnostics:
            assert item.span is not None
            assert 0 <= item.span.start <= item.span.end <= len(text)


PIECES = [*WORDS, *OPERATORS, 'p', 'q', 'sw', 'x', '3', '1.5', 'persisted', '"a b"', '\n', '"']


@given(st.lists(st.sampled_from(PIECES), max_size=30).map(' '.join))
def test_words_in_any_order_are_a_sentence_or_an_error_at_a_place(text: str) -> None:
    check_any(text)


@given(st.text(max_size=80))
def test_any_text_is_a_sentence_or_an_error_at_a_place(text: str) -> None:
    check_any(text)
    check_any(f'the sw shall always satisfy {text}')


def test_a_sentence_with_one_word_changed_is_a_sentence_or_an_error_at_a_place() -> None:
    rng = Random(7)
    words = ('in m mode , when p & q is false or if x > 3 , the sw shall , within 3 ticks , '
             'satisfy if persisted ( 3 , p ) then x + 2 * y > 3 .').split()
    for _ in range(400):
        changed = list(words)
        place = rng.randrange(len(words))
        changed[place:place + rng.choice((0, 1))] = rng.choices(PIECES, k=rng.choice((0, 1, 2)))
        check_any(' '.join(changed))


LONG = 30_000


@pytest.mark.parametrize('text', some([
    'the ' * (LONG // 4), '(' * LONG, 'if ' * (LONG // 3), '! ' * (LONG // 2),
    'when p ' * (LONG // 7), 'p' * LONG, '"' * LONG, '. ' * (LONG // 2), '3' * LONG,
    'the sw shall always satisfy ' + '(' * LONG,
    'the sw shall always satisfy ' + 'if p then ' * (LONG // 10),
    'the sw shall always satisfy ' + 'p & ' * (LONG // 4),
    'the sw shall always satisfy ' + 'x + ' * (LONG // 4) + '1 > ' * 100,
    f'the sw shall within {"9" * LONG} ticks satisfy r', 'a ' * (LONG // 2),
], 3))
def test_garbage_of_many_characters_is_refused_in_time(text: str) -> None:
    before = time.process_time()
    with pytest.raises(CompileError):
        formalize(parse_fretish(text_of(text)))
    assert time.process_time() - before < 6


@pytest.mark.parametrize('text', some([
    'the sw shall always satisfy ' + '(' * 15_000 + 'p' + ')' * 15_000,
    'the sw shall always satisfy ' + 'if p then ' * 5_000 + 'q',
    'the sw shall always satisfy ' + '!' * 20_000 + 'p',
    'the sw shall always satisfy ' + 'p & ' * 10_000 + 'q',
    'when p ' + 'or if q ' * 8_000 + 'the sw shall eventually satisfy r',
], 2))
def test_long_and_deep_sentences_are_formalised_in_time(text: str) -> None:
    before = time.process_time()
    assert formalize(parse_fretish(text_of(text)))
    assert time.process_time() - before < 10


def test_a_formula_that_explodes_as_text_is_refused() -> None:
    nested = 'p'
    for _ in range(40):
        nested = f'prevOcc({nested}, q)'
    assert 'too long' in str(error(f'the sw shall always satisfy {nested}'))
