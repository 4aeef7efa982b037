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

"""`bench BUNDLE [--json]`: time of a step, state and compile time of a bundle."""

from argparse import ArgumentParser, Namespace

from fret_monitor.cli.document import add_json_option, print_document
from fret_monitor.model.bundle_files import BUNDLE_HELP, existing_bundle
from fret_monitor.traces.benchmark import measure, Measurement


def add_arguments(parser: ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument('bundle', metavar='BUNDLE', help=BUNDLE_HELP)
    add_json_option(parser)
    parser.set_defaults(run=run)


def run(options: Namespace) -> int:
    """Measure a bundle."""
    found = measure(existing_bundle(options.bundle))
    if options.json:
        print_document(found.as_dict(), [])
    else:
        print(_shown(found))
    return 0


def _shown(found: Measurement) -> str:
    step = 'step   ' if found.evaluations is None else 'message'
    deadlines = [] if found.evaluations is None else [
        f'evaluations      {found.evaluations:.2f} a message, 10 ms apart, with deadlines']
    return '\n'.join((
        f'requirements     {found.requirements:,}',
        f'time a {step}   {found.ns_per_step:,.1f} ns on random inputs, '
        f'{found.ns_per_step_lasting:,.1f} ns on long-lasting ones (median of 9 rounds)',
        *deadlines,
        f'state            {found.state_bytes:,} bytes',
        f'compile          {found.compile_seconds:.2f} s from bundle to library, nothing cached',
    ))
