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
A headless Chromium, driven over the DevTools protocol.

Nothing but the address of the page is reached: all other names are not found.
"""

from base64 import b64decode
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
import json
from pathlib import Path
import shutil
import subprocess
import time
from typing import Any

CHROMIUM = next(filter(None, map(shutil.which, (
    'chromium', 'chromium-browser', 'google-chrome'))), None)
WAIT_S = 150.0
NAVIGATED = -32000  # a code of the protocol
KEYS = {'ArrowRight': 39, 'ArrowLeft': 37, ' ': 32, 'Enter': 13, 'Tab': 9, 'Escape': 27}


def called(socket: Any, number: int, method: str, parameters: dict[str, Any],
           note: Callable[[dict[str, Any]], None]) -> Any:
    """Return the result of a command of the protocol; give `note` what comes before it."""
    socket.send(json.dumps({'id': number, 'method': method, 'params': parameters}))
    while (found := json.loads(socket.recv(WAIT_S))).get('id') != number:
        note(found)
    if found.get('error', {}).get('code') == NAVIGATED:
        raise Navigated(found['error']['message'])
    assert 'error' not in found, found
    return found['result']


class Navigated(Exception):
    """The page was left before it answered."""


class Page:
    """A page; what goes wrong in it is in `problems`."""

    def __init__(self, socket: Any, context: str) -> None:
        self._socket = socket
        self._next = 0
        self.context = context
        self.problems: list[str] = []
        for domain in ('Page', 'Runtime', 'Log', 'Network'):
            self.call(f'{domain}.enable')

    def call(self, method: str, **parameters: Any) -> Any:
        """Return the result of a command of the protocol."""
        self._next += 1
        return called(self._socket, self._next, method, parameters, self._note)

    def _note(self, found: dict[str, Any]) -> None:
        match found:
            case {'method': 'Page.javascriptDialogOpening'}:  # leaves a page with unsaved text
                self._socket.send(json.dumps({
                    'id': -1, 'method': 'Page.handleJavaScriptDialog',
                    'params': {'accept': True}}))
            case {'method': 'Runtime.exceptionThrown', 'params': parameters}:
                self.problems.append(json.dumps(parameters['exceptionDetails']))
            case {'method': 'Runtime.consoleAPICalled', 'params': {'type': 'error', **rest}}:
                self.problems.append(json.dumps(rest))
            case {'method': 'Log.entryAdded', 'params': {'entry': entry}} if (
                    entry['level'] == 'error'):
                self.problems.append(entry['text'])

    def open(self, url: str) -> None:
        """Go to an address."""
        self.call('Page.navigate', url=url)
        self.wait('document.readyState === "complete"')

    def get(self, code: str) -> Any:
        """Return the value of an expression in the page."""
        found = self.call('Runtime.evaluate', expression=code, returnByValue=True,
                          awaitPromise=True)
        assert 'exceptionDetails' not in found, found
        return found['result'].get('value')

    def wait(self, code: str, what: str = '') -> Any:
        """Return the value of an expression when it is true."""
        end = time.monotonic() + WAIT_S
        while not (value := self._found(code)):
            assert time.monotonic() < end, what or code
            time.sleep(0.05)
        return value

    def _found(self, code: str) -> Any:
        """Return the value of an expression; None if the page is left for another one."""
        try:
            return self.get(code)
        except Navigated:
            return None

    def see(self, selector: str) -> None:
        """Wait for an element."""
        self.wait(f'!!document.querySelector({json.dumps(selector)})', selector)

    def text(self, selector: str) -> str:
        """Return the text of an element."""
        self.see(selector)
        return str(self.get(f'document.querySelector({json.dumps(selector)}).textContent'))

    def point(self, selector: str, across: float = 0.5, down: float = 0.5) -> tuple[float, float]:
        """Return a point in an element, by parts of its width and height."""
        box = self.wait(f"""(() => {{
            const found = document.querySelector({json.dumps(selector)});
            if (!found) return null;
            found.scrollIntoView({{ block: 'center' }});
            const box = found.getBoundingClientRect();
            return [box.x, box.y, box.width, box.height]; }})()""", selector)
        return box[0] + across * box[2], box[1] + down * box[3]

    def mouse(self, kind: str, point: tuple[float, float]) -> None:
        """Press, move or release the left button."""
        self.call('Input.dispatchMouseEvent', type=kind, x=point[0], y=point[1], button='left',
                  buttons=0 if kind == 'mouseReleased' else 1, clickCount=1)

    def click(self, selector: str, across: float = 0.5) -> None:
        """Click on an element."""
        point = self.point(selector, across)
        self.mouse('mousePressed', point)
        self.mouse('mouseReleased', point)

    def drag(self, selector: str, begin: tuple[float, float], end: tuple[float, float]) -> None:
        """Drag inside of an element; points are parts of its width and height."""
        self.mouse('mousePressed', self.point(selector, *begin))
        for part in (0.5, 1.0):
            self.mouse('mouseMoved', self.point(selector, *(
                start + part * (stop - start)
                for start, stop in zip(begin, end, strict=True))))
        self.mouse('mouseReleased', self.point(selector, *end))

    def key(self, key: str, modifiers: int = 0) -> None:
        """Press a key."""
        text = {'text': '\r' if key == 'Enter' else key} if key in (' ', 'Enter') else {}
        for kind in ('keyDown', 'keyUp'):
            self.call('Input.dispatchKeyEvent', type=kind, key=key, code=key,
                      windowsVirtualKeyCode=KEYS.get(key, ord(key[0].upper())),
                      modifiers=modifiers, **(text if kind == 'keyDown' else {}))

    def type(self, text: str) -> None:
        """Type a text where the cursor is."""
        self.call('Input.insertText', text=text)

    def screen(self, path: Path, width: int = 1400, height: int = 1000, *,
               is_dark: bool = False) -> None:
        """Write a picture of the page."""
        self.call('Emulation.setDeviceMetricsOverride', width=width, height=height,
                  deviceScaleFactor=1, mobile=False)
        self.call('Emulation.setEmulatedMedia', features=[
            {'name': 'prefers-color-scheme', 'value': 'dark' if is_dark else 'light'}])
        found = self.call('Page.captureScreenshot', format='png', captureBeyondViewport=True)
        path.write_bytes(b64decode(found['data']))

    def shoot(self, path: Path, selector: str) -> None:
        """Write a picture of an element."""
        x, y, width, height = self.get(f"""(() => {{
            const box = document.querySelector({json.dumps(selector)}).getBoundingClientRect();
            return [box.x + scrollX, box.y + scrollY, box.width, box.height]; }})()""")
        found = self.call('Page.captureScreenshot', format='png', captureBeyondViewport=True,
                          clip={'x': x, 'y': y, 'width': width, 'height': height, 'scale': 1})
        path.write_bytes(b64decode(found['data']))


@dataclass(frozen=True)
class Chromium:
    """A running Chromium, whose pages share nothing, unless they are asked to."""

    port: int
    _browser: Any

    @contextmanager
    def page(self) -> Iterator[Page]:
        """Open a page in a window with a storage of its own."""
        context = self._call('Target.createBrowserContext')['browserContextId']
        try:
            with self.tab(context) as page:
                yield page
        finally:
            self._call('Target.disposeBrowserContext', browserContextId=context)

    @contextmanager
    def tab(self, context: str) -> Iterator[Page]:
        """Open a page that shares the storage of others; it is closed at the end."""
        target = self._call('Target.createTarget', url='about:blank', browserContextId=context,
                            newWindow=True)['targetId']
        try:
            with _connected(f'ws://127.0.0.1:{self.port}/devtools/page/{target}') as socket:
                page = Page(socket, context)
                page.call('Emulation.setDeviceMetricsOverride', width=1400, height=1000,
                          deviceScaleFactor=1, mobile=False)
                page.call('Emulation.setFocusEmulationEnabled', enabled=True)
                yield page
        finally:
            self._call('Target.closeTarget', targetId=target)

    def _call(self, method: str, **parameters: Any) -> Any:
        return called(self._browser, 0, method, parameters, lambda found: None)


@contextmanager
def chromium(profile: Path) -> Iterator[Chromium]:
    """Start a Chromium."""
    assert CHROMIUM is not None
    process = subprocess.Popen(
        [CHROMIUM, '--headless', '--no-sandbox', '--disable-gpu', '--disable-extensions',
         '--remote-debugging-port=0', f'--user-data-dir={profile}', '--window-size=1400,1000',
         '--no-first-run', '--disable-background-networking', '--disable-component-update',
         '--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1', 'about:blank'],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        end = time.monotonic() + WAIT_S
        note = profile / 'DevToolsActivePort'
        while not note.exists() or note.read_text().count('\n') < 1:
            assert process.poll() is None and time.monotonic() < end, 'Chromium does not start'
            time.sleep(0.05)
        port, path = note.read_text().splitlines()[:2]
        with _connected(f'ws://127.0.0.1:{port}{path}') as socket:
            yield Chromium(int(port), socket)
    finally:
        process.terminate()
        process.wait(WAIT_S)


@contextmanager
def browser(profile: Path) -> Iterator[Page]:
    """Start a Chromium with one page."""
    with chromium(profile) as found, found.page() as page:
        yield page


def _connected(address: str) -> Any:
    from websockets.sync.client import connect  # of the extra `studio`
    return connect(address, max_size=None)
