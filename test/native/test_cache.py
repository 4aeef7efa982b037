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

"""Libraries are built once, found again, and never loaded from a folder others can write."""

import ctypes
import json
import logging
import os
from pathlib import Path
import shutil
import signal
import subprocess
import sys
import time

from fret_monitor.native import (
    build_library, cache, cache_directory, CacheError, Compiler, CompilerError, csrc_directory,
    find_compiler, NativeError, runtime_headers,
)
from fret_monitor.native.compiler import OBJECT
import pytest

SOURCE = 'int fm_answer(void);\nint fm_answer(void)\n{\n  return 42;\n}\n'


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Give each test a cache of its own."""
    monkeypatch.setenv('ROS_HOME', str(tmp_path / 'ros'))
    return tmp_path / 'ros' / 'fret_monitor'


@pytest.fixture
def counting(tmp_path: Path) -> Compiler:
    """Return the compiler behind a script that writes a line at each run."""
    file = tmp_path / 'counting-cc'
    real = ' '.join(find_compiler().command)
    file.write_text(
        f'#!/bin/sh\necho run >> "{tmp_path}/runs"\nexec {real} "$@"\n', encoding='utf-8')
    file.chmod(0o755)
    return Compiler((str(file),), 'counting')


def runs(tmp_path: Path) -> int:
    file = tmp_path / 'runs'
    return len(file.read_text(encoding='utf-8').splitlines()) if file.exists() else 0


def test_a_library_is_in_a_folder_of_the_user_under_ros_home(home: Path) -> None:
    library = build_library({'toy.c': SOURCE}, name='toy')
    assert library.name == 'libtoy.so'
    assert library.parent.parent == home
    assert home.stat().st_mode & 0o777 == 0o700
    assert library.parent.stat().st_mode & 0o077 == 0


def test_without_ros_home_it_is_dot_ros_in_the_home_of_the_user(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delenv('ROS_HOME')
    monkeypatch.setenv('HOME', '/home/somebody')
    assert cache_directory() == Path('/home/somebody/.ros/fret_monitor')


def test_a_second_build_compiles_nothing(tmp_path: Path, counting: Compiler) -> None:
    first = build_library({'toy.c': SOURCE}, name='toy', compiler=counting)
    before = first.stat().st_mtime_ns
    assert runs(tmp_path) == 1
    assert build_library({'toy.c': SOURCE}, name='toy', compiler=counting) == first
    assert runs(tmp_path) == 1
    assert first.stat().st_mtime_ns == before


def test_everything_that_changes_the_library_changes_its_path() -> None:
    compiler = find_compiler()
    other = Compiler(compiler.command, 'another version')
    places = {
        build_library({'toy.c': SOURCE}, name='toy', headers={}),
        build_library({'toy.c': SOURCE + '\n'}, name='toy', headers={}),
        build_library({'boy.c': SOURCE}, name='toy', headers={}),
        build_library({'toy.c': SOURCE}, name='boy', headers={}),
        build_library({'toy.c': SOURCE}, name='toy', headers={'a.h': ''}),
        build_library({'toy.c': SOURCE}, name='toy', headers={}, compiler=other),
    }
    assert len({library.parent for library in places}) == 6


def test_sources_and_headers_are_kept_beside_the_library_and_objects_are_not() -> None:
    more = SOURCE.replace('answer', 'question')
    library = build_library({'toy.c': SOURCE, 'more.c': more}, name='toy', headers={'a.h': ''})
    assert sorted(file.name for file in library.parent.iterdir()) == [
        'a.h', 'libtoy.so', 'more.c', 'seal.json', 'toy.c']


def test_objects_are_linked_and_made_only_where_the_library_is_not_there_yet(
    tmp_path: Path, counting: Compiler,
) -> None:
    shown = f'__attribute__((visibility("default"))) {SOURCE}'

    def made() -> list[Path]:
        return [build_library({'toy.c': shown}, name='toy', headers={}, compiler=counting,
                              linking=OBJECT)]

    first = build_library({}, name='toy', headers={'toy.c': SOURCE}, compiler=counting,
                          objects=made)
    assert ctypes.CDLL(str(first)).fm_answer() == 42
    number = runs(tmp_path)
    made()[0].unlink()
    assert build_library({}, name='toy', headers={'toy.c': SOURCE}, compiler=counting,
                         objects=made) == first
    assert runs(tmp_path) == number


def test_the_headers_of_csrc_are_on_the_include_path() -> None:
    text = '#include "fret_monitor.h"\n#include "fret_cells.h"\n' + SOURCE
    assert build_library({'toy.c': text}, name='toy').exists()
    assert {'fret_monitor.h', 'fret_cells.h'} <= runtime_headers().keys()


@pytest.mark.parametrize('damage', ['shorten', 'change', 'remove', 'no seal', 'seal', 'folder'])
def test_a_damaged_library_is_noticed_and_built_again(
    tmp_path: Path, counting: Compiler, damage: str,
) -> None:
    library = build_library({'toy.c': SOURCE}, name='toy', compiler=counting)
    whole = library.read_bytes()
    seal = library.parent / 'seal.json'
    match damage:
        case 'shorten':
            library.write_bytes(whole[:1000])
        case 'change':
            library.write_bytes(whole[:-1] + bytes([whole[-1] ^ 1]))
        case 'remove':
            library.unlink()
        case 'no seal':
            seal.unlink()
        case 'seal':
            seal.write_bytes(b'\xff' + json.dumps({'library': 1}).encode())
        case _:
            shutil.rmtree(library.parent)
            library.parent.write_text('in the way', encoding='utf-8')
    assert build_library({'toy.c': SOURCE}, name='toy', compiler=counting) == library
    assert library.read_bytes() == whole
    assert runs(tmp_path) == 2
    assert sorted(file.name for file in library.parent.parent.iterdir()) == [library.parent.name]


def test_a_compiler_that_fails_leaves_nothing(home: Path) -> None:
    with pytest.raises(CompilerError):
        build_library({'toy.c': 'no C\n'}, name='toy')
    assert list(home.iterdir()) == []


def start_build(source: str, compiler: str) -> 'subprocess.Popen[str]':
    """Build in another process, which prints the path of the library."""
    script = (
        'import sys\nfrom fret_monitor.native import build_library, Compiler\n'
        'print(build_library({"toy.c": sys.argv[1]}, name="toy", '
        'compiler=Compiler((sys.argv[2],), "slow")))')
    environment = {**os.environ, 'PYTHONPATH': os.pathsep.join(filter(None, sys.path))}
    return subprocess.Popen(
        [sys.executable, '-c', script, source, compiler], stdout=subprocess.PIPE, text=True,
        env=environment)


def slow_compiler(tmp_path: Path, condition: str) -> str:
    """Write a compiler that waits while a shell condition holds, for a minute at most."""
    file = tmp_path / 'slow-cc'
    real = ' '.join(find_compiler().command)
    file.write_text(
        f'#!/bin/sh\necho run >> "{tmp_path}/runs"\nn=0\n'
        f'while [ $n -lt 1200 ] && [ {condition} ]; do sleep 0.05; n=$((n + 1)); done\n'
        f'exec {real} "$@"\n',
        encoding='utf-8')
    file.chmod(0o755)
    return str(file)


def test_two_processes_building_the_same_library_both_succeed(tmp_path: Path, home: Path) -> None:
    compiler = slow_compiler(tmp_path, f'$(wc -l < "{tmp_path}/runs") -lt 3')
    processes = [start_build(SOURCE, compiler) for _ in range(3)]
    said = [process.communicate(timeout=90)[0].strip() for process in processes]
    assert [process.returncode for process in processes] == [0, 0, 0]
    assert len(set(said)) == 1 and Path(said[0]).is_file()
    assert runs(tmp_path) == 3, 'they did not race'
    assert [folder.name for folder in home.iterdir()] == [Path(said[0]).parent.name]


def test_a_process_killed_during_a_build_leaves_nothing_that_passes_for_a_library(
    tmp_path: Path, home: Path,
) -> None:
    hang = tmp_path / 'hang'
    hang.touch()
    compiler = slow_compiler(tmp_path, f'-e "{hang}"')
    process = start_build(SOURCE, compiler)
    deadline = time.monotonic() + 30
    while runs(tmp_path) == 0 and time.monotonic() < deadline:
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    left = list(home.iterdir())
    assert len(left) == 1 and left[0].name.startswith('.building-')
    hang.unlink()
    library = build_library(
        {'toy.c': SOURCE}, name='toy', compiler=Compiler((compiler,), 'slow'))
    assert library.is_file() and library.parent != left[0]


def test_old_unfinished_builds_are_removed(home: Path) -> None:
    build_library({'toy.c': SOURCE}, name='toy')
    old, new = home / '.building-old', home / '.building-new'
    old.mkdir()
    new.mkdir()
    os.utime(old, (1, 1))
    build_library({'toy.c': SOURCE}, name='boy')
    assert not old.exists() and new.exists()


@pytest.mark.parametrize('mode', [0o770, 0o702, 0o777])
def test_a_folder_that_others_can_write_is_refused_with_a_remedy(home: Path, mode: int) -> None:
    home.mkdir(parents=True)
    home.chmod(mode)
    with pytest.raises(CacheError, match=f'chmod 700 {home}'):
        build_library({'toy.c': SOURCE}, name='toy')
    assert list(home.iterdir()) == []


def test_a_built_library_in_a_folder_that_others_can_write_is_refused(home: Path) -> None:
    build_library({'toy.c': SOURCE}, name='toy')
    home.chmod(0o777)
    with pytest.raises(CacheError, match='can be written by others'):
        build_library({'toy.c': SOURCE}, name='toy')


@pytest.mark.skipif(os.geteuid() != 0, reason='only root can give a folder away')
def test_a_folder_of_another_user_is_refused(home: Path) -> None:
    home.mkdir(parents=True, mode=0o700)
    os.chown(home, 12345, 12345)
    with pytest.raises(CacheError, match='belongs to another user'):
        build_library({'toy.c': SOURCE}, name='toy')


def test_a_build_works_without_a_cache_folder_that_cannot_be_created(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture,
) -> None:
    (tmp_path / 'file').write_text('', encoding='utf-8')
    monkeypatch.setenv('ROS_HOME', str(tmp_path / 'file' / 'ros'))
    with caplog.at_level(logging.WARNING):
        library = build_library({'toy.c': SOURCE}, name='toy')
    assert library.is_file()
    assert library.parent.stat().st_mode & 0o777 == 0o700
    assert 'the library is built for this run only' in caplog.text
    shutil.rmtree(library.parent)


def small_disk(folder: Path) -> None:
    """Mount a file system of 64 KiB, or skip: this needs root and support by the kernel."""
    folder.mkdir(parents=True)
    done = subprocess.run(
        ['mount', '-t', 'tmpfs', '-o', 'size=64k', 'tmpfs', str(folder)], capture_output=True,
        check=False)
    if done.returncode != 0:
        pytest.skip('cannot mount a small disk')


@pytest.mark.skipif(os.geteuid() != 0, reason='only root can mount a disk')
@pytest.mark.parametrize('free', [0, 1, 2, 3])
def test_a_build_works_without_a_cache_on_a_full_disk(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, free: int,
) -> None:
    """Leave no room at all, room for the source, or for a part of the library."""
    disk = tmp_path / 'ros'
    small_disk(disk)
    try:
        (disk / 'data').write_bytes(bytes((16 - free) * 4096))
        library = build_library({'toy.c': SOURCE}, name='toy', headers={})
        assert library.is_file() and disk not in library.parents
        assert 'the library is built for this run only' in caplog.text
        shutil.rmtree(library.parent)
    finally:
        subprocess.run(['umount', '-l', str(disk)], check=True)


@pytest.mark.skipif(os.geteuid() != 0, reason='only root can mount a disk')
def test_a_library_on_a_disk_that_became_read_only_is_used(tmp_path: Path) -> None:
    disk = tmp_path / 'ros'
    small_disk(disk)
    try:
        library = build_library({'toy.c': SOURCE}, name='toy', headers={})
        subprocess.run(['mount', '-o', 'remount,ro', str(disk)], check=True)
        assert build_library({'toy.c': SOURCE}, name='toy', headers={}) == library
        other = build_library({'toy.c': SOURCE}, name='other', headers={})
        assert other.is_file() and disk not in other.parents
        shutil.rmtree(other.parent)
    finally:
        subprocess.run(['umount', '-l', str(disk)], check=True)


def test_the_hand_written_c_is_found_beside_the_package_or_in_its_prefix() -> None:
    assert (csrc_directory() / 'evaluator' / 'evaluator.c').is_file()


def test_c_installed_under_an_ament_prefix_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    installed = tmp_path / 'share' / 'fret_monitor' / 'csrc'
    shutil.copytree(csrc_directory(), installed)
    package = tmp_path / 'elsewhere' / 'fret_monitor' / 'native' / 'cache.py'
    monkeypatch.setattr(cache, '__file__', str(package))
    monkeypatch.setattr(sys, 'prefix', str(tmp_path / 'nowhere'))
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'/nowhere{os.pathsep}{tmp_path}')
    assert csrc_directory.__wrapped__() == installed


def test_c_that_is_not_installed_is_reported_with_the_folders_searched(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(cache, '__file__', str(tmp_path / 'lib' / 'fret_monitor' / 'n' / 'c.py'))
    monkeypatch.setattr(sys, 'prefix', str(tmp_path / 'nowhere'))
    monkeypatch.delenv('AMENT_PREFIX_PATH', raising=False)
    with pytest.raises(NativeError, match='share/fret_monitor/csrc'):
        csrc_directory.__wrapped__()
