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

# flake8: noqa
# ruff: noqa
# mypy: ignore-errors

"""What csrc/reporting/words.h has, and parameter_table.h; written by `declarations.py`, not by hand."""

WAITING = 'waiting to be configured and activated: autostart is false'
INACTIVE = 'nothing is monitored until the node is active again'
NO_RESTART = 'nothing to restart: the node is not active'
NAMESAKE = 'there is another node %s: both watch and announce; give one another name (-r __node:=NAME) to tell them apart in /diagnostics, ~/reset and transitions'
NO_ENDPOINT = 'cannot subscribe or advertise'
NO_THREAD = 'no thread can be started'
NO_WORKING_DIRECTORY = "parameter 'blackbox' is '%s', in a working directory that was deleted: give the whole path"
UNANSWERED = "gate '%s': no server of %s answers; the request is refused"
RESPONSE_NOT_SENT = 'the response of %s is not sent: %s'
NEGATIVE_TIME = 'a message on /clock is ignored: its time is negative, %.3f s'
KEY_SIZE = 'a key has 1 to 255 bytes'
NO_SERVER = 'no server of %s in %g s'
NO_ANSWER = '%s has not answered in %g s'
NO_SUCCESS = '%s answered without success%s%s'
NOT_SENT = 'the middleware does not send the request to %s'
NO_REQUEST = 'the middleware does not read its request'
NOT_PUBLISHED = 'the middleware does not publish its message'
REFUSED = '%s refused to leave the state %s'
STILL_IN = '%s is %s'
NO_WAY = '%s is %s, from where no transition leads to %s'
WAKES = 'messages are taken in C, in a thread of its own: '
HOT_PATH_IS_OFF = 'hot_path is off'
UNKNOWN_CALLBACKS = 'the callbacks of %s are not known to allow it'
TAKES = 'messages are taken in C, inside %s%s%s'
ALL_COPIED = ', and copied before they are read: '
COPIED = 'messages on %s are copied before they are read: '
NO_SUPPORT = '%s has no type support for Fast DDS'
NO_MARGINS = "parameter 'margins': it was compiled without margins: give --margins to compile or export"
NO_MARGINS_OF_GATES = "parameter 'margins': a gate has no margins"
COUNT = 'a number of messages, 1 to 2147483647'
READ_AT_START = '%s: read at the start of the process only'
READ_ONCE = '%s: read when the node is configured, so deactivate and clean up first'
NOT_WANTED = "parameter '%s' is %s, and has to be %s"
NO_PARAMETER = "there is no parameter '%s'"
IGNORED = "ignored parameter '%s': %s"
ALL_PARAMETERS = 'this node has %s, constants.NAME'
NO_CONSTANT = "parameter '%s': no bundle has this constant: %s"
ALL_CONSTANTS = 'the constants are %s'
NO_CONSTANTS = 'there are none'
NO_PRIORITY = 'the priority %d is not possible: %s'
NO_PROCESSORS = 'to run on the processors %s is not possible: %s'
NO_LOCKED_MEMORY = 'to lock the memory is not possible: %s'
OVERRIDES = 'qos_overrides.'
OVERRIDE = '%s.subscription.%s'
POLICY = '%s of the subscription to %s; read at the start of the process%s'

PARAMETERS = (
    ('hot_path', 'SWITCH', 'UNCONFIGURED', 'auto', 0, 0, 'one of auto, on, off', "whether the middleware's callbacks take the messages: auto (where this is known to work), on, off (they wake a thread that does); read by `configure`"),
    ('handler_depth', 'COUNT', 'UNCONFIGURED', 1000, 1, 2147483647, 'a number of messages, 1 to 2147483647', 'violations that a slow listener of one handler may be behind before it loses some; read by `configure`'),
    ('log_violations', 'FLAG', 'UNCONFIGURED', True, 0, 0, 'true or false', 'whether the node logs violations and their ends; false if the logger does; read by `configure`'),
    ('verdicts', 'FLAG', 'UNCONFIGURED', False, 0, 0, 'true or false', 'whether the verdict of each requirement is published on copilot/verdict/ID; read by `configure`'),
    ('margins', 'FLAG', 'UNCONFIGURED', False, 0, 0, 'true or false', 'whether margins are published on copilot/margin, and shown with violations; read by `configure`'),
    ('blackbox', 'TEXT', 'UNCONFIGURED', '', 0, 0, 'the path of a folder', 'a folder to which the last messages of all topics are written at each violation; empty: none are kept; read by `configure`'),
    ('blackbox_seconds', 'SECONDS', 'UNCONFIGURED', 10.0, 0, 1000000000, 'a number above 0, at most 1000000000 (seconds, say 10.0)', 'seconds of messages before a violation that a file has; read by `configure`'),
    ('blackbox_bytes', 'COUNT', 'UNCONFIGURED', 67108864, 4096, 4611686018427387903, 'a number of bytes, at least 4096: -p blackbox_bytes:=4096', 'memory for the last messages, in bytes, for each bundle; read by `configure`'),
    ('blackbox_files', 'COUNT', 'UNCONFIGURED', 20, 1, 4611686018427387903, 'a number of files, at least 1: -p blackbox_files:=1', 'files of black boxes in the folder, at most: the oldest are removed; read by `configure`'),
    ('blackbox_disk_bytes', 'COUNT', 'UNCONFIGURED', 1073741824, 1048576, 4611686018427387903, 'a number of bytes, at least 1048576: -p blackbox_disk_bytes:=1048576', 'bytes of these files together, at most; read by `configure`'),
    ('priority', 'COUNT', 'UNCONFIGURED', 0, 0, 99, 'a priority from 1 to 99, or 0 to leave it', 'the priority of all threads under SCHED_FIFO, 1 to 99; 0: as the process was started; read by `configure`'),
    ('processors', 'NUMBERS', 'UNCONFIGURED', '', 0, 0, 'numbers of processors, such as 0,2-3', 'the processors that all threads run on, such as 0,2-3; empty: as the process was started; read by `configure`'),
    ('lock_memory', 'FLAG', 'UNCONFIGURED', False, 0, 0, 'true or false', 'whether all memory stays in memory once it was touched; read by `configure`'),
    ('autostart', 'FLAG', 'AT_START', True, 0, 0, 'true or false', 'whether the node configures and activates itself at its start'),
    ('log_level', 'CHOICE', 'ALWAYS', '', 0, 0, 'one of debug, info, warn, error, fatal', "the least severity that this node logs: debug, info, warn, error or fatal; empty for the process's"),
)
