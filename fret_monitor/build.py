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
The stages in a row, from a bundle to a monitor that runs.

    text -> Bundle -> Specification -> MonitorProgram -> C module + Manifest -> library -> Monitor
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
import hashlib
from pathlib import Path

from fret_monitor.bundle.bundle import Bundle
from fret_monitor.bundle.constants import override_constants
from fret_monitor.bundle.gates import names_with_keys
from fret_monitor.bundle.reader import survey_bundle, USUAL_REORDER_S
from fret_monitor.bundle.source_file import read_source, ReadFile
from fret_monitor.codegen.describe import describe, described_topics, with_kinds
from fret_monitor.codegen.extractors import Feed
from fret_monitor.codegen.module import CModule, generate
from fret_monitor.elaboration.elaborate import specify
from fret_monitor.elaboration.memory import RequirementMemory
from fret_monitor.elaboration.restrict import restrict
from fret_monitor.elaboration.signals import FindMessage
from fret_monitor.lint.actions import action_warnings
from fret_monitor.lint.constant_verdicts import constant_verdicts
from fret_monitor.lint.gates import gate_warnings
from fret_monitor.lint.instants import doubtful_instants, reports_once
from fret_monitor.lint.not_a_number import weaker_with_nan
from fret_monitor.lint.sentences import doubtful_sentences
from fret_monitor.lint.topics import doubtful_topics
from fret_monitor.lint.units import doubtful_units
from fret_monitor.lint.unread import unread_topics
from fret_monitor.logic.scopes import (
    bundle_scope, instance_scopes, InstanceScope, one_instance,
)
from fret_monitor.logic.specification import Specification
from fret_monitor.messages.installed import find_message as find_installed, fingerprint
from fret_monitor.model.diagnostics import (
    by_place, CompileError, Diagnostic, Level, Problems, Text,
)
from fret_monitor.model.manifest import FORMAT, Manifest, ManifestTopic
from fret_monitor.model.names import fret_name
from fret_monitor.model.parts import NodePart
from fret_monitor.model.policies import Policy, Stamp
from fret_monitor.native.cache import build_library, runtime_headers
from fret_monitor.native.compiled import CompiledMonitor
from fret_monitor.native.folder import check_writable, write_folder
from fret_monitor.program.layout import (
    check_bounds, check_instances, GroupLayout, lay_out, MAX_STATE_BYTES,
)
from fret_monitor.program.lower import lower
from fret_monitor.program.monitor_program import MonitorProgram


@dataclass(frozen=True)
class Reading:
    """
    What a bundle means, the warnings about it, and its hash.

    `files` are the files that were read, the bundle first, each with the SHA-256 of its text;
    `messages` are its message types, each with the fingerprint of its definition; `constants` are
    names with the values that were used, as written. `bundle` is what was elaborated; None if the
    specification was not read from a bundle.
    """

    specification: Specification
    warnings: tuple[Diagnostic, ...]
    bundle_hash: str
    files: tuple[tuple[Path, str], ...]
    messages: tuple[tuple[str, str], ...] = ()
    constants: tuple[tuple[str, str], ...] = ()
    bundle: Bundle | None = field(default=None, repr=False)

    @property
    def paths(self) -> tuple[Path, ...]:
        """The files it was read from, the bundle first."""
        return tuple(path for path, _ in self.files)


@dataclass(frozen=True)
class GeneratedMonitor:
    """
    The C of a bundle and the values that it was made from; nothing is compiled yet.

    `sources` are the files that the bundle was read from.
    """

    specification: Specification
    program: MonitorProgram
    layouts: tuple[GroupLayout, ...]
    module: CModule
    manifest: Manifest
    warnings: tuple[Diagnostic, ...]
    sources: tuple[Path, ...]
    kinds: tuple['GeneratedKind', ...] = ()

    @property
    def c_sources(self) -> dict[str, str]:
        """The C sources of all modules, by file name."""
        modules = (self.module, *(item.module for item in self.kinds))
        return {name: text for module in modules for name, text in module.sources}

    @property
    def c_headers(self) -> dict[str, str]:
        """The generated headers, by file name."""
        return dict(module.header for module in (
            self.module, *(item.module for item in self.kinds)))


@dataclass(frozen=True)
class GeneratedKind:
    """The C of what there is one of for each key of some instance variables."""

    scope: InstanceScope
    program: MonitorProgram
    layouts: tuple[GroupLayout, ...]
    module: CModule
    manifest: Manifest


def read(path: Path, *, policy: Policy | None = None, period: Fraction | None = None,
         constants: Mapping[str, Text] | None = None, stamp: Stamp | None = None,
         find_message: FindMessage | None = None, part: NodePart | None = None,
         takes_instances: bool = False, read_file: ReadFile = read_source,
         memory: RequirementMemory | None = None) -> Reading:
    """
    Read a bundle and elaborate it.

    `policy`, `period` (seconds), `constants` (see `override_constants`) and `stamp` override those
    of the bundle. `find_message` returns the layout of a message type; None: of what is installed.
    `part` are the requirements to take of it, None: all. The hash is that of the whole bundle.
    Without `takes_instances`, a bundle with `for_each` or `where` is refused. `read_file` is as
    `read_source`. `memory` is as of `specify`.

    Raises
    ------
    CompileError
        with all problems of the bundle.
    """
    problems, constants = Problems(), constants or {}
    needs_period = period is None and policy in (None, Policy.PERIODIC)
    written = survey_bundle(path, problems, needs_period=needs_period, read_file=read_file)
    if written is None:
        raise CompileError(problems.errors)
    with_policy = _with_stamp(_with_policy(written, policy, period, problems), stamp, problems)
    bundle = override_constants(with_policy, constants, problems)
    if not takes_instances:
        _refuse_instances(bundle, problems)
    specification, warnings = _specify(bundle, written, problems, find_message, memory)
    warnings = by_place((*warnings, *doubtful_sentences(specification),
                         *unread_topics(bundle, specification),
                         *doubtful_topics(bundle, specification),
                         *doubtful_units(bundle, specification),
                         *gate_warnings(bundle, specification),
                         *action_warnings(bundle, specification),
                         *weaker_with_nan(specification),
                         *reports_once(specification), *doubtful_instants(specification)))
    find_message = find_message or find_installed
    messages = _messages(specification, find_message)
    taken = specification if part is None else restrict(specification, part)
    values = tuple((item.name.value, item.value.value) for item in bundle.constants)
    overrides = {name: text.value for name, text in constants.items()}
    return Reading(taken, warnings,
                   _bundle_hash(bundle, specification, messages, overrides),
                   tuple((Path(source.name), text_hash(source.text)) for source in bundle.sources),
                   messages if part is None else _messages(taken, find_message), values, bundle)


def read_one_instance(path: Path, *, constants: Mapping[str, Text] | None = None) -> Reading:
    """Read a bundle as of one instance of each of its variables; errors as of `read`."""
    reading = read(path, constants=constants, takes_instances=True)
    return replace(reading, specification=one_instance(reading.specification))


def without_probabilities(reading: Reading, verb: str) -> tuple[Reading, tuple[Diagnostic, ...]]:
    """
    Return a bundle without its requirements with probabilities, and a warning for each.

    Raises
    ------
    CompileError
        if there are no others.
    """
    found = reading.specification.properties
    kept = tuple(item for item in found if item.probability is None)
    problems = Problems()
    for item in found:
        if item.probability is not None:
            (problems.warning if kept else problems.error)(
                f'`{verb}` leaves out {item.id}: it is about a probability', item.place,
                'no single run satisfies or violates it', '' if kept else
                'fret-monitor bag and a running monitor test it')
    problems.raise_errors()
    return replace(reading, specification=replace(
        reading.specification, properties=kept)), problems.warnings


def _refuse_instances(bundle: Bundle, problems: Problems) -> None:
    """Report what only `check` and `simulate` can do yet."""
    for place in (*(item.name.span for item in bundle.instance_variables[:1]),
                  *(item.where.span for item in bundle.inputs if item.where)):
        problems.error("'for_each' and 'where' are not supported here yet", place, '',
                       'fret-monitor check, simulate and bag know them')


def _specify(
    bundle: Bundle, written: Bundle, problems: Problems, find_message: FindMessage | None,
    memory: RequirementMemory | None,
) -> tuple[Specification, tuple[Diagnostic, ...]]:
    """Elaborate a bundle; the errors name constants that are not as they were written."""
    try:
        return specify(bundle, find_message, problems, memory)
    except CompileError as error:
        changed = [(old.value, new.value) for old, new in zip(
            written.constants, bundle.constants, strict=True) if new is not old]
        causes = [Diagnostic(f'with {new.source.name} = {new} in place of {old}',
                             level=Level.WARNING) for old, new in changed]
        raise CompileError((*error.diagnostics, *causes)) from None


def constant_names(path: Path) -> tuple[str, ...]:
    """Return the names of the constants of a bundle, as far as it can be read."""
    bundle = survey_bundle(path, Problems())
    return tuple(item.name.value for item in bundle.constants) if bundle else ()


def own_constants(path: Path, constants: Mapping[str, Text]) -> dict[str, Text]:
    """Return the constants that a bundle has, of those that are given for several."""
    names = {fret_name(name) for name in constant_names(path)}
    return {name: text for name, text in constants.items() if fret_name(name) in names}


def gate_names(path: Path) -> tuple[str, ...]:
    """Return the names of the gates of a bundle, with keys, as far as it can be read."""
    bundle = survey_bundle(path, Problems())
    return tuple(name for item in bundle.gates
                 for name in names_with_keys(item, bundle)) if bundle else ()


def _messages(specification: Specification,
              find_message: FindMessage) -> tuple[tuple[str, str], ...]:
    """Return the fingerprint of each message that is read or written."""
    layouts = {item.layout.name: item.layout for item in specification.signals if item.layout}
    gates = (*specification.gates, *([specification.gate] if specification.gate else []))
    types = [*(item.payload_type for item in specification.actions),
             *(gate.settings.payload_type for gate in gates)]
    layouts |= {name: find_message(name) for name in types if name and name not in layouts}
    return tuple((name, fingerprint(layout)) for name, layout in layouts.items())


def _with_policy(bundle: Bundle, policy: Policy | None, period: Fraction | None,
                 problems: Problems) -> Bundle:
    """Override policy and period; a period missing in the file has been reported already."""
    policy = policy or bundle.policy
    period = (period or bundle.period) if policy is Policy.PERIODIC else period
    if policy is Policy.PERIODIC and period is None and policy is not bundle.policy:
        problems.error(f'the policy periodic needs a period ({bundle.sources[0].name})',
                       help='give a period (seconds) or a rate (Hz)')
    if policy is not Policy.PERIODIC and period is not None:
        problems.error(
            f'a period or a rate goes with the policy periodic, not with {policy.value} '
            f'({bundle.sources[0].name})',
            help='policy: periodic; as a parameter of the node, -p policy:=periodic')
    if policy is not Policy.TIMED:
        bundle = replace(bundle, unit=None, stamp=Stamp.RECEIVED, reorder=0)
    return replace(bundle, policy=policy, period=period)


def _with_stamp(bundle: Bundle, stamp: Stamp | None, problems: Problems) -> Bundle:
    if stamp is None or stamp is bundle.stamp:
        return bundle
    if bundle.policy is not Policy.TIMED:
        problems.error(f'stamps count under the policy timed, not under {bundle.policy.value}')
    return replace(bundle, stamp=stamp, reorder=int(
        USUAL_REORDER_S * 10**9) if stamp is Stamp.HEADER else 0)


def text_hash(text: str) -> str:
    """Return the SHA-256 of a text."""
    return hashlib.sha256(text.encode('utf-8', 'surrogatepass')).hexdigest()


def _bundle_hash(bundle: Bundle, specification: Specification,
                 messages: tuple[tuple[str, str], ...], constants: Mapping[str, str]) -> str:
    """Hash the files' texts, the message definitions and the overrides."""
    parts = [str(FORMAT), bundle.name, *(source.text for source in bundle.sources)]
    parts += [repr(item) for item in (*specification.signals, *specification.actions,
                                      *specification.gates)]
    parts += [f'{name} {fingerprint}' for name, fingerprint in messages]
    parts += [specification.policy.value, str(specification.period)]
    parts += [f'{name}={value}' for name, value in sorted(constants.items())]
    return text_hash('\0'.join(parts))


def with_name(reading: Reading, name: str) -> Reading:
    """Give a bundle another name, which its files and symbols in C begin with."""
    return replace(reading, specification=replace(reading.specification, name=name))


def with_margins(reading: Reading) -> Reading:
    """Have the steps of a bundle compute margins, too (docs/margins.md)."""
    return replace(reading, specification=replace(reading.specification, has_margins=True))


def generate_monitor(reading: Reading, *,
                     max_state_bytes: int = MAX_STATE_BYTES) -> GeneratedMonitor:
    """
    Lower a specification and write its C.

    Raises
    ------
    CompileError
        if it needs more than `max_state_bytes` of state.
    """
    specification = bundle_scope(reading.specification)
    program, layouts = _lowered(specification, max_state_bytes)
    scopes = instance_scopes(reading.specification)
    keyed = [item.specification.signals for item in scopes]
    module = generate(program, layouts, keyed)
    topics = described_topics(program.signals, keyed)
    manifest = describe(program, layouts, module, specification, reading.bundle_hash,
                        reading.constants, topics, reading.specification.properties)
    kinds = tuple(_generate_kind(scope, reading, max_state_bytes, topics) for scope in scopes)
    if reading.specification.instance_variables:
        manifest = with_kinds(manifest, [(item.scope, item.manifest) for item in kinds],
                              reading.specification)
    warnings = _warnings(reading, program, [(item.scope, item.program) for item in kinds])
    return GeneratedMonitor(specification, program, layouts, module, manifest, warnings,
                            reading.paths, kinds)


def _generate_kind(scope: InstanceScope, reading: Reading, max_state_bytes: int,
                   topics: Mapping[Feed, ManifestTopic]) -> GeneratedKind:
    program, layouts = _lowered_scope(scope, reading, max_state_bytes)
    module = generate(program, layouts, None)
    manifest = describe(program, layouts, module, scope.specification, reading.bundle_hash,
                        reading.constants, topics, reading.specification.properties)
    return GeneratedKind(scope, program, layouts, module, manifest)


def check_reading(reading: Reading) -> tuple[Diagnostic, ...]:
    """Return the warnings of a bundle, as `generate_monitor` does, with its errors, without C."""
    program, _ = _lowered(bundle_scope(reading.specification), MAX_STATE_BYTES)
    return _warnings(reading, program, [
        (scope, _lowered_scope(scope, reading, MAX_STATE_BYTES)[0])
        for scope in instance_scopes(reading.specification)])


def _lowered(specification: Specification, max_state_bytes: int) -> tuple[
        MonitorProgram, tuple[GroupLayout, ...]]:
    program = lower(specification)
    layouts = tuple(lay_out(group) for group in program.groups)
    check_bounds(program, layouts, max_state_bytes)
    return program, layouts


def _lowered_scope(scope: InstanceScope, reading: Reading, max_state_bytes: int) -> tuple[
        MonitorProgram, tuple[GroupLayout, ...]]:
    program, layouts = _lowered(scope.specification, max_state_bytes)
    check_instances(program, layouts, [
        item for item in reading.specification.instance_variables
        if item.name in scope.variables], next(
            (item.name.span for item in reading.bundle.instance_variables
             if item.name.value in scope.variables and not item.keys), None)
        if reading.bundle else None)
    return program, layouts


def _warnings(reading: Reading, program: MonitorProgram,
              scopes: Iterable[tuple[InstanceScope, MonitorProgram]]) -> tuple[Diagnostic, ...]:
    return by_place((
        *reading.warnings, *constant_verdicts(bundle_scope(reading.specification), program),
        *(warning for scope, lowered in scopes for warning in constant_verdicts(
            scope.specification, lowered, scope.n_reported))))


def compile_monitor(generated: GeneratedMonitor) -> CompiledMonitor:
    """
    Compile generated C, or take the library from the cache.

    Raises
    ------
    NativeError
        if there is no C compiler, it fails, or the cache is not safe to use.
    """
    library = build_library(generated.c_sources, name=generated.manifest.symbol,
                            headers={**runtime_headers(), **generated.c_headers})
    return CompiledMonitor(generated.manifest, library, generated.warnings, generated.sources)


def build(path: Path, *, policy: Policy | None = None, period: Fraction | None = None,
          constants: Mapping[str, Text] | None = None, stamp: Stamp | None = None,
          find_message: FindMessage | None = None,
          max_state_bytes: int = MAX_STATE_BYTES) -> CompiledMonitor:
    """Read, generate and compile a bundle; arguments and errors as `read`, `compile_monitor`."""
    reading = read(path, policy=policy, period=period, constants=constants, stamp=stamp,
                   find_message=find_message)
    return compile_monitor(generate_monitor(reading, max_state_bytes=max_state_bytes))


def build_specification(specification: Specification) -> CompiledMonitor:
    """Compile a specification that was not read from a bundle; for `traces` and tests."""
    digest = hashlib.sha256(repr(specification.signals).encode()).hexdigest()
    return compile_monitor(generate_monitor(Reading(specification, (), digest, ())))


def write(generated: GeneratedMonitor, directory: Path) -> None:
    """
    Compile a bundle and write its folder; errors as `write_folder` and `compile_monitor`.

    A folder that cannot be written is refused before the compiler runs.
    """
    check_writable(directory)
    compiled = compile_monitor(generated)
    write_folder(directory, compiled.manifest, compiled.library, generated.module.files)
