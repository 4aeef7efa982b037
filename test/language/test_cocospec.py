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

"""Tests of the reader of CoCoSpec: FRET's Lustre, Lustre nodes and equations."""

from pathlib import Path

import facts
from fret_monitor.language.cocospec import parse_cocospec, RESERVED
from fret_monitor.language.expression import Equations, Expression, Infix, Name, postorder, Prefix
from fret_monitor.language.smv import parse_smv
from fret_monitor.model.diagnostics import CompileError, Source, Text
import golden
from hypothesis import given
from hypothesis import strategies as st
import pytest
from strategies import some
from trees import (
    check_infix, check_places, garbage, in_time, refusal, show, text, written,
)

# Lustre V6's manual, the tightest first; FRET's '^' has the precedence of V6's '**'.
INFIX = (('^',), ('*', '/', 'mod'), ('+', '-'), ('<', '<=', '=', '<>', '>', '>='), ('and',),
         ('or', 'xor'), ('=>',), ('->',))
FROM_RIGHT = ('^', '=>', '->')
LEVEL = {operator: level for level, group in enumerate(INFIX) for operator in group}
IN_TREE = {'<>': '!=', 'and': '&', 'or': '|', '=>': '->', '->': 'arrow', 'not': '!'}


def tree(formula: str | Text) -> Expression:
    found = parse_cocospec(text(formula) if isinstance(formula, str) else formula)
    assert not isinstance(found, Equations)
    return found


def read(formula: str) -> str:
    return show(tree(formula))


def equations(formula: str) -> Equations:
    found = parse_cocospec(text(formula))
    assert isinstance(found, Equations)
    return found


def error(formula: str | Text) -> CompileError:
    return refusal(parse_cocospec, formula)


@pytest.mark.parametrize('first', LEVEL)
def test_of_two_infix_operators_the_tighter_one_takes_the_operand_between(first: str) -> None:
    check_infix(parse_cocospec, first, LEVEL, FROM_RIGHT, IN_TREE)


@pytest.mark.parametrize('prefix', ['not', '-', 'pre', 'H', 'O', 'Y', 'Z'])
def test_a_prefix_operator_binds_tighter_than_all_infix_ones(prefix: str) -> None:
    for infix in LEVEL:
        one, two = IN_TREE.get(prefix, prefix), IN_TREE.get(infix, infix)
        assert read(f'{prefix} a {infix} b') == f'(({one} a) {two} b)'


@pytest.mark.parametrize(('formula', 'expected'), [
    ('H(p => q)', '(H (p -> q))'),
    ('O(p) and H(q)', '((O p) & (H q))'),
    ('YtoPre(p) or ZtoPre(false)', '((Y p) | (Z False))'),
    ('Y not p and q', '((Y (! p)) & q)'),
    ('not (p) or pre (not q)', '((! p) | (pre (! q)))'),
    ('( not FTP)', '(! FTP)'),
    ('false -> pre p', '(False arrow (pre p))'),
    ('0 -> pre x + 1', '(0 arrow ((pre x) + 1))'),
    ('a -> b -> c', '(a arrow (b arrow c))'),
    ('a => b => c', '(a -> (b -> c))'),
    ('-1 -> pre C + (if pre C <0 then 0 else 1)',
     '((- 1) arrow ((pre C) + (if ((pre C) < 0) then 0 else 1)))'),
    ('if a then b else c + 1', '(if a then b else (c + 1))'),
    ('1 + if a then b else c + 1', '(1 + (if a then b else (c + 1)))'),
    ('if a then if b then c else d else e', '(if a then (if b then c else d) else e)'),
    ('not x > 5', '((! x) > 5)'),
    ('x div 2 mod 3', '((x / 2) mod 3)'),
    ('(-(x) ^ 2)', '((- x) ^ 2)'),
    ('-((x ^ 2)) > 0', '((- (x ^ 2)) > 0)'),
    ('(x - -3) > 0', '((x - (- 3)) > 0)'),
    ('preInt(0,x) + 1 = x', '((preInt(0, x) + 1) = x)'),
    ('p && q || !r == s', '((p & q) | ((! r) = s))'),
    ('p & q | ~r != s', '((p & q) | ((! r) != s))'),
    ('/* a */ p (* b *) and -- c\n q -- d', '(p & q)'),
    ('"a b" > 1', '(a b > 1)'),
    ('(O((( input_signal <= 5 ))));', '(O (input_signal <= 5))'),
    ('p = q', '(p = q)'),
    ('current > 3 and type = node', '((current > 3) & (type = node))'),
    ('var = let', '(var = let)'),
])
def test_a_formula_has_the_tree_of_lustre_and_fret(formula: str, expected: str) -> None:
    assert read(formula) == expected


@pytest.mark.parametrize(('formula', 'smv'), [
    ('S(p, q)', 'q S p'),
    ('SI(p, q)', 'q SI p'),
    ('T(p, q)', 'q T p'),
    ('OT(10, 2, p)', 'O[2,10] p'),
    ('HT(10, 2, p)', 'H[2,10] p'),
    ('ST(10, 2, p, q)', 'q S[2,10] p'),
    ('SIT(10, 2, p, q)', 'q SI[2,10] p'),
    ('TT(10, 2, p, q)', 'q T[2,10] p'),
    ('OT(-1, 0, p)', 'O[0,-1] p'),
    ('OT(10-1,0,p)', 'O[0,9] p'),
    ('OT(0.5, LessThan, p)', 'O[<0.5] p'),
    ('HT(3, LessThanOrEqual, p)', 'H[<=3] p'),
    ('OT(3, Equal, p)', 'O[=3] p'),
    ('ST(3, GreaterThan, p, q)', 'q S[>3] p'),
    ('TT(3, GreaterThanOrEqual, p, q)', 'q T[>=3] p'),
])
def test_frets_functions_are_operators_with_their_arguments_in_order(
        formula: str, smv: str) -> None:
    assert read(formula) == show(parse_smv(text(smv)))


def test_an_operator_read_from_a_function_has_places() -> None:
    node = tree('p or ST(10, 2, p, q)')
    assert isinstance(node, Infix) and isinstance(node.right, Infix)
    assert node.right.bound is not None
    assert written(node.right.bound.span) == '10, 2'
    assert written(node.right.operator_span) == 'ST(10, 2'
    assert written(node.right.span) == 'ST(10, 2, p, q)'


@pytest.mark.parametrize('word', sorted(RESERVED))
def test_a_reserved_word_in_quotes_is_a_name(word: str) -> None:
    node = tree(f'"{word}"')
    assert isinstance(node, Name)
    assert node.text == word


NODE = """
-- how long the motor has drawn much
node overload(x: real; p, q: bool;) returns (ok: bool);
var C: int; D, Y: bool;
let
  C = 0 -> pre C + 1;   -- counts
  D = C > 3;
  Y = D or p => Y not q;
  ok = D and (* both *) q;
tel
"""


def test_a_node_has_equations_declarations_and_a_result() -> None:
    node = equations(NODE)
    assert [(it.name, show(it.expression)) for it in node.equations] == [
        ('C', '(0 arrow ((pre C) + 1))'), ('D', '(C > 3)'), ('Y', '((D | p) -> (Y (! q)))'),
        ('ok', '(D & q)')]
    assert node.result is node.equations[3]
    assert [(it.name, it.type) for it in node.inputs] == [
        ('x', 'real'), ('p', 'bool'), ('q', 'bool')]
    assert [(it.name, it.type) for it in node.declarations] == [
        ('C', 'int'), ('D', 'bool'), ('Y', 'bool'), ('ok', 'bool')]
    assert written(node.equations[1].span) == 'D = C > 3'
    assert written(node.equations[1].name_span) == 'D'
    assert written(node.inputs[2].span) == 'q'
    assert written(node.span).startswith('node') and written(node.span).endswith('tel')


def test_the_result_of_a_node_is_its_output_whatever_the_order_of_equations() -> None:
    node = equations('node N() returns (o: bool) var a: bool; let o = a; a = p; tel.')
    assert node.result.name == 'o'
    assert node.inputs == ()


def test_the_result_of_equations_is_the_last_one() -> None:
    node = equations('a = x > 3; b = a and q;')
    assert [(it.name, show(it.expression)) for it in node.equations] == [
        ('a', '(x > 3)'), ('b', '(a & q)')]
    assert node.result.name == 'b'
    assert node.declarations == ()
    assert [it.name for it in equations('a = x > 3; b = a and q').equations] == ['a', 'b']
    assert equations('a = p and pre a;').result.name == 'a'


@pytest.mark.parametrize('name', ['H', 'O', 'Y', 'Z', 'S', 'SI', 'T'])
def test_names_of_operators_can_be_names_in_a_node(name: str) -> None:
    node = equations(f'node {name}(X: bool) returns ({name}: bool);\n'
                     f'let {name} = X -> (X and (pre {name})); tel')
    assert show(node.result.expression) == f'(X arrow (X & (pre {name})))'


@pytest.mark.parametrize(('value', 'joined'), [
    ('p and q -- why and r', True),
    ('p and q -- why\nand r', False),
])
def test_a_comment_that_yaml_has_joined_with_the_next_line_is_refused(
        value: str, joined: bool) -> None:
    source = Source('bundle.yaml', 'p and q -- why\nand r')
    folded = Text(value, source, range(len(value) + 1))
    if joined:
        caught = error(folded)
        assert 'swallow' in str(caught) and "'|'" in str(caught)
    else:
        assert show(tree(folded)) == '((p & q) & r)'


@pytest.mark.parametrize('case', golden.cases('formula', '.cocospec'), ids=lambda path: path.stem)
def test_errors_say_what_is_wrong_and_what_to_write(case: Path) -> None:
    formulas = case.read_text(encoding='utf-8').rstrip('\n').split('\n\n')
    golden.check(case, '\n\n'.join(str(error(formula)) for formula in formulas) + '\n')


DEEP = 8_000


@pytest.mark.parametrize(('formula', 'nodes'), [
    ('H(' * DEEP + 'p' + ')' * DEEP, DEEP + 1),
    ('OT(3,0,' * (DEEP // 4) + 'p' + ')' * (DEEP // 4), DEEP // 4 + 1),
    ('S(p,' * (DEEP // 2) + 'q' + ')' * (DEEP // 2), DEEP + 1),
    ('if a then b else ' * DEEP + 'p', 3 * DEEP + 1),
    ('pre ' * DEEP + 'p', DEEP + 1),
    ('0 -> ' * DEEP + 'p', 2 * DEEP + 1),
])
def test_large_and_deep_formulas_are_read_quickly(formula: str, nodes: int) -> None:
    with in_time():
        assert sum(1 for _ in postorder(tree(formula))) == nodes


def test_thousands_of_equations_are_read_quickly() -> None:
    with in_time():
        found = equations(''.join(f'a{i} = p and pre a{i};\n' for i in range(5000)))
    assert len(found.equations) == 5000


@pytest.mark.parametrize('piece', ['(', '/*', '(*', '(* ', '--', 'a = p;', 'OT(', 'if ', ';',
                                   'node N(', 'let ', '/* */ ', '1,'])
def test_garbage_of_many_characters_is_refused_in_time(piece: str) -> None:
    with in_time():
        assert len(str(error(garbage(piece)))) < 2000


TOKENS = ('p', 'x', '3', '(', ')', ',', 'and', 'or', '=>', '->', 'not', 'H', 'Y', 'S(', 'OT(',
          'pre', 'if', 'then', 'else', '=', '<', '+', '-', ';', ':', 'node N(', 'returns', 'var',
          'let', 'tel', 'bool', '--', '/*', '*/', 'LessThan', '.', '[')


@given(st.lists(st.sampled_from(TOKENS), max_size=14).map(' '.join) | st.text(max_size=30))
def test_any_text_is_a_formula_or_an_error_at_a_place_within(formula: str) -> None:
    check_places(parse_cocospec, lambda tree: [tree.span], formula)


def test_every_formula_of_fret_has_the_same_shape_in_both_languages() -> None:
    for entry in (*some(facts.templates()), *facts.requirements()):
        in_smv, in_lustre = parse_smv(text(entry['ptltl'])), tree(entry['cocospec'])
        names = [{node.text for node in postorder(root) if isinstance(node, Name)}
                 for root in (in_smv, in_lustre)]
        assert names[0] == names[1]
        # FRET writes SI for a common shape of S; otherwise the trees are equal except for `=`.
        if 'SI(' not in entry['cocospec']:
            assert show(in_lustre) == show(in_smv).replace(' <-> ', ' = ')


def test_every_formula_of_frets_answers_to_probes_is_read() -> None:
    lines = facts.path('fret/probes.txt').read_text(encoding='utf-8').splitlines()
    formulas = [line.strip()[5:] for line in lines if line.strip().startswith('coco=')]
    assert len(formulas) > 100
    for formula in formulas:
        if formula != 'undefined':
            tree(formula)


@pytest.mark.parametrize(('name', 'operators'), [('fcs-1', {'H', '!', 'pre', '&', '|', '->',
                                                            '*', '>=', '<='}), ('fcs-2', set())])
def test_ogmas_examples_are_read(name: str, operators: set[str]) -> None:
    found = set()
    for entry in facts.read(f'ogma/{name}.json')['RTSASpec']['Requirements']:
        found |= {node.operator for node in postorder(tree(entry['CoCoSpecCode']))
                  if isinstance(node, Infix | Prefix)}
    assert found == operators
