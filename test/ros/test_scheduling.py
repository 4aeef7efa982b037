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

"""Priority, processors and locked memory of both nodes: what is asked for, and what is refused."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import partial
import os
from pathlib import Path
import re
import subprocess
import sys
from typing import TypeAlias

from bundles import BELOW_HALF, write_bundle
import pytest
from ros.exported import ExportedNode, monitoring, NODES
from ros.harness import NodeProcess
from strategies import some

WANTED = ('-p', 'priority:=3', '-p', 'processors:={processor}', '-p', 'lock_memory:=true')

pytestmark = pytest.mark.usefixtures('domain')
Start: TypeAlias = Callable[..., AbstractContextManager[NodeProcess]]


@pytest.fixture(params=NODES)
def run(request: pytest.FixtureRequest, tmp_path: Path) -> Start:
    """Return a function that starts a node with arguments."""
    return partial(monitoring, request.param, write_bundle(tmp_path, BELOW_HALF))


def is_allowed(statement: str) -> bool:
    """Return whether this user may do something."""
    done = subprocess.run([sys.executable, '-c', f'import ctypes, os; {statement}'], check=False,
                          stderr=subprocess.DEVNULL)
    return done.returncode == 0


def test_all_threads_have_priority_and_processors_or_the_log_says_why_not(run: Start) -> None:
    processor = max(os.sched_getaffinity(0))
    arguments = [item.format(processor=processor) for item in WANTED]
    with run(*arguments) as node:
        threads = [int(item) for item in os.listdir(f'/proc/{node.process.pid}/task')]
        assert len(threads) > 5
        assert {frozenset(os.sched_getaffinity(item)) for item in threads} == {
            frozenset({processor})}
        has_priority = is_allowed('os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(3))')
        found = {(os.sched_getscheduler(item), os.sched_getparam(item).sched_priority)
                 for item in threads}
        assert found == {(os.SCHED_FIFO, 3) if has_priority else (os.SCHED_OTHER, 0)}
        assert ('the priority 3 is not possible: ' in node.output) is not has_priority
        if not isinstance(node, ExportedNode):  # its sanitizer locks no memory
            status = Path(f'/proc/{node.process.pid}/status').read_text(encoding='ascii')
            has_memory = 'to lock the memory is not possible: ' not in node.output
            assert (re.search(r'VmLck:\s+0 kB', status) is None) is has_memory
            assert has_memory is is_allowed('assert ctypes.CDLL(None).mlockall(7) == 0')


@pytest.mark.parametrize('processors', some([
    '0-', '1-0', 'all', '0,,1', '-1', '0;1', '99999'], 3))
def test_a_list_that_is_none_is_logged_and_the_node_runs(run: Start, processors: str) -> None:
    with run('-p', f'processors:="{processors}"') as node:
        line = f'to run on the processors {processors} is not possible: Invalid argument'
        assert line in node.output
