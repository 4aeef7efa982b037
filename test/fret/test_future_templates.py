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
FRET's future-time formulas of its templates say at step 0 what its past-time ones say at the end.

The finite ones do so for all. Those of MLTL do not know where a trace ends: they agree where
nothing changes any more before the last step, except where `finally` asks for the response at the
end of the execution. FRET's formula is TRUE there, or asks at the end of a mode alone.
"""

from collections.abc import Sequence
from functools import cache
from pathlib import Path
from random import Random

import facts
from fret_monitor.bundle.reader import parse_bundle
from fret_monitor.elaboration.elaborate import specify
from fret_monitor.logic.evaluate import evaluate_all
from fret_monitor.logic.specification import Property
from fret_monitor.model.diagnostics import Source
import pytest
from strategies import some

LAST = 7
NAMES = 'mcsr'
# Scopes that may last to the end of the execution, and FRET's MLTL does not say so.
ENDLESS = {('after', 'null'), ('after', 'regular'), ('after', 'holding'), ('in', 'null'),
           ('notin', 'regular'), ('notin', 'holding'), ('null', 'null'), ('null', 'regular'),
           ('null', 'holding'), ('onlyBefore', 'null'), ('onlyBefore', 'regular'),
           ('onlyBefore', 'holding'), ('onlyIn', 'regular'), ('onlyIn', 'holding')}


@cache
def pairs(kind: str) -> Sequence[tuple[tuple[str, str, str], Property, Property]]:
    """Return template keys, each with its future-time and its past-time formula."""
    texts = {key_of(item): item['ptltl'] for item in facts.templates()}
    chosen = some(facts.read('fret/future.json')['templates'])
    text = (f'format: 1\nconstants: {{M: {LAST}}}\n'
            'inputs: {m: {type: bool}, c: {type: bool}, s: {type: bool}, r: {type: bool}, '
            'LAST: {type: bool}}\nrequirements:\n')
    for number, item in enumerate(chosen):
        future = item[kind].replace(' V ', f' R[0,{LAST}] ').replace(' U ', f' U[0,{LAST}] ')
        text += (f'  - {{id: A{number}, mltl: "{future}"}}\n'
                 f'  - {{id: B{number}, ptltl: "{texts[key_of(item)]}"}}\n')
    found = specify(parse_bundle(Source('bundle.yaml', text), Path()))[0].properties
    return [(key_of(item), ahead, past) for item, ahead, past in zip(
        chosen, found[::2], found[1::2], strict=True)]


def key_of(item: dict[str, str]) -> tuple[str, str, str]:
    return item['scope'], item['condition'], item['timing']


def column(rng: Random, steps: int) -> list[bool]:
    found = [rng.random() < 0.5]
    while len(found) < steps:
        found.append(found[-1] is not (rng.random() < 0.35))
    return found


@pytest.mark.parametrize('seed', range(1))
def test_the_finite_formula_of_each_template_says_what_the_past_one_does(seed: int) -> None:
    for key, ahead, past in pairs('future_finite'):
        rng = Random(f'{key} {seed}')
        steps = max(ahead.horizon, LAST) + 1
        columns = {name: column(rng, steps) for name in NAMES}
        columns['LAST'] = [t == LAST for t in range(steps)]
        early, late = evaluate_all([ahead.formula, past.formula], columns)
        assert early[ahead.horizon] == late[LAST], key


@pytest.mark.parametrize('seed', range(1))
def test_the_formula_for_mltl_says_what_the_past_one_does_if_the_end_is_quiet(seed: int) -> None:
    differing = set()
    for key, ahead, past in pairs('mltl'):
        rng = Random(f'{key} {seed}')
        steps = max(ahead.horizon, LAST) + 1
        columns = {}
        for name in [*NAMES, 'LAST']:
            begin = column(rng, LAST - 1)
            columns[name] = begin + begin[-1:] * (steps - len(begin))
        early, late = evaluate_all([ahead.formula, past.formula], columns)
        if early[ahead.horizon] != late[-1]:
            differing.add(key)
    assert {timing for *_, timing in differing} <= {'finally'}
    assert {key[:2] for key in differing} <= ENDLESS
    assert differing


def test_the_formula_for_r2u2_says_at_each_step_what_the_one_for_mltl_says_at_the_first() -> None:
    for (key, r2u2, _), (_, whole, _) in zip(pairs('r2u2'), pairs('mltl'), strict=True):
        rng = Random(str(key))
        # G[0,M] around the whole, which R2U2's verdict at each step takes the place of.
        steps = max(r2u2.horizon, whole.horizon) + LAST + 1
        columns = {name: column(rng, steps) for name in [*NAMES, 'LAST']}
        each, once = evaluate_all([r2u2.formula, whole.formula], columns)
        assert all(each[r2u2.horizon:r2u2.horizon + LAST + 1]) == once[whole.horizon], key
