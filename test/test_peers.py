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

"""Comparison with peers: missing ones are reported, and Copilot's C is driven correctly."""

import os
from pathlib import Path
import subprocess
import sys

from bench import peers
import pytest

ROOT = Path(__file__).resolve().parent.parent


def test_missing_peers_are_reported(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, '-S', '-c', 'import sys; sys.path[:] = sys.argv[1:]\n'
         'import bench.peers as peers\n'
         'peers.find_spec = lambda name: None\nsys.argv = ["peers"]\nsys.exit(peers.main())',
         *sys.path], cwd=ROOT, capture_output=True, text=True, check=False,
        env={**os.environ, 'PATH': str(tmp_path)})
    assert (done.returncode, done.stderr) == (0, '')
    assert done.stdout.splitlines() == [
        'Copilot: not found; apt install ghc libghc-copilot-dev',
        'reelay: not found; pip install reelay']


def test_differences_are_reported_with_their_number_and_the_first() -> None:
    assert peers.difference([b'0', b'1'], [b'0', b'1']) == 'equal'
    assert peers.difference([b'0', b'1', b'1'], [b'0', b'0', b'0']) == \
        'differ at 2 of 3 steps, first at step 1'


@pytest.mark.skipif(peers.copilot_version() is None, reason='needs GHC and Copilot')
@pytest.mark.parametrize('name', ['running_example', 'historically', 'once', 'since'])
def test_hand_written_copilot_gives_our_verdicts(tmp_path: Path, name: str) -> None:
    work = next(work for work in peers.ALL_WORKS if work.floor == name)
    ours = peers.compile_ours(work, tmp_path)
    peer = peers.copilot(peers.WAYS[1], ours, tmp_path)
    seen: set[bytes] = set()
    for _, inputs in ours.inputs():
        mine = list(peers.verdicts(ours.monitor, inputs))
        assert mine == list(peers.verdicts(peers.fresh(peer, ours), inputs))
        seen.update(bytes([flag]) for verdicts in mine for flag in verdicts)
    assert seen == {b'\0', b'\1'}


@pytest.mark.skipif(peers.copilot_version() is None, reason='needs GHC and Copilot')
def test_a_wrong_since_is_reported(tmp_path: Path) -> None:
    ours = peers.compile_ours(peers.ALL_WORKS[-1], tmp_path)
    ogma = peers.copilot(peers.WAYS[0], ours, tmp_path)
    told = [peers.difference(list(peers.verdicts(ours.monitor, inputs)),
                             list(peers.verdicts(peers.fresh(ogma, ours), inputs)))
            for _, inputs in ours.inputs()]
    assert all(text.startswith('differ at ') for text in told)
