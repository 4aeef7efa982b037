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

"""Services and actions as topics over real DDS: events of calls, status and feedback of goals."""

from pathlib import Path
from time import sleep
from typing import Any

from bundles import write_bundle
import pytest
from rclpy.action import ActionClient, ActionServer
from rclpy.qos import qos_profile_services_default
from rclpy.service_introspection import ServiceIntrospectionState
from ros.harness import Partner, started, wait_until
from std_srvs.srv import SetBool

test_msgs = pytest.importorskip('test_msgs.action')

BUNDLE = """
format: 1
inputs:
  wanted:
    topic: arm/_service_event
    type: std_srvs/srv/SetBool_Event
    field: request[0].data
  event: {topic: arm/_service_event, type: std_srvs/srv/SetBool_Event, field: info.event_type}
  goals:
    topic: count/_action/status
    type: action_msgs/msg/GoalStatusArray
    field: len(status_list)
  numbers:
    topic: count/_action/feedback
    type: test_msgs/action/Fibonacci_FeedbackMessage
    field: len(feedback.sequence)
evaluation: {policy: relevant_message}
requirements:
  - {id: CALLED, ptltl: "!wanted"}
  - {id: GOALS, ptltl: "goals = 0"}
  - {id: COUNT, ptltl: "numbers < 3"}
"""


def test_calls_goals_and_feedback_are_received(partner: Partner, tmp_path: Path) -> None:
    bundle = write_bundle(tmp_path, BUNDLE, 'services.yaml')
    node = partner.node
    service = node.create_service(SetBool, 'arm', lambda _, response: response)
    service.configure_introspection(
        node.get_clock(), qos_profile_services_default, ServiceIntrospectionState.CONTENTS)
    server = ActionServer(node, test_msgs.Fibonacci, 'count', _count)
    client = node.create_client(SetBool, 'arm')
    actions = ActionClient(node, test_msgs.Fibonacci, 'count')
    with started('monitor', '-p', f'spec:={bundle}') as monitor:
        partner.listen('CALLED', 'GOALS', 'COUNT')
        wait_until(lambda: node.count_subscribers('arm/_service_event') > 0
                   and node.count_subscribers('count/_action/feedback') > 0,
                   'the monitor listens')
        wait_until(client.service_is_ready, 'the service')
        wait_until(actions.server_is_ready, 'the action')

        def call() -> bool:
            called = client.call_async(SetBool.Request(data=True))
            wait_until(called.done, 'an answer')
            return "input 'wanted'" in monitor.output

        def set_goal() -> bool:
            sent = actions.send_goal_async(test_msgs.Fibonacci.Goal(order=5))
            wait_until(sent.done, 'a goal')
            ended = sent.result().get_result_async()
            wait_until(ended.done, 'its end')
            return partner.heard['COUNT'] > 0

        # The test cannot observe when a hidden publisher and the monitor have matched.
        # An event without a request leaves the input's value unchanged, which is reported.
        wait_until(call, 'a call')
        wait_until(set_goal, 'a goal')
        wait_until(lambda: partner.heard['COUNT'] % 3 == 0 and partner.heard['GOALS'] > 0
                   and partner.heard['CALLED'] > 0, 'violations of all')
        before = partner.heard['COUNT']
        set_goal()
        wait_until(lambda: partner.heard['COUNT'] == before + 3, 'those of another goal')
    server.destroy()
    actions.destroy()


def _count(goal: Any) -> Any:
    feedback = test_msgs.Fibonacci.Feedback()
    for number in range(1, 6):
        feedback.sequence = list(range(number))
        goal.publish_feedback(feedback)
        sleep(0.01)
    goal.succeed()
    return test_msgs.Fibonacci.Result()
