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
`monitor` or `gate` with `native:=true`: the process becomes the node in C, built once.

This comes before rclpy is imported. What the node in C cannot do is done by the node in Python,
with a line in the log that says why.
"""

from collections.abc import Mapping, Sequence
import os
from pathlib import Path
import signal
import sys
from time import time_ns
from typing import Any, TYPE_CHECKING

from fret_monitor.ros.signals import SIGNALS

if TYPE_CHECKING:
    from fret_monitor.model.diagnostics import Text
    from fret_monitor.model.parts import NodePart
    from fret_monitor.native.compiled import CompiledMonitor
    from fret_monitor.ros.settings.parameters import Settings

GATE, MONITOR = 'fret_gate', 'fret_monitor'


def become_native(arguments: Sequence[str], node: str = MONITOR) -> str:
    """
    Replace this process by the node in C if the arguments ask for that; `arguments` are sys.argv.

    `node` is the name of the node without remapping: `MONITOR` or `GATE`.

    Returns why it cannot be done; an empty text if it is not wanted, or if the node in Python has
    errors of the user to report.
    """
    if not any('native' in item or item == '--params-file' for item in arguments):
        return ''
    from fret_monitor.ros.settings.arguments import (
        given_parameters, NotUnderstood, SeveralTypes,
    )
    try:
        given = given_parameters(arguments[1:], node)
    except (NotUnderstood, SeveralTypes):
        return ''
    return _become(arguments, given, node) if given.get('native') is True else ''


def _become(arguments: Sequence[str], given: Mapping[str, Any], node: str) -> str:
    from fret_monitor.model.diagnostics import CompileError
    from fret_monitor.native.errors import NativeError
    from fret_monitor.ros.settings.parameters import read_settings, Refusal
    try:
        settings = read_settings(given)
        if reason := _missing(settings):
            return reason
        parts = _parts(settings, node)
        if not parts or (settings.margins and node == GATE):
            return ''  # the node in Python reports that there is none
        program = _program(settings, parts, node)
    except (Refusal, CompileError):
        return ''
    except NativeError as error:
        return str(error)
    # A signal waits until the node in C handles signals: before that, it would kill the process.
    before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    try:
        os.execv(program, [arguments[0], *arguments[1:]])
    except OSError as error:
        return f'{program} cannot be run: {error.strerror or error}'
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _missing(settings: 'Settings') -> str:
    """Return which feature the node in C lacks; an empty text if it has all that is wanted."""
    if any(item.library is not None for item in settings.origins):
        return ('the node in C is built from the bundle, not from a folder of `compile`: '
                'give spec alone')
    if settings.metrics is not None:
        return 'the node in C serves no figures for Prometheus: leave metrics out'
    return ''


def _parts(settings: 'Settings', node: str) -> list[tuple[Path, 'NodePart']]:
    """Return what the node runs of each bundle; nothing if a gate, or a bundle's, is missing."""
    from fret_monitor.model.parts import NodePart, UNGATED
    specs = [item.spec for item in settings.origins if item.spec is not None]
    if node == MONITOR:
        return [(spec, UNGATED) for spec in specs]
    from fret_monitor.build import gate_names
    wanted = settings.gates
    found = [(spec, name) for spec in specs for name in gate_names(spec)
             if not wanted or name in wanted]
    if set(wanted) - {name for _, name in found} or set(specs) - {spec for spec, _ in found}:
        return []
    return [(spec, NodePart(name)) for spec, name in found]


def _program(settings: 'Settings', parts: Sequence[tuple[Path, 'NodePart']], node: str) -> Path:
    if len(parts) == 1:
        return _built(settings, *parts[0], node, settings.constants).library
    from fret_monitor.export.program import program_of_several
    from fret_monitor.model.names import distinct_names
    from fret_monitor.ros.settings.opened import constants_of, refuse_combinations
    shown = distinct_names([part.gate or spec.stem for spec, part in parts])
    compiled = [_built(settings, spec, part, node, constants_of(settings, spec), place)
                for place, (spec, part) in zip(enumerate(shown), parts)]
    manifests = [item.manifest for item in compiled]
    refuse_combinations(settings, manifests)
    return program_of_several([item.library for item in compiled], manifests)


def _built(settings: 'Settings', spec: Path, part: 'NodePart', node: str,
           constants: Mapping[str, 'Text'], place: tuple[int, str] | None = None,
           ) -> 'CompiledMonitor':
    """
    Return the program of a bundle; with a `place`, its table for a program of several.

    `place` is its number and its name in statuses.
    """
    from fret_monitor.native.ros_files import identity
    from fret_monitor.start import start_program

    def make(generated: Any) -> Path:
        from fret_monitor.export.program import node_program, table_object
        from fret_monitor.export.ros2_table import OneOfSeveral
        _tell(node, spec)
        return node_program(generated, str(spec)) if place is None else \
            table_object(generated, str(spec), OneOfSeveral(*place, spec.stem))

    return start_program(
        spec, make, ' '.join([identity(), *map(str, place or ())]),
        policy=settings.policy, period=settings.period, constants=constants, part=part,
        name=f'b{place[0]}_{spec.stem}' if place else None, margins=settings.margins)


def _tell(node: str, spec: Path) -> None:
    """Say on standard error what takes long, in the form of the log, which is not there yet."""
    seconds, nanoseconds = divmod(time_ns(), 10**9)
    print(f'[INFO] [{seconds}.{nanoseconds:09}] [{node}]: {_compiling(spec)}', file=sys.stderr,
          flush=True)


def _compiling(spec: Path) -> str:
    return f'compiling the node in C for {spec}; later starts reuse it'
