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

"""The server of a page, as a process."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
import signal
import subprocess
import sys

from fret_monitor.native import evaluator_library


@contextmanager
def studio(folder: Path, *arguments: str) -> Iterator[str]:
    """Start the server, and return the address of its page."""
    evaluator_library()  # a page's patience begins when what all bundles share is compiled
    process = subprocess.Popen(
        [sys.executable, '-m', 'fret_monitor', 'studio', '--print-url', *arguments],
        stdout=subprocess.PIPE, text=True, cwd=folder)
    assert process.stdout is not None
    try:
        yield process.stdout.readline().strip()
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(60)
        process.stdout.close()
