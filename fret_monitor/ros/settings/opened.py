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
From a node's settings to a loaded monitor.

Parser, code generator and compiler are imported only to compile a bundle: a compiled folder runs
on robots that have none of them.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
import os
from pathlib import Path
from time import monotonic, time
from typing import Any

from fret_monitor.model.bundle_files import refuse_missing
from fret_monitor.model.diagnostics import (
    CompileError, Diagnostic, did_you_mean, Problems, Text, UNKNOWN_CONSTANT,
)
from fret_monitor.model.manifest import Manifest, ManifestRequirement, shared_handlers
from fret_monitor.model.names import exact, fret_name
from fret_monitor.model.parts import (
    FOLDER_OF_EACH, judged_by_gates, NodePart, UNGATED, without_gates,
)
from fret_monitor.model.policies import Policy
from fret_monitor.native import (
    evaluator_library, load, load_evaluator, Monitor, NativeError, words,
)
from fret_monitor.native.folder import MANIFEST_FILE, open_folder
from fret_monitor.ros.settings.parameters import CONSTANTS, Origin, Refusal, Settings


@dataclass(frozen=True)
class Opened:
    """
    A monitor ready to run.

    `evaluator` is the library of the evaluator. `period` is in seconds, None unless the policy is
    periodic. `origin` describes for the log where the monitor was loaded from; `warnings` are
    those about the bundle.
    """

    monitor: Monitor
    evaluator: Path
    policy: Policy
    period: float | None
    origin: str
    warnings: tuple[str, ...]


def open_monitors(settings: Settings) -> list[Opened]:
    """
    Compile and load the bundles, or load the compiled folders.

    Raises `Refusal` with all problems of the bundles, the folders, the compiler, or their
    combination.
    """
    opened = _all(lambda origin: _open(settings, origin, UNGATED), settings)
    manifests = [item.monitor.manifest for item in opened]
    if settings.margins and not all(item.has_margins for item in manifests):
        raise Refusal(words.NO_MARGINS)
    refuse_combinations(settings, manifests)
    return opened


def open_gates(settings: Settings, names: Sequence[str] = ()) -> list[Opened]:
    """
    Compile and load the gates of the bundles, or load the folders of compiled gates.

    `names`: of the bundles' gates, only these; () for all. Each manifest has its gate. Raises
    `Refusal` as `open_monitors`, or if there is no such gate, or a bundle has none of them.
    """
    if settings.margins:
        raise Refusal(words.NO_MARGINS_OF_GATES)
    found = _all(lambda origin: [
        _open(settings, origin, NodePart(name)) for name in _gate_names(origin)
        if not names or name in names], settings)
    opened = [item for several in found for item in several]
    manifests = [item.monitor.manifest for item in opened]
    missing = set(names) - {item.gate.name for item in manifests if item.gate}
    if missing or not opened:
        known = [name for origin in settings.origins for name in _gate_names(origin)]
        listed = ', '.join(f"'{name}'" for name in known) or 'none'
        raise Refusal(*(f"no bundle has the gate '{name}': "
                        f'{did_you_mean(name, known) or f"the gates are {listed}"}'
                        for name in sorted(missing)),
                      *(['no gates: write them in the bundle, under gates'] if not opened
                        and not missing else []))
    if useless := [str(origin) for origin, several in zip(settings.origins, found) if not several]:
        raise Refusal(*(without_gates(origin, names) for origin in useless))
    refuse_combinations(settings, manifests)
    return opened


def _gate_names(origin: Origin) -> tuple[str, ...]:
    """Return the names of the gates of a bundle, or of the one that a folder is compiled for."""
    if origin.library is not None:
        gate = open_folder(origin.library).manifest.gate
        if gate is None:
            raise Refusal(f"'{origin.library}' is compiled for the monitor: ros2 run fret_monitor "
                          f'monitor --ros-args -p library:={origin.library}')
        return (gate.name,)
    assert origin.spec is not None
    from fret_monitor.build import gate_names
    return gate_names(origin.spec)


def open_manifests(settings: Settings) -> list[Manifest]:
    """Return the manifests of the bundles or compiled folders; raises `Refusal`."""
    manifests = _all(lambda origin: _manifest(settings, origin), settings)
    refuse_combinations(settings, manifests)
    return manifests


def load_reporting(settings: Settings) -> Any:
    """
    Return the functions of csrc: from a compiled folder, if one is given, or from the cache.

    Raises `Refusal` if there is neither, and no compiler.
    """
    with _as_refusal(''):
        for directory in (item.library for item in settings.origins):
            if directory is not None:
                folder = open_folder(directory)
                return load_evaluator(folder.private().evaluator, origin=folder.evaluator)
        return load_evaluator(evaluator_library())


def refuse_combinations(settings: Settings, manifests: Sequence[Manifest]) -> None:
    """Refuse constants that no bundle has, and handlers of two bundles; raises `Refusal`."""
    _refuse_unknown_constants(
        settings, (name for item in manifests for name, _ in item.constants))
    _refuse_shared_handlers(settings.origins, manifests)


def _all[T](open_one: Callable[[Origin], T], settings: Settings) -> list[T]:
    """Open all origins, so that the problems of all of them are reported together."""
    opened, refused = [], []
    overrides = _overrides(settings)
    for origin in settings.origins:
        try:
            with _as_refusal(overrides):
                _refuse_slips(origin)
                opened.append(open_one(origin))
        except Refusal as refusal:
            refused.append(str(refusal))
    if refused:
        raise Refusal(*refused, heading='')
    return opened


def _overrides(settings: Settings) -> str:
    """Return the parameters that change a bundle, which may be the cause of an error in it."""
    values = [
        *([] if settings.policy is None else [f'policy:={settings.policy.value}']),
        *([] if settings.period is None else [f'period:={float(settings.period):g}']),
        *(f'constants.{name}:={text.value}' for name, text in settings.constants.items())]
    return ', '.join(values)


def _refuse_slips(origin: Origin) -> None:
    """Refuse a path that belongs to the other parameter, or that does not exist."""
    spec, library = origin.spec, origin.library
    if library is not None and os.path.isfile(library):
        raise Refusal(f"'{library}' is a file, and not the folder of a compiled bundle"
                      + (f'; for a bundle: -p spec:={library}' if spec is None else ''))
    if spec is None:
        return
    if os.path.isfile(spec / MANIFEST_FILE):
        raise Refusal(f"'{spec}' is a directory: for a compiled bundle, -p library:={spec}")
    parts = str(spec).split(',')
    if len(parts) > 1 and not os.path.exists(spec):
        listed = ', '.join(part.strip() for part in parts)
        raise Refusal(f"there is no file '{spec}'; for several bundles: -p spec:=\"[{listed}]\"")
    refuse_missing(spec)


def _refuse_shared_handlers(origins: Sequence[Origin], manifests: Sequence[Manifest]) -> None:
    """Refuse two requirements with the same handler topic."""
    problems = [
        f"'{other.id}' ({_place(origins[owner], other)}) and '{item.id}' "
        f'({_place(origins[number], item)}) would both be announced on copilot/{item.handler}: '
        'give one of them another id'
        for (owner, other), (number, item) in shared_handlers(manifests)]
    if problems:
        raise Refusal(*problems)


def _place(origin: Origin, requirement: ManifestRequirement) -> str:
    """Return file, line and column of a requirement, or only the origin if they are unknown."""
    if origin.spec is not None:
        from fret_monitor.bundle.reader import survey_bundle
        bundle = survey_bundle(origin.spec, Problems())
        for item in bundle.requirements if bundle else ():
            if item.id.value == requirement.id:
                span = item.id.span
                return f'{span.source.name}:{span.line}:{span.column}'
    return str(origin)


def _open(settings: Settings, origin: Origin, part: NodePart) -> Opened:
    if origin.library is not None:
        return _open_library(settings, origin, origin.library, part)
    assert origin.spec is not None
    return _compile(settings, origin.spec, part)


def _manifest(settings: Settings, origin: Origin) -> Manifest:
    if origin.library is not None:
        manifest = open_folder(origin.library).manifest
        _refuse_other_bundle(origin.spec, origin.library, manifest)
        _refuse_constants(settings, manifest)
        return manifest
    assert origin.spec is not None
    from fret_monitor.start import manifest_of
    return manifest_of(origin.spec, policy=settings.policy, period=settings.period,
                       constants=constants_of(settings, origin.spec))


def constants_of(settings: Settings, spec: Path) -> Mapping[str, Text]:
    """Return the constants that are meant for a bundle: of several bundles, those it has."""
    if len(settings.origins) == 1 or not settings.constants:
        return settings.constants
    from fret_monitor.build import own_constants
    return own_constants(spec, settings.constants)


def _refuse_unknown_constants(settings: Settings, names: Iterable[str]) -> None:
    """Refuse constants that have none of the names."""
    names = list(dict.fromkeys(names))
    known = {fret_name(name) for name in names}
    listed = words.ALL_CONSTANTS % ', '.join(names) if names else words.NO_CONSTANTS
    if problems := [words.NO_CONSTANT % (CONSTANTS + name, did_you_mean(name, names) or listed)
                    for name in settings.constants if fret_name(name) not in known]:
        raise Refusal(*problems)


@contextmanager
def _as_refusal(overrides: str) -> Iterator[None]:
    """Raise `Refusal` in place of errors that the user can correct."""
    try:
        yield
    except CompileError as error:
        problems = [_of_both_nodes(item) for item in error.diagnostics]
        has_others = any(item.label != UNKNOWN_CONSTANT for item in error.diagnostics)
        note = f'\nnote: in place of what the bundle says: {overrides}' \
            if overrides and has_others else ''
        raise Refusal(f'{CompileError(problems)}{note}', heading='') from None  # rendered already
    except NativeError as error:
        raise Refusal(str(error)) from None


def _of_both_nodes(problem: Diagnostic) -> Diagnostic:
    """Return a problem in the words of the node in C, if that can have it: an unknown constant."""
    if problem.label != UNKNOWN_CONSTANT or problem.span is None:
        return problem
    parameter = problem.span.source.name.removeprefix('parameter ')
    return Diagnostic(words.NO_CONSTANT % (parameter, problem.help))


def _compile(settings: Settings, spec: Path, part: NodePart) -> Opened:
    from fret_monitor.start import start
    began, clock = time(), monotonic()
    compiled = start(spec, policy=settings.policy, period=settings.period,
                     constants=constants_of(settings, spec), part=part, takes_instances=True,
                     margins=settings.margins)
    is_new = compiled.library.stat().st_mtime >= began
    how = f'compiled in {monotonic() - clock:.1f} s' if is_new else 'found compiled'
    manifest = compiled.manifest
    assert compiled.evaluator is not None
    return Opened(compiled.monitor, compiled.evaluator, manifest.policy, manifest.period,
                  f'{spec}, {how}',
                  (*(warning.render() for warning in compiled.warnings),
                   *filter(None, [judged_by_gates(manifest.kept, f'spec:={spec}')])))


def _open_library(settings: Settings, origin: Origin, directory: Path, part: NodePart) -> Opened:
    folder = open_folder(directory)
    if part == UNGATED and folder.manifest.gate is not None:
        raise Refusal(
            f"'{directory}' is compiled for the gate '{folder.manifest.gate.name}': "
            f'ros2 run fret_monitor gate --ros-args -p library:={directory}')
    _refuse_other_bundle(origin.spec, directory, folder.manifest)
    _refuse_constants(settings, folder.manifest)
    policy = _policy_of(settings, folder.manifest)
    private = folder.private()  # so that replacing the folder does no harm
    monitor = load(private.library, folder.manifest, origin=folder.library)
    load_evaluator(private.evaluator, origin=folder.evaluator)  # refuses another version
    return Opened(monitor, private.evaluator, policy, folder.manifest.period,
                  f'compiled before, in {directory}',
                  tuple(filter(None, [judged_by_gates(folder.manifest.kept, FOLDER_OF_EACH)])))


def _refuse_other_bundle(spec: Path | None, directory: Path, manifest: Manifest) -> None:
    if spec is None:
        return
    from fret_monitor.build import read
    if read(spec, takes_instances=True).bundle_hash != manifest.bundle_hash:
        raise Refusal(
            f"'{directory}' was not compiled from '{spec}' as it is now; compile it "
            f'anew: fret-monitor compile {spec} --output {directory}')


def _refuse_constants(settings: Settings, manifest: Manifest) -> None:
    """Refuse other values of what is compiled into a folder."""
    compiled = {fret_name(name): value for name, value in manifest.constants}
    for name, text in settings.constants.items():
        value = compiled.get(fret_name(name), text.value)
        if value != text.value and (exact(value) is None or exact(value) != exact(text.value)):
            raise Refusal(
                f'{text.source.name}: {name} is compiled into the folder, as {value}: '
                f'compile the folder with --constant {name}={text.value}, or name the bundle '
                'instead, -p spec:=FILE')


def _policy_of(settings: Settings, manifest: Manifest) -> Policy:
    """Return the policy to run; refuse what contradicts the durations that are compiled in."""
    policy = settings.policy or manifest.policy
    has_time = {Policy.PERIODIC, Policy.TIMED} & {policy, manifest.policy}
    if has_time and policy is not manifest.policy:
        raise Refusal(
            f'the bundle is compiled for the policy {manifest.policy.value}; to run it '
            f'with {policy.value}, compile it with that policy in the bundle')
    if settings.period is not None and float(settings.period) != manifest.period:
        raise Refusal(
            'the period is compiled into the bundle'
            + (f' ({manifest.period:g} s)' if manifest.period is not None else ' (it has none)')
            + '; to run it with another, compile it with that period in the bundle')
    return policy
