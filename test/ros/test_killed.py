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

"""A watched node in a process of its own that is killed, and started again: in both nodes."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
import signal

from bundles import write_bundle
import pytest
from ros.harness import NodeProcess, Partner
from ros.test_asked import both, Watcher
from strategies import thorough

pytest.importorskip('diagnostic_msgs.msg')

# The watched node is a monitor itself: it is a lifecycle node with parameters and publishers.
WATCHED = """
format: 1
constants: {top: 2.5}
inputs: {x: {topic: x, type: std_msgs/msg/Float32}}
requirements: [{id: X, ptltl: x < top}]
"""
BUNDLE = """
format: 1
inputs:
  alive: {node: /watched/fret_monitor}
  signs: {publishers: /watched/fret_monitor/alive}
  state: {lifecycle: /watched/fret_monitor}
  top: {parameter: {node: /watched/fret_monitor, name: constants.top}, type: float64}
evaluation: {policy: relevant_message}
requirements:
  - {id: ALIVE, ptltl: alive}
  - {id: SIGNS, ptltl: signs > 0}
  - {id: THERE, ptltl: state != UNKNOWN}
  - {id: TOP, ptltl: top < 3}
"""
IDS = ('ALIVE', 'SIGNS', 'THERE', 'TOP')
NODE = 'graph node /watched/fret_monitor'
STATE = 'graph lifecycle /watched/fret_monitor'
SIGNS = 'graph publishers of /watched/fret_monitor/alive'
TOP = 'graph parameter constants.top of /watched/fret_monitor'
# How soon the middleware misses a process that was killed; 20 s by default.
LEASE = """<?xml version="1.0" encoding="UTF-8" ?>
<profiles xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles">
  <participant profile_name="short_lease" is_default_profile="true"><rtps><builtin>
    <discovery_config>
      <leaseDuration><sec>5</sec></leaseDuration>
      <leaseAnnouncement><sec>1</sec></leaseAnnouncement>
    </discovery_config>
  </builtin></rtps></participant>
</profiles>
"""


@contextmanager
def watched(folder: Path, top: float) -> Iterator[NodeProcess]:
    profile = folder / 'lease.xml'
    profile.write_text(LEASE, encoding='utf-8')
    bundle = folder / 'watched'
    bundle.mkdir(exist_ok=True)
    process = NodeProcess(
        'monitor', '-p', f'spec:={write_bundle(bundle, WATCHED)}', '-r', '__ns:=/watched',
        '-p', f'constants.top:={top}',
        environment={name: str(profile) for name in (
            'FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE')})
    try:
        process.wait_for('watching')
        yield process
    finally:
        process.kill()


def expect_all(watcher: Watcher) -> None:
    watcher.expect(NODE, 'there')
    watcher.expect(SIGNS, 'there')
    watcher.expect(STATE, 'active')
    watcher.expect(TOP, 'it has a value')


@thorough
def test_a_node_that_is_killed_is_missed_and_seen_when_it_is_started_again(
        partner: Partner, tmp_path: Path) -> None:
    watcher = Watcher(partner, IDS)
    with both(write_bundle(tmp_path, BUNDLE)):
        with watched(tmp_path, 2.5) as process:
            expect_all(watcher)
            watcher.violations()
            assert process.end(signal.SIGKILL) == -signal.SIGKILL
        watcher.expect(NODE, 'not there any more')
        watcher.expect(SIGNS, 'not there any more')
        watcher.expect(STATE, 'not there any more')
        watcher.expect(TOP, 'its node is not there', b'\1')
        watcher.violations(ALIVE=1, SIGNS=1, THERE=1)
        with watched(tmp_path, 3.5) as process:
            expect_all(watcher)
            watcher.violations(TOP=1)
            assert process.end() == 0
