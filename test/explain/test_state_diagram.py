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

"""A requirement that a state follows a diagram is drawn as one, in the state of the last step."""

from pathlib import Path
from xml.etree import ElementTree

from fret_monitor.build import read
from fret_monitor.explain.diagram import DrawnEdge, StateDiagram
from fret_monitor.explain.report import explain
from fret_monitor.explain.svg import to_svg
from fret_monitor.importing import import_bundles, write_bundles
import pytest

DOOR = """stateDiagram-v2
[*] --> CLOSED
CLOSED --> OPENING : button
OPENING --> OPEN : gap > 0.9
OPEN --> CLOSED : !button & gap < 5
OPENING --> CLOSED
OPEN --> OPEN : button
"""
NUMBERS = 'graph LR\n 3-->|a|1\n 1-->|b|3\n'
SVG = '{http://www.w3.org/2000/svg}'


def explained(folder: Path, text: str) -> tuple[StateDiagram, list[int | None], str]:
    """Import a diagram; return that of its requirement, its states at the ends, and the SVG."""
    (folder / 'd.mmd').write_text(text, encoding='utf-8')
    write_bundles(import_bundles([folder / 'd.mmd'], folder / 'd.yaml'))
    (found,), _ = explain(read(folder / 'd.yaml'))
    drawn = [line.diagram for line in found.timelines if line.diagram]
    assert len(drawn) == len(found.timelines) >= 2
    return drawn[0].diagram, [item.state for item in drawn], to_svg('d', found.timelines)


def test_states_and_edges_are_those_of_the_diagram(tmp_path: Path) -> None:
    found, states, _ = explained(tmp_path, DOOR)
    assert found.variable == 'state'
    assert found.states == (('CLOSED', 0), ('OPENING', 1), ('OPEN', 2))
    assert set(found.edges) == {
        DrawnEdge(0, 1, 'button'), DrawnEdge(1, 2, 'gap > 0.9'), DrawnEdge(1, 0, ''),
        DrawnEdge(2, 2, 'button'),
        DrawnEdge(2, 0, '!button & gap < 5.0')}
    assert all(state is None or state in range(3) for state in states)
    assert [found.at(value).state for value in (2, 7)] == [2, None]


def test_the_state_of_the_last_step_is_filled(tmp_path: Path) -> None:
    found, states, svg = explained(tmp_path, NUMBERS)
    root = ElementTree.fromstring(svg)
    boxes = [item for item in root.iter(f'{SVG}rect') if item.get('rx')]
    filled = [item.get('fill') == '#3465a4' for item in boxes]
    assert filled == [number == state for state in states for number in range(len(found.states))]
    texts = [item.text for item in root.iter(f'{SVG}text') if item.get('text-anchor')]
    assert set(texts) == {'1', '3', 'a', 'b'}
    assert len([*root.iter(f'{SVG}polygon')]) == len(found.edges) * len(states)
    width, height = float(root.get('width', 0)), float(root.get('height', 0))
    for box in boxes:
        assert 0 < float(box.get('x', 0)) < width - 96 and 0 < float(box.get('y', 0)) < height - 26


@pytest.mark.parametrize('formula', [
    'H (p -> x < 2)', 'Y (x = 1) -> x = 2 | p', 'Y (x = 1) -> ite(p, x = 2, x > 3)',
    '(Y (x = 1) -> x = 2) & (Y (y = 2) -> y = 1)', '(Y (x = 1) -> y = 2)'])
def test_another_formula_is_no_diagram(formula: str, tmp_path: Path) -> None:
    (tmp_path / 'a.yaml').write_text(
        'format: 1\ninputs: {p: {type: bool}, x: {type: int8}, y: {type: int8}}\n'
        f'requirements: [{{id: R, ptltl: "{formula}"}}]\n', encoding='utf-8')
    (found,), _ = explain(read(tmp_path / 'a.yaml'))
    assert found.timelines and all(line.diagram is None for line in found.timelines)
