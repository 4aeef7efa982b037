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

"""`layout BUNDLE`: write a layout of Foxglove, Lichtblick or PlotJuggler."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from fret_monitor.build import read
from fret_monitor.cli.terminal import print_diagnostics
from fret_monitor.export.layouts import LAYOUTS
from fret_monitor.model.bundle_files import BUNDLE_HELP, existing_bundle
from fret_monitor.model.diagnostics import Diagnostic, Level
from fret_monitor.model.output import open_output, refuse_overwriting


def add_arguments(parser: ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument('bundle', metavar='BUNDLE', help=BUNDLE_HELP)
    parser.add_argument('--to', choices=sorted(LAYOUTS), default='foxglove',
                        help='the viewer; Lichtblick takes the layouts of foxglove, the default')
    parser.add_argument('-o', '--output', metavar='FILE', type=Path,
                        help='the file to write; default: standard output')
    parser.set_defaults(run=run)


def run(options: Namespace) -> int:
    """Write the layout; return 0."""
    reading = read(existing_bundle(options.bundle), takes_instances=True)
    found = LAYOUTS[options.to](reading.specification)
    if found.left_out:
        print_diagnostics([Diagnostic(
            f'the viewer cannot draw {", ".join(found.left_out)}', level=Level.WARNING,
            help='they are computed of fields, selected, or no fields of messages')])
    if options.output is None:
        print(found.text, end='')
        return 0
    refuse_overwriting(options.output, reading.paths)
    with open_output(options.output) as file:
        file.write(found.text)
    return 0
