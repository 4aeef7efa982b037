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

"""A client of the language server, over its pipes: JSON-RPC with the protocol's framing."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
import json
import os
from pathlib import Path
from queue import Queue
import subprocess
import sys
from threading import Thread
from typing import Any, BinaryIO

WAIT_S = 300.0  # for an answer, on a machine with much other load

Message = dict[str, Any]


class Refused(Exception):
    """The server has answered with an error: its code and message."""


class Client:
    """An editor with one server; every message that comes is kept until it is asked for."""

    def __init__(self, process: 'subprocess.Popen[bytes]') -> None:
        assert process.stdin is not None and process.stdout is not None
        self.process = process
        self._input = process.stdin
        self._number = 0
        self._answers: Queue[Message] = Queue()
        self._published: Queue[Message] = Queue()
        self.others: list[Message] = []
        self._reader = Thread(target=self._read, args=(process.stdout,), daemon=True)
        self._reader.start()

    def _read(self, output: BinaryIO) -> None:
        while header := output.readline():
            length = 0
            while header.strip():
                name, _, value = header.decode('ascii').partition(':')
                length = int(value) if name.lower() == 'content-length' else length
                header = output.readline()
            message = json.loads(output.read(length))
            if message.get('method') == 'textDocument/publishDiagnostics':
                self._published.put(message['params'])
            elif 'method' in message:
                self.others.append(message)
            else:
                self._answers.put(message)
        self._answers.put({'id': None})  # the server has ended

    def end(self) -> None:
        """End the server as an editor that vanishes does; its output is read to the end."""
        with suppress(OSError):
            self._input.close()
        self.process.wait(timeout=WAIT_S)
        self._reader.join()

    def send(self, message: Mapping[str, Any]) -> None:
        body = json.dumps({'jsonrpc': '2.0', **message}).encode()
        self._input.write(b'Content-Length: %d\r\n\r\n%b' % (len(body), body))
        self._input.flush()

    def notify(self, method: str, **params: Any) -> None:
        self.send({'method': method, 'params': params})

    def begin(self, method: str, **params: Any) -> int:
        """Send a request and return its number."""
        self._number += 1
        self.send({'id': self._number, 'method': method, 'params': params})
        return self._number

    def answer(self, number: int) -> Any:
        """Return the result of a request; raises `Refused`."""
        message = self._answers.get(timeout=WAIT_S)
        assert message['id'] == number, message
        if 'error' in message:
            raise Refused(message['error']['code'], message['error']['message'])
        return message['result']

    def ask(self, method: str, **params: Any) -> Any:
        return self.answer(self.begin(method, **params))

    def diagnostics(self, uri: str, version: int | None) -> list[Message]:
        """Return the diagnostics of a version of a file, once they are published."""
        while True:
            found = self._published.get(timeout=WAIT_S)
            if found['uri'] == uri and found.get('version') == version:
                return list(found['diagnostics'])

    def open(self, uri: str, text: str, version: int = 1) -> None:
        self.notify('textDocument/didOpen', textDocument={
            'uri': uri, 'languageId': 'yaml', 'version': version, 'text': text})

    def replace(self, uri: str, version: int, *changes: tuple[Message | None, str]) -> None:
        """Change a file: texts in place of ranges, None for all of it."""
        self.notify('textDocument/didChange', textDocument={'uri': uri, 'version': version},
                    contentChanges=[{'text': text, **({'range': place} if place else {})}
                                    for place, text in changes])


def at(line: int, character: int) -> Message:
    return {'line': line, 'character': character}


def place_of(text: str, word: str) -> Message:
    """Return the position in the middle of a word, of ASCII alone."""
    before = text[:text.index(word) + len(word) // 2]
    return at(before.count('\n'), len(before) - before.rfind('\n') - 1)


@contextmanager
def started(path: str = '', **capabilities: Any) -> Iterator[Client]:
    """Start a server, and end it at the end as an editor that vanishes does."""
    environment = {**os.environ, **({'PATH': path} if path else {})}
    with subprocess.Popen([sys.executable, '-m', 'fret_monitor', 'lsp'], env=environment,
                          stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                          cwd=Path(__file__).resolve().parents[2]) as process:
        client = Client(process)
        try:
            client.ask('initialize', processId=os.getpid(), rootUri=None,
                       capabilities=capabilities)
            client.notify('initialized')
            yield client
        finally:
            client.end()


@contextmanager
def editor(path: str = '', **capabilities: Any) -> Iterator[Client]:
    """Start a server; `path` replaces PATH. At the end it has to end by itself."""
    with started(path, **capabilities) as client:
        yield client
        client.ask('shutdown')
        client.notify('exit')
        assert client.process.wait(timeout=WAIT_S) == 0
