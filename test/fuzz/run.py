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
Fuzz for a bounded time: `python -m fuzz.run --seconds N [TARGET...]`; `make fuzz` does.

If `atheris` (libFuzzer for Python) is installed, it is guided by coverage; if not, an input that
is accepted, or refused in a new way, is kept and changed further. Each target has its own process.
An input that shows a bug is written to `fuzz-crashes` in the working directory, under a name made
from the failure; the exit status is 1 if there is one.
"""

from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from hashlib import sha256
from importlib import import_module
import importlib.util
import os
from pathlib import Path
from random import Random
import re
import subprocess
import sys
import tempfile
import time
import traceback

CRASHES = Path('fuzz-crashes')
LONGEST = 3000  # bytes of an input
MESSAGES = 'messages'  # the target in C
RECORDINGS = 'recordings'  # compared with the reference evaluators
DAMAGE = 'damage'  # of recordings: the answer is the right one, or an error
GUIDED = importlib.util.find_spec('atheris') is not None


def main() -> int:
    """Fuzz the targets one after the other, or one of them in this process."""
    parser = ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('targets', metavar='TARGET', nargs='*')
    parser.add_argument('--seconds', type=float, default=60.0, help='for all targets together')
    parser.add_argument('--seed', type=int, default=0, help='of the random changes; 0: the time')
    parser.add_argument('--here', action='store_true', help='one target, in this process')
    options = parser.parse_args()
    return _fuzz_here(options) if options.here else _fuzz_all(options)


def _fuzz_all(options: Namespace) -> int:
    from fuzz.targets import TARGETS
    known = [*TARGETS, MESSAGES, RECORDINGS, DAMAGE]
    chosen = options.targets or known
    unknown = [name for name in chosen if name not in known]
    if unknown:
        print(f'no target {unknown[0]}; there are {", ".join(known)}', file=sys.stderr)
        return 2
    share = options.seconds / len(chosen)
    print(f'{len(chosen)} targets, {share:.1f} s each, '
          f'{"guided by coverage" if GUIDED else "without atheris: not guided by coverage"}')
    before = set(CRASHES.glob('*'))
    for name in chosen:
        if name == MESSAGES:
            _fuzz_messages(share, options.seed)
        elif name in (RECORDINGS, DAMAGE):
            _fuzz_recordings(name, share, options.seed)
        else:
            _fuzz_apart(name, share, options.seed)
    found = sorted(set(CRASHES.glob('*')) - before)
    for path in found:
        print(f'{path}: new')
    return 1 if found else 0


def _fuzz_apart(name: str, seconds: float, seed: int) -> None:
    command = [sys.executable, '-m', 'fuzz.run', '--here', '--seconds', f'{seconds:.1f}',
               '--seed', str(seed), name]
    try:
        done = subprocess.run(command, text=True, capture_output=True, errors='replace',
                              timeout=seconds + 300, check=False)
    except subprocess.TimeoutExpired as error:
        # The machine is overloaded, or C code does not end on an input.
        output = error.stderr or b''
        print(f'{name}: the process did not end')
        _write(name, output[-4000:] if isinstance(output, bytes) else output[-4000:].encode(),
               'the process did not end')
        return
    counts = re.findall(r'^(?:Done|tried) (\d+)', done.stdout + done.stderr, re.MULTILINE)
    print(f'{name}: {int(counts[-1]) if counts else 0:,} inputs')
    for line in done.stdout.splitlines():
        if line.startswith('BUG'):
            print(line)
    if done.returncode:
        _write(name, done.stderr[-4000:].encode(), 'the process died')


def _fuzz_messages(seconds: float, seed: int) -> None:
    from fuzz.messages import fuzz
    with tempfile.TemporaryDirectory(prefix='fret_monitor-fuzz-') as name:
        done = fuzz(Path(name), seconds, seed or time.time_ns() % 2 ** 32)
    count = re.search(r'Done (\d+)', done.stdout)
    print(f'{MESSAGES}: {int(count[1]) if count else 0:,} messages')
    if done.returncode:
        report = done.stderr[-6000:]
        print(f'BUG in {MESSAGES}: {report}')
        # The arguments hold the seed; the report is the sanitizer's.
        _write(MESSAGES, f'{done.args}\n{report}'.encode(), f'status {done.returncode}')


def _fuzz_recordings(name: str, seconds: float, seed: int) -> None:
    fuzz = import_module(f'fuzz.{name}').fuzz
    try:
        print(f'{name}: {fuzz(seconds, seed or time.time_ns() % 2 ** 32):,} recordings')
    except AssertionError as error:
        print(f'BUG in {name}: {error}')
        _write(name, str(error).encode(), 'judged in another way')


class Recorder:
    """Gives inputs to a target, and keeps one input for each place of failure."""

    def __init__(self, name: str) -> None:
        """Take the target of that name."""
        from fuzz import targets
        self._targets = targets
        self._target = targets.TARGETS[name]
        self._name = name
        self._known: set[str] = set()

    def __call__(self, data: bytes) -> str:
        """Return the outcome of an input: '' if it was accepted, else how it was refused."""
        try:
            return '' if self._targets.attempt(self._target, data) else 'refused'
        except Exception as error:  # noqa: B902  an undocumented one is a bug
            place = _place(error)
            if place not in self._known:
                self._known.add(place)
                _write(self._name, data, place)
                print(f'BUG in {self._name}: {place}', flush=True)
            return place


def _place(error: Exception) -> str:
    frames = [frame for frame in traceback.extract_tb(error.__traceback__)
              if 'fret_monitor' in frame.filename]
    frame = frames[-1] if frames else traceback.extract_tb(error.__traceback__)[-1]
    return f'{type(error).__name__} at {Path(frame.filename).name}:{frame.lineno}'


def _write(name: str, data: bytes, place: str) -> None:
    CRASHES.mkdir(exist_ok=True)
    digest = sha256(place.encode()).hexdigest()[:8]
    (CRASHES / f'{name}-{digest}').write_bytes(data)


def _fuzz_here(options: Namespace) -> int:
    name, = options.targets
    return _guided(name, options) if GUIDED else _unguided(name, options)


def _guided(name: str, options: Namespace) -> int:
    import atheris
    with atheris.instrument_imports(include=['fret_monitor']):
        from fuzz import targets
    target = targets.TARGETS[name]
    folder = Path(tempfile.mkdtemp(prefix='fret_monitor-fuzz-'))
    for number, seed in enumerate(inputs_of(name)):
        (folder / f'seed-{number}').write_bytes(seed)
    words = folder.with_suffix('.words')
    words.write_text(''.join(f'"{_escaped(word)}"\n' for word in target.words))
    record = Recorder(name)
    atheris.Setup(
        ['fuzz', str(folder), f'-dict={words}', f'-max_total_time={max(1, int(options.seconds))}',
         f'-max_len={LONGEST}', f'-timeout={4 * targets.TIMEOUT_S}', '-rss_limit_mb=3000',
         f'-seed={options.seed}', '-verbosity=1'], lambda data: record(data) and None)
    atheris.Fuzz()
    return 0


def _escaped(word: str) -> str:
    return ''.join(chr(byte) if 32 <= byte < 127 and byte not in b'"\\' else f'\\x{byte:02x}'
                   for byte in word.encode())


def inputs_of(name: str) -> list[bytes]:
    """Return the first inputs of a target: its seeds and its corpus."""
    from fuzz.targets import kept, TARGETS
    return [*kept(name).values(), *TARGETS[name].seeds()]


def _unguided(name: str, options: Namespace) -> int:
    from fuzz import targets
    rng = Random(options.seed or None)
    record = Recorder(name)
    pool = inputs_of(name)
    words = [word.encode() for word in targets.TARGETS[name].words]
    seen: set[str] = set()
    tried, end = 0, time.monotonic() + options.seconds
    while time.monotonic() < end:
        data = mutated(rng, rng.choice(pool), pool, words)
        tried += 1
        outcome = record(data)
        if outcome == '' or outcome not in seen:
            seen.add(outcome)
            pool.append(data)
            if len(pool) > 2000:
                pool.pop(rng.randrange(len(pool)))
    print(f'tried {tried}')
    targets.remove_scratch()
    return 0


def mutated(rng: Random, data: bytes, pool: list[bytes], words: list[bytes]) -> bytes:
    """Return an input with one to four changes."""
    for _ in range(rng.choice((1, 1, 2, 4))):
        data = rng.choice(_CHANGES)(rng, data, pool, words)[:LONGEST]
    return data


Change = Callable[[Random, bytes, list[bytes], list[bytes]], bytes]


def _insert_word(rng: Random, data: bytes, pool: list[bytes], words: list[bytes]) -> bytes:
    place = rng.randrange(len(data) + 1)
    space = rng.choice((b'', b' '))
    return data[:place] + space + rng.choice(words or [b'']) + space + data[place:]


def _replace_word(rng: Random, data: bytes, pool: list[bytes], words: list[bytes]) -> bytes:
    found = list(re.finditer(rb'\w+|[^\w\s]+', data))
    if not found:
        return data
    old = rng.choice(found)
    return data[:old.start()] + rng.choice(words or [b'']) + data[old.end():]


def _drop(rng: Random, data: bytes, pool: list[bytes], words: list[bytes]) -> bytes:
    place, size = rng.randrange(len(data) + 1), rng.choice((1, 1, 3, 10, 60))
    return data[:place] + data[place + size:]


def _repeat(rng: Random, data: bytes, pool: list[bytes], words: list[bytes]) -> bytes:
    place, size = rng.randrange(len(data) + 1), rng.choice((1, 3, 10, 60))
    return data[:place] + data[place:place + size] * rng.choice((2, 2, 3, 100)) \
        + data[place + size:]


def _join(rng: Random, data: bytes, pool: list[bytes], words: list[bytes]) -> bytes:
    other = rng.choice(pool)
    return data[:rng.randrange(len(data) + 1)] + other[rng.randrange(len(other) + 1):]


def _flip(rng: Random, data: bytes, pool: list[bytes], words: list[bytes]) -> bytes:
    if not data:
        return bytes([rng.randrange(256)])
    place = rng.randrange(len(data))
    return data[:place] + bytes([rng.choice((0, 10, 127, 255, rng.randrange(256)))]) \
        + data[place + 1:]


_CHANGES: tuple[Change, ...] = (
    _insert_word, _replace_word, _replace_word, _drop, _repeat, _join, _flip)

if __name__ == '__main__':
    os.environ.setdefault('ROS_HOME', tempfile.mkdtemp(prefix='fret_monitor-fuzz-'))
    sys.exit(main())
