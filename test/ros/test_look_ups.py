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

"""Names of elements that no message has had are logged once, and again after they were found."""

from types import SimpleNamespace
from typing import Any

from fret_monitor.model.manifest import ManifestInput
from fret_monitor.model.paths import LookUp
from fret_monitor.model.values import ValueType
from fret_monitor.ros.reports.look_ups import LookUpLog


class _Bench(SimpleNamespace):
    """Node, manifest and engine of one input, and a clock."""

    now = 0.0
    received = 0

    def log(self) -> LookUpLog:
        item = ManifestInput('elbow', ValueType.FLOAT64, 'joints', 'any',
                             ('position', LookUp(('name',), 'elbow', is_parallel=True)), (), None)
        self.lines: list[str] = []
        node: Any = SimpleNamespace(
            resolve_topic_name=lambda name: f'/{name}',
            get_logger=lambda: SimpleNamespace(warning=self.lines.append))
        engine: Any = SimpleNamespace(
            input_counts=lambda _: SimpleNamespace(received=self.received),
            value=lambda _: self.received or None)
        manifest: Any = SimpleNamespace(inputs=(item,))
        return LookUpLog(node, manifest, engine, lambda: self.now)


def test_a_name_is_logged_after_ten_seconds_and_again_when_it_was_lost() -> None:
    bench = _Bench()
    log = bench.log()

    def pass_seconds(seconds: int, *, is_found: bool) -> None:
        for _ in range(seconds):
            bench.now += 1.0
            bench.received += is_found
            if not is_found:
                log.note_absent(0)
            log.review()

    pass_seconds(10, is_found=False)
    assert (bench.lines, list(log.missing)) == ([], [])
    pass_seconds(30, is_found=False)
    assert bench.lines == [
        '/joints: no message has had position[name = elbow] for 10 s; '
        "input 'elbow' has no value yet"]
    assert list(log.missing) == [0]
    pass_seconds(1, is_found=True)
    assert list(log.missing) == []
    pass_seconds(9, is_found=False)
    pass_seconds(1, is_found=True)  # another node's message has it
    pass_seconds(9, is_found=False)
    assert len(bench.lines) == 1
    pass_seconds(9, is_found=False)
    assert bench.lines[1:] == [
        '/joints: no message has had position[name = elbow] for 10 s; '
        "input 'elbow' keeps its value"]
