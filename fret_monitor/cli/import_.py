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

"""`import FILE... [-o BUNDLE]`: make a bundle from files of FRET, R2U2 or Ogma."""

from argparse import ArgumentParser, Namespace
from pathlib import Path
import sys

from fret_monitor.cli.columns import columns
from fret_monitor.cli.terminal import print_diagnostics
from fret_monitor.importing import import_bundles, Imported, write_bundles
from fret_monitor.importing.files import ImportOptions
from fret_monitor.importing.state_machine import DiagramOptions, Mode
from fret_monitor.importing.xml_format import read_format
from fret_monitor.model.diagnostics import counted


def add_arguments(parser: ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument('files', metavar='FILE', nargs='+', type=Path,
                        help="FRET's project, component specification or Lustre; R2U2's "
                             'specification (C2PO); a table (CSV, XLSX); ReqIF; XML; a state '
                             "diagram (Mermaid, DOT); Ogma's variable database; a list of names "
                             'and topics')
    parser.add_argument('-o', '--output', metavar='BUNDLE',
                        help='the bundle to write, or a folder for a bundle of each component; '
                             'default: standard output')
    parser.add_argument('--component', metavar='NAME',
                        help='which component, if there are several')
    parser.add_argument('--columns', metavar='ROLE=HEAD', type=columns, default={},
                        help='the columns of a table, as in id=ID,fretish=Requirement; others are '
                        'found by their heads')
    parser.add_argument('--format', metavar='FORMAT', type=Path,
                        help='where requirements are in XML files: a YAML with XPaths, or a '
                        'format of Ogma (XMLFormat)')
    parser.add_argument('--mode', choices=[mode.value for mode in Mode], default='check',
                        help='of a state diagram: check that an input follows it (default), '
                        'calculate the state, or safeguard: which states may follow')
    parser.add_argument('--state-var', metavar='NAME', default='state',
                        help='the name of the state of a diagram; default: state')
    parser.add_argument('--input-var', metavar='NAME', default='input',
                        help='the input whose values numbers at edges are; default: input')
    parser.add_argument('--force', action='store_true', help='overwrite an existing bundle')
    parser.set_defaults(run=run)


def run(options: Namespace) -> int:
    """Import; return 0 if there are bundles, even if some work is left to do by hand."""
    if options.output is None:
        return _print(options)
    output = Path(options.output)
    is_folder = options.output.endswith('/') or output.is_dir()
    found = import_bundles(options.files, output, options.component, is_folder=is_folder,
                           options=_options(options))
    write_bundles(found, force=options.force, read=options.files)
    for item in found:
        _print_notes(item, f'{item.path}: ')
        print(f'{item.path}: {_summary(item)}')
    return 0


def _options(options: Namespace) -> ImportOptions:
    return ImportOptions(
        options.columns,
        DiagramOptions(Mode(options.mode), options.state_var, options.input_var),
        None if options.format is None else read_format(options.format))


def _print(options: Namespace) -> int:
    """Print the only bundle to standard output, and everything else to standard error."""
    [item] = import_bundles(options.files, Path('bundle.yaml'), options.component,
                            options=_options(options))
    print(item.text, end='')
    _print_notes(item, '')
    if item.traces:
        names = ', '.join(str(path) for path, _ in item.traces)
        print(f'not written without -o: {names}', file=sys.stderr)
    print(_summary(item), file=sys.stderr)
    return 0


def _print_notes(item: Imported, place: str) -> None:
    print_diagnostics(item.warnings)
    if item.draft.todo:
        print(f'{place}to do by hand ({len(item.draft.todo)}):', file=sys.stderr)
    for task in item.draft.todo:
        print('- ' + task.replace('\n', '\n      '), file=sys.stderr)


def _summary(item: Imported) -> str:
    left, missing = len(item.draft.left_out), sum(one.topic is None for one in item.draft.inputs)
    return (f'{counted(len(item.draft.requirements), "requirement")}'
            f'{f" ({left} left out)" if left else ""}, {counted(len(item.draft.inputs), "input")}'
            f'{f" ({missing} without a topic)" if missing else ""}')
