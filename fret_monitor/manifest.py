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
What the run-time must know of a compiled bundle; frozen, and JSON on disk.

The manifest is all a node needs beside the shared library: it names topics, types, fields, step
groups, ids, texts and policy, so that a robot runs a monitor with neither parser nor compiler.
Its JSON carries a format number; a manifest of another format is refused.
"""

from dataclasses import asdict, dataclass
from enum import Enum
import json
from typing import Any

FORMAT = 1


class ManifestError(Exception):
    """A manifest that cannot be read: not JSON, of another format, or incomplete."""


class ValueType(Enum):
    """The type of an input or of a term; the value is its name in ROS message definitions."""

    BOOL = 'bool'
    INT8 = 'int8'
    INT16 = 'int16'
    INT32 = 'int32'
    INT64 = 'int64'
    UINT8 = 'uint8'
    UINT16 = 'uint16'
    UINT32 = 'uint32'
    UINT64 = 'uint64'
    FLOAT32 = 'float32'
    FLOAT64 = 'float64'

    @property
    def is_integer(self) -> bool:
        """Whether it is one of the eight integer types."""
        return 'int' in self.value

    @property
    def is_float(self) -> bool:
        """Whether it is float32 or float64."""
        return self.value.startswith('float')

    @property
    def is_number(self) -> bool:
        """Whether it is any type but bool."""
        return self is not ValueType.BOOL


class Policy(Enum):
    """When a step happens (DESIGN 6)."""

    EVERY_MESSAGE = 'every_message'
    RELEVANT_MESSAGE = 'relevant_message'
    ALL_INPUTS = 'all_inputs'
    PERIODIC = 'periodic'


class Report(Enum):
    """Which violating steps of a requirement are announced."""

    EVERY_STEP = 'every_step'
    ONSET = 'onset'


class Severity(Enum):
    """How a violation of a requirement is logged."""

    ERROR = 'error'
    WARN = 'warn'


@dataclass(frozen=True)
class ManifestInput:
    """
    One input, in the order of the C struct.

    `value_type` is how it is stored. `values` are its names: (name, number or string); a string
    input is stored as int32, the index of its string in `values`. `initial` is None or the value
    it starts with, as stored. `path` is the field path within the message, one step each:
    a field name or an index.
    """

    name: str
    value_type: ValueType
    topic: str | None
    message_type: str | None
    path: tuple[str | int, ...]
    values: tuple[tuple[str, int | str], ...]
    initial: bool | int | float | None

    @property
    def is_string(self) -> bool:
        """Whether the message field is a string, mapped through `values`."""
        return any(isinstance(value, str) for _, value in self.values)


@dataclass(frozen=True)
class ManifestTopic:
    """A mapped topic: its type, the inputs it feeds (indices), and the bundle's `qos` for it."""

    name: str
    message_type: str
    inputs: tuple[int, ...]
    qos: tuple[tuple[str, str | int], ...]


@dataclass(frozen=True)
class ManifestGroup:
    """A step group: the inputs it reads and the requirements it holds, as indices."""

    inputs: tuple[int, ...]
    requirements: tuple[int, ...]
    state_bytes: int
    operations: int


@dataclass(frozen=True)
class ManifestRequirement:
    """A requirement as the run-time shows it. `inputs` are indices; `group` is one too."""

    id: str
    handler: str
    text: str
    title: str
    formula: str
    report: Report
    severity: Severity
    group: int
    inputs: tuple[int, ...]


@dataclass(frozen=True)
class Manifest:
    """
    All that the run-time must know.

    `symbol` is the one name the library exports that leads to all others. `bundle_hash` is the
    SHA-256 of what was compiled (bundle, signals files, message definitions), `source_hash` of
    the C text; `sources` are the file names of the generated C. `period` is in seconds.
    """

    name: str
    symbol: str
    component: str
    policy: Policy
    period: float | None
    inputs: tuple[ManifestInput, ...]
    topics: tuple[ManifestTopic, ...]
    groups: tuple[ManifestGroup, ...]
    requirements: tuple[ManifestRequirement, ...]
    state_bytes: int
    bundle_hash: str
    source_hash: str
    sources: tuple[str, ...]

    def to_json(self) -> str:
        """Return the JSON text, the same for the same manifest."""
        content = {'format': FORMAT, **asdict(self)}
        return json.dumps(content, indent=1, default=_plain, ensure_ascii=False) + '\n'

    @classmethod
    def from_json(cls, text: str) -> 'Manifest':
        """
        Read what `to_json` wrote.

        Raises
        ------
        ManifestError
            if the text is not such JSON, or of another format.
        """
        try:
            content = json.loads(text)
            if content['format'] != FORMAT:
                raise ManifestError(
                    f"manifest has format {content['format']}, this version reads {FORMAT}: "
                    'compile the bundle again')
            return _manifest(content)
        except (KeyError, TypeError, ValueError) as error:
            raise ManifestError(f'not a manifest of fret_monitor ({error})') from None


def _plain(value: object) -> object:
    if isinstance(value, Enum):
        return value.value
    raise TypeError(f'{value!r} is not part of a manifest')


def _manifest(content: dict[str, Any]) -> Manifest:
    return Manifest(
        name=content['name'],
        symbol=content['symbol'],
        component=content['component'],
        policy=Policy(content['policy']),
        period=content['period'],
        inputs=tuple(_input(item) for item in content['inputs']),
        topics=tuple(_topic(item) for item in content['topics']),
        groups=tuple(_group(item) for item in content['groups']),
        requirements=tuple(_requirement(item) for item in content['requirements']),
        state_bytes=content['state_bytes'],
        bundle_hash=content['bundle_hash'],
        source_hash=content['source_hash'],
        sources=tuple(content['sources']),
    )


def _input(item: dict[str, Any]) -> ManifestInput:
    return ManifestInput(**{
        **item,
        'value_type': ValueType(item['value_type']),
        'path': tuple(item['path']),
        'values': tuple((name, value) for name, value in item['values']),
    })


def _topic(item: dict[str, Any]) -> ManifestTopic:
    return ManifestTopic(**{
        **item,
        'inputs': tuple(item['inputs']),
        'qos': tuple((key, value) for key, value in item['qos']),
    })


def _group(item: dict[str, Any]) -> ManifestGroup:
    return ManifestGroup(**{
        **item,
        'inputs': tuple(item['inputs']),
        'requirements': tuple(item['requirements']),
    })


def _requirement(item: dict[str, Any]) -> ManifestRequirement:
    return ManifestRequirement(**{
        **item,
        'report': Report(item['report']),
        'severity': Severity(item['severity']),
        'inputs': tuple(item['inputs']),
    })
