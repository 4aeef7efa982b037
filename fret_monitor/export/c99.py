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
Target `c99`: monitors and evaluator as C99, with a CMake file and a test.

The test has a trace and its verdicts by the reference evaluator, so that a build for another
machine can be tested there.
"""

from collections.abc import Iterable, Iterator, Mapping
import re

from fret_monitor.build import GeneratedMonitor
from fret_monitor.codegen.c import string_literal
from fret_monitor.export import flight
from fret_monitor.export.content import (
    common_values, Content, csrc_files, EVALUATOR, export_name, ExportPart, fill, hand_written,
    HandlerArguments, Options, runtime_files, structs,
)
from fret_monitor.export.examples import example
from fret_monitor.export.margins_header import margins_header
from fret_monitor.model.diagnostics import refuse
from fret_monitor.model.policies import Policy
from fret_monitor.native.compiler import COMPILE_FLAGS

_EXTRACTORS = ('fret_cdr.h', 'fret_fields.h', 'fret_reductions.h')
_FIELDS_ROW = ('| `src/{}_fields.c`, `src/fret_fields.h` | reads the inputs from serialized '
               'messages (CDR) |\n')
_MARGINS_ROW = ('| `src/{}_margins.h`, `src/fret_margins.h` | how far each requirement is from '
                'the other verdict, and which comparison decides that |\n')

_FUNCTION = re.compile(r'^FM_(?:EXPORT|INTERNAL)\s[^(;]*?\b(fm_\w+)\(', re.MULTILINE)
_NAMES_HEADER = 'fret_names.h'


def c99(generated: GeneratedMonitor, options: Options) -> Content:
    """
    Return the files; every bundle can be exported.

    Raises
    ------
    CompileError
        if handlers shall have arguments: this target calls none.
    """
    if options.handler_arguments is not HandlerArguments.NONE:
        refuse('the target c99 calls no handlers', help='leave --handler-arguments out: a '
               'verdict is an element of an array, and the inputs are a struct')
    name, files = export_name(generated), generated.module.files
    extractors = _EXTRACTORS if generated.module.readers else ()
    library = {**runtime_files(generated), **csrc_files(*EVALUATOR, *extractors), **files}
    values = {**common_values(generated, options), **flight.runner_values(generated)}
    if generated.manifest.inputs:
        library[f'{name}_options.h'] = '\n'.join([*flight.options_header(generated), ''])
        library[f'{name}_size.h'] = fill('NAME_size.h', hand_written('flight')['NAME_size.h'],
                                         values)
    if generated.manifest.margins:
        library[f'{name}_margins.h'] = '\n'.join([*margins_header(generated), ''])
    if options.prefix:
        library = _with_prefix(library, options.prefix)
    more_headers = ('instance.h', 'tables.h', f'{name}_options.h', f'{name}_size.h',
                    f'{name}_margins.h', _NAMES_HEADER)
    trace, verdicts = example(generated)
    values = {
        **values,
        'LIBRARY_SOURCES': '\n  '.join(f'src/{file}' for file in library if file.endswith('.c')),
        'EXACT_FLAGS': '\n    '.join(flag for flag in COMPILE_FLAGS if flag.startswith(
            ('-ffp-contract', '-fno-builtin'))),
        'EXAMPLE': '\n'.join(_example(name, generated.manifest.policy is Policy.TIMED)),
        'MORE_HEADERS': ''.join(f' src/{file}' for file in library if file in more_headers),
        'MARGINS_ROW': _MARGINS_ROW.format(name) if generated.manifest.margins else '',
        'FIELDS_ROW': _FIELDS_ROW.format(name) if generated.module.readers else '',
    }
    return Content(
        generated={
            **{f'src/{file}': text for file, text in library.items()},
            'test/test_tables.h': '\n'.join(
                [*_tables(generated, verdicts.partition('\n')[0]), '']),
            'test/trace.csv': trace, 'test/verdicts.csv': verdicts},
        templates=hand_written('c99'), values=values,
        parts=tuple(_parts(generated)))


def _parts(generated: GeneratedMonitor) -> Iterator[ExportPart]:
    name = export_name(generated)

    def sources(files: Iterable[str]) -> tuple[str, ...]:
        return tuple(f'src/{file}' for file in files if file.endswith('.c'))

    monitors = sources(file for file in generated.module.files if file != f'{name}_fields.c')
    yield ExportPart('monitors alone', monitors, 'src', f'{name}_monitor.h',
                     structs(f'{name}_state', f'{name}_inputs'))
    if generated.manifest.inputs:
        size = f'{name.upper()}_EVALUATOR_BYTES'
        yield ExportPart('monitors with evaluator', monitors + sources(EVALUATOR), 'src',
                         f'{name}_size.h', {size: size})
    if generated.module.readers:
        yield ExportPart('readers of messages', sources([f'{name}_fields.c']), 'src')


def _with_prefix(library: Mapping[str, str], prefix: str) -> dict[str, str]:
    """Return the library with a header that gives the evaluator's functions names of its own."""
    functions = sorted({name for text in library.values() for name in _FUNCTION.findall(text)})
    guard = '#define FRET_MONITOR_H_\n'
    names = ['// The functions of the evaluator in this export have a prefix, so that it can be',
             '// linked with other exports. Generated by fret_monitor; changes will be lost.',
             '', '#ifndef FRET_NAMES_H_', '#define FRET_NAMES_H_', '',
             *(f'#define {name} {prefix}_{name}' for name in functions),
             '', '#endif  // FRET_NAMES_H_', '']
    include = f'#include "{_NAMES_HEADER}"\n'
    common = library['fret_monitor.h'].replace(guard, f'{guard}\n{include}', 1)
    return {**library, 'fret_monitor.h': common, _NAMES_HEADER: '\n'.join(names)}


def _example(name: str, is_timed: bool) -> Iterator[str]:
    yield f'struct {name}_state state;'
    yield f'struct {name}_inputs inputs;'
    yield f'bool verdicts[{name}_verdicts];'
    if is_timed:
        yield 'int64_t tick = 0, next;  // nanoseconds since the first call'
    yield ''
    yield f'{name}_reset(&state);             // once'
    yield '// set the fields of inputs, then:'
    if is_timed:
        yield f'next = {name}_step_at(&state, &inputs, verdicts, tick);'
        yield '// again when an input changes, with the tick of then, and before that at tick'
        yield '// `next` with the old inputs, unless it is FM_NEVER. Ticks increase.'
    else:
        yield f'{name}_step(&state, &inputs, verdicts);'
    yield '// verdicts[i] is false if requirement i is violated'


def _tables(generated: GeneratedMonitor, heading: str) -> Iterator[str]:
    """Yield the header by which the test program knows the bundle."""
    name, manifest = export_name(generated), generated.manifest
    is_timed = manifest.policy is Policy.TIMED
    yield '// What test.c must know of the bundle. Generated by fret_monitor.'
    yield ''
    yield f'#include "{name}_monitor.h"'
    yield ''
    yield f'#define TEST_IS_TIMED {int(is_timed)}'
    for what, word in (('MONITOR', 'monitor'), ('RESET', 'reset'),
                       ('STEP', 'step_at' if is_timed else 'step'),
                       ('REQUIREMENTS', 'requirements'), ('VERDICTS', 'verdicts')):
        yield f'#define TEST_{what} {name}_{word}'
    yield f'#define TEST_INPUTS struct {name}_inputs'
    yield f'#define TEST_STATE struct {name}_state'
    yield ''
    yield '// Names for values of inputs; the last one ends the list.'
    yield 'static const struct {uint32_t input; const char * name; const char * number;} ' \
          'test_values[] = {'
    for index, item in enumerate(manifest.inputs):
        for word, number in item.stored_values:
            yield f'  {{{index}u, {string_literal(word.encode())}, "{number}"}},'
    yield '  {UINT32_MAX, "", ""},'
    yield '};'
    yield ''
    yield f'static const char test_heading[] = {string_literal(heading.encode())};'
