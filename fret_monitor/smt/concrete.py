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
Evaluation of terms on values, by a generated Python function.

Generated code, because the search for counterexamples evaluates many steps. Cells that are
replaced by contracts have no value.
"""

from collections.abc import Callable, Mapping, Sequence
import math
from typing import Any

from fret_monitor.model.floats import to_float32
from fret_monitor.smt import terms as t
from fret_monitor.smt.terms import Term

_INFIX = {'add': '+', 'sub': '-', 'mul': '*', 'bitand': '&', 'bitor': '|', 'bitxor': '^'}
_RELATIONS = {'ult': '<', 'equal': '==', 'flt': '<', 'fle': '<=', 'feq': '==', 'iff': '=='}
_AGAIN = {'fadd': '+', 'fsub': '-', 'fmul': '*'}


class NoValue(Exception):
    """The term has no value, because it contains a cell that is replaced by its contract."""


def function_of(results: Sequence[Term], arguments: Sequence[Term]) -> Callable[..., list[Any]]:
    """
    Return a function from values of the arguments, in their order, to the values of the results.

    Values are bool, int (words, unsigned), float and bytes (rings).
    """
    names: dict[Term, str] = {item: f'v{place}' for place, item in enumerate(arguments)}
    lines = [f'def compute({", ".join(names.values())}):']
    for item in t.postorder(results, names):
        names[item] = f't{item.number}'
        lines.append(f'    {names[item]} = {_text(item, names)}')
    lines.append(f'    return [{", ".join(names[item] for item in results)}]')
    scope: dict[str, Any] = {'F': t.FUNCTIONS, 'r': to_float32, 'put': _put, 'same': _same,
                             'inf': math.inf, 'nan': math.nan, 's': t.signed,
                             'from_integer': t.from_integer}
    exec('\n'.join(lines), scope)
    found: Callable[..., list[Any]] = scope['compute']
    return found


def _put(array: bytes, index: int, byte: int) -> bytes:
    return array[:index] + bytes([byte]) + array[index + 1:] if index < len(array) else array


def _same(left: Any, right: Any) -> bool:
    if isinstance(left, float):
        return (left != left and right != right) or (
            left == right and math.copysign(1, left) == math.copysign(1, right))
    return bool(left == right)


def _text(item: Term, names: Mapping[Term, str]) -> str:
    args = [names[each] for each in item.args]
    kind, bits = item.sort
    match item.op:
        case 'constant':
            return repr(t.plain(item))
        case 'filled':
            return f'bytes([{item.value}]) * {bits}'
        case 'variable' | 'cell' | 'cell_next':
            raise NoValue(item.op)
        case 'bit':
            return f'({args[0]} >> {item.value}) & 1 == 1'
        case 'not':
            return f'not {args[0]}'
        case 'and':
            return f'{args[0]} and {args[1]}'
        case 'choice':
            return f'{args[1]} if {args[0]} else {args[2]}'
        case 'select':
            return f'{args[0]}[{args[1]}] if {args[1]} < len({args[0]}) else 0'
        case 'store':
            return f'put({", ".join(args)})'
        case 'same':
            return f'same({", ".join(args)})'
        case 'fneg':
            return f'-{args[0]}'
        case 'float':
            return f'r({args[0]})' if bits == 32 else args[0]
        case 'float_s':
            return f'from_integer(s({args[0]}, {item.args[0].sort[1]}), {bits})'
        case 'float_u':
            return f'from_integer({args[0]}, {bits})'
    if item.op in _RELATIONS:
        return f'{args[0]} {_RELATIONS[item.op]} {args[1]}'
    if item.op in _AGAIN:
        shown = f'{args[0]} {_AGAIN[item.op]} {args[1]}'
        return f'r({shown})' if bits == 32 else shown
    mask = f' & {(1 << bits) - 1}' if kind == 'word' else ''
    if item.op in _INFIX:
        return f'({args[0]} {_INFIX[item.op]} {args[1]}){mask}'
    return f'F[{item.op!r}]({item.args[0].sort[1]}, {", ".join(args)}){mask}'
