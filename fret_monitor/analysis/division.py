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
The division of a part into smaller ones with the same answers.

Components share inputs, but no outputs. One that is realizable can answer whatever inputs the
others need: then it restricts no run of theirs. It is *robust* if no run that satisfies its
requirements leads it to a state where it is not realizable any more.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

from fret_monitor.analysis.answers import Question
from fret_monitor.analysis.component import build_component, by_outputs, Part, united
from fret_monitor.analysis.diagrams import MemoryErrors
from fret_monitor.logic.specification import Specification
from fret_monitor.smt.boolean import TooLarge
from fret_monitor.smt.transition import NotModelled
from fret_monitor.traces.deadline import Deadline, OutOfTime

_SMALL = 8  # requirements that are not divided


@dataclass(frozen=True)
class Task:
    """Questions about a part; `chosen` are the ids of the requirements that they are about."""

    part: Part
    questions: tuple[Question, ...]
    chosen: frozenset[str]


class _Freedom(Enum):
    NONE = 0
    REALIZABLE = 1
    ROBUST = 2


def tasks(specification: Specification, part: Part, questions: Sequence[Question],
          deadline: Deadline) -> Iterator[Task]:
    """Yield questions about smaller parts that answer those about a part."""
    components = by_outputs(specification, part)
    if len(part.properties) <= _SMALL or len(components) < 2:
        yield Task(part, tuple(questions), frozenset(part.ids))
        return
    freedom = []
    for number, item in enumerate(components):
        deadline.begin_part(2 * len(components) - number)  # half of the time is for the answers
        freedom.append(_freedom(specification, item, deadline))
    found = dict(enumerate(freedom))
    core = [item for place, item in enumerate(components) if found[place] is _Freedom.NONE]
    loose = [item for place, item in enumerate(components)
             if found[place] is not _Freedom.ROBUST]
    yield from _of_runs(part, components, core, found, questions)
    if Question.RT_CONSISTENCY in questions:
        for group in [[item] for item in components if item not in loose] + [loose] * bool(loose):
            whole = united(part, group)
            yield Task(whole, (Question.RT_CONSISTENCY,), frozenset(whole.ids))


def _of_runs(part: Part, components: Sequence[Part], core: list[Part],
             freedom: Mapping[int, _Freedom], questions: Sequence[Question]) -> Iterator[Task]:
    """Yield the questions for which the components that are not realizable matter."""
    asked = tuple(item for item in questions if item is not Question.RT_CONSISTENCY)
    if not asked:
        return
    groups = [[item] for place, item in enumerate(components)
              if freedom[place] is not _Freedom.NONE]
    seen: set[str] = set()
    for group in [core] * bool(core) + groups:
        chosen = {name for item in group for name in item.ids} - seen
        seen |= chosen  # an assumption may belong to several
        yield Task(united(part, [*group, *core]), asked, frozenset(chosen))


def _freedom(specification: Specification, part: Part, deadline: Deadline) -> _Freedom:
    try:
        with MemoryErrors():
            return _found_freedom(specification, part, deadline)
    except (MemoryError, NotModelled, OutOfTime, TooLarge):
        return _Freedom.NONE


def _found_freedom(specification: Specification, part: Part, deadline: Deadline) -> _Freedom:
    component = build_component(specification, part, None, deadline)
    games, d = component.games, component.games.diagrams
    if component.doubts or games.pending:
        return _Freedom.NONE
    if games.assumptions and not games.consistent(()).holds:
        return _Freedom.NONE
    found = games.realizable(component.required)
    if not found.holds:
        return _Freedom.NONE
    safe = games.safe(component.required)
    inside = d.before(found.last)
    layers = games.reach(safe & inside, safe & found.last & ~inside)
    return _Freedom.REALIZABLE if games.is_reached(layers) else _Freedom.ROBUST
