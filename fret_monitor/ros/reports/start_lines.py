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

"""The log lines at the start: one in total, and one for each bundle if there are several."""

from collections.abc import Iterator, Sequence

from fret_monitor.model.policies import Stamp
from fret_monitor.ros.settings.opened import Opened


def announcement(opened: Sequence[Opened]) -> Iterator[str]:
    """Yield the lines; the last one begins with `watching`."""
    if len(opened) == 1:
        yield f'watching {_contents(opened)}, {_terms(opened[0])}'
        return
    for item in opened:
        yield f'bundle {item.monitor.manifest.name}: {_contents([item])}, {_terms(item)}'
    yield f'watching {_contents(opened)} in {len(opened)} bundles, {_state(opened)}'


def _contents(opened: Sequence[Opened]) -> str:
    manifests = [item.monitor.manifest for item in opened]
    topics = {topic.name for manifest in manifests for topic in manifest.topics}
    return (f'{count(sum(len(item.requirements) for item in manifests), "requirement")} '
            f'on {count(sum(len(item.inputs) for item in manifests), "input")} '
            f'of {count(len(topics), "topic")}')


def _terms(opened: Opened) -> str:
    manifest = opened.monitor.manifest
    period = '' if opened.period is None else f'{opened.period:g} s, '
    if manifest.stamp is Stamp.HEADER:
        period = f'by the stamps of headers, reordered within {manifest.reorder / 1e9:g} s, '
    return f'policy {opened.policy.value}, {period}{_state([opened])} ({opened.origin})'


def _state(opened: Sequence[Opened]) -> str:
    total = sum(item.monitor.manifest.state_bytes for item in opened)
    return f'{count(total, "byte")} of state'


def count(number: int, noun: str) -> str:
    """Return a number and its noun, in the plural unless the number is 1."""
    return f'{number} {noun}' if number == 1 else f'{number} {noun}s'
