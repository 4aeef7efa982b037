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


"""`new --bag BAG...`: write a first bundle with the topics and fields of recordings."""

from argparse import ArgumentParser, Namespace
from pathlib import Path
import sys

from fret_monitor.cli.bag import require_rosbags
from fret_monitor.cli.terminal import progress
from fret_monitor.model.diagnostics import counted, did_you_mean, Problems, refuse
from fret_monitor.model.names import shown
from fret_monitor.model.output import open_output


def add_arguments(parser: ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument('--bag', metavar='BAG', nargs='+', type=Path, required=True,
                        help='recordings: folders of rosbag2, or files (.mcap, .db3, .bag)')
    parser.add_argument('--topics', metavar='TOPIC', nargs='+',
                        help='the topics to take; default: a menu on a terminal')
    parser.add_argument('--all', action='store_true', help='take all topics')
    parser.add_argument('-o', '--output', metavar='BUNDLE', type=Path,
                        help='the bundle to write; it must not exist; default: standard output')
    parser.set_defaults(run=run)


def run(options: Namespace) -> int:
    """Write the bundle; return 0."""
    require_rosbags('`new --bag`')
    from fret_monitor.bag.first_bundle import bundle_text, recorded_topics, survey
    if options.output is not None and options.output.exists():
        refuse(f'{shown(str(options.output))} exists', help='give another name: -o other.yaml')
    topics = recorded_topics(options.bag)
    if not options.all:
        names = [topic.name for topic in topics]
        wanted = _known(options.topics, names) if options.topics else _menu(names)
        topics = [topic for topic in topics if topic.name in wanted]
    with progress('new', is_printing=options.output is None) as report:
        survey(options.bag, topics, report)
    text = bundle_text(topics, ', '.join(path.name for path in options.bag))
    if options.output is None:
        print(text, end='')
        return 0
    with open_output(options.output) as file:
        file.write(text)
    fields = sum(len(topic.fields) for topic in topics)
    print(f'{options.output}: {counted(fields, "input")} on {counted(len(topics), "topic")}')
    return 0


def _known(wanted: list[str], names: list[str]) -> list[str]:
    """Return full names of topics; refuse those that were not recorded."""
    problems = Problems()
    full = [name if name.startswith('/') else f'/{name}' for name in wanted]
    for name in full:
        if name not in names:
            problems.error(f'no topic {shown(name)} with numbers was recorded',
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
