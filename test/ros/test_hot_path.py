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

"""Receiving in C: messages are read where the middleware has stored them."""

from collections.abc import Iterator
from contextlib import contextmanager
import gc
from pathlib import Path
from threading import Event
from types import SimpleNamespace
from typing import Any
import weakref

from bundles import BELOW_HALF, write_bundle
from diagnostic_msgs.msg import DiagnosticArray
from fret_monitor.model.names import DETAILS_TOPIC
from fret_monitor.native import evaluator_library, load_evaluator
from fret_monitor.native.binding import ffi
from fret_monitor.ros import MonitorNode
from fret_monitor.ros.intake import native_lifetimes
from fret_monitor.ros.intake.hot_path import EngineReceiver, Middleware, why_callbacks_wake
from fret_monitor.ros.intake.rcl_endpoint import RclSubscription
from fret_monitor.ros.intake.symbols import find_symbol, Unavailable
from fret_monitor.ros.settings.parameters import Refusal
import pytest
import rclpy
from rclpy.node import Node
from ros.harness import make_node, Partner, wait_until
from ros.received import read_detail
from std_msgs.msg import Float32, Int32


def skip_unless_read_in_place() -> None:
    try:
        Middleware().read_in_place(load_evaluator(evaluator_library()))
    except Unavailable as reason:
        pytest.skip(f'messages are not read in place: {reason}')


def test_only_a_topic_that_cannot_be_read_in_place_is_copied(
    partner: Partner, stranger: Partner, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    skip_unless_read_in_place()
    bundle = write_bundle(tmp_path, BELOW_HALF.replace('requirements:', """\
  y: {topic: y, type: std_msgs/msg/Int32}
requirements:
  - {id: S, ptltl: "y < 1"}"""))
    original = Middleware.class_in_place

    def refuse(self: Middleware, kind: Any) -> Any:
        if kind is Int32:
            raise Unavailable('Int32 has no type support for Fast DDS')
        return original(self, kind)

    monkeypatch.setattr(Middleware, 'class_in_place', refuse)
    node = make_node(MonitorNode, stranger.context, spec=bundle, hot_path='on')
    try:
        x, y = partner.publisher(Float32, 'x'), partner.publisher(Int32, 'y')
        partner.listen('R', 'S')
        partner.wait_for_listener(x, y)
        x.publish(Float32(data=2.0))
        partner.expect({'R': 1})  # `every_message`, but S waits for y
        y.publish(Int32(data=2))
        partner.expect({'R': 2, 'S': 1})
    finally:
        node.destroy_node()
    logged = capfd.readouterr().err
    assert 'messages on /y are copied before they are read: Int32 has no type support' in logged
    assert 'messages are taken in C' in logged


def test_the_log_says_why_messages_are_copied_before_they_are_read(
    stranger: Partner, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    bundle = write_bundle(tmp_path, BELOW_HALF)

    def refuse(self: Middleware, library: Any) -> None:
        raise Unavailable('Fast DDS 9 is not known')

    monkeypatch.setattr(Middleware, 'read_in_place', refuse)
    make_node(MonitorNode, stranger.context, spec=bundle, hot_path='on').destroy_node()
    assert 'and copied before they are read: Fast DDS 9 is not known' in capfd.readouterr().err


@pytest.mark.parametrize(('hot_path', 'is_in_place'), [('on', True), ('off', False)])
def test_a_subscription_is_read_in_place_only_on_the_hot_path(
    domain: int, tmp_path: Path, hot_path: str, is_in_place: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    skip_unless_read_in_place()
    bundle = write_bundle(tmp_path, BELOW_HALF)
    kinds: list[str] = []

    class Spy(RclSubscription):

        def __init__(self, node: Node, msg_type: Any, *arguments: Any) -> None:
            kinds.append(type(msg_type).__name__)
            super().__init__(node, msg_type, *arguments)

    monkeypatch.setattr('fret_monitor.ros.intake.feed.RclSubscription', Spy)
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain)
    node = make_node(MonitorNode, context, spec=bundle, hot_path=hot_path)
    try:
        assert kinds
        assert all((kind == 'InPlace') is is_in_place for kind in kinds)
    finally:
        node.destroy_node()
        context.try_shutdown()


@pytest.mark.parametrize('hot_path', ['on', 'off'])
def test_a_detail_that_is_not_published_yet_holds_no_message_and_no_violation(
    partner: Partner, stranger: Partner, tmp_path: Path, hot_path: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bundle = write_bundle(tmp_path, BELOW_HALF)
    is_known, may_publish = Event(), Event()
    details: list[Any] = []
    turns: list[Any] = []  # since the subscriber is known; its details are wanted from the second

    def log(*arguments: Any) -> None:
        turns.extend(arguments if is_known.is_set() else ())
        if len(turns) > len(arguments):
            may_publish.wait()

    monkeypatch.setattr('fret_monitor.ros.reports.details.log_lines', log)
    node = make_node(MonitorNode, stranger.context, spec=bundle, hot_path=hot_path)
    try:
        partner.node.create_subscription(DiagnosticArray, DETAILS_TOPIC, details.append, 1000)
        wait_until(lambda: node._sessions[0]._details.subscriptions > 0, 'the discovery')
        is_known.set()
        x = partner.publisher(Float32, 'x')
        partner.listen('R')
        partner.wait_for_listener(x)
        wait_until(lambda: len(turns) > 2, 'two turns')
        for number in range(50):
            x.publish(Float32(data=2.0))
            wait_until(lambda: partner.heard['R'] > number, 'its violation')  # noqa: B023
        assert details == []
        may_publish.set()
        wait_until(lambda: len(details) == 50, 'the details')
        found = [read_detail(array.status[0]) for array in details]
        assert [item.step for item in found] == list(range(50))
    finally:
        may_publish.set()
        node.destroy_node()


@pytest.mark.parametrize('way', ['auto', 'off'])
def test_a_middleware_without_a_callback_for_new_messages_is_refused(
    stranger: Partner, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, way: str,
) -> None:
    bundle = write_bundle(tmp_path, BELOW_HALF)

    def find(library: Any, name: str, kind: Any) -> Any:
        if name == 'rmw_subscription_set_on_new_message_callback':
            raise Unavailable(f'the middleware has no {name}')
        return find_symbol(library, name, kind)

    monkeypatch.setattr('fret_monitor.ros.intake.hot_path.find_symbol', find)
    with pytest.raises(Refusal, match='cannot use the middleware: the middleware has no rmw_sub'):
        make_node(MonitorNode, stranger.context, spec=bundle, hot_path=way)


@pytest.mark.parametrize(('name', 'reason'), [
    ('rmw_fastrtps_cpp', None),
    ('rmw_other', 'the callbacks of rmw_other are not known to allow it')])
def test_callbacks_of_an_unknown_middleware_only_wake(
    name: str, reason: str | None, monkeypatch: pytest.MonkeyPatch,
) -> None:
    library = load_evaluator(evaluator_library())
    monkeypatch.setattr(
        'fret_monitor.ros.intake.hot_path.get_rmw_implementation_identifier', lambda: name)
    assert why_callbacks_wake('auto', library) == reason
    assert why_callbacks_wake('on', library) is None
    assert why_callbacks_wake('off', library) == 'hot_path is off'


def why_copied(library: Any, maps: str) -> str:
    why = ffi.new('char[]', 256)
    is_known = library.fm_in_place_is_known(maps.encode(), why, len(why))
    reason: Any = ffi.string(why)
    return '' if is_known else str(reason.decode())


def test_messages_are_read_in_place_only_with_known_versions(tmp_path: Path) -> None:
    library = load_evaluator(evaluator_library())
    versions = {'rmw_fastrtps_cpp': '8.4', 'rosidl_typesupport_fastrtps_c': '3.6',
                'fastcdr': '2.2'}
    (tmp_path / 'a b' / 'lib').mkdir(parents=True)
    maps = '7f00-7f01 r-xp 00000000 08:01 12 /usr/lib/libc.so.6\n'
    for name, version in versions.items():
        maps += f'7f00-7f01 r-xp 0 08:01 12    {tmp_path}/a b/lib/lib{name}.so.2\n'
        package = tmp_path / 'a b' / 'share' / name / 'package.xml'
        package.parent.mkdir(parents=True)
        package.write_text(f'<package><version> {version}.1 </version></package>')
    assert why_copied(library, maps) == ''
    for name, version in versions.items():
        package = tmp_path / 'a b' / 'share' / name / 'package.xml'
        for other in ('9.9.9', f'{version}1.0'):
            package.write_text(f'<package><version>{other}</version></package>')
            assert f'{name} {version}, not with {other}' in why_copied(library, maps)
        package.unlink()
        assert f'{name} {version}, not with unknown' in why_copied(library, maps)
        (tmp_path / 'a b' / 'lib' / f'lib{name}.so.{version}.5').touch()  # of no ROS package
        assert why_copied(library, maps) == ''
    assert 'not with unknown' in why_copied(library, '')
    assert 'not with unknown' in why_copied(library, maps.replace('fastcdr', 'slowcdr'))


@pytest.mark.parametrize('is_stopped', [True, False])
def test_a_receiver_that_could_not_be_stopped_keeps_its_objects(
        is_stopped: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    kept: dict[int, Any] = {}
    monkeypatch.setattr(native_lifetimes, '_KEPT', kept)
    calls = []

    class Subscription:

        @property
        @contextmanager
        def handle(self) -> Iterator[None]:
            yield
            calls.append('released')

    memory = ffi.new('char[]', 8)

    def start(place: Any, *_: object) -> bool:
        place[0] = ffi.cast('struct fm_receiver *', memory)
        return True

    def stop(place: Any) -> bool:
        if place[0] != ffi.NULL:
            calls.append('stop')
        if is_stopped:
            place[0] = ffi.NULL
        return is_stopped

    library: Any = SimpleNamespace(fm_receiver_start=start, fm_receiver_stop=stop)
    middleware: Any = SimpleNamespace(
        functions=None, handle=lambda _: None, taking=lambda _: 0)
    evaluator: Any = SimpleNamespace(library=library, pointer=None, drain=lambda: None)
    subscription: Any = Subscription()
    receiver = EngineReceiver(evaluator, middleware, subscription, 0)
    for _ in range(2):
        receiver.end()
        receiver.stop()
    assert calls == (['stop', 'released'] if is_stopped else ['stop'])
    assert bool(kept) is not is_stopped
    kept.clear()  # as when Python clears its modules at exit
    found = weakref.ref(receiver)
    del receiver
    gc.collect()
    assert (found() is None) is is_stopped
