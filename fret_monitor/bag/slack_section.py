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

"""The slack of a sentence with a deadline in a report: of its triggers, the least first."""

from collections.abc import Callable, Iterator
from operator import attrgetter

from fret_monitor.bag.evidence import Occurrence
from fret_monitor.bag.findings import Findings, Slack
from fret_monitor.bag.page import escaped, table
from fret_monitor.model.diagnostics import counted

_MOST_SHOWN = 5


def slack_section(item: Findings, since: Callable[[int], str]) -> Iterator[str]:
    """Yield the least slack of a requirement, and the triggers that had least; nothing without."""
    if item.slack is None:
        return
    yield f'<p>Least slack: {escaped(slack_text(item.slack))}.</p>'
    found = sorted(item.slacks, key=attrgetter('left'))
    if found:
        yield table(('trigger', 'response', 'slack'), [
            (since(each.trigger), 'none' if each.until is None else since(each.until),
             slack_text(each)) for each in found[:_MOST_SHOWN]])
    if len(found) > _MOST_SHOWN:
        yield f'<p class="faint">and {counted(len(found) - _MOST_SHOWN, "trigger")} more</p>'


def slack_text(found: Slack) -> str:
    """Return how much time was left."""
    most = '' if found.until is not None else ' at most'
    return f'{found.left:.6g} {found.unit}{most}{f" of {found.key}" if found.key else ""}'


def slack_of(item: Findings, occurrence: Occurrence) -> Slack | None:
    """Return the slack of the trigger whose response was late when an occurrence began."""
    time, key = occurrence.start.time, occurrence.start.key
    name = '' if key is None else item.shown_key(key)
    late = (each for each in item.slacks if each.left < 0 and each.key == name)
    return None if occurrence.is_open else next(
        (each for each in late if each.trigger < time and (
            each.until is None or time <= each.until)), None)
