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
Mutants of csrc, ros, program and elaboration, judged by the tests of their room.

    python -m bench.mutation [ROOM...] [--share PERCENT] [--only TEXT] [--once]

Each mutant is put into a copy of the repository, where the tests of its file run until one fails.
A test with ROS 2 that fails, and whatever takes too long, counts only if it does so a second time
and passes in the unchanged copy, there in a fraction of the time: the machine may be busy. Tests
that take too long together leave the mutant without a result. The programs of test/csrc run
first, without pytest.

Results are kept in `.mutation/`: a run that was stopped goes on, and a mutant whose file and tests
have not changed since is not judged again; the summary is `bench/judged_mutants.md`. The status
is 1 if a room has fewer than 90 % of its mutants noticed; those of `equivalent_mutants.txt` are
not counted.
"""

import argparse
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from fnmatch import fnmatch
from functools import cache
from hashlib import sha256
import importlib
import json
import os
from pathlib import Path
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback

from bench.mutation_results import equivalent, keep, kept_results, Result, SUMMARY, summary
from bench.source_mutants import all_changes, sample, SourceMutant
from fret_monitor.native.cache import CSRC_ROOMS
import pytest

ROOT = Path(__file__).resolve().parent.parent
GOAL = 0.9
_TEST_S = 100  # for one test; mutants that loop for ever are noticed
_PROGRAM_S = 15
_MUTANT_S = 1800.0
_SLOWER = 10  # times as long as without the mutant: what takes longer counts as endless
_MEMORY_BYTES = 8 << 30
_LIKELY = 6  # tests that noticed other mutants of the room, and run first
# About text alone, or as long as all the others and the same but for the preemption.
_LEFT_OUT = ('without_warnings', 'without_a_warning', 'header_compiles', 'threads-True',
             'addresses-True')
# With their arguments; of those without, each of the scenarios that they print is run.
_PROGRAMS: dict[str, tuple[str, ...]] = {
    'evaluator_scenarios': (), 'timed_scenarios': (), 'evaluator_edges': ('',),
    'evaluator_model': ('0 300', '1 300', '2 300'), 'scopes_model': ('0 120', '1 120', '2 120'),
    'engine_instances': ('',), 'questions': ('',), 'engine_time': ('',), 'engine_timed': ('',),
    'receivers': ('',), 'relay': ('',), 'losses': ('0', '1'), 'actions': ('',),
    'closing': ('before_take', 'after_take', 'before_is_closed', 'after_is_closed'),
    'backlog': ('',), 'engine_threads': ('',), 'scopes_lives': ('',), 'locks': ('',),
    'engine_clock': ('',)}  # the last ones wait for seconds, or need as much of a processor
_WRAPPED = re.compile(r'__wrap_(\w+)\(')
_SANITIZED = ('test/csrc', 'test/codegen', 'test/ros')
_OTHER_LIBRARIES = ('benchmark.c', 'trials.c')
_BROKEN = 70  # the status of a child that could not run pytest
_COPIED = ('bench', 'config', 'csrc', 'docs', 'examples', 'fret_monitor', 'launch', 'resource',
           'test', 'tools')
# Imported once, before the fork for each mutant. Nothing that a mutant may change.
_PRELOADED = ('hypothesis', 'numpy', 'cffi', 'yaml', 'lark', 'pycparser', 'xdist')


@dataclass(frozen=True)
class Room:
    """A part of the repository: its files, how many mutants are judged, and their tests."""

    place: str
    """What the keys of its mutants begin with, wherever in the room a file is."""
    files: tuple[str, ...]
    mutants: int
    tests: dict[str, str]
    """The tests by the name of a file, those first that are quick or likely to fail."""

    def tests_of(self, path: str) -> tuple[str, ...]:
        """Return the tests of a file; the last pattern is `*`."""
        return tuple(next(tests for pattern, tests in self.tests.items()
                          if fnmatch(Path(path).name, pattern)).split())


def _ros(names: str) -> str:
    return ' '.join(f'test/ros/test_{name}.py' for name in names.split())


_EVALUATOR = 'test/csrc/test_evaluator.py'
_THREADS = 'test/csrc/test_engine.py::test_threads[threads-engine_threads]'
_BACKLOG = ('test/csrc/test_engine.py::'
            'test_messages_that_wait_in_the_queues_of_the_middleware')
_BLACKBOX = 'test/csrc/test_engine.py::test_files_of_the_black_box'
_KEYED = ('test/csrc/test_engine.py::test_an_engine_with_instances '
          'test/traces/test_keyed_simulate.py test/bag/test_instances.py '
          'test/runtime/test_keyed_topics.py test/runtime')
_MEMORY = ' '.join(f'test/csrc/test_engine.py::test_threads[addresses-{name}]'
                   for name in ('actions', 'relay'))
_QUESTIONS = 'test/csrc/test_engine.py::test_questions_to_nodes_that_were_killed'
_REVIEW = 'test/runtime/test_review.py test/runtime/test_review_acting.py'
_SPECIFY = 'test/elaboration/test_specify.py'
ROOMS = {
    'csrc': Room('csrc', ('csrc/evaluator/*.c', 'csrc/engine/*.c', 'csrc/traces/*.c'), 110, {
        'gate.c': 'test/runtime/test_gate.py test/runtime/test_states.py '
                  f'test/traces/test_gated.py {_EVALUATOR}::test_scenario',
        '*transforms.c': 'test/csrc/test_transforms.py test/bag/test_transforms.py test/runtime '
                         + _ros('transforms'),
        'engine*.c': f'test/runtime {_THREADS} {_BACKLOG}',
        'states.c': 'test/runtime/test_states.py test/runtime',
        'handover.c': 'test/runtime ' + _ros('raw_topic feed'),
        'outbox.c': 'test/runtime',
        'blackbox_*.c': f'{_BLACKBOX} test/runtime/test_mcap.py ' + _ros('blackbox'),
        'mcap.c': f'test/runtime/test_mcap.py {_BLACKBOX} test/bag/test_chunks.py '
                  'test/bag/test_bag.py',
        'scopes*.c': _KEYED,
        'aggregates.c': _KEYED,
        'keys.c': _KEYED,
        'pool.c': _KEYED,
        'heap.c': _KEYED,
        'measures.c': 'test/bag/test_rates.py test/traces/test_timed_simulate.py '
                      'test/bag/test_random_bags.py test/runtime',
        'blackbox.c': f'test/runtime {_THREADS} ' + _ros('blackbox'),
        'reorder.c': 'test/runtime test/bag',
        'records.c': 'test/runtime test/traces test/bag',
        'csv*.c': 'test/traces/test_csv_trace.py test/traces',
        'thinning.c': 'test/runtime test/bag',
        'benchmark.c': 'test/traces/test_benchmark.py',
        'trials.c': 'test/traces',
        'evaluator.c': 'test/runtime/test_evaluator.py test/cli/test_sources.py '
                       'test/traces/test_timed_simulate.py test/runtime',
        '*': 'test/runtime/test_evaluator.py test/runtime'}),
    'headers': Room('csrc', ('csrc/generated/*.h', 'csrc/evaluator/*.h', 'csrc/engine/*.h'), 15, {
        'fret_windows.h': 'test/differential/test_over_time.py test/logic/test_over_time.py',
        'fret_cdr.h': 'test/codegen/test_extractors.py test/codegen',
        'fret_reductions.h': 'test/codegen/test_extractors.py test/codegen',
        'fret_margins.h': 'test/differential/test_margins.py test/bag/test_margins.py',
        'fret_cells.h': 'test/csrc/test_cells.py test/differential test/proving/test_cells.py',
        '*': f'test/codegen/test_extractors.py test/codegen test/runtime {_EVALUATOR}'}),
    'csrc/ros': Room('csrc/ros', ('csrc/ros/*.c',), 20, {
        'relay.c': f'{_MEMORY} ' + _ros('gate'),
        'action*.c': f'{_MEMORY} ' + _ros('actions'),
        'announcer.c': _ros('actions monitor_node'),
        'in_place*.c': _ros('hot_path'),
        'keyed_topics.c': 'test/runtime/test_keyed_topics.py ' + _ros('instances'),
        'question.c': f'{_QUESTIONS} ' + _ros('asked graph'),
        'graph.c': f'{_QUESTIONS} ' + _ros('asked graph'),
        '*': _ros('feed hot_path raw_topic monitor_node')}),
    'csrc/node': Room('csrc/node', ('csrc/reporting/*.c', 'csrc/node/*.c'), 30, {
        'text.c': 'test/csrc/test_node_text.py ' + _ros('node_parts exported_node'),
        'gate_target.c': 'test/runtime/test_gate_target.py ' + _ros('gate'),
        'instance_lines.c': f'test/runtime/test_reporting.py {_REVIEW} ' + _ros('instances'),
        'topics.c': _ros('instances node_parts'),
        'node_blackbox.c': _ros('node_parts blackbox'),
        'subscription.c': 'test/runtime/test_subscription.py ' + _ros('node_parts'),
        'details.c': 'test/runtime/test_reporting.py',
        'violation_log.c': 'test/runtime/test_reporting.py',
        'condition_log.c': 'test/runtime/test_review_acting.py',
        'start_lines.c': 'test/runtime/test_start_lines.py',
        'lines.c': f'{_REVIEW} ' + _ros('node_parts'),
        'spelling.c': 'test/csrc/test_node_text.py ' + _ros('parameter_table'),
        'shared_names.c': _ros('several node_parts'),
        'parameters.c': _ros('node_parts side_by_side exported_node overrides parameter_table'),
        'given.c': _ros('overrides'),
        'overrides.c': _ros('overrides'),
        'monitor_node.c': _ros('scheduling node_parts exported_node'),
        'input_log.c': 'test/runtime/test_review.py test/runtime/test_review_time.py',
        'health.c': f'{_REVIEW} test/runtime/test_review_time.py',
        'review.c': f'{_REVIEW} test/runtime/test_review_time.py',
        '*': _ros('node_parts exported_node')}),
    'ros': Room('fret_monitor/ros', ('fret_monitor/ros/*.py', 'fret_monitor/ros/*/*.py'), 50, {
        'action*.py': _ros('actions'),
        'discovery.py': _ros('logger_node'),
        'handlers.py': _ros('logger_node refusals'),
        'pairing.py': _ros('logger_node'),
        'blackbox.py': _ros('blackbox'),
        'bundle_session.py': _ros('hot_path missing monitor_node parameters lifecycle faults'),
        'opened.py': _ros('parts constants usage refusals several'),
        'detail*.py': _ros('details monitor_node'),
        'duplicate_nodes.py': _ros('several'),
        'feed.py': _ros('feed logger_node monitor_node'),
        'fields.py': _ros('fields'),
        'gate*.py': _ros('gate parts'),
        'relay.py': _ros('gate'),
        'health.py': _ros('missing monitor_node faults timed'),
        'hot_path.py': _ros('hot_path monitor_node'),
        'in_place.py': _ros('hot_path'),
        'logger*.py': _ros('logger_node'),
        'symbols.py': _ros('several'),
        'native_lifetimes.py': _ros('interrupts shutdown'),
        'node_time.py': _ros('node_time time timed'),
        'names.py': _ros('several missing refusals'),
        'native_start.py': _ros('native_start'),
        'graph_*.py': _ros('feed missing graph asked'),
        'declared.py': _ros('parameters parameter_table constants usage'),
        'next_report.py': _ros('node_time'),
        'overrides.py': _ros('overrides'),
        'parameters.py': _ros('parameters parameter_table overrides usage'),
        'player.py': _ros('played'),
        'process.py': _ros('usage interrupts'),
        'signals.py': _ros('interrupts'),
        'qos.py': _ros('qos feed'),
        'raw_topic.py': _ros('raw_topic'),
        'rcl_*.py': _ros('feed monitor_node'),
        'service_gate.py': _ros('service_gate services'),
        'sign_of_life.py': _ros('sign_of_life'),
        '*': _ros('monitor_node lifecycle parameters missing faults')}),
    'program': Room('fret_monitor/program', ('fret_monitor/program/*.py',), 40, {
        'cost.py': 'test/worst_case test/cli/test_check.py test/program/test_layout.py',
        'margins.py': 'test/differential/test_margins.py test/bag/test_margins.py',
        'window_sizes.py': 'test/cli/test_check.py test/program/test_layout.py',
        'rewriting.py': 'test/program/test_lower.py test/fret '
                        'test/differential/test_timed_formulas.py',
        '*': 'test/program/test_lower.py test/program/test_layout.py test/codegen/test_shape.py '
             'test/differential/test_timed_formulas.py test/differential/test_random_formulas.py '
             'test/program/test_parts.py'}),
    'elaboration': Room('fret_monitor/elaboration', ('fret_monitor/elaboration/*.py',), 60, {
        'acting*.py': f'{_SPECIFY} test/lint/test_actions.py test/lint/test_gates.py '
                      'test/elaboration/test_elaborate.py test/bundle/test_bundle.py '
                      'test/runtime/test_gate.py',
        'signals.py': f'{_SPECIFY} test/elaboration test/bundle/test_bundle.py '
                      'test/codegen/test_extractors.py',
        '*': f'{_SPECIFY} test/elaboration/test_times.py test/elaboration/test_types_by_use.py '
             'test/lint test/elaboration test/cli/test_check.py'}),
}


# ---- the copy that mutants are put into --------------------------------------------------------

# An object of the same text and flags is compiled once: a mutant costs the one file that changed.
# A warning would be noticed by a test of its own, and says nothing about the others.
_COMPILER = """\
import hashlib, os, sys

REAL, KEPT = {real!r}, {kept!r}
# A compiler cache looks for the compiler itself, and would find this program again.
own = os.path.dirname(os.path.abspath(__file__))
os.environ['PATH'] = os.pathsep.join(
    place for place in os.environ['PATH'].split(os.pathsep) if place != own)
arguments = [*sys.argv[1:], '-w']
sources = [word for word in arguments if word.endswith('.c')]
if '-c' not in arguments or not sources:
    os.execv(REAL, [REAL, *arguments])
target = arguments[arguments.index('-o') + 1] if '-o' in arguments else None
flags, skip = [], False
for word in arguments:
    if not skip and word not in ('-c', '-o') and word not in sources:
        flags.append(word)
    skip = word == '-o'
status = 0
for source in sources:
    made = target or os.path.basename(source)[:-2] + '.o'
    places = [word[2:] for word in flags if word.startswith('-I')]
    texts = [source]
    for place in {{os.path.dirname(source) or '.', *places}}:
        texts += sorted(e.path for e in os.scandir(place) if e.name.endswith('.h'))
    seen = hashlib.sha256(repr([word for word in flags if not word.startswith('-I')]).encode())
    for text in texts:
        seen.update(os.path.basename(text).encode() + open(text, 'rb').read())
    kept = os.path.join(KEPT, seen.hexdigest())
    if os.path.exists(kept):
        with open(kept, 'rb') as file, open(made, 'wb') as copy:
            copy.write(file.read())
        continue
    import shutil, subprocess
    done = subprocess.run([REAL, *flags, '-c', source, '-o', made], capture_output=True)
    sys.stdout.buffer.write(done.stdout)
    sys.stderr.buffer.write(done.stderr)
    status = status or done.returncode
    if done.returncode == 0 and not done.stdout + done.stderr:
        shutil.copyfile(made, f'{{kept}}.{{os.getpid()}}')
        os.rename(f'{{kept}}.{{os.getpid()}}', kept)
sys.exit(status)
"""


class Copy:
    """A copy of the repository, one file of which may be changed."""

    def __init__(self, folder: Path) -> None:
        self.root = folder / 'repository'
        self._folder = folder
        self._moment = int(time.time()) - 10**6
        self.root.mkdir()
        (folder / 'home').mkdir()
        for name in _COPIED:
            shutil.copytree(ROOT / name, self.root / name,
                            ignore=shutil.ignore_patterns('__pycache__'))
        for file in ROOT.iterdir():
            if file.is_file():
                shutil.copy2(file, self.root)
        (self.root / '.venv').symlink_to(ROOT / '.venv')
        self._wrap_compiler()

    def _wrap_compiler(self) -> None:
        programs, kept = self._folder / 'bin', self._folder / 'objects'
        programs.mkdir()
        kept.mkdir()
        for name in ('cc', 'gcc'):
            real = shutil.which(name)
            if real is not None:
                file = programs / name
                file.write_text(f'#!{sys.executable} -SE\n'
                                + _COMPILER.format(real=real, kept=str(kept)), encoding='utf-8')
                file.chmod(0o755)

    def environment(self) -> dict[str, str]:
        """Return the variables with which processes import the copy, and find the compiler."""
        path = os.pathsep.join([str(self._folder / 'bin'), os.environ['PATH']])
        return {'PYTHONPATH': str(self.root), 'PATH': path, 'FRET_MONITOR_EXAMPLES': '15',
                'FRET_MONITOR_TEST_HOME': str(self._folder / 'home'),
                'PYTHONDONTWRITEBYTECODE': ''}  # each process would compile the package anew

    @contextmanager
    def changed(self, mutant: SourceMutant) -> Iterator[None]:
        """Put a mutant in."""
        file = self.root / mutant.path
        text = file.read_text(encoding='utf-8')
        self._write(file, mutant.applied(text))
        try:
            yield
        finally:
            self._write(file, text)

    def _write(self, file: Path, text: str) -> None:
        """Write a file with a date of its own: Python compares dates in seconds, and sizes."""
        self._moment += 2
        file.write_text(text, encoding='utf-8')
        os.utime(file, (self._moment, self._moment))


# ---- judging -----------------------------------------------------------------------------------


class _FirstFailure:
    """A plugin of pytest that writes the test that failed, or took too long, to a file."""

    def __init__(self, file: Path) -> None:
        self._file = file

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        self._file.write_text(nodeid, encoding='utf-8')  # while it runs, and if it never ends

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            how = '\ntoo long' if 'Timeout (>' in report.longreprtext else '\nfailed'
            self._file.write_text(report.nodeid + how, encoding='utf-8')

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        if report.failed:
            self._file.write_text(f'{report.nodeid}\nfailed', encoding='utf-8')


@dataclass(frozen=True)
class Failure:
    """What noticed a mutant: a test, or a program with its argument."""

    by: str
    is_ended: bool
    """Whether it did not fail, but was ended: perhaps because the machine was busy."""


def run_tests(copy: Copy, tests: Sequence[str], test_s: float = _TEST_S) -> Failure | None:
    """Run tests in the copy; return the first that fails or takes too long, None if all pass."""
    with tempfile.TemporaryDirectory(prefix='judged-') as name:
        current = Path(name) / 'current'
        child = os.fork()
        if child == 0:
            try:
                os._exit(_run_here(copy, tests, current, Path(name), test_s))
            except BaseException:  # noqa: B902  # it must not go on as the parent does
                traceback.print_exc()
            os._exit(_BROKEN)
        status = _wait(child, current, 2 * test_s)
        if status in (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED):
            return None
        if status in (pytest.ExitCode.INTERNAL_ERROR, pytest.ExitCode.USAGE_ERROR, _BROKEN):
            raise RuntimeError((Path(name) / 'output').read_text(encoding='utf-8'))
        test, _, how = _text_of(current).partition('\n')
        is_ended = status in (None, -signal.SIGKILL, -signal.SIGTERM) or how == 'too long'
        return Failure(test or f'status {status}', is_ended)


def _text_of(file: Path) -> str:
    return file.read_text(encoding='utf-8') if file.is_file() else ''


def _run_here(copy: Copy, tests: Sequence[str], current: Path, folder: Path,
              test_s: float) -> int:
    """Run pytest in this process, a child, as if it had been started in the copy."""
    os.setsid()
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    output = os.open(folder / 'output', os.O_WRONLY | os.O_CREAT)
    os.dup2(output, 1)
    os.dup2(output, 2)
    os.chdir(copy.root)
    os.environ.update({**copy.environment(), 'TMPDIR': str(folder)})
    tempfile.tempdir = None
    sys.dont_write_bytecode = False
    sys.path[:] = [str(copy.root), *(path for path in sys.path if path not in ('', str(ROOT)))]
    for name in [name for name in sys.modules if name.split('.')[0] in ('bench', 'fret_monitor')]:
        del sys.modules[name]
    importlib.invalidate_caches()
    # A failure is enough: the smallest one takes minutes to find.
    next(module for name, module in sys.modules.items()
         if name.endswith('.conjecture.engine')).__dict__['MAX_SHRINKS'] = 1
    if not any(test.startswith(_SANITIZED) for test in tests):
        # The address sanitizer reserves more than any limit.
        resource.setrlimit(resource.RLIMIT_AS, (_MEMORY_BYTES, _MEMORY_BYTES))
    try:
        return int(pytest.main(
            ['-x', '-q', '-p', 'no:cacheprovider',
             f'--timeout={test_s}', f'--basetemp={folder / "pytest"}',
             '-k', ' and '.join(f'not {name}' for name in _LEFT_OUT),
             '-W', 'ignore::pytest.PytestAssertRewriteWarning', *tests],
            plugins=[_FirstFailure(current)]))
    finally:
        sys.stdout.flush()


def _wait(child: int, current: Path, test_s: float) -> int | None:
    """
    Wait for a child and end all that it has started.

    None if it took too long, or the file `current` stayed as it was for `test_s` seconds: then a
    test waits in C, where the timeout of pytest does not end it.
    """
    end = time.monotonic() + _MUTANT_S
    status = None
    try:
        while status is None and time.monotonic() < end and _age_s(current) < test_s:
            ended, result = os.waitpid(child, os.WNOHANG)
            if ended:
                status = os.waitstatus_to_exitcode(result)
            else:
                time.sleep(0.02)
    finally:
        with suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)
        if status is None:
            os.waitpid(child, 0)
    return status


def _age_s(file: Path) -> float:
    return time.time() - file.stat().st_mtime if file.is_file() else 0.0


class Programs:
    """The programs of test/csrc, which notice most mutants of C, without sanitizers and pytest."""

    def __init__(self, copy: Copy, folder: Path) -> None:
        """Compile the engine, and the programs, in a folder."""
        self._folder = folder
        self._csrc = copy.root / 'csrc'
        folder.mkdir()
        self._engine = {source: self._object(source) for room in CSRC_ROOMS[:-1]
                        for source in sorted((self._csrc / room).glob('*.c'))
                        if source.name not in _OTHER_LIBRARIES}
        sources = {name: copy.root / 'test' / 'csrc' / f'{name}.c' for name in _PROGRAMS}
        self._wrapped = {name: set(_WRAPPED.findall(source.read_text(encoding='utf-8')))
                         for name, source in sources.items()}
        self._programs = {name: self._object(source, f'program_{name}')
                          for name, source in sources.items()}
        self._linked: dict[str, bytes] = {}
        failing = self._first_failing([*self._engine.values()], [*_PROGRAMS])
        self._used = {name: _symbols(folder / name) for name in _PROGRAMS}
        for name in _PROGRAMS:
            self._linked[name] = (folder / name).read_bytes()
            shutil.copy2(folder / name, folder / f'unchanged_{name}')
        if failing is not None:
            raise RuntimeError(f'{failing} fails without a mutant')

    def failing(self, path: Path) -> str | None:
        """Return the first program that fails with the text that a file of the engine now has."""
        if path not in self._engine:
            return None
        objects = [*(made for source, made in self._engine.items() if source != path),
                   self._object(path, 'changed')]
        defined = _symbols(self._engine[path])
        return self._first_failing(
            objects, [name for name in _PROGRAMS if defined & self._used[name]])

    def _first_failing(self, objects: list[Path], names: Sequence[str]) -> str | None:
        for name in names:
            program, arguments = self._folder / name, _PROGRAMS[name]
            flags = [f'-Wl,--wrap={function}' for function in self._wrapped[name]]
            subprocess.run(['gcc', self._programs[name], *objects, *flags, '-o', program,
                            '-Wl,--gc-sections', '-pthread', '-lm'],
                           check=True, capture_output=True)
            if program.read_bytes() == self._linked.get(name):
                continue  # the change is in a function that this program does not call
            for argument in arguments or self._scenarios(program):
                if self._fails(program, argument):
                    return f'{name} {argument}'.strip()
        return None

    def _scenarios(self, program: Path) -> list[str]:
        done = subprocess.run([program], check=False, capture_output=True, text=True)
        return done.stdout.split()

    def _fails(self, program: Path, argument: str) -> bool:
        """Return whether it hangs, or fails twice: some have threads and clocks."""
        status = _status(program, argument)
        if status is None:
            return self._hangs(program, argument)
        return status != 0 and _status(program, argument) != 0

    def _hangs(self, program: Path, argument: str) -> bool:
        """Return whether it takes too long again, and much longer than without a mutant."""
        unchanged = self._folder / f'unchanged_{program.name}'
        before = time.monotonic()
        if not unchanged.exists() or _status(unchanged, argument) != 0:
            return False
        taken_s = time.monotonic() - before
        return _status(program, argument, max(_PROGRAM_S, _SLOWER * taken_s)) is None

    def _object(self, source: Path, name: str = '') -> Path:
        made = self._folder / f'{name or source.stem}.o'
        subprocess.run(['gcc', '-std=c99', '-O0', '-w', '-ffunction-sections', '-fdata-sections',
                        *(f'-I{self._csrc / room}' for room in CSRC_ROOMS),
                        '-c', source, '-o', made], check=True)
        return made


def _symbols(file: Path) -> set[str]:
    """Return the names that an object file or a program defines for others."""
    done = subprocess.run(['nm', '--defined-only', '--extern-only', '-P', file], check=True,
                          capture_output=True, text=True)
    return {line.split()[0] for line in done.stdout.splitlines()}


def _status(program: Path, argument: str, limit_s: float = _PROGRAM_S) -> int | None:
    """Return the status with which a program ends, None if it takes longer than the limit."""
    with suppress(subprocess.TimeoutExpired):
        return subprocess.run([program, *argument.split()], check=False, timeout=limit_s,
                              capture_output=True).returncode
    return None


class Judge:
    """Judges mutants in a copy; knows which tests fail, or pass, there without one."""

    def __init__(self, copy: Copy, programs: Programs) -> None:
        self._copy = copy
        self._programs = programs
        self._failing: list[str] = []
        self._passing: dict[str, float] = {}  # without a mutant; the seconds

    def judged(self, mutant: SourceMutant, tests: tuple[str, ...], version: str,
               likely: Sequence[str] = ()) -> Result:
        """Return the result for a mutant; `likely` are tests that have noticed others."""
        before = time.monotonic()
        answer, by = self._first_answer(mutant) or self._answer_of_tests(mutant, tests, likely)
        return Result(mutant.key, answer, by, round(time.monotonic() - before, 1), version)

    def _first_answer(self, mutant: SourceMutant) -> tuple[str, str] | None:
        with self._copy.changed(mutant):
            if not self._compiles(mutant):
                return 'invalid', ''
            program = self._programs.failing(self._copy.root / mutant.path)
        return None if program is None else ('noticed', program)

    def _answer_of_tests(self, mutant: SourceMutant, tests: Sequence[str],
                         likely: Sequence[str]) -> tuple[str, str]:
        passed: Sequence[str] = ()
        with suppress(RuntimeError):  # one has another name by now
            answer = self._answer(mutant, likely)
            if answer[0] == 'noticed':
                return answer
            passed = likely if answer[0] == 'missed' else ()
        return self._answer(mutant, tests, passed)

    def _answer(self, mutant: SourceMutant, tests: Sequence[str],
                passed: Sequence[str] = ()) -> tuple[str, str]:
        end = time.monotonic() + _MUTANT_S
        left_out = [*passed]
        while failure := self._failure(mutant, tests, left_out):
            if self._is_confirmed(mutant, failure):
                return 'noticed', failure.by
            if time.monotonic() > end:
                return 'open', 'the time was over'
            left_out.append(failure.by)
        return 'missed', ''

    def _failure(self, mutant: SourceMutant, tests: Sequence[str],
                 left_out: Sequence[str]) -> Failure | None:
        out = {*left_out, *self._failing}
        left = [test for test in tests if test not in out]
        if not left:
            return None
        with self._copy.changed(mutant):
            return run_tests(self._copy, [*(f'--deselect={test}' for test in out), *left])

    def _is_confirmed(self, mutant: SourceMutant, failure: Failure) -> bool:
        """Return whether a failure was the mutant's: not the machine's, and not the test's."""
        if '::' not in failure.by or not (failure.is_ended
                                          or failure.by.startswith('test/ros/')):
            return not failure.is_ended
        if failure.is_ended or failure.by not in self._passing:
            self._try_unchanged(failure.by)
        taken_s = self._passing.get(failure.by)
        if taken_s is None:
            return False
        with self._copy.changed(mutant):
            again = run_tests(self._copy, [failure.by], max(_TEST_S, _SLOWER * taken_s))
        return again is not None

    def _try_unchanged(self, test: str) -> None:
        before = time.monotonic()
        if run_tests(self._copy, [test]) is None:
            self._passing[test] = time.monotonic() - before
        else:
            print(f'  left out, it fails without a mutant: {test}', flush=True)
            self._failing.append(test)
            self._passing.pop(test, None)

    def _compiles(self, mutant: SourceMutant) -> bool:
        if not mutant.path.endswith('.c'):
            return True
        root = self._copy.root
        searched = [f'-I{root / "csrc" / room}' for room in CSRC_ROOMS]
        done = subprocess.run(
            ['gcc', '-std=c99', '-fsyntax-only', '-w', *searched, *_headers_of_ros(),
             root / mutant.path], check=False, capture_output=True)
        return done.returncode == 0


@cache
def _headers_of_ros() -> list[str]:
    done = subprocess.run(
        [sys.executable, '-c', 'import json; from fret_monitor.native import ros_files; '
         'print(json.dumps(ros_files.searched()))'],
        check=True, capture_output=True, text=True, cwd=ROOT)
    found: list[str] = json.loads(done.stdout)
    return found


# ---- the run -----------------------------------------------------------------------------------


def mutants_of(room: Room, count: int) -> list[SourceMutant]:
    """Return the mutants of a room."""
    paths = sorted({str(path.relative_to(ROOT)) for pattern in room.files
                    for path in ROOT.glob(pattern)})
    found = [replace(mutant, place=room.place) for mutant in all_changes(ROOT, paths)]
    return sample(found, count)


@cache
def _version(path: str, tests: tuple[str, ...]) -> str:
    """Return a hash of a source file and its tests."""
    files = [ROOT / path]
    for test in tests:
        place = ROOT / test.partition('::')[0]
        files += sorted(place.rglob('*.[pc]*')) if place.is_dir() else [place]
    texts = [file.read_bytes() for file in files if file.suffix in ('.py', '.c', '.h')]
    return sha256(b'\0'.join(texts)).hexdigest()[:16]


def _likely(known: dict[str, Result], mutant: SourceMutant,
            tests: Sequence[str]) -> list[str]:
    """Return the tests among `tests` that noticed this mutant before, or others of its room."""
    mine = known.get(mutant.key)
    others = [result for key, result in known.items() if key.startswith(f'{mutant.place}/')]
    others.sort(key=lambda result: result.key.partition(':')[0] == mutant.key.partition(':')[0])
    found = [result.by for result in (*([mine] if mine else []), *reversed(others))
             if '::' in result.by and result.by.startswith(tuple(tests))]
    return [*dict.fromkeys(found)][:_LIKELY]


def judge_room(name: str, judge: Judge, share: int, only: str, is_once: bool) -> bool:
    """Judge the mutants of a room and print what was missed; return whether enough was noticed."""
    room = ROOMS[name]
    known, same = kept_results(), equivalent()
    counts = dict.fromkeys(('noticed', 'missed', 'invalid', 'equivalent', 'open'), 0)
    missed = []
    for mutant in mutants_of(room, -(-room.mutants * share // 100)):
        if mutant.key in same:
            counts['equivalent'] += 1
            continue
        if only not in mutant.key:
            continue
        tests = room.tests_of(mutant.path)
        version = _version(mutant.path, tests)
        result = known.get(mutant.key)
        is_known = result is not None and (is_once or result.version == version)
        if result is None or not is_known or result.answer == 'open':
            result = judge.judged(mutant, tests, version, _likely(known, mutant, tests))
            known[mutant.key] = result
            keep(result)
            print(f'  {result.answer} {result.seconds:.0f} s {mutant.path}:{mutant.line} '
                  f'{mutant.before} => {mutant.after}  [{result.by}]', flush=True)
        counts[result.answer] += 1
        if result.answer == 'missed':
            missed.append(mutant)
    judged = counts['noticed'] + counts['missed']
    print(f'{name}: {judged} mutants, {counts["noticed"]} noticed, {counts["missed"]} missed; '
          f'{counts["equivalent"]} mean the same, {counts["invalid"]} do not compile, '
          f'{counts["open"]} took too long')
    for mutant in missed:
        print(f'  missed: {mutant.path}:{mutant.line}\n    {mutant.key}', flush=True)
    return counts['noticed'] >= GOAL * judged


def main(arguments: Sequence[str]) -> int:
    """Judge the rooms that are named, all without a name."""
    parser = argparse.ArgumentParser(prog='python -m bench.mutation')
    parser.add_argument('rooms', nargs='*', metavar='ROOM', help=' '.join(ROOMS))
    parser.add_argument('--share', type=int, default=100, metavar='PERCENT',
                        help='of the mutants of each room')
    parser.add_argument('--once', action='store_true',
                        help='no mutant that was judged before, whatever has changed since')
    parser.add_argument('--only', default='', metavar='TEXT', help='those with this in their key')
    options = parser.parse_args(arguments)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # ends what it has started
    for name in _PRELOADED:
        importlib.import_module(name)
    with tempfile.TemporaryDirectory(prefix='fret_monitor-mutation-') as folder:
        copy = Copy(Path(folder))
        judge = Judge(copy, Programs(copy, Path(folder) / 'programs'))
        enough = [judge_room(name, judge, options.share, options.only, options.once)
                  for name in options.rooms or ROOMS]
    SUMMARY.write_text(summary({name: mutants_of(room, room.mutants)
                                for name, room in ROOMS.items()}), encoding='utf-8')
    return 0 if all(enough) else 1


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
