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

"""Errors of compiling, caching and loading C. They are never caused by the bundle."""


class NativeError(Exception):
    """C cannot be compiled, cached or loaded; the text says why and what to do."""


class CompilerError(NativeError):
    """There is no C compiler, or it failed or hung."""


class CacheError(NativeError):
    """The cache cannot be used: others can write to it, or no folder can be written."""


class LibraryError(NativeError):
    """A library cannot be loaded, or does not match its manifest."""
