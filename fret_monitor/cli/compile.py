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

"""`compile BUNDLE --output DIR`: sources, header, libraries and manifest."""

from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from pathlib import Path

from fret_monitor.build import generate_monitor, GeneratedMonitor, read, with_margins, write
from fret_monitor.cli.constants import add_constants
from fret_monitor.cli.terminal import print_diagnostics
from fret_monitor.model.bundle_files import BUNDLE_HELP, existing_bundle
from fret_monitor.model.diagnostics import counted
from fret_monitor.model.parts import NodePart
from fret_monitor.native.stack import worst_stack
from fret_monitor.program.cost import step_cost


def add_arguments(parser: ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument('bundle', metavar='BUNDLE', help=BUNDLE_HELP)
    add_constants(parser)
    parser.add_argument('-o', '--output', metavar='DIR', type=Path, required=True,
                        help='the folder to write; an earlier one is replaced')
    parser.add_argument('--gate', metavar='NAME',
                        help='compile the requirements that this gate keeps, for the node `gate`; '
                             'default: those that no gate keeps, for the node `monitor`')
    parser.add_argument('--margins', action='store_true',
                        help='with how far each requirement is from the other verdict, for the '
                             'node with margins:=true')
    parser.add_argument('--worst-case', action='store_true',
                        help='print the most instructions and stack that a step takes')
    parser.set_defaults(run=run, refuse=parser.error)


def run(options: Namespace) -> int:
    """Compile a bundle to a folder."""
    _refuse_margins(options)
    reading = read(existing_bundle(options.bundle), constants=dict(options.constants),
                   part=NodePart(options.gate), takes_instances=True)
    generated = generate_monitor(with_margins(reading) if options.margins else reading)
    print_diagnostics(generated.warnings)
    write(generated, options.output)
    manifest = generated.manifest
    operations = sum(group.operations for group in manifest.groups)
    cost = step_cost(generated.layouts)
    print(f'{options.output}: {counted(len(manifest.numbered), "requirement")}, '
          f'{counted(manifest.state_bytes, "byte")} of state, '
          f'{counted(operations, "operation")} and '
          f'at most {counted(cost.own + cost.library, "instruction")} a step'
          + (', without its margins' if options.margins else ''))
    if options.worst_case:
        print('\n'.join(_worst_case(generated)))
    return 0


def _refuse_margins(options: Namespace) -> None:
    if options.margins and options.gate:
        options.refuse('a gate has no margins: leave --margins out')
    if options.margins and options.worst_case:
        options.refuse('the worst case of margins is not known, as their windows take O(1) a '
                       'step on average: leave --margins out')


def _worst_case(generated: GeneratedMonitor) -> Iterator[str]:
    cost, stack = step_cost(generated.layouts), worst_stack(generated.module.files)
    more = f', and {cost.library:,} in fmod and pow of glibc' if cost.library else ''
    yield 'worst case of a step of all requirements:'
    yield f'  at most {counted(cost.own, "instruction")}{more} (x86-64, gcc -O2)'
    if stack is None:
        yield '  stack: needs gcc 10 or later; name one in CC'
    else:
        yield (f'  at most {counted(stack.monitor + stack.evaluator, "byte")} of stack: '
               f'{stack.evaluator:,} of the evaluator, {stack.monitor:,} of the monitors, '
               f'and what the C library needs in {", ".join(stack.library)}')
