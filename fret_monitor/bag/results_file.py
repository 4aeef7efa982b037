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
A file of results: a line of JSON for each recording (docs/recordings.md).

A name that is not UTF-8 is written with escapes of JSON, so that it is read again as it was.
"""

from collections.abc import Sequence
import hashlib
import json
import os
from pathlib import Path

from fret_monitor.model.diagnostics import CompileError, refuse
from fret_monitor.model.manifest import Manifest
from fret_monitor.model.output import refuse_overwriting

_MEANING_DIGITS = 16


def meanings_of(manifest: Manifest) -> dict[str, str]:
    """
    Return a hash of what each requirement says, by id: of its text, formula and policy.

    Results carry it, so that those of an earlier text of a requirement are known as such.
    """
    step = f'{manifest.policy.value} {manifest.period}'
    return {item.id: hashlib.sha256('\0'.join([step, item.text, item.formula]).encode(
        'utf-8', 'surrogatepass')).hexdigest()[:_MEANING_DIGITS] for item in manifest.numbered}


def failed_line(path: object, errors: Sequence[str]) -> str:
    """Return the line of a recording that could not be checked at all."""
    return json.dumps({'bag': str(path), 'recorded': 0, 'read': 0, 'requirements': {},
                       'errors': list(errors)}, ensure_ascii=False)


def problem_texts(problem: Exception) -> list[str]:
    """Return what is wrong as texts of one line each, for the `errors` of a line of JSON."""
    if isinstance(problem, CompileError):
        return [item.in_one_line for item in problem.diagnostics]
    return [str(problem)]


def recording_key(path: Path | str) -> str:
    """Return the name under which the results of a recording are found."""
    return str(Path(path).absolute())


def finished_lines(results: Path) -> dict[str, str]:
    """Return the lines of a file of results that an earlier run wrote, by recording."""
    found: dict[str, str] = {}
    try:
        content = results.read_bytes()
    except FileNotFoundError:
        return {}
    for data in content.split(b'\n'):
        try:
            line = data.decode()
            found[recording_key(json.loads(line)['bag'])] = line
        except (ValueError, KeyError, TypeError):
            continue  # the run was stopped while it wrote this line
    return found


class ResultsFile:
    """
    A file of results to which lines are appended.

    `error` is empty until a line cannot be written; later lines are then left out.
    """

    def __init__(self, path: Path) -> None:
        """
        Use a file, which need not exist.

        Raises
        ------
        CompileError
            if it is a link, or no regular file: no earlier results could be read from it.
        OSError
            if it cannot be written.
        """
        refuse_overwriting(path)
        if path.exists() and not path.is_file():
            refuse(f"cannot keep results in '{path}': it is not a regular file",
                   help='name a file that a later run can read, such as results.jsonl')
        self.error = ''
        self._path = path
        self._is_line_open = False
        with path.open('a+b') as file:
            if file.tell():
                file.seek(-1, os.SEEK_END)
                self._is_line_open = file.read(1) != b'\n'

    def add(self, line: str) -> None:
        """Append a line, and end the last one, which a run that was stopped may have left."""
        if self.error:
            return
        data = (line + '\n').encode('utf-8', 'backslashreplace')
        try:
            with self._path.open('ab') as file:
                file.write(b'\n' + data if self._is_line_open else data)
            self._is_line_open = False
        except OSError as error:
            self.error = f"cannot write '{self._path}': {error.strerror or error}"
