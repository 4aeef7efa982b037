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

"""The targets of `export` by name."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from fret_monitor.build import GeneratedMonitor
from fret_monitor.export.c99 import c99
from fret_monitor.export.cfs import cfs
from fret_monitor.export.content import Content, Options
from fret_monitor.export.copilot import copilot
from fret_monitor.export.fprime import fprime
from fret_monitor.export.ros2 import ros2, ros2_of_several
from fret_monitor.export.written_keys import Limits, OF_MESSAGES
from fret_monitor.model.parts import NodePart, UNGATED


@dataclass(frozen=True)
class Target:
    """
    A target: a line for `--help`, and the function that makes its files.

    The function raises a `CompileError` with places for a bundle that the target cannot do. `part`
    is what the target takes of a bundle; None: all requirements. `acts`: it starts its actions,
    and runs a gate instead, if one is named. `limits` are those of a bundle with `for_each`, whose
    keys are written in place of the variables; None: the target has no such bundles. `several`
    makes the files of more than one bundle; None: it takes one. `has_margins`: it takes bundles
    whose steps compute margins.
    """

    summary: str
    content: Callable[[GeneratedMonitor, Options], Content]
    part: NodePart | None = None
    acts: bool = False
    limits: Limits | None = None
    several: Callable[[Sequence[GeneratedMonitor], Options], Content] | None = None
    has_margins: bool = False


TARGETS = {
    'c99': Target('C99 and CMake: the monitors, and the evaluator that runs any of them', c99,
                  limits=OF_MESSAGES | Limits.ELEMENTS, has_margins=True),
    'cfs': Target('an application of the core Flight System: an event for each violation', cfs,
                  limits=OF_MESSAGES),
    'copilot': Target('the interface of the C that Copilot generates: step() and handlers',
                      copilot, limits=Limits.NONE),
    'fprime': Target('a component of F Prime: an event and a channel for each requirement',
                     fprime, limits=OF_MESSAGES),
    'ros2': Target('a package for colcon, with one node in C on rcl', ros2,
                   UNGATED, acts=True, several=ros2_of_several, has_margins=True),
}
