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

"""`prove BUNDLE`: proof by a solver that the C computes the equations of the requirements."""

from argparse import ArgumentParser, Namespace
from itertools import zip_longest
from pathlib import Path
import sys
from typing import TYPE_CHECKING

from fret_monitor.build import generate_monitor, read_one_instance, without_probabilities
from fret_monitor.cli.constants import add_constants
from fret_monitor.cli.document import add_json_option, print_document
from fret_monitor.cli.limits import seconds
from fret_monitor.cli.terminal import painted, print_diagnostics, progress
from fret_monitor.model.bundle_files import BUNDLE_HELP, existing_bundle
from fret_monitor.model.diagnostics import counted, refuse, require_packages
from fret_monitor.model.output import open_output, refuse_overwriting
from fret_monitor.native.folder import source_files

if TYPE_CHECKING:
    from fret_monitor.proving.verification import Verification

_NEEDED = {'z3': 'z3-solver', 'pycparser': 'pycparser'}


def add_arguments(parser: ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument('bundle', metavar='BUNDLE', help=BUNDLE_HELP)
    add_constants(parser)
    parser.add_argument('--sources', metavar='DIR', type=Path,
                        help='require that this folder holds, word for word, the C that is proved')
    add_json_option(parser)
    parser.add_argument('--timeout', metavar='SECONDS', type=seconds, default=30.0,
                        help='time limit of each obligation; default 30')
    parser.add_argument('--trace', metavar='FILE.csv', type=Path,
                        help='write a counterexample to this file, for `simulate`')
    parser.set_defaults(run=run)


def run(options: Namespace) -> int:
    """Prove a bundle; return 1 if it is not proved."""
    require_packages('`prove`', _NEEDED)
    # Imported here: loading the solver is slow, and the other verbs do not need it.
    from fret_monitor.proving.certificate import as_dict, Certificate, lines
    from fret_monitor.proving.verification import verify
    bundle = existing_bundle(options.bundle)
    reading, left_out = without_probabilities(read_one_instance(
        bundle, constants=dict(options.constants)), 'prove')
    generated = generate_monitor(reading)
    if not options.json:
        print_diagnostics((*generated.warnings, *left_out))
    if options.sources is not None and left_out:
        refuse('--sources: they hold requirements with probabilities, which are not proved',
               help='prove the bundle without --sources')
    if options.sources is not None:
        _require_same_files(options.sources, source_files(generated.module.files))
    if options.trace is not None:
        sources = () if options.sources is None else options.sources.iterdir()
        refuse_overwriting(options.trace, (*generated.sources, *sources))
    with progress('prove') as report:
        found = verify(generated, seconds=options.timeout, progress=report)
    certificate = Certificate(bundle.name, generated, found)
    if options.json:
        print_document(_with_trace(as_dict(certificate), found),
                       (*generated.warnings, *left_out))
    else:
        style = 'satisfied' if found.is_proved else 'violated'
        first, *others = lines(certificate)
        print('\n'.join([painted(first, style, sys.stdout), *others]))
    _report_counterexample(options, found)
    return 0 if found.is_proved else 1


def _require_same_files(folder: Path, written: dict[str, str]) -> None:
    """Refuse a folder that does not hold exactly the files that `compile` writes to `src`."""
    how = '`compile BUNDLE --output DIR` of this version writes the sources to DIR/src'
    try:
        names = {item.name for item in folder.iterdir()}
        # CRLF ends a line too; a lone CR does not, for a compiler.
        found = {name: (folder / name).read_bytes().replace(b'\r\n', b'\n')
                 for name in sorted(names & written.keys())}
    except OSError as error:
        refuse(f"cannot read '{error.filename}': {error.strerror or error}")
    for name in sorted(names ^ written.keys()):
        if name in written:
            refuse(f"there is no file '{folder / name}'", help=how)
        refuse(f"'{folder / name}' is not a file that `compile` writes: a compiler might use it",
               help='remove it, or prove a folder without it')
    for name, content in found.items():
        lines, wanted = content.split(b'\n'), written[name].encode().split(b'\n')
        for number, (line, other) in enumerate(zip_longest(lines, wanted), 1):
            if line != other:
                refuse(f"'{folder / name}', line {number}, is not what `compile` writes",
                       help=how)


def _with_trace(content: dict[str, object], found: 'Verification') -> dict[str, object]:
    from fret_monitor.proving.refutation import to_csv
    example = found.counterexample
    if example is None or found.subject is None:
        return {**content, 'counterexample': None}
    ids = [item.id for item in found.subject.program.properties]
    return {**content, 'counterexample': {
        'trace': to_csv(found.subject, example),
        'meant': {ids[number]: value for number, value in example.meant.items()},
        'found': {ids[number]: value for number, value in example.found.items()},
        'undefined': list(example.undefined)}}


def _report_counterexample(options: Namespace, found: 'Verification') -> None:
    from fret_monitor.proving.refutation import to_csv
    example = found.counterexample
    if example is None or found.subject is None:
        return
    text = to_csv(found.subject, example)
    if options.trace is not None:
        with open_output(options.trace) as file:
            file.write(text)
    if options.json:
        return
    properties = found.subject.program.properties
    steps = counted(len(example.rows), 'step')
    print(f'\nCounterexample, {steps} from a reset; at the last of them')
    for number, meant in example.meant.items():
        if example.found[number] is not meant:
            print(f'  {properties[number].id} is {_word(meant)}; the C computes '
                  f'{_word(example.found[number])}')
    for what in example.undefined:
        print(f'  the C is undefined: {what}')
    if options.trace is not None:
        print(f'{options.trace}: the trace, for `fret-monitor simulate {options.bundle} --trace '
              f'{options.trace}`')
    else:
        print(text, end='')


def _word(verdict: bool) -> str:
    return 'satisfied' if verdict else 'violated'
