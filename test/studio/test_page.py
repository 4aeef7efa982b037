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

"""The page in a browser, clicked through; and what takes too long is ended."""

import asyncio
from hashlib import sha256
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
import tempfile
import time
from urllib.parse import urlsplit

from bag.recordings import write
import fret_monitor.studio
from fret_monitor.studio.process import Answering, OUTDATED, Unanswered
import pytest
from strategies import thorough
from studio.browser import CHROMIUM, Chromium, Page
from studio.serving import studio
from studio.test_recordings import BUNDLE as RECORDED, messages


BUNDLE = """\
format: 1
evaluation: {policy: every_message}
inputs:
  speed: {topic: speed, type: std_msgs/msg/Float64}
  hot: {topic: hot, type: std_msgs/msg/Bool}
requirements:
  - {id: SLOW, ptltl: "hot -> speed <= 1.5"}
  - {id: COOL, ptltl: "!hot"}
"""
HOT, SPEED = '.lane[aria-label^="hot"]', '.lane[aria-label^="speed"]'
ANSWER = '.lane[aria-label^="ANSWER"]'
SLOW, COOL = '.lane[aria-label^="SLOW"]', '.lane[aria-label^="COOL"]'
PAGE = Path(fret_monitor.studio.__file__).parent / 'page'
needs_browser = pytest.mark.skipif(
    CHROMIUM is None or find_spec('uvicorn') is None, reason='needs Chromium and uvicorn')


def colours(page: Page, lane: str) -> str:
    """Return the truth values that a lane draws, such as `10` for true, then false."""
    return str(page.get(f"""[...document.querySelectorAll('{lane} rect:not(.chosen)')]
        .map((each) => each.classList.contains('is-true') ? 1 : 0).join('')"""))


def steps_of(page: Page, lane: str) -> list[float]:
    """Return where the parts of a lane begin and end, in steps of 40."""
    return [round(value / 25, 3) for value in page.get(
        f"""[...document.querySelectorAll('{lane} rect:not(.chosen)')].flatMap((each) => [
        Number(each.getAttribute('x')),
        Number(each.getAttribute('x')) + Number(each.getAttribute('width'))])""")]


def becomes(page: Page, lane: str, steps: list[float]) -> None:
    """Wait until a lane, which begins true, changes at these steps."""
    expected = [each for pair in pairwise([0.0, *steps, 40.0]) for each in pair]
    end = time.monotonic() + 60
    while steps_of(page, lane) != expected:
        assert time.monotonic() < end, (lane, steps_of(page, lane), expected)
        time.sleep(0.02)
    assert colours(page, lane) == ('10' * len(expected))[:len(expected) // 2]


@needs_browser
def test_write_understand_and_try(folder: Path, url: str, page: Page) -> None:
    path = folder / 'b.yaml'
    path.write_text(BUNDLE)
    page.open(url)
    page.wait(f"!!document.querySelector('{COOL} rect.is-true')")
    assert page.get("""[...document.querySelectorAll('#nav a')].every(
        (each) => document.querySelector(each.hash)?.tagName === 'SECTION')""")
    # A number with which an input is compared is in its scale.
    assert page.get("""[...document.querySelectorAll('#trace .axis span')].map(
        (each) => Number(each.textContent))""") == [1.88, -0.375]
    assert page.get(f"document.querySelectorAll('{SPEED} line.level').length") == 1
    # Understand.
    page.see('figure')
    assert 'hot' in page.text('#meaning')
    # Try: a click, a drag, a value that is typed, the keyboard.
    page.click(HOT, 10.5 / 40)
    becomes(page, COOL, [10, 11])
    page.drag(HOT, (20.5 / 40, 0.5), (29.5 / 40, 0.5))
    becomes(page, COOL, [10, 11, 20, 30])
    page.click(SPEED, 20.5 / 40)
    page.get(f"document.querySelector('{SPEED}').focus()")
    for _ in range(3):
        page.key('ArrowRight', modifiers=8)
    page.key('Enter')
    page.get("document.querySelector('#value').select()")
    page.type('7.5')
    page.key('Enter')
    becomes(page, SLOW, [20, 24])
    page.get(f"document.querySelector('{HOT}').focus()")
    page.key('Home')
    page.key(' ')
    page.wait(f"document.querySelector('{COOL} rect:not(.chosen)').matches('.is-false')")
    # A trace that violates.
    page.get("[...document.querySelectorAll('#trace button')].find("
             "(each) => each.textContent === 'violates it').click()")
    page.wait("document.querySelector('#steps').value !== '40'")
    page.wait(f"!!document.querySelector('{SLOW} rect.is-false')")
    page.wait(f"""document.querySelector('{SLOW}').nextElementSibling.textContent
        === 'violated: why?'""")  # at the last step, which is chosen
    page.get(f"document.querySelector('{SLOW}').nextElementSibling.click()")
    axis = page.wait("""(() => {
        const drawn = document.querySelector('#why .report')?.shadowRoot.querySelectorAll('text');
        const texts = [...drawn ?? []].map((each) => each.textContent);
        return texts.filter((each) => / steps$/.test(each)).join(); })()""")
    assert axis.startswith('0 steps') and '.' not in axis
    # Write: a mistake, its message, its fix.
    page.get("document.querySelector('.cm-content').focus()")
    at = BUNDLE.index('!hot') + 1
    page.get('window.getSelection().selectAllChildren(document.querySelector('
             '".cm-content")); 0')
    page.type(BUNDLE[:at] + 'hott' + BUNDLE[at + 3:])
    page.see('#problems li.error')
    assert "'hott'" in page.text('#problems')
    page.see('#problems .fix')
    page.click('#problems .fix')
    page.wait("!document.querySelector('#problems li')")
    # Save, after asking; nothing before.
    page.get("document.querySelector('.cm-content').focus()")
    page.key('ArrowRight')
    page.type('# noted\n')
    page.wait("document.querySelector('#state').textContent.includes('not saved')")
    assert path.read_text() == BUNDLE
    page.click('#save')
    page.click('#ask-yes')
    page.wait("/· saved/.test(document.querySelector('#state').textContent)")
    assert '# noted' in path.read_text()
    assert page.get("document.querySelector('#recording').closest('.tools').hidden")  # none
    # In another file, by Enter alone.
    path = folder / 'other.yaml'
    page.click('#save-as')
    page.get("document.querySelector('#ask-name').select()")
    page.type(path.name)
    page.key('Enter')
    page.wait("document.querySelector('#file').value === 'other.yaml'")
    assert '# noted' in path.read_text()
    # Somebody else writes the file.
    path.write_text(BUNDLE + '# by hand\n')
    page.see('#notice:not([hidden]) button')
    page.click('#notice button')
    page.wait("document.querySelector('.cm-content').textContent.includes('by hand')")
    assert page.problems == []


@needs_browser
def test_a_recording_its_reasons_the_picture_and_the_form(
    folder: Path, url: str, page: Page,
) -> None:
    (folder / 'b.yaml').write_text(RECORDED)
    write(folder / 'run', messages())
    drawn = "document.querySelector('#report .report')?.shadowRoot"
    page.open(url)
    page.see(f'{ANSWER} rect.is-true')
    # A recording: occurrence by occurrence, and a stretch of it.
    page.click('#open-recording')
    page.wait(f"{drawn}?.querySelectorAll('svg[data-lane] rect').length > 3")
    for number, at in ((1, 5), (2, 14)):
        page.click('#next')
        page.wait(f"document.querySelector('#recording-note').textContent.startsWith("
                  f"'occurrence {number} of 2: ANSWER at {at} s')")
        assert page.get(f'{drawn}.activeElement.tagName') == 'FIGURE'
    page.get("""for (const [id, value] of [['from', 11], ['to', 15]]) {
        document.querySelector(`#stretch-${id}`).value = value; } 0""")
    page.click('#zoom')
    page.wait(f"[...{drawn}.querySelectorAll('svg[data-times] text')].some((each) => "
              "each.textContent === '13 s')")
    # The stretch as a trace, and why it violates.
    page.click('#take-over')
    page.wait("document.querySelector('#trace-note').textContent.startsWith('Taken over')")
    page.see(f'{ANSWER} rect.is-false')
    page.get(f"document.querySelector('{ANSWER}').focus()")
    page.key('End')
    page.click('button.now.is-false')
    page.see('#why p')
    assert 'trigger came at 1.01 s; the deadline passed 2 s later' in page.text('#why')
    page.wait("!!document.querySelector('#why .report').shadowRoot.querySelector('.fired')")
    assert page.get(f"document.querySelectorAll('{ANSWER} line.trigger').length") == 1
    page.drag(ANSWER.replace('ANSWER', 'flow'), (0.01, 0.2), (0.05, 0.2))
    page.wait("!document.querySelector('#why p, .lane line:not(.level)')")
    # Margins.
    page.click('#margins')
    page.wait("document.querySelector('.lane[aria-label^=\"margin of LOW\"] path')"
              "?.getAttribute('d').length > 10")
    page.see(f'{ANSWER} rect')
    # The picture, by keyboard.
    node = '.picture .node[aria-label^="input flow"]'
    page.see(node)
    page.get(f"document.querySelector('{node}').focus()")
    page.key('ArrowRight')
    assert page.get("document.activeElement.getAttribute('aria-label')").startswith(
        'requirement ANSWER; ')
    page.key('Enter')
    page.wait("document.activeElement.classList.contains('cm-content')")
    # The form.
    page.get("document.querySelector('#field-timing').select()")
    page.type('within 1 second')
    page.wait("document.querySelector('.cm-content').textContent.includes("
              "'shall within 1 second satisfy level > 1')")
    page.wait("document.querySelector('#state').textContent.startsWith('no problems')")
    assert page.get('document.activeElement.id') == 'field-timing'
    assert page.problems == []


@needs_browser
def test_a_new_requirement_is_written_from_a_form(folder: Path, url: str, page: Page) -> None:
    (folder / 'b.yaml').write_text(RECORDED)
    page.open(url)
    page.see(f'{ANSWER} rect')
    page.wait("document.querySelector('#field-component')?.value === 'pump'")
    page.click('#new-requirement')
    page.wait("document.querySelector('#new-component')?.value === 'pump'")
    assert page.get('document.activeElement.id') == 'new-id'
    page.type('ANSWER')
    problems = "document.querySelector('#new-problems').textContent"
    page.wait(f'{problems}.includes("already")')
    assert page.get("document.querySelector('#new-add').disabled")
    page.type('-2')
    for name, text in (('condition', 'when flow > 3'), ('timing', 'always'),
                       ('response', 'levl >= 0')):
        page.get(f"document.querySelector('#new-{name}').focus()")
        page.type(text)
    page.wait(f'{problems}.includes("levl")')
    page.get("document.querySelector('#new-response').select()")
    page.type('level >= 0')
    page.see('#meaning figure')
    assert not page.text('#new-problems') and 'flow > 3' in page.text('#meaning dl')
    page.key('Enter')
    page.wait("document.querySelector('#requirement')?.value === 'ANSWER-2'")
    page.see('.lane[aria-label^="ANSWER-2"] rect')
    assert 'fretish: "when flow > 3 the pump shall always satisfy level >= 0"' in page.text(
        '.cm-content')
    page.wait("document.querySelector('#field-response')?.value === 'level >= 0'")
    page.click('#new-requirement')
    page.wait("document.activeElement.id === 'new-id' && !document.activeElement.value")
    page.click('#meaning form button[type=button]')
    page.wait("document.querySelector('#requirement')?.value === 'ANSWER-2'")
    # An id that is written before the fields come stays.
    at_once(page, "find('#new-requirement').click()", "put('#new-id', 'ANSWER-2')")
    page.see('#new-response')
    page.wait(f'{problems}.includes("already")')
    assert page.get("document.querySelector('#new-id').value") == 'ANSWER-2'
    assert page.problems == []


TWO = """\
format: 1
component: robot
inputs:
  speed: {topic: speed, type: std_msgs/msg/Float64}
requirements:
  - {id: SLOW, fretish: the robot shall always satisfy speed <= 1.0}
  - {id: FAST, fretish: the robot shall always satisfy speed >= 0.0}
"""
TEXT = "[...document.querySelectorAll('.cm-line')].map((each) => each.textContent).join('\\n')"


def at_once(page: Page, *steps: str) -> None:
    """Run steps without a pause; `put(selector, text)` writes, `choose` chooses."""
    page.get("""{
        const find = (selector) => document.querySelector(selector);
        const set = (kind) => (selector, text) => {
          find(selector).value = text; find(selector).dispatchEvent(new Event(kind)); };
        const [put, choose] = [set('input'), set('change')];
        const write = (text) => document.execCommand('insertText', false, text);
        """ + '; '.join(steps) + '; 0 }')


@needs_browser
def test_what_is_typed_is_written_into_the_text_as_it_is_then(
    folder: Path, url: str, page: Page,
) -> None:
    (folder / 'b.yaml').write_text(TWO)
    checked = 'Number(document.body.dataset.checked)'
    page.open(url)
    page.wait("document.querySelector('#field-response')?.value === 'speed <= 1.0'")
    # A draft of a requirement, then another text, then Enter right after a letter.
    at_once(page, "find('#new-requirement').click()", "put('#new-id', ' NEW  ONE')")
    page.see('#new-response')  # by now
    assert page.get('document.activeElement.id') == 'new-id'
    at_once(page, "put('#new-timing', 'always')", "put('#new-response', 'speed < 5')")
    page.see('#meaning figure')
    at_once(page, "find('.cm-content').focus()", "write('# a comment, and a long one\\n')",
            "put('#new-response', 'speed < 5 & speed > -5')",
            "find('#new-add').click()")
    page.see('.lane[aria-label^="NEW ONE"]')
    assert page.get(TEXT).rstrip() == '# a comment, and a long one\n' + TWO + (
        '  - id: "NEW ONE"\n'
        '    fretish: "the robot shall always satisfy speed < 5 & speed > -5"')
    # A field, then another requirement.
    page.wait("document.querySelector('#field-response')?.value === 'speed < 5 & speed > -5'")
    seen = page.get(checked)
    at_once(page, "put('#field-response', 'speed < 6')", "choose('#requirement', 'FAST')")
    page.wait(f'{checked} > {seen}')
    page.wait("document.querySelector('#field-response')?.value === 'speed >= 0.0'")
    assert page.get(TEXT).rstrip().endswith('satisfy speed < 6"')
    # A field, then a line in the editor before the answer comes.
    at_once(page, "put('#field-response', 'speed >= 7.0')",
            "find('#field-response').dispatchEvent(new Event('change'))",
            "find('.cm-content').focus()", "write('# later\\n')")
    page.wait(f'({TEXT}).includes("satisfy speed >= 7.0")')
    assert len(page.get(TEXT).splitlines()) == len(TWO.splitlines()) + 4
    page.wait("document.querySelector('#state').textContent.startsWith('no problems')")
    assert page.problems == []


@needs_browser
def test_another_file_takes_nothing_of_the_one_before(folder: Path, url: str, page: Page) -> None:
    (folder / 'b.yaml').write_bytes(TWO.replace('\n', '\r\n').encode())
    (folder / 'c.yaml').write_text(TWO.replace('speed:', 'height:').replace('SLOW', 'LOW'))
    title = "document.querySelector('#try-title').textContent"
    state = "document.querySelector('#state').textContent"
    lane = '.lane[aria-label^="SLOW"]'
    page.open(url)
    page.see(f'{lane} rect.is-true')
    page.see('#meaning figure')
    page.wait(f"{state} === 'no problems · saved'")
    # An error: what is shown is of an older text, until there is none.
    page.get("document.querySelector('.cm-content').focus()")
    page.type('# [\n  : x\n')
    page.wait(f"{title} === 'Try it on a trace (of an older text)'")
    assert page.get("document.body.classList.contains('is-old')")
    for _ in range(2):
        page.key('z', 2)
    page.wait(f"{title} === 'Try it on a trace' && {state} === 'no problems · saved'")
    assert page.get(TEXT) == TWO  # the loading cannot be undone
    # Line ends are kept.
    page.type('# noted\n')
    page.wait(f"{state} === 'no problems · not saved'")
    page.click('#save')
    page.click('#ask-yes')
    page.wait(f"{state} === 'no problems · saved'")
    assert (folder / 'b.yaml').read_bytes() == (
        '# noted\n' + TWO).replace('\n', '\r\n').encode()
    # Another file, with an error.
    at_once(page, "choose('#file', 'c.yaml')")
    page.wait(f"/errors?.*saved/.test({state}) && ({TEXT}).includes('height')")
    assert page.get("document.querySelectorAll('.lane[aria-label$=steps]').length") == 0
    assert not page.get("document.querySelector('#meaning figure, #requirement')")
    page.get("document.querySelector('.cm-content').focus()")
    page.key('z', 2)
    page.wait(f'{TEXT} === {(folder / "c.yaml").read_text()!r}')
    at_once(page, "choose('#file', 'b.yaml')")
    page.see(f'{lane} rect.is-true')
    page.see('#meaning figure')
    # A draft of a file that somebody else has changed since.
    page.get("document.querySelector('.cm-content').focus()")
    page.type('# draft\n')
    page.wait(f"{state} === 'no problems · not saved'")
    at_once(page, "choose('#file', 'c.yaml')")
    page.wait(f"({TEXT}).includes('height')")
    (folder / 'b.yaml').write_text(TWO + '# by hand\n')
    at_once(page, "choose('#file', 'b.yaml')")
    page.wait(f"({TEXT}).includes('# draft')")
    notice = "document.querySelector('#notice').textContent"
    page.wait(f"{notice}.startsWith('b.yaml was changed on disk by somebody else')")
    page.get("document.querySelector('#notice').hidden = true")
    page.click('#save')
    page.click('#ask-yes')
    page.wait("!document.querySelector('#notice').hidden")
    page.wait(f"{notice}.startsWith('b.yaml was changed on disk by somebody else')")
    assert (folder / 'b.yaml').read_text() == TWO + '# by hand\n'
    # The file is gone: there is nothing to read again.
    (folder / 'b.yaml').unlink()
    page.wait(f"{notice}.startsWith('b.yaml is not there any more')")
    assert 'Read it again' not in page.text('#notice')
    page.click('#notice button')
    page.wait("document.querySelector('#notice').hidden")
    assert '# draft' in (folder / 'b.yaml').read_text()
    # A new file, of which seconds are time.
    at_once(page, "choose('#file', '')")
    page.wait(f"({TEXT}).includes('policy: timed') && {state} === 'no problems · not saved'")
    assert page.problems == []


def crowd(count: int) -> str:
    """Return a bundle with so many requirements."""
    return BUNDLE + ''.join(
        f'  - {{id: R{number}, ptltl: "hot -> speed < {number}"}}\n' for number in range(count))


@needs_browser
def test_of_many_rows_those_near_the_window_are_drawn(folder: Path, url: str, page: Page) -> None:
    (folder / 'b.yaml').write_text(
        crowd(200) + '  - {id: MOST, ptltl: "maxOver(3, speed) < 9"}\n')
    last = '.lane[aria-label^="R199,"]'
    page.open(url)
    page.see(f'{COOL} rect.is-true')
    assert page.get("document.querySelectorAll('.lane').length") == 206
    assert page.get(f"document.querySelector('{last}').childElementCount") == 0
    assert page.get("document.querySelectorAll('.lane rect').length") < 300
    page.get("document.querySelector('#rows-with').focus()")
    page.type('R199')
    page.see(f'{last} rect.is-true')
    assert page.get(f"document.querySelector('{COOL}').getBoundingClientRect().height") == 0
    page.get("document.querySelector('#rows-with').value = ''; document.querySelector("
             "'#rows-with').dispatchEvent(new Event('input'));")
    # What has not changed is not drawn again.
    page.get(f"window.kept = document.querySelector('{COOL} rect.is-true'); 0")
    page.drag(SPEED, (10.5 / 40, 0.5), (10.5 / 40, 0.1))
    page.wait(f"document.querySelector('{SPEED} path').getAttribute('d').length > 20")
    page.wait(f"document.querySelector('{COOL} .chosen').getAttribute('x') === '250'")
    assert page.get('kept.isConnected')
    page.wait("document.querySelector('.lane[aria-label^=maxOver] path')"
              "?.getAttribute('d').length > 20")
    page.click(HOT, 5.5 / 40)
    becomes(page, COOL, [5, 6])
    assert page.problems == []


@needs_browser
@thorough
def test_a_thousand_requirements_are_tried_and_changed(folder: Path, url: str, page: Page) -> None:
    (folder / 'b.yaml').write_text(crowd(1000))
    page.open(url)
    page.see(f'{COOL} rect.is-true')
    page.get("document.querySelector('#rows-with').focus()")
    page.type('R0')
    page.see('.lane[aria-label^="R0,"] rect.is-true')
    page.get("document.querySelector('#rows-with').value = ''; document.querySelector("
             "'#rows-with').dispatchEvent(new Event('input'));")
    page.click(HOT, 5.5 / 40)
    becomes(page, COOL, [5, 6])
    page.get("document.querySelector('#rows-with').focus()")
    page.type('R0')
    becomes(page, '.lane[aria-label^="R0,"]', [5, 6])
    # A change of one requirement.
    judged = page.get("document.querySelector('#trace').dataset.judged")
    page.get("document.querySelector('#requirement').value = 'R0'; document.querySelector("
             "'#requirement').dispatchEvent(new Event('change'));")
    page.key('End')
    page.type('  # noted')
    page.wait(f"document.querySelector('#trace').dataset.judged > {judged}")
    page.wait("document.querySelector('#state').textContent.startsWith('no problems')")
    assert page.problems == []


HOLD = """
const { send } = WebSocket.prototype;
[window.held, window.sockets] = [[], new Set()];
WebSocket.prototype.send = function (text) {
  window.sockets.add(this);
  const go = () => send.call(this, text);
  if (window.held && ['simulate', 'explain'].includes(JSON.parse(text).do)) window.held.push(go);
  else go();
};"""
SHOWN = "[...document.querySelectorAll('#trace button.now')].map((each) => each.textContent)"


@needs_browser
def test_a_page_says_that_it_computes_and_fits_a_telephone(
    folder: Path, url: str, page: Page,
) -> None:
    (folder / 'b.yaml').write_text(RECORDED)
    page.call('Page.addScriptToEvaluateOnNewDocument', source=HOLD)
    page.open(url)
    page.wait('held.length === 2')
    assert page.get(SHOWN) == ['computing', 'computing']
    assert page.text('#meaning [aria-live]') == 'looking for examples'
    page.get('held.forEach((go) => go()); window.held = null; 0')
    page.wait(f"{SHOWN}.join() === 'satisfied,satisfied'")
    page.see('#meaning figure')
    for width in (1400, 390):
        page.call('Emulation.setDeviceMetricsOverride', width=width, height=800,
                  deviceScaleFactor=1, mobile=True)
        page.wait("""(() => {
            const boxes = [...document.querySelectorAll('#trace .scale span')].map(
              (each) => each.getBoundingClientRect());
            return boxes.length >= 3 && boxes.every(
              (box, number) => !number || box.left > boxes[number - 1].right); })()""")
    # The connection alone is lost, and the file is changed meanwhile.
    page.get('sockets.forEach((each) => each.close()); 0')
    page.wait("document.querySelector('#notice').textContent.startsWith('The server cannot')")
    (folder / 'b.yaml').write_text(RECORDED + '# by hand\n')
    page.wait("document.querySelector('#notice').textContent.includes('by somebody else')")
    assert page.problems == []


@needs_browser
def test_traces_are_written_and_read_as_those_of_fret(folder: Path, url: str, page: Page) -> None:
    (folder / 'b.yaml').write_text(BUNDLE)
    page.open(url)
    text, notes, steps, same, broken = page.get("""import('./trace.js').then((found) => {
        const kind = (name, more) => (
          { name, names: [], numbers: [], initial: null, ...more });
        const inputs = [kind('hot', { isBool: true }), kind('speed', { isFloat: true }),
          kind('mode', { names: ['IDLE', 'DRIVE'], numbers: [0, 3] })];
        const words = new Proxy({}, { get: (_, name) => (...more) => [name, ...more] });
        const [one, other] = [new found.Trace(), new found.Trace()];
        [one, other].forEach((trace) => trace.fit(inputs));
        one.resize(3);
        one.set('hot', 1, 1, true);
        one.set('speed', 2, 2, 0.5);
        one.set('mode', 1, 2, 'DRIVE');
        const text = found.writeFret(one, inputs, 'T', ['R']);
        const more = JSON.parse(text);
        more.push({});
        more[0].theTrace.keys.push('LAST');
        more[0].theTrace.values = [0, 0, 0, 0, 1, 0, 3, 0, 0, 0.5, 3, 1];
        const notes = found.readFret(other, inputs, JSON.stringify(more), words);
        one.set('speed', 0, 0, 'nan');
        return [JSON.parse(text), notes.flat(), other.steps,
          JSON.stringify(other.values) === JSON.stringify(
            { hot: [[0, false], [1, true], [2, false]], speed: [[0, 0], [2, 0.5]],
              mode: [[0, 'IDLE'], [1, 'DRIVE']] }),
          [found.writeFret(one, inputs, 'T', []), found.readFret(other, inputs, '[{}]',
            words).flat().length]]; })""")
    assert page.problems == []
    trace = text[0]['theTrace']
    assert trace['keys'] == ['hot', 'speed', 'mode'] and trace['traceLength'] == 3
    assert trace['values'] == [0, 0, 0, 1, 0, 3, 0, 0.5, 3]
    assert trace['type'] == ['category', 'number', 'number'] and text[0]['traceID'] == 'T'
    assert notes == ['firstOf', 2, 'T'] and steps == 3 and same
    assert broken == [None, 1]


@needs_browser
def test_nothing_typed_is_lost_when_the_server_is_killed(tmp_path: Path, page: Page) -> None:
    (tmp_path / 'b.yaml').write_text(BUNDLE)
    with studio(tmp_path, 'b.yaml') as url:
        written(page, url, '# typed\n')
    page.see('#notice:not([hidden])')
    assert '# typed' in page.text('.cm-content')
    with studio(tmp_path, 'b.yaml', '--port', str(urlsplit(url).port)) as again:
        page.call('Page.navigate', url=again)
        page.wait(f"document.querySelector('#notice')?.textContent.startsWith('{RESTORED}')")
        assert page.get(TEXT) == f'# typed\n{BUNDLE}'
        page.get("document.querySelector('#notice button').click()")  # read it again
        page.wait(f'{TEXT} === {BUNDLE!r}')


FULL = """{ // the storage, and a damaged draft is in it
    const draft = Object.keys(localStorage).find((key) => key.startsWith('draft '));
    localStorage.setItem(draft.replace(/ [^ ]+/, ' none'), '{damaged');
    for (let size = 2 ** 22; size >= 1; size /= 2) {
        try { localStorage.setItem('full' + size, 'x'.repeat(size)); } catch { } } 0 }"""
RESTORED = 'This is what was not saved'
STATE = "document.querySelector('#state')?.textContent"
NOTICE = "document.querySelector('#notice')?.textContent"


def written(page: Page, url: str, text: str) -> None:
    """Open a page, and type a text, which is not saved."""
    page.open(url)
    page.wait('!!document.body.dataset.checked')
    page.get("document.querySelector('.cm-content').focus()")
    page.type(text)
    page.wait(f"{STATE} === 'no problems · not saved'")


@needs_browser
def test_what_two_tabs_write_stays_apart(
    folder: Path, url: str, page: Page, chromium: Chromium,
) -> None:
    (folder / 'b.yaml').write_text(BUNDLE)
    written(page, url, '# one\n')
    with chromium.tab(page.context) as tab:
        tab.open(url)
        tab.wait(f"{NOTICE}?.startsWith('Another tab has changes')")
        assert tab.get(TEXT) == BUNDLE
        tab.get("document.querySelector('.cm-content').focus()")
        tab.type('# two\n')
        tab.wait(f"{STATE} === 'no problems · not saved'")
        # Each has its own, also after it is opened again.
        for each, text in ((page, '# one\n'), (tab, '# two\n')):
            each.call('Page.reload')
            each.wait(f"{NOTICE}?.startsWith('{RESTORED}')")
            assert each.get(TEXT) == text + BUNDLE
        # What one saves is not overwritten by the other without being asked.
        save(tab)
        tab.wait(f"{STATE} === 'no problems · saved'")
        page.wait(f"{NOTICE}.startsWith('b.yaml was changed on disk')")
        page.get("document.querySelector('#notice').hidden = true")
        save(page)
        page.wait("!document.querySelector('#notice').hidden")
        assert (folder / 'b.yaml').read_text() == '# two\n' + BUNDLE
        assert page.get(TEXT) == '# one\n' + BUNDLE
        assert tab.problems == []
    # What a closed tab has not saved is shown by the next one, the newest first.
    with chromium.tab(page.context) as tab:
        written(tab, url, '# three\n')
    page.get(FULL)
    with chromium.tab(page.context) as tab:
        tab.open(url)
        tab.wait(f"{NOTICE}?.startsWith('{RESTORED}')")
        assert tab.get(TEXT) == '# three\n# two\n' + BUNDLE
        assert tab.problems == []
    # Another browser has none of them.
    with chromium.page() as other:
        other.open(url)
        other.wait(f"{STATE} === 'no problems · saved'")
        assert other.get(TEXT) == '# two\n' + BUNDLE
    assert page.problems == []


def save(page: Page) -> None:
    """Save the file of a page."""
    page.click('#save')
    page.click('#ask-yes')


def test_a_question_that_takes_too_long_is_ended_and_the_next_is_answered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(tempfile, 'tempdir', str(tmp_path))
    many = 'format: 1\ninputs: {p: {topic: p, type: std_msgs/msg/Bool}}\nrequirements:\n' + \
        ''.join(f'  - {{id: R{number}, ptltl: "H[0,{number + 1}] p"}}\n' for number in range(900))

    async def run() -> None:
        answering = Answering(tmp_path, limit_s=0.8)
        begin = time.monotonic()
        with pytest.raises(Unanswered, match='no answer within'):
            await answering.ask({'do': 'simulate', 'name': 'b.yaml', 'text': many, 'steps': 9,
                                 'values': {}}, lambda: True)
        assert time.monotonic() - begin < 30
        assert not [*tmp_path.glob('fret_monitor-*')]
        # What all bundles share is compiled for longer than that.
        answering = Answering(tmp_path, limit_s=0.001)
        assert await answering.ask({'do': 'prepare'}, lambda: True, 300) is False
        await answering.end()
        answering = Answering(tmp_path)
        with pytest.raises(Unanswered, match=OUTDATED):
            await answering.ask({'do': 'check'}, lambda: False)
        found = await answering.ask({'do': 'check', 'name': 'b.yaml', 'text': BUNDLE},
                                    lambda: True)
        assert found['diagnostics'] == []
        await answering.end()

    asyncio.run(run())


def test_what_is_taken_from_others_is_named_and_unchanged() -> None:
    vendor = PAGE / 'vendor'
    digest, name = (vendor / 'SHA256SUMS').read_text().split()
    assert sha256((vendor / name).read_bytes()).hexdigest() == digest
    assert '@codemirror/view' in (vendor / 'LICENSES.txt').read_text()
    assert sum(path.stat().st_size for path in PAGE.rglob('*.*')
               if path.name != 'LICENSES.txt') < 600_000


def test_the_page_names_no_other_host() -> None:
    for path in PAGE.glob('*.*'):
        text = '\n'.join(line for line in path.read_text(encoding='utf-8').splitlines()
                         if 'apache.org/licenses' not in line)
        assert 'http' not in text.replace('http://www.w3.org/2000/svg', ''), path
