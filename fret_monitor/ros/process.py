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

"""A node as a process: from the command line to the exit status, without a traceback."""

from collections.abc import Callable
import sys

from fret_monitor.ros.parameters import Refusal
from fret_monitor.ros.signals import StopRequest

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

# Python sees a signal only between two calls into C, so none of them may last longer.
_SPIN = 0.2  # s

_USAGE = """\
usage: ros2 run fret_monitor {name} --ros-args -p spec:=BUNDLE.yaml
       ros2 run fret_monitor {name} --ros-args -p library:=FOLDER   (what `compile` wrote)
"""


def run(name: str, make_node: Callable[[], Node], stop: StopRequest) -> int:
    """
    Make a node and spin it until a signal comes; return the exit status.

    0 after SIGINT or SIGTERM; 1 if there was a reason not to start, which is then told on
    standard error.
    """
    try:
        own = remove_ros_args(sys.argv)[1:]
        if own:
            return _tell_usage(name, own[0])
        rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
        return _run(make_node, stop)
    except _rclpy.UnknownROSArgsError as error:
        print(f'error: unknown ROS arguments {error}', file=sys.stderr)
        return 1
    except _rclpy.RCLInvalidROSArgsError as error:
        reason = str(error).partition(', at ')[0]
        print(f'error: {reason}\n{_USAGE.format(name=name)}', end='', file=sys.stderr)
        return 1
    except Refusal as refusal:
        print(refusal, file=sys.stderr)
        return 1
    finally:
        rclpy.try_shutdown()
        stop.end()


def _tell_usage(name: str, argument: str) -> int:
    usage = _USAGE.format(name=name)
    if argument in ('-h', '--help'):
        print(usage, end='')
        return 0
    print(f"error: unexpected argument '{argument}'\n{usage}", end='', file=sys.stderr)
    return 1


def _run(make_node: Callable[[], Node], stop: StopRequest) -> int:
    with stop.interruptible():
        node = make_node()
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        while not stop.requested and node.context.ok():
            executor.spin_once(timeout_sec=_SPIN)
    finally:
        executor.shutdown()
        node.destroy_node()
    return 0
