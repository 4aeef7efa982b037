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
The elaborated bundle: typed inputs, and one formula for each requirement.

`specify` (in `elaboration/elaborate.py`) makes it from a `Bundle` and the layouts of its messages.
It is the input of all later stages.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from math import ceil

from fret_monitor.language.sentence import Sentence
from fret_monitor.logic.formula import Feedback, Formula, postorder, Variable
from fret_monitor.messages.layout import MessageLayout
from fret_monitor.model.diagnostics import Span
from fret_monitor.model.made import Made
from fret_monitor.model.manifest import ManifestAction, ManifestGate, ManifestVariable
from fret_monitor.model.paths import FieldPath, LookUp
from fret_monitor.model.policies import (
    ActionKind, InputRole, InputSource, OverInstances, Policy, Report, Severity, Stale, Stamp,
)
from fret_monitor.model.probability import Probability
from fret_monitor.model.times import NANOSECONDS
from fret_monitor.model.values import ValueType


@dataclass(frozen=True)
class Signal:
    """
    An input with its type, its message field and its options.

    `values` are pairs (name, number or string). A string input has type INT32: its value is the
    index of the string in `values`. `initial` is None or a value of the type. `topic` and
    `message_type` are None for an input without ROS. `timeout` and `startup` are in seconds;
    `reduction` is as in `ManifestInput`. `max_rate` is the greatest number of messages a second.
    `layout` is that of the message; None if the specification was not made from a bundle, and
    messages cannot be decoded. `place` is that of the name in the bundle. `role` says who sets it.
    `made` is what the monitor makes the messages of; `topic` is then its name.
    `variables` are the instance variables that it mentions, in the order of the bundle: it has a
    value for each of their keys. `where` selects messages: those of which a field has a value.
    Margins of comparisons that read it are distances divided by `scale`.
    """

    name: str
    type: ValueType
    topic: str | None
    message_type: str | None
    path: FieldPath
    values: tuple[tuple[str, int | str], ...]
    initial: bool | int | float | None
    qos: tuple[tuple[str, str | int], ...]
    timeout: float | None = None
    stale: Stale = Stale.WARN
    startup: float | None = None
    reduction: str = ''
    layout: MessageLayout | None = field(default=None, repr=False)
    max_rate: Fraction | None = None
    source: InputSource = InputSource.FIELD
    role: InputRole = field(default=InputRole.INPUT, repr=False)
    place: Span | None = field(default=None, repr=False, compare=False)
    made: Made | None = field(default=None, repr=False)
    variables: tuple[str, ...] = field(default=(), repr=False)
    where: LookUp | None = field(default=None, repr=False)
    window: int = 0
    scale: float = field(default=1.0, repr=False)

    @property
    def room(self) -> int:
        """
        How many messages a rate keeps the times of; 0 of anything else.

        Any second may have all that `max_rate` allows at its end, and the next at its beginning.
        """
        if self.source is not InputSource.RATE or self.max_rate is None:
            return 0
        return ceil(self.max_rate * (self.window // NANOSECONDS['s'] + 1)) + 1

    @property
    def is_string(self) -> bool:
        """Whether it is a string input, with indices into `values` as its values."""
        return any(isinstance(value, str) for _, value in self.values)

    @property
    def is_never_negative(self) -> bool:
        """Whether it is a float that may be NaN, but not less than 0."""
        return self.reduction == 'norm'


def written_input(signals: Iterable[Signal], signal: Signal) -> Signal:
    """Return the input of the bundle for which an implied one was added; else the input itself."""
    if signal.place is None:
        return signal
    return next(item for item in signals if item.place == signal.place)


@dataclass(frozen=True)
class Property:
    """
    A requirement with its formula; `text` is the property as written, on one line.

    `feedback` has the equation of each `Feedback` node that the formula reaches, directly or
    through other equations; an equation may contain its own `Feedback` node. `place` is the place
    of the formula's text. `bounds` are, in ascending order, the largest few of the numbers of
    steps in that text and in the definitions it uses; the formula of a FRETish sentence contains
    further bounds. `sentence` is the parsed text if it is FRETish. `id_place` is that of the id.
    `constants` are the names of those in the text and in the definitions it uses.
    `is_assumption`: it constrains the environment instead of the system. `on_violation` and
    `on_end` are names of actions. `output` is a number that is kept after each step, for an
    aggregate. `horizon`: the verdict is that of so many steps ago, and TRUE before there are any.
    `probability` is that of a sentence with one; the formula is then a `NotRefuted`.
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
    id_place: Span | None = field(default=None, repr=False, compare=False)
    is_assumption: bool = field(default=False, repr=False)
    on_violation: tuple[str, ...] = ()
    on_end: tuple[str, ...] = ()
    constants: tuple[str, ...] = field(default=(), compare=False)
    output: Formula | None = None
    horizon: int = 0
    probability: Probability | None = None

    @property
    def roots(self) -> tuple[Formula, ...]:
        """The formula, its feedback equations, and its output."""
        output = () if self.output is None else (self.output,)
        return self.formula, *(equation for _, equation in self.feedback), *output

    @cached_property
    def inputs(self) -> tuple[str, ...]:
        """The names of the inputs in the formulas, in the order of first occurrence."""
        return tuple(node.name for node in postorder(self.roots) if isinstance(node, Variable))


@dataclass(frozen=True)
class Gate:
    """
    A gate, with the ids of the requirements that it keeps.

    `settings.topic` is None: the manifest has the index. `place` is that of its name,
    `keep_places` are those of the ids, and `otherwise_place` is that of what it sends instead.
    """

    settings: ManifestGate
    keep: tuple[str, ...]
    place: Span | None = field(default=None, repr=False, compare=False)
    otherwise_place: Span | None = field(default=None, repr=False, compare=False)
    keep_places: tuple[Span, ...] = field(default=(), repr=False, compare=False)

    @property
    def name(self) -> str:
        """Its name in the bundle."""
        return self.settings.name


@dataclass(frozen=True)
class InstanceAggregate:
    """
    A function of the values that an operand has in the instances of a variable, or of pairs.

    `signal` is the input, without a topic, that stands for its value in formulas. `feedback` is as
    in `Property`, of the operand. `place` is that of the first use.
    """

    signal: Signal
    function: OverInstances
    variables: tuple[str, ...]
    operand: Formula
    feedback: tuple[tuple[Feedback, Formula], ...] = ()
    place: Span | None = field(default=None, repr=False, compare=False)


@dataclass(frozen=True)
class Specification:
    """
    An elaborated bundle; `signals` and `properties` are in the bundle's order.

    `definitions` are the formulas of the bundle's definitions, for printing. Under the policy
    timed all windows are in ticks of a nanosecond; `unit` is how many seconds a plain count stands
    for (None: plain counts are refused), and `reorder` how many nanoseconds a message waits for
    messages with earlier stamps. Of the whole bundle, `gates` are all gates; a part of one (see
    `restrict`) has none. `gate` is that of a part that a gate keeps; `kept` are the ids that gates
    keep, of the part that they leave. `instance_variables` are those of the bundle, and
    `aggregates` what formulas read of their instances; `signals` has those of aggregates last.
    With `has_margins` a step computes margins, too.
    """

    name: str
    component: str
    signals: tuple[Signal, ...]
    properties: tuple[Property, ...]
    policy: Policy
    period: Fraction | None
    definitions: tuple[tuple[str, Formula], ...] = ()
    unit: Fraction | None = None
    stamp: Stamp = Stamp.RECEIVED
    reorder: int = 0
    actions: tuple[ManifestAction, ...] = ()
    gates: tuple[Gate, ...] = ()
    gate: Gate | None = None
    kept: tuple[tuple[str, tuple[str, ...]], ...] = ()
    instance_variables: tuple[ManifestVariable, ...] = ()
    aggregates: tuple[InstanceAggregate, ...] = ()
    has_margins: bool = False

    @cached_property
    def read(self) -> frozenset[str]:
        """The names of the inputs that requirements read, themselves or through aggregates."""
        operands = [item for item in postorder([item.operand for item in self.aggregates])
                    if isinstance(item, Variable)]
        return frozenset([*(item.name for item in operands),
                          *(name for item in self.properties for name in item.inputs)])

    @cached_property
    def gated(self) -> frozenset[str]:
        """The ids of the requirements that gates keep."""
        return frozenset(id_ for gate in self.gates for id_ in gate.keep)

    @cached_property
    def locks(self) -> frozenset[str]:
        """The names of the locks."""
        return frozenset(item.name for item in self.actions if item.kind is ActionKind.LOCK)
