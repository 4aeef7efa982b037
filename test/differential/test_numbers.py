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

"""Every operation on numbers, bit for bit: compiled C against the reference, on edge values."""

from collections.abc import Iterator, Sequence
from functools import cache
from itertools import product
import math
from random import Random
import struct
from typing import Any

from differential.compiled import clang, Compiled, FLAGS, gcc
from fret_monitor.logic.evaluate import evaluate, evaluate_all
from fret_monitor.logic.formula import (
    Binary, BinaryOperator, Choice, Constant, Conversion, Formula, Previous, Unary, UnaryOperator,
    Variable,
)
from fret_monitor.logic.specification import Property
from fret_monitor.model.floats import to_float32
from fret_monitor.model.values import ValueType
import pytest
from strategies import (
    all_values, becomes, EXAMPLES, finite_values, property_of, specification_of, TERM_TYPES,
    thorough,
)

INT64, UINT64 = ValueType.INT64, ValueType.UINT64
FLOAT32, FLOAT64 = ValueType.FLOAT32, ValueType.FLOAT64
NUMBERS = [kind for kind in ValueType if kind.is_number]
A = {kind: Variable(f'a_{kind.value}', kind) for kind in ValueType}
B = {kind: Variable(f'b_{kind.value}', kind) for kind in ValueType}
EXPONENTS = (0, 1, 2, 3, 4, 5, 7, 8, 10, 31, 63, 64, 65, 1000, 2 ** 62 + 1, 2 ** 63 - 1)


def operands(kind: ValueType) -> list[tuple[Any, Any]]:
    """Return pairs of values: all edge values with one another, and random ones."""
    rng = Random(kind.value)
    values = all_values(kind)
    return [*product(values, repeat=2),
            *((random_value(rng, kind), random_value(rng, kind)) for _ in range(200))]


def random_value(rng: Random, kind: ValueType) -> Any:
    """Return a value whose bits are random, or a small one."""
    if kind is ValueType.BOOL:
        return rng.random() < 0.5
    if kind is FLOAT32:
        return rng.choice([struct.unpack('<f', rng.randbytes(4))[0], to_float32(rng.gauss(0, 9))])
    if kind is FLOAT64:
        return rng.choice([struct.unpack('<d', rng.randbytes(8))[0], rng.gauss(0, 9)])
    low, high = kind.limits
    return rng.choice([rng.randint(low, high), rng.randint(max(low, -20), min(high, 20))])


def terms() -> Iterator[Formula]:
    """Yield every operation, on inputs."""
    for kind in TERM_TYPES:
        yield from (Unary(operator, A[kind]) for operator in (UnaryOperator.NEG,
                                                              UnaryOperator.ABS))
        if kind is FLOAT64:
            yield from (Unary(item, A[kind]) for item in UnaryOperator if item.is_library)
        for operator in BinaryOperator:
            if operator is BinaryOperator.ATAN2:
                if kind is FLOAT64:
                    yield Binary(operator, A[kind], B[kind])
            elif operator is BinaryOperator.POW:
                yield from (Binary(operator, A[kind], Constant(n, INT64)) for n in EXPONENTS)
            elif not operator.is_boolean and not operator.is_relation:
                yield Binary(operator, A[kind], B[kind])
        yield Choice(Binary(BinaryOperator.LT, A[kind], B[kind]), A[kind], B[kind])
        yield from (Previous(Constant(value, kind), A[kind]) for value in finite_values(kind))
        yield from (Binary(BinaryOperator.MUL, A[kind], Constant(value, kind))
                    for value in finite_values(kind))
    yield Binary(BinaryOperator.POW, A[FLOAT64], B[FLOAT64])
    yield from two_roundings()
    yield from conversions()
    yield from constants()


def constants() -> Iterator[Formula]:
    """Yield constants: edge values, and others of many digits."""
    rng = Random(1)
    for kind in TERM_TYPES:
        values = [*finite_values(kind),
                  *(random_value(rng, kind) for _ in range(EXAMPLES // 5))]
        yield from (Constant(value, kind) for value in values
                    if math.isfinite(value))


def two_roundings() -> Iterator[Formula]:
    """Yield a * b + a, which one fused instruction would round once."""
    for kind in (FLOAT32, FLOAT64):
        yield Binary(BinaryOperator.ADD, Binary(BinaryOperator.MUL, A[kind], B[kind]), A[kind])


def conversions() -> Iterator[Formula]:
    """Yield every conversion."""
    for source, kind in product(NUMBERS, TERM_TYPES):
        if source is not kind and becomes(source, kind):
            yield Conversion(A[source], kind)


def is_value(term: Formula, result: Variable) -> Formula:
    """Return that a term is, bit for bit, the value of an input; all NaNs are alike."""
    equal = Binary(BinaryOperator.EQ, term, result)
    if not term.type.is_float:
        return equal
    one = Constant(1.0, term.type)
    # 1 / -0.0 is not 1 / 0.0.
    signs = Binary(BinaryOperator.EQ, Binary(BinaryOperator.DIV, one, term),
                   Binary(BinaryOperator.DIV, one, result))
    both_nan = Binary(BinaryOperator.AND, Binary(BinaryOperator.NE, term, term),
                      Binary(BinaryOperator.NE, result, result))
    return Binary(BinaryOperator.OR, both_nan, Binary(BinaryOperator.AND, equal, signs))


def columns() -> dict[str, list[Any]]:
    """Return columns for all inputs, of one length."""
    pairs = {kind: operands(kind) for kind in ValueType}
    steps = max(map(len, pairs.values()))
    trace: dict[str, list[Any]] = {}
    for kind, values in pairs.items():
        repeated = (values * (steps // len(values) + 1))[:steps]
        trace[A[kind].name] = [a for a, _ in repeated]
        trace[B[kind].name] = [b for _, b in repeated]
    return trace


def neighbour(value: Any, kind: ValueType) -> Any:
    """Return the nearest other value."""
    if kind is FLOAT32:
        bits = struct.unpack('<I', struct.pack('<f', value))[0]
        return 1.0 if math.isnan(value) else struct.unpack('<f', struct.pack('<I', bits ^ 1))[0]
    if kind is FLOAT64:
        return 1.0 if math.isnan(value) else math.nextafter(value, 0.0) if value else -value
    return value ^ 1


with_each_compiler = pytest.mark.parametrize(('compiler', 'level'), [
    pytest.param(gcc, '-O3', id='gcc -O3'),
    pytest.param(clang, '-O2', marks=thorough, id='clang -O2')])


def compiled(properties: list[Property], inputs: Sequence[Variable], compiler: Any,
             level: str) -> Compiled:
    """Compile with a compiler, if it is there."""
    if compiler() is None:
        pytest.skip('needs this compiler')
    return Compiled(specification_of(properties, inputs), compiler=compiler(),
                    flags=(*FLAGS, level))


@cache
def results() -> list[tuple[Formula, Variable, list[Any]]]:
    """Return every operation with an input and the values that it should give."""
    items = [*terms()]
    found = zip(items, evaluate_all(items, columns()), strict=True)
    return [(term, Variable(f'r_{number}', term.type), values)
            for number, (term, values) in enumerate(found)]


@cache
def operations(compiler: Any, level: str) -> Compiled:
    """Compile the comparison of every operation with its input."""
    properties = [property_of(f'R-{number}', is_value(term, result))
                  for number, (term, result, _) in enumerate(results())]
    inputs = (*A.values(), *B.values(), *(result for _, result, _ in results()))
    return compiled(properties, inputs, compiler, level)


@with_each_compiler
def test_every_operation_gives_the_same_bits_as_the_reference(compiler: Any, level: str) -> None:
    trace = columns() | {result.name: values for _, result, values in results()}
    verdicts = operations(compiler, level).run(trace)
    wrong = [shown(term, trace, found.index(False))
             for (term, _, _), found in zip(results(), verdicts, strict=True) if not all(found)]
    assert not wrong


def test_a_result_with_a_wrong_last_bit_is_detected() -> None:
    trace = columns() | {result.name: [neighbour(value, result.type) for value in values]
                         for _, result, values in results()}
    assert not any(map(any, operations(gcc, '-O3').run(trace)))


def shown(term: Formula, trace: dict[str, list[Any]], step: int) -> str:
    """Describe an operation and the operands on which it failed."""
    names = [name for name in trace if name in (f'a_{term.type.value}', f'b_{term.type.value}')]
    what = getattr(term, 'operator', type(term).__name__)
    values = {name: trace[name][step] for name in names}
    return f'{what} at step {step} on {values} should be {evaluate(term, trace)[step]}'


@cache
def relations() -> list[tuple[Formula, list[Any]]]:
    """Return every relation, on inputs and constants, negated or not, with its verdicts."""
    pairs: list[tuple[Formula, Formula]] = [(A[kind], B[kind]) for kind in TERM_TYPES]
    pairs += [(A[INT64], B[UINT64]), (A[UINT64], B[INT64])]
    pairs += [(A[kind], A[kind]) for kind in TERM_TYPES]
    pairs += [(A[kind], Constant(value, kind)) for kind in TERM_TYPES
              for value in finite_values(kind)]
    plain = [Binary(operator, a, b) for a, b in pairs
             for operator in BinaryOperator if operator.is_relation]
    items: list[Formula] = [*plain, *(Unary(UnaryOperator.NOT, item) for item in plain)]
    return list(zip(items, evaluate_all(items, columns()), strict=True))


@with_each_compiler
def test_every_relation_is_that_of_the_reference_negated_too(compiler: Any, level: str) -> None:
    properties = [property_of(f'R-{number}', item) for number, (item, _) in enumerate(relations())]
    monitor = compiled(properties, (*A.values(), *B.values()), compiler, level)
    for (item, expected), found in zip(relations(), monitor.run(columns()), strict=True):
        assert found == expected, getattr(item, 'operator', item)
