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

"""State diagrams: what their edges mean, in the modes that Ogma has, and what is refused."""

from itertools import product
from pathlib import Path
from random import Random

from fret_monitor.build import read
from fret_monitor.cli.main import main
from fret_monitor.importing import import_bundles, Imported
from fret_monitor.importing.diagram import Diagram, read_diagram
from fret_monitor.importing.files import ImportOptions
from fret_monitor.importing.state_machine import DiagramOptions, Mode
from fret_monitor.logic.evaluate import evaluate_all
from fret_monitor.model.diagnostics import CompileError, Problems, Source
import pytest

# The example of Ogma's tutorial on diagrams: its graph, inputs and calculated states.
OGMA = """digraph g{
   rankdir="LR";
   edge[splines="curved"]
   0 -> 0 [label = "input >= 120 && input <= 180"];

   0 -> 1 [label = "input > 180"];
   1 -> 0 [label = "input <= 180"];
   1 -> 1 [label = "input > 180"];
   0 -> 2 [label = "input < 120"];
   2 -> 0 [label = "input >= 120"];
   2 -> 2 [label = "input < 120"];
}
"""
OGMA_INPUTS = [150, 185, 185, 110, 110, 110, 185]
OGMA_STATES = [0, 1, 1, 0, 2, 2, 0]

DOOR = """stateDiagram-v2
    %% a door
    direction LR
    state "moving" as OPENING
    [*] --> CLOSED
    CLOSED --> OPENING : button & !locked
    OPENING --> OPEN : position >= 1.0
    OPEN --> CLOSED : !button
    note right of OPEN
       OPEN --> OPENING
    end note
    CLOSED : shut
"""


def imported(folder: Path, text: str, mode: Mode = Mode.CHECK, **files: str) -> Imported:
    (folder / 'machine.txt').write_text(text, encoding='utf-8')
    for name, content in files.items():
        (folder / name).write_text(content, encoding='utf-8')
    paths = [folder / name for name in ('machine.txt', *files)]
    return import_bundles(paths, folder / 'machine.yaml',
                          options=ImportOptions(diagram=DiagramOptions(mode)))[0]


def verdicts(folder: Path, found: Imported, **trace: list[int]) -> dict[str, list[bool]]:
    path = folder / 'machine.yaml'
    path.write_text(found.text, encoding='utf-8')
    specification = read(path).specification
    columns = {item.name: trace[item.name] for item in specification.signals}
    values = evaluate_all([item.formula for item in specification.properties], columns,
                          [pair for item in specification.properties for pair in item.feedback])
    return {item.id: [bool(value) for value in column]
            for item, column in zip(specification.properties, values, strict=True)}


def edges(text: str) -> list[tuple[str, str, str]]:
    return [(edge.origin, edge.target, edge.condition) for edge in parsed(text).edges]


def parsed(text: str) -> Diagram:
    return read_diagram(Source('d', text), Problems())


def test_the_calculated_states_are_those_of_ogmas_tutorial(tmp_path: Path) -> None:
    found = verdicts(tmp_path, imported(tmp_path, OGMA, Mode.CALCULATE), input=OGMA_INPUTS)
    assert [next(name for name in found if found[name][step])
            for step in range(len(OGMA_INPUTS))] == [f'state_{state}' for state in OGMA_STATES]


def test_the_states_of_ogmas_tutorial_follow_its_diagram(tmp_path: Path) -> None:
    found = imported(tmp_path, OGMA)
    assert verdicts(tmp_path, found, input=OGMA_INPUTS, state=OGMA_STATES) == {
        'machine': [True] * 7}
    wrong = [0, 1, 1, 2, 2, 2, 0]  # from 1 to 2
    assert verdicts(tmp_path, found, input=OGMA_INPUTS, state=wrong) == {
        'machine': [True, True, True, False, True, True, True]}


@pytest.mark.parametrize('seed', range(6))
def test_each_mode_does_what_a_walk_along_the_edges_does(seed: int, tmp_path: Path) -> None:
    rng = Random(seed)
    count = rng.randint(2, 4)
    graph = [(rng.randrange(count), rng.randint(0, 1), rng.randrange(count))
             for _ in range(rng.randint(3, 8))]
    states = sorted({state for one, _, two in graph for state in (one, two)})
    inputs = [rng.randint(0, 2) for _ in range(40)]
    trace = [rng.choice(states) for _ in range(40)]
    text = 'graph TD;\n' + '\n'.join(f'    {a}-->|{value}|{b};' for a, value, b in graph)

    def following(state: int, value: int) -> int:
        return next((b for a, at, b in graph if (a, at) == (state, value)), state)

    calculated, state = [], states[0]
    for value in inputs:
        state = following(state, value)
        calculated.append(state)
    found = verdicts(tmp_path, imported(tmp_path, text), input=inputs, state=trace)
    assert found['machine'] == [step == 0 or trace[step] == following(
        trace[step - 1], inputs[step]) for step in range(40)]
    found = verdicts(tmp_path, imported(tmp_path, text, Mode.CALCULATE), input=inputs)
    assert found == {f'state_{one}': [one == state for state in calculated] for one in states}
    found = verdicts(tmp_path, imported(tmp_path, text, Mode.SAFEGUARD), input=inputs, state=trace)
    for one in states:
        assert found[f'to_{one}'] == [
            (at, value, one) in graph or one == at and not any(
                (a, v) == (at, value) for a, v, _ in graph)
            for at, value in zip(trace, inputs, strict=True)]


def test_names_of_states_are_values_and_the_first_state_is_the_marked_one(tmp_path: Path) -> None:
    found = imported(tmp_path, DOOR)
    assert 'values: {CLOSED: 0, OPENING: 1, OPEN: 2}' in found.text
    assert any('guessed: CLOSED = 0' in item for item in found.draft.todo)
    for state, follows in product(range(4), (True, False)):
        assert verdicts(tmp_path, found, state=[state, 1], button=[follows, True],
                        locked=[False, False], position=[0, 0])['machine'] == [
            state == 0, state in (0, 1, 3)]  # nothing is known of what follows no state


@pytest.mark.parametrize(('line', 'values'), [
    ('state door std_msgs/msg/String', 'values: {CHARGING: "CHARGING", FULL: "FULL"}'),
    ('state door std_msgs/msg/UInt8', 'values: {CHARGING: 0, FULL: 1}')])
def test_the_message_decides_about_names(line: str, values: str, tmp_path: Path) -> None:
    found = imported(tmp_path, 'graph TD\nCHARGING-->|level > 0.9|FULL', topics=line)
    assert values in found.text


def test_states_are_constants_of_the_message_or_an_error(tmp_path: Path) -> None:
    text = 'graph TD\nPOWER_SUPPLY_STATUS_CHARGING-->|level > 0.9|POWER_SUPPLY_STATUS_FULL'
    topics = 'state battery sensor_msgs/msg/BatteryState power_supply_status'
    found = imported(tmp_path, text, topics=topics)
    assert 'values' not in found.text
    with pytest.raises(CompileError, match='has no value POWER_SUPPLY_STATUS_FUL in sensor_msgs'):
        imported(tmp_path, text.removesuffix('L'), topics=topics)


def test_edges_that_hold_at_once_are_reported_with_values_for_which_they_do(
        tmp_path: Path) -> None:
    found = imported(tmp_path, 'graph TD;\n 3-->|input > 30|3;\n 3-->|input > 40|4;\n')
    warning, = found.warnings
    assert warning.title == 'two edges out of 3 hold at once, to 3 and to 4'
    assert warning.span and warning.span.line == 3
    name, value = warning.help.removeprefix('as with ').split(' = ')
    assert name == 'input' and float(value) > 40
    assert not imported(tmp_path, OGMA).warnings


def test_a_topic_without_its_field_does_not_hide_the_diagram(tmp_path: Path) -> None:
    found = imported(tmp_path, 'graph TD\n0-->|level > 1|1\n0-->|level > 2|2\n',
                     topics='level battery sensor_msgs/msg/BatteryState')
    assert [item.title for item in found.warnings] == [
        'whether two conditions hold at once is not known']
    assert 'has 16 fields' in found.warnings[0].help


def test_states_that_cannot_be_reached_are_reported(tmp_path: Path) -> None:
    found = imported(tmp_path, 'graph TD\n 0-->|1|1\n 2-->|1|0\n 2-->|2|3\n')
    assert [item.title for item in found.warnings] == [
        'no edges lead from the state 0 to 2', 'no edges lead from the state 0 to 3']


def test_a_first_state_without_edges_is_a_state(tmp_path: Path) -> None:
    found = imported(tmp_path, 'stateDiagram-v2\n[*] --> 0\n1 --> 2 : x >= 0\n2 --> 1 : x < 0\n')
    assert verdicts(tmp_path, found, state=[0, 0], x=[1, 1])['machine'] == [True, True]


ALIKE = [('A', 'B', 'x > 1'), ('B', 'A', '')]


@pytest.mark.parametrize('text', [
    'graph TD;\nA-->|x > 1|B;\nB-->A;',
    'flowchart LR; A[first] -->|"x > 1"| B(last); B ==> A',
    'graph LR\n%% x\nclassDef c fill:#f96;\nA -- x > 1 --> B:::c --> A\nstyle A fill:#f9f',
    '---\ntitle: t\n---\ngraph LR\nA -. "x #gt; 1" .-> B\nB -.-> A',
    'graph LR\nA-->|x &gt; 1|B\nB-->A',
    'stateDiagram\nA --> B: x > 1\nB --> A',
    'stateDiagram-v2\nstate A\nA --> B : x  >  1\nnote left of A : A --> C\nB-->A',
    'digraph { A -> B [label="x > 1"]; B -> A }',
    '// x\nstrict digraph "a b" { node [shape=box]; A [label="a"]; rankdir=LR\n'
    'A -> B [color=red, label="x\\n> 1"] B -> A; }',
    '# x\ndigraph d {\n/* A -> C; */ "A" -> B [label="x > 1"];\nB -> "A" [style=dashed]\n}'])
def test_the_forms_of_an_edge_mean_the_same(text: str) -> None:
    assert edges(text) == ALIKE


@pytest.mark.parametrize('text', [
    'graph TD\nA-->|"x > 2 | y; < 2"|B', 'graph TD\nA-->|  "x > 2 | y; < 2" |B',
    'graph TD\nA-- "x > 2 | y; < 2" -->B', 'digraph { A -> B [label="x > 2 | y; < 2"]; }'])
def test_a_label_in_quotes_may_have_the_sign_around_labels(text: str) -> None:
    assert edges(text) == [('A', 'B', 'x > 2 | y; < 2')]


def test_a_label_with_the_sign_around_labels_needs_quotes() -> None:
    with pytest.raises(CompileError) as raised:
        edges('graph TD\nA-->|x > 2 | y < 2|B')
    assert raised.value.diagnostics[0].help == (
        'write A -->|condition| B, with quotes around a condition with |')


@pytest.mark.parametrize(('text', 'line', 'message'), [
    ('graph TD\nA-->B\nA---C', 3, 'this is no edge'),
    ('graph TD\nA-->B & C', 2, 'this is no edge'),
    ('graph TD\nsubgraph s\nA-->B\nend', 2, 'nested'),
    ('graph TD\n', 1, 'no edge'),
    ('graph g {\nA -- B }', 1, 'direction'),
    ('graph TD\n1-->A', 1, 'some states are numbers'),
    ('graph TD\nA-->|x >|B', 2, 'the condition of the edge from A to B cannot be read'),
    ('graph TD\nA-->|x|H', 2, "'H' cannot be the name of a state"),
    ('graph TD\n1-->|x|256', 2, 'not below 256'),
    ('graph TD\nstate-->|x|B', 2, "'state' is a state"),
    ('stateDiagram-v2\nstate A {\nB --> C\n}', 2, 'nested'),
    ('stateDiagram-v2\nstate f <<fork>>\nB --> C', 2, 'nested'),
    ('stateDiagram-v2\n[*] --> A\n[*] --> B\n', 3, 'the first state is A already'),
    ('stateDiagram-v2\nA --> B x', 2, 'this is no edge'),
    ('digraph {\nA -> B [label=<x>];}', 2, 'HTML'),
    ('digraph {\nsubgraph s { A -> B }}', 2, 'nested'),
    ('digraph {\nA -> B', 2, 'missing'),
    ('digraph {\nA -> B }\ndigraph { A -> B }', 3, 'one diagram'),
    ('digraph {\nA -> B [label="a"\n', 2, 'missing'),
    ('digraph {\nedge [label="a"]; A -> B }', 2, 'a label for all edges'),
    ('digraph {\nA -- B }', 2, 'this is no edge'),
    ('digraph {\nA ->', 2, 'ends too early')])
def test_what_cannot_be_read_is_refused_with_its_place(text: str, line: int, message: str,
                                                       tmp_path: Path) -> None:
    with pytest.raises(CompileError, match=message) as raised:
        imported(tmp_path, text)
    span = raised.value.diagnostics[0].span
    assert span and span.line == line


def test_what_is_calculated_is_not_read_by_conditions(tmp_path: Path) -> None:
    with pytest.raises(CompileError, match="reads 'state', which is calculated"):
        imported(tmp_path, 'graph TD\n0-->|state = 1|1', Mode.CALCULATE)


def test_the_command_has_the_mode_and_the_names(tmp_path: Path) -> None:
    (tmp_path / 'd.dot').write_text('digraph { 0 -> 1 [label="10"]; }', encoding='utf-8')
    target = tmp_path / 'd.yaml'
    assert main(['import', str(tmp_path / 'd.dot'), '--mode', 'safeguard', '--state-var', 'mode',
                 '--input-var', 'key', '-o', str(target)]) == 0
    specification = read(target).specification
    assert [item.name for item in specification.signals] == ['mode', 'key']
    assert [item.id for item in specification.properties] == ['to_0', 'to_1']
    assert all(item.severity.value == 'warn' and item.report.value == 'onset'
               for item in specification.properties)


@pytest.mark.timeout(30)
@pytest.mark.parametrize('text', ['0 -> 1 [label="' + '\\"' * 200_000, '/* ' * 200_000])
def test_a_quote_or_a_comment_that_does_not_end_is_read_once(text: str, tmp_path: Path) -> None:
    (tmp_path / 'a.dot').write_text(f'digraph {{ {text}')
    with pytest.raises(CompileError):
        import_bundles([tmp_path / 'a.dot'], tmp_path / 'a.yaml')
