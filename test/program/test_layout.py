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

"""The layout of state: as narrow as the bounds allow, known before the run, equal to that of C."""

from collections.abc import Callable
from dataclasses import replace
from math import isqrt
from pathlib import Path
from random import Random
import time

from bundles import write_bundle
from differential.compiled import c_module, compile_c, CSRC, gcc
from fret_monitor.build import build_specification, read
from fret_monitor.logic.formula import (
    Binary, BinaryOperator, Formula, Historically, Once, postorder, Since, Unary, UnaryOperator,
    Variable, Window, Yesterday,
)
from fret_monitor.logic.specification import Specification
from fret_monitor.model.diagnostics import CompileError
from fret_monitor.model.manifest import ManifestVariable
from fret_monitor.model.policies import Policy
from fret_monitor.model.values import ValueType
from fret_monitor.program.layout import (
    check_instances, instance_bytes, lay_out, MAX_STATE_BYTES, state_bytes,
)
from fret_monitor.program.lower import lower
from fret_monitor.program.monitor_program import room_of
from fret_monitor.program.window_sizes import window_sizes
from fret_monitor.runtime.evaluator import Evaluator
from program.written import generate, layouts_of, specified, state
import pytest
from strategies import property_of, random_inputs, random_property, specification_of
from traces.timed_traces import timed

P, Q = Variable('p', ValueType.BOOL), Variable('q', ValueType.BOOL)


def size(*formulas: str) -> int:
    """Return the bytes of state that formulas need."""
    return state_bytes(layouts_of(specified(*formulas)))


@pytest.mark.parametrize(('formula', 'fields'), [
    # Ages use a bit above the bound; other counters must hold bound + 1.
    ('O[0,1] p', 'counter uint8'), ('O[0,127] p', 'counter uint8'),
    ('O[0,128] p', 'counter uint16'),
    ('O[0,32767] p', 'counter uint16'), ('O[0,32768] p', 'counter uint32'),
    ('O[0,2147483647] p', 'counter uint32'), ('H[0,127] p', 'counter uint8'),
    ('H[0,128] p', 'counter uint16'), ('p S[0,127] q', 'counter uint8'),
    ('p S[0,128] q', 'counter uint16'), ('p T[0,2147483647] q', 'counter uint32'),
    ('O[>=254] p', 'counter uint8'), ('O[>=255] p', 'counter uint16'),
    ('p S[>=65534] q', 'counter uint16'), ('p S[>=65535] q', 'counter uint32'),
    ('H[>=2147483647] p', 'counter uint32'),
    # Delay lines are bits.
    ('O[1,1] p', 'flag bool'), ('O[2,2] p', 'line uint8'), ('O[8,8] p', 'line uint8'),
    ('O[9,9] p', 'line uint16'), ('O[16,16] p', 'line uint16'), ('O[17,17] p', 'line uint32'),
    ('O[32,32] p', 'line uint32'), ('O[33,33] p', 'line uint64'), ('O[64,64] p', 'line uint64'),
    ('O[65,65] p', 'position uint8|ring uint8[9]'), ('O[72,72] p', 'position uint8|ring uint8[9]'),
    ('O[73,73] p', 'position uint8|ring uint8[10]'),
    ('H[256,256] p', 'position uint8|ring uint8[32]'),
    ('H[257,257] p', 'position uint16|ring uint8[33]'),
    ('O[65537,65537] p', 'position uint32|ring uint8[8193]'),
    # All rings of one length share a position.
    ('O[99,99] p & O[99,99] q & O[100,100] p',
     'position uint8|position uint8|ring uint8[13]|ring uint8[13]|ring uint8[13]'),
    # The temporal operators and the state that each needs.
    ('Y p', 'flag bool'), ('Z p', 'flag bool'), ('O p', 'flag bool'), ('H p', 'flag bool'),
    ('p S q', 'flag bool'), ('p T q', 'flag bool'), ('FTP', 'flag bool'),
    ('O[3,9] p', 'counter uint8|line uint8'), ('H[3,9] p', 'counter uint8|line uint8'),
    ('p S[3,9] q', 'counter uint8|counter uint8|line uint8'),
    ('p T[3,9] q', 'counter uint8|counter uint8|line uint8'),
    ('preReal(0.0, d) > 1.0', 'number float64'), ('preReal(0.0, x) > 1.0', 'number float32'),
    ('preInt(0, n) > 1', 'number int64'), ('preInt(5, m) > 1', 'number int64'),
    # Up to eight bits are separate bytes; nine share a word.
    ('Y ' * 8 + 'p', '|'.join(['flag bool'] * 8)),
    ('Y ' * 9 + 'p', 'bits uint16'),
    ('Y ' * 33 + 'p', 'bits uint64'),
    ('Y ' * 64 + 'p', 'bits uint64'),
    ('Y ' * 65 + 'p', 'bits uint64|bits uint8'),
    # No state.
    ('p', ''), ('p & FALSE & O q', ''), ('O[0,-1] p', ''), ('H[0,-1] O p', ''), ('O[0,0] p', ''),
])
def test_state_is_as_narrow_as_its_bounds_allow(formula: str, fields: str) -> None:
    assert '|'.join(state(formula)) == fields


def test_the_running_example_needs_a_few_bytes() -> None:
    assert size('H ((H[0,10] (x > 15.0 & y > 8.0) & H[0,9] !FTP) -> O[0,10] (x <= 15.0))') <= 8


def test_a_distant_deadline_needs_a_few_bytes() -> None:
    assert size('H (O[2000000000,2000000000] p -> O[0,1999999999] q)') <= 8


def test_fields_are_ordered_by_size_so_that_a_struct_has_no_holes() -> None:
    assert size('O[0,9] p & preReal(0.0, d) > 1.0 & Y q & O[0,300] q & O[0,70000] r') == 16
    assert size('p') == 1


def test_groups_are_laid_out_one_after_the_other() -> None:
    # 1 byte, then 8 at the next multiple of 8, then 2.
    assert size('Y p', 'preReal(0.0, d) > 1.0', 'O[0,300] q') == 24
    assert size('Y p', 'O[0,300] q', 'preReal(0.0, d) > 1.0') == 16


@pytest.mark.parametrize('seed', [1, 2])
def test_the_reported_size_of_state_is_that_of_c(seed: int, tmp_path: Path) -> None:
    if gcc() is None:
        pytest.skip('needs gcc')
    rng = Random(seed)
    properties = [random_property(rng, f'R-{number}', random_inputs(rng), size=60, loops=2)
                  for number in range(60)]
    specification = specification_of(properties)
    layouts = layouts_of(specification)
    module = c_module(specification)
    told = [(f'struct random_group_{number}', layout.size)
            for number, layout in enumerate(layouts)]
    told.append(('struct random_state', state_bytes(layouts)))
    lines = [f'typedef char size_{number}[sizeof({name}) == {size}u ? 1 : -1];'
             for number, (name, size) in enumerate(told)]
    (tmp_path / module.header[0]).write_text(module.header[1])
    (tmp_path / 'sizes.c').write_text('\n'.join([f'#include "{module.header[0]}"', *lines, '']))
    compile_c([*(gcc() or ()), '-std=c99', f'-I{CSRC}', f'-I{tmp_path}', '-c',
               tmp_path / 'sizes.c', '-o', tmp_path / 'sizes.o'])


# -- bounds -----------------------------------------------------------------------------------


def refusal(specification: Specification, limit: int = MAX_STATE_BYTES) -> str:
    """Return the error with which a specification is refused."""
    with pytest.raises(CompileError) as caught:
        generate(specification, limit)
    return str(caught.value)


def test_a_bound_that_needs_too_much_state_is_refused_at_its_place() -> None:
    said = refusal(specified('p', 'O[70,80] q', 'H (p -> O[200000000,200000005] q)', 'O r'))
    lines = [line.rstrip() for line in said.splitlines()]
    assert 'error: the bundle needs 25,000,' in lines[0]
    assert lines[0].split('error')[0].endswith('written.yaml:16:23: ')
    assert 'H (p -> O[200000000,200000005] q)' in lines[1]
    assert 'R-2 looks back 200,000,000 steps: 25,000,000 bytes' in lines[2]
    assert 'use [0,b]' in lines[3]


def test_the_widest_of_many_bounds_is_named() -> None:
    said = refusal(specified('O[900,900] p', 'O[1000,1001] q', 'O[0,5000] r'), 200)
    assert 'R-1 looks back 1,000 steps: 125 bytes' in said
    alike = [f'O[{steps},{steps}] p' for steps in (70, 900, 1000, 80)]
    assert 'R-2 looks back 1,000 steps' in refusal(specified(*alike), 200)
    assert 'R-3 looks back 1,000 steps' in refusal(specified('q', *alike), 200)


def test_many_small_states_are_refused_together() -> None:
    formulas = [f'O[0,{number + 1}] p' for number in range(20)]
    assert 'the bundle needs 20 bytes of state; at most 19 are allowed' in \
        refusal(specified(*formulas), 19)
    generate(specified(*formulas), 20)


def test_16_mib_are_allowed_and_not_a_byte_more() -> None:
    steps = (MAX_STATE_BYTES - 4) * 8
    generate(specified(f'O[{steps},{steps}] p'))
    said = refusal(specified(f'O[{steps + 1},{steps + 1}] p'))
    assert 'the bundle needs 16,777,220 bytes' in said


@pytest.mark.parametrize('formula', ['O[=20] p', 'p S[=20] q', 'maxOver(20, n) > 3'])
def test_a_window_of_times_without_a_rate_is_refused_at_its_place(formula: str) -> None:
    said = refusal(replace(specified('p', formula), policy=Policy.TIMED))
    assert 'written.yaml:15:23: ' in said and 'R-1 looks back ' in said
    assert 'how many there can be is not known without a rate of ' in said


@pytest.mark.parametrize(('formula', 'entries'), [
    # Each tick of the window, the one before it, and the one that comes.
    ('maxOver(3, n) > 3', 5), ('changeOver(3, n) > 3', 5)])
def test_a_short_window_of_numbers_has_an_entry_for_each_tick(formula: str, entries: int) -> None:
    program = lower(timed(specified(formula)))
    rooms = [room_of(item.operation) for group in program.groups for item in group.equations]
    assert [room.capacity for room in rooms if room is not None] == [entries]


def test_a_window_is_of_the_requirement_that_reads_it_at_the_step_before(tmp_path: Path) -> None:
    bundle = write_bundle(tmp_path, """
format: 1
inputs: {x: {type: float64}}
requirements:
  - id: R
    cocospec: n = 0 -> pre m; m = n + (if maxOver(2, x) > 1.0 then 1 else 0); ok = n < 9;
""")
    layout, = layouts_of(read(bundle).specification)
    assert [window.properties for window in window_sizes(layout)] == [(0,)]


def test_instances_may_need_4_gib_and_not_a_byte_more() -> None:
    program = lower(specified('O[=99] p'))
    layouts = tuple(lay_out(group) for group in program.groups)
    each = instance_bytes(program, layouts)
    most = 4 * 1024 ** 3 // each
    check_instances(program, layouts, [ManifestVariable('robot', (), most)])
    with pytest.raises(CompileError) as refused:
        check_instances(program, layouts, [ManifestVariable('robot', (), most + 1)])
    assert f"{most + 1:,} instances of 'robot' need {each * (most + 1):,} bytes" in str(
        refused.value)
    assert f'most: {most}' in str(refused.value)


@pytest.mark.parametrize('keys', [(), ('a', 'b', 'c')])
def test_the_help_about_too_many_pairs_works(keys: tuple[str, ...]) -> None:
    program = lower(specified('p'))
    layouts = tuple(lay_out(group) for group in program.groups)
    most = 4 * 1024 ** 3 // instance_bytes(program, layouts)
    robot = ManifestVariable('robot', keys, len(keys) or 10**7)
    with pytest.raises(CompileError) as refused:
        check_instances(program, layouts, [robot, ManifestVariable('person', (), 10**8)])
    allowed = most // len(keys) if keys else isqrt(most)
    line = f'most: {allowed}' if keys else f'most: {allowed}, of robot and of person'
    assert "instances of 'robot, person' need" in str(refused.value)
    assert str(refused.value).splitlines()[-1].endswith(f'= help: {line}')
    check_instances(program, layouts, [
        replace(robot, most=len(keys) or allowed), ManifestVariable('person', (), allowed)])


@pytest.mark.parametrize(('formula', 'most'), [
    ('O[0,2147483647] p', 4), ('H[>=2147483647] p', 4), ('p S[0,2147483647] q', 4),
    ('O[1000000,2000000] p', 125_016), ('p S[1000000,2000000] q', 125_016),
    ('H[8,2147483647] p', 8),
])
def test_large_bounds_cost_their_delay_only(formula: str, most: int) -> None:
    assert size(formula) <= most


# -- large formulas ---------------------------------------------------------------------------


def deep(kind: Callable[[Formula, int], Formula], depth: int) -> Formula:
    """Nest a formula `depth` times."""
    formula: Formula = P
    for number in range(depth):
        formula = kind(formula, number)
    return formula


DEEP: list[Callable[[Formula, int], Formula]] = [
    lambda item, _: Yesterday(item),
    lambda item, _: Unary(UnaryOperator.NOT, item),
    lambda item, n: Once(Window(0, n % 9 + 1), item),
    lambda item, n: Historically(Window(n % 70, None), item),
    lambda item, n: Since(Window(n % 3, 40), Q if n % 2 else item, item),
    lambda item, n: Binary(BinaryOperator.IMPLIES, Q, item) if n % 2 else Yesterday(item),
    lambda item, n: Binary(BinaryOperator.XOR, item, Once(Window(n % 50, 60), Q)),
    lambda item, n: Binary(BinaryOperator.OR, Binary(BinaryOperator.AND, Q, item),
                           Binary(BinaryOperator.AND, Q, Yesterday(item))),
]


@pytest.mark.parametrize(('kind', 'depth'), [
    *((kind, 1_200) for kind in range(len(DEEP))), (0, 8_000), (1, 8_000), (3, 8_000)])
def test_deep_formulas_are_translated_to_c(kind: int, depth: int) -> None:
    specification = specification_of([property_of('R-1', deep(DEEP[kind], depth))], [P, Q])
    generated = generate(specification)
    assert len(generated.manifest.requirements[0].formula) <= 10_003
    longest = max(len(line) for _, text in generated.module.sources for line in text.splitlines())
    assert longest < 400


def test_a_wide_formula_is_translated_to_c() -> None:
    rng = Random(1)
    specification = specification_of([random_property(rng, 'R-1', size=3)])
    parts = [random_property(rng, 'R', size=40).formula for _ in range(1100)]
    formula = specification.properties[0].formula
    for item in parts:
        formula = Binary(BinaryOperator.IFF, formula, item)
    assert len(postorder([formula])) > 10_000
    generate(specification_of([property_of('R-1', formula)]))


def seconds(count: int, *, groups: int) -> float:
    """Return the processor time from a specification of `count` requirements to its C."""
    rng = Random(1)
    inputs = [Variable(f'x{number}', ValueType.FLOAT32) for number in range(groups)]
    properties = [random_property(rng, f'R-{number}', [inputs[number % groups]], size=30)
                  for number in range(count)]
    specification = specification_of(properties, inputs)
    start = time.process_time()
    generate(specification)
    return time.process_time() - start


@pytest.mark.parametrize('grouped', [True, False])
def test_time_grows_linearly_with_the_number_of_requirements(grouped: bool) -> None:
    few = min(seconds(100, groups=1 if grouped else 100) for _ in range(3))
    many = seconds(400, groups=1 if grouped else 400)
    assert many < 4 * 2.5 * few + 0.1, f'{few:.2f} s and {many:.2f} s'


@pytest.mark.parametrize('seed', range(3))
def test_the_bytes_of_an_instance_are_those_of_c(seed: int) -> None:
    rng = Random(seed)
    specification = specification_of([
        random_property(rng, f'R-{number}', random_inputs(rng)) for number in range(seed * 7 + 1)])
    monitor = build_specification(specification).monitor
    program = lower(specification)
    layouts = tuple(lay_out(group) for group in program.groups)
    assert instance_bytes(program, layouts) == len(Evaluator(monitor).save())
