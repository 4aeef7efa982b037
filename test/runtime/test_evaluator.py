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

"""The evaluator's Python interface: values in, violations out, all counted."""

from array import array
from dataclasses import replace
from functools import cache
import gc
import math
from pathlib import Path
from typing import Any

from fret_monitor.model.manifest import Manifest, ManifestInput, ManifestTopic
from fret_monitor.model.policies import Policy, Stale
from fret_monitor.model.values import ValueType
from fret_monitor.native import build_library, evaluator_library, LibraryError, load
from fret_monitor.runtime import (
    Evaluator, InputCounts, NEVER, RequirementCounts, TimeCounts, TopicCounts, Violation,
)
from hypothesis import given
from hypothesis import strategies as st
from native import toys
import pytest
from runtime.seen import is_stale, Silence, silence_of

FLAG, LEVEL = 0, 1
LAMP, COOL = 0, 1
SECOND = 10**9


@cache
def toy_library() -> Path:
    return build_library({'toy.c': toys.source()}, name='toy')


def toy(manifest: Manifest | None = None, *, policy: Policy | None = None) -> Evaluator:
    monitor = load(toy_library(), manifest or toys.manifest())
    return Evaluator(monitor, policy=policy, library=evaluator_library())


def with_timeout(manifest: Manifest) -> Manifest:
    """Let FLAG violate its requirements after a second of silence."""
    flag = replace(manifest.inputs[FLAG], timeout=1.0, stale=Stale.VIOLATE)
    return replace(manifest, inputs=(flag, *manifest.inputs[1:]))


@cache
def typed_library() -> Path:
    """Build a monitor with an input of each type, and no requirement."""
    types = list(ValueType)
    names = {ValueType.BOOL: 'bool', ValueType.FLOAT32: 'float', ValueType.FLOAT64: 'double'}
    fields = ''.join(f'{names.get(item, item.value + "_t")} v_{item.value};' for item in types)
    table = ''.join(
        f'{{"{item.value}", (uint32_t)offsetof(struct inputs, v_{item.value}), FM_{item.name}}},'
        for item in types)
    return build_library({'typed.c': (
        '#include "fret_monitor.h"\n'
        f'struct inputs {{{fields}}};\n'
        f'static const struct fm_input INPUTS[] = {{{table}}};\n'
        'static const struct fm_monitor MONITOR = {FM_ABI, 11, 0, 0, 0, sizeof(struct inputs),\n'
        '  INPUTS, NULL, NULL, "typed", "", NULL, NULL, 0, NULL};\n'
        'FM_EXPORT const struct fm_monitor * fm_typed_monitor(void);\n'
        'const struct fm_monitor * fm_typed_monitor(void) {return &MONITOR;}\n')}, name='typed')


def typed(initial: dict[ValueType, Any] | None = None) -> Evaluator:
    inputs = tuple(
        ManifestInput(item.value, item, None, None, (), (), (initial or {}).get(item))
        for item in ValueType)
    manifest = replace(
        toys.manifest(), symbol='fm_typed_monitor', inputs=inputs, topics=(), groups=(),
        requirements=())
    return Evaluator(load(typed_library(), manifest))


def index(value_type: ValueType) -> int:
    return list(ValueType).index(value_type)


RANGES = {
    ValueType.BOOL: (0, 1),
    ValueType.INT8: (-2**7, 2**7 - 1),
    ValueType.INT16: (-2**15, 2**15 - 1),
    ValueType.INT32: (-2**31, 2**31 - 1),
    ValueType.INT64: (-2**63, 2**63 - 1),
    ValueType.UINT8: (0, 2**8 - 1),
    ValueType.UINT16: (0, 2**16 - 1),
    ValueType.UINT32: (0, 2**32 - 1),
    ValueType.UINT64: (0, 2**64 - 1),
}


# ---- values --------------------------------------------------------------------------------


@pytest.mark.parametrize('value_type', RANGES)
def test_an_integer_is_stored_exactly(value_type: ValueType) -> None:
    evaluator = typed()
    for value in (*RANGES[value_type], 0, 1):
        evaluator.store(index(value_type), value)
        assert evaluator.value(index(value_type)) == value
    assert isinstance(evaluator.value(0), bool | None)


@pytest.mark.parametrize('value_type', RANGES)
def test_an_integer_out_of_range_is_refused_and_changes_nothing(value_type: ValueType) -> None:
    evaluator = typed()
    low, high = RANGES[value_type]
    evaluator.store(index(value_type), high)
    for value in (low - 1, high + 1, 10**30):
        with pytest.raises(OverflowError):
            evaluator.store(index(value_type), value)
    assert evaluator.value(index(value_type)) == high
    assert evaluator.input_counts(index(value_type)).received == 1


@pytest.mark.parametrize('value_type', ValueType)
def test_a_value_of_a_wrong_kind_is_refused(value_type: ValueType) -> None:
    evaluator = typed()
    wrong: list[Any] = ['1', None, [1]]
    for value in [*wrong, *([] if value_type.is_float else [1.0])]:
        with pytest.raises(TypeError):
            evaluator.store(index(value_type), value)
    assert evaluator.value(index(value_type)) is None


@pytest.mark.parametrize('value', [0.1, -0.0, math.inf, 1e300, 5e-324, 3])
def test_a_float_is_stored_and_a_float32_rounded_once(value: float) -> None:
    evaluator = typed()
    evaluator.store(index(ValueType.FLOAT64), value)
    evaluator.store(index(ValueType.FLOAT32), value)
    assert repr(evaluator.value(index(ValueType.FLOAT64))) == repr(float(value))
    rounded = math.inf if value == 1e300 else array('f', [value])[0]
    assert repr(evaluator.value(index(ValueType.FLOAT32))) == repr(rounded)


def test_nan_is_a_value() -> None:
    evaluator = typed()
    evaluator.store(index(ValueType.FLOAT32), math.nan)
    value = evaluator.value(index(ValueType.FLOAT32))
    assert value is not None and math.isnan(value)


def test_an_input_without_a_value_has_none() -> None:
    evaluator = toy()
    assert evaluator.value(FLAG) is None
    evaluator.store(FLAG, False)
    assert evaluator.value(FLAG) is False


def test_an_input_that_does_not_exist_is_refused() -> None:
    evaluator = toy()
    with pytest.raises(IndexError):
        evaluator.store(2, 1)
    with pytest.raises(IndexError):
        evaluator.value(2)


def test_initial_values_exist_from_the_start_and_do_not_count_as_received() -> None:
    evaluator = toy(toys.with_initial(True, -300))
    assert (evaluator.value(FLAG), evaluator.value(LEVEL)) == (True, -300)
    assert evaluator.ready(0) and evaluator.ready(1)
    assert evaluator.input_counts(LEVEL) == InputCounts(0, 0, 0)


# ---- steps ---------------------------------------------------------------------------------


def test_a_message_steps_the_ready_groups_and_returns_violations() -> None:
    evaluator = toy()
    evaluator.store(FLAG, False)
    assert not evaluator.ready(1)
    assert evaluator.message(FLAG, 7) == [Violation(requirement=LAMP, step=0, stamp=7)]
    evaluator.store(LEVEL, 30)
    assert evaluator.message(LEVEL, 8) == [Violation(LAMP, 1, 8), Violation(COOL, 0, 8)]
    assert evaluator.message(LEVEL, 9) == [Violation(LAMP, 2, 9)], 'COOL reports its onset'
    evaluator.store(FLAG, True)
    assert evaluator.message(FLAG, 10) == []
    assert evaluator.verdicts == [True, False]
    assert (evaluator.steps(0), evaluator.steps(1)) == (4, 3)


def test_the_policy_is_that_of_the_manifest_unless_given() -> None:
    assert toy(toys.manifest(policy=Policy.PERIODIC)).policy is Policy.PERIODIC
    steps = {}
    for policy in set(Policy) - {Policy.TIMED}:
        evaluator = toy(policy=policy)
        for topic in (LEVEL, FLAG, FLAG):
            evaluator.store(topic, 1)
            evaluator.message(topic, 0)
        steps[policy] = (evaluator.steps(0), evaluator.steps(1))
    assert steps == {
        Policy.EVERY_MESSAGE: (2, 2), Policy.RELEVANT_MESSAGE: (2, 2),
        Policy.ALL_INPUTS: (2, 1), Policy.PERIODIC: (0, 0)}


def test_a_monitor_that_steps_is_refused_under_the_policy_timed() -> None:
    with pytest.raises(LibraryError, match='refuses'):
        toy(policy=Policy.TIMED)


def test_a_row_steps_the_ready_groups_with_every_policy() -> None:
    evaluator = toy(policy=Policy.PERIODIC)
    evaluator.store(FLAG, False)
    assert evaluator.message(FLAG, 1) == []
    assert evaluator.step(-5) == [Violation(LAMP, 0, -5)]


def test_a_reset_restarts_the_state_and_keeps_values_and_counters() -> None:
    evaluator = toy(toys.with_initial(False, 30))
    evaluator.step(0)
    evaluator.reset()
    assert evaluator.verdicts == [True, True] and evaluator.steps(0) == 0
    assert evaluator.step(1) == [Violation(LAMP, 0, 1), Violation(COOL, 0, 1)]
    assert evaluator.requirement_counts(COOL) == RequirementCounts(2, 2, 2, False, False, True)


def test_requirements_on_a_silent_input_are_violated_until_its_next_message() -> None:
    evaluator = toy(with_timeout(toys.with_initial(True, 0)))
    assert evaluator.advance(0) == [] and evaluator.deadline == SECOND
    evaluator.store(FLAG, True, now=5)
    assert evaluator.advance(SECOND) == [], 'a value came meanwhile'
    assert evaluator.deadline == SECOND + 5
    assert evaluator.advance(10 * SECOND) == [
        Violation(LAMP, 0, SECOND + 5), Violation(COOL, 0, SECOND + 5)]
    assert evaluator.advance(20 * SECOND) == [] and is_stale(evaluator, FLAG)
    assert silence_of(evaluator, FLAG) == Silence(1, 20 * SECOND - 5, True)
    assert not is_stale(evaluator, LEVEL) and evaluator.deadline == NEVER
    assert evaluator.step(7) == [Violation(LAMP, 0, 7)], 'COOL reports its onset'
    assert evaluator.requirement_counts(LAMP) == RequirementCounts(1, 2, 2, False, False, True)
    evaluator.store(FLAG, True, now=21 * SECOND)
    assert silence_of(evaluator, FLAG) == Silence(1, 21 * SECOND - 5, False)
    assert evaluator.message(FLAG, 8) == [] and evaluator.verdicts == [True, True]


def test_a_value_without_a_time_is_received_at_the_time_of_the_evaluator() -> None:
    evaluator = toy(with_timeout(toys.with_initial(True, 0)))
    assert evaluator.advance(100 * SECOND) == []
    assert evaluator.advance(100 * SECOND + 5) == []
    evaluator.store(FLAG, True)
    assert evaluator.deadline == 101 * SECOND + 5
    assert evaluator.advance(101 * SECOND + 4) == [] and not is_stale(evaluator, FLAG)
    evaluator.store(FLAG, True, 0)
    assert evaluator.advance(101 * SECOND + 4) != [], 'received at 0'


def test_a_silence_found_after_a_stop_is_put_off_once_and_stamped_with_its_end() -> None:
    monitor = load(toy_library(), with_timeout(toys.with_initial(True, 0)))
    evaluator = Evaluator(monitor, patience=0.01, library=evaluator_library())
    evaluator.advance(0)
    assert evaluator.advance(5 * SECOND) == [] and evaluator.deadline == 6 * SECOND
    assert [item.stamp for item in evaluator.advance(60 * SECOND)] == [SECOND] * 2


def test_each_period_is_stamped_with_its_own_instant_however_late_it_is_taken() -> None:
    monitor = load(toy_library(), toys.with_initial(False, 0))
    evaluator = Evaluator(
        monitor, policy=Policy.PERIODIC, period=1.0, library=evaluator_library())
    assert evaluator.deadline == -2**63, 'the time has not begun'
    assert evaluator.advance(7) == []
    assert evaluator.advance(SECOND + 6) == []
    assert evaluator.advance(5 * SECOND) == [
        Violation(LAMP, number, (number + 1) * SECOND + 7) for number in range(4)]
    assert evaluator.time_counts() == TimeCounts(periods=4, late=4, missed=0, restarts=0)
    evaluator.advance(2000 * SECOND)
    assert evaluator.time_counts() == TimeCounts(periods=1004, late=1004, missed=995, restarts=0)
    evaluator.advance(0)
    assert evaluator.time_counts().restarts == 1
    assert evaluator.deadline == 7, 'what was to come in 7 ns still does'


def test_everything_is_counted() -> None:
    evaluator = toy(policy=Policy.ALL_INPUTS)
    for value in (1, 2, 30):
        evaluator.store(LEVEL, value)
        evaluator.message(LEVEL, 0)
    evaluator.unusable(LEVEL)
    evaluator.undecodable(LEVEL)
    evaluator.store(FLAG, True)
    evaluator.message(FLAG, 0)
    assert evaluator.input_counts(LEVEL) == InputCounts(received=3, unusable=1, overwritten=2)
    assert evaluator.topic_counts(LEVEL) == TopicCounts(messages=3, undecodable=1)
    assert evaluator.requirement_counts(LAMP) == RequirementCounts(1, 0, 0, True, True, False)
    assert evaluator.requirement_counts(COOL) == RequirementCounts(1, 1, 1, False, False, True)
    assert evaluator.requirement_counts(99) == RequirementCounts(0, 0, 0, True, True, False)


# ---- rows ----------------------------------------------------------------------------------


def table(evaluator: Evaluator, columns: list[Any], count: int) -> bytes:
    """Return the verdicts of rows that are a nanosecond apart."""
    return b''.join(found for _, found in evaluator.rows(columns, array('q', range(count))))


@given(st.lists(st.tuples(st.booleans(), st.integers(0, 20)), max_size=30))
def test_rows_together_give_the_verdicts_of_rows_one_by_one(rows: list[tuple[bool, int]]) -> None:
    at_once, one_by_one = toy(), toy()
    columns = [array('B', [flag for flag, _ in rows]), array('h', [level for _, level in rows])]
    found = table(at_once, columns, len(rows))
    expected = bytearray()
    for flag, level in rows:
        one_by_one.store(FLAG, flag)
        one_by_one.store(LEVEL, level)
        one_by_one.step(0)
        expected += bytes(one_by_one.verdicts)
    assert found == expected
    for requirement in (LAMP, COOL):
        assert (at_once.requirement_counts(requirement)
                == one_by_one.requirement_counts(requirement))


def test_rows_take_columns_of_every_type() -> None:
    evaluator = typed()
    columns = [array(item.typecode, [0, 1]) for item in ValueType]
    assert table(evaluator, columns, 2) == b''
    assert [evaluator.value(item) for item in range(len(columns))] == [1] * len(columns)


def test_a_row_without_a_column_leaves_the_input_as_it_is() -> None:
    evaluator = toy(toys.with_initial(True, None))
    assert table(evaluator, [None, array('h', [1, 30])], 2) == bytes([1, 1, 1, 0])


@pytest.mark.parametrize('columns', [
    [array('B', [1]), array('h', [1, 2])],
    [array('B', [1]), array('i', [1])],
    [array('B', [1])],
    [array('B', [1]), array('h', [1]), array('h', [1])],
])
def test_columns_that_do_not_fit_are_refused(columns: list['array[Any]']) -> None:
    with pytest.raises(ValueError, match='column'):
        table(toy(), columns, 1)


# ---- mismatches and ownership --------------------------------------------------------------


@pytest.mark.parametrize('topics', [
    (ManifestTopic('/flag', 'std_msgs/msg/Bool', (7,), ()),),
    (ManifestTopic('/flag', 'std_msgs/msg/Bool', (-1,), ()),),
    (ManifestTopic('/flag', 'std_msgs/msg/Bool', (0,), ()),
     ManifestTopic('/lamp', 'std_msgs/msg/Bool', (0,), ())),
])
def test_a_manifest_with_wrong_topics_is_refused(topics: tuple[ManifestTopic, ...]) -> None:
    with pytest.raises(LibraryError):
        toy(replace(toys.manifest(), topics=topics))


@pytest.mark.parametrize('initial', [(2, 0), (True, 40000)])
def test_a_manifest_with_wrong_initial_values_is_refused(initial: tuple[int, int]) -> None:
    with pytest.raises(LibraryError, match='does not fit C'):
        toy(toys.with_initial(*initial))


def test_an_evaluator_keeps_its_library_alive() -> None:
    evaluator = toy(toys.with_initial(False, 0))
    gc.collect()
    assert evaluator.step(0) == [Violation(LAMP, 0, 0)]
    violations = evaluator.step(1)
    del evaluator
    gc.collect()
    assert violations == [Violation(LAMP, 1, 1)]


def test_evaluators_of_one_monitor_are_independent() -> None:
    monitor = load(toy_library(), toys.manifest())
    one, other = Evaluator(monitor), Evaluator(monitor)
    one.store(FLAG, False)
    one.step(0)
    assert other.value(FLAG) is None and other.verdicts == [True, True]


def test_the_memory_of_an_evaluator_is_aligned() -> None:
    for _ in range(8):
        address = str(toy().pointer).rpartition('0x')[2].rstrip('>')
        assert int(address, 16) % 16 == 0
