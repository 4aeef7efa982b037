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


"""`formalize TEXT`: the formula of one FRETish sentence, on one line."""

from argparse import ArgumentParser, ArgumentTypeError, Namespace
from fractions import Fraction
import sys

from fret_monitor.cli.terminal import print_diagnostics
from fret_monitor.elaboration.durations import STEPS, TimeScale
from fret_monitor.elaboration.formalize import formalize
from fret_monitor.language.fretish import parse_fretish
from fret_monitor.lint.sentences import advise_alone
from fret_monitor.model.diagnostics import Source, Text
from fret_monitor.model.names import exact
from fret_monitor.model.policies import Policy


def add_arguments(parser: ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument('text', metavar='TEXT', help='the sentence; - reads standard input')
    parser.add_argument('--language', choices=('smv', 'cocospec'), default='smv',
                        help="FRET's past-time MTL for SMV (the default), or its CoCoSpec")
    parser.add_argument('--policy', choices=('steps', 'timed'), default='steps',
                        help='steps: durations count steps, as in FRET (the default); '
                             'timed: durations are times')
    parser.add_argument('--unit', metavar='SECONDS', type=_seconds,
                        help='with --policy timed: what a count without a unit stands for')
    parser.set_defaults(run=run, refuse=parser.error)


def _seconds(text: str) -> Fraction:
    number = exact(text)
    if number is None or number <= 0:
        raise ArgumentTypeError(f"'{text}' is not a number of seconds above 0")
    return number


def run(options: Namespace) -> int:
    """Print the formula; types of names are inferred from their use."""
    if options.unit is not None and options.policy != 'timed':
        options.refuse('--unit needs --policy timed')
    text = sys.stdin.read() if options.text == '-' else options.text
    sentence = parse_fretish(Text.whole(Source('<sentence>', text)))
    scale = TimeScale(Policy.TIMED, None, options.unit) if options.policy == 'timed' \
        else STEPS
    formula, warnings = formalize(sentence, options.language, scale)
    print_diagnostics([*advise_alone(sentence, scale.is_timed), *warnings])
    print(formula)
    return 0
