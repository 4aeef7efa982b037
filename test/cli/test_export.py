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

"""`export`: writes a folder, with a proof and sizes; refuses what it cannot write."""

import json
from pathlib import Path
import re

from bundles import ARM_GATE, ARM_INPUT
from cli.command import Here, PUMP
import pytest


def test_it_writes_a_folder_and_prints_proof_and_sizes(here: Here) -> None:
    pytest.importorskip('z3')
    pytest.importorskip('pycparser')
    bundle, out = here.file('pump.yaml', PUMP), here.folder / 'out'
    done = here.run('export', bundle, '--to', 'c99', '--output', out)
    assert (done.status, done.err) == (0, '')
    first, proof, *sizes = done.out.splitlines()
    assert re.fullmatch(rf'{re.escape(str(out))}: c99, \d+ files, 3 requirements, \d+ bytes of '
                        'state', first)
    assert proof == 'proved: the generated C computes its program (certificate.json)'
    code = r'[\d,]+ bytes of code and constants, 0 bytes of variables'
    assert re.fullmatch(rf'monitors alone: {code}; in your program: struct pump_state \d+ bytes?, '
                        r'struct pump_inputs \d+ bytes? \(.* -Os\)', sizes[0])
    assert re.fullmatch(rf'monitors with evaluator: {code}; in your program: PUMP_EVALUATOR_BYTES '
                        r'[\d,]+ bytes \(.* -Os\)', sizes[1])
    certificate = json.loads((out / 'certificate.json').read_text())
    assert certificate['proved'] and 'seconds' not in str(certificate)
    before = {path: path.read_bytes() for path in out.rglob('*') if path.is_file()}
    assert here.run('export', bundle, '--to', 'c99', '--output', out) == done
    assert {path: path.read_bytes() for path in out.rglob('*') if path.is_file()} == before


def test_without_solver_or_compiler_it_exports_and_says_so(
    here: Here, monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr('fret_monitor.model.diagnostics.find_spec', lambda name: None)
    monkeypatch.setenv('PATH', str(here.folder))
    monkeypatch.delenv('CC', raising=False)
    done = here.run('export', here.file('pump.yaml', PUMP), '--to', 'copilot', '--prefix', 'left',
                    '--output', here.folder / 'out')
    assert (done.status, done.err) == (0, '')
    assert done.out.splitlines()[1].startswith('not proved: z3-solver and pycparser missing; ')
    assert done.out.splitlines()[2] == (
        'size unknown for this machine: no C compiler found: install gcc (sudo apt install gcc) '
        'or set CC')
    assert 'void left_step(void);' in (here.folder / 'out' / 'left.h').read_text()
    assert not (here.folder / 'out' / 'certificate.json').exists()


def test_what_is_not_proved_is_not_exported_unasked(
    here: Here, monkeypatch: pytest.MonkeyPatch,
) -> None:
    pytest.importorskip('z3')
    pytest.importorskip('pycparser')
    from fret_monitor.proving import verification
    monkeypatch.setattr(verification, 'verify', lambda generated, progress:
                        verification.Verification((), (), None, 'no', 0.0))
    bundle, out = here.file('pump.yaml', PUMP), here.folder / 'out'
    done = here.run('export', bundle, '--to', 'c99', '--output', out)
    assert (done.status, done.out) == (1, '')
    assert '--no-proof exports without a certificate' in done.err
    assert not out.exists()


@pytest.mark.parametrize(('arguments', 'status', 'expected'), [
    (('--to', 'vxworks', '--output', 'out'), 2, "invalid choice: 'vxworks'"),
    (('--to', 'c99'), 2, 'the following arguments are required: -o/--output'),
    (('--to', 'c99', '--output', 'out', '--name', 'a', '--prefix', 'b'), 2, 'not allowed with'),
    (('--to', 'c99', '--output', 'out', '--prefix', '2nd'), 2, "'2nd' cannot begin names in C"),
    (('--to', 'c99', '--output', ''), 2, 'the name of a folder is missing'),
    (('--to', 'c99', '--output', '.', '--no-proof'), 1, 'holds other files'),
    (('--to', 'c99', '--output', 'out', '--handler-arguments', 'values'), 2, 'calls no handlers'),
    (('--to', 'c99', '--output', 'out', '--gate', 'g'), 2, 'runs no gate, only ros2 does'),
    (('--to', 'c99', '--output', 'out', '--templates', 'none'), 2, "there is no folder 'none'"),
])
def test_wrong_arguments_are_refused(
    here: Here, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...], status: int,
    expected: str,
) -> None:
    monkeypatch.chdir(here.folder)
    done = here.run('export', here.file('pump.yaml', PUMP), *arguments)
    assert (done.status, done.out) == (status, '')
    assert expected in done.err
    assert [path.name for path in Path().iterdir()] == ['pump.yaml']


def test_actions_and_gates_are_not_part_of_an_export_and_it_says_so(here: Here) -> None:
    bundle = here.file('acts.yaml', """\
format: 1
inputs:
  x: {topic: x, type: std_msgs/msg/Float32}
actions:
  stop: {lock: {topic: e_stop}}
gates:
  cmd: {from: cmd_in, to: cmd_out, type: std_msgs/msg/Float32, keep: [R]}
requirements:
  - {id: R, on_violation: stop, ptltl: "x < 1.0"}
""")
    done = here.run('export', bundle, '--to', 'c99', '--output', here.folder / 'out', '--no-proof')
    assert done.status == 0
    assert "acts.yaml:9:10: warning: no action follows 'R' in an export" in done.err
    assert "acts.yaml:7:3: warning: the gate 'cmd' is not part of an export" in done.err


def test_an_exported_node_leaves_the_requirements_of_gates_to_the_node_gate(here: Here) -> None:
    text = """\
format: 1
inputs:
  x: {topic: x, type: std_msgs/msg/Float32}
gates:
  cmd: {from: cmd_in, to: cmd_out, type: std_msgs/msg/Float32, keep: [KEPT, TOO]}
requirements:
  - {id: KEPT, ptltl: "x < 1.0"}
  - {id: TOO, ptltl: "x < 2.0"}
"""
    more = '  - {id: OWN, ptltl: "x < 3.0"}\n'
    bundle, out = here.file('gated.yaml', text + more), here.folder / 'out'
    done = here.run('export', bundle, '--to', 'ros2', '--output', out, '--no-proof')
    assert done.status == 0 and '1 requirement' in done.out
    assert f"warning: not monitored here: the gate 'cmd' judges KEPT, TOO. Run it: ros2 run " \
           f'fret_monitor gate --ros-args -p spec:={bundle}\n' in done.err
    assert 'not part of an export' not in done.err
    table = (out / 'src' / 'node_table.c').read_text(encoding='utf-8')
    assert "not monitored here: the gate 'cmd' judges KEPT, TOO. Run it:" in table
    assert 'handlerpropOWN' in table and 'handlerpropKEPT' not in table
    all_kept = here.file('all.yaml', text)
    done = here.run('export', all_kept, '--to', 'ros2', '--output', here.folder / 'none')
    assert done.status == 1 and "gates keep all requirements of 'all' (cmd)" in done.err


SPEED = """\
format: 1
constants: {most: 1.0}
inputs:
  x: {topic: cmd_in, type: std_msgs/msg/Float32}
gates:
  NAME: {from: cmd_in, to: NAME_out, type: std_msgs/msg/Float32, keep: [KEPT-NAME]}
requirements:
  - {id: KEPT-NAME, ptltl: "x < most"}
  - {id: OWN-NAME, ptltl: "x < 3.0"}
"""


def test_several_bundles_are_exported_as_one_node(here: Here) -> None:
    bundles = [here.file(f'{name}.yaml', SPEED.replace('NAME', name.replace('-', '_')))
               for name in ('a-b', 'c')]
    out = here.folder / 'out'
    done = here.run('export', *bundles, '--to', 'ros2', '--output', out,
                    '--constant', 'most=2.5')
    assert done.status == 0 and '2 requirements' in done.out, done.err
    assert done.err.count('not monitored here') == 2
    package, cmake = ((out / name).read_text(encoding='utf-8')
                      for name in ('package.xml', 'CMakeLists.txt'))
    assert '<name>a_b_c_monitor</name>' in package
    for number, name in enumerate(('a-b', 'c')):
        table = (out / 'src' / f'node_table_{number}.c').read_text(encoding='utf-8')
        assert f'.bundle = "{name}"' in table and '{.name = "most", .value = "2.5"}' in table
        assert f'src/node_table_{number}.c' in cmake
    assert '&fm_node_table_1' in (out / 'src' / 'node_tables.c').read_text(encoding='utf-8')
    readme = (out / 'README.md').read_text(encoding='utf-8')
    assert 'monitors a-b.yaml, c.yaml' in readme and readme.count('OWN') == 6
    assert len(json.loads((out / 'manifest.json').read_text(encoding='utf-8'))['bundles']) == 2
    if 'proved: the generated C computes its program' in done.out:
        proofs = json.loads((out / 'certificate.json').read_text(encoding='utf-8'))
        assert [item['proved'] for item in proofs] == [True, True]


def test_several_gates_are_exported_as_one_node(here: Here) -> None:
    bundles = [here.file(f'{name}.yaml', SPEED.replace('NAME', name)) for name in ('a', 'c')]
    out = here.folder / 'out'
    export = ('export', *bundles, '--to', 'ros2', '--no-proof', '--output', out, '--gate')
    done = here.run(*export, 'c', '--gate', 'a', '--name', 'Both')
    assert done.status == 0 and '2 requirements' in done.out, done.err
    assert '<name>both_gate</name>' in (out / 'package.xml').read_text(encoding='utf-8')
    tables = [(out / 'src' / f'node_table_{number}.c').read_text(encoding='utf-8')
              for number in range(2)]
    assert all(f'"{name}_out"' in table for name, table in zip('ac', tables))
    assert "no bundle has the gate 'd'" in here.run(*export, 'd').err
    assert f"'{bundles[1]}' has none of the gates a: leave it out" in here.run(*export, 'a').err


def test_what_cannot_be_one_node_is_refused(here: Here) -> None:
    bundles = [here.file(f'{name}.yaml', SPEED.replace('NAME', 'n')) for name in ('a', 'c')]
    done = here.run('export', *bundles, '--to', 'c99', '--output', here.folder / 'out')
    assert done.status == 2 and 'the target c99 takes one bundle, only ros2 takes' in done.err
    export = ('export', *bundles, '--to', 'ros2', '--output', here.folder / 'out')
    done = here.run(*export)
    assert done.status == 1
    assert "c.yaml:9:10: error: 'OWN-n' would be announced on copilot/handlerpropOWN_n, as " \
           "'OWN-n' is (" in done.err and 'a.yaml:9:10)' in done.err
    assert "a.yaml has no constant 'none'" in here.run(*export, '--constant', 'none=1').err


def test_a_gate_on_a_topic_is_exported_as_a_node_of_its_own(here: Here) -> None:
    bundle, out = here.file('gated.yaml', """\
format: 1
inputs:
  x: {topic: cmd_in, type: std_msgs/msg/Float32}
""" + ARM_INPUT + """\
gates:
  cmd: {from: cmd_in, to: cmd_out, type: std_msgs/msg/Float32, keep: [KEPT]}
""" + ARM_GATE + """\
requirements:
  - {id: KEPT, ptltl: "x < 1.0"}
  - {id: ARM, ptltl: "!data"}
  - {id: OWN, ptltl: "x < 3.0"}
"""), here.folder / 'out'
    export = ('export', bundle, '--to', 'ros2', '--no-proof', '--output', out, '--gate')
    done = here.run(*export, 'cmd')
    assert done.status == 0 and '1 requirement' in done.out and 'not part of' not in done.err
    assert '<name>gated_cmd_gate</name>' in (out / 'package.xml').read_text(encoding='utf-8')
    table = (out / 'src' / 'node_table.c').read_text(encoding='utf-8')
    assert all(word in table for word in (
        '"fret_gate"', 'handlerpropKEPT', '"cmd_out"', '.gate = report_gate', '.gate = gate'))
    assert 'handlerpropOWN' not in table
    assert 'add_executable(gate' in (out / 'CMakeLists.txt').read_text(encoding='utf-8')
    launch = (out / 'launch' / 'gate.launch.py').read_text(encoding='utf-8')
    assert "executable='gate'" in launch and "'name': ('fret_gate'" in launch
    done = here.run(*export, 'arm')
    assert done.status == 0 and '<depend>std_srvs</depend>' in (out / 'package.xml').read_text()
    table = (out / 'src' / 'node_table.c').read_text(encoding='utf-8')
    assert 'FM_SERVICE_SUPPORT(std_srvs, srv, SetBool), INT64_C(60000000000)' in table
