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

"""A running monitor watched in the page: a real one over DDS, with and without a browser."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
import json
import os
from pathlib import Path
from signal import SIGINT
from threading import Event, Thread
from time import monotonic, sleep
from typing import Any
from urllib.parse import urlsplit

from fret_monitor import build
from fret_monitor.studio.plan import plan
from fret_monitor.studio.turn import MOST_CHANGES, MOST_OCCURRENCES, read_path, Turn
import pytest
from strategies import thorough
from studio.browser import CHROMIUM, Page
from studio.serving import studio

pytest.importorskip('uvicorn')
client = pytest.importorskip('websockets.sync.client')

BUNDLE = """\
format: 1
for_each: {robot: [alpha]}
inputs:
  speed: {topic: speed, type: std_msgs/msg/Float64}
  hot: {topic: state, type: std_msgs/msg/UInt8, values: {COLD: 0, HOT: 7}}
  near: {topic: "/{robot}/near", type: std_msgs/msg/Bool}
  depth: {topic: /scan, type: sensor_msgs/msg/LaserScan, field: min(ranges)}
requirements:
  - {id: SLOW-1, title: not too fast, ptltl: "speed <= 1.5", report: onset}
  - {id: COOL, ptltl: "H (hot != HOT)", report: occurrence}
  - {id: NEVER, ptltl: "depth > 0.1"}
  - {id: FAR, ptltl: "!near"}
"""
WAIT_S = 60.0


def test_a_turn_is_bounded_and_leaves_out_no_change_without_its_contrary() -> None:
    turn = Turn()
    for time in range(1001):
        turn.add_verdict('R', time, time % 2 == 0)
        turn.add_occurrence({'id': 'R'})
    turn.note(monitors=[])
    found = turn.take({})
    changes = found['verdicts']['R']
    assert len(changes) <= MOST_CHANGES and changes[-1] == (1000, True)
    assert all(one[1] is not other[1] for one, other in pairwise(changes))
    assert (len(found['occurrences']), found['leftOut']) == (
        MOST_OCCURRENCES, 1001 - MOST_OCCURRENCES)
    assert found['monitors'] == [] and turn.take({}) == {}


def test_a_value_is_read_by_its_path_and_is_none_outside_of_an_array() -> None:
    class Message:
        ranges = (1.5, float('inf'))
        is_on = True

    assert read_path(Message(), ['ranges', 0]) == 1.5
    assert read_path(Message(), ['ranges', 1]) == 'inf'
    assert read_path(Message(), ['ranges', 2]) is None
    assert read_path(Message(), ['is_on']) is True


def test_a_plan_has_the_topics_of_verdicts_and_inputs(tmp_path: Path) -> None:
    path = tmp_path / 'b.yaml'
    path.write_text(BUNDLE)
    found = plan(build.read(path, takes_instances=True).specification)
    assert found['requirements'][0] == {'id': 'SLOW-1', 'topic': 'copilot/verdict/SLOW_1'}
    assert found['inputs'] == [
        {'name': 'speed', 'topic': 'speed', 'type': 'std_msgs/msg/Float64', 'path': ['data'],
         'isDiscrete': False, 'names': {}},
        {'name': 'hot', 'topic': 'state', 'type': 'std_msgs/msg/UInt8', 'path': ['data'],
         'isDiscrete': True, 'names': {'0': 'COLD', '7': 'HOT'}},
        {'name': 'near[robot=alpha]', 'topic': '/alpha/near', 'type': 'std_msgs/msg/Bool',
         'path': ['data'], 'isDiscrete': True, 'names': {}}]
    assert found['leftOut'] == ['depth']


class Watcher:
    """A page of the test: what came over its socket, by kind."""

    def __init__(self, url: str, socket: Any) -> None:
        """Ask to watch."""
        self._socket = socket
        self.plan: Any = None
        self.verdicts: dict[str, list[bool | None]] = {}
        self.values: dict[str, Any] = {}
        self.occurrences: list[Any] = []
        self.health: dict[str, tuple[int, str]] = {}
        self.monitors: list[str] | None = None
        self.told = self.error = ''

    def ask(self, what: str, **more: Any) -> None:
        """Ask the server."""
        self._socket.send(json.dumps({'do': what, 'number': 1, **more}))

    def wait(self, is_true: Callable[[], bool], what: str) -> None:
        """Take what comes until a condition holds."""
        end = monotonic() + WAIT_S
        while not is_true():
            assert monotonic() < end, f'{what}: {vars(self)}'
            self._take(json.loads(self._socket.recv(WAIT_S)))

    def _take(self, found: dict[str, Any]) -> None:
        if 'live' not in found:
            self.plan = found.get('answer') or self.plan
            self.error = found.get('error', self.error)
            return
        live = found['live']
        for name, changes in live.get('verdicts', {}).items():
            self.verdicts.setdefault(name, []).extend(value for _, value in changes)
        self.values |= {name: value for name, (_, value) in live.get('values', {}).items()}
        self.occurrences += live.get('occurrences', [])
        self.health |= {item['name']: (item['level'], item['text']) for key, items in live.items()
                        if key.startswith('health ') for item in items}
        self.monitors = live.get('monitors', self.monitors)
        self.told = live.get('told', self.told)
        self.error = live.get('error', self.error)


@contextmanager
def watching(folder: Path) -> Iterator[Watcher]:
    """Open the page of a folder without a browser, and ask to watch its bundle."""
    with studio(folder, 'b.yaml') as url:
        place = urlsplit(url)
        with client.connect(f'ws://{place.netloc}{place.path}talk', open_timeout=WAIT_S,
                            origin=f'http://{place.netloc}') as socket:
            watcher = Watcher(url, socket)
            watcher.ask('watch', name='b.yaml', text=(folder / 'b.yaml').read_text(),
                        namespace='/robot')
            yield watcher


def test_without_ros_the_page_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / 'b.yaml').write_text(BUNDLE.replace(
        'sensor_msgs/msg/LaserScan, field: min(ranges)', 'std_msgs/msg/Float64'))
    hidden = tmp_path / 'hidden'
    hidden.mkdir()
    (hidden / 'rclpy.py').write_text("raise ImportError('no rclpy here')\n")
    monkeypatch.setenv('PYTHONPATH', f'{hidden}{os.pathsep}{os.environ.get("PYTHONPATH", "")}')
    with watching(tmp_path) as watcher:
        watcher.wait(lambda: bool(watcher.error), 'the error')
        assert watcher.error.startswith('ROS 2 is not here: no rclpy here. Start studio in')


@pytest.fixture
def bundle(tmp_path: Path) -> Path:
    pytest.importorskip('sensor_msgs')
    (tmp_path / 'b.yaml').write_text(BUNDLE)
    return tmp_path


@contextmanager
def robot(folder: Path, domain: int, *arguments: str) -> Iterator[Any]:
    """Run a monitor of the bundle in the namespace /robot, beside a node of the test: both."""
    pytest.importorskip('rclpy')
    from ros.harness import Partner, started
    partner = Partner(domain, '/robot')
    try:
        with started('monitor', '-p', f'spec:={folder / "b.yaml"}', '-r', '__ns:=/robot',
                     *arguments) as node:
            yield partner, node.process
    finally:
        partner.close()


def wait_for_all(partner: Any, *publishers: Any) -> None:
    """Wait until the monitor is matched with publishers, beside the page that subscribes, too."""
    from ros.harness import wait_until

    def are_all_matched() -> bool:
        listed = [partner.node.get_subscriptions_info_by_topic(item.topic_name)
                  for item in publishers]
        return all(any(info.node_name == 'fret_monitor' for info in infos)
                   and item.get_subscription_count() == len(infos)
                   for item, infos in zip(publishers, listed, strict=True))

    wait_until(are_all_matched, 'the monitor', WAIT_S)
    partner.wait_for_listener(*publishers)


@pytest.mark.parametrize('arguments', [(), ('-p', 'verdicts:=true')])
def test_a_monitor_is_watched_and_reset(
    bundle: Path, domain: int, arguments: tuple[str, ...],
) -> None:
    with robot(bundle, domain, *arguments) as (partner, _), watching(bundle) as watcher:
        from ros.harness import LATCHED
        from std_msgs.msg import Bool, Float64, UInt8
        near = partner.publisher(Bool, '/alpha/near', LATCHED)
        speed, hot = partner.publisher(Float64, 'speed'), partner.publisher(
            UInt8, 'state', LATCHED)
        watcher.wait(lambda: watcher.monitors == ['/robot/fret_monitor'], 'the monitor')
        wait_for_all(partner, speed, hot, near)
        watcher.wait(lambda: 'NEVER' in watcher.health, 'health')
        assert watcher.health['topic /scan'] == (1, 'no publisher')
        hot.publish(UInt8(data=0))  # once: the page gets the last message

        def is_so(value: float, is_true: Callable[[], bool]) -> bool:
            speed.publish(Float64(data=value))  # again: nobody keeps it for the page
            return is_true()

        watcher.wait(lambda: is_so(1.0, lambda: watcher.values.items() >= {
            'speed': 1.0, 'hot': 0}.items()),
                     'values')
        watcher.wait(lambda: watcher.verdicts.get('SLOW-1', [])[-1:] == [True]
                     and watcher.verdicts.get('COOL', [])[-1:] == [True], 'satisfied')
        watcher.wait(lambda: is_so(2.25, lambda: watcher.values['speed'] == 2.25), 'the speed')
        hot.publish(UInt8(data=7))
        watcher.wait(lambda: [watcher.verdicts[name][-1] for name in ('SLOW-1', 'COOL')]
                     == [False, False] and len(watcher.occurrences) == 2, 'violated')
        found = {item['id']: item for item in watcher.occurrences}
        assert ['speed', '2.25'] in found['SLOW-1']['values']
        assert ['hot', 'HOT'] in found['COOL']['values']
        assert found['SLOW-1']['text'] == 'not too fast' and not found['SLOW-1']['isOver']
        assert watcher.verdicts.get('NEVER', [None])[-1] is None
        hot.publish(UInt8(data=0))
        watcher.wait(lambda: watcher.verdicts['COOL'][-1] is True
                     and any(item['isOver'] for item in watcher.occurrences), 'over')
        assert 'FAR[robot=alpha]' not in watcher.verdicts
        near.publish(Bool(data=True))
        watcher.wait(lambda: watcher.verdicts.get('FAR[robot=alpha]') == [False], 'the instance')
        near.publish(Bool(data=False))
        watcher.wait(lambda: watcher.verdicts['FAR[robot=alpha]'] == [False, True], 'its end')
        watcher.ask('reset', node='/robot/other')  # none that is watched
        watcher.ask('reset', node='/robot/fret_monitor')
        watcher.wait(lambda: watcher.told.startswith('restarted')
                     and watcher.verdicts['FAR[robot=alpha]'][-1] is None, 'the reset')


AXIS = """[...document.querySelectorAll('#live-rows .axis')[0].children].map(
    (each) => each.textContent)"""
SLOW, SPEED = '.lane[aria-label^="SLOW-1"]', '.lane[aria-label^="speed:"]'


def looks(page: Page, selector: str) -> Any:
    """Return the classes of what a row draws, as one text."""
    return page.get(f"""[...document.querySelectorAll('#watch {selector} rect')]
        .map((each) => each.classList.contains('is-true') ? 1 : 0).join('')""")


@pytest.mark.skipif(CHROMIUM is None, reason='needs Chromium')
def test_a_violation_is_seen_as_it_comes_up(
    bundle: Path, domain: int, page: Page,
) -> None:
    with robot(bundle, domain) as (partner, monitor), studio(bundle, 'b.yaml') as url:
        from std_msgs.msg import Float64
        speed = partner.publisher(Float64, 'speed')
        page.open(url)
        page.wait('!!document.body.dataset.checked')
        page.get("document.querySelector('#live-connect').focus()")
        page.key('Enter')
        # None is in this namespace: how one is started, and where another is.
        page.wait("document.querySelector('#live-status button')?.textContent === 'Watch /robot'")
        assert page.text('#live-status pre') == (
            f'ros2 run fret_monitor monitor --ros-args -p spec:={bundle / "b.yaml"}')
        page.get("document.querySelector('#live-status button').focus()")
        page.key('Enter')
        page.wait("document.querySelector('#live-status').textContent"
                  " === 'watching /robot/fret_monitor'")
        assert 'depth' in page.text('#live-note')
        partner.wait_for_listener(speed)
        while page.get(f"document.querySelector('#watch {SPEED}').ariaLabel") != 'speed: 0.5':
            speed.publish(Float64(data=0.5))  # until the page has found the topic
            sleep(0.1)
        page.wait(f"""document.querySelector('#watch {SLOW}').ariaLabel === 'SLOW-1: satisfied'""")
        speed.publish(Float64(data=2.0))
        page.wait(f"""document.querySelector('#watch {SLOW}').ariaLabel === 'SLOW-1: violated'""")
        page.wait("document.querySelector('#live-occurrences').textContent.includes('speed = 2')")
        page.get(f"document.querySelector('#watch {SLOW}').scrollIntoView()")
        page.wait(f"document.querySelectorAll('#watch {SLOW} rect').length === 2")
        assert looks(page, SLOW) == '10'
        assert page.get(AXIS) == ['2.19', '0.313']  # of 0.5 to 2
        page.wait("/no publisher/.test(document.querySelector('#live-health').textContent)")
        assert '=>' not in page.get('document.body.innerText')  # a function in place of a word
        # A pause holds the picture, and what came meanwhile is there afterwards.
        page.click('#live-pause')
        speed.publish(Float64(data=1.0))
        page.wait("document.querySelectorAll('#live-occurrences li').length === 2")
        drawn = page.get("document.querySelector('#watch').dataset.drawn")
        page.wait(f"Number(document.querySelector('#watch').dataset.drawn) > {drawn} + 3")
        assert looks(page, SLOW) == '10'
        page.click('#live-pause')
        page.wait(f"document.querySelectorAll('#watch {SLOW} rect').length === 3")
        page.click('#live-reset')
        page.wait("/^restarted/.test(document.querySelector('#live-status').textContent)")
        speed.publish(Float64(data=2.0))
        page.wait(f"""document.querySelector('#watch {SLOW}').ariaLabel === 'SLOW-1: violated'""")
        monitor.send_signal(SIGINT)  # what it said holds no longer
        page.wait(f"""document.querySelector('#watch {SLOW}').ariaLabel === 'SLOW-1: not known'""")
        page.wait("/^No monitor/.test(document.querySelector('#live-status').textContent)"
                  " && document.querySelector('#live-health').textContent === ''")
        # On a telephone nothing is wider than the screen.
        page.call('Emulation.setDeviceMetricsOverride', width=390, height=800,
                  deviceScaleFactor=1, mobile=True)
        assert page.get('document.documentElement.scrollWidth') <= 390
        page.click('#live-connect')
        page.wait("document.querySelector('#live-status').textContent"
                  " === 'No monitor is watched.'")
        assert page.problems == []


COUNTING = """
window.WebSocket = class extends WebSocket {
  constructor(...given) {
    super(...given);
    this.addEventListener('message', () => { window.came = (window.came ?? 0) + 1; });
  } };"""


class Flood(Thread):
    """Publishes at 1 kHz, as well as the machine can; `count` are sent."""

    def __init__(self, publisher: Any) -> None:
        super().__init__(daemon=True)
        self._publisher, self._is_over, self.count = publisher, Event(), 0

    def __enter__(self) -> 'Flood':
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._is_over.set()
        self.join()

    def run(self) -> None:
        from std_msgs.msg import Float64
        begin = monotonic()
        while not self._is_over.wait(max(0.0, begin + self.count / 1000 - monotonic())):
            self.count += 1
            self._publisher.publish(Float64(data=self.count % 100 / 100))


def processor_s(process: Any) -> float:
    """Return the processor time that a process has taken."""
    fields = Path(f'/proc/{process.pid}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


@thorough
@pytest.mark.skipif(CHROMIUM is None, reason='needs Chromium')
def test_a_topic_of_1_khz_is_watched_for_a_minute(
    bundle: Path, domain: int, page: Page,
) -> None:
    with robot(bundle, domain) as (partner, monitor), studio(bundle, 'b.yaml') as url:
        from std_msgs.msg import Float64
        speed = partner.publisher(Float64, 'speed')
        page.call('Page.addScriptToEvaluateOnNewDocument', source=COUNTING)
        page.open(url)
        page.wait('!!document.body.dataset.checked')
        partner.wait_for_listener(speed)
        with Flood(speed) as flood:
            _watch_for_a_minute(page, monitor, flood)
        assert page.problems == []


def _watch_for_a_minute(page: Page, monitor: Any, flood: Flood) -> None:
    def cost(seconds: int) -> float:
        """Return the processor time (s) of the monitor for a message."""
        count, taken = flood.count, processor_s(monitor)
        for _ in range(seconds):
            sleep(1)
            page.get('0')  # reads what the browser tells of frames
        return (processor_s(monitor) - taken) / (flood.count - count)

    def size() -> tuple[int, int]:
        """Return the bytes and the elements of the page."""
        page.call('HeapProfiler.collectGarbage')
        return (page.call('Runtime.getHeapUsage')['usedSize'],
                page.call('Memory.getDOMCounters')['nodes'])

    alone = cost(15)
    page.get("document.querySelector('#live-namespace').value = '/robot'; "
             "document.querySelector('#live-connect').click()")
    page.see(f'#watch {SPEED}')
    page.get(f"document.querySelector('#watch {SPEED}').scrollIntoView()")
    page.wait(f"document.querySelector('#watch {SPEED} path')?.getAttribute('d').length > 1000")
    cost(10)
    shown = "Number(document.querySelector('#watch').dataset.drawn)"
    before, begin = size(), monotonic()
    came, drawn = page.get(f'[window.came, {shown}]')
    watched = cost(60)
    seconds = monotonic() - begin
    came, drawn = page.get(f'[window.came - {came}, {shown} - {drawn}]')
    after = size()
    print(f'{flood.count} messages; {alone * 1e6:.1f} and {watched * 1e6:.1f} us a message; '
          f'{came / seconds:.1f} and {drawn / seconds:.1f} a second; {before}, {after}')
    assert 60 <= came <= 20 * seconds and 60 <= drawn <= 20 * seconds
    assert watched < 1.25 * alone + 20e-6
    assert after[0] < before[0] + 1_500_000 and after[1] < before[1] + 3_000


@pytest.mark.skipif(CHROMIUM is None, reason='needs Chromium')
def test_an_instance_has_a_row_from_its_first_violation_on(
    folder: Path, url: str, page: Page,
) -> None:
    (folder / 'b.yaml').write_text(BUNDLE)
    page.open(url)
    page.see('#drawn .node')  # the page's own picture, which this one replaces
    page.get("""(async () => {
        const { LiveView } = await import('./live.js');
        const [talk, place] = [new EventTarget(), document.querySelector('#watch')];
        const plan = { inputs: [], leftOut: [], requirements: [{ id: 'FAR' }, { id: 'B' }] };
        const { Picture } = await import('./picture.js');
        const nodes = [['requirement', 'FAR'], ['requirement', 'B'], ['topic', 'near'],
          ['topic', '/far']].map(([kind, name]) => ({ kind, name, detail: '', from: null }));
        window.picture = new Picture(
          document.querySelector('#drawn'), async () => ({ nodes, links: [] }), () => null);
        picture.use();
        new LiveView(place, async () => plan, talk, (...names) => picture.mark(...names));
        place.querySelector('#live-connect').click();
        window.tell = (verdicts, more) => talk.dispatchEvent(
          new CustomEvent('live', { detail: { verdicts, ...more } })); })()""")
    page.wait("document.querySelectorAll('#drawn .node').length === 4")
    page.wait("document.querySelectorAll('#live-rows .lane').length === 2")
    page.get("""tell({ FAR: [[Date.now() - 500, false]], 'NO[k=1]': [[Date.now(), true]],
        'FAR[robot=alpha]': [[Date.now() - 500, false]] }, { 'health /m': [
          { name: 'topic /alpha/near', level: 1, values: [] },
          { name: 'topic /so/far', level: 0, values: [] }] })""")
    rows = "[...document.querySelectorAll('#live-rows .name')].map((each) => each.textContent)"
    assert page.get(rows) == ['FAR', 'FAR[robot=alpha]', 'B']
    broken = """[...document.querySelectorAll('#drawn .broken')].map(
        (each) => each.ariaLabel.split(';')[0] + each.ariaLabel.split(';').at(-1))"""
    assert page.get(broken) == ['requirement FAR broken now', 'topic near broken now']
    assert page.get("""[...document.querySelectorAll('#drawn .node text')].map(
        (each) => each.textContent)""") == ['! FAR', 'B', '! near', '/far']
    page.get('tell({ FAR: [[Date.now(), true]] }); 0')
    assert page.get(broken)[0] == 'requirement FAR broken now'  # the instance
    lane = '#live-rows .lane[aria-label^="FAR[robot=alpha]"]'
    page.wait(f"document.querySelector('{lane}')?.ariaLabel.endsWith('violated')")
    page.get(f"document.querySelector('{lane}').scrollIntoView()")
    page.wait(f"!!document.querySelector('{lane} rect.is-false')")
    # Beside a row is its value where the pointer is.
    shown = f"document.querySelector('{lane}').nextElementSibling.textContent"
    page.wait(f"{shown} === 'violated'")
    page.mouse('mouseMoved', page.point(lane, 0.1))
    page.wait(f"{shown} === 'not known' && !!document.querySelector('{lane} line.pointed')")
    page.mouse('mouseMoved', page.point('#live-title'))
    page.wait(f"{shown} === 'violated'")
    page.get("tell({ 'FAR[robot=alpha]': [[Date.now(), null]] }); 0")
    assert page.get(broken) == ['topic near broken now']
    page.wait(f"{shown} === 'not known'")
    assert page.problems == []


@pytest.mark.skipif(CHROMIUM is None, reason='needs Chromium')
def test_what_the_page_keeps_of_a_long_run_is_bounded(folder: Path, url: str, page: Page) -> None:
    (folder / 'b.yaml').write_text(BUNDLE)
    page.open(url)
    found = page.get("""(async () => {
        const { History } = await import('./live.js');
        const history = new History();
        for (let k = 0; k < 100000; k += 1) history.add(k * 100, k % 7);
        history.add(9999999, 99999 % 7); // no change
        const view = { first: 9700000, count: 300000 };
        return [history.changes.length, history.changes[0][0], history.thinned(view).length,
          history.at(9999950)];
    })()""")
    assert found == [3002, 9699800, found[2], 99999 % 7]
    assert 300 <= found[2] <= 1200
