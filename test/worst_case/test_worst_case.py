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

"""
The worst-case cost of a step against measurements: instructions by valgrind, stack by painting.

`count.c` beside this file steps a monitor over adverse and over lasting inputs.
"""

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from functools import cache
from pathlib import Path
from random import Random
import re
import shutil
import subprocess
from typing import Any, TypeAlias

from differential.compiled import compile_c, CSRC, gcc, write_module
from differential.test_clean_c import every_window
from fret_monitor.build import read_one_instance
from fret_monitor.codegen.module import CModule, generate
from fret_monitor.logic.formula import (
    ALWAYS, Binary, BinaryOperator, Constant, FALSE, Formula, FTP, Historically, NotRefuted, Once,
    postorder, Since, Slope, TimeOver, Trial, Triggered, Unary, UnaryOperator, Variable, Window,
    Yesterday,
)
from fret_monitor.logic.specification import Property, Specification
from fret_monitor.model.policies import Policy
from fret_monitor.model.values import ValueType
from fret_monitor.native.compiler import COMPILE_FLAGS, Compiler
from fret_monitor.native.stack import call_graph
from fret_monitor.program.cost import Cost, COSTS, kinds, LIBRARY_COSTS, step_cost
from fret_monitor.program.layout import GroupLayout, lay_out
from fret_monitor.program.lower import lower
from fret_monitor.smt.terms import LIBRARY
from program import written
import pytest
from strategies import (
    EXAMPLES, INPUTS, property_of, random_inputs, random_property, specification_of,
)

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
P, Q = Variable('p', ValueType.BOOL), Variable('q', ValueType.BOOL)
X = Variable('x_float64', ValueType.FLOAT64)
STEPS = 120
SLACK = 4  # a bound must be no more than this factor above the measurement
BUNDLES = [*sorted((ROOT / 'config').glob('*.yaml')),
           ROOT / 'test/golden/check/every_message.yaml']


def layouts_of(specification: Specification) -> tuple[GroupLayout, ...]:
    return tuple(lay_out(group) for group in lower(specification).groups)


def random_specification(seed: int) -> Specification:
    rng = Random(1000 + seed)
    size = (6, 12, 25, 60)[seed % 4]
    return specification_of([
        random_property(rng, f'R-{number}', random_inputs(rng), size=size,
                        reach=rng.choice((9, 300, 2 ** 31 - 1)), loops=number % 3)
        for number in range((1, 4, 12)[seed % 3])])


def windows_apart() -> Specification:
    """Return a requirement for each operator and form of window, in one group."""
    return specification_of([property_of(f'W-{number}', item)
                             for number, item in enumerate(every_window())], (P, Q))


def at_ticks(specification: Specification) -> Specification:
    """Return a specification under the policy timed; its bounds are nanoseconds."""
    rate = Fraction(20)  # so low that queues of windows [a,a] overflow
    return replace(specification, policy=Policy.TIMED, signals=tuple(
        replace(signal, max_rate=rate) for signal in specification.signals))


def less_than_one(number: Formula) -> Formula:
    return Binary(BinaryOperator.LT, number, Constant(1.0, ValueType.FLOAT64))


def windows_at_ticks() -> Specification:
    """Return a requirement for each operator and form of window, in one group at ticks."""
    windows = [Window(0, 7), Window(0, 300), Window(5, None), Window(300, None), Window(3, 8),
               Window(90, 300), Window(200, 200)]
    terms = [term for window in windows for term in (
        Once(window, P), Historically(window, P), Since(window, P, Q), Triggered(window, P, Q))]
    properties = [property_of(f'W-{number}', item)
                  for number, item in enumerate([*terms, Yesterday(P), FTP, Once(ALWAYS, P),
                                                 TimeOver(200, 100, P),
                                                 less_than_one(Slope(X, P, 1))])]
    return at_ticks(specification_of(properties, (P, Q, X)))


def many_of_a_group() -> Specification:
    """Return a group that is cut into several functions, with values that later ones read."""
    shared = Since(Window(0, 7), P, Q)
    return specification_of([
        property_of(f'M-{number}', Binary(
            BinaryOperator.XOR, shared, Once(Window(number, 2 * number), P)))
        for number in range(1, 200)], (P, Q))


def trials() -> Specification:
    """Return tests of probabilities, whose trials often begin, succeed and fail."""
    return specification_of([
        property_of(f'T-{number}', NotRefuted(
            Trial(due, P, Q, Unary(UnaryOperator.NOT, P), P, FTP, FALSE), *allowed))
        for number, (due, allowed) in enumerate((
            (None, (0.02, 0.98, 1000.0)), (3, (1e-6, 1.0 - 1e-6, 1e12)),
            (7, (0.5, 0.5, 1000.0))))], (P, Q))


def remainders() -> Specification:
    """Return divisions and powers, for which the C library takes many instructions."""
    found: list[Property] = []
    for kind in (ValueType.FLOAT32, ValueType.FLOAT64):
        x, y = Variable(f'x_{kind.value}', kind), Variable(f'y_{kind.value}', kind)
        operators = (BinaryOperator.MOD, BinaryOperator.POW)[:1 + (kind is ValueType.FLOAT64)]
        found += [property_of(f'{operator.name}-{kind.value}', Binary(
            BinaryOperator.LT, Binary(operator, x, y), Constant(0.5, kind)))
            for operator in operators]
    x, y = Variable('x_float64', ValueType.FLOAT64), Variable('y_float64', ValueType.FLOAT64)
    calls: list[Unary | Binary] = [Unary(item, x) for item in UnaryOperator if item.is_library]
    calls.append(Binary(BinaryOperator.ATAN2, x, y))
    found += [property_of(f'{call.operator.name}-float64', Binary(
        BinaryOperator.LT, call, Constant(0.5, ValueType.FLOAT64)))
        for call in calls]
    return specification_of(found)


def tool(name: str) -> str:
    found = shutil.which(name)
    if found is None:
        pytest.skip(f'needs {name}')
    return found


Build: TypeAlias = Callable[[Specification], tuple[Path, CModule, Cost]]


@pytest.fixture(scope='module')
def build(tmp_path_factory: pytest.TempPathFactory) -> Build:
    """
    Return a function that compiles a specification as `native` does, with `count.c`.

    Each specification is compiled once, and so is `count.c`.
    """
    found = gcc()
    if found is None:
        pytest.skip('needs gcc')
    if 'x86_64' not in subprocess.run([*found, '-dumpmachine'], capture_output=True, text=True,
                                      check=True).stdout:
        pytest.skip('the costs are those of x86-64')

    def compile_object(source: Path, *flags: str) -> Path:
        made = tmp_path_factory.mktemp('object') / 'made.o'
        compile_c([*found, *flags, f'-I{CSRC}', f'-I{source.parent}', '-c', source, '-o', made])
        return made

    @cache
    def counter(symbol: str) -> Path:
        return compile_object(HERE / 'count.c', '-O2', f'-DMONITOR={symbol}')

    @cache
    def built(specification: Specification) -> tuple[Path, CModule, Cost]:
        program = lower(specification)
        layouts = tuple(lay_out(group) for group in program.groups)
        module = generate(program, layouts)
        folder = tmp_path_factory.mktemp('count')
        objects = [compile_object(source, *COMPILE_FLAGS)
                   for source in write_module(module, folder)]
        # -z now: the loader's work at the first call of a function must not count.
        compile_c([*found, counter(module.symbol), *objects, '-lm', '-lpthread', '-Wl,-z,now',
                   '-o', folder / 'count'])
        return folder / 'count', module, step_cost(layouts)

    return built


def instructions(program: Path) -> list[int]:
    """Return the instructions of each step, as valgrind counts them."""
    out = program.parent / 'counted'
    done = subprocess.run(
        [tool('valgrind'), '--tool=callgrind', f'--callgrind-out-file={out}', '--combine-dumps=no',
         '--toggle-collect=counted_step', '--dump-after=counted_step', program, str(STEPS), '-'],
        capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return [int(found[1]) for file in program.parent.glob('counted.*')
            if (found := re.search(r'^summary: (\d+)', file.read_text(), re.MULTILINE))
            and int(found[1])]


def check(build: Build, specification: Specification, slack: float | None = None) -> None:
    """Check the bound against the measurement; it must not be far above where `slack` is given."""
    program, _, cost = build(specification)
    counted = instructions(program)
    assert len(counted) == STEPS
    most = max(counted) - 5  # counted_step itself: three loads, a jump, a return
    assert most <= cost.own + cost.library
    if slack is not None:
        assert cost.own <= slack * most


@pytest.mark.parametrize('bundle', BUNDLES, ids=lambda path: path.stem)
def test_the_bound_of_a_bundle_holds_and_is_close(
    bundle: Path, build: Build,
) -> None:
    if not bundle.is_file():
        pytest.skip('needs the source tree')
    check(build, read_one_instance(bundle).specification, SLACK)


@pytest.mark.parametrize('seed', range(EXAMPLES // 8))
def test_random_requirements_stay_within_the_bound(
    seed: int, build: Build,
) -> None:
    check(build, random_specification(seed))


def test_each_operator_with_each_window_stays_within_the_bound(
    build: Build,
) -> None:
    check(build, windows_apart(), SLACK)


def test_each_operator_stays_within_the_bound_at_ticks(build: Build) -> None:
    check(build, windows_at_ticks(), SLACK)


@pytest.mark.parametrize('seed', range(4))
def test_random_requirements_stay_within_the_bound_at_ticks(seed: int, build: Build) -> None:
    rng = Random(2000 + seed)
    check(build, at_ticks(specification_of([
        random_property(rng, f'R-{number}', random_inputs(rng), size=(6, 12, 25, 60)[seed],
                        reach=300) for number in range((1, 4, 12)[seed % 3])])))


def test_a_group_of_several_functions_stays_within_the_bound(
    build: Build,
) -> None:
    check(build, many_of_a_group(), SLACK)


def test_tests_of_probabilities_stay_within_the_bound(build: Build) -> None:
    check(build, trials())


def test_remainders_and_powers_of_floats_stay_within_the_bound(
    build: Build,
) -> None:
    check(build, remainders())


def test_the_bounds_of_windows_do_not_change_the_cost_of_a_step() -> None:
    def cost(bound: int) -> Cost:
        windows = (Window(0, bound), Window(bound, None), Window(bound, 2 * bound))
        return step_cost(layouts_of(specification_of(
            [property_of(f'R-{number}', Since(window, P, Q))
             for number, window in enumerate(windows)], (P, Q))))
    assert cost(100) == cost(1_000_000)


def test_every_kind_of_equation_has_exactly_one_cost() -> None:
    deep: Formula = P
    for _ in range(9):  # more bits than are a byte each
        deep = Yesterday(deep)
    specifications = [windows_apart(), windows_at_ticks(), remainders(), trials(),
                      specification_of([property_of('R-1', deep)], (P,)),
                      *map(random_specification, range(60)), many_of_a_group()]
    found = {kind for item in specifications for kind in kinds(layouts_of(item))}
    assert found == COSTS.keys() | LIBRARY_COSTS.keys()


def test_each_group_is_counted_once() -> None:
    def groups(*operands: Variable) -> int:
        return kinds(layouts_of(specification_of(
            [property_of(f'R-{item.name}', item) for item in operands], operands)))['group']

    assert (groups(P), groups(P, Q)) == (1, 2)


# Of each requirement, what it counts besides inputs, literals, relations and its verdict.
@pytest.mark.parametrize(('formula', 'operations'), [
    ('Y p', 'bit'),
    ('p S q', 'bit'),
    ('p & q', 'connective'),
    ('O[7,7] p', 'delay, word'),
    ('O[100,100] p', 'delay, ring'),
    ('O[0,7] p', 'counter, O H [0,b]'),
    ('H[0,7] p', 'counter, O H [0,b]'),
    ('p S[0,7] q', 'counter, S T [0,b]'),
    ('p T[0,7] q', 'counter, S T [0,b]'),
    ('O[>=5] p', 'counter, O H [a,inf)'),
    ('p S[>=5] q', 'counter, S T [a,inf)'),
    ('u > 0.5', 'conversion, uint64 to float'),
    ('d > n', 'conversion, to float'),
    ('m > n', 'conversion, to integer'),
    ('u > m', 'relation, int64 with uint64'),
    ('abs(x) > y', 'abs, float'),
    ('-x > y', 'minus, float'),
    ('x / y > x', 'div mod, float'),
    ('max(x, y) > x', 'min max, float'),
    ('x + y > x', '+ - *, float'),
])
def test_each_operation_is_counted_once(formula: str, operations: str) -> None:
    found = kinds(written.layouts_of(written.specified(formula)))
    others = {'step', 'group', 'verdict', 'use', 'position of rings', 'relation, float',
              'relation, integer', 'literal, float', 'literal, integer', 'input, float',
              'input, integer', 'input, Boolean'}
    assert {kind: count for kind, count in found.items() if count and kind not in others} == {
        operations: 1}


def test_the_costs_in_the_documentation_are_those_in_use() -> None:
    page = ROOT / 'docs' / 'worst_case.md'
    if not page.is_file():
        pytest.skip('needs the source tree')
    rows = re.findall(r'^\| `(.*?)` \|.*\| ([\d,]+) \|$', page.read_text(), re.MULTILINE)
    assert {name: int(cost.replace(',', '')) for name, cost in rows} == COSTS | LIBRARY_COSTS


# -- stack --------------------------------------------------------------------------------------


def bools(seed: int) -> Specification:
    """Return requirements that call no functions of the C library."""
    rng = Random(seed)
    properties = [random_property(rng, f'R-{number}', INPUTS[:4], size=40) for number in range(40)]
    return specification_of([item for item in properties if not any(
        isinstance(node, Binary) and node.operator in (BinaryOperator.MOD, BinaryOperator.POW)
        for node in postorder([item.formula]))], INPUTS[:4])


@cache
def graph_of(module: CModule) -> Any:
    found = gcc()
    if found is None:
        pytest.skip('needs gcc')
    headers = {file.name: file.read_text() for file in CSRC.glob('*.h')}
    graph = call_graph(Compiler(found, ''), {**headers, **module.files},
                       [name for name, _ in module.sources])
    if graph is None:
        pytest.skip('needs a gcc that tells of its stack')
    return graph


@pytest.mark.parametrize('specification', [
    bools(1), bools(2), windows_apart(), windows_at_ticks(), many_of_a_group()],
    ids=['random', 'random too', 'windows', 'at ticks', 'parts'])
def test_steps_take_no_more_stack_than_the_compiler_reports(
    specification: Specification, build: Build,
) -> None:
    program, module, _ = build(specification)
    graph = graph_of(module)
    assert graph.external <= {'memset'}, 'the C library has stack of its own'
    told = max(map(graph.depth, graph.frames))
    used = int(subprocess.run([program], capture_output=True, check=True).stdout)
    assert told / 3 - 64 <= used <= told


@pytest.mark.parametrize('specification', [windows_apart(), many_of_a_group(), remainders()],
                         ids=['windows', 'parts', 'remainders'])
def test_generated_c_has_no_recursion_and_no_calls_through_pointers(
    specification: Specification,
) -> None:
    module = generate(lower(specification), layouts_of(specification))
    graph = graph_of(module)
    assert max(map(graph.depth, graph.frames)) > 0  # depth raises for a recursion and names it
    assert graph.external <= {'memset', 'fmodf', *LIBRARY}
    assert not any('__indirect_call' in called for called in graph.calls.values())
