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

"""`fit BUNDLE BAG...`: the tightest value of a constant that recordings support."""

from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from fret_monitor.bag.required import require_rosbags
from fret_monitor.cli.bag import add_reading, selection_of
from fret_monitor.cli.constants import constant
from fret_monitor.cli.document import add_json_option, print_document
from fret_monitor.cli.terminal import progress
from fret_monitor.model.bundle_files import BUNDLE_HELP, existing_bundle
from fret_monitor.model.diagnostics import refuse, require_packages, Text
from fret_monitor.model.times import seconds

if TYPE_CHECKING:
    from fret_monitor.bag.fit import Fit


def add_arguments(parser: ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument('bundle', metavar='BUNDLE', help=BUNDLE_HELP)
    parser.add_argument('bags', metavar='BAG', nargs='+', type=Path,
                        help='recordings, as of `bag`')
    parser.add_argument('--constant', dest='wanted', metavar='NAME[=VALUE]', action='append',
                        required=True, type=_wanted,
                        help='a constant to find the tightest value of; with a value, one that '
                        "has it in place of the bundle's")
    add_reading(parser)
    parser.add_argument('--dask', metavar='ADDRESS',
                        help='read recordings on a Dask cluster; local: --jobs workers here')
    add_json_option(parser)
    parser.set_defaults(run=run)


def _wanted(text: str) -> tuple[str, Text | None]:
    return constant(text) if '=' in text else (text, None)


def run(options: Namespace) -> int:
    """Print the tightest value of each constant."""
    require_rosbags('`fit`')
    if options.dask is not None:
        require_packages('--dask', {'distributed': 'distributed'})
    from fret_monitor.bag.cluster import executor
    from fret_monitor.bag.fit import fit
    bundle = existing_bundle(options.bundle)
    names = [name for name, value in options.wanted if value is None]
    if not names:
        refuse('no constant is to be fitted', help='--constant NAME, without a value')
    given = [(name, value) for name, value in options.wanted if value is not None]
    selection = selection_of(options, given)
    found = []
    paths = [path if options.dask is None else path.absolute() for path in options.bags]
    with progress('fit') as report, executor(options.jobs, options.dask) as processes:
        for name in names:
            found.append(fit(bundle, paths, name, selection, executor=processes,
                             progress=report))
            if not options.json:  # at once: there may be no value of the next one
                print('\n' if len(found) > 1 else '', _shown(found[-1]), sep='', flush=True)
    if options.json:
        print_document({'constants': {item.name: _as_dict(item) for item in found}}, ())
    return 0


def _as_dict(item: 'Fit') -> dict[str, object]:
    time = item.deciding.time
    return {
        'before': item.before, 'value': item.value, 'next': item.tighter,
        'limit': 'least' if item.is_least else 'greatest', 'monotone': item.is_monotone,
        'other_end': item.other_end, 'type': item.kind, 'tried': item.tried,
        'requirements': list(item.requirements), 'bag': str(item.deciding.path),
        'requirement': item.deciding.requirement,
        'time': None if time is None else seconds(time)}


def _shown(item: 'Fit') -> str:
    side = 'least' if item.is_least else 'greatest'
    by = item.deciding
    when = '' if by.time is None else f' at {seconds(by.time)}'
    lines = [
        f'{item.name}: {item.before} -> {item.value}, the {side} value that all recordings '
        f'satisfy ({", ".join(item.requirements)})',
        f'  with {item.tighter}, {by.requirement} is violated in {by.path}{when}',
        f'  {item.tried:,} values tried, of {item.kind}; all on one side of it are satisfied, '
        'all on the other are not' if item.other_end is None else
        f'  {item.tried:,} values tried, of {item.kind}; the verdicts are not monotone: from '
        f'{item.value} to {item.other_end} all that were tried are satisfied, and perhaps others '
        'outside',
        '', 'constants:', f'  {item.name}: {item.value}']
    return '\n'.join(lines)
