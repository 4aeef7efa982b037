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

"""Frozen classes that are compiled with their first instance, beside those of `dataclass`."""

import ast
from collections.abc import Iterator
from copy import copy
from dataclasses import asdict, dataclass, field, FrozenInstanceError, is_dataclass, replace
from pathlib import Path
import re
from threading import Barrier, Thread
from typing import Any

from fret_monitor.model.frozen import frozen
import pytest


def pair(decorate: Any) -> Any:
    """Return a class with fields and defaults, made by a decorator."""
    class Pair:
        """Two values."""

        x: int
        names: tuple[str, ...] = field(default_factory=tuple)

        def half(self) -> float:
            return self.x / 2

    return decorate(Pair)


@pytest.mark.parametrize('decorate', [frozen, dataclass(frozen=True)])
def test_it_behaves_as_a_frozen_dataclass(decorate: Any) -> None:
    kind = pair(decorate)
    one = kind(3, names=('a',))
    assert (one.x, one.names, one.half(), kind(1).names) == (3, ('a',), 1.5, ())
    assert one == kind(3, ('a',)) == copy(one) != kind(4)
    assert hash(one) == hash(kind(3, ('a',)))
    assert (replace(one, x=5).x, asdict(one)) == (5, {'x': 3, 'names': ('a',)})
    assert repr(one).endswith("Pair(x=3, names=('a',))")
    with pytest.raises(FrozenInstanceError):
        one.x = 4
    with pytest.raises(TypeError, match='missing 1 required positional argument'):
        kind()
    match one:
        case kind(x, names):
            assert (x, names) == (3, ('a',))


def test_it_is_compiled_with_its_first_instance() -> None:
    kind = pair(frozen)
    assert not is_dataclass(kind)
    kind(1)
    assert is_dataclass(kind)


def test_its_first_instance_may_come_out_of_a_pickle_which_calls_new_alone() -> None:
    kind = pair(frozen)
    found = kind.__new__(kind)
    vars(found).update(x=5, names=())
    assert found == kind(5)


def test_several_threads_may_make_the_first_instance() -> None:
    for _ in range(50):
        kind, barrier, found = pair(frozen), Barrier(8), []

        def make() -> None:
            barrier.wait()  # noqa: B023  each round joins its threads
            found.append(kind(1))  # noqa: B023

        threads = [Thread(target=make) for _ in range(8)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert found == [kind(1)] * 8


def test_no_class_derives_from_a_frozen_one_which_has_no_fields_yet() -> None:
    root = Path(__file__).resolve().parents[2]
    texts = [path.read_text() for room in ('fret_monitor', 'test')
             for path in (root / room).rglob('*.py')]

    def classes(pattern: str) -> Iterator[ast.ClassDef]:
        for text in texts:
            if re.search(pattern, text):
                yield from (node for node in ast.walk(ast.parse(text))
                            if isinstance(node, ast.ClassDef))

    lazy = {node.name for node in classes(r'@frozen\b')
            if any(isinstance(item, ast.Name) and item.id == 'frozen'
                   for item in node.decorator_list)}
    derived = {node.name for node in classes(rf'class \w+\([^)]*\b({"|".join(lazy)})\b')
               if any(isinstance(base, ast.Name) and base.id in lazy for base in node.bases)}
    assert lazy
    assert not derived
