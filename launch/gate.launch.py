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
Start the gates of one bundle or several.

    ros2 launch fret_monitor gate.launch.py spec:=vehicle.yaml
    ros2 launch fret_monitor gate.launch.py library:=compiled/drive namespace:=robot respawn:=true

The gate is a managed node. With `autostart:=false` nothing passes until it is configured and
activated.
"""

from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.launch_context import LaunchContext
from launch.launch_description import LaunchDescription
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode
from launch_ros.parameter_descriptions import ParameterValue

ARGUMENTS = {
    'spec': ('', 'the bundle, a YAML file, or a list of them in brackets'),
    'library': ('', 'the folder of a compiled gate, instead of the bundle or with it'),
    'gates': ('', 'the gates to run, a name or a list in brackets; default: all of the bundle'),
    'hot_path': ('', "whether the middleware's callbacks take the messages"),
    'native': ('', 'whether the gate becomes a node in C, built for the bundle once'),
    'autostart': ('true', 'whether the gate configures and activates itself'),
    'namespace': ('', 'where relative topics and the handlers lie'),
    'name': ('fret_gate', 'the name of the node'),
    'use_sim_time': ('false', 'whether time comes from /clock'),
    'log_level': ('info', 'the least severity that is logged'),
    'respawn': ('false', 'whether the node is started again, a second after it has ended'),
}
RESPAWN_DELAY_S = 1.0  # so that a node that cannot start is not started without pause
LISTS = ('spec', 'library', 'gates')
BOOLEANS = ('native', 'autostart', 'use_sim_time')


def generate_launch_description() -> LaunchDescription:
    """Describe the arguments and the node."""
    arguments = [DeclareLaunchArgument(name, default_value=value, description=description)
                 for name, (value, description) in ARGUMENTS.items()]
    return LaunchDescription([*arguments, OpaqueFunction(function=_nodes)])


def _nodes(context: LaunchContext) -> list[LifecycleNode]:
    texts = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    if not texts['spec'] and not texts['library']:
        raise RuntimeError('no gate: name a bundle, spec:=FILE.yaml, or a compiled gate, '
                           'library:=FOLDER')
    given = {name: ParameterValue(LaunchConfiguration(name), value_type=_type(name, text))
             for name, text in texts.items()
             if text and name in (*LISTS, *BOOLEANS, 'hot_path')}
    return [LifecycleNode(
        package='fret_monitor', executable='gate', output='screen',
        name=LaunchConfiguration('name'), namespace=LaunchConfiguration('namespace'),
        parameters=[given], respawn=LaunchConfiguration('respawn'), respawn_delay=RESPAWN_DELAY_S,
        ros_arguments=['--log-level', LaunchConfiguration('log_level')])]


def _type(name: str, text: str) -> object:
    if name in BOOLEANS:
        return bool
    return None if text.lstrip().startswith('[') else str  # None: the type in YAML
