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

"""Formulas are interned: structural equality is identity, in every thread."""

from collections.abc import Iterator
import gc
import sys
from threading import Barrier, Thread

from fret_monitor.logic import formula as f
from fret_monitor.model.values import ValueType
import pytest

ROUNDS = 60
THREADS = 4


@pytest.fixture
def frequent_switches() -> Iterator[None]:
    """Have threads take turns as often as Python allows."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


def built(seed: int) -> list[f.Formula]:
    """Return formulas that no other seed gives."""
    nodes: list[f.Formula] = [f.Variable(f'x{seed}', ValueType.BOOL)]
    for high in range(40):
        nodes.append(f.Once(f.Window(0, high), nodes[-1]))
    return nodes


@pytest.mark.usefixtures('frequent_switches')
def test_threads_get_the_same_object_for_the_same_formula() -> None:
    found: list[list[list[f.Formula]]] = [[] for _ in range(THREADS)]
    start = Barrier(THREADS)

    def build(mine: list[list[f.Formula]]) -> None:
        for seed in range(ROUNDS):
            start.wait()
            mine.append(built(seed))

    threads = [Thread(target=build, args=(mine,)) for mine in found]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    twins = sum(len({id(node) for node in nodes}) - 1
                for rounds in zip(*found, strict=True) for nodes in zip(*rounds, strict=True))
    assert twins == 0


def test_an_unreferenced_formula_is_freed() -> None:
    gc.collect()  # the formulas of other tests
    before = len(f._interned)
    nodes = built(-1)
    assert len(f._interned) == before + len(nodes)
    del nodes
    gc.collect()
    assert len(f._interned) == before
