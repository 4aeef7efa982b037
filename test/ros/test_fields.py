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

"""Message types found by name."""

import re

from fret_monitor.model.diagnostics import pip_install
from fret_monitor.ros.intake.fields import message_class, MessageTypeError
import pytest


def test_events_of_services_have_a_class() -> None:
    assert message_class('std_srvs/srv/Trigger_Event').__name__ == 'Trigger_Event'


def test_feedback_of_actions_has_a_class() -> None:
    pytest.importorskip('test_msgs.action')
    assert message_class('test_msgs/action/Fibonacci_FeedbackMessage').__name__ == \
        'Fibonacci_FeedbackMessage'


@pytest.mark.parametrize(('name', 'command'), [
    ('no_such_msgs/msg/Bool', ''),
    ('std_msgs/msg/NoSuch', f'install it ({pip_install("ros-jazzy-std-msgs")}), or ')])
def test_a_type_that_is_not_installed_is_reported_with_the_command_that_installs_it(
        name: str, command: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv('AMENT_PREFIX_PATH', raising=False)
    monkeypatch.setenv('ROS_DISTRO', '')
    package, _, _ = name.partition('/')
    with pytest.raises(MessageTypeError, match=re.escape(
            f"message type {name} of the package '{package}' is not installed here: {command}"
            'source the workspace that has it')):
        message_class(name)
