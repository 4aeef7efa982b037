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

"""The parts of a bundle with gates, each of which is compiled as a monitor of its own."""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class NodePart:
    """The requirements that a gate keeps, by its name; None: those that no gate keeps."""

    gate: str | None


UNGATED = NodePart(None)

FOLDER_OF_EACH = 'library:=FOLDER, of each gate'
"""Where gates come from if what was compiled does not name its bundle."""


def without_gates(origin: str, wanted: Sequence[str]) -> str:
    """Return why a bundle is refused that has no gates, or none of those that are wanted."""
    missing = f'none of the gates {", ".join(wanted)}' if wanted else 'no gates'
    return f"'{origin}' has {missing}: leave it out"


def judged_by_gates(kept: Sequence[tuple[str, Sequence[str]]], origin: str) -> str:
    """
    Return what the log says of the requirements that gates keep; an empty text if none does.

    `kept` are the gates and the ids; `origin` is the parameter that names the bundle or folder.
    """
    gates = '; '.join(f"the gate '{name}' judges {', '.join(ids)}" for name, ids in kept)
    return (f'not monitored here: {gates}. '
            f'Run it: ros2 run fret_monitor gate --ros-args -p {origin}') if kept else ''
