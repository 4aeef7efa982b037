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

"""
Start a monitor and a logger for one bundle.

    ros2 launch fret_monitor monitor.launch.py spec:=quadrotor.yaml
    ros2 launch fret_monitor monitor.launch.py library:=compiled namespace:=robot logger:=false
"""

from launch.actions import DeclareLaunchArgument
from launch.actions import OpaqueFunction
from launch.conditions import IfCondition
from launch.launch_context import LaunchContext
from launch.launch_description import LaunchDescription
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

ARGUMENTS = {
    'spec': ('', 'the bundle, a YAML file'),
    'library': ('', 'the folder of a compiled bundle, instead of the bundle or with it'),
    'policy': ('', "when a step happens, instead of the bundle's policy"),
    'period': ('', 'seconds between two steps, with the policy periodic'),
    'rate': ('', 'steps a second, with the policy periodic'),
    'namespace': ('', 'where relative topics and the handlers lie'),
    'use_sim_time': ('false', 'whether time comes from /clock'),
    'logger': ('true', 'whether violations go to the ROS log'),
    'log_level': ('info', 'the least severity that is logged'),
}
PATHS = ('spec', 'library')
TYPES = {'spec': str, 'library': str, 'policy': str, 'period': float, 'rate': float,
         'use_sim_time': bool}


def generate_launch_description() -> LaunchDescription:
    """Describe the arguments and the two nodes."""
    arguments = [DeclareLaunchArgument(name, default_value=value, description=description)
                 for name, (value, description) in ARGUMENTS.items()]
    return LaunchDescription([*arguments, OpaqueFunction(function=_nodes)])


def _nodes(context: LaunchContext) -> list[Node]:
    return [
        _node(context, 'monitor', 'fret_monitor', tuple(TYPES)),
        _node(context, 'logger', 'fret_logger', (*PATHS, 'use_sim_time'),
              condition=IfCondition(LaunchConfiguration('logger'))),
    ]


def _node(context: LaunchContext, executable: str, name: str, parameters: tuple[str, ...],
          condition: IfCondition | None = None) -> Node:
    # What is left out stays the bundle's business, so that only what was said is handed on.
    given = {
        parameter: ParameterValue(LaunchConfiguration(parameter), value_type=TYPES[parameter])
        for parameter in parameters if LaunchConfiguration(parameter).perform(context)}
    return Node(
        package='fret_monitor', executable=executable, name=name, output='screen',
        namespace=LaunchConfiguration('namespace'), parameters=[given], condition=condition,
        ros_arguments=['--log-level', LaunchConfiguration('log_level')])
