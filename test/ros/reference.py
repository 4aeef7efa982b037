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

"""The violations that a node must publish, computed by the reference semantics alone."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from fret_monitor import build
from fret_monitor.logic.evaluate import verdicts
from fret_monitor.logic.pointwise import Value
from fret_monitor.logic.specification import Property
from fret_monitor.model.policies import Policy, Report

Message = tuple[str, dict[str, Value]]
"""The topic of a message, and the inputs that it feeds."""


def expected(bundle: Path, messages: Sequence[Message],
             policy: Policy = Policy.EVERY_MESSAGE) -> dict[str, int]:
    """Return how often each requirement is violated, for messages in this order."""
    specification = build.read(bundle, policy=policy).specification
    return dict(Counter({
        item.handler.removeprefix('handlerprop'): _announced(item, messages, policy)
        for item in specification.properties}))


def _announced(item: Property, messages: Sequence[Message], policy: Policy) -> int:
    read = set(item.inputs)
    rows = _rows(read, messages, policy)
    trace = {name: [row[name] for row in rows] for name in read}
    truth = verdicts(item.formula, trace) if rows else []
    if item.report is Report.EVERY_STEP:
        return truth.count(False)
    return sum(before and not now for before, now in zip([True, *truth], truth))


def _rows(read: set[str], messages: Sequence[Message],
          policy: Policy) -> list[dict[str, Value]]:
    """Return the inputs of each step; there is no step before all inputs have a value."""
    values: dict[str, Value] = {}
    fresh: set[str] = set()
    rows = []
    for _, fed in messages:
        values.update(fed)
        fresh |= fed.keys()
        is_due = {
            Policy.EVERY_MESSAGE: True,
            Policy.RELEVANT_MESSAGE: bool(read & fed.keys()),
            Policy.ALL_INPUTS: fresh >= read,
        }[policy]
        if is_due and values.keys() >= read:
            rows.append(dict(values))
            fresh = set()
    return rows
