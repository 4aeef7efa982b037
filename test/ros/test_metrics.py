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

"""The figures of `/diagnostics` over HTTP, as Prometheus reads them."""

from collections.abc import Iterator
from contextlib import closing, ExitStack
from http.client import HTTPConnection
from pathlib import Path
import re
import socket
from urllib.parse import urlsplit

from bundles import spec_of, write_bundle
from fret_monitor.ros.settings.parameters import (
    check_settings, Given, MetricsAddress, Refusal,
)
from fret_monitor.runtime.reporting import StatusRecord
import pytest
from ros.harness import Partner, started, wait_until
from std_msgs.msg import Float32

prometheus = pytest.importorskip('prometheus_client.parser')
metrics = pytest.importorskip('fret_monitor.ros.reports.metrics')

BUNDLE = """
format: 1
inputs:
  x: {topic: x, type: std_msgs/msg/Float32, timeout: 60}
requirements:
  - {id: LOW-1, title: 'x is "low"', ptltl: "x < 0.5", report: occurrence}
"""
STATUSES = (
    StatusRecord(2, 'ns/node: LOW', 'violated', 'bundle', (
        ('steps', '7'), ('verdict', 'false'), ('text', 'x < 0.5'),
        ('estimated probability', ''), ('margin', '-0.5'), ('margin by', 'x < 0.5 (-0.5)'))),
    StatusRecord(0, 'ns/node: topic /x', 'received', 'bundle', (
        ('rate', '2.5'), ('unusable x', '3'), ('silences y', '1'))),
    StatusRecord(0, 'ns/node: links of b', '', 'bundle', (('unusable', '4'), ('too early', '0'))))

Figures = dict[tuple[str, str, str], float]
"""By metric, name and input."""


def read(text: str) -> Figures:
    """Return what Prometheus makes of a text."""
    return {(item.name, item.labels['name'], item.labels.get('input', '')): item.value
            for family in prometheus.text_string_to_metric_families(text)
            for item in family.samples}


def get(url: str, path: str | None = None, method: str = 'GET', **headers: str) -> tuple[int, str]:
    """Return status and text of an answer."""
    place = urlsplit(url)
    with closing(HTTPConnection(place.hostname or '', place.port or 0, timeout=60)) as connection:
        connection.putrequest(method, path or place.path, skip_host='Host' in headers)
        for name, value in headers.items():
            connection.putheader(name, value)
        connection.endheaders()
        answer = connection.getresponse()
        return answer.status, answer.read().decode()


@pytest.fixture
def url() -> Iterator[str]:
    with closing(metrics.MetricsServer(MetricsAddress('127.0.0.1', 0))) as server:
        server.show(STATUSES)
        yield server.url


def test_all_numbers_are_figures_and_no_text_is(url: str) -> None:
    status, text = get(url)
    assert status == 200
    assert read(text) == {
        ('fret_monitor_status', 'LOW', ''): 2, ('fret_monitor_status', 'topic /x', ''): 0,
        ('fret_monitor_status', 'links of b', ''): 0,
        ('fret_monitor_steps_total', 'LOW', ''): 7, ('fret_monitor_verdict', 'LOW', ''): 0,
        ('fret_monitor_margin', 'LOW', ''): -0.5,
        ('fret_monitor_rate', 'topic /x', ''): 2.5,
        ('fret_monitor_unusable_total', 'topic /x', 'x'): 3,
        ('fret_monitor_silences_total', 'topic /x', 'y'): 1,
        ('fret_monitor_unusable_total', 'links of b', ''): 4,
        ('fret_monitor_too_early_total', 'links of b', ''): 0}
    assert 'x < 0.5' not in text and '# TYPE fret_monitor_rate gauge' in text


def test_nothing_else_is_served_and_no_page_of_another_site_can_ask(url: str) -> None:
    port = urlsplit(url).port
    for path in ('/', '/metrics/', '/../etc/passwd', '/metrics2'):
        assert get(url, path)[0] == 404, path
    for headers in ({'Host': 'evil.example'}, {'Host': f'evil.example:{port}'},
                    {'Origin': f'http://127.0.0.1:{port}'}):
        assert get(url, **headers)[0] == 403, headers
    assert get(url, Host=f'localhost:{port}')[0] == 200
    assert get(url, method='POST')[0] == 501


@pytest.mark.parametrize(('patience', 'silent'), [(60.0, 30), (0.2, 1)])
def test_connections_that_say_nothing_are_bounded_and_ended(
    url: str, monkeypatch: pytest.MonkeyPatch, patience: float, silent: int,
) -> None:
    monkeypatch.setattr(metrics._Handler, 'timeout', patience)
    place = (urlsplit(url).hostname, urlsplit(url).port)
    with ExitStack() as stack:
        *_, last = (stack.enter_context(closing(socket.create_connection(place, 30)))
                    for _ in range(silent))
        assert last.recv(1) == b''  # there are too many, or it has said nothing for too long


def test_an_address_that_is_taken_or_none_is_refused(url: str) -> None:
    with pytest.raises(Refusal, match=r'cannot listen on 127\.0\.0\.1:\d+: Address already'):
        metrics.MetricsServer(MetricsAddress('127.0.0.1', urlsplit(url).port or 0))
    for wrong in ('9400', 9400, ':9400', '127.0.0.1', '127.0.0.1:99999', 'a b:1', False):
        given = Given({'metrics': wrong})
        check_settings(given)
        problem, = given.problems
        shown = 'false' if wrong is False else repr(wrong)
        assert problem.startswith(f"parameter 'metrics' is {shown}, and has to be an address")
    given = Given({'metrics': ''})
    assert check_settings(given).metrics is None and given.problems == []
    for text, found in (('[::1]:9400', ('::1', 9400)), ('robot-1:0', ('robot-1', 0))):
        address = check_settings(Given({'metrics': text})).metrics
        assert address is not None and (address.host, address.port) == found
        assert str(address) == text


def test_the_figures_of_a_monitor_are_served_while_it_is_active(
    tmp_path: Path, partner: Partner,
) -> None:
    x = partner.publisher(Float32, 'x')
    with started('monitor', '-p', spec_of(tmp_path, BUNDLE),
                 '-p', 'metrics:=127.0.0.1:0') as monitor:
        found = re.search(r'figures of /diagnostics for Prometheus: (http\S+)', monitor.output)
        assert found is not None, monitor.output
        partner.wait_for_listener(x)
        x.publish(Float32(data=0.9))
        wait_until(lambda: read(get(found[1])[1]).get(
            ('fret_monitor_violations_total', 'LOW-1', '')) == 1, 'the violation')
        figures = read(get(found[1])[1])
        assert figures['fret_monitor_status', 'LOW-1', ''] == 2
        assert figures['fret_monitor_received_total', 'topic /x', ''] == 1
        assert figures['fret_monitor_silences_total', 'topic /x', 'x'] == 0


def test_the_node_in_c_leaves_metrics_to_the_node_in_python(
    tmp_path: Path, domain: int,
) -> None:
    with started('monitor', '-p', f'spec:={write_bundle(tmp_path, BUNDLE)}',
                 '-p', 'native:=true', '-p', 'metrics:=127.0.0.1:0') as monitor:
        monitor.wait_for('native is not possible, the node runs in Python: the node in '
                         'C serves no figures for Prometheus: leave metrics out')
