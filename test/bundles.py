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

"""Bundles of tests: written to a folder, and built to an engine."""

from pathlib import Path

from fret_monitor import build
from fret_monitor.runtime import Engine, Evaluator

BELOW_HALF = """
format: 1
inputs:
  x: {topic: x, type: std_msgs/msg/Float32}
requirements:
  - {id: R, ptltl: "x < 0.5"}
"""
NEGATIVE = """
format: 1
inputs:
  n: {topic: n, type: std_msgs/msg/Int32}
requirements:
  - {id: R, ptltl: "n < 0"}
"""
# A requirement of the requests of a service, for a gate on it
ARMED = """
format: 1
evaluation: {policy: every_message}
inputs:
  data: {topic: enable/_service_event, type: std_srvs/srv/SetBool_Event, field: "request[0].data"}
  safe: {topic: safe, type: std_msgs/msg/Bool}
requirements:
  - {id: ARMED, ptltl: "data -> safe"}
"""
# A gate on a service, which keeps a requirement ARM of the input `data` of its requests
ARM_INPUT = """\
  data: {topic: arm/_service_event, type: std_srvs/srv/SetBool_Event, field: "request[0].data"}
"""
ARM_GATE = """\
  arm:
    service: arm
    to: arm_raw
    type: std_srvs/srv/SetBool
    keep: [ARM]
    otherwise: {respond: {success: false, message: withheld}}
"""


def write_bundle(folder: Path, text: str, name: str = 'bundle.yaml') -> Path:
    """Write a bundle, and return its path."""
    path = folder / name
    path.write_text(text, encoding='utf-8')
    return path


def spec_of(folder: Path, text: str) -> str:
    """Write a bundle, and return the parameter `spec` of a node for it."""
    return f'spec:={write_bundle(folder, text)}'


def engine_of(folder: Path, text: str) -> Engine:
    """Write a bundle, and return an engine of its monitor."""
    return Engine(Evaluator(build.build(write_bundle(folder, text)).monitor))
