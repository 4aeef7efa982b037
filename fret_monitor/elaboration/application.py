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

"""The call of a predefined function, and what such a function is."""

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil

from fret_monitor.elaboration.durations import approximate, STEPS, TimeScale
from fret_monitor.elaboration.implied_inputs import ImpliedInputs
from fret_monitor.elaboration.terms import describe, Lasting, TypedTerm
from fret_monitor.logic.formula import Formula, FTP
from fret_monitor.logic.numbers import ExactNumber
from fret_monitor.model.diagnostics import Problems, refuse, Span


@dataclass(frozen=True)
class Application:
    """
    A call with elaborated arguments, whose number is correct.

    `left` holds at the left end of the interval in which the call looks back; None for no end.
    The counts and times among the arguments are numbers of `scale` already. `implied` are the
    inputs that a call may add; None without a bundle.
    """

    name: str
    arguments: tuple[TypedTerm, ...]
    place: Span
    problems: Problems
    left: Formula | None = FTP
    scale: TimeScale = STEPS
    implied: ImpliedInputs | None = None

    @property
    def quoted(self) -> str:
        """The quoted name, for messages."""
        return f"'{self.name}'"


@dataclass(frozen=True)
class Function:
    """
    A predefined function: the arguments of each form, and its formula.

    `gives_truth`: the result is Boolean for all arguments. `counts_steps`: all arguments except
    the last are numbers of steps. `is_timed`: only under the policy timed.
    """

    forms: tuple[str, ...]
    meaning: Callable[[Application], Formula | ExactNumber | Lasting]
    gives_truth: bool = False
    counts_steps: bool = False
    is_timed: bool = False

    def takes(self, count: int) -> bool:
        """Whether a form has `count` arguments."""
        return any(len(form.split(', ')) == count for form in self.forms)


def count_of(call: Application, term: TypedTerm) -> int:
    """Return an argument that is a number of steps or nanoseconds; refuse what is none."""
    value, longest = term.value, call.scale.longest
    if not isinstance(value, ExactNumber) or value.is_real or not 0 <= value.value <= longest:
        what = 'a time, up to 2^62 ns, or a count' if call.scale.is_timed else \
            f'a number of steps, from 0 to {longest}'
        refuse(f'{call.quoted} takes {what}, as digits or as a constant', term.span,
               f'this is {describe(term)}', f'write {_mended(call, term)}')
    return value.value.numerator


def _mended(call: Application, term: TypedTerm) -> str:
    """Return a call with a count in place of an argument that is none."""
    last, value = call.arguments[-1], term.value
    unit = ' s' if call.scale.is_timed else ''
    if not isinstance(value, ExactNumber):
        is_swapped = isinstance(last.value, ExactNumber) and len(call.arguments) == 2
        return f'{call.name}({last.span.written}{unit}, {term.span.written})' if is_swapped else \
            f'{call.name}(10{unit}, ...): its length is the same at every step'
    number = abs(value.value)
    if number > call.scale.longest:
        return f'{call.scale.longest} at most'
    return f'{call.name}({approximate(number) if unit else ceil(number)}{unit}, ...)'
