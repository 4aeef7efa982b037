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
The ROS parameters of the nodes: described, checked, and what they mean. Without rclpy.

All problems are reported together, each with what to write instead.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import zip_longest
from math import isfinite
from pathlib import Path
import re
from typing import Any, cast

from fret_monitor.model.bundle_files import find_bundle
from fret_monitor.model.diagnostics import CompileError, Source, Text
from fret_monitor.model.frozen import frozen
from fret_monitor.model.policies import Policy
from fret_monitor.native import words

CONSTANTS = 'constants.'


@dataclass(frozen=True)
class Described:
    """
    A parameter: its default, its description, and whether it is read-only.

    `kind` says which values it takes, and `wanted` says it to the user (`parameter_table.h`).
    """

    default: Any
    description: str
    read_only: bool = False
    kind: str = ''
    least: int = 0
    most: int = 0
    wanted: str = ''

    def takes(self, value: object) -> bool:
        """Return whether a value can be used."""
        is_number = type(value) in (int, float)
        match self.kind:
            case 'FLAG':
                return isinstance(value, bool)
            case 'COUNT':
                return type(value) is int and self.least <= value <= self.most
            case 'SECONDS':
                return is_number and self.least < cast(float, value) <= self.most
            case 'CHOICE' | 'SWITCH':
                is_word = value in ('', *self.wanted.removeprefix(_ONE_OF).split(', '))
                return is_word or (self.kind == 'SWITCH' and isinstance(value, bool))
            case _:
                return isinstance(value, str) or (self.kind == 'NUMBERS' and type(value) is int)


_ONE_OF = 'one of '
_SPEC = ("the bundle: a path, package://PKG/PATH, or the name of a file in this package's config "
         'folder; or a list of them')
_LIBRARY = ('the folder of a compiled bundle, instead of `spec`; if both are given, it must have '
            'been compiled from that bundle; a list for several')
_POLICIES = ', '.join(item.value for item in Policy)

OF_BOTH = {
    name: Described(usual, description, settable == 'AT_START', kind, least, most, wanted)
    for name, kind, settable, usual, least, most, wanted, description in words.PARAMETERS}
"""The parameters that the node in C has, too."""

MONITOR_PARAMETERS = {
    'spec': Described('', f'{_SPEC}; read by `configure`'),
    'library': Described('', f'{_LIBRARY}; read by `configure`'),
    'policy': Described('', f"when a step happens: {_POLICIES}; empty for the bundle's; read by "
                            '`configure`', kind='CHOICE', wanted=_ONE_OF + _POLICIES),
    'period': Described(0.0, 'seconds between two steps, with the policy periodic; 0 for the '
                             "bundle's; read by `configure`"),
    'rate': Described(0.0, 'steps a second, with the policy periodic, instead of a period; 0 for '
                           "the bundle's; read by `configure`"),
    'metrics': Described('', 'the address and port at which the figures of /diagnostics are '
                             'served for Prometheus, such as 127.0.0.1:9400; empty: nowhere; '
                             'read by `configure`'),
    'native': Described(False, 'whether the process becomes a node in C that is built for the '
                               'bundle once; read at the start', read_only=True, kind='FLAG',
                        wanted=OF_BOTH['autostart'].wanted),
    **OF_BOTH,
}
CONSTANT = "a constant of a bundle, with a value in place of the bundle's; read by `configure`"
GATE_PARAMETERS = {
    'gates': Described('', 'the gates of the bundles to run, a name or a list; empty for all; '
                           'read by `configure`'),
    **{name: item for name, item in MONITOR_PARAMETERS.items()
       if name not in ('period', 'rate')},
}
LOGGER_PARAMETERS = {
    'spec': Described('', _SPEC, read_only=True),
    'library': Described('', _LIBRARY, read_only=True),
    'policy': Described('', "as the monitor's", read_only=True),
    'period': Described(0.0, "as the monitor's: a bundle may leave it to the parameter",
                        read_only=True),
    'rate': Described(0.0, "as the monitor's, instead of a period", read_only=True),
    'handler_depth': Described(
        OF_BOTH['handler_depth'].default, 'violations of one handler that may wait in this node',
        read_only=True),
    'log_level': OF_BOTH['log_level'],
}

_ADDRESS = re.compile(r'(?P<host>\[[0-9A-Fa-f:.]+(?:%[\w.-]+)?\]|[\w.-]+):(?P<port>[0-9]{1,5})')
_LARGEST_PORT = 65535
# Parameters of rclpy and of both nodes: one parameter file may be given to both.
KNOWN = {'use_sim_time', 'start_type_description_service',
         *MONITOR_PARAMETERS, *GATE_PARAMETERS, *LOGGER_PARAMETERS}


class Refusal(Exception):
    """Reasons not to start, in words for the user."""

    def __init__(self, *problems: str, heading: str = 'error: ') -> None:
        """Take one problem or more; the heading precedes each of them in the text."""
        self.problems = problems
        super().__init__('\n'.join(heading + problem for problem in problems))


@dataclass(frozen=True)
class Origin:
    """Where a bundle comes from: its file, its compiled folder, or both."""

    spec: Path | None
    library: Path | None

    def __str__(self) -> str:
        """Return the path of the bundle, or else of the compiled folder."""
        return str(self.spec or self.library)


@frozen
class BlackBoxSettings:
    """
    Where the last messages are written, and how many.

    `seconds` before a violation; `memory_bytes` for messages; `files` and `disk_bytes` are those
    of the folder, at most.
    """

    folder: Path
    seconds: float = 10.0
    memory_bytes: int = 64 << 20
    files: int = 20
    disk_bytes: int = 1 << 30


@dataclass(frozen=True)
class MetricsAddress:
    """Where figures are served; port 0 is any free one."""

    host: str
    port: int

    def __str__(self) -> str:
        """Return it as in a URL."""
        return f'[{self.host}]:{self.port}' if ':' in self.host else f'{self.host}:{self.port}'


@dataclass(frozen=True)
class Settings:
    """
    The bundles to monitor, and what overrides them; `period` is in seconds, exact.

    `gates`: the gates to run; () for all. `priority` and what follows it is asked of the system.
    """

    origins: tuple[Origin, ...]
    policy: Policy | None = None
    period: Fraction | None = None
    hot_path: str = 'auto'
    handler_depth: int = OF_BOTH['handler_depth'].default
    log_violations: bool = True
    publishes_verdicts: bool = False
    metrics: MetricsAddress | None = None
    constants: Mapping[str, Text] = field(default_factory=dict)
    blackbox: BlackBoxSettings | None = None
    gates: tuple[str, ...] = ()
    margins: bool = False
    priority: int = 0
    processors: str = ''
    locks_memory: bool = False


class Given:
    """The values of parameters, by name, and the `problems` of those that cannot be used."""

    def __init__(self, values: Mapping[str, Any]) -> None:
        """Take the values; those that are missing have their defaults."""
        self.values = values
        self.problems: list[str] = []

    def refuse(self, name: str, wanted: str) -> None:
        """Note that a value has to be another."""
        self.problems.append(words.NOT_WANTED % (name, _shown(self.values[name]), wanted))

    def checked(self, name: str) -> Any:
        """Return the value of a parameter, or its default if the value cannot be used."""
        item = MONITOR_PARAMETERS[name]
        value = self.values.get(name, item.default)
        if item.takes(value):
            return value
        self.refuse(name, item.wanted)
        return item.default

    def positive(self, name: str, unit: str) -> Fraction | None:
        """Return a number above 0, exact; None if there is none."""
        value = self.values.get(name, '')
        if value == '':
            return None
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        if not is_number or not isfinite(value) or value < 0:
            self.refuse(name, f'a number above 0 ({unit})')
            return None
        # str() gives the decimal number as written. 0 is the default: no value is given.
        return Fraction(str(value)) or None

    def texts(self, name: str) -> list[str]:
        """Return a text or a list of texts."""
        value: Any = self.values.get(name, '')
        is_list = isinstance(value, Sequence) and not isinstance(value, str)
        listed: list[Any] = list(value) if is_list else [value]
        wrong = [item for item in listed
                 if not isinstance(item, str) or not item and listed != ['']]
        if wrong:
            hint = '' if wrong[0] is None else \
                f"; quote it: -p '{name}:=\"{_written(wrong[0])}\"'"
            kind = 'a name or a list of names' if name == 'gates' else 'a path or a list of paths'
            self.problems.append(words.NOT_WANTED % (
                name, _listed(listed) if is_list else _shown(value), f'{kind}{hint}'))
            return []
        return [item for item in listed if item]


def _written(value: object) -> str:
    """Return a value as YAML writes it, without quotes."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def _shown(value: object) -> str:
    """Return a value as YAML writes it; as the node in C does."""
    if isinstance(value, str):
        return f"'{value}'"
    if isinstance(value, int | float):
        return _written(value)
    return 'not set' if value is None else 'a list'


def _listed(values: Iterable[object]) -> str:
    return f'[{", ".join(map(_shown, values))}]'


def read_settings(values: Mapping[str, Any]) -> Settings:
    """
    Return the settings that the values of parameters give.

    Raises `Refusal` if a value cannot be used, or no bundle is given.
    """
    given = Given(values)
    settings = check_settings(given)
    if not settings.origins and not given.problems:
        given.problems.append('nothing to monitor: name a bundle with -p spec:=FILE, '
                              'or a compiled one with -p library:=FOLDER')
    if given.problems:
        raise Refusal(*given.problems)
    return settings


def check_settings(given: Given) -> Settings:
    """Return the settings; what cannot be used is among the problems then."""
    origins, policy, period = _origins(given), given.checked('policy'), _period(given)
    found = {name: given.checked(name) for name in ('native', *OF_BOTH)}
    hot_path = found['hot_path']
    return Settings(
        origins=origins, policy=Policy(policy) if policy else None, period=period,
        hot_path=('off', 'on')[hot_path] if isinstance(hot_path, bool) else hot_path or 'auto',
        handler_depth=found['handler_depth'], log_violations=found['log_violations'],
        publishes_verdicts=found['verdicts'], metrics=_metrics(given),
        constants=_constant_texts(given), blackbox=_blackbox(given, found),
        gates=tuple(given.texts('gates')), priority=found['priority'],
        processors=str(found['processors']), locks_memory=found['lock_memory'],
        margins=found['margins'])


def _origins(given: Given) -> tuple[Origin, ...]:
    specs = list(_specs(given))
    libraries = [Path(item).expanduser() for item in given.texts('library')]
    if specs and libraries and len(specs) != len(libraries):
        given.problems.append(
            f"parameters 'spec' and 'library' name {len(specs)} and {len(libraries)}: where both "
            'are given, each bundle has its folder, in the same order')
    return tuple(Origin(*pair) for pair in zip_longest(specs, libraries))


def _specs(given: Given) -> Iterator[Path]:
    for text in given.texts('spec'):
        try:
            yield find_bundle(text)
        except CompileError as error:
            given.problems.append(str(error).removeprefix('error: '))


def _constant_texts(given: Given) -> dict[str, Text]:
    """Return the constants among parameters, by name, each with its parameter as the source."""
    found = {}
    for parameter in (name for name in given.values if name.startswith(CONSTANTS)):
        value = given.values[parameter]
        if not isinstance(value, bool | int | float | str):
            given.refuse(parameter, 'a number, true or false')
        else:
            found[parameter.removeprefix(CONSTANTS)] = Text.whole(
                Source(f'parameter {parameter}', _written(value)))
    return found


def _metrics(given: Given) -> MetricsAddress | None:
    value = given.values.get('metrics', '')
    if value == '':
        return None
    found = _ADDRESS.fullmatch(value) if isinstance(value, str) else None
    if found is None or int(found['port']) > _LARGEST_PORT:
        given.refuse('metrics', 'an address and a port, say -p metrics:=127.0.0.1:9400')
        return None
    return MetricsAddress(found['host'].strip('[]'), int(found['port']))


def _blackbox(given: Given, found: Mapping[str, Any]) -> BlackBoxSettings | None:
    folder = found['blackbox']
    if not folder or given.problems:
        return None
    try:
        path = Path(folder).expanduser().absolute()
    except FileNotFoundError:
        given.problems.append(words.NO_WORKING_DIRECTORY % folder)
        return None
    return BlackBoxSettings(
        path, float(found['blackbox_seconds']), found['blackbox_bytes'], found['blackbox_files'],
        found['blackbox_disk_bytes'])


def _period(given: Given) -> Fraction | None:
    period = given.positive('period', 'seconds, say 0.1')
    rate = given.positive('rate', 'steps a second, say 10.0')
    if period is not None and rate is not None:
        given.problems.append("parameters 'period' and 'rate' are both given: give one of them")
    return period if rate is None else 1 / rate
