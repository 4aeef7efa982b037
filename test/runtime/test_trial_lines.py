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

"""What is reported of a requirement with a probability: details, the log, and `/diagnostics`."""

from pathlib import Path

from fret_monitor.runtime.probability import PooledTest
from fret_monitor.runtime.reporting import read_detail, Reporter, ReportTable
from runtime.reviewed import ERROR, OK, Reviewed, WARN
from runtime.test_reporting import ViolationLog

BUNDLE = """
format: 1
confidence: 0.9
inputs:
  c: {topic: c, type: std_msgs/msg/Bool}
  r: {topic: r, type: std_msgs/msg/Bool}
requirements:
  - id: P
    fretish: upon c the robot shall with probability > 0.8 immediately satisfy r
    report: onset
"""
KEYS = ['decided trials', 'failed trials', 'estimated probability', 'interval of the probability']


def trial(reviewed: Reviewed, *, succeeds: bool, at: float) -> None:
    """Deliver a trigger, whose response is there or not."""
    reviewed.send(1, {'data': succeeds}, at)
    reviewed.send(0, {'data': True}, at + 0.1)
    reviewed.send(0, {'data': False}, at + 0.2)


def begun(folder: Path) -> Reviewed:
    reviewed = Reviewed(folder, BUNDLE)
    reviewed.send(0, {'data': False}, 1.1)
    reviewed.send(1, {'data': False}, 1.2)
    return reviewed


def test_a_status_counts_the_trials_and_says_what_is_shown(tmp_path: Path) -> None:
    reviewed = begun(tmp_path)
    found = reviewed.statuses()['P']
    assert (found.level, found.message) == (
        OK, 'open: 0 of 0 trials failed, probability > 0.8 required')
    assert dict(found.values)['estimated probability'] == ''
    trial(reviewed, succeeds=True, at=2)
    trial(reviewed, succeeds=False, at=3)
    found = reviewed.statuses()['P']
    assert found.message == 'open: 1 of 2 trials failed, probability > 0.8 required'
    values = dict(found.values)
    assert [values[key] for key in KEYS[:3]] == ['2', '1', '0.5']
    asked = reviewed.manifest.requirements[0].probability
    assert asked is not None
    pooled = PooledTest(asked)
    pooled.add_runs([1, 0])
    figures = pooled.figures()
    assert values[KEYS[3]] == f'{figures.low:.6g} to {figures.high:.6g}, confidence 0.9'
    for number in range(6):
        trial(reviewed, succeeds=False, at=4 + number)
    found = reviewed.statuses()['P']
    assert (found.level, found.message) == (
        ERROR, 'refuted: 7 of 8 trials failed, probability > 0.8 required')


def test_what_is_assured_says_so_and_inputs_come_first(tmp_path: Path) -> None:
    reviewed = Reviewed(tmp_path, BUNDLE)
    assert reviewed.summaries()['P'] == (WARN, 'no value yet of c, r')
    for number in range(40):
        trial(reviewed, succeeds=True, at=2 + number)
    assert reviewed.summaries()['P'][1].startswith('assured: 0 of ')


def test_details_and_the_log_have_the_trials_of_the_violation(tmp_path: Path) -> None:
    reviewed = begun(tmp_path)
    reporter = Reporter(reviewed.engine, ReportTable(reviewed.manifest))
    log = ViolationLog(reporter)
    reviewed.engine.want_details(True, 100)
    details = []
    for number in range(6):
        trial(reviewed, succeeds=False, at=2 + number)
        while (detail := reviewed.engine.take_detail(0)) is not None:
            details.append(reporter.detail(detail))
            lines = log.add(detail, int((3 + number) * 1e9))
    (found,) = details
    values = dict(found.values)
    assert values['c'] == 'true' and values['r'] == 'false'
    assert values['decided trials'] == values['failed trials']
    assert values['estimated probability'] == '0'
    assert read_detail(reporter.library, found) is not None
    (line,) = lines
    count = values['decided trials']
    assert f'{count} of {count} trials failed, probability 0 (0 to ' in line.text
    assert line.text.index('trials failed') < line.text.index('c = true')
