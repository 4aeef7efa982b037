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

"""
From a click to the verdicts, in the page of studio: `PYTHONPATH=.:test python -m bench.studio`.

The bundle of `bench.editor` is open on a trace of 10,000 steps. One step of an input is changed
after another, as by a click, and after each the time until the verdicts of all requirements come
back over the WebSocket; in other rounds, one character is typed, and the time until the answer to
`check` is taken. The processor time is that of the server and the processes that it has started.
With `--browser`, a headless Chromium has the page open: the time is from the key Enter, behind a
value, until the verdicts are drawn, and the processor time is that of the browser, too.
"""

from argparse import ArgumentParser
from collections.abc import Callable
from contextlib import suppress
from functools import partial
import json
import os
from pathlib import Path
from tempfile import TemporaryDirectory
import time
from typing import Any
from urllib.parse import urlsplit

from bench.editor import bundle, shown
from studio.browser import browser
from studio.serving import studio
from websockets.sync.client import connect
from websockets.typing import Origin

_TYPED = ' & speed_7 > 0.5'


def _asked(socket: Any, question: dict[str, Any]) -> float:
    """Return the seconds until the answer to a question."""
    begin = time.perf_counter()
    socket.send(json.dumps({'number': 1, 'name': 'b.yaml', **question}))
    found = json.loads(socket.recv(600))
    assert 'answer' in found, found
    return time.perf_counter() - begin


def _clicks(text: str, steps: int) -> Callable[[int], dict[str, Any]]:
    def question(number: int) -> dict[str, Any]:
        return {'do': 'simulate', 'text': text, 'steps': steps, 'period': 0.1, 'values': {
            'speed_0': [[0, 0.0], [17 * number % steps, 1.75], [steps - 1, 0.0]]}}

    return question


def _keys(text: str) -> Callable[[int], dict[str, Any]]:
    place = text.index('!fast') + len('!fast')

    def question(number: int) -> dict[str, Any]:
        typed = _TYPED[:1 + number % len(_TYPED)]
        return {'do': 'check', 'text': text[:place] + typed + text[place:]}

    return question


def _processor_s() -> float:
    """Return the processor time of all processes that this one has started."""
    found = {}
    for path in Path('/proc').glob('[0-9]*/stat'):
        with suppress(OSError):
            fields = path.read_text().rpartition(')')[2].split()
            found[int(path.parent.name)] = int(fields[1]), sum(map(int, fields[11:15]))
    own, below = {os.getpid()}, 0
    while len(own) > below:
        below = len(own)
        own |= {process for process, (parent, _) in found.items() if parent in own}
    return sum(ticks for process, (_, ticks) in found.items()
               if process in own - {os.getpid()}) / os.sysconf('SC_CLK_TCK')


def _print(title: str, times: Callable[[], list[float]]) -> None:
    before = _processor_s()
    found = times()
    print(shown(title, found, 'times'))
    taken = (_processor_s() - before) / len(found)
    print(f'{"  processor time":<28} mean   {1000 * taken:6.1f} ms')


_CLICK = """(async () => {
    const trace = document.querySelector('#trace');
    document.querySelector('.lane[aria-label^="speed_0,"]').focus();
    const [value, before] = [document.querySelector('#value'), trace.dataset.judged];
    value.value = %s;
    const begin = performance.now();
    value.dispatchEvent(new KeyboardEvent('keydown', { key: 'Enter' }));
    while (trace.dataset.judged === before) await new Promise((go) => setTimeout(go, 1));
    await new Promise((go) => requestAnimationFrame(() => setTimeout(go, 0)));
    return (performance.now() - begin) / 1000; })()"""


def _in_browser(folder: Path, url: str, steps: int, rounds: int) -> None:
    """Change a value in the page again and again, and print the times until it has drawn."""
    with browser(folder / 'profile') as page:
        begin = time.perf_counter()
        page.open(url)
        page.wait('!!document.body.dataset.checked')
        print(f'{"opened, usable after":<28} {time.perf_counter() - begin:13.1f} s')
        judged = "Number(document.querySelector('#trace').dataset.judged ?? 0)"
        page.wait(f'{judged} > 0')
        page.get(f"document.querySelector('#steps').value = {steps}; document.querySelector("
                 "'#steps').dispatchEvent(new Event('change'));")
        page.wait(f'{judged} > 1')
        _print('click to verdicts drawn', lambda: [
            page.get(_CLICK % (1.5 + number % 2)) for number in range(rounds)])
        assert page.problems == []


def main() -> None:
    """Click and type, and print the times."""
    parser = ArgumentParser(description='From a click to the verdicts.')
    parser.add_argument('--requirements', type=int, default=100)
    parser.add_argument('--steps', type=int, default=10_000)
    parser.add_argument('--rounds', type=int, default=100)
    parser.add_argument('--browser', action='store_true')
    options = parser.parse_args()
    text = bundle(options.requirements)
    with TemporaryDirectory() as name:
        (Path(name) / 'b.yaml').write_text(text)
        with studio(Path(name), 'b.yaml') as url:
            if options.browser:
                _in_browser(Path(name), url, options.steps, options.rounds)
            else:
                _over_the_socket(url, text, options.steps, options.rounds)


def _over_the_socket(url: str, text: str, steps: int, rounds: int) -> None:
    place = urlsplit(url)
    with connect(f'ws://{place.netloc}{place.path}talk', max_size=None,
                 origin=Origin(f'http://{place.netloc}')) as socket:
        for title, question in (('click to verdicts', _clicks(text, steps)),
                                ('key to diagnostics', _keys(text))):
            _asked(socket, question(0))  # compiles
            _print(title, partial(_timed, socket, question, rounds))


def _timed(socket: Any, question: Callable[[int], dict[str, Any]], rounds: int) -> list[float]:
    return [_asked(socket, question(number)) for number in range(1, rounds + 1)]


if __name__ == '__main__':
    main()
