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
FRET's own formulas: its template for every key, real requirements, and its independent oracle.

The data lie in `shared/data` beside the repository, or where FRET_MONITOR_SHARED says; without
them these tests are skipped.
"""

from collections.abc import Iterator
from functools import cache
import json
import os
from pathlib import Path
from random import Random
import re
from typing import Any

from differential.compiled import Compiled
from fret_monitor.bundle.bundle import Language
from fret_monitor.elaboration.languages import read_formula
from fret_monitor.language.expression import (
    Boolean, Call, children, Conditional, Expression, Infix, Name, Number, postorder, Prefix,
)
from fret_monitor.logic.evaluate import verdicts
from fret_monitor.logic.formula import Formula, Variable
from fret_monitor.model.diagnostics import CompileError, Source, Text
from fret_monitor.model.values import ValueType
import pytest
from stages import elaborate, scope_of
from strategies import property_of, some, specification_of, thorough, Trace

ROOT = Path(__file__).resolve().parent.parent.parent
SHARED = Path(os.environ.get('FRET_MONITOR_SHARED', ROOT.parent / 'shared' / 'data')) / 'fret'
BOOL, NUMBER = ValueType.BOOL, ValueType.FLOAT64
ARITHMETIC = ('+', '-', '*', '/', 'mod', '^')
FAST = ('-std=c99', '-O0', '-fPIC', '-ffp-contract=off')
# Functions that a project of FRET's users defines outside of FRET.
FOREIGN = {'Xtarg', 'det_3x3', 'dot', 'mag', 'persists', 'yout'}
# What FRET calls the inputs of its templates.
MODE, CONDITION, RESPONSE, STOP = (Variable(name, BOOL) for name in 'mcrs')


def load(name: str) -> Any:
    """Return the contents of a file of the shared data."""
    path = SHARED / name
    if not path.is_file():
        pytest.skip(f'needs {name} of the shared data')
    return json.loads(path.read_text(encoding='utf-8'))


def tree_of(language: Language, text: str) -> Expression:
    """Read a formula of one of the languages."""
    tree = read_formula(language, Text.whole(Source('<fret>', text)))
    assert isinstance(tree, Name | Number | Boolean | Prefix | Infix | Call | Conditional)
    return tree


def meaning(language: Language, text: str, inputs: tuple[Variable, ...]) -> Formula:
    """Return the formula of a text."""
    return elaborate(tree_of(language, text), scope_of(inputs))


@cache
def templates() -> dict[str, tuple[str, str]]:
    """Return FRET's formula for each key, in SMV and CoCoSpec; the duration is 3."""
    return {f"{item['scope']},{item['condition']},{item['timing']},satisfaction":
            (item['ptltl'], item['cocospec']) for item in load('templates.json')['templates']}


def stretches(rng: Random, steps: int, values: list[Any]) -> list[Any]:
    """Return values that stay for a step or for a few."""
    column: list[Any] = []
    while len(column) < steps:
        column += [rng.choice(values)] * rng.choice((1, 1, 2, 3, 6))
    return column[:steps]


def test_both_formulas_of_each_template_mean_the_same_and_c_agrees() -> None:
    inputs = (MODE, CONDITION, RESPONSE, STOP)
    pairs = {key: (meaning(Language.PTLTL, ptltl, inputs),
                   meaning(Language.COCOSPEC, cocospec, inputs))
             for key, (ptltl, cocospec) in some([*templates().items()])}
    assert len(pairs) > 50
    rng = Random(1)
    trace = {item.name: stretches(rng, 120, [False, True]) for item in inputs}
    properties = [property_of(f'{key}-{number}', formula) for key, pair in pairs.items()
                  for number, formula in enumerate(pair)]
    found = Compiled(specification_of(properties, inputs), flags=FAST).run(trace)
    for index, (key, (ptltl, cocospec)) in enumerate(pairs.items()):
        expected = verdicts(ptltl, trace)
        assert verdicts(cocospec, trace) == expected, key
        assert found[2 * index] == found[2 * index + 1] == expected, key


def with_duration(formula: str, duration: int) -> str:
    """Put another duration for 3, which stands in bounds as itself, less one, or and one."""
    def bound(match: re.Match[str]) -> str:
        low, high = (int(text) for text in match.groups())
        return f'[{low and low - 3 + duration},{high - 3 + duration}]'
    return re.sub(r'\[(\d+),(\d+)\]', bound, formula)


def column_of(intervals: list[list[int]], steps: int) -> list[bool]:
    """Return which steps lie in one of the closed intervals."""
    return [any(first <= t <= last for first, last in intervals) for t in range(steps)]


def oracle_trace(setting: list[Any]) -> Trace:
    """Return the trace that a setting of the oracle describes."""
    steps, _, *intervals = setting
    return {item.name: column_of(part, steps) for item, part
            in zip((MODE, CONDITION, RESPONSE, STOP), intervals, strict=True)}


@cache
def template_meaning(text: str) -> Formula:
    """Return the meaning of a template; most have no duration, and are the same for each."""
    return meaning(Language.PTLTL, text, (MODE, CONDITION, RESPONSE, STOP))


@pytest.mark.parametrize('duration', [
    pytest.param(number, marks=() if number in (1, 4, 9) else thorough)
    for number in range(1, 10)])
def test_templates_give_the_verdicts_of_the_oracle_of_fret(duration: int) -> None:
    oracle = load('oracle.json')
    inputs = (MODE, CONDITION, RESPONSE, STOP)
    formulas = [template_meaning(with_duration(templates()[key][0], duration))
                for key in oracle['keys']]
    properties = [property_of(f'R-{number}', item) for number, item in enumerate(formulas)]
    compiled = Compiled(specification_of(properties, inputs), flags=FAST)
    chosen = [(oracle_trace(setting), expected) for setting, expected
              in zip(oracle['settings'], oracle['expected'], strict=True)
              if setting[1] == duration]
    assert chosen
    for trace, expected in chosen:
        last = [column[-1] for column in compiled.run(trace)]
        assert ''.join('01'[value] for value in last) == expected


def test_the_settings_of_the_oracle_have_the_durations_tested() -> None:
    assert {setting[1] for setting in load('oracle.json')['settings']} == set(range(1, 10))


# Real requirements come without types: these are found from how the names are used.

def names_as(kind: ValueType, node: Expression) -> Iterator[tuple[str, ValueType]]:
    if isinstance(node, Name):
        yield node.text, kind


def uses(node: Expression) -> Iterator[tuple[str, ValueType]]:
    """Yield the types that an operator requires of the names among its operands."""
    match node:
        case Prefix() | Conditional():
            kind = NUMBER if isinstance(node, Prefix) and node.operator == '-' else BOOL
            yield from names_as(kind, children(node)[0])
        case Infix(operator) if operator in (*ARITHMETIC, '<', '<=', '>', '>='):
            for child in children(node):
                yield from names_as(NUMBER, child)
        case Infix('=' | '!='):
            truths = [is_truth(child) for child in children(node)]
            for child in children(node):
                yield from names_as(BOOL if any(truths) else NUMBER, child)
        case Infix():
            for child in children(node):
                yield from names_as(BOOL, child)
        case Call():
            kind = ValueType.INT64 if node.function.endswith('Int') else NUMBER
            for child in node.arguments:
                yield from names_as(kind, child)


def is_truth(node: Expression) -> bool:
    match node:
        case Boolean():
            return True
        case Prefix():
            return node.operator != '-'
        case Infix():
            return node.operator not in ARITHMETIC
        case _:
            return False


def inputs_of(tree: Expression) -> tuple[Variable, ...]:
    """Return the names of a formula as inputs, typed by their use."""
    kinds = dict(names_as(BOOL, tree))
    for node in postorder(tree):
        for name, kind in uses(node):
            # BOOL wins over other uses; `preInt(0, x)` restricts x more than `x < 3`.
            if kinds.get(name, NUMBER) is NUMBER:
                kinds[name] = kind
    return tuple(Variable(name, kind) for name, kind in kinds.items() if name != 'FTP')


def foreign_functions(tree: Expression) -> set[str]:
    return {node.function for node in postorder(tree) if isinstance(node, Call)} & FOREIGN


def values_for(tree: Expression, kind: ValueType) -> list[Any]:
    """Return the numbers in a formula and their neighbours, or both truth values."""
    if kind is BOOL:
        return [False, True]
    written = {float(node.text) for node in postorder(tree) if isinstance(node, Number)} | {0.0}
    values = sorted(value + step for value in written for step in (-1, 0, 1))
    return [int(value) for value in values] if kind.is_integer else values


def requirements() -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = load('requirements.json')['requirements']
    assert len(found) == 130
    return found


class Batch:
    """Requirements whose inputs fit one another, for one library."""

    def __init__(self) -> None:
        self.kinds: dict[str, ValueType] = {}
        self.pools: dict[str, list[Any]] = {}
        self.pairs: list[tuple[Formula, Formula]] = []

    def takes(self, inputs: tuple[Variable, ...]) -> bool:
        """Return whether no input is already present with another type."""
        return all(self.kinds.get(item.name, item.type) is item.type for item in inputs)

    def add(self, item: dict[str, Any], tree: Expression, inputs: tuple[Variable, ...]) -> None:
        """Add both formulas of a requirement."""
        self.pairs.append((meaning(Language.PTLTL, item['ptltl'], inputs),
                           meaning(Language.COCOSPEC, item['cocospec'], inputs)))
        for one in inputs:
            self.kinds[one.name] = one.type
            self.pools.setdefault(one.name, []).extend(values_for(tree, one.type))

    def check(self) -> None:
        """Compare the formulas of each pair with one another and with C."""
        rng = Random(1)
        inputs = [Variable(name, kind) for name, kind in self.kinds.items()]
        trace = {item.name: stretches(rng, 300, self.pools[item.name]) for item in inputs}
        properties = [property_of(f'R-{number}-{side}', pair[side])
                      for number, pair in enumerate(self.pairs) for side in (0, 1)]
        found = Compiled(specification_of(properties, inputs), flags=FAST).run(trace)
        for number, (ptltl, cocospec) in enumerate(self.pairs):
            expected = verdicts(ptltl, trace)
            assert verdicts(cocospec, trace) == expected
            assert found[2 * number] == found[2 * number + 1] == expected


def test_both_formulas_of_each_real_requirement_mean_the_same_and_c_agrees() -> None:
    batches = [Batch()]
    for item in requirements():
        tree = tree_of(Language.PTLTL, item['ptltl'])
        if not foreign_functions(tree):
            inputs = inputs_of(tree)
            if not batches[-1].takes(inputs):
                batches.append(Batch())
            batches[-1].add(item, tree, inputs)
    for batch in batches:
        batch.check()
    assert sum(len(batch.pairs) for batch in batches) > 100


def test_a_requirement_with_a_function_that_is_not_frets_is_refused_by_its_name() -> None:
    refused = 0
    for item in requirements():
        for language, text in ((Language.PTLTL, item['ptltl']),
                               (Language.COCOSPEC, item['cocospec'])):
            tree = tree_of(language, text)
            foreign = foreign_functions(tree)
            if foreign:
                with pytest.raises(CompileError) as caught:
                    meaning(language, text, inputs_of(tree))
                assert any(name in str(caught.value) for name in foreign)
                refused += 1
    assert refused > 10
