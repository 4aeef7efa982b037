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

"""Lustre for JKind, as FRET writes it to check realizability: nodes with properties."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from random import Random

from fret_monitor.build import read
from fret_monitor.importing import import_bundles, Imported, lustre_calls
from fret_monitor.logic.evaluate import evaluate_all
from fret_monitor.model.diagnostics import CompileError
import pytest

PUMP = """--Historically
node H(X:bool) returns (Y:bool);
let
    Y = X -> (X and (pre Y));
tel

node PumpSpec( level, limit:real; on:bool; flow:int; alarm:bool ) returns ( );

var full:bool; was_on:bool; R1:bool;
 R2:bool; FTP: bool;
let
FTP = true->false;
full = level > limit;
was_on = false -> pre on;
(* Req text: Pump shall always satisfy full => alarm  *)
R1 = (H((full => alarm)));
R2 = H(was_on => flow >= 0); -- H(false)
assert limit > 0.0;
 --%PROPERTY R1;
 --%PROPERTY R2;
 --%PROPERTY "no flow" H(not on => flow = 0);
 --%PROPERTY H(flow < 100);
--%REALIZABLE level, limit,
  on;
tel
"""


def imported(text: str, folder: Path) -> Imported:
    (folder / 'pump.lus').write_text(text, encoding='utf-8')
    found, = import_bundles([folder / 'pump.lus'], folder / 'pump.yaml')
    return found


def test_properties_are_requirements_and_other_equations_definitions(tmp_path: Path) -> None:
    draft = imported(PUMP, tmp_path).draft
    assert draft.component == 'Pump'
    assert {item.id: item.text for item in draft.requirements} == {
        'PumpSpec_1': 'limit > 0.0', 'R1': 'Pump shall always satisfy full => alarm',
        'R2': 'H(was_on => flow >= 0)', 'no flow': 'H(not on => flow = 0)',
        'PumpSpec_5': 'H(flow < 100)'}
    text = imported(PUMP, tmp_path).text
    assert 'cocospec: "level > limit"' in text and 'cocospec: "false -> pre on"' in text
    assert 'assume: true' in text and 'FTP' not in text
    outputs = text.partition('inputs:')[2].partition('definitions:')[0].split('role: output')
    assert len(outputs) == 3  # flow and alarm


@pytest.mark.parametrize('listed', ['--%REALIZABLE;', ''])
def test_without_a_list_all_are_outputs_and_without_the_line_none(
        listed: str, tmp_path: Path) -> None:
    before, _, after = PUMP.partition('--%REALIZABLE')
    text = imported(before + listed + after.partition(';')[2], tmp_path).text
    assert text.count('role: output') == (5 if listed else 0)


@pytest.mark.parametrize(('old', 'new', 'message'), [
    ('was_on = false', '(was_on, x) = false', 'this node cannot be read'),
    ('limit,\n', 'limit +\n', "a variable, ',' or ';' was expected"),
    ('var full:bool;', 'var full;', "',' or ':' was expected"),
    ('--%PROPERTY', '--', 'has no contract')])
def test_what_cannot_be_read_has_its_place(old: str, new: str, message: str,
                                           tmp_path: Path) -> None:
    with pytest.raises(CompileError, match=message):
        imported(PUMP.replace(old, new), tmp_path)


CALLS = """
type Sensor = struct {value : real; broken : bool};
type Pair = struct {a : Sensor; b : Sensor; spare : int};

node good(s : Sensor; high : real) returns (ok : bool);
let ok = not s.broken => s.value <= high; tel;

node both(p : Pair) returns (ok : bool);
var l, r : bool;
let
  ok = (l and r) or (l and p.spare > 0);
  l = good(p.a, 2.0);
  r = good(p.b, 1.0 + 2.0);
tel;

node run_length(sig : bool) returns (count : int);
let count = (if sig then ((0 -> (pre count)) + 1) else 0); tel;

node ever(condition : bool) returns (holds : bool);
let holds = (condition or (condition -> (pre holds))); tel;

node pulse() returns (first : bool);
let first = true -> false; tel;

node loop(x : bool) returns (y : bool);
let y = loop(x); tel;
node assuming(x : bool) returns (y : bool);
let assert x; y = x; tel;
node two(x : bool) returns (y, z : bool);
let y = x; z = x; tel;
node unset(x : bool) returns (y : bool);
var free : bool;
let y = free; tel;

node main(pair : Pair; fault : bool; n : int) returns ();
var R1, R2, R3, R4, R5, R6, R7, R8 : bool; late : bool;
let
  R1 = both(pair);
  R2 = run_length(not (fault or pair.a.broken)) >= 3 => n = 0;
  R3 = ever(run_length(fault) >= 2) => pair.spare > 0;
  late = run_length(fault) >= 2;
  R4 = H(late and not (pulse()) => abs(n) <= 3);
  R5 = loop(fault);
  R6 = assuming(fault);
  R7 = two(fault);
  R8 = unset(fault);
  --%PROPERTY R1; --%PROPERTY R2; --%PROPERTY R3; --%PROPERTY R4; --%PROPERTY R5;
  --%PROPERTY R6; --%PROPERTY R7; --%PROPERTY R8;
  --%REALIZABLE fault, n;
tel;
"""


def verdicts(rows: Sequence[dict[str, float | bool]]) -> Iterator[dict[str, bool]]:
    """Yield what the requirements of `CALLS` say, written in Python from its nodes."""
    running = faults = 0
    has_held = is_over = False
    for number, row in enumerate(rows):
        good = [bool(row[f'pair.{name}.broken']) or row[f'pair.{name}.value'] <= high
                for name, high in (('a', 2.0), ('b', 1.0 + 2.0))]
        running = 0 if row['fault'] or row['pair.a.broken'] else running + 1
        faults = faults + 1 if row['fault'] else 0
        has_held = has_held or faults >= 2
        is_over = is_over or (faults >= 2 and number > 0 and abs(row['n']) > 3)
        yield {'R1': good[0] and (good[1] or row['pair.spare'] > 0),
               'R2': running < 3 or row['n'] == 0,
               'R3': not has_held or row['pair.spare'] > 0, 'R4': not is_over}


@pytest.mark.parametrize('seed', range(4))
def test_calls_of_other_nodes_mean_what_the_nodes_say(seed: int, tmp_path: Path) -> None:
    target = tmp_path / 'pump.yaml'
    target.write_text(imported(CALLS, tmp_path).text, encoding='utf-8')
    specification = read(target).specification
    rng = Random(seed)
    rows: list[dict[str, float | bool]] = [
        {'pair.a.value': rng.choice((1.0, 2.0, 2.5)), 'pair.b.value': rng.choice((3.0, 3.5)),
         'pair.a.broken': rng.random() < 0.2, 'pair.b.broken': rng.random() < 0.2,
         'fault': rng.random() < 0.5, 'n': rng.choice((0, 0, 0, 3, -4)),
         'pair.spare': rng.choice((0, 1, 1, 1))} for _ in range(40)]
    found = evaluate_all([item.formula for item in specification.properties],
                         {name: [row[name] for row in rows] for name in rows[0]},
                         [pair for item in specification.properties for pair in item.feedback])
    assert [item.id for item in specification.properties] == ['R1', 'R2', 'R3', 'R4']
    assert [dict(zip(('R1', 'R2', 'R3', 'R4'), step, strict=True))
            for step in zip(*found, strict=True)] == [*verdicts(rows)]


def test_fields_of_structures_are_inputs_and_what_cannot_be_called_is_a_comment(
        tmp_path: Path) -> None:
    draft = imported(CALLS, tmp_path).draft
    assert {(item.name, item.type, item.is_output) for item in draft.inputs} == {
        ('pair.a.value', 'float64', True), ('pair.a.broken', 'bool', True),
        ('pair.b.value', 'float64', True), ('pair.b.broken', 'bool', True),
        ('pair.spare', 'int64', True), ('fault', 'bool', False), ('n', 'int64', False)}
    assert {(item.id, reason) for item, reason in draft.left_out} == {
        ('R5', "there is no function 'loop'"), ('R6', "there is no function 'assuming'"),
        ('R7', "there is no function 'two'"), ('R8', "there is no function 'unset'")}


def test_equal_calls_share_their_definitions(tmp_path: Path) -> None:
    names = [item.name for item in imported(CALLS, tmp_path).draft.definitions]
    assert sum(name.startswith('run_length_') for name in names) == 2  # of two arguments


def test_calls_that_become_too_long_are_refused(tmp_path: Path,
                                                monkeypatch: pytest.MonkeyPatch) -> None:
    nodes = ''.join(f'node n{k}(x : int) returns (y : int);\n'
                    f'let y = n{k - 1}(x + 1) + n{k - 1}(x + 2); tel;\n' for k in range(1, 40))
    text = ('node n0(x : int) returns (y : int);\nlet y = x; tel;\n' + nodes
            + 'node main(x : int) returns ();\nvar R : bool;\nlet R = n39(x) > 0;\n'
            '--%PROPERTY R;\ntel;\n')
    monkeypatch.setattr(lustre_calls, '_MAX_CHARS', 2 ** 14)
    with pytest.raises(CompileError, match='R: without calls of nodes'):
        imported(text, tmp_path)
