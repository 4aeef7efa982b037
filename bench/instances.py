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
Messages a second with 25, 10,000 and 500,000 instances of a key, beside the plain bundle.

`instances.c` drives the evaluator's C: a message with a key is found, stored and stepped on.

    python -m bench.instances
"""

from pathlib import Path
import subprocess
import tempfile

from fret_monitor.native.cache import csrc_file, csrc_includes
from fret_monitor.native.compiler import COMPILE_FLAGS, find_compiler, LIBRARIES

SOURCE = Path(__file__).resolve().with_name('instances.c')
_TESTS = SOURCE.parent.parent / 'test' / 'csrc'  # whose random numbers it draws
_PARTS = ('instance', 'tables', 'due', 'measures', 'steps', 'deadlines', 'evaluator', 'keys',
          'heap', 'pairs', 'aggregates', 'pool', 'scopes_steps', 'scopes_due', 'scopes_making',
          'scopes', 'scheduling')
_FLAGS = [flag for flag in COMPILE_FLAGS if flag not in ('-fPIC', '-fvisibility=hidden')]
_ROW = '| {} | {} | {} | {} | {} | {} |'


def compiled(folder: Path) -> Path:
    """Compile the program in a folder; return it."""
    program = folder / 'instances'
    subprocess.run(
        [*find_compiler().command, *_FLAGS, '-Werror', *csrc_includes(), f'-I{_TESTS}', SOURCE,
         *(csrc_file(f'{name}.c') for name in _PARTS), *LIBRARIES, '-o', program], check=True)
    return program


def main() -> None:
    """Compile the program, run it and print its rows as a table."""
    with tempfile.TemporaryDirectory() as folder:
        found = subprocess.run([compiled(Path(folder))], check=True, capture_output=True,
                               text=True).stdout
    print(_ROW.format('policy', 'instances', 'with keys', 'plain', 'bytes', 'outside the block'))
    print(_ROW.format('---', *['---:'] * 5))
    for line in found.splitlines():
        print(_ROW.format(*line.split('\t')))


if __name__ == '__main__':
    main()
