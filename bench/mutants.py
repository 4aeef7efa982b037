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
Mutants of generated C: one operator, number, name, call or statement is changed.

`mutants` changes the syntax tree, so that each mutant is valid C; `printed` returns its text for
the compiler. Run as a program, this proves or refutes mutants and prints a table:

    python -m bench.mutants [HOW MANY A BUNDLE AND OF THE CELLS]
"""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from pathlib import Path
from random import Random
import sys
import tempfile
import time
from typing import Any

from bench.equivalence import verify_edited
from bench.source_mutants import OPERATORS
from fret_monitor.build import generate_monitor, GeneratedMonitor, read
from fret_monitor.proving.c_source import CFunction, CProgram, shown
from fret_monitor.proving.contracts import cell_attempts
from fret_monitor.proving.monitor import ALL, ProofSubject
from fret_monitor.proving.verification import GroupResult, read_subject
from fret_monitor.smt.cells import COUNTERS
from fret_monitor.smt.solver import ProofAnswer
from pycparser import c_ast, CParser
from pycparser.c_generator import CGenerator

_CELLS = {'once_within': 'always_within', 'always_within': 'once_within',
          'since_within': 'since_before', 'since_before': 'since_within',
          'once_before': 'once_within', 'add': 'sub', 'sub': 'add', 'mul': 'add', 'div': 'mod',
          'mod': 'div', 'min': 'max', 'max': 'min', 'neg': 'abs', 'abs': 'neg'}
_Change = Callable[[], None]
_SECONDS = 20.0

# Each bundle has cells of one kind, with bounds so small that short traces show a change.
BUNDLES = {
    'bits': """
inputs: {p: {type: bool}, q: {type: bool}}
requirements:
  - {id: first, ptltl: "FTP -> p"}
  - {id: once, ptltl: "O (p & q)"}
  - {id: always, ptltl: "H (p | q)"}
  - {id: since, ptltl: "p S q"}
  - {id: triggered, ptltl: "p T q"}
  - {id: before, ptltl: "Y p"}
  - {id: weakly, ptltl: "Z q"}
  - {id: packed, ptltl: "Y Y Y Y Y p xor q"}
""",
    'counters': """
inputs: {p: {type: bool}, q: {type: bool}}
requirements:
  - {id: once, ptltl: "O[0,5] p"}
  - {id: always, ptltl: "H[0,3] q"}
  - {id: since, ptltl: "p S[0,4] q"}
  - {id: triggered, ptltl: "q T[0,2] p"}
  - {id: once_later, ptltl: "O[>=3] p"}
  - {id: since_later, ptltl: "p S[>=2] q"}
  - {id: persisted, ptltl: "H[0,4] (p | q) & H[0,3] !FTP"}
  - {id: wide, ptltl: "O[0,200] (p & q)"}
""",
    'delays': """
inputs: {p: {type: bool}, q: {type: bool}, r: {type: bool}}
requirements:
  - {id: once, ptltl: "O[3,3] p"}
  - {id: always, ptltl: "H[2,4] q"}
  - {id: since, ptltl: "p S[2,3] q"}
  - {id: ring, ptltl: "O[70,70] r"}
""",
    'integers': """
inputs: {n: {type: int32}, m: {type: int64}, u: {type: uint64}}
requirements:
  - {id: sum, ptltl: "n + 1 < m - 2 * n"}
  - {id: quotient, ptltl: "n / 3 = n mod 5"}
  - {id: absolute, ptltl: "abs(n) > 4"}
  - {id: power, ptltl: "m ^ 3 != -m"}
  - {id: natural, ptltl: "u + u - 1 > 7"}
  - {id: mixed, ptltl: "u < m | u = m"}
  - {id: before, ptltl: "preInt(3, n) < n"}
""",
    'floats': """
inputs: {p: {type: bool}, x: {type: float32}, d: {type: float64}}
requirements:
  - {id: sum, ptltl: "x + 0.5 < x * 2.0"}
  - {id: quotient, ptltl: "x / 4.0 >= 1.0"}
  - {id: least, ptltl: "min(d, 3.0) = max(d, 1.5)"}
  - {id: power, ptltl: "x ^ 2 > 1e3"}
  - {id: absolute, ptltl: "abs(-d) >= 2.5"}
  - {id: choice, ptltl: "ite(p, d, 1.0) > 0.5"}
  - {id: before, ptltl: "preReal(0.5, d) < d"}
""",
    'groups': """
inputs: {p: {type: bool}, q: {type: bool}, x: {type: float32}}
definitions: {high: x > 15.0}
requirements:
  - {id: response, fretish: "if persisted(3, high) the system shall within 4 ticks satisfy p"}
  - {id: other, fretish: "in q mode the system shall always satisfy p"}
  - {id: alone, ptltl: "H (p -> O[0,2] p)"}
  - {id: constant, ptltl: "TRUE"}
""",
}


@dataclass(frozen=True)
class Mutant:
    """A program with one changed function; `what` describes the change."""

    what: str
    kind: str
    function: str
    code: CProgram


def mutants(code: CProgram, functions: Sequence[str]) -> Iterator[Mutant]:
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


def sample(code: CProgram, functions: Sequence[str], count: int, seed: int = 0) -> list[Mutant]:
    """Return `count` mutants of all kinds of change, the same for the same seed."""
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


def generated_functions(code: CProgram, prefix: str) -> list[str]:
    """Return the functions of a monitor, except the one that returns its description."""
    return [name for name in code.functions
            if name.startswith(f'{prefix}_') and name != f'{prefix}_monitor']


def _changes(function: CFunction, code: CProgram) -> Iterator[tuple[str, str, _Change]]:
    """Yield the possible changes of a function: kind, description, and a function to apply it."""
    fields = _fields_of(function.body)
    for node in _nodes(function.body):
        match node:
            case c_ast.BinaryOp() if node.op in OPERATORS:
                yield _setting('operator', node, 'op', OPERATORS[node.op])
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
                yield from _calls(node, code, function.name)
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
    for other in {value + 1, value - 1} - {-1, 1 << 63}:
        yield _setting('number', node, 'value', f'{other}{suffix}')


def _calls(node: Any, code: CProgram, inside: str) -> Iterator[tuple[str, str, _Change]]:
    name = node.name.name
    stem = name.removeprefix('fm_').rsplit('_', 1)
    other = f'fm_{_CELLS.get(stem[0], "")}_{stem[-1]}'
    if other in code.functions and other != inside and \
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
    """Return for each field the other fields of its kind that a function uses."""
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


def printed(text: str, mutant: Mutant) -> str:
    """Return preprocessed C with the function of the mutant, ready to be compiled."""
    lines = ['#include <stddef.h>', '#define FM_NAN __builtin_nanf("")',
             '#define FM_INFINITY __builtin_inff()']
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


def subject_of(text: str, name: str = 'mutants') -> tuple[ProofSubject, GeneratedMonitor]:
    """Generate the C of a bundle, and parse it."""
    with tempfile.TemporaryDirectory(prefix='fret_monitor-') as folder:
        path = Path(folder) / f'{name}.yaml'
        path.write_text('format: 1\n' + text, encoding='utf-8')
        generated = generate_monitor(read(path))
    return read_subject(generated), generated


def judged(subject: ProofSubject, mutant: Mutant,
           seconds: float = _SECONDS) -> tuple[str, GroupResult]:
    """
    Return the result for a mutant: refuted, undefined, equivalent, or undecided.

    A refuted mutant comes with a trace from the reset on which it differs; an undefined one with a
    trace that ends in undefined behaviour.
    """
    changed = replace(subject, code=mutant.code)
    settled = None
    for group in [*range(len(subject.layouts)), ALL]:
        settled = verify_edited(changed, group, seconds)
        if not settled.is_proved:
            example = settled.counterexample
            if example is None:
                return 'undecided', settled
            return 'undefined' if example.undefined else 'refuted', settled
    assert settled is not None
    return 'equivalent', settled


def cell_functions(code: CProgram) -> list[str]:
    """Return the functions of `fret_cells.h` to mutate: one type of each, of small width."""
    wanted = ('fm_bit', 'fm_signed', 'fm_next_position', 'fm_delay_ring')
    return [name for name in code.functions
            if name in wanted or name.endswith(('_u8', '_iu', '_ui', '_i64'))
            and not name.startswith(('fm_min', 'fm_max', 'fm_power'))]


TICK_FUNCTIONS = ['fm_lower', *(f'fm_{name}_at' for name in COUNTERS)]
"""The functions of `fret_cells.h` that step cells at ticks."""


def judged_cell(code: CProgram, mutant: Mutant, seconds: float = _SECONDS) -> str:
    """Return the result for a mutant of a cell: equivalent if all its callers are proved."""
    proofs = cell_attempts()
    for name in _standing_on(code, mutant.function):
        prove = proofs.get(name)
        answer = prove(mutant.code, seconds).answer if prove else ProofAnswer.PROVED
        if answer is not ProofAnswer.PROVED:
            return 'refuted' if answer is ProofAnswer.REFUTED else 'undecided'
    return 'equivalent'


def _standing_on(code: CProgram, function: str) -> list[str]:
    """Return a function and all functions that call it, directly or indirectly."""
    found = [function]
    for name in found:
        found += [other for other, item in code.functions.items() if other not in found
                  and any(isinstance(node, c_ast.FuncCall) and node.name.name == name
                          for node in _nodes(item.body))]
    return found


def main() -> int:
    """Print the table; 1 if something is undecided."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    print(f'{"mutants of":12} {"made":>5} {"refuted":>8} {"undefined":>10} {"equivalent":>11} '
          f'{"undecided":>10} {"seconds":>8}')
    left = 0
    code = None
    for name, text in BUNDLES.items():
        subject, _ = subject_of(text, name)
        code = subject.code
        chosen = sample(code, generated_functions(code, subject.prefix), count)
        left += _row(name, ((mutant, judged(subject, mutant)[0]) for mutant in chosen))
    assert code is not None
    cells = sample(code, cell_functions(code), count)
    left += _row('fret_cells.h', ((mutant, judged_cell(code, mutant)) for mutant in cells))
    left += _row('cells at ticks', ((mutant, judged_cell(code, mutant))
                                    for mutant in mutants(code, TICK_FUNCTIONS)))
    return 1 if left else 0


def _row(name: str, judgements: Iterator[tuple[Mutant, str]]) -> int:
    before = time.perf_counter()
    found: Counter[str] = Counter()
    undecided = []
    for mutant, judgement in judgements:
        found[judgement] += 1
        if judgement == 'undecided':
            undecided.append(mutant.what)
    print(f'{name:12} {found.total():5} {found["refuted"]:8} {found["undefined"]:10} '
          f'{found["equivalent"]:11} {found["undecided"]:10} '
          f'{time.perf_counter() - before:8.1f}', flush=True)
    for what in undecided:
        print(f'  undecided: {what}')
    return len(undecided)


if __name__ == '__main__':
    sys.exit(main())
