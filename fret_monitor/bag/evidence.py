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
What happened around the occurrences of violations: inputs, propositions, trigger and deadline.

The recording is read once more, by a monitor of its own, whose requirements are the propositions
and the triggers of the violated ones.
"""

from bisect import bisect_right
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from fret_monitor.bag.check import (
    AnyBatch, AnyRecording, compiled, RecordingResult, run, Selection,
)
from fret_monitor.bag.findings import Findings
from fret_monitor.bag.lanes import FALSE, Lane, TRUE
from fret_monitor.bag.moments import Anchor, Moment
from fret_monitor.bag.observers import beside, names_in, unknown_values
from fret_monitor.bag.overview import MOST_SHOWN, Start
from fret_monitor.build import Reading
from fret_monitor.explain.report import Meaning
from fret_monitor.logic.formula import (
    Binary, Constant, Conversion, Formula, Historically, postorder, Unary,
    UnaryOperator, Variable, variables,
)
from fret_monitor.logic.printing import to_smv
from fret_monitor.logic.propositions import bounds, horizon, propositions, triggers
from fret_monitor.logic.scopes import bundle_scope
from fret_monitor.logic.specification import Property, Signal, Specification
from fret_monitor.model.diagnostics import CompileError
from fret_monitor.model.manifest import Manifest
from fret_monitor.model.policies import InputSource, Policy, Report, Stale
from fret_monitor.model.values import ValueType
from fret_monitor.runtime.engine import Engine
from fret_monitor.runtime.evaluator import NEVER, Violation
from fret_monitor.runtime.reporting import StatusRecord
from fret_monitor.runtime.thinning import Thinning, TimeWindow, WindowPart

_LABEL = 90
_MOST_LANES = 10
_MOST_PLOTS = 8
_MOST_RISES = 512  # of a trigger that are remembered before an occurrence
_PARTS = 6000  # of all plots together
_FEWEST_PARTS, _MOST_PARTS = 120, 480
_FEWEST_STEPS = 40  # shown before an occurrence
_TOLERANCE_NS = 2  # a deadline passes a nanosecond after the bound


@dataclass(frozen=True)
class Plot:
    """A number over a window: the value before it, its parts, and what it is compared with."""

    input: int
    before: float | None
    parts: tuple[WindowPart, ...]
    thresholds: tuple[float, ...]


@dataclass(frozen=True)
class Occurrence:
    """
    What is shown of an occurrence; times in nanoseconds.

    `lanes` are (label, kind, lane), the kind `trigger`, `proposition` or `verdict`. With
    `is_deadline` it begins when the time after the `trigger` is over. With `is_open` it has not
    begun when the recording ends.
    """

    start: Start
    end: int | None
    window: tuple[int, int]
    parts: int
    plots: tuple[Plot, ...]
    lanes: tuple[tuple[str, str, str], ...]
    trigger: int | None
    is_deadline: bool
    is_open: bool


@dataclass
class _Lane:
    """A formula that is shown in a window; `kind` as in `Occurrence`."""

    label: str
    kind: str
    formula: Formula
    lane: Lane


@dataclass
class _Shown:
    """An occurrence that is to be shown."""

    item: Property
    findings: Findings
    start: Start
    end: int | None
    window: tuple[int, int]
    formulas: Sequence[tuple[str, str, Formula]]
    inputs: Sequence[int]
    plots: Sequence[int]  # those of the inputs that are drawn as numbers
    lanes: list[_Lane] = field(default_factory=list)
    ready: int | None = None  # when all inputs had a value, within the window
    rises: list[tuple[int, int]] = field(default_factory=list)  # (time, step) of the trigger
    is_by_change: bool = False  # a proposition beside the trigger changes when it begins
    thinning: Thinning | None = None  # of its inputs, from `place` on
    place: int = 0


def evidence(
    reading: Reading, meanings: Mapping[str, Meaning], recordings: Sequence[AnyRecording],
    selection: Selection, result: RecordingResult, starts: Sequence[Sequence[Start]],
) -> list[list[Occurrence]]:
    """
    Return, for each requirement, what is shown of its first occurrences, or why it is open.

    `recordings` has the one in which it is looked for, of each requirement.
    """
    specification = reading.specification
    shown = [list(_shown(item, findings, found, result, specification, meanings[item.id]))
             for item, findings, found in zip(
                 specification.properties, result.findings, starts)]
    count = _shown_count(shown)
    shown = [items[:count] for items in shown]
    plots = sum(len(item.plots) for items in shown for item in items)
    parts = max(_FEWEST_PARTS, min(_MOST_PARTS, _PARTS // max(1, plots)))
    for recording in dict.fromkeys(recordings):
        watched = [item for items, other in zip(shown, recordings, strict=True)
                   if other is recording for item in items]
        if watched:
            _watch(watched, parts, specification, reading, recording, selection)
    return [[_occurrence(item, parts, specification) for item in items] for items in shown]


def _shown_count(shown: Sequence[Sequence[_Shown]]) -> int:
    """Return how many occurrences of a requirement are shown, so that a report stays small."""
    count = MOST_SHOWN
    while count > 1 and _FEWEST_PARTS * sum(
            len(item.plots) + 1 for items in shown for item in items[:count]) > _PARTS:
        count -= 1
    return count


def _shown(item: Property, findings: Findings, starts: Sequence[Start], result: RecordingResult,
           specification: Specification, meaning: Meaning) -> Iterable[_Shown]:
    formulas = _formulas(item, specification, meaning)
    signals = bundle_scope(specification).signals
    inputs = [index for index, signal in enumerate(signals) if signal.name in item.inputs
              and signal.source is not InputSource.INSTANCES]
    plots = [index for index in inputs if signals[index].type is not ValueType.BOOL][:_MOST_PLOTS]
    lead = _lead(item, result, specification)
    later = iter(findings.spans)
    for start in starts:
        begin, end = next((span for span in later if span[0] == start.time), (None, None))
        if begin is None:
            break
        lasts = result.end - begin if end is None else end - begin
        window = (max(result.begin, begin - lead),
                  min(result.end, begin + max(lead // 3, min(lasts + lasts // 4, lead))))
        yield _Shown(item, findings, start, end, window, formulas, inputs, plots)
    if findings.due is not None:
        window = (max(result.begin, findings.due - lead), result.end)
        yield _Shown(item, findings, Start(findings.due, 0), None, window, formulas, inputs, plots)


def _lead(item: Property, result: RecordingResult, specification: Specification) -> int:
    """Return how much time before an occurrence is shown: what the bounds reach back, and more."""
    topics = {signal.topic for signal in specification.signals if signal.name in item.inputs}
    is_for_all = specification.policy is Policy.EVERY_MESSAGE
    counts = [count for topic, count in zip(result.manifest.topics, result.read.values())
              if is_for_all or topic.name in topics] or result.read.values()
    interval = (result.end - result.begin) // max(1, sum(counts))
    reach = horizon(item)
    if specification.policy is Policy.PERIODIC and specification.period is not None \
            and not result.is_trace:
        interval = int(specification.period * 10**9)
    if specification.policy is not Policy.TIMED:
        reach *= interval
    return max(1_000_000, reach + reach // 4, _FEWEST_STEPS * interval)


def _formulas(item: Property, specification: Specification,
              meaning: Meaning) -> list[tuple[str, str, Formula]]:
    """Return the lanes of a requirement: label, kind, formula."""
    values = {signal.name: signal.values for signal in specification.signals if signal.values}
    names: dict[Formula, str] = {
        formula: name for name, formula in specification.definitions
        if not isinstance(formula, Variable | Constant)}

    def text(formula: Formula) -> str:
        return to_smv(formula, _LABEL, values, names,
                      is_timed=specification.policy is Policy.TIMED)

    found: dict[Formula, tuple[str, str]] = {}
    denial = meaning.denial
    if isinstance(denial, Historically) and denial.window.is_unbounded and variables(denial):
        label = dict(meaning.fields).get('condition') or dict(meaning.fields).get('scope', '')
        found[Unary(UnaryOperator.NOT, denial.argument)] = (label[:_LABEL], 'trigger')
    elif item.sentence is None:
        for trigger in triggers(item.formula, 1):
            found[trigger] = (text(trigger), 'trigger')
    for proposition in propositions(item)[:_MOST_LANES]:
        found.setdefault(proposition, (text(proposition), 'proposition'))
    unknown = unknown_values(specification)
    equations = {name for _, equation in item.feedback for name in names_in(equation)}
    return [(label, kind, formula) for formula, (label, kind) in found.items()
            if unknown.isdisjoint(names_in(formula) | equations)]


def _watch(shown: Sequence[_Shown], parts: int, specification: Specification, reading: Reading,
           recording: AnyRecording, selection: Selection) -> None:
    """Read the recording once more, up to the last window, for what is shown of it."""
    properties: dict[tuple[Formula, tuple[str, ...]], Property] = {}
    for each in shown:
        for label, kind, formula in each.formulas:
            key = formula, tuple(sorted(each.item.inputs))
            properties.setdefault(key, _property(len(properties), formula, each.item,
                                                 specification))
            each.lanes.append(_Lane(label, kind, formula, Lane(*each.window, parts)))
    numbers = {key: number for number, key in enumerate(properties)}
    if not properties:
        return
    try:
        # A lane shows what a formula is of the last values, also while an input is silent.
        monitor = compiled(replace(reading, specification=replace(
            specification, properties=tuple(properties.values()), signals=tuple(
                replace(item, stale=Stale.WARN) for item in specification.signals)))).monitor
    except CompileError:
        return  # more state than allowed; the other parts of the report are worth having
    thinning = Thinning(monitor, [TimeWindow(index, *each.window, parts)
                                  for each in shown for index in each.inputs])

    def watch(engine: Engine, batch: AnyBatch) -> None:
        batch.add_to(thinning, engine)

    changes = _LaneChanges(len(properties))
    for each in shown:
        for lane in each.lanes:
            number = numbers[lane.formula, tuple(sorted(each.item.inputs))]
            changes.add_lane(number, lane.lane)
            if lane.kind == 'trigger':
                changes.add_occurrence(number, each)
            elif not any(lane.formula in postorder([other.formula]) for other in each.lanes
                         if other.kind == 'trigger'):
                changes.add_start(number, each)
    last = max(each.window[1] for each in shown)
    run(monitor, recording, replace(selection, end=Moment(Anchor.EPOCH, last), until=None),
        changes=[changes], watch=watch, checks_remaps=False)  # a part of the topics
    place = 0
    for each in shown:
        each.thinning, each.place = thinning, place
        each.ready = _ready(each, thinning, place)
        place += len(each.inputs)


def _property(number: int, formula: Formula, item: Property,
              specification: Specification) -> Property:
    """Return a requirement that is violated whenever a formula of another one is false."""
    return replace(beside(formula, item, specification), id=f'lane {number}',
                   handler=f'lane_{number}', report=Report.ONSET)


class _LaneChanges:
    """Paints lanes, and remembers when triggers came before occurrences."""

    wants_details = False

    def __init__(self, count: int) -> None:
        self._lanes: list[list[Lane]] = [[] for _ in range(count)]
        self._waiting: list[list[_Shown]] = [[] for _ in range(count)]
        self._rises: list[deque[tuple[int, int]]] = [
            deque(maxlen=_MOST_RISES) for _ in range(count)]
        self._starts: list[dict[int, list[_Shown]]] = [{} for _ in range(count)]
        self._state: list[int | None] = [None] * count  # None: not judged yet

    def add_lane(self, number: int, lane: Lane) -> None:
        """Paint a lane with the truth of a formula."""
        self._lanes[number].append(lane)

    def add_occurrence(self, number: int, shown: _Shown) -> None:
        """Remember when a formula became true before an occurrence."""
        self._waiting[number].append(shown)

    def add_start(self, number: int, shown: _Shown) -> None:
        """Note it if a formula changes at the instant at which an occurrence begins."""
        self._starts[number].setdefault(shown.start.time, []).append(shown)

    def begin(self, begin: int, end: int, manifest: Manifest) -> None:
        """Begin a run."""
        self._since = [begin] * len(self._lanes)
        for lanes in self._lanes:
            lanes.sort(key=lambda lane: lane.end, reverse=True)  # the next to end is the last
        for waiting in self._waiting:
            waiting.sort(key=lambda shown: shown.start.time, reverse=True)

    def judged(self, requirement: int, time: int) -> None:
        """Take that a formula is true from its first step on."""
        self._become(requirement, time, 0, TRUE)

    def change(self, violation: Violation, detail: StatusRecord | None) -> None:
        """Take that a formula is false, or true again."""
        for shown in self._starts[violation.requirement].get(violation.stamp, ()):
            shown.is_by_change = True
        self._become(violation.requirement, violation.stamp, violation.step,
                     TRUE if violation.is_recovery else FALSE)

    def _become(self, number: int, time: int, step: int, state: int) -> None:
        self._paint(number, time - 1)
        self._pass(number, time)
        self._state[number] = state
        self._since[number] = time
        if state == TRUE and self._waiting[number]:
            self._rises[number].append((time, step))

    def end(self, time: int) -> None:
        """End the run."""
        for number in range(len(self._lanes)):
            self._paint(number, time)
            self._pass(number, NEVER)

    def _paint(self, number: int, until: int) -> None:
        since, lanes = self._since[number], self._lanes[number]
        while lanes and lanes[-1].end < since:
            lanes.pop()
        state = self._state[number]
        if state is not None:
            for lane in lanes:
                lane.paint(since, max(since, until), state)

    def _pass(self, number: int, time: int) -> None:
        """Remember the rises before the occurrences that began before `time`."""
        waiting = self._waiting[number]
        while waiting and waiting[-1].start.time < time:
            waiting.pop().rises = list(self._rises[number])


def _occurrence(shown: _Shown, parts: int, specification: Specification) -> Occurrence:
    trigger, is_deadline = _trigger(shown, specification)
    verdict = Lane(*shown.window, parts)
    _paint_verdict(verdict, shown)
    is_open = shown.findings.is_open
    if is_open:
        verdict.leave_open()
    lanes = [*shown.lanes, _Lane(shown.item.id, 'verdict', shown.item.formula, verdict)]
    plots: tuple[Plot, ...] = ()
    signals = bundle_scope(specification).signals
    if (thinning := shown.thinning) is not None:
        plots = tuple(
            Plot(index, thinning.before(place), tuple(thinning.parts(place)),
                 _thresholds(signals[index], shown.item))
            for place, index in enumerate(shown.inputs, shown.place) if index in shown.plots)
    return Occurrence(
        shown.start, shown.end, shown.window, parts, plots,
        tuple((lane.label, lane.kind, lane.lane.text()) for lane in lanes), trigger, is_deadline,
        is_open)


def _ready(shown: _Shown, thinning: Thinning, place: int) -> int | None:
    """Return when all inputs had a value, or the begin of the window if it is later."""
    firsts = [thinning.first(place + number) for number in range(len(shown.inputs))]
    known = [time for time in firsts if time is not None]
    return max(known, default=shown.window[0]) if len(known) == len(firsts) else None


def _paint_verdict(lane: Lane, shown: _Shown) -> None:
    spans = shown.findings.spans
    first = max(0, bisect_right(spans, lane.begin, key=lambda span: span[0]) - 1)
    true_since = lane.end + 1 if shown.ready is None else shown.ready
    for begin, end in spans[first:]:
        if begin > lane.end:
            break
        if begin > true_since:
            lane.paint(true_since, begin - 1, TRUE)
        true_since = lane.end + 1 if end is None else end
        lane.paint(begin, max(begin, true_since - 1), FALSE)
    if true_since <= lane.end:
        lane.paint(true_since, lane.end, TRUE)


def _trigger(shown: _Shown, specification: Specification) -> tuple[int | None, bool]:
    """Return the trigger that has led to an occurrence, and whether its time was over then."""
    is_timed = specification.policy is Policy.TIMED
    start = shown.start
    for bound in () if shown.is_by_change else reversed(bounds(shown.item)):
        for time, step in reversed(shown.rises):
            left = start.time - time - bound if is_timed else start.step - step - bound
            if 0 <= left <= (_TOLERANCE_NS if is_timed else 0):
                return time, True
    return (shown.rises[-1][0] if shown.rises else None), False


def _thresholds(signal: Signal, item: Property) -> tuple[float, ...]:
    """Return the numbers with which an input is compared in a requirement."""
    found: dict[float, None] = {}
    for proposition in propositions(item):
        if isinstance(proposition, Binary):
            for one, other in ((proposition.left, proposition.right),
                               (proposition.right, proposition.left)):
                if isinstance(other, Constant) and not isinstance(other.value, bool):
                    found.update(dict.fromkeys(_compared(one, signal.name, other.value)))
    return tuple(found)


def _compared(term: Formula, name: str, value: float) -> tuple[float, ...]:
    match term:
        case Conversion():
            return _compared(term.argument, name, value)
        case Variable():
            return (float(value),) if term.name == name else ()
        case Unary(UnaryOperator.ABS, argument):
            return tuple(sign * each for each in _compared(argument, name, value)
                         for sign in (1, -1))
        case Unary(UnaryOperator.NEG, argument):
            return tuple(-each for each in _compared(argument, name, value))
        case _:
            return ()
