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

"""From a bundle to a folder for a robot: reproducible, and written completely or not at all."""

from dataclasses import replace
from fractions import Fraction
import os
from pathlib import Path
import shutil
import stat
import struct
import subprocess
import sys

import fret_monitor
from fret_monitor.build import build, generate_monitor, read, write
from fret_monitor.logic.formula import Historically
from fret_monitor.model.diagnostics import CompileError
from fret_monitor.model.manifest import Manifest
from fret_monitor.model.policies import Policy, Report, Stamp
from fret_monitor.native import cache, CompilerError, NativeError
from fret_monitor.native.folder import open_folder
from fret_monitor.native.monitor import load
from fret_monitor.runtime.evaluator import Evaluator
from fret_monitor.runtime.fields import FieldReading, read_fields, ReadOutcome
from native import engine
import pytest
from strategies import thorough

PACKAGE = Path(fret_monitor.__file__).resolve().parent
PUMP = """\
format: 1
inputs: {p: {type: bool}, x: {type: float32}}
definitions: {high: x > 0.5}
requirements:
  - {id: R-1, ptltl: "high -> O[0,3] p", title: a first one}
  - {id: R-2, ptltl: "H[9,70] p"}
"""
HOLDS = {'manifest.json', 'libpump_monitor.so', 'libfm_evaluator.so', 'src'}


@pytest.fixture
def pump(tmp_path: Path) -> Path:
    """Return a bundle in a folder of its own."""
    (tmp_path / 'in').mkdir()
    path = tmp_path / 'in' / 'pump.yaml'
    path.write_text(PUMP)
    return path


def write_bundle(bundle: Path, folder: Path) -> None:
    """Compile a bundle to a folder."""
    write(generate_monitor(read(bundle)), folder)


def contents(folder: Path) -> dict[str, bytes]:
    """Return all files of a folder except libraries: linkers may differ from run to run."""
    return {path.relative_to(folder).as_posix(): path.read_bytes()
            for path in sorted(folder.rglob('*')) if path.is_file()}


def verdicts(folder: Path, values: list[tuple[bool, float]]) -> list[bool]:
    """Run the compiled bundle of a folder and return the verdicts of R-1."""
    held = open_folder(folder)
    evaluator = Evaluator(load(held.library, held.manifest), library=held.evaluator)
    found = []
    for p, x in values:
        evaluator.store(0, p)
        evaluator.store(1, x)
        evaluator.step(0)
        found.append(evaluator.verdicts[0])
    return found


def refusal(bundle: Path, folder: Path) -> str:
    """Return the error for a folder that is refused; check that nothing is left beside it."""
    before = sorted(os.listdir(bundle.parent.parent))
    with pytest.raises(CompileError) as caught:
        write_bundle(bundle, folder)
    assert sorted(os.listdir(bundle.parent.parent)) == before
    return str(caught.value)


# -- the folder -------------------------------------------------------------------------------


def test_a_folder_holds_libraries_manifest_and_sources(pump: Path, tmp_path: Path) -> None:
    out = tmp_path / 'out'
    write_bundle(pump, out)
    assert set(os.listdir(out)) == HOLDS
    assert set(os.listdir(out / 'src')) >= {
        'pump_monitor.h', 'pump_monitor.c', 'fret_monitor.h', 'fret_cells.h', 'evaluator.h',
        'evaluator.c', 'deadlines.c', 'due.c', 'measures.c', 'steps.c', 'tables.c',
        'instance.c'}
    assert sorted(os.listdir(tmp_path)) == ['in', 'out']
    assert stat.S_IMODE(out.stat().st_mode) == 0o755


def test_the_manifest_of_a_folder_agrees_with_the_bundle(pump: Path, tmp_path: Path) -> None:
    write_bundle(pump, tmp_path / 'out')
    manifest = open_folder(tmp_path / 'out').manifest
    assert [item.name for item in manifest.inputs] == ['p', 'x']
    assert [(item.id, item.handler, item.title) for item in manifest.requirements] == [
        ('R-1', 'handlerpropR_1', 'a first one'), ('R-2', 'handlerpropR_2', '')]
    assert manifest.requirements[0].text == 'high -> O[0,3] p'
    assert manifest.sources == ('pump_monitor.h', 'pump_monitor.c')
    text = (tmp_path / 'out' / 'manifest.json').read_text()
    assert Manifest.from_json(text).to_json() == text
    assert str(tmp_path) not in text


def test_a_folder_runs_without_a_compiler(pump: Path, tmp_path: Path,
                                          monkeypatch: pytest.MonkeyPatch) -> None:
    write_bundle(pump, tmp_path / 'out')
    shutil.move(tmp_path / 'out', tmp_path / 'robot')
    monkeypatch.setenv('PATH', str(tmp_path))
    monkeypatch.setenv('CC', 'no-compiler')
    monkeypatch.setenv('ROS_HOME', str(tmp_path / 'empty'))
    values = [(False, 0.0), (False, 1.0), (True, 1.0), (False, 1.0)]
    assert verdicts(tmp_path / 'robot', values) == [True, False, True, True]


def test_a_folder_reads_messages(pump: Path, tmp_path: Path) -> None:
    folder = tmp_path / 'share' / 'pump_msgs' / 'msg'
    folder.mkdir(parents=True)
    (folder / 'Level.msg').write_text('string name\nfloat32[] levels\n')
    topic = '{topic: levels, type: pump_msgs/msg/Level, field: max(levels)}'
    pump.write_text(PUMP.replace('{type: float32}', topic))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv('AMENT_PREFIX_PATH', str(tmp_path))
        write_bundle(pump, tmp_path / 'out')
    found = open_folder(tmp_path / 'out')
    assert found.manifest.sources == ('pump_monitor.h', 'pump_monitor.c', 'pump_fields.c')
    assert found.manifest.inputs[1].reduction == 'max'
    assert (tmp_path / 'out' / 'src' / 'fret_cdr.h').is_file()
    monitor = load(found.library, found.manifest)
    message = b'\0\1\0\0' + struct.pack('<I4sIff', 4, b'abc', 2, 0.25, 0.75)
    assert read_fields(monitor, 0, message) == (FieldReading(ReadOutcome.READ, 0.75),)
    source = tmp_path / 'out' / 'src' / 'pump_fields.c'
    compiler = shutil.which('cc') or shutil.which('gcc')
    if compiler:
        subprocess.run([compiler, '-std=c99', '-Wall', '-Wextra', '-Werror', '-c', source.name],
                       cwd=source.parent, check=True)


def test_the_sources_of_a_folder_compile_in_place(pump: Path, tmp_path: Path) -> None:
    out = tmp_path / 'out'
    write_bundle(pump, out)
    compiler = shutil.which('cc') or shutil.which('gcc')
    if compiler is None:
        pytest.skip('needs a C compiler by the name of cc or gcc')
    subprocess.run([compiler, '-std=c99', '-Wall', '-Wextra', '-Wpedantic', '-Werror', '-fPIC',
                    '-shared', 'pump_monitor.c', 'evaluator.c', 'deadlines.c', 'due.c',
                    'measures.c', 'steps.c', 'tables.c', 'instance.c', '-lm', '-o', 'all.so'],
                   cwd=out / 'src', check=True)
    assert b'O[0,3] p' in (out / 'src' / 'pump_monitor.c').read_bytes()


@pytest.mark.parametrize('is_anew', [False, pytest.param(True, marks=thorough)])
def test_the_same_bundle_gives_the_same_bytes(
    pump: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_anew: bool,
) -> None:
    script = 'from pathlib import Path; from fret_monitor.build import *; ' \
             'write(generate_monitor(read(Path("pump.yaml"))), Path("../elsewhere"))'
    write_bundle(pump, tmp_path / 'here')  # with what the cache has
    evaluator = engine.entry()
    monkeypatch.setenv('ROS_HOME', str(tmp_path / 'home'))
    if not is_anew:
        engine.put(evaluator)
    subprocess.run(
        [sys.executable, '-c', script], cwd=pump.parent, check=True,
        env={**os.environ, 'PYTHONHASHSEED': '0', 'PYTHONPATH': str(PACKAGE.parent)})
    made = contents(tmp_path / 'here')
    assert made == contents(tmp_path / 'elsewhere')
    assert len(made) >= 9


def test_a_topic_with_its_fields_gives_the_same_c_as_its_inputs(tmp_path: Path) -> None:
    path = tmp_path / 'base.yaml'
    requirement = 'requirements:\n  - {id: R, ptltl: "far -> speed < 1.0"}\n'
    odom = 'type: nav_msgs/msg/Odometry, qos: {depth: 5}, timeout: 1, stale: violate, startup: 3'
    made = []
    for inputs in (f"""
inputs:
  speed: {{topic: odom, {odom}, field: norm(twist.twist.linear), initial: 0}}
  far: {{topic: odom, {odom}, field: received()}}
""", f"""
topics:
  odom:
    {{{odom}, fields: {{speed: {{field: norm(twist.twist.linear), initial: 0}}, far: received()}}}}
"""):
        path.write_text(f'format: 1{inputs}{requirement}')
        generated = generate_monitor(read(path))
        made.append((generated.module, replace(generated.manifest, bundle_hash='')))
    assert made[0] == made[1]


def test_another_text_gives_another_hash(pump: Path) -> None:
    first = generate_monitor(read(pump)).manifest
    assert generate_monitor(read(pump)).manifest == first
    pump.write_text(PUMP.replace('first', 'second'))
    second = generate_monitor(read(pump)).manifest
    pump.write_text(PUMP.replace('O[0,3]', 'O[0,4]'))
    third = generate_monitor(read(pump)).manifest
    hashes = {item.bundle_hash for item in (first, second, third)}
    assert len(hashes) == 3
    assert third.source_hash != first.source_hash


# -- where it is written ----------------------------------------------------------------------


def test_missing_parent_folders_are_created(pump: Path, tmp_path: Path) -> None:
    write_bundle(pump, tmp_path / 'a' / 'b' / 'out')
    assert set(os.listdir(tmp_path / 'a' / 'b' / 'out')) == HOLDS
    assert os.listdir(tmp_path / 'a' / 'b') == ['out']


def test_an_empty_folder_is_filled(pump: Path, tmp_path: Path) -> None:
    (tmp_path / 'out').mkdir()
    write_bundle(pump, tmp_path / 'out')
    assert set(os.listdir(tmp_path / 'out')) == HOLDS


def test_an_earlier_compiled_bundle_is_replaced_as_a_whole(pump: Path, tmp_path: Path) -> None:
    out = tmp_path / 'out'
    write_bundle(pump, out)
    pump.write_text(PUMP.replace('O[0,3]', 'O[0,1]'))
    write_bundle(pump, out)
    assert sorted(os.listdir(tmp_path)) == ['in', 'out']
    values = [(True, 0.0), (False, 1.0), (False, 1.0)]
    assert verdicts(out, values) == [True, True, False]


@pytest.mark.parametrize('name', ['mine/keep', 'src/mine.c', 'notes.txt'])
def test_files_that_a_user_added_to_a_compiled_folder_are_not_lost(
    name: str, pump: Path, tmp_path: Path,
) -> None:
    out = tmp_path / 'out'
    write_bundle(pump, out)
    (out / name).parent.mkdir(exist_ok=True)
    (out / name).write_text('mine')
    before = contents(out)
    with pytest.raises(CompileError, match=f"holds '{name.removesuffix('/keep')}'"):
        write_bundle(pump, out)
    assert contents(out) == before


def test_a_relative_path_is_relative_to_the_working_directory(
        pump: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for folder in ('out', './other', 'in/../third/', 'out'):
        write_bundle(pump, Path(folder))
    assert sorted(os.listdir(tmp_path)) == ['in', 'other', 'out', 'third']


def test_the_working_directory_is_refused(pump: Path, tmp_path: Path,
                                          monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / 'here').mkdir()
    monkeypatch.chdir(tmp_path / 'here')
    for folder in ('.', '', '../here', str(tmp_path / 'here')):
        assert 'is the current folder' in refusal(pump, Path(folder))
    assert os.listdir(tmp_path / 'here') == []


def test_a_link_to_a_folder_stays_a_link(pump: Path, tmp_path: Path) -> None:
    (tmp_path / 'link').symlink_to('place')
    for _ in range(2):
        write_bundle(pump, tmp_path / 'link')
        assert (tmp_path / 'link').is_symlink()
        assert set(os.listdir(tmp_path / 'place')) == HOLDS
        assert sorted(os.listdir(tmp_path)) == ['in', 'link', 'place']


def test_a_folder_with_other_files_is_refused(pump: Path, tmp_path: Path) -> None:
    said = refusal(pump, tmp_path / 'in')
    assert f"'{tmp_path / 'in'}' holds other files" in said
    assert 'name an empty folder' in said
    assert os.listdir(tmp_path / 'in') == ['pump.yaml']
    (tmp_path / 'in' / 'manifest.json').write_text('{}')
    assert 'holds other files' in refusal(pump, tmp_path / 'in')


def test_a_file_in_the_way_is_refused(pump: Path, tmp_path: Path) -> None:
    file = tmp_path / 'file'
    file.write_text('mine')
    assert f"'{file}' is a file" in refusal(pump, file)
    assert f"'{file}' is a file" in refusal(pump, file / 'out')
    assert 'cannot write' in refusal(pump, file / 'a' / 'out')
    assert file.read_text() == 'mine'
    assert 'cannot write' in refusal(pump, Path('/dev/null/out'))
    assert "'/dev/null' is a file" in refusal(pump, Path('/dev/null'))


def test_an_impossible_path_is_refused(pump: Path, tmp_path: Path) -> None:
    assert 'File name too long' in refusal(pump, tmp_path / ('x' * 300))
    (tmp_path / 'loop').symlink_to('loop')
    assert 'cannot write' in refusal(pump, tmp_path / 'loop')
    assert 'cannot write' in refusal(pump, tmp_path / 'loop' / 'out')


@pytest.mark.skipif(os.geteuid() == 0, reason='root may write anywhere')
def test_a_folder_that_may_not_be_written_is_refused(pump: Path, tmp_path: Path) -> None:
    (tmp_path / 'closed').mkdir(mode=0o500)
    assert 'Permission denied' in refusal(pump, tmp_path / 'closed' / 'out')
    (tmp_path / 'shut').mkdir(mode=0o000)
    assert 'Permission denied' in refusal(pump, tmp_path / 'shut' / 'out')


def test_a_full_disk_leaves_the_earlier_folder_unchanged(pump: Path, tmp_path: Path) -> None:
    out = tmp_path / 'out'
    write_bundle(pump, out)
    before = contents(out)
    script = 'import sys, resource; from pathlib import Path; from fret_monitor.build import *; ' \
             'made = generate_monitor(read(Path(sys.argv[1]))); compile_monitor(made); ' \
             'resource.setrlimit(resource.RLIMIT_FSIZE, (3000, 3000)); ' \
             'write(made, Path(sys.argv[2]))'
    for folder in (out, tmp_path / 'new'):
        done = subprocess.run([sys.executable, '-c', script, str(pump), str(folder)],
                              capture_output=True, text=True, check=False,
                              env={**os.environ, 'PYTHONPATH': str(PACKAGE.parent)})
        assert f"error: cannot write '{folder}': File too large" in done.stderr
    assert contents(out) == before
    assert sorted(os.listdir(tmp_path)) == ['in', 'out']


def test_a_bundle_may_have_a_file_name_that_is_not_utf_8(tmp_path: Path) -> None:
    bundle = tmp_path / os.fsdecode(b'p\xffp.yaml')
    bundle.write_text(PUMP)
    write_bundle(bundle, tmp_path / 'out')
    assert open_folder(tmp_path / 'out').manifest.symbol == 'p_p_monitor'


def test_a_bundle_may_have_a_long_file_name(tmp_path: Path) -> None:
    bundle = tmp_path / ('n' * 250 + '.yaml')
    bundle.write_text(PUMP)
    write_bundle(bundle, tmp_path / 'out')
    assert verdicts(tmp_path / 'out', [(True, 1.0), (False, 1.0)]) == [True, True]


# -- the compiler -----------------------------------------------------------------------------


def test_without_a_compiler_nothing_is_written(pump: Path, tmp_path: Path,
                                               monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv('ROS_HOME', str(tmp_path / 'home'))
    monkeypatch.delenv('CC', raising=False)
    monkeypatch.setenv('PATH', str(tmp_path))
    with pytest.raises(CompilerError, match='no C compiler found: install gcc'):
        write_bundle(pump, tmp_path / 'out')
    assert not (tmp_path / 'out').exists()


def test_a_compiler_that_fails_leaves_nothing(pump: Path, tmp_path: Path,
                                              monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv('ROS_HOME', str(tmp_path / 'home'))
    script = tmp_path / 'in' / 'bad-cc'
    script.write_text('#!/bin/sh\necho "out of luck" >&2\nexit 3\n')
    script.chmod(0o755)
    monkeypatch.setenv('CC', str(script))
    with pytest.raises(NativeError, match=r'(?s)exit status 3.*out of luck'):
        write_bundle(pump, tmp_path / 'out')
    assert sorted(path.name for path in tmp_path.iterdir() if path.name != 'home') == ['in']


def test_a_built_library_is_cached_and_found(pump: Path) -> None:
    first = build(pump)
    changed = first.library.stat().st_mtime_ns
    assert build(pump).library == first.library
    assert first.library.stat().st_mtime_ns == changed
    assert cache.is_kept(first.library)


# -- policy and period ------------------------------------------------------------------------


def test_given_policy_and_period_replace_those_of_the_bundle(pump: Path) -> None:
    def manifest(**options: object) -> Manifest:
        return generate_monitor(read(pump, **options)).manifest  # type: ignore[arg-type]

    assert manifest().policy is Policy.EVERY_MESSAGE
    assert manifest(policy=Policy.ALL_INPUTS).policy is Policy.ALL_INPUTS
    periodic = manifest(policy=Policy.PERIODIC, period=Fraction(1, 10))
    assert (periodic.policy, periodic.period) == (Policy.PERIODIC, 0.1)
    assert manifest(policy=Policy.ALL_INPUTS).bundle_hash != manifest().bundle_hash
    with pytest.raises(CompileError, match=rf'the policy periodic needs a period \({pump}\)'):
        manifest(policy=Policy.PERIODIC)
    with pytest.raises(CompileError, match=rf'not with every_message \({pump}\)'):
        manifest(period=Fraction(1))


def test_a_bad_period_hides_no_other_problem(pump: Path) -> None:
    wrong = PUMP + '  - {id: R9, ptltl: H nothing}\nfoo: 1\n'
    for evaluation, told in (
            ('', []),
            ('evaluation: {policy: periodic}\n', ["the policy periodic needs a 'period'"]),
            ('evaluation: {policy: periodic, period: 0}\n', ["'period' must be greater"]),
            ('evaluation: {policy: periodic, rate: 1e30}\n', ["'rate' is out of range"])):
        pump.write_text(wrong + evaluation)
        with pytest.raises(CompileError) as caught:
            read(pump)
        expected = ["'nothing' is not declared", "a bundle has no key 'foo'", *told]
        titles = [item.title for item in caught.value.diagnostics]
        assert len(titles) == len(expected), titles
        assert all(title.startswith(start)
                   for title, start in zip(titles, expected, strict=True)), titles
        assert all(item.span for item in caught.value.diagnostics)


def test_a_given_policy_that_does_not_fit_hides_no_problem_of_the_bundle(
        pump: Path) -> None:
    pump.write_text(PUMP + '  - {id: R9, ptltl: H nothing}\n')
    for options in ({'policy': Policy.PERIODIC}, {'period': Fraction(1)}):
        with pytest.raises(CompileError) as caught:
            read(pump, **options)
        first, second = (item.title for item in caught.value.diagnostics)
        assert 'period' in first
        assert second == "'nothing' is not declared"


def test_the_period_of_the_bundle_is_used_with_its_own_policy_only(pump: Path) -> None:
    pump.write_text(PUMP + 'evaluation: {policy: periodic, rate: 20}\n')
    assert generate_monitor(read(pump)).manifest.period == 0.05
    assert generate_monitor(read(pump, policy=Policy.ALL_INPUTS)).manifest.period is None
    assert generate_monitor(read(pump, period=Fraction(2))).manifest.period == 2.0


def test_a_bundle_is_read_in_time_by_a_given_policy(pump: Path) -> None:
    with pytest.raises(CompileError) as caught:
        read(pump, policy=Policy.TIMED)
    places = [(item.title, item.span.line) for item in caught.value.diagnostics if item.span]
    assert places == [('a count needs a unit of time', 5), ('a count needs a unit of time', 6)]
    assert all('unit: 1' in item.help for item in caught.value.diagnostics)
    with pytest.raises(CompileError, match='a period or a rate goes with the policy periodic'):
        read(pump, policy=Policy.TIMED, period=Fraction(1))


def test_a_bundle_with_times_needs_a_policy_that_has_them(pump: Path) -> None:
    pump.write_text(PUMP.replace('O[0,3]', 'O[0, 3 s]').replace('H[9,70]', 'H[<70]')
                    + 'evaluation: {policy: timed, unit: 0.1, reorder: 0.5, stamp: header}\n')
    timed = read(pump).specification
    assert [str(item.formula.window.high) for item in timed.properties
            if isinstance(item.formula, Historically)] == ['6999999999']
    assert (timed.unit, timed.reorder, timed.stamp) == (
        Fraction(1, 10), 500_000_000, Stamp.HEADER)
    assert {item.report for item in timed.properties} == {Report.OCCURRENCE}
    with pytest.raises(CompileError, match='a bound must be a number of steps'):
        read(pump, policy=Policy.EVERY_MESSAGE)
    periodic = read(pump, policy=Policy.PERIODIC, period=Fraction(1, 10)).specification
    assert (periodic.unit, periodic.reorder, periodic.stamp) == (None, 0, Stamp.RECEIVED)
    assert {item.report for item in periodic.properties} == {Report.EVERY_STEP}
    assert [item.bounds for item in periodic.properties] == [(30,), (69,)]


def test_a_bundle_without_a_period_can_be_given_one(pump: Path) -> None:
    pump.write_text(pump.read_text() + 'evaluation: {policy: periodic}\n')
    with pytest.raises(CompileError, match="the policy periodic needs a 'period'"):
        read(pump)
    assert read(pump, period=Fraction(1, 2)).specification.period == Fraction(1, 2)
    assert read(pump, policy=Policy.ALL_INPUTS).specification.policy is Policy.ALL_INPUTS
