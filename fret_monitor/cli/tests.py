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

"""`tests BUNDLE --output DIR`: traces that test each requirement, with their verdicts."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from fret_monitor.build import (
    compile_monitor, generate_monitor, read_one_instance, without_probabilities,
)
from fret_monitor.cli.constants import add_constants
from fret_monitor.cli.document import add_json_option, print_document
from fret_monitor.cli.limits import seconds
from fret_monitor.cli.terminal import print_diagnostics, progress
from fret_monitor.model.bundle_files import BUNDLE_HELP, existing_bundle
from fret_monitor.model.diagnostics import counted, Diagnostic, Level
from fret_monitor.testgen.folder import (
    as_dict, check_output, lines, pytest_file, write_suite,
)
from fret_monitor.testgen.played import obstacle
from fret_monitor.testgen.suite import make_suite

_USUAL_S = 120.0


def add_arguments(parser: ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument('bundle', metavar='BUNDLE', help=BUNDLE_HELP)
    add_constants(parser)
    parser.add_argument('-o', '--output', metavar='DIR', type=Path, required=True,
                        help='the folder to write; earlier tests there are replaced')
    parser.add_argument('--timeout', metavar='SECONDS', type=seconds, default=_USUAL_S,
                        help=f'end the search after this time; default {_USUAL_S:g}')
    add_json_option(parser)
    parser.set_defaults(run=run)


def run(options: Namespace) -> int:
    """Write the tests of a bundle."""
    reading, left_out = without_probabilities(read_one_instance(
        existing_bundle(options.bundle), constants=dict(options.constants)), 'tests')
    check_output(options.output)
    compiled = compile_monitor(generate_monitor(reading))
    with progress('tests') as report:
        suite = make_suite(reading, options.timeout, report)
        count = write_suite(suite, compiled.monitor, reading, options.output)
    warnings = [*compiled.warnings, *left_out]
    if suite.is_partial:
        warnings.append(Diagnostic(
            f'the search ended after {options.timeout:g} s: some answers are missing',
            level=Level.WARNING, help='--timeout SECONDS gives it more time'))
    if options.json:
        print_document({'output': str(options.output), 'files': count, **as_dict(suite)},
                       warnings)
        return 0
    print_diagnostics(warnings)
    print('\n'.join(lines(suite)))
    print(f'\n{options.output}: {counted(len(suite.cases), "trace")}, '
          f'{counted(count, "file")}')
    if reason := obstacle(reading.specification):
        print(f'no {pytest_file(reading)}: {reason}')
    return 0
