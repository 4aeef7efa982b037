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

"""Groups of items that share names."""

from random import Random

from fret_monitor.model.graph import DisjointSets, sharing


def test_items_that_share_a_name_directly_or_through_others_are_a_group() -> None:
    names = {'one': 'a b', 'two': 'c', 'three': '', 'four': 'd b', 'five': 'd', 'six': 'c'}
    # Names are equal, but not one object, as those of a long text are.
    assert sharing(list(names), lambda item: [''.join(name) for name in names[item].split()]) == [
        ['one', 'four', 'five'], ['two', 'six'], ['three']]


def test_joined_sets_have_one_root() -> None:
    rng, sets = Random(0), DisjointSets[str]()
    known = {str(item): {str(item)} for item in range(200)}
    for _ in range(150):
        one, other = (''.join(rng.choice([*known])) for _ in range(2))
        assert sets.root(one) in known[one]
        joined = known[one] | known[other]
        assert sets.join(one, other) in joined
        known.update(dict.fromkeys(joined, joined))
    for item, joined in known.items():
        assert {sets.root(each) for each in joined} == {sets.root(item)} <= joined
