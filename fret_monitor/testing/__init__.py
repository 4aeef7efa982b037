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
For tests of robots: a monitor beside a simulation, which fails the test on a violation.

The fixture needs this line in `conftest.py` (docs/ci.md):

    pytest_plugins = ['fret_monitor.testing']

ROS is imported only when a monitor was started.
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, ExitStack, suppress
from dataclasses import dataclass, replace
from itertools import count
import math
import os
from pathlib import Path
import re
import signal
import subprocess
import sys
from tempfile import TemporaryFile
from time import monotonic, sleep, time
from typing import Any, IO, TYPE_CHECKING
import warnings

import pytest

if TYPE_CHECKING:
    from fret_monitor.model.manifest import Manifest
    from fret_monitor.testgen.inputs import InputTrace, Tested
    from fret_monitor.testing.next_report import NodeReport, RequirementReport
    from fret_monitor.testing.player import Make
    from hypothesis.strategies import SearchStrategy

_MONITOR = ('import sys; from fret_monitor.ros.monitor import main; '
            'sys.argv[0] = "monitor"; sys.exit(main())')
_READY = re.compile(r'watching (?P<number>\d+) requirement')
_IGNORED = re.compile(r"\[WARN\] (?P<line>ignored parameter '(?P<name>[^']*)'.*)")
_VIOLATED = re.compile(
    r'\[(?:ERROR|WARN)\] (?P<line>(?P<id>\S+) violated at (?P<stamp>-?\d+\.\d+): .*)')
_UNSEEN = re.compile(
    r'\[ERROR\] (.* its messages are not received|.* does not match the subscription to .*)')
_SILENT = ', no message for '  # in the line of a violation by an input that is too old
_REORDERED = re.compile(r'reordered within (?P<seconds>[\d.e+-]+) s')
_NAME = 'fret_monitor'
_NUMBERS = count(1)  # of the monitors of this process
_ARRIVAL_S = 0.1  # after the end of a block, for messages that were published before
_LOG_S = 3.0  # after a violation, until it is logged
Step = Callable[[dict[str, Any]], Mapping[str, Any]]
"""A node as a function: the values of its inputs at a row, by name, to those of its outputs."""

_PAUSE_S = 0.1  # after each row, for the answer of a node
_TRIES = 3  # of a trace on which a requirement was not evaluated
_EXAMPLES = 200
_PROCESS_EXAMPLES = 10
_TIMEOUT_S = 60.0  # of `check_node`
_OUTPUT_LINES = 20  # of a node, in an error
_ENDING_S = 5.0  # after SIGINT, until SIGKILL
_HAS_PASSED = pytest.StashKey[bool]()


class _DoesNotStart(AssertionError):
    """A node, or the monitor, does not start: no trace can be played."""


class Watched:
    """A monitor that runs as a process, and what it has logged."""

    def __init__(self, bundle: str | os.PathLike[str], arguments: tuple[str, ...],
                 seconds: float, *, allow_losses: bool = False) -> None:
        """Start it with further ROS arguments; all waits end after some seconds."""
        self.node_name = f'{_NAME}_{os.getpid()}_{next(_NUMBERS)}'
        self._arguments = arguments
        self._seconds = seconds
        self._allow_losses = allow_losses
        self._until: float | None = None  # s since the epoch: when the block ended
        self._file = TemporaryFile()  # noqa: SIM115  closed by `end`
        self._output: str | None = None  # all of it, after `end`
        self.process = subprocess.Popen(
            [sys.executable, '-c', _MONITOR, '--ros-args', '-r', f'__node:={self.node_name}',
             '-p', f'spec:={os.fspath(bundle)}', *arguments, '-p', 'log_violations:=true'],
            stdin=subprocess.DEVNULL, stdout=self._file, stderr=subprocess.STDOUT,
            env={**os.environ, 'RCUTILS_COLORIZED_OUTPUT': '0',
                 'RCUTILS_CONSOLE_OUTPUT_FORMAT': '[{severity}] {message}'})

    @property
    def output(self) -> str:
        """What it has written so far."""
        if self._output is not None:
            return self._output
        size = os.fstat(self._file.fileno()).st_size
        return os.pread(self._file.fileno(), size, 0).decode(errors='replace')

    @property
    def violations(self) -> list[str]:
        """
        Lines with requirement, time and values; at most one a second of each requirement.

        After the block, those until its end.
        """
        return self._violations(self._until)

    def _violations(self, until: float | None) -> list[str]:
        """Return the lines of the violations until a time; of all, if that is None."""
        return [match['line'] for match in _VIOLATED.finditer(self.output)
                if until is None or float(match['stamp']) <= until + (
                    0 if _SILENT in match['line'] else _ARRIVAL_S)]

    def wait(self) -> None:
        """
        Wait until it has subscribed to all topics.

        Raises
        ------
        AssertionError
            if it does not start, or ignores a parameter in the arguments.
        """
        end = monotonic() + self._seconds
        while not _READY.search(self.output):
            if not self._is_running() or monotonic() > end:
                raise AssertionError(f'the monitor does not start:\n{self.output}')
            sleep(0.02)
        # Other nodes may use what a file of parameters has beside the monitor's.
        given = {text.partition(':=')[0].rpartition(':')[2] for text in self._arguments}
        lines = [match['line'] for match in _IGNORED.finditer(self.output)
                 if match['name'] in given]
        if lines:
            raise AssertionError('\n'.join(lines))

    def check(self) -> None:
        """
        Judge what happened until now.

        Raises
        ------
        AssertionError
            if a requirement was violated, or never evaluated; or if messages were not received.
        """
        self._check(time())

    def requirements(self) -> 'tuple[RequirementReport, ...]':
        """
        Return the counts of each requirement until now.

        Raises
        ------
        AssertionError
            if the monitor does not report.
        """
        return self._report().requirements

    def end_block(self) -> None:
        """Judge what happened until now, as `check`; what comes later does not count."""
        self._until = time()
        self._check(self._until)

    def _report(self) -> 'NodeReport':
        """Wait for the next report of the monitor; raises `AssertionError` without one."""
        from fret_monitor.testing.next_report import next_report
        reorder = max((float(match['seconds']) for match in _REORDERED.finditer(self.output)),
                      default=0.0)  # messages wait so long before they are evaluated
        sleep(_ARRIVAL_S + reorder)
        ready = _READY.search(self.output)
        report = next_report(self.node_name, int(ready['number']) if ready else 0,
                             self._seconds, self._is_running)
        if report is None:
            raise AssertionError(
                f'{self._ending() or "the monitor does not report any more"}:\n{self.output}')
        return report

    def _check(self, until: float) -> None:
        report = self._report()
        announced = {item.id: item.announced for item in report.requirements if item.announced}
        unlogged = self._unlogged(announced)
        lines = self._violations(until)
        lines += [f'{item} violated {announced[item]} times' for item in unlogged]
        lines += [f'{item.id} was never evaluated: {item.message}' for item in report.requirements
                  if not item.steps and not item.announced]
        lines += _UNSEEN.findall(self.output)
        lines += [f'{item.name}: {item.undecodable} messages cannot be decoded'
                  for item in report.topics if item.undecodable]
        lines += [f'{item.name}: {item.lost} messages were lost (allow_losses=True allows that)'
                  for item in report.topics if item.lost and not self._allow_losses]
        if lines:
            raise AssertionError('\n'.join(lines))

    def _unlogged(self, announced: dict[str, int]) -> list[str]:
        """Return the requirements whose violations have no line; wait a while for the lines."""
        end = monotonic() + _LOG_S
        while True:
            logged = {match['id'] for match in _VIOLATED.finditer(self.output)}
            missing = [item for item in announced if item not in logged]
            if not missing or monotonic() > end:
                return missing
            sleep(0.05)

    def add_notes(self, error: BaseException) -> None:
        """Add to an exception what the monitor has found before."""
        if self.violations:
            error.add_note('\n'.join(['violations before that:', *self.violations]))
        if self._ending():
            error.add_note(self._ending())

    def _is_running(self) -> bool:
        return self.process.poll() is None

    def _ending(self) -> str:
        """Return how it ended; an empty text if it runs."""
        status = self.process.poll()
        if status is None:
            return ''
        if status < 0:
            return f'the monitor was killed by {signal.Signals(-status).name}'
        return f'the monitor has ended with exit status {status}'

    def end(self) -> None:
        """End the process."""
        if self._is_running():
            self.process.send_signal(signal.SIGINT)
        try:
            self.process.wait(self._seconds)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self._output = self.output
        self._file.close()


def play_trace(bundle: str | os.PathLike[str], trace: str | os.PathLike[str],
               announced: Iterable[str] = (), *, node: Sequence[str] | None = None,
               constants: Mapping[str, str] | None = None, make: 'Make | None' = None,
               seconds: float = 30.0, pause: float | None = None) -> None:
    """
    Play a trace to a monitor, and to a node, over ROS topics.

    Parameters
    ----------
    bundle, constants
        the bundle, and values of its constants that are used in place of its own.
    trace
        CSV as for `fret-monitor simulate`.
    announced
        the requirements that have to be announced as violated, and no others.
    node
        the command that starts a node under test. It publishes the inputs with `role: output`,
        which are not taken from the trace.
    make
        makes the message of a topic from the values of its inputs, where inputs are not fields.
    seconds
        after which waiting for a process fails.
    pause
        the time in seconds that a node has after each row, and when `/clock` goes on; default 0.1
        with a node.

    Raises
    ------
    AssertionError
        if other requirements are violated, or a process does not start or ends.
    CompileError
        if the bundle or the trace cannot be used.
    """
    from fret_monitor.build import read
    from fret_monitor.model.diagnostics import Source, Text
    from fret_monitor.model.policies import InputRole
    from fret_monitor.start import start
    path = Path(bundle)
    given = {name: Text.whole(Source(f'constant {name}', value))
             for name, value in (constants or {}).items()}
    specification = read(path, constants=given).specification
    manifest = start(path, constants=given).manifest
    played = {item.name for item in specification.signals
              if node is None or item.role is InputRole.INPUT}
    times, rows = _trace_rows(Path(trace), manifest)
    what = _Played(played, times, rows, times[-1], make, pause)
    _play(path, manifest, what, node, _overrides(constants or {}), seconds, sorted(announced))


def _overrides(constants: Mapping[str, str]) -> list[str]:
    """Return the ROS arguments that give constants their values."""
    return [text for name, value in constants.items()
            for text in ('-p', f'constants.{name}:={value}')]


@dataclass(frozen=True)
class _Played:
    """What is played: the names of inputs, and rows of all inputs with their times."""

    names: Collection[str]
    times: Sequence[int]
    rows: Sequence[Sequence[Any]]
    end: int
    make: 'Make | None' = None
    pause: float | None = None


def _trace_rows(path: Path, manifest: 'Manifest') -> tuple[list[int], list[tuple[Any, ...]]]:
    from fret_monitor.model.policies import Policy
    from fret_monitor.traces.csv_trace import open_trace, TimeColumn, TraceReader
    is_timed = manifest.policy is Policy.TIMED
    times: list[int] = []
    rows: list[tuple[Any, ...]] = []
    with open_trace(path) as file:
        reader = TraceReader(str(path), file, manifest.inputs,
                             TimeColumn.REQUIRED if is_timed else TimeColumn.IGNORED)
        for some, columns in reader.blocks():
            times += some
            rows += zip(*columns, strict=True)
    return times, rows


def _play(bundle: Path, manifest: 'Manifest', played: _Played, node: Sequence[str] | None,
          arguments: Sequence[str], seconds: float, announced: Sequence[str],
          end: float = math.inf) -> dict[str, str]:
    """
    Play rows; raise `AssertionError` if other requirements are announced.

    Returns the requirements that were never evaluated, each with the reason. Those are played
    again, until a time of the steady clock: a busy machine may lose what a node publishes before
    it has found the monitor.
    """
    missing: dict[str, str] = {}
    for _ in range(_TRIES if node is not None else 1):
        found, lines, missing = _played_once(bundle, manifest, played, node, arguments, seconds)
        if found != list(announced):
            raise AssertionError('\n'.join([
                f'violated: {", ".join(found) or "nothing"}',
                f'expected: {", ".join(announced) or "nothing"}', *lines]))
        if not missing or monotonic() > end:
            break
    return missing


def _played_once(bundle: Path, manifest: 'Manifest', played: _Played,
                 node: Sequence[str] | None, arguments: Sequence[str],
                 seconds: float) -> tuple[list[str], list[str], dict[str, str]]:
    """Return the requirements that were announced, the lines, and those not evaluated."""
    from fret_monitor.testing.player import Player
    with ExitStack() as stack:
        pause = played.pause if played.pause is not None else _PAUSE_S if node else 0.0
        player = stack.enter_context(Player(manifest, played.names, played.make, pause))
        simulated = ('-p', 'use_sim_time:=true') if player.has_clock else ()
        process = None if node is None else stack.enter_context(_running(node, seconds))
        watched = Watched(bundle, (*arguments, *simulated), seconds)
        stack.callback(watched.end)
        try:
            watched.wait()
            player.wait(watched.node_name, 1 if process is None else 2, seconds)
        except AssertionError as error:
            ended = [] if process is None else process.ending()
            raise _DoesNotStart('\n'.join([str(error), *ended])) from None
        player.play(played.times, played.rows, played.end)
        if process is not None and process.has_ended:
            raise AssertionError('\n'.join(process.ending()))
        requirements = watched.requirements()
        return (sorted(item.id for item in requirements if item.announced),
                [*watched.violations, *(process.output() if process else ())],
                {item.id: item.message for item in requirements
                 if not item.steps and not item.announced})


def traces(bundle: str | os.PathLike[str], *, max_steps: int = 20,
           constants: Mapping[str, str] | None = None) -> 'SearchStrategy[InputTrace]':
    """
    Return a strategy of Hypothesis: traces of the inputs of a bundle that a node does not set.

    These are all inputs but those with `role: output`. Their values are below, above and equal to
    the numbers that they are compared with; they stay for about as long as the bounds of the
    requirements. A trace has at most `max_steps` steps, under `timed` rows.

    Raises
    ------
    CompileError
        if the bundle cannot be used, or Hypothesis is not installed.
    """
    return _strategy(_tested(bundle, constants, max_steps), max_steps)


def check_node(bundle: str | os.PathLike[str], node: 'Callable[[], Step] | Sequence[str]', *,
               tries: int | None = None, max_steps: int = 20,
               constants: Mapping[str, str] | None = None, make: 'Make | None' = None,
               seconds: float = 30.0, pause: float | None = None,
               timeout: float = _TIMEOUT_S) -> None:
    """
    Look for a trace on which a node violates a requirement.

    Parameters
    ----------
    bundle, constants, make, seconds, pause
        as for `play_trace`.
    node
        the command that starts it: then a new process is fed over ROS topics for each trace. Or a
        function that is called for each trace, and returns one that is called with the values of
        the inputs at each row, by name, and returns those of the outputs (`role: output`).
    tries
        how many traces are tried; default 200, and 10 with a command.
    max_steps
        how many steps (under `timed`, rows) a trace has at most.
    timeout
        seconds after which no other trace is tried. A warning says so if the node has violated
        nothing, and a note if a shorter trace may exist.

    Raises
    ------
    AssertionError
        with the shortest trace that was found on which the node violates a requirement. Or if a
        requirement was evaluated on no trace, or the node does not start.
    CompileError
        if the bundle cannot be used, or Hypothesis is not installed.
    """
    subject = _tested(bundle, constants, max_steps)
    strategy = _strategy(subject, max_steps)
    from hypothesis import given, HealthCheck, Phase, settings, Verbosity
    from hypothesis.errors import Flaky
    count = tries or (_EXAMPLES if callable(node) else _PROCESS_EXAMPLES)

    # Inputs that the node sets are in no message: any value will do.
    usual = {signal.name: signal.values[0][1] if signal.is_string else 0
             for signal in subject.specification.signals}
    names = {signal.name for signal in subject.fed}
    arguments = _overrides(constants or {})

    def play(trace: 'InputTrace') -> Mapping[str, str]:
        if callable(node):
            _check_function(subject, node, trace)
            return {}
        rows = [subject.row({**usual, **row}) for row in trace.rows]
        played = _Played(names, trace.times, rows, trace.end, make, pause)
        try:
            return _play(Path(bundle), subject.monitor.manifest, played, node, arguments, seconds,
                         (), trials.end)
        except _DoesNotStart:
            raise
        except AssertionError as error:
            raise AssertionError(f'on this trace:\n{trace}\n{error}') from None

    trials = _Trials(play, timeout)

    @settings(max_examples=count, deadline=None, database=None, derandomize=True,
              print_blob=False, suppress_health_check=list(HealthCheck),
              phases=(Phase.generate, Phase.shrink), verbosity=Verbosity.quiet)
    @given(strategy)
    def holds(trace: 'InputTrace') -> None:
        failure = trials.failure(trace)
        if failure:  # raised here alone: Hypothesis distinguishes errors by their lines
            raise AssertionError(failure)

    try:
        holds()
    except Flaky:
        raise trials.unsteady_failure() from None
    except AssertionError as error:
        raise trials.noted(error) from None
    trials.judge_evaluations()
    if trials.is_cut:
        warnings.warn(f'{trials.limit} of {count}: allow more with `timeout`', stacklevel=2)


class _Trials:
    """The traces that were tried on a node, until the time is over."""

    def __init__(self, play: 'Callable[[InputTrace], Mapping[str, str]]', timeout: float) -> None:
        """
        Begin the time, in seconds.

        `play` returns the requirements that were not evaluated, each with the reason. It raises
        AssertionError if the node violates some, and _DoesNotStart if none can be played.
        """
        self.end = monotonic() + timeout
        self.is_cut = False
        self._play, self._timeout = play, timeout
        self._held: list[InputTrace] = []
        self._failures: list[tuple[InputTrace, str]] = []
        self._never: dict[str, str] | None = None  # evaluated, on all traces so far
        self._obstacle = ''  # why none can be played

    def failure(self, trace: 'InputTrace') -> str:
        """Return how the node fails on a trace; an empty text if it does not, or is not tried."""
        if self._obstacle or trace in self._held:
            return self._obstacle
        if monotonic() > self.end:
            self.is_cut = True
            return next((text for other, text in self._failures if other == trace), '')
        try:
            missing = self._play(trace)
        except _DoesNotStart as error:
            self._obstacle = str(error)
        except AssertionError as error:
            self._failures.append((trace, str(error)))
            return str(error)
        else:
            self._held.append(trace)
            self._never = {name: reason for name, reason in missing.items()
                           if self._never is None or name in self._never}
        return self._obstacle

    @property
    def limit(self) -> str:
        """Say how many traces were tried when the time was over."""
        from fret_monitor.model.diagnostics import counted
        tried = len(self._held) + len(self._failures)
        return f'the time was over after {self._timeout:g} s and {counted(tried, "trace")}'

    def unsteady_failure(self) -> AssertionError:
        """Return the error of a node that did not fail each time, with its shortest trace."""
        _, text = min(self._failures, key=lambda each: (len(each[0].rows), each[0].end))
        error = AssertionError(text)
        error.add_note('the node has not violated it each time that it was fed this trace')
        return self.noted(error)

    def noted(self, error: AssertionError) -> AssertionError:
        """Add to an error that a shorter trace may exist, if the time was over."""
        if self.is_cut:
            error.add_note(f'{self.limit}: a shorter one may exist')
        return error

    def judge_evaluations(self) -> None:
        """Raise AssertionError if a requirement was evaluated on no trace."""
        from fret_monitor.model.diagnostics import counted
        if self._never:
            raise AssertionError('\n'.join([
                *(f'{name} was evaluated on no trace: {reason}'
                  for name, reason in self._never.items()),
                f'the last of {counted(len(self._held), "trace")}:', str(self._held[-1]),
                'if the node needs more time for an answer, allow more with `pause`']))


def _tested(bundle: str | os.PathLike[str], constants: Mapping[str, str] | None,
            max_steps: int) -> 'Tested':
    from fret_monitor.model.diagnostics import require_packages, Source, Text
    from fret_monitor.testgen.inputs import tested
    require_packages('a search of traces', {'hypothesis': 'hypothesis'})
    return tested(Path(bundle), {name: Text.whole(Source(f'constant {name}', value))
                                 for name, value in (constants or {}).items()}, max_steps)


def _strategy(subject: 'Tested', max_steps: int) -> 'SearchStrategy[InputTrace]':
    from fret_monitor.testgen.inputs import InputTrace
    from hypothesis import strategies as st
    names = [signal.name for signal in subject.fed]
    row = st.tuples(*(st.sampled_from(pool) for pool in subject.pools))
    runs = st.lists(st.tuples(row, st.sampled_from(subject.stays)), min_size=1,
                    max_size=max_steps)

    def made(drawn: list[tuple[tuple[Any, ...], int]]) -> InputTrace:
        times: list[int] = []
        rows: list[dict[str, Any]] = []
        time = 0
        for values, stay in drawn:
            count = 1 if subject.is_timed else min(stay, max_steps - len(rows))
            for _ in range(count):
                times.append(time)
                rows.append(dict(zip(names, values, strict=True)))
                time += stay if subject.is_timed else 1
        end = time if subject.is_timed else times[-1]
        return InputTrace(tuple(times), tuple(rows), end, subject.is_timed)

    return runs.map(made)


def _check_function(subject: 'Tested', node: 'Callable[[], Step]', trace: 'InputTrace') -> None:
    step = node()
    seen = replace(trace, rows=tuple({**row, **step(dict(row))} for row in trace.rows))
    if violated := subject.violated(seen):
        raise AssertionError(f'the node violates {", ".join(violated)} on this trace:\n{seen}')


class _NodeUnderTest:
    """A process, and what it has written."""

    def __init__(self, command: Sequence[str], file: IO[bytes]) -> None:
        """Start it, with a file for its output."""
        self._file = file
        self.process = subprocess.Popen(
            list(command), stdin=subprocess.DEVNULL, stdout=file, stderr=subprocess.STDOUT,
            start_new_session=True)

    @property
    def has_ended(self) -> bool:
        """Whether it has ended by itself."""
        return self.process.poll() is not None

    def ending(self) -> list[str]:
        """Return how it has ended, if it has, and what it has written."""
        ending = f'the node has ended with exit status {self.process.poll()}'
        return [*([ending] if self.has_ended else ()), *self.output()]

    def output(self) -> list[str]:
        """Return the last lines that it has written."""
        size = os.fstat(self._file.fileno()).st_size
        lines = os.pread(self._file.fileno(), size, 0).decode(errors='replace').splitlines()
        return ['the node has written:', *lines[-_OUTPUT_LINES:]] if lines else []


@contextmanager
def _running(command: Sequence[str], seconds: float) -> Iterator[_NodeUnderTest]:
    """
    Run a node during a block; what it started ends with it.

    Its output is kept for errors: at its end, a node in Python writes a traceback.
    """
    with TemporaryFile() as file:
        node = _NodeUnderTest(command, file)
        try:
            yield node
        finally:
            _end(node.process, seconds)


def _end(process: 'subprocess.Popen[bytes]', seconds: float) -> None:
    """End a process and what it has started."""
    for number in (signal.SIGINT, signal.SIGKILL):
        with suppress(ProcessLookupError):
            os.killpg(process.pid, number)
        with suppress(subprocess.TimeoutExpired):
            process.wait(seconds if number is signal.SIGKILL else _ENDING_S)
            break


@contextmanager
def watching(bundle: str | os.PathLike[str], *arguments: str, blackbox: Path | None = None,
             seconds: float = 30.0, allow_losses: bool = False) -> Iterator[Watched]:
    """
    Run a monitor for a bundle during a `with` block, which begins when it watches.

    Parameters
    ----------
    bundle
        as the parameter `spec` of the monitor.
    arguments
        further ROS arguments, such as `'-r', 'level:=/tank/level'`.
    blackbox
        a folder for the last messages before a violation.
    seconds
        after which waiting for the monitor fails.
    allow_losses
        whether messages may be lost.

    Raises
    ------
    ValueError
        if the arguments have another bundle.
    AssertionError
        at the end of the block, if a requirement was violated until then, or never evaluated, or
        if messages were not received; or if the monitor does not start, ignores a parameter, or
        does not run.
    """
    if any(text.startswith('spec:=') for text in arguments):  # rcl drops a list after a text
        raise ValueError("the first argument has all bundles, such as '[a.yaml, b.yaml]'")
    box = () if blackbox is None else ('-p', f'blackbox:={blackbox}')
    watched = Watched(bundle, (*box, *arguments), seconds, allow_losses=allow_losses)
    try:
        watched.wait()
        try:
            yield watched
        except BaseException as error:  # noqa: B902  raised again
            watched.add_notes(error)
            raise
        watched.end_block()
    finally:
        watched.end()


class Monitors:
    """Makes monitors for a test, and counts the blocks that it has begun."""

    def __init__(self, blackbox: Path) -> None:
        """Write the last messages before a violation to a folder."""
        self._blackbox = blackbox
        self.calls = self.begun = 0

    def __call__(self, *arguments: str | os.PathLike[str],
                 **options: object) -> AbstractContextManager[Watched]:
        """Return `watching`, with a black box."""
        self.calls += 1
        return self._watching(*arguments, **{'blackbox': self._blackbox, **options})

    @contextmanager
    def _watching(self, *arguments: object, **options: object) -> Iterator[Watched]:
        self.begun += 1
        begin: Callable[..., AbstractContextManager[Watched]] = watching
        with begin(*arguments, **options) as watched:
            yield watched


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Iterator[None]:
    """Keep for the fixture whether the test has passed."""
    outcome = yield
    report = outcome.get_result()  # type: ignore[attr-defined]
    if report.when == 'call':
        item.stash[_HAS_PASSED] = report.passed


@pytest.fixture
def monitored(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Monitors]:
    """Return `watching`, with a black box in the folder of the test; it must be used."""
    monitors = Monitors(tmp_path / 'blackbox')
    yield monitors
    if request.node.stash.get(_HAS_PASSED, False) and not 0 < monitors.calls <= monitors.begun:
        pytest.fail('the test has watched nothing: write `with monitored(...):`', pytrace=False)
