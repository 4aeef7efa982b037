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

"""A wrapper of `csrc/reporting/start_lines.h`: what is watched, and lines of no bundle."""

from collections.abc import Sequence
from typing import Any

from fret_monitor.native.binding import ffi
from fret_monitor.runtime.reporting import lines_of, LogLine, Reporter


def watching(reporters: Sequence[Reporter], origins: Sequence[str]) -> list[LogLine]:
    """Return the lines of all bundles, of at least one; `origins` are their files or folders."""
    library, texts = reporters[0].library, [_characters(origin) for origin in origins]
    return lines_of(library, library.fm_add_watching, [
        {'reporter': reporter.pointer, 'origin': text}
        for reporter, text in zip(reporters, texts, strict=True)], len(reporters))


def restarted(library: Any, groups: int) -> LogLine:
    """Return the line of a reset of so many step groups; `library` has the functions of csrc."""
    line, = lines_of(library, library.fm_add_restarted, groups)
    return line


def _characters(text: str) -> Any:
    return ffi.new('char[]', text.encode(errors='replace'))
