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
The ROS parameters of the nodes: declared, described, checked.

All problems are reported together, each with what to write instead.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import zip_longest
from math import isfinite
from pathlib import Path
from typing import Any

from fret_monitor.model.bundle_files import find_bundle
from fret_monitor.model.diagnostics import CompileError, did_you_mean, Text
from fret_monitor.model.manifest import Manifest
from fret_monitor.model.policies import Policy
from fret_monitor.ros.settings.constants import constant_texts, ConstantParameters
from fret_monitor.ros.settings.qos import DEFAULT_HANDLER_DEPTH, LARGEST_DEPTH

from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.logging import LoggingSeverity
from rclpy.node import Node
from rclpy.parameter import Parameter


@dataclass(frozen=True)
class Described:
    """A parameter: its default, its description, and whether it is read-only."""

    default: object
    description: str
    read_only: bool = False


_SPEC = ("the bundle: a path, package://PKG/PATH, or the name of a file in this package's config "
         'folder; or a list of them')
_LIBRARY = ('the folder of a compiled bundle, instead of the bundle, or with it to be sure that '
            'it is of that; a list for several')
_LOG_LEVEL = Described('', 'the least severity that this node logs: debug, info, warn, error or '
                           "fatal; empty for the process's")

MONITOR_PARAMETERS = {
    'spec': Described('', f'{_SPEC}; read by `configure`'),
    'library': Described('', f'{_LIBRARY}; read by `configure`'),
    'policy': Described('', f"when a step happens: {', '.join(item.value for item in Policy)}; "
                            "empty for the bundle's; read by `configure`"),
    'period': Described(0.0, 'seconds between two steps, with the policy periodic; 0 for the '
                             "bundle's; read by `configure`"),
    'rate': Described(0.0, 'steps a second, with the policy periodic, instead of a period; 0 for '
                           "the bundle's; read by `configure`"),
    'hot_path': Described('auto', "whether the middleware's callbacks take the messages: auto "
                                  '(where this is known to work), on, off (they wake a thread '
                                  'that does); read by `configure`'),
    'handler_depth': Described(
        DEFAULT_HANDLER_DEPTH, 'violations that a slow listener of one handler may be behind '
                               'before it loses some; read by `configure`'),
    'log_violations': Described(True, 'whether the node logs violations and their ends; false if '
                                      'the logger does; read by `configure`'),
    'blackbox': Described('', 'a folder to which the last messages of all topics are written at '
                              'each violation; empty: none are kept; read by `configure`'),
    'blackbox_seconds': Described(10.0, 'seconds of messages before a violation that a file has; '
                                        'read by `configure`'),
    'blackbox_bytes': Described(64 << 20, 'memory for the last messages, in bytes, for each '
                                          'bundle; read by `configure`'),
    'blackbox_files': Described(20, 'files of black boxes in the folder, at most: the oldest are '
                                    'removed; read by `configure`'),
    'blackbox_disk_bytes': Described(1 << 30, 'bytes of these files together, at most; read by '
                                              '`configure`'),
    'autostart': Described(True, 'whether the node configures and activates itself at its start',
                           read_only=True),
    'log_level': _LOG_LEVEL,
}
_CONSTANT = "a constant of a bundle, with a value in place of the bundle's; read by `configure`"
GATE_PARAMETERS = {
    'gates': Described('', 'the gates of the bundles to run, a name or a list; empty for all; '
                           'read by `configure`'),
    **{name: item for name, item in MONITOR_PARAMETERS.items() if name not in ('period', 'rate')},
}
LOGGER_PARAMETERS = {
    'spec': Described('', _SPEC, read_only=True),
    'library': Described('', _LIBRARY, read_only=True),
    'policy': Described('', "as the monitor's", read_only=True),
    'period': Described(0.0, "as the monitor's: a bundle may leave it to the parameter",
                        read_only=True),
    'rate': Described(0.0, "as the monitor's, instead of a period", read_only=True),
    'handler_depth': Described(
        DEFAULT_HANDLER_DEPTH, 'violations of one handler that may wait in this node',
        read_only=True),
    'log_level': _LOG_LEVEL,
}

_LEAST_BYTES = 4096  # of a black box
_LEAST_DISK_BYTES = 1 << 20
_HOT_PATHS = ('auto', 'on', 'off')
_LEVELS = ('debug', 'info', 'warn', 'error', 'fatal')
# Parameters of rclpy and of both nodes: one parameter file may be given to both.
_KNOWN = {'use_sim_time', 'start_type_description_service',
          *MONITOR_PARAMETERS, *GATE_PARAMETERS, *LOGGER_PARAMETERS}


class Refusal(Exception):
    """Reasons not to start, in words for the user."""

    def __init__(self, *problems: str, heading: str = 'error: ') -> None:
        """Take one problem or more; the heading precedes each of them."""
        super().__init__('\n'.join(heading + problem for problem in problems))


@dataclass(frozen=True)
class Origin:
    """Where a bundle comes from: its file, its compiled folder, or both."""

    spec: Path | None
    library: Path | None

    def __str__(self) -> str:
        """Return the path of the bundle, or else of the compiled folder."""
        return str(self.spec or self.library)


@dataclass(frozen=True)
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
class Settings:
    """
    The bundles to monitor, and what overrides them; `period` is in seconds, exact.

    `gates`: the gates to run; () for all.
    """

    origins: tuple[Origin, ...]
    policy: Policy | None = None
    period: Fraction | None = None
    hot_path: str = 'auto'
    handler_depth: int = DEFAULT_HANDLER_DEPTH
    log_violations: bool = True
    constants: Mapping[str, Text] = field(default_factory=dict)
    blackbox: BlackBoxSettings | None = None
    gates: tuple[str, ...] = ()


class Parameters:
    """The declared parameters of a node."""

    def __init__(self, node: Node, table: Mapping[str, Described],
                 why_fixed: Callable[[], str] = str) -> None:
        """
        Declare the parameters of `table`.

        `why_fixed` returns why the parameters that `configure` reads cannot change now, or an
        empty string if they can.

        Raises
        ------
        Refusal
            if the value of `log_level` or `autostart` cannot be used.
        """
        self._node = node
        self._table = table
        self._why_fixed = why_fixed
        for name, item in table.items():
            node.declare_parameter(name, item.default, ParameterDescriptor(
                description=item.description, read_only=item.read_only, dynamic_typing=True))
        self._constants = ConstantParameters(
            node, _CONSTANT, read_only=table['spec'].read_only)
        self._ignored = self._find_ignored()
        self._names_of_constants: set[str] = set()
        if problems := _found(_level, self.values()) + _found(_autostart, self.values()):
            raise Refusal(*problems)
        self._set_level()
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(lambda _: self._set_level())

    def values(self) -> dict[str, Any]:
        """Return the values of all parameters in the table."""
        values = {name: self._node.get_parameter(name).value for name in self._table}
        return values | self._constants.overrides()

    def show_constants(self, manifests: Iterable[Manifest]) -> None:
        """
        Declare a parameter for each constant of the bundles, with the value in use.

        A constant that has several values is left out unless it was given.
        """
        pairs = [pair for item in manifests for pair in item.constants]
        self._constants.show(pairs)
        self._names_of_constants = {name for name, _ in pairs}

    @contextmanager
    def warning_of_ignored(self) -> Iterator[None]:
        """
        Warn, once, about the ignored parameters at the end of the block, also of one that fails.

        The block opens the bundles and calls `show_constants`: an ignored parameter may have the
        name of one of their constants.
        """
        try:
            yield
        finally:
            while self._ignored:
                name = self._ignored.pop(0)
                self._node.get_logger().warning(f"ignored parameter '{name}': {self._hint(name)}")

    def _find_ignored(self) -> list[str]:
        """
        Return the given parameters that this node does not have; `Overrides` reads its own.

        They are no error: a file with the wildcard `/**` also has parameters of other nodes.
        """
        return [name for name in self._node._parameter_overrides
                if not name.startswith('qos_overrides.') and not self._constants.has(name)
                and name not in _KNOWN and not self._node.has_parameter(name)]

    def _hint(self, name: str) -> str:
        constant = name.rpartition('.')[2]
        if constant in self._names_of_constants:
            return f"did you mean 'constants.{constant}'?"
        return did_you_mean(name, self._table) or \
            f'this node has {", ".join(self._table)}, constants.NAME'

    def _check(self, parameters: list[Parameter]) -> SetParametersResult:
        """Refuse values that cannot be used, and changes that are not possible now."""
        overrides = [item.name for item in parameters if item.name.startswith('qos_overrides.')
                     and self._node.has_parameter(item.name)]
        if overrides:
            return SetParametersResult(successful=False, reason=(
                f"{', '.join(overrides)}: read at the start of the process only"))
        new = {item.name: item.value for item in parameters if item.name in self._table
               or self._constants.has(item.name)}
        problems = _found(_settings, self.values() | new) + _found(_level, new)
        fixed = [name for name in new if name != 'log_level']
        reason = self._why_fixed()
        if fixed and reason:
            problems = [f"{', '.join(fixed)}: {reason}"]
        return SetParametersResult(successful=not problems, reason='; '.join(problems))

    def _set_level(self) -> None:
        self._node.get_logger().set_level(_level(self.values(), []))


def read_settings(given: Mapping[str, Any]) -> Settings:
    """
    Return the settings that the values of parameters give.

    Raises
    ------
    Refusal
        if a value cannot be used, or no bundle is given.
    """
    problems: list[str] = []
    settings = _settings(given, problems)
    if not settings.origins and not problems:
        problems.append('nothing to monitor: name a bundle with -p spec:=FILE, '
                        'or a compiled one with -p library:=FOLDER')
    if problems:
        raise Refusal(*problems)
    return settings


def _found(read: Callable[[Mapping[str, Any], list[str]], object],
           given: Mapping[str, Any]) -> list[str]:
    """Return the problems that `read` finds."""
    problems: list[str] = []
    read(given, problems)
    return problems


def _level(given: Mapping[str, Any], problems: list[str]) -> LoggingSeverity:
    word = _word(given, 'log_level', _LEVELS, problems)
    return LoggingSeverity[word.upper()] if word else LoggingSeverity.UNSET


def _autostart(given: Mapping[str, Any], problems: list[str]) -> None:
    _truth(given, 'autostart', problems)


def _truth(given: Mapping[str, Any], name: str, problems: list[str]) -> bool:
    value = given.get(name, True)
    if not isinstance(value, bool):
        problems.append(f"parameter '{name}' is {value!r}, and has to be true or false")
    return bool(value)


def _settings(given: Mapping[str, Any], problems: list[str]) -> Settings:
    return Settings(
        _origins(given, problems), _policy(given, problems), _period(given, problems),
        _word(given, 'hot_path', _HOT_PATHS, problems) or 'auto',
        _depth(given, problems), _truth(given, 'log_violations', problems),
        constant_texts(given, problems), _blackbox(given, problems),
        tuple(_texts(given, 'gates', problems)))


def _origins(given: Mapping[str, Any], problems: list[str]) -> tuple[Origin, ...]:
    specs = _specs(_texts(given, 'spec', problems), problems)
    libraries = [Path(item).expanduser() for item in _texts(given, 'library', problems)]
    if specs and libraries and len(specs) != len(libraries):
        problems.append(
            f"parameters 'spec' and 'library' name {len(specs)} and {len(libraries)}: where both "
            'are given, each bundle has its folder, in the same order')
    return tuple(Origin(*pair) for pair in zip_longest(specs, libraries))


def _specs(texts: Sequence[str], problems: list[str]) -> list[Path]:
    specs = []
    for text in texts:
        try:
            specs.append(find_bundle(text))
        except CompileError as error:
            problems.append(str(error).removeprefix('error: '))
    return specs


def _texts(given: Mapping[str, Any], name: str, problems: list[str]) -> list[str]:
    value: Any = given.get(name) or ''
    listed: list[Any] = [value] if isinstance(value, str | bool | int | float) else list(value)
    wrong = [item for item in listed if not isinstance(item, str) or not item and listed != ['']]
    if wrong:
        problems.append(
            f"parameter '{name}' is {listed if len(listed) > 1 else value!r}, and has to be a "
            f"path or a list of paths; quote it: -p '{name}:=\"{wrong[0]}\"'")
        return []
    return [item for item in listed if item]


def _blackbox(given: Mapping[str, Any], problems: list[str]) -> BlackBoxSettings | None:
    folder = given.get('blackbox') or ''
    seconds = _positive(given, 'blackbox_seconds', 'seconds, say 10.0', problems)
    numbers = [_count(given, f'blackbox_{name}', unit, least, problems) for name, unit, least in (
        ('bytes', 'bytes', _LEAST_BYTES), ('files', 'files', 1),
        ('disk_bytes', 'bytes', _LEAST_DISK_BYTES))]
    if not isinstance(folder, str):
        problems.append(f"parameter 'blackbox' is {folder!r}, and has to be the path of a folder")
    if not folder or problems:
        return None
    try:
        path = Path(folder).expanduser().absolute()
    except FileNotFoundError:
        problems.append(f"parameter 'blackbox' is '{folder}', in a working directory that was "
                        'deleted: give the whole path')
        return None
    return BlackBoxSettings(path, float(seconds or 10), *numbers)


def _count(given: Mapping[str, Any], name: str, unit: str, least: int,
           problems: list[str]) -> int:
    value = given.get(name, MONITOR_PARAMETERS[name].default)
    if not isinstance(value, int) or isinstance(value, bool) or not least <= value < 1 << 62:
        problems.append(f"parameter '{name}' is {value!r}, and has to be a number of {unit}, "
                        f'at least {least}: -p {name}:={least}')
        return least
    return value


def _depth(given: Mapping[str, Any], problems: list[str]) -> int:
    value = given.get('handler_depth', DEFAULT_HANDLER_DEPTH)
    if not isinstance(value, int) or isinstance(value, bool) or not 0 < value <= LARGEST_DEPTH:
        problems.append(f"parameter 'handler_depth' is {value!r}, and has to be a number of "
                        'messages, at least 1')
        return DEFAULT_HANDLER_DEPTH
    return value


def _policy(given: Mapping[str, Any], problems: list[str]) -> Policy | None:
    word = _word(given, 'policy', [policy.value for policy in Policy], problems)
    return Policy(word) if word else None


def _word(given: Mapping[str, Any], name: str, words: Sequence[str],
          problems: list[str]) -> str:
    value = given.get(name) or ''
    # In YAML, and so in `-p hot_path:=off`, `on` and `off` are booleans.
    if isinstance(given.get(name), bool) and 'off' in words:
        value = 'on' if given[name] else 'off'
    if value and value not in words:
        problems.append(f"parameter '{name}' is '{value}', and has to be one of "
                        f"{', '.join(words)}")
        return ''
    return str(value)


def _period(given: Mapping[str, Any], problems: list[str]) -> Fraction | None:
    period = _positive(given, 'period', 'seconds, say 0.1', problems)
    rate = _positive(given, 'rate', 'steps a second, say 10.0', problems)
    if period is not None and rate is not None:
        problems.append("parameters 'period' and 'rate' are both given: give one of them")
    return period if rate is None else 1 / rate


def _positive(given: Mapping[str, Any], name: str, unit: str,
              problems: list[str]) -> Fraction | None:
    value = given.get(name)
    if value is None or value == '':
        return None
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if not is_number or not isfinite(value) or value < 0:
        problems.append(
            f"parameter '{name}' is {value!r}, and has to be a number above 0 ({unit})")
        return None
    # str() gives the decimal number as written. 0 is the default: no value is given.
    return Fraction(str(value)) or None
