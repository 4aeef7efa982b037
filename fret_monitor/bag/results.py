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

"""What was found in a recording, as JSON, JUnit, CSV and a table."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
import json
from math import inf
from typing import Any, TextIO
from xml.etree import ElementTree

from fret_monitor.bag.check import RecordingResult
from fret_monitor.bag.findings import Closest, Findings, Slack
from fret_monitor.bag.results_file import meanings_of
from fret_monitor.model.csv_writer import CsvWriter
from fret_monitor.model.diagnostics import counted, printable
from fret_monitor.model.manifest import Manifest
from fret_monitor.model.names import key_text, parts_of_key
from fret_monitor.model.times import seconds, short_seconds
from fret_monitor.runtime.evaluator import Violation
from fret_monitor.runtime.probability import Figures, runs_of
from fret_monitor.runtime.reporting import StatusRecord

_MOST_INSTANCES = 10  # violated instances of a requirement that are named
_CONTROLS = {chr(k): '?' for k in range(32) if chr(k) not in '\t\n\r'}


def json_line(result: RecordingResult) -> str:
    """Return the result as a line of JSON (docs/recordings.md)."""
    meanings = meanings_of(result.manifest)
    return json.dumps({
        'bag': str(result.path),
        'recorded': sum(result.recorded.values()),
        'read': sum(result.read.values()),
        **({} if result.is_trace else {'checksums': result.has_checksums}),
        'requirements': {item.id: {
            'meaning': meanings[item.id],
            'verdict': item.verdict,
            'violations': item.violations,
            'occurrences': item.occurrences,
            'first': None if item.first is None else seconds(item.first),
            **({'open': True} if item.is_open else {}),
            **({'instances': _instances(item)} if item.variables else {}),
            **_probability(item),
            **({'closest': _closest(item.closest)} if item.closest else {}),
            **({'closest_of': {key_text(key, item.variables): _closest(found)
                               for key, found in sorted(item.closest_of.items())}}
               if item.closest_of else {}),
            **({'slack': _slack(item.slack)} if item.slack else {}),
            **({'slack_of': {key_text(key, item.variables): _slack(found)
                             for key, found in sorted(item.slack_of.items())}}
               if item.slack_of else {}),
            **({} if item.waiting is None else {'waiting': seconds(item.waiting)}),
            **({} if item.triggered is None else {'triggered': item.triggered}),
        } for item in result.findings},
        **({'instances': {name: {
            'began': counts.begun, 'ended': counts.ended, 'ended_open': counts.open,
            'beyond': counts.beyond,
        } for name, counts in result.kinds.items()}} if result.kinds else {}),
        'errors': list(result.errors),
    }, ensure_ascii=False)


def _instances(item: Findings) -> dict[str, dict[str, object]]:
    """Return the instances of a requirement that were violated, by key."""
    return {key_text(key, item.variables): {
        'occurrences': found.occurrences,
        'first': None if found.first is None else seconds(found.first),
    } for key, found in sorted(item.instances.items())}


def _closest(found: Closest) -> dict[str, object]:
    return {'margin': found.margin, 'distance': found.distance, 'comparison': found.comparison,
            'inputs': list(found.inputs), 'at': seconds(found.at), 'step': seconds(found.step),
            **({'key': found.key} if found.key else {})}


def _slack(found: Slack) -> dict[str, object]:
    return {'left': found.left, 'unit': found.unit, 'trigger': seconds(found.trigger),
            'until': None if found.until is None else seconds(found.until),
            **({'key': found.key} if found.key else {})}


def _probability(item: Findings) -> dict[str, object]:
    """Return what was found of a probability, with all trials, to be pooled."""
    if item.probability is None or item.figures is None:
        return {}
    return {'probability': {
        'required': item.probability.required, 'confidence': item.probability.confidence_text,
        **figures_json(item.figures),
        'runs': runs_of(has_failed for _, has_failed in item.trials)}}


ALL_RECORDINGS = 'all recordings'
"""The name of what is found over all of them."""


def figures_json(found: Figures) -> dict[str, object]:
    """Return the figures of a test (docs/probability.md)."""
    return {'verdict': found.verdict, 'trials': found.trials, 'failures': found.failures,
            'estimate': found.estimate if found.trials else None,
            'interval': [found.low, found.high], 'more': found.more}


def verdict_text(verdict: bool | None, *, is_open: bool) -> str:
    """Return a verdict in a word."""
    if verdict is None:
        return 'open' if is_open else 'not judged'
    return 'satisfied' if verdict else 'VIOLATED'


def verdict_of(item: Findings) -> str:
    """Return the verdict of a requirement in a word."""
    return verdict_text(item.verdict, is_open=item.is_open)


def table(result: RecordingResult) -> str:
    """Return the result for a terminal; times count from the begin of the recording."""
    has_closest = any(item.closest for item in result.findings)
    has_slack = any(item.slack or item.waiting is not None for item in result.findings)
    rows: list[tuple[str, ...]] = [(
        'requirement', 'verdict', 'occurrences', 'first at', 'longest',
        *(('closest', 'at', 'by') if has_closest else ()),
        *(('slack', 'trigger', 'until') if has_slack else ()))]

    def more(each: Findings) -> tuple[str, ...]:
        return (*(_closest_cells(each.closest, result.start) if has_closest else ()),
                *(_slack_cells(each, result.start) if has_slack else ()))

    for item in result.findings:
        rows += [(*_row(each, result.start), *more(each))
                 for each in (item, *_first_instances(item))]
        rows += [(printable(each.id), '-', '', '', '', *more(each)) for each in _others(item)]
        if len(item.instances) > _MOST_INSTANCES:
            left = counted(len(item.instances) - _MOST_INSTANCES, 'instance')
            names = ','.join(f'{name}=...' for name in item.variables)
            rows.append((f'{item.id}[{names}]', f'{left} more'))
    rows = [row + ('',) * (len(rows[0]) - len(row)) for row in rows]
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    note = '' if result.has_checksums or result.is_trace else ', no checksums'
    lines = [f'{result.path}: {result.amount}, '
             f'{short_seconds(result.end - result.begin)} s{note}']
    lines += [f'{name}: {counted(counts.begun, "instance")}, {counts.ended:,} ended, '
              f'{counts.open:,} of them open' for name, counts in result.kinds.items()]
    return '\n'.join([*lines, *(aligned(row, widths) for row in rows)])


def _row(item: Findings, start: int) -> tuple[str, str, str, str, str]:
    never = ', never triggered' if item.verdict and item.triggered is False else ''
    return (printable(item.id), verdict_of(item) + never, f'{item.occurrences:,}',
            '-' if item.first is None else f'{short_seconds(item.first - start)} s',
            f'{short_seconds(item.longest)} s' if item.occurrences else '-')


def _closest_cells(found: Closest | None, start: int) -> tuple[str, str, str]:
    """Return the margin, when its comparison had it, and that with its distance."""
    if found is None:
        return '-', '-', '-'
    return (f'{found.margin:.6g}', f'{short_seconds(found.at - start)} s',
            by_text(found.comparison, found.distance, found.key))


def _slack_cells(item: Findings, start: int) -> tuple[str, str, str]:
    """Return the slack, and when its trigger and its response came; `open` while one waits."""
    found = item.slack
    if found is None:
        return ('-', '-', '-') if item.waiting is None else (
            'open', f'{short_seconds(item.waiting - start)} s', '-')
    is_open = ', open' if item.waiting is not None else ''
    of = f' of {printable(found.key)}' if found.key else ''
    return (f'{found.left:.6g} {found.unit}{is_open}{of}',
            f'{short_seconds(found.trigger - start)} s',
            '-' if found.until is None else f'{short_seconds(found.until - start)} s')


def by_text(comparison: str, distance: float, key: str = '') -> str:
    """Return what decides a margin: a comparison, its distance in its own unit, an instance."""
    of = f' of {printable(key)}' if key else ''
    return f'{printable(comparison)} ({distance:.6g}){of}'


def _first_instances(item: Findings) -> list[Findings]:
    """Return the violated instances of a requirement that are shown, by their keys."""
    return [_of_key(item, key, found)
            for key, found in sorted(item.instances.items())[:_MOST_INSTANCES]]


def _others(item: Findings) -> list[Findings]:
    """Return other instances that are shown, with what is known of them, the closest first."""
    keys = sorted({*item.closest_of, *item.slack_of} - {*item.instances}, key=lambda key: (
        item.closest_of[key].margin if key in item.closest_of else inf, key))
    return [_of_key(item, key, Findings(f'{item.id}[{item.shown_key(key)}]'))
            for key in keys[:max(0, _MOST_INSTANCES - len(item.instances))]]


def _of_key(item: Findings, key: bytes, found: Findings) -> Findings:
    """Return what was found of an instance with its margin and slack, whose row has its key."""
    closest, slack = item.closest_of.get(key), item.slack_of.get(key)
    return replace(found, closest=closest and replace(closest, key=''),
                   slack=slack and replace(slack, key=''))


def aligned(row: Sequence[str], widths: Sequence[int], words: int = 2) -> str:
    """Return a row with its first words on the left and its numbers on the right of columns."""
    texts = [cell.ljust(width) for cell, width in zip(row[:words], widths)]
    numbers = [cell.rjust(width) for cell, width in zip(row[words:], widths[words:])]
    return '  '.join([*texts, *numbers]).rstrip()


def junit(lines: Iterable[str], texts: Mapping[str, str], bundle: str, *,
          is_partial: bool = False, pooled: Mapping[str, Figures] | None = None) -> str:
    """
    Return lines of JSON as JUnit's XML: a suite a recording, a case a requirement.

    `texts` are those of the requirements, by id. If it `is_partial`, what is missing in a
    recording that could be judged is no error, but in the suite's output. `pooled` are the figures
    of the probabilities over all recordings: a further suite.
    """
    suites = ElementTree.Element('testsuites', name=_clean(bundle))
    for content in map(json.loads, lines):
        suite = ElementTree.SubElement(suites, 'testsuite', name=_clean(content['bag']))
        for name, found in content['requirements'].items():
            case = ElementTree.SubElement(
                suite, 'testcase', name=_clean(name), classname=_clean(bundle))
            _add_properties(case, [*_properties(found)])
            if found['verdict'] is False:
                first = '' if found['first'] is None else f', first at {found["first"]}'
                failure = ElementTree.SubElement(
                    case, 'failure', message=_clean(
                        f'violated {counted(found["occurrences"], "time")}{first}'
                        + _by(list(found.get('instances', ())))))
                failure.text = _clean(texts.get(name, ''))
            elif found['verdict'] is None:
                ElementTree.SubElement(case, 'skipped', message=verdict_text(
                    None, is_open='open' in found))
        is_wanted = is_partial and content['requirements']
        for error in [] if is_wanted else content['errors']:
            case = ElementTree.SubElement(
                suite, 'testcase', name='recording', classname='recording')
            ElementTree.SubElement(case, 'error', message=_clean(error))
        _count(suite)
        if is_wanted and content['errors']:
            output = ElementTree.SubElement(suite, 'system-out')
            output.text = _clean('\n'.join(content['errors']))
    if pooled:
        _add_pooled(suites, pooled, texts, bundle)
    ElementTree.indent(suites)
    return ElementTree.tostring(suites, encoding='unicode', xml_declaration=True) + '\n'


def _properties(found: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield what is said of a requirement beside its verdict."""
    if 'closest' in found:
        for key in ('margin', 'distance', 'comparison', 'at', 'key'):
            if key in found['closest']:
                yield f'closest.{key}', str(found['closest'][key])
    for key, value in found.get('slack', {}).items():
        yield f'slack.{key}', 'never' if value is None else str(value)
    if 'waiting' in found:
        yield 'waiting', found['waiting']
    if 'triggered' in found:
        yield 'triggered', 'true' if found['triggered'] else 'false'
    if 'probability' in found:
        yield from _figures(found['probability'])
    if 'meaning' in found:
        yield 'meaning', found['meaning']


def _figures(found: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    for key in ('verdict', 'trials', 'failures', 'estimate', 'interval'):
        yield f'probability.{key}', str(found[key])


def _count(suite: ElementTree.Element) -> None:
    suite.set('tests', str(len(suite)))
    for kind in ('failure', 'error', 'skipped'):
        plural = kind if kind == 'skipped' else f'{kind}s'
        suite.set(plural, str(len(suite.findall(f'*/{kind}'))))


def _add_properties(case: ElementTree.Element, items: Sequence[tuple[str, str]]) -> None:
    if items:
        properties = ElementTree.SubElement(case, 'properties')
        for name, value in items:
            ElementTree.SubElement(properties, 'property', name=name, value=_clean(value))


def _add_pooled(suites: ElementTree.Element, pooled: Mapping[str, Figures],
                texts: Mapping[str, str], bundle: str) -> None:
    suite = ElementTree.SubElement(suites, 'testsuite', name=ALL_RECORDINGS)
    for name, found in pooled.items():
        case = ElementTree.SubElement(
            suite, 'testcase', name=_clean(name), classname=_clean(bundle))
        _add_properties(case, [*_figures(figures_json(found))])
        if found.verdict == 'refuted':
            failure = ElementTree.SubElement(case, 'failure', message=(
                f'refuted: {found.failures:,} of {found.trials:,} trials failed'))
            failure.text = _clean(texts.get(name, ''))
        elif found.verdict == 'open':
            ElementTree.SubElement(case, 'skipped', message='open')
    _count(suite)


HEADS = ('Verdict', 'Recording', 'Occurrences', 'First violation')
"""The columns of `verdicts_of`."""


def verdicts_of(lines: Iterable[str]) -> dict[str, tuple[str, ...]]:
    """
    Return the verdict of each requirement over all recordings, from their lines of JSON, by id.

    The recording is the first one in which it was violated; without a violation, the one in which
    it was judged, or how many these are.
    """
    found: dict[str, list[tuple[str, dict[str, Any]]]] = {}
    for content in map(json.loads, lines):
        for name, item in content['requirements'].items():
            found.setdefault(name, []).append((content['bag'], item))
    return {name: _verdict(items) for name, items in found.items()}


def _verdict(items: Sequence[tuple[str, dict[str, Any]]]) -> tuple[str, ...]:
    violated = [(bag, item) for bag, item in items if item['verdict'] is False]
    judged = [(bag, item) for bag, item in items if item['verdict'] is not None]
    if violated:
        bag, first = violated[0]
        occurrences = sum(item['occurrences'] for _, item in violated)
        return ('violated', bag, str(occurrences), str(first['first'] or ''))
    word = verdict_text(True if judged else None, is_open=any('open' in item for _, item in items))
    bags = [bag for bag, _ in judged or items]
    return (word, bags[0] if len(bags) == 1 else counted(len(bags), 'recording'), '0', '')


def _by(keys: Sequence[str]) -> str:
    """Return which instances violated a requirement."""
    more = f' and {len(keys) - _MOST_INSTANCES:,} more' if len(keys) > _MOST_INSTANCES else ''
    return f', by {", ".join(keys[:_MOST_INSTANCES])}{more}' if keys else ''


def _clean(text: str) -> str:
    """Replace what XML cannot hold."""
    return ''.join('?' if item in _CONTROLS or 0xD800 <= ord(item) < 0xE000
                   or item in '\ufffe\uffff' else item for item in text)


class ChangesCsv:
    """
    Writes verdicts whenever one changes: a column a requirement, 1 fulfilled, 0 violated.

    It is empty until the requirement is judged for the first time. With instances, a variable has
    a column for the key of the row's instance, in whose columns is what has changed of it; they
    are empty in rows without a key, and when the instance ends.
    """

    wants_details = False

    def __init__(self, file: TextIO) -> None:
        """Write to `file`, an open CSV file."""
        self._writer = CsvWriter(file)
        self._state: list[int | None] = []
        self._waiting: int | None = None  # the time of a row to which more may be added

    def begin(self, begin: int, end: int, manifest: Manifest) -> None:
        """Write the heading, and begin the first row."""
        self._state = [None] * len(manifest.numbered)
        names = [item.id for item in manifest.numbered]
        self._columns = [*map(names.index, manifest.ids or names)]
        self._variables_of = manifest.variables_of
        self._variables = [item.name for item in manifest.variables]
        self._writer.writerow(['time', *self._variables, *(manifest.ids or names)])
        self._waiting = begin

    def judged(self, requirement: int, time: int) -> None:
        """Add to a row that a requirement is fulfilled."""
        if self._variables_of[requirement]:
            return  # which instances there are is not known
        if time != self._waiting:
            self._end_row()
            self._waiting = time
        self._state[requirement] = 1

    def change(self, violation: Violation, detail: StatusRecord | None) -> None:
        """Write a row with one verdict changed."""
        self._end_row()
        self._state[violation.requirement] = \
            None if violation.is_end else int(violation.is_recovery)
        self._write(violation.stamp, self._variables_of[violation.requirement], violation.key)
        if violation.key is not None:
            self._state[violation.requirement] = None

    def end(self, time: int) -> None:
        """Write what waits: the last row holds until the end."""
        self._end_row()

    def _end_row(self) -> None:
        if self._waiting is not None:
            self._write(self._waiting)
            self._waiting = None

    def _write(self, time: int, variables: tuple[str, ...] = (),
               key: bytes | None = None) -> None:
        parts = () if key is None else parts_of_key(key, variables)
        shown = {name: part.decode(errors='backslashreplace')
                 for name, part in zip(variables, parts)}
        self._writer.writerow([
            seconds(time), *(shown.get(name, '') for name in self._variables),
            *(self._state[place] for place in self._columns)])
