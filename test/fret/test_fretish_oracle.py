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


"""Every key of FRETish against its meaning without formulas, on thousands of random traces."""

from collections.abc import Sequence
from random import Random

import facts
from fret.sentences import formalise, sentence_for
from fret_monitor.logic.evaluate import evaluate_all
from fret_monitor.logic.formula import Formula, postorder, Variable
from oracle import KEYS, Setting, verdicts
import pytest
from strategies import EXAMPLES, some

Key = tuple[str, str, str]


def column(rng: Random, steps: int) -> list[bool]:
    """Return stretches of true and false, rare or frequent."""
    share = rng.choice((0.1, 0.3, 0.5, 0.8))
    found: list[bool] = []
    while len(found) < steps:
        found += [rng.random() < share] * rng.choice((1, 1, 2, 3, 5))
    return found[:steps]


def random_setting(rng: Random, duration: int) -> Setting:
    steps = rng.choice((4, 5, 6, 8, 10, 12, 16))
    mode, condition, response, stop = (column(rng, steps) for _ in range(4))
    return Setting(mode, condition, response, stop, duration)


def formulas_for(duration: int, keys: Sequence[Key] = KEYS) -> dict[Key, Formula]:
    return {key: formalise(sentence_for(key, duration)) for key in keys}


def compare(formulas: dict[Key, Formula], setting: Setting) -> int:
    """Compare the verdict of every formula at every step; return how many there are."""
    trace = dict(zip('mcrs', (setting.mode, setting.condition, setting.response, setting.stop),
                     strict=True))
    found = dict(zip(formulas, evaluate_all([*formulas.values()], trace), strict=True))
    length = len(setting.mode)
    for steps in range(1, length + 1):
        expected = verdicts(setting.until(steps), formulas)
        for key, values in found.items():
            assert values[steps - 1] == expected[key], (key, setting.until(steps))
    return len(formulas) * length


@pytest.mark.parametrize('duration', range(7))
def test_every_key_means_what_its_intervals_and_triggers_say(duration: int) -> None:
    rng = Random(duration)
    # Three of four keys have no duration: those are compared twice, not with all durations.
    formulas = formulas_for(duration, KEYS if duration < 2 else [
        key for key in KEYS if key[2] in ('within', 'for', 'after')])
    count = 288 if duration < 2 else 72
    traces = EXAMPLES
    compared = sum(compare(formulas, random_setting(rng, duration)) for _ in range(traces))
    assert compared > 7 * traces * count


def columns_of(key: Key) -> str:
    """Return which columns of a trace decide the verdict of a key: m, c, r and s."""
    scope, condition, timing = key
    return 'm' * (scope != 'null') + 'c' * (condition != 'null') + 'r' + \
        's' * (timing in ('until', 'before'))


@pytest.mark.parametrize('read', sorted({columns_of(key) for key in KEYS}))
def test_all_traces_of_three_steps_agree_for_every_key(read: str) -> None:
    formulas = formulas_for(1, [key for key in KEYS if columns_of(key) == read])
    for item in formulas.values():
        assert {node.name for node in postorder([item]) if isinstance(node, Variable)} <= {*read}
    # Of three columns there are 512 traces, of four 4096: those are compared in part.
    bits = 3 * len(read)
    for number in some(range(2 ** bits), {3: 3, 4: 23}.get(len(read), 1)):
        columns = dict.fromkeys('mcrs', [False] * 3) | {
            name: [bool(number >> 3 * place + step & 1) for step in range(3)]
            for place, name in enumerate(read)}
        compare(formulas, Setting(columns['m'], columns['c'], columns['r'], columns['s'], 1))


def test_the_oracle_of_this_suite_agrees_with_that_of_fret() -> None:
    data = facts.read('fret/oracle.json')
    count = 0
    for (steps, duration, *spans), expected in zip(data['settings'], data['expected'],
                                                   strict=True):
        mode, condition, response, stop = ([any(first <= step <= last for first, last in intervals)
                                            for step in range(steps)] for intervals in spans)
        found = verdicts(Setting(mode, condition, response, stop, duration), KEYS)
        for name, verdict in zip(data['keys'], expected, strict=True):
            scope, condition_kind, timing = name.split(',')[:3]
            assert found[scope, condition_kind, timing] == (verdict in ('1', 1)), (name, spans)
            count += 1
    assert count == 26_400
