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

"""Target `c99` with margins: its C alone gives the margins of `simulate`, bit for bit."""

from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import accumulate
import math
from pathlib import Path
from random import Random
import subprocess
from typing import Any

from cli.command import run_here as cli
from differential.compiled import compile_c, gcc, SANITIZERS, WARNINGS
from differential.test_clean_c import has_sanitizers
from differential.test_margins import build, evaluator_of, INPUTS, N, P, random_chain, run, X, Y

from fret_monitor.build import GeneratedMonitor
from fret_monitor.export.c99 import c99
from fret_monitor.export.content import export_name, Options
from fret_monitor.export.flight import members
from fret_monitor.logic.evaluate import Trace
from fret_monitor.logic.formula import Binary, BinaryOperator, Formula
from fret_monitor.model.policies import Policy
from fret_monitor.model.values import ValueType
import pytest
from strategies import property_of, random_trace

ROWS = 40
PRINTED = """
static void print(const struct {name}_state * state)
{{
  for (uint32_t i = 0u; i < {name}_requirements; ++i) {{
    const struct fm_margin margin = {name}_margin(state, i);
    const bool is_known = margin.value - margin.value == 0.0;
    printf("%a,%a,%lld,%s\\n", margin.value, is_known ? margin.distance : 0.0,
      is_known ? (long long)margin.instant : 0,
      is_known ? {name}_comparison(margin.comparison) : {name}_comparison(-1));
  }}
}}
"""


def literal(value: Any, kind: ValueType) -> str:
    """Return a value as it is written in C."""
    if isinstance(value, float) and not math.isfinite(value):
        return 'NAN' if math.isnan(value) else 'INFINITY' if value > 0 else '-INFINITY'
    suffix = 'f' if kind is ValueType.FLOAT32 else ''
    return value.hex() + suffix if isinstance(value, float) else str(int(value))


def program(generated: GeneratedMonitor, trace: Trace, times: Sequence[int]) -> Iterator[str]:
    """Yield a program that steps through a trace, and prints the margins at each row."""
    name, is_timed = export_name(generated), generated.manifest.policy is Policy.TIMED
    yield from ('#include <stdio.h>', '#include <math.h>', f'#include "{name}_margins.h"',
                '#include "evaluator.h"', f'#include "{name}_options.h"',
                PRINTED.format(name=name), 'int main(void)', '{',
                f'  static struct {name}_state state;',
                f'  bool verdicts[{name}_verdicts];', '  int64_t next = FM_NEVER;',
                f'  static const struct {name}_inputs rows[] = {{')
    for row, _ in enumerate(times):
        yield '    {' + ', '.join(
            f'.{member} = {literal(trace[item.name][row], item.value_type)}'
            for member, item in zip(members(generated), generated.manifest.inputs,
                                    strict=True)) + '},'
    yield from ('  };', '  static const int64_t times[] = {' + ', '.join(map(str, times)) + '};',
                f'  {name}_reset(&state);', f'  for (int k = 0; k < {len(times)}; ++k) {{')
    if is_timed:
        step = f'{name}_step_at(&state, &rows[{{}}], verdicts, {{}})'
        yield from ('    while (next < times[k]) {', f'      {name}_margins_at(&state, next);',
                    f'      next = {step.format("k - 1", "next")};', '    }',
                    f'    {name}_margins_at(&state, times[k]);',
                    f'    next = {step.format("k", "times[k]")};')
    else:
        yield from (f'    {name}_margins_at(&state, times[k]);',
                    f'    {name}_step(&state, &rows[k], verdicts);')
    yield from ('    print(&state);', '  }', '  (void)next;',
                f'  (void){name}_set_initial_values;',
                f'  return {name}_options().margins == {name}_margins() ? 0 : 1;', '}', '')


def printed(generated: GeneratedMonitor, trace: Trace, times: Sequence[int],
            folder: Path) -> list[str]:
    """Return what the program of an export prints."""
    compiler = gcc()
    if compiler is None:
        pytest.skip('needs gcc')
    for name, text in c99(generated, Options()).generated.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    (folder / 'main.c').write_text('\n'.join(program(generated, trace, times)))
    sanitizers = SANITIZERS if has_sanitizers(folder) else ()
    compile_c([*compiler, '-std=c99', '-ffp-contract=off', *sanitizers, *WARNINGS,
               f'-I{folder}/src', folder / 'main.c',
               folder / 'src' / f'{export_name(generated)}_monitor.c', '-lm',
               '-o', folder / 'main'])
    return subprocess.run([folder / 'main'], check=True, capture_output=True,
                          text=True).stdout.splitlines()


@pytest.mark.parametrize('policy', [Policy.EVERY_MESSAGE, Policy.TIMED])
def test_the_margins_of_an_export_are_those_of_simulate(policy: Policy, tmp_path: Path) -> None:
    rng = Random(f'{policy}')
    formulas: list[Formula] = [random_chain(rng) for _ in range(12)]
    formulas.append(Binary(BinaryOperator.OR, P, formulas[0]))  # now and then no number decides
    generated = build([property_of(f'R-{number}', item) for number, item in enumerate(formulas)],
                      policy, {X.name: 0.7, N.name: 2.0}, Fraction(100))
    times = [0, *accumulate(rng.choice((1, 1, 2, 5, 9)) for _ in range(ROWS - 1))]
    if policy is not Policy.TIMED:
        times = [*range(ROWS)]
    trace: Trace = {**random_trace(rng, INPUTS, ROWS), **{
        item.name: [rng.choice((math.nan, math.inf, *[rng.uniform(-2, 5)] * 8)) for _ in times]
        for item in (X, Y)}}
    found = run(evaluator_of(generated), trace, times)
    texts = [item.text for item in generated.manifest.comparisons]
    last_at = {time: place for place, time in enumerate(found.times)}
    expected = [
        f'{hexed(item.value)},{hexed(item.distance)},{item.instant},{texts[item.comparison]}'
        if math.isfinite(item.value) else f'{item.value},0x0p+0,0,'
        for time in times for item in found.margins[
            last_at[time] * len(formulas):(last_at[time] + 1) * len(formulas)]]
    assert [line.replace('-nan', 'nan') for line in printed(
        generated, trace, times, tmp_path)] == expected
    assert len({*expected}) > 50 and any(line.startswith('-inf') for line in expected)


def hexed(value: float) -> str:
    """Return a number as `%a` prints it."""
    head, _, exponent = value.hex().partition('p')
    short = head.rstrip('0').rstrip('.') if '.' in head else head
    return f'{short}p{exponent}'


MOTOR = """
format: 1
inputs: {current: {topic: current, type: std_msgs/msg/Float64}}
requirements: [{id: CURRENT, ptltl: "current < 20"}]
gates: {safe: {from: current, to: safe, type: std_msgs/msg/Float64, keep: [CURRENT]}}
"""


def test_margins_are_exported_where_they_are_asked_for_alone(
    tmp_path: Path,
) -> None:
    bundle = tmp_path / 'motor.yaml'
    bundle.write_text(MOTOR[:MOTOR.index('gates')])
    for target, row in (('c99', '| `src/motor_margins.h`, `src/fret_margins.h` |'),
                        ('ros2', '| `copilot/margin/ID` | `std_msgs/msg/Float64` |')):
        for options in ((), ('--margins',)):
            out = tmp_path / f'{target}{len(options)}'
            assert cli('export', bundle, '--to', target, '--output', out, '--no-proof',
                       *options).status == 0
            assert (row in (out / 'README.md').read_text()) == bool(options)
            assert ('motor_margins' in (out / 'src' / 'motor_monitor.c').read_text()) == bool(
                options)
    refused = [(('export', bundle, '--to', 'cfs', '--output', tmp_path / 'x', '--margins'),
                'the target cfs has no margins, only c99 and ros2 have: leave --margins out'),
               (('export', bundle, '--to', 'requirements', '--output', tmp_path / 'x',
                 '--margins'), 'takes one bundle and no option but --output'),
               (('export', bundle, '--to', 'ros2', '--output', tmp_path / 'x', '--margins',
                 '--gate', 'safe'), 'a gate has no margins: leave --margins out'),
               (('compile', bundle, '--output', tmp_path / 'x', '--margins', '--gate', 'safe'),
                'a gate has no margins: leave --margins out'),
               (('compile', bundle, '--output', tmp_path / 'x', '--margins', '--worst-case'),
                'the worst case of margins is not known')]
    for arguments, message in refused:
        done = cli(*arguments)
        assert done.status == 2 and message in done.err
        assert not (tmp_path / 'x').exists()
