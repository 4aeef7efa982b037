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

"""Mutants of generated C: each is refuted or shown equivalent; what is refuted is different."""

import ctypes
from pathlib import Path
from random import Random
from typing import Any

from bench.mutants import (
    BUNDLES, cell_functions, generated_functions, judged, judged_cell, printed, sample, subject_of,
    TICK_FUNCTIONS,
)
from differential.compiled import compile_c, gcc
from fret_monitor.build import GeneratedMonitor
from fret_monitor.logic.evaluate import evaluate_all
from fret_monitor.logic.formula import Variable
from fret_monitor.model.values import ValueType
from fret_monitor.native.cache import runtime_headers
from fret_monitor.proving.c_source import preprocess, Struct
from fret_monitor.proving.monitor import ProofSubject
from fret_monitor.proving.refutation import Counterexample
from fret_monitor.smt import numbers
from fret_monitor.smt import terms as t
import pytest
from strategies import IS_THOROUGH, random_trace, thorough

EACH = 12 if IS_THOROUGH else 6  # of each bundle; `make prove` judges more
COMPILED = 3
C_TYPES: dict[ValueType, Any] = {
    ValueType.BOOL: ctypes.c_bool, ValueType.INT32: ctypes.c_int32,
    ValueType.INT64: ctypes.c_int64, ValueType.UINT64: ctypes.c_uint64,
    ValueType.FLOAT32: ctypes.c_float, ValueType.FLOAT64: ctypes.c_double,
}


def plain(value: Any, kind: ValueType) -> Any:
    """Return a value of a row as the reference takes it: with its sign."""
    if kind.is_signed:
        return t.signed(value, numbers.sort_of(kind)[1])
    return value


def random_rows(monitor: GeneratedMonitor) -> list[list[Any]]:
    """Return a random trace as rows."""
    inputs = [Variable(item.name, item.type) for item in monitor.program.signals]
    trace = random_trace(Random(7), inputs, 300)
    return [list(row) for row in zip(*(trace[item.name] for item in inputs))]


def last_verdicts(source: str, subject: ProofSubject, group: int | None, rows: list[list[Any]],
                  folder: Path) -> list[bool]:
    """Compile C that stands by itself, run a group or all, and return its last verdicts."""
    compiler = gcc()
    if compiler is None:
        pytest.skip('needs gcc')
    folder.mkdir()  # one each: a library of the same name would be taken for the same
    (folder / 'mutant.c').write_text(source, encoding='utf-8')
    compile_c([*compiler, '-std=c99', '-w', '-O1', '-ffp-contract=off', '-fPIC', '-shared',
               folder / 'mutant.c', '-lm', '-o', folder / 'mutant.so'])
    library: Any = ctypes.CDLL(str(folder / 'mutant.so'))
    fields = [(f'f{number}', C_TYPES[signal.type])
              for number, signal in enumerate(subject.program.signals)]
    inputs = type('Inputs', (ctypes.Structure,), {'_fields_': fields})
    state = ctypes.create_string_buffer(
        b'\xff' * subject.code.size(Struct(f'{subject.prefix}_state')))
    name = subject.prefix if group is None else f'{subject.prefix}_group_{group}'
    library[f'{name}_reset'](state)
    verdicts = (ctypes.c_bool * len(subject.program.properties))()
    for row in rows:
        library[f'{name}_step'](state, ctypes.byref(inputs(*row)), verdicts)
    return list(verdicts)


def rows_of(subject: ProofSubject, example: Counterexample) -> list[list[Any]]:
    kinds = [signal.type for signal in subject.program.signals]
    return [[plain(value, kind) for value, kind in zip(row, kinds)] for row in example.rows]


def expected(monitor: GeneratedMonitor, rows: list[list[Any]]) -> list[bool]:
    """Return the verdicts of the last step by the reference evaluator."""
    names = [signal.name for signal in monitor.program.signals]
    trace = {name: [row[place] for row in rows] for place, name in enumerate(names)}
    columns = evaluate_all([item.formula for item in monitor.program.properties], trace)
    return [bool(column[-1]) for column in columns]


@pytest.mark.parametrize('name', [pytest.param(name, marks=thorough if name == 'counters' else ())
                                  for name in sorted(BUNDLES)])
def test_every_mutant_is_refuted_or_shown_equivalent(name: str, tmp_path: Path) -> None:
    subject, monitor = subject_of(BUNDLES[name], name)
    header, text = monitor.module.header
    sources = {item: each for item, each in monitor.module.sources if 'fields' not in item}
    texts = list(preprocess(sources, {**runtime_headers(), header: text}).values())
    chosen = sample(subject.code, generated_functions(subject.code, subject.prefix), EACH)
    assert len(chosen) == EACH
    judgements = [(mutant, *judged(subject, mutant)) for mutant in chosen]
    assert [mutant.what for mutant, judgement, _ in judgements if judgement == 'undecided'] == []
    equivalent = [mutant for mutant, judgement, _ in judgements if judgement == 'equivalent']
    for number, mutant in enumerate(equivalent[:COMPILED]):
        rows = random_rows(monitor)
        folder = tmp_path / f'equivalent_{number}'
        assert last_verdicts(printed(texts[0], mutant), subject, None, rows, folder) \
            == expected(monitor, rows), mutant.what
    refuted = [(mutant, settled.group, settled.counterexample)
               for mutant, judgement, settled in judgements
               if judgement == 'refuted' and settled.group >= 0]
    assert len(refuted) > EACH // 3
    for number, (mutant, group, example) in enumerate(refuted[::len(refuted) // COMPILED]):
        assert example is not None
        rows = rows_of(subject, example)
        wanted = expected(monitor, rows)
        found = last_verdicts(printed(texts[0], mutant), subject, group, rows,
                              tmp_path / str(number))
        assert {place: wanted[place] for place in example.meant} == example.meant
        assert {place: found[place] for place in example.meant} != example.meant, mutant.what


def test_every_mutant_of_the_cells_is_refuted_or_shown_equivalent() -> None:
    subject, _ = subject_of(BUNDLES['bits'], 'bits')
    chosen = sample(subject.code, cell_functions(subject.code), EACH)
    judgements = {mutant.what: judged_cell(subject.code, mutant) for mutant in chosen}
    assert [what for what, judgement in judgements.items() if judgement == 'undecided'] == []
    assert list(judgements.values()).count('refuted') > EACH // 2


def test_every_mutant_of_the_cells_at_ticks_is_refuted_or_shown_equivalent() -> None:
    subject, _ = subject_of(BUNDLES['bits'], 'bits')
    chosen = sample(subject.code, TICK_FUNCTIONS, EACH)
    judgements = [(mutant.what, judged_cell(subject.code, mutant)) for mutant in chosen]
    assert [what for what, judgement in judgements if judgement == 'undecided'] == []
    # `<` and `<=` for the earlier of two ticks, and 1 or 2 for true.
    assert sum(judgement == 'equivalent' for _, judgement in judgements) <= 2
    assert len(judgements) == EACH
