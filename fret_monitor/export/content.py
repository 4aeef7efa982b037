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

"""What a target makes of a bundle: files, and values for the placeholders in some of them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
import re

from fret_monitor import __version__
from fret_monitor.build import GeneratedMonitor
from fret_monitor.codegen.comments import safe
from fret_monitor.codegen.inputs import meaning
from fret_monitor.model.diagnostics import counted, Diagnostic, Problems, refuse, Source, Span
from fret_monitor.model.manifest import Manifest, ManifestRequirement
from fret_monitor.model.parts import judged_by_gates
from fret_monitor.model.policies import Policy
from fret_monitor.native.cache import csrc_directory, csrc_file

_PLACEHOLDER = re.compile(r'@([A-Z][A-Z_]*)@')


class HandlerArguments(Enum):
    """What handlers that the user defines are called with."""

    NONE = 'none'
    VALUES = 'values'


@dataclass(frozen=True)
class Options:
    """
    Options of an export.

    `prefix` begins every name that the export defines for others to use; '' if the names are those
    that the target has by itself. The bundle then has the same name, see `renamed`. `name`: of an
    export of several bundles.
    """

    prefix: str = ''
    handler_arguments: HandlerArguments = HandlerArguments.NONE
    name: str = ''


@dataclass(frozen=True)
class ExportPart:
    """
    C of an export of which the size is of interest.

    `name` says what is counted. Each of `sources` can be compiled alone, in the folder, with the
    search path `include`. `held` is the memory that the program provides: C expressions of bytes,
    by what is shown of them; the header `header` declares what they name.
    """

    name: str
    sources: tuple[str, ...]
    include: str = '.'
    header: str = ''
    held: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Content:
    """
    The files of an export by relative path.

    `generated` are final texts that a user cannot replace. In `templates`, which a user can
    replace, each `@NAME@` stands for a value in `values`. `parts` are measured.
    """

    generated: Mapping[str, str]
    templates: Mapping[str, str]
    values: Mapping[str, str]
    parts: tuple[ExportPart, ...]
    warnings: tuple[Diagnostic, ...] = ()


def fill(name: str, text: str, values: Mapping[str, str]) -> str:
    """
    Replace the placeholders of a file.

    Raises
    ------
    CompileError
        if there is no value for a placeholder; with its place.
    """
    def value(found: re.Match[str]) -> str:
        if found[1] not in values:
            refuse(f"there is no placeholder '{found[0]}'",
                   Span(Source(name, text), *found.span()),
                   help='there are ' + ', '.join(f'@{word}@' for word in sorted(values)))
        return values[found[1]]

    return _PLACEHOLDER.sub(value, text)


def hand_written(target: str) -> dict[str, str]:
    """Return the files of `csrc/export/TARGET` by their path in it."""
    folder = csrc_directory() / 'export' / target
    return {path.relative_to(folder).as_posix(): path.read_text(encoding='utf-8')
            for path in sorted(folder.rglob('*')) if path.is_file()}


EVALUATOR = (*(f'{name}.{kind}' for name in (
    'evaluator', 'instance', 'tables', 'due', 'measures', 'steps') for kind in ('h', 'c')),
    'deadlines.c')
"""The files of `csrc` that run monitors from messages, without ROS."""


def csrc_files(*names: str) -> dict[str, str]:
    """Return files of `csrc` by their names."""
    return {name: csrc_file(name).read_text(encoding='utf-8') for name in names}


def runtime_files(generated: GeneratedMonitor) -> dict[str, str]:
    """Return the headers that the generated monitors include."""
    return csrc_files(*generated.module.runtime_headers)


def structs(*names: str) -> dict[str, str]:
    """Return the memory of structs, as in `ExportPart.held`."""
    return {f'struct {name}': f'sizeof(struct {name})' for name in names}


def export_name(generated: GeneratedMonitor) -> str:
    """Return the word that the names of a bundle begin with in C, such as `quadrotor`."""
    return generated.manifest.symbol.removesuffix('_monitor')


def common_values(generated: GeneratedMonitor, options: Options) -> dict[str, str]:
    """Return the placeholders that every target has."""
    manifest = generated.manifest
    return {
        'NAME': export_name(generated),
        'PREFIX': f'{options.prefix}_' if options.prefix else '',
        'BUNDLE': markdown(generated.sources[0].name if generated.sources else manifest.name),
        'VERSION': __version__,
        'SOURCES': '\n  '.join(name for name in generated.module.files if name.endswith('.c')),
        'STATE_BYTES': counted(manifest.state_bytes, 'byte'),
        'STEP': _step(generated),
        'REQUIREMENTS': '\n'.join(_requirements(manifest.requirements)),
        'INPUT_TABLE': '\n'.join(_inputs(manifest)),
    }


_BETWEEN = {'BUNDLE': ', ', 'STATE_BYTES': ', ', 'SOURCES': '\n  '}


def values_of_several(monitors: Sequence[GeneratedMonitor], options: Options) -> dict[str, str]:
    """Return these placeholders for an export of several bundles, one value after the other."""
    each = [common_values(item, options) for item in monitors]
    joined = {key: _BETWEEN.get(key, '\n\n').join(dict.fromkeys(values[key] for values in each))
              for key in each[0]}
    return {**joined, 'NAME': options.name}


def unacted(generated: GeneratedMonitor, *, acts: bool) -> tuple[Diagnostic, ...]:
    """Return warnings of what an export leaves out; `acts`: it starts actions."""
    problems = Problems()
    for item in generated.specification.properties:
        if not acts and (item.on_violation or item.on_end):
            problems.warning(f"no action follows '{item.id}' in an export", item.id_place,
                             'the program that it is built into has to act')
    for gate in generated.specification.gates:
        problems.warning(f"the gate '{gate.name}' is not part of an export", gate.place,
                         'no message passes through it')
    if text := judged_by_gates(generated.manifest.kept, f'spec:={generated.sources[0]}'):
        problems.warning(text)
    return problems.warnings


def markdown(text: str) -> str:
    """Return text of a bundle as it can stand in a table of Markdown, on one line."""
    return re.sub(r'([\\`*_{}\[\]<>#|~])', r'\\\1', safe(text))


def _step(generated: GeneratedMonitor) -> str:
    """Return what a step is, as a sentence for a README."""
    manifest = generated.manifest
    match manifest.policy:
        case Policy.TIMED:
            return 'Times count in nanoseconds; an evaluation is made when a value or a verdict ' \
                   'can change.'
        case Policy.PERIODIC:
            return f'A step is a period of {manifest.period:g} s: call it that often.'
        case Policy.EVERY_MESSAGE | Policy.RELEVANT_MESSAGE | Policy.ALL_INPUTS:
            return 'Bounds in formulas count steps.'


def _inputs(manifest: Manifest) -> Iterator[str]:
    yield '| input | type | is |'
    yield '|---|---|---|'
    for item in manifest.inputs:
        kind = 'string' if item.is_string else item.value_type.value
        yield f'| {markdown(item.name)} | {kind} | {markdown(meaning(item))} |'
    if manifest.constants:
        values = (f'`{name} = {value}`' for name, value in manifest.constants)
        yield from ('', f'The constants are compiled in: {", ".join(values)}.')


def _requirements(items: tuple[ManifestRequirement, ...]) -> Iterator[str]:
    yield '| requirement | text |'
    yield '|---|---|'
    for item in items:
        yield f'| {markdown(item.id)} | {markdown(item.title or item.text)} |'
