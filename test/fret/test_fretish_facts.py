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


"""FRETish against FRET's own formulas: its templates, real requirements, probes, its oracle."""

from collections.abc import Iterator
from random import Random
from typing import Any

import facts
from fret.sentences import formalise, INPUTS, parse, sentence_for
from fret_monitor.elaboration.formalize import scope_by_use
from fret_monitor.elaboration.scope import Scope
from fret_monitor.language.smv import parse_smv
from fret_monitor.logic.evaluate import evaluate_all
from fret_monitor.logic.formula import Formula, postorder, Variable
from fret_monitor.model.diagnostics import CompileError, Source, Text
from fret_monitor.model.values import ValueType
import pytest
from stages import elaborate, scope_of
from strategies import some

# Sentences that FRET accepts and formalises wrongly, and what we say of them.
_FRETS_BUGS = {
    'the sw shall always satisfy ~p & q': 'drops ~',
    'the sw shall always satisfy ~(p)': 'drops ~',
    'the sw shall always satisfy !(~p)': 'drops ~',
    'upon p | ~q the sw shall immediately satisfy r': 'drops ~',
    'in thereafter mode the sw shall always satisfy r': "finds 'after' in the name of the mode",
    'the sw shall within 1e3 ticks satisfy r': 'reads 1e3 as 1',
}
_REFUSED = {
    'the sw shall within 0.5 seconds satisfy p': 'whole number of steps',
    'the sw shall within -3 ticks satisfy r': 'negative',
    'the sw shall with probability > 0.9 always satisfy r': 'probability',
    '"the natural language text"': 'free text',
    'the sw shall always satisfy foo(x, p & q)': 'no function',
    'the sw shall always satisfy foo()': 'no function',
    'the sw shall always satisfy persists(3,p)': 'the future',
    'the sw shall always satisfy nextOcc(p,q)': 'the future',
    'the sw shall always satisfy persisted(n,p)': 'number of steps',
}
# FRET writes a bound here that cannot be read.
_MALFORMED = {
    'the sw shall within 2.0 seconds satisfy r': 'the sw shall within 2 seconds satisfy r',
}
_FOREIGN = ('cos', 'det_3x3', 'dot', 'mag', 'sin', 'sqrt', 'yout', 'Xtarg', 'persists')


def smv(text: str, scope: Scope) -> Formula:
    return elaborate(parse_smv(Text.whole(Source('<fret>', text))), scope)


def stretches(rng: Random, steps: int, values: list[Any]) -> list[Any]:
    found: list[Any] = []
    while len(found) < steps:
        found += [rng.choice(values)] * rng.choice((1, 1, 2, 4))
    return found[:steps]


def values_of(variable: Variable) -> list[Any]:
    if variable.type is ValueType.BOOL:
        return [False, True]
    numbers = [-1, 0, 1, 2, 3, 4, 5, 10, 42, 90]
    return numbers if variable.type.is_integer else [*map(float, numbers), 0.05]


def differs(rng: Random, ours: Formula, theirs: Formula, rounds: int) -> bool:
    inputs = [node for node in postorder([ours, theirs]) if isinstance(node, Variable)]
    for _ in range(rounds):
        steps = rng.choice((1, 2, 5, 40))
        trace = {item.name: stretches(rng, steps, values_of(item)) for item in inputs}
        found = evaluate_all([ours, theirs], trace or {'none': [0] * steps})
        if found[0] != found[1]:
            return True
    return False


def test_every_template_has_the_key_and_the_verdicts_of_fret() -> None:
    rng = Random(3)
    scope = scope_of(INPUTS)
    count = 0
    for item in some(facts.templates()):
        key = f"{item['scope']},{item['condition']},{item['timing']}"
        assert parse(item['fretish']).key == key
        ours = formalise(item['fretish'], scope)
        assert not differs(rng, ours, smv(item['ptltl'], scope), 12), item['fretish']
        count += 1
    assert count > 50


def test_every_real_requirement_has_the_key_and_the_verdicts_of_fret() -> None:
    rng = Random(4)
    compared = 0
    for item in facts.requirements():
        text = item['fretish']
        if 'with probability' in text or any(f'{name}(' in text for name in _FOREIGN):
            with pytest.raises(CompileError):
                formalise(text, Scope())
            continue
        sentence = parse(text)
        assert f'{sentence.key},satisfaction' == item['key']
        assert sentence.component.name == item['component']
        scope = scope_by_use(sentence)
        assert not differs(rng, formalise(text, scope), smv(item['ptltl'], scope), 12), text
        compared += 1
    assert compared == 117


def probes() -> Iterator[tuple[str, str, str]]:
    """Yield the sentences that FRET accepts, each with its key and formula."""
    text = key = ''
    for line in facts.path('fret/probes.txt').read_text(encoding='utf-8').splitlines():
        if line.startswith(('OK ', 'ERR ')):
            text = line[3:].strip() if line.startswith('OK ') else ''
        elif text and line.strip().startswith('key='):
            parts = line.strip()[4:].split()[0].split(',')
            key = ','.join((parts[0], parts[1], parts[3]))
        elif text and line.strip().startswith('pt='):
            yield text, key, line.strip()[3:]


def test_what_fret_accepts_has_its_key_and_verdicts_but_for_its_bugs() -> None:
    rng = Random(5)
    compared = 0
    for text, key, theirs in probes():
        if text in _REFUSED:
            with pytest.raises(CompileError, match=_REFUSED[text]):
                formalise(text, scope_by_use(parse(text)))
            continue
        scope = scope_by_use(parse(text))
        ours = formalise(text, scope)
        if text in _MALFORMED:
            assert ours is formalise(_MALFORMED[text], scope)
            continue
        if text in _FRETS_BUGS:
            assert differs(rng, ours, smv(theirs, scope), 30), _FRETS_BUGS[text]
            continue
        assert parse(text).key == key
        assert not differs(rng, ours, smv(theirs, scope), 12), text
        compared += 1
    assert compared > 140


def test_the_oracle_of_fret_agrees_with_every_formula() -> None:
    oracle = facts.read('fret/oracle.json')
    keys = [tuple(name.split(',')[:3]) for name in oracle['keys']]
    formulas = {duration: [formalise(sentence_for((key[0], key[1], key[2]), duration))
                           for key in keys]
                for duration in {setting[1] for setting in oracle['settings']}}
    for (steps, duration, *spans), expected in zip(oracle['settings'], oracle['expected'],
                                                   strict=True):
        trace = {name: [any(first <= step <= last for first, last in intervals)
                        for step in range(steps)]
                 for name, intervals in zip('mcrs', spans, strict=True)}
        found = evaluate_all(formulas[duration], trace)
        assert [str(int(values[-1])) for values in found] == list(map(str, expected))
