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

"""The file that a user names as a bundle."""

import os
from pathlib import Path

from fret_monitor.model.bundle_files import existing_bundle
from fret_monitor.model.diagnostics import CompileError
import pytest


def test_a_named_pipe_is_refused_and_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / 'pipe.yaml')
    (tmp_path / 'link.yaml').symlink_to('pipe.yaml')
    for name in ('pipe.yaml', 'link.yaml'):
        with pytest.raises(CompileError, match=f"{name}' is a named pipe, not a file"):
            existing_bundle(str(tmp_path / name))


def test_a_device_is_refused_and_what_the_shell_opens_is_not() -> None:
    with pytest.raises(CompileError, match="'/dev/zero' is a device, not a file"):
        existing_bundle('/dev/zero')
    assert existing_bundle('/dev/stdin') == Path('/dev/stdin')


def test_a_pipe_of_the_shell_is_a_bundle() -> None:
    reading, writing = os.pipe()
    try:
        assert existing_bundle(f'/dev/fd/{reading}') == Path(f'/dev/fd/{reading}')
    finally:
        os.close(reading)
        os.close(writing)
