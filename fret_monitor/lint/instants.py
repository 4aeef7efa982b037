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
Warnings about reports and times that are legal, and probably not meant.

The cases: `report: onset` of a requirement that stays violated; under the policy timed, operators
that look back one nanosecond where no change is looked for.
"""

from collections.abc import Iterator
import re
from typing import TypeAlias

from fret_monitor.logic.formula import (
    ALWAYS, Feedback, Formula, FTP, Historically, NUMBERS_OVER_TIME, Once, operands, postorder,
    Previous, Since, Triggered, Variable, WeakYesterday, Yesterday,
)
from fret_monitor.logic.specification import Property, Specification
from fret_monitor.model.diagnostics import Diagnostic, Level
from fret_monitor.model.policies import InputSource, Policy, Report

_Kinds: TypeAlias = tuple[type[Previous | WeakYesterday | Yesterday], ...]

_ONE_BACK: _Kinds = (Previous, WeakYesterday, Yesterday)
_LOOKS_BACK = re.compile(r'\b(?:[YZ]|pre\w*)\b')
_TEMPORAL = (Historically, Once, Since, Triggered, *NUMBERS_OVER_TIME, *_ONE_BACK)


def reports_once(specification: Specification) -> Iterator[Diagnostic]:
    """Yield a warning for each requirement `H p` that is announced once and never again."""
    for item in specification.properties:
        is_always = isinstance(item.formula, Historically) and item.formula.window == ALWAYS
        if item.report is Report.ONSET and is_always:
            yield _warning(
                item, f'{item.id} is announced once and never again',
                'once false, it stays false',
                'write report: occurrence to announce each violation when it begins')


def doubtful_instants(specification: Specification) -> Iterator[Diagnostic]:
    """Yield the warnings about formulas of single nanoseconds under the policy timed."""
    if specification.policy is not Policy.TIMED:
        return
    received = {item.name for item in specification.signals
                if item.source is InputSource.RECEIVED}
    for item in specification.properties:
        yield from _instants(item, received)


def _instants(item: Property, received: set[str]) -> Iterator[Diagnostic]:
    # Y and Z in the formula of a sentence are FRET's; only `pre` was written by the user.
    back = _ONE_BACK if item.sentence is None else (Previous,)
    nodes = postorder(item.roots)
    if item.horizon and not _LOOKS_BACK.search(item.text):
        return  # each Y is of the rewriting to the past
    name = next(_received_before(nodes, received, back), '')
    if name:
        yield _warning(
            item, f"{item.id} looks back one nanosecond at '{name}'",
            'it is true for one nanosecond, when a message comes',
            'for a message not long ago write '
            + (f'a bound, as in O[0, 100 ms] {name}' if item.sentence is None
               else f'occurred(100 milliseconds, {name})'))
    elif any(_looks_back_alone(region, back) for region in _regions(nodes)):
        yield _warning(
            item, f'{item.id} looks back one nanosecond', "under policy: timed 'Y', 'Z' and 'pre'"
            ' see the instant before, not the message before',
            'for a change compare a value with its own past, as in '
            + ('p & Y !p; for a time write a bound, as in O[0, 100 ms] p'
               if item.sentence is None else
               'p & !preBool(true, p); for a time write occurred(100 milliseconds, p)'))


def _received_before(nodes: list[Formula], received: set[str],
                     back: _Kinds) -> Iterator[str]:
    """Yield the names of `received()` inputs that are read one step ago."""
    for node in nodes:
        if isinstance(node, back) and node is not FTP:
            read = next(_regions([node.argument]))
            yield from (inner.name for inner in read
                        if isinstance(inner, Variable) and inner.name in received)


def _regions(nodes: list[Formula]) -> Iterator[list[Formula]]:
    """
    Yield the operators and inputs that are evaluated at one instant, for each such instant.

    A region is the whole formula or the operand of a temporal operator, down to the next temporal
    operators, which are part of it.
    """
    roots = {nodes[-1]: None}
    for node in nodes:
        if isinstance(node, _TEMPORAL):
            roots.update(dict.fromkeys(operands(node)))
    for root in roots:
        found: list[Formula] = []
        todo = [root]
        seen: set[Formula] = set()
        while todo:
            node = todo.pop()
            if node not in seen:
                seen.add(node)
                found.append(node)
                todo += [] if isinstance(node, _TEMPORAL) else operands(node)
        yield found


def _looks_back_alone(region: list[Formula], back: _Kinds) -> bool:
    """Whether an operator looks back one step at inputs that are not read at the step itself."""
    now = {node for node in region if isinstance(node, Variable | Feedback)}
    for node in region:
        if isinstance(node, back) and node is not FTP:
            read = {inner for inner in postorder([node.argument])
                    if isinstance(inner, Variable | Feedback)}
            if read and now.isdisjoint(read):
                return True
    return False


def _warning(item: Property, title: str, label: str, help_: str) -> Diagnostic:
    return Diagnostic(title, item.place, label, help_, Level.WARNING)
