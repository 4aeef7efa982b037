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

"""Silences are logged once when they have begun, and once when they have ended."""

from typing import Any

from fret_monitor import build
from fret_monitor.model.manifest import Manifest
from fret_monitor.ros.reports.health import describe_silences
from fret_monitor.ros.reports.silences import SilenceLog, some
from fret_monitor.runtime import InputCounts, Silence
import pytest

BUNDLE = """
format: 1
inputs:
  x: {topic: t, type: geometry_msgs/msg/Point, field: x, timeout: 1.5, startup: 3,
      stale: violate}
  y: {topic: t, type: geometry_msgs/msg/Point, field: y, timeout: 1.5, startup: 3,
      stale: violate}
  z: {topic: z, type: std_msgs/msg/Float32, timeout: 0.5}
  n: {topic: n, type: std_msgs/msg/Float32}
requirements:
  - {id: R, ptltl: "x < 1.0 & n < 1.0"}
  - {id: S, ptltl: "y < 1.0 & z < 1.0"}
"""
X, Y, Z = range(3)
SECOND = 10**9


class Recorder:
    """A node and an engine: has silences, and keeps what is logged."""

    def __init__(self) -> None:
        self.silences = {index: Silence(0, 0, False) for index in (X, Y, Z)}
        self.received = 1
        self.lines: list[tuple[str, str]] = []

    def silence(self, index: int) -> Silence:
        return self.silences[index]

    def input_counts(self, index: int) -> InputCounts:
        return InputCounts(self.received, 0, 0)

    def resolve_topic_name(self, name: str) -> str:
        return f'/robot/{name}'

    def get_logger(self) -> 'Recorder':
        return self

    def error(self, line: str) -> None:
        self.lines.append(('error', line))

    def warning(self, line: str) -> None:
        self.lines.append(('warning', line))

    def info(self, line: str) -> None:
        self.lines.append(('info', line))


@pytest.fixture(scope='module')
def manifest(tmp_path_factory: pytest.TempPathFactory) -> Manifest:
    path = tmp_path_factory.mktemp('silences') / 'bundle.yaml'
    path.write_text(BUNDLE, encoding='utf-8')
    return build.build(path).monitor.manifest


def reviewed(recorder: Any, manifest: Manifest, *steps: dict[int, Silence]) -> list[list[Any]]:
    """Return the lines that are logged in each of these states."""
    log = SilenceLog(recorder, manifest, recorder)
    found = []
    for silences in steps:
        recorder.silences.update(silences)
        recorder.lines = []
        log.review()
        found.append(recorder.lines)
    return found


def test_a_silence_is_logged_once_with_the_requirements_that_it_violates(
    manifest: Manifest,
) -> None:
    is_silent = Silence(1, 2 * SECOND, True)
    assert reviewed(
        Recorder(), manifest, {}, {X: is_silent, Y: is_silent}, {}, {Z: is_silent},
        {X: Silence(1, 3 * SECOND, False)}, {},
    ) == [
        [],
        [('error', "no usable value on /robot/t within the timeout of 1.5 s for 'x', 'y': R, S "
                   'violated until one comes')],
        [],
        [('warning', "no usable value on /robot/z within the timeout of 0.5 s for 'z'")],
        [('info', "values on /robot/t again after 3.0 s, for 'x'")],
        [],
    ]


def test_a_silence_between_two_reviews_is_logged_with_its_end(manifest: Manifest) -> None:
    ended = Silence(1, 2 * SECOND, False)
    assert reviewed(
        Recorder(), manifest, {Z: ended}, {Z: Silence(2, SECOND, True)},
        {Z: Silence(3, SECOND, True)}, {Z: Silence(3, SECOND, False)},
        {Z: Silence(5, SECOND, True)},
    ) == [
        [('warning', "no usable value on /robot/z within the timeout of 0.5 s for 'z'"),
         ('info', "values on /robot/z again after 2.0 s, for 'z'")],
        [('warning', "no usable value on /robot/z within the timeout of 0.5 s for 'z'")],
        [('warning', "again no usable value on /robot/z within the timeout of 0.5 s for 'z'")],
        [('info', "values on /robot/z again after 1.0 s, for 'z'")],
        [('warning', "again no usable value on /robot/z within the timeout of 0.5 s for 'z'")],
    ]


def test_a_silence_before_the_first_value_is_logged_with_the_startup(manifest: Manifest) -> None:
    recorder = Recorder()
    recorder.received = 0
    is_silent = Silence(1, 12 * SECOND, True)
    assert reviewed(recorder, manifest, {X: is_silent}, {Z: is_silent}) == [
        [('error', "no usable value on /robot/t within the startup of 3 s for 'x': R violated "
                   'until one comes')],
        [('warning', "no usable value on /robot/z within the startup of 10 s for 'z'")],
    ]


def test_only_inputs_with_a_timeout_have_silences(manifest: Manifest) -> None:
    recorder: Any = Recorder()
    assert [*SilenceLog(recorder, manifest, recorder).present()] == [X, Y, Z]


def test_a_line_names_five_and_counts_the_others() -> None:
    assert some(['a', 'b']) == 'a, b'
    assert some(list('abcdefg'), '; ') == 'a; b; c; d; e and 2 more'


def test_diagnostics_have_the_time_of_each_silent_input() -> None:
    assert describe_silences({'x': SECOND}) == 'nothing for 1.0 s of x'
    assert describe_silences({'x': SECOND, 'ghost': 16 * SECOND, 'y': SECOND}) == (
        'nothing for 1.0 s of x, y, for 16.0 s of ghost')
