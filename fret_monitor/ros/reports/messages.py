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


"""Statuses of `csrc/reporting` as messages."""

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from fret_monitor.runtime.reporting import StatusRecord


def status_message(record: StatusRecord) -> DiagnosticStatus:
    return DiagnosticStatus(
        level=bytes((record.level,)), name=record.name, message=record.message,
        hardware_id=record.hardware_id,
        values=[KeyValue(key=key, value=value) for key, value in record.values])


def status_record(message: DiagnosticStatus) -> StatusRecord:
    return StatusRecord(
        message.level[0], message.name, message.message, message.hardware_id,
        tuple((item.key, item.value) for item in message.values))
