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


"""A rate beyond `max_rate`, and over an hour without messages: the same in `bag`, `simulate`."""

from decimal import Decimal
from itertools import pairwise
from pathlib import Path

from bag.recordings import FLOAT, START, write
from fret_monitor.cli.main import main
import pytest

BUNDLE = """format: 1
evaluation: {policy: timed}
inputs:
  a_rate: {topic: a, type: TYPE, field: rate(1 s), max_rate: 10}
  a: {topic: a, type: TYPE, max_rate: 10}
requirements:
  - {id: RATE, ptltl: "a_rate <= 1000.0"}
  - {id: ALIVE, ptltl: "a_rate >= 1.0"}
  - {id: COUNT, ptltl: "countOver(1 s, a > 0.0) <= 1000"}
""".replace('TYPE', FLOAT)
HOUR_MS = 3_600_000
# Sixty messages in 0.59 s, of which a rate keeps 21 and a count 22; then none for an hour.
TIMES_MS = [*range(0, 600, 10), HOUR_MS, HOUR_MS + 1]
# 39 messages are missed until the last of them has left, 1 s later. A window with both its ends
# misses one more nanosecond.
EXPECTED = [['0.22', '1', '1', '0'], ['1', '0', '0', '0'], ['1.370000001', '0', '0', '1'],
            ['1.38', '1', '1', '1'], ['1.59', '1', '0', '1'], ['3600', '1', '1', '1']]


def changes(rows: list[list[str]]) -> list[list[str]]:
    """Return the rows at which a verdict changes, the last of each time; times since START."""
    found = {Decimal(time) - START // 10 ** 9: [item or '1' for item in verdicts]
             for time, *verdicts in rows}  # not judged yet is not violated
    shown = [['', '1', '1', '1'], *([str(time.normalize() if time % 1 else int(time)), *verdicts]
                                    for time, verdicts in found.items())]
    return [row for before, row in pairwise(shown) if before[1:] != row[1:]]


def test_a_rate_beyond_its_room_is_violated_until_what_was_lost_has_left(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, table = tmp_path / 'rate.yaml', tmp_path / 'trace.csv'
    file.write_text(BUNDLE)
    table.write_text('time,a\n' + ''.join(
        f'{Decimal(START) / 10 ** 9 + Decimal(time) / 1000},1\n' for time in TIMES_MS))
    assert main(['simulate', str(file), '--trace', str(table)]) == 0
    printed = capsys.readouterr()
    assert '77 changes came faster than max_rate says: ' in printed.err  # 39 and 38
    _, *rows = (line.split(',') for line in printed.out.splitlines())
    assert changes(rows) == EXPECTED
    bag = write(tmp_path / 'bag', [('/a', time * 1_000_000, 1.0) for time in TIMES_MS])
    assert main(['bag', str(file), str(bag), '--csv', str(tmp_path / 'out.csv')]) == 1
    _, _, *rows = (line.split(',') for line in (tmp_path / 'out.csv').read_text().splitlines())
    assert changes(rows) == EXPECTED
    assert '77 changes came faster than max_rate says: ' in capsys.readouterr().err


PERIOD = """format: 1
evaluation: {policy: every_message}
inputs:
  pause: {topic: a, type: TYPE, field: period()}
requirements:
  - {id: APART, ptltl: "pause > 0.0"}
""".replace('TYPE', FLOAT)


def test_two_messages_at_one_time_are_no_seconds_apart(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / 'period.yaml'
    file.write_text(PERIOD)
    bag = write(tmp_path / 'bag', [('/a', time, 1.0) for time in (0, 0, 1_000_000_000)])
    assert main(['bag', str(file), str(bag)]) == 0
    assert ['APART', 'VIOLATED', '1', '0', 's', '1', 's'] in [
        line.split() for line in capsys.readouterr().out.splitlines()]
