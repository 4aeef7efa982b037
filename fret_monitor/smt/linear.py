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
Translation of terms to z3 in which a word is an integer, instead of a vector of bits.

For sums and comparisons of 64-bit words, which take a solver of bit vectors minutes. A word is the
signed integer that it represents; a sum that leaves the range of its width wraps around.
"""

from collections.abc import Callable
from typing import Any
from weakref import WeakKeyDictionary

from fret_monitor.smt import terms as t
from fret_monitor.smt.terms import Term
import z3


class NotLinear(Exception):
    """A term has an operation that is not translated here."""


class LinearTranslation:
    """
    Translates terms to z3; `variables` has those of the terms translated so far.

    `ranges` are the ranges of these variables, to be assumed.
    """

    def __init__(self) -> None:
        """Start with no terms."""
        self.variables: dict[Term, Any] = {}
        self.ranges: list[Any] = []
        self._known: dict[Term, Any] = {}

    def __call__(self, root: Term) -> Any:
        """Return the z3 expression of a term; raises NotLinear for other operations."""
        for item in t.postorder([root], self._known):
            self._known[item] = self._translated(item)
        return self._known[root]

    def _translated(self, item: Term) -> Any:
        args = [self._known[each] for each in item.args]
        kind, bits = item.sort
        match item.op:
            case 'variable':
                return self._variable(item)
            case 'constant' if kind == 'word':
                return z3.IntVal(t.signed(item.value, bits))
            case 'constant' if kind == 'bool':
                return z3.BoolVal(item.value)
            case 'word':
                return z3.If(args[0], z3.IntVal(1), z3.IntVal(0))
            case 'sext':
                return args[0]
            case 'add':
                return _wrapped(args[0] + args[1], bits)
            case 'sub':
                return _wrapped(args[0] - args[1], bits)
            case 'ult':
                width = item.args[0].sort[1]
                return _natural(args[0], width) < _natural(args[1], width)
            case _ if item.op in _DIRECT and kind in ('bool', 'word'):
                return _DIRECT[item.op](*args)
            case _:
                raise NotLinear(item.op)

    def _variable(self, item: Term) -> Any:
        kind = item.sort[0]
        if kind not in ('bool', 'word'):
            raise NotLinear(item.op)
        found = z3.Bool(item.value) if kind == 'bool' else z3.Int(item.value)
        if kind == 'word':
            self.ranges.append(self._range(item, found))
        self.variables[item] = found
        return found

    def _range(self, item: Term, found: Any) -> Any:
        half = 1 << (item.sort[1] - 1)
        return z3.And(-half <= found, found < half)


# Making an expression of z3 in Python takes as long as many a proof.
_made: 'WeakKeyDictionary[Term, Any]' = WeakKeyDictionary()
_ranges: 'WeakKeyDictionary[Term, Any]' = WeakKeyDictionary()


class SharedTranslation(LinearTranslation):
    """As `LinearTranslation`, with the expressions that others have made of the same terms."""

    def __call__(self, root: Term) -> Any:
        """Return the z3 expression of a term; raises NotLinear for other operations."""
        for item in t.postorder([root], self._known):
            found = _made.get(item)
            if found is None or item.op == 'variable':  # with its range
                found = _made[item] = self._translated(item)
            self._known[item] = found
        return self._known[root]

    def _range(self, item: Term, found: Any) -> Any:
        made = _ranges.get(item)
        if made is None:
            made = _ranges[item] = super()._range(item, found)
        return made


def _wrapped(found: Any, bits: int) -> Any:
    """Return a sum or difference of two words, modulo 2^bits."""
    half = 1 << (bits - 1)
    return z3.If(found >= half, found - 2 * half, z3.If(found < -half, found + 2 * half, found))


def _natural(found: Any, bits: int) -> Any:
    return z3.If(found < 0, found + (1 << bits), found)


_DIRECT: dict[str, Callable[..., Any]] = {
    'not': z3.Not,
    'and': z3.And,
    'iff': lambda a, b: a == b,
    'choice': z3.If,
    'slt': lambda a, b: a < b,
    'equal': lambda a, b: a == b,
}
