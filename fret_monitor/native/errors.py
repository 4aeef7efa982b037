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

"""What can go wrong between C text and a loaded monitor. None of it is the bundle's fault."""


class NativeError(Exception):
    """C cannot be compiled, kept or loaded here; the text says why and what to do."""


class CompilerError(NativeError):
    """There is no C compiler, or it failed or hung."""


class CacheError(NativeError):
    """The folder of built libraries is not one that only this user can write."""


class LibraryError(NativeError):
    """A library cannot be loaded, or is not the one that its manifest describes."""
