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

"""Symbolic execution of C: its results equal compiled C, and undefined behaviour is reported."""

import ctypes
from pathlib import Path
from random import Random
import struct
from typing import Any

from differential.compiled import clang, compile_c, gcc
from fret_monitor.model.floats import to_float32
from fret_monitor.proving.c_source import ArithmeticType, read_program, Struct, Unreadable
from fret_monitor.proving.execution import Machine, Memory, Reference, sort_of, Value
from fret_monitor.smt import terms as t
from fret_monitor.smt.concrete import function_of
from fret_monitor.smt.solver import ProofAnswer, prove, Translation
from fret_monitor.smt.terms import Sort
import pytest
import z3

INCLUDES = '#include <stdbool.h>\n#include <stdint.h>\n'
TYPES: dict[str, Any] = {
    'bool': ctypes.c_bool, 'int8_t': ctypes.c_int8, 'uint8_t': ctypes.c_uint8,
    'uint16_t': ctypes.c_uint16, 'int32_t': ctypes.c_int32, 'uint32_t': ctypes.c_uint32,
    'int64_t': ctypes.c_int64, 'uint64_t': ctypes.c_uint64, 'float': ctypes.c_float,
    'double': ctypes.c_double,
}
# Type of the result, types of a and b, body: defined for all values, or guarded.
DEFINED = [
    ('int32_t', 'uint8_t', 'int8_t', 'a + b'),
    ('uint32_t', 'uint8_t', 'uint32_t', 'a - b'),
    ('bool', 'int8_t', 'uint8_t', 'a < b'),
    ('bool', 'int32_t', 'uint32_t', 'a < b'),
    ('bool', 'int64_t', 'uint32_t', 'a < b'),
    ('uint8_t', 'uint8_t', 'uint8_t', '(uint8_t)(a * b)'),
    ('uint16_t', 'uint16_t', 'uint16_t', '(uint16_t)(~a | b)'),
    ('uint64_t', 'uint64_t', 'uint64_t', 'b == 0u ? 0u : a / b + a % b'),
    ('uint32_t', 'uint32_t', 'uint32_t', 'a >> (b & 31u)'),
    ('uint64_t', 'uint32_t', 'uint32_t', '(uint64_t)a << (b & 31u)'),
    ('int64_t', 'int64_t', 'int32_t', 'b > 0 ? a / b : a < 0 ? 1 : a % 7'),
    ('uint32_t', 'bool', 'bool', '(uint32_t)(a & b) << 3 | (uint32_t)(a ^ b)'),
    ('bool', 'bool', 'bool', '!a | b'),
    ('bool', 'bool', 'uint32_t', 'a && b > 5u || !b'),
    ('float', 'float', 'float', 'a * b + a'),
    ('double', 'float', 'double', 'a * b - a'),
    ('float', 'float', 'float', 'a / b'),
    ('double', 'int64_t', 'uint64_t', '(double)a + (double)b'),
    ('float', 'int64_t', 'uint64_t', '(float)a - (float)b'),
    ('bool', 'double', 'float', 'a >= b'),
    ('bool', 'float', 'float', 'a == b || a != a'),
    ('double', 'float', 'double', 'a < b ? a : -b'),
    ('float', 'double', 'double', '(float)(a * b)'),
    ('bool', 'float', 'float', 'a + 0.1f < b'),
    ('bool', 'float', 'float', 'a + 0.1 < b'),
    ('bool', 'uint8_t', 'uint8_t', 'a - b > 3'),
    ('bool', 'uint8_t', 'uint8_t', 'a - b > 3u'),
]


def parameters(number: int) -> str:
    """Return a function definition of the table."""
    result, first, second, body = DEFINED[number]
    return f'{result} f{number}({first} a, {second} b) {{return {body};}}'


def drawn(rng: Random, kind: str) -> Any:
    """Return a value of a C type, extreme ones often."""
    if kind == 'bool':
        return rng.random() < 0.5
    if kind in ('float', 'double'):
        value = rng.choice((0.0, -0.0, 1.5, -3.25, 1e30, 1e-40, float('inf'), float('nan'),
                            rng.uniform(-10, 10), 16777217.0))
        return TYPES[kind](value).value
    bits = 8 * ctypes.sizeof(TYPES[kind])
    whole = rng.choice((0, 1, -1, 5, 1 << (bits - 1), (1 << (bits - 1)) - 1, rng.getrandbits(64)))
    return TYPES[kind](whole).value


def as_term_has_it(value: Any, kind: str) -> Any:
    """Return a value of ctypes as terms have it: words are unsigned."""
    if isinstance(value, float | bool):
        return value
    return value & ((1 << 8 * ctypes.sizeof(TYPES[kind])) - 1)


@pytest.mark.parametrize('compiler', [gcc, clang])
def test_terms_compute_what_compiled_c_does(compiler: Any, tmp_path: Path) -> None:
    if compiler() is None:
        pytest.skip('no such compiler')
    source = INCLUDES + '\n'.join(parameters(number) for number in range(len(DEFINED)))
    (tmp_path / 'f.c').write_text(source, encoding='utf-8')
    compile_c([*compiler(), '-std=c99', '-O1', '-w', '-ffp-contract=off', '-fPIC', '-shared',
               tmp_path / 'f.c', '-o', tmp_path / 'f.so'])
    library = ctypes.CDLL(str(tmp_path / 'f.so'))
    program = read_program({'f.c': source}, {})
    rng = Random(3)
    for number, (result, *kinds, body) in enumerate(DEFINED):
        function = library[f'f{number}']
        function.restype, function.argtypes = TYPES[result], [TYPES[kind] for kind in kinds]
        types = [kind for _, kind in program.functions[f'f{number}'].parameters]
        inputs = [t.variable(name, sort_of(kind)) for name, kind in zip('ab', types)]
        machine = Machine(program, {})
        found = machine.call(f'f{number}', [
            Value(kind, item) for kind, item in zip(types, inputs)
            if isinstance(kind, ArithmeticType)])
        assert isinstance(found, Value)
        compute = function_of([found.term], inputs)
        for _ in range(200):
            values = [drawn(rng, kind) for kind in kinds]
            [ours] = compute(*(as_term_has_it(value, kind)
                               for value, kind in zip(values, kinds)))
            theirs = as_term_has_it(function(*values), result)
            assert repr(ours) == repr(theirs), (body, values)


@pytest.mark.parametrize(('text', 'said'), [
    ('int32_t f(int32_t a, int32_t b) {return a + b;}', 'signed overflow'),
    ('int32_t f(int32_t a, int32_t b) {return a * b;}', 'signed overflow'),
    ('int64_t f(int64_t a, int64_t b) {return -a;}', 'signed overflow'),
    ('int32_t f(int32_t a, int32_t b) {return a / (b | 1);}', 'signed overflow'),
    ('int32_t f(int32_t a, int32_t b) {return a / b;}', 'division by zero'),
    ('uint32_t f(uint32_t a, uint32_t b) {return a % b;}', 'division by zero'),
    ('uint32_t f(uint32_t a, uint32_t b) {return a << b;}', 'shift by the width'),
    ('int32_t f(int32_t a, int32_t b) {return a >> 1;}', 'shift of a negative'),
    ('int8_t f(int32_t a, int32_t b) {return (int8_t)a;}', 'converted to'),
    ('int32_t f(int32_t a, int32_t b) {int32_t c; return c;}', 'before it is written'),
    ('uint8_t g(uint8_t * x) {*x = 1u; return *x;} struct s {uint8_t x;}; '
     'uint32_t f(uint32_t a, struct s * b) {return a + g(&b->x) + g(&b->x);}', 'another operand'),
    ('struct s {uint8_t x[4];}; uint32_t f(uint32_t a, struct s * b) {return b->x[a];}',
     'index of'),
])
def test_what_c_leaves_undefined_is_a_condition_that_fails(text: str, said: str) -> None:
    program = read_program({'f.c': INCLUDES + text}, {})
    memory: Memory = {('s', 'x'): t.variable('x', t.ring(4) if '[4]' in text else t.word(8))}
    arguments = [
        Value(kind, t.variable(name, sort_of(kind))) if isinstance(kind, ArithmeticType)
        else Reference(('s',), Struct('s'))
        for name, kind in program.functions['f'].parameters]
    machine = Machine(program, memory)
    machine.call('f', arguments)
    failed = [item for item in machine.conditions
              if prove([item.holds]).answer is ProofAnswer.REFUTED]
    assert any(said in item.what for item in failed), machine.conditions


@pytest.mark.parametrize('text', [
    'int f(int a) {while (a) {a = a - 1;} return a;}',
    'int f(int a) {goto end; end: return a;}',
    'int f(int a) {for (int i = 0; i < a; ++i) {} return a;}',
    'int f(int a) {return f(a);}',
    'int f(int a) {return h(a);}',
    'int f(int a) {if (a) {return 1;}}',
    'int x; int f(int a) {return a;}',
])
def test_what_is_not_such_c_is_refused(text: str) -> None:
    with pytest.raises(Unreadable):
        program = read_program({'f.c': text}, {})
        Machine(program, {}).call('f', [Value(ArithmeticType('int', 32, True),
                                              t.variable('a', t.word(32)))])


WORDS = ['add', 'sub', 'mul', 'bitand', 'bitor', 'bitxor', 'shl', 'lshr', 'ashr', 'udiv', 'urem',
         'sdiv', 'srem']
FLOATS = ['fadd', 'fsub', 'fmul', 'fdiv']


@pytest.mark.parametrize('op', [*WORDS, *FLOATS, 'ult', 'slt', 'equal', 'flt', 'fle', 'feq',
                                'float_s', 'float_u', 'float', 'same'])
@pytest.mark.parametrize('bits', [8, 32, 64])
def test_z3_and_python_agree_on_what_an_operation_computes(op: str, bits: int) -> None:
    is_real = op in FLOATS or op in ('flt', 'fle', 'feq', 'float', 'same')
    if is_real and bits == 8:
        pytest.skip('there is no such float')
    sort: Sort = t.real(bits) if is_real else t.word(bits)
    result = t.BOOL if op in t.RELATIONS or op == 'same' else sort
    if op.startswith('float'):
        result = t.real(32)
    rng = Random(bits)
    a, b = t.variable('a', sort), t.variable('b', sort)
    args = (a,) if op.startswith('float') else (a, b)
    item = t.term(op, result, args)
    compute, translation = function_of([item], list(args)), Translation(False)
    shown = translation(item)
    for _ in range(12):
        values = [drawn(rng, 'double') if is_real else rng.getrandbits(bits) >> rng.choice((0, 3))
                  for _ in args]
        if is_real and bits == 32:
            values = [to_float32(value) for value in values]
        [ours] = compute(*values)
        put = [(translation.variables[arg], Translation(False)(t.constant(value, sort)))
               for arg, value in zip(args, values)]
        theirs = z3.simplify(z3.substitute(shown, *put))
        wanted = Translation(False)(t.constant(ours, result))
        assert z3.is_true(z3.simplify(theirs == wanted)), (values, ours, theirs)


def test_minus_zero_is_another_value_and_nan_is_itself() -> None:
    assert t.same(t.floating(0.0, 64), t.floating(-0.0, 64)) is t.FALSE
    nan = struct.unpack('<d', struct.pack('<Q', 0x7ff0000000000001))[0]
    assert t.same(t.floating(nan, 64), t.floating(float('nan'), 64)) is t.TRUE
    x = t.variable('x', t.real(64))
    assert prove([t.relation('feq', x, x)]).answer is ProofAnswer.REFUTED
    assert prove([t.same(t.operation('fadd', x, t.floating(0.0, 64)), x)]).answer \
        is ProofAnswer.REFUTED
