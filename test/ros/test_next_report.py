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

"""What another program reads from `/diagnostics`: all requirements of a node, and no others."""

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from fret_monitor.testing.next_report import complete, reports


def status(name: str, **values: str) -> DiagnosticStatus:
    return DiagnosticStatus(name=name, message='holds', values=[
        KeyValue(key=key, value=value) for key, value in values.items()])


ARRAY = DiagnosticArray(status=[
    status('monitor: R', steps='3', announced='1'), status('monitor: S', evaluations='2',
                                                           announced='0'),
    status('monitor: topic /x', undecodable='4', lost='5'),
    status('/robot/monitor: T', steps='9', announced='9'),
    status('other: U', steps='1', announced='1')])


def test_a_report_is_complete_with_the_last_requirement_and_stays_so() -> None:
    found = reports(ARRAY, 'monitor')
    assert list(found) == ['R', 'S', 'topic /x', 'T']
    for wanted in (1, 2, 3):
        report = complete(found, wanted)
        assert report is not None
        assert [(item.id, item.steps, item.announced) for item in report.requirements] == [
            ('R', 3, 1), ('S', 2, 0), ('T', 9, 9)]
        assert [(item.undecodable, item.lost) for item in report.topics] == [(4, 5)]
    assert complete(found, 4) is None


def test_topics_alone_are_no_report() -> None:
    assert complete(reports(DiagnosticArray(status=ARRAY.status[2:3]), 'monitor'), 0) is None
