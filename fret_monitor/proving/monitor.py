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
Proof obligations of a monitor's C: verdicts, state, reset, description, defined behaviour.

Each group is proved separately, for all states and inputs, with cells replaced by contracts. For
most obligations the two terms to compare are then the same object. The functions that step or
reset all groups are compared with a sequence of calls for each group.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import reduce
import time
from typing import Any

from fret_monitor.model.policies import Policy
from fret_monitor.program.layout import GroupLayout
from fret_monitor.program.monitor_program import MonitorProgram
from fret_monitor.proving.c_source import BOOL, CProgram, LONG, Struct, Unreadable
from fret_monitor.proving.contracts import ARITHMETIC, CELLS
from fret_monitor.proving.description import (
    occurrence_places, wrong_in_description, wrong_types_of_inputs, wrong_types_of_state,
)
from fret_monitor.proving.execution import (
    Contract, Machine, Memory, Path, places, Reference, Result, sort_of, Value,
)
from fret_monitor.proving.group_contract import group_contract, GroupContract, same_or_false
from fret_monitor.proving.obligations import Proof
from fret_monitor.proving.timed_cells import AskedTicks
from fret_monitor.proving.windows import WINDOWS
from fret_monitor.smt import terms as t
from fret_monitor.smt.solver import ProofAnswer, prove, PROVED, shown_values
from fret_monitor.smt.terms import Term
from fret_monitor.smt.transition import earlier, NEVER, TransitionSystem

ALL = -1  # the functions that step or reset all groups
ANY = -2  # likewise, with the step function in the description (`step_any`)
_CONTRACTS = {**ARITHMETIC, **CELLS, **WINDOWS}
_TYPES = 'the program needs a field of another type'
_STATIC = ('description: ', 'inputs: ')  # no trace can refute these


@dataclass
class GroupProofs:
    """
    The proofs of a group, or of the functions for all groups (ALL).

    `values` are the values of variables at which obligations fail.
    """

    group: int
    proofs: list[Proof] = field(default_factory=list)
    values: list[Mapping[Term, Any]] = field(default_factory=list)

    @property
    def is_proved(self) -> bool:
        """Whether all obligations are proved."""
        return all(proof.answer is ProofAnswer.PROVED for proof in self.proofs)

    @property
    def has_behaviour_unproved(self) -> bool:
        """Whether an obligation is unproved that a trace could refute."""
        return any(proof.answer is not ProofAnswer.PROVED and not proof.name.startswith(_STATIC)
                   for proof in self.proofs)


@dataclass(frozen=True)
class ProofSubject:
    """The C text and the program it must implement; `prefix` is that of the names in C."""

    code: CProgram
    program: MonitorProgram
    layouts: tuple[GroupLayout, ...]
    prefix: str
    source_hash: str

    def state(self, groups: Sequence[int]) -> Memory:
        """Return memory with an arbitrary state of some groups."""
        fields = dict(self.code.structs[f'{self.prefix}_state'])
        memory: Memory = {}
        for group in groups:
            name = f'group_{group}'
            for path, kind in places(self.code, fields[name], ('state', name)):
                memory[path] = t.variable('.'.join(map(str, path)), sort_of(kind))
        return memory

    def inputs(self) -> Memory:
        """Return memory with arbitrary inputs."""
        return {path: t.variable('.'.join(map(str, path)), sort_of(kind)) for path, kind
                in places(self.code, Struct(f'{self.prefix}_inputs'), ('inputs',))}

    def signals(self) -> dict[int, Term]:
        """Return the inputs by their index."""
        return dict(enumerate(self.inputs().values()))

    def call_reset(self, machine: Machine, group: int) -> None:
        """Execute the function that resets a group, or all groups."""
        machine.call(self._function(group, 'reset'), [self._state()])

    def call_step(self, machine: Machine, group: int) -> Result:
        """Execute the function that steps a group, or all groups."""
        if self.is_timed:
            return machine.call(self._function(group, 'step_at'), self.arguments())
        return machine.call(self._function(group, 'step'), self.arguments())

    def arguments(self) -> list[Reference | Value]:
        """Return the arguments of a step function."""
        length = len(self.program.properties) + len(self.occurrences)
        verdicts = Reference(('verdicts',), BOOL, t.number(0, 64), length)
        inputs = Reference(('inputs',), Struct(f'{self.prefix}_inputs'))
        tick = [Value(LONG, self.tick)] if self.is_timed else []
        return [self._state(), inputs, verdicts, *tick]

    @property
    def is_timed(self) -> bool:
        """Whether the groups step at ticks."""
        return self.program.policy is Policy.TIMED

    @property
    def tick(self) -> Term:
        """An arbitrary tick."""
        return t.variable('tick', t.word(64))

    @property
    def occurrences(self) -> dict[int, int]:
        """The index of the verdict for occurrences, by requirement that has one of its own."""
        return occurrence_places(self.program, self.layouts)

    def _state(self) -> Reference:
        return Reference(('state',), Struct(f'{self.prefix}_state'))

    def _function(self, group: int, verb: str) -> str:
        if group == ANY and verb == 'step':
            return f'{self.prefix}_step_any'
        return f'{self.prefix}_group_{group}_{verb}' if group >= 0 else f'{self.prefix}_{verb}'


def wrong_types(subject: ProofSubject, group: int) -> list[Proof]:
    """
    Return a failed proof for each field with a wrong type, of a group or of ALL.

    A counter only has to be unsigned; that it is wide enough is a separate obligation.
    """
    groups = range(len(subject.layouts)) if group == ALL else [group]
    found = [f'group {number}: type of {text}' for number in groups
             for text in wrong_types_of_state(subject.code, subject.layouts[number],
                                              f'{subject.prefix}_group_{number}')]
    if group != ALL:
        found += [f'group {group}: type of inputs.{text}' for text in
                  wrong_types_of_inputs(subject.code, subject.program, subject.prefix)]
    return [Proof(text, ProofAnswer.UNKNOWN, 0.0, _TYPES) for text in found]


def prove_group(subject: ProofSubject, group: int, seconds: float) -> GroupProofs:
    """Prove a group with cells replaced by contracts; `seconds` limits each obligation."""
    return prove_contract(
        subject, group, seconds, lambda: group_contract(
            subject.layouts[group], group, subject.state([group]), subject.signals(),
            subject.tick),
        _CONTRACTS)


def prove_contract(subject: ProofSubject, group: int, seconds: float,
                   contract: Callable[[], GroupContract],
                   functions: Mapping[str, Contract]) -> GroupProofs:
    """Prove that a group satisfies a contract; `functions` are replaced by their contracts."""
    outcome = GroupProofs(group)
    before = time.perf_counter()
    try:
        wanted = contract()
        goals = list(_goals(subject, group, wanted, functions))
    except (Unreadable, KeyError) as error:
        what = f'no {error.args[0]} in C' if isinstance(error, KeyError) else str(error)
        outcome.proofs.append(Proof(f'group {group}: read', ProofAnswer.UNKNOWN,
                                    time.perf_counter() - before, what))
        return outcome
    for name, goal in goals:
        _settle(outcome, f'group {group}: {name}', goal, wanted.system.invariants, seconds)
    return outcome


def _settle(outcome: GroupProofs, name: str, goal: Term, given: Sequence[Term],
            seconds: float) -> None:
    result = PROVED if goal in given else prove([goal], given, seconds=seconds)
    detail = shown_values(result.values)
    if result.answer is ProofAnswer.REFUTED:
        outcome.values.append(result.values)
    outcome.proofs.append(Proof(name, result.answer, result.seconds, detail))


def _goals(subject: ProofSubject, group: int, wanted: GroupContract,
           functions: Mapping[str, Contract]) -> Iterator[tuple[str, Term]]:
    state, inputs = subject.state([group]), subject.inputs()
    for name, is_wide in wanted.fits:
        yield f'{name} is wide enough', t.truth(is_wide)
    reset = Machine(subject.code, state, functions)
    subject.call_reset(reset, group)
    yield from _starts(wanted, reset, state)
    ticks = AskedTicks(subject.tick)
    contracts = {**functions, **ticks.contracts} if subject.is_timed else functions
    step = Machine(subject.code, {**state, **inputs}, contracts)
    due = subject.call_step(step, group)
    yield from _steps(subject, wanted, step, {**state, **inputs})
    if wanted.system.due is not None:
        yield 'next tick', _is_due(wanted.system, due, ticks.asked)
        yield 'no value changes before the next tick', t.all_of(wanted.lasts)


def _is_due(system: TransitionSystem, found: Result, asked: Sequence[Term]) -> Term:
    """Return whether a step returns the next tick; `asked` is what its cells ask for."""
    if not isinstance(found, Value) or len(asked) != len(system.asked) or system.due is None:
        return t.FALSE
    same = t.all_of(map(same_or_false, asked, system.asked))
    return t.conjunction(same, same_or_false(found.term, system.due))


def _starts(wanted: GroupContract, machine: Machine,
            before: Memory) -> Iterator[tuple[str, Term]]:
    for check in wanted.starts:
        yield f'reset: {check.what}', check.holds(machine.memory)
    yield 'reset: nothing else is written', t.truth(machine.memory.keys() == before.keys())
    for condition in machine.conditions:
        yield f'defined: {condition.what}', condition.holds


def _steps(subject: ProofSubject, wanted: GroupContract, machine: Machine,
           before: Memory) -> Iterator[tuple[str, Term]]:
    memory, meant = machine.memory, wanted.system.verdicts
    for number, verdict in meant.items():
        found = memory.get(('verdicts', number))
        name = f'verdict of {subject.program.properties[number].id}'
        yield name, t.FALSE if found is None else t.same_truth(found, verdict)
    places = subject.occurrences
    for number, verdict in wanted.system.occurrences.items():
        found = memory.get(('verdicts', places[number]))
        name = f'occurrences of {subject.program.properties[number].id}'
        yield name, t.FALSE if found is None else t.same_truth(found, verdict)
    for check in wanted.steps:
        yield f'step: {check.what}', check.holds(memory)
    verdicts: set[Path] = {('verdicts', number) for number in meant}
    verdicts |= {('verdicts', places[number]) for number in wanted.system.occurrences}
    others = memory.keys() - before.keys() - verdicts
    yield 'step: nothing else is written', t.truth(not others and _keeps_inputs(before, memory))
    for condition in machine.conditions:
        yield f'defined: {condition.what}', condition.holds


def _keeps_inputs(before: Memory, after: Memory) -> bool:
    return all(after[path] is value for path, value in before.items() if path[0] == 'inputs')


def prove_whole(subject: ProofSubject, seconds: float) -> GroupProofs:
    """Prove the functions for all groups, and the description."""
    outcome = GroupProofs(ALL)
    before = time.perf_counter()
    try:
        for name, goal in _whole_goals(subject):
            _settle(outcome, name, goal, _positions(subject), seconds)
    except (Unreadable, KeyError) as error:
        outcome.proofs.append(Proof('all groups: read', ProofAnswer.UNKNOWN,
                                    time.perf_counter() - before, str(error)))
    return outcome


def _positions(subject: ProofSubject) -> list[Term]:
    """Return the invariants of the ring positions of all groups."""
    found = []
    for path, item in subject.state(range(len(subject.layouts))).items():
        kind, _, number = str(path[-1]).partition('_')
        if kind == 'position':
            found.append(t.relation('ult', t.resized(item, 32, False),
                                    t.number(int(number), 32)))
    return found


def _whole_goals(subject: ProofSubject) -> Iterator[tuple[str, Term]]:
    groups = range(len(subject.layouts))
    state, inputs = subject.state(groups), subject.inputs()

    def ran(call: Callable[[Machine], None], memory: Memory) -> Machine:
        machine = Machine(subject.code, memory, _CONTRACTS)
        call(machine)
        return machine

    def one_by_one(verb: Callable[[Machine, int], object]) -> Callable[[Machine], None]:
        def run(machine: Machine) -> None:
            for group in groups:
                verb(machine, group)
        return run

    whole = ran(lambda machine: subject.call_reset(machine, ALL), state)
    parts = ran(one_by_one(subject.call_reset), state)
    yield from _equal('reset of all groups', whole, parts)
    if subject.is_timed:
        yield from _equal_at(subject, {**state, **inputs})
    else:
        names = [f'{subject.prefix}_step']
        if len(groups) > 1:
            names.append(f'{subject.prefix}_step_any')
        parts = ran(one_by_one(subject.call_step), {**state, **inputs})
        for name in names:
            def stepping(machine: Machine, name: str = name) -> None:
                machine.call(name, subject.arguments())
            yield from _equal(f'{name}: all groups', ran(stepping, {**state, **inputs}), parts)
    for text in wrong_types_of_inputs(subject.code, subject.program, subject.prefix):
        yield f'inputs: {text}', t.FALSE
    yield 'inputs: as many and of the types that the program has', t.TRUE
    wrong = wrong_in_description(subject.code, subject.program, subject.layouts, subject.prefix,
                                 subject.source_hash)
    for text in wrong:
        yield f'description: {text}', t.FALSE
    yield 'description: inputs, groups and requirements', t.truth(not wrong)


def _equal_at(subject: ProofSubject, memory: Memory) -> Iterator[tuple[str, Term]]:
    """Yield the obligations of the function that steps all groups at a tick."""
    name = f'{subject.prefix}_step_at'
    machines, dues = [], []
    for groups in ([ALL], range(len(subject.layouts))):
        contracts = {**_CONTRACTS, **AskedTicks(subject.tick).contracts}
        machine = Machine(subject.code, memory, contracts)
        found = [subject.call_step(machine, group) for group in groups]
        dues.append([item.term for item in found if isinstance(item, Value)])
        machines.append(machine)
    yield from _equal(f'{name}: all groups', *machines)
    earliest = reduce(earlier, dues[1], NEVER)
    is_same = len(dues[0]) == 1 and dues[0][0].sort == earliest.sort
    yield f'{name}: next tick', t.same(dues[0][0], earliest) if is_same else t.FALSE


def _equal(name: str, whole: Machine, parts: Machine) -> Iterator[tuple[str, Term]]:
    """
    Yield the obligations that two machines have equal memory and conditions.

    Conditions of `parts` are covered by the proofs of the groups.
    """
    missing = whole.memory.keys() ^ parts.memory.keys()
    yield f'{name}: the same places are written', t.truth(not missing)
    # `none` is the unused field of a struct that would otherwise be empty.
    same = [t.same(whole.memory[path], parts.memory[path])
            for path in whole.memory.keys() & parts.memory.keys() if path[-1] != 'none']
    yield f'{name}: the same values', t.all_of(same)
    known = {condition.holds for condition in parts.conditions}
    for condition in whole.conditions:
        if condition.holds not in known:
            yield f'{name}: defined: {condition.what}', condition.holds
