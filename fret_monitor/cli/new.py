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


"""`new --bag BAG... | --live`: write a first bundle with what recordings, or the graph, have."""

from argparse import ArgumentParser, ArgumentTypeError, Namespace
import math
import os
from pathlib import Path
import sys
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from fret_monitor.bag.required import require_rosbags
from fret_monitor.cli.terminal import print_diagnostics, progress
from fret_monitor.model.diagnostics import counted, did_you_mean, Problems, refuse
from fret_monitor.model.names import shown
from fret_monitor.model.output import open_output

if TYPE_CHECKING:
    from fret_monitor.bag.first_bundle import SeenTopic


def add_arguments(parser: ArgumentParser) -> None:
    """Add the arguments of the verb."""
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument('--bag', metavar='BAG', nargs='+', type=Path,
                        help='recordings: folders of rosbag2, or files (.mcap, .db3, .bag)')
    source.add_argument('--live', action='store_true', help='the topics of the running graph')
    parser.add_argument('--seconds', metavar='S', type=_seconds, default=10.0,
                        help='with --live: how long to listen; default: 10')
    parser.add_argument('--topics', metavar='TOPIC', nargs='+',
                        help='the topics to take; default: a menu on a terminal')
    parser.add_argument('--all', action='store_true', help='take all topics')
    parser.add_argument('-o', '--output', metavar='BUNDLE', type=Path,
                        help='the bundle to write; it must not exist; default: standard output')
    parser.set_defaults(run=run)


def _seconds(text: str) -> float:
    try:
        found = float(text)
    except ValueError:
        found = math.nan
    if not 0 < found < math.inf:
        raise ArgumentTypeError(f"'{text}' is not a number of seconds")
    return found


def run(options: Namespace) -> int:
    """Write the bundle; return 0."""
    require_rosbags('`new`')
    if options.output is not None and options.output.exists():
        refuse(f'{shown(str(options.output))} exists', help='give another name: -o other.yaml')
    if options.live:
        return _of_graph(options)
    from fret_monitor.bag.first_bundle import recorded_topics, survey
    problems = Problems()
    try:
        wanted = [] if options.all else [_full(name) for name in options.topics or ()]
        found = recorded_topics(options.bag, problems, wanted)
    finally:
        print_diagnostics(problems.warnings)
    topics = _chosen(options, found, 'was recorded')
    with progress('new', is_printing=options.output is None) as report:
        survey(options.bag, topics, report)
    return _write(options, topics, ', '.join(path.name for path in options.bag))


def _of_graph(options: Namespace) -> int:
    """Record topics of the graph for a while, and write the bundle of the recording."""
    from fret_monitor.bag.first_bundle import survey
    from fret_monitor.bag.live import live_graph
    problems = Problems()
    with live_graph() as graph, TemporaryDirectory() as folder:
        found = graph.topics([_full(name) for name in options.topics or ()], problems)
        print_diagnostics(problems.warnings)
        topics = _chosen(options, found, 'is published', 'is the robot in this domain? '
                         f'ROS_DOMAIN_ID is {os.environ.get("ROS_DOMAIN_ID", "0")}')
        path = Path(folder) / 'live.mcap'
        with progress('new', is_printing=options.output is None) as report:
            graph.record(topics, options.seconds, path, report)
        survey([path], topics)
    return _write(options, topics, f'{options.seconds:g} s of the running graph')


def _chosen(options: Namespace, found: list['SeenTopic'], what: str,
            help_without: str = '') -> list['SeenTopic']:
    """Return the topics with numbers that the options or the menu choose."""
    topics = [topic for topic in found if topic.has_numbers]
    names = [topic.name for topic in topics]
    if not topics:
        refuse(f'no topic with numbers {what}', help=help_without)
    if options.all:
        return topics
    left_out = {topic.name for topic in found} - {*names}
    wanted = _known(options.topics, names, left_out, what) if options.topics else _menu(names)
    return [topic for topic in topics if topic.name in wanted]


def _write(options: Namespace, topics: list['SeenTopic'], source: str) -> int:
    from fret_monitor.bag.first_bundle import bundle_text
    text = bundle_text(topics, source)
    if options.output is None:
        print(text, end='')
        return 0
    with open_output(options.output) as file:
        file.write(text)
    fields = sum(len(topic.fields) for topic in topics)
    print(f'{options.output}: {counted(fields, "input")} on {counted(len(topics), "topic")}')
    return 0


def _full(name: str) -> str:
    return name if name.startswith('/') else f'/{name}'


def _known(wanted: list[str], names: list[str], left_out: set[str], what: str) -> list[str]:
    """Return full names of topics; refuse those that are not there, or if all are left out."""
    problems = Problems()
    full = [_full(name) for name in wanted]
    for name in full:
        if name not in names and (name not in left_out or left_out.issuperset(full)):
            problems.error(f'no topic {shown(name)} with numbers {what}',
                           help=did_you_mean(name, names) or 'there are ' + ', '.join(names))
    problems.raise_errors()
    return full


def _menu(names: list[str]) -> list[str]:
    """Ask on the terminal which topics to take; by their numbers, all without an answer."""
    if not sys.stdin.isatty() or not sys.stderr.isatty():
        refuse('which topics? --topics TOPIC... takes some, --all takes all',
               help='there are ' + ', '.join(names))
    for number, name in enumerate(names, 1):
        print(f'{number:>4}  {name}', file=sys.stderr)
    print('topics, by their numbers (all): ', end='', file=sys.stderr, flush=True)
    words = sys.stdin.readline().replace(',', ' ').split()
    wrong = [word for word in words if not word.isdecimal() or not 1 <= int(word) <= len(names)]
    if wrong:
        refuse(f'{shown(wrong[0])} is no number of a topic', help=f'1 to {len(names)}')
    return [names[int(word) - 1] for word in words] or names
