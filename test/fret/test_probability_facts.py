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
Trials against FRET's own words for them, for each of its templates (`future.json`).

An oracle reads the three sentences of a template's words: the scope, the trigger, the required
behaviour. It shares nothing with the formulas.
"""

from collections.abc import Callable, Iterator
from random import Random
import re
from typing import TypeAlias

import facts
from fret.sentences import formalise, sentence_for
from fret_monitor.logic.evaluate import evaluate
from fret_monitor.logic.formula import NotRefuted
from fret_monitor.model.diagnostics import CompileError
import pytest

_N = 3  # the duration in the words
_Trace: TypeAlias = dict[str, list[bool]]
_Interval: TypeAlias = tuple[int, int | None]  # the last step; None: it had not ended


def runs(values: list[bool]) -> list[_Interval]:
    """Return where values are true; the last run may go on."""
    found: list[_Interval] = []
    for step, value in enumerate(values):
        if value and (step == 0 or not values[step - 1]):
            found.append((step, None))
        if not value and step > 0 and values[step - 1]:
            found[-1] = (found[-1][0], step - 1)
    return found


def intervals(words: str, m: list[bool]) -> list[_Interval]:
    if words == 'in the interval defined by the entire execution.':
        return [(0, None)]
    if words == 'in every interval where m holds.':
        return runs(m)
    if words == 'in every interval where m does NOT hold.':
        return runs([not item for item in m])
    first, *_ = [*runs(m), (None, None)]
    if 'exclusive of) the first point where m holds' in words:
        return [] if first[0] == 0 else [(0, None if first[0] is None else first[0] - 1)]
    if 'starting strictly after the first m interval' in words:
        return [] if first[1] is None else [(first[1] + 1, None)]
    if 'starting at the first point where m holds' in words:
        return [] if first[0] is None else [(first[0], None)]
    assert 'to (and including) the first interval where m holds' in words, words
    return [(0, first[1])]


def triggers(words: str, c: list[bool], span: _Interval) -> list[int]:
    first, last = span
    steps = range(first, len(c) if last is None else last + 1)
    if words == 'first point in the interval.':
        return [step for step in steps if step == first]
    if words == 'every point in the interval where c is true.':
        return [step for step in steps if c[step]]
    assert words == ('first point in the interval if c is true and any point in the interval '
                     'where c becomes true (from false).')
    return [step for step in steps if c[step] and (step == first or not c[step - 1])]


# What decides a trial: of the steps since its trigger, r and s. None: not yet.
_Rule: TypeAlias = Callable[[int, bool, bool], bool | None]
_R = '(?:for every trigger, with probability BOUND, )'
_WORDS: list[tuple[str, _Rule, str]] = [
    (r'if trigger holds then r also holds at the same', lambda n, r, s: r, 'met'),
    (r'trigger and r cannot hold at the same', lambda n, r, s: not r, 'met'),
    (r'r must hold at the next time step', lambda n, r, s: r if n == 1 else None, 'met'),
    (r'r cannot hold at the next', lambda n, r, s: not r if n == 1 else None, 'met'),
    (r'r must hold at all time points between', lambda n, r, s: None if r else False, 'met'),
    (r'r must be false at all time points between', lambda n, r, s: False if r else None, 'met'),
    (r'r must hold at some time point between', lambda n, r, s: True if r else None, 'missed'),
    (r'r must be false at some time point between', lambda n, r, s: None if r else True, 'missed'),
    (r'if trigger holds, then r holds at the end', lambda n, r, s: None, 'r'),
    (r'trigger and r cannot hold at the last', lambda n, r, s: None, 'not r'),
    (r'r must hold at some point with distance', lambda n, r, s:
        True if r else False if n == _N else None, 'met'),
    (r'r must be false at some point with distance', lambda n, r, s:
        True if not r else False if n == _N else None, 'met'),
    (r'r must hold at the trigger and remain true for 3', lambda n, r, s:
        False if not r else True if n == _N else None, 'met'),
    (r'r must be false at all time points with distance <=3 .* or until the end',
        lambda n, r, s: False if r else True if n == _N else None, 'met'),
    (r'r must be false at all time points with distance <=3 .* Moreover, r must hold at',
        lambda n, r, s: (r if n == _N + 1 else False if r else None), 'met'),
    (r'r must either hold at some point with distance <=3',
        lambda n, r, s: (not r if n == _N + 1 else True if r else None), 'met'),
    (r'r must remain true until', lambda n, r, s: True if s else None if r else False, 'met'),
    (r'r must be false until', lambda n, r, s: True if s else False if r else None, 'met'),
    (r'r must hold at least once strictly before', lambda n, r, s:
        False if s else True if r else None, 'met'),
    (r'r must be false at least once strictly before', lambda n, r, s:
        False if s else None if r else True, 'met'),
]


def rule(words: str) -> tuple[_Rule, str]:
    found = [(decide, end) for pattern, decide, end in _WORDS if re.match(_R + pattern, words)]
    # `within` of an `only` scope and `after` begin alike.
    assert len(found) == 1, words
    return found[0]


def decision(decide: _Rule, end: str, begin: int, last: int | None,
             trace: _Trace) -> tuple[int, bool] | None:
    """Return at which step a trial is decided, and whether it succeeds."""
    for step in range(begin, len(trace['r'])):
        if last is not None and step > last:
            r = trace['r'][last]
            return step, {'met': True, 'missed': False, 'r': r, 'not r': not r}[end]
        found = decide(step - begin, trace['r'][step], trace['s'][step])
        if found is not None:
            return step, found
    return None


def outcomes(words: str, trace: _Trace) -> Iterator[tuple[int, bool]]:
    """Yield the trials of a trace in order; a trigger while one is open is none."""
    scope, rest = words.removeprefix('SCOPE: ').split(' TRIGGER: ')
    trigger, behaviour = rest.split(' REQUIRED BEHAVIOR: ')
    decide, end = rule(behaviour)
    free = 0
    for span in intervals(scope, trace['m']):
        for begin in triggers(trigger, trace['c'], span):
            if begin < free:
                continue
            found = decision(decide, end, begin, span[1], trace)
            if found is None:
                return
            yield found
            free = found[0] + 1


def stretches(rng: Random, steps: int) -> list[bool]:
    found: list[bool] = []
    while len(found) < steps:
        found += [rng.random() < 0.5] * rng.choice((1, 1, 2, 5))
    return found[:steps]


def test_the_trials_of_every_template_are_those_of_frets_words() -> None:
    rng = Random(33)
    compared = refused = decided = 0
    for item in facts.read('fret/future.json')['templates']:
        key = item['scope'], item['condition'], item['timing']
        sentence = sentence_for(key, _N).replace('shall', 'shall with probability > 0.9')
        no_end = item['scope'] in ('null', 'after', 'onlyBefore')
        if no_end and item['timing'] in ('always', 'never', 'eventually', 'null', 'finally'):
            with pytest.raises(CompileError, match='have no end'):
                formalise(sentence)
            refused += 1
            continue
        formula = formalise(sentence)
        assert isinstance(formula, NotRefuted)
        for _ in range(12):
            steps = rng.choice((1, 2, 6, 40))
            trace = {name: stretches(rng, steps) for name in 'mcrs'}
            found = [(step, value == 1) for step, value in enumerate(
                evaluate(formula.argument, trace)) if value]
            assert found == list(outcomes(item['probability'], trace)), (key, trace)
            decided += len(found)
        compared += 1
    assert (compared, refused) == (243, 45)
    assert decided > 4000
