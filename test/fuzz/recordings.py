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

"""Random recordings and requirements: what `bag` finds is what the reference evaluators say."""

from pathlib import Path
from random import Random
import tempfile
import time

from bag.random_bags import CASES, compare


def fuzz(seconds: float, seed: int) -> int:
    """
    Compare for some time; return the number of recordings.

    Raises
    ------
    AssertionError
        that names the random seed, if a recording is judged in another way.
    """
    end = time.monotonic() + seconds
    count = 0
    while time.monotonic() < end:
        policy, stamp = CASES[count % len(CASES)]
        with tempfile.TemporaryDirectory(prefix='fret_monitor-fuzz-') as name:
            try:
                compare(Random(seed + count), Path(name), policy, stamp)
            except AssertionError as error:
                raise AssertionError(
                    f'compare(Random({seed + count}), folder, {policy}, {stamp}): {error}'
                ) from None
        count += 1
    return count
