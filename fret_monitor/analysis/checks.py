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
The analysis of a bundle: all questions, each for the parts that it concerns.

    Reading -> parts -> systems -> fixed points -> answers, each no with a run or with conflicts
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice
import time

from fret_monitor.analysis.answers import Analysis, Answer, Question
from fret_monitor.analysis.component import (
    build_component, by_inputs, by_outputs, Component, has_unknown_values, output_names, Part,
    unrelated_assumptions,
)
from fret_monitor.analysis.conflicts import shrunk, smallest_conflicts
from fret_monitor.analysis.diagrams import MemoryErrors
from fret_monitor.analysis.division import Task, tasks
from fret_monitor.analysis.extremes import simplified, without_extremes
from fret_monitor.analysis.games import Descent
from fret_monitor.analysis.grid_runs import GridRuns
from fret_monitor.analysis.letters import Values
from fret_monitor.analysis.nan_inputs import NanRuns, NanUndecided
from fret_monitor.analysis.part_runs import PartRuns
from fret_monitor.analysis.reachability import asked_diagram, AskedDiagram, never, Way
from fret_monitor.analysis.replay import Replay
from fret_monitor.analysis.runs import (
    continue_to_violation, NoRun, play_to_violation, run_to, Runner,
)
from fret_monitor.analysis.second import NotComparable, SecondCheck
from fret_monitor.analysis.short_runs import shown_by_short_runs
from fret_monitor.analysis.unrolling import end_of_runs, Wanted
from fret_monitor.logic.evaluate import evaluate_all
from fret_monitor.logic.formula import Formula, variables
from fret_monitor.logic.printing import to_smv
from fret_monitor.logic.specification import Specification
from fret_monitor.model.diagnostics import counted
from fret_monitor.model.policies import InputRole, Policy
from fret_monitor.model.progress import no_progress, Progress
from fret_monitor.model.times import time_text
from fret_monitor.smt import solver
from fret_monitor.smt import terms as t
from fret_monitor.smt.boolean import TooLarge
from fret_monitor.smt.transition import NotModelled
from fret_monitor.traces.deadline import Deadline, OutOfTime
from fret_monitor.traces.trace import Row

_MOST_CONFLICTS = 10
_TIMED_S = 5.0  # for a question about time, since most end soon or never
_LONG_S = 20.0  # to find a run of numbers
_SHORT_S = 2.0  # the same for one requirement
_MANY = 20  # requirements, for which short runs are searched first
_RUNS_SHARE = 0.75  # of the time of a part, for short runs
_MOST_S = 120.0  # of that time
_WIDTH = 60  # of a condition
_REFUTED = 'internal error: z3 refutes what the decision diagrams found; please report it'
_CONTRADICTION = 'the assumptions contradict each other'
_CONFIRMED = 'confirmed by z3'
_INTERRUPTED = 'interrupted'
_OUT_OF_TIME = 'out of time'


class _Refuted(Exception):
    """The second check of a fixed point refutes it."""


@dataclass(frozen=True)
class _Context:
    """What all parts share."""

    specification: Specification
    replay: Replay
    denials: Mapping[str, Formula]
    deadline: Deadline


def analyze(specification: Specification, replay: Replay, asked: Sequence[Question], *,
            denials: Mapping[str, Formula] | None = None, deadline: Deadline | None = None,
            progress: Progress = no_progress) -> Analysis:
    """
    Answer questions about the requirements of a bundle.

    Parameters
    ----------
    specification
        the bundle.
    asked
        the questions.
    replay
        runs the bundle, to confirm every run.
    denials
        by id, formulas that are violated once the trigger of a FRETish sentence comes.
    deadline
        answers that it cuts off are unknown.
    progress
        called before each part with the share of them that is done.

    Returns
    -------
    Analysis
        an answer to each question for each part or requirement that it concerns.
    """
    begin = time.perf_counter()
    known = {name: simplified((item,))[item] for name, item in (denials or {}).items()}
    context = _Context(without_extremes(specification), replay, known, deadline or Deadline(None))
    answers: list[Answer] = []
    work = list(_work(context, asked))
    for number, task in enumerate(work):
        progress(number / len(work), ', '.join(task.part.ids[:3]))
        context.deadline.begin_part(len(work) - number)
        answers += _PartAnalysis(context, task).answers()
    return Analysis(tuple(answers), frozenset(asked), time.perf_counter() - begin,
                    any(item.reason in (_INTERRUPTED, _OUT_OF_TIME) for item in answers))


def _work(context: _Context, asked: Sequence[Question]) -> Iterator[Task]:
    of_runs = list(filter(lambda item: item is not Question.REALIZABILITY, asked))
    if of_runs:
        for part in by_inputs(context.specification):
            yield from tasks(context.specification, part, of_runs, context.deadline)
    if Question.REALIZABILITY in asked:
        for part in [*by_outputs(context.specification),
                     *unrelated_assumptions(context.specification)]:
            yield Task(part, (Question.REALIZABILITY,), frozenset(part.ids))


class _PartAnalysis:
    """Answers the questions about one part."""

    def __init__(self, context: _Context, task: Task, is_on_grid: bool = False) -> None:
        """With `is_on_grid`, time is a grid."""
        self._context, self._task = context, task
        self._part, self._questions = task.part, task.questions
        self._deadline = context.deadline
        self._is_timed = context.specification.policy is Policy.TIMED
        self._is_on_grid = is_on_grid
        self._component: Component | None = None
        self._descent: Descent | None = None
        self._second: SecondCheck | None = None
        self._is_full = False
        self._shown: dict[tuple[Question, tuple[str, ...]], Answer] = {}

    @property
    def _outputs(self) -> tuple[str, ...]:
        names = output_names(self._context.specification)
        read = {name for item in self._part.properties if not item.is_assumption
                for name in item.inputs}
        return tuple(item.name for item in self._context.specification.signals
                     if item.name in names & read)

    def answers(self) -> Iterator[Answer]:
        if len(self._part.properties) > _MANY:
            with suppress(MemoryError, NotModelled, OutOfTime, TooLarge), MemoryErrors():
                self._show_by_runs()
        for question in self._questions:
            if question.is_list:
                for place, name in enumerate(self._part.ids):
                    if name in self._task.chosen and (
                            question is not Question.REACHABILITY or self._diagram(place)):
                        yield self._guarded(question, place)
            else:
                found = self._guarded(question)
                if question is not Question.REALIZABILITY or self._part.required \
                        or not found.holds:
                    yield found

    def _guarded(self, question: Question, place: int | None = None) -> Answer:
        """Answer a question; unknown with the reason if that is not possible."""
        ids = self._part.ids if place is None else (self._part.ids[place],)
        outputs = self._outputs if question is Question.REALIZABILITY else ()
        blank = Answer(question, ids, None, outputs=outputs)
        known = self._shown.get((question, ids))
        found = known or self._confirmed_on_grid(blank, place) or self._attempt(blank, place)
        if found.holds is None and not self._deadline.is_over and self._is_timed \
                and not self._is_on_grid:
            found = self._on_grid(found, place)
        return self._without_calls(found, place) if found.holds is None else found

    def _attempt(self, blank: Answer, place: int | None) -> Answer:
        try:
            with MemoryErrors():
                return self._answer(blank, place)
        except (TooLarge, NotModelled, NoRun) as error:
            return replace(blank, reason=str(error))
        except _Refuted:
            return replace(blank, reason=_REFUTED)
        except MemoryError:
            return replace(blank, reason='the decision diagrams need too much memory')
        except OutOfTime:
            return replace(blank, reason=self._late)

    @property
    def _late(self) -> str:
        if self._deadline.is_interrupted:
            return _INTERRUPTED
        return _OUT_OF_TIME if self._deadline.is_over else f'not decided in {_TIMED_S:g} s'

    @cached_property
    def _of_grid(self) -> '_PartAnalysis':
        """The analysis of this part on a grid of time."""
        return _PartAnalysis(self._context, self._task, is_on_grid=True)

    def _confirmed_on_grid(self, blank: Answer, place: int | None) -> Answer | None:
        """
        Return that a timed requirement is needed, if runs on a grid of time show it.

        The runs are short there, and the monitor confirms them in real time.
        """
        if place is None or self._is_on_grid or not self._is_timed \
                or blank.question is Question.REACHABILITY:
            return None
        with suppress(MemoryError, NoRun, NotModelled, OutOfTime, TooLarge), MemoryErrors():
            self._deadline.begin_attempt(_TIMED_S)
            component = self._built()
            is_covered = not component.games.pending and not component.doubts \
                and place not in component.games.assumptions
            if is_covered and self._contradiction is None \
                    and self._consistent(component).holds:
                runs = GridRuns(self._of_grid._built(), self._of_grid._runs,
                                self._context.specification)
                return runs.answer(blank, place, self._context.denials)
        return None

    def _on_grid(self, unknown: Answer, place: int | None) -> Answer:
        """Add to an unknown answer about time what holds if all happens on a grid of time."""
        on_grid = self._of_grid
        found = on_grid._attempt(replace(unknown, reason=''), place)
        component = on_grid._component
        if found.holds is None or component is None or component.grid is None:
            return unknown
        what = 'yes' if found.holds else 'no'
        sets = ': ' + '; '.join(', '.join(each) for each in found.conflicts) \
            if found.conflicts else ''
        return replace(unknown, reason=f'{unknown.reason}; if all happens on a grid of '
                       f'{time_text(component.grid)}, {what}{sets}', example=found.example)

    @cached_property
    def _of_solvable(self) -> '_PartAnalysis':
        """The analysis of this part without the requirements with unknown values."""
        kept = tuple(item for item in self._part.properties if not has_unknown_values(item))
        task = replace(self._task, part=Part(kept))
        return _PartAnalysis(self._context, task, self._is_on_grid)

    def _without_calls(self, unknown: Answer, place: int | None) -> Answer:
        """
        Answer by fewer requirements, where some have values that no solver knows.

        What contradicts itself, is implied or is never violated stays so with more requirements.
        Everything else is added to the unknown answer.
        """
        rest = self._of_solvable
        left_out = [item for item in self._part.properties if has_unknown_values(item)]
        names = [item.id for item in left_out]
        if not names or not rest._part.required or self._deadline.is_over or (
                place is not None and self._part.ids[place] in names):
            return unknown
        found = rest._attempt(replace(unknown, reason=''), None if place is None else
                              rest._part.ids.index(self._part.ids[place]))
        if found.holds is None:
            return unknown
        without = f'without {", ".join(names)}'
        is_final = found.holds if place is not None else not found.holds and (
            unknown.question is Question.CONSISTENCY
            or unknown.question is Question.REALIZABILITY
            and not any(item.is_assumption for item in left_out))
        if is_final:
            return replace(found, method=f'{found.method}; {without}', are_all=False)
        return replace(unknown, reason=f'{unknown.reason}; {without}, '
                       f'{"yes" if found.holds else "no"}')

    def _answer(self, blank: Answer, place: int | None) -> Answer:
        if self._is_timed:
            self._deadline.begin_attempt(_TIMED_S)
        self._deadline.check()
        if self._contradiction is not None:
            return _contradicted(blank, self._contradiction)
        if blank.question is Question.REACHABILITY and place is not None:
            return self._reachability(blank, place)
        component = self._built()
        match blank.question:
            case Question.CONSISTENCY:
                return self._consistency(blank, component)
            case Question.RT_CONSISTENCY:
                return self._rt_consistency(blank, component)
            case Question.REALIZABILITY:
                return self._realizability(blank, component)
            case Question.VACUITY if place is not None:
                return self._vacuity(blank, component, place)
            case _:
                assert place is not None
                return self._redundancy(blank, component, place)

    @cached_property
    def _contradiction(self) -> Answer | None:
        """The answer that no run satisfies the assumptions, if that is so."""
        assumed = tuple(replace(item, is_assumption=False) for item in self._part.properties
                        if item.is_assumption)
        if not assumed:
            return None
        found = self._asked(Question.CONSISTENCY, Part(assumed))
        return found if found.holds is False else None

    def _asked(self, question: Question, part: Part) -> Answer:
        """Return the answer to a question about another part."""
        task = Task(part, (question,), frozenset(part.ids))
        other = _PartAnalysis(self._context, task, self._is_on_grid)
        return other._attempt(Answer(question, part.ids, None), None)

    def _built(self) -> Component:
        if self._component is None:
            needs_triggers = Question.VACUITY in self._questions
            self._component = build_component(
                self._context.specification, self._part,
                self._context.denials if needs_triggers else None, self._deadline,
                self._is_on_grid)
        return self._component

    @cached_property
    def _runs(self) -> PartRuns:
        return PartRuns(self._built(), self._context.specification, self._context.replay,
                        self._deadline)

    def _consistent(self, component: Component) -> Descent:
        if self._descent is None:
            if self._is_full:
                raise MemoryError
            try:
                with MemoryErrors():
                    self._descent = component.games.consistent(component.required)
            except MemoryError:
                self._is_full = True  # so that no other question fills the memory again
                raise
        return self._descent

    def _show_by_runs(self) -> None:
        """Store the answers about many requirements that short runs show."""
        questions = {*self._questions} - {Question.REALIZABILITY, Question.RT_CONSISTENCY}
        if not questions or self._is_timed:
            return
        component = self._built()
        if component.games.pending:
            return
        seconds = self._deadline.at_most(_MOST_S) * _RUNS_SHARE
        for found in shown_by_short_runs(component, self._runs, self._deadline, seconds):
            self._shown[found.question, found.requirements] = found

    # -- questions --------------------------------------------------------------------------

    def _consistency(self, blank: Answer, component: Component) -> Answer:
        games, found = component.games, self._consistent(component)
        if found.holds:
            return self._yes(blank, component, found, lambda second: second.wins(
                found.last, component.required, is_game=False))
        return self._with_conflicts(self._inconsistent(blank, component, found), component,
                                    lambda items: not games.consistent(items).holds)

    def _inconsistent(self, blank: Answer, component: Component, found: Descent) -> Answer:
        runner = Runner(component.games)
        continue_to_violation(runner, component.games, component.required, found)
        return self._no(blank, component, runner)

    def _rt_consistency(self, blank: Answer, component: Component) -> Answer:
        games, d = component.games, component.games.diagrams
        found = self._consistent(component)
        safe = games.safe(component.required)
        if not found.holds:
            no = self._inconsistent(blank, component, found)
            return no if no.holds is None else replace(
                no, method='no run satisfies all requirements', example=None)
        inside = d.before(found.last)
        fatal = found.last & safe & ~inside
        layers = games.reach(safe & inside, fatal)
        if not games.is_reached(layers):
            return self._yes(blank, component, found, lambda second: second.is_closed(
                found.last & ~layers[-1], component.required))
        runner = run_to(games, layers, safe & inside, fatal)
        continue_to_violation(runner, games, component.required, found)
        return self._no(blank, component, runner)

    def _realizability(self, blank: Answer, component: Component) -> Answer:
        games = component.games
        if not component.required:
            return self._consistency(blank, component)  # whether they contradict each other
        found = games.realizable(component.required)
        trusted = [self._part.ids[item] for item in games.linked if item in games.pending]
        if trusted and not self._consistent(component).holds:
            return self._consistency(blank, component)  # the system can only prevent them
        if found.holds:
            return self._yes(blank, component, found, lambda second: second.wins(
                found.last, component.required, is_game=True))
        if trusted:
            found = games.realizable(component.required, trusts_linked=True)
            if found.holds:
                return replace(blank, reason=_preventable(
                    trusted, [self._part.ids[item] for item in games.shared]))
        runner = play_to_violation(games, component.required, found)
        return self._with_conflicts(
            self._no(blank, component, runner), component,
            lambda items: not games.realizable(items, bool(trusted)).holds)

    def _vacuity(self, blank: Answer, component: Component, place: int) -> Answer:
        games, d = component.games, component.games.diagrams
        verdicts = component.whole.verdicts
        found = self._consistent(component)
        if not found.holds:
            return replace(blank, reason='; '.join(component.gaps)
                           or 'no run satisfies all requirements')
        anyhow = games.violation(place, d.possible, ())
        if not games.is_reached(anyhow):
            by_nan = self._is_violated_by_nan(component, place, None)
            if by_nan is not False:
                return _by_nan(blank, by_nan, 'NaN violates it')
            return self._certain(
                blank, component, 'never violated by finite numbers' if self._reads_floats(place)
                else 'never violated, whatever the inputs',
                lambda second: second.is_closed(~anyhow[-1], [], place), place)
        trigger = component.triggers.get(place)
        if trigger is None:
            return self._possible(blank, component, 'it can be violated',
                                  Wanted(t.TRUE, t.negation(verdicts[place])))
        steps = games.safe(component.required) & d.before(found.last)
        layers = games.reach(steps, steps & ~d.outputs[trigger])
        if not games.is_reached(layers):
            others = [item for item in component.required if item != place]
            by_nan = self._is_violated_by_nan(component, place, others)
            if by_nan is not False:
                return _by_nan(blank, by_nan, 'its trigger can come with NaN')
            finite = ' with finite numbers' if self._reads_floats() else ''
            return self._certain(
                blank, component,
                f'its trigger never comes{finite} while all requirements hold',
                lambda second: second.is_closed(
                    ~layers[-1], component.required, trigger, found.last))
        return self._possible(blank, component, 'its trigger can come', self._runs.everything(
            (t.negation(verdicts[trigger]),)))

    def _redundancy(self, blank: Answer, component: Component, place: int) -> Answer:
        games = component.games
        others = [item for item in component.required if item != place]
        if place in games.assumptions:
            return replace(blank, holds=False, method='an assumption')
        if not self._consistent(component).holds and not games.consistent(others).holds:
            return replace(blank, reason='; '.join(component.gaps) or
                           'the others exclude one another, and so imply anything')
        layers = games.violation(place, games.safe(others), [*others, *games.assumptions])
        if not games.is_reached(layers):
            by_nan = self._is_violated_by_nan(component, place, others)
            if by_nan is not False:
                return _by_nan(blank, by_nan, 'NaN violates it alone')
            return self._certain(
                blank, component,
                'implied by the others' + self._equal(component, place, others),
                lambda second: second.is_closed(~layers[-1], others, place), place)
        verdicts = component.whole.verdicts
        held = t.all_of(verdicts[item] for item in (*others, *games.assumptions)
                        if item not in games.pending)
        return self._possible(blank, component, 'it can be violated alone', Wanted(
            held, t.conjunction(held, t.negation(verdicts[place]))))

    def _reachability(self, blank: Answer, place: int) -> Answer:
        """Answer whether no run reaches some states of a diagram, and name them with the edges."""
        diagram = self._diagram(place)
        assert diagram is not None
        reached = self._reached(blank, place, diagram.now, diagram.is_required)
        unreached = {state for state, item in enumerate(reached) if item.holds}
        asked = [state for state in diagram.asked if state in unreached]
        notes: list[str] = []
        with suppress(MemoryError, NoRun, NotModelled, OutOfTime, TooLarge), MemoryErrors():
            for note in self._overlaps(place, diagram):
                notes.append(note)
        blank = replace(blank, notes=tuple(notes))
        if not asked:
            unknown = next((item for item in reached if item.holds is None), None)
            return replace(blank, reason=unknown.reason) if unknown is not None else replace(
                blank, holds=False, method='a run reaches each state')
        ways = diagram.into(unreached)
        tried = self._reached(blank, place, map(diagram.attempt, ways), diagram.is_required)
        stuck = {way for way, item in zip(ways, tried, strict=True) if item.holds}
        method = '; '.join(self._why(diagram, state, unreached, stuck) for state in asked)
        return replace(blank, holds=True, method=f'{method} ({_joint([*reached, *tried])})')

    def _diagram(self, place: int) -> AskedDiagram | None:
        return asked_diagram(self._part.properties[place])

    def _reached(self, blank: Answer, place: int, goals: Iterable[Formula],
                 is_required: bool) -> list[Answer]:
        """Return for each goal whether no run gets there, on which the requirements hold."""
        other = self._with(place, goals)
        required = self._part_required if is_required else []
        return [other._goal(blank, number, required) for number in range(
            len(self._part.properties), len(other._part.properties))]

    def _with(self, place: int, goals: Iterable[Formula]) -> '_PartAnalysis':
        """Return the analysis of this part with properties that goals never hold."""
        more = tuple(never(self._part.properties[place], goals))
        task = replace(self._task, part=Part((*self._part.properties, *more)))
        return _PartAnalysis(self._context, task, self._is_on_grid)

    @property
    def _part_required(self) -> list[int]:
        return [number for number, item in enumerate(self._part.properties)
                if not item.is_assumption]

    def _overlaps(self, place: int, diagram: AskedDiagram) -> Iterator[str]:
        """Yield the pairs of edges whose conditions hold at once, with values."""
        goals = [diagram.attempt(item) for item in diagram.overlaps]
        other, count = self._with(place, goals), len(self._part.properties)
        for number, item in enumerate(diagram.overlaps):
            row = other._last_row(count + number, self._part_required, item.condition)
            if row is not None:
                origin, *targets = (self._state_name(diagram, state)
                                    for state in (item.origin, *item.targets))
                yield (f'two edges out of {origin} hold at once, to {" and to ".join(targets)}'
                       f'{self._values_text(item.condition, row)}: the first one is taken')

    def _last_row(self, place: int, required: Sequence[int], both: Formula) -> Row | None:
        """Return the last row of a run after which a property is violated, if both hold there."""
        component = self._built()
        games, d = component.games, component.games.diagrams
        found = games.consistent(required)
        steps = games.safe(required) & d.before(found.last)
        goal = steps & ~d.outputs[place]
        layers = games.reach(steps, goal)
        if not found.holds or not games.is_reached(layers):
            return None
        rows = self._runs.rows(run_to(games, layers, steps, goal).rows())
        columns = {signal.name: [row[number] for row in rows] for number, signal
                   in enumerate(self._context.specification.signals)}
        truths, = evaluate_all([both], columns, self._part.properties[place].feedback)
        return rows[-1] if truths[-1] else None

    def _values_text(self, formula: Formula, row: Row) -> str:
        """Return the values of the inputs that a formula reads, behind a comma."""
        named = zip(self._context.specification.signals, row, strict=True)
        read = {item.name for item in variables(formula)}
        found = [f'{item.name} = {value}' for item, value in named if item.name in read]
        return f', as with {", ".join(found)}' if found else ''

    def _why(self, diagram: AskedDiagram, state: int, unreached: Collection[int],
             stuck: Collection[Way]) -> str:
        """Return a state that is not reached, with the reason for each edge to it."""
        ways = [way for way in diagram.ways if way.target == state]
        reasons = [f'from {self._state_name(diagram, way.origin)}, ' + (
            'which is not reached' if way.origin in unreached else
            f'where {self._text(way.condition)} never holds' if way in stuck else
            'where an edge before it is always taken instead') for way in ways]
        only = f'only {" and ".join(reasons)}' if ways else \
            'no edge that is ever taken leads to it'
        return f'{self._state_name(diagram, state)}: {only}'

    def _state_name(self, diagram: AskedDiagram, state: int) -> str:
        node = diagram.states[state]
        texts = (item.text for item in self._context.specification.properties
                 if item.formula is node)
        return next(texts, self._text(node)).rpartition('= ')[2]

    def _text(self, formula: Formula) -> str:
        return to_smv(formula, _WIDTH, {item.name: item.values for item
                                        in self._context.specification.signals if item.values})

    def _goal(self, blank: Answer, place: int, required: Sequence[int]) -> Answer:
        """Return whether a property holds whenever some requirements do, at all steps."""
        component = self._built()
        games, d = component.games, component.games.diagrams
        found = games.consistent(required)
        if not found.holds:
            return replace(blank, reason='; '.join(component.gaps)
                           or 'no run satisfies all requirements')
        steps = games.safe(required) & d.before(found.last)
        layers = games.reach(steps, steps & ~d.outputs[place])
        if not games.is_reached(layers):
            by_nan = self._is_violated_by_nan(component, place, required)
            if by_nan is not False:
                return _by_nan(blank, by_nan, 'reached with NaN')
            return self._certain(blank, component, '', lambda second: second.is_closed(
                ~layers[-1], required, place, found.last))
        verdicts = component.whole.verdicts
        held = t.all_of(verdicts[item] for item in (*required, *games.assumptions)
                        if item not in games.pending)
        return self._possible(blank, component, '', Wanted(
            held, t.conjunction(held, t.negation(verdicts[place]))))

    def _reads_floats(self, place: int | None = None) -> bool:
        """Whether a requirement reads a float input; None: any of the part."""
        floats = {item.name for item in self._context.specification.signals
                  if item.type.is_float}
        return any(not floats.isdisjoint(item.inputs) for item in (
            self._part.properties if place is None else [self._part.properties[place]]))

    @cached_property
    def _nan(self) -> NanRuns:
        return NanRuns(self._context.specification, self._part, self._deadline, self._is_on_grid)

    def _is_violated_by_nan(self, component: Component, place: int,
                            others: Sequence[int] | None) -> bool | None:
        """
        Whether a run with NaN violates a requirement while others hold; None: not known.

        `others` None: whatever they do.
        """
        if place in component.games.pending or not self._reads_floats(
                place if others is None else None):
            return False
        with suppress(NanUndecided, NoRun, NotModelled, TooLarge):
            return self._nan.violate(place, others, self._runs)
        return None

    def _equal(self, component: Component, place: int, others: Sequence[int]) -> str:
        """Name a requirement that always has the same verdict."""
        for other in others:
            if not component.games.differ(place, other):
                return f'; equal to {self._part.ids[other]}' + self._for_finite(place, other)
        return ''

    def _for_finite(self, place: int, other: int) -> str:
        """Return an addition to "equal", if NaN may tell two requirements apart."""
        if not self._reads_floats():
            return ''
        with suppress(NanUndecided, NotModelled, TooLarge):
            if not self._nan.differ(place, other):
                return ''
        return ' for finite numbers'

    # -- answers ----------------------------------------------------------------------------

    def _yes(self, blank: Answer, component: Component, found: Descent,
             check: Callable[[SecondCheck], solver.ProofAnswer]) -> Answer:
        if component.doubts:
            return self._repeating(blank, component)
        steps = len(found.layers)
        return replace(blank, holds=True, method=f'fixed point over all states, round {steps}, '
                       + self._checked(component, check))

    def _repeating(self, blank: Answer, component: Component) -> Answer:
        """Answer yes if a run that repeats satisfies all, and no run is needed for each input."""
        unknown = replace(blank, reason='; '.join(component.doubts))
        is_run_enough = blank.question is Question.CONSISTENCY or (
            blank.question is Question.REALIZABILITY and _has_outputs_only(component))
        if not is_run_enough:
            return unknown
        found = self._runs.find(self._runs.everything(), _LONG_S)
        if found is None or found.start is None:
            return self._ending(unknown, component)
        rows = self._runs.rows((*found.rows, *found.rows[found.start:]))
        if any(self._runs.violated(rows)):
            return unknown
        return replace(blank, holds=True, method=(
            f'a run that repeats from step {found.start} on after '
            f'{counted(len(found.rows), "step")}, replayed in the compiled monitor'))

    def _ending(self, unknown: Answer, component: Component) -> Answer:
        """Answer no if no run satisfies all for more than some steps."""
        verdicts, assumptions = component.whole.verdicts, component.games.assumptions

        def end(items: Iterable[int], most: int | None = None) -> int | None:
            always = t.all_of(verdicts[item] for item in (*items, *assumptions)
                              if item not in component.games.pending)
            return end_of_runs(self._runs.steps, always, self._deadline, _LONG_S, most)

        last = end(component.required)
        if last is None:
            return unknown
        example = self._runs.example(self._runs.longest(_LONG_S))
        if example is None:
            return unknown
        no = replace(unknown, holds=False, example=example, reason='', are_all=False,
                     method=f'no run of {counted(last, "step")} satisfies all')
        with suppress(OutOfTime):
            # First those that end as soon, which is fast; of these, fewer may end later.
            less = shrunk(frozenset(component.required),
                          lambda items: end(items, last) is not None)
            less = shrunk(less, lambda items: end(items) is not None)
            return self._with_smallest(replace(
                no, conflicts=(tuple(self._part.ids[item] for item in sorted(less)),)))
        return no

    def _checked(self, component: Component,
                 check: Callable[[SecondCheck], solver.ProofAnswer]) -> str:
        """Return the result of a second check; raise _Refuted if it refutes."""
        try:
            if self._second is None:
                self._second = SecondCheck(component.group, component.inputs, component.games)
            found = check(self._second)
        except (NotModelled, NotComparable):
            return 'checked once'
        if found is solver.ProofAnswer.REFUTED:
            raise _Refuted
        if found is solver.ProofAnswer.UNKNOWN:
            return 'checked once, z3 did not decide it'
        return _CONFIRMED + (', but for `eventually`' if component.games.pending else '')

    def _certain(self, blank: Answer, component: Component, method: str,
                 check: Callable[[SecondCheck], solver.ProofAnswer],
                 place: int | None = None) -> Answer:
        """
        Return that nothing was reached, which holds for fewer runs, too.

        `place` is the requirement that is never violated; None: none.
        """
        if component.gaps:
            return replace(blank, reason='; '.join(component.gaps))
        how = 'checked once' if place in component.games.pending else \
            self._checked(component, check)
        return replace(blank, holds=True, method=f'{method} ({how})')

    def _possible(self, blank: Answer, component: Component, method: str,
                  wanted: Wanted) -> Answer:
        """Return that something was reached; where that is in doubt, find a run."""
        if component.doubts and self._runs.find(wanted, _SHORT_S) is None:
            return replace(blank, reason='; '.join(component.doubts))
        return replace(blank, holds=False, method=method)

    def _no(self, blank: Answer, component: Component, runner: Runner) -> Answer:
        """Return a no whose run the compiled monitor confirms."""
        example = None if component.gaps else self._runs.example(
            self._values(blank, component, runner))
        if example is None:
            return replace(blank, reason='; '.join(component.doubts) or
                           'the compiled monitor does not confirm the run')
        return replace(blank, holds=False, example=example,
                       method='run replayed in the compiled monitor')

    def _values(self, blank: Answer, component: Component, runner: Runner) -> Sequence[Values]:
        """Return the rows of a run, from the solver if it relates numbers of several steps."""
        related = component.games.diagrams.system.related
        if not related or blank.question is Question.RT_CONSISTENCY \
                or not _has_outputs_only(component):
            return runner.rows()
        return self._runs.longest(_LONG_S)

    def _with_conflicts(self, answer: Answer, component: Component,
                        conflicts: Callable[[frozenset[int]], bool]) -> Answer:
        """Add smallest sets of conflicting requirements to a no."""
        if answer.holds is not False:
            return answer
        found: list[tuple[str, ...]] = []
        ids = self._part.ids
        try:
            for items in islice(smallest_conflicts(component.required, conflicts),
                                _MOST_CONFLICTS + 1):
                found.append(tuple(ids[item] for item in sorted(items)))
        except OutOfTime:
            return replace(answer, conflicts=tuple(found), are_all=False)
        answer = replace(answer, conflicts=tuple(found[:_MOST_CONFLICTS]),
                         are_all=len(found) <= _MOST_CONFLICTS)
        return self._with_smallest(answer) if component.doubts else answer

    def _with_smallest(self, answer: Answer) -> Answer:
        """Replace conflicts, of which a part may conflict too, by those that are smallest."""
        found = [self._reduced(answer.question, each) for each in answer.conflicts]
        kept = tuple(dict.fromkeys(each for each in found if each is not None))
        if None not in found and kept == answer.conflicts:
            return answer
        large = [each for each, less in zip(answer.conflicts, found) if less is None]
        method = '; '.join([answer.method, *(
            f'{", ".join(each)} conflict, but perhaps not all of them are needed' if len(each) > 1
            else f'{each[0]} cannot be satisfied, or the assumptions contradict each other'
            for each in large)])
        return replace(answer, conflicts=kept, are_all=False, method=method)

    def _reduced(self, question: Question, conflict: Sequence[str]) -> tuple[str, ...] | None:
        """Return a smallest conflict within another; None if it is unknown."""
        if len(conflict) == 1 and not any(item.is_assumption for item in self._part.properties):
            return tuple(conflict)
        for left_out in conflict:
            kept = set(conflict) - {left_out}
            found = self._asked(question, Part(tuple(
                item for item in self._part.properties if item.is_assumption or item.id in kept)))
            if found.holds is None or found.holds is False and not found.conflicts:
                return None
            if found.holds is False:
                return found.conflicts[0]
        return tuple(conflict)


def _contradicted(blank: Answer, contradiction: Answer) -> Answer:
    """Return the answer to a question where the assumptions contradict each other."""
    found = replace(blank, conflicts=contradiction.conflicts, are_all=contradiction.are_all)
    match blank.question:
        case Question.CONSISTENCY:
            return replace(found, holds=False, example=contradiction.example,
                           method=f'{_CONTRADICTION}; {contradiction.method}')
        case Question.RT_CONSISTENCY:
            return replace(found, holds=False, method=_CONTRADICTION)
    names = '; '.join(', '.join(each) for each in contradiction.conflicts)
    return replace(found, reason=f'{_CONTRADICTION}: {names}')


def _joint(answers: Iterable[Answer]) -> str:
    """Return how all that is never reached was checked."""
    found = {item.method.strip(' ()') for item in answers if item.holds}
    return min(found, key=lambda text: text.startswith(_CONFIRMED), default='')


def _by_nan(blank: Answer, is_so: bool | None, method: str) -> Answer:
    """Return the answer about a requirement that only NaN may violate; None: not known."""
    if is_so is None:
        return replace(blank, reason='what NaN changes is not known')
    return replace(blank, holds=False, method=method)


def _preventable(trusted: Sequence[str], shared: Sequence[str]) -> str:
    """Return why an answer is unknown that needs assumptions of which some read outputs."""
    others = [name for name in shared if name not in trusted]
    link = f' through {", ".join(others)}' if others else ''
    return (f'{", ".join(trusted)} {"is" if len(trusted) == 1 else "are"} needed, which '
            f'{"says" if len(trusted) == 1 else "say"} `eventually` about outputs{link}: '
            'the system could prevent it')


def _has_outputs_only(component: Component) -> bool:
    return all(item.role is InputRole.OUTPUT for item in component.signals)
