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

"""`export BUNDLE --to TARGET --output DIR`: sources that build without this package."""

from argparse import ArgumentParser, ArgumentTypeError, Namespace, RawDescriptionHelpFormatter
import json
from pathlib import Path
from typing import Any

from fret_monitor.build import generate_monitor, GeneratedMonitor, read
from fret_monitor.cli.constants import add_constants
from fret_monitor.cli.terminal import print_diagnostics, progress
from fret_monitor.export.content import HandlerArguments, Options, unacted
from fret_monitor.export.folder import assemble, check_output, is_name, renamed, write_export
from fret_monitor.export.sizes import measured_sizes, PartSizes
from fret_monitor.export.targets import TARGETS
from fret_monitor.export.written_keys import with_written_keys
from fret_monitor.model.bundle_files import BUNDLE_HELP, existing_bundle
from fret_monitor.model.diagnostics import counted, missing_packages, pip_install, refuse
from fret_monitor.model.parts import NodePart

_PROVER = {'z3': 'z3-solver', 'pycparser': 'pycparser'}


def add_arguments(parser: ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.formatter_class = RawDescriptionHelpFormatter
    parser.epilog = 'targets:\n' + '\n'.join(
        f'  {name:9} {target.summary}' for name, target in TARGETS.items())
    parser.add_argument('bundle', metavar='BUNDLE', help=BUNDLE_HELP)
    add_constants(parser)
    parser.add_argument('--to', dest='target', choices=TARGETS, required=True,
                        help='what to write, see below')
    parser.add_argument('-o', '--output', metavar='DIR', type=_folder, required=True,
                        help='the folder to write; an earlier export there is replaced')
    names = parser.add_mutually_exclusive_group()
    names.add_argument('--name', metavar='NAME',
                       help='what files and symbols begin with; default: the name of the bundle')
    names.add_argument('--prefix', metavar='NAME',
                       help='as --name, and for all other names that the export defines, so that '
                            'several exports fit into one program')
    parser.add_argument('--handler-arguments', choices=[item.value for item in HandlerArguments],
                        default=HandlerArguments.NONE.value,
                        help='of copilot: what handlers are called with: nothing (default), or '
                             'the values of the inputs that the requirement reads')
    parser.add_argument('--gate', metavar='NAME',
                        help='of ros2: export the node of this gate; default: the node of the '
                             'requirements that no gate keeps')
    parser.add_argument('--templates', metavar='DIR', type=Path,
                        help='a folder with files of your own in place of some of the export')
    parser.add_argument('--no-proof', action='store_true',
                        help='do not prove the generated C, and write no certificate')
    parser.set_defaults(run=run, refuse=parser.error)


def _folder(text: str) -> Path:
    if not text:
        raise ArgumentTypeError('the name of a folder is missing')
    return Path(text)


def run(options: Namespace) -> int:
    """Export a bundle to a folder."""
    if options.handler_arguments != HandlerArguments.NONE.value and options.target != 'copilot':
        options.refuse(f'the target {options.target} calls no handlers of yours, only copilot '
                       'does: leave --handler-arguments out')
    if options.templates is not None and not options.templates.is_dir():
        options.refuse(f"argument --templates: there is no folder '{options.templates}'")
    if options.gate is not None and not TARGETS[options.target].acts:
        options.refuse(f'the target {options.target} runs no gate, only ros2 does: leave --gate '
                       'out')
    name = options.name if options.name is not None else options.prefix
    if name is not None and not is_name(name):
        options.refuse(f"'{name}' cannot begin names in C: "
                       'use a letter, then at most 99 letters, digits and _')
    limits = TARGETS[options.target].limits
    reading = read(existing_bundle(options.bundle), constants=dict(options.constants),
                   part=_part(options), takes_instances=limits is not None)
    if limits is not None:
        reading = with_written_keys(reading, options.target, limits)
    generated = generate_monitor(renamed(reading, name) if name is not None else reading)
    print_diagnostics(generated.warnings)
    chosen = Options(options.prefix or '', HandlerArguments(options.handler_arguments))
    content = TARGETS[options.target].content(generated, chosen)
    print_diagnostics([*unacted(generated, acts=TARGETS[options.target].acts), *content.warnings])
    check_output(options.output, content.templates)
    # Once without the certificate, so that a mistake in --templates is reported before the proof.
    assemble(options.target, generated, chosen, content, templates=options.templates)
    is_proved = not (options.no_proof or missing_packages(_PROVER))
    certificate = _certificate(generated) if is_proved else None
    files = assemble(options.target, generated, chosen, content, templates=options.templates,
                     certificate=certificate)
    write_export(options.output, files)
    print(f'{options.output}: {options.target}, {counted(len(files), "file")}, '
          f'{counted(len(generated.manifest.requirements), "requirement")}, '
          f'{counted(generated.manifest.state_bytes, "byte")} of state')
    print(_proof_line(options, is_proved=certificate is not None))
    print('\n'.join(map(_size_line, measured_sizes(files, content.parts))))
    return 0


def _part(options: Namespace) -> NodePart | None:
    """Return what is exported of the bundle."""
    return TARGETS[options.target].part if options.gate is None else NodePart(options.gate)


def _certificate(generated: GeneratedMonitor) -> str:
    """Prove the generated C; the certificate has no times, so that the export has equal bytes."""
    from fret_monitor.proving.certificate import as_dict, Certificate
    from fret_monitor.proving.verification import verify
    with progress('prove') as report:
        found = verify(generated, progress=report)
    if not found.is_proved:
        refuse('the generated C is not proved',
               help='`fret-monitor prove` shows what is missing; '
                    '--no-proof exports without a certificate')
    certificate = Certificate(generated.manifest.name, generated, found)
    return json.dumps(_without_times(as_dict(certificate)), indent=1, ensure_ascii=False) + '\n'


def _without_times(value: Any) -> Any:
    match value:
        case dict():
            return {key: _without_times(item) for key, item in value.items() if key != 'seconds'}
        case list():
            return [_without_times(item) for item in value]
        case _:
            return value


def _proof_line(options: Namespace, *, is_proved: bool) -> str:
    if is_proved:
        return 'proved: the generated C computes its program (certificate.json)'
    if options.no_proof:
        return 'not proved: --no-proof'
    missing = missing_packages(_PROVER)
    return f'not proved: {" and ".join(missing)} missing; {pip_install(*missing)}'


def _size_line(sizes: PartSizes) -> str:
    if sizes.problem:
        return f'size unknown for {sizes.compiler}: {sizes.problem}'
    held = [f'{what} {counted(size, "byte")}' for what, size in sizes.held.items()]
    return (f'{sizes.part}: {counted(sizes.code, "byte")} of code and constants, '
            f'{counted(sizes.data, "byte")} of variables'
            + (f'; in your program: {", ".join(held)}' if held else '') + f' ({sizes.compiler})')
