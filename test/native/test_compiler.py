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

"""A C compiler is found and run; one that is missing, fails or hangs is reported clearly."""

from collections.abc import Iterator
import os
from pathlib import Path
import shutil
import signal
import subprocess
import time
from typing import Any

from fret_monitor.native import Compiler, compiler, CompilerError, find_compiler
from fret_monitor.native.compiler import compile_library
import pytest

GOOD = 'int fm_answer(void);\nint fm_answer(void)\n{\n  return 42;\n}\n'
BAD = 'int fm_answer(void)\n{\n  return missing;\n}\n'


def script(folder: Path, name: str, body: str) -> Path:
    """Write an executable script in place of a compiler."""
    file = folder / name
    file.write_text(f'#!/bin/sh\n{body}\n', encoding='utf-8')
    file.chmod(0o755)
    return file


def processes_of(marker: str) -> list[int]:
    """Return the processes whose command line contains a text."""
    found = []
    for folder in Path('/proc').glob('[0-9]*'):
        try:
            if marker.encode() in (folder / 'cmdline').read_bytes():
                found.append(int(folder.name))
        except OSError:
            continue
    return found


@pytest.fixture
def tools(tmp_path: Path) -> Path:
    folder = tmp_path / 'tools'
    folder.mkdir()
    return folder


@pytest.fixture
def sources(tmp_path: Path) -> Iterator[Path]:
    folder = tmp_path / 'sources'
    folder.mkdir()
    (folder / 'good.c').write_text(GOOD, encoding='utf-8')
    (folder / 'bad.c').write_text(BAD, encoding='utf-8')
    yield folder


def test_cc_gcc_and_clang_are_looked_for_in_this_order(tools: Path) -> None:
    for name in ('clang', 'gcc', 'cc'):
        script(tools, name, f'echo {name}')
        assert find_compiler({'PATH': str(tools)}).command == (str(tools / name),)


def test_the_variable_cc_comes_first_and_may_have_arguments(tools: Path) -> None:
    script(tools, 'cc', '')
    mine = script(tools, 'my compiler', '')
    found = find_compiler({'PATH': str(tools), 'CC': f"'{mine}' -m64 \t-g"})
    assert found.command == (str(mine), '-m64', '-g')


def test_an_empty_variable_cc_is_ignored(tools: Path) -> None:
    script(tools, 'cc', '')
    assert find_compiler({'PATH': str(tools), 'CC': ' '}).command == (str(tools / 'cc'),)


def test_no_compiler_at_all_says_what_to_install(tools: Path) -> None:
    with pytest.raises(CompilerError) as caught:
        find_compiler({'PATH': str(tools)})
    assert str(caught.value) == (
        'no C compiler found: install gcc (sudo apt install gcc) or set CC')


@pytest.mark.parametrize('wanted', ['no-such-compiler', '/no/such/compiler', '"unclosed', '""'])
def test_a_variable_cc_that_cannot_be_run_is_reported(tools: Path, wanted: str) -> None:
    script(tools, 'cc', '')
    with pytest.raises(CompilerError, match='CC is set to'):
        find_compiler({'PATH': str(tools), 'CC': wanted})


def test_the_identity_changes_with_the_version_the_file_and_the_arguments(tools: Path) -> None:
    file = script(tools, 'cc', 'echo version 1')
    first = find_compiler({'PATH': str(tools)})
    assert find_compiler({'PATH': str(tools)}) == first
    os.utime(file, (1, 1))
    second = find_compiler({'PATH': str(tools)})
    third = find_compiler({'PATH': str(tools), 'CC': 'cc -O1'})
    (tools / 'version').write_text('2', encoding='utf-8')
    script(tools, 'cc', f'cat {tools}/version')
    os.utime(file, (1, 1))
    fourth = find_compiler({'PATH': str(tools)})
    (tools / 'version').write_text('3', encoding='utf-8')
    fifth = find_compiler({'PATH': str(tools)})
    assert len({found.identity for found in (first, second, third, fourth, fifth)}) == 5


def test_a_compiler_whose_file_stays_is_asked_for_its_version_once(
        tools: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def version(command: tuple[str, ...]) -> str:
        asked.append(command)
        return '1'

    monkeypatch.setattr(compiler, '_version', version)
    shutil.copy2('/bin/true', tools / 'cc')
    first = [find_compiler({'PATH': str(tools)}) for _ in range(3)]
    os.utime(tools / 'cc', (1, 1))
    assert find_compiler({'PATH': str(tools)}) not in first
    assert len(asked) == 2 and len(set(first)) == 1


@pytest.mark.parametrize('wanted', [{}, {'CC': 'cc'}])
@pytest.mark.parametrize('variable', ['CPATH', 'C_INCLUDE_PATH', 'LIBRARY_PATH'])
def test_the_identity_changes_with_the_search_path_of_the_compiler(
        tools: Path, variable: str, wanted: dict[str, str]) -> None:
    script(tools, 'cc', 'echo version 1')
    plain = {'PATH': str(tools), **wanted}
    found = [find_compiler(plain), *(find_compiler({**plain, variable: value})
                                     for value in ('', '/one', '/two'))]
    assert len({compiler.identity for compiler in found}) == 4


def test_a_compiler_that_prints_no_version_is_accepted(tools: Path) -> None:
    script(tools, 'cc', 'exit 1')
    assert find_compiler({'PATH': str(tools)}).command == (str(tools / 'cc'),)


def test_a_compiler_that_is_no_program_is_reported(tools: Path) -> None:
    (tools / 'cc').write_text('not a program', encoding='utf-8')
    (tools / 'cc').chmod(0o755)
    with pytest.raises(CompilerError, match='cannot be run'):
        find_compiler({'PATH': str(tools)})


def test_one_file_or_several_make_a_library(sources: Path) -> None:
    (sources / 'more.c').write_text(GOOD.replace('answer', 'question'), encoding='utf-8')
    compile_library(find_compiler(), ['good.c'], 'libone.so', folder=sources)
    compile_library(find_compiler(), ['good.c', 'more.c'], 'libtwo.so', folder=sources)
    assert b'fm_question' in (sources / 'libtwo.so').read_bytes()


def test_a_library_contains_no_path_of_this_machine(sources: Path) -> None:
    compile_library(find_compiler(), ['good.c'], 'lib.so', folder=sources)
    assert str(sources).encode() not in (sources / 'lib.so').read_bytes()


def test_the_same_sources_make_the_same_library(sources: Path) -> None:
    compile_library(find_compiler(), ['good.c'], 'lib.so', folder=sources)
    first = (sources / 'lib.so').read_bytes()
    compile_library(find_compiler(), ['good.c'], 'lib.so', folder=sources)
    assert (sources / 'lib.so').read_bytes() == first


def test_the_output_of_a_failing_compiler_is_shown_with_the_command(sources: Path) -> None:
    with pytest.raises(CompilerError) as caught:
        compile_library(find_compiler(), ['good.c', 'bad.c'], 'lib.so', folder=sources)
    message = str(caught.value)
    assert message.startswith('the C compiler failed (exit status 1):')
    assert '-c -o bad.c.o bad.c' in message
    assert "'missing' undeclared" in message or 'undeclared identifier' in message


def test_an_undefined_symbol_fails_at_once(sources: Path) -> None:
    (sources / 'open.c').write_text(
        'int fm_missing(void);\nint fm_open(void);\n'
        'int fm_open(void)\n{\n  return fm_missing();\n}\n', encoding='utf-8')
    with pytest.raises(CompilerError, match='fm_missing'):
        compile_library(find_compiler(), ['open.c'], 'lib.so', folder=sources)


def test_only_the_last_lines_of_long_compiler_output_are_shown(tools: Path, sources: Path) -> None:
    compiler = Compiler((str(script(tools, 'cc', 'seq 100000; exit 3')),), '')
    with pytest.raises(CompilerError) as caught:
        compile_library(compiler, ['good.c'], 'lib.so', folder=sources)
    lines = str(caught.value).splitlines()
    assert lines[0] == 'the C compiler failed (exit status 3):'
    assert lines[-1] == '100000' and len(lines) == 32


def test_a_compiler_that_is_killed_is_reported_with_the_signal(tools: Path, sources: Path) -> None:
    compiler = Compiler((str(script(tools, 'cc', 'kill -9 $$')),), '')
    with pytest.raises(CompilerError, match='killed by SIGKILL'):
        compile_library(compiler, ['good.c'], 'lib.so', folder=sources)


def test_a_compiler_that_disappears_is_reported(tools: Path, sources: Path) -> None:
    compiler = Compiler((str(tools / 'gone'),), '')
    with pytest.raises(CompilerError, match='cannot be run'):
        compile_library(compiler, ['good.c'], 'lib.so', folder=sources)


@pytest.mark.parametrize('body', ['sleep {0} & wait', 'exec >&- 2>&-; sleep {0}'])
def test_a_compiler_that_hangs_is_stopped_with_its_child_processes(
    tools: Path, sources: Path, body: str,
) -> None:
    seconds = f'{300 + os.getpid() / 1e7:.7f}'
    compiler = Compiler((str(script(tools, 'cc', body.format(seconds))),), '')
    begin = time.monotonic()
    with pytest.raises(CompilerError, match='did not end in time'):
        compile_library(compiler, ['good.c'], 'lib.so', folder=sources, timeout=0.3)
    assert time.monotonic() - begin < 20
    deadline = time.monotonic() + 5
    while processes_of(seconds) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert processes_of(seconds) == []


def test_a_signal_while_a_command_starts_leaves_none_running(
        tools: Path, sources: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    spawn = subprocess.Popen
    started: list[subprocess.Popen[bytes]] = []

    def spawn_and_signal(*arguments: Any, **options: Any) -> subprocess.Popen[bytes]:
        started.append(spawn(*arguments, **options))
        signal.raise_signal(signal.SIGINT)
        return started[-1]

    slow = script(tools, 'cc', 'exec sleep 60')
    monkeypatch.setattr(subprocess, 'Popen', spawn_and_signal)
    # a shell without job control starts processes in the background with SIGINT ignored
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            compile_library(Compiler((str(slow),), ''), ['good.c'], 'lib.so', folder=sources)
    finally:
        signal.signal(signal.SIGINT, before)
    assert [process.wait(0) for process in started] == [-signal.SIGKILL]


def test_the_first_failure_stops_the_others(tools: Path, sources: Path) -> None:
    seconds = f'{400 + os.getpid() / 1e7:.7f}'
    body = f'case "$*" in *bad.c*) exit 1;; *) sleep {seconds};; esac'
    compiler = Compiler((str(script(tools, 'cc', body)),), '')
    with pytest.raises(CompilerError, match='exit status 1'):
        compile_library(compiler, ['bad.c', 'good.c'], 'lib.so', folder=sources, timeout=60)
    deadline = time.monotonic() + 5
    while processes_of(seconds) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert processes_of(seconds) == []
