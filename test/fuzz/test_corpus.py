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

"""The inputs of the corpus end as documented, and fuzzing detects one that does not."""

from collections.abc import Callable
from pathlib import Path
from random import Random
import shutil
import subprocess
import sys
import time

from cli.command import environment
from differential.compiled import CSRC
from fret_monitor.model.diagnostics import CompileError
from fuzz import messages, targets
from fuzz.run import inputs_of, mutated, Recorder
from fuzz.targets import attempt, check_c, CORPUS, kept, Leaked, Target, TARGETS, TookTooLong
import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize('name', TARGETS)
def test_inputs_of_the_corpus_end_as_documented(name: str) -> None:
    outcomes = {label: attempt(TARGETS[name], data) for label, data in kept(name).items()}
    assert outcomes['accepted']
    assert not all(outcomes.values()), 'some are accepted and some are refused'


def test_the_corpus_stays_small() -> None:
    assert sum(path.stat().st_size for path in CORPUS.rglob('*')) < 200_000


@pytest.mark.parametrize('name', TARGETS)
def test_randomly_changed_inputs_end_as_documented(name: str) -> None:
    rng, pool = Random(1), inputs_of(name)
    words = [word.encode() for word in TARGETS[name].words]
    for _ in range(30):
        attempt(TARGETS[name], mutated(rng, rng.choice(pool), pool, words))


# -- the fuzzer ----------------------------------------------------------------------------


def failing(error: Callable[[], Exception]) -> Callable[[bytes], None]:
    def run(data: bytes) -> None:
        if b'bug' in data:
            raise error()
    return run


def test_an_error_that_is_not_documented_is_found_once_and_its_input_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    target = Target(failing(lambda: KeyError('x')), (CompileError,), lambda: [b''])
    monkeypatch.setitem(TARGETS, 'toy', target)
    record = Recorder('toy')
    assert record(b'well') == ''
    assert record(b'a bug') == record(b'another bug') != ''
    found = list((tmp_path / 'fuzz-crashes').iterdir())
    assert [path.read_bytes() for path in found] == [b'a bug']


def test_an_input_that_takes_too_long_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(targets, 'TIMEOUT_S', 1)
    target = Target(lambda data: time.sleep(30), (CompileError,), lambda: [b''])
    with pytest.raises(TookTooLong):
        attempt(target, b'')


@pytest.mark.parametrize('text', [
    'int a; // b \\\n', '// ??/\n', '// a\rint b;\n', '// \u202e\n', "char c = 'x';\n",
    'char * s = "\x01";\n', 'char * s = "\\n";\n', 'int \u0430;\n', '/* // \n $'])
def test_text_that_leaks_into_c_is_found(text: str) -> None:
    with pytest.raises(Leaked):
        check_c(text)


def test_changed_messages_cause_no_sanitizer_error(tmp_path: Path) -> None:
    done = messages.fuzz(tmp_path, 1.5, 1, level='-O0')
    assert done.returncode == 0, done.stderr
    assert int(done.stdout.split()[1]) > 1000


def test_an_extractor_that_reads_past_a_message_is_found(tmp_path: Path) -> None:
    """Compile with a header whose check allows one byte too many."""
    shutil.copytree(CSRC, tmp_path / 'csrc')
    header = tmp_path / 'csrc' / 'fret_cdr.h'
    right = 'size > left - padding'
    assert right in header.read_text()
    header.write_text(header.read_text().replace(right, f'{right} + 1u'))
    program = messages.build(tmp_path, messages.topics(tmp_path)[:3], tmp_path / 'csrc', '-O0')
    if b'__asan' not in program.read_bytes():
        pytest.skip('needs a compiler with the address sanitizer')
    done = subprocess.run([program, tmp_path / 'seeds', '20', '1'], capture_output=True,
                          text=True, check=False)
    assert done.returncode != 0 and 'heap-buffer-overflow' in done.stderr


def test_it_ends_in_time_and_prints_how_many_inputs_it_tried(tmp_path: Path) -> None:
    paths = environment()['PYTHONPATH'] + f':{ROOT / "test"}'
    begin = time.monotonic()
    done = subprocess.run(
        [sys.executable, '-m', 'fuzz.run', '--seconds', '2', 'manifest', 'message'], cwd=tmp_path,
        env=environment(PYTHONPATH=paths), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert time.monotonic() - begin < 60
    first, manifests, definitions = done.stdout.splitlines()
    assert first.startswith('2 targets, 1.0 s each')
    assert manifests.startswith('manifest: ') and definitions.startswith('message: ')
    assert all(int(line.split()[1].replace(',', '')) > 50 for line in (manifests, definitions))
