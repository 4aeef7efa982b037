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

"""Changes of a text: what a rename or a quick fix writes, and where."""

from collections.abc import Iterable
from dataclasses import dataclass

from fret_monitor.model.diagnostics import Span


@dataclass(frozen=True)
class TextEdit:
    """Text in place of a range of a file."""

    place: Span
    text: str


def edited(text: str, edits: Iterable[TextEdit]) -> str:
    """Return a text with edits of it, which do not overlap."""
    for edit in sorted(edits, key=lambda item: item.place.start, reverse=True):
        text = text[:edit.place.start] + edit.text + text[edit.place.end:]
    return text
