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

from collections.abc import Iterator, Mapping, Sequence
import re

from fret_monitor.build import GeneratedMonitor
from fret_monitor.export.content import (
    common_values, Content, csrc_files, export_name, ExportPart, hand_written, HandlerArguments,
    markdown, Options, values_of_several,
)
from fret_monitor.export.ros2_table import (
    node_table, node_tables, OneOfSeveral, packages_of,
)
from fret_monitor.model.diagnostics import CompileError, Diagnostic, Problems, refuse, Span
from fret_monitor.model.manifest import Manifest, ManifestRequirement, shared_handlers
from fret_monitor.model.names import distinct_names, HANDLER_TOPIC
from fret_monitor.native.cache import csrc_directory, CSRC_ROOMS

NODE_PACKAGES = ('diagnostic_msgs', 'lifecycle_msgs', 'rcl_interfaces', 'rosgraph_msgs',
                 'std_msgs', 'std_srvs', 'type_description_interfaces')
"""The packages of the messages and services that every node has."""

_ROOMS = tuple(room for room in CSRC_ROOMS if room != 'traces')  # which no node needs
_UNUSED = ('records.c',)
_MARGIN_ROW = '| `copilot/margin/ID` | `std_msgs/msg/Float64` | with `margins:=true`: the ' \
              'margin of each requirement, as it changes, at most 20 times a second |'


def ros2(generated: GeneratedMonitor, options: Options) -> Content:
    """
    Return the files of the package.

    Raises
    ------
    CompileError
        if an input that a requirement reads has no topic, or handlers should have arguments.
    """
    name = export_name(generated)
    return _package([generated], options, {'node_table.c': node_table(generated)}, {
        **common_values(generated, options),
        'PACKAGE': package_name(name, _program(generated)),
        'TABLES': f'`src/node_table.c`, `src/{name}_*`',
    })


def ros2_of_several(monitors: Sequence[GeneratedMonitor], options: Options) -> Content:
    """
    Return the files of a package whose node runs several bundles, or gates.

    Their names in C must be distinct; `options.name` is that of the package.

    Raises
    ------
    CompileError
        as `ros2`, or if two requirements have one handler.
    """
    _refuse_shared_handlers(monitors)
    paths = [item.sources[0] for item in monitors]
    gates = [item.manifest.gate for item in monitors]
    shown = distinct_names([gate.name if gate else path.stem for gate, path in zip(gates, paths)])
    tables = {
        f'node_table_{number}.c':
        node_table(item, place=OneOfSeveral(number, shown[number], paths[number].stem))
        for number, item in enumerate(monitors)}
    return _package(monitors, options, tables, {
        **values_of_several(monitors, options),
        'PACKAGE': package_name(options.name, _program(monitors[0])),
        'TABLES': ', '.join(['`src/node_table_*`', *(
            f'`src/{export_name(item)}_*`' for item in monitors)]),
    })


def _program(generated: GeneratedMonitor) -> str:
    return 'gate' if generated.manifest.gate else 'monitor'


def _package(monitors: Sequence[GeneratedMonitor], options: Options, tables: Mapping[str, str],
             values: Mapping[str, str]) -> Content:
    if options.handler_arguments is not HandlerArguments.NONE:
        refuse('handlers of ros2 are topics of std_msgs/msg/Empty, without arguments',
               help='copilot/violations has the values; leave --handler-arguments out')
    for item in monitors:
        refuse_what_no_node_has(item)
    own = {name: text for item in monitors
           for name, text in {**item.c_sources, **item.c_headers}.items()}
    files = {**csrc_files(*hand_written_sources()), **own, **tables,
             'node_tables.c': node_tables(len(monitors))}
    sources = {f'src/{name}': text for name, text in files.items()}
    program = _program(monitors[0])
    return Content(
        generated=sources, templates=_templates(program), values={
            **values, **_node_values([item.manifest for item in monitors]),
            'PROGRAM': program, 'NODE': f'fret_{program}',
            'NODE_SOURCES': '\n  '.join(name for name in sorted(sources) if name.endswith('.c'))},
        parts=(ExportPart('monitors with readers of messages, without the node', tuple(
            f'src/{name}' for name in own if name.endswith('.c')), 'src'),))


def _node_values(manifests: Sequence[Manifest]) -> dict[str, str]:
    used = sorted({name for item in manifests for name in packages_of(item)})
    interfaces = sorted({*NODE_PACKAGES, *used})
    topics = dict.fromkeys(topic for item in manifests for topic in _topics(item))
    has_margins = all(item.has_margins for item in manifests)
    return {
        'INTERFACES': ' '.join(interfaces),
        'DEPENDS': '\n  '.join(f'<depend>{name}</depend>' for name in interfaces),
        'MESSAGES': ', '.join(f'`{name}`' for name in used) or 'none',
        'TOPICS': f'It subscribes to {", ".join(topics) or "no topic"}.',
        'HANDLERS': '\n'.join([*(line for item in manifests for line in _handlers(item)),
                               *([_MARGIN_ROW] if has_margins else [])]),
        'MARGINS': 'compiled in' if has_margins else 'refused: exported without `--margins`',
    }


def _refuse_shared_handlers(monitors: Sequence[GeneratedMonitor]) -> None:
    problems = Problems()
    for (owner, other), (number, item) in shared_handlers([one.manifest for one in monitors]):
        place, first = _place(monitors[number], item), _place(monitors[owner], other)
        problems.error(
            f"'{item.id}' would be announced on copilot/{item.handler}, as '{other.id}' is "
            f'({first.source.name}:{first.line}:{first.column})', place,
            help='give one of them another id')
    problems.raise_errors()


def _place(generated: GeneratedMonitor, requirement: ManifestRequirement) -> Span:
    return next(item.id_place for item in generated.specification.properties
                if item.id == requirement.id and item.id_place is not None)


def _templates(program: str) -> dict[str, str]:
    return {name.replace('monitor.launch', f'{program}.launch'): text
            for name, text in hand_written('ros2').items()}


def package_name(name: str, program: str = 'monitor') -> str:
    """Return the name of the package: lower case, one underscore at a time (REP 144)."""
    word = re.sub('[^a-z0-9]+', '_', name.lower()).strip('_')
    return f'{word if word[:1].isalpha() else f"m_{word}"}_{program}'.replace('__', '_')


def hand_written_sources() -> list[str]:
    """Return the names in `csrc` of all C that every node has."""
    found = [path.name for room in _ROOMS for path in (csrc_directory() / room).iterdir()]
    return sorted(name for name in found if name.rpartition('.')[0] + '.c' not in _UNUSED)


def refuse_what_no_node_has(generated: GeneratedMonitor) -> None:
    """
    Refuse inputs that a requirement reads without a topic.

    Raises
    ------
    CompileError
        with all of them.
    """
    problems = []
    for index in sorted(generated.manifest.read):
        item, signal = generated.manifest.inputs[index], generated.specification.signals[index]
        if item.topic is None or item.message_type is None:
            problems.append(Diagnostic(
                f"'{item.name}' has no ROS 2 topic to read", signal.place,
                help=f'{item.name}: {{topic: {item.topic or item.name}, type: '
                     'PACKAGE/msg/Name, field: ...}'))
    if problems:
        raise CompileError(problems)


def _topics(manifest: Manifest) -> list[str]:
    return [f'`{item.name}` (`{item.message_type}`)' for item in manifest.received]


def _handlers(manifest: Manifest) -> Iterator[str]:
    for item in manifest.numbered:
        yield (f'| `{HANDLER_TOPIC}{item.handler}` | `std_msgs/msg/Empty` | a violation of '
               f'{markdown(item.id)} |')
