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
The reference semantics: the value of a formula at every step of a trace (docs/language.md).

It follows the table of operators there literally, with quantifiers over steps: each operator
examines the whole past at each step, which is easy to check and slow. Compiled monitors are
tested against it, so it shares no code with `program` and `codegen`. Nodes without past have
their meaning from `pointwise`.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import assert_never, TypeAlias

from fret_monitor.logic.formula import (
    Ago, Binary, Choice, Constant, Conversion, Feedback, Formula, Held, Historically,
    MessageSlope, NotRefuted, Once, operands, Over, postorder, Previous, Since, Slope,
    TimeOver, Trial, Triggered, Unary, Variable, WeakYesterday, Window, Yesterday,
)
from fret_monitor.logic.pointwise import (
    aggregate, at_start, checked, Compute, operation, slope, TraceError, Value,
)
from fret_monitor.logic.trials import OpenTrial, SequentialTest
from fret_monitor.model.values import ValueType

Trace: TypeAlias = Mapping[str, Sequence[Value]]
Equations: TypeAlias = Sequence[tuple[Feedback, Formula]]

_NO_END = 2 ** 63

_Columns: TypeAlias = dict[Formula, list[Value]]
_Rule: TypeAlias = Callable[[int], Value]


def evaluate(formula: Formula, trace: Trace, feedback: Equations = ()) -> list[Value]:
    """
    Return the value of a formula at every step of a trace.

    `trace` maps each input to its values, one for each step. `feedback` has the equation of each
    `Feedback` node in the formula.

    Raises
    ------
    TraceError
        if an input has no column, columns differ in length, or a value is not of the input's type.
    """
    return evaluate_all([formula], trace, feedback)[0]


def verdicts(formula: Formula, trace: Trace, feedback: Equations = ()) -> list[bool]:
    """Return the verdicts of a BOOL formula at every step; otherwise as `evaluate`."""
    return [value is True for value in evaluate(formula, trace, feedback)]


def evaluate_all(formulas: Sequence[Formula], trace: Trace,
                 feedback: Equations = ()) -> list[list[Value]]:
    """Evaluate several formulas over one trace, common subterms once; otherwise as `evaluate`."""
    steps = _steps(trace)
    equations = dict(feedback)
    nodes = postorder([*formulas, *equations.values()])
    columns: _Columns = {node: [] for node in nodes}
    stepwise = _dependent_on_feedback(nodes)
    for node in nodes:
        if node not in stepwise:
            columns[node].extend(_column(node, columns, trace, steps))
    rules = [(columns[node].append, _rule(node, columns, trace, equations)) for node in stepwise]
    for t in range(steps):
        for append, value_at in rules:
            append(value_at(t))
    return [columns[formula] for formula in formulas]


def _dependent_on_feedback(nodes: Sequence[Formula]) -> dict[Formula, None]:
    """Return the nodes, in order, whose next value may depend on values of later nodes."""
    found: dict[Formula, None] = {}
    if any(isinstance(node, Feedback) for node in nodes):
        for node in nodes:
            if isinstance(node, Feedback) or not found.keys().isdisjoint(operands(node)):
                found[node] = None
    return found


def _column(node: Formula, columns: _Columns, trace: Trace, steps: int) -> Iterable[Value]:
    """Return the values of a node at all steps from those of its operands: `_rule`, but faster."""
    match node:
        case Conversion() | Unary() | Binary() | Choice():
            return map(operation(node), *(columns[item] for item in operands(node)))
        case _:
            return map(_rule(node, columns, trace, {}), range(steps))


def _steps(trace: Trace) -> int:
    lengths = {len(column) for column in trace.values()}
    if len(lengths) > 1:
        raise TraceError(f'columns of different lengths: {sorted(lengths)}')
    return lengths.pop() if lengths else 0


def _rule(node: Formula, columns: _Columns, trace: Trace,
          equations: Mapping[Feedback, Formula]) -> _Rule:
    """Return the function that computes a node at step t from its operands at steps 0..t."""
    match node:
        case Constant() | Conversion() | Unary() | Binary() | Choice():
            return _pointwise(operation(node), [columns[item] for item in operands(node)])
        case Variable():
            return _stored(node, trace)
        case Previous():
            return _previous(columns[node.initial], columns[node.argument])
        case Feedback():
            return _feedback(node.type, columns[equations[node]])
        case Yesterday():
            return _yesterday(columns[node.argument], False)
        case WeakYesterday():
            return _yesterday(columns[node.argument], True)
        case Once():
            return _once(node.window, columns[node.argument])
        case Historically():
            return _historically(node.window, columns[node.argument])
        case Since():
            return _since(node.window, columns[node.left], columns[node.right])
        case Triggered():
            return _triggered(node.window, columns[node.left], columns[node.right])
        case Over():
            return _over(node, columns[node.argument], columns[node.at])
        case Ago():
            x = columns[node.argument]
            return lambda t: x[max(0, t - node.past)]
        case Held():
            return _held(columns[node.condition], columns[node.argument])
        case Slope():
            return _slope(columns[node.argument], columns[node.at], range(0, _NO_END, node.step))
        case MessageSlope():
            return _slope(columns[node.argument], columns[node.at], columns[node.time])
        case TimeOver():
            p = columns[node.argument]
            return lambda t: sum(p[max(0, t - node.past + 1):t + 1]) >= node.least
        case Trial():
            trials, parts = OpenTrial(node), [columns[item] for item in operands(node)]
            return lambda t: trials.outcome(t, *(part[t] is True for part in parts))
        case NotRefuted():
            test, outcomes = SequentialTest(node), columns[node.argument]
            return lambda t: test.take(int(outcomes[t]))
        case _:
            assert_never(node)


# Past-time operators, in the order of the table in docs/language.md.

def _yesterday(p: list[Value], at_start: bool) -> _Rule:
    return lambda t: p[t - 1] if t > 0 else at_start


def _past(window: Window, t: int) -> slice:
    """Return the steps k with 0 <= k <= t and low <= t - k <= high."""
    first = 0 if window.high is None else max(0, t - window.high)
    return slice(first, max(first, t - window.low + 1))


def _once(window: Window, p: list[Value]) -> _Rule:
    return lambda t: any(p[_past(window, t)])


def _historically(window: Window, p: list[Value]) -> _Rule:
    return lambda t: all(p[_past(window, t)])


def _since(window: Window, p: list[Value], q: list[Value]) -> _Rule:
    return lambda t: _found_since(True, _past(window, t), t, p, q)


def _triggered(window: Window, p: list[Value], q: list[Value]) -> _Rule:
    return lambda t: not _found_since(False, _past(window, t), t, p, q)


def _found_since(value: bool, past: slice, t: int, p: list[Value], q: list[Value]) -> bool:
    """Return whether q has a value at some k of `past`, and p has it at every step k+1..t."""
    for k in range(t, past.start - 1, -1):
        if k < past.stop and q[k] is value:
            return True
        if p[k] is not value:
            return False
    return False


# Numbers over time (docs/over_time.md).

def _over(node: Over, x: list[Value], at: list[Value]) -> _Rule:
    compute = aggregate(node)

    def value_at(t: int) -> Value:
        first = max(0, t - node.past)
        window = zip(x[first:t + 1], at[first:t + 1], strict=True)
        return compute([value for value, is_there in window if is_there])

    return value_at


def _slope(x: list[Value], at: list[Value], time: Sequence[Value]) -> _Rule:
    def value_at(t: int) -> Value:
        steps = [k for k in range(t + 1) if at[k]][-2:]
        return 0.0 if len(steps) < 2 else slope(
            *((time[k], x[k]) for k in steps))

    return value_at


def _held(condition: list[Value], x: list[Value]) -> _Rule:
    return lambda t: x[next((k for k in range(t, 0, -1) if condition[k]), 0)]


# Values of the previous step.

def _previous(initial: list[Value], argument: list[Value]) -> _Rule:
    return lambda t: argument[t - 1] if t > 0 else initial[0]


def _feedback(kind: ValueType, equation: list[Value]) -> _Rule:
    return lambda t: equation[t - 1] if t > 0 else at_start(kind)


# Values of the current step.

def _pointwise(compute: Compute, arguments: list[list[Value]]) -> _Rule:
    match arguments:
        case []:
            return lambda t: compute()
        case [p]:
            return lambda t: compute(p[t])
        case [p, q]:
            return lambda t: compute(p[t], q[t])
        case _:
            return lambda t: compute(*(column[t] for column in arguments))


def _stored(node: Variable, trace: Trace) -> _Rule:
    if node.name not in trace:
        raise TraceError(f"no column for the input '{node.name}'")
    column = [checked(value, node.type, node.name) for value in trace[node.name]]
    return lambda t: column[t]
