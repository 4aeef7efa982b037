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
Target `ros2`: a package for colcon, with one node in C on rcl and rmw.

The node is the C in `csrc/node` on the engine and on `csrc/ros`; only its table is generated.
"""

from collections.abc import Iterator
import re

from fret_monitor.build import GeneratedMonitor
from fret_monitor.export.content import (
    common_values, Content, csrc_files, export_name, ExportPart, hand_written, HandlerArguments,
    markdown, Options,
)
from fret_monitor.export.ros2_table import node_table, node_tables, packages_of
from fret_monitor.model.diagnostics import CompileError, Diagnostic, refuse
from fret_monitor.model.manifest import Manifest
from fret_monitor.model.names import HANDLER_TOPIC
from fret_monitor.native.cache import csrc_directory, CSRC_ROOMS

NODE_PACKAGES = ('diagnostic_msgs', 'lifecycle_msgs', 'rcl_interfaces', 'rosgraph_msgs',
                 'std_msgs', 'std_srvs', 'type_description_interfaces')
"""The packages of the messages and services that every node has."""

_UNUSED = ('benchmark.c', 'csv.c', 'records.c', 'thinning.c', 'trials.c')


def ros2(generated: GeneratedMonitor, options: Options) -> Content:
    """
    Return the files of the package.

    Raises
    ------
    CompileError
        if an input that a requirement reads has no topic, or handlers should have arguments.
    """
    if options.handler_arguments is not HandlerArguments.NONE:
        refuse('handlers of ros2 are topics of std_msgs/msg/Empty, without arguments',
               help='copilot/violations has the values; leave --handler-arguments out')
    refuse_what_no_node_has(generated)
    manifest = generated.manifest
    files = {**csrc_files(*hand_written_sources()), **generated.module.files}
    sources = {f'src/{name}': text for name, text in files.items()}
    sources['src/node_table.c'] = node_table(generated)
    sources['src/node_tables.c'] = node_tables()
    program = 'gate' if manifest.gate else 'monitor'
    interfaces = sorted({*NODE_PACKAGES, *packages_of(manifest)})
    values = {
        **common_values(generated, options),
        'PACKAGE': package_name(export_name(generated), program),
        'PROGRAM': program,
        'NODE': 'fret_gate' if manifest.gate else 'fret_monitor',
        'INTERFACES': ' '.join(interfaces),
        'DEPENDS': '\n  '.join(f'<depend>{name}</depend>' for name in interfaces),
        'NODE_SOURCES': '\n  '.join(name for name in sorted(sources) if name.endswith('.c')),
        'MESSAGES': ', '.join(f'`{name}`' for name in packages_of(manifest)) or 'none',
        'TOPICS': _topics(manifest),
        'HANDLERS': '\n'.join(_handlers(manifest)),
    }
    return Content(
        generated=sources, templates=_templates(program), values=values,
        parts=(ExportPart('monitors with readers of messages, without the node', tuple(
            f'src/{name}' for name in generated.module.files if name.endswith('.c')), 'src'),))


def _templates(program: str) -> dict[str, str]:
    return {name.replace('monitor.launch', f'{program}.launch'): text
            for name, text in hand_written('ros2').items()}


def package_name(name: str, program: str = 'monitor') -> str:
    """Return the name of the package: lower case, one underscore at a time (REP 144)."""
    word = re.sub('_+', '_', name.lower()).strip('_')
    return f'{word if word[:1].isalpha() else f"m_{word}"}_{program}'.replace('__', '_')


def hand_written_sources() -> list[str]:
    """Return the names in `csrc` of all C that every node has."""
    found = [path.name for room in CSRC_ROOMS for path in (csrc_directory() / room).iterdir()]
    return sorted(name for name in found if name.rpartition('.')[0] + '.c' not in _UNUSED)


def refuse_what_no_node_has(generated: GeneratedMonitor) -> None:
    """
    Refuse inputs that a requirement reads without a topic.

    Raises
    ------
    CompileError
        with all of them.
    """
    manifest = generated.manifest
    read = {index for group in manifest.groups for index in group.inputs}
    problems = []
    for index in sorted(read):
        item, signal = manifest.inputs[index], generated.specification.signals[index]
        if item.topic is None or item.message_type is None:
            problems.append(Diagnostic(
                f"'{item.name}' has no ROS 2 topic to read", signal.place,
                help=f'{item.name}: {{topic: {item.topic or item.name}, type: '
                     'PACKAGE/msg/Name, field: ...}'))
    if problems:
        raise CompileError(problems)


def _topics(manifest: Manifest) -> str:
    names = ', '.join(f'`{item.name}` (`{item.message_type}`)' for item in manifest.received)
    return f'It subscribes to {names}.' if names else 'It subscribes to no topic.'


def _handlers(manifest: Manifest) -> Iterator[str]:
    for item in manifest.requirements:
        yield (f'| `{HANDLER_TOPIC}{item.handler}` | `std_msgs/msg/Empty` | a violation of '
               f'{markdown(item.id)} |')
