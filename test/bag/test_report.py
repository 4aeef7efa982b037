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

"""Reports of recordings: what they show, that nothing in them is code, that spikes are kept."""

from array import array
from base64 import b64encode
from hashlib import sha256
import math
from operator import itemgetter
from pathlib import Path
from random import Random
import shutil
import subprocess

from bag.outline import Outline
from bag.recordings import Message, START, TYPES, write
from bundles import write_bundle
from fret_monitor.bag.fleet import page_name
from fret_monitor.bag.lanes import FALSE, Lane, TRUE
from fret_monitor.bag.page import document
from fret_monitor.bag.report import _values
from fret_monitor.build import build
from fret_monitor.cli.main import main
from fret_monitor.model.manifest import ManifestInput
from fret_monitor.model.values import ValueType
from fret_monitor.runtime.engine import Engine
from fret_monitor.runtime.evaluator import Evaluator
from fret_monitor.runtime.thinning import Thinning, TimeWindow, WindowPart
import pytest
from rosbags.rosbag2 import Writer

SECOND = 10**9
HOSTILE = '</script><script>alert("1")</script>'


POINTER = """
const svg = document.querySelector('svg[data-occurrence]');
const box = svg.getBoundingClientRect();
svg.onpointermove({clientX: box.left + box.width * 0.9});
"""


def report(folder: Path, text: str, messages: list[Message], *options: str) -> Outline:
    """Return the report of a recording, made with a bundle of a text."""
    file, page = folder / 'bundle.yaml', folder / 'page.html'
    file.write_text(text, encoding='utf-8')
    path = write(folder / 'bag', messages)
    assert main(['bag', str(file), str(path), '--report', str(page), *options]) == 0
    found = page.read_text(encoding='utf-8')
    assert len(found) < 300_000
    return Outline(found)


ANSWER = """format: 1
evaluation: {policy: POLICY}
constants: {high: 1}
inputs:
  level: {topic: level, type: std_msgs/msg/Float64}
  flow: {topic: flow, type: std_msgs/msg/Float64}
requirements:
  - {id: ANSWER, fretish: "when flow > 1 the pump shall within WITHIN satisfy level > high"}
  - {id: LOW, title: Not too high, ptltl: "level < 5"}
  - {id: SOON, fretish: "when flow > 7 the pump shall within LATER satisfy level > 9"}
"""


def answer(policy: str, within: str) -> str:
    """Return the bundle, in which an answer is due within so many seconds or ticks."""
    unit = within.split()[1]
    return ANSWER.replace('POLICY', policy).replace('WITHIN', within).replace(
        'LATER', f'2000 {unit}')


def answers(count: int = 40) -> list[Message]:
    """Return messages each half second; flow rises at 3 s, nothing answers before 15 s."""
    return [message for k in range(count) for message in (
        ('/level', k * SECOND // 2, 2.0 if k >= 30 else 0.25),
        ('/flow', k * SECOND // 2 + 1, 2.5 if k >= 6 else 0.0))]


def test_a_report_shows_verdicts_occurrences_and_what_was_around_them(tmp_path: Path) -> None:
    found = report(tmp_path, answer('timed', '2 seconds'), answers())
    assert found.of('h1', 'h2', 'h3', 'span') == [
        'bag', 'Verdicts', 'violated', 'satisfied', 'satisfied', 'fulfilled', 'violated',
        'not judged', 'open at the end', 'Requirements', 'ANSWER', 'violated', 'LOW', 'satisfied',
        'SOON', 'satisfied', 'Inputs']
    assert found.of('strong') == ['1 occurrence', 'Occurrence 1']
    assert found.of('blockquote') == [
        'when flow > 1 the pump shall within 2 seconds satisfy level > high', 'level < 5',
        'when flow > 7 the pump shall within 2000 seconds satisfy level > 9']
    kinds = [(tag, key) for tag, values in found.tags for key in values if key.startswith('data-')]
    assert kinds == [*[('svg', 'data-lane')] * 3, ('svg', 'data-times'),
                     ('svg', 'data-occurrence'), *[('svg', 'data-input')] * 2]
    data = found.data
    occurrence, = data['occurrences']
    assert abs(occurrence['g'] + 2 * SECOND) <= 1
    assert occurrence['d'] == 1
    assert abs(occurrence['e'] - 10 * SECOND) <= 1
    assert [plot['h'] for plot in occurrence['p']] == [[[1, 'high = 1']], [[1, 'high = 1']]]
    assert [(label, kind) for label, kind, _ in occurrence['l']] == [
        ('when flow > 1', 'trigger'), ('flow > 1.0', 'proposition'),
        ('level > 1.0', 'proposition'), ('ANSWER', 'verdict')]
    level, flow = data['inputs']
    assert [values[1:] for values in level['v']] == [[0.25], [2]]
    assert (level['b'], flow['name'], flow['bool']) == (None, 'flow', False)
    assert ''.join(filter(str.isalpha, data['lanes'][0])) == 'tmfmt'
    flow_lane, level_lane = (''.join(filter(str.isalpha, text))
                             for _, _, text in occurrence['l'][1:3])
    assert (flow_lane.replace('m', ''), level_lane) == ('ft', 'f')


@pytest.mark.parametrize('policy', ['every_message', 'relevant_message'])
def test_a_deadline_in_steps_is_found(tmp_path: Path, policy: str) -> None:
    found = report(tmp_path, answer(policy, '3 ticks'), answers())
    occurrence = found.data['occurrences'][0]
    assert occurrence['d'] == 1
    # A tick is a message: two come each half second.
    assert occurrence['g'] == -SECOND + 1


def test_a_trigger_at_the_first_instant_has_its_mark(tmp_path: Path) -> None:
    for name, begin in (('first', 1), ('later', 2)):  # the first instant at which all is known
        folder = tmp_path / name
        folder.mkdir()
        messages = [('/level', 0, 0.5), ('/flow', 1, 2.0 if begin == 1 else 0.0),
                    ('/flow', 2, 2.0), ('/flow', SECOND, 0.0), ('/level', 4 * SECOND, 0.25)]
        found = report(folder, answer('timed', '2 seconds'), messages)
        occurrence, = found.data['occurrences']
        assert occurrence['d'] == 1
        assert occurrence['g'] == -2 * SECOND
        label, kind, lane = occurrence['l'][0]
        assert (label, kind) == ('when flow > 1', 'trigger')
        assert 't' in lane or 'm' in lane


def test_the_trigger_is_the_one_whose_time_was_over(tmp_path: Path) -> None:
    found = report(tmp_path, answer('timed', '2 seconds'), [
        ('/level', 0, 0.5), *(('/flow', k * SECOND // 2, float(2 * (k in (6, 8))))
                              for k in range(20))])
    occurrence, = found.data['occurrences']
    assert (occurrence['g'], occurrence['d']) == (-2 * SECOND, 1)
    # At first nothing is true: the second message at 0 s takes effect a nanosecond later.
    assert [lane[0] for _, _, lane in occurrence['l']] == ['f', 'f', 'f', 't']


def test_an_answer_that_ends_too_early_is_no_deadline(tmp_path: Path) -> None:
    text = answer('timed', '2 seconds').replace('shall within 2 seconds', 'shall for 2 seconds')
    found = report(tmp_path, text, [
        ('/level', 0, 2.0), ('/flow', 0, 0.0), ('/flow', SECOND, 2.0),
        ('/level', 3 * SECOND, 0.0), ('/level', 4 * SECOND, 2.0)])
    occurrence, = found.data['occurrences']
    assert (occurrence['g'], occurrence['d']) == (-2 * SECOND, 0)


def test_a_proposition_is_drawn_of_the_last_values_while_an_input_is_silent(
        tmp_path: Path) -> None:
    text = answer('timed', '2 seconds').replace(
        'type: std_msgs/msg/Float64}', 'type: std_msgs/msg/Float64, timeout: 1, stale: violate}')
    found = report(tmp_path, text, [
        ('/level', 0, 0.5), ('/flow', 0, 0.0), ('/flow', 1, 0.0), ('/level', 5 * SECOND, 0.5),
        ('/flow', 5 * SECOND, 0.0)])
    low = [item for item in found.data['occurrences'] if len(item['l']) == 2]
    assert low and not any('f' in item['l'][0][2] for item in low), low
    assert all('f' in item['l'][1][2] for item in low)


def test_an_end_that_is_open_and_a_begin_without_values_are_shown(tmp_path: Path) -> None:
    text = answer('timed', '20 seconds').replace('requirements:', """
  gone: {topic: gone, type: std_msgs/msg/Float64}
requirements:
  - {id: GONE, ptltl: "gone > 1"}""")
    found = report(tmp_path, text, [
        ('/level', 0, 0.5), ('/flow', 5 * SECOND, 0.0), ('/flow', 8 * SECOND, 2.0),
        ('/level', 10 * SECOND, 0.5)], '--missing-topics', 'ok')
    gone, *lanes = found.data['lanes']
    assert gone == 'u720'
    assert lanes[0].startswith('u')
    assert lanes[0].endswith('o14')
    assert lanes[1] == 't720'


def test_an_open_requirement_has_its_trigger_and_the_time_at_which_it_is_due(
        tmp_path: Path) -> None:
    found = report(tmp_path, answer('timed', '20 seconds'), [
        ('/level', 0, 0.5), ('/flow', 5 * SECOND, 0.0), ('/flow', 8 * SECOND, 2.0),
        ('/level', 10 * SECOND, 0.5)])
    assert 'Open at the end' in found.of('strong')
    page = (tmp_path / 'page.html').read_text(encoding='utf-8')
    assert 'violated if nothing comes until 28 s, 18 s after the end' in page
    assert 'The trigger came at 8 s' in page
    shown, = found.data['occurrences']
    assert (shown['o'], shown['d'], shown['g'], shown['e']) == (1, 1, 0, None)
    assert shown['w'] == [-5 * SECOND, 2 * SECOND] or shown['w'] == [-8 * SECOND, 2 * SECOND]
    trigger, *_, verdict = shown['l']
    assert trigger[1] == 'trigger' and 'm' in trigger[2]
    assert verdict[2].endswith(('o9', 'o2', 'o1')), verdict
    assert 'Further occurrences' not in page


def test_an_open_end_without_a_trigger_of_its_own_is_shown(tmp_path: Path) -> None:
    text = answer('timed', '2 seconds').replace(
        'requirements:', 'requirements:\n  - {id: WITHIN, ptltl: "O[0, 20 s] level > 0.2"}')
    found = report(tmp_path, text, [('/level', 0, 0.5), ('/flow', 1, 0.0),
                                    ('/level', 2 * SECOND, 0.1)])
    shown, = found.data['occurrences']
    assert (shown['o'], shown['w'][1] <= 2 * SECOND) == (1, True)
    assert 'violated if nothing comes until 22 s' in (
        tmp_path / 'page.html').read_text(encoding='utf-8')


def test_an_index_of_many_requirements_has_signs_and_short_heads(tmp_path: Path) -> None:
    file, reports = tmp_path / 'b.yaml', tmp_path / 'out'
    ids = ['A_LONG_' * 9, *(f'R-{k}' for k in range(8))]
    file.write_text(answer('timed', '2 seconds') + ''.join(
        f'  - {{id: {name}, ptltl: "level < {number}"}}\n' for number, name in enumerate(ids)),
        encoding='utf-8')
    paths = [write(tmp_path / name, answers(5)) for name in ('one', 'two')]
    assert main(['bag', str(file), *map(str, paths), '--report', str(reports)]) == 0
    found = Outline((reports / 'index.html').read_text(encoding='utf-8'))
    heads = [values.get('title') for tag, values in found.tags if tag == 'th']
    assert heads == [None, None, 'ANSWER', 'LOW', 'SOON', *ids, None]
    assert [cell for cell in found.of('span') if cell in ('1', '✓', '✗')][:12] == [
        '✓', '✓', '✓', '1', *8 * '✓']


def test_a_recording_of_one_instant_is_shown(tmp_path: Path) -> None:
    found = report(tmp_path, answer('every_message', '2 ticks'), [
        ('/level', 0, 7.0), ('/flow', 0, 0.0)])
    assert found.data['lanes'] == ['t1', 'f1', 't1']
    assert found.data['length'] == 0


def test_nothing_of_a_bundle_or_recording_is_code(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / '<img src=x onerror=alert(1)>&"\'<'
    folder.mkdir()
    found = report(folder, f"""format: 1
inputs:
  level: {{topic: level, type: std_msgs/msg/Float64}}
  flow: {{topic: flow, type: std_msgs/msg/Float64, values: {{A: 1}}}}
requirements:
  - id: '{HOSTILE}'
    title: '{HOSTILE}'
    ptltl: "level < 1 & flow != A"
""", answers())
    tags = [tag for tag, _ in found.tags]
    assert tags.count('script') == 2
    assert 'img' not in tags
    assert not [key for _, values in found.tags for key in values if key.startswith('on')]
    assert HOSTILE in ''.join(found.of('h3'))
    assert found.data['occurrences'][0]['l'][-1][0] == HOSTILE
    policy = next(values['content'] for tag, values in found.tags if 'http-equiv' in values)
    assert policy is not None and "default-src 'none'" in policy and 'unsafe' not in policy
    assert '\x00' not in document('a\x00\udc80', [])
    document('a\udc80', []).encode()


def test_thinning_keeps_every_spike(tmp_path: Path) -> None:
    file = write_bundle(tmp_path, """format: 1
inputs:
  level: {topic: level, type: std_msgs/msg/Float64, initial: 7}
  flow: {topic: flow, type: std_msgs/msg/Float64}
requirements: [{id: LOW, ptltl: "level < flow"}]
""")
    monitor = build(file).monitor
    engine = Engine(Evaluator(monitor))
    for seed in range(20):
        rng = Random(seed)
        messages = sorted((rng.randrange(1000), rng.randrange(2), rng.choice(
            [rng.random(), -1e9, 1e9, math.nan, math.inf])) for _ in range(rng.randrange(300)))
        if seed % 2:  # as stamps may come
            rng.shuffle(messages)
        windows = [TimeWindow(k % 2, begin, begin + rng.choice([0, 1, 100, 999]), rng.choice(
            [1, 7, 1000])) for k, begin in enumerate(rng.choices(range(1000), k=6))]
        thinning = Thinning(monitor, windows)
        for part in (messages[:100], messages[100:]):
            data = [bytes(TYPES.serialize_cdr(
                TYPES.types['std_msgs/msg/Float64'](value), 'std_msgs/msg/Float64'))
                for _, _, value in part]
            thinning.add(engine, array('I', [topic for _, topic, _ in part]),
                         array('q', [time for time, _, _ in part]),
                         array('Q', map(len, data)), b''.join(data))
        for k, window in enumerate(windows):
            check_window(thinning, k, window, [
                (time, value) for time, topic, value in sorted(messages, key=itemgetter(0))
                if topic == window.input])


def test_inputs_of_all_kinds_are_drawn(tmp_path: Path) -> None:
    file, path, page = tmp_path / 'b.yaml', tmp_path / 'bag', tmp_path / 'page.html'
    file.write_text("""format: 1
evaluation: {policy: timed, stamp: header}
inputs:
  small:
    {topic: range, type: sensor_msgs/msg/Range, field: radiation_type, values: {LOUD: 0, RED: 1}}
  near: {topic: range, type: sensor_msgs/msg/Range, field: min_range}
  old: {topic: range, type: sensor_msgs/msg/Range, field: age(header.stamp)}
  came: {topic: range, type: sensor_msgs/msg/Range, field: received(), initial: false}
  frame: {topic: range, type: sensor_msgs/msg/Range, field: header.frame_id, values: {A: a, B: b}}
requirements:
  - {id: ALL, ptltl: "small = LOUD | near < 0.5 | old > 0.5 | came | frame = A"}
""", encoding='utf-8')
    kind = 'sensor_msgs/msg/Range'
    types = TYPES.types
    with Writer(path, version=9) as writer:
        topic = writer.add_connection('/range', kind, typestore=TYPES)
        for k in range(4):
            stamp = types['builtin_interfaces/msg/Time'](START // SECOND + k, 0)
            header = types['std_msgs/msg/Header'](stamp, 'ab'[k // 2])
            message = types[kind](header, k % 2, 0.0, 0.25 * k, 0.0, 0.0, 0.0)
            writer.write(topic, START + k * SECOND + SECOND // 4, TYPES.serialize_cdr(
                message, kind))
    assert main(['bag', str(file), str(path), '--report', str(page), '--from', str(
        START // SECOND)]) == 0
    data = Outline(page.read_text(encoding='utf-8')).data
    small, near, old, came, frame = data['inputs']
    assert [item[1:] for item in small['v']] == [[0], [1], [0], [1]]
    # Values take effect at the stamps, which are a quarter of a second before the reception.
    assert [item[0] * 3.25 / small['n'] for item in small['v']] == pytest.approx(
        [0, 1, 2, 3], abs=0.01)
    assert [item[1:] for item in near['v']] == [[0], [0.25], [0.5], [0.75]]
    assert [item[1:] for item in old['v']] == [[0.25]]
    assert [item[1:] for item in came['v']] == [[0, 1, 0]] * 4
    assert [item[1:] for item in frame['v']] == [[0], [1]]
    assert frame['names'] == [['A', 0], ['B', 1]]
    thresholds = [plot['h'] for plot in data['occurrences'][0]['p']]
    assert thresholds == [[[0, 'LOUD']], [[0.5, '0.5']], [[0.5, '0.5']], [[0, 'A']]]


def check_window(thinning: Thinning, k: int, window: TimeWindow,
                 values: list[tuple[int, float]]) -> None:
    before = [value for time, value in values if time < window.begin]
    initial = None if window.input else 7.0
    assert repr(thinning.before(k)) == repr(before[-1] if before else initial)
    expected: dict[int, list[float]] = {}
    length = window.end - window.begin + 1
    for time, value in values:
        if window.begin <= time <= window.end:
            place = int((time - window.begin) / length * window.parts)
            expected.setdefault(place, []).append(value)
    found = list(thinning.parts(k))
    assert [part.place for part in found] == list(expected)
    for part, inside in zip(found, expected.values()):
        numbers = [value for value in inside if not math.isnan(value)] or [math.nan]
        assert repr((part.least, part.most, part.last, part.has_nan)) == repr(
            (min(numbers), max(numbers), inside[-1], any(map(math.isnan, inside))))


def test_no_value_is_hidden_by_another_in_its_part() -> None:
    item = ManifestInput('x', ValueType.FLOAT64, None, None, (), (), None)
    assert _values([WindowPart(0, 1.0, 1.0, 1.0, False), WindowPart(1, 1.0, 1.0, 1.0, False),
                    WindowPart(2, 1.0, 1.0, 1.0, True),
                    WindowPart(3, -math.inf, 2.5, 1 / 3, False),
                    WindowPart(4, math.nan, math.nan, math.nan, True)], item) == [
        [0, 1], [2, 'NaN', 1, 1, 1], [3, '-inf', 2.5, 0.3333333], [4, 'NaN', 'NaN']]


def test_a_lane_keeps_what_was_short() -> None:
    lane = Lane(0, 999, 10)
    lane.paint(-5, 449, TRUE)
    lane.paint(450, 450, FALSE)
    lane.paint(451, 2000, TRUE)
    assert lane.text() == 't4m1t5'


def test_several_recordings_have_an_index(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, reports, results = (tmp_path / name for name in ('b.yaml', 'out', 'results.jsonl'))
    file.write_text(answer('timed', '2 seconds'), encoding='utf-8')
    paths = [write(tmp_path / name, answers(count)) for name, count in (('one', 40), ('two', 5))]
    (tmp_path / 'bad.mcap').write_bytes(b'nothing')
    arguments = ['bag', str(file), *map(str, paths), str(tmp_path / 'bad.mcap'), '--report']
    assert main([*arguments, str(reports), '--results', str(results)]) == 1
    found = Outline((reports / 'index.html').read_text(encoding='utf-8'))
    links = [values['href'] for tag, values in found.tags if tag == 'a']
    assert len(links) == 2
    assert all(link is not None and (reports / link).is_file() for link in links)
    assert found.of('span') == ['violated', 'satisfied', 'satisfied', 'satisfied', 'satisfied',
                                'satisfied']
    assert 'script' not in {tag for tag, _ in found.tags}
    lines = results.read_text(encoding='utf-8').splitlines()
    results.write_text('\n'.join(line for line in lines if 'two' not in line), encoding='utf-8')
    assert main([*arguments, str(reports), '--results', str(results)]) == 1
    again = Outline((reports / 'index.html').read_text(encoding='utf-8'))
    assert sorted(again.of('a', 'td', 'span')) == sorted(found.of('a', 'td', 'span'))
    assert main([*arguments, str(tmp_path / 'page.html')]) == 1
    assert 'name a folder' in capsys.readouterr().err
    (reports / 'index.html').write_text('mine', encoding='utf-8')
    assert main([*arguments, str(reports)]) == 1
    assert 'is not an index that this command wrote' in capsys.readouterr().err
    assert (reports / 'index.html').read_text(encoding='utf-8') == 'mine'


def test_a_report_that_cannot_be_written_leaves_nothing(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / 'bundle.html'
    file.write_text(answer('timed', '2 seconds'), encoding='utf-8')
    path = write(tmp_path / 'bag', answers(5))
    full = tmp_path / 'full.html'
    full.symlink_to('/dev/full')
    mine = tmp_path / 'mine.txt'
    mine.write_text('mine', encoding='utf-8')
    (tmp_path / 'link.html').symlink_to(mine)
    (tmp_path / 'dangling.html').symlink_to(tmp_path / 'new')
    before = sorted(tmp_path.rglob('*')), file.read_bytes()
    for page, message in ((file, 'this command reads it'),
                          (full, 'No space left'),
                          (tmp_path / 'link.html', f"is a link to '{mine}'"),
                          (tmp_path / 'dangling.html', f"is a link to '{tmp_path / 'new'}'"),
                          (tmp_path / 'no' / 'page.html', 'No such file or directory')):
        assert main(['bag', str(file), str(path), '--report', str(page)]) == 1
        assert message in capsys.readouterr().err
    assert (sorted(tmp_path.rglob('*')), file.read_bytes()) == before
    assert mine.read_text(encoding='utf-8') == 'mine'


@pytest.mark.parametrize('option', ['--report', '--results', '--csv', '--mcap', '--junit'])
def test_no_result_of_a_recording_is_written_through_a_link(
        option: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = write_bundle(tmp_path, answer('timed', '2 seconds'))
    path = write(tmp_path / 'bag', answers(5))
    mine = tmp_path / 'mine.txt'
    mine.write_text('mine', encoding='utf-8')
    folder = tmp_path / 'reports'
    folder.mkdir()
    planted = folder / page_name(path) if option == '--report' else tmp_path / 'result'
    planted.symlink_to(mine)
    named = folder if option == '--report' else planted
    assert main(['bag', str(file), str(path), option, str(named)]) == 1
    assert f"'{planted}': it is a link" in capsys.readouterr().err
    assert planted.is_symlink()
    assert mine.read_text(encoding='utf-8') == 'mine'


def test_a_browser_draws_it_without_network_or_errors(tmp_path: Path) -> None:
    browser = next(filter(None, map(shutil.which, (
        'chromium', 'chromium-browser', 'google-chrome'))), None)
    if browser is None:
        pytest.skip('no Chromium is installed')
    static = report(tmp_path, answer('timed', '2 seconds').replace('id: LOW', f"id: '{HOSTILE}'"),
                    answers())
    sources = [(tag, values[key]) for tag, values in static.tags for key in ('src', 'href')
               if key in values and tag != 'a']
    assert sources == [('link', 'data:,')]
    page = tmp_path / 'page.html'
    own = f"'sha256-{b64encode(sha256(POINTER.encode()).digest()).decode()}'"
    page.write_text(page.read_text(encoding='utf-8').replace(
        'script-src', f'script-src {own}').replace(
        '</body>', f'<script>{POINTER}</script></body>'), encoding='utf-8')
    ran = subprocess.run(
        [browser, '--headless', '--no-sandbox', '--disable-gpu', '--disable-extensions',
         f'--user-data-dir={tmp_path / "profile"}', '--enable-logging=stderr', '--dump-dom',
         '--virtual-time-budget=3000', '--window-size=400,900',
         '--host-resolver-rules=MAP * ~NOTFOUND',
         page.as_uri()],
        capture_output=True, text=True, timeout=120, check=True)
    assert 'CONSOLE' not in ran.stderr
    shown = Outline(ran.stdout)
    drawn = [values for tag, values in shown.tags if tag == 'svg']
    assert len(drawn) == 7
    assert all(values.get('viewbox') for values in drawn)
    curves = [values['d'] for tag, values in shown.tags
              if tag == 'path' and values.get('class') == 'curve']
    assert len(curves) == 4
    assert all(curve and 'NaN' not in curve for curve in curves)
    arrows = [values['d'] for tag, values in shown.tags
              if tag == 'path' and values.get('class') == 'fired']
    assert len(arrows) == 1  # the trigger lasts a nanosecond
    texts = shown.of('text')
    assert 'deadline, violated' in texts
    assert texts[texts.index('flow') + 1] == '2.5'  # under the pointer
    assert texts[texts.index('level > 1.0') + 1] == 'false'
    assert texts[texts.index('ANSWER') + 1] == 'violated'
