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

"""The evaluator and the engine of `csrc`, wrapped for Python; independent of ROS."""

from fret_monitor.runtime.engine import (
    Engine, MOST_DETAILS_PER_S, OrderCounts, Receipt, RequirementState, State,
)
from fret_monitor.runtime.evaluator import (
    Evaluator, InputCounts, NEVER, RequirementCounts, TimeCounts, TopicCounts, Violation,
)
from fret_monitor.runtime.gate import GateCounts, Judgement, MessageGate
from fret_monitor.runtime.margin_step import margin_step, MarginStep

__all__ = [
    'Engine',
    'Evaluator',
    'MessageGate',
    'GateCounts',
    'InputCounts',
    'Judgement',
    'MarginStep',
    'MOST_DETAILS_PER_S',
    'NEVER',
    'OrderCounts',
    'Receipt',
    'RequirementCounts',
    'RequirementState',
    'State',
    'TimeCounts',
    'TopicCounts',
    'Violation',
    'margin_step',
]
