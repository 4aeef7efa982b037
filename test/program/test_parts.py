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
Groups cut into parts, and bundles cut into files and blocks, give the verdicts of the whole.

Both great numbers of requirements and low limits cause cuts. With low limits every kind of cell
can lie on either side of a cut.
"""

from array import array
from random import Random

from differential.compiled import c_module, Compiled, reference, unoptimised
from fret_monitor.build import build_specification
from fret_monitor.codegen import module
from fret_monitor.logic.formula import (
    Aggregate, Ago, ALWAYS, Binary, BinaryOperator, Choice, Constant, Feedback, Formula, FTP, Held,
    Historically, Once, Over, Previous, Since, Triggered, TRUE, Unary, UnaryOperator, Variable,
    WeakYesterday, Window, Yesterday,
)
from fret_monitor.logic.specification import Property, Specification
from fret_monitor.model.values import ValueType
from fret_monitor.native.compiled import CompiledMonitor
from fret_monitor.program import layout
from fret_monitor.runtime.evaluator import Evaluator
from program.written import kinds, layouts_of
import pytest
from strategies import (
    as_term, FormulaMaker, INPUTS, property_of, random_inputs, random_property, random_trace, some,
    specification_of, thorough, Trace,
)

CELLS = {'FirstStep', 'Delay', 'OnceEver', 'AlwaysSoFar', 'SinceEver', 'TriggeredEver',
         'OnceWithin', 'AlwaysWithin', 'OnceBefore', 'SinceWithin', 'SinceBefore',
         'PreviousNumber', 'FeedbackRead', 'Greatest', 'Hold', 'Rounded', 'Tally', 'Total',
         'ValueAgo'}
PURE = {'ApplyBinary', 'ApplyUnary', 'Power', 'Choose'}
FEW = (Variable('p', ValueType.BOOL), Variable('q', ValueType.BOOL),
       Variable('x_int8', ValueType.INT8), Variable('x_float32', ValueType.FLOAT32))
P, Q = FEW[0], FEW[1]


def low_limits(monkeypatch: pytest.MonkeyPatch, part: int, file: int, block: int) -> None:
    """Lower the limits, so that everything is cut into small pieces."""
    monkeypatch.setattr(layout, 'PART_EQUATIONS', part)
    monkeypatch.setattr(module, '_FILE_EQUATIONS', file)
    monkeypatch.setattr(module, '_BLOCK_EQUATIONS', block)


def rows(built: CompiledMonitor, specification: Specification, trace: Trace) -> list[list[bool]]:
    """Step all groups at once, as the evaluator does when all are ready."""
    evaluator = Evaluator(built.monitor)
    columns = [array(item.type.typecode, trace[item.name]) for item in specification.signals]
    times = array('q', range(len(columns[0])))
    found = b''.join(flags for _, flags in evaluator.rows(columns, times))
    count = len(specification.properties)
    return [[bool(value) for value in found[number::count]] for number in range(count)]


def assert_equal(specification: Specification, trace: Trace) -> None:
    """Compare group by group, and all at once, with the reference."""
    with unoptimised():
        built = build_specification(specification)
    found = Compiled(specification, built=built).run(trace)
    expected = reference(specification.properties, trace)
    for item, column, right in zip(specification.properties, found, expected, strict=True):
        assert column == right, item.id
    assert rows(built, specification, trace) == found


def shared_by_many(rng: Random, count: int, size: int) -> list[Property]:
    """Return requirements on the same inputs that share terms and loops."""
    nodes = [Feedback(f'loop_{index}', kind) for index, kind in
             enumerate((ValueType.BOOL, ValueType.FLOAT64, ValueType.INT64))]
    maker = FormulaMaker(rng.randrange, FEW, reach=300, feedback=nodes)
    equations: list[tuple[Feedback, Formula]] = [
        (node, maker.formula(size) if node.type is ValueType.BOOL
         else maker.term(node.type, size)) for node in nodes]
    properties = []
    for number in range(count):
        formula = maker.formula(size)
        for item in FEW:  # all of them read all of the inputs
            formula = Binary(BinaryOperator.XOR, formula, reading(item))
        properties.append(property_of(f'M-{number}', formula, tuple(equations)))
    return properties


def reading(item: Variable) -> Formula:
    """Return a formula that depends on an input."""
    if item.type is ValueType.BOOL:
        return item
    number = as_term(item, ValueType.FLOAT64)
    return Binary(BinaryOperator.LE, number, Constant(2.0, ValueType.FLOAT64))


@pytest.mark.parametrize(('seed', 'part', 'file', 'block'), some([
    (1, 1, 1, 1), (2, 2, 7, 3), (3, 3, 40, 11), (4, 7, 100, 100), (5, 20, 33, 3000)], 2))
def test_small_pieces_give_the_verdicts_of_the_whole(
        monkeypatch: pytest.MonkeyPatch, seed: int, part: int, file: int, block: int) -> None:
    low_limits(monkeypatch, part, file, block)
    rng = Random(seed)
    properties = [random_property(rng, f'R-{number}', random_inputs(rng, INPUTS, 3), size=30,
                                  loops=number % 3) for number in range(12)]
    specification = specification_of([*properties, *shared_by_many(rng, 4, 40)])
    layouts = layouts_of(specification)
    assert max(len(item.parts) for item in layouts) > 5
    for item in layouts:
        whole = range(len(item.group.equations))
        assert [index for one in item.parts for index in one] == list(whole)
        assert all(0 < len(one) <= part for one in item.parts if len(whole))
    assert len(c_module(specification).sources) > 1
    assert_equal(specification, random_trace(rng, INPUTS, 300))


def crossing(specification: Specification) -> set[str]:
    """Return the kinds of operations whose values a later part reads."""
    return {type(item.group.equations[index].operation).__name__
            for item in layouts_of(specification) for index in item.wires}


def test_every_kind_of_value_crosses_from_one_part_to_another(
        monkeypatch: pytest.MonkeyPatch) -> None:
    # The last requirement reads each cell, many parts after the one that computes it.
    low_limits(monkeypatch, 3, 50, 20)
    number = Variable('x_int32', ValueType.INT32)
    whole = as_term(number, ValueType.INT64)
    loop, loose = Feedback('loop', ValueType.INT64), Feedback('loose', ValueType.BOOL)
    three = Constant(3, ValueType.INT64)
    terms: list[Formula] = [
        FTP, Yesterday(P), WeakYesterday(Q), Once(ALWAYS, P), Historically(ALWAYS, Q),
        Since(ALWAYS, P, Q), Triggered(ALWAYS, P, Q), Once(Window(0, 5), P),
        Historically(Window(0, 300), Q), Once(Window(4, None), P), Since(Window(0, 7), P, Q),
        Since(Window(5, None), P, Q), Once(Window(20, 20), P), Once(Window(100, 100), Q),
        Choice(Once(ALWAYS, Q), Yesterday(P), Yesterday(Q)), Binary(BinaryOperator.AND, P, Q),
        loose]
    real = as_term(number, ValueType.FLOAT64)
    numbers: list[Formula] = [
        Ago(2, whole), Over(Aggregate.GREATEST, 3, whole, TRUE), Held(P, whole),
        Over(Aggregate.SUM, 4, whole, TRUE), Over(Aggregate.COUNT, 5, P, TRUE),
        Previous(three, whole), loop, Unary(UnaryOperator.NEG, whole),
        Binary(BinaryOperator.MUL, whole, whole), Binary(BinaryOperator.POW, whole, three), whole]
    terms += [Binary(BinaryOperator.LT, item, three) for item in numbers]
    means = [Over(aggregate, 3, real, TRUE) for aggregate in (Aggregate.SUM, Aggregate.MEAN)]
    terms += [Binary(operator, item, real) for item in means
              for operator in (BinaryOperator.LT, BinaryOperator.EQ)]
    terms += [Binary(BinaryOperator.EQ, item, whole) for item in numbers[:-1]]
    equations = ((loop, Binary(BinaryOperator.ADD, loop, whole)),
                 (loose, Unary(UnaryOperator.NOT, Binary(BinaryOperator.OR, loose, P))))
    last = terms[0]
    for item in terms[1:]:
        last = Binary(BinaryOperator.XOR, last, item)
    everywhere = Binary(BinaryOperator.AND, Binary(BinaryOperator.AND, P, Q),
                        Binary(BinaryOperator.LT, loop, three))
    properties = [property_of(f'R-{index}', Binary(BinaryOperator.IMPLIES, everywhere, item),
                              equations) for index, item in enumerate(terms)]
    properties.append(property_of('R-last', last, equations))
    properties += [property_of(f'A-{index}', item, equations)
                   for index, item in enumerate([*terms, loose])]
    specification = specification_of(properties, (P, Q, number))
    found = crossing(specification)
    assert {*CELLS, *PURE, 'Convert'} - found == set()
    assert_equal(specification, random_trace(Random(1), (P, Q, number), 400))


def test_loops_across_parts_keep_their_values(
        monkeypatch: pytest.MonkeyPatch) -> None:
    # A ring of delays, two that swap their values, and one that stays the same.
    low_limits(monkeypatch, 2, 30, 10)
    kind = ValueType.BOOL
    ring = [Feedback(f'ring_{index}', kind) for index in range(9)]
    one, two, still = (Feedback(name, kind) for name in ('one', 'two', 'still'))
    equations: list[tuple[Feedback, Formula]] = [
        (node, ring[index - 1] if index else Binary(BinaryOperator.XOR, P, ring[8]))
        for index, node in enumerate(ring)]
    equations += [(one, two), (two, Binary(BinaryOperator.OR, one, Q)), (still, still)]
    formulas: list[Formula] = [Binary(BinaryOperator.XOR, Binary(BinaryOperator.AND, P, Q), node)
                               for node in (*ring, one, two, still)]
    properties = [property_of(f'R-{index}', item, tuple(equations))
                  for index, item in enumerate(formulas)]
    specification = specification_of(properties, (P, Q))
    assert len(layouts_of(specification)[0].parts) > 10
    assert_equal(specification, random_trace(Random(1), (P, Q), 200))


@thorough
def test_thousands_of_equations_in_groups_of_hundreds() -> None:
    rng = Random(1)
    properties = shared_by_many(rng, 60, 60)
    properties += [random_property(rng, f'S-{number}', INPUTS[number % 5:number % 5 + 3], size=60,
                                   loops=1) for number in range(150)]
    specification = specification_of(properties)
    layouts = layouts_of(specification)
    sizes = [len(item.group.equations) for item in layouts]
    assert sum(sizes) > 3000 and max(sizes) > 2 * layout.PART_EQUATIONS
    made = {kind for item in layouts for kind in kinds(item)}
    assert (CELLS | PURE) - made == set()
    assert len(c_module(specification).sources) > 1
    assert_equal(specification, random_trace(rng, INPUTS, 150))


@thorough
def test_one_requirement_larger_than_parts_and_files() -> None:
    rng = Random(2)
    maker = FormulaMaker(rng.randrange, FEW, reach=300)
    formula = maker.formula(10)
    for _ in range(260):
        formula = Binary(rng.choice([BinaryOperator.XOR, BinaryOperator.IFF]), formula,
                         maker.formula(60))
    specification = specification_of([property_of('R-1', formula)], FEW)
    assert len(layouts_of(specification)[0].group.equations) > 3000
    assert_equal(specification, random_trace(rng, FEW, 150))


@pytest.mark.parametrize('count', [8, 9, 33, 64, 65, 129, 200])
def test_bits_at_every_position_of_a_word_keep_their_values(count: int) -> None:
    chain: list[Formula] = [P]
    for number in range(count):
        before = Yesterday if number % 3 else WeakYesterday
        chain.append(before(chain[-1]))
    formulas = [Binary(BinaryOperator.IFF, item, Q) for item in chain[1:]]
    specification = specification_of([property_of(f'R-{number}', item)
                                      for number, item in enumerate(formulas)], (P, Q))
    kinds_of_fields = {item.kind for item in layouts_of(specification)[0].fields}
    assert (layout.FieldKind.BITS in kinds_of_fields) == (count > 8)
    assert_equal(specification, random_trace(Random(count), (P, Q), 400))
