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

"""Random recordings on several topics, and bundles of random requirements for them."""

from dataclasses import fields, replace
from fractions import Fraction
from pathlib import Path
from random import Random
from typing import Any

from bag.recordings import START, TYPES
from bag.reference import findings, Found, read_messages
from differential.compiled import unoptimised
from differential.test_timed_formulas import SCALES, TimedFormulaMaker
from fret_monitor.bag.check import compiled, opened, read_bundle, run, Selection
from fret_monitor.bag.moments import Anchor, Moment
from fret_monitor.logic.formula import (
    ALWAYS, Binary, BinaryOperator, Constant, Formula, Historically, Variable,
)
from fret_monitor.logic.specification import Property
from fret_monitor.model.policies import Policy, Report, Stamp
from fret_monitor.model.values import ValueType
import numpy
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from strategies import property_of, random_inputs, random_property, random_trace

REORDER_NS = 50_000_000
BATTERY, WARM, RANGE = (f'sensor_msgs/msg/{name}' for name in (
    'BatteryState', 'Temperature', 'Range'))
TOPICS = {'/battery': BATTERY, '/warm': WARM, '/range': RANGE, '/spare': BATTERY}
# Topic and field of each input.
INPUTS = {
    'p': ('battery', 'present'), 'x_float32': ('battery', 'voltage'),
    'x_uint8': ('battery', 'power_supply_status'), 'x_float64': ('warm', 'temperature'),
    'y_float64': ('warm', 'variance'), 'y_float32': ('range', 'range'),
    'y_uint8': ('range', 'radiation_type'), 'q': ('spare', 'present'),
    'came': ('warm', 'received()'), 'age': ('range', 'age(header.stamp)'),
    'rate': ('battery', 'rate(0.3 s)'), 'gap': ('range', 'period()'),
}
KINDS = {'p': ValueType.BOOL, 'q': ValueType.BOOL, 'came': ValueType.BOOL,
         'age': ValueType.FLOAT64, 'rate': ValueType.FLOAT64, 'gap': ValueType.FLOAT64}
NO_FIELDS = ('came', 'age', 'rate', 'gap')
VARIABLES = tuple(Variable(name, KINDS.get(name) or ValueType(name.partition('_')[2]))
                  for name in INPUTS)
DERIVATIVES = ('derivative(x_uint8) > 100', 'abs(derivative(derivative(x_uint8))) < 10000',
               'derivative(x_uint8 + y_uint8) <= 0')
TIMEOUTS_S = (0.02, 0.05, 0.3)
CASES = [*((policy, Stamp.RECEIVED) for policy in Policy), (Policy.TIMED, Stamp.HEADER)]
GAPS_NS = (0, 0, 1, 2, 10**7, 2 * 10**7 - 1, 2 * 10**7, 2 * 10**7 + 1, 5 * 10**7, 4 * 10**8)


def compare(rng: Random, folder: Path, policy: Policy, stamp: Stamp, *, bags: int = 1) -> int:
    """Compare the findings of random requirements in random recordings; return occurrences."""
    file = folder / 'bundle.yaml'
    file.write_text(bundle(rng, policy, stamp), encoding='utf-8')
    properties = [*(requirement(rng, number, policy) for number in range(40)),
                  *(of_measure(rng, number) for number in range(40, 60))]
    monitor = None
    occurrences = 0
    for number in range(bags):
        path = write(rng, folder / f'bag{number}', 250)
        more = rng.choice([0, 0, 1, 10**7, 3 * 10**9])
        selection = Selection(until=Moment(Anchor.END, more) if more else None)
        with opened(path) as (recording, find):
            if monitor is None:
                reading = read_bundle(file, selection, find)
                properties += [replace(item, report=Report.OCCURRENCE)
                               for item in reading.specification.properties]
                specification = replace(reading.specification, properties=tuple(properties))
                with unoptimised():
                    monitor = compiled(replace(reading, specification=specification)).monitor
            result = run(monitor, recording, selection)
        assert result.errors == ()
        expected = findings(specification, read_messages(path), more=more, reorder=(
            REORDER_NS if stamp is Stamp.HEADER else None))
        for item, found, one in zip(properties, result.findings, expected, strict=True):
            assert Found(found.verdict, found.is_open, found.violations,
                         tuple(found.spans)) == one, (item.id, item.formula)
            assert found.occurrences == len(one.spans)
            occurrences += found.occurrences
    return occurrences


def bundle(rng: Random, policy: Policy, stamp: Stamp) -> str:
    """Return a bundle with all inputs, some of them with initial values and timeouts."""
    evaluation = f'policy: {policy.value}'
    if policy is Policy.PERIODIC:
        evaluation += ', rate: 50'
    if stamp is Stamp.HEADER:
        evaluation += f', stamp: header, reorder: {REORDER_NS / 1e9}'
    silences = {topic: silence(rng) for topic in TOPICS}  # inputs of one topic share them
    lines = ['format: 1', f'evaluation: {{{evaluation}}}', 'inputs:']
    for item in VARIABLES:
        topic, field = INPUTS[item.name]
        initial = 'initial: ' + ('false' if item.type is ValueType.BOOL else '1')
        options = [f'topic: {topic}', f'type: {TOPICS["/" + topic]}', f'field: "{field}"',
                   *rng.choice(([initial], [], [])), *silences['/' + topic],
                   *(['max_rate: 2000'] if topic == 'battery' else
                     ['max_rate: 1e9'] if policy is Policy.TIMED else [])]
        lines.append(f'  {item.name}: {{{", ".join(options)}}}')
    lines.append('requirements:')
    lines += [f'  - {{id: D-{number}, ptltl: "{formula}"}}'
              for number, formula in enumerate(DERIVATIVES)]
    return '\n'.join([*lines, ''])


def silence(rng: Random) -> list[str]:
    """Return options of inputs: what happens without a message for long."""
    if rng.randrange(2):
        return []
    return [f'timeout: {rng.choice(TIMEOUTS_S)}', rng.choice(
        ['stale: violate', 'stale: violate', 'stale: warn']), *rng.choice(([], ['startup: 0.5']))]


def requirement(rng: Random, number: int, policy: Policy) -> Property:
    """Return a random requirement; half of them hold for all time."""
    inputs = random_inputs(rng, VARIABLES, 3)
    if policy is Policy.TIMED:
        maker = TimedFormulaMaker(rng.randrange, SCALES['both'], inputs)
        item = property_of(f'R-{number}', maker.formula(3 + rng.randrange(12)))
    else:
        item = random_property(rng, f'R-{number}', inputs, reach=20, loops=int(number % 5 == 0))
    if rng.randrange(2):
        item = replace(item, formula=Historically(ALWAYS, item.formula))
    return replace(item, report=Report.OCCURRENCE)


def of_measure(rng: Random, number: int) -> Property:
    """Return a requirement that compares a rate or a period with a value that it has."""
    name = rng.choice(['rate', 'gap'])
    value = float(Fraction(rng.randrange(8) * 10, 3)) if name == 'rate' else \
        rng.choice(GAPS_NS[1:]) / 1e9
    operator = rng.choice([BinaryOperator.LT, BinaryOperator.LE, BinaryOperator.EQ])
    sides: list[Formula] = [Variable(name, ValueType.FLOAT64), Constant(value, ValueType.FLOAT64)]
    left, right = rng.sample(sides, 2)
    item = property_of(f'R-{number}', Binary(operator, left, right))
    return replace(item, report=Report.OCCURRENCE)


def write(rng: Random, path: Path, count: int) -> Path:
    """Write a recording of messages at random times, in any storage."""
    inputs = tuple(item for item in VARIABLES if item.name not in NO_FIELDS)
    columns = random_trace(rng, inputs, count)
    late = {topic: rng.choice((0, 0, 5, 60)) for topic in TOPICS}
    storage = rng.choice([StoragePlugin.MCAP, StoragePlugin.SQLITE3])
    writer = Writer(path, version=9, storage_plugin=storage)
    if storage is StoragePlugin.SQLITE3 and rng.randrange(2):
        writer.set_compression(CompressionMode.MESSAGE, CompressionFormat.ZSTD)
    with writer:
        topics = {topic: writer.add_connection(topic, kind, typestore=TYPES)
                  for topic, kind in TOPICS.items()}
        time = START
        for row in range(count):
            topic = rng.choice([topic for topic, first in late.items() if first <= row] or [
                '/warm'])
            values = {INPUTS[item.name][1]: columns[item.name][row] for item in inputs
                      if '/' + INPUTS[item.name][0] == topic}
            stamp = time - rng.choice([0, 1, 10**6, REORDER_NS // 2, REORDER_NS - 1])
            kind = TOPICS[topic]
            writer.write(topics[topic], time, TYPES.serialize_cdr(
                message(kind, stamp, values), kind))
            time += rng.choice(GAPS_NS)
    return path


def message(kind: str, stamp: int, values: dict[str, Any]) -> Any:
    """Return a message of a type, with a stamp in its header and some values."""
    header = TYPES.types['std_msgs/msg/Header'](
        TYPES.types['builtin_interfaces/msg/Time'](*divmod(stamp, 10**9)), '')
    zero = dict.fromkeys((
        'temperature', 'variance', 'field_of_view', 'min_range', 'max_range', 'range', 'voltage',
        'current', 'charge', 'capacity', 'design_capacity', 'percentage'), 0.0)
    usual: dict[str, Any] = {
        **zero, 'radiation_type': 0, 'present': False, 'power_supply_status': 0,
        'power_supply_health': 0, 'power_supply_technology': 0, 'location': '',
        'serial_number': '', 'cell_voltage': numpy.zeros(0, numpy.float32),
        'cell_temperature': numpy.zeros(0, numpy.float32), **values}
    make: Any = TYPES.types[kind]
    return make(header=header, **{item.name: usual[item.name] for item in fields(make)
                                  if item.name in usual})
