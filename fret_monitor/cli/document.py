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

"""The answers of `--json`: one document on standard output (docs/command_line.md)."""

from argparse import ArgumentParser
from collections.abc import Iterable, Mapping
import json

from fret_monitor.model.diagnostics import Diagnostic


def add_json_option(parser: ArgumentParser) -> None:
    """Add the option `--json` to a verb that prints one document."""
    parser.add_argument('--json', action='store_true',
                        help='print one JSON document, errors and warnings included')
    parser.set_defaults(has_document=True)  # unlike `bag`, which prints a line a recording


def print_document(content: Mapping[str, object], diagnostics: Iterable[Diagnostic]) -> None:
    """Print the answer of a verb with its errors and warnings."""
    print(json.dumps({**content, 'diagnostics': [_as_dict(item) for item in diagnostics]},
                     indent=1))


def _as_dict(item: Diagnostic) -> dict[str, object]:
    span = item.span
    return {
        'level': item.level.value,
        'file': span.source.name if span else None,
        'line': span.line if span else None,
        'column': span.column if span else None,
        'message': item.title,
        'label': item.label,
        'help': item.help,
    }
