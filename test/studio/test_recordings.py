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

"""Recordings in the page are those of `bag --report`; why a verdict is false is in it, too."""

import json
import os
from pathlib import Path
from typing import Any

from bag.outline import Outline
from bag.recordings import Message, write
from fret_monitor.cli.main import main
from fret_monitor.studio import folder as folders
from fret_monitor.studio.folder import Folder
from fret_monitor.studio.questions import Questions
import pytest

SECOND = 10**9
BUNDLE = """\
format: 1
evaluation: {policy: timed}
inputs:
  level: {topic: level, type: std_msgs/msg/Float64, max_rate: 200}
  flow: {topic: flow, type: std_msgs/msg/Float64, max_rate: 200}
requirements:
  - {id: ANSWER, fretish: when flow > 1 the pump shall within 2 seconds satisfy level > 1}
  - {id: LOW, ptltl: "level < 5"}
"""
STEPPED = BUNDLE.replace('timed', 'every_message').replace('2 seconds', '3 ticks')


def messages() -> list[Message]:
    """Return messages each half second: flow rises at 3 s and 12 s, level at 8 s and 16 s."""
    return [message for k in range(40) for message in (
        ('/level', k * SECOND // 2, 2.0 if k in (16, 32) else 0.25),
        ('/flow', k * SECOND // 2 + 1, 2.5 if 6 <= k < 10 or 24 <= k < 30 else 0.0))]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / 'b.yaml').write_text(BUNDLE)
    write(tmp_path / 'run', messages())
    return tmp_path


def answer(folder: Path, do: str, text: str = BUNDLE, **more: Any) -> dict[str, Any]:
    return Questions(folder).answer({
        'do': do, 'name': 'b.yaml', 'text': text, 'recording': 'run', **more})


def ask(folder: Path, do: str, text: str = BUNDLE, **more: Any) -> Any:
    found = answer(folder, do, text, **more)
    assert 'error' not in found, found
    return json.loads(json.dumps(found['answer']))


def between(first: float, last: float) -> dict[str, Any]:
    """Return a stretch of a recording, in seconds."""
    return {'from': first, 'to': last}


def test_a_recording_is_shown_as_the_report_of_bag_shows_it(folder: Path) -> None:
    page = folder / 'page.html'
    assert main(['bag', str(folder / 'b.yaml'), str(folder / 'run'), '--report', str(page)]) == 0
    written = page.read_text(encoding='utf-8')
    found = ask(folder, 'recording')
    assert found['data'] == Outline(written).data
    assert found['html'] in written.replace('\n', '')
    assert found['occurrences'] == [[pytest.approx(5, abs=1e-6), 'ANSWER'],
                                    [pytest.approx(14, abs=1e-6), 'ANSWER']]
    assert found['drawn'] == found['occurrences']


def test_a_stretch_of_a_recording_shows_what_is_in_it_with_the_same_verdicts(
        folder: Path) -> None:
    whole, part = ask(folder, 'recording'), ask(folder, 'recording', **between(13.5, 14.5))
    assert part['occurrences'] == whole['occurrences'] and part['length'] == whole['length']
    assert part['drawn'] == whole['occurrences'][1:]
    assert (part['data']['begin'], part['data']['length']) == (13.5 * SECOND, SECOND)
    lane = part['data']['lanes'][0]
    assert lane in ('t360f360', 't360m1f359', 't359m1f360')
    assert set(filter(str.isalpha, part['data']['lanes'][1])) == {'t'}
    # One that began before the stretch and lasts into it is there, one that has ended is not.
    assert ask(folder, 'recording', **between(14.2, 14.8))['drawn'] == part['drawn']
    assert ask(folder, 'recording', **between(18, 19))['drawn'] == []


def test_a_stretch_is_taken_over_with_the_verdicts_it_had(folder: Path) -> None:
    found = ask(folder, 'taken', **between(11, 16))
    assert found['period'] * (found['steps'] - 1) == pytest.approx(5)
    judged = ask(folder, 'simulate', steps=found['steps'], period=found['period'],
                 values=found['values'])['verdicts']['ANSWER']
    (_, before), (at, violated), *_ = judged
    assert (before, violated) == (1, 0) and at == pytest.approx(14 - 11, abs=found['period'] * 2)


def test_of_steps_that_are_messages_a_stretch_has_one_for_each(folder: Path) -> None:
    found = ask(folder, 'taken', STEPPED, **between(0, 30))
    assert (found['steps'], found['period'], found['late']) == (80, None, ['flow'])
    judged = ask(folder, 'simulate', STEPPED, steps=80, values=found['values'])['verdicts']
    times = [k * SECOND // 2 + part for k in range(40) for part in (0, 1)]
    occurrences = ask(folder, 'recording', STEPPED)['occurrences']
    # The verdict of a sentence is final once it is false; a report has each occurrence.
    assert len(occurrences) == 2
    assert [times[step] / SECOND for step, value in judged['ANSWER'] if not value] == [
        occurrences[0][0]]


TRACE = {'level': [[0, 0.25], [20, 2.0], [21, 0.25]], 'flow': [[0, 0.0], [6, 2.5], [10, 0.0]]}


@pytest.mark.parametrize('text, period, begin', [(STEPPED, 0.1, 9), (BUNDLE, 0.5, 10)],
                         ids=['steps', 'timed'])
def test_a_violation_has_its_trigger_deadline_and_comparisons(
        folder: Path, text: str, period: float, begin: int) -> None:
    more = {'steps': 40, 'period': period, 'values': TRACE, 'id': 'ANSWER'}
    found = ask(folder, 'why', text, step=begin + 1, **more)
    assert found['begin'] == pytest.approx(begin, abs=1e-6)
    assert found['trigger'] == pytest.approx(6, abs=1e-6) and found['isDeadline']
    drawn = found['data']['occurrences'][found['place']]
    assert [(label, kind) for label, kind, _ in drawn['l']] == [
        ('when flow > 1', 'trigger'), ('flow > 1.0', 'proposition'),
        ('level > 1.0', 'proposition'), ('ANSWER', 'verdict')]
    assert ask(folder, 'why', text, step=begin - 1, **more) is None
    assert ask(folder, 'why', text, step=30, **more)['begin'] == found['begin']
    judged = ask(folder, 'simulate', text, **more)['verdicts']['ANSWER']
    assert [at / (period if text is BUNDLE else 1) for at, value in judged if not value] == [
        pytest.approx(begin, abs=1e-6)]


def test_a_violation_that_is_over_has_an_end(folder: Path) -> None:
    more = {'steps': 9, 'values': {'level': [[0, 0.0], [3, 7.0], [6, 1.0]]}, 'id': 'LOW'}
    found = ask(folder, 'why', STEPPED, step=5, **more)
    assert (found['begin'], found['end']) == (3, 6)
    assert ask(folder, 'why', STEPPED, step=6, **more) is None


@pytest.mark.parametrize('name', ['../run', '/etc', '', '.', 'link', 'linked', 'piped', 'none',
                                  'large'])
def test_a_folder_opens_no_recording_outside_no_link_pipe_or_large_one(
        folder: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    inside = folder / 'inside'
    inside.mkdir()
    (inside / 'link').symlink_to(folder / 'run')
    for sub in ('linked', 'piped', 'large'):
        (inside / sub).mkdir()
        (inside / sub / 'metadata.yaml').write_text('{}')
    file, = (folder / 'run').glob('*.mcap')
    (inside / 'linked' / file.name).symlink_to(file)
    os.mkfifo(inside / 'piped' / 'pipe.mcap')
    (inside / 'large' / 'a.mcap').write_bytes(b'0' * 20_000)
    monkeypatch.setattr(folders, 'MOST_RECORDING_BYTES', 10_000)
    with pytest.raises(ValueError):
        Folder(inside).recording(name)
    found = answer(inside, 'recording', recording=name)
    assert 'error' in found


def test_recordings_of_a_folder_are_listed(folder: Path) -> None:
    (folder / 'other').mkdir()
    (folder / 'one.mcap').write_bytes(b'')
    (folder / 'link.mcap').symlink_to(folder / 'one.mcap')
    assert Folder(folder).recordings() == ['one.mcap', 'run']
    assert 'error' in answer(folder, 'recording', recording='one.mcap')


def test_what_cannot_be_taken_over_is_refused(folder: Path, monkeypatch: pytest.MonkeyPatch,
                                              ) -> None:
    from fret_monitor.studio import recordings
    monkeypatch.setattr(recordings, 'MOST_ROWS', 10)
    found = answer(folder, 'taken', STEPPED, **between(0, 30))
    assert found['error'].startswith('this stretch has 80 messages')
    assert 'before it ends' in answer(folder, 'taken', **between(3, 2))['error']
    keyed = BUNDLE.replace('inputs:', 'for_each: {robot: [a]}\ninputs:').replace(
        'topic: flow', 'topic: "/{robot}/flow"')
    assert 'for_each' in answer(folder, 'taken', keyed, **between(1, 2))['error']
