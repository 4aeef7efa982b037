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

"""Violations that could not be published are counted and reported."""

from pathlib import Path

from bundles import engine_of, NEGATIVE
from fret_monitor.native.binding import ffi
from fret_monitor.ros.intake.hot_path import Announcer, Middleware
from fret_monitor.ros.nodes.bundle_session import handlers_of
from fret_monitor.runtime import Engine
from fret_monitor.runtime.reporting import ReportTable
import pytest
from rclpy.context import Context
from rclpy.node import Node
from ros.harness import Partner
from runtime.seen import see

A_MESSAGE = b'\0\1\0\0\1\0\0\0'


@pytest.fixture
def engine(tmp_path: Path) -> Engine:
    return engine_of(tmp_path, NEGATIVE)


def started(engine: Engine, middleware: Middleware, node: Node) -> Announcer:
    manifest = engine.monitor.manifest
    return Announcer(
        engine, middleware, [*handlers_of(node, manifest, 10)], ReportTable(manifest))


def test_violations_that_a_publisher_refuses_are_counted(
    engine: Engine, partner: Partner,
) -> None:
    node = Node('fret_monitor', context=partner.context)
    middleware = Middleware()
    refuse = ffi.callback(ffi.typeof(middleware.functions.publish), lambda *_: 1)
    middleware.functions.publish = refuse
    announcer = started(engine, middleware, node)
    for _ in range(3):
        engine.message(0, A_MESSAGE, received=0)
    announcer.close()
    assert see(engine).unpublished == 3
    node.destroy_node()


def test_violations_are_published_while_the_context_ends(engine: Engine, domain: int) -> None:
    context = Context()
    context.init(args=[], domain_id=domain)
    node = Node('fret_monitor', context=context)
    announcer = started(engine, Middleware(), node)
    context.shutdown()
    for _ in range(3):
        engine.message(0, A_MESSAGE, received=0)
    announcer.close()
    assert see(engine).unpublished == 0 and engine.take(0) == []
