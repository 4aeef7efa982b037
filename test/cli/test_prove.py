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

"""`fret-monitor prove`: a certificate, or a trace that shows what is wrong."""

import csv
import json
from pathlib import Path
import subprocess
import sys

from cli.command import Done, environment, Here, run
from fret_monitor.build import generate_monitor, GeneratedMonitor, Reading
from fret_monitor.native.cache import runtime_headers
from proving.workbench import exchanged
import pytest

pytest.importorskip('z3')
pytest.importorskip('pycparser')

BUNDLE = """\
format: 1
inputs:
  p: {type: bool}
  x: {type: float32}
  state: {type: string, values: {stopped: halt, moving: go}}
requirements:
  - {id: R-1, ptltl: "H (x > 15.0 -> O[0,3] p)"}
  - {id: R-2, ptltl: "Y (state = moving) -> p"}
"""


def compiled(here: Here) -> Path:
    """Compile the bundle, and return the folder of its sources."""
    path = here.file('pump.yaml', BUNDLE)
    assert here.run('compile', path, '--output', here.folder / 'out').status == 0
    return here.folder / 'out' / 'src'


def prove(here: Here, *arguments: object) -> Done:
    return here.run('prove', here.file('pump.yaml', BUNDLE), *arguments)


def test_a_bundle_is_proved_with_a_complete_certificate(here: Here) -> None:
    done = prove(here)
    assert (done.status, done.err) == (0, '')
    assert done.out.startswith('pump.yaml: proved, 2 requirements\n')
    for text in ('bundle        sha256 ', 'cells ', 'solver        z3 ', 'Assumed, or not covered',
                 'the C compiler', 'how messages are decoded', 'requirement to the equations'):
        assert text in done.out


TIMED = """\
format: 1
evaluation: {policy: timed}
inputs: {p: {type: bool}, d: {type: float64}}
requirements:
  - {id: R-1, ptltl: "H (p -> O[0, 2.5 s] d > 1.0)"}
  - {id: R-2, ptltl: "O[9 s, 10 s] p"}
  - {id: R-3, ptltl: "preReal(0.5, d) < d"}
"""


def test_the_certificate_of_a_timed_bundle_speaks_of_ticks(here: Here) -> None:
    done = here.run('prove', here.file('timed.yaml', TIMED))
    assert (done.status, done.err) == (0, '')
    assert done.out.startswith('timed.yaml: proved, 3 requirements\n')
    for text in ('No verdict changes before the tick that a step returns',
                 'the caller steps a group first at tick 0', 'fm_same_f32',
                 'fm_since_between_at with more than 2 intervals'):
        assert text in done.out


def test_a_counterexample_does_not_overwrite_an_input_file(here: Here) -> None:
    sources = compiled(here)
    code = sources / 'pump_monitor.c'
    for arguments, out in (((), here.folder / 'pump.yaml'), (('--sources', sources), code)):
        before = out.read_text(encoding='utf-8')
        done = prove(here, *arguments, '--trace', out)
        assert (done.status, done.out) == (1, '')
        assert done.err.startswith(f"error: cannot write '{out}': this command reads it")
        assert out.read_text(encoding='utf-8') == before


def test_the_certificate_is_json_too_and_the_same_for_the_same_bundle(here: Here) -> None:
    first, second = (json.loads(prove(here, '--json').out) for _ in range(2))
    assert first['proved'] is True
    assert [item['id'] for item in first['requirements']] == ['R-1', 'R-2']
    assert all(item['proved'] for item in first['requirements'])
    assert first['obligations']['total'] == first['obligations']['proved'] > 60
    assert len(first['cells']) > 60
    assert first['not_proved'] == []
    assert first['counterexample'] is None
    assert first['assumed']
    assert not any('what they compute is not proved' in item for item in first['assumed'])
    manifest = here.run('compile', here.folder / 'pump.yaml', '--output', here.folder / 'out')
    assert manifest.status == 0
    written = json.loads((here.folder / 'out' / 'manifest.json').read_text(encoding='utf-8'))
    assert first['bundle_hash'] == written['bundle_hash']
    assert first['source_hash'] == written['source_hash']
    assert {key: first[key] for key in ('bundle_hash', 'source_hash', 'code_hash')} == \
        {key: second[key] for key in ('bundle_hash', 'source_hash', 'code_hash')}


def test_a_compiled_folder_is_proved_in_place(here: Here) -> None:
    sources = compiled(here)
    assert json.loads(prove(here, '--sources', sources, '--json').out)['proved'] is True
    for file in sources.iterdir():
        file.write_bytes(file.read_bytes().replace(b'\n', b'\r\n'))
    assert prove(here, '--sources', sources).status == 0


@pytest.mark.parametrize('name', ['string.h', 'sys/types.h', 'pump_monitor.h.gch',
                                  'pump_monitor.h.gch/a', 'fret_cells.h.pch', 'other.c', '.notes'])
def test_a_folder_with_another_file_is_refused(here: Here, name: str) -> None:
    # gcc takes pump_monitor.h.gch, a file or a folder, in place of pump_monitor.h.
    planted = compiled(here) / name
    planted.parent.mkdir(exist_ok=True)
    planted.write_text('#define pump_req_R_1 1\n', encoding='utf-8')
    done = prove(here, '--sources', here.folder / 'out' / 'src')
    assert (done.status, done.out) == (1, '')
    assert f"{name.partition('/')[0]}' is not a file that `compile` writes" in done.err


@pytest.mark.parametrize(('name', 'old', 'new'), [
    ('pump_monitor.c', '3u, in->p', '2u, in->p'),
    ('pump_monitor.c', '#include "fret_cells.h"', '#include  "fret_cells.h"'),
    ('pump_monitor.h', 'float x;', 'volatile float x;'),
    ('pump_monitor.c', '#include <string.h>', '\n#include <string.h>'),
    ('pump_monitor.c', ' // ', ' // \r'),
    ('fret_cells.h', 'return age <= bound', 'return age < bound'),
    ('fret_monitor.h', 'FM_FLOAT32 = 9', 'FM_FLOAT32 = 10'),
])
def test_a_folder_with_changed_c_is_refused_with_the_line(
    here: Here, name: str, old: str, new: str,
) -> None:
    file = compiled(here) / name
    text = file.read_text(encoding='utf-8')
    place = text.index(old)
    file.write_bytes(text.replace(old, new, 1).encode())
    done = prove(here, '--sources', file.parent)
    assert (done.status, done.out) == (1, '')
    line = text.count('\n', 0, place) + 1
    assert f"{name}', line {line}, is not what `compile` writes" in done.err


def test_a_folder_that_lacks_a_file_is_refused(here: Here) -> None:
    sources = compiled(here)
    (sources / 'fret_cells.h').unlink()
    assert "fret_cells.h'" in prove(here, '--sources', sources).err
    assert 'cannot read' in prove(here, '--sources', here.folder / 'nowhere').err


@pytest.mark.parametrize(('old', 'new', 'wrong'), [
    ('3u, in->p', '2u, in->p', 'R-1'),
    ('> 15.0f', '>= 15.0f', 'R-1'),
    ('state == 1', 'state == 0', 'R-2'),
])
def test_wrong_c_is_refuted_by_a_trace_for_simulate(
    here: Here, old: str, new: str, wrong: str, monkeypatch: pytest.MonkeyPatch,
) -> None:
    def with_an_error(reading: Reading) -> GeneratedMonitor:
        generated = generate_monitor(reading)
        text = dict(generated.module.sources)['pump_monitor.c']
        if old in text:
            return exchanged(generated, 'pump_monitor.c', old, new)
        as_there = [item.replace('state == ', 'state_i64 == ').replace('in->p', 'p')
                    for item in (old, new)]
        return exchanged(generated, 'pump_monitor.c', *as_there)

    monkeypatch.setattr('fret_monitor.cli.prove.generate_monitor', with_an_error)
    trace = here.folder / 'trace.csv'
    done = prove(here, '--trace', trace)
    assert done.status == 1
    assert 'NOT PROVED' in done.out
    said = next(line for line in done.out.splitlines() if line.startswith(f'  {wrong} is '))
    meant = 'satisfied' if f'{wrong} is satisfied' in said else 'violated'
    simulated = here.run('simulate', here.folder / 'pump.yaml', '--trace', trace)
    assert simulated.status == 0, simulated.err
    last = list(csv.DictReader(simulated.out.splitlines()))[-1]
    assert last[wrong] == {'satisfied': '1', 'violated': '0'}[meant]
    again = here.folder / 'again.csv'  # the solver may find another one
    content = json.loads(prove(here, '--json', '--trace', again).out)
    assert content['counterexample']['trace'] == again.read_text(encoding='utf-8')
    assert not next(item['proved'] for item in content['requirements'] if item['id'] == wrong)


def test_cells_that_are_wrong_are_reported(
    here: Here, monkeypatch: pytest.MonkeyPatch,
) -> None:
    headers = runtime_headers()
    headers['fret_cells.h'] = headers['fret_cells.h'].replace(
        'return age <= bound', 'return age < bound')
    monkeypatch.setattr('fret_monitor.proving.verification.runtime_headers', lambda: headers)
    done = prove(here)
    assert done.status == 1
    assert 'refuted: fm_once_within_u8' in done.out


def test_a_proof_that_takes_too_long_is_reported_as_not_proved(here: Here) -> None:
    done = prove(here, '--timeout', '0.001')
    assert done.status == 1
    assert 'NOT PROVED' in done.out
    assert 'the obligation ran out of time: allow more with --timeout' in done.out


def test_c_that_cannot_be_parsed_is_not_proved(
    here: Here, monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(
        'fret_monitor.cli.prove.generate_monitor', lambda reading: exchanged(
            generate_monitor(reading), 'pump_monitor.c', '#include "fret_cells.h"', '#error "no"'))
    done = prove(here)
    assert done.status == 1
    assert 'not read      the preprocessor failed' in done.out


@pytest.mark.parametrize('seconds', ['0', '-1', 'ten', 'nan'])
def test_a_malformed_time_limit_is_wrong_usage(here: Here, seconds: str) -> None:
    assert prove(here, '--timeout', seconds).status == 2


def test_without_the_solver_it_says_what_to_install(tmp_path: Path) -> None:
    (tmp_path / 'pump.yaml').write_text(BUNDLE, encoding='utf-8')
    # A Python interpreter in which z3 cannot be imported: a finder before all others refuses it.
    (tmp_path / 'sitecustomize.py').write_text(
        'import importlib.util as util\nfind = util.find_spec\n'
        "util.find_spec = lambda name, *more: None if name == 'z3' else find(name, *more)\n",
        encoding='utf-8')
    known = environment()['PYTHONPATH']
    done = run('prove', tmp_path / 'pump.yaml',
               env=environment(PYTHONPATH=f'{tmp_path}:{known}'))
    assert done.status == 1
    assert '`prove` needs z3-solver, which is not installed' in done.err
    assert f'help: {sys.executable} -m pip install z3-solver\n' in done.err


def test_other_verbs_do_not_load_the_solver(tmp_path: Path) -> None:
    script = ('import sys; from fret_monitor.cli.main import main; main(["formalize", "p shall '
              'satisfy q"]); sys.exit("z3" in sys.modules or "pycparser" in sys.modules)')
    done = subprocess.run([sys.executable, '-c', script], env=environment(), check=False,
                          capture_output=True)
    assert done.returncode == 0
