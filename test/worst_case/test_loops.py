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

"""Loops and calls of generated C, found by a C parser."""

from collections.abc import Iterator
from typing import Any

from differential.compiled import CSRC
from fret_monitor.codegen.module import generate
from fret_monitor.logic.specification import Specification
from fret_monitor.program.lower import lower
from fret_monitor.smt.terms import LIBRARY as LIBRARY_CALLS
import pytest
from strategies import some
from worst_case.test_worst_case import (
    layouts_of, many_of_a_group, random_specification, remainders, windows_apart,
)

c_ast = pytest.importorskip('pycparser.c_ast')
c_source = pytest.importorskip('fret_monitor.proving.c_source')

SPECIFICATIONS = {
    'windows': windows_apart(), 'parts': many_of_a_group(), 'remainders': remainders(),
    **{f'random {seed}': random_specification(seed) for seed in (2, 6, 7, 10, 11)}}
LIBRARY = {'memset', 'fmodf', '__builtin_clzll', *LIBRARY_CALLS,
           'fm_offset'}  # stands for offsetof


def functions_of(specification: Specification) -> dict[str, Any]:
    """Return the bodies of all functions, those of csrc's headers too, by name."""
    module = generate(lower(specification), layouts_of(specification))
    headers = {file.name: file.read_text() for file in CSRC.glob('*.h')}
    program = c_source.read_program(dict(module.sources), {**headers, **dict([module.header])})
    return {name: item.body for name, item in program.functions.items()}


def nodes(root: Any) -> Iterator[Any]:
    """Yield a node and all below it."""
    todo = [root]
    while todo:
        node = todo.pop()
        yield node
        todo.extend(child for _, child in node.children())


def has_fixed_bound(loop: Any) -> bool:
    """Whether a loop is `for (unsigned i = 0u; i < N; ++i)`, or `i < N && ...`, i not changed."""
    condition = loop.cond
    while isinstance(condition, c_ast.BinaryOp) and condition.op == '&&':
        condition = condition.left
    match loop.init, condition, loop.next:
        case (c_ast.DeclList(decls=[declared]),
              c_ast.BinaryOp(op='<', left=c_ast.ID(name=name), right=c_ast.Constant()),
              c_ast.UnaryOp(op='++', expr=c_ast.ID(name=counted))):
            changed = {node.lvalue.name for node in nodes(loop.stmt)
                       if isinstance(node, c_ast.Assignment)
                       and isinstance(node.lvalue, c_ast.ID)}
            return declared.name == name == counted and name not in changed
    return False


def problems(functions: dict[str, Any]) -> Iterator[str]:
    """Yield what has no bound: other loops, jumps, calls of unknown functions, recursion."""
    calls: dict[str, set[str]] = {}
    for name, body in functions.items():
        calls[name] = set()
        for node in nodes(body):
            if isinstance(node, c_ast.While | c_ast.DoWhile | c_ast.Goto | c_ast.Label):
                yield f'{name}: {type(node).__name__}'
            if isinstance(node, c_ast.For) and not has_fixed_bound(node):
                yield f'{name}: a loop without a fixed bound'
            if isinstance(node, c_ast.FuncCall):
                called = node.name.name if isinstance(node.name, c_ast.ID) else None
                if called not in functions and called not in LIBRARY:
                    yield f'{name}: a call of {called}'
                calls[name].add(str(called))
    yield from circles(calls)


def circles(calls: dict[str, set[str]]) -> Iterator[str]:
    """Yield the functions that are left when those that call none of the rest are removed."""
    left = {name: called & calls.keys() for name, called in calls.items()}
    while ends := {name for name, called in left.items() if not called}:
        left = {name: called - ends for name, called in left.items() if name not in ends}
    yield from (f'{name}: may call itself' for name in left)


@pytest.mark.parametrize('name', some([*SPECIFICATIONS], 2))
def test_all_loops_have_fixed_bounds_and_no_call_is_recursive(name: str) -> None:
    functions = functions_of(SPECIFICATIONS[name])
    assert len(functions) > 40  # including those of the headers
    assert list(problems(functions)) == []


@pytest.mark.parametrize(('body', 'expected'), [
    ('while (x) {x = x - 1u;}', 'While'),
    ('do {x = x - 1u;} while (x);', 'DoWhile'),
    ('again: x = x - 1u; goto again;', 'Goto'),
    ('for (unsigned i = 0u; i < x; ++i) {x = x - 1u;}', 'without a fixed bound'),
    ('for (unsigned i = 0u; i < 9u; ++i) {i = 0u;}', 'without a fixed bound'),
    ('for (;;) {}', 'without a fixed bound'),
    ('g(x);', 'may call itself'),
    ('f(x);', 'may call itself'),
    ('abort();', 'a call of abort'),
])
def test_unbounded_constructs_are_detected(body: str, expected: str) -> None:
    text = f'void f(unsigned x);\nvoid g(unsigned x) {{f(x);}}\nvoid f(unsigned x) {{{body}}}\n'
    program = c_source.parse({'a.c': text})
    found = list(problems({name: item.body for name, item in program.functions.items()}))
    assert any(expected in item for item in found), found
