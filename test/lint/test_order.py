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

"""Warnings of a bundle come in the order of the file, whichever stage found them."""

from pathlib import Path

from fret_monitor import build

BUNDLE = """
format: 1
inputs:
  p: {topic: p, type: std_msgs/msg/Bool}
  q: {topic: q, type: std_msgs/msg/Bool}
requirements:
  - {id: R1, fretish: "the sw shall within 2 seconds satisfy p"}
  - {id: R2, cocospec: "pre p"}
  - {id: R3, ptltl: "p | !p"}
  - {id: R4, fretish: "the sw shall eventually satisfy p"}
"""


def test_warnings_come_in_the_order_of_the_bundle(tmp_path: Path) -> None:
    bundle = tmp_path / 'bundle.yaml'
    bundle.write_text(BUNDLE, encoding='utf-8')
    warnings = build.generate_monitor(build.read(bundle)).warnings
    lines = [item.span.line for item in warnings if item.span]
    assert lines == [5, 7, 8, 9, 10]
