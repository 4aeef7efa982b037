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
Compare the wordings of a requirement by their verdicts on random traces.

FRET exports a sentence and its formulas, of which users may edit one. Verdicts are those of the
reference semantics, on traces without NaN. Equal verdicts do not prove that wordings are
equivalent; a difference proves that they are not, and is returned with its trace.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from random import Random

from fret_monitor.bundle.bundle import Bundle, Language, Requirement
from fret_monitor.elaboration.elaborate import specify
from fret_monitor.importing.component import Exclusion
from fret_monitor.importing.draft import Comparison
from fret_monitor.logic.evaluate import evaluate_all
from fret_monitor.logic.formula import Feedback, Formula, postorder, Variable
from fret_monitor.logic.pointwise import Value
from fret_monitor.logic.propositions import bounds, horizon
from fret_monitor.logic.specification import Property
from fret_monitor.model.diagnostics import (
    CompileError, Diagnostic, Level, Source, Text,
)
from fret_monitor.model.policies import Severity
from fret_monitor.traces.boundary import boundary_values, constants
from fret_monitor.traces.random_traces import random_traces
from fret_monitor.traces.trace import length, rows_of

_TRACES = 150
_SHORT = 24  # steps of the trace for formulas without variables
_LONGEST = 400  # maximum steps of a trace
_MOST_WORK = 4_000_000  # maximum of nodes * steps * past steps examined at each


@dataclass(frozen=True)
class Difference:
    """
    Two wordings whose verdicts differ at the last step of a trace and at none before.

    `trace` has a column for each variable; `first` and `other` are the labels of the wordings;
    `verdict` is the verdict of the first.
    """

    id: str
    first: str
    other: str
    verdict: bool
    trace: dict[str, list[Value]]

    @property
    def step(self) -> int:
        """The step at which they differ, from 0."""
        return max((len(column) for column in self.trace.values()), default=1) - 1


def differences(comparison: Comparison) -> list[Difference]:
    """Return a difference for each further wording that differs from the first."""
    (label, first), *others = comparison.properties
    found = (_difference(comparison.id, label, first, other, item) for other, item in others
             if item.formula is not first.formula or item.feedback or first.feedback)
    return [item for item in found if item]


def overlaps(exclusions: Sequence[Exclusion], bundle: Bundle) -> Iterator[Diagnostic]:
    """
    Report the pairs of conditions that hold at once on a trace, with the values of its last step.

    `bundle` has the inputs and definitions that the conditions read.
    """
    if not exclusions:
        return
    texts = ['FALSE', *(f'{item.first} & {item.second}' for item in exclusions)]
    asked = tuple(Requirement(_whole(str(number)), Language.PTLTL, _whole(text), '', '', None,
                              Severity.ERROR) for number, text in enumerate(texts))
    try:
        never, *both = specify(replace(bundle, requirements=asked))[0].properties
    except CompileError as error:  # a task by hand, of which there is a comment
        yield Diagnostic('whether two conditions hold at once is not known',
                         help=error.diagnostics[0].title, level=Level.WARNING)
        return
    for item, found in zip(exclusions, both, strict=True):
        for difference in differences(Comparison(found.id, (('never', never), ('both', found)))):
            values = ', '.join(f'{name} = {column[-1]}' for name, column
                               in difference.trace.items() if name)
            yield Diagnostic(item.title, item.place, item.effect,
                             f'as with {values}' if values else '', Level.WARNING)


def _whole(text: str) -> Text:
    return Text.whole(Source('', text))


def _difference(id: str, label: str, first: Property, name: str,
                other: Property) -> Difference | None:
    formulas = [first.formula, other.formula]
    feedback = tuple(dict([*first.feedback, *other.feedback]).items())
    found = [{name: values[:step + 1] for name, values in trace.items()}
             for trace in _traces(first, other, Random(id))
             if (step := _first_difference(formulas, trace, feedback)) is not None]
    if not found:
        return None
    shortest = min(found, key=lambda trace: len(next(iter(trace.values()))))
    verdict = evaluate_all(formulas, shortest, feedback)[0][-1] is True
    return Difference(id, label, name, verdict, shortest)


def _first_difference(formulas: Sequence[Formula], trace: dict[str, list[Value]],
                      feedback: Sequence[tuple[Feedback, Formula]]) -> int | None:
    first, other = evaluate_all(formulas, trace, feedback)
    return next((step for step, (one, two) in enumerate(zip(first, other, strict=True))
                 if one is not two), None)


def _traces(first: Property, other: Property, rng: Random) -> Iterator[dict[str, list[Value]]]:
    """Yield traces of the variables of two wordings; fewer if evaluation is expensive."""
    nodes = postorder([*first.roots, *other.roots])
    variables = [node for node in nodes if isinstance(node, Variable)]
    if not variables:
        yield {'': [False] * _SHORT}
        return
    numbers = sorted({*constants(nodes), 0})
    pools = [[value for value in boundary_values(item.type, numbers)[0] if value == value]
             for item in variables]
    ends = {*bounds(first), *bounds(other)}
    reach = min(max(horizon(first), horizon(other)), _LONGEST // 3)
    work = 0
    for trace in islice(random_traces(pools, ends, reach, rng, _LONGEST), _TRACES):
        steps = length(trace)
        work += len(nodes) * steps * min(steps, 8)
        columns = zip(*rows_of(trace), strict=True)
        yield {item.name: list(column) for item, column in zip(variables, columns, strict=True)}
        if work > _MOST_WORK:
            return
