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

"""Who may ask the server of a page, and what it gives away."""

from collections.abc import Iterator
from contextlib import closing
from http.client import HTTPConnection
import json
import os
from pathlib import Path
import signal
import subprocess
import sys
from typing import Any
from urllib.parse import urlsplit

from fret_monitor.cli.main import main
from fret_monitor.studio.folder import Folder, MOST_BYTES
import pytest
from studio.serving import studio

pytest.importorskip('uvicorn')
server = pytest.importorskip('fret_monitor.studio.server')
websockets = pytest.importorskip('websockets')
client = pytest.importorskip('websockets.sync.client')

BUNDLE = """\
format: 1
inputs:
  p: {topic: p, type: std_msgs/msg/Bool}
requirements:
  - {id: R, ptltl: "p"}
"""


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    found = tmp_path_factory.mktemp('studio')
    (found / 'b.yaml').write_text(BUNDLE)
    (found / 'other.yaml').write_text('services: {}\n')
    return found


@pytest.fixture(scope='module')
def url(folder: Path) -> Iterator[str]:
    with studio(folder, 'b.yaml') as address:
        yield address


def get(url: str, path: str, **headers: str) -> tuple[int, dict[str, str], str]:
    """Return status, headers and text of a path on the server of a page."""
    place = urlsplit(url)
    with closing(HTTPConnection('127.0.0.1', place.port or 0, timeout=60)) as connection:
        connection.putrequest('GET', path, skip_host='Host' in headers)
        for name, value in headers.items():
            connection.putheader(name, value)
        connection.endheaders()
        answer = connection.getresponse()
        return answer.status, {name.lower(): value for name, value in answer.getheaders()}, \
            answer.read().decode()


def test_only_the_page_with_its_token_is_answered(url: str) -> None:
    place = urlsplit(url)
    status, headers, text = get(url, place.path)
    assert status == 200 and '<main>' in text
    policy = headers['content-security-policy']
    assert "default-src 'none'" in policy and "script-src 'self';" in policy
    assert policy.count('unsafe') == 1 and "style-src-attr 'unsafe-inline'" in policy
    assert '@NONCE@' not in text
    assert headers['referrer-policy'] == 'no-referrer'
    token = place.path.strip('/')
    wrong = token[:-1] + ('a' if token[-1] != 'a' else 'b')
    for path in ('/', f'/{wrong}/', f'/{wrong}/main.js', '/main.js', '//', '/index.html'):
        assert get(url, path)[0] == 403, path
    for headers_ in ({'Host': 'evil.example'}, {'Host': f'evil.example:{place.port}'},
                     {'Origin': 'http://evil.example'}, {'Origin': 'null'}):
        assert get(url, place.path, **headers_)[0] == 403, headers_
    for name, what in (('rows.js', 'function drawReport('), ('report.css', ':host')):
        assert what in get(url, place.path + name)[2]
    for name in ('../server.py', '../../bag/page.js', 'page.js', '..%2fserver.py',
                 'vendor/../../server.py', 'vendor', 'none.js', 'vendor/SHA256SUMS',
                 '/etc/passwd', '%00', 'x' * 5000):
        assert get(url, place.path + name)[0] in (403, 404), name


def talk(url: str, origin: str | None) -> Any:
    place = urlsplit(url)
    return client.connect(f'ws://{place.netloc}{place.path}talk', origin=origin, open_timeout=60)


def asked(url: str, *questions: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the answers, in the order of the questions."""
    with talk(url, f'http://{urlsplit(url).netloc}') as socket:
        for number, question in enumerate(questions):
            socket.send(json.dumps({'number': number, **question}))
        found = [json.loads(socket.recv(60)) for _ in questions]
    return sorted(found, key=lambda item: int(item['number']))


def test_a_socket_of_another_origin_or_without_the_token_is_refused(url: str) -> None:
    place = urlsplit(url)
    for address, origin in ((url, 'http://evil.example'), (url, None), (url, 'null'),
                            (f'http://{place.netloc}/wrong/', f'http://{place.netloc}')):
        with pytest.raises(websockets.WebSocketException), talk(address, origin) as socket:
            socket.recv(10)


def test_the_page_opens_reads_and_writes_bundles_of_its_folder(url: str, folder: Path) -> None:
    opened, stored = asked(url, {'do': 'open'}, {'do': 'read', 'name': 'b.yaml'})
    assert opened['answer']['recordings'] == []
    assert opened['answer']['names'] == ['b.yaml'] and opened['answer']['bundle'] == 'b.yaml'
    assert stored['answer']['text'] == BUNDLE
    stamp = stored['answer']['stamp']
    new = BUNDLE.replace('"p"', '"O p"')
    written, = asked(url, {'do': 'write', 'name': 'b.yaml', 'text': new, 'stamp': stamp})
    assert (folder / 'b.yaml').read_text() == new
    again, = asked(url, {'do': 'write', 'name': 'b.yaml', 'text': BUNDLE, 'stamp': stamp})
    assert 'has changed on disk' in again['error'] and (folder / 'b.yaml').read_text() == new
    back, = asked(url, {'do': 'write', 'name': 'b.yaml', 'text': BUNDLE,
                        'stamp': written['answer']['stamp']})
    assert 'answer' in back


def test_a_bundle_that_is_given_by_a_link_is_opened_where_it_is(
    folder: Path, tmp_path: Path,
) -> None:
    (tmp_path / 'installed.yaml').symlink_to(folder / 'b.yaml')
    with studio(tmp_path, 'installed.yaml') as address:
        opened, = asked(address, {'do': 'open'})
    assert opened['answer']['bundle'] == 'b.yaml'
    assert opened['answer']['folder'] == str(folder)


def test_a_page_hears_that_a_recording_has_come(tmp_path: Path) -> None:
    (tmp_path / 'b.yaml').write_text(BUNDLE)
    with studio(tmp_path, 'b.yaml') as address, \
            talk(address, f'http://{urlsplit(address).netloc}') as socket:
        socket.send(json.dumps({'number': 1, 'do': 'open'}))
        assert json.loads(socket.recv(60))['answer']['recordings'] == []
        (tmp_path / 'one.mcap').write_bytes(b'')
        assert json.loads(socket.recv(60)) == {'recordings': ['one.mcap']}


@pytest.mark.parametrize(('name', 'text', 'reason'), [
    ('table.csv', 'time,p\n', "'table.csv' does not end with .yaml"),
    ('large.yaml', '#' * (MOST_BYTES + 1), 'more than 2,000,000 bytes')])
def test_what_the_page_cannot_open_is_refused_before_there_is_a_page(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch,
    name: str, text: str, reason: str,
) -> None:
    monkeypatch.setattr(server, 'serve', lambda *_: None)
    (tmp_path / name).write_text(text)
    assert main(['studio', str(tmp_path / name), '--print-url']) == 1
    assert reason in capsys.readouterr().err


def test_a_second_signal_while_the_server_ends_prints_nothing(folder: Path) -> None:
    process = subprocess.Popen(
        [sys.executable, '-m', 'fret_monitor', 'studio', '--print-url', 'b.yaml'], cwd=folder,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        # If these tests run in the background, SIGINT may be ignored, and children inherit that.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))
    assert process.stdout is not None
    address = process.stdout.readline().strip()
    with talk(address, f'http://{urlsplit(address).netloc}') as socket:
        process.send_signal(signal.SIGINT)
        with pytest.raises(websockets.ConnectionClosed):
            socket.recv(60)
        process.send_signal(signal.SIGINT)
        assert process.communicate(timeout=60) == ('', '')
    assert process.returncode == 130


def test_a_page_hears_that_its_file_was_changed(url: str, folder: Path) -> None:
    with talk(url, f'http://{urlsplit(url).netloc}') as socket:
        socket.send(json.dumps({'number': 1, 'do': 'read', 'name': 'b.yaml'}))
        socket.recv(60)
        (folder / 'b.yaml').write_text(BUNDLE + '# changed\n')
        assert json.loads(socket.recv(60)) == {'changed': 'b.yaml'}
    (folder / 'b.yaml').write_text(BUNDLE)


def test_nonsense_is_answered_with_an_error_or_ends_that_page_alone(url: str) -> None:
    found = asked(url, {'do': 'nothing'}, {'do': 'read'}, {'do': 'read', 'name': 3},
                  {'do': 'check', 'name': 'b.yaml'},
                  {'do': 'recording', 'name': 'b.yaml', 'text': BUNDLE, 'recording': '../run'},
                  {'do': 'check', 'name': '../b.yaml', 'text': BUNDLE})
    assert all('error' in item for item in found)
    for text in ('[]', '{', '{"do": "open"}', '3'):
        with talk(url, f'http://{urlsplit(url).netloc}') as socket:
            socket.send(text)
            with pytest.raises(websockets.ConnectionClosed):
                socket.recv(60)
    assert 'answer' in asked(url, {'do': 'open'})[0]


@pytest.mark.parametrize('name', ['../b.yaml', '/etc/passwd', 'b.txt', '', '.', '..', 'a/b.yaml',
                                  'b\0.yaml', 'link.yaml', 'pipe.yaml', 'large.yaml'])
def test_a_folder_gives_no_file_outside_and_no_link_pipe_or_large_file(
    tmp_path: Path, name: str,
) -> None:
    inside = tmp_path / 'inside'
    inside.mkdir()
    (tmp_path / 'b.yaml').write_text(BUNDLE)
    (inside / 'link.yaml').symlink_to(tmp_path / 'b.yaml')
    os.mkfifo(inside / 'pipe.yaml')
    (inside / 'large.yaml').write_text('#' * (MOST_BYTES + 1))
    found = Folder(inside)
    with pytest.raises(ValueError):
        found.read(name)
    for stamp in ('a stamp', None):
        with pytest.raises(ValueError):
            found.write(name, BUNDLE, stamp)
    assert (inside / 'large.yaml').stat().st_size > MOST_BYTES
    assert found.names() == [] and (tmp_path / 'b.yaml').read_text() == BUNDLE


def test_a_name_that_is_too_long_is_no_file(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r'cannot write .*too long'):
        Folder(tmp_path).write('x' * 300 + '.yaml', BUNDLE, None)


@pytest.mark.parametrize(('old', 'text', 'expected'), [
    (b'a\nb\n', 'b\nc\n', b'b\nc\n'),
    (b'a\r\nb\r\n', 'a\nc\nb\n', b'a\r\nc\r\nb\r\n'),
    # Another first line, one more in the middle, and one fewer.
    (b'a\r\nb\nc\r\nd\ne', 'A\nb\nc\nnew\nd\ne', b'A\r\nb\nc\r\nnew\r\nd\ne'),
    (b'a\r\nb\nc\rd\n', 'a\nc\nd\n', b'a\r\nc\rd\n'),
    (b'a', 'a\nb\n', b'a\nb\n'),
    # A byte order mark, which is not of the text.
    (b'\xef\xbb\xbfa\n', '# x\na\n', b'\xef\xbb\xbf# x\na\n'),
    (b'\xef\xbb\xbfa\r\nb\nc\n', 'x\na\nc\n', b'\xef\xbb\xbfx\r\na\r\nc\n')])
def test_a_write_keeps_the_end_of_each_line(
    tmp_path: Path, old: bytes, text: str, expected: bytes,
) -> None:
    (tmp_path / 'b.yaml').write_bytes(old)
    found = Folder(tmp_path)
    assert found.read('b.yaml').text.startswith('a')
    found.write('b.yaml', text, found.stamp('b.yaml'), 'b.yaml')
    assert (tmp_path / 'b.yaml').read_bytes() == expected


def test_a_write_keeps_the_permissions_and_leaves_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / 'b.yaml'
    path.write_text(BUNDLE)
    path.chmod(0o640)
    found = Folder(tmp_path)
    found.write('b.yaml', 'format: 1\n', found.stamp('b.yaml'))
    assert path.read_text() == 'format: 1\n' and path.stat().st_mode & 0o777 == 0o640
    with pytest.raises(ValueError, match='there already'):
        found.write('b.yaml', '', None)
    assert os.listdir(tmp_path) == ['b.yaml']
