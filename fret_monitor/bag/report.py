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
The report of a recording: one page of HTML with all that it needs (docs/recordings.md).

The recording is read once for the verdicts, and once more for what is drawn around occurrences.
"""

from bisect import bisect_left
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
import math
from operator import itemgetter
from pathlib import Path
from typing import Any

from fret_monitor.bag.check import (
    AnyRecording, Aside, Changes, compiled, MakeAsides, no_asides, opened, read_bundle,
    RecordingResult, run, Selection,
)
from fret_monitor.bag.curve import probability_section
from fret_monitor.bag.evidence import Occurrence, Plot
from fret_monitor.bag.evidence_by_key import evidence_by_key
from fret_monitor.bag.findings import Findings, Slack
from fret_monitor.bag.margin_lane import margin_row, margin_section
from fret_monitor.bag.overview import Overview, Stretch
from fret_monitor.bag.page import badge, document, escaped, LEGEND, table
from fret_monitor.bag.recording import files_of
from fret_monitor.bag.results import verdict_of
from fret_monitor.bag.slack import slack_asides_of
from fret_monitor.bag.slack_section import slack_of, slack_section, slack_text
from fret_monitor.build import Reading
from fret_monitor.elaboration.signals import FindMessage
from fret_monitor.explain.report import Meaning, meanings
from fret_monitor.model.diagnostics import counted
from fret_monitor.model.manifest import Manifest, ManifestInput
from fret_monitor.model.output import open_output
from fret_monitor.model.policies import InputSource, Policy
from fret_monitor.model.progress import no_progress, Progress
from fret_monitor.model.times import iso_time, short_seconds
from fret_monitor.model.values import ValueType
from fret_monitor.runtime.thinning import WindowPart

_MOST_LISTED = 50  # times of occurrences that are not drawn
_DIGITS = 7  # of numbers in plots
_FLOATS = (ValueType.FLOAT32, ValueType.FLOAT64)
_FOXGLOVE = 'https://app.foxglove.dev/~/view?time='


def check_and_report(bundle: Path, path: Path, selection: Selection, file: Path, *,
                     changes: Sequence[Changes] = (), progress: Progress = no_progress,
                     asides: MakeAsides = no_asides) -> RecordingResult:
    """
    Run a bundle over a recording and write a report; errors as of `check_recording`.

    Nothing is written if anything fails.
    """
    with opened(path) as (recording, find):
        reading = read_bundle(bundle, selection, find)
        report = examine(bundle, reading, recording, find, selection, changes=changes,
                         progress=progress, asides=asides)
    with open_output(file, [bundle, *reading.paths, *files_of(path)]) as output:
        output.write(report.page())
    return report.result


def examine(
    bundle: Path, reading: Reading, recording: AnyRecording, find: FindMessage,
    selection: Selection, *, stretch: Stretch | None = None, changes: Sequence[Changes] = (),
    progress: Progress = no_progress, asides: MakeAsides = no_asides,
) -> 'RecordingReport':
    """
    Run a bundle over a recording and return its report; `reading` is as of `read_bundle`.

    With a `stretch` it shows that part of the judged time. `bundle` is only named. `asides` need
    not find the slack.
    """
    def beside() -> list[Aside]:
        slack = slack_asides_of(reading, find) if selection.margins else ()
        return [*slack, *asides(bundle, replace(selection, margins=False), find)]

    monitor = compiled(reading).monitor
    overview = Overview(monitor, stretch=stretch)
    result = run(monitor, recording, selection, changes=[*changes, overview],
                 watch=overview.watch, progress=progress, asides=beside())
    if result.end > overview.until:  # the recording is longer than its metadata says
        overview = Overview(monitor, result.end, stretch)
        result = run(monitor, recording, selection, changes=[overview],
                     watch=overview.watch, progress=progress, asides=beside())
    found = meanings(reading, find)
    occurrences, drawn = evidence_by_key(
        reading, found, recording, selection, result, overview.starts)
    return RecordingReport(bundle, reading, found, result, overview, occurrences, drawn)


class RecordingReport:
    """The report of one recording, or of a stretch of it."""

    def __init__(self, bundle: Path, reading: Reading, found: dict[str, Meaning],
                 result: RecordingResult, overview: Overview,
                 occurrences: Sequence[Sequence[Occurrence]],
                 drawn: Sequence[ManifestInput]) -> None:
        self._bundle = bundle
        self._reading = reading
        self._meanings = found
        self.result = result
        self._overview = overview
        self.occurrences = occurrences
        self._manifest: Manifest = result.manifest
        self._drawn = drawn  # the inputs of the plots
        self._keyed = [overview.of_instances(index) for index, _ in enumerate(result.findings)]
        self._length = result.end - result.begin

    def page(self) -> str:
        """Return it as a page that needs nothing else."""
        name = self.result.path.resolve().name
        return document(f'{name}: {self._manifest.name}', self.body(), self.data())

    def body(self) -> Iterator[str]:
        """Yield it in HTML; `rows.js` draws what is in `data` in it."""
        result = self.result
        name = result.path.resolve().name
        yield f'<header><h1>{escaped(name)}</h1>'
        yield f'<p>{self._summary()}</p>'
        yield '<dl>'
        for title, text in (
                ('recording', str(result.path)), ('bundle', str(self._bundle)),
                ('from', self._moment(result.begin)), ('to', self._moment(result.end)),
                ('judged', f'{short_seconds(self._length)} s'), ('read', result.amount),
                *(() if result.has_checksums or result.is_trace else
                  [('checksums', 'none: values that changed in the file are not noticed')])):
            yield f'<dt>{title}</dt><dd>{escaped(text)}</dd>'
        yield '</dl></header>'
        problems = (*result.errors, *result.warnings)
        if problems:
            yield '<section class="card warning" id="errors"><h2>What was not seen as it was</h2>'
            yield from ('<ul>', *(f'<li>{escaped(item)}</li>' for item in problems), '</ul>')
            yield '</section>'
        yield from self._verdicts()
        yield from self._requirements()
        yield from self._inputs()

    def _summary(self) -> str:
        words = [verdict_of(item) for item in self.result.findings]
        parts = [f'{words.count(word)} {word.lower()}' for word in (
            'VIOLATED', 'satisfied', 'open', 'not judged') if word in words]
        return f'{counted(len(words), "requirement")}: {", ".join(parts)}.'

    def _verdicts(self) -> Iterator[str]:
        yield '<section id="overview"><h2>Verdicts</h2><div class="card"><div class="rows">'
        for index, item in enumerate(self.result.findings):
            yield (f'<a href="#r{index}">{escaped(item.id)}</a>{badge(verdict_of(item))}'
                   f'{_lane(index)}')
            yield from margin_row(item, self._overview.margins(index))
            yield from self._instances(index)
        yield '<span></span><span></span><svg data-times="1" role="img" aria-label="time"></svg>'
        yield f'</div>{LEGEND}</div></section>'

    def _instances(self, index: int) -> Iterator[str]:
        """Yield a row for each instance that violated a requirement, folded."""
        item = self.result.findings[index]
        if not item.instances:
            return
        yield (f'<details><summary>{counted(len(item.instances), "instance")} violated it'
               '</summary><div class="rows">')
        first = len(self._keyed) + sum(map(len, self._keyed[:index]))
        for number, key in enumerate(self._keyed[index], first):
            found = item.instances[key]
            yield (f'<span>{escaped(found.id)}<br><span class="faint">{self._times(found)}</span>'
                   f'</span>{badge(verdict_of(found))}{_lane(number)}')
        left = len(item.instances) - len(self._keyed[index])
        yield f'</div>{f"<p>and {left:,} more</p>" if left else ""}</details>'

    def _times(self, item: Findings) -> str:
        first = '' if item.first is None else f', first at {self._since(item.first)}'
        return (f'{counted(item.occurrences, "occurrence")}{first}, the longest '
                f'{short_seconds(item.longest)} s')

    def _requirements(self) -> Iterator[str]:
        yield '<section id="requirements"><h2>Requirements</h2>'
        place = 0
        by_id = {item.id: item for item in self._manifest.numbered}
        for index, item in enumerate(self.result.findings):
            requirement, meaning = by_id[item.id], self._meanings[item.id]
            yield (f'<article class="card" id="r{index}"><h3>{escaped(item.id)} '
                   f'{badge(verdict_of(item))}</h3>')
            if requirement.title:
                yield f'<p>{escaped(requirement.title)}</p>'
            yield f'<blockquote>{escaped(requirement.text)}</blockquote><dl>'
            for title, text in (*meaning.meaning, ('formula', meaning.formula)):
                kind = ' class="formula"' if title == 'formula' else ''
                yield f'<dt>{escaped(title)}</dt><dd{kind}>{escaped(text)}</dd>'
            yield f'</dl>{self._count(index)}'
            yield from probability_section(item)
            yield from margin_section(item, self._overview.margins(index),
                                      self._overview.comparisons(index), self.result.start)
            yield from slack_section(item, self._since)
            for number, occurrence in enumerate(
                    self.occurrences[index], 1 + self._count_before(index)):
                key = occurrence.start.key
                of = '' if key is None else f' of {item.instances[key].id}'
                yield from self._figure(f'Occurrence {number}{of}', occurrence, place,
                                        requirement.horizon, slack_of(item, occurrence))
                place += 1
            yield from self._others(index)
            yield '</article>'
        yield '</section>'

    def _count_before(self, index: int) -> int:
        """Return how many occurrences began before the first one that is drawn."""
        item, shown = self.result.findings[index], self.occurrences[index]
        if item.variables or not shown:
            return 0
        return bisect_left(item.spans, shown[0].start.time, key=itemgetter(0))

    def _count(self, index: int) -> str:
        item = self.result.findings[index]
        if not item.occurrences:
            return ''
        steps = '' if item.violations is None else \
            f', {counted(item.violations, "violating step")}'
        return (f'<p><strong>{counted(item.occurrences, "occurrence")}</strong>{steps}, '
                f'the longest {short_seconds(item.longest)} s.</p>')

    def _figure(self, title: str, item: Occurrence, place: int, horizon: int,
                slack: Slack | None) -> Iterator[str]:
        yield '<figure><figcaption>'
        yield from self._open(item) if item.is_open else self._occurred(title, item)
        if slack is not None:
            yield f'<br>Slack: {escaped(slack_text(slack))}.'
        if horizon and not item.is_open:
            yield f'<br>It is about {self._about(item, horizon)}.'
        yield (f'</figcaption><svg data-occurrence="{place}" role="img" '
               f'aria-label="inputs and propositions around it"></svg></figure>')

    def _about(self, item: Occurrence, horizon: int) -> str:
        """Return the step or time that a verdict on the future is about."""
        if self._manifest.policy is Policy.TIMED:
            return self._since(item.start.time - horizon)
        return f'step {item.start.step - horizon:,}, {counted(horizon, "step")} before'

    def _open(self, item: Occurrence) -> Iterator[str]:
        due = item.start.time
        later = short_seconds(due - self.result.end)
        yield (f'<strong>Open at the end</strong>: violated if nothing comes until '
               f'{self._since(due)}, {later} s after the end of the recording.')
        if item.trigger is not None:
            which = 'The trigger' if item.is_deadline else 'The last trigger before it'
            yield (f'<br>{which} came at {self._since(item.trigger)} '
                   f'<span class="time"><code>{self._moment(item.trigger)}</code> '
                   '<button class="copy">copy</button></span>')

    def _occurred(self, title: str, item: Occurrence) -> Iterator[str]:
        time = item.start.time
        lasts = 'until the end' if item.end is None else \
            f'for {short_seconds(item.end - time)} s'
        moment = self._moment(time)
        yield (f'<strong>{escaped(title)}</strong> at '
               f'{self._since(time)}, {lasts}<br><span class="time"><code>{moment}</code> '
               '<button class="copy">copy</button></span>')
        if not self.result.is_trace:
            yield (' <a class="jump" target="_blank" rel="noopener noreferrer" '
                   f'href="{_FOXGLOVE}{moment}">Foxglove</a>')
        if item.is_deadline and item.trigger is not None:
            yield (f'<br>The deadline passed {short_seconds(time - item.trigger)} s after the '
                   f'trigger at {self._since(item.trigger)}.')
        elif item.trigger is not None:
            yield f'<br>The last trigger before it came at {self._since(item.trigger)}.'
        if item.start.silent:
            yield f'<br>No message for {escaped(item.start.silent)}.'
        if item.start.values:
            values = ', '.join(f'{name} = {value}' for name, value in item.start.values)
            yield f'<br>Values: <code>{escaped(values)}</code>'

    def _others(self, index: int) -> Iterator[str]:
        item = self.result.findings[index]
        if item.variables:
            return  # the rows of the instances have the first of each
        drawn = {each.start.time for each in self.occurrences[index] if not each.is_open}
        others = [begin for begin, _ in item.spans if begin not in drawn][:_MOST_LISTED]
        if others:
            times = ', '.join(map(self._since, others))
            left = item.occurrences - len(drawn) - len(others)
            more = f', and {left:,} more' if left else ''
            yield f'<p class="faint">Further occurrences at {times}{more}.</p>'

    def _since(self, time: int) -> str:
        return f'{short_seconds(time - self.result.start)} s'

    def _moment(self, time: int) -> str:
        """Return a time as other programs show it: a date, or the seconds of a trace."""
        return short_seconds(time) if self.result.is_trace else iso_time(time)

    def _inputs(self) -> Iterator[str]:
        yield '<section id="inputs"><h2>Inputs</h2><div class="card">'
        rows = [(item.name, item.topic or '', item.message_type or '')
                for item in self._manifest.inputs]
        yield table(('input', 'topic', 'type'), rows)
        for index, _ in enumerate(rows):
            yield (f'<figure><svg data-input="{index}" role="img" '
                   'aria-label="values over time"></svg></figure>')
        yield '</div></section>'

    def data(self) -> dict[str, Any]:
        """Return what `rows.js` draws, as JSON."""
        result, overview = self.result, self._overview
        inputs = self._manifest.inputs
        begin, end = overview.window
        return {
            'begin': begin - result.start,
            'length': end - begin,
            'lanes': [*overview.verdicts(result.findings),
                      *(lane for lanes in self._keyed for lane in lanes.values())],
            'inputs': [{
                'name': item.name, 'bool': item.value_type is ValueType.BOOL,
                'names': item.stored_values,
                'n': overview.parts, 'b': _number(overview.thinning.before(index), item),
                'v': _values(overview.thinning.parts(index), item),
            } for index, item in enumerate(inputs)] + [{
                'name': item.name, 'bool': item.value_type is ValueType.BOOL,
                'names': item.stored_values, 'n': 1, 'b': None, 'v': [],
            } for item in self._drawn[len(inputs):]],
            'occurrences': [self._occurrence(item)
                            for items in self.occurrences for item in items],
        }

    def _occurrence(self, item: Occurrence) -> dict[str, Any]:
        time = item.start.time
        if item.is_open:  # what is drawn ends before the deadline
            time = self.result.end if item.trigger is None else item.trigger
        return {
            'w': [item.window[0] - time, item.window[1] - time],
            'e': None if item.end is None else item.end - time,
            'g': None if item.trigger is None else item.trigger - time,
            'd': int(item.is_deadline),
            'o': int(item.is_open),
            'n': item.parts,
            'p': [self._plot(plot) for plot in item.plots],
            'l': item.lanes,
        }

    def _plot(self, plot: Plot) -> dict[str, Any]:
        item = self._drawn[plot.input]
        return {
            'i': plot.input, 'b': _number(plot.before, item), 'v': _values(plot.parts, item),
            'h': [(_number(value, item), self._threshold(value, item))
                  for value in plot.thresholds],
        }

    def _threshold(self, value: float, item: ManifestInput) -> str:
        """Return the label of a threshold: a named value or a constant of the bundle, if it is."""
        for name, number in item.stored_values:
            if value == number:
                return name
        text = f'{value:.{_DIGITS}g}'
        names = [name for name, written in self._reading.constants if _is_number(written, value)]
        return f'{names[0]} = {text}' if len(names) == 1 else text


def _lane(number: int) -> str:
    return f'<svg data-lane="{number}" role="img" aria-label="verdicts over time"></svg>'


def _is_number(written: str, value: float) -> bool:
    try:
        return math.isclose(float(written), value, rel_tol=1e-6)
    except ValueError:
        return False


def _number(value: float | None, item: ManifestInput) -> float | int | str | None:
    """Return a value for JSON, which has no NaN and no infinity."""
    if value is None:
        return None
    if not math.isfinite(value):
        return 'NaN' if math.isnan(value) else f'{value}'
    if item.value_type not in _FLOATS:
        return int(value)
    short = float(f'{value:.{_DIGITS}g}')
    return int(short) if short.is_integer() and abs(short) < 1e15 else short


def _values(parts: Iterable[WindowPart], item: ManifestInput) -> list[list[Any]]:
    """Return the parts as the page's script reads them, without those that change nothing."""
    if item.source is InputSource.RECEIVED:  # true for an instant each time
        return [[part.place, 0, 1, 0] for part in parts]
    found: list[list[Any]] = []
    for part in parts:
        least, most, last = (_number(value, item) for value in part[1:4])
        if part.has_nan:
            numbers = [] if least == 'NaN' else [least, most]
            found.append([part.place, 'NaN', *numbers, last])
        elif least != most:
            found.append([part.place, least, most, last])
        elif not found or found[-1][-1] != last:
            found.append([part.place, last])
    return found
