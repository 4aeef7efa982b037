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
Mutants of generated C: one operator, number, name, call or statement changed.

`mutants` makes them on the syntax tree, so that each is C; `printed` writes one down to be
compiled. Run as a program, this proves or refutes many of them and prints a table:

    python -m bench.mutants [HOW MANY A BUNDLE]
"""

from collections.abc import Callable
from collections.abc import Iterator
from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass
from dataclasses import replace
from random import Random
from typing import Any

from fret_monitor.proving.c_source import Function
from fret_monitor.proving.c_source import Program
from fret_monitor.proving.c_source import shown
from pycparser import c_ast
from pycparser import CParser
from pycparser.c_generator import CGenerator

_OPERATORS = {'&': '|', '|': '&', '^': '&', '==': '!=', '!=': '==', '<': '<=', '<=': '<',
              '>': '>=', '>=': '>', '+': '-', '-': '+', '*': '+', '/': '*', '<<': '>>',
              '>>': '<<', '&&': '||', '||': '&&'}
_CELLS = {'once_within': 'always_within', 'always_within': 'once_within',
          'since_within': 'since_before', 'since_before': 'since_within',
          'once_before': 'once_within', 'add': 'sub', 'sub': 'add', 'mul': 'add', 'div': 'mod',
          'mod': 'div', 'min': 'max', 'max': 'min', 'neg': 'abs', 'abs': 'neg'}
_Change = Callable[[], None]


@dataclass(frozen=True)
class Mutant:
    """A program in which one function is another; `what` says where and how."""

    what: str
    kind: str
    function: str
    code: Program


def mutants(code: Program, functions: Sequence[str]) -> Iterator[Mutant]:
    """Yield every mutant of some functions of a program."""
    for name in functions:
        function = code.functions[name]
        for number in range(sum(1 for _ in _changes(deepcopy(function), code))):
            body = deepcopy(function.body)
            copy = replace(function, body=body)
            kind, what, change = next(item for place, item in enumerate(_changes(copy, code))
                                      if place == number)
            change()
            yield Mutant(f'{name}: {what}', kind, name,
                         replace(code, functions={**code.functions, name: copy}))


def sample(code: Program, functions: Sequence[str], count: int, seed: int = 0) -> list[Mutant]:
    """Return some mutants, spread over the kinds of change; the same ones each time."""
    rng = Random(seed)
    by_kind: dict[str, list[Mutant]] = {}
    for mutant in mutants(code, functions):
        by_kind.setdefault(mutant.kind, []).append(mutant)
    for found in by_kind.values():
        rng.shuffle(found)
    chosen: list[Mutant] = []
    while len(chosen) < count and any(by_kind.values()):
        chosen += [found.pop() for found in by_kind.values() if found]
    return chosen[:count]


def generated_functions(code: Program, prefix: str) -> list[str]:
    """Return the functions of a monitor, but for its description."""
    return [name for name in code.functions
            if name.startswith(f'{prefix}_') and name != f'{prefix}_monitor']


def _changes(function: Function, code: Program) -> Iterator[tuple[str, str, _Change]]:
    """Yield what can be changed in a function: kind, text, and what does it."""
    fields = _fields_of(function.body)
    for node in _nodes(function.body):
        match node:
            case c_ast.BinaryOp() if node.op in _OPERATORS:
                yield _setting('operator', node, 'op', _OPERATORS[node.op])
            case c_ast.Assignment(op='|='):
                yield _setting('operator', node, 'op', '&=')
            case c_ast.UnaryOp(op='!'):
                yield 'operator', f'{shown(node)} without !', _unwrapping(node)
            case c_ast.Constant() if node.type in ('int', 'unsigned int', 'long long int'):
                yield from _numbers(node)
            case c_ast.Constant() if node.type in ('float', 'double'):
                suffix = 'f' if node.value[-1] in 'fF' else ''
                text = repr(float(node.value.rstrip('fF')) + 1.0) + suffix
                yield _setting('constant', node, 'value', text)
            case c_ast.FuncCall():
                yield from _calls(node, code)
            case c_ast.StructRef() if node.field.name in fields:
                yield from _others(node, fields[node.field.name])
            case c_ast.Compound():
                yield from _without(node)
            case c_ast.TernaryOp():
                yield 'operator', f'{shown(node)[:60]} with branches exchanged', _exchanging(node)


def _setting(kind: str, node: Any, name: str, value: str) -> tuple[str, str, _Change]:
    return kind, f'{shown(node)[:60]}, {getattr(node, name)} to {value}', \
        lambda: setattr(node, name, value)


def _unwrapping(node: Any) -> _Change:
    def change() -> None:
        node.op, node.expr = '!', c_ast.UnaryOp('!', node.expr)
    return change


def _exchanging(node: Any) -> _Change:
    def change() -> None:
        node.iftrue, node.iffalse = node.iffalse, node.iftrue
    return change


def _numbers(node: Any) -> Iterator[tuple[str, str, _Change]]:
    digits = node.value.rstrip('uUlL')
    suffix = node.value[len(digits):]
    value = int(digits, 0)
    for other in {value + 1, value - 1} - {-1}:
        yield _setting('number', node, 'value', f'{other}{suffix}')


def _calls(node: Any, code: Program) -> Iterator[tuple[str, str, _Change]]:
    name = node.name.name
    stem = name.removeprefix('fm_').rsplit('_', 1)
    other = f'fm_{_CELLS.get(stem[0], "")}_{stem[-1]}'
    if other in code.functions and \
            code.functions[other].parameters == code.functions[name].parameters:
        yield _setting('call', node.name, 'name', other)
    if node.args is not None and len(node.args.exprs) > 1:
        last, before = node.args.exprs[-1], node.args.exprs[-2]
        if name in code.functions and len({kind for _, kind in
                                           code.functions[name].parameters[-2:]}) == 1:
            def exchange() -> None:
                node.args.exprs[-2:] = [last, before]
            yield 'call', f'{shown(node)[:60]} with operands exchanged', exchange


def _fields_of(body: Any) -> dict[str, list[str]]:
    """Return for each field the others of its kind that a function names."""
    names = sorted({node.field.name for node in _nodes(body) if isinstance(node, c_ast.StructRef)
                    and getattr(node.name, 'name', '') in ('s', 'in')})
    return {name: [other for other in names if other != name
                   and other.split('_')[0] == name.split('_')[0]] for name in names}


def _others(node: Any, names: Sequence[str]) -> Iterator[tuple[str, str, _Change]]:
    for name in names[:2]:
        yield _setting('name', node.field, 'name', name)


def _without(node: Any) -> Iterator[tuple[str, str, _Change]]:
    for item in node.block_items or ():
        if isinstance(item, c_ast.Assignment | c_ast.FuncCall):
            yield 'statement', f'without {shown(item)[:60]}', _removing(node, item)


def _removing(node: Any, item: Any) -> _Change:
    return lambda: node.block_items.remove(item)


def _nodes(node: Any) -> Iterator[Any]:
    yield node
    for _, child in node.children():
        yield from _nodes(child)


def printed(code: Program, texts: Sequence[str], mutant: Mutant) -> str:
    """Return preprocessed C in which a function is the mutant's, to be compiled as it is."""
    lines = ['#include <stddef.h>', '#define FM_NAN __builtin_nanf("")',
             '#define FM_INFINITY __builtin_inff()']
    [text] = texts
    tree = CParser().parse(text)
    kept = []
    for item in tree.ext:
        if isinstance(item, c_ast.FuncDef):
            if item.decl.name.endswith('_monitor'):
                continue  # the description, which needs offsetof
            if item.decl.name == mutant.function:
                item.body = mutant.code.functions[mutant.function].body
        if not (isinstance(item, c_ast.Typedef) and item.name == 'size_t'):
            kept.append(item)
    tree.ext = kept
    return '\n'.join([*lines, CGenerator().visit(tree)])
