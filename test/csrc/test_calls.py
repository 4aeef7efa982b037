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

"""The order of csrc: a file calls only functions of files before its own (docs/design.md)."""

from collections.abc import Iterator
from functools import cache
from pathlib import Path
import re

from fret_monitor.native import csrc_directory
from fret_monitor.native.cache import CSRC_ROOMS

# Within the other rooms there is no circle.
ORDER = {
    'evaluator': ('instance', 'tables', 'due', 'steps', 'measures', 'deadlines', 'evaluator',
                  'gate', 'states', 'keys', 'pairs', 'heap', 'aggregates', 'pool', 'scopes_steps',
                  'scopes_due',
                  'scopes_making', 'scopes'),
    'engine': ('thread', 'scheduling', 'transforms', 'handover', 'outbox', 'reorder', 'blackbox',
               'mcap', 'blackbox_file', 'engine_clock', 'engine_findings', 'engine_message',
               'engine_scopes', 'engine_due', 'engine_backlog', 'engine_delivery', 'seen',
               'engine_graph', 'engine_transforms', 'engine_gate', 'engine', 'blackbox_writer',
               'schedule', 'schedules', 'payload',
               'snapshot', 'records'),
}
_FUNCTION = re.compile(
    r'^(?!typedef|#)[A-Za-z_][\w *]*?\b(\w+)\([^;{}]*\)\s*\{', re.MULTILINE)
_NO_CALL = re.compile(r'//[^\n]*|"(?:\\.|[^"\\\n])*"')


@cache
def texts() -> dict[Path, str]:
    """Return the text of each C file of the rooms, without comments and strings."""
    return {path: _NO_CALL.sub('', path.read_text(encoding='utf-8'))
            for room in CSRC_ROOMS for path in sorted((csrc_directory() / room).glob('*.c'))}


@cache
def calls() -> dict[Path, dict[Path, set[str]]]:
    """Return which functions of which other files each file calls."""
    defined = {name: path for path, text in texts().items() for name in _FUNCTION.findall(text)
               if name.startswith('fm_')}
    found: dict[Path, dict[Path, set[str]]] = {path: {} for path in texts()}
    for path, text in texts().items():
        for name in set(re.findall(r'\b(fm_\w+)\(', text)):
            if name in defined and defined[name] != path:
                found[path].setdefault(defined[name], set()).add(name)
    return found


def upward() -> Iterator[str]:
    """Yield the calls into later rooms, or into later files of a room with an order."""
    for path, called in calls().items():
        for other, names in called.items():
            room = path.parent.name
            before, after = (CSRC_ROOMS.index(each.parent.name) for each in (path, other))
            if before == after and room in ORDER:
                before, after = (ORDER[room].index(each.stem) for each in (path, other))
            if after > before:
                yield f'{room}/{path.name} calls {sorted(names)} of {other.name}'


def test_each_file_has_a_place_in_the_order() -> None:
    for room, names in ORDER.items():
        assert sorted(names) == [path.stem for path in texts() if path.parent.name == room]
    assert sum(map(len, calls().values())) > 50  # that calls are found at all


def test_calls_point_to_earlier_files() -> None:
    assert list(upward()) == []


def test_no_file_calls_itself_through_others() -> None:
    reached = {path: set(called) for path, called in calls().items()}
    for _ in reached:
        for path, others in reached.items():
            reached[path] = others.union(*(reached[other] for other in others))
    assert [path.name for path, others in reached.items() if path in others] == []
