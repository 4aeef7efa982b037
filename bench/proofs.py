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
Measure the time of proofs: of the cells, of bundles, and of 1, 10 and 100 requirements.

    python -m bench.proofs [BUNDLE...]
"""

from pathlib import Path
import sys
import tempfile
import time

from fret_monitor.build import generate_monitor, read
from fret_monitor.native.cache import runtime_headers
from fret_monitor.proving.verification import cells_proved, verify

ROOT = Path(__file__).resolve().parent.parent
_SENTENCE = ('if persisted(10, current_{n} > 15.0 & wind_{n} > 8.0) the vehicle shall within '
             '10 ticks satisfy current_{n} <= 15.0')


def copies(count: int) -> str:
    """Return a bundle with copies of the running example, each with its own inputs."""
    lines = ['format: 1', 'inputs:']
    lines += [f'  {name}_{number}: {{type: float32}}'
              for number in range(count) for name in ('current', 'wind')]
    lines.append('requirements:')
    lines += [f'  - {{id: R-{number}, fretish: "{_SENTENCE.format(n=number)}"}}'
              for number in range(count)]
    return '\n'.join(lines) + '\n'


def main() -> int:
    """Print a table; 1 if something is not proved."""
    headers = runtime_headers()
    runtime = tuple((name, headers[name]) for name in ('fret_cells.h', 'fret_monitor.h'))
    before = time.perf_counter()
    cells = cells_proved(runtime, 60.0)
    print(f'{"cells":24} {len(cells):6} obligations {time.perf_counter() - before:8.2f} s')
    paths = [Path(name) for name in sys.argv[1:]] or sorted((ROOT / 'config').glob('*.yaml'))
    is_proved = True
    for path in paths:
        is_proved &= _row(path, path.name)
    with tempfile.TemporaryDirectory(prefix='fret_monitor-') as folder:
        for count in (1, 10, 100):
            path = Path(folder) / f'copies_{count}.yaml'
            path.write_text(copies(count), encoding='utf-8')
            is_proved &= _row(path, f'{count} requirement{"s" * (count > 1)}')
    return 0 if is_proved else 1


def _row(path: Path, name: str) -> bool:
    generated = generate_monitor(read(path))
    found = verify(generated, seconds=60.0)
    others = sum(len(item.proofs) for item in found.groups)
    print(f'{name:24} {others:6} obligations {found.seconds:8.2f} s'
          f'{"" if found.is_proved else "  NOT PROVED"}', flush=True)
    return found.is_proved


if __name__ == '__main__':
    sys.exit(main())
