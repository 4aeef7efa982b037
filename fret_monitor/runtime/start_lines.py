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
from typing import Any, NamedTuple

from fret_monitor.native.binding import ffi
from fret_monitor.runtime.reporting import lines_of, LogLine, Reporter


class WatchedBundle(NamedTuple):
    """A bundle: its file or folder, and full names: of its gate, its locks and other actions."""

    reporter: Reporter
    origin: str
    ends: tuple[str, str] = ('', '')
    locks: Sequence[str] = ()
    actions: Sequence[str] = ()


def watching(bundles: Sequence[WatchedBundle]) -> list[LogLine]:
    """Return what is logged of all bundles, of at least one, at the start."""
    library = bundles[0].reporter.library
    texts = [[*map(_characters, (item.origin, *item.ends, *item.locks, *item.actions))]
             for item in bundles]
    names = [ffi.new('char *[]', found[3:]) for found in texts]
    return lines_of(library, library.fm_add_watching, [
        (item.reporter.pointer, *found[:3], name, name + len(item.locks))
        for item, found, name in zip(bundles, texts, names)], len(bundles))


def restarted(library: Any, groups: int) -> LogLine:
    """Return the line of a reset of so many step groups; `library` has the functions of csrc."""
    line, = lines_of(library, library.fm_add_restarted, groups)
    return line


def _characters(text: str) -> Any:
    return ffi.new('char[]', text.encode(errors='replace'))
