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
Start a monitor and a logger for one bundle or several.

    ros2 launch fret_monitor monitor.launch.py spec:=quadrotor.yaml
    ros2 launch fret_monitor monitor.launch.py library:=compiled namespace:=robot logger:=false
    ros2 launch fret_monitor monitor.launch.py spec:="[mobile_base.yaml, arm.yaml]"

The monitor is a managed node. With `autostart:=false` it waits until it is configured and
activated, by `ros2 lifecycle set` or by events of a launch file that includes this one.
"""

from fret_monitor.model.policies import Policy
from launch.actions import DeclareLaunchArgument, OpaqueFunction, Shutdown
from launch.conditions import IfCondition
from launch.events.process import ProcessExited
from launch.launch_context import LaunchContext
from launch.launch_description import LaunchDescription
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode, Node
from launch_ros.parameter_descriptions import ParameterValue
import yaml

ARGUMENTS = {
    'spec': ('', 'the bundle, a YAML file, or a list of them in brackets'),
    'library': ('', 'the folder of a compiled bundle, instead of the bundle or with it'),
    'policy': ('', "when a step happens, instead of the bundle's policy"),
    'period': ('', 'seconds between two steps, with the policy periodic'),
    'rate': ('', 'steps a second, with the policy periodic'),
    'constants': ('', "values in place of the bundle's: {v_max: 0.8, is_outdoors: true}"),
    'hot_path': ('', "whether the middleware's callbacks take the messages"),
    'native': ('', 'whether the monitor becomes a node in C, built for the bundle once'),
    'log_violations': ('', 'whether the monitor logs violations; default: if logger is false'),
    'verdicts': ('', 'whether the verdict of each requirement is published'),
    'margins': ('', 'whether the monitor publishes margins'),
    'metrics': ('', 'the address and port at which figures are served for Prometheus'),
    'handler_depth': ('', 'violations that a slow listener may be behind'),
    'blackbox': ('', 'a folder for the last messages before each violation'),
    'blackbox_seconds': ('', 'seconds of messages before a violation'),
    'blackbox_bytes': ('', 'memory for the last messages'),
    'blackbox_files': ('', 'files in the folder, at most'),
    'blackbox_disk_bytes': ('', 'bytes of these files together, at most'),
    'priority': ('', 'of all threads of the monitor, under SCHED_FIFO'),
    'processors': ('', 'that all threads of the monitor run on'),
    'lock_memory': ('', 'whether all memory of the monitor stays in memory'),
    'autostart': ('true', 'whether the monitor configures and activates itself'),
    'namespace': ('', 'where relative topics and the handlers lie'),
    'name': ('fret_monitor', 'the name of the monitor'),
    'use_sim_time': ('false', 'whether time comes from /clock'),
    'logger': ('true', 'whether violations go to the ROS log'),
    'log_level': ('info', 'the least severity that is logged'),
    'respawn': ('false', 'whether nodes that end are started again, after two seconds'),
    'on_exit': ('nothing', 'what follows when the monitor ends and is not started again'),
}
BOOLEANS = ('true', 'false', 'True', 'False')
CHOICES = {
    'policy': ('', *(item.value for item in Policy)),
    'hot_path': ('', 'auto', 'on', 'off'),
    'native': ('', *BOOLEANS),
    'lock_memory': ('', *BOOLEANS),
    'margins': ('', *BOOLEANS),
    'log_violations': ('', *BOOLEANS),
    'verdicts': ('', *BOOLEANS),
    'autostart': BOOLEANS,
    'use_sim_time': BOOLEANS,
    'logger': BOOLEANS,
    'log_level': ('debug', 'info', 'warn', 'error', 'fatal'),
    'respawn': BOOLEANS,
    'on_exit': ('nothing', 'shutdown'),
}
RESPAWN_DELAY_S = 2.0
CANNOT_START = 1  # the exit status of a monitor that refuses its bundle or parameters
PATHS = ('spec', 'library')
OF_BOTH = (*PATHS, 'policy', 'period', 'rate', 'handler_depth', 'use_sim_time')
SYSTEM_TYPES = {'priority': int, 'processors': str, 'lock_memory': bool}
BLACKBOX_TYPES = {'blackbox': str, 'blackbox_seconds': float, 'blackbox_bytes': int,
                  'blackbox_files': int, 'blackbox_disk_bytes': int}
TYPES = {'period': float, 'rate': float, 'handler_depth': int, 'autostart': bool, 'native': bool,
         'log_violations': bool, 'verdicts': bool, 'margins': bool, 'metrics': str,
         'use_sim_time': bool, **BLACKBOX_TYPES, **SYSTEM_TYPES}


def generate_launch_description() -> LaunchDescription:
    """Describe the arguments and the two nodes."""
    arguments = [
        DeclareLaunchArgument(name, default_value=value, description=description,
                              choices=list(CHOICES[name]) if name in CHOICES else None)
        for name, (value, description) in ARGUMENTS.items()]
    return LaunchDescription([*arguments, OpaqueFunction(function=_nodes)])


def _nodes(context: LaunchContext) -> list[Node]:
    if not _origin(context):
        raise RuntimeError('nothing to monitor: name a bundle, spec:=FILE.yaml, or a compiled '
                           'one, library:=FOLDER')
    has_logger = IfCondition(LaunchConfiguration('logger'))
    logs_once = {'log_violations': not has_logger.evaluate(context)}
    common = {
        'package': 'fret_monitor', 'output': 'screen',
        'namespace': LaunchConfiguration('namespace'),
        'respawn': LaunchConfiguration('respawn'), 'respawn_delay': RESPAWN_DELAY_S,
        'ros_arguments': ['--log-level', LaunchConfiguration('log_level')]}
    return [
        LifecycleNode(
            executable='monitor', name=LaunchConfiguration('name'), on_exit=_end,
            parameters=[logs_once, _constants(context), _given(
                context, *OF_BOTH, *BLACKBOX_TYPES, *SYSTEM_TYPES, 'hot_path', 'native',
                'autostart', 'log_violations', 'verdicts', 'margins', 'metrics')], **common),
        Node(
            executable='logger', name='fret_logger',
            parameters=[_constants(context), _given(context, *OF_BOTH)],
            condition=has_logger, **common),
    ]


def _end(event: ProcessExited, context: LaunchContext) -> Shutdown | None:
    """End the launch with an error if the monitor cannot start; obey `on_exit` otherwise."""
    if context.is_shutdown or IfCondition(LaunchConfiguration('respawn')).evaluate(context):
        return None
    if event.returncode == CANNOT_START:
        raise RuntimeError(
            f'the monitor cannot start, for the reason above: correct {_origin(context)}, or the '
            'other arguments of monitor.launch.py')
    if LaunchConfiguration('on_exit').perform(context) == 'shutdown':
        return Shutdown(reason=f'the monitor has ended with exit status {event.returncode}')
    return None


def _origin(context: LaunchContext) -> str:
    """Return what names the bundles, as it is written on the command line."""
    texts = {name: LaunchConfiguration(name).perform(context) for name in PATHS}
    return ' '.join(f'{name}:={text}' for name, text in texts.items() if text)


def _given(context: LaunchContext, *names: str) -> dict[str, ParameterValue]:
    """Return the parameters that were given; the others keep their defaults."""
    texts = {name: LaunchConfiguration(name).perform(context) for name in names}
    return {name: ParameterValue(LaunchConfiguration(name), value_type=_type(name, text))
            for name, text in texts.items() if text}


def _constants(context: LaunchContext) -> dict[str, object]:
    """Return the parameters `constants.NAME`; launch_ros joins the names of nested mappings."""
    text = LaunchConfiguration('constants').perform(context)
    values = yaml.safe_load(text) if text else {}
    if not isinstance(values, dict):
        raise ValueError(f'constants:={text} is not a mapping: write constants:="{{v_max: 0.8}}"')
    return {'constants': values} if values else {}


def _type(name: str, text: str) -> object:
    is_list = name in PATHS and text.lstrip().startswith('[')
    return None if is_list else TYPES.get(name, str)  # None: the type in YAML
