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

"""The first bundle of the README over real DDS: nodes, test messages and the logged line."""

import os
from pathlib import Path
import re
import shlex
import subprocess
import sys
from time import monotonic, sleep

from bundles import write_bundle
import pytest
from rclpy.qos import QoSProfile, QoSReliabilityPolicy
from ros.harness import Partner, started, wait_until
from std_msgs.msg import Bool

ROOT = Path(__file__).resolve().parents[2]
README = ROOT / 'README.md'
TIMEOUT_S = 60

if not README.is_file():
    pytest.skip('needs the source tree', allow_module_level=True)


def publish(command: str) -> subprocess.CompletedProcess[str]:
    """Run one of the README's commands that publish test messages."""
    program, *arguments = shlex.split(command)
    assert program == 'python'
    paths = os.pathsep.join([str(ROOT), *sys.path])
    return subprocess.run([sys.executable, *arguments], cwd=ROOT, text=True, capture_output=True,
                          timeout=TIMEOUT_S, env={**os.environ, 'PYTHONPATH': paths}, check=False)


def test_the_logger_prints_what_the_readme_says(domain: int, tmp_path: Path) -> None:
    text = README.read_text(encoding='utf-8')
    bundle = write_bundle(tmp_path, text.split('```yaml\n')[1].split('```')[0], 'robot.yaml')
    messages = re.findall(r'^python examples/publish\.py .*$', text, re.MULTILINE)
    printed = re.findall(r'^The logger prints `([^`]*)`', text, re.MULTILINE)
    assert messages and len(printed) == 1
    with started('monitor', '-p', f'spec:={bundle}'), \
            started('logger', '-p', f'spec:={bundle}') as logger:
        shown = '.*'.join(map(re.escape, printed[0].split('...')))
        end = monotonic() + TIMEOUT_S
        # The logger may discover the monitor's publishers only after the first messages.
        while not re.search(shown, logger.output):
            assert monotonic() < end, logger.output
            for each in messages:
                done = publish(each)
                assert (done.returncode, 'Traceback' in done.stderr) == (0, False)


def test_a_message_is_published_when_the_subscriptions_have_stayed_the_same(
    partner: Partner, domain: int,
) -> None:
    received: list[Bool] = []
    first = partner.node.create_subscription(
        Bool, 'brake', received.append, QoSProfile(
            depth=1, reliability=QoSReliabilityPolicy.BEST_EFFORT))
    process = subprocess.Popen([sys.executable, ROOT / 'examples' / 'publish.py', 'brake',
                                'std_msgs/msg/Bool', 'data=true'])
    try:
        # As a monitor does, which subscribes anew when it discovers a publisher
        wait_until(lambda: partner.node.count_publishers('brake') > 0, 'the publisher')
        sleep(0.15)
        partner.node.destroy_subscription(first)
        received.clear()
        partner.node.create_subscription(Bool, 'brake', received.append, 10)
        assert process.wait(TIMEOUT_S) == 0
        wait_until(lambda: bool(received), 'the message')
        assert [item.data for item in received] == [True]
    finally:
        process.kill()
        process.wait()


@pytest.mark.parametrize('arguments, reason', [
    ('odom nav_msgs/msg/Odo', "the package 'nav_msgs' has no message 'Odo'"),
    ('odom Odometry', "'Odometry' is not a message type, such as std_msgs/msg/Float32"),
    ('odom nav_msgs/msg/Odometry pose', "'pose' has no value: write pose=VALUE"),
    ('odom nav_msgs/msg/Odometry pose.x=1',
     "no field 'pose.x': 'pose' has pose, covariance"),
    ('odom nav_msgs/msg/Odometry pose.pose.position.x.y=1',
     "'pose.pose.position.x' has no fields"),
    ('brake std_msgs/msg/Bool data=[', "'[' cannot be read as YAML"),
    ('2x std_msgs/msg/Bool', "'2x' is not a name of a topic"),
    ('odom nav_msgs/msg/Odometry twist=1', "The 'twist' field must be"),
    ('odom missing_msgs/msg/Odometry', "no messages of a package 'missing_msgs' are installed"),
])
def test_a_wrong_message_is_refused(arguments: str, reason: str, domain: int) -> None:
    done = publish(f'python examples/publish.py {arguments}')
    assert (done.returncode, done.stdout) == (1, '')
    assert done.stderr.startswith('publish: ') and done.stderr.count('\n') == 1
    assert reason in done.stderr
