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
Target `copilot`: the interface of the C that Copilot 4 generates.

`NAME.h` declares inputs and handlers, which the user defines, and `step`. `NAME.c` includes the
monitors, so that it is one file to compile, as Copilot's, and defines no other external names.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import copysign, isfinite, isnan

from fret_monitor.build import GeneratedMonitor
from fret_monitor.codegen.c import literal
from fret_monitor.codegen.comments import comment, safe
from fret_monitor.codegen.inputs import number_text, origin
from fret_monitor.codegen.names import is_of_module, Names
from fret_monitor.export.content import (
    common_values, Content, export_name, ExportPart, hand_written, HandlerArguments, Options,
    runtime_files,
)
from fret_monitor.export.external_names import check_name, constant_names, input_names
from fret_monitor.model.diagnostics import Problems
from fret_monitor.model.manifest import Manifest, ManifestInput, ManifestRequirement
from fret_monitor.model.names import HANDLER_PREFIX
from fret_monitor.model.policies import Policy, Report, Stale, Stamp
from fret_monitor.model.values import ValueType

_MONITORS = 'monitors'


def copilot(generated: GeneratedMonitor, options: Options) -> Content:
    """
    Return the files.

    Raises
    ------
    CompileError
        if a name cannot be that of a variable in C, two names clash, or an input is `stale:
        violate`.
    """
    problems = Problems()
    check_name(_file_name(generated), problems)
    _check_timeouts(generated, problems)
    _check_stamps(generated, problems)
    _check_handlers(generated, options, problems)
    defined = _defined(generated.manifest, options)
    inputs = input_names(generated, defined, problems)
    _check_initial_values(generated, inputs, problems)
    constants = constant_names(generated, options.prefix, inputs, defined, problems)
    problems.raise_errors()
    writer = _CopilotWriter(generated, options, inputs, constants)
    hand = hand_written('copilot')
    module = generated.module.files
    monitors = {**runtime_files(generated), **module,
                **{name.partition('/')[2]: text for name, text in hand.items()
                   if name.startswith(f'{_MONITORS}/')}}
    monitors.pop(f'{writer.name}_fields.c', None)  # no messages are decoded
    file = _file_name(generated)
    texts = {f'{file}.h': writer.header(), f'{file}.c': writer.source(),
             f'{file}_types.h': writer.types()}
    return Content(
        generated={**{name: '\n'.join(lines) + '\n' for name, lines in texts.items()},
                   **{f'{_MONITORS}/{name}': text for name, text in monitors.items()}},
        templates={'README.md': hand['README.md']},
        values={**common_values(generated, options), **writer.values(), 'NAME': file},
        parts=(ExportPart(f'{file}.c with all its state', (f'{file}.c',)),),
        warnings=problems.warnings)


def _file_name(generated: GeneratedMonitor) -> str:
    """Return the name of the bundle; as a symbol it may have a prefix, see `Names`."""
    name = generated.program.name
    return name if name.isidentifier() and name.isascii() else export_name(generated)


def _check_timeouts(generated: GeneratedMonitor, problems: Problems) -> None:
    for signal in generated.specification.signals:
        if signal.timeout is not None and signal.stale is Stale.VIOLATE:
            problems.error(
                f"'{signal.name}' is 'stale: violate', which needs messages", signal.place,
                'Copilot has variables, which are never silent',
                'stale: warn')
        elif signal.timeout is not None:
            problems.warning(f"the timeout of '{signal.name}' has no effect in this export",
                             signal.place, 'Copilot has variables, which are never silent')


def _check_stamps(generated: GeneratedMonitor, problems: Problems) -> None:
    specification = generated.specification
    place = next((item.place for item in specification.signals if item.topic is not None), None)
    call = _functions(generated.manifest, Options())[0]
    if specification.stamp is Stamp.HEADER:
        problems.warning('`stamp: header` has no effect in this export', place,
                         'Copilot has variables, which have no headers',
                         f'pass the stamp of the message to {call}, in the order of the stamps')
    if specification.reorder:
        problems.warning('`reorder` has no effect in this export', place,
                         'values count in the order of the calls',
                         f'call {call} in the order of the stamps')


def _check_initial_values(generated: GeneratedMonitor, inputs: Mapping[str, str],
                          problems: Problems) -> None:
    items = generated.manifest.inputs
    for signal, item in zip(generated.specification.signals, items, strict=True):
        is_zero = item.initial == 0 and copysign(1, item.initial) > 0
        if item.initial is not None and not is_zero:
            problems.warning(
                f"'{item.name}' has its `initial` value only if the program defines it so",
                signal.place, 'a variable of C begins with 0',
                f'in the program: {definition(item, inputs[item.name])}')


def _functions(manifest: Manifest, options: Options) -> list[str]:
    """Return the names of the functions that a program calls."""
    names = ['step_at', 'deadline'] if manifest.policy is Policy.TIMED else ['step']
    return [f'{options.prefix}_{name}' if options.prefix else name for name in names]


def _handler(item: ManifestRequirement, options: Options) -> str:
    """Return the name of a handler; Ogma capitalises the first letter of the id."""
    word = item.handler.removeprefix(HANDLER_PREFIX)
    name = HANDLER_PREFIX + word[:1].upper() + word[1:]
    return f'{options.prefix}_{name}' if options.prefix else name


def _check_handlers(generated: GeneratedMonitor, options: Options, problems: Problems) -> None:
    taken: dict[str, str] = {}
    for item, written in zip(generated.manifest.requirements, generated.specification.properties,
                             strict=True):
        name = _handler(item, options)
        if name in taken:
            problems.error(f"'{item.id}' and '{taken[name]}' have one handler, {name}",
                           written.id_place, 'in C, the first letter of an id is a capital',
                           'give one of them another id')
        taken[name] = item.id


def _defined(manifest: Manifest, options: Options) -> dict[str, str]:
    """Return the names of functions and of their arguments, each with what it is."""
    return {
        **dict.fromkeys(_functions(manifest, options), 'the function that takes a step'),
        **{_handler(item, options): f'the handler of {item.id}'
           for item in manifest.requirements},
        **{argument: f'an argument of the handler of {item.id}'
           for item in manifest.requirements for argument in _arguments(item, options)},
    }


def _arguments(item: ManifestRequirement, options: Options) -> list[str]:
    """Return the names of a handler's arguments, one for each input that it reads."""
    if options.handler_arguments is HandlerArguments.NONE:
        return []
    return [f'{_handler(item, options)}_arg{place}' for place in range(len(item.inputs))]


@dataclass(frozen=True)
class _CopilotWriter:
    """Writes the files; `inputs` and `constants` are names in C, see `external_names`."""

    generated: GeneratedMonitor
    options: Options
    inputs: Mapping[str, str]
    constants: Mapping[tuple[str, str], str]

    @property
    def name(self) -> str:
        return export_name(self.generated)

    @property
    def file(self) -> str:
        return _file_name(self.generated)

    @property
    def _manifest(self) -> Manifest:
        return self.generated.manifest

    @property
    def _is_timed(self) -> bool:
        return self._manifest.policy is Policy.TIMED

    def _read(self, item: ManifestRequirement) -> list[ManifestInput]:
        """Return the inputs whose values a handler is called with."""
        if self.options.handler_arguments is HandlerArguments.NONE:
            return []
        return [self._manifest.inputs[index] for index in item.inputs]

    @property
    def _guard(self) -> str:
        """The include guard of NAME_types.h."""
        return f'{self.file}_TYPES_H_'

    def _opening(self, file: str, what: str) -> Iterator[str]:
        yield f'// {file}: {what} of {safe(self._manifest.name)}.'
        yield '// Generated by fret_monitor; changes will be lost.'
        yield ''

    def types(self) -> Iterator[str]:
        """Yield the lines of NAME_types.h: constants for the named values of inputs."""
        yield from self._opening(f'{self.file}_types.h', 'the values with names')
        yield from (f'#ifndef {self._guard}', f'#define {self._guard}', '')
        for item in self._manifest.inputs:
            if item.values:
                yield f'// Values of {self.inputs[item.name]}.'
            for word, number in item.stored_values:
                yield f'#define {self.constants[item.name, word]} {_number(number)}'
            if item.values:
                yield ''
        yield f'#endif  // {self._guard}'

    def header(self) -> Iterator[str]:
        """Yield the lines of NAME.h."""
        guard = f'{self.file}_H_'
        yield from self._opening(f'{self.file}.h', 'the interface to the monitors')
        yield from (f'#ifndef {guard}', f'#define {guard}', '')
        yield from ('#include <stdbool.h>', '#include <stdint.h>', '')
        yield f'#include "{self.file}_types.h"'
        yield from ('', '#ifdef __cplusplus', 'extern "C" {', '#endif', '')
        yield '// The inputs, which the program defines.'
        for item in self._manifest.inputs:
            yield from comment(origin(item))
            yield f'extern {item.value_type.c_name} {self.inputs[item.name]};'
        yield from ('', '// The handlers of violations, which the program defines.')
        for requirement in self._manifest.requirements:
            yield from comment(f'{requirement.id}: {requirement.title or requirement.text}')
            yield f'void {self._signature(requirement)};'
        yield ''
        yield from self._functions()
        yield from ('#ifdef __cplusplus', '}  // extern "C"', '#endif', '', f'#endif  // {guard}')

    def _signature(self, item: ManifestRequirement) -> str:
        arguments = ', '.join(
            f'{kind.value_type.c_name} {name}' for kind, name in zip(
                self._read(item), _arguments(item, self.options), strict=True))
        return f'{_handler(item, self.options)}({arguments or "void"})'

    def _functions(self) -> Iterator[str]:
        names = _functions(self._manifest, self.options)
        if not self._is_timed:
            yield '// Take a step: copy the inputs, evaluate, call handlers.'
            yield f'void {names[0]}(void);'
            yield ''
            return
        yield '// Copy the inputs and evaluate them at a time in nanoseconds. What was due since'
        yield '// the last call is evaluated before. A time that goes back starts afresh.'
        yield f'void {names[0]}(int64_t now);'
        yield ''
        yield f'// The time at which {names[0]} is to be called next if no input changes:'
        yield '// INT64_MAX if never, INT64_MIN before the first call.'
        yield f'int64_t {names[1]}(void);'
        yield ''

    def source(self) -> Iterator[str]:
        """Yield the lines of NAME.c."""
        name = self.name
        yield from self._opening(f'{self.file}.c', 'the monitors')
        yield f'#include "{_MONITORS}/fret_alone.h"'
        yield ''
        sources = (file for file in self.generated.module.files
                   if file.endswith('.c') and file != f'{name}_fields.c')
        own = self._functions_of_module()
        if own:
            yield '// Static functions of the generated C that have the name of one in the header.'
        yield from (f'#define {word} {word}_of_monitors' for word in own)
        yield from (f'#include "{_MONITORS}/{file}"' for file in sources)
        yield from (f'#undef {word}' for word in own)
        yield ''
        yield '// Without the constants for values, which could replace names below.'
        yield f'#define {self._guard}'
        yield from (f'#include "{self.file}.h"', '')
        yield f'static struct {name}_state fm_state;'
        yield f'static struct {name}_inputs fm_inputs;'
        yield f'static bool fm_verdicts[{name}_verdicts];'
        yield '// What reports compare with: the verdicts of the last step.'
        yield f'static bool fm_held[{name}_requirements];'
        yield ''
        yield from self._reports()
        yield from self._copy()
        yield from self._call()
        yield from self._macros()
        yield f'#include "{_MONITORS}/fret_copilot.h"'

    def _functions_of_module(self) -> list[str]:
        return [word for word in _functions(self._manifest, self.options)
                if is_of_module(word, self.name)]

    def _reports(self) -> Iterator[str]:
        yield '// Of a requirement: the verdict to look at, and whether each violating step calls'
        yield '// its handler, or only the first of several.'
        yield 'static const struct fm_requirement_table'
        yield '{'
        yield '  uint32_t verdict;'
        yield '  bool is_every_step;'
        yield '} fm_requirements[] = {'
        occurrences = {number for group in self.generated.program.groups
                       for number, _ in group.occurrences}
        count = len(self._manifest.requirements)
        own = {number: count + place for place, number in enumerate(sorted(occurrences))}
        for number, item in enumerate(self._manifest.requirements):
            is_every_step = str(item.report is Report.EVERY_STEP).lower()
            yield f'  {{{own.get(number, number)}u, {is_every_step}}},  // {safe(item.id)}'
        yield from ('};', '')

    def _copy(self) -> Iterator[str]:
        members = self._members()
        yield 'static void fm_copy_inputs(void)'
        yield '{'
        yield from (f'  fm_inputs.{members[item.name]} = {self.inputs[item.name]};'
                    for item in self._manifest.inputs)
        yield from ('}', '')

    def _members(self) -> dict[str, str]:
        """Return the members of the struct of inputs."""
        program = self.generated.program
        names = Names(program.name, (item.name for item in program.signals), (),
                      (word for word, _ in program.definitions))
        return names.signals

    def _call(self) -> Iterator[str]:
        members = self._members()
        yield 'static void fm_call_handler(uint32_t fm_requirement)'
        yield '{'
        yield '  switch (fm_requirement) {'
        for number, item in enumerate(self._manifest.requirements):
            values = ', '.join(f'fm_inputs.{members[read.name]}' for read in self._read(item))
            yield f'    case {number}u: {_handler(item, self.options)}({values}); break;'
        yield '    default: break;'
        yield from ('  }', '}', '')

    def _macros(self) -> Iterator[str]:
        names = _functions(self._manifest, self.options)
        yield f'#define FM_RESET {self.name}_reset'
        yield f'#define FM_REQUIREMENTS {len(self._manifest.requirements)}u'
        evaluate = f'{self.name}_step_at' if self._is_timed else f'{self.name}_step'
        suffix = '_of_monitors' if evaluate in self._functions_of_module() else ''
        yield f'#define FM_EVALUATE {evaluate}{suffix}'
        if self._is_timed:
            yield f'#define FM_STEP_AT {names[0]}'
            yield f'#define FM_DEADLINE {names[1]}'
        else:
            yield f'#define FM_STEP {names[0]}'
        yield ''

    def values(self) -> dict[str, str]:
        """Return the placeholders of the README."""
        names = _functions(self._manifest, self.options)
        define = [definition(item, self.inputs[item.name]) for item in self._manifest.inputs]
        define += [f'void {self._signature(item)} {{}}' for item in self._manifest.requirements]
        call = f'`void {names[0]}(void)`: take a step.'
        if self._is_timed:
            call = (f'`void {names[0]}(int64_t now)` when an input has changed, with the time in '
                    f'nanoseconds, and at the time that `int64_t {names[1]}(void)` returns '
                    '(`INT64_MAX`: never). What was due before `now` is evaluated first, in the '
                    'order of time, so that a late call loses nothing.')
        named = any(item.values for item in self._manifest.inputs)
        order = ('A call copies all inputs first, then evaluates all requirements, and then calls '
                 'the handlers of those that are violated, in the order of the bundle.')
        if self._is_timed:
            order = ('A call calls the handlers for each time that was due before `now`, from the '
                     'first on, with the inputs of the last call. Then it copies the inputs and '
                     'evaluates all requirements. Handlers of one time are called in the order of '
                     'the bundle.')
        return {'ORDER': order, 'DEFINE': '\n'.join(define), 'CALL': call,
                'VALUES': f'`{self.file}_types.h` has constants for the values that have '
                          'names.\n\n' if named else ''}


def definition(item: ManifestInput, name: str) -> str:
    """Return the definition of an input's variable, with its initial value."""
    kind = item.value_type
    if item.initial is None:
        return f'{kind.c_name} {name};'
    if not kind.is_float:
        value = _number(int(item.initial)) if kind is not ValueType.BOOL else number_text(item)
    elif isfinite(item.initial):
        value = number_text(item)
        value += 'f' if kind is ValueType.FLOAT32 and not value.lstrip('-').isdigit() else ''
    else:
        value = 'NAN' if isnan(item.initial) else 'INFINITY' if item.initial > 0 else '-INFINITY'
    return f'{kind.c_name} {name} = {value};'


def _number(number: int) -> str:
    """Return an integer constant that fits any type of C that holds the number."""
    kind = ValueType.UINT64 if number > ValueType.INT64.limits[1] else ValueType.INT64
    text = literal(number, kind).text
    return f'({text})' if text.startswith('-') else text
