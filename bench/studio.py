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
`check` is taken. What the browser takes to draw is not in it.
"""

from argparse import ArgumentParser
from collections.abc import Callable
import json
from pathlib import Path
from tempfile import TemporaryDirectory
import time
from typing import Any
from urllib.parse import urlsplit

from bench.editor import bundle, shown
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


def main() -> None:
    """Click and type, and print the times."""
    parser = ArgumentParser(description='From a click to the verdicts.')
    parser.add_argument('--requirements', type=int, default=100)
    parser.add_argument('--steps', type=int, default=10_000)
    parser.add_argument('--rounds', type=int, default=100)
    options = parser.parse_args()
    text = bundle(options.requirements)
    with TemporaryDirectory() as name, studio(Path(name), '--port', '0') as url:
        place = urlsplit(url)
        with connect(f'ws://{place.netloc}{place.path}talk', max_size=None,
                     origin=Origin(f'http://{place.netloc}')) as socket:
            for title, question in (
                    ('click to verdicts', _clicks(text, options.steps)),
                    ('key to diagnostics', _keys(text))):
                _asked(socket, question(0))  # compiles
                times = [_asked(socket, question(number))
                         for number in range(1, options.rounds + 1)]
                print(shown(title, times, 'times'))


if __name__ == '__main__':
    main()
