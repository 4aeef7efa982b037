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
The server of `fret-monitor studio`, on 127.0.0.1.

All addresses begin with a token, which only the user's terminal shows; host and origin of a
request are checked, too, so that no other page reaches this server. One WebSocket carries
questions `{number, do, ...}` and answers `{number, answer}` or `{number, error}`;
`{changed: name}` says that a file was changed by somebody else, `{gone: name}` that it cannot be
read any more, `{recordings: names}` which recordings there are now, `{live: ...}` what is new in
a monitor that is watched (`turn.py`).
"""

import asyncio
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from hmac import compare_digest
import json
from pathlib import Path
import secrets
import shlex
import socket
from types import FrameType
from typing import Any

from fret_monitor.studio.folder import Folder, MOST_BYTES
from fret_monitor.studio.live import Live
from fret_monitor.studio.process import Answering, Unanswered
from starlette.applications import Starlette
from starlette.requests import HTTPConnection, Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect
import uvicorn

HOST = '127.0.0.1'
_PAGE = Path(__file__).parent / 'page'
_REPORTS = _PAGE.parents[1] / 'bag'
_OF_REPORTS = {'rows.js': 'rows.js', 'report.css': 'page.css'}  # of the reports of `bag`
_TYPES = {'.css': 'text/css', '.html': 'text/html', '.js': 'text/javascript',
          '.svg': 'image/svg+xml'}
_NONCE = '@NONCE@'
_LOOK_S = 1.0
_MOST_WAITING = 64  # questions of one page
_SLOW = frozenset({'explain', 'simulate', 'example', 'why', 'fixes'})
_OF_RECORDINGS = frozenset({'recording', 'taken'})
_COMPILED = frozenset({'simulate', 'why'})
_RECORDING_S = 120.0
_PREPARING_S = 300.0
_PART_S = 60.0  # of a bundle, which is compiled


@dataclass(frozen=True)
class Address:
    """Where a page is; `token` is a secret of the user."""

    port: int
    token: str

    @property
    def url(self) -> str:
        """The address of the page."""
        return f'http://{HOST}:{self.port}/{self.token}/'

    @property
    def hosts(self) -> tuple[str, ...]:
        """The names under which a browser may know this server."""
        return tuple(f'{name}:{self.port}' for name in (HOST, 'localhost'))

    def is_allowed(self, request: HTTPConnection) -> bool:
        """Whether a request comes from the page, or from the user who opens it."""
        host = request.headers.get('host', '')
        origin = request.headers.get('origin')
        given = request.path_params.get('token', '')
        return (host in self.hosts
                and (origin == f'http://{host}'
                     or origin is None and not isinstance(request, WebSocket))
                and compare_digest(given.encode(), self.token.encode()))


def listening(port: int = 0) -> tuple[socket.socket, Address]:
    """Return a socket that listens, with a new token; `OSError` if the port is taken."""
    found = socket.create_server((HOST, port))
    return found, Address(found.getsockname()[1], secrets.token_urlsafe(24))


def serve(folder: Path, bundle: str | None, listener: socket.socket, address: Address,
          begun: Callable[[], None]) -> None:
    """Answer browsers until SIGINT or SIGTERM; call `begun` when a page can be opened."""
    class Server(uvicorn.Server):
        async def startup(self, sockets: list[socket.socket] | None = None) -> None:
            await super().startup(sockets)
            begun()

        def handle_exit(self, sig: int, frame: FrameType | None) -> None:
            if not self.should_exit:  # uvicorn would raise a second one again, within its loop
                super().handle_exit(sig, frame)

    Server(uvicorn.Config(
        application(Folder(folder.resolve()), bundle, address), log_level='warning',
        access_log=False, server_header=False, ws='websockets-sansio',
        ws_max_size=8 * MOST_BYTES, timeout_graceful_shutdown=1,
        limit_concurrency=50)).run([listener])


def application(folder: Folder, bundle: str | None, address: Address) -> Starlette:
    """Return the application; `bundle` is the name of the file that the page opens first."""
    async def page(request: Request) -> Response:
        if not address.is_allowed(request):
            return PlainTextResponse('refused: open the address that the terminal shows', 403)
        return _file(request.path_params.get('name') or 'index.html', address)

    async def talk(connection: WebSocket) -> None:
        if not address.is_allowed(connection):
            await connection.close(1008)
            return
        await connection.accept()
        await Talk(folder, bundle, connection).run()

    return Starlette(routes=[
        WebSocketRoute('/{token}/talk', talk),
        Route('/{token}/', page), Route('/{token}/{name:path}', page),
        Route('/{name:path}', page)])


def _file(name: str, address: Address) -> Response:
    folder = _REPORTS if name in _OF_REPORTS else _PAGE
    path = folder / _OF_REPORTS.get(name, name)
    if not _is_of_page(path, folder):
        return PlainTextResponse('there is no such file', 404)
    nonce = secrets.token_urlsafe(16)
    text = path.read_text(encoding='utf-8').replace(_NONCE, nonce) \
        if path.suffix == '.html' else path.read_bytes()
    return Response(text, headers=_headers(nonce, address), media_type=_TYPES[path.suffix])


def _is_of_page(path: Path, folder: Path) -> bool:
    try:
        found = path.resolve()
        return found.is_relative_to(folder) and found.is_file() and found.suffix in _TYPES
    except (OSError, ValueError):  # a name that is too long, or no name
        return False


def _headers(nonce: str, address: Address) -> Mapping[str, str]:
    sockets = ' '.join(f'ws://{host}' for host in address.hosts)
    return {
        'Content-Security-Policy':
            # CodeMirror sets attributes `style`; elements need the nonce.
            f"default-src 'none'; script-src 'self'; style-src 'self' 'nonce-{nonce}'; "
            "style-src-attr 'unsafe-inline'; "
            f"img-src 'self' data:; connect-src 'self' {sockets}; base-uri 'none'; "
            "form-action 'none'; frame-ancestors 'none'",
        'Cache-Control': 'no-store',
        'Cross-Origin-Opener-Policy': 'same-origin',
        'Cross-Origin-Resource-Policy': 'same-origin',
        'Referrer-Policy': 'no-referrer',
        'X-Content-Type-Options': 'nosniff',
    }


class Talk:
    """The conversation with one page."""

    def __init__(self, folder: Folder, bundle: str | None, connection: WebSocket) -> None:
        """Store what it is about."""
        self._folder = folder
        self._bundle = bundle
        self._connection = connection
        self._quick = Answering(folder.root)
        self._slow = Answering(folder.root)
        self._recordings = Answering(folder.root, _RECORDING_S)
        self._live = Live(self._send)
        self._watched: dict[str, str | None] = {}
        self._listed: list[str] | None = None  # recordings, as the page has them
        self._newest: dict[str, int] = {}
        self._sending = asyncio.Lock()

    async def run(self) -> None:
        """Answer until the page is closed."""
        tasks: set[asyncio.Task[None]] = {asyncio.create_task(self._watch())}
        try:
            while True:
                question = json.loads(await self._connection.receive_text())
                if len(tasks) > _MOST_WAITING:
                    await self._send({'number': question['number'], 'error': 'too many questions'})
                    continue
                self._newest[question['do']] = question['number']
                task = asyncio.create_task(self._answer(question))
                tasks.add(task)
                task.add_done_callback(tasks.discard)
        except (WebSocketDisconnect, ValueError, KeyError, TypeError, RuntimeError):
            pass  # the page is gone, or is not our page
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            await asyncio.gather(self._quick.end(), self._slow.end(), self._recordings.end(),
                                 self._live.end())
            with suppress(RuntimeError, WebSocketDisconnect):
                await self._connection.close()

    async def _answer(self, question: dict[str, Any]) -> None:
        do, number = question['do'], question['number']
        try:
            answer = await self._found(do, question)
        except (Unanswered, ValueError) as error:
            await self._send({'number': number, 'error': str(error)})
        except (KeyError, TypeError, AttributeError):
            await self._send({'number': number, 'error': 'this is no question of the page'})
        else:
            await self._send({'number': number, 'answer': answer})

    async def _found(self, do: str, question: dict[str, Any]) -> Any:
        match do:
            case 'open':
                self._listed = self._folder.recordings()
                return {'names': self._folder.names(), 'bundle': self._bundle,
                        'recordings': self._listed,
                        'folder': str(self._folder.root)}
            case 'read':
                stored = self._folder.read(question['name'])
                self._watched = {question['name']: stored.stamp}
                return {'text': stored.text, 'stamp': stored.stamp}
            case 'write':
                stamp = self._folder.write(question['name'], question['text'],
                                           question['stamp'], question.get('like'))
                self._watched = {question['name']: stamp}
                return {'stamp': stamp}
            case 'watch':
                plan = await self._quick.ask({**question, 'do': 'plan'}, lambda: True)
                namespace = str(question['namespace'])
                await self._live.watch({**plan, 'namespace': namespace})
                return {**plan, 'command': self._command(question['name'], namespace)}
            case 'unwatch':
                return await self._live.end()
            case 'reset':
                return await self._live.tell({'reset': str(question['node'])})

        def is_wanted() -> bool:
            return bool(self._newest[do] == question['number'])

        if do in _COMPILED:  # part by part, so that other questions have their turn
            await self._slow.ask({'do': 'prepare'}, is_wanted, _PREPARING_S)
            while do == 'simulate' and await self._slow.ask(
                    {**question, 'do': 'prepare'}, is_wanted, _PART_S):
                pass
        process = self._slow if do in _SLOW else \
            self._recordings if do in _OF_RECORDINGS else self._quick
        return await process.ask(question, is_wanted)

    def _command(self, name: str, namespace: str) -> str | None:
        """Return what starts a monitor of a bundle; None without a file."""
        if self._folder.stamp(name) is None:
            return None
        return shlex.join([
            'ros2', 'run', 'fret_monitor', 'monitor', '--ros-args',
            '-p', f'spec:={self._folder.path(name)}',
            *(['-r', f'__ns:=/{namespace.strip("/")}'] if namespace.strip('/') else [])])

    async def _watch(self) -> None:
        """Tell the page when its file was changed or is gone, or a recording has come."""
        while True:
            await asyncio.sleep(_LOOK_S)
            with suppress(OSError):
                if self._listed not in (None, found := self._folder.recordings()):
                    self._listed = found
                    await self._send({'recordings': found})
            for name, stamp in list(self._watched.items()):
                present = self._folder.stamp(name)
                if present != stamp and self._watched.get(name) == stamp:
                    self._watched[name] = present
                    await self._send({'changed' if present else 'gone': name})

    async def _send(self, answer: dict[str, Any]) -> None:
        async with self._sending:
            with suppress(WebSocketDisconnect, RuntimeError):
                await self._connection.send_text(json.dumps(answer))
