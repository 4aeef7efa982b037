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
The layers of the package: which module may import which (docs/design.md).

Imports are read from the syntax trees, so those inside functions and under TYPE_CHECKING count.
"""

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
import os
from pathlib import Path
import subprocess
import sys

import fret_monitor
import pytest

PACKAGE = Path(fret_monitor.__file__).parent
PYTHONPATH = os.pathsep.join([str(PACKAGE.parent), os.environ.get('PYTHONPATH', '')])

LEVELS = {
    'fret_monitor': 0,
    'fret_monitor.model': 1,
    'fret_monitor.messages': 2,
    'fret_monitor.bundle': 3,
    'fret_monitor.language': 4,
    'fret_monitor.logic': 5,
    'fret_monitor.elaboration': 6,
    'fret_monitor.program': 7,
    'fret_monitor.codegen': 8,
    'fret_monitor.native': 9,
    'fret_monitor.runtime': 10,
    'fret_monitor.lint': 11,
    'fret_monitor.build': 12,
    'fret_monitor.start': 13,  # builds, or loads what was built before
    'fret_monitor.traces': 14,
    'fret_monitor.smt': 15,
    'fret_monitor.explain': 16,
    'fret_monitor.proving': 16,
    'fret_monitor.importing': 16,
    'fret_monitor.export': 16,
    'fret_monitor.analysis': 17,  # draws runs as `explain` does
    'fret_monitor.testgen': 17,  # reads sentences as `explain` does
    'fret_monitor.editing': 18,
    'fret_monitor.ros': 19,
    'fret_monitor.bag': 19,
    'fret_monitor.lsp': 19,
    'fret_monitor.studio': 20,  # shows the reports of `bag`
    'fret_monitor.cli': 21,  # its verbs `bag`, `lsp` and `studio` call those faces
    'fret_monitor.testing': 22,  # for tests of robots: starts the monitor as a process
    'fret_monitor.__main__': 22,
}
# The rooms of `ros`, between its own modules: what all use, and the entries.
ROOMS_OF_ROS = (
    'signals', 'watch', 'log_lines', 'settings', 'intake', 'acting', 'reports', 'nodes', '')
FACES = {name for name, level in LEVELS.items() if level in (19, 20, 21)}
BETWEEN_FACES = {
    ('fret_monitor.cli', 'fret_monitor.bag'), ('fret_monitor.cli', 'fret_monitor.lsp'),
    ('fret_monitor.cli', 'fret_monitor.studio'), ('fret_monitor.studio', 'fret_monitor.bag')}
LEAN = {'fret_monitor.native', 'fret_monitor.runtime'}
LEAN_LEVELS = {0, 1, 9, 10}
# Packages of ROS that are not named `*_msgs`.
ROS_MODULES = {
    'ament_index_python', 'builtin_interfaces', 'launch', 'launch_ros', 'mcap', 'rclpy',
    'rosbag2_py', 'rosbags', 'std_srvs', 'unique_identifier_msgs',
}


@dataclass(frozen=True)
class Import:
    """One import: importing module, imported name, line, and whether it runs on load."""

    importer: str
    imported: str
    line: int
    on_load: bool

    def __str__(self) -> str:
        return f'{self.importer}, line {self.line}: imports {self.imported}'


@cache
def modules() -> dict[str, Path]:
    """Return every module of the package, by its name, packages under theirs."""
    found = {}
    for path in PACKAGE.rglob('*.py'):
        parts = path.relative_to(PACKAGE.parent).with_suffix('').parts
        found['.'.join(parts[:-1] if parts[-1] == '__init__' else parts)] = path
    return found


def nodes(tree: ast.AST, on_load: bool = True) -> Iterator[tuple[ast.AST, bool]]:
    """Yield each statement below a tree and whether it runs when the module is loaded."""
    stack = [(tree, on_load)]
    while stack:
        node, runs = stack.pop()
        yield node, runs
        inner = runs and not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        stack.extend((child, inner) for child in ast.iter_child_nodes(node)
                     if not isinstance(child, ast.expr))


def named(node: ast.AST, module: str, is_package: bool) -> Iterator[str]:
    """Yield what an import statement imports; `from a import b` gives a.b if that is a module."""
    match node:
        case ast.Import(names=names):
            yield from (alias.name for alias in names)
        case ast.ImportFrom(module=origin, names=names, level=level):
            base = origin or ''
            if level:
                package = module.split('.')
                package = package[:len(package) - level + is_package]
                base = '.'.join([*package, *([origin] if origin else [])])
            for alias in names:
                whole = f'{base}.{alias.name}'
                yield whole if whole in modules() else base


@cache
def imports_of(name: str) -> list[Import]:
    """Return all imports of a module of the package."""
    path = modules()[name]
    tree = ast.parse(path.read_text(encoding='utf-8'))
    return [
        Import(name, imported, getattr(node, 'lineno', 0), on_load)
        for node, on_load in nodes(tree)
        for imported in named(node, name, path.name == '__init__.py')
    ]


@cache
def all_imports() -> tuple[Import, ...]:
    """Return all imports in the package."""
    return tuple(each for name in sorted(modules()) for each in imports_of(name))


def place(name: str) -> str:
    """Return the entry of the level that a module belongs to: the first two parts of its name."""
    return '.'.join(name.split('.')[:2])


def inside() -> list[Import]:
    """Return the imports of one part of the package by another or itself."""
    return [each for each in all_imports() if each.imported.split('.')[0] == 'fret_monitor']


def reached_from(name: str) -> set[str]:
    """Return the modules that loading or running a module may load, including itself."""
    seen, waiting = {name}, [name]
    while waiting:
        for each in imports_of(waiting.pop()):
            # Importing a.b.c runs a and a.b first.
            parts = each.imported.split('.')
            for end in range(1, len(parts) + 1):
                step = '.'.join(parts[:end])
                if step in modules() and step not in seen:
                    seen.add(step)
                    waiting.append(step)
    return seen


def told(wrong: list[Import]) -> str:
    return '\n'.join(map(str, wrong))


def test_every_module_has_a_level() -> None:
    assert [name for name in modules() if place(name) not in LEVELS] == []


def test_every_imported_module_exists() -> None:
    wrong = [each for each in inside() if each.imported not in modules()]
    assert not wrong, told(wrong)


def test_imports_point_down_only() -> None:
    wrong = [
        each for each in inside()
        if place(each.importer) != place(each.imported)
        and LEVELS[place(each.importer)] <= LEVELS[place(each.imported)]
    ]
    assert not wrong, told(wrong)


def room_of_ros(name: str) -> int:
    """Return the place of a module of `ros` in the order of its rooms."""
    parts = name.split('.')[2:]
    return ROOMS_OF_ROS.index(parts[0] if parts and parts[0] in ROOMS_OF_ROS else '')


def test_imports_point_down_between_the_rooms_of_the_nodes() -> None:
    wrong = [
        each for each in inside()
        if place(each.importer) == place(each.imported) == 'fret_monitor.ros'
        and room_of_ros(each.importer) < room_of_ros(each.imported)
    ]
    assert not wrong, told(wrong)


def test_no_module_imports_itself_through_others() -> None:
    assert [name for name in modules() if name in named_from(name)] == []


def named_from(name: str) -> set[str]:
    """Return the modules that a module imports, directly or indirectly."""
    seen: set[str] = set()
    waiting = [name]
    while waiting:
        for each in imports_of(waiting.pop()):
            if each.imported in modules() and each.imported not in seen:
                seen.add(each.imported)
                waiting.append(each.imported)
    return seen


def test_there_are_no_import_cycles() -> None:
    # Not even inside functions: modules in a cycle cannot be understood separately.
    assert [name for name in modules() if name in named_from(name)] == []


def test_the_faces_do_not_import_each_other() -> None:
    wrong = [
        each for each in inside()
        if place(each.importer) in FACES and place(each.imported) in FACES
        and place(each.importer) != place(each.imported)
        and (place(each.importer), place(each.imported)) not in BETWEEN_FACES
    ]
    assert not wrong, told(wrong)


def test_only_the_nodes_and_the_bag_reader_import_ros() -> None:
    wrong = [
        each for each in all_imports()
        if place(each.importer) not in {
            'fret_monitor.ros', 'fret_monitor.bag', 'fret_monitor.testing'}
        and each.importer != 'fret_monitor.studio.watching'  # a process of its own
        and (each.imported.split('.')[0] in ROS_MODULES
             or each.imported.split('.')[0].endswith('_msgs'))
    ]
    assert not wrong, told(wrong)


@pytest.mark.parametrize('face', sorted(LEAN))
def test_a_robot_loads_a_monitor_without_parser_and_compiler(face: str) -> None:
    reached = {place(name) for start in modules() if place(start) == face
               for name in reached_from(start)}
    assert {name for name in reached if LEVELS[name] not in LEAN_LEVELS} == set()


@pytest.mark.parametrize('reference', ['evaluate', 'timed', 'pointwise'])
def test_the_reference_semantics_and_the_lowering_are_independent(reference: str) -> None:
    evaluate, lower = f'fret_monitor.logic.{reference}', 'fret_monitor.program.lower'
    assert lower not in reached_from(evaluate)
    assert evaluate not in reached_from(lower)


def test_the_nodes_load_the_parsers_only_when_they_need_them() -> None:
    wrong = [
        each for each in inside()
        if place(each.importer) == 'fret_monitor.ros' and each.on_load
        and LEVELS[place(each.imported)] not in {*LEAN_LEVELS, LEVELS['fret_monitor.ros']}
    ]
    assert not wrong, told(wrong)


@pytest.mark.parametrize('face', [
    'native', 'runtime', 'ros.nodes.monitor_node', 'ros.nodes.logger_node'])
def test_loading_a_monitor_loads_no_parser(face: str) -> None:
    # The same for a real process, which also covers modules imported by name.
    if face.startswith('ros.'):
        pytest.importorskip('rclpy')
    script = f'import sys, fret_monitor.{face}; print(*sys.modules)'
    done = subprocess.run([sys.executable, '-c', script], text=True, check=True,
                          capture_output=True, env={**os.environ, 'PYTHONPATH': PYTHONPATH})
    loaded = set(done.stdout.split())
    heavy = {'lark', 'fret_monitor.build', 'fret_monitor.bundle', 'fret_monitor.language',
             'fret_monitor.logic'}
    assert f'fret_monitor.{face}' in loaded
    assert loaded & heavy == set()
