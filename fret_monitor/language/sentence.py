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
The parts of a FRETish sentence: scope, condition, component, timing, response.

`parse_fretish` returns a `Sentence`. The expressions in it are those of the other
languages (`language/expression.py`). The values of the enumerations are the words of FRET's
template keys.
"""

from dataclasses import dataclass
from enum import Enum
from fractions import Fraction

from fret_monitor.language.expression import Duration, Expression
from fret_monitor.model.diagnostics import Diagnostic, Span


class ScopeKind(Enum):
    """Where a requirement is in force, seen from a mode."""

    GLOBAL = 'null'
    IN = 'in'
    NOT_IN = 'notin'
    ONLY_IN = 'onlyIn'
    BEFORE = 'before'
    AFTER = 'after'
    ONLY_BEFORE = 'onlyBefore'
    ONLY_AFTER = 'onlyAfter'

    @property
    def is_only(self) -> bool:
        """Whether it forbids the response outside instead of requiring it inside."""
        return self in (ScopeKind.ONLY_IN, ScopeKind.ONLY_BEFORE, ScopeKind.ONLY_AFTER)


@dataclass(frozen=True, eq=False)
class ScopePhrase:
    """
    `in landing mode`, `while speed > 3`, `only after armed`: `mode` is what holds in the mode.

    `is_named` is true for `in m mode`, false for `while m`, which means the same. Never GLOBAL.
    """

    kind: ScopeKind
    mode: Expression
    is_named: bool
    span: Span


class ConditionKind(Enum):
    """From when a timing counts."""

    NONE = 'null'
    REGULAR = 'regular'
    HOLDING = 'holding'


@dataclass(frozen=True, eq=False)
class Qualifier:
    """
    One link of a chain: `upon p`, `or if q`, `and unless r is true`.

    `word` is upon, when, where, if, unless or whenever; `joint` is '&' or '|', which joins it
    to the part before it ('&' for the first). `is_negated` is true for `unless p` and `when p is
    false`, false for `unless p is false`.
    """

    word: str
    joint: str
    expression: Expression
    is_negated: bool
    span: Span


@dataclass(frozen=True, eq=False)
class ConditionPhrase:
    """
    A chain of qualifiers, joined from left to right: `when p and if q or if r` is (p & q) | r.

    `expression` is that as one expression. Never of kind NONE.
    """

    kind: ConditionKind
    qualifiers: tuple[Qualifier, ...]
    expression: Expression
    span: Span


class TimingKind(Enum):
    """When the response is due; NONE means the same as EVENTUALLY."""

    NONE = 'null'
    IMMEDIATELY = 'immediately'
    NEXT = 'next'
    FINALLY = 'finally'
    EVENTUALLY = 'eventually'
    ALWAYS = 'always'
    NEVER = 'never'
    UNTIL = 'until'
    BEFORE = 'before'
    WITHIN = 'within'
    FOR = 'for'
    AFTER = 'after'


@dataclass(frozen=True, eq=False)
class TimingPhrase:
    """`within 10 seconds` (a duration), `until p` (a stop), `always` (neither). Never NONE."""

    kind: TimingKind
    duration: Duration | None
    stop: Expression | None
    span: Span


@dataclass(frozen=True, eq=False)
class ProbabilityPhrase:
    """`with probability > 0.98`; `relation` is `>`, `>=`, `<` or `<=`, and 0 < `bound` < 1."""

    relation: str
    bound: Fraction
    span: Span


@dataclass(frozen=True, eq=False)
class ComponentPhrase:
    """The component; `span` is the place of its name."""

    name: str
    span: Span


@dataclass(frozen=True, eq=False)
class Sentence:
    """
    The parts of a FRETish sentence; omitted ones are None.

    `remarks` are warnings if FRET reads it in an unexpected way.
    """

    scope: ScopePhrase | None
    condition: ConditionPhrase | None
    component: ComponentPhrase
    timing: TimingPhrase | None
    response: Expression
    span: Span
    remarks: tuple[Diagnostic, ...] = ()
    probability: ProbabilityPhrase | None = None

    @property
    def scope_kind(self) -> ScopeKind:
        """The kind of the scope."""
        return self.scope.kind if self.scope else ScopeKind.GLOBAL

    @property
    def condition_kind(self) -> ConditionKind:
        """The kind of the condition."""
        return self.condition.kind if self.condition else ConditionKind.NONE

    @property
    def timing_kind(self) -> TimingKind:
        """The kind of the timing."""
        return self.timing.kind if self.timing else TimingKind.NONE

    @property
    def expressions(self) -> tuple[Expression, ...]:
        """All expressions: of scope, condition, stop and response, in this order."""
        parts = (self.scope.mode if self.scope else None,
                 self.condition.expression if self.condition else None,
                 self.timing.stop if self.timing else None, self.response)
        return tuple(part for part in parts if part is not None)

    @property
    def key(self) -> str:
        """The template key of FRET, such as `in,regular,within`."""
        kinds = (self.scope_kind, self.condition_kind, self.timing_kind)
        return ','.join(kind.value for kind in kinds)
