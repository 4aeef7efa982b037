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

"""Keys in place of instance variables: the plain bundle, and aggregates as formulas."""

from dataclasses import replace
from itertools import product
from pathlib import Path
from random import Random

from fret_monitor.build import read
from fret_monitor.logic.evaluate import evaluate
from fret_monitor.logic.expansion import expanded, Expansion
from fret_monitor.logic.formula import Variable, variables as variables_of
from fret_monitor.logic.specification import Specification
from fret_monitor.model.manifest import ManifestVariable
from fret_monitor.model.policies import OverInstances
from keyed import (
    of_instances, OTHER, OWN, random_aggregate, random_bundle, random_requirement,
)
import pytest
from strategies import INPUTS, random_trace

KEYS = ('a', 'b', 'c')
FLEET = """\
format: 1
evaluation: {policy: relevant_message}
for_each:
  robot: [alpha]
  joint: [elbow]
  track: [t7]
inputs:
  speed: {topic: "/{robot}/speed", type: std_msgs/msg/Float32, timeout: 2}
  effort: {topic: joint_states, type: sensor_msgs/msg/JointState, field: "effort[name = {joint}]"}
  x: {topic: x, type: geometry_msgs/msg/PointStamped, where: "header.frame_id = {track}",
      field: point.x}
  near: {topic: "/{robot}/near", type: geometry_msgs/msg/PointStamped,
         where: "header.frame_id = {track}", field: point.y}
  on: {topic: enable, type: std_msgs/msg/Bool}
definitions:
  fast: speed > 0.5
requirements:
  - {id: SPEED, fretish: when on the robot shall within 2 ticks satisfy !fast}
  - {id: EFFORT, ptltl: "H (effort < 3.0)"}
  - {id: NEAR, cocospec: "(0.0 -> pre x) < 7.0"}
  - {id: PAIR, ptltl: "fast & x > 1.0 -> Y (near > 2.0)"}
  - {id: ON, ptltl: "O on"}
"""


def test_with_one_key_of_each_variable_it_is_the_bundle_in_which_they_are_written(
        tmp_path: Path) -> None:
    file, plain_file = tmp_path / 'fleet.yaml', tmp_path / 'plain.yaml'
    file.write_text(FLEET)
    head, rest = FLEET.split('for_each:')
    text = head + rest[rest.index('inputs:'):]
    for name, key in (('robot', 'alpha'), ('joint', 'elbow'), ('track', 't7')):
        text = text.replace(f'{{{name}}}', key)
    plain_file.write_text(text)
    found = expanded(read(file, takes_instances=True).specification,
                     {'robot': ['alpha'], 'joint': ['elbow'], 'track': ['t7']},
                     lambda name, _: name)
    plain = read(plain_file, takes_instances=True).specification
    assert found.signals == plain.signals
    assert found.definitions == plain.definitions
    assert [item.formula for item in found.properties] == [
        item.formula for item in plain.properties]
    assert [item.id for item in found.properties] == [
        'SPEED[robot=alpha]', 'EFFORT[joint=elbow]', 'NEAR[track=t7]',
        'PAIR[robot=alpha,track=t7]', 'ON']
    assert [item.handler for item in found.properties] == [
        'handlerpropSPEED_alpha', 'handlerpropEFFORT_elbow', 'handlerpropNEAR_t7',
        'handlerpropPAIR_alpha_t7', 'handlerpropON']


def with_pairs(rng: Random, specification: Specification) -> Specification:
    """Return a bundle with values over the pairs of its two variables, and what reads them."""
    found = [random_aggregate(rng, number, ('robot', 'joint'), 20, inputs=[*OWN, *OTHER])
             for number in range(3)]
    values = [Variable(item.signal.name, item.signal.type) for item in found]
    return replace(
        specification, aggregates=(*specification.aggregates, *found),
        signals=(*specification.signals, *(item.signal for item in found)),
        properties=(*specification.properties, *(random_requirement(
            rng, f'P-{number}', [*values, *INPUTS], values, 20, 1) for number in range(4))))


@pytest.mark.parametrize('seed', range(6))
def test_aggregates_are_those_of_all_instances_at_every_step(seed: int) -> None:
    rng = Random(f'expansion {seed}')
    variables = [ManifestVariable('robot', KEYS, 3), ManifestVariable('joint', KEYS[:2], 2)]
    whole = with_pairs(rng, random_bundle(rng, variables, levels=3))
    keys = {item.name: item.keys for item in variables}
    found = expanded(whole, keys)
    trace = random_trace(rng, [Variable(item.name, item.type) for item in found.signals], 60)
    own = Expansion(replace(whole, aggregates=()), keys)  # it leaves the names of aggregates
    values = dict(trace)
    sums_of_floats = set[str]()
    for one in whole.aggregates:
        each = [evaluate(own.formula(one.operand, tuple(zip(one.variables, written))), values)
                for written in product(*(keys[name] for name in one.variables))]
        values[one.signal.name] = [of_instances(one, row) for row in zip(*each, strict=True)]
        if one.function is OverInstances.SUM and one.operand.type.is_float or \
                sums_of_floats.intersection(item.name for item in variables_of(one.operand)):
            sums_of_floats.add(one.signal.name)  # rounded once there, at each addition here
    compared = {'R': 0, 'L': 0, 'B': 0, 'P': 0}
    by_id = {item.id: item for item in found.properties}
    for item in whole.properties:
        for new in own.properties(item) if not sums_of_floats.intersection(item.inputs) else ():
            expected = evaluate(new.formula, values, new.feedback)
            written = by_id[new.id]
            assert evaluate(written.formula, trace, written.feedback) == expected
            compared[item.id[0]] += len({*expected})
    assert min(compared.values()) > 2
