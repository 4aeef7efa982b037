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

"""FRET's timings without queues: the same verdicts, and state that does not grow with bounds."""

from itertools import product
import random

from fret.sentences import formalise, INPUTS, sentence_for
from fret_monitor.logic.evaluate import evaluate_all
from fret_monitor.logic.formula import (
    Binary, BinaryOperator, Formula, Historically, Once, Unary, UnaryOperator, Variable, Window,
)
from fret_monitor.model.values import ValueType
from fret_monitor.program.lower import lower
from fret_monitor.program.monitor_program import Delay
from fret_monitor.program.rewriting import without_queues
import pytest
from strategies import property_of, some, specification_of

SCOPES = ('null', 'in', 'notin', 'onlyIn', 'before', 'after', 'onlyBefore', 'onlyAfter')
CONDITIONS = ('null', 'regular', 'holding')
BOUNDED = ('within', 'for', 'after')
ALWAYS = Window(0, None)

# "only ..., upon c the sw shall after n ticks satisfy r": violated where r becomes true exactly
# n + 1 steps after some trigger. Any set of triggers in the last n steps makes a difference.
WITH_QUEUE = set(product(('onlyIn', 'onlyBefore', 'onlyAfter'), ('regular', 'holding'),
                         ('after',)))


def random_trace(source: random.Random) -> dict[str, list[bool]]:
    """Return random values of the inputs, some rarely true and some rarely false."""
    length = source.randint(1, 20)
    rates = [source.choice([0.15, 0.5, 0.85]) for _ in INPUTS]
    return {item.name: [source.random() < rate for _ in range(length)]
            for item, rate in zip(INPUTS, rates, strict=True)}


@pytest.mark.parametrize('scope', some(SCOPES, 2))
def test_rewritten_sentences_have_the_same_verdicts(scope: str) -> None:
    source = random.Random(scope)
    for condition, timing, n in product(CONDITIONS, BOUNDED, (1, 2, 5)):
        formula = formalise(sentence_for((scope, condition, timing), n))
        simpler = without_queues([formula])[formula]
        for _ in range(60):
            trace = random_trace(source)
            wanted, found = evaluate_all([formula, simpler], trace)
            assert wanted == found, (condition, timing, n, trace)


def test_only_six_keys_need_a_queue() -> None:
    keys = {key for key in product(SCOPES, CONDITIONS, BOUNDED)
            if has_queue(formalise(sentence_for(key, 100)))}
    assert keys == WITH_QUEUE


def has_queue(formula: Formula) -> bool:
    """Whether the program of a formula stores more than the value of one step before."""
    program = lower(specification_of([property_of('A', formula)], INPUTS))
    return any(isinstance(equation.operation, Delay) and equation.operation.steps > 1
               for group in program.groups for equation in group.equations)


def test_a_scope_that_begins_again_without_an_answer_keeps_its_queue() -> None:
    # m may hold again later than n steps after the trigger, and c be forgotten by then.
    m, c, r = (Variable(name, ValueType.BOOL) for name in 'mcr')
    late = Binary(BinaryOperator.IMPLIES, Once(Window(2, 2), c), Once(Window(0, 1), r))
    formula = Historically(ALWAYS, Binary(BinaryOperator.IMPLIES, m, late))
    assert without_queues([formula])[formula] is formula
    trace = {'m': [False, False, False, True], 'c': [True, False, False, False],
             'r': [False] * 4}
    overdue = Historically(ALWAYS, Binary(
        BinaryOperator.IMPLIES, m, Unary(UnaryOperator.NOT, Once(Window(2, None), c))))
    assert evaluate_all([formula, overdue], trace) == [[True] * 4, [True, True, True, False]]
