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

"""The tree of coordinate frames against homogeneous matrices of numpy."""

from collections.abc import Iterator
import ctypes
from random import Random
from typing import Any

from fret_monitor.native import evaluator_library, load_evaluator
from fret_monitor.native.binding import ffi
import numpy
from numpy.typing import NDArray
import pytest
from transforms import LinkOf, links

Matrix = NDArray[numpy.float64]
SECOND = 10**9


class Tree:
    """The tree in C."""

    def __init__(self) -> None:
        self._library: Any = load_evaluator(evaluator_library())
        self._tree = ffi.gc(self._library.fm_tree_create(), self._library.fm_tree_destroy)

    def read(self, message: bytes, *, is_static: bool = False) -> bool:
        return bool(self._library.fm_tree_read(
            self._tree, ffi.from_buffer('uint8_t[]', message), len(message), is_static))

    def take(self, *items: LinkOf, is_static: bool = False) -> None:
        assert self.read(links(*items), is_static=is_static)

    def look_up(self, origin: str, to: str) -> tuple[Matrix, int] | None:
        found: Any = ffi.new('struct fm_looked_up *')
        if not self._library.fm_tree_look_up(self._tree, origin.encode(), to.encode(), found):
            return None
        return (matrix(list(found.pose.translation), list(found.pose.rotation)),
                int(found.stamp))

    def missing(self) -> tuple[str, str]:
        first, second = (bytes(ffi.buffer(
            self._library.fm_tree_missing(self._tree, of_to), 256)).partition(b'\0')[0].decode()
            for of_to in (False, True))
        return first, second

    @property
    def left_out(self) -> tuple[int, int, int]:
        found = self._library.fm_tree_left_out(self._tree)
        return found.loops, found.unusable, found.old


def matrix(translation: list[float], rotation: list[float]) -> Matrix:
    """Return the homogeneous matrix of a pose."""
    x, y, z, w = rotation
    found = numpy.eye(4)
    found[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]]
    found[:3, 3] = translation
    return found


def random_pose(rng: Random) -> tuple[list[float], list[float]]:
    quaternion = numpy.array([rng.gauss(0, 1) for _ in range(4)])
    return ([rng.uniform(-9, 9) for _ in range(3)],
            [float(part) for part in quaternion / numpy.linalg.norm(quaternion)])


def yaw(angle: float) -> list[float]:
    return [0.0, 0.0, float(numpy.sin(angle / 2)), float(numpy.cos(angle / 2))]


def link(parent: str, child: str, stamp: int = SECOND, x: float = 0.0,
         angle: float = 0.0) -> LinkOf:
    return LinkOf(stamp, parent, child, [x, 0.0, 0.0], yaw(angle))


def shuffled(rng: Random, items: list[LinkOf]) -> Iterator[LinkOf]:
    rng.shuffle(items)
    yield from items


@pytest.mark.parametrize('length', range(1, 21))
@pytest.mark.parametrize('statics', ['none', 'some', 'all'])
def test_a_chain_is_the_product_of_its_links(length: int, statics: str) -> None:
    rng = Random(length)
    poses = [random_pose(rng) for _ in range(length)]
    bend = rng.randrange(length + 1)  # the frame in which the two ends are rooted
    tree, product = Tree(), numpy.eye(4)
    stamps: list[int] = []
    static_stamps: list[int] = []
    items = []
    for number, (translation, rotation) in enumerate(poses):
        stamp = rng.randrange(SECOND, SECOND + 100)
        is_static = statics == 'all' or statics == 'some' and rng.random() < 0.5
        (static_stamps if is_static else stamps).append(stamp)
        here, there = f'f{number}', f'f{number + 1}'
        pose = matrix(translation, rotation)
        if number < bend:  # the link points the other way
            product = product @ numpy.linalg.inv(pose)
            here, there = there, here
        else:
            product = product @ pose
        # Two samples with one value hold it at each common time.
        items += [(is_static, LinkOf(0, here, there, translation, rotation))] * (not is_static)
        items.append((is_static, LinkOf(stamp, here, there, translation, rotation)))
    rng.shuffle(items)
    for is_static, item in items:
        tree.take(item, is_static=is_static)
    found = tree.look_up('f0', f'f{length}')
    assert found is not None
    assert numpy.allclose(found[0], product, rtol=0, atol=1e-12 * 9 * length)
    assert found[1] == min(stamps or static_stamps)
    back = tree.look_up(f'f{length}', 'f0')
    assert back is not None
    assert numpy.allclose(back[0] @ product, numpy.eye(4), rtol=0, atol=1e-12 * 9 * length)


def test_a_link_is_interpolated_at_the_latest_common_time() -> None:
    tree = Tree()
    tree.take(link('map', 'odom', SECOND, x=1.0))
    tree.take(link('odom', 'base', 0, x=0.0, angle=0.0))
    tree.take(link('odom', 'base', 4 * SECOND, x=8.0, angle=2.0))
    found = tree.look_up('map', 'base')
    assert found is not None
    assert found[1] == SECOND
    assert numpy.allclose(found[0], matrix([3.0, 0.0, 0.0], yaw(0.5)), atol=1e-14)


def test_opposite_quaternions_are_one_rotation_between_samples() -> None:
    tree = Tree()
    tree.take(link('map', 'other', SECOND))
    tree.take(LinkOf(0, 'map', 'base', [0.0] * 3, yaw(0.2)))
    tree.take(LinkOf(2 * SECOND, 'map', 'base', [0.0] * 3, [-part for part in yaw(0.6)]))
    found = tree.look_up('other', 'base')
    assert found is not None
    assert numpy.allclose(found[0], matrix([0.0] * 3, yaw(0.4)), atol=1e-14)


def test_there_is_no_extrapolation() -> None:
    tree = Tree()
    tree.take(link('map', 'odom', SECOND))
    tree.take(link('odom', 'base', 2 * SECOND))  # its only sample is later
    assert tree.look_up('map', 'base') is None
    assert tree.missing() == ('base', 'base')
    tree.take(link('map', 'odom', 2 * SECOND, x=5.0))
    found = tree.look_up('map', 'base')
    assert found is not None
    assert (found[0][0, 3], found[1]) == (5.0, 2 * SECOND)


def test_samples_may_come_late_and_twice() -> None:
    rng = Random(7)
    stamps = [number * SECOND // 100 for number in range(1000)]
    tree = Tree()
    for item in shuffled(rng, [link('map', 'base', at, x=at / SECOND) for at in stamps * 2]):
        tree.take(item)
    for at in sorted(rng.sample(range(SECOND // 2, 9 * SECOND), 200)):
        tree.take(link('map', 'clock', at))
        found = tree.look_up('clock', 'base')
        assert found is not None
        assert found[0][0, 3] == pytest.approx(at / SECOND, abs=1e-9)
    assert tree.left_out == (0, 0, 0)


def test_a_long_time_of_samples_keeps_the_last_ten_seconds() -> None:
    tree = Tree()
    for number in range(20_000):
        tree.take(link('map', 'base', number * SECOND // 1000, x=number))
    tree.take(link('map', 'clock', 12 * SECOND))
    found = tree.look_up('clock', 'base')
    assert found is not None
    assert found[0][0, 3] == 12_000
    tree.take(link('map', 'base', 9 * SECOND))
    assert tree.left_out == (0, 0, 1)
    tree = Tree()
    tree.take(link('map', 'base', 0), link('map', 'base', 10 * SECOND + 1), link('map', 'clock'))
    assert tree.look_up('clock', 'base') is None


def test_a_link_may_change_its_parent() -> None:
    tree = Tree()
    tree.take(link('map', 'one', 0), link('map', 'one', 9 * SECOND, x=0.0),
              link('map', 'two', 0, x=100.0), link('map', 'two', 9 * SECOND, x=100.0))
    tree.take(link('one', 'box', SECOND, x=1.0), link('one', 'box', 2 * SECOND, x=2.0))
    found = tree.look_up('map', 'box')
    assert found is not None
    assert (found[0][0, 3], found[1]) == (2.0, 2 * SECOND)
    tree.take(link('two', 'box', 3 * SECOND, x=3.0))
    found = tree.look_up('map', 'box')
    assert found is not None
    assert (found[0][0, 3], found[1]) == (103.0, 3 * SECOND)
    # Between samples with two parents the earlier holds, as in tf2.
    tree.take(link('map', 'clock', 5 * SECOND // 2))
    found = tree.look_up('clock', 'box')
    assert found is not None
    assert (found[0][0, 3], found[1]) == (2.0, 5 * SECOND // 2)


def test_a_link_that_closes_a_loop_is_refused() -> None:
    tree = Tree()
    tree.take(link('a', 'b'), link('b', 'c', x=2.0), link('c', 'a'), link('c', 'b', x=7.0))
    assert tree.left_out == (2, 0, 0)
    found = tree.look_up('a', 'c')
    assert found is not None
    assert found[0][0, 3] == 2.0


def test_links_that_closed_a_loop_at_no_time_end_a_look_up() -> None:
    tree = Tree()
    tree.take(link('a', 'b', SECOND), link('c', 'b', 3 * SECOND))
    tree.take(link('b', 'a', 2 * SECOND), link('map', 'c', 0), link('map', 'c', 4 * SECOND))
    tree.take(link('map', 'clock', 2 * SECOND))
    assert tree.look_up('clock', 'a') is None
    assert tree.look_up('a', 'clock') is None


def test_a_broken_chain_names_the_frames_between_which_a_link_is_missing() -> None:
    tree = Tree()
    assert tree.look_up('map', 'lidar') is None
    assert tree.missing() == ('map', 'lidar')
    tree.take(link('odom', 'base'), link('base', 'lidar'))
    assert tree.look_up('map', 'lidar') is None
    assert tree.missing() == ('map', 'odom')
    tree.take(link('earth', 'map'))
    assert tree.look_up('map', 'lidar') is None
    assert tree.missing() == ('earth', 'odom')
    tree.take(link('earth', 'odom'))
    assert tree.look_up('map', 'lidar') is not None


@pytest.mark.parametrize('item', [
    LinkOf(0, '', 'b', [0.0] * 3, yaw(0)), LinkOf(0, 'a', '', [0.0] * 3, yaw(0)),
    LinkOf(0, 'a', 'a', [0.0] * 3, yaw(0)), LinkOf(0, 'a', 'x' * 256, [0.0] * 3, yaw(0)),
    LinkOf(0, 'a', 'b', [float('nan'), 0.0, 0.0], yaw(0)),
    LinkOf(0, 'a', 'b', [0.0, float('inf'), 0.0], yaw(0)),
    LinkOf(0, 'a', 'b', [0.0] * 3, [0.0] * 4), LinkOf(0, 'a', 'b', [0.0] * 3, [0.1, 0, 0, 1]),
    LinkOf(0, 'a', 'b', [0.0] * 3, [float('nan')] * 4)])
def test_a_link_without_a_usable_transform_is_left_out(item: LinkOf) -> None:
    tree = Tree()
    tree.take(item)
    assert tree.left_out == (0, 1, 0)
    assert tree.look_up('a', 'b') is None


def test_a_slash_before_a_name_is_no_part_of_it() -> None:
    tree = Tree()
    tree.take(link('/map', '/base', x=3.0))
    assert tree.look_up('map', 'base') is not None


def test_frames_beyond_the_limit_are_left_out() -> None:
    tree = Tree()
    for number in range(1030):
        tree.take(link('map', f'f{number}'))
    assert tree.left_out == (0, 7, 0)
    assert tree.look_up('f0', 'f1022') is not None


def test_a_message_that_is_cut_short_changes_nothing() -> None:
    message = links(link('a', 'b'), link('b', 'c'))
    for size in range(len(message)):
        tree = Tree()
        copy = ctypes.create_string_buffer(message[:size], size)  # ends where its memory does
        assert not tree.read(copy.raw)
        assert tree.look_up('a', 'b') is None
    assert Tree().read(message)


def test_both_byte_orders_are_read() -> None:
    tree = Tree()
    tree.take(link('a', 'b', x=1.5), link('b', 'c', x=2.0))
    assert tree.read(links(link('a', 'b', x=1.5), link('b', 'c', x=2.0), is_little=False))
    found = tree.look_up('a', 'c')
    assert found is not None
    assert found[0][0, 3] == 3.5
