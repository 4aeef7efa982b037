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

"""`explain BUNDLE [ID...]`: what requirements mean, with example traces as timelines."""

from argparse import ArgumentParser, Namespace
from pathlib import Path
import sys

from fret_monitor.build import read
from fret_monitor.cli.constants import add_constants
from fret_monitor.explain.report import explain, shown
from fret_monitor.explain.svg import to_svg
from fret_monitor.model.bundle_files import BUNDLE_HELP, existing_bundle
from fret_monitor.model.output import open_output, refuse_overwriting


def add_arguments(parser: ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument('bundle', metavar='BUNDLE', help=BUNDLE_HELP)
    add_constants(parser)
    parser.add_argument('ids', metavar='ID', nargs='*', help='some requirements; default: all')
    parser.add_argument('--svg', metavar='FILE', type=Path, help='write the timelines as SVG')
    parser.set_defaults(run=run)


def run(options: Namespace) -> int:
    """Explain a bundle."""
    bundle = existing_bundle(options.bundle)
    reading = read(bundle, constants=dict(options.constants))
    if options.svg is not None:
        refuse_overwriting(options.svg, reading.paths)
    found, warnings = explain(reading, options.ids)
    for warning in warnings:
        print(warning.render(), file=sys.stderr)
    if options.svg is not None:
        lines = [line for item in found for line in item.timelines]
        with open_output(options.svg) as file:
            file.write(to_svg(f'{bundle.name}: example traces', lines))
    print('# true, . false; of the verdict # satisfied, x violated; ~ steps left out\n')
    print('\n\n'.join('\n'.join(shown(item)) for item in found))
    return 0
