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
Prove that edited C is equivalent to the C that `compile` writes, or find a trace that differs.

This finds equivalent mutants. The proof of unedited C does not need it, because that C calls each
cell as its contract requires.

1. The bodies of the cells are executed instead of their contracts. The C state need only represent
   the state of the transition system: all counters above their bound represent the same.
2. If the inputs matter only through finitely many comparisons, and counters saturate, a group and
   its C have finitely many states. All reachable states are explored, which finds a shortest trace
   on which the two differ, or proves that there is none.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
import time
from typing import Any

from fret_monitor.program.layout import FieldKind, GroupLayout
from fret_monitor.program.monitor_program import (
    AlwaysWithin, Delay, OnceBefore, OnceWithin, SinceBefore, SinceWithin,
)
from fret_monitor.proving.c_source import Unreadable
from fret_monitor.proving.contracts import ARITHMETIC
from fret_monitor.proving.execution import Path
from fret_monitor.proving.group_contract import Check, GroupContract, place_of, same_or_false
from fret_monitor.proving.monitor import (
    ALL, GroupProofs, ProofSubject, prove_contract, prove_group, wrong_types,
)
from fret_monitor.proving.obligations import Proof
from fret_monitor.proving.refutation import (
    Counterexample, find_counterexample, ProgramRunner, zero,
)
from fret_monitor.proving.verification import GroupResult, verify_group
from fret_monitor.smt import terms as t
from fret_monitor.smt.cells import line_related, WIDTH
from fret_monitor.smt.concrete import function_of, NoValue
from fret_monitor.smt.solver import ProofAnswer, prove
from fret_monitor.smt.terms import Term
from fret_monitor.smt.transition import counter_model, StateVariable, transition_system

_QUICK_S = 0.3  # for a search before the bodies of the cells are executed
_SEARCH_S = 10.0
_MOST_STATES = 200_000
_MOST_ROWS = 64
_RELATED = (FieldKind.COUNTER, FieldKind.LINE)
_State = tuple[Any, ...]


@dataclass(frozen=True)
class Explored:
    """The result: a counterexample, or None if there is none, and the number of states."""

    counterexample: Counterexample | None
    states: int


class _Infinite(Exception):
    """The exploration is not finite, or has too many states or input rows."""


def verify_edited(subject: ProofSubject, group: int, seconds: float) -> GroupResult:
    """Prove or refute a group of edited C, or the function that steps all groups (`ALL`)."""
    wrong = wrong_types(subject, group)
    if wrong:
        return GroupResult(group, tuple(wrong), None)
    if group == ALL:
        return verify_group(subject, group, seconds)
    by_contract = prove_group(subject, group, seconds)
    if by_contract.is_proved:
        return GroupResult(group, tuple(by_contract.proofs), None)
    found = find_counterexample(subject, group, by_contract.values, min(seconds, _QUICK_S))
    if found is not None:
        return GroupResult(group, tuple(by_contract.proofs), found)
    opened = _prove_opened(subject, group, seconds)
    if not opened.has_behaviour_unproved:
        return GroupResult(group, tuple(opened.proofs), None)
    seconds = min(seconds, _SEARCH_S)
    explored = explore(subject, group, seconds)
    if explored is not None and explored.counterexample is None:
        name = f'group {group}: all {explored.states} states that can be reached'
        return GroupResult(group, (Proof(name, ProofAnswer.PROVED, 0.0),), None)
    found = explored.counterexample if explored else find_counterexample(
        subject, group, [*opened.values, *by_contract.values], seconds)
    return GroupResult(group, tuple(opened.proofs), found)


def _prove_opened(subject: ProofSubject, group: int, seconds: float) -> GroupProofs:
    """Prove a group by executing the bodies of its cells, with a relation between the states."""
    return prove_contract(subject, group, seconds, lambda: _opened_contract(subject, group),
                          ARITHMETIC)


def _opened_contract(subject: ProofSubject, group: int) -> GroupContract:
    layout, memory = subject.layouts[group], subject.state([group])
    system = transition_system(layout.group, subject.signals(), f'meant.{group}')
    exact = {item.now: _read(layout, group, item)(memory) for item in system.state
             if item.kind not in _RELATED}
    if any(now.sort != found.sort for now, found in exact.items()):
        raise Unreadable('a field of another size')
    state = [replace(item, now=now, after=after) for item, now, after in zip(
        system.state, t.substituted((item.now for item in system.state), exact),
        t.substituted((item.after for item in system.state), exact), strict=True)]
    verdicts = dict(zip(system.verdicts, t.substituted(system.verdicts.values(), exact)))
    given = [*t.substituted(system.invariants, exact),
             *(_related(layout, item, _read(layout, group, item)(memory), item.now)
               for item in state if item.kind in _RELATED)]

    def check(item: StateVariable, wanted: Term) -> Check:
        read = _read(layout, group, item)
        return Check(item.name, lambda after: _related(layout, item, read(after), wanted))

    return GroupContract(replace(system, verdicts=verdicts, state=tuple(state),
                                 invariants=tuple(given)),
                         tuple(check(item, item.after) for item in state),
                         tuple(check(item, item.start) for item in state), ())


def _read(layout: GroupLayout, group: int,
          item: StateVariable) -> Callable[[Mapping[Path, Term]], Term]:
    """Return the function that reads a state variable from memory; positions get 32 bits."""
    _, read = place_of(layout, group, item)
    if item.kind is not FieldKind.POSITION:
        return read
    return lambda memory: t.resized(read(memory), 32, False)


def _related(layout: GroupLayout, item: StateVariable, found: Term, meant: Term) -> Term:
    """Return whether a value of C represents a value of the transition system."""
    operation = layout.group.equations[item.number].operation if item.kind in _RELATED else None
    match operation:
        case Delay():
            return line_related(found, meant, operation.steps)
        case OnceWithin() | AlwaysWithin() | OnceBefore() | SinceWithin() | SinceBefore():
            bound = t.number(operation.bound, WIDTH)
            return counter_model(operation).related(found, meant, bound)
        case _:
            return same_or_false(found, meant)


def explore(subject: ProofSubject, group: int, seconds: float) -> Explored | None:
    """Visit all reachable states of a group and its C; None if there are too many."""
    try:
        return _Explorer(subject, group, time.monotonic() + seconds).run()
    except (_Infinite, NoValue, Unreadable, KeyError):
        return None


class _Explorer:

    def __init__(self, subject: ProofSubject, group: int, until: float) -> None:
        self._runner = runner = ProgramRunner(subject, group)
        self._until = until
        if any(item.op not in ('constant', 'filled') for item in runner.starts):
            raise _Infinite  # the reset does not overwrite the whole state
        roots = [*runner.after, *runner.results]
        self._atoms = list(_atoms(roots, set(runner.inputs)))
        self._rows = list(self._possible(subject))
        decided = {atom: t.variable(f'atom.{place}', t.BOOL)
                   for place, atom in enumerate(self._atoms)}
        self._step = function_of(t.substituted(roots, decided),
                                 [*runner.state, *decided.values()])
        offset = len(runner.state) - len(runner.kept)
        self._coarse = [(offset + place, item.limit, item.mask)
                        for place, item in enumerate(runner.kept)
                        if item.limit is not None or item.mask is not None]
        self._coarse += [(place, limit, None)
                         for place, limit in self._limits(subject, group).items()]

    def _limits(self, subject: ProofSubject, group: int) -> dict[int, int]:
        """Return the limits above which all values of C's counters are proved equivalent."""
        runner, limits = self._runner, {}
        for place, item in enumerate(runner.state[:len(runner.state) - len(runner.kept)]):
            kind, _, number = str(item.value).rpartition('.')[2].partition('_')
            if kind == 'counter':
                operation = subject.layouts[group].group.equations[int(number)].operation
                limits[place] = int(getattr(operation, 'bound', 0)) + 2
        coarse = {runner.state[place]: _at_most(runner.state[place], limit + 1)
                  for place, limit in limits.items()}
        after = [_at_most(item, limits[place] + 1) if place in limits else item
                 for place, item in enumerate(runner.after)]
        roots = [*after, *runner.results]
        goals = [t.same(one, other) for one, other in zip(roots, t.substituted(roots, coarse))]
        seconds = max(0.1, (self._until - time.monotonic()) / 2)
        is_so = prove(goals, seconds=seconds).answer is ProofAnswer.PROVED
        return limits if is_so else {}

    def _possible(
        self, subject: ProofSubject,
    ) -> Iterator[tuple[tuple[bool, ...], tuple[Any, ...]]]:
        """Yield each possible combination of results of the comparisons, with inputs for it."""
        inputs = self._runner.inputs
        given = [t.relation('ult', item, t.number(len(signal.values), item.sort[1]))
                 for item, signal in zip(inputs, subject.program.signals) if signal.is_string]
        compute = function_of(self._atoms, inputs)
        for _ in range(_MOST_ROWS):
            result = prove([t.FALSE], given, seconds=max(0.1, self._until - time.monotonic()))
            if result.answer is ProofAnswer.PROVED:
                return
            if result.answer is ProofAnswer.UNKNOWN:
                raise _Infinite
            row = tuple(result.values.get(item, zero(item.sort)) for item in inputs)
            truth = tuple(compute(*row))
            yield truth, row
            given.append(t.negation(t.all_of(t.same_truth(atom, t.truth(value))
                                             for atom, value in zip(self._atoms, truth))))
        raise _Infinite

    def run(self) -> Explored:
        runner, size = self._runner, len(self._runner.state)
        start = self._canonical(runner.begins[0])
        came_from: dict[_State, tuple[_State, int] | None] = {start: None}
        waiting = [start]
        while waiting:
            if len(came_from) > _MOST_STATES or time.monotonic() > self._until:
                raise _Infinite
            following = []
            for state in waiting:
                for number, (truth, row) in enumerate(self._rows):
                    values = self._step(*state, *truth)
                    found, meant, holds = runner.judged(values[size:])
                    if found != meant or not all(holds):
                        rows = [*self._way(state, came_from), row]
                        return Explored(runner.example(rows, values[size:]), len(came_from))
                    after = self._canonical(values[:size])
                    if after not in came_from:
                        came_from[after] = (state, number)
                        following.append(after)
            waiting = following
        return Explored(None, len(came_from))

    def _canonical(self, values: Sequence[Any]) -> _State:
        state = list(values)
        for place, limit, mask in self._coarse:
            if limit is not None:
                state[place] = min(state[place], limit + 1)
            if mask is not None:
                state[place] &= mask
        return tuple(state)

    def _way(self, state: _State,
             came_from: dict[_State, tuple[_State, int] | None]) -> list[tuple[Any, ...]]:
        rows = []
        step = came_from[state]
        while step is not None:
            state, number = step
            rows.append(self._rows[number][1])
            step = came_from[state]
        return rows[::-1]


def _at_most(item: Term, limit: int) -> Term:
    """Return the minimum of a word and a limit."""
    if limit >> item.sort[1]:
        return item
    bound = t.number(limit, item.sort[1])
    return t.choice(t.relation('ult', bound, item), bound, item)


def _atoms(roots: Sequence[Term], inputs: set[Term]) -> Iterator[Term]:
    """
    Yield the Boolean terms over inputs only, through which all influence of the inputs passes.

    Raises
    ------
    _Infinite
        if inputs have influence in another way.
    """
    order = t.postorder(roots)
    reads: dict[Term, bool] = {}  # whether it reads an input
    mixed: dict[Term, bool] = {}  # whether it reads a variable that is not an input
    for item in order:
        reads[item] = item in inputs or any(reads[each] for each in item.args)
        mixed[item] = (item.op == 'variable' and item not in inputs) \
            or any(mixed[each] for each in item.args)
    pure = {item for item in order if reads[item] and not mixed[item]}
    wanted = dict.fromkeys(root for root in roots if root in pure)
    for item in order:
        if item not in pure:
            wanted.update(dict.fromkeys(each for each in item.args if each in pure))
    yield from dict.fromkeys(atom for item in wanted for atom in _truths(item))


def _truths(item: Term) -> Iterator[Term]:
    """Yield the Boolean terms that a term of inputs consists of; raises `_Infinite`."""
    if item.sort == t.BOOL and item.op != 'constant':
        yield item
    elif item.op == 'variable':
        raise _Infinite
    else:
        for each in item.args:
            yield from _truths(each)
