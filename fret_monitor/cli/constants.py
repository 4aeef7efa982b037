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

"""The option `--constant NAME=VALUE` of the verbs that read bundles."""

from argparse import ArgumentParser, ArgumentTypeError

from fret_monitor.model.diagnostics import Source, Text


def add_constants(parser: ArgumentParser) -> None:
    """Add the option; `dict(options.constants)` are then the overrides, by name."""
    parser.add_argument(
        '--constant', dest='constants', metavar='NAME=VALUE', type=constant, action='append',
        default=[], help="a constant of the bundle, with a value in place of the bundle's")


def constant(text: str) -> tuple[str, Text]:
    """Return the name and the value of NAME=VALUE."""
    name, equals, value = text.partition('=')
    if name.endswith(':'):
        raise ArgumentTypeError(f"'{text}': here it is {name[:-1]}={value}, without the colon")
    if not equals or not name:
        raise ArgumentTypeError(f"'{text}' is not NAME=VALUE, such as v_max=0.8")
    return name, Text.whole(Source(f'--constant {name}', value))
