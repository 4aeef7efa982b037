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
From a bundle to a monitor that runs: the one place that sees all stages.

    text -> Bundle -> Specification -> MonitorProgram -> C module + Manifest -> library -> Monitor
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from fractions import Fraction
import hashlib
import os
from pathlib import Path
import shutil
import tempfile

from fret_monitor.bundle.bundle import Bundle, survey_bundle
from fret_monitor.codegen.describe import describe
from fret_monitor.codegen.module import CModule, generate
from fret_monitor.elaboration.elaborate import specify
from fret_monitor.lint.constant_verdicts import constant_verdicts
from fret_monitor.lint.sentences import doubtful_sentences
from fret_monitor.lint.unread import unread_topics
from fret_monitor.logic.specification import Specification
from fret_monitor.model.diagnostics import by_place, CompileError, Diagnostic, Problems, refuse
from fret_monitor.model.manifest import FORMAT, Manifest
from fret_monitor.model.policies import Policy
from fret_monitor.native.cache import (
    build_library, csrc_directory, evaluator_library, EVALUATOR_SOURCES, runtime_headers,
)
from fret_monitor.native.compiler import find_compiler
from fret_monitor.native.folder import (
    EVALUATOR_FILE, is_compiled, library_file, MANIFEST_FILE, open_folder,
)
from fret_monitor.native.monitor import CompiledMonitor
from fret_monitor.native.stack import call_graph
from fret_monitor.program.cost import Cost, step_cost
from fret_monitor.program.layout import check_bounds, GroupLayout, lay_out, MAX_STATE_BYTES
from fret_monitor.program.lower import lower
from fret_monitor.program.monitor_program import MonitorProgram

_SOURCES = Path('src')


@dataclass(frozen=True)
class Reading:
    """
    A bundle as understood: what it means, what was odd about it, and its hash.

    `files` are those it was read from, the bundle first, each with the SHA-256 of what was read;
    `messages` the message types it reads, each with the fingerprint of its definition.
    """

    specification: Specification
    warnings: tuple[Diagnostic, ...]
    bundle_hash: str
    files: tuple[tuple[Path, str], ...]
    messages: tuple[tuple[str, str], ...] = ()

    @property
    def paths(self) -> tuple[Path, ...]:
        """The files it was read from, the bundle first."""
        return tuple(path for path, _ in self.files)


@dataclass(frozen=True)
class GeneratedMonitor:
    """
    The C of a bundle, and all that was decided on the way; nothing is compiled yet.

    `sources` are the files that the bundle was read from.
    """

    specification: Specification
    program: MonitorProgram
    layouts: tuple[GroupLayout, ...]
    module: CModule
    manifest: Manifest
    warnings: tuple[Diagnostic, ...]
    sources: tuple[Path, ...]


def read(path: Path, *, policy: Policy | None = None, period: Fraction | None = None) -> Reading:
    """
    Read a bundle and give it its meaning.

    `policy` and `period` (seconds) stand in for those of the bundle.

    Raises
    ------
    CompileError
        with all that is wrong with the bundle.
    """
    problems = Problems()
    needs_period = period is None and policy in (None, Policy.PERIODIC)
    written = survey_bundle(path, problems, needs_period=needs_period)
    if written is None:
        raise CompileError(problems.errors)
    bundle = _with_policy(written, policy, period, problems)
    specification, warnings = specify(bundle, problems=problems)
    warnings = by_place((*warnings, *doubtful_sentences(specification),
                         *unread_topics(bundle, specification)))
    messages = _messages(specification)
    return Reading(specification, warnings, _bundle_hash(bundle, specification, messages),
                   tuple((Path(source.name), text_hash(source.text)) for source in bundle.sources),
                   messages)


def _messages(specification: Specification) -> tuple[tuple[str, str], ...]:
    layouts = {item.layout.name: item.layout for item in specification.signals if item.layout}
    return tuple((name, layout.fingerprint) for name, layout in layouts.items())


def _with_policy(bundle: Bundle, policy: Policy | None, period: Fraction | None,
                 problems: Problems) -> Bundle:
    """Put a policy and a period in; a period that the file itself lacks is told already."""
    policy = policy or bundle.policy
    period = (period or bundle.period) if policy is Policy.PERIODIC else period
    if policy is Policy.PERIODIC and period is None and policy is not bundle.policy:
        problems.error('the policy periodic needs a period',
                       help='give a period (seconds) or a rate (Hz)')
    if policy is not Policy.PERIODIC and period is not None:
        problems.error(
            f'a period or a rate goes with the policy periodic, not with {policy.value}',
            help='policy: periodic; as a parameter of the node, -p policy:=periodic')
    return replace(bundle, policy=policy, period=period)


def text_hash(text: str) -> str:
    """Return the SHA-256 of a text."""
    return hashlib.sha256(text.encode('utf-8', 'surrogatepass')).hexdigest()


def _bundle_hash(bundle: Bundle, specification: Specification,
                 messages: tuple[tuple[str, str], ...]) -> str:
    """Hash the files' texts and what the message definitions and overrides made of them."""
    parts = [str(FORMAT), bundle.name, *(source.text for source in bundle.sources)]
    parts += [repr(signal) for signal in specification.signals]
    parts += [f'{name} {fingerprint}' for name, fingerprint in messages]
    parts += [specification.policy.value, str(specification.period)]
    return text_hash('\0'.join(parts))


def generate_monitor(reading: Reading, *,
                     max_state_bytes: int = MAX_STATE_BYTES) -> GeneratedMonitor:
    """
    Lower a specification and write its C.

    Raises
    ------
    CompileError
        if it needs more than `max_state_bytes` of state.
    """
    program = lower(reading.specification)
    layouts = tuple(lay_out(group) for group in program.groups)
    check_bounds(program, layouts, max_state_bytes)
    module = generate(program, layouts)
    manifest = describe(program, layouts, module, reading.bundle_hash)
    warnings = by_place((*reading.warnings,
                         *constant_verdicts(reading.specification, program)))
    return GeneratedMonitor(reading.specification, program, layouts, module, manifest, warnings,
                            reading.paths)


def compile_monitor(generated: GeneratedMonitor) -> CompiledMonitor:
    """
    Compile generated C, or find it compiled.

    Raises
    ------
    NativeError
        if there is no C compiler, it fails, or the cache is not safe to use.
    """
    header, text = generated.module.header
    library = build_library(dict(generated.module.sources), name=generated.manifest.symbol,
                            headers={**runtime_headers(), header: text})
    warnings = tuple(warning.render() for warning in generated.warnings)
    return CompiledMonitor(generated.manifest, library, warnings, generated.sources)


def build(path: Path, *, policy: Policy | None = None, period: Fraction | None = None,
          max_state_bytes: int = MAX_STATE_BYTES) -> CompiledMonitor:
    """Read, generate and compile a bundle; errors as `read` and `compile_monitor`."""
    reading = read(path, policy=policy, period=period)
    return compile_monitor(generate_monitor(reading, max_state_bytes=max_state_bytes))


def build_specification(specification: Specification) -> CompiledMonitor:
    """Compile what is specified already; for tools and tests."""
    digest = hashlib.sha256(repr(specification.signals).encode()).hexdigest()
    return compile_monitor(generate_monitor(Reading(specification, (), digest, ())))


def write(generated: GeneratedMonitor, directory: Path) -> None:
    """
    Write what a robot needs to run a bundle: libraries, manifest, and the sources.

    The folder appears as a whole or not at all. One that `write` made before is replaced.

    Raises
    ------
    CompileError
        if `directory` is something else and not empty, or cannot be written.
    NativeError
        as `compile_monitor`.
    """
    place = Path(os.path.realpath(directory))  # a link stays one
    with _telling(directory):
        _refuse_occupied(directory, place)
    compiled = compile_monitor(generated)
    evaluator = evaluator_library()
    with _telling(directory):
        place.parent.mkdir(parents=True, exist_ok=True)
        unfinished = Path(tempfile.mkdtemp(prefix='.fret_monitor-', dir=place.parent))
        try:
            _fill(unfinished, generated, compiled.library, evaluator)
            _put_in_place(unfinished, place)
        finally:
            shutil.rmtree(unfinished, ignore_errors=True)


@contextmanager
def _telling(directory: Path) -> Iterator[None]:
    """Refuse a folder that the system refuses."""
    try:
        yield
    except FileExistsError as error:
        refuse(f"cannot write '{directory}': '{error.filename}' is a file")
    except OSError as error:
        refuse(f"cannot write '{directory}': {error.strerror or error}")


def _refuse_occupied(directory: Path, place: Path) -> None:
    if place.is_dir() and not is_compiled(place) and any(place.iterdir()):
        refuse(f"'{directory}' holds other files", help='name an empty folder, or a new one')
    for other in _others(place):
        refuse(f"'{directory}' holds '{other}', which `compile` did not write",
               help='move it away, or name a new folder')
    if place.exists() and not place.is_dir():
        refuse(f"'{directory}' is a file", help='name a folder')
    if place == Path.cwd():
        refuse(f"'{directory}' is the folder you are in", help='it is put in place as a whole: '
               'name a new folder')


def _others(place: Path) -> Iterator[Path]:
    """Yield what is in a compiled folder besides what belongs there."""
    if not is_compiled(place):
        return
    manifest = open_folder(place).manifest
    ours = {Path(MANIFEST_FILE), Path(EVALUATOR_FILE), Path(library_file(manifest)), _SOURCES}
    ours |= {_SOURCES / name for name in (*manifest.sources, *_handwritten())}
    yield from (found for found in sorted(path.relative_to(place) for path in place.rglob('*'))
                if found not in ours)


def source_files(generated: GeneratedMonitor) -> dict[str, str]:
    """Return all C that `write` puts into the folder `src`, by file name."""
    return {**_handwritten(), **dict([generated.module.header, *generated.module.sources])}


def _handwritten() -> dict[str, str]:
    """Return the hand-written C that belongs beside generated C, by file name."""
    return {**runtime_headers(),
            **{name: (csrc_directory() / name).read_text(encoding='utf-8')
               for name in EVALUATOR_SOURCES}}


def _fill(folder: Path, generated: GeneratedMonitor, library: Path, evaluator: Path) -> None:
    folder.chmod(0o755)
    manifest = generated.manifest
    (folder / MANIFEST_FILE).write_text(manifest.to_json(), encoding='utf-8')
    shutil.copyfile(library, folder / library_file(manifest))
    shutil.copyfile(evaluator, folder / EVALUATOR_FILE)
    sources = folder / _SOURCES
    sources.mkdir()
    for name, text in source_files(generated).items():
        (sources / name).write_text(text, encoding='utf-8')


def _put_in_place(folder: Path, directory: Path) -> None:
    if not directory.exists():
        folder.rename(directory)
        return
    former = folder.with_name(folder.name + '-former')
    directory.rename(former)
    try:
        folder.rename(directory)
    except OSError:
        former.rename(directory)
        raise
    shutil.rmtree(former, ignore_errors=True)


@dataclass(frozen=True)
class Stack:
    """
    Bytes of stack at most: of the monitors' functions, and of the evaluator's that call them.

    `library` are the functions of the C library that are called; their stack comes on top.
    """

    monitor: int
    evaluator: int
    library: tuple[str, ...]


def worst_cost(generated: GeneratedMonitor) -> Cost:
    """Return the most instructions that a step of all groups takes."""
    return step_cost(generated.layouts)


def worst_stack(generated: GeneratedMonitor) -> Stack | None:
    """
    Return the most stack that a step takes; None if the C compiler cannot tell (only gcc can).

    Errors are those of `find_compiler`.
    """
    header, text = generated.module.header
    files = {**runtime_headers(), header: text, **dict(generated.module.sources)}
    files['evaluator.c'] = (csrc_directory() / 'evaluator.c').read_text(encoding='utf-8')
    compiler = find_compiler()
    monitor = call_graph(compiler, files, [name for name, _ in generated.module.sources])
    evaluator = call_graph(compiler, files, ['evaluator.c'])
    if monitor is None or evaluator is None:
        return None
    below = max(map(monitor.depth, monitor.frames))
    total = max(evaluator.depth(name, below) for name in evaluator.frames)
    functions = {name for name in monitor.external | evaluator.external
                 if name not in monitor.frames}
    return Stack(below, total - below, tuple(sorted(functions)))
