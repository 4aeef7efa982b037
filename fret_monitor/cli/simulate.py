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

"""`simulate BUNDLE --trace FILE.csv`: run the compiled monitors over a trace."""

from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Iterator, Mapping
from operator import attrgetter
import os
from pathlib import Path
import sys
from typing import TYPE_CHECKING

from fret_monitor.cli.constants import add_constants
from fret_monitor.cli.document import add_json_option, print_document
from fret_monitor.cli.terminal import painted, print_diagnostics, progress
from fret_monitor.messages.installed import find_message
from fret_monitor.model.bundle_files import BUNDLE_HELP, existing_bundle
from fret_monitor.model.diagnostics import counted, printable, refuse
from fret_monitor.model.manifest import Manifest
from fret_monitor.model.names import key_text
from fret_monitor.model.policies import Policy
from fret_monitor.model.times import known_text, overflow_text
from fret_monitor.native import words
from fret_monitor.start import start
from fret_monitor.traces.csv_trace import parse_seconds, seconds_text
from fret_monitor.traces.simulate import simulate
from fret_monitor.traces.summary import Summary

if TYPE_CHECKING:
    from fret_monitor.bag.findings import Findings, Slack

_MOST_INSTANCES = 10  # of a requirement, whose slack is said in words


def add_arguments(parser: ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument('bundle', metavar='BUNDLE', help=BUNDLE_HELP)
    add_constants(parser)
    parser.add_argument('--trace', metavar='FILE.csv', type=Path, required=True,
                        help='one column for each input, one row for each step; under '
                        'policy: timed also a column `time`, in seconds')
    parser.add_argument('--verdicts', metavar='FILE.csv', type=Path,
                        help='where to write the verdicts; default: standard output')
    parser.add_argument('--margins', metavar='FILE.csv', type=Path,
                        help='also write how far each requirement is from the other verdict, and '
                        'which comparison decides that')
    parser.add_argument('--fail-on-violation', action='store_true',
                        help='exit with 1 if any requirement was violated')
    parser.add_argument('--until', metavar='T', type=_seconds,
                        help='under policy: timed, go on to this time after the last row')
    add_json_option(parser)
    parser.set_defaults(run=run)


def run(options: Namespace) -> int:
    """Run the monitors over a trace; return 1 at a violation with --fail-on-violation."""
    compiled = start(existing_bundle(options.bundle), constants=dict(options.constants),
                     takes_instances=True, margins=options.margins is not None)
    if not options.json:
        print_diagnostics(compiled.warnings)
    if options.until is not None and compiled.monitor.manifest.policy is not Policy.TIMED:
        refuse('--until needs policy: timed',
               help=f'here it is {compiled.monitor.manifest.policy.value}: nothing happens '
               'between and after the rows')
    # The document takes the place of the table on standard output.
    verdicts = options.verdicts or (Path(os.devnull) if options.json else None)
    with progress('simulate', is_printing=verdicts is None) as report:
        summary = simulate(compiled.monitor, options.trace, verdicts, compiled.sources,
                           options.until, report, margins=options.margins)
    slacks = _slacks(options) if options.margins else {}
    is_timed = compiled.monitor.manifest.policy is Policy.TIMED
    horizons = _horizons(compiled.monitor.manifest)
    for name, horizon in horizons.items():
        print(f'{name}: known {known_text(horizon, is_timed=is_timed)}', file=sys.stderr)
    for found in slacks.values() if verdicts is None else ():
        print('\n'.join(_slack_lines(found, is_timed)), file=sys.stderr)
    for item in summary.beyond:
        why = f'beyond most: {item.most} not evaluated' if item.most else \
            f'not evaluated: {words.KEY_SIZE}'
        print(f"{counted(item.rows, 'row')} of keys of '{item.variable}' {why}", file=sys.stderr)
    if summary.overflows:
        print(overflow_text(summary.overflows), file=sys.stderr)
    if options.json:
        print_document(_as_dict(summary, is_timed, horizons, slacks), compiled.warnings)
    elif verdicts is not None:
        print(_shown(summary, is_timed, horizons, slacks))
    return 1 if options.fail_on_violation and any(summary.violations.values()) else 0


def _seconds(text: str) -> int:
    try:
        return parse_seconds(text)
    except ValueError as error:
        raise ArgumentTypeError(f"'{text}' is no time: {error}") from None


def _horizons(manifest: Manifest) -> dict[str, int]:
    """Return how long before a verdict is what it is about, of requirements that look ahead."""
    described = [manifest, *(kind.manifest for kind in manifest.kinds)]
    return {item.id: item.horizon for part in described for item in part.requirements
            if item.horizon}


def _slacks(options: Namespace) -> 'dict[str, Findings]':
    """Return the slack of the sentences with a deadline, by id."""
    from fret_monitor.bag.trace_slack import slack_of_trace  # it needs the parser
    from fret_monitor.build import read
    reading = read(existing_bundle(options.bundle), constants=dict(options.constants),
                   takes_instances=True)
    found = slack_of_trace(reading, find_message, options.trace, options.until)
    if found is None:
        print('slack is not looked for: that takes a second reading of the trace, and a pipe is '
              'read once', file=sys.stderr)
        return {}
    return {name: item for name, item in found.items()
            if item.slack is not None or item.waiting is not None}


def _when(at: int, is_timed: bool) -> str:
    return f'{seconds_text(at)} s' if is_timed else f'step {at:,}'


def _slack_lines(item: 'Findings', is_timed: bool) -> Iterator[str]:
    """Yield the least slack of a requirement, and of the instances with least, in words."""
    if item.slack is None:
        yield f'{item.id}: the trigger at {_when(item.waiting or 0, is_timed)} waits for its ' \
            'response'
        return
    yield f'{item.id}: {_slack_text(item.slack, is_timed)}'
    least = sorted(item.slack_of.values(), key=attrgetter('left', 'key'))
    for slack in least[:_MOST_INSTANCES]:
        yield f'{item.id}[{printable(slack.key)}]: {_slack_text(slack, is_timed)}'


def _slack_text(slack: 'Slack', is_timed: bool) -> str:
    until = 'no response' if slack.until is None else f'response at {_when(slack.until, is_timed)}'
    return (f'least slack {slack.left:.6g} {slack.unit}, trigger at '
            f'{_when(slack.trigger, is_timed)}, {until}')


def _shown(summary: Summary, is_timed: bool, horizons: dict[str, int],
           slacks: 'Mapping[str, Findings]') -> str:
    noun = 'row' if is_timed else 'step'
    lines = [counted(summary.steps, noun)]
    for name, count in summary.violations.items():
        if count:
            when = f' first at {seconds_text(summary.first[name])} s,' if is_timed else ''
            if name in horizons:
                first = summary.first[name] - horizons[name]
                when += f' first about {seconds_text(first)} s,' if is_timed else \
                    f' first about step {first},'
            verdict = painted('violated', 'violated', sys.stdout)
            lines.append(f'{name}: {verdict}{when} at {counted(count, noun)}')
        elif summary.steps:
            lines.append(f'{name}: {painted("satisfied", "satisfied", sys.stdout)}')
        else:
            lines.append(f'{name}: not judged')
        if name in slacks:
            lines += _slack_lines(slacks[name], is_timed)
    return '\n'.join(lines)


def _as_dict(summary: Summary, is_timed: bool, horizons: dict[str, int],
             slacks: 'Mapping[str, Findings]') -> dict[str, object]:
    def requirement(name: str, count: int) -> dict[str, object]:
        first = summary.first.get(name)
        when: dict[str, object] = {
            'first_time': None if first is None else seconds_text(first)} if is_timed \
            else {'first_step': first}
        if name in horizons and first is not None:
            about = first - horizons[name]
            when['about_time' if is_timed else 'about_step'] = \
                seconds_text(about) if is_timed else about
        own = _slack_dict(slacks[name], is_timed) if name in slacks else {}
        return {'id': name, 'violations': count, **when, **own}

    return {'rows' if is_timed else 'steps': summary.steps,
            'requirements': [requirement(*item) for item in summary.violations.items()],
            **({'overflows': summary.overflows} if summary.overflows else {})}


def _slack_dict(item: 'Findings', is_timed: bool) -> dict[str, object]:
    def instant(at: int | None) -> object:
        return at if at is None or not is_timed else seconds_text(at)

    def document(slack: 'Slack') -> dict[str, object]:
        return {'left': slack.left, 'unit': slack.unit, 'trigger': instant(slack.trigger),
                'until': instant(slack.until), **({'key': slack.key} if slack.key else {})}

    return {
        **({} if item.slack is None else {'slack': document(item.slack)}),
        **({'slack_of': {key_text(key, item.variables): document(slack)
                         for key, slack in sorted(item.slack_of.items())}}
           if item.slack_of else {}),
        **({} if item.waiting is None else {'waiting': instant(item.waiting)})}
