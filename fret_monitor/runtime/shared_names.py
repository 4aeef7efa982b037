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

"""A wrapper of `csrc/reporting/shared_names.h`: names that only one part of a node may use."""

from collections.abc import Iterable, Sequence
from typing import Any

from fret_monitor.model.used_names import TypedUse, Use
from fret_monitor.native.binding import ffi
from fret_monitor.runtime.reporting import lines_of, LogLine, ReportTable


def find_two_types(library: Any, uses: Sequence[TypedUse], owners: Sequence[str],
                   kind: str) -> list[LogLine]:
    """Return a line about each name with a second type; `owners` are names of `kind`."""
    texts = [[ffi.new('char[]', text.encode(errors='replace')) for text in use[:2]]
             for use in uses]
    names = [ffi.new('char[]', name.encode(errors='replace')) for name in owners]
    found = ffi.new('struct fm_typed_use[]', [
        (*kept, *use[2:]) for kept, use in zip(texts, uses)])
    return lines_of(
        library, library.fm_find_two_types, found, len(uses), names, kind.encode())


def find_shared(library: Any, uses: Sequence[Use]) -> list[LogLine]:
    """Return the line about the first problem of the uses of names, if there is any."""
    texts = [[ffi.new('char[]', text.encode(errors='replace'))
              for text in (*use[:5], *(use.ends or ()))] for use in uses]
    found = ffi.new('struct fm_use[]', [
        (*kept[:5], use.is_alone, *(kept[5:] or (ffi.NULL, ffi.NULL)))
        for kept, use in zip(texts, uses)])
    return lines_of(library, library.fm_find_shared, found, len(uses))


def find_merged(library: Any, table: ReportTable, names: Iterable[str]) -> list[LogLine]:
    """Return the line about the first two topics that are one; `names` are of all in the table."""
    texts = [ffi.new('char[]', name.encode(errors='replace')) for name in names]
    return lines_of(library, library.fm_find_merged, table.pointer, texts)
