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
A second, independent check of a fixed point.

A set of states that decision diagrams found is checked by z3 on the system of `smt/transition.py`,
whose counters are words and whose models of the cells are proved (docs/prove.md). The choices that
keep a run in the set are functions of state and inputs, so that one query without quantifiers is
enough. Comparisons are truth values here, too; `letters.py` confirms each of their combinations.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from fret_monitor.analysis.diagrams import Diagrams, Node
from fret_monitor.analysis.games import Games
from fret_monitor.program.layout import FieldKind
from fret_monitor.program.monitor_program import StepGroup
from fret_monitor.smt import terms as t
from fret_monitor.smt.cells import WIDTH
from fret_monitor.smt.solver import ProofAnswer, prove
from fret_monitor.smt.terms import Term
from fret_monitor.smt.transition import transition_system

_SECONDS = 20.0
_MOST_NODES = 20_000


class NotComparable(Exception):
    """The two systems have states that cannot be related, or a set is too large."""


class SecondCheck:
    """Checks sets of states of one system."""

    def __init__(self, group: StepGroup, inputs: Sequence[Term], games: Games) -> None:
        """Build the second system, and relate its state to the bits of the first."""
        self._games = games
        self._d: Diagrams = games.diagrams
        if self._d.system.numbers or self._d.system.tracked:
            raise NotComparable
        self._system = transition_system(group, dict(enumerate(inputs)), 'state')
        self._bits: dict[str, Term] = {}
        for item in self._system.state:
            self._relate(item.kind, item.number, item.now, item.limit, item.mask)
        if not set(self._d.bits) <= set(self._bits):
            raise NotComparable
        self._after = {item.now: item.after for item in self._system.state}
        self._start = {item.now: item.start for item in self._system.state}
        self._names: dict[Term, Term] = {}
        self._variables: dict[str, Term] = {}
        for choice in self._d.choices:
            if choice.block.given or choice.classes:
                raise NotComparable
            for term, name in zip(choice.block.terms, (*choice.environment, *choice.others)):
                self._variables[name] = t.variable(name, t.BOOL)
                self._names[term] = self._variables[name]

    def _relate(self, kind: FieldKind, number: int, now: Term, limit: int | None,
                mask: int | None) -> None:
        """Name the bits of a state variable as `smt/boolean.py` does."""
        if now.sort == t.BOOL:
            self._bits[now.value] = now
        elif limit is not None:
            far = t.number(limit + 1, WIDTH)
            age = t.choice(t.relation('ult', far, now), far, now)
            for place in range((limit + 1).bit_length()):
                self._bits[f'state.counter_{number}.{place}'] = t.bit(age, place)
        elif mask is not None:
            for place in range(mask.bit_length()):
                self._bits[f'state.line_{number}.{place}'] = t.bit(now, place)
        elif kind is not FieldKind.POSITION:
            raise NotComparable

    # -- claims -----------------------------------------------------------------------------

    def wins(self, states: Node, requirements: Sequence[int], is_game: bool) -> ProofAnswer:
        """
        Return whether the system, or with `is_game` False all together, can stay in some states.

        All requirements then hold at each step, but those that say `eventually`.
        """
        d, games = self._d, self._games
        if is_game:
            steps, names = games.good(requirements, d.before(states)), d.own
        else:
            steps = games.safe(requirements) & d.before(states)
            names = [*d.environment, *d.own]
        chosen = self._functions(steps, names)
        # The environment's variables stay free in a game; all others are functions of them.
        held = self._verdicts(requirements, chosen)
        stays = self._set(states, self._next(chosen))
        good = t.conjunction(held, stays)
        given = [self._set(states, self._now)]
        if is_game:
            given.append(self._steps(d.enabled))
            good = t.conjunction(good, t.disjunction(
                self._steps(games.doomed), self._set(games.lasting, self._next(chosen))))
            good = t.disjunction(self._steps(games.excused), good)
        goals = [self._translated(d.possible, {**self._now, **self._variables, **chosen}), good]
        answers = [self._proved(states, goals, given)]
        return _worst([*answers, *self._environment_fails()] if is_game else answers)

    def _environment_fails(self) -> Iterator[ProofAnswer]:
        """Check that no choice of the system keeps an assumption where it is excused."""
        games = self._games
        possible, assumed = self._steps(self._d.possible), self._verdicts((), {})
        yield _valid([t.negation(assumed)], [possible, self._steps(games.excused)])
        if games.shared:
            yield self.wins(games.lasting, (), is_game=False)
            yield _valid([t.negation(self._set(games.lasting, self._next({})))],
                         [possible, assumed, self._steps(games.doomed)])

    def is_closed(self, states: Node, requirements: Sequence[int], kept: int | None = None,
                  inside: Node | None = None) -> ProofAnswer:
        """
        Return whether safe steps stay in a set, and another requirement holds at each.

        `kept` is the other one; None: none. With `inside`, only steps that lead there count.
        """
        possible = self._steps(self._d.possible)
        held = self._verdicts(requirements, {})
        after = self._next({})
        goals = [self._set(states, after)]
        if kept is not None:
            goals += t.substituted([self._system.verdicts[kept]], self._choices({}))
        given = [self._set(states, self._now), possible, held]
        if inside is not None:
            given.append(self._set(inside, after))
        return self._proved(states, goals, given)

    def _proved(self, states: Node, goals: Sequence[Term], given: Sequence[Term]) -> ProofAnswer:
        """Return whether the states contain the start, and goals follow."""
        found, = t.substituted([self._set(states, self._now)], dict(self._start))
        return _valid(goals, given) if found is t.TRUE else ProofAnswer.REFUTED

    # -- translation ------------------------------------------------------------------------

    @property
    def _now(self) -> Mapping[str, Term]:
        return self._bits

    def _choices(self, chosen: Mapping[str, Term]) -> dict[Term, Term]:
        return {term: chosen.get(name.value, name) for term, name in self._names.items()}

    def _next(self, chosen: Mapping[str, Term]) -> Mapping[str, Term]:
        after = t.substituted(self._after.values(), self._choices(chosen))
        state = dict(zip(self._after, after))
        return dict(zip(self._bits, t.substituted(self._bits.values(), state)))

    def _verdicts(self, requirements: Sequence[int], chosen: Mapping[str, Term]) -> Term:
        wanted = [self._system.verdicts[item]
                  for item in sorted({*requirements, *self._games.assumptions})
                  if item not in self._games.pending]
        return t.all_of(t.substituted(wanted, self._choices(chosen)))

    def _steps(self, steps: Node) -> Term:
        return self._translated(steps, {**self._now, **self._variables})

    def _set(self, states: Node, bits: Mapping[str, Term]) -> Term:
        return self._translated(states, bits)

    def _functions(self, steps: Node, names: Sequence[str]) -> dict[str, Term]:
        """Return choices in some steps as functions of the state and of what is not chosen."""
        d, found = self._d, {}
        for place, name in enumerate(names):
            d.deadline.check()
            yes = d.at(steps, {name: True})
            function = d.bdd.exist(list(names[place + 1:]), yes)
            if name in d.bdd.support(steps):
                steps = d.bdd.let({name: function}, steps)
            found[name] = self._translated(function, {**self._now, **self._variables})
        return found

    def _translated(self, root: Node, names: Mapping[str, Term]) -> Term:
        """Return a diagram as a term."""
        d = self._d
        known: dict[Any, Term] = {int(d.bdd.true): t.TRUE, int(d.bdd.false): t.FALSE}
        stack = [root]
        kept = []  # so that no node is freed, and its number used again
        while stack:
            node = stack[-1]
            key = int(node)
            if key in known:
                stack.pop()
                continue
            if len(known) > _MOST_NODES:
                raise NotComparable
            kept.append(node)
            yes = d.at(node, {node.var: True})
            no = d.at(node, {node.var: False})
            missing = [each for each in (yes, no) if int(each) not in known]
            if missing:
                stack += missing
                kept += missing
                continue
            known[key] = t.choice(names[node.var], known[int(yes)], known[int(no)])
            stack.pop()
        return known[int(root)]


def _valid(goals: Sequence[Term], given: Sequence[Term]) -> ProofAnswer:
    return prove(goals, given, seconds=_SECONDS).answer


def _worst(answers: Sequence[ProofAnswer]) -> ProofAnswer:
    """Return PROVED if all are so, REFUTED if one is."""
    return next((item for item in (ProofAnswer.REFUTED, ProofAnswer.UNKNOWN) if item in answers),
                ProofAnswer.PROVED)
