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

"""`export BUNDLE... --to TARGET --output DIR`: sources that build without this package."""

from argparse import ArgumentParser, ArgumentTypeError, Namespace, RawDescriptionHelpFormatter
from collections.abc import Mapping, Sequence
from functools import partial
import json
from pathlib import Path
from typing import Any

from fret_monitor.build import (
    gate_names, generate_monitor, GeneratedMonitor, own_constants, read, Reading, with_margins,
    with_name,
)
from fret_monitor.cli.constants import add_constants
from fret_monitor.cli.terminal import print_diagnostics, progress
from fret_monitor.export.content import Content, HandlerArguments, Options, unacted
from fret_monitor.export.folder import assemble, check_output, is_name, renamed, write_export
from fret_monitor.export.requirements import requirements_file
from fret_monitor.export.sizes import measured_sizes, PartSizes
from fret_monitor.export.targets import TARGETS
from fret_monitor.export.written_keys import with_written_keys
from fret_monitor.model.bundle_files import BUNDLE_HELP, existing_bundle
from fret_monitor.model.diagnostics import (
    counted, missing_packages, pip_install, refuse, Text,
)
from fret_monitor.model.output import open_output
from fret_monitor.model.parts import NodePart, without_gates

_REQUIREMENTS = 'requirements'
_PROVER = {'z3': 'z3-solver', 'pycparser': 'pycparser'}


def add_arguments(parser: ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.formatter_class = RawDescriptionHelpFormatter
    parser.epilog = 'targets:\n' + '\n'.join(
        f'  {name:12} {target.summary}' for name, target in TARGETS.items()) + (
        f'\n  {_REQUIREMENTS:12} a table or ReqIF for requirement tools: FILE.csv, .xlsx, .reqif')
    parser.add_argument('bundles', metavar='BUNDLE', nargs='+',
                        help=f'{BUNDLE_HELP}; of ros2 also several, for one node')
    add_constants(parser)
    parser.add_argument('--to', dest='target', choices=[*TARGETS, _REQUIREMENTS], required=True,
                        help='what to write, see below')
    parser.add_argument('-o', '--output', metavar='DIR', type=_folder, required=True,
                        help='the folder to write; an earlier export there is replaced; of '
                        'requirements: the file')
    names = parser.add_mutually_exclusive_group()
    names.add_argument('--name', metavar='NAME',
                       help='what files and symbols begin with; default: the name of the bundle; '
                            'of several bundles, the name of the package')
    names.add_argument('--prefix', metavar='NAME',
                       help='as --name, and for all other names that the export defines, so that '
                            'several exports fit into one program')
    parser.add_argument('--handler-arguments', choices=[item.value for item in HandlerArguments],
                        default=HandlerArguments.NONE.value,
                        help='of copilot: what handlers are called with: nothing (default), or '
                             'the values of the inputs that the requirement reads')
    parser.add_argument('--gate', dest='gates', metavar='NAME', action='append', default=[],
                        help='of ros2: export the node of this gate, or of these, if it is given '
                             'again; default: the node of the requirements that no gate keeps')
    parser.add_argument('--margins', action='store_true',
                        help='of c99 and ros2: with how far each requirement is from the other '
                             'verdict')
    parser.add_argument('--templates', metavar='DIR', type=Path,
                        help='a folder with files of your own in place of some of the export')
    parser.add_argument('--no-proof', action='store_true',
                        help='do not prove the generated C, and write no certificate')
    parser.set_defaults(run=run, refuse=parser.error)


def _folder(text: str) -> Path:
    if not text:
        raise ArgumentTypeError('the name of a folder is missing')
    return Path(text)


def _refuse_arguments(options: Namespace) -> None:
    target = TARGETS[options.target]
    if options.handler_arguments != HandlerArguments.NONE.value and options.target != 'copilot':
        options.refuse(f'the target {options.target} calls no handlers of yours, only copilot '
                       'does: leave --handler-arguments out')
    if options.templates is not None and not options.templates.is_dir():
        options.refuse(f"argument --templates: there is no folder '{options.templates}'")
    if options.gates and not target.acts:
        options.refuse(f'the target {options.target} runs no gate, only ros2 does: leave --gate '
                       'out')
    if options.margins and not target.has_margins:
        options.refuse(f'the target {options.target} has no margins, only '
                       f'{_with_margins()} have: leave --margins out')
    if options.margins and options.gates:
        options.refuse('a gate has no margins: leave --margins out')
    if len(options.bundles) > 1 and target.several is None:
        options.refuse(f'the target {options.target} takes one bundle, only ros2 takes several')
    name = _name(options)
    if name is not None and not is_name(name):
        options.refuse(f"'{name}' cannot begin names in C: "
                       'use a letter, then at most 99 letters, digits and _')


def _with_margins() -> str:
    return ' and '.join(name for name, item in TARGETS.items() if item.has_margins)


def _name(options: Namespace) -> str | None:
    name: str | None = options.name if options.name is not None else options.prefix
    return name


def run(options: Namespace) -> int:
    """Export bundles to a folder, or the requirements of one to a file."""
    if options.target == _REQUIREMENTS:
        return _write_requirements(options)
    _refuse_arguments(options)
    monitors = [generate_monitor(item) for item in _readings(options)]
    for item in monitors:
        print_diagnostics(item.warnings)
    chosen = Options(options.prefix or '', HandlerArguments(options.handler_arguments),
                     _package(options) if len(monitors) > 1 else '')
    content = _content(options, monitors, chosen)
    check_output(options.output, content.templates)
    # Once without the certificate, so that a mistake in --templates is reported before the proof.
    written = partial(assemble, options.target, monitors[0], chosen, content,
                      others=monitors[1:], templates=options.templates)
    written()
    obstacle = _obstacle_to_proof(monitors)
    is_proved = not (options.no_proof or obstacle or missing_packages(_PROVER))
    files = written(certificate=_certificates(monitors) if is_proved else None)
    write_export(options.output, files)
    manifests = [item.manifest for item in monitors]
    n_requirements = sum(len(item.numbered) for item in manifests)
    print(f'{options.output}: {options.target}, {counted(len(files), "file")}, '
          f'{counted(n_requirements, "requirement")}, '
          f'{counted(sum(item.state_bytes for item in manifests), "byte")} of state')
    print(_proof_line(options, is_proved=is_proved, obstacle=obstacle))
    print('\n'.join(map(_size_line, measured_sizes(files, content.parts))))
    return 0


def _write_requirements(options: Namespace) -> int:
    others = (options.name, options.prefix, options.templates, options.gates, options.margins,
              options.constants, options.handler_arguments != HandlerArguments.NONE.value)
    if len(options.bundles) > 1 or any(others):
        options.refuse('the target requirements takes one bundle and no option but --output')
    path = existing_bundle(options.bundles[0])
    bundle = read(path, takes_instances=True).bundle
    assert bundle is not None, 'it is read from a file'
    data = requirements_file(bundle, options.output)
    with open_output(options.output, [Path(source.name) for source in bundle.sources]) as file:
        file.buffer.write(data)
    print(f'{options.output}: {counted(len(bundle.requirements), "requirement")}')
    return 0


def _content(options: Namespace, monitors: Sequence[GeneratedMonitor], chosen: Options) -> Content:
    target = TARGETS[options.target]
    content = target.content(monitors[0], chosen) if target.several is None or len(
        monitors) == 1 else target.several(monitors, chosen)
    for item in monitors:
        print_diagnostics(unacted(item, acts=target.acts))
    print_diagnostics(content.warnings)
    return content


def _package(options: Namespace) -> str:
    """Return the name of a package of several bundles, or gates."""
    return _name(options) or '_'.join(dict.fromkeys(
        Path(name).stem for name in options.bundles))


def _readings(options: Namespace) -> list[Reading]:
    """Read what is exported: each bundle, or each gate of one; several with distinct names."""
    constants = dict(options.constants)
    paths = [existing_bundle(name) for name in options.bundles]
    parts = _parts(options, paths)
    if len(parts) == 1:
        reading = _reading(options, paths[0], constants, parts[0][1])
        name = _name(options)
        return [reading if name is None else renamed(reading, name)]
    meant = {path: own_constants(path, constants) for path in paths}
    unknown = {*constants}.difference(*meant.values())
    meant[paths[0]] |= {name: constants[name] for name in unknown}  # it is refused there
    return [with_name(_reading(options, path, meant[path], part), f'b{number}_{path.stem}')
            for number, (path, part) in enumerate(parts)]


def _reading(options: Namespace, path: Path, constants: Mapping[str, Text],
             part: NodePart | None) -> Reading:
    limits = TARGETS[options.target].limits
    reading = read(path, constants=constants, part=part, takes_instances=True)
    if options.margins:
        reading = with_margins(reading)
    return reading if limits is None else with_written_keys(reading, options.target, limits)


def _parts(options: Namespace, paths: Sequence[Path]) -> list[tuple[Path, NodePart | None]]:
    """Return what is exported of each bundle."""
    if not options.gates:
        return [(path, TARGETS[options.target].part) for path in paths]
    wanted = list(dict.fromkeys(options.gates))
    if len(paths) == 1:
        return [(paths[0], NodePart(name)) for name in wanted]
    found = {path: [name for name in wanted if name in gate_names(path)] for path in paths}
    for name in sorted({*wanted}.difference(*found.values())):
        refuse(f"no bundle has the gate '{name}'")
    for path, names in found.items():
        if not names:
            refuse(without_gates(str(path), wanted))
    return [(path, NodePart(name)) for path, names in found.items() for name in names]


def _certificates(monitors: Sequence[GeneratedMonitor]) -> str:
    """Return the certificate of a bundle, or a list of those of several."""
    found = [_certificate(item) for item in monitors]
    return json.dumps(found[0] if len(found) == 1 else found, indent=1, ensure_ascii=False) + '\n'


def _certificate(generated: GeneratedMonitor) -> Any:
    """Prove the generated C; the certificate has no times, so that the export has equal bytes."""
    from fret_monitor.proving.certificate import as_dict, Certificate
    from fret_monitor.proving.verification import verify
    with progress('prove') as report:
        found = verify(generated, progress=report)
    if not found.is_proved:
        refuse('the generated C is not proved',
               help='`fret-monitor prove` shows what is missing; '
                    '--no-proof exports without a certificate')
    return _without_times(as_dict(Certificate(generated.manifest.name, generated, found)))


def _without_times(value: Any) -> Any:
    match value:
        case dict():
            return {key: _without_times(item) for key, item in value.items() if key != 'seconds'}
        case list():
            return [_without_times(item) for item in value]
        case _:
            return value


def _obstacle_to_proof(monitors: Sequence[GeneratedMonitor]) -> str:
    """Return why monitors are not proved as a whole; '' if they may be."""
    if any(item.kinds for item in monitors):
        return 'a bundle with instances; `fret-monitor prove` proves one of them'
    if any(item.manifest.has_margins for item in monitors):
        return 'margins; `fret-monitor prove` proves the bundle without them'
    if any(item.manifest.tests for item in monitors):
        return 'requirements with probabilities; `fret-monitor prove` proves the others'
    return ''


def _proof_line(options: Namespace, *, is_proved: bool, obstacle: str) -> str:
    if is_proved:
        return 'proved: the generated C computes its program (certificate.json)'
    if options.no_proof:
        return 'not proved: --no-proof'
    if obstacle:
        return f'not proved: {obstacle}'
    missing = missing_packages(_PROVER)
    return f'not proved: {" and ".join(missing)} missing; {pip_install(*missing)}'


def _size_line(sizes: PartSizes) -> str:
    if sizes.problem:
        return f'size unknown for {sizes.compiler}: {sizes.problem}'
    held = [f'{what} {counted(size, "byte")}' for what, size in sizes.held.items()]
    return (f'{sizes.part}: {counted(sizes.code, "byte")} of code and constants, '
            f'{counted(sizes.data, "byte")} of variables'
            + (f'; in your program: {", ".join(held)}' if held else '') + f' ({sizes.compiler})')
