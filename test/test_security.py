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

"""The package executes no data as code, and starts no shell."""

import ast
from collections.abc import Iterator
from pathlib import Path

import fret_monitor

PACKAGE = Path(fret_monitor.__file__).parent
MODULES = {'pickle', 'marshal', 'shelve', 'dill', 'runpy', 'code', 'pty'}
CALLS = {'eval', 'exec', 'compile', '__import__', 'os.system', 'os.popen', 'os.execv',
         'subprocess.getoutput', 'subprocess.getstatusoutput', 'yaml.load', 'yaml.unsafe_load',
         'yaml.full_load', 'tempfile.mktemp'}


def trees() -> Iterator[tuple[str, ast.Module]]:
    for path in sorted(PACKAGE.rglob('*.py')):
        yield path.relative_to(PACKAGE).as_posix(), ast.parse(path.read_text(encoding='utf-8'))


def uses(tree: ast.Module) -> Iterator[str]:
    """Yield the places where a module does so, with the line."""
    for node in ast.walk(tree):
        match node:
            case ast.Import(names=names):
                found = [alias.name for alias in names if alias.name in MODULES]
            case ast.ImportFrom(module=str(module)):
                found = [module] if module in MODULES else []
            case ast.Call(func=function, keywords=keywords):
                name = ast.unparse(function)
                found = [name] if name in CALLS else []
                found += [f'{name}(shell=...)' for item in keywords if item.arg == 'shell']
            case _:
                continue
        yield from (f'{item} in line {node.lineno}' for item in found)


def test_no_module_executes_data_or_starts_a_shell() -> None:
    found = {name: list(uses(tree)) for name, tree in trees()}
    # `prove` runs arithmetic as Python that it generates itself, from operators and numbers.
    assert len(found.pop('smt/concrete.py', [''])) == 1
    # `native:=true` replaces the process by the program that was built for the bundle.
    assert len(found.pop('ros/native_start.py')) == 1
    assert {name: items for name, items in found.items() if items} == {}


def test_the_check_finds_each_forbidden_use() -> None:
    text = ('import pickle\nfrom runpy import run_path\nos.system("x")\neval("1")\n'
            'subprocess.run("x", shell=True)\nyaml.load(x)\n')
    assert len(list(uses(ast.parse(text)))) == 6
