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

"""Compiled folders that change while a process runs their libraries."""

import os
from pathlib import Path
import shutil
import subprocess
import tempfile

from fret_monitor.native import build_library, LibraryError, load, Monitor
from fret_monitor.native.binding import ffi
from fret_monitor.native.cache import cache_directory, private_copy
from native import toys
import pytest


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv('ROS_HOME', str(tmp_path / 'home'))
    return cache_directory()


def toy(limit: int) -> Path:
    return build_library({'toy.c': toys.source(limit=limit)}, name='toy')


def opened(file: Path) -> Monitor:
    return load(private_copy(file), toys.manifest(), origin=file)


def is_cool(monitor: Monitor, level: int) -> bool:
    """Return the verdict of COOL, whose limit is compiled into the library."""
    state, verdicts = ffi.new('uint64_t[2]'), ffi.new('bool[2]')
    inputs = ffi.new('int16_t[2]', [0, level])
    monitor.pointer.groups[1].step(state, inputs, verdicts)
    return bool(verdicts[1])


@pytest.mark.parametrize('is_in_place', [True, False])
def test_a_changed_library_at_the_same_path_is_opened_beside_the_one_in_use(
    home: Path, tmp_path: Path, is_in_place: bool,
) -> None:
    file = tmp_path / 'libtoy.so'
    shutil.copyfile(toy(10), file)
    before = opened(file)
    if not is_in_place:
        file.unlink()
    shutil.copyfile(toy(20), file)  # overwrites the existing file in place
    after = opened(file)
    assert (is_cool(before, 15), is_cool(after, 15)) == (False, True)
    file.write_bytes(b'')
    assert (is_cool(before, 5), is_cool(after, 25)) == (True, False)


def test_copies_are_made_once_and_kept(home: Path, tmp_path: Path) -> None:
    file = tmp_path / 'libtoy.so'
    shutil.copyfile(toy(10), file)
    first = private_copy(file)
    assert first == private_copy(file)
    assert first.parent.parent == home


@pytest.mark.parametrize('mode', [0o500, 0o777])
def test_a_copy_is_made_even_where_the_cache_cannot_be_written(
    home: Path, tmp_path: Path, mode: int,
) -> None:
    file = tmp_path / 'libtoy.so'
    shutil.copyfile(toy(10), file)
    shutil.rmtree(home)
    home.mkdir()
    home.chmod(mode)
    try:
        assert is_cool(opened(file), 5)
    finally:
        home.chmod(0o700)


@pytest.mark.parametrize('is_foreign', [False, True])
def test_a_library_is_opened_in_place_where_no_copy_can_be_written(
    home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture,
    is_foreign: bool,
) -> None:
    file = tmp_path / 'libtoy.so'
    shutil.copyfile(toy(10), file)
    (tmp_path / 'file').touch()
    if is_foreign:
        home.chmod(0o777)
    else:
        monkeypatch.setenv('ROS_HOME', str(tmp_path / 'file' / 'home'))
    monkeypatch.setattr(tempfile, 'tempdir', str(tmp_path / 'file'))
    assert private_copy(file) == file
    assert is_cool(opened(file), 5)
    cause = 'it is a link, or others can write there' if is_foreign else 'Not a directory'
    [warning] = caplog.messages
    assert warning.startswith(f'{tmp_path} is used in place, without a copy (there is no place')
    assert f'neither {cache_directory()} ({cause}) nor {tmp_path}/file (Not a dir' in warning


@pytest.mark.skipif(os.geteuid() != 0, reason='only root can mount a disk')
def test_a_library_is_opened_in_place_where_its_copy_may_not_run(
    home: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture,
) -> None:
    file = tmp_path / 'libtoy.so'
    shutil.copyfile(toy(10), file)
    shutil.rmtree(home)
    home.mkdir(mode=0o700)
    mount = ['mount', '-t', 'tmpfs', '-o', 'noexec,mode=700', 'tmpfs', str(home)]
    if subprocess.run(mount, check=False).returncode != 0:
        pytest.skip('no disk can be mounted')
    try:
        assert private_copy(file) == file
        assert is_cool(opened(file), 5)
    finally:
        subprocess.run(['umount', '-l', str(home)], check=True)
    [warning] = caplog.messages
    assert warning.startswith(f'{tmp_path} is used in place, without a copy (cannot load {home}')


def test_errors_name_the_file_that_was_copied(home: Path, tmp_path: Path) -> None:
    file = tmp_path / 'libtoy.so'
    with pytest.raises(LibraryError, match=f'{file}'):
        opened(file)
    file.write_bytes(toy(10).read_bytes()[:2000])
    with pytest.raises(LibraryError, match=f'{file}: the file is cut short'):
        opened(file)
