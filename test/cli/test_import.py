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

"""`fret-monitor import` as users run it."""

import os
from pathlib import Path

from fret_monitor.cli.main import main
from importing.examples import DATABASE, PROJECT, requirement, SPECIFICATION, written
import pytest


def test_a_bundle_that_is_ready_passes_check(tmp_path: Path,
                                             capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip('std_msgs')
    database = {**DATABASE, 'inputs': DATABASE['inputs'][:2]}  # those of the component
    files = [str(path) for path in written(tmp_path, spec_json=SPECIFICATION, db_json=database)]
    bundle = tmp_path / 'rover.yaml'
    assert main(['import', *files, '-o', str(bundle)]) == 0
    said = capsys.readouterr()
    assert said.out == f'{bundle}: 1 requirement, 1 input\n'
    assert said.err == ''
    assert main(['check', str(bundle)]) == 0


def test_manual_tasks_are_reported_and_the_bundle_passes_check(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    [file] = written(tmp_path, moon_json=PROJECT)
    bundle = tmp_path / 'rover.yaml'
    assert main(['import', str(file), '-o', str(bundle)]) == 0
    said = capsys.readouterr()
    assert said.out == f'{bundle}: 3 requirements, 3 inputs (3 without a topic)\n'
    assert f'{bundle}: to do by hand (1):\n- no file gives the topic' in said.err
    assert '\n        armed: {topic: ..., type: std_msgs/msg/Bool}\n' in said.err
    assert '# TO DO (1):\n# - no file gives the topic' in bundle.read_text()
    assert main(['check', str(bundle)]) == 0


def test_a_trace_on_which_wordings_differ_can_be_simulated(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    project = {'requirements': [
        requirement('A', 'rover shall always satisfy speed < 3', '(H (speed <= 3))'),
        requirement('B', 'rover shall always satisfy armed')]}
    [file] = written(tmp_path, moon_json=project)
    bundle = tmp_path / 'rover.yaml'
    assert main(['import', str(file), '-o', str(bundle)]) == 0
    capsys.readouterr()
    trace = tmp_path / 'rover.A.1.csv'
    assert main(['simulate', str(bundle), '--trace', str(trace)]) == 0
    rows = [row.split(',') for row in capsys.readouterr().out.split()]
    assert rows[0][:2] == ['step', 'A']
    assert [row[1] for row in rows[1:]] == ['1'] * (len(rows) - 2) + ['0']


def test_a_folder_receives_a_bundle_for_each_component(tmp_path: Path) -> None:
    project = {'requirements': [requirement('A', 'rover shall always satisfy p'),
                                requirement('A', 'arm shall always satisfy p', component='arm')]}
    [file] = written(tmp_path, moon_json=project)
    assert main(['import', str(file), '-o', f'{tmp_path}/bundles/']) == 0
    assert sorted(path.name for path in (tmp_path / 'bundles').iterdir()) == [
        'arm.yaml', 'rover.yaml']


def test_without_output_the_bundle_goes_to_standard_output(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    [file] = written(tmp_path, moon_json=PROJECT)
    assert main(['import', str(file), '-o', str(tmp_path / 'rover.yaml')]) == 0
    capsys.readouterr()
    assert main(['import', str(file)]) == 0
    said = capsys.readouterr()
    assert said.out == (tmp_path / 'rover.yaml').read_text()
    assert said.err.startswith('to do by hand (1):\n- no file gives the topic')
    assert said.err.endswith('\n3 requirements, 3 inputs (3 without a topic)\n')
    assert sorted(path.name for path in tmp_path.iterdir()) == ['moon.json', 'rover.yaml']


def test_without_output_several_components_are_refused(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    project = {'requirements': [requirement('A', 'rover shall always satisfy p'),
                                requirement('A', 'arm shall always satisfy p', component='arm')]}
    [file] = written(tmp_path, moon_json=project)
    assert main(['import', str(file)]) == 1
    said = capsys.readouterr()
    assert said.out == ''
    assert 'there are 2 components' in said.err


def test_without_output_it_reports_that_traces_are_not_written(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str]) -> None:
    project = {'requirements': [
        requirement('A', 'rover shall always satisfy speed < 3', '(H (speed <= 3))')]}
    [file] = written(tmp_path, moon_json=project)
    monkeypatch.chdir(tmp_path)
    assert main(['import', str(file)]) == 0
    assert 'not written without -o: bundle.A.1.csv\n' in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ['moon.json']


def test_a_malformed_sentence_does_not_prevent_the_other_bundles(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    project = {'requirements': [
        requirement('R-1', 'rover shall always satisfy p'),
        requirement('R-1', 'arm shall always satisfy p', component='arm'),
        requirement('R-3', 'rover must be nice', component='')]}
    [file] = written(tmp_path, moon_json=project)
    assert main(['import', str(file), '-o', f'{tmp_path}/bundles/']) == 0
    assert sorted(path.name for path in (tmp_path / 'bundles').iterdir()) == [
        'arm.yaml', 'rover.yaml']
    assert 'warning: in no bundle, because they have no component: R-3' in capsys.readouterr().err


def test_a_file_that_is_no_export_is_refused_and_nothing_is_written(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    [file] = written(tmp_path, odd_json='{"requirements": [')
    assert main(['import', str(file), '-o', str(tmp_path / 'b.yaml')]) == 1
    said = capsys.readouterr()
    assert 'odd.json:1:19: error: this is not JSON' in said.err
    assert said.out == ''
    assert [path.name for path in tmp_path.iterdir()] == ['odd.json']


def test_a_bundle_is_overwritten_only_with_force(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    [file] = written(tmp_path, moon_json=PROJECT)
    bundle = tmp_path / 'rover.yaml'
    bundle.write_text('mine')
    assert main(['import', str(file), '-o', str(bundle)]) == 1
    assert 'exists' in capsys.readouterr().err
    assert main(['import', str(file), '-o', str(bundle), '--force']) == 0
    assert bundle.read_text() != 'mine'


@pytest.mark.timeout(60)
@pytest.mark.parametrize('name', ['pipe.json', 'pipe.xlsx', 'pipe.csv', 'pipe.reqifz'])
def test_a_named_pipe_is_neither_read_nor_written(
        name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    [file] = written(tmp_path, moon_json=PROJECT)
    pipe, xml = tmp_path / name, tmp_path / 'a.xml'
    os.mkfifo(pipe)
    xml.write_text('<a/>')
    for words in ([pipe], [xml, '--format', pipe]):
        assert main(['import', *map(str, words)]) == 1
        assert f"{name}' is a named pipe, not a file" in capsys.readouterr().err
    assert main(['import', str(file), '-o', str(pipe), '--force']) == 1
    assert f"cannot write '{pipe}': it is no file" in capsys.readouterr().err


def test_a_pipe_of_the_shell_is_read(tmp_path: Path) -> None:
    [file] = written(tmp_path, moon_json=PROJECT)
    reading, writing = os.pipe()
    os.write(writing, file.read_bytes())
    os.close(writing)
    try:
        target = tmp_path / 'rover.yaml'
        assert main(['import', f'/dev/fd/{reading}', '-o', str(target)]) == 0
        assert 'R-1' in target.read_text()
    finally:
        os.close(reading)


def test_the_imported_file_is_not_overwritten_even_with_force(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    [file] = written(tmp_path, moon_json=PROJECT)
    text = file.read_text()
    (tmp_path / 'link.yaml').symlink_to(file)
    for output in (file, tmp_path / 'link.yaml'):
        assert main(['import', str(file), '-o', str(output), '--force']) == 1
        assert f"cannot write '{output}': this command reads it" in capsys.readouterr().err
        assert file.read_text() == text


def test_a_bundle_that_cannot_be_written_is_reported(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    [file] = written(tmp_path, moon_json=PROJECT)
    (tmp_path / 'file').write_text('')
    assert main(['import', str(file), '-o', str(tmp_path / 'file' / 'b.yaml')]) == 1
    assert 'cannot write' in capsys.readouterr().err
