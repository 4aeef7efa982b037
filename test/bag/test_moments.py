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

"""Moments of a recording: what a number on the command line counts from."""

from fret_monitor.bag.moments import Anchor, Moment
import pytest

SECOND = 10**9


@pytest.mark.parametrize(('text', 'anchor', 'offset'), [
    ('999999999.999999999', Anchor.START, 10**18 - 1),
    ('1000000000', Anchor.EPOCH, 10**18),
    ('1000000000.000000001', Anchor.EPOCH, 10**18 + 1),
    ('start+1000000000', Anchor.START, 10**18),
    ('end-2', Anchor.END, -2 * SECOND), ('end', Anchor.END, 0)])
def test_a_number_from_a_thousand_million_on_is_seconds_since_1970(
        text: str, anchor: Anchor, offset: int) -> None:
    assert Moment.parse(text) == Moment(anchor, offset)


def test_a_moment_is_too_far_away_from_2_to_the_62_nanoseconds_on() -> None:
    assert Moment.parse('4611686018.427387903').offset == 2**62 - 1
    with pytest.raises(ValueError, match='too far away'):
        Moment.parse('4611686018.427387904')
