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

"""Random recordings: what `bag` finds in them is what the reference evaluators say."""

from pathlib import Path
from random import Random

from bag.random_bags import CASES, compare
from fret_monitor.model.policies import Policy, Stamp
import pytest
from strategies import some


@pytest.mark.parametrize(('policy', 'stamp'), some(CASES, 2))
def test_random_recordings_have_the_occurrences_of_the_reference(
        tmp_path: Path, policy: Policy, stamp: Stamp) -> None:
    rng = Random(f'{policy.value} {stamp.value}')
    assert compare(rng, tmp_path, policy, stamp, bags=2) > 100
