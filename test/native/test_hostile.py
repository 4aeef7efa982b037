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

"""
Disks, caches and compilers that fail at a start, with real processes and file systems.

See also test_cache.py and test_compiler.py.
"""

from collections.abc import Iterator
import os
from pathlib import Path
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time

from cli.command import command, environment
from fret_monitor.native import (
    build_library, cache_directory, CacheError, Compiler, CompilerError, find_compiler,
)
from fret_monitor.native.cache import is_kept
from native import engine
from native.test_cache import home as home_of_the_test
from native.test_cache import small_disk, SOURCE
from native.test_compiler import processes_of, script
import pytest
from strategies import thorough

BUNDLE = """\
format: 1
inputs: {x: {type: float64}}
requirements:
  - {id: R, ptltl: "H[0,3] (x < 10.0)"}
"""
TRACE = 'x\n1\n2\n30\n4\n'
VERDICTS = 'step,R\n0,1\n1,1\n2,0\n3,0\n'
DAY = 24 * 3600.0

home = home_of_the_test


@pytest.fixture
def start(tmp_path: Path) -> Iterator[list[str]]:
    """Return the command of a start: it builds or finds a bundle's library, and runs it."""
    (tmp_path / 'b.yaml').write_text(BUNDLE)
    (tmp_path / 'trace.csv').write_text(TRACE)
    yield command('simulate', tmp_path / 'b.yaml', '--trace', tmp_path / 'trace.csv')


@pytest.fixture(scope='module')
def built_engine() -> Path:
    """Return the engine's entry in the cache of all tests; `home` is set after this."""
    return engine.entry()


def renew(home: Path, built_engine: Path) -> None:
    """Empty the cache but for the engine."""
    shutil.rmtree(home, ignore_errors=True)
    engine.put(built_engine)


def run(start: list[str], **changes: str) -> 'subprocess.CompletedProcess[str]':
    done = subprocess.run(start, env=environment(**changes), text=True, capture_output=True,
                          check=False, timeout=120)
    assert 'Traceback' not in done.stderr, done.stderr
    return done


# -- a full disk ------------------------------------------------------------------------------


@thorough  # test_refusals has a cache that cannot be written
@pytest.mark.skipif(os.geteuid() != 0, reason='only root can mount a disk')
def test_a_start_on_a_full_disk_runs_with_a_warning(start: list[str], tmp_path: Path) -> None:
    disk = tmp_path / 'ros'
    small_disk(disk)
    try:
        (disk / 'data').write_bytes(bytes(15 * 4096))
        done = run(start)
        assert (done.returncode, done.stdout) == (0, VERDICTS)
        assert 'No space left on device' in done.stderr
        assert done.stderr.startswith(f'warning: {disk}/fret_monitor cannot be written (')
        assert done.stderr.count('the library is built for this run only, and every start') == 1
    finally:
        subprocess.run(['umount', '-l', str(disk)], check=True)


@pytest.mark.skipif(os.geteuid() != 0, reason='only root can mount a disk')
def test_a_start_with_no_room_anywhere_names_the_remedy(start: list[str], tmp_path: Path) -> None:
    disk = tmp_path / 'ros'
    small_disk(disk)
    try:
        (disk / 'tmp').mkdir()
        (disk / 'data').write_bytes(bytes(15 * 4096))
        done = run(start, TMPDIR=str(disk / 'tmp'))
        assert (done.returncode, done.stdout) == (1, '')
        assert 'make room, or set ROS_HOME or TMPDIR to another folder' in done.stderr
        assert list((disk / 'tmp').iterdir()) == []
    finally:
        subprocess.run(['umount', '-l', str(disk)], check=True)


def test_a_limit_on_the_size_of_files_is_reported(start: list[str]) -> None:
    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (2048, 2048))

    done = subprocess.run(start, env=environment(), text=True, capture_output=True, check=False,
                          preexec_fn=limit, timeout=120)
    assert (done.returncode, done.stdout) == (1, '')
    assert 'error: there is no place to put a library' in done.stderr
    assert 'File too large' in done.stderr and 'Traceback' not in done.stderr
    assert not list(cache_directory().glob('*'))


# -- a cache that cannot be written, or that others can write ----------------------------------


@pytest.mark.skipif(os.geteuid() != 0, reason='only root can become somebody else')
@pytest.mark.parametrize(('mode', 'owner', 'expected'), [
    (0o500, 65534, 'the library is built for this run only'),
    (0o000, 65534, 'the library is built for this run only'),
    (0o777, 65534, 'can be written by others'),
    (0o755, 0, 'belongs to another user'),
    (0o777, 0, 'belongs to another user'),
])
def test_a_user_without_a_safe_cache_folder_gets_a_clear_message(
    tmp_path: Path, home: Path, mode: int, owner: int, expected: str,
) -> None:
    home.mkdir(parents=True)
    os.chown(home, owner, owner)
    home.chmod(mode)
    for folder in (home.parent, *tmp_path.parents[:3], tmp_path):
        if folder != Path(tempfile.gettempdir()):
            folder.chmod(folder.stat().st_mode | 0o055)
    # Other users may have no access to Python's own folder: load it before changing the user.
    code = ('import logging, os, shutil, sys, tempfile\nfrom fret_monitor.native import *\n'
            'os.setgid(65534)\nos.setuid(65534)\n'
            'library = build_library({"toy.c": sys.argv[1]}, name="toy", headers={})\n'
            'print(cache_directory() in library.parents)')
    done = subprocess.run([sys.executable, '-c', code, SOURCE], env=environment(), text=True,
                          capture_output=True, check=False, cwd='/')
    assert expected in done.stderr
    assert done.stdout == ('False\n' if 'this run only' in expected else '')
    assert ('CacheError' in done.stderr) == ('by others' in expected or 'user' in expected)
    assert list(home.iterdir()) == []


@pytest.mark.parametrize('planted', ['a link to a folder', 'a link to a library', 'open folder',
                                     'open library'])
def test_an_entry_that_others_can_write_is_not_used(
    tmp_path: Path, home: Path, planted: str,
) -> None:
    library = build_library({'toy.c': SOURCE}, name='toy')
    before = library.stat().st_ino
    match planted:
        case 'a link to a folder':
            library.parent.rename(tmp_path / 'elsewhere')
            library.parent.symlink_to(tmp_path / 'elsewhere')
        case 'a link to a library':
            library.rename(tmp_path / 'elsewhere.so')
            library.symlink_to(tmp_path / 'elsewhere.so')
        case 'open folder':
            library.parent.chmod(0o770)
        case _:
            library.chmod(0o775)
    assert build_library({'toy.c': SOURCE}, name='toy') == library
    assert library.lstat().st_ino != before and not library.is_symlink()
    assert [entry.name for entry in home.iterdir()] == [library.parent.name]
    assert library.parent.stat().st_mode & 0o077 == 0


@pytest.mark.skipif(os.geteuid() != 0, reason='only root can give files away')
@pytest.mark.parametrize('part', ['folder', 'library'])
def test_an_entry_of_another_user_is_not_used(part: str) -> None:
    library = build_library({'toy.c': SOURCE}, name='toy')
    before = library.stat().st_ino
    os.chown(library if part == 'library' else library.parent, 12345, 12345)
    assert build_library({'toy.c': SOURCE}, name='toy') == library
    assert library.stat().st_ino != before


def test_a_cache_that_is_a_link_is_refused_and_nothing_written_behind_it(
    tmp_path: Path, home: Path, start: list[str],
) -> None:
    library = build_library({'toy.c': SOURCE}, name='toy')
    planted = home.rename(tmp_path / 'planted')
    before = sorted(planted.rglob('*'))
    home.symlink_to(planted)
    with pytest.raises(CacheError, match='is a link'):
        build_library({'toy.c': SOURCE}, name='toy')
    with pytest.raises(CacheError, match='is a link'):
        is_kept(library)
    done = run(start)
    assert (done.returncode, done.stdout) == (1, '')
    assert f'{home} is a link' in done.stderr
    assert sorted(planted.rglob('*')) == before


def test_a_library_is_built_without_write_permission_for_the_group() -> None:
    before = os.umask(0o002)
    try:
        library = build_library({'toy.c': SOURCE}, name='toy')
    finally:
        os.umask(before)
    assert library.stat().st_mode & 0o022 == 0


# -- several starts, and one that is killed -----------------------------------------------------


def test_starts_that_race_for_one_entry_all_succeed(
    start: list[str], home: Path, built_engine: Path,
) -> None:
    renew(home, built_engine)
    racing = [subprocess.Popen(start, env=environment(), text=True, stdout=subprocess.PIPE,
                               stderr=subprocess.PIPE) for _ in range(2)]
    said = [process.communicate(timeout=120) for process in racing]
    assert [out for out, _ in said] == [VERDICTS] * 2, said
    assert not list(home.glob('.building-*'))


def test_a_start_killed_at_any_moment_leaves_a_usable_cache(
    start: list[str], home: Path, built_engine: Path,
) -> None:
    renew(home, built_engine)
    begin = time.monotonic()
    assert run(start).stdout == VERDICTS
    whole = time.monotonic() - begin
    for share in (0.4, 0.8):
        renew(home, built_engine)
        process = subprocess.Popen(start, env=environment(), stdout=subprocess.DEVNULL,
                                   stderr=subprocess.DEVNULL, start_new_session=True)
        try:
            process.wait(share * whole)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        assert (run(start).stdout, run(start).stdout) == (VERDICTS, VERDICTS)


# -- compilers ----------------------------------------------------------------------------------


@pytest.mark.parametrize(('body', 'expected'), [
    ('exit 0', 'none at all'),
    ('for last; do :; done; head -c 5000 /dev/urandom > {0}', 'something else'),
    ('{1} "$@" && truncate -s 4000 {0}', 'a part of one'),
    ('{1} "$@" && : > {0}', 'something else'),
])
def test_a_compiler_that_writes_garbage_is_reported_and_nothing_is_kept(
    tmp_path: Path, home: Path, body: str, expected: str,
) -> None:
    real = ' '.join(find_compiler().command)
    bad = script(tmp_path, 'cc', body.format('libtoy.so', real))
    compiler = Compiler((str(bad),), 'one')
    with pytest.raises(CompilerError, match=expected):
        build_library({'toy.c': SOURCE}, name='toy', compiler=compiler)
    assert list(home.iterdir()) == []
    script(tmp_path, 'cc', f'exec {real} "$@"')  # as if the disk had room again
    assert build_library({'toy.c': SOURCE}, name='toy', compiler=compiler).is_file()


def test_endless_output_of_a_compiler_does_not_fill_the_memory(tmp_path: Path) -> None:
    talking = script(tmp_path, 'cc', 'exec yes')
    # Not ru_maxrss: a process takes over the one of the process that forked it.
    code = ('import sys\nfrom fret_monitor.native import *\n'
            'def peak():\n'
            '  with open("/proc/self/status") as status:\n'
            '    return next(int(line.split()[1]) for line in status if line[:6] == "VmHWM:")\n'
            'before = peak()\n'
            'try:\n  build_library({"toy.c": ""}, name="toy", timeout=2.0, headers={},\n'
            '    compiler=Compiler((sys.argv[1],), ""))\n'
            'except CompilerError as error:\n  print(error)\n'
            'print(peak() - before)')
    done = subprocess.run([sys.executable, '-c', code, str(talking)], env=environment(),
                          capture_output=True, text=True, check=True, timeout=60)
    assert 'did not end in time' in done.stdout
    assert int(done.stdout.splitlines()[-1]) < 20_000  # KiB


def test_a_compiler_that_hangs_at_version_is_stopped_with_its_child_processes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    seconds = f'{500 + os.getpid() / 1e7:.7f}'
    hanging = script(tmp_path, 'cc', f'sleep {seconds} & wait')
    monkeypatch.setattr('fret_monitor.native.compiler._VERSION_TIMEOUT', 0.5)
    with pytest.raises(CompilerError, match='--version gave no answer in'):
        find_compiler({'CC': str(hanging), 'PATH': os.environ['PATH']})
    deadline = time.monotonic() + 5
    while processes_of(seconds) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert processes_of(seconds) == []


# -- old entries --------------------------------------------------------------------------------


def made(number: int, days: float) -> Path:
    """Return a library last used some days ago."""
    library = build_library({'toy.c': f'{SOURCE}// {number}\n'}, name='toy')
    when = time.time() - days * DAY
    os.utime(library.parent / 'seal.json', (when, when))
    return library


def test_libraries_unused_for_90_days_are_removed_at_a_build(home: Path) -> None:
    young, old = made(2, 89), made(1, 91)
    assert old.is_file()
    build_library({'toy.c': SOURCE}, name='toy')
    assert not old.parent.exists() and young.is_file()
    assert not list(home.glob('.building-*'))


def test_using_a_library_keeps_it() -> None:
    old = made(1, 91)
    assert build_library({'toy.c': f'{SOURCE}// 1\n'}, name='toy') == old
    build_library({'toy.c': SOURCE}, name='toy')
    assert old.is_file()


def test_of_too_many_libraries_the_least_recent_go_but_none_used_today(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr('fret_monitor.native.cache._MOST', 3)
    kept = [made(1, 0.5), made(2, 0.9), made(3, 0)]
    gone = [made(4, 9), made(5, 2)]
    last = build_library({'toy.c': SOURCE}, name='toy')
    assert [library.is_file() for library in (*kept, last)] == [True] * 4
    assert [library.parent.exists() for library in gone] == [False, False]


@pytest.mark.skipif(not Path('/proc/self/maps').exists(), reason='needs /proc')
def test_a_library_that_is_removed_while_in_use_goes_on_working(
    start: list[str], tmp_path: Path, home: Path, built_engine: Path,
) -> None:
    """Remove the library while a process that has loaded it waits for its trace on a pipe."""
    renew(home, built_engine)
    os.mkfifo(tmp_path / 'pipe')
    process = subprocess.Popen(
        [*start[:-1], str(tmp_path / 'pipe')], env=environment(), text=True,
        stdout=subprocess.PIPE)
    mapped = Path(f'/proc/{process.pid}/maps')
    deadline = time.monotonic() + 60
    with (tmp_path / 'pipe').open('w') as pipe:  # once the process reads it
        pipe.write('x\n1\n')
        pipe.flush()
        while 'libfm_evaluator' not in mapped.read_text() and time.monotonic() < deadline:
            time.sleep(0.01)
        shutil.rmtree(home)
        pipe.write('30\n')
    out, _ = process.communicate(timeout=60)
    assert out.startswith('step,R\n0,1\n1,0\n')
