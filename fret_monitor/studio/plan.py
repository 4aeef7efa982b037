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

"""What a page watches of a running monitor: the topics of a bundle's verdicts and inputs."""

from typing import Any

from fret_monitor.export.layouts import drawn_values, DrawnValue
from fret_monitor.logic.specification import Specification
from fret_monitor.model.names import verdict_topic


def plan(specification: Specification) -> dict[str, Any]:
    """
    Return the requirements and inputs to watch, as JSON.

    Of inputs there are those of which a field of a message is the value; the others, such as the
    least element of an array, are named in `leftOut`.
    """
    drawn, left_out = drawn_values(specification, can_filter=False)
    return {
        'requirements': [{'id': item.id, 'topic': verdict_topic(item.handler)}
                         for item in specification.properties],
        'inputs': [_input(item) for item in drawn],
        'leftOut': list(left_out)}


def _input(item: DrawnValue) -> dict[str, Any]:
    return {
        'name': item.name, 'topic': item.topic, 'type': item.message_type,
        'path': [_step(part) for step in item.path for part in _parts(step)],
        'isDiscrete': item.is_discrete,
        'names': {str(value): name for name, value in item.values}}


def _parts(step: str) -> list[str]:
    return [step] if step.startswith('[') else step.removeprefix('.').split('.')


def _step(part: str) -> str | int:
    return int(part[1:-1]) if part.startswith('[') else part
