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
Binary decision diagrams of a Boolean system: its steps, and who chooses what in them.

A set of states is a diagram over the bits of the state. A set of steps is one over the bits, the
choices of the environment and those of the system.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

from fret_monitor.analysis.letters import Block
from fret_monitor.smt import terms as t
from fret_monitor.smt.boolean import BooleanSystem
from fret_monitor.smt.terms import Term
from fret_monitor.traces.deadline import Deadline

try:
    from dd.cudd import BDD
except ImportError:  # a platform without a wheel
    from dd.autoref import BDD

Node: TypeAlias = Any
_MEMORY_BYTES = 2 * 2 ** 30
_LEAST_BYTES = 2 ** 26
_FULL_AFTER_S = 100.0  # about the time in which the memory fills
_MANY_NODES = 100_000  # before variables are moved
_ROUNDS = 32  # between two looks at how many there are


class MemoryErrors:
    """
    Raises MemoryError where `dd` reports that CUDD has reached the limit of its memory.

    It is no generator (`contextlib`), since that would keep the error in a cycle, and with it the
    diagrams until the garbage collector runs.
    """

    def __enter__(self) -> None:
        """Do nothing."""

    def __exit__(self, _: object, error: BaseException | None, place: object) -> None:
        """Replace an error."""
        if isinstance(error, RuntimeError | ValueError) and (
                'NULL' in str(error) or 'failed' in str(error)):
            del error, place
            raise MemoryError


@dataclass(frozen=True)
class Choices:
    """The variables of a block's environment terms, of its others, and of its classes."""

    block: Block
    environment: tuple[str, ...]
    others: tuple[str, ...]
    classes: tuple[str, ...]


def _manager(deadline: Deadline) -> BDD:
    """
    Return a manager of diagrams.

    An operation of CUDD cannot be interrupted. Its memory is limited to what fills in the time
    that is left, so that it ends by then.
    """
    if 'cudd' not in BDD.__module__:
        manager = BDD()
        manager.configure(reordering=False)
        return manager
    share = deadline.at_most(_FULL_AFTER_S) / _FULL_AFTER_S
    manager = BDD(memory_estimate=_MEMORY_BYTES)
    manager.configure(reordering=False,
                      max_memory=max(_LEAST_BYTES, int(share * _MEMORY_BYTES)))
    return manager


def _order(bit: str) -> tuple[int, str]:
    """
    Return a key to sort bits by: those of all counters by their place, the highest first.

    Sets in which counters are compared have small diagrams in this order.
    """
    name, _, place = bit.rpartition('.')
    return (-int(place), name) if place.isdecimal() else (1, bit)


class Diagrams:
    """
    The steps of a system.

    `possible` are the steps whose comparisons can hold together; `enabled` are the choices of the
    environment that can be made; `outputs` are the terms of the system's outputs.
    """

    def __init__(self, system: BooleanSystem, blocks: Sequence[Block],
                 deadline: Deadline) -> None:
        """Translate a system."""
        self.deadline = deadline
        self.bdd = _manager(deadline)
        self._rounds = 0
        self.system = system
        self.bits = [item.now.value for item in system.bits]
        self._known: dict[Term, Node] = {}
        self.choices: list[Choices] = []
        self._declare(blocks)
        self.environment = [name for item in self.choices
                            for name in (*item.environment, *item.classes)]
        self.own = [name for item in self.choices for name in item.others]
        self.after = {item.now.value: self.node(item.after) for item in system.bits}
        self.outputs = [self.node(item) for item in system.outputs]
        self.start = self.bdd.cube({item.now.value: item.start for item in system.bits})
        self.possible, self.enabled = self.bdd.true, self.bdd.true
        for item in self.choices:
            self._add_block(item)

    def _declare(self, blocks: Sequence[Block]) -> None:
        number = 0
        for block in blocks:
            names = [f'choice.{number + place}' for place in range(len(block.environment))]
            others = [f'choice.{number + len(names) + place}'
                      for place in range(len(block.others))]
            number += len(names) + len(others)
            size = 0 if block.classes is None else max(0, len(block.classes) - 1).bit_length()
            classes = [f'class.{number + place}' for place in range(size)]
            number += size
            self.bdd.declare(*names, *others, *classes)
            for term, name in zip((*block.environment, *block.others), [*names, *others]):
                self._known[term] = self.bdd.var(name)
            self.choices.append(Choices(block, tuple(names), tuple(others), tuple(classes)))
        if self.bits:
            self.bdd.declare(*sorted(self.bits, key=_order))
        for item in self.system.bits:
            self._known[item.now] = self.bdd.var(item.now.value)
        for bit, atom in ((bit, atom) for bit, atom in self.system.tracked.items()):
            self._known.setdefault(atom, self.bdd.var(bit.value))

    def node(self, root: Term) -> Node:
        """Return the diagram of a truth value."""
        for item in t.postorder([root], self._known):
            self.deadline.check()
            args = [self._known[each] for each in item.args]
            match item.op:
                case 'constant':
                    found = self.bdd.true if item.value else self.bdd.false
                case 'not':
                    found = ~args[0]
                case 'and':
                    found = args[0] & args[1]
                case 'iff':
                    found = self.bdd.apply('<=>', *args)
                case 'choice':
                    found = self.bdd.ite(*args)
                case _:
                    raise AssertionError(f'{item.op} is not Boolean')
            self._known[item] = found
        return self._known[root]

    def _add_block(self, item: Choices) -> None:
        block = item.block
        if block.is_free:
            return
        names = [*item.environment, *item.others]
        terms = block.terms
        together, certain = self.bdd.false, self.bdd.false
        for letter in block.letters:
            self.deadline.check()
            cube = self._cube(terms, names, letter.truths)
            together |= cube
            if letter.is_certain:
                certain |= cube
        if block.classes is None:
            enabled = self.bdd.exist(item.others, certain)
        else:
            enabled, together = self._classes(item)
        self.possible &= together
        self.enabled &= enabled

    def _cube(self, terms: Sequence[Term], names: Sequence[str],
              truths: Sequence[bool]) -> Node:
        found = self.bdd.true
        for place, (term, value) in enumerate(zip(terms, truths)):
            node = self.bdd.var(names[place]) if place < len(names) else self._known[term]
            found &= node if value else ~node
        return found

    def _classes(self, item: Choices) -> tuple[Node, Node]:
        """Return the classes that there are, and the letters that each leaves."""
        block = item.block
        enabled, together = self.bdd.false, self.bdd.false
        names = [*item.environment, *item.others]
        for number, found in enumerate(block.classes or ()):
            code = {name: bool(number >> place & 1) for place, name in enumerate(item.classes)}
            code.update(zip(item.environment, found.truths))
            here = self.bdd.cube(code)
            enabled |= here
            letters = self.bdd.false
            for choice in found.choices:
                letters |= self._cube(block.terms, names, block.letters[choice].truths)
            together |= here & letters
        return enabled, together

    # -- operations -------------------------------------------------------------------------

    def before(self, states: Node) -> Node:
        """Return the steps that lead to some states."""
        self._work_on()
        return self.at(states, self.after)

    def _work_on(self) -> None:
        """Check the time, and let variables move once there are many nodes."""
        self.deadline.check()
        self._rounds += 1
        if self._rounds % _ROUNDS == 0 and len(self.bdd) > _MANY_NODES:  # slow to count
            self.bdd.configure(reordering=True)

    def some(self, steps: Node) -> Node:
        """Return the states that have one of some steps."""
        self.deadline.check()
        return self.bdd.exist([*self.environment, *self.own], steps)

    def forced(self, steps: Node) -> Node:
        """Return the states in which the system can choose one of some steps, whatever comes."""
        self.deadline.check()
        answered = self.bdd.exist(self.own, self.possible & steps)
        return self.bdd.forall(self.environment, ~self.enabled | answered)

    def contains_start(self, states: Node) -> bool:
        """Whether some states contain the initial one."""
        return bool(self.start & states != self.bdd.false)

    def all_of(self, nodes: Iterable[Node]) -> Node:
        """Return the conjunction of some diagrams."""
        found = self.bdd.true
        for item in nodes:
            self.deadline.check()
            found &= item
        return found

    def at(self, node: Node, values: Mapping[str, Any]) -> Node:
        """Return a diagram with values, or diagrams, for some of its variables."""
        found = {name: values[name] for name in self.bdd.support(node) if name in values}
        return self.bdd.let(found, node) if found else node

    def after_from(self, state: Mapping[str, bool]) -> dict[str, Node]:
        """Return for each bit the choices that make it true after a step from a state."""
        return {name: self.at(node, state) for name, node in self.after.items()}

    def picked(self, node: Node, names: Sequence[str],
               before: Mapping[str, bool]) -> dict[str, bool]:
        """Return values of some variables in a diagram, as near as possible to those before."""
        found: dict[str, bool] = {}
        for name in names:
            wanted = before.get(name, False)
            rest = self.at(node, {name: wanted})
            if rest == self.bdd.false:
                wanted = not wanted
                rest = self.at(node, {name: wanted})
            found[name] = wanted
            node = rest
        return found
