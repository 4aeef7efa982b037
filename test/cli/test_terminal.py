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

"""On a terminal there are colours and progress; in a pipe, a file or a dumb terminal none."""

from contextlib import suppress
import os
from pathlib import Path
import pty
import re
import subprocess
import sys
from tempfile import TemporaryFile
import time

from cli.command import command, environment, HEADING, Here, PUMP
from fret_monitor.cli import terminal
from fret_monitor.model.diagnostics import Diagnostic, Level, Source, Span
import pytest

ESCAPE = re.compile(r'\x1b\[[0-9;]*[A-Za-z]')
# A step that takes long enough for progress to be drawn.
SLOW = """if True:
    import sys, time
    from fret_monitor.cli import main, terminal
    from fret_monitor.runtime.evaluator import Evaluator
    terminal._REDRAW_S = 0.05
    rows = Evaluator.rows
    Evaluator.rows = lambda *arguments: (time.sleep(0.3), rows(*arguments))[1]
    sys.exit(main.main())"""


def on_terminal(words: list[str], *, out_too: bool, **changes: str) -> tuple[int, str, str]:
    """Return status, standard output, and what a terminal at standard error received."""
    ours, theirs = pty.openpty()
    env = {name: value for name, value in environment().items() if name != 'NO_COLOR'}
    shown = b''
    with TemporaryFile() as file, subprocess.Popen(
            words, stdin=subprocess.DEVNULL, stdout=theirs if out_too else file,
            stderr=theirs, env={**env, 'TERM': 'xterm', **changes}) as process:
        os.close(theirs)
        with suppress(OSError):  # raised when the other side of the terminal is closed
            while part := os.read(ours, 65536):
                shown += part
        os.close(ours)
        status = process.wait()
        file.seek(0)
        return status, file.read().decode(), shown.decode().replace('\r\n', '\n')


def test_errors_are_coloured_on_a_terminal_only(here: Here) -> None:
    bundle = here.file('pump.yaml', PUMP.replace('n < 5', 'N < 5'))
    words = command('check', bundle)
    plain = here.run('check', bundle)
    status, _, coloured = on_terminal(words, out_too=True)
    assert (status, ESCAPE.sub('', coloured)) == (1, plain.err)
    assert '\x1b[1;31merror:\x1b[0m' in coloured
    for changes in ({'NO_COLOR': '1'}, {'TERM': 'dumb'}):
        assert on_terminal(words, out_too=True, **changes) == (1, '', plain.err)
    assert on_terminal(words, out_too=True, NO_COLOR='')[2] == coloured


def test_progress_is_shown_on_standard_error_and_erased(here: Here) -> None:
    bundle = here.file('pump.yaml', PUMP)
    trace = here.file('trace.csv', HEADING + '1,0,9,0,moving\n' * 9_000)
    words = [sys.executable, '-c', SLOW, 'simulate', str(bundle), '--trace', str(trace)]
    silent = subprocess.run(words, env=environment(), capture_output=True, text=True, check=False)
    assert (silent.returncode, silent.stderr) == (0, '')
    status, out, shown = on_terminal(words, out_too=False)
    assert (status, out) == (0, silent.stdout)
    assert re.search(r'\r\x1b\[Ksimulate: [\d,]+ steps, \d+%, \d:\d\d to go', shown)
    assert shown.endswith('\r\x1b[K')
    assert '\n' not in shown
    verdicts = ['--verdicts', str(here.folder / 'verdicts.csv')]
    shown = on_terminal([*words, *verdicts], out_too=True)[2]
    assert '% ' not in shown and '%, ' in shown
    assert shown.endswith('\r\x1b[K9,000 steps\nR-1: \x1b[32msatisfied\x1b[0m\n'
                          'R,2: \x1b[32msatisfied\x1b[0m\nR"3: \x1b[31mviolated\x1b[0m '
                          'at 9,000 steps\n')


def test_progress_is_not_shown_where_it_would_be_in_the_way(
        monkeypatch: pytest.MonkeyPatch) -> None:
    stream = Terminal()
    monkeypatch.setattr('sys.stderr', stream)
    monkeypatch.setattr('sys.stdout', stream)
    monkeypatch.setattr(terminal, '_REDRAW_S', 0.001)
    for name, is_printing in (('dumb', False), ('xterm', True)):
        monkeypatch.setenv('TERM', name)
        with terminal.progress('simulate', is_printing=is_printing) as report:
            report(0.5, 'step')
            time.sleep(0.02)
    assert stream.text == ''


class Terminal:
    """A stream that says that it is a terminal."""

    def __init__(self) -> None:
        self.text = ''

    def isatty(self) -> bool:
        return True

    def fileno(self) -> int:
        raise OSError('no file')

    def write(self, text: str) -> None:
        self.text += text

    def flush(self) -> None:
        pass


def test_a_line_is_cut_and_holds_no_control_characters(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = Terminal()
    monkeypatch.setattr('sys.stderr', stream)
    monkeypatch.setattr(terminal, '_REDRAW_S', 0.001)
    monkeypatch.setenv('TERM', 'xterm')
    with terminal.progress('explain') as report:
        for part, item in ((None, 'cells'), (0.0, 'A\x1b[2J'), (0.5, 'R-' + 'x' * 100)):
            report(part, item)
            seen = len(stream.text)
            while stream.text[seen:].count('\r') < 3:
                time.sleep(0.001)
    lines = stream.text.split('\r\x1b[K')
    assert lines[0] == lines[-1] == ''
    assert 'explain: cells, 0:00' in lines
    assert 'explain: A\ufffd[2J, 0:00' in lines
    assert max(map(len, lines)) == 79


@pytest.mark.parametrize(('seconds', 'text'), [
    (0.4, '0:00'), (59.6, '1:00'), (61, '1:01'), (3723, '1:02:03')])
def test_a_duration_is_shown_as_on_a_clock(seconds: float, text: str) -> None:
    assert terminal._clock(seconds) == text


def test_colours_change_nothing_but_the_colour() -> None:
    source = Source('b.yaml', 'one\ntwo three\n')
    for item in (Diagnostic('no place', help='write\nthis'),
                 Diagnostic('a title', Span(source, 8, 13), 'a label', 'help', Level.WARNING),
                 Diagnostic('a title', Span(source, 4, 7))):
        marked = item.render(lambda text, style: f'<{style}|{text}>')
        assert re.sub(r'<\w+\|([^>]*)>', r'\1', marked) == item.render()
        assert marked.count('<') == 2 + bool(item.span) + bool(item.help)


def test_progress_ends_with_an_error(here: Here, tmp_path: Path) -> None:
    bundle = here.file('pump.yaml', PUMP)
    trace = here.file('trace.csv', HEADING + '1,0,9,0,moving\n' * 9_000 + 'wrong\n')
    words = [sys.executable, '-c', SLOW, 'simulate', str(bundle), '--trace', str(trace)]
    status, _, shown = on_terminal(words, out_too=False, NO_COLOR='1')
    assert status == 1
    drawn, _, error = shown.rpartition('\r\x1b[K')
    assert 'to go' in drawn
    assert error.startswith(f'{trace}:9002:')
