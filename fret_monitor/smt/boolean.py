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
The transition system of a step group with a state of bits, for decision diagrams.

Counters and delays become bits. Numbers occur only in comparisons, its *atoms*. A comparison of
numbers of the step before alone becomes a bit too: whether the comparison held at that step. So
the state has numbers only where a comparison relates them to inputs (`x - pre x <= 5`).
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from fret_monitor.program.layout import FieldKind
from fret_monitor.program.monitor_program import (
    AlwaysWithin, CounterCell, Delay, OnceBefore, OnceWithin, SinceBefore, SinceBetween,
    SinceWithin, StepGroup,
)
from fret_monitor.smt import terms as t
from fret_monitor.smt.terms import Term
from fret_monitor.smt.transition import NotModelled, StateVariable, SystemBuilder

_CONNECTIVES = frozenset({'not', 'and', 'iff', 'choice', 'constant', 'variable'})
_MOST_LIFTED = 256  # comparisons that one becomes by its choices


class TooLarge(Exception):
    """A system has no form of this kind, or one that is too large; the argument says why."""


@dataclass(frozen=True)
class Bit:
    """A bit of the state: its variable, its value in the initial state, and after the step."""

    now: Term
    start: bool
    after: Term


@dataclass(frozen=True)
class BitSystem:
    """A step group: the verdicts by property, and a state of bits and of numbers."""

    verdicts: Mapping[int, Term]
    bits: tuple[Bit, ...]
    numbers: tuple[StateVariable, ...]

    @property
    def state(self) -> tuple[StateVariable, ...]:
        """The bits and the numbers."""
        return (*(StateVariable(FieldKind.FLAG, number, item.now, t.truth(item.start), item.after)
                  for number, item in enumerate(self.bits)), *self.numbers)


@dataclass(frozen=True)
class BooleanSystem:
    """
    A step group over bits, Boolean inputs and atoms.

    `outputs` are the terms that were asked for. `inputs` are the Boolean inputs that occur.
    `atoms` are the comparisons; those in `related` compare inputs with `numbers`, which are the
    numbers of the step before that remain. `tracked` are bits and the atom over `numbers` that
    each is the value of.
    """

    outputs: tuple[Term, ...]
    bits: tuple[Bit, ...]
    inputs: tuple[Term, ...]
    atoms: tuple[Term, ...]
    related: tuple[Term, ...]
    numbers: tuple[StateVariable, ...]
    tracked: Mapping[Term, Term]


class BitBuilder(SystemBuilder):
    """Builds a transition system whose counters and delays are bits; `bits` collects them."""

    def __init__(self, group: StepGroup, inputs: Mapping[int, Term], most_bits: int) -> None:
        """Store the group and its inputs; `most_bits` limits the state."""
        super().__init__(group, inputs, 'state')
        self.bits: list[Bit] = []
        self._most_bits = most_bits

    def add(self, kind: FieldKind, number: int, now: Term, start: Term, after: Term,
            limit: int | None = None, mask: int | None = None) -> None:
        """Add a state variable; one of sort BOOL is a bit."""
        if kind is FieldKind.POSITION:
            return  # rings are shift registers here
        if now.sort == t.BOOL:
            self.bits.append(Bit(now, bool(t.plain(start)), after))
            if len(self.bits) > self._most_bits:
                raise TooLarge(f'its state has more than {self._most_bits} bits')
        else:
            super().add(kind, number, now, start, after, limit, mask)

    def _variables(self, name: str, count: int) -> list[Term]:
        return [t.variable(f'state.{name}.{place}', t.BOOL) for place in range(count)]

    def counter(self, index: int, operation: CounterCell, arguments: list[Term]) -> Term:
        """Add a counter that saturates at bound + 1, and return what the cell returns."""
        far = operation.bound + 1
        age = self._variables(f'counter_{index}', far.bit_length())
        match operation:
            case OnceWithin() | AlwaysWithin():
                start = far - operation.head
                reset = arguments[0] if isinstance(operation, OnceWithin) \
                    else t.negation(arguments[0])
                now = [t.conjunction(t.negation(reset), item) for item in age]
                recent = t.negation(_is_number(now, far))
                out = recent if isinstance(operation, OnceWithin) else t.negation(recent)
            case SinceWithin():
                start = far
                left, right = arguments
                kept = _chosen(left, age, far)
                now = [t.conjunction(t.negation(right), item) for item in kept]
                out = t.negation(_is_number(now, far))
            case OnceBefore() | SinceBefore():
                start = 0
                if isinstance(operation, SinceBefore):
                    age_now = [t.conjunction(arguments[0], item) for item in age]
                else:
                    age_now = age
                has_been = t.disjunction(arguments[-1], t.negation(_is_number(age_now, 0)))
                now = [t.conjunction(has_been, item) for item in _more(age_now, far)]
                out = _is_number(now, far)
        after = now if isinstance(operation, OnceBefore | SinceBefore) else _more(now, far)
        for place, item in enumerate(age):
            self.add(FieldKind.COUNTER, index, item, t.truth(bool(start >> place & 1)),
                     after[place])
        return out

    def queue(self, index: int, operation: SinceBetween, arguments: list[Term]) -> Term:
        """Refuse a queue."""
        raise NotModelled('queues')

    def line(self, index: int, operation: Delay, argument: Term) -> Term:
        """Add a shift register, and return what the cell returns."""
        if operation.steps > self._most_bits:
            raise TooLarge(f'it stores {operation.steps} steps of the past')
        items = self._variables(f'line_{index}', operation.steps)
        for item, after in zip(items, [argument, *items], strict=False):
            self.add(FieldKind.LINE, index, item, t.truth(operation.initial), after)
        return items[-1]

    def ring(self, index: int, operation: Delay, argument: Term) -> Term:
        """Add a shift register, and return what the cell returns."""
        return self.line(index, operation, argument)


def _is_number(bits: Sequence[Term], value: int) -> Term:
    return t.all_of(item if value >> place & 1 else t.negation(item)
                    for place, item in enumerate(bits))


def _chosen(condition: Term, bits: Sequence[Term], other: int) -> list[Term]:
    return [t.choice(condition, item, t.truth(bool(other >> place & 1)))
            for place, item in enumerate(bits)]


def _more(bits: Sequence[Term], far: int) -> list[Term]:
    """Return the number plus 1, and `far` for `far`."""
    is_far = _is_number(bits, far)
    carry = t.TRUE
    found = []
    for place, item in enumerate(bits):
        more = t.negation(t.same_truth(item, carry))
        found.append(t.choice(is_far, t.truth(bool(far >> place & 1)), more))
        carry = t.conjunction(carry, item)
    return found


def bit_system(group: StepGroup, inputs: Mapping[int, Term],
               most_bits: int = 4096) -> BitSystem:
    """
    Return the system of a group with counters and delays as bits.

    Raises
    ------
    TooLarge
        if the state has more than `most_bits` bits.
    """
    builder = BitBuilder(group, inputs, most_bits)
    system = builder.build()
    return BitSystem(system.verdicts, tuple(builder.bits), system.state)


def boolean_system(system: BitSystem, inputs: Iterable[Term],
                   wanted: Iterable[int]) -> BooleanSystem:
    """
    Return a system with atoms; its outputs are the verdicts of the properties in `wanted`.

    Raises
    ------
    TooLarge
        if a comparison has too many cases.
    """
    return _Atoms(system.bits, system.numbers, inputs).collect(
        [system.verdicts[number] for number in wanted])


class _Atoms:
    """Collects the atoms of a system, and turns those of the step before into bits."""

    def __init__(self, bits: Sequence[Bit], numbers: Sequence[StateVariable],
                 inputs: Iterable[Term]) -> None:
        self._bits = list(bits)
        self._numbers = {item.now: item for item in numbers}
        self._inputs = set(inputs)
        self._known: dict[Term, Term] = {}
        self._delayed: dict[Term, Term] = {}  # by atom of numbers of the step before
        self._atoms: dict[Term, None] = {}
        self._related: dict[Term, None] = {}

    def collect(self, outputs: Sequence[Term]) -> BooleanSystem:
        found = [self._flat(item) for item in outputs]
        done = 0
        is_tracking = False
        while True:
            while done < len(self._bits):  # new bits come from delayed atoms
                bit = self._bits[done]
                self._bits[done] = Bit(bit.now, bit.start, self._flat(bit.after))
                done += 1
            if is_tracking:
                break
            is_tracking = True
            self._track()
        roots = [*found, *(item.after for item in self._bits)]
        inputs = [item for item in t.postorder(roots)
                  if item.op == 'variable' and item in self._inputs and item.sort == t.BOOL]
        used = {item for atom in self._related for item in t.postorder([atom])}
        return BooleanSystem(
            tuple(found), tuple(self._bits), tuple(inputs), tuple(self._atoms),
            tuple(self._related),
            tuple(item for now, item in self._numbers.items() if now in used),
            {bit: atom for atom, bit in self._delayed.items()})

    def _flat(self, root: Term) -> Term:
        """Return a term in which comparisons of the step before are bits."""
        for item in t.postorder([root], self._known):
            if item.sort != t.BOOL:
                self._known[item] = item
            elif item.op in _CONNECTIVES:
                args = {each: self._known[each] for each in item.args}
                self._known[item] = t.substituted([item], args)[0]
            else:
                self._known[item] = self._comparison(item)
        return self._known[root]

    def _comparison(self, atom: Term) -> Term:
        """Return an atom, with choices by the state lifted out of it."""
        cases = 0
        stack = [atom]
        found: dict[Term, Term] = {}
        while stack:
            item = stack[-1]
            condition = self._state_condition(item)
            if item in found or condition is None:
                found.setdefault(item, self._atom(item) if item.op not in _CONNECTIVES else item)
                stack.pop()
                continue
            yes, no = (t.substituted([item], {condition: value})[0]
                       for value in (t.TRUE, t.FALSE))
            missing = [each for each in (yes, no) if each not in found]
            if missing:
                stack += missing
                cases += 1
                if cases > _MOST_LIFTED:
                    raise TooLarge('a comparison has too many cases')
                continue
            found[item] = t.choice(self._flat(condition), found[yes], found[no])
            stack.pop()
        return found[atom]

    def _state_condition(self, atom: Term) -> Term | None:
        """Return the condition of a choice in an atom that depends on the state."""
        for item in t.postorder([atom]):
            if item.op == 'choice' and item.sort != t.BOOL and any(
                    each.sort == t.BOOL and each not in self._inputs
                    for each in variables(item.args[0])):
                return item.args[0]
        return None

    def _atom(self, atom: Term) -> Term:
        used = variables(atom)
        before = {item for item in used if item in self._numbers}
        if not before:
            self._atoms[atom] = None
        elif before == used:
            return self._bit_of(atom)
        else:
            self._atoms[atom] = None
            self._related[atom] = None
        return atom

    def _bit_of(self, atom: Term) -> Term:
        """Return the bit that has the value of an atom over numbers of the step before."""
        if atom not in self._delayed:
            used = [self._numbers[item] for item in variables(atom)]
            start, = t.substituted([atom], {item.now: item.start for item in used})
            after, = t.substituted([atom], {item.now: item.after for item in used})
            bit = t.variable(f'state.before_{len(self._delayed)}', t.BOOL)
            self._delayed[atom] = bit
            self._bits.append(Bit(bit, bool(t.plain(start)), after))
        return self._delayed[atom]

    def _track(self) -> None:
        """Remember of the numbers that remain how they compared at the step before."""
        for now in {item for atom in self._related for item in variables(atom)
                    if item in self._numbers}:
            source = self._numbers[now].after
            for atom in list(self._atoms):
                if variables(atom) == {source}:
                    self._bit_of(t.substituted([atom], {source: now})[0])


def variables(item: Term) -> set[Term]:
    """Return the variables of a term."""
    return {each for each in t.postorder([item]) if each.op == 'variable'}
