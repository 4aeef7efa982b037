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
Formulas whose form shows that a verdict, once reached, stays.

A formula is *final* if, once false, it stays false in every continuation of the trace; it is
*lasting* if, once true, it stays true. `H p` is final and `O p` is lasting for every p; the
connectives and `S`, `T`, `Z`, `Y` propagate both properties by the rules below, which are
sufficient but not necessary.
"""

from typing import NamedTuple

from fret_monitor.logic.formula import (
    Binary, BinaryOperator, Constant, Formula, Historically, NotRefuted, Once, postorder,
    Since, Triggered, Unary, UnaryOperator, WeakYesterday, Yesterday,
)


class Course(NamedTuple):
    """Whether false stays false, and whether true stays true."""

    is_final: bool
    is_lasting: bool


_UNKNOWN = Course(False, False)
_FIXED = Course(True, True)


def is_final(formula: Formula) -> bool:
    """Whether the form of a formula shows that a false verdict stays false."""
    found: dict[Formula, Course] = {}
    for node in postorder([formula]):
        found[node] = _course(node, found)
    return found[formula].is_final


def _course(node: Formula, found: dict[Formula, Course]) -> Course:
    match node:
        case Constant():
            return _FIXED
        case Historically() | Once():
            return _bounded(node)
        case NotRefuted():
            return Course(True, False)
        case Unary(UnaryOperator.NOT, argument):
            return Course(found[argument].is_lasting, found[argument].is_final)
        case Binary():
            return _connective(node.operator, found[node.left], found[node.right])
        case Yesterday(argument):
            # False at step 0 for every argument, so it may become true later.
            return Course(False, found[argument].is_lasting)
        case WeakYesterday(argument):
            return Course(found[argument].is_final, False)
        case Since() | Triggered() if node.window.is_unbounded:
            # p S q is q | (p & Y(p S q)). While it is false, so is q: if q is final, neither
            # becomes true again. While it is true, q held at some step: if q is lasting, q and
            # so p S q stay true. p T q is !(!p S !q), for which the same follows by duality.
            return found[node.right]
        case _:
            return _UNKNOWN


def _bounded(node: Historically | Once) -> Course:
    if node.window.is_empty:
        return _FIXED
    is_endless = node.window.high is None
    return Course(is_endless and isinstance(node, Historically),
                  is_endless and isinstance(node, Once))


def _connective(operator: BinaryOperator, left: Course, right: Course) -> Course:
    match operator:
        case BinaryOperator.AND | BinaryOperator.OR:
            return Course(left.is_final and right.is_final, left.is_lasting and right.is_lasting)
        case BinaryOperator.IMPLIES:
            return Course(left.is_lasting and right.is_final, left.is_final and right.is_lasting)
        case _:
            is_fixed = all(left) and all(right)
            return Course(is_fixed, is_fixed)
