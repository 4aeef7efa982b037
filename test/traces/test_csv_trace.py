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

"""What C reads of a trace is what Python reads of it, rows before an error included."""

from array import array
from fractions import Fraction
from functools import cache
import io
from itertools import product
import math
from pathlib import Path
from random import Random
import struct
from typing import Any

from fret_monitor.model.diagnostics import CompileError
from fret_monitor.model.floats import to_float32
from fret_monitor.model.manifest import ManifestInput
from fret_monitor.model.values import ValueType
from fret_monitor.native import evaluator_library, load_evaluator
from fret_monitor.native.monitor import CData
from fret_monitor.runtime.csv_rows import CsvColumn, CsvRows, verdict_rows
from fret_monitor.traces import csv_trace
from fret_monitor.traces.csv_trace import seconds_text, TimeColumn, TraceReader
from hypothesis import given, settings
from hypothesis import strategies as st
import pytest
from strategies import thorough

ANY_TIME = (-2 ** 63, 2 ** 63 - 1)
NAMES = {'IDLE': 0, 'moving': 1, 'a,b': 2, 'né': 3, ' odd': 4, '': 5, '7': 6}
INPUTS = (
    ManifestInput('p', ValueType.BOOL, None, None, (), (), None),
    ManifestInput('n', ValueType.INT8, None, None, (), tuple(NAMES.items()), None),
    ManifestInput('u', ValueType.UINT64, None, None, (), (), None),
    ManifestInput('x', ValueType.FLOAT64, None, None, (), (), None),
    ManifestInput('f', ValueType.FLOAT32, None, None, (), (), None),
    ManifestInput('s', ValueType.INT32, None, None, (), (('on', 'on'), ('off', 'off')), None),
)
PLAIN = {'time': st.just('0'), 'p': st.sampled_from(['0', '1', 'True', 'false']),
         'n': st.sampled_from(['IDLE', '-128', '+7', 'né', '007', '7']),
         'u': st.sampled_from(['0', '18446744073709551615', '-0']),
         'x': st.floats().map(repr), 'f': st.floats(width=32).map(repr),
         's': st.sampled_from(['on', 'off']), 'note': st.sampled_from(['', 'x', 'a "b"'])}
ODD = st.one_of(
    st.sampled_from([
        '', ' ', '\t1 ', '"1"', '" 0 "', '"a,b"', '"1""', '""', '"0"x', '"', '"\n"', '"a""b"',
        '\r', 'a\rb', '\xa01', '1\u2003', '1_0', '0x1', '1e', 'e1', '.', '+', '.5', '5.', '1e999',
        '1e-999', '-nan', 'NaN', 'Infinity', 'inF', '+INF', '128', '-129', '256', '-1', '1.0',
        '18446744073709551616', '9' * 30, '0' * 70 + '1', '1' + '0' * 62, 'TRUE', 'yes', 'idle',
        'odd', ' odd', '\x00', '1\x00', '\ufeff', 'é', '\x1f1', '१', '-0.0', 'on ', '7']),
    st.decimals(allow_nan=False, allow_infinity=False).map(str), st.text(max_size=4))


ENDS = ('\n', '\r\n', '\r')


@cache
def library() -> CData:
    return load_evaluator(evaluator_library())


@st.composite
def tables(draw: st.DrawFn) -> str:
    """Return a trace, most cells of which are right."""
    names = draw(st.permutations(list(PLAIN)))
    rows = [list(names)]
    now = draw(st.sampled_from([0, -3, 2 ** 62 - 5]))
    for _ in range(draw(st.integers(0, 8))):
        now += draw(st.sampled_from([1, 10, 10 ** 9]))
        rows.append([seconds_text(now) if name == 'time' else draw(PLAIN[name])
                     for name in names])
    for _ in range(draw(st.integers(0, 2))):
        row = draw(st.sampled_from(rows[1:] or [[]]))
        if row:
            row[draw(st.integers(0, len(row) - 1))] = draw(ODD)
    for row in rows[1:]:
        if draw(st.integers(0, 20)) == 0:
            row.append('1')
    end = draw(st.sampled_from(['\n', '\n', '\r\n', '\r']))
    last = draw(st.sampled_from([end, end, '', end * 2]))
    return draw(st.sampled_from(['', '', '\ufeff'])) + end.join(map(','.join, rows)) + last


def found(text: str, time: TimeColumn, native: CData | None) -> list[Any]:
    """Return all rows of a trace, and the error after them."""
    result: list[Any] = []
    try:
        reader = TraceReader('t.csv', io.BytesIO(text.encode()), INPUTS, time, native)
        for times, columns in reader.blocks():
            result += zip(times, *(map(repr, column or []) for column in columns), strict=True)
        result.append(reader.first)
    except CompileError as error:
        result.append(str(error))
    return result


@settings(max_examples=150, deadline=None)
@given(tables(), st.sampled_from([TimeColumn.REQUIRED, TimeColumn.IGNORED]),
       st.sampled_from([7, 1 << 20]))
def test_rows_and_errors_are_those_that_python_reads(
        text: str, time: TimeColumn, size: int) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(csv_trace, '_READ_BYTES', size)
        assert found(text, time, library()) == found(text, time, None)


@settings(max_examples=100, deadline=None)
@given(tables(), st.sampled_from([TimeColumn.REQUIRED, TimeColumn.IGNORED]))
def test_the_spans_are_those_that_python_reads(text: str, time: TimeColumn) -> None:
    def spans(native: CData | None) -> tuple[int, object, object, str]:
        count, times, problem = 0, [], ''
        try:
            reader = TraceReader('t.csv', io.BytesIO(text.encode()), (), time, native)
            for number, first, last in reader.spans():
                count += number
                times += [first, last]
        except CompileError as error:
            problem = str(error)
        known = [item for item in times if item is not None]
        return count, known[:1], known[-1:], problem
    assert spans(library()) == spans(None)


def plain(cells: list[str], kind: ValueType) -> 'array[Any]':
    """Return what C reads of a column, without the rows after the first that is not plain."""
    text = ''.join(f'{cell}\n' for cell in cells).encode()
    rows = CsvRows(library(), [CsvColumn(0, kind, {})], 1)
    count, place, columns = rows.read(text, 0, len(cells), *ANY_TIME)
    column: array[Any] = columns[0]
    assert len(column) == count
    assert place == sum(len(cell.encode()) + 1 for cell in cells[:count])
    return column


def near_ties(rng: Random) -> list[str]:
    """Return decimals at and beside the middle of two float32 and of two float64."""
    cells = []
    for _ in range(2000):
        single = abs(to_float32(rng.uniform(1, 2) * 10.0 ** rng.randint(-37, 37)))
        bits, = struct.unpack('<I', struct.pack('<f', single))
        after, = struct.unpack('<f', struct.pack('<I', bits + 1))
        middle = (single + after) / 2
        double = rng.uniform(1, 2) * 10.0 ** rng.randint(-20, 20)
        exact = (Fraction(double) + Fraction(math.nextafter(double, math.inf))) / 2
        for value in (middle, math.nextafter(middle, 0), math.nextafter(middle, math.inf)):
            cells.append(repr(value))
        for digits in (15, 17, 19, 25, 40):
            cells += [f'{middle:.{digits}e}', f'{float(exact):.{digits}e}']
        cells.append(str(rng.randint(0, 2 ** 54)) + rng.choice(['', 'e5', 'e22', 'e-22', '.25']))
        cells.append(f'-{rng.randint(0, 2 ** 25)}e{rng.randint(-11, 11)}')
    return cells


def test_decimals_are_rounded_once() -> None:
    cells = near_ties(Random(1))
    cells += ['1.00000005960464477539062500001', '4.9e-324', '2.4703282292062327e-324',
              '1.7976931348623159e308', '3.4028235677973366e38', '7.006492321624085e-46', '1e-50',
              '16777217', '9007199254740993', '1e22', '1e23', '123456789012345678901', '1e400']
    for kind, exact in ((ValueType.FLOAT64, float), (ValueType.FLOAT32, rounded_to_float32)):
        assert list(plain(cells, kind)) == [exact(cell) for cell in cells]


def rounded_to_float32(cell: str) -> float:
    return to_float32(Fraction(cell))


@pytest.mark.parametrize('kind', [item for item in ValueType if item.is_integer])
def test_integers_of_the_whole_range_are_plain_and_no_others(kind: ValueType) -> None:
    least, most = kind.limits
    cells = [str(least), str(most), f'+{most}', f'000{most}', '0', '-0']
    assert list(plain(cells, kind)) == [int(cell) for cell in cells]
    for cell in (str(least - 1), str(most + 1), '-' + '9' * 25, '1.0', '', '+', '1e3'):
        assert not plain([cell], kind), cell


def test_times_are_exact_to_the_nanosecond() -> None:
    rng = Random(2)
    times = sorted({rng.randint(-2 ** 62, 2 ** 62) // 10 ** rng.randint(0, 19)
                    for _ in range(3000)} | {-2 ** 62, 0, 2 ** 62})
    text = ''.join(f'{seconds_text(time)}\n' for time in times).encode()
    rows = CsvRows(library(), [CsvColumn(0, ValueType.INT64, {}, is_time=True)], 1)
    assert rows.read(text, 0, len(times), *ANY_TIME) == (
        len(times), len(text), [array('q', times)])
    assert rows.read(text, 0, len(times), *(times[0], times[9]))[0] == 0
    assert rows.read(text, 0, len(times), *(times[0] - 1, times[9]))[0] == 10
    for wrong in ('4611686018.427387905', '9999999999', '1e3', '.5', '', '0.0000000001', 'nan'):
        assert rows.read(f'{wrong}\n'.encode(), 0, 1, *ANY_TIME)[0] == 0, wrong


def test_verdicts_are_written_as_labels_and_flags() -> None:
    rng = Random(3)
    labels = array('q', [0, -1, 1, 10 ** 9, -10 ** 9 - 1, 2 ** 63 - 1, -2 ** 63, *(
        rng.randint(-2 ** 63, 2 ** 63 - 1) // 10 ** rng.randint(0, 19) for _ in range(500))])
    for width in (0, 1, 5):
        verdicts = bytes(rng.randint(0, 1) for _ in range(width * len(labels)))
        flags = [''.join(f',{flag}' for flag in verdicts[width * k:width * (k + 1)])
                 for k in range(len(labels))]
        for are_times, shown in ((False, str), (True, seconds_text)):
            assert verdict_rows(library(), labels, verdicts, width, are_times=are_times) == \
                ''.join(f'{shown(label)}{flag}\n' for label, flag in zip(labels, flags))


def test_a_trace_of_odd_rows_is_read_in_large_blocks(tmp_path: Path) -> None:
    text = 'p,n,u,x,f,s,note\n' + '1,0,0,1,1,on,"a\nb"\n1,0,0,1,1,on,\n' * 3000
    reader = TraceReader('t.csv', io.BytesIO(text.encode()), INPUTS, library=library())
    sizes = [len(times) for times, _ in reader.blocks()]
    assert sum(sizes) == 6000
    assert len(sizes) < 40


@pytest.mark.parametrize('is_in_c', [False, True])
@pytest.mark.parametrize(('rows', 'wrong', 'end'), [
    *product((0, 1), [b'\xff\n'], ENDS),
    *product([90], [b'1,\xe2\n', b'"1",M\xe9\n', b'"\n1\xc0'], ENDS),
    (300_000, b'1\xff', '\n'),
    *(pytest.param(300_000, b'1\xff', end, marks=thorough) for end in ENDS[1:])])
def test_rows_before_one_that_is_not_text_are_read(
        is_in_c: bool, rows: int, wrong: bytes, end: str) -> None:
    text = f'x,y{end}' + f'7,0{end}' * rows
    inputs = [ManifestInput('x', ValueType.INT32, None, None, (), (), None)]
    reader = TraceReader('t.csv', io.BytesIO(text.encode() + wrong), inputs,
                         library=library() if is_in_c else None)
    count = 0
    line = rows + 2 + wrong.startswith(b'"\n')
    with pytest.raises(CompileError, match=rf'^t\.csv:{line}:[0-9]+: error: not text in UTF-8'):
        for times, _ in reader.blocks():
            count += len(times)
    assert count == rows
