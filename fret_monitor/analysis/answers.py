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

"""The answers of an analysis; None is `unknown`, with a reason."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

from fret_monitor.traces.trace import Row


class Question(Enum):
    """What an analysis can be asked; the value is the word on the command line."""

    CONSISTENCY = 'consistency'
    RT_CONSISTENCY = 'rt-consistency'
    VACUITY = 'vacuity'
    REDUNDANCY = 'redundancy'
    REALIZABILITY = 'realizability'
    REACHABILITY = 'reachability'

    @property
    def is_list(self) -> bool:
        """Whether it is asked of each requirement, and yes is a fault."""
        return self in (Question.VACUITY, Question.REDUNDANCY, Question.REACHABILITY)


@dataclass(frozen=True)
class Example:
    """
    A run that shows why an answer is no, with the values of all inputs at each step.

    `violated` are the ids of the requirements that the compiled monitor finds violated at the last
    step. `grid` is the time between two rows, in nanoseconds; None if rows are steps.
    """

    rows: tuple[Row, ...]
    violated: tuple[str, ...]
    grid: int | None = None


@dataclass(frozen=True)
class Answer:
    """
    An answer for some requirements.

    `method` says how a yes or no was found, `reason` why there is none. `conflicts` are smallest
    sets of requirements that exclude one another; `are_all` says whether there are no others.
    `notes` are findings that are no fault.
    """

    question: Question
    requirements: tuple[str, ...]
    holds: bool | None
    method: str = ''
    reason: str = ''
    example: Example | None = None
    conflicts: tuple[tuple[str, ...], ...] = ()
    are_all: bool = True
    outputs: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Analysis:
    """
    All answers: of each component for consistency and realizability, of each requirement else.

    For vacuity and redundancy, `holds` is True if the requirement is vacuous or redundant, for
    reachability if no run reaches some states of its diagram. `asked`
    are the questions, `seconds` the time taken, `is_partial` whether it was stopped early.
    """

    answers: tuple[Answer, ...]
    asked: frozenset[Question]
    seconds: float
    is_partial: bool = False

    def of(self, question: Question) -> list[Answer]:
        """Return the answers to a question."""
        return [item for item in self.answers if item.question is question]

    def together(self, question: Question) -> bool | None:
        """Return whether all answers to a question are yes."""
        found = [item.holds for item in self.of(question)]
        if question not in self.asked:
            return None
        return False if False in found else None if None in found else True

    def listed(self, question: Question, holds: bool | None = True) -> Sequence[str]:
        """Return the requirements for which a question has some answer; None is `unknown`."""
        return [item.requirements[0] for item in self.of(question) if item.holds is holds]
