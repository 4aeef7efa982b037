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

"""A manifest is read as written; a damaged one is refused with the key."""

from dataclasses import replace
from fractions import Fraction
import json
from pathlib import Path
from typing import Any

from fret_monitor.model.made import Made, MadeKind
from fret_monitor.model.manifest import (
    Manifest, ManifestAction, ManifestComparison, ManifestError, ManifestGate, ManifestGroup,
    ManifestInput, ManifestRequirement, ManifestTopic, ManifestVariable,
)
from fret_monitor.model.paths import LookUp, Sector, Slice
from fret_monitor.model.payload import PartKind, PayloadPart
from fret_monitor.model.policies import (
    ActionKind, InputSource, Otherwise, Policy, Report, Severity, Stale, Stamp,
)
from fret_monitor.model.probability import Probability
from fret_monitor.model.values import ValueType
from fret_monitor.native import LibraryError
from fret_monitor.native.folder import MANIFEST_FILE, open_folder
import pytest
from strategies import some

PROBABLE = Probability('>', Fraction(49, 50), Fraction(9, 10))
MANIFEST = Manifest(
    name='pump', symbol='fm_pump_monitor', component='', policy=Policy.PERIODIC, period=0.5,
    inputs=(ManifestInput('on', ValueType.BOOL, '/on', 'std_msgs/msg/Bool', ('data',), (), True),
            ManifestInput('mode', ValueType.INT32, '/m', 'm/msg/M',
                          ('modes', 3, LookUp(('key',), 'n', is_parallel=True), Slice(None, -1),
                           Sector(0.5, 1.0, 'x')),
                          (('A', 'a'), ('B', 'b')), 1),
            ManifestInput('level', ValueType.FLOAT64, None, None, (), (('FULL', 9),), -2.5,
                          'mean', 0.25, Stale.VIOLATE),
            ManifestInput('heard', ValueType.BOOL, '/on', 'std_msgs/msg/Bool', (), (), None,
                          source=InputSource.RECEIVED)),
    topics=(ManifestTopic('/on', 'std_msgs/msg/Bool', (0, 3), ()),
            ManifestTopic('/m', 'm/msg/M', (1,), (('depth', 5), ('reliability', 'reliable')),
                          Made(MadeKind.TRANSFORM, ('map', 'base_link')))),
    groups=(ManifestGroup((0, 1, 2), (0,), 8, 3),),
    requirements=(ManifestRequirement('R', 'handlerpropR', 'text', '', 'on', Report.ONSET,
                                      Severity.WARN, 0, (0, 2), (1,), (0,),
                                      probability=PROBABLE),),
    state_bytes=8, bundle_hash='b', source_hash='s', sources=('pump.h', 'pump.c'),
    margins='fm_pump_margins', comparisons=(ManifestComparison('level > 1.0', (0,)),),
    readers='fm_pump_readers', stamp=Stamp.HEADER, reorder=50_000_000,
    constants=(('v_max', '0.5'),),
    actions=(ManifestAction('call', ActionKind.CALL, '/stop', 'std_srvs/srv/Trigger', b'\0\1\0\0',
                            timeout=10 ** 9, retries=3, after=1, cooldown=2),
             ManifestAction('brake', ActionKind.PUBLISH, '/brake', 'm/msg/M', b'\0\1\0\0\xff', 4,
                            period=10, duration=20, parts=(
                                PayloadPart(PartKind.BYTES, 2, 4, 1),
                                PayloadPart(PartKind.KEY, keys=(0,))))),
    gate=ManifestGate('drive', '/raw', '/cmd', 'm/msg/M', False, 1, Otherwise.SUBSTITUTE,
                      substitute=b'\0\1\0\0', period=50_000_000, stamp_at=4, latches=True,
                      open_after=2 * 10 ** 9, timeout=10 ** 9),
    kept=(('other', ('R-2',)),),
    variables=(ManifestVariable('robot', ('alpha', ''), 2, 10 ** 9),), ids=('R-1', 'R-2'))

HUGE = 7 * 10 ** 400
ANYTHING: list[Any] = [None, True, -1, 0.5, float('nan'), HUGE, 'x\ud800', [], {}, [[]], [None]]

# What else a value may be, by its key; every other value of ANYTHING is refused.
ALLOWED: dict[str, list[Any]] = {
    'period': [0.5],
    'inputs[0].timeout': [None, 0.5],
    'inputs[0].startup': [None, 0.5],
    'inputs[1].timeout': [None, 0.5],
    'inputs[1].startup': [None, 0.5],
    'inputs[2].timeout': [None, 0.5],
    'inputs[2].startup': [None, 0.5],
    'inputs[3].timeout': [None, 0.5],
    'inputs[3].startup': [None, 0.5],
    'inputs[0].initial': [None, True],
    'inputs[1].initial': [None, -1],
    'inputs[2].initial': [None, -1, 0.5, float('nan')],
    'inputs[3].initial': [None, True],
    'inputs[1].values[0][1]': [-1, HUGE],
    'inputs[1].values[1][1]': [-1, HUGE],
    'inputs[2].values[0][1]': [-1, HUGE],
    **{f'topics[{index}].made': [None] for index in (0, 1)},
    'topics[1].made.patience': [0.5],
    'topics[1].qos[0][1]': [-1, HUGE],
    'topics[1].qos[1][1]': [-1, HUGE],
    'inputs[0].path[0]': [HUGE],
    'inputs[1].path[0]': [HUGE],
    **{f'inputs[1].path[{step}]': [HUGE] for step in range(1, 5)},
    'inputs[1].path[2].is_parallel': [True],
    **{f'inputs[1].path[3].{end}': [None, -1, HUGE] for end in ('start', 'stop')},
    **{f'inputs[1].path[4].{end}': [-1, 0.5, float('nan')] for end in ('first', 'width')},
    'groups[0].state_bytes': [HUGE],
    'groups[0].operations': [HUGE],
    'state_bytes': [HUGE],
    'requirements[0].horizon': [HUGE],
    'requirements[0].probability': [None],
    'variables[0].most': [HUGE],
    'gate': [None],
    **{f'{item}.stamp_at': [None, HUGE] for item in ('gate', 'actions[0]', 'actions[1]')},
    'gate.topic': [None],
    **{f'gate.{key}': [True] for key in ('is_service', 'is_open_when_stale', 'latches')},
    **{f'actions[{index}].retries': [HUGE] for index in (0, 1)},
}
# Lists that may be empty.
EMPTY = ('path', 'values', 'qos', 'sources', 'constants', 'on_violation', 'on_end',
         'kept', 'kept[0][1]', 'names', 'variables', 'keys', 'kinds', 'aggregates', 'ids',
         'comparisons', 'comparisons[0].inputs')
EMPTY_INDICES = ('topics[0].inputs', 'topics[1].inputs', 'groups[0].inputs',
                 'groups[0].requirements', 'requirements[0].inputs', 'requirements')
OPTIONAL = ('.topic', 'inputs[0].message_type', 'inputs[1].message_type',
            'inputs[2].message_type', 'inputs[3].message_type')


def places(content: Any, key: str = '') -> list[tuple[str, list[str | int]]]:
    """Return the key of every value below, and the way to it."""
    inner = content.items() if isinstance(content, dict) else \
        enumerate(content) if isinstance(content, list) else ()
    found: list[tuple[str, list[str | int]]] = []
    for step, value in inner:
        name = f'{key}[{step}]' if isinstance(step, int) else f'{key}.{step}'.lstrip('.')
        found += [(name, [step])]
        found += [(below, [step, *way]) for below, way in places(value, name)]
    return found


PLACES = places(json.loads(MANIFEST.to_json()))


def damaged(way: list[str | int], value: object) -> str:
    """Return the text of the manifest with another value at a place."""
    content = at = json.loads(MANIFEST.to_json())
    for step in way[:-1]:
        at = at[step]
    at[way[-1]] = value
    return json.dumps(content)


def is_allowed(key: str, value: object) -> bool:
    """Whether a value may stand at a key."""
    if value == []:
        return key.endswith(EMPTY) or key in EMPTY_INDICES and key != 'requirements'
    if value is None:
        return key.endswith(OPTIONAL) and not key.startswith('topics') \
            or None in ALLOWED.get(key, [])
    return any(type(item) is type(value) and repr(item)[:9] == repr(value)[:9]
               for item in ALLOWED.get(key, []) if isinstance(item, float)) \
        or any(type(item) is type(value) and item == value for item in ALLOWED.get(key, []))


def test_a_manifest_is_read_as_it_was_written() -> None:
    for item in (MANIFEST, replace(MANIFEST, policy=Policy.ALL_INPUTS, period=None),
                 replace(MANIFEST, policy=Policy.TIMED, period=None)):
        assert Manifest.from_json(item.to_json()) == item
        assert Manifest.from_json(item.to_json()).to_json() == item.to_json()


@pytest.mark.parametrize(('key', 'way'), some(PLACES, 3), ids=[
    key for key, _ in some(PLACES, 3)])
def test_a_value_of_another_kind_is_refused_with_its_key(key: str, way: list[str | int]) -> None:
    for value in ANYTHING:
        text = damaged(way, value)
        if is_allowed(key, value):
            Manifest.from_json(text)
            continue
        with pytest.raises(ManifestError) as caught:
            Manifest.from_json(text)
        if key == 'format' and value == HUGE:
            assert 'manifest has format 7000' in str(caught.value)
        elif value != [] or key not in (
                'inputs', 'topics', 'groups', 'requirements', 'actions'):
            assert f'({key}' in str(caught.value)  # else an index is what is out of range
        assert len(str(caught.value)) < 300
        assert str(caught.value).isprintable()


@pytest.mark.parametrize(('key', 'value', 'expected'), [
    ('source_hash', None, '(source_hash must be a text, not None)'),
    ('format', True, '(format must be a whole number from 0, not True)'),
    ('format', 1, 'manifest has format 1, this version reads 16: compile the bundle again'),
    ('period', 0, '(period must be a number of seconds above 0, not 0)'),
    ('period', float('inf'), '(period must be a number of seconds above 0, not inf)'),
    ('symbol', '../x', "(symbol must be a name in C, not '../x')"),
    ('symbol', 'x\x00', '(symbol must be a name in C'),
    ('readers', '../x', "(readers must be a name in C, not '../x')"),
    ('inputs[2].reduction', 'median', '(inputs[2].reduction must be one of seconds, len, min, '),
    ('policy', 'never', '(policy must be one of every_message, '),
    ('inputs[1].initial', 2 ** 31, '(inputs[1].initial must be a number of int32'),
    ('topics[0].inputs[0]', 4, '(topics[0].inputs[0] must be an index below 4'),
    ('groups[0].inputs[0]', 4, '(groups[0].inputs[0] must be an index below 4'),
    ('groups[0].requirements[0]', 1, '(groups[0].requirements[0] must be an index below 1'),
    ('requirements[0].group', 1, '(requirements[0].group must be an index below 1'),
    ('requirements[0].inputs[1]', 4, '(requirements[0].inputs[1] must be an index below 4'),
    ('topics[1].qos[0]', ['depth'], '(topics[1].qos[0] must be a list of two'),
    ('requirements[0].on_end[0]', 2, '(requirements[0].on_end[0] must be an index below 2'),
    ('actions[0].payload', 'abc', "(actions[0].payload must be bytes in hexadecimal, not 'abc'"),
    ('actions[1].parts[0].size', 2, '(actions[1].parts must be parts of the payload, not list'),
    ('actions[1].parts[0].at', 5, '(actions[1].parts must be parts of the payload, not list'),
    ('actions[1].parts[1].align', 3, '(actions[1].parts[1].align must be 1, 2, 4 or 8, not 3'),
    ('actions[0].kind', 'brake', '(actions[0].kind must be one of lock, publish, call, '),
    ('gate.topic', 2, '(gate.topic must be an index below 2'),
])
def test_the_error_says_what_is_wrong(key: str, value: object, expected: str) -> None:
    with pytest.raises(ManifestError) as caught:
        Manifest.from_json(damaged(dict(PLACES)[key], value))
    assert expected in str(caught.value)


@pytest.mark.parametrize('key', [key for key, way in PLACES if isinstance(way[-1], str)])
def test_a_key_that_is_missing_is_named(key: str) -> None:
    content = at = json.loads(MANIFEST.to_json())
    *way, last = dict(PLACES)[key]
    for step in way:
        at = at[step]
    del at[last]
    with pytest.raises(ManifestError) as caught:
        Manifest.from_json(json.dumps(content))
    assert f'({key} is missing)' in str(caught.value)


@pytest.mark.parametrize('text', [
    '', '{', 'null', '[]', '1', '"x"', '[' * 100_000, '1' * 10_000, '{"a":' * 100_000])
def test_what_is_no_manifest_at_all_is_refused(text: str) -> None:
    with pytest.raises(ManifestError, match='not a manifest of fret_monitor'):
        Manifest.from_json(text)


def test_a_folder_with_a_damaged_manifest_says_so(tmp_path: Path) -> None:
    (tmp_path / MANIFEST_FILE).write_text(damaged(['source_hash'], -1), encoding='utf-8')
    with pytest.raises(LibraryError, match=r'cannot read .*\(source_hash must be a text'):
        open_folder(tmp_path)
