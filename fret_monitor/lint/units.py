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
Warnings about numbers that are probably in another unit than the field of the message.

Only fields are known whose unit the comments of their message give, and numbers that such a field
never has: a percentage of 15 where 1.0 is all, an angle of 90 rad. They are in a table, since a
comment alone does not tell: angles in radians of steering wheels, encoders and joints are more
than a turn.
"""

from collections.abc import Iterator
import math

from fret_monitor.bundle.bundle import Bundle
from fret_monitor.logic.formula import (
    Binary, Constant, Conversion, Formula, postorder, Unary, UnaryOperator as Sign, Variable,
)
from fret_monitor.logic.specification import Signal, Specification
from fret_monitor.messages.installed import nested_layout
from fret_monitor.model.diagnostics import Diagnostic, Level, Span
from fret_monitor.model.manifest import ANGLES

_LONGEST_TIMEOUT_S = 60.0
_RADIANS = 2 * math.pi
_LARGEST = {
    ('sensor_msgs/msg/BatteryState', 'percentage'): 1.0,
    ('sensor_msgs/msg/RelativeHumidity', 'relative_humidity'): 1.0,
    ('sensor_msgs/msg/JoyFeedback', 'intensity'): 1.0,
    **{(f'sensor_msgs/msg/{scan}', f'angle_{name}'): _RADIANS
       for scan in ('LaserScan', 'MultiEchoLaserScan') for name in ('min', 'max', 'increment')},
    ('sensor_msgs/msg/Range', 'field_of_view'): _RADIANS,
    ('geometry_msgs/msg/Pose2D', 'theta'): _RADIANS,
    ('turtlesim/msg/Pose', 'theta'): _RADIANS,
}
"""The largest number that a field of a message has, in the unit that its comments give."""


def doubtful_units(bundle: Bundle, specification: Specification) -> Iterator[Diagnostic]:
    """Yield a warning for each number that is too large for the unit of what it is compared to."""
    limits = {signal.name: limit for signal in specification.signals
              if (limit := _largest(signal)) is not None}
    for item in specification.properties:
        found = {(name, value) for node in postorder([item.formula])
                 for name, value in _compared(node)
                 if name in limits and abs(value) > limits[name]}
        for name, value in sorted(found):
            yield _doubt(name, value, limits[name], item.place)
    yield from _long_timeouts(bundle, specification)


def _doubt(name: str, value: float, limit: float, place: Span | None) -> Diagnostic:
    if limit == _RADIANS:
        return Diagnostic(
            f"'{name}' is an angle in radians, and is compared with {value:g}",
            place, f'{value:g} rad are {value / _RADIANS:.3g} turns',
            f'{value:g} degrees are {math.radians(value):.6g} rad', Level.WARNING)
    return Diagnostic(
        f"'{name}' is from 0 to {limit:g}, and is compared with {value:g}",
        place, f'{limit:g} is all of it',
        f'{value:g} % are {value / 100:g}', Level.WARNING)


def _long_timeouts(bundle: Bundle, specification: Specification) -> Iterator[Diagnostic]:
    names = {entry.name.value: entry.name for entry in bundle.inputs}
    warned: set[str | None] = set()
    for signal in specification.signals:
        seconds = signal.timeout
        if seconds is None or seconds <= _LONGEST_TIMEOUT_S or signal.topic in warned:
            continue
        warned.add(signal.topic)
        yield Diagnostic(
            f"the timeout of '{signal.name}' is {seconds / 60:.3g} minutes",
            names[signal.name].span, f'{seconds:g} seconds',
            f'a timeout is in seconds: {seconds:g} ms are {seconds / 1000:g}', Level.WARNING)


def _compared(node: Formula) -> Iterator[tuple[str, float]]:
    """Yield the input and the number of a comparison of the two, also `abs(x)` and `-x`."""
    if not isinstance(node, Binary) or not node.operator.is_relation:
        return
    for side, other in ((node.left, node.right), (node.right, node.left)):
        while isinstance(side, Conversion) or (
                isinstance(side, Unary) and side.operator in (Sign.ABS, Sign.NEG)):
            side = side.argument
        while isinstance(other, Conversion):
            other = other.argument
        if isinstance(side, Variable) and isinstance(other, Constant) \
                and not isinstance(other.value, bool):
            yield side.name, float(other.value)


def _largest(signal: Signal) -> float | None:
    """Return the largest number of an input, if its message tells."""
    if signal.reduction in ANGLES:
        return _RADIANS
    layout = signal.layout
    for place, name in enumerate(signal.path):
        found = None if layout is None or not isinstance(name, str) else layout.find_field(name)
        if found is None or layout is None:
            return None
        if place == len(signal.path) - 1:
            return _LARGEST.get((layout.name, found.name))
        layout = nested_layout(layout, found.type) if found.type.is_message else None
    return None
