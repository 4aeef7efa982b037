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

"""A compiled bundle that is not loaded yet, without cffi, which loads slowly."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from fret_monitor.model.diagnostics import Diagnostic
from fret_monitor.model.manifest import Manifest

if TYPE_CHECKING:
    from fret_monitor.native.monitor import Monitor


@dataclass(frozen=True)
class CompiledMonitor:
    """
    A compiled bundle that is not loaded yet; `monitor` loads it on first use.

    `warnings` are those of the bundle; `sources` are the files it was read from; `evaluator` is
    the library of the evaluator, None if it was not looked for.
    """

    manifest: Manifest
    library: Path
    warnings: tuple[Diagnostic, ...]
    sources: tuple[Path, ...] = ()
    evaluator: Path | None = None

    @cached_property
    def monitor(self) -> 'Monitor':
        """The loaded library; raises `LibraryError`."""
        from fret_monitor.native.monitor import load
        return load(self.library, self.manifest)
