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

"""Answers to a page are those of the verbs."""

import csv
import json
from pathlib import Path
from typing import Any

from fret_monitor.build import read
from fret_monitor.cli.main import main
from fret_monitor.explain.report import as_dict, explain
from fret_monitor.studio import drawn_trace
from fret_monitor.studio.drawn_trace import CompiledPart, TracePart
from fret_monitor.studio.questions import Questions, Utf16
import pytest

BUNDLE = """\
format: 1
evaluation: {policy: every_message}
inputs:
  speed: {topic: speed, type: std_msgs/msg/Float64}
  hot: {topic: hot, type: std_msgs/msg/Bool}
  mode: {topic: mode, type: std_msgs/msg/Int8, values: {IDLE: 0, DRIVE: 3}}
requirements:
  - {id: SLOW, ptltl: "H[0,3] hot -> speed <= 1.5"}
  - {id: 'A,B', ptltl: "mode = DRIVE -> !hot"}
  - {id: C, fretish: whenever hot the robot shall within 3 ticks satisfy speed <= 0.5}
"""
TIMED = BUNDLE.replace('every_message', 'timed').replace('3 ticks', '2 seconds').replace(
    'H[0,3]', 'H[0,0.25 s]')
RATED = TIMED.replace('Float64}', 'Float64, max_rate: 100}').replace(
    'Bool}', 'Bool, max_rate: 100}').replace('Int8,', 'Int8, max_rate: 100,')

MIXED = """\
format: 1
evaluation: {policy: timed}
inputs:
  x: {topic: x, type: std_msgs/msg/Float64, max_rate: 50}
  hot: {topic: hot, type: std_msgs/msg/Bool, max_rate: 50}
  scan: {topic: scan, type: std_msgs/msg/Float64, field: rate(1 s), max_rate: 50}
  front: {topic: front, type: std_msgs/msg/Float64}
actions: {stop: {lock: {topic: e_stop}}}
gates:
  drive: {from: a, to: b, type: std_msgs/msg/Float64, keep: [NEAR], otherwise: drop}
requirements:
  - {id: MEAN, ptltl: "meanOver(0.5 s, x) <= 0.75"}
  - {id: ONCE, ptltl: "O[0.15 s, 0.35 s] hot -> x < 1.5"}
  - {id: NEAR, ptltl: "front > 0.5", on_violation: [stop]}
  - {id: HELD, ptltl: "heldAt(hot, x) < 0.5"}
  - {id: BUSY, ptltl: "timeOver(1 s, x > 0.5) <= 0.75"}
  - {id: SOON, fretish: upon hot the robot shall within 0.25 seconds satisfy x > 1.75}
  - {id: SCANS, ptltl: "scan >= 5"}
"""


def ask(folder: Path, do: str, text: str = BUNDLE, **more: Any) -> Any:
    found = Questions(folder).answer({'do': do, 'name': 'b.yaml', 'text': text, **more})
    assert 'error' not in found, found
    return found['answer']


def refusal(folder: Path, do: str, text: str = BUNDLE, **more: Any) -> str:
    found = Questions(folder).answer({'do': do, 'name': 'b.yaml', 'text': text, **more})
    return str(found['error'])


def test_problems_have_places_in_units_of_javascript_and_fixes(tmp_path: Path) -> None:
    text = BUNDLE.replace('format: 1', 'format: 1  # 😀').replace('mode = DRIVE', 'mode = DRIV')
    found = ask(tmp_path, 'check', text)
    assert found['bundle'] is None
    first = found['diagnostics'][0]
    assert first['severity'] == 'error' and first['line'] == 9
    wide = text.encode('utf-16-le')
    assert wide[2 * first['from']:2 * first['to']].decode('utf-16-le') == 'DRIV'
    way = ask(tmp_path, 'fixes', text)[0][0]
    mended = wide[:2 * way['from']] + way['text'].encode('utf-16-le') + wide[2 * way['to']:]
    assert ask(tmp_path, 'check', mended.decode('utf-16-le'))['bundle'] is not None


@pytest.mark.parametrize(
    'text', [BUNDLE.replace('DRIVE ->', 'DRIV ->').replace('C,', 'SLOW,'), MIXED],
    ids=['errors', 'warnings'])
def test_an_editor_has_the_same_diagnostics(tmp_path: Path, text: str) -> None:
    pytest.importorskip('pygls')
    from lsp.client import editor
    uri = (tmp_path / 'b.yaml').as_uri()
    with editor() as client:
        client.open(uri, text)
        listed = client.diagnostics(uri, 1)
    found = ask(tmp_path, 'check', text)['diagnostics']
    assert len(found) >= 2
    assert [(item['line'] - 1, item['severity'], item['code'], '\n'.join(filter(None, (
        item['title'], item['label'], item['help'])))) for item in found] == [
            (item['range']['start']['line'], {1: 'error', 2: 'warning'}[item['severity']],
             item['code'], item['message']) for item in listed]


def test_a_bundle_without_errors_has_its_inputs_and_requirements(tmp_path: Path) -> None:
    found = ask(tmp_path, 'check')['bundle']
    assert [(item['name'], item['type'], item['names']) for item in found['inputs']] == [
        ('speed', 'float64', []), ('hot', 'bool', []), ('mode', 'int8', ['IDLE', 'DRIVE'])]
    assert [item['levels'] for item in found['inputs']] == [[0.5, 1.5], [], []]
    assert [item['id'] for item in found['requirements']] == ['SLOW', 'A,B', 'C']
    assert BUNDLE[found['requirements'][2]['from']:].startswith('C,')


def test_hover_and_completion_are_those_of_editors(tmp_path: Path) -> None:
    place = BUNDLE.index('speed <= 1.5')
    assert 'std_msgs/msg/Float64' in ask(tmp_path, 'hover', offset=place + 1)['markdown']
    labels = {item['label'] for item in ask(tmp_path, 'complete', offset=place + 2)}
    assert 'speed' in labels
    assert ask(tmp_path, 'hover', offset=BUNDLE.index('\nevaluation')) is None


def test_an_explanation_is_that_of_explain(tmp_path: Path) -> None:
    path = tmp_path / 'b.yaml'
    path.write_text(BUNDLE)
    expected, _ = explain(read(path), ['C'])
    found = ask(tmp_path, 'explain', id='C')
    assert json.loads(json.dumps(found)) == json.loads(json.dumps(as_dict(expected[0])))


def test_a_new_requirement_is_tried_before_it_is_written(tmp_path: Path) -> None:
    text = BUNDLE.replace('mode = DRIVE', 'mode = DRIV')  # a mistake elsewhere
    fields = {'component': 'robot', 'timing': 'always', 'response': 'spee < 1'}
    found = ask(tmp_path, 'draft', text, id='D', fields=fields)
    assert len(found['problems']) == 1 and "'spee'" in found['problems'][0]
    fields['response'] = 'speed < 1'
    found = ask(tmp_path, 'draft', text, id='D', fields=fields)
    assert found['problems'] == []
    assert found['whole'] == text[:found['from']] + found['text'] + text[found['to']:]
    found = ask(tmp_path, 'draft', id='D', fields=fields)
    assert ask(tmp_path, 'explain', found['whole'], id='D')['text'] == \
        'the robot shall always satisfy speed < 1'
    assert 'already' in refusal(tmp_path, 'draft', id='C', fields=fields)
    assert [item['text'] for item in ask(tmp_path, 'form', id=None)] == [''] * 6


TRACE = {'speed': [[0, 0.25], [4, 2.0], [9, 'nan'], [10, 1.0]],
         'hot': [[0, False], [2, True], [8, False]], 'mode': [[0, 'IDLE'], [5, 'DRIVE']]}


@pytest.mark.parametrize('text', [BUNDLE, TIMED], ids=['steps', 'timed'])
def test_verdicts_are_those_of_simulate(tmp_path: Path, text: str) -> None:
    found = ask(tmp_path, 'simulate', text, steps=40, period=0.1, values=TRACE, csv=True)
    path = tmp_path / 'b.yaml'
    path.write_text(text)
    trace, verdicts = tmp_path / 'trace.csv', tmp_path / 'verdicts.csv'
    trace.write_text(found['csv'])
    assert [row['speed'] for row in csv.DictReader(found['csv'].splitlines())] == [
        *['0.25'] * 4, *['2.0'] * 5, 'nan', *['1.0'] * 30]
    assert main(['simulate', str(path), '--trace', str(trace), '--verdicts', str(verdicts)]) == 0
    rows = [line.split(',') for line in verdicts.read_text().splitlines()[1:]]
    assert len(rows) >= 40 and {'0', '1'} <= {cell for row in rows for cell in row[1:]}
    for number, name in enumerate(('SLOW', 'A,B', 'C')):
        changes = {float(at): value for at, value in found['verdicts'][name]}
        now = None
        for label, *cells in rows:
            now = changes.get(float(label), now)
            assert now == int(cells[number]), (name, label)


def test_a_zero_of_the_other_sign_is_another_value(tmp_path: Path) -> None:
    text = """\
format: 1
inputs:
  x: {topic: x, type: std_msgs/msg/Float64}
  y: {topic: y, type: std_msgs/msg/Float64}
requirements:
  - {id: B, ptltl: "y / x > 0.5"}
"""
    questions = Questions(tmp_path)

    def verdict(x: float) -> Any:
        return questions.answer({
            'do': 'simulate', 'name': 'b.yaml', 'text': text, 'steps': 1,
            'values': {'x': [[0, x]], 'y': [[0, 1.0]]}})['answer']['verdicts']['B']

    assert [verdict(x) for x in (-0.0, 0.0, -0.0)] == [[(0, 0)], [(0, 1)], [(0, 0)]]


COUNTED = MIXED.replace('timed', 'every_message').replace('0.15 s, 0.35 s', '1, 3').replace(
    '0.25 seconds', '2 ticks').replace('0.5 s', '5').replace(
    'timeOver(1 s, x > 0.5) <= 0.75', 'countOver(9, x > 0.5) <= 6')


@pytest.mark.parametrize('text', [MIXED, COUNTED], ids=['timed', 'steps'])
def test_parts_of_a_bundle_have_the_verdicts_of_the_whole(
    tmp_path: Path, text: str, monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(drawn_trace, '_IN_PART', 3)
    path, trace, verdicts = (tmp_path / name for name in ('b.yaml', 'trace.csv', 'verdicts.csv'))
    path.write_text(text)
    questions, seen = Questions(tmp_path), set()
    for values in (  # one after the other, by the same compiled parts
            {'x': [[0, 0.25], [4, 2.0], [13, 0.5]], 'hot': [[0, False], [2, True], [8, False]],
             'front': [[0, 1.0], [20, 0.0], [25, 1.0]], 'scan': [[0, 9.0], [7, 1.0]]},
            {'x': [[0, 2.0], [1, 0.0]], 'hot': [[3, True], [4, False], [9, True]],
             'x_received': [[5, False], [30, True]]},
            {'x': [[0, 2.0], [1, 0.0]], 'hot': [[3, True], [4, False]],
             'x_received': [[5, False], [30, True]]}):
        question = {'name': 'b.yaml', 'text': text, 'steps': 40, 'period': 0.1, 'values': values}
        found = questions.answer({'do': 'simulate', 'csv': True, **question})['answer']
        trace.write_text(found['csv'])
        assert main(['simulate', str(path), '--trace', str(trace),
                     '--verdicts', str(verdicts)]) == 0
        heading, *rows = [line.split(',') for line in verdicts.read_text().splitlines()]
        for number, name in enumerate(heading[1:], start=1):
            changes = {float(row[0]): int(row[number]) for place, row in enumerate(rows)
                       if not place or rows[place - 1][number] != row[number]}
            assert dict(found['verdicts'][name]) == changes, name
            seen |= {(name, value) for value in changes.values()}
    assert len(seen) == 14  # each requirement was satisfied, and violated


OVER_TIME = """\
format: 1
evaluation: {policy: every_message}
inputs:
  x: {topic: x, type: std_msgs/msg/Float64}
  n: {topic: n, type: std_msgs/msg/UInt8}
definitions: {most: "maxOver(2, n)"}
requirements:
  - {id: A, ptltl: "H (meanOver(3, x) <= 0.75 & most < 9)"}
  - {id: B, ptltl: "changeOver(2, x) < 1 -> derivative(x) < 2"}
  - {id: C, ptltl: "sumOver(1, sqrt(x)) < 9 & heldAt(n > 3, n) > 1 & countOver(3, x > 0) < 9"}
"""


@pytest.mark.parametrize('text', [OVER_TIME, OVER_TIME.replace('every_message', 'timed').replace(
    'Float64', 'Float64, max_rate: 9').replace('UInt8', 'UInt8, max_rate: 9').replace(
    'Over(1', 'Over(1 s').replace('Over(2', 'Over(2 s').replace('Over(3', 'Over(3 s')],
    ids=['steps', 'timed'])
def test_numbers_over_time_have_rows_with_the_values_of_the_reference(
    tmp_path: Path, text: str,
) -> None:
    windows = ask(tmp_path, 'check', text)['bundle']['windows']
    names = [name.replace(' s,', ',') for name in windows]
    assert names == ['meanOver(3, x)', 'most', 'changeOver(2, x)', 'derivative(x)',
                     'sumOver(1, sqrt(x))', 'heldAt(n > 3, n)', 'countOver(3, x > 0.0)']
    x, n = [0.25, 4.0, 0.0, -1.0, 9.0, 1.0, 1.0, 1.0], [0, 5, 5, 200, 1, 1, 1, 4]
    steps = range(len(x))
    found = ask(tmp_path, 'simulate', text, steps=len(x), period=1.0, values={
        'x': list(zip(steps, x, strict=True)), 'n': list(zip(steps, n, strict=True))})['windows']
    rows = {}
    for name, changes in found.items():
        rows[name.replace(' s,', ',')] = [
            next(value for at, value in reversed(changes) if at <= step) for step in steps]
    roots = [value ** 0.5 if value >= 0 else float('nan') for value in x]
    held = [next((n[k] for k in reversed(range(t + 1)) if n[k] > 3), n[0]) for t in steps]
    past = {name: [range(max(0, t - d), t + 1) for t in steps]
            for name, d in (('1', 1), ('2', 2), ('3', 3))}
    sums = [sum(roots[k] for k in window) for window in past['1']]
    assert rows == {
        'meanOver(3, x)': [sum(x[k] for k in window) / len(window) for window in past['3']],
        'most': [max(n[k] for k in window) for window in past['2']],
        'changeOver(2, x)': [x[t] - x[max(0, t - 2)] for t in steps],
        'derivative(x)': [x[t] - x[max(0, t - 1)] for t in steps],
        'sumOver(1, sqrt(x))': ['nan' if value != value else value for value in sums],
        'heldAt(n > 3, n)': held,
        'countOver(3, x > 0.0)': [sum(x[k] > 0 for k in window) for window in past['3']]}


def test_a_change_of_a_requirement_compiles_its_part_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(drawn_trace, '_IN_PART', 3)
    compiled: list[tuple[str, ...]] = []

    class Noted(CompiledPart):

        def __init__(self, part: TracePart) -> None:
            if not part.has_windows:
                compiled.append(tuple(item.id for item in part.specification.properties))
            super().__init__(part)

    monkeypatch.setattr('fret_monitor.studio.questions.CompiledPart', Noted)
    questions = Questions(tmp_path)

    def simulate(text: str) -> dict[str, Any]:
        question = {'name': 'b.yaml', 'text': text, 'steps': 9, 'values': {}}
        while questions.answer({'do': 'prepare', **question})['answer']:
            pass
        return dict(questions.answer({'do': 'simulate', **question})['answer']['verdicts'])

    simulate(COUNTED)
    assert sorted(sum(compiled, ())) == sorted(
        ['MEAN', 'ONCE', 'NEAR', 'HELD', 'BUSY', 'SOON', 'SCANS'])
    compiled.clear()
    assert simulate(f'# x\n{COUNTED}'.replace('front > 0.5', 'front < 0.5'))['NEAR'] == [(0, 1)]
    assert simulate(COUNTED)['NEAR'] == [(0, 0)]
    assert len(compiled) == 1 and 'NEAR' in compiled[0] and len(compiled[0]) < 7


@pytest.mark.parametrize('text', [BUNDLE, TIMED], ids=['steps', 'timed'])
def test_examples_violate_satisfy_and_tell_apart(tmp_path: Path, text: str) -> None:
    def last(ids: list[str], kind: str) -> list[int]:
        found = ask(tmp_path, 'example', text, ids=ids, kind=kind)
        judged = ask(tmp_path, 'simulate', text, steps=found['steps'], values=found['values'],
                     period=found['period'])['verdicts']
        return [judged[name][-1][1] for name in ids]

    assert last(['C'], 'violating') == [0]
    assert last(['C'], 'satisfying') == [1]
    assert sorted(last(['SLOW', 'A,B'], 'violating')) == [0, 1]


@pytest.mark.parametrize('text', [BUNDLE, RATED], ids=['steps', 'timed'])
def test_margins_are_those_of_simulate(tmp_path: Path, text: str) -> None:
    found = ask(tmp_path, 'simulate', text, steps=40, period=0.1, values=TRACE, csv=True,
                margins=True)
    path, trace, margins = (tmp_path / name for name in ('b.yaml', 'trace.csv', 'margins.csv'))
    path.write_text(text)
    trace.write_text(found['csv'])
    assert main(['simulate', str(path), '--trace', str(trace), '--verdicts',
                 str(tmp_path / 'verdicts.csv'), '--margins', str(margins)]) == 0
    now: dict[str, list[Any]] = {}
    with margins.open(newline='') as file:
        for row in csv.DictReader(file):
            name, at = row['requirement'], float(row.get('time') or row['step'])
            changes = {when: value for when, *value in found['margins'][name]}
            now[name] = changes.get(at) or now[name]
            shown = now[name][0] if isinstance(now[name][0], str) else repr(now[name][0])
            assert (shown, now[name][1]) == (row['margin'] or 'nan', row['comparison'])
    assert set(now) == {'SLOW', 'A,B', 'C'}
    assert any(isinstance(value, float) for _, value, _ in found['margins']['SLOW'])


KEYED = """\
format: 1
evaluation: {policy: every_message}
for_each:
  robot: [alpha, beta]
  track: {most: 9}
inputs:
  speed: {topic: "/{robot}/speed", type: std_msgs/msg/Float64}
  near: {topic: "/{track}/near", type: std_msgs/msg/Bool}
  on: {topic: on, type: std_msgs/msg/Bool}
actions: {stop: {lock: {topic: e_stop}}}
requirements:
  - id: SLOW
    fretish: when on the robot shall within 2 ticks satisfy speed <= 1
    on_violation: stop
  - {id: FAR, ptltl: "! near"}
  - {id: FLEET, ptltl: "count(robot: speed > 1) <= 1"}
"""


def test_instances_have_inputs_and_verdicts_of_their_own(tmp_path: Path) -> None:
    found = ask(tmp_path, 'check', KEYED)['bundle']
    assert [item['name'] for item in found['inputs']] == [
        'speed[robot=alpha]', 'speed[robot=beta]', 'near[track=a]', 'near[track=b]', 'on']
    assert found['judged'] == ['SLOW[robot=alpha]', 'SLOW[robot=beta]', 'FAR[track=a]',
                               'FAR[track=b]', 'FLEET']
    assert [item['id'] for item in found['requirements']] == ['SLOW', 'FAR', 'FLEET']
    trace = {'steps': 20, 'values': {
        'speed[robot=alpha]': [[0, 0.0], [4, 2.0]], 'speed[robot=beta]': [[0, 0.0], [9, 2.0]],
        'near[track=b]': [[0, False], [6, True]], 'on': [[0, False], [5, True]]}}
    judged = ask(tmp_path, 'simulate', KEYED, **trace)['verdicts']
    assert {name: next((at for at, value in changes if not value), None)
            for name, changes in judged.items()} == {
        'SLOW[robot=alpha]': 7, 'SLOW[robot=beta]': None, 'FAR[track=a]': None,
        'FAR[track=b]': 6, 'FLEET': 9}
    why = ask(tmp_path, 'why', KEYED, id='SLOW[robot=alpha]', step=8, **trace)
    assert (why['begin'], why['end'], why['trigger']) == (7, None, None)
    assert {label for label, kind, _ in why['data']['occurrences'][0]['l']
            if kind == 'proposition'} == {'on', '"speed[robot=alpha]" <= 1.0'}
    example = ask(tmp_path, 'example', KEYED, ids=['FLEET'], kind='violating')
    again = ask(tmp_path, 'simulate', KEYED, **example)['verdicts']
    assert again['FLEET'][-1][1] == 0


def test_the_picture_and_the_form_have_offsets_of_javascript(tmp_path: Path) -> None:
    text = BUNDLE.replace('format: 1', 'format: 1  # 😀')
    wide = text.encode('utf-16-le')
    found = ask(tmp_path, 'picture', text)
    node = next(item for item in found['nodes'] if item['name'] == 'SLOW')
    assert wide[2 * node['from']:].decode('utf-16-le').startswith('SLOW')
    fields = {item['name']: item['text'] for item in ask(tmp_path, 'form', text, id='C')}
    assert fields['timing'] == 'within 3 ticks'
    edit = ask(tmp_path, 'reword', text, id='C', fields={**fields, 'timing': 'immediately'})
    new = (wide[:2 * edit['from']] + edit['text'].encode('utf-16-le')
           + wide[2 * edit['to']:]).decode('utf-16-le')
    assert 'the robot shall immediately satisfy speed <= 0.5"' in new
    assert ask(tmp_path, 'check', new)['bundle'] is not None


def test_what_cannot_be_answered_says_why(tmp_path: Path) -> None:
    assert refusal(tmp_path, 'simulate', BUNDLE + '  - nonsense', steps=3, values={}) == \
        'the bundle has errors'
    assert '1 to 100,000 steps' in refusal(tmp_path, 'simulate', steps=100_001, values={})
    assert "'fast' is no value" in refusal(tmp_path, 'simulate', steps=3,
                                           values={'speed': [[0, 'fast']]})
    assert 'no trace' in refusal(tmp_path, 'example', ids=['C', 'C'], kind='violating')
    assert "no requirement 'X'" in refusal(tmp_path, 'example', ids=['X'], kind='violating')
    assert 'at most 100 years' in refusal(
        tmp_path, 'simulate', TIMED, steps=100_000, period=100_000, values={})
    assert 'cannot be answered' in refusal(tmp_path, 'hover')


def test_files_of_a_bundle_outside_of_its_folder_are_not_read(tmp_path: Path) -> None:
    inside = tmp_path / 'inside'
    inside.mkdir()
    (tmp_path / 'secret.yaml').write_text('inputs: {key: 1}\n')
    for name in ('../secret.yaml', str(tmp_path / 'secret.yaml'), 'link.yaml'):
        (inside / 'link.yaml').unlink(missing_ok=True)
        (inside / 'link.yaml').symlink_to(tmp_path / 'secret.yaml')
        found = ask(inside, 'check', f'signals: {name}\n{BUNDLE}')
        assert 'outside of the folder' in str(found['diagnostics'])
        assert 'key' not in str(found['diagnostics'])


def test_offsets_beyond_the_first_plane_are_converted_both_ways() -> None:
    text = 'a😀b\n😀'
    places = Utf16(text)
    for offset in range(len(text) + 1):
        units = len(text[:offset].encode('utf-16-le')) // 2
        assert places.units(offset) == units and places.offset(units) == offset
