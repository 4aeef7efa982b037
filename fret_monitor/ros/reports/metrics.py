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
The figures of `/diagnostics` for Prometheus, over HTTP (docs/ros_interface.md, Metrics).

Needs prometheus-client (extra `metrics`). The server answers `GET /metrics` and nothing else, in
threads of its own; it reads what `MetricsServer.show` was given last.
"""

from collections.abc import Iterable, Iterator
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from ipaddress import ip_address
import re
import socket
from threading import BoundedSemaphore, Thread
from typing import Any

from fret_monitor.ros.settings.parameters import MetricsAddress, Refusal
from fret_monitor.runtime.reporting import StatusRecord

try:
    from prometheus_client import CollectorRegistry, generate_latest
    from prometheus_client.core import Metric
    from prometheus_client.exposition import CONTENT_TYPE_LATEST
except ImportError:
    raise Refusal("parameter 'metrics' needs the package prometheus-client: "
                  "pip install 'fret-monitor[metrics]', or rosdep's python3-prometheus-client"
                  ) from None

_PREFIX = 'fret_monitor_'
_OF_INPUT = ('silences', 'unusable')  # the name of an input follows
_GAUGES = frozenset({
    'behind', 'estimated probability', 'instances', 'margin', 'period', 'publishers', 'rate',
    'seen', 'status', 'verdict', 'violated'})
_HELP = {'status': '0: OK, 1: WARN, 2: ERROR'}
_TRUTHS = {'true': 1.0, 'false': 0.0}
_MOST_CONNECTIONS = 8
_PATIENCE_S = 5.0


def families(statuses: Iterable[StatusRecord]) -> list[Metric]:
    """
    Return the levels and the numbers of statuses; texts are left out.

    Labels are the node, the name of the status behind it, and of some the input.
    """
    found: dict[str, Metric] = {}
    for status in statuses:
        node, _, name = status.name.partition(': ')
        for key, value in (('status', float(status.level)), *_numbers(status)):
            kind = next((item for item in _OF_INPUT if key.startswith(f'{item} ')), key)
            labels = {'node': node, 'name': name}
            if kind != key:
                labels['input'] = key.removeprefix(f'{kind} ')
            _add(found, kind, labels, value)
    return list(found.values())


def _add(found: dict[str, Metric], kind: str, labels: dict[str, str], value: float) -> None:
    title = _PREFIX + re.sub(r'\W+', '_', kind)
    is_gauge = kind in _GAUGES
    if kind not in found:
        found[kind] = Metric(title, _HELP.get(kind, f"'{kind}' in /diagnostics"),
                             'gauge' if is_gauge else 'counter')
    found[kind].add_sample(title if is_gauge else f'{title}_total', labels, value)


def _numbers(status: StatusRecord) -> Iterator[tuple[str, float]]:
    for key, text in status.values:
        with suppress(ValueError):
            yield key, _TRUTHS[text] if text in _TRUTHS else float(text)


class MetricsServer(ThreadingHTTPServer):
    """Serves the figures that were shown last, until it is closed."""

    daemon_threads = True

    def __init__(self, address: MetricsAddress) -> None:
        """Listen, and serve nothing yet; raises `Refusal` if the address cannot be listened on."""
        self._statuses: tuple[StatusRecord, ...] = ()
        self._room = BoundedSemaphore(_MOST_CONNECTIONS)
        try:
            found, *_ = socket.getaddrinfo(
                address.host, address.port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
            self.address_family, host = found[0], str(found[4][0])
            super().__init__((host, address.port), _Handler)
        except OSError as error:
            raise Refusal(f"parameter 'metrics': cannot listen on {address}: "
                          f'{error.strerror or error}') from None
        self._is_local = ip_address(host.partition('%')[0]).is_loopback
        self.url = f'http://{MetricsAddress(address.host, self.server_address[1])}/metrics'
        self._thread = Thread(target=self.serve_forever, name='metrics', daemon=True)
        self._thread.start()

    def server_bind(self) -> None:
        """Bind the socket; the name of the host is not looked up."""
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self.socket.bind(self.server_address)
        self.server_address = self.socket.getsockname()

    def show(self, statuses: Iterable[StatusRecord]) -> None:
        """Serve these figures from now on."""
        self._statuses = tuple(statuses)

    def text(self) -> bytes:
        registry = CollectorRegistry()
        registry.register(self)
        return bytes(generate_latest(registry))

    def collect(self) -> list[Metric]:
        return families(self._statuses)

    def may_ask(self, host: str) -> bool:
        """
        Whether a request for a host is answered.

        On an address of this machine alone, pages of other sites could reach it under their name.
        """
        name = re.sub(r':\d+$', '', host)
        return not self._is_local or name in ('localhost', '127.0.0.1', '[::1]')

    def process_request(self, request: Any, client_address: Any) -> None:
        """Answer in a thread, unless too many are answered now."""
        if self._room.acquire(blocking=False):
            super().process_request(request, client_address)
        else:
            self.shutdown_request(request)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._room.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Forget a connection that failed."""

    def close(self) -> None:
        """Stop, and free the address."""
        self.shutdown()
        self.server_close()
        self._thread.join()


class _Handler(BaseHTTPRequestHandler):
    server: MetricsServer
    timeout = _PATIENCE_S

    def do_GET(self) -> None:
        if not self.server.may_ask(self.headers.get('Host', '')) or 'Origin' in self.headers:
            self._answer(403, b'refused\n')
        elif self.path.partition('?')[0] == '/metrics':
            self._answer(200, self.server.text(), CONTENT_TYPE_LATEST)
        else:
            self._answer(404, b'figures are at /metrics\n')

    def _answer(self, status: int, text: bytes, kind: str = 'text/plain; charset=utf-8') -> None:
        self.send_response_only(status)
        for name, value in (('Content-Type', kind), ('Content-Length', str(len(text))),
                            ('Cache-Control', 'no-store'), ('X-Content-Type-Options', 'nosniff'),
                            ('Content-Security-Policy', "default-src 'none'")):
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(text)

    def log_message(self, format: str, *arguments: Any) -> None:
        pass
