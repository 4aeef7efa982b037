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

"""The files around the package agree with it, and contain no path or host of one machine."""

import ast
from collections import deque
from collections.abc import Iterator
from functools import cache
from pathlib import Path
import re
import subprocess
import sys
from typing import Any
from zipfile import ZipFile

import pytest

ROOT = Path(__file__).resolve().parent.parent
NAME = 'fret_monitor'

if not (ROOT / 'package.xml').is_file():
    pytest.skip('needs the source tree', allow_module_level=True)

APACHE = """\
Copyright 2026 The fret_monitor authors

Licensed under the Apache License, Version 2.0 (the "License");
you may not use this file except in compliance with the License.
You may obtain a copy of the License at

    http://www.apache.org/licenses/LICENSE-2.0

Unless required by applicable law or agreed to in writing, software
distributed under the License is distributed on an "AS IS" BASIS,
WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
See the License for the specific language governing permissions and
limitations under the License.
"""
COMMENT = {'.py': '#', '.sh': '#', '.c': '//', '.h': '//'}
CODE = {*COMMENT, '.lark', '.yaml', '.toml', '.cfg'}

# The key of rosdep for a Python module of another name.
KEYS = {
    '_cffi_backend': 'python3-cffi',
    'cffi': 'python3-cffi',
    'hypothesis': 'python3-hypothesis',
    'lark': 'python3-lark-parser',
    'numpy': 'python3-numpy',
    'pytest': 'python3-pytest',
    'yaml': 'python3-yaml',
}
# Only with wheels: a ROS 2 installation has no key for these, and their tests are skipped there.
OPTIONAL = {
    'apsw', 'atheris', 'backports', 'catkin_pkg', 'compression', 'dd', 'distributed', 'lsprotocol',
    'openpyxl', 'prometheus_client', 'pycparser', 'pygls', 'reelay', 'rosbags', 'starlette',
    'uvicorn', 'websockets', 'xdist', 'z3', 'ziglang'}


def git(*arguments: str) -> str:
    """Return the output of git, or skip where this is no clone."""
    done = subprocess.run(['git', *arguments], cwd=ROOT, text=True, capture_output=True,
                          check=False)
    if done.returncode:
        pytest.skip('needs a clone')
    return done.stdout


def committed() -> list[Path]:
    """Return the files that are committed or staged."""
    return [ROOT / name for name in git('ls-files', '-z').split('\0') if (ROOT / name).is_file()]


def manifest() -> Any:
    """Return package.xml as colcon reads it."""
    return pytest.importorskip('catkin_pkg.package').parse_package(str(ROOT / 'package.xml'))


@cache
def nodes(path: Path) -> list[ast.AST]:
    """Return the imports and classes of a module."""
    found: list[ast.AST] = []
    waiting = deque[ast.AST]([ast.parse(path.read_bytes())])
    while waiting:
        node = waiting.popleft()
        if isinstance(node, ast.Import | ast.ImportFrom | ast.ClassDef):
            found.append(node)
        waiting.extend(child for child in ast.iter_child_nodes(node)
                       if not isinstance(child, ast.expr))
    return found


def imported(folder: str) -> Iterator[str]:
    """Yield the top-level name of every import in a folder, except Python's and our own."""
    ours = {NAME, 'bench', 'tools'} | {path.stem for path in (ROOT / 'test').iterdir()}
    for path in sorted((ROOT / folder).rglob('*.py')):
        for node in nodes(path):
            match node:
                case ast.Import(names=names):
                    found = [alias.name for alias in names]
                case ast.ImportFrom(module=str(module), level=0):
                    found = [module]
                case _:
                    continue
            tops = {name.split('.')[0] for name in found}
            yield from tops - ours - sys.stdlib_module_names - {path.stem for path in
                                                                path.parent.glob('*.py')}


def test_colcon_accepts_the_manifest() -> None:
    package = manifest()
    package.validate()
    assert (package.name, package.get_build_type()) == (NAME, 'ament_python')


def test_the_version_is_the_same_everywhere() -> None:
    version = manifest().version
    assert f"version='{version}'" in (ROOT / 'setup.py').read_text(encoding='utf-8')
    assert f'\n{version} (' in (ROOT / 'CHANGELOG.rst').read_text(encoding='utf-8')


def test_the_package_imports_only_what_the_manifest_declares() -> None:
    package = manifest()
    declared = {each.name for each in package.exec_depends}
    needed = {KEYS.get(name, name) for folder in (NAME, 'launch', 'examples')
              for name in imported(folder)}
    # fret_monitor.testing is a plugin of pytest, and draws traces with hypothesis if it is there.
    declared |= {'python3-pytest', 'python3-hypothesis'}
    assert needed - declared - OPTIONAL == set()
    # `make demo` installs no optional extra.
    assert {KEYS.get(name, name) for name in imported('examples')} - declared == set()


def test_the_tests_import_only_what_the_manifest_declares() -> None:
    package = manifest()
    declared = {each.name for each in [*package.exec_depends, *package.test_depends]}
    needed = {KEYS.get(name, name) for name in imported('test')}
    assert needed - declared - OPTIONAL == set()


def test_every_entry_point_exists() -> None:
    text = (ROOT / 'setup.py').read_text(encoding='utf-8')
    entries = re.findall(r"f'(\S+) = \{NAME\}\.(\S+):(\w+)'", text)
    assert [name for name, _, _ in entries] == ['fret-monitor', 'gate', 'logger', 'monitor']
    for _, module, function in entries:
        path = ROOT / NAME / (module.replace('.', '/') + '.py')
        names = {node.name for node in ast.parse(path.read_text(encoding='utf-8')).body
                 if isinstance(node, ast.FunctionDef)}
        assert function in names, f'{path} has no {function}'


def test_no_two_classes_of_the_package_have_one_name() -> None:
    places: dict[str, list[str]] = {}
    for path in sorted((ROOT / NAME).rglob('*.py')):
        for node in nodes(path):
            if isinstance(node, ast.ClassDef):
                places.setdefault(node.name, []).append(f'{path.relative_to(ROOT)}:{node.lineno}')
    assert {name: found for name, found in places.items() if len(found) > 1} == {}


def test_every_file_of_code_starts_with_the_licence() -> None:
    wrong = []
    for path in committed():
        if path.suffix in COMMENT and path.stat().st_size:
            sign = COMMENT[path.suffix]
            header = ''.join(f'{sign} {line}'.rstrip() + '\n' for line in APACHE.splitlines())
            text = path.read_text(encoding='utf-8')
            if not re.sub(r'\A#!.*\n', '', text).startswith(header):
                wrong.append(path.relative_to(ROOT))
    assert wrong == []


def test_no_committed_file_names_a_machine() -> None:
    # A path or host of one developer's machine is of no use to anyone else.
    pattern = re.compile(
        r'(?<![\w.$}])/(?:work|root|tmp|home|Users)/(?!somebody\b)[\w.]|index-url|\.internal\b')
    wrong = []
    for path in committed():
        if path == Path(__file__).resolve() or path.suffix in {'.png', '.gz'}:
            continue
        for number, line in enumerate(path.read_text(encoding='utf-8').splitlines(), 1):
            if pattern.search(line):
                wrong.append(f'{path.relative_to(ROOT)}:{number}: {line.strip()}')
    assert wrong == []


def test_no_test_is_run_again() -> None:
    # What needs a second run hides a race, in the test or in the product.
    files = ('Makefile', 'setup.py', 'setup.cfg', 'pyproject.toml', '.ci/run', 'tools/setup.sh')
    assert [name for name in files if re.search(
        r'rerun|flaky', (ROOT / name).read_text(encoding='utf-8'))] == []


def test_every_page_that_is_cited_exists() -> None:
    cited = re.compile(r'\b(docs/[\w.-]+\.md|[A-Z]{4,}\.md)\b|\b(DESIGN|STYLE)(?: \d|\b)')
    wrong = []
    for path in committed():
        if path == Path(__file__).resolve() or path.suffix not in {'.md', '.rst', *CODE}:
            continue
        for number, line in enumerate(path.read_text(encoding='utf-8').splitlines(), 1):
            for found in cited.finditer(line):
                if found[2] or not (ROOT / found[1]).is_file():
                    wrong.append(f'{path.relative_to(ROOT)}:{number}: {found[0]}')
    assert wrong == []


def test_no_line_of_a_header_is_longer_than_99_columns() -> None:
    long = [f'{path.relative_to(ROOT)}:{number}' for path in committed() if path.suffix == '.h'
            for number, line in enumerate(path.read_text(encoding='utf-8').splitlines(), start=1)
            if len(line) > 99]
    assert long == []


def test_lines_end_with_a_newline_without_carriage_return() -> None:
    wrong = [path.relative_to(ROOT) for path in committed()
             if path.suffix != '.png' and (text := path.read_bytes())
             and (not text.endswith(b'\n') or b'\r\n' in text)]
    assert wrong == []


def test_a_wheel_holds_every_file_that_a_robot_needs(repository: Path, tmp_path: Path) -> None:
    pytest.importorskip('setuptools', minversion='70.1', reason='older ones need wheel besides')
    subprocess.run(
        [sys.executable, '-m', 'pip', 'wheel', '--quiet', '--no-deps', '--no-build-isolation',
         '--no-index', '--wheel-dir', str(tmp_path), str(repository)],
        check=True, capture_output=True)
    held = set(ZipFile(next(tmp_path.glob('*.whl'))).namelist())
    package = {path.relative_to(repository).as_posix() for path in repository.glob(f'{NAME}/**/*')
               if path.is_file()}
    shared = {f'{NAME}-0.1.0.data/data/share/{NAME}/{path.relative_to(repository).as_posix()}'
              for folder in ('config', 'csrc', 'launch')
              for path in (repository / folder).rglob('*') if path.is_file()}
    marker = f'{NAME}-0.1.0.data/data/share/ament_index/resource_index/packages/{NAME}'
    assert {*package, *shared, marker} - held == set()
