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

"""Tests of the reader of past-time MTL in FRET's SMV syntax."""

from pathlib import Path
import re
import subprocess
import sys

import facts
from fret_monitor.language.expression import Infix, Name, Number, postorder, Prefix
from fret_monitor.language.smv import parse_smv, RESERVED
from fret_monitor.model.diagnostics import CompileError, Source, Text
import golden
from hypothesis import given
from hypothesis import strategies as st
import pytest
from strategies import some
from trees import (
    check_infix, check_places, garbage, in_time, refusal, show, text, written,
)

# Operators in docs/language.md, the tightest first; '-' is the sign, '^' is right-associative.
INFIX = (('^',), ('*', '/', 'mod'), ('+', '-'), ('<', '<=', '=', '!=', '>', '>='),
         ('S', 'T', 'SI'), ('&',), ('|',), ('xor',), ('->',), ('<->',))
FROM_RIGHT = ('^', '->')
LEVEL = {operator: level for level, group in enumerate(INFIX) for operator in group}


def read(formula: str) -> str:
    return show(parse_smv(text(formula)))


def error(formula: str | Text) -> CompileError:
    return refusal(parse_smv, formula)


def place(formula: str) -> tuple[int, int]:
    span = error(formula).diagnostics[0].span
    assert span is not None
    return span.start, span.end


@pytest.mark.parametrize('first', LEVEL)
def test_of_two_infix_operators_the_tighter_one_takes_the_operand_between(first: str) -> None:
    check_infix(parse_smv, first, LEVEL, FROM_RIGHT, {})


@pytest.mark.parametrize('prefix', ['!', 'H', 'O', 'Y', 'Z'])
def test_a_prefix_operator_takes_arithmetic_and_comparisons_and_no_more(prefix: str) -> None:
    for infix, level in LEVEL.items():
        reaches = level <= LEVEL['<']
        assert read(f'{prefix} a {infix} b') == (
            f'({prefix} (a {infix} b))' if reaches else f'(({prefix} a) {infix} b)')


@pytest.mark.parametrize('infix', LEVEL)
def test_a_sign_takes_a_power_and_no_more(infix: str) -> None:
    expected = '(- (a ^ b))' if infix == '^' else f'((- a) {infix} b)'
    assert read(f'-a {infix} b') == expected


@pytest.mark.parametrize(('formula', 'tree'), [
    ('! x > 5', '(! (x > 5))'),
    ('H p & q', '((H p) & q)'),
    ('H O ! p S q', '((H (O (! p))) S q)'),
    ('p = ! q', '(p = (! q))'),
    ('p = ! q & r', '((p = (! q)) & r)'),
    ('p S H[0,3] q | r', '((p S (H[0,3] q)) | r)'),
    ('x ^ -y * z', '((x ^ (- y)) * z)'),
    ('x - -3 > 0', '((x - (- 3)) > 0)'),
    ('x-3>0', '((x - 3) > 0)'),
    ('x -3 > 0', '((x - 3) > 0)'),
    ('- -3 < x', '((- (- 3)) < x)'),
    ('x / y * z mod 3', '(((x / y) * z) mod 3)'),
    ('((p))', 'p'),
    ('f() & g(x, p & q, -1)', '(f() & g(x, (p & q), (- 1)))'),
    ('H f(x)', '(H f(x))'),
    ('H(p)', '(H p)'),
    ('TRUE & false | tRuE', '((True & False) | True)'),
    ('FTP -> p', '(FTP -> p)'),
])
def test_a_formula_has_the_documented_tree(formula: str, tree: str) -> None:
    assert read(formula) == tree


@pytest.mark.parametrize(('formula', 'tree'), [
    ('(-3 ^ 2)', '((- 3) ^ 2)'),
    ('x * -3 ^ 2', '(x * ((- 3) ^ 2))'),
    ('(- (3 ^ 2))', '(- (3 ^ 2))'),
    ('- 3 ^ 2', '(- (3 ^ 2))'),
    ('-x ^ 2', '(- (x ^ 2))'),
    ('x -3 ^ 2', '(x - (3 ^ 2))'),
    ('x - 3 ^ 2', '(x - (3 ^ 2))'),
    ('f(2)-3 ^ 2', '(f(2) - (3 ^ 2))'),
])
def test_the_sign_that_touches_a_number_belongs_to_it_as_in_fret(formula: str, tree: str) -> None:
    assert read(formula) == tree


@pytest.mark.parametrize(('spelled', 'tree'), [
    ('p => q', '(p -> q)'), ('p <=> q', '(p <-> q)'), ('p && q', '(p & q)'),
    ('p || q', '(p | q)'), ('x == y', '(x = y)'), ('~p', '(! p)'), ('p XOR q', '(p xor q)'),
    ('x Mod y', '(x mod y)'), ('p &lt;-&gt; q', '(p <-> q)'), ('p -&gt; q', '(p -> q)'),
    ('x &lt;= 3 &amp; y &gt; 2', '((x <= 3) & (y > 2))'), ('p &amp;&amp; q', '(p & q)'),
])
def test_spellings_of_other_tools_are_accepted(spelled: str, tree: str) -> None:
    assert read(spelled) == tree


@pytest.mark.parametrize(('bound', 'tree'), [
    ('[0,10]', '[0,10]'), ('[ 3 , 3 ]', '[3,3]'), ('[<5]', '[<5]'), ('[<=5]', '[<=5]'),
    ('[=5]', '[=5]'), ('[==5]', '[=5]'), ('[>=5]', '[>=5]'), ('[>5]', '[>5]'),
    ('[0,-1]', '[0,-1]'), ('[0,10-1]', '[0,9]'), ('[<10 + 1]', '[<11]'), ('[<2.0]', '[<2.0]'),
    ('[(1+2)*3, 99999999999]', '[9,99999999999]'), ('[=<b><i>10</i></b>]', '[=10]'),
    ('[<<b><i>10</i></b>]', '[<10]'), ('[0, -(2-1)]', '[0,-1]'), ('[0,n]', '[0,n]'),
    ('[<= n]', '[<=n]'), ('[n-1, 2*n+1]', '[(n - 1),((2 * n) + 1)]'),
])
@pytest.mark.parametrize('operator', ['H', 'O', 'S', 'SI', 'T'])
def test_every_form_of_bound_is_read_on_every_operator_that_has_one(
        operator: str, bound: str, tree: str) -> None:
    if operator in ('H', 'O'):
        assert read(f'{operator}{bound} p') == f'({operator}{tree} p)'
    else:
        assert read(f'p {operator}{bound} q') == f'(p {operator}{tree} q)'


def test_a_bound_and_its_operator_have_places() -> None:
    node = parse_smv(text('p | (q S[<3] r)'))
    assert isinstance(node, Infix) and isinstance(node.right, Infix)
    assert node.right.bound is not None
    assert written(node.right.bound.span) == '[<3]'
    assert written(node.right.operator_span) == 'S[<3]'
    assert written(node.right.span) == '(q S[<3] r)'
    assert written(node.span) == 'p | (q S[<3] r)'


def test_every_node_has_the_place_where_it_was_written() -> None:
    tree = parse_smv(text('H (abs(x) > -1.5) & ! "a b"'))
    assert [written(node.span) for node in postorder(tree)] == [
        'x', 'abs(x)', '1.5', '-1.5', '(abs(x) > -1.5)', 'H (abs(x) > -1.5)', '"a b"',
        '! "a b"', 'H (abs(x) > -1.5) & ! "a b"']


@pytest.mark.parametrize('number', ['0', '15', '1.5', '1e3', '3.5e-2', '.5', '0.0', '1E+9',
                                    '9' * 5000])
def test_a_number_is_kept_as_written(number: str) -> None:
    node = parse_smv(text(number))
    assert isinstance(node, Number)
    assert node.text == number


@pytest.mark.parametrize('number', ['03', '5.', '10s', '0x1F', '1_000', '1e', '1.5.2', '1.e3'])
def test_a_malformed_number_is_refused_as_a_whole(number: str) -> None:
    assert place(f'x > {number} & p') == (4, 4 + len(number))


@pytest.mark.parametrize(('formula', 'name'), [
    ('a.b', 'a.b'), ('a_DOT_b', 'a_DOT_b'), ('c%d', 'c%d'), ('$x', '$x'), ('_x9', '_x9'),
    ('"hello world"', 'hello world'), (r'"say \"a\\b\""', r'say "a\b"'), ('Sx', 'Sx'),
    ('xor1', 'xor1'), ('Hp', 'Hp'), ('"H"', 'H'), ('TRUEish', 'TRUEish'), ('"größe"', 'größe'),
])
def test_a_name_is_an_identifier_of_fret(formula: str, name: str) -> None:
    node = parse_smv(text(formula))
    assert isinstance(node, Name)
    assert node.text == name


@pytest.mark.parametrize('word', sorted(RESERVED - {'FTP', 'SI', 'TT', 'YtoPre', 'ZtoPre'}))
def test_a_reserved_word_is_no_name(word: str) -> None:
    if re.fullmatch('true|false', word, re.IGNORECASE):
        assert read(word) in ('True', 'False')
    elif word in ('OT', 'HT', 'ST', 'SIT'):
        error(f'{word}(p)')
    else:
        error(word)


def test_an_old_export_of_fret_is_read_without_its_tags_and_keeps_its_places() -> None:
    formula = '(<b><i>mode</i></b> & (O[=<b><i>10</i></b>] <b><i>(( p ))</i></b>))'
    tree = parse_smv(text(formula))
    assert show(tree) == '(mode & (O[=10] p))'
    names = [node for node in postorder(tree) if isinstance(node, Name)]
    assert [(node.span.start, written(node.span)) for node in names] == [
        (formula.index('mode'), 'mode'), (formula.index('p ))'), 'p')]


def test_without_a_closing_tag_angle_brackets_compare() -> None:
    assert 'chained' in str(error('x <b> y'))


def test_places_are_those_of_the_file_where_yaml_has_folded_the_text() -> None:
    source = Source('bundle.yaml', 'ptltl: >-\n  H (p\n  & )\n')
    start = source.text.index('H')
    offsets = [*range(start, start + 4), *range(start + 6, start + 11)]
    folded = Text('H (p & )', source, offsets)
    span = error(folded).diagnostics[0].span
    assert span is not None
    assert (span.line, span.column) == (3, 5)


@pytest.mark.parametrize(('formula', 'start'), [
    ('p \x07', 2), ('p \x00& q', 2), ('p\u00a0& q', 1), ('\ufeffp', 0), ('p \u2227 q', 2),
    ('x \u2264 3', 2), ('p & \U0001f600', 4), ('größe > 1', 2), ('p &\u2028q', 3),
    ('"a\x00b"', 0), ('p\ud800', 1),
])
def test_an_invalid_character_is_reported_with_its_place(formula: str, start: int) -> None:
    assert place(formula)[0] == start


def test_an_unexpected_end_is_just_after_the_last_word() -> None:
    assert place('p &   ') == (3, 3)
    assert place('   ') == (0, 3)


def test_an_open_bracket_is_reported_at_its_place() -> None:
    assert place('(p & (q | r)') == (0, 1)
    assert place('O[0,3') == (1, 2)
    assert place('(p] & q') == (0, 1)


@pytest.mark.parametrize('case', golden.cases('formula', '.smv'), ids=lambda path: path.stem)
def test_errors_say_what_is_wrong_and_what_to_write(case: Path) -> None:
    formulas = case.read_text(encoding='utf-8').rstrip('\n').split('\n')
    golden.check(case, '\n\n'.join(str(error(formula)) for formula in formulas) + '\n')


DEEP = 8_000


@pytest.mark.parametrize(('formula', 'nodes'), some([
    ('H[0,3] ' * DEEP + 'p', DEEP + 1),
    ('(! ' * DEEP + 'p' + ')' * DEEP, DEEP + 1),
    ('p' + ' & q' * DEEP, 2 * DEEP + 1),
    ('p -> ' * DEEP + 'q', 2 * DEEP + 1),
    ('f(' + 'p, ' * DEEP + 'q)', DEEP + 2),
    ('f(' * DEEP + 'p' + ')' * DEEP, DEEP + 1),
], 2))
def test_large_and_deep_formulas_are_read_quickly(formula: str, nodes: int) -> None:
    with in_time():
        assert sum(1 for _ in postorder(parse_smv(text(formula)))) == nodes


@pytest.mark.parametrize('piece', some([
    '(', '"', '-', 'a.', '1', '1e', '0x0', ' ', '&', '&lt', '<b>', '</b><', 'a<', 'H[1+', 'f(,',
    '9' * 50 + '*', '"\\', '^-3',
], 3))
def test_garbage_of_many_characters_is_refused_in_time(piece: str) -> None:
    with in_time():
        assert len(str(error(garbage(piece)))) < 2000


def test_a_bound_of_endless_arithmetic_is_refused() -> None:
    assert 'too large' in str(error('H[' + '999 * ' * 10_000 + '9, 5] p'))


TOKENS = ('p', 'x', '3', '1.5', '(', ')', '[0,2]', '[<3]', '&', '|', '->', '<->', 'xor', '!', 'H',
          'O', 'Y', 'Z', 'S', 'T', 'SI', '<', '=', '+', '-', '*', 'mod', '^', 'f(', ',', 'TRUE',
          'FTP', '"a b"', '<b>', '</b>', '[', ']', 'and', '.', 'é')


@given(st.lists(st.sampled_from(TOKENS), max_size=14).map(' '.join) | st.text(max_size=30))
def test_any_text_is_a_formula_or_an_error_at_a_place_within(formula: str) -> None:
    check_places(parse_smv, lambda tree: [node.span for node in postorder(tree)], formula)


def _trees(children: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    bounds = st.sampled_from(('', '[0,3]', '[<3]', '[<=3]', '[=3]', '[>3]', '[>=3]'))
    return st.one_of(
        st.builds('(! {})'.format, children), st.builds('(- {})'.format, children),
        st.builds('({} {})'.format, st.sampled_from('YZ'), children),
        st.builds('({}{} {})'.format, st.sampled_from('HO'), bounds, children),
        st.builds('({} {}{} {})'.format, children, st.sampled_from(('S', 'T', 'SI')), bounds,
                  children),
        st.builds('({} {} {})'.format, children,
                  st.sampled_from([it for it in LEVEL if it not in ('S', 'T', 'SI')]), children),
        st.builds('f({}, {})'.format, children, children),
    )


@given(st.recursive(st.sampled_from(('p', 'x', '3', '1.5', 'True', 'False', 'FTP')), _trees,
                    max_leaves=20))
def test_with_all_parentheses_a_formula_is_its_tree(formula: str) -> None:
    assert read(formula) == formula


def test_reading_gives_no_warning_and_loads_no_lark() -> None:
    program = ('from fret_monitor.model.diagnostics import Source, Text\n'
               'from fret_monitor.language.smv import parse_smv\n'
               "parse_smv(Text.whole(Source('<f>', 'H p')))\n"
               'import sys; sys.exit("lark" in sys.modules)\n')
    done = subprocess.run([sys.executable, '-W', 'error', '-c', program], capture_output=True,
                          text=True, check=False, env={'PYTHONPATH': ':'.join(sys.path)})
    assert (done.returncode, done.stderr) == (0, '')


def test_every_formula_of_fret_is_read() -> None:
    for entry in (*some(facts.templates()), *facts.requirements()):
        tree = parse_smv(text(entry['ptltl']))
        # FRET writes all parentheses, so each operator takes exactly its neighbours.
        for node in postorder(tree):
            if isinstance(node, Infix | Prefix):
                assert re.match(r'\(|-[0-9]', written(node.span))


def test_every_formula_of_frets_answers_to_probes_is_read() -> None:
    lines = facts.path('fret/probes.txt').read_text(encoding='utf-8').splitlines()
    formulas = [line.strip()[3:] for line in lines if line.strip().startswith('pt=')]
    assert len(formulas) > 100
    for formula in formulas:
        if formula != 'undefined':
            parse_smv(text(formula))


def test_ogmas_example_of_an_old_export_is_read() -> None:
    entries = facts.read('ogma/fcs-2.json')['RTSASpec']['Requirements']
    trees = [parse_smv(text(entry['ptLTL'])) for entry in entries]
    names = {node.text for tree in trees for node in postorder(tree) if isinstance(node, Name)}
    assert names == {'flight_mode', 'conflict_detected', 'replanning_mode'}
