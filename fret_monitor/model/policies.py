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

"""When a step happens, who sets an input, which violations are announced, what follows them."""

from collections.abc import Mapping
from enum import Enum

QOS_CHOICES = {
    'reliability': {'reliable': 'FM_STRONGER', 'best_effort': 'FM_WEAKER'},
    'durability': {'transient_local': 'FM_STRONGER', 'volatile': 'FM_WEAKER'},
    'history': {'keep_last': 'FM_WEAKER', 'keep_all': 'FM_STRONGER'},
}
"""The policies of the quality of service, and their values with those of `enum fm_choice`."""


def fixed_qos(qos: Mapping[str, str | int]) -> tuple[str, str, str, int]:
    """Return the fields of a `struct fm_fixed_qos` for policies that are fixed."""
    reliability, durability, history = (
        values.get(str(qos.get(policy)), 'FM_FOLLOW') for policy, values in QOS_CHOICES.items())
    return reliability, durability, history, int(qos.get('depth', 0))


class Policy(Enum):
    """When a step happens (docs/bundle.md)."""

    EVERY_MESSAGE = 'every_message'
    RELEVANT_MESSAGE = 'relevant_message'
    ALL_INPUTS = 'all_inputs'
    PERIODIC = 'periodic'
    TIMED = 'timed'

    @property
    def default_report(self) -> 'Report':
        """The report of a requirement for which the bundle names none."""
        return Report.OCCURRENCE if self is Policy.TIMED else Report.EVERY_STEP


class Report(Enum):
    """
    Which violations of a requirement are announced.

    `OCCURRENCE`: for a requirement `H p`, each time p becomes false; for others, as `ONSET`.
    """

    EVERY_STEP = 'every_step'
    ONSET = 'onset'
    OCCURRENCE = 'occurrence'


class Stamp(Enum):
    """Under the policy timed: which time of a message counts, its reception or its header's."""

    RECEIVED = 'received'
    HEADER = 'header'


class InputSource(Enum):
    """
    What an input is fed by.

    `FIELD`: a field of the message. `RECEIVED`: the fact that a message came, true at its step
    alone. `AGE`: the seconds between a stamp in the message and its reception. `INSTANCES`: no
    message; the aggregate of the instances of a variable. The evaluator measures the others.
    `RATE`: messages a second in the last `window`. `PERIOD`: the seconds between the last two
    messages. `TIME`: when the last one was received, in nanoseconds; no bundle names it.
    """

    FIELD = 'field'
    RECEIVED = 'received'
    AGE = 'age'
    INSTANCES = 'instances'
    RATE = 'rate'
    PERIOD = 'period'
    TIME = 'time'

    @property
    def is_measured(self) -> bool:
        """Whether the evaluator computes its values from the times of messages."""
        return self in (InputSource.RATE, InputSource.PERIOD, InputSource.TIME)


class OverInstances(Enum):
    """What an aggregate computes of its operand over the instances of a variable."""

    COUNT = 'count'
    ANY = 'any'
    ALL = 'all'
    SUM = 'sum'
    LEAST = 'min'
    GREATEST = 'max'

    @property
    def takes_truth(self) -> bool:
        """Whether its operand is Boolean; a number otherwise."""
        return self in (OverInstances.COUNT, OverInstances.ANY, OverInstances.ALL)


class InputRole(Enum):
    """
    Who sets an input, for `analyze`.

    `INPUT`: the environment. `OUTPUT`: the system, which has to meet the requirements.
    """

    INPUT = 'input'
    OUTPUT = 'output'


class Stale(Enum):
    """What happens, besides a warning, if an input gets no message within its `timeout`."""

    WARN = 'warn'
    VIOLATE = 'violate'


class Severity(Enum):
    """How a violation of a requirement is logged."""

    ERROR = 'error'
    WARN = 'warn'


class ActionKind(Enum):
    """What an action of a bundle does; the value is its key in the bundle."""

    LOCK = 'lock'
    PUBLISH = 'publish'
    CALL = 'call'
    TRANSITION = 'transition'


class Otherwise(Enum):
    """
    What a gate does in place of passing a message on; the value is its word in the bundle.

    `HOLD`: sends the last good message again. `RESPOND`: answers a request, of a service.
    """

    DROP = 'drop'
    HOLD = 'hold'
    SUBSTITUTE = 'substitute'
    RESPOND = 'respond'
