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
Start the node of @PACKAGE@.

    ros2 launch @PACKAGE@ @PROGRAM@.launch.py namespace:=robot1

It is a managed node. With `autostart:=false` it waits until it is configured and activated, by
`ros2 lifecycle set` or by events of a launch file that includes this one.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode
from launch_ros.parameter_descriptions import ParameterValue

ARGUMENTS = {
    'namespace': ('', 'where relative topics and the handlers lie'),
    'name': ('@NODE@', 'the name of the node'),
    'use_sim_time': ('false', 'whether time comes from /clock'),
    'log_violations': ('true', 'whether the node logs violations'),
    'handler_depth': ('1000', 'violations that a slow listener may be behind'),
    'autostart': ('true', 'whether the node configures and activates itself'),
    'log_level': ('', 'the least severity that is logged'),
    'respawn': ('false', 'whether the node is started again when it has ended'),
}
TYPES = {'use_sim_time': bool, 'log_violations': bool, 'handler_depth': int, 'autostart': bool,
         'log_level': str}


def generate_launch_description():
    """Describe the arguments and the node."""
    arguments = [DeclareLaunchArgument(name, default_value=value, description=description)
                 for name, (value, description) in ARGUMENTS.items()]
    parameters = {name: ParameterValue(LaunchConfiguration(name), value_type=kind)
                  for name, kind in TYPES.items()}
    return LaunchDescription([*arguments, LifecycleNode(
        package='@PACKAGE@', executable='@PROGRAM@', name=LaunchConfiguration('name'),
        namespace=LaunchConfiguration('namespace'), parameters=[parameters], output='both',
        respawn=LaunchConfiguration('respawn'), respawn_delay=2.0)])
