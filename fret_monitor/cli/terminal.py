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
What is written for the eyes of a person: diagnostics, colours, and the progress of long work.

Colours and progress are for a terminal; a pipe or a file gets plain text. The variables `NO_COLOR`
and `TERM=dumb` turn colours off, `TERM=dumb` also the progress.
"""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
import os
import sys
from threading import Event, Thread
from time import monotonic
from typing import TextIO

from fret_monitor.model.diagnostics import Diagnostic, printable
from fret_monitor.model.progress import no_progress, Progress

_STYLES = {
    'error': '1;31', 'warning': '1;33', 'title': '1', 'help': '1;36',
    'violated': '31', 'satisfied': '32',
}
_ERASED = '\r\x1b[K'
_REDRAW_S = 0.5
_USUAL_WIDTH = 80


def painted(text: str, style: str, stream: TextIO) -> str:
    """Return a text in the colour of a style if the stream is a terminal that has colours."""
    if not _is_terminal(stream) or os.environ.get('NO_COLOR'):
        return text
    return f'\x1b[{_STYLES[style]}m{text}\x1b[0m'


def print_diagnostics(diagnostics: Iterable[Diagnostic]) -> None:
    """Print errors and warnings to standard error."""
    for item in diagnostics:
        print(item.render(lambda text, style: painted(text, style, sys.stderr)), file=sys.stderr)


@contextmanager
def progress(verb: str, *, is_printing: bool = False) -> Iterator[Progress]:
    """
    Yield a function that reports progress, which is shown on standard error and erased at the end.

    Nothing is shown in a pipe, or if the verb `is_printing` to the same terminal meanwhile.
    """
    if not _is_terminal(sys.stderr) or (is_printing and sys.stdout.isatty()):
        yield no_progress
        return
    line = _ProgressLine(verb, sys.stderr)
    try:
        yield line.report
    finally:
        line.close()


def _is_terminal(stream: TextIO) -> bool:
    return stream.isatty() and os.environ.get('TERM', 'dumb') != 'dumb'


class _ProgressLine:
    """
    Draws a line twice a second, in a thread of its own.

    A verb that takes less than half a second draws nothing.
    """

    def __init__(self, verb: str, stream: TextIO) -> None:
        self._verb = verb
        self._stream = stream
        self._start = monotonic()
        self._measured_from = self._start  # when the part that is done became known
        self._part: float | None = None
        self._item = ''
        self._is_drawn = False
        self._closed = Event()
        self._thread = Thread(target=self._run, name='progress', daemon=True)
        self._thread.start()

    def report(self, part: float | None, item: str) -> None:
        """Note how far the work has come."""
        if self._part is None and part is not None:
            self._measured_from = monotonic()
        self._part, self._item = part, item

    def close(self) -> None:
        """Stop drawing, and erase the line."""
        self._closed.set()
        self._thread.join()
        if self._is_drawn:
            with suppress(OSError):
                print(end=_ERASED, file=self._stream, flush=True)

    def _run(self) -> None:
        with suppress(OSError):  # the terminal is gone
            while not self._closed.wait(_REDRAW_S):
                print(end=_ERASED + self._text(monotonic())[:self._width() - 1],
                      file=self._stream, flush=True)
                self._is_drawn = True

    def _width(self) -> int:
        try:
            return os.get_terminal_size(self._stream.fileno()).columns or _USUAL_WIDTH
        except OSError:
            return _USUAL_WIDTH

    def _text(self, now: float) -> str:
        part = self._part
        text = ' '.join(filter(None, [f'{self._verb}:', printable(self._item)]))
        if not part:
            return f'{text}, {_clock(now - self._start)}'
        left = (now - self._measured_from) * (1 - part) / part
        return f'{text}, {part:.0%}, {_clock(left)} to go'


def _clock(seconds: float) -> str:
    """Return a duration as `0:07` or `1:02:03`."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f'{hours}:{minutes:02}:{rest:02}' if hours else f'{minutes}:{rest:02}'
