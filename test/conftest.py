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

"""Fixtures of all tests: a home folder, a copy of the repository, a DDS domain."""

from collections.abc import Callable, Iterator
import fcntl
import gc
import os
from pathlib import Path
import re
import shutil
import subprocess
import sys
import tempfile
from typing import Any

from hypothesis import HealthCheck, settings
import pytest

# Helpers of several tests contain assertions too: rewrite them, so that failures show values.
pytest.register_assert_rewrite('differential.compiled', 'ros.harness', 'strategies')

# Run times depend on other load on the machine more than on the code. `make thorough` tries more.
settings.register_profile(
    'fret_monitor', deadline=None, suppress_health_check=[HealthCheck.too_slow],
    max_examples=int(os.environ.get('FRET_MONITOR_EXAMPLES', '10')))
settings.load_profile('fret_monitor')

ROOT = Path(__file__).resolve().parent.parent
# With ROS 2: what keeps a processor busy, and may not run beside its like or beside test_time
_BUSY = r'/test_(bench|colcon|faults|hot_path|interrupts|shutdown|soak|time)\b'
_LONG = (r'/(studio/|test_(lint|extractors|parts|engine|hostile|numbers|cells|mutants|readme|'
         r'corpus|prove|clean_c|shape|layout|worst_case|shared_data|fretish_oracle|lsp|suite|'
         r'keyed_simulate|fit|\w+_formulas))')
_WORKER = 'PYTEST_XDIST_WORKER'
_HOME = pytest.StashKey[str]()
_RUN = pytest.StashKey['tempfile.TemporaryDirectory[str]']()
_LIBRARY = pytest.StashKey['subprocess.Popen[bytes]']()
_BUILD = """
from fret_monitor.native.cache import evaluator_library
evaluator_library()
"""
# Domain ids 0 to 101 give ports outside the ephemeral range; 0 is the default of all nodes.
_DOMAINS = range(1, 101)
_turns = 0


def pytest_configure(config: pytest.Config) -> None:
    """Keep ROS's log and our build cache out of the user's home, and DDS on this machine."""
    gc.disable()  # until all tests are collected: until then almost nothing becomes garbage
    if _WORKER in os.environ:
        return
    home = os.environ.get('FRET_MONITOR_TEST_HOME')  # one that stays, with its cache
    if home is None:
        home = config.stash[_HOME] = tempfile.mkdtemp(prefix='fret_monitor-test-')
    os.environ['ROS_HOME'] = home
    config.stash[_RUN] = tempfile.TemporaryDirectory(prefix='fret_monitor-test-run-')
    os.environ['FRET_MONITOR_TEST_RUN'] = config.stash[_RUN].name
    os.environ['ROS_LOG_DIR'] = os.path.join(home, 'log')
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    # Hundreds of Python processes start: let the next one load what the first one compiled.
    os.environ.pop('PYTHONDONTWRITEBYTECODE', None)
    if config.getoption('numprocesses', None) and \
            config.args_source is config.ArgsSource.TESTPATHS:  # all tests
        config.stash[_LIBRARY] = _begin_library()


def _begin_library() -> 'subprocess.Popen[bytes]':
    """Compile the library of csrc while the first worker collects; a lock is free afterwards."""
    with _library_lock().open('w') as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # the process has it, too, until it ends
        return subprocess.Popen(
            [sys.executable, '-c', _BUILD], cwd=ROOT, pass_fds=[lock.fileno()],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def _library_lock() -> Path:
    return Path(os.environ['FRET_MONITOR_TEST_RUN'], 'library.lock')


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_collection() -> Iterator[None]:
    """
    Let the first worker collect alone, and the others after it.

    It rewrites the assertions of all modules, which the others then read from the cache.
    """
    if _WORKER not in os.environ:
        return (yield)
    first = Path(os.environ['FRET_MONITOR_TEST_RUN'], 'first-worker')
    with first.open('a', encoding='utf-8') as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        if first.stat().st_size == 0:
            file.write(os.environ[_WORKER])
            file.flush()
            return (yield)
    return (yield)


def pytest_collection_finish() -> None:
    """Let the garbage collector skip the thousands of tests, which stay until the end."""
    gc.freeze()
    gc.enable()
    if _WORKER in os.environ:  # otherwise all workers would compile the library
        with _library_lock().open('a') as lock:
            fcntl.flock(lock, fcntl.LOCK_SH)


def pytest_unconfigure(config: pytest.Config) -> None:
    """Remove what `pytest_configure` made."""
    if _LIBRARY in config.stash:
        config.stash[_LIBRARY].kill()
        config.stash[_LIBRARY].wait()
    if _RUN in config.stash:
        config.stash[_RUN].cleanup()
    if _HOME in config.stash:
        shutil.rmtree(config.stash[_HOME], ignore_errors=True)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """
    Give a worker of pytest-xdist all tests of a module, and four workers those with processes.

    So what a module builds for its tests is built once. One of the four runs the tests with ROS 2
    that keep a processor busy, the others those that mostly wait; all four take about as long.
    One worker runs all proofs: what it has proved of the cells of bounds serves the next ones.
    """
    from xdist.scheduler import LoadScopeScheduling

    class WorkersForRos(LoadScopeScheduling):  # type: ignore[misc]
        # Override how tests are grouped; xdist_group has no effect in pytest 9.

        def _split_scope(self, nodeid: str) -> str:
            return _scope(nodeid)

    config.option.loadscopereorder = False  # not the largest modules first, but the order below
    return WorkersForRos(config, log)


def _scope(nodeid: str) -> str:
    module = nodeid.split('::')[0]
    if re.search(r'\btest/(proving/|cli/test_prove)', module):
        return 'proofs'
    if not re.search(r'\btest/(ros/|test_colcon)', module):
        return module
    if re.search(_BUSY, module):
        return 'busy'
    first = module.partition('/test_')[2][0]
    return f'waiting {(first > "f") + (first > "m")}'  # equally long


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Let workers begin with the tests that wait, and then with the longest."""
    if _WORKER in os.environ:
        items.sort(key=lambda item: (_scope(item.nodeid).endswith('.py'),
                                     re.search(_LONG, item.nodeid) is None))


@pytest.fixture
def domain(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """
    Set ROS_DOMAIN_ID to a number that no other test on this machine uses, and return it.

    Each user locks a file, and the lock ends with the process in any case. The file is in /tmp
    whatever TMPDIR is: runs with different ones would share a domain, and receive each other's
    messages. A number is not used again soon, since messages may still be under way.
    """
    global _turns
    _turns += 1
    begin = (_turns + 31 * int(os.environ.get(_WORKER, 'gw0').removeprefix('gw'))) % len(_DOMAINS)
    folder = Path('/tmp') / f'fret_monitor-domains-{os.getuid()}'
    folder.mkdir(exist_ok=True)
    for number in (*_DOMAINS[begin:], *_DOMAINS[:begin]):
        with (folder / str(number)).open('w') as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                continue
            monkeypatch.setenv('ROS_DOMAIN_ID', str(number))
            yield number
            return
    pytest.fail('all domains are in use')


@pytest.fixture(scope='session')
def copy_repository() -> Callable[[Path], Path]:
    """
    Return a function that copies what git holds, or would hold, into a new folder.

    It skips the test where this is no clone.
    """
    listed = subprocess.run(
        ['git', 'ls-files', '-z', '--cached', '--others', '--exclude-standard'],
        cwd=ROOT, capture_output=True, text=True, check=False)

    def copy_to(folder: Path) -> Path:
        if listed.returncode:
            pytest.skip('needs a clone')
        for name in filter(None, listed.stdout.split('\0')):
            if (ROOT / name).is_file():
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(ROOT / name, folder / name)
        return folder

    return copy_to


@pytest.fixture
def repository(copy_repository: Callable[[Path], Path], tmp_path: Path) -> Path:
    """Return a copy of what git holds, or would hold, of this repository."""
    return copy_repository(tmp_path / 'repository')
