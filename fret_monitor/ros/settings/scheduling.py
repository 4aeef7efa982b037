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

"""Priority, processors and locked memory of the process, by the functions of csrc."""

from collections.abc import Iterator
from os import strerror
from typing import Any

from fret_monitor.native import words
from fret_monitor.ros.settings.parameters import Scheduling


def ask_system(wanted: Scheduling, library: Any) -> Iterator[str]:
    """Ask the system for what is wanted, and yield a warning for each thing that it refuses."""
    if wanted.priority and (error := library.fm_set_priority(wanted.priority)):
        yield words.NO_PRIORITY % (wanted.priority, strerror(error))
    processors = wanted.processors
    if processors and (error := library.fm_set_processors(processors.encode())):
        yield words.NO_PROCESSORS % (processors, strerror(error))
    if wanted.locks_memory and (error := library.fm_lock_memory()):
        yield words.NO_LOCKED_MEMORY % strerror(error)
