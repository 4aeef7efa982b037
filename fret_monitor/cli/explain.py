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
from contextlib import suppress
from pathlib import Path

from fret_monitor.build import read_one_instance
from fret_monitor.bundle.reader import survey_bundle
from fret_monitor.cli.constants import add_constants
from fret_monitor.cli.document import add_json_option, print_document
from fret_monitor.cli.terminal import print_diagnostics, progress
from fret_monitor.explain.report import as_dict, explain, shown
from fret_monitor.explain.svg import to_svg
from fret_monitor.model.bundle_files import BUNDLE_HELP, existing_bundle, find_bundle
from fret_monitor.model.diagnostics import CompileError, Problems
from fret_monitor.model.output import open_output, refuse_overwriting


def add_arguments(parser: ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument('bundle', metavar='BUNDLE', help=BUNDLE_HELP)
    add_constants(parser)
    ids = parser.add_argument('ids', metavar='ID', nargs='*',
                              help='some requirements; default: all')
    ids.completer = _ids  # type: ignore[attr-defined]  # of argcomplete
    parser.add_argument('--svg', metavar='FILE', type=Path, help='write the timelines as SVG')
    add_json_option(parser)
    parser.set_defaults(run=run)


def _ids(parsed_args: Namespace, **_: object) -> list[str]:
    """Return the ids of a bundle, for the completion of a shell."""
    with suppress(CompileError, OSError):
        bundle = survey_bundle(find_bundle(parsed_args.bundle), Problems())
        return [item.id.value for item in bundle.requirements] if bundle else []
    return []


def run(options: Namespace) -> int:
    """Explain a bundle."""
    bundle = existing_bundle(options.bundle)
    reading = read_one_instance(bundle, constants=dict(options.constants))
    if options.svg is not None:
        refuse_overwriting(options.svg, reading.paths)
    with progress('explain') as report:
        found, warnings = explain(reading, options.ids, report)
    if not options.json:
        print_diagnostics(warnings)
    if options.svg is not None:
        lines = [line for item in found for line in item.timelines]
        with open_output(options.svg) as file:
            file.write(to_svg(f'{bundle.name}: example traces', lines))
    if options.json:
        print_document({'bundle': str(bundle), 'requirements': list(map(as_dict, found))},
                       warnings)
        return 0
    print('# true, . false; of the verdict # satisfied, x violated; ~ steps left out\n')
    print('\n\n'.join('\n'.join(shown(item)) for item in found))
    return 0
