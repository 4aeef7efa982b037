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

"""Compile the C of specifications with warnings as errors, and compare it with the reference."""

from dataclasses import replace
from pathlib import Path
from random import Random
import tempfile

from differential.compiled import (
    c_module, clang_check, compile_c, Compiled, CSRC, FLAGS, gcc, WARNINGS, write_module,
)
from fret_monitor.codegen.module import CModule
from fret_monitor.logic.evaluate import evaluate_all
from fret_monitor.logic.formula import Formula, postorder, Variable
from fret_monitor.logic.specification import Specification
from strategies import property_of, random_trace, specification_of


def specify(formulas: list[Formula], name: str = 'random') -> Specification:
    """Return a specification of these formulas and of the inputs that they read."""
    inputs = [node for node in postorder(formulas) if isinstance(node, Variable)]
    properties = [property_of(f'R-{number}', item) for number, item in enumerate(formulas)]
    return replace(specification_of(properties, inputs), name=name)


def inputs_of(specification: Specification) -> list[Variable]:
    """Return the inputs of a specification as formulas see them."""
    return [Variable(item.name, item.type) for item in specification.signals]


def assert_clean_and_right(specification: Specification, *, steps: int = 200,
                           with_clang: bool = True) -> CModule:
    """Compile with gcc and clang without a warning, compare the verdicts, and return the C."""
    formulas = [item.formula for item in specification.properties]
    trace = random_trace(Random(1), inputs_of(specification), steps) \
        or {'nothing': [False] * steps}
    compiled = Compiled(specification, compiler=gcc(), flags=(*FLAGS, *WARNINGS, '-O0')).run(trace)
    expected = evaluate_all(formulas, trace)
    for number, item in enumerate(specification.properties):
        assert compiled[number] == expected[number], item.id
    module = c_module(specification)
    if with_clang:
        check_with_clang(module, '-fbracket-depth=32')
    return module


def check_with_clang(module: CModule, *flags: str) -> None:
    """Let clang check generated C with warnings as errors; do nothing without clang."""
    clang = clang_check()
    if clang is None:
        return
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        compile_c([*clang, '-std=c99', *WARNINGS, *flags, f'-I{CSRC}', f'-I{folder}',
                   *write_module(module, folder)])
