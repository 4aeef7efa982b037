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
Messages of many types, changed at random, through generated readers and the evaluator.

The program is `messages.c` beside this file, compiled with the address and undefined-behaviour
sanitizers where the compiler has them.
"""

from collections.abc import Sequence
from dataclasses import replace
import os
from pathlib import Path
from random import Random
import shutil
import struct
import subprocess

from codegen.messages import random_tree, serialize, Topic
from codegen.test_extractors import specification_for, topic_of, WRITTEN
from differential.compiled import c_module, CSRC, write_module
from fret_monitor.logic.formula import (
    Binary, BinaryOperator, Formula, Historically, Variable, Window,
)
from fret_monitor.logic.specification import Signal, Specification
from fret_monitor.messages.installed import find_message
from fret_monitor.model.diagnostics import CompileError
from fret_monitor.model.values import ValueType
from fret_monitor.native import csrc_file, csrc_includes
from strategies import as_term, property_of

HERE = Path(__file__).resolve().parent
SANITIZERS = ('-fsanitize=address,undefined', '-fno-sanitize-recover=all', '-g1')
EVALUATOR = ('evaluator', 'deadlines', 'due', 'measures', 'steps', 'tables', 'instance')
# Common types, with strings and arrays before numbers, beside those that the tests define.
TYPES = ('nav_msgs/msg/Odometry', 'sensor_msgs/msg/BatteryState', 'sensor_msgs/msg/JointState',
         'sensor_msgs/msg/LaserScan', 'geometry_msgs/msg/PoseWithCovarianceStamped',
         'diagnostic_msgs/msg/DiagnosticArray', 'std_msgs/msg/String', 'std_msgs/msg/Float32')
MOST_INPUTS = 10


def fuzz(folder: Path, seconds: float, seed: int,
         level: str = '-O1') -> 'subprocess.CompletedProcess[str]':
    """Fuzz for some seconds; return the output, and a status other than 0 for a bug."""
    program = build(folder, topics(folder), level=level)
    return subprocess.run(
        [program, folder / 'seeds', str(seconds), str(seed)], capture_output=True, text=True,
        check=False, timeout=seconds + 60,
        # It does not free what it allocates once.
        env={**os.environ, 'ASAN_OPTIONS': 'detect_leaks=0'})


def topics(folder: Path) -> list[Topic]:
    """Return topics with messages defined here, and with those `TYPES` that are installed."""
    for name, fields in WRITTEN.items():
        path = folder / 'share' / f'{name}.msg'
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text('\n'.join(fields) + '\n')
    layouts = [find_message(name, [folder]) for name, fields in WRITTEN.items() if fields]
    for name in TYPES:
        try:
            layouts.append(find_message(name))
        except CompileError:
            continue  # it is not installed
    return [topic_of(layout, number, MOST_INPUTS) for number, layout in enumerate(layouts)]


def specification(chosen: Sequence[Topic]) -> Specification:
    """Return a requirement for each topic, which reads the topic's first inputs."""
    formulas = [Historically(Window(0, 3), _read(topic.signals[:3])) for topic in chosen
                if topic.signals]
    return replace(specification_for(chosen), properties=tuple(
        property_of(f'R-{number}', item) for number, item in enumerate(formulas)))


def _read(signals: Sequence[Signal]) -> Formula:
    first, *others = (_relation(Variable(item.name, item.type)) for item in signals)
    for other in others:
        first = Binary(BinaryOperator.AND, first, other)
    return first


def _relation(item: Variable) -> Formula:
    if item.type is ValueType.BOOL:
        return item
    kind = item.type if item.type.is_float or item.type is ValueType.UINT64 else ValueType.INT64
    return Binary(BinaryOperator.LE, as_term(item, kind), as_term(item, kind))


def build(folder: Path, chosen: Sequence[Topic], csrc: Path = CSRC, level: str = '-O1') -> Path:
    """Write the seed messages and build the program, with sanitizers if possible."""
    rng = Random(7)
    (folder / 'seeds').write_bytes(b''.join(
        struct.pack('<II', number, len(message)) + message
        for number, topic in enumerate(chosen)
        for tree in [random_tree(topic.layout, rng) for _ in range(12)]
        for big in (False, True) for message in [serialize(topic.layout, tree, big=big)]))
    sources = write_module(c_module(specification(chosen)), folder)
    program = folder / 'messages'
    gcc = shutil.which('gcc') or 'cc'
    command = [gcc, '-std=c99', f'-I{csrc}', *csrc_includes(), f'-I{folder}',
               *map(str, sources),
               *(str(csrc_file(f'{name}.c')) for name in EVALUATOR), str(HERE / 'messages.c'),
               '-lm', '-o', str(program)]
    for flags in (SANITIZERS, ()):
        done = subprocess.run([*command, *flags, level], capture_output=True, text=True,
                              check=False)
        if done.returncode == 0:
            return program
    raise AssertionError(done.stderr)
