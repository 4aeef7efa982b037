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
C text to shared library to `Monitor`.

A library is compiled, kept and found again by `build_library`, and opened by `load`. Nothing here
knows of bundles and formulas, or of ROS.
"""

from fret_monitor.native.cache import build_library
from fret_monitor.native.cache import cache_directory
from fret_monitor.native.cache import csrc_directory
from fret_monitor.native.cache import evaluator_library
from fret_monitor.native.cache import runtime_headers
from fret_monitor.native.compiler import Compiler
from fret_monitor.native.compiler import find_compiler
from fret_monitor.native.errors import CacheError
from fret_monitor.native.errors import CompilerError
from fret_monitor.native.errors import LibraryError
from fret_monitor.native.errors import NativeError
from fret_monitor.native.monitor import Library
from fret_monitor.native.monitor import load
from fret_monitor.native.monitor import load_evaluator
from fret_monitor.native.monitor import Monitor

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
    'evaluator_library',
    'find_compiler',
    'load',
    'load_evaluator',
    'runtime_headers',
]
