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

"""
What a bundle means: typed inputs, and one formula for each requirement.

`specify` (in `elaboration/elaborate.py`) makes it from a `Bundle` and the layouts of its messages;
all later stages stand on it.
"""

from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property

from fret_monitor.language.sentence import Sentence
from fret_monitor.logic.formula import Feedback, Formula, postorder, Variable
from fret_monitor.messages.layout import MessageLayout
from fret_monitor.model.diagnostics import Span
from fret_monitor.model.policies import Policy, Report, Severity, Stale
from fret_monitor.model.values import ValueType


@dataclass(frozen=True)
class Signal:
    """
    An input with its type and where it comes from.

    `values` are its names: (name, number or string); a string input has type INT32 and counts as
    the index of its string in `values`. `initial` is None or a value of the type.
    `topic` and `message_type` are None for an input that exists only off ROS. `timeout` is in
    seconds; `reduction` is as in `ManifestInput`; `layout` is that of the message, None
    where no bundle was read: messages cannot be read then.
    """

    name: str
    type: ValueType
    topic: str | None
    message_type: str | None
    path: tuple[str | int, ...]
    values: tuple[tuple[str, int | str], ...]
    initial: bool | int | float | None
    qos: tuple[tuple[str, str | int], ...]
    timeout: float | None = None
    stale: Stale = Stale.WARN
    reduction: str = ''
    layout: MessageLayout | None = field(default=None, repr=False)

    @property
    def is_string(self) -> bool:
        """Whether it is a text, of which the values are indices into `values`."""
        return any(isinstance(value, str) for _, value in self.values)


@dataclass(frozen=True)
class Property:
    """
    A requirement with its formula; `text` is the property as written, on one line.

    `feedback` holds, for each `Feedback` node that the formula reaches, the equation it delays
    (whose own operands may reach `Feedback` nodes again, its own too). `place` is the formula's
    text. `bounds` are the numbers of steps that were written in it and in the definitions it uses,
    the largest few, in order: the formula of a sentence has more. `sentence` is
    the text taken apart, where it is FRETish.
    """

    id: str
    handler: str
    text: str
    title: str
    formula: Formula
    report: Report
    severity: Severity
    feedback: tuple[tuple[Feedback, Formula], ...] = ()
    place: Span | None = None
    bounds: tuple[int, ...] = ()
    sentence: Sentence | None = field(default=None, repr=False, compare=False)

    @property
    def roots(self) -> tuple[Formula, ...]:
        """The formula, and the equations of its feedback."""
        return self.formula, *(equation for _, equation in self.feedback)

    @cached_property
    def inputs(self) -> tuple[str, ...]:
        """The names of the inputs that are read, in the order they first occur."""
        return tuple(node.name for node in postorder(self.roots) if isinstance(node, Variable))


@dataclass(frozen=True)
class Specification:
    """
    All of a bundle, typed. `signals` and `properties` are in the bundle's order.

    `definitions` are the bundle's named expressions, for those who show formulas to people.
    """

    name: str
    component: str
    signals: tuple[Signal, ...]
    properties: tuple[Property, ...]
    policy: Policy
    period: Fraction | None
    definitions: tuple[tuple[str, Formula], ...] = ()
