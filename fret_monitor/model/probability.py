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
What a requirement with a probability asks for: the relation, its bound, and the confidence.

A test counts events: trials that fail, or, where the probability has an upper bound, trials that
succeed. docs/probability.md has the test.
"""

from decimal import Decimal, localcontext
from fractions import Fraction

from fret_monitor.model.frozen import frozen

RELATIONS = ('>', '>=', '<', '<=')
USUAL_CONFIDENCE = Fraction(999, 1000)
LEAST = Fraction(1, 10 ** 12)
"""The least distance of a bound, and of a confidence, from 0 and 1."""


@frozen
class Probability:
    """
    How probable it must be that a trial succeeds, and how sure a verdict has to be.

    `relation` is one of `RELATIONS`, `bound` is what it compares with; both as in the sentence.
    """

    relation: str
    bound: Fraction
    confidence: Fraction

    @property
    def required(self) -> str:
        """The relation and the bound, as in the sentence."""
        return f'{self.relation} {self.bound_text}'

    @property
    def bound_text(self) -> str:
        """The bound as a decimal number."""
        return _decimal(self.bound)

    @property
    def confidence_text(self) -> str:
        """The confidence as a decimal number."""
        return _decimal(self.confidence)

    @property
    def counts_successes(self) -> bool:
        """Whether the events that the test counts are successes: the bound is an upper one."""
        return self.relation in ('<', '<=')

    @property
    def allowed(self) -> float:
        """The probability of an event up to which the requirement holds."""
        return float(self.bound if self.counts_successes else 1 - self.bound)

    @property
    def rest(self) -> float:
        """One minus `allowed`, rounded once."""
        return float(1 - self.bound if self.counts_successes else self.bound)

    @property
    def limit(self) -> float:
        """The evidence at which a test rejects its hypothesis."""
        return float(1 / (1 - self.confidence))


def _decimal(number: Fraction) -> str:
    """Return a number that was written as a decimal one, exactly."""
    with localcontext(prec=60):
        return f'{(Decimal(number.numerator) / number.denominator).normalize():f}'
