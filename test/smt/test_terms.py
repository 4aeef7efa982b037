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

"""Terms: one for each expression, in all threads, freed when unused."""

import gc
import sys
from threading import Barrier, Thread

from fret_monitor.smt import terms as t
from fret_monitor.smt.terms import Term


def test_two_threads_get_one_term_for_one_expression() -> None:
    rounds, threads = 60, 4
    barrier = Barrier(threads)
    found: list[list[Term]] = [[] for _ in range(threads)]

    def build(mine: list[Term]) -> None:
        for number in range(rounds):
            barrier.wait()
            item = t.variable(f'v{number}', t.BOOL)
            for place in range(100):
                item = t.conjunction(t.variable(f'w{place}', t.BOOL), t.negation(item))
                mine.append(item)

    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        running = [Thread(target=build, args=(mine,)) for mine in found]
        for thread in running:
            thread.start()
        for thread in running:
            thread.join()
    finally:
        sys.setswitchinterval(interval)
    assert len(found[0]) == rounds * 100
    for others in found[1:]:
        assert all(one is other for one, other in zip(found[0], others, strict=True))


def test_unused_terms_are_freed_also_deep_ones() -> None:
    gc.collect()
    before = len(t._interned)
    item = t.variable('deep', t.word(32))
    for number in range(100_000):
        item = t.term('add', t.word(32), (item, item), number)
    assert len(t._interned) > before + 100_000
    del item
    gc.collect()
    assert len(t._interned) <= before
