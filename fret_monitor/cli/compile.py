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

from argparse import _SubParsersAction
from argparse import ArgumentParser
from argparse import Namespace
from pathlib import Path
import sys

from fret_monitor.build import generate_monitor
from fret_monitor.build import read
from fret_monitor.build import write
from fret_monitor.diagnostics import counted


def add_to(verbs: '_SubParsersAction[ArgumentParser]') -> None:
    """Add the verb to the command line."""
    parser = verbs.add_parser('compile', help='write C, libraries and manifest to a folder')
    parser.add_argument('bundle', metavar='BUNDLE', type=Path)
    parser.add_argument('--output', metavar='DIR', type=Path, required=True)
    parser.set_defaults(run=run)


def run(options: Namespace) -> int:
    """Compile a bundle to a folder."""
    generated = generate_monitor(read(options.bundle))
    for warning in generated.warnings:
        print(warning.render(), file=sys.stderr)
    write(generated, options.output)
    manifest = generated.manifest
    operations = sum(group.operations for group in manifest.groups)
    print(f'{options.output}: {counted(len(manifest.requirements), "requirement")}, '
          f'{counted(manifest.state_bytes, "byte")} of state, '
          f'{counted(operations, "operation")} a step')
    return 0
