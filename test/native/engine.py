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

"""The library of the engine for tests with a cache of their own: it takes longest to build."""

from pathlib import Path
import shutil

from fret_monitor.native.cache import cache_directory, evaluator_library


def entry() -> Path:
    """Return the engine's entry of the cache that is now in use; build it if it is not there."""
    return evaluator_library().parent


def put(engine: Path) -> None:
    """Copy the engine into the cache that is now in use."""
    cache_directory().mkdir(parents=True, mode=0o700, exist_ok=True)
    shutil.copytree(engine, cache_directory() / engine.name)
