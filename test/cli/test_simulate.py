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

"""`simulate`: reads a trace from a CSV file and writes a row of verdicts for each step."""

from collections import deque
import csv
from io import StringIO
import os
from pathlib import Path
import resource
import signal
import subprocess
import sys
import threading

from cli.command import command, environment, HEADING, Here, PUMP, run
import pytest

GOOD = '0,0,0,IDLE,stopped\n'


def verdicts(here: Here, trace: str | bytes, bundle: str = PUMP) -> list[list[str]]:
    """Simulate a valid trace, and return the rows of verdicts."""
    path = here.file('trace.csv', trace)
    done = here.run('simulate', here.file('pump.yaml', bundle), '--trace', path)
    assert (done.status, done.err) == (0, '')
    return list(csv.reader(StringIO(done.out)))


def column(here: Here, requirement: str, inputs: str, cells: list[str]) -> str:
    """Return the verdicts of one requirement over a trace of one input, as a string of 0 and 1."""
    bundle = f'format: 1\ninputs: {{{inputs}}}\n' \
             f'requirements: [{{id: R, ptltl: "{requirement}"}}]\n'
    name = inputs.split(':')[0]
    rows = verdicts(here, '\n'.join([name, *cells]) + '\n', bundle)
    return ''.join(row[1] for row in rows[1:])


def refused(here: Here, trace: str | bytes) -> str:
    """Return the error for a trace; an existing file of verdicts must stay unchanged."""
    bundle, path = here.file('pump.yaml', PUMP), here.file('trace.csv', trace)
    former = here.file('verdicts.csv', 'former\n')
    done = here.run('simulate', bundle, '--trace', path, '--verdicts', former)
    assert (done.status, done.out) == (1, '')
    assert former.read_text() == 'former\n'
    new = here.folder / 'new.csv'
    assert here.run('simulate', bundle, '--trace', path, '--verdicts', new) == done
    assert sorted(os.listdir(here.folder)) == ['pump.yaml', 'trace.csv', 'verdicts.csv']
    return done.err.replace(str(path), 'trace.csv')


# -- output -----------------------------------------------------------------------------------


def test_each_step_is_a_row_with_the_ids_in_the_order_of_the_bundle(here: Here) -> None:
    rows = GOOD + '1,0.5,5,LANDING,stopped\n0,0,-128,7,moving\n'
    trace = here.file('trace.csv', HEADING + rows)
    done = here.run('simulate', here.file('pump.yaml', PUMP), '--trace', trace)
    assert done.out == 'step,R-1,"R,2","R""3"\n0,0,1,1\n1,1,0,0\n2,0,1,1\n'
    assert (done.status, done.err) == (0, '')


def test_columns_may_have_any_order_and_other_columns_are_ignored(here: Here) -> None:
    trace = 'time,word,mode,time,n,x,p\n10:00,moving,0,?,4,.2,0\n,stopped,7,"a,b",5,0,0\n'
    assert verdicts(here, trace)[1:] == [['0', '1', '1', '1'], ['1', '0', '1', '0']]


def test_a_file_of_verdicts_has_what_standard_output_would_have(here: Here) -> None:
    bundle, trace = here.file('pump.yaml', PUMP), here.file('trace.csv', HEADING + GOOD)
    out = here.folder / 'out.csv'
    done = here.run('simulate', bundle, '--trace', trace, '--verdicts', out)
    assert out.read_text() == here.run('simulate', bundle, '--trace', trace).out
    assert done.out == '1 step\nR-1: violated at 1 step\nR,2: satisfied\nR"3: satisfied\n'
    assert out.stat().st_mode & 0o777 == trace.stat().st_mode & 0o777
    assert sorted(os.listdir(here.folder)) == ['out.csv', 'pump.yaml', 'trace.csv']


def test_under_timed_the_summary_counts_rows(here: Here) -> None:
    bundle = here.file('timed.yaml', 'format: 1\nevaluation: {policy: timed}\n'
                       'inputs: {p: {type: bool}}\nrequirements: [{id: R, ptltl: p}]\n')
    trace = here.file('trace.csv', 'time,p\n0,1\n1,0\n2,0\n')
    done = here.run('simulate', bundle, '--trace', trace, '--verdicts', here.folder / 'out.csv')
    assert done.out == '3 rows\nR: violated first at 1 s, at 2 rows\n'


def test_a_trace_without_rows_gives_no_verdicts(here: Here) -> None:
    assert verdicts(here, HEADING) == [['step', 'R-1', 'R,2', 'R"3']]
    assert verdicts(here, HEADING.rstrip()) == [['step', 'R-1', 'R,2', 'R"3']]


def test_without_rows_no_requirement_is_evaluated(here: Here) -> None:
    bundle, trace = here.file('pump.yaml', PUMP), here.file('trace.csv', HEADING)
    done = here.run('simulate', bundle, '--trace', trace, '--verdicts', here.folder / 'out.csv',
                    '--fail-on-violation')
    assert done.out == '0 steps\nR-1: not judged\nR,2: not judged\nR"3: not judged\n'
    assert (done.status, done.err) == (0, '')


@pytest.mark.parametrize('policy', [
    'every_message', 'relevant_message', 'all_inputs', '{policy: periodic, period: 0.1}'])
def test_a_row_is_a_step_under_every_policy(here: Here, policy: str) -> None:
    evaluation = policy if policy.startswith('{') else f'{{policy: {policy}}}'
    bundle = PUMP + f'  - {{id: R-4, ptltl: "p S[2,2] x > 0"}}\nevaluation: {evaluation}\n'
    trace = HEADING + '1,1,0,0,moving\n' * 3 + '0,0,0,0,moving\n' * 2
    rows = verdicts(here, trace, bundle)
    assert [row[0] for row in rows[1:]] == ['0', '1', '2', '3', '4']
    assert [row[4] for row in rows[1:]] == ['0', '0', '1', '0', '0']


def test_violations_make_it_fail_only_if_requested(here: Here) -> None:
    bundle = here.file('pump.yaml', PUMP)
    bad, good = here.file('bad.csv', HEADING + GOOD), here.file('good.csv', HEADING + '1,1,1,0,'
                                                                'stopped\n')
    for trace, status in ((bad, 1), (good, 0)):
        plain = here.run('simulate', bundle, '--trace', trace)
        strict = here.run('simulate', bundle, '--trace', trace, '--fail-on-violation')
        assert (plain.status, strict.status) == (0, status)
        assert strict.out == plain.out


# -- cells ------------------------------------------------------------------------------------


def test_booleans_are_written_in_four_ways(here: Here) -> None:
    assert column(here, 'p', 'p: {type: bool}', ['0', '1', 'true', 'false', 'True', ' 1 ']) \
        == '011011'


@pytest.mark.parametrize('kind', ['float32', 'float64'])
def test_numbers_that_are_not_finite_are_ieee_numbers(here: Here, kind: str) -> None:
    cells = ['nan', 'inf', '-inf', 'NaN', '-nan', '+Inf', '-0.0', '0', '1e400']
    inputs = f'x: {{type: {kind}}}'
    assert column(here, 'x > 0', inputs, cells) == '010001001'
    assert column(here, 'x = x', inputs, cells) == '011001111'
    assert column(here, '1 / x < 0', inputs, cells) == '000000100'


def test_a_float32_is_rounded_once(here: Here) -> None:
    # Just above the middle between 1 and the next float32: rounded to float64 first it would be
    # the middle, and then become 1.
    cells = ['1.000000059604644775390625000000000000001', '1.000000059604644775390625']
    assert column(here, 'x = 1.00000011920928955078125', 'x: {type: float32}', cells) == '10'
    assert column(here, 'x = 0.1', 'x: {type: float32}', ['0.1', '0.100000001', '.1e0']) == '111'


def test_integers_have_their_whole_range(here: Here) -> None:
    for bits in (8, 16, 32, 64):
        low, high = -2 ** (bits - 1), 2 ** (bits - 1) - 1
        assert column(here, f'x = {low} | x = {high}', f'x: {{type: int{bits}}}',
                      [f'{low}', f'{high}', '+1', '-0']) == '1100'
        assert column(here, f'x = {2 ** bits - 1}', f'x: {{type: uint{bits}}}',
                      [f'{2 ** bits - 1}', '007']) == '10'


def test_names_and_numbers_are_interchangeable_except_for_strings(here: Here) -> None:
    rows = verdicts(here, HEADING + '1,0,0,IDLE,moving\n1,0,0,0,moving\n1,0,0, LANDING ,stopped\n')
    assert [row[2] for row in rows[1:]] == ['1', '1', '1']
    assert 'is no value' in refused(here, HEADING + '1,0,0,0,1\n')
    assert "write 'stopped', 'moving'" in refused(here, HEADING + '1,0,0,0,go\n')


@pytest.mark.parametrize('trace', [
    HEADING.encode() + b'1,0,0,0,moving\n0,0,0,0,moving\n',
    b'p,x,n,mode,word\r\n1,0,0,0,moving\r\n0,0,0,0,moving\r\n',
    b'\xef\xbb\xbfp,x,n,mode,word\n1,0,0,0,moving\n0,0,0,0,moving',
    b'"p","x","n","mode","word"\n"1","0","0","IDLE","moving"\n"0","0","0","0","moving"\n',
    b' p , x , n , mode , word \n 1 , 0 , 0 , 0 , moving \n 0 , 0 , 0 , 0 , moving \n',
    b'p,x,n,mode,word,"a ""note"""\n1,0,0,0,moving,"two\nlines"\n0,0,0,0,moving,"\xc3\xa4, b"\n',
    b'p,x,n,mode,word\n1,0,0,0,moving\n0,0,0,0,moving\n\n\n',
], ids=['plain', 'CRLF', 'BOM', 'quoted', 'blanks', 'notes', 'empty lines behind'])
def test_csv_is_read_as_spreadsheets_write_it(here: Here, trace: bytes) -> None:
    assert verdicts(here, trace)[1:] == [['0', '1', '1', '1'], ['1', '0', '1', '1']]


@pytest.mark.parametrize(('trace', 'separator'), [
    ((HEADING + GOOD).replace(',', ';'), "';'"), ((HEADING + GOOD).replace(',', '\t'), 'tabs'),
    ('"p";"x";"n";"mode";"word"\n' + GOOD.replace(',', ';'), "';'"),
    (HEADING + GOOD.replace(',', '|'), "'|'")])
def test_another_separator_is_refused_by_name(here: Here, trace: str, separator: str) -> None:
    here.file('trace.csv', trace)
    done = here.run('simulate', here.file('pump.yaml', PUMP), '--trace',
                    here.folder / 'trace.csv')
    assert done.status == 1
    assert (f'help: cells are separated by commas here, not by {separator}: export the trace '
            'with commas') in done.err


# -- errors -----------------------------------------------------------------------------------


@pytest.mark.parametrize(('trace', 'expected'), [
    ('', "trace.csv:1:1: error: the trace has no column for 'p', 'x', 'n', 'mode', 'word'"),
    ('\n' + HEADING, 'trace.csv:1:1: error: empty row'),
    ('p,x,n,Mode,word\n' + GOOD, "trace.csv:1:1: error: the trace has no column for 'mode'"),
    ('p,x,n,mode,word,p\n', "trace.csv:1:1: error: the trace has two columns for 'p'"),
    (HEADING + GOOD + '0,0,0,0\n',
     'trace.csv:3:1: error: 4 cells in a row of a trace with 5 columns'),
    (HEADING + GOOD + '0,0,0,0,moving,1\n',
     'trace.csv:3:1: error: 6 cells in a row of a trace with 5 columns'),
    (HEADING + GOOD + '\n' + GOOD, 'trace.csv:3:1: error: empty row'),
    (HEADING + '0,,0,0,moving\n', "trace.csv:2:3: error: empty cell for 'x'"),
    (HEADING + '0, ,0,0,moving\n', "trace.csv:2:3: error: empty cell for 'x'"),
    (HEADING + '0,0,0,0,""\n', "trace.csv:2:9: error: empty cell for 'word'"),
    (HEADING + GOOD * 5000 + '0,fast,0,0,moving\n',
     "trace.csv:5002:3: error: 'fast' is no value of 'x'"),
    (HEADING + '2,0,0,0,moving\n', "trace.csv:2:1: error: '2' is no value of 'p'"),
    (HEADING + '1.0,0,0,0,moving\n', "trace.csv:2:1: error: '1.0' is no value of 'p'"),
    (HEADING + '0,1_0,0,0,moving\n', "trace.csv:2:3: error: '1_0' is no value of 'x'"),
    (HEADING + '0,0x10,0,0,moving\n', "trace.csv:2:3: error: '0x10' is no value of 'x'"),
    (HEADING + '0,infinity,0,0,moving\n', "trace.csv:2:3: error: 'infinity' is no value of 'x'"),
    (HEADING + '0,"1,5",0,0,moving\n', "error: '1,5' is no value of 'x'"),
    (HEADING + '0,0,128,0,moving\n', "trace.csv:2:5: error: '128' is no value of 'n'"),
    (HEADING + '0,0,-129,0,moving\n', "trace.csv:2:5: error: '-129' is no value of 'n'"),
    (HEADING + '0,0,1.0,0,moving\n', "trace.csv:2:5: error: '1.0' is no value of 'n'"),
    (HEADING + '0,0,nan,0,moving\n', "trace.csv:2:5: error: 'nan' is no value of 'n'"),
    (HEADING + '0,0,\N{ARABIC-INDIC DIGIT ONE},0,moving\n', "is no value of 'n'"),
    (HEADING + '0,0,' + '9' * 10_000 + ',0,moving\n', "trace.csv:2:5: error: '9999"),
    (HEADING + '0,0,0,-1,moving\n', "trace.csv:2:7: error: '-1' is no value of 'mode'"),
    (HEADING + '0,0,0,idle,moving\n', "trace.csv:2:7: error: 'idle' is no value of 'mode'"),
    (HEADING + '0,0,0,0,moving\x00\n', "is no value of 'word'"),
    (HEADING + '0,0,\x00,0,moving\n', "is no value of 'n'"),
    (HEADING + '0,0,0,0,"moving\n', 'trace.csv:2:1: error: not CSV: unexpected end of data'),
    (HEADING + '0,0,0,0,"mov"ing\n', 'trace.csv:2:1: error: not CSV:'),
    (HEADING + '0,0,0,0,' + 'm' * 200_000 + '\n', "trace.csv:2:9: error: 'mmmm"),
], ids=range(30))
def test_an_invalid_trace_is_refused_with_the_place(
        here: Here, trace: str, expected: str) -> None:
    said = refused(here, trace)
    assert expected in said
    assert len(said) < 1000


@pytest.mark.parametrize(('trace', 'place'), [
    (HEADING.encode() + b'0,0,0,0,\xff\n', '2:9'), ('p,x'.encode('utf-16'), '1:1'),
    (HEADING.encode() + b'0,0,0,0,"\n\xe2', '3:1'), (bytes(range(14, 256)), '1:115')],
    ids=['Latin-1', 'UTF-16', 'cut off', 'noise'])
def test_a_trace_that_is_not_text_is_refused(here: Here, trace: bytes, place: str) -> None:
    assert f'trace.csv:{place}: error: not text in UTF-8' in refused(here, trace)


def test_a_column_with_a_name_close_to_a_missing_one_is_suggested(here: Here) -> None:
    said = refused(here, 'p,x,n,Mode,word\n')
    assert said.splitlines()[1:3] == [' 1 | p,x,n,Mode,word', '   | ^^^^^^^^^^^^^^^']
    assert "help: the column 'Mode' is close to 'mode'" in said


def test_a_wrong_cell_is_underlined(here: Here) -> None:
    assert refused(here, HEADING + GOOD + '1,2,x3,4,moving\n').splitlines() == [
        "trace.csv:3:5: error: 'x3' is no value of 'n'",
        ' 3 | 1,2,x3,4,moving',
        '   |     ^^',
        '    = help: write a whole number (int8)',
    ]


@pytest.mark.parametrize('rows', [1, 100])  # a few are read in Python, many in C
def test_the_verdicts_of_the_rows_before_a_wrong_cell_are_printed(here: Here, rows: int) -> None:
    trace = here.file('trace.csv', HEADING + GOOD * rows + '0,0,0,IDLE,\n' + GOOD)
    done = here.run('simulate', here.file('pump.yaml', PUMP), '--trace', trace)
    assert done.status == 1
    assert done.out.splitlines()[1:] == [f'{step},0,1,1' for step in range(rows)]
    assert f'trace.csv:{rows + 2}:' in done.err


@pytest.mark.parametrize('rest', ['', '\n', '\n0,0,0,0,moving\n\n'])
def test_an_unclosed_quote_is_shown_where_its_row_begins(here: Here, rest: str) -> None:
    assert refused(here, HEADING + GOOD + '1,"2' + rest).splitlines() == [
        'trace.csv:3:1: error: not CSV: unexpected end of data',
        ' 3 | 1,"2',
        '   | ^^^^',
        '    = help: a quote (") in this row is not closed',
    ]


def test_a_quote_within_a_cell_is_shown_with_its_line(here: Here) -> None:
    said = refused(here, HEADING + GOOD + '0,0,0,0,"mov\n"ing\n' + GOOD)
    assert said.startswith('trace.csv:4:1: error: not CSV: ')
    assert said.splitlines()[1:3] == [' 4 | "ing', '   | ^^^^']


def test_a_long_cell_of_an_unused_column_is_accepted(here: Here) -> None:
    long = 'm' * 1_000_000
    trace = f'p,x,n,mode,word,{long}\n1,0,0,0,moving,{long}\n0,0,0,0,moving,"{long}\n"\n'
    assert verdicts(here, trace)[1:] == [['0', '1', '1', '1'], ['1', '0', '1', '1']]


def test_an_endless_line_is_refused_without_filling_the_memory(here: Here) -> None:
    bundle = here.file('pump.yaml', PUMP)
    done = subprocess.run(
        [sys.executable, '-c', PEAK, 'simulate', bundle, '--trace', '/dev/zero'],
        env=environment(), capture_output=True, text=True, check=False, timeout=60,
        preexec_fn=limited)
    said, _, peak = done.stderr.rstrip('\n').rpartition('\n')
    assert (done.returncode, done.stdout) == (1, '')
    assert said.startswith('/dev/zero:1:1: error: a row of more than 16,777,216 characters\n')
    assert len(said) < 1000
    assert int(peak) < 300 * 1024


def limited() -> None:
    """Limit the memory, so that the process fails instead of filling the machine."""
    resource.setrlimit(resource.RLIMIT_AS, (2 ** 30, 2 ** 30))


def test_a_place_after_a_cell_of_several_lines_is_correct(here: Here) -> None:
    said = refused(here, 'p,x,n,mode,word,note\n0,0,0,0,moving,"a\nb"\n0,0,0,0,moving,\n2,,,,,\n')
    assert said.startswith("trace.csv:5:1: error: '2' is no value of 'p'")


def test_files_that_cannot_be_read_or_written_are_reported(here: Here) -> None:
    bundle, trace = here.file('pump.yaml', PUMP), here.file('trace.csv', HEADING + GOOD)
    gone, long = here.folder / 'gone.csv', here.folder / ('x' * 300)
    for arguments, expected in [
        (('--trace', gone), f"there is no file '{gone}'"),
        (('--trace', here.folder), f"'{here.folder}': Is a directory"),
        (('--trace', long), 'File name too long'),
        (('--trace', trace / 'x'), 'Not a directory'),
        (('--trace', trace, '--verdicts', here.folder), f"'{here.folder}': Is a directory"),
        (('--trace', trace, '--verdicts', long), 'File name too long'),
        (('--trace', trace, '--verdicts', here.folder / 'no' / 'v.csv'), f"{here.folder / 'no'}"),
        (('--trace', trace, '--verdicts', trace / 'v.csv'), 'Not a directory'),
        (('--trace', trace, '--verdicts', trace), 'this command reads it'),
        (('--trace', trace, '--verdicts', here.folder / '..' / here.folder.name / 'trace.csv'),
         'this command reads it as'),
    ]:
        done = here.run('simulate', bundle, *arguments)
        assert (done.status, done.out) == (1, ''), arguments
        assert done.err.startswith('error: '), arguments
        assert expected in done.err, arguments
    assert trace.read_text() == HEADING + GOOD
    assert sorted(os.listdir(here.folder)) == ['pump.yaml', 'trace.csv']


def test_verdicts_do_not_overwrite_an_input_file(here: Here) -> None:
    signals = here.file('signals.yaml', 'inputs: {spare: {type: bool}}\n')
    trace = here.file('trace.csv', 'spare,' + HEADING + '0,' + GOOD)
    bundle = here.file('pump.yaml', PUMP + 'signals: signals.yaml\n')
    (here.folder / 'link.csv').symlink_to('pump.yaml')
    (here.folder / 'hard.csv').hardlink_to(signals)
    before = {path: path.read_text() for path in here.folder.iterdir()}
    for _ in range(2):  # the second start finds the bundle in the cache
        for out in (bundle, signals, trace, here.folder / 'link.csv', here.folder / 'hard.csv',
                    here.folder / '..' / here.folder.name / 'signals.yaml'):
            done = here.run('simulate', bundle, '--trace', trace, '--verdicts', out)
            assert (done.status, done.out) == (1, '')
            assert done.err.startswith(f"error: cannot write '{out}': this command reads it")
            assert {path: path.read_text() for path in here.folder.iterdir()} == before
        assert here.run('simulate', bundle, '--trace', trace).status == 0


def test_a_missing_output_folder_is_not_reported_as_a_missing_trace(here: Here) -> None:
    bundle, trace = here.file('pump.yaml', PUMP), here.file('trace.csv', HEADING + GOOD)
    out = here.folder / 'no' / 'v.csv'
    done = here.run('simulate', bundle, '--trace', trace, '--verdicts', out)
    assert done.err == f"error: cannot write '{out}': No such file or directory\n"


# -- pipes, devices and large files -----------------------------------------------------------


@pytest.fixture(scope='module')
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a bundle and long traces, in which all rows of verdicts differ."""
    folder = tmp_path_factory.mktemp('large')
    requirements = [f'{{id: R-{bit}, ptltl: "n mod {2 ** (bit + 1)} < {2 ** bit}"}}'
                    for bit in range(20)]
    (folder / 'many.yaml').write_text(
        f'format: 1\ninputs: {{n: {{type: int32}}}}\nrequirements: [{", ".join(requirements)}]\n')
    for count in (50_000, 250_000):
        numbers = '\n'.join(map(str, range(count)))
        (folder / f'{count}.csv').write_text(f'n\n{numbers}\n')
    return folder


# Not ru_maxrss: a process takes over the one of the process that forked it.
PEAK = """
import sys
from pathlib import Path
from fret_monitor.cli.main import main
status = main(sys.argv[1:])
[peak] = [line.split()[1] for line in Path('/proc/self/status').read_text().splitlines()
          if line.startswith('VmHWM:')]
print(peak, file=sys.stderr)
sys.exit(status)
"""


def peak_kilobytes(folder: Path, steps: int) -> int:
    """Simulate that many rows to a file and return the peak memory."""
    out = folder / f'verdicts-{steps}.csv'
    done = subprocess.run(
        [sys.executable, '-c', PEAK, 'simulate', folder / 'many.yaml', '--trace',
         folder / f'{steps}.csv', '--verdicts', out],
        env=environment(), capture_output=True, text=True, check=True)
    assert done.stdout.startswith(f'{steps:,} steps\n')
    with out.open() as file:
        last = deque(file, 1).pop()
    assert last.startswith(f'{steps - 1},')
    out.unlink()
    return int(done.stderr)


def test_many_rows_need_no_more_memory_than_few(files: Path) -> None:
    few = peak_kilobytes(files, 50_000)
    many = peak_kilobytes(files, 250_000)
    assert many - few < 4 * 1024, f'{few} and {many} kB'  # 10 bytes a row


def test_a_reader_that_closes_the_pipe_is_no_error(files: Path) -> None:
    process = subprocess.Popen(
        command('simulate', files / 'many.yaml', '--trace', files / '50000.csv'),
        env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None and process.stderr is not None
    assert process.stdout.readline().startswith('step,R-0,')
    process.stdout.close()
    said = process.stderr.read()
    process.stderr.close()
    assert process.wait() in (0, 1)
    assert said == ''


def test_verdicts_can_be_written_to_a_pipe_or_device(here: Here) -> None:
    bundle, trace = here.file('pump.yaml', PUMP), here.file('trace.csv', HEADING + GOOD)
    pipe = here.folder / 'pipe'
    os.mkfifo(pipe)
    found: list[str] = []
    reader = threading.Thread(target=lambda: found.append(pipe.read_text()))
    reader.start()
    assert here.run('simulate', bundle, '--trace', trace, '--verdicts', pipe).status == 0
    reader.join(30)
    assert found == ['step,R-1,"R,2","R""3"\n0,0,1,1\n']
    assert pipe.is_fifo()
    done = here.run('simulate', bundle, '--trace', trace, '--verdicts', '/dev/null')
    assert (done.status, done.err) == (0, '')
    assert Path('/dev/null').is_char_device()


def test_a_named_pipe_whose_reader_closes_it_is_no_error(files: Path, here: Here) -> None:
    pipe = here.folder / 'pipe'
    os.mkfifo(pipe)
    process = subprocess.Popen(
        command('simulate', files / 'many.yaml', '--trace', files / '50000.csv', '--verdicts',
                pipe),
        env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    with pipe.open() as reader:
        assert reader.readline().startswith('step,R-0,')
    assert process.communicate(timeout=60) == ('', '')
    assert process.returncode == 1


def test_a_trace_can_be_read_from_a_pipe(here: Here) -> None:
    done = run('simulate', here.file('pump.yaml', PUMP), '--trace', '/dev/stdin',
               stdin=HEADING + GOOD)
    assert (done.status, done.out) == (0, 'step,R-1,"R,2","R""3"\n0,0,1,1\n')


def test_a_full_disk_is_reported_and_leaves_no_file(here: Here) -> None:
    bundle = here.file('pump.yaml', PUMP)
    trace = here.file('trace.csv', HEADING + GOOD * 20_000)
    out = here.folder / 'out.csv'
    done = subprocess.run(
        command('simulate', bundle, '--trace', trace, '--verdicts', out), env=environment(),
        capture_output=True, text=True, check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000)))
    assert done.returncode == 1
    assert done.stderr.startswith('error: cannot ')
    assert done.stderr.count('\n') == 1
    assert sorted(os.listdir(here.folder)) == ['pump.yaml', 'trace.csv']


@pytest.mark.skipif(not Path('/dev/full').exists(), reason='needs /dev/full')
def test_a_full_output_device_is_reported(here: Here) -> None:
    bundle, trace = here.file('pump.yaml', PUMP), here.file('trace.csv', HEADING + GOOD)
    for arguments in (('simulate', bundle, '--trace', trace), ('check', bundle)):
        with Path('/dev/full').open('w') as full:
            done = subprocess.run(command(*arguments), env=environment(), stdout=full,
                                  stderr=subprocess.PIPE, text=True, check=False)
        assert done.returncode == 1
        assert done.stderr == 'error: cannot write to standard output: No space left on device\n'


def test_an_interrupt_leaves_no_file_and_no_traceback(here: Here) -> None:
    bundle, out, pipe = here.file('pump.yaml', PUMP), here.folder / 'out.csv', here.folder / 'pipe'
    os.mkfifo(pipe)
    process = subprocess.Popen(
        command('simulate', bundle, '--trace', pipe, '--verdicts', out), env=environment(),
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        # A shell lets background processes ignore SIGINT.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))
    with pipe.open('w') as writer:  # blocks until the reader opens the pipe
        writer.write(HEADING + GOOD * 20_000)
        writer.flush()
        process.send_signal(signal.SIGINT)
        said, err = process.communicate(timeout=60)
    assert (process.returncode, said, err) == (130, '', '')
    assert sorted(os.listdir(here.folder)) == ['pipe', 'pump.yaml']


def test_unusual_names_work_from_bundle_to_verdicts(here: Here) -> None:
    bundle = here.file('odd names *', """\
format: 1
inputs:
  '"a,b"': {type: bool}
  '"two words"': {type: bool}
  int: {type: int32}
  math_errhandling: {type: float32}
  a.b%c: {type: bool}
definitions:
  once_1: 'O[0,1] "a,b"'
requirements:
  - {id: "x, \\"y\\"", ptltl: 'once_1 & "two words"', title: "*/ ???/"}
  - {id: 日本, ptltl: 'int > 3 | math_errhandling > 0.5 | a.b%c', title: 'ends in \\'}
""")
    heading = '"a,b",two words,int,math_errhandling,a.b%c\n'
    trace = here.file('trace.csv', heading + '1,1,0,0,0\n0,1,4,0,0\n0,1,0,1,0\n0,0,0,0,1\n')
    done = here.run('simulate', bundle, '--trace', trace)
    assert (done.status, done.err) == (0, '')
    assert done.out == 'step,"x, ""y""",日本\n0,1,0\n1,1,1\n2,0,1\n3,0,1\n'
    done = here.run('compile', bundle, '--output', here.folder / 'out')
    assert (done.status, done.err) == (0, '')
    assert 'odd_names___monitor.c' in os.listdir(here.folder / 'out' / 'src')


def test_verdicts_are_not_written_through_a_link(here: Here) -> None:
    bundle, trace = here.file('pump.yaml', PUMP), here.file('trace.csv', HEADING + GOOD)
    link, place = here.folder / 'link.csv', here.folder / 'place.csv'
    link.symlink_to('place.csv')
    for content in ('', 'mine'):
        if content:
            place.write_text(content)
        done = here.run('simulate', bundle, '--trace', trace, '--verdicts', link)
        assert (done.status, done.out) == (1, '')
        assert done.err.startswith(f"error: cannot write '{link}': it is a link to 'place.csv'")
        assert (place.read_text() if content else place.exists()) == (content or False)
        assert link.is_symlink()


def test_verdicts_can_be_written_to_standard_output_in_a_file(here: Here) -> None:
    # /dev/stdout is a link, here to a regular file
    bundle, trace = here.file('pump.yaml', PUMP), here.file('trace.csv', HEADING + GOOD)
    with (here.folder / 'out.csv').open('w') as out:
        subprocess.run(command('simulate', bundle, '--trace', trace, '--verdicts', '/dev/stdout'),
                       stdout=out, check=True, env=environment())
    first, *_, last = (here.folder / 'out.csv').read_text().splitlines()
    assert first.startswith('step,') and last.startswith('R"3: ')


MOTOR = """format: 1
inputs:
  current: {type: float64, scale: 5}
  mode: {type: int32, values: {IDLE: 0, RUN: 1}}
requirements:
  - {id: LOW, ptltl: "H (mode = RUN -> current <= 20)"}
  - {id: IDLE, ptltl: "mode = IDLE"}
"""


def test_margins_have_the_deciding_comparison_its_distance_and_its_step(here: Here) -> None:
    bundle = here.file('motor.yaml', MOTOR)
    trace = here.file('trace.csv', 'mode,current\nIDLE,30\nRUN,15\nRUN,17.5\nRUN,22.5\n')
    table = here.folder / 'margins.csv'
    done = here.run('simulate', bundle, '--trace', trace, '--margins', table)
    assert (done.status, done.err) == (0, '')
    assert done.out == 'step,LOW,IDLE\n0,1,1\n1,1,0\n2,1,0\n3,0,0\n'
    assert table.read_text().splitlines() == [
        'step,requirement,margin,distance,comparison,inputs,at',
        '0,LOW,inf,,,,', '0,IDLE,inf,,,,',
        '1,LOW,1.0,5.0,current <= 20.0,current,1', '1,IDLE,-inf,,,,',
        '2,LOW,0.5,2.5,current <= 20.0,current,2', '2,IDLE,-inf,,,,',
        '3,LOW,-0.5,-2.5,current <= 20.0,current,3', '3,IDLE,-inf,,,,']


def test_margins_under_timed_have_rows_where_only_a_margin_changes(here: Here) -> None:
    bundle = here.file('timed.yaml', """format: 1
inputs: {x: {type: float64, max_rate: 10}}
evaluation: {policy: timed, unit: 1}
requirements: [{id: R, ptltl: "H[0,2] (x <= 5)"}]
""")
    trace = here.file('trace.csv', 'time,x\n0,4\n1,1\n3.5,6\n4,0\n')
    table = here.folder / 'margins.csv'
    done = here.run('simulate', bundle, '--trace', trace, '--margins', table, '--until', '5')
    assert (done.status, done.err) == (0, '')
    assert done.out == 'time,R\n0,1\n1,1\n3.5,0\n4,0\n'
    assert [line.split(',') for line in table.read_text().splitlines()[1:]] == [
        ['0', 'R', '1.0', '1.0', 'x <= 5.0', 'x', '0'],
        ['1', 'R', '1.0', '1.0', 'x <= 5.0', 'x', '0'],
        ['3', 'R', '4.0', '4.0', 'x <= 5.0', 'x', '1'],
        ['3.5', 'R', '-1.0', '-1.0', 'x <= 5.0', 'x', '3.5'],
        ['4', 'R', '-1.0', '-1.0', 'x <= 5.0', 'x', '3.5']]


def test_margins_under_timed_need_the_rates_of_what_is_in_a_window(here: Here) -> None:
    bundle = here.file('timed.yaml', """format: 1
inputs: {x: {type: float64}}
evaluation: {policy: timed, unit: 1}
requirements: [{id: R, ptltl: "H[0,2] (x <= 5)"}]
""")
    trace = here.file('trace.csv', 'time,x\n0,4\n')
    table = here.folder / 'margins.csv'
    done = here.run('simulate', bundle, '--trace', trace, '--margins', table)
    assert done.status == 1 and not table.exists()
    assert 'the margin of R looks back 2 s' in done.err
    assert 'write `max_rate: 100` (Hz) at x' in done.err
    assert here.run('simulate', bundle, '--trace', trace).status == 0


def test_margins_of_instances_have_their_keys(here: Here) -> None:
    bundle = here.file('robots.yaml', """format: 1
for_each: {robot: {most: 2}}
inputs:
  x: {topic: "/{robot}/x", type: std_msgs/msg/Float64, scale: 2}
  most: {topic: most, type: std_msgs/msg/Float64}
requirements:
  - {id: R, ptltl: "H (x <= most)"}
  - {id: MOST, ptltl: "most < 9.0"}
""")
    trace = here.file('trace.csv', 'robot,x,most\n"a,b",1,5\nc,7,\n,,2\n"a,b",0.5,\nd,1,\n')
    table = here.folder / 'margins.csv'
    done = here.run('simulate', bundle, '--trace', trace, '--margins', table)
    assert done.status == 0
    assert done.out == 'step,robot,R,MOST\n0,"a,b",1,1\n1,c,0,1\n2,,,1\n3,"a,b",1,1\n4,d,,1\n'
    assert table.read_text().splitlines() == [
        'step,robot,requirement,margin,distance,comparison,inputs,at',
        '0,"a,b",R,2.0,4.0,x <= most,x most,0', '0,"a,b",MOST,4.0,4.0,most < 9.0,most,0',
        '1,c,R,-1.0,-2.0,x <= most,x most,1', '1,c,MOST,4.0,4.0,most < 9.0,most,1',
        '2,,MOST,7.0,7.0,most < 9.0,most,2',
        '3,"a,b",R,0.5,1.0,x <= most,x most,2', '3,"a,b",MOST,7.0,7.0,most < 9.0,most,3',
        '4,d,MOST,7.0,7.0,most < 9.0,most,4']
