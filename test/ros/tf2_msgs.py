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
The package tf2_msgs with its one message of /tf, built where it is not installed.

The wheels lack it. It is generated and compiled by the tools of the wheels, as colcon would.
"""

import ctypes
from functools import cache
from importlib import import_module
from importlib.util import find_spec
import os
from pathlib import Path
import subprocess
import sys
import sysconfig
from tempfile import TemporaryDirectory
from typing import Any

from fret_monitor.native.ros_files import linked, prefixes, searched
import pytest

_PACKAGE = 'tf2_msgs'
_DEPENDENCIES = ('geometry_msgs', 'std_msgs', 'builtin_interfaces')
_GENERATE = """
from pathlib import Path
import sys

from rosidl_adapter.msg import convert_msg_to_idl
from rosidl_cli.command.helpers import generator_arguments_file, legacy_generator_arguments
from rosidl_generator_c.cli import GenerateC
from rosidl_generator_py.cli import GeneratePython
from rosidl_generator_type_description import generate_type_hash
from rosidl_typesupport_c.cli import GenerateCTypesupport
from rosidl_typesupport_fastrtps_c.cli import GenerateFastRTPSCTypesupport
from rosidl_typesupport_introspection_c.cli import GenerateIntrospectionCTypesupport

package, prefix, out, *dependencies = sys.argv[1:]
found = Path(out)
convert_msg_to_idl(found, package, Path('msg/TFMessage.msg'), found / 'msg')
idl, share = [f'{out}:msg/TFMessage.idl'], Path(prefix) / 'share'
paths = [str(share / name) for name in dependencies]
arguments = legacy_generator_arguments(
    package_name=package, interface_files=idl, include_paths=paths, templates_path=share,
    output_path=found)
arguments['include_paths'] = [f'{name}:{share / name}' for name in dependencies]
with generator_arguments_file(**arguments) as file:
    hashes = generate_type_hash(file)
GenerateC('c').generate(package, idl, paths, found, hashes)
for made in (GenerateCTypesupport('c'), GenerateFastRTPSCTypesupport('fastrtps_c'),
             GenerateIntrospectionCTypesupport('introspection_c'), GeneratePython('py')):
    made.generate(package, idl, paths, found)
"""


@cache
def _folder() -> 'TemporaryDirectory[str]':
    return TemporaryDirectory(prefix='tf2-msgs-')


@cache
def prefix() -> Path | None:
    """Return where it is built; None: it is installed. Skips the test if it cannot be built."""
    if find_spec(_PACKAGE) is not None:
        return None
    if not Path(sysconfig.get_path('include'), 'Python.h').is_file():
        pytest.skip('tf2_msgs is not installed, and there are no headers of Python to build it')
    root = Path(_folder().name)
    package = root / 'lib' / 'python' / _PACKAGE
    share = root / 'share' / _PACKAGE / 'msg'
    for folder in (package / 'msg', share):
        folder.mkdir(parents=True)
    for place in (package / 'msg', share):
        (place / 'TFMessage.msg').write_text('geometry_msgs/TransformStamped[] transforms\n')
    (package / '__init__.py').touch()
    home = next(item for item in prefixes() if (item / 'share' / _DEPENDENCIES[0]).is_dir())
    _run([sys.executable, '-c', _GENERATE, _PACKAGE, str(home), str(package), *_DEPENDENCIES],
         {'AMENT_PREFIX_PATH': os.pathsep.join(map(str, prefixes()))})
    _compile(package, root / 'lib')
    return root


def _run(command: list[str], environment: dict[str, str] | None = None) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False,
                          env={**os.environ, **(environment or {})})
    assert done.returncode == 0, done.stderr


def _compile(package: Path, lib: Path) -> None:
    detail = package / 'msg' / 'detail' / 'tf_message__'
    sources = {
        'rosidl_generator_c': (f'{detail}functions.c', f'{detail}description.c'),
        'rosidl_typesupport_introspection_c': (f'{detail}type_support.c',),
        'rosidl_typesupport_fastrtps_c': (f'{detail}type_support_c.cpp',),
        'rosidl_typesupport_c': (str(package / 'msg' / 'tf_message__type_support.cpp'),),
        'rosidl_generator_py': (str(package / 'msg' / '_tf_message_s.c'),)}
    for kind, files in sources.items():
        _link(package, [*files], lib / f'lib{_PACKAGE}__{kind}.so')
    module = f'{_PACKAGE}_s__rosidl_typesupport_c'
    _link(package, [str(package / '_tf2_msgs_s.ep.rosidl_typesupport_c.c')],
          package / f'{module}{sysconfig.get_config_var("EXT_SUFFIX")}', lib)


def _link(package: Path, sources: list[str], made: Path, lib: Path | None = None) -> None:
    """Link a library against all that are there already, of this package and of the others."""
    is_cpp = sources[0].endswith('.cpp')
    own = [str(path) for path in sorted((lib or made.parent).glob('*.so'))]
    libraries = [f'{name}__{kind}' for name in _DEPENDENCIES for kind in (
        'rosidl_generator_c', 'rosidl_generator_py', 'rosidl_typesupport_c',
        'rosidl_typesupport_fastrtps_c', 'rosidl_typesupport_introspection_c')]
    common = ('rosidl_typesupport_c', 'rosidl_typesupport_fastrtps_c',
              'rosidl_typesupport_introspection_c', 'rosidl_runtime_c', 'rcutils', 'fastcdr')
    _run(['g++' if is_cpp else 'gcc', '-shared', '-fPIC', '-w', f'-Wl,-soname,{made.name}',
          f'-I{package.parent}', f'-I{sysconfig.get_path("include")}', *searched(),
          *(f'-isystem{item}/include' for item in prefixes()), *_numpy(), *sources, *own,
          *linked([*libraries, *common], ()), f'-Wl,-rpath,{made.parent}',
          '-Wl,--unresolved-symbols=ignore-all', '-o', str(made)])


def _numpy() -> list[str]:
    return [f'-I{import_module("numpy").get_include()}']


def environment() -> dict[str, str]:
    """Return the variables with which a new process finds it, as a sourced workspace sets them."""
    found = prefix()
    if found is None:
        return {}
    values = {'AMENT_PREFIX_PATH': [found, *prefixes()], 'LD_LIBRARY_PATH': [found / 'lib'],
              'PYTHONPATH': [found / 'lib' / 'python']}
    return {name: os.pathsep.join([*map(str, items), *filter(None, [
        os.environ.get(name, '') if name != 'AMENT_PREFIX_PATH' else ''])])
        for name, items in values.items()}


@cache
def message_class() -> Any:
    """Return the class of tf2_msgs/msg/TFMessage, in this process."""
    found = prefix()
    if found is not None:
        for kind in ('generator_c', 'typesupport_introspection_c', 'typesupport_fastrtps_c',
                     'typesupport_c', 'generator_py'):
            ctypes.CDLL(str(found / 'lib' / f'lib{_PACKAGE}__rosidl_{kind}.so'),
                        ctypes.RTLD_GLOBAL)
        sys.path.append(str(found / 'lib' / 'python'))
    return import_module(f'{_PACKAGE}.msg').TFMessage
