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

"""Texts of users in comments of C: readable, within their lines, and never code."""

from dataclasses import replace
from pathlib import Path
from time import process_time
import unicodedata

from codegen.workbench import assert_clean_and_right, specify
from differential.compiled import compile_c, gcc, WARNINGS
from fret_monitor.codegen.comments import comment, safe
from fret_monitor.codegen.inputs import meaning
from fret_monitor.logic.formula import FALSE, Formula, Once, Variable, Window
from fret_monitor.model.manifest import ManifestInput
from fret_monitor.model.values import ValueType
from hypothesis import given, settings
from hypothesis import strategies as st
import pytest
from strategies import EXAMPLES

HOSTILE = [
    '*/ int x; /*', '/* never closed', 'ends in a backslash \\', 'a trigraph ??/', '???/', '????/',
    '??' * 50 + '/', '??\n/', 'line\nbreak', 'carriage\rreturn', 'a\x0bb\x0cc', 'next\x85line',
    'line\u2028separator\u2029s', '"quoted" and \'quoted\'', '%s%n%d', 'nul\x00byte',
    '\x1b[31mred',
    '\N{RIGHT-TO-LEFT OVERRIDE}txet', '\N{LEFT-TO-RIGHT ISOLATE}x', 'ש\u0631', '日本語', 'é' * 400,
    'x' * 5000, 'a \\ b ' * 100, '#include <x>', '#error no', '\ud800', '/' * 300, '/*' * 100,
    '*' * 95 + '/', 'x' * 88 + ' \\', '\\' * 500, '\N{ZERO WIDTH SPACE}', '', ' ', '-' * 200,
    '@SOURCE-HASH@', '//', '\t', 'https://example.org/a?b=??/',
]
P = Variable('p', ValueType.BOOL)


def test_titles_ids_and_texts_may_be_anything() -> None:
    formulas: list[Formula] = [Once(Window(0, number + 1), P) for number, _ in enumerate(HOSTILE)]
    specification = specify(formulas)
    named = [replace(item, title=text) for item, text in
             zip(specification.properties, HOSTILE, strict=True)]
    texts = [replace(item, text=text) for item, text in
             zip(specification.properties, HOSTILE, strict=True)]
    for properties in (named, texts):
        assert_clean_and_right(replace(specification, properties=tuple(properties)), steps=100)


def test_ids_and_names_of_inputs_may_be_any_text() -> None:
    # C99 guarantees string literals of 4095 characters.
    words = [text[:4000] for text in dict.fromkeys(HOSTILE) if '\ud800' not in text]
    formulas: list[Formula] = [Once(Window(0, 2), Variable(word, ValueType.BOOL))
                               for word in words if word]
    specification = specify(formulas)
    # Ids that are equal in C are refused when a bundle is read.
    properties = [replace(item, id=f'{number}{word}') for number, (item, word) in
                  enumerate(zip(specification.properties, words, strict=False))]
    assert_clean_and_right(replace(specification, properties=tuple(properties)), steps=50)


def test_harmless_characters_are_unchanged() -> None:
    for text in ('if p ROS_component shall within 10 seconds satisfy x <= cc_t', 'a / b * c',
                 'why?', 'Übergröße', '日本語', 'x → y', '50 % of 3 µm'):
        assert safe(text) == text


@pytest.mark.parametrize('text', HOSTILE, ids=range(len(HOSTILE)))
def test_a_text_cannot_leave_its_comment(text: str) -> None:
    lines = list(comment(text, '  ', 'first ', 'rest '))
    assert lines
    for line in lines:
        assert line.startswith('  //')
        assert len(line.splitlines()) == 1
        assert not line.endswith('\\')
        assert len(line) <= 110
        for sign in ('??', '*/', '/*', '\\'):
            assert sign not in line
        # There is no right-to-left text: every character is displayed at its position in the line.
        assert not {unicodedata.bidirectional(char) for char in line} & {
            'R', 'AL', 'AN', 'RLO', 'RLE', 'RLI', 'LRO', 'LRE', 'LRI', 'FSI', 'PDF', 'PDI', 'BN'}


@settings(max_examples=3 * EXAMPLES)
@given(st.text(st.sampled_from('?/*\\ \n"a\x00é\u202e')))
def test_no_combination_of_characters_can_leave_its_comment(text: str) -> None:
    shown = safe(text)
    assert not any(sign in shown for sign in ('??', '*/', '/*', '\\', '\n', '\x00', '\u202e'))


def test_the_texts_do_not_reach_the_compiler(tmp_path: Path) -> None:
    if gcc() is None:
        pytest.skip('needs gcc')
    lines = ['int before(void);']
    for text in HOSTILE:
        lines += [*comment(text), f'typedef int seen_{len(lines)};']
    source = tmp_path / 'comments.c'
    source.write_text('\n'.join(lines) + '\n')
    for standard in ('c99', 'c11', 'gnu99'):
        compile_c([*(gcc() or ()), f'-std={standard}', *WARNINGS, '-Wtrigraphs', '-Wcomment', '-c',
                   source, '-o', tmp_path / 'out.o'])


def test_a_constant_formula_has_its_heading(tmp_path: Path) -> None:
    module = assert_clean_and_right(specify([FALSE, Once(Window(0, 0), P)]))
    assert '// R-0: R-0' in module.sources[0][1]


def test_a_long_text_takes_time_in_proportion_to_its_length() -> None:
    def seconds(count: int) -> float:
        begin = process_time()
        lines = list(comment('m' * count))
        taken = process_time() - begin
        assert sum(line.count('m') for line in lines) == count
        return taken

    assert min(seconds(2_000_000) for _ in range(3)) < 16 * min(
        seconds(250_000) for _ in range(3)) + 0.1


def test_the_meaning_of_an_input_with_many_values_takes_linear_time() -> None:
    values = tuple((f'N{number}', number) for number in range(20_000))
    item = ManifestInput('x', ValueType.INT32, None, None, (), values, None)
    begin = process_time()
    assert meaning(item).endswith(', N19999 = 19999')
    assert process_time() - begin < 5  # it took more than a minute
