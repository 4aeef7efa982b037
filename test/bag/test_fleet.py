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

"""Many recordings: when earlier results count, and what becomes of the files asked for."""

from concurrent.futures import ProcessPoolExecutor
from errno import ENOSPC
import json
import os
from pathlib import Path
import subprocess
import sys
import threading
from typing import Any
from xml.etree import ElementTree

from bag.recordings import FLOAT, START, TYPES, write
from bundles import write_bundle
from fret_monitor.bag import fleet
from fret_monitor.bag.check import check_recording, Selection
from fret_monitor.bag.required import _ROSBAGS
from fret_monitor.bag.results_file import finished_lines, ResultsFile
from fret_monitor.bag.workers import workers
from fret_monitor.cli.main import main
import pytest
from rosbags.rosbag2 import Reader, Writer
from rosbags.typesys import get_types_from_msg, get_typestore, Stores

SECOND = 10**9
LOW = """format: 1
inputs: {level: {topic: level, type: std_msgs/msg/Float64}}
requirements: [{id: LOW, ptltl: "level < 0.5"}]
"""
Capture = pytest.CaptureFixture[str]


@pytest.fixture
def bundle(tmp_path: Path) -> Path:
    """Write a bundle that a level of 0.5 violates."""
    return write_bundle(tmp_path, LOW, 'low.yaml')


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """Write a recording that violates it in its second message."""
    return write(tmp_path / 'recording', [('/level', 0, 0.0), ('/level', 5, 0.7)])


def test_results_do_not_count_after_a_file_of_the_bundle_changed(
        tmp_path: Path, capsys: Capture) -> None:
    kind = 'tank_msgs/msg/Level'  # its definition is in the recording alone
    types = get_typestore(Stores.ROS2_JAZZY)
    types.register(get_types_from_msg('float64 level', kind))
    with Writer(tmp_path / 'tank', version=9) as writer:
        topic = writer.add_connection('/level', kind, typestore=types)
        writer.write(topic, START, types.serialize_cdr(types.types[kind](0.7), kind))
    signals, file = tmp_path / 'signals.yaml', tmp_path / 'tank.yaml'
    signals.write_text(f"""format: 1
constants: {{limit: 0.9}}
inputs: {{level: {{topic: level, type: {kind}, field: level}}}}
""", encoding='utf-8')
    file.write_text("""format: 1
signals: signals.yaml
requirements: [{id: LOW, ptltl: "level < limit"}]
""", encoding='utf-8')
    arguments = ['bag', str(file), str(tmp_path / 'tank'), '--results', str(tmp_path / 'r.jsonl')]
    for _ in range(2):
        assert main(arguments) == 0
    assert 'checked before, no violation' in capsys.readouterr().out
    signals.write_text(signals.read_text(encoding='utf-8').replace('0.9', '0.5'), encoding='utf-8')
    assert main([*arguments, '--fail-on-violation']) == 1
    assert 'VIOLATED' in capsys.readouterr().out
    assert main([*arguments, '--constant', 'limit=0.9', '--fail-on-violation']) == 0
    assert 'satisfied' in capsys.readouterr().out


def test_results_without_what_was_judged_are_found_anew(
        tmp_path: Path, bundle: Path, recording: Path, capsys: Capture) -> None:
    results = tmp_path / 'r.jsonl'
    arguments = ['bag', str(bundle), str(recording), '--results', str(results)]
    assert main(arguments) == 0
    line = json.loads(results.read_text())
    del line['requirements']['LOW']['meaning']  # as earlier versions wrote it
    results.write_text(json.dumps(line) + '\n')
    assert main(arguments) == 0
    assert 'checked before' not in capsys.readouterr().out
    assert '"meaning"' in results.read_text().splitlines()[-1]


def test_results_do_not_count_if_the_recording_changed_meanwhile(
        tmp_path: Path, bundle: Path, recording: Path, capsys: Capture,
        monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patch:
        def check_and_change(*arguments: object, **named: object) -> object:
            result = check_recording(*arguments, **named)  # type: ignore[arg-type]
            with (recording / 'recording.mcap').open('ab') as file:
                file.write(b'more')
            return result

        patch.setattr('fret_monitor.bag.fleet.check_recording', check_and_change)
        arguments = ['bag', str(bundle), str(recording), '--results', str(tmp_path / 'r.jsonl')]
        assert main([*arguments, '--json']) == 0
        assert json.loads(capsys.readouterr().out)['sha256'] is None
    main(arguments)
    assert 'checked before' not in capsys.readouterr().out


def test_files_are_written_though_the_recording_was_checked_before(
        tmp_path: Path, bundle: Path, recording: Path, capsys: Capture) -> None:
    arguments = ['bag', str(bundle), str(recording), '--results', str(tmp_path / 'r.jsonl')]
    for option, name in (('--csv', 'c.csv'), ('--mcap', 'm.mcap'), ('--report', 'p.html')):
        for _ in range(2):
            assert main([*arguments, option, str(tmp_path / name)]) == 0
            (tmp_path / name).unlink()
    junit = tmp_path / 'j.xml'
    assert main([*arguments, '--junit', str(junit)]) == 0
    assert 'checked before' in capsys.readouterr().out
    failure, = ElementTree.parse(junit).iter('failure')
    assert failure.text == 'level < 0.5'


def test_an_index_has_the_pages_of_recordings_that_were_checked_before(
        tmp_path: Path, bundle: Path, recording: Path, capsys: Capture) -> None:
    second = write(tmp_path / 'second', [('/level', 0, 0.0)])
    reports = tmp_path / 'reports'
    arguments = ['bag', str(bundle), str(recording), str(second),
                 '--results', str(tmp_path / 'r.jsonl')]
    assert main(arguments) == 0
    with_reports = [*arguments, '--report', str(reports)]
    assert main(with_reports) == 0
    pages = sorted(reports.glob('re*.html')) + sorted(reports.glob('second*.html'))
    assert len(pages) == 2
    capsys.readouterr()
    assert main(with_reports) == 0
    assert capsys.readouterr().out.count('checked before') == 2
    pages[0].unlink()
    pages[1].write_text('of another bundle', encoding='utf-8')
    assert main(with_reports) == 0
    assert 'checked before' not in capsys.readouterr().out
    assert all('LOW' in page.read_text(encoding='utf-8') for page in pages)
    index = (reports / 'index.html').read_text(encoding='utf-8')
    assert all(f'href="{page.name}"' in index for page in pages)


def read_pipe(pipe: Path, found: list[bytes]) -> threading.Thread:
    """Make a pipe, and start to read it."""
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: found.append(pipe.read_bytes()), daemon=True)
    reader.start()
    return reader


@pytest.mark.parametrize('option', ['--mcap', '--csv', '--report', '--junit'])
def test_a_pipe_is_written_and_not_replaced(
        tmp_path: Path, bundle: Path, recording: Path, option: str) -> None:
    pipe, found = tmp_path / 'pipe.html', list[bytes]()
    reader = read_pipe(pipe, found)
    assert main(['bag', str(bundle), str(recording), option, str(pipe)]) == 0
    reader.join(10)
    assert pipe.is_fifo()
    assert len(found[0]) > 50
    if option == '--mcap':
        (tmp_path / 'out.mcap').write_bytes(found[0])
        with Reader(tmp_path / 'out.mcap') as reader_of_mcap:
            assert reader_of_mcap.message_count > 2


def test_results_overwrite_no_file_that_is_read_and_no_other_result(
        tmp_path: Path, recording: Path, capsys: Capture) -> None:
    signals, file = tmp_path / 'signals.yaml', tmp_path / 'tank.yaml'
    inputs, _, requirements = LOW.partition('\n')[2].partition('\n')
    file.write_text(f'format: 1\nsignals: signals.yaml\n{requirements}', encoding='utf-8')
    (tmp_path / 'link').symlink_to('signals.yaml')
    for text in (inputs, 'inputs: ['):  # what cannot be used is read too
        signals.write_text(text, encoding='utf-8')
        before = {path: path.read_bytes() for path in tmp_path.rglob('*') if path.is_file()}
        for option in ('--csv', '--mcap', '--junit', '--results', '--report'):
            for out in (file, signals, tmp_path / 'link', recording / 'metadata.yaml'):
                assert main(['bag', str(file), str(recording), option, str(out)]) == 1
                assert f"error: cannot write '{out}': this command reads it" \
                    in capsys.readouterr().err
    assert main(['bag', str(file), str(recording), '--results', str(tmp_path / 'out'),
                 '--junit', f'{tmp_path}/recording/../out']) == 1
    assert '--junit and --results both write' in capsys.readouterr().err
    assert {path: path.read_bytes() for path in tmp_path.rglob('*') if path.is_file()} == before


def test_results_are_not_kept_in_a_pipe(
        tmp_path: Path, bundle: Path, recording: Path, capsys: Capture) -> None:
    os.mkfifo(tmp_path / 'pipe')
    assert main(['bag', str(bundle), str(recording), '--results', str(tmp_path / 'pipe')]) == 1
    assert 'it is not a regular file' in capsys.readouterr().err


def test_results_that_were_cut_off_are_read(tmp_path: Path) -> None:
    results = tmp_path / 'r.jsonl'
    file = ResultsFile(results)
    for name in ('säck', 'line\u2028separator\x85', 'no\udcff'):
        file.add(json.dumps({'bag': name}, ensure_ascii=False))
    results.write_bytes(results.read_bytes() + '{"bag": "ä'.encode()[:-1])
    again = ResultsFile(results)
    again.add('{"bag": "last"}')
    assert [Path(name).name for name in finished_lines(results)] == [
        'säck', 'line\u2028separator\x85', 'no\udcff', 'last']


def test_a_name_that_is_not_utf_8_is_in_the_results(
        tmp_path: Path, bundle: Path, recording: Path, capsys: Capture) -> None:
    path = tmp_path / os.fsdecode(b'bad\xff.mcap')
    (recording / 'recording.mcap').rename(path)
    results, junit = tmp_path / 'r.jsonl', tmp_path / 'j.xml'
    arguments = ['bag', str(bundle), str(path), '--results', str(results), '--junit', str(junit)]
    for _ in range(2):
        assert main([*arguments, '--report', str(tmp_path / 'pages')]) == 0
    assert capsys.readouterr().out.count('checked before') == 1
    assert json.loads(results.read_text(encoding='utf-8'))['bag'] == str(path)


def test_a_full_disk_does_not_end_the_run(
        tmp_path: Path, bundle: Path, recording: Path, capsys: Capture,
        monkeypatch: pytest.MonkeyPatch) -> None:
    results = tmp_path / 'r.jsonl'
    open_file = Path.open

    class Full:
        """A file on a full disk."""

        def __enter__(self) -> 'Full':
            return self

        def __exit__(self, *error: object) -> None:
            """Close it."""

        def write(self, data: object) -> None:
            raise OSError(ENOSPC, 'No space left on device')

        def flush(self) -> None:
            """Write nothing."""

    def full(path: Path, mode: str = 'r', **options: str) -> object:
        is_it = path == results and mode in ('a', 'ab')
        return Full() if is_it else open_file(path, mode, **options)  # type: ignore[call-overload]

    second = write(tmp_path / 'second', [('/level', 0, 0.0)])
    results.write_text('', encoding='utf-8')
    monkeypatch.setattr(Path, 'open', full)
    assert main(['bag', str(bundle), str(recording), str(second), '--results', str(results)]) == 1
    out, err = capsys.readouterr()
    assert (out.count('VIOLATED'), out.count('satisfied')) == (1, 1)
    assert f"cannot write '{results}': No space left on device" in err
    assert err.count('No space') == 1


def test_one_recording_by_two_names_is_checked_once(
        tmp_path: Path, bundle: Path, recording: Path, capsys: Capture,
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    results = ['--results', 'r.jsonl']
    assert main(['bag', str(bundle), str(recording), *results]) == 0
    assert main(['bag', str(bundle), 'recording', *results]) == 0
    assert 'checked before' in capsys.readouterr().out


@pytest.mark.parametrize('jobs', [1, 2])
def test_one_job_needs_no_other_process(
        tmp_path: Path, bundle: Path, recording: Path, monkeypatch: pytest.MonkeyPatch,
        jobs: int) -> None:
    pools: list[int] = []

    class Pool(ProcessPoolExecutor):

        def __init__(self, workers: int, **options: Any) -> None:
            pools.append(workers)
            super().__init__(workers, **options)

    monkeypatch.setattr(fleet, 'ProcessPoolExecutor', Pool)
    other = write(tmp_path / 'other', [('/level', 0, 0.1)])
    outcomes = list(fleet.check_all(bundle, [recording, other], Selection(), jobs=jobs))
    found = {item.path: item.result and item.result.findings[0].verdict for item in outcomes}
    assert found == {recording: False, other: True}
    assert [item.error for item in outcomes] == ['', '']
    assert pools == ([] if jobs == 1 else [2])


def test_workers_have_imported_what_they_need() -> None:
    with ProcessPoolExecutor(1, mp_context=workers()) as pool:
        found = pool.submit(eval, "'fret_monitor.build' in __import__('sys').modules")
        assert found.result()


def test_a_cluster_without_workers_is_an_error(
        bundle: Path, recording: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch) -> None:
    distributed = pytest.importorskip('distributed', reason='needs the extra dask')
    monkeypatch.setattr('fret_monitor.bag.cluster._TIMEOUT_S', 1)
    with distributed.LocalCluster(n_workers=0, dashboard_address='127.0.0.1:0',
                                  scheduler_kwargs={'dashboard': False}) as cluster:
        address = cluster.scheduler_address
        assert main(['bag', str(bundle), str(recording), '--dask', address]) == 1
    err = capsys.readouterr().err
    assert f"error: the scheduler of Dask at '{address}' has no worker" in err
    assert f'= help: start one, or several: dask worker {address}' in err


def test_an_error_of_the_bundle_is_printed_once(
        tmp_path: Path, bundle: Path, recording: Path, capsys: Capture) -> None:
    bad = write_bundle(tmp_path, LOW.replace('< 0.5', '< < 0.5'), 'bad.yaml')
    assert main(['bag', str(bad), *[str(recording)] * 2]) == 1
    first, *others, last = capsys.readouterr().err.splitlines()
    assert first.startswith(f'{bad}:3:') and not any('error' in line for line in others)
    assert last == f'error: {recording}: the same as before'


def test_every_error_is_json(
        tmp_path: Path, bundle: Path, recording: Path, capsys: Capture,
        monkeypatch: pytest.MonkeyPatch) -> None:
    def errors(*arguments: object) -> list[list[str]]:
        assert main(['bag', *map(str, arguments), '--json']) == 1
        out, err = capsys.readouterr()
        assert 'error: ' in err
        return [json.loads(line)['errors'] for line in out.splitlines()]

    bad = write_bundle(tmp_path, LOW.replace('< 0.5', '< < 0.5'), 'bad.yaml')
    for arguments, text in (
            ((tmp_path / 'gone.yaml', recording), 'there is no file '),
            ((bundle, recording, recording / 'x', '--csv', 'c.csv'), '--csv is of one recording'),
            ((bad, recording), f'{bad}:3:'), ((bundle, tmp_path / 'no'), 'there is no recording')):
        found = errors(*arguments)
        assert len(found) == (2 if '--csv' in arguments else 1)
        assert all(error.startswith(text) and '\n' not in error for error, in found), found
    monkeypatch.setattr('fret_monitor.model.diagnostics.find_spec', lambda name: None)
    (text,), = errors(bundle, recording)
    assert text.startswith('`bag` needs rosbags>=0.11.7,<0.12, which is not installed; ')


def test_a_release_of_rosbags_that_cannot_be_used_is_no_traceback(
        tmp_path: Path, bundle: Path, recording: Path) -> None:
    old = tmp_path / 'old' / 'rosbags'
    old.mkdir(parents=True)
    (old / '__init__.py').write_text('')
    done = subprocess.run(
        [sys.executable, '-m', 'fret_monitor', 'bag', bundle, recording], capture_output=True,
        text=True, env={**os.environ, 'PYTHONPATH': str(old.parent)})
    assert done.returncode == 1
    assert done.stderr.startswith('error: `bag` needs another release of rosbags: ')
    assert "pip install 'rosbags>=0.11.7,<0.12'" in done.stderr
    assert f"    '{_ROSBAGS}',\n" in (
        Path(__file__).parents[2] / 'setup.py').read_text(encoding='utf-8')


def test_junit_agrees_with_the_exit_status_of_a_partial_check(
        tmp_path: Path, bundle: Path, recording: Path) -> None:
    junit = tmp_path / 'j.xml'
    file = recording / 'recording.mcap'
    file.write_bytes(file.read_bytes().replace(b'/level', b'/leval'))
    arguments = ['bag', str(bundle), str(file), '--junit', str(junit)]
    assert main([*arguments]) == 1
    assert ElementTree.parse(junit).getroot()[0].get('errors') == '1'
    assert main([*arguments, '--partial']) == 0
    suite, = ElementTree.parse(junit).getroot()
    assert (suite.get('errors'), suite.get('skipped'), suite.get('tests')) == ('0', '1', '1')
    assert '/level was not recorded' in suite.findtext('system-out', '')
    file.write_bytes(b'')
    assert main([*arguments, '--partial']) == 1
    assert ElementTree.parse(junit).getroot()[0].get('errors') == '1'


TWO = """format: 1
evaluation: {policy: POLICY}
inputs:
  level: {topic: level, type: std_msgs/msg/Float64}
  flow: {topic: flow, type: std_msgs/msg/Float64}
  gone: {topic: gone, type: std_msgs/msg/Float64, initial: 0}
requirements:
  - {id: LEVEL, ptltl: "level < 0.5"}
  - {id: FLOW, ptltl: "flow < 0.5"}
  - {id: GONE, ptltl: "gone < 0.5"}
"""


@pytest.mark.parametrize(('policy', 'level', 'flow'), [  # when each takes its first step
    ('every_message', 1, 2 * SECOND), ('timed', 1, 2 * SECOND),
    ('periodic, rate: 100', 1 + SECOND // 100, 1 + 2 * SECOND)])
def test_verdicts_are_written_from_the_first_step_on(
        tmp_path: Path, policy: str, level: int, flow: int) -> None:
    file, csv, mcap = (tmp_path / name for name in ('two.yaml', 'c.csv', 'm.mcap'))
    file.write_text(TWO.replace('POLICY', policy), encoding='utf-8')
    path = write(tmp_path / 'bag', [
        ('/level', 1, 0.0), ('/level', SECOND, 0.7), ('/flow', 2 * SECOND, 0.0),
        ('/flow', 3 * SECOND, 0.0)])
    arguments = ['bag', str(file), str(path), '--missing-topics', 'ok']
    assert main([*arguments, '--csv', str(csv), '--mcap', str(mcap)]) == 0
    rows = [row.split(',') for row in csv.read_text(encoding='utf-8').splitlines()[1:]]
    if level > 1:
        assert rows.pop(0) == ['1700000000.000000001', '', '', '']  # nothing is judged yet
    assert [row[1:] for row in rows] == [['1', '', ''], ['0', '', ''], ['0', '1', '']]
    assert [int(row[0].replace('.', '')) - START for row in rows[::2]] == [level, flow]
    with Reader(mcap) as reader:
        found = [(item.topic.rpartition('/')[2], time - START, data[4])
                 for item, time, data in reader.messages() if '/copilot/verdict/' in item.topic]
    assert [item[:2] for item in found][:3:2] == [('LEVEL', level), ('FLOW', flow)]
    assert [(name, value) for name, _, value in found] == [
        ('LEVEL', 1), ('LEVEL', 0), ('FLOW', 1), ('LEVEL', 0), ('FLOW', 1)]


def test_only_verdicts_by_initial_values_are_written_of_an_empty_recording(tmp_path: Path) -> None:
    file, csv = tmp_path / 'two.yaml', tmp_path / 'c.csv'
    file.write_text(TWO.replace('POLICY', 'timed'), encoding='utf-8')
    with Writer(tmp_path / 'bag', version=9) as writer:
        for topic in ('/level', '/flow', '/gone'):
            writer.add_connection(topic, FLOAT, typestore=TYPES)
    assert main(['bag', str(file), str(tmp_path / 'bag'), '--partial', '--csv', str(csv)]) == 0
    row, = csv.read_text(encoding='utf-8').splitlines()[1:]
    assert row.endswith(',,,1')  # GONE has an initial value


def test_details_for_which_there_was_no_room_are_a_warning(
        tmp_path: Path, recording: Path, capsys: Capture) -> None:
    file = tmp_path / 'many.yaml'
    file.write_text(LOW.split('requirements')[0] + 'requirements:\n' + ''.join(
        f'  - {{id: R{k}, ptltl: "level < 0.5"}}\n' for k in range(1100)), encoding='utf-8')
    assert main(['bag', str(file), str(recording), '--mcap', str(tmp_path / 'm.mcap')]) == 0
    assert '76 changes of verdicts are not in copilot/violations' in capsys.readouterr().err


def test_a_time_after_2038_has_no_stamp(
        tmp_path: Path, bundle: Path, capsys: Capture) -> None:
    path = write(tmp_path / 'late', [('/level', 2**31 * SECOND - START, 0.7)])
    assert main(['bag', str(bundle), str(path)]) == 0
    assert main(['bag', str(bundle), str(path), '--mcap', str(tmp_path / 'm.mcap')]) == 1
    assert ('the time 2147483648.000000000 is too late for the stamp of a message, which ends in '
            '2038') in capsys.readouterr().err


def test_a_new_name_for_no_topic_is_refused(
        bundle: Path, recording: Path, capsys: Capture) -> None:
    arguments = ['bag', str(bundle), str(recording), '--remap']
    assert main([*arguments, 'levle:=/level']) == 1
    err = capsys.readouterr().err
    assert "error: --remap levle:=/level: the bundle has no topic 'levle'" in err
    assert "= help: did you mean 'level'?" in err
    assert main([*arguments, 'nope:=x']) == 1
    assert '= help: it has level' in capsys.readouterr().err
    assert main([*arguments, '/level:=level']) == 0
