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

"""Fixtures of the tests with ROS 2; without rclpy these tests are not collected."""

from collections.abc import Iterator
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from fret_monitor.native import evaluator_library
import pytest
from strategies import HOT_PATHS, IS_THOROUGH

if TYPE_CHECKING:
    from ros.harness import Partner


collect_ignore_glob: list[str] = []
try:
    import rclpy  # noqa: F401
except ImportError:
    collect_ignore_glob.append('*')


# Its monitors take messages in callbacks, and then in a thread: both must pass the same tests.
# In `make test`, test_hot_path, test_recordings, test_timed and others see the thread, too.
BOTH_WAYS = {'test_monitor_node'}


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Run the tests of `BOTH_WAYS` twice."""
    if metafunc.module.__name__.rpartition('.')[2] in BOTH_WAYS:
        metafunc.fixturenames.append('hot_path')
        metafunc.parametrize('hot_path', HOT_PATHS, indirect=True)


@pytest.fixture(scope='session', autouse=True)
def built_engine() -> None:
    """Build the engine before the first node does: on a busy machine that takes half a minute."""
    evaluator_library()


@pytest.fixture
def hot_path(request: pytest.FixtureRequest) -> Iterator[str]:
    """Start monitors with each value of the parameter `hot_path`."""
    from ros import harness
    harness.HOT_PATH = request.param
    yield request.param
    harness.HOT_PATH = None


@pytest.fixture
def forking(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fork the nodes that are started by a command line; see `forked`."""
    from ros import forked
    monkeypatch.setattr('subprocess.Popen', forked.popen)


@pytest.fixture(scope='session')
def short_bench() -> Iterator[None]:
    """Build the programs of `bench.ros` once, without optimization, and shorten its waits."""
    from bench import ros as bench
    with TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        patch.setattr(bench, 'OPTIMIZATION', '-O0')
        patch.setattr(bench, 'IDLE', 0.1)
        patch.setattr(bench, 'DRAIN', 0.2)
        build = cache(bench.build)
        patch.setattr(bench, 'build', lambda name, _: build(name, Path(folder)))
        if not IS_THOROUGH:  # the C of all bundles is compiled for other tests, too
            from ros.exported import exported_bundle
            patch.setattr(bench, 'exported', lambda bundle, _: exported_bundle(bundle))
        yield


def _joined(domain: int) -> Iterator['Partner']:
    from ros.harness import Partner
    made = Partner(domain)
    yield made
    made.close()


@pytest.fixture
def partner(domain: int) -> Iterator['Partner']:
    """Return a node of the test in a ROS domain of its own."""
    yield from _joined(domain)


@pytest.fixture
def stranger(domain: int) -> Iterator['Partner']:
    """Return a second node, in a context of its own, as another process would have."""
    yield from _joined(domain)
