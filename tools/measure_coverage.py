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
Tell what the tests run of the package and of the hand-written C: `make coverage`.

Arguments are pytest's. Python is measured by coverage.py, also in the processes that tests start.
C is measured by gcc and gcov: a `gcc` that stands first on PATH adds `--coverage` to what is
compiled, and keeps the notes that gcov needs, since tests compile in folders that do not last.
"""

from collections import defaultdict
from collections.abc import Iterator
import json
import os
from pathlib import Path
import shutil
import subprocess
import sys
import tempfile

ROOT = Path(__file__).resolve().parent.parent
CSRC = ROOT / 'csrc'
WRAPPER = """\
#!/bin/sh
# An object that a test compiles by itself is looked at as it is: its symbols, its warnings.
output=. previous= alone= coverage='--coverage -fprofile-update=atomic'
for word; do
  if test "$previous" = -o; then output=$(dirname -- "$word"); fi
  case "$previous $word" in '-c /'*|*' -fsyntax-only'|*' --version'|*' -dumpmachine') alone=1; esac
  previous=$word
done
if test -n "$alone"; then coverage=; fi
{gcc} "$@" $coverage
status=$?
place={notes}$(cd "$output" 2>/dev/null && pwd)
for note in "$output"/*.gcno; do
  if test -f "$note"; then mkdir -p "$place" && cp "$note" "$place"; fi
done
exit $status
"""
SETTINGS = """\
[run]
source = fret_monitor
data_file = {data}
parallel = True
patch = subprocess
[report]
skip_covered = True
show_missing = True
exclude_also =
    case _:\\n *assert_never
    if TYPE_CHECKING:
"""

Lines = dict[str, dict[int, int]]


def main(arguments: list[str]) -> int:
    """Run the tests, measuring, and print what was run; the status is that of the tests."""
    with tempfile.TemporaryDirectory(prefix='fret_monitor-coverage-') as name:
        folder = Path(name)
        status = _run_tests(folder, arguments)
        print('\nThe package, files that are not run whole:')
        _coverage(folder, 'combine', '--quiet', str(folder))
        _coverage(folder, 'report')
        print('\ncsrc, lines:')
        print('\n'.join(_told(_counted(folder / 'notes'))))
    return status


def _run_tests(folder: Path, arguments: list[str]) -> int:
    gcc = shutil.which('gcc')
    (folder / 'bin').mkdir()
    for name in ('gcc', 'cc') if gcc else ():
        file = folder / 'bin' / name
        file.write_text(WRAPPER.format(gcc=gcc, notes=folder / 'notes'))
        file.chmod(0o755)
    (folder / 'settings').write_text(SETTINGS.format(data=folder / 'data'))
    environment = {**os.environ, 'PATH': f'{folder / "bin"}{os.pathsep}{os.environ["PATH"]}',
                   'GCOV_PREFIX': str(folder / 'notes'),
                   'COVERAGE_CORE': 'sysmon'}  # which costs a tenth of what tracing does
    return subprocess.run(
        [sys.executable, '-m', 'coverage', 'run', f'--rcfile={folder / "settings"}', '-m',
         'pytest', '--quiet', *arguments], cwd=ROOT, env=environment, check=False).returncode


def _coverage(folder: Path, *command: str) -> None:
    subprocess.run([sys.executable, '-m', 'coverage', command[0],
                    f'--rcfile={folder / "settings"}', *command[1:]], cwd=ROOT, check=False)


def _counted(notes: Path) -> Lines:
    """Return how often each line of csrc was run, by file."""
    found: Lines = defaultdict(dict)
    for data in notes.rglob('*.gcda'):
        for name, number, count in _lines(data):
            found[name][number] = found[name].get(number, 0) + count
    return found


def _lines(data: Path) -> Iterator[tuple[str, int, int]]:
    done = subprocess.run(['gcov', '--json-format', '--stdout', data.name], cwd=data.parent,
                          capture_output=True, text=True, check=False)
    for line in done.stdout.splitlines():
        for file in json.loads(line)['files'] if line.startswith('{') else ():
            name = Path(file['file']).name
            if any(CSRC.rglob(name)):
                yield from ((name, item['line_number'], item['count']) for item in file['lines'])


def _told(counts: Lines) -> Iterator[str]:
    for name, lines in sorted(counts.items()):
        missed = sorted(number for number, count in lines.items() if not count)
        share = 100 * (1 - len(missed) / len(lines))
        yield f'{name:20} {len(lines):5} {share:5.1f} %  {", ".join(map(str, missed))}'.rstrip()


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
