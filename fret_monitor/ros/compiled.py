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

Parser, code generator and compiler are needed for a bundle only, and imported only then: a
compiled folder runs on robots that have none of them.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import monotonic, time

from fret_monitor.diagnostics import CompileError
from fret_monitor.manifest import Manifest, Policy
from fret_monitor.native import load, Monitor, NativeError
from fret_monitor.native.folder import open_folder
from fret_monitor.ros.parameters import Refusal, Settings


@dataclass(frozen=True)
class Opened:
    """
    A monitor ready to run.

    `evaluator` is None where the evaluator is to be built, or found built. `period` is in
    seconds, None but with the policy periodic. `origin` tells a person where it came from,
    `warnings` what is odd about the bundle.
    """

    monitor: Monitor
    evaluator: Path | None
    policy: Policy
    period: float | None
    origin: str
    warnings: tuple[str, ...]


def open_monitor(settings: Settings) -> Opened:
    """
    Compile and load the bundle, or load the compiled folder.

    Raises
    ------
    Refusal
        with all that is wrong with the bundle, the folder, the compiler, or the combination.
    """
    with _told():
        if settings.library is not None:
            return _open_library(settings, settings.library)
        assert settings.spec is not None
        return _compile(settings, settings.spec)


def open_manifest(settings: Settings) -> Manifest:
    """Return what is known of the bundle or compiled folder; raises `Refusal`."""
    with _told():
        if settings.library is not None:
            manifest = open_folder(settings.library).manifest
            _refuse_other_bundle(settings, settings.library, manifest)
            return manifest
        assert settings.spec is not None
        from fret_monitor.start import manifest_of
        return manifest_of(settings.spec)


@contextmanager
def _told() -> Iterator[None]:
    """Turn a user's mistake into a refusal to start."""
    try:
        yield
    except CompileError as error:
        raise Refusal(str(error), heading='') from None  # rendered already
    except NativeError as error:
        raise Refusal(str(error)) from None


def _compile(settings: Settings, spec: Path) -> Opened:
    from fret_monitor.start import start
    began, clock = time(), monotonic()
    compiled = start(spec, policy=settings.policy, period=settings.period)
    is_new = compiled.library.stat().st_mtime >= began
    how = f'compiled in {monotonic() - clock:.1f} s' if is_new else 'found compiled'
    manifest = compiled.manifest
    return Opened(compiled.monitor, None, manifest.policy, manifest.period, f'{spec}, {how}',
                  compiled.warnings)


def _open_library(settings: Settings, directory: Path) -> Opened:
    folder = open_folder(directory)
    _refuse_other_bundle(settings, directory, folder.manifest)
    policy = _policy_of(settings, folder.manifest)
    return Opened(load(folder.library, folder.manifest), folder.evaluator, policy,
                  folder.manifest.period, f'compiled before, in {directory}', ())


def _refuse_other_bundle(settings: Settings, directory: Path, manifest: Manifest) -> None:
    if settings.spec is None:
        return
    from fret_monitor.build import read
    if read(settings.spec).bundle_hash != manifest.bundle_hash:
        raise Refusal(
            f"'{directory}' was not compiled from '{settings.spec}' as it is now; compile it "
            f'anew: fret-monitor compile {settings.spec} --output {directory}')


def _policy_of(settings: Settings, manifest: Manifest) -> Policy:
    """Return the policy to run a compiled folder with; durations are compiled into it."""
    policy = settings.policy or manifest.policy
    if Policy.PERIODIC in (policy, manifest.policy) and policy is not manifest.policy:
        raise Refusal(
            f'the compiled bundle counts steps of the policy {manifest.policy.value}; to run it '
            f'with {policy.value}, compile it with that policy in the bundle')
    if settings.period is not None and float(settings.period) != manifest.period:
        raise Refusal(
            'the period is compiled into the bundle'
            + (f' ({manifest.period:g} s)' if manifest.period is not None else ' (it has none)')
            + '; to run it with another, compile it with that period in the bundle')
    return policy
