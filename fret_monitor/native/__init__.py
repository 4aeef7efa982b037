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
Compile C to shared libraries, and load them as `Monitor` objects.

`build_library` compiles a library, or returns it from the cache; `load` opens it. This package
does not depend on bundles, formulas or ROS. What loads libraries needs cffi, which takes a while,
and is imported on first use.
"""

from importlib import import_module
from typing import Any, TYPE_CHECKING

from fret_monitor.native.cache import (
    build_library, cache_directory, csrc_directory, csrc_file, csrc_includes, evaluator_library,
    runtime_headers,
)
from fret_monitor.native.compiler import Compiler, find_compiler
from fret_monitor.native.errors import CacheError, CompilerError, LibraryError, NativeError

if TYPE_CHECKING:
    from fret_monitor.native.monitor import Library, load, load_evaluator, Monitor

__all__ = [
    'CacheError',
    'Compiler',
    'CompilerError',
    'Library',
    'LibraryError',
    'Monitor',
    'NativeError',
    'build_library',
    'cache_directory',
    'csrc_directory',
    'csrc_file',
    'csrc_includes',
    'evaluator_library',
    'find_compiler',
    'load',
    'load_evaluator',
    'runtime_headers',
]


def __getattr__(name: str) -> Any:
    if name not in ('Library', 'Monitor', 'load', 'load_evaluator'):
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(import_module(f'{__name__}.monitor'), name)
