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
A small hand-written compiled bundle: C text and its manifest.

Two inputs and two groups. Group 0 reads `flag` and holds LAMP: flag. Group 1 reads both and holds
COOL: level < limit, where the limit is 10. The state counts the steps of each group.
"""

from dataclasses import replace

from fret_monitor.model.manifest import (
    Manifest, ManifestGroup, ManifestInput, ManifestRequirement, ManifestTopic,
)
from fret_monitor.model.policies import Policy, Report, Severity
from fret_monitor.model.values import ValueType

SYMBOL = 'fm_toy_monitor'

SOURCE = """\
#include "fret_monitor.h"

struct inputs
{
  bool flag;
  int16_t level;
};

struct state
{
  uint64_t steps[2];
};

static void reset_0(void * state)
{
  ((struct state *)state)->steps[0] = 0;
}

static void reset_1(void * state)
{
  ((struct state *)state)->steps[1] = 0;
}

static void step_0(void * state, const void * inputs, bool * verdicts)
{
  ((struct state *)state)->steps[0] += 1;
  verdicts[0] = ((const struct inputs *)inputs)->flag;
}

static void step_1(void * state, const void * inputs, bool * verdicts)
{
  ((struct state *)state)->steps[1] += 1;
  verdicts[1] = ((const struct inputs *)inputs)->level < LIMIT;
}

static const struct fm_input INPUTS[] = {
  {"flag", (uint32_t)offsetof(struct inputs, flag), FM_BOOL},
  {"level", (uint32_t)offsetof(struct inputs, level), FM_INT16},
};
static const uint32_t FIRST_TWO[] = {0, 1};
static const struct fm_group GROUPS[] = {
  {FIRST_TWO, 1, FIRST_TWO, 1, reset_0, step_0, NULL},
  {FIRST_TWO, 2, FIRST_TWO + 1, 1, reset_1, step_1, NULL},
};
static const struct fm_requirement REQUIREMENTS[] = {{"LAMP", 0}, {"COOL", 1}};
static const struct fm_monitor MONITOR = {
  FM_ABI, 2, 2, 2, sizeof(struct state), sizeof(struct inputs),
  INPUTS, GROUPS, REQUIREMENTS, "toy", "HASH", NULL, NULL, 0, NULL
};

FM_EXPORT const struct fm_monitor * fm_toy_monitor(void);

const struct fm_monitor * fm_toy_monitor(void)
{
  return &MONITOR;
}
"""


def source(*, limit: int = 10, source_hash: str = '') -> str:
    """Return the C text of the toy."""
    return SOURCE.replace('LIMIT', str(limit)).replace('HASH', source_hash)


def manifest(*, policy: Policy = Policy.EVERY_MESSAGE) -> Manifest:
    """Return the manifest of the toy; topic 0 feeds `flag`, topic 1 `level`."""
    return Manifest(
        name='toy', symbol=SYMBOL, component='', policy=policy, period=None,
        inputs=(_input('flag', ValueType.BOOL), _input('level', ValueType.INT16)),
        topics=(ManifestTopic('/flag', 'std_msgs/msg/Bool', (0,), ()),
                ManifestTopic('/level', 'std_msgs/msg/Int16', (1,), ())),
        groups=(ManifestGroup((0,), (0,), 8, 1), ManifestGroup((0, 1), (1,), 8, 1)),
        requirements=(_requirement('LAMP', 0, Report.EVERY_STEP),
                      _requirement('COOL', 1, Report.ONSET)),
        state_bytes=16, bundle_hash='', source_hash='', sources=('toy.c',))


def with_initial(flag: bool | int | None, level: bool | int | None) -> Manifest:
    """Return the manifest of the toy with initial values."""
    made = manifest()
    return replace(made, inputs=(
        replace(made.inputs[0], initial=flag), replace(made.inputs[1], initial=level)))


def _input(name: str, value_type: ValueType) -> ManifestInput:
    message = {ValueType.BOOL: 'std_msgs/msg/Bool', ValueType.INT16: 'std_msgs/msg/Int16'}
    return ManifestInput(
        name, value_type, f'/{name}', message[value_type], ('data',), (), None)


def _requirement(name: str, group: int, report: Report) -> ManifestRequirement:
    return ManifestRequirement(
        id=name, handler=f'handlerprop{name}', text='', title='', formula='', report=report,
        severity=Severity.ERROR, group=group, inputs=(0, 1)[:group + 1])
