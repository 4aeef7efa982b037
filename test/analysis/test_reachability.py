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

"""States of diagrams that no run reaches, against a search over all states."""

from itertools import combinations
from pathlib import Path
from random import Random
import re

from analysis.search import reference
from fret_monitor.analysis.answers import Answer, Question
from fret_monitor.analysis.checks import analyze
from fret_monitor.build import read
from fret_monitor.importing import import_bundles, write_bundles
from fret_monitor.importing.files import ImportOptions
from fret_monitor.importing.state_machine import DiagramOptions, Mode
from fret_monitor.traces.deadline import Deadline
import pytest

LIMITED = '  - {id: LOW, ptltl: "H (x >= 0 & x < 4)", assume: true}\n'
CONDITIONS = {
    'x > 1': {2, 3}, 'x > 1 & x < 1': set(), 'x = 0': {0}, 'x > 5': set(), 'x < 3': {0, 1, 2},
    'x = 2 | x = 3': {2, 3}, 'x >= 0': {0, 1, 2, 3}, 'Y (x = 1) & FTP': set(), '': {0, 1, 2, 3},
}


def asked(folder: Path, text: str, mode: Mode, more: str = '') -> list[Answer]:
    """Import a diagram over an integer x from 0 to 3, and ask which states are reached."""
    (folder / 'd.mmd').write_text(text, encoding='utf-8')
    write_bundles(import_bundles([folder / 'd.mmd'], folder / 'd.yaml', options=ImportOptions(
        diagram=DiagramOptions(mode))), force=True)
    made = (folder / 'd.yaml').read_text(encoding='utf-8').replace('type: float64', 'type: int32')
    (folder / 'd.yaml').write_text(
        made.replace('requirements:\n', f'requirements:\n{LIMITED}{more}'), encoding='utf-8')
    found = read(folder / 'd.yaml').specification
    answers = analyze(found, reference(found), [Question.REACHABILITY],
                      deadline=Deadline(60.0)).answers
    assert all(item.holds is not None for item in answers)
    return list(answers)


def reached(edges: list[tuple[str, str, str]], first: str) -> set[str]:
    """Return the states that some values of x lead to; the first edge that holds is taken."""
    found, new = {first}, [first]
    while new:
        state = new.pop()
        left = {0, 1, 2, 3}
        for origin, condition, target in edges:
            if origin == state:
                taken = left & CONDITIONS[condition]
                left -= taken
                if taken and target not in found:
                    found.add(target)
                    new.append(target)
    return found


def random_edges(seed: int) -> list[tuple[str, str, str]]:
    """Return the edges of a diagram that begins in A."""
    rng = Random(seed)
    return [('A', 'x > 1', 'B'), *(
        (rng.choice('ABCDE'), rng.choice(list(CONDITIONS)), rng.choice('ABCDE'))
        for _ in range(7))]


@pytest.mark.parametrize('seed', range(4))
def test_unreached_states_are_those_that_no_values_lead_to(seed: int, tmp_path: Path) -> None:
    edges = random_edges(seed)
    text = 'stateDiagram-v2\n  [*] --> A\n' + ''.join(
        f'  {one} --> {other}' + f' : {condition}'.rstrip(' :') + '\n'
        for one, condition, other in edges)
    states = {name for one, _, other in edges for name in (one, other)}
    missing = states - reached(edges, 'A')
    [answer] = asked(tmp_path, text, Mode.CHECK)
    parts = answer.method.split('; ') if answer.holds else []
    assert {part.partition(':')[0] for part in parts} == missing
    answers = asked(tmp_path, text, Mode.CALCULATE)
    assert {item.requirements[0].removeprefix('state_') for item in answers
            if item.holds} == missing
    assert len(answers) == len(states)


def test_each_edge_to_an_unreached_state_has_its_reason(tmp_path: Path) -> None:
    text = 'graph LR\n0-->|x > 1|1\n0-->|x > 2|2\n1-->|x > 8|2\n2-->3\n4-->0\n'
    [answer] = asked(tmp_path, text, Mode.CHECK)
    assert answer.holds and answer.method == (
        '2: only from 0, where an edge before it is always taken instead and from 1, where x > 8 '
        'never holds; 3: only from 2, which is not reached; 4: no edge that is ever taken leads '
        'to it (confirmed by z3)')


def test_other_requirements_and_assumptions_count(tmp_path: Path) -> None:
    text = 'graph LR\n0-->|x > 2|1\n1-->|x < 1|2\n2-->0\n'
    [answer] = asked(tmp_path, text, Mode.CHECK)
    assert answer.holds is False
    [answer] = asked(tmp_path, text, Mode.CHECK, '  - {id: N, ptltl: "H (state != 2)"}\n')
    assert answer.holds and '2: only from 1, where x < 1 never holds' in answer.method


@pytest.mark.parametrize('seed', range(2))
def test_edges_that_hold_at_once_are_told_with_values(seed: int, tmp_path: Path) -> None:
    edges = [('A', 'x < 3', 'B'), *random_edges(seed)]  # two to one state are no overlap
    text = 'stateDiagram-v2\n  [*] --> A\n' + ''.join(
        f'  {one} --> {other}' + f' : {condition}'.rstrip(' :') + '\n'
        for one, condition, other in edges)
    expected = []
    for state in reached(edges, 'A'):
        out = [edge for edge in edges if edge[0] == state]
        ends = next((number for number, edge in enumerate(out) if not edge[1]), len(out))
        expected += [(state, {one[2], other[2]}, CONDITIONS[one[1]] & CONDITIONS[other[1]])
                     for one, other in combinations(out[:ends], 2) if one[2] != other[2]]
    [answer] = asked(tmp_path, text, Mode.CHECK)
    told = [re.fullmatch(r'two edges out of (\w) hold at once, to (\w) and to (\w), as with '
                         r'x = (\d): the first one is taken', note) for note in answer.notes]
    assert len(told) == sum(bool(values) for *_, values in expected)
    for note in told:
        assert note is not None
        assert any(note[1] == origin and {note[2], note[3]} == targets and int(note[4]) in values
                   for origin, targets, values in expected)
