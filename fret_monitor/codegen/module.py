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
Generate the C files of a monitor program: a header for programmers, and the sources.

The same program gives the same bytes. Large programs are divided into several files of similar
size, which can be compiled in parallel.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
import hashlib
import re

from fret_monitor.codegen import c
from fret_monitor.codegen.comments import comment, safe
from fret_monitor.codegen.extractors import generate_extractors
from fret_monitor.codegen.inputs import described_input, meaning, origin
from fret_monitor.codegen.margins import MarginWriter
from fret_monitor.codegen.names import field, Names
from fret_monitor.codegen.operations import OF_MATH_H
from fret_monitor.codegen.step import PartWriter
from fret_monitor.logic.specification import Signal
from fret_monitor.model.policies import Policy
from fret_monitor.model.values import ValueType
from fret_monitor.program.layout import FM_NEVER, GroupLayout, StateField
from fret_monitor.program.monitor_program import (
    MarginOperation, MonitorProgram, Operation, room_of, StepGroup,
)

_FILE_EQUATIONS = 3000
_BLOCK_EQUATIONS = 600
_USE_OF_MATH_H = re.compile(rf'\b({"|".join(sorted(OF_MATH_H))})\b')
_USE_OF_TRIALS_H = re.compile(r'\bfm_(trial|tested)')
_USE_OF_WINDOWS_H = re.compile(r'\bfm_((number|of_key|exact|time_over)_|slope)')
WINDOWS_HEADER = 'fret_windows.h'
"""The runtime header of the cells of numbers over time, which includes the others."""
TRIALS_HEADER = 'fret_trials.h'
"""The runtime header of trials and tests of probabilities."""
_MARGINS_HEADER = 'fret_margins.h'
_HEADERS = ('fret_monitor.h', 'fret_cells.h')
_HASH_FIELD = '\0'  # replaced by the hash; cannot occur in text of a bundle


@dataclass(frozen=True)
class CModule:
    """
    Generated C: `header` and `sources` as (file name, text).

    `symbol` is the exported function that returns the `struct fm_monitor`. `readers` is the one
    that returns the `struct fm_readers` (the extractors), '' if there are no topics.
    `outputs` is the one that returns the `struct fm_outputs`, '' if there are none, `tests`
    the `struct fm_tests` of the requirements with probabilities, and `margins` the
    `struct fm_margins`, '' without margins.
    `source_hash` is the SHA-256 of all texts; the struct of the monitor holds it too.
    """

    name: str
    symbol: str
    source_hash: str
    header: tuple[str, str]
    sources: tuple[tuple[str, str], ...]
    readers: str = ''
    outputs: str = ''
    tests: str = ''
    margins: str = ''

    @property
    def files(self) -> dict[str, str]:
        """All texts by file name, the header first."""
        return dict((self.header, *self.sources))

    @property
    def runtime_headers(self) -> tuple[str, ...]:
        """The names of the headers of the runtime that are included."""
        more = (name for name in (WINDOWS_HEADER, TRIALS_HEADER, _MARGINS_HEADER)
                if any(f'"{name}"' in text for _, text in self.sources))
        return (*_HEADERS, *more)


def generate(program: MonitorProgram, layouts: tuple[GroupLayout, ...],
             kinds: Sequence[Sequence[Signal]] | None = ()) -> CModule:
    """
    Write the C of a program; `layouts` are those of its groups, in order.

    `kinds` are the inputs of the kinds of instances, for the extractors; None: without extractors,
    since the module is that of a kind.
    """
    names = Names(program.name, (item.name for item in program.signals),
                  (item.id for item in program.properties),
                  (name for name, _ in program.definitions))
    writer = _ModuleWriter(program, layouts, names)
    header = '\n'.join(writer.header()) + '\n'
    texts = [(name, '\n'.join(lines) + '\n') for name, lines in writer.sources()]
    readers = [] if kinds is None else list(generate_extractors(
        names, program.name, program.signals, program.stamp, kinds))
    if readers:
        texts.append((names.fields_source, '\n'.join(readers) + '\n'))
    digest = hashlib.sha256('\0'.join([header, *(text for _, text in texts)]).encode()).hexdigest()
    sources = tuple((name, text.replace(_HASH_FIELD, digest)) for name, text in texts)
    return CModule(program.name, names.symbol, digest, (names.header, header), sources,
                   names.readers if readers else '',
                   names.outputs if any(layout.group.outputs for layout in layouts) else '',
                   names.tests if writer.has_tests else '',
                   names.margins if writer.has_margins else '')


class _ModuleWriter:
    def __init__(self, program: MonitorProgram, layouts: tuple[GroupLayout, ...],
                 names: Names) -> None:
        self._program = program
        self._layouts = layouts
        self._names = names
        self.has_margins = any(layout.group.margins for layout in layouts)

    # -- header -------------------------------------------------------------------------------

    def header(self) -> Iterator[str]:
        names, program = self._names, self._program
        guard = f'{names.prefix.upper()}_MONITOR_H_'
        yield f'// {names.header}: the monitors of {safe(program.name)}.'
        yield '// Generated by fret_monitor; changes will be lost.'
        yield '//'
        yield '// The caller owns an inputs struct and a state struct. It resets the state once,'
        yield '// and for each step sets the inputs and calls the step function. All functions'
        yield '// take O(1) time whatever the bounds, and cannot fail.'
        yield ''
        yield from (f'#ifndef {guard}', f'#define {guard}', '', '#include "fret_monitor.h"', '')
        yield from ('#ifdef __cplusplus', 'extern "C" {', '#endif', '')
        yield from self._inputs()
        yield from self._requirements()
        yield from self._state()
        yield from self._prototypes()
        yield from ('#ifdef __cplusplus', '}  // extern "C"', '#endif', '')
        yield f'#endif  // {guard}'

    def _inputs(self) -> Iterator[str]:
        yield '/// The values that the requirements read.'
        yield self._names.inputs_struct
        yield '{'
        for signal in self._program.signals:
            item = described_input(signal)
            if meaning(item):
                yield from comment(origin(item), '  ')
            yield f'  {signal.type.c_name} {self._names.signals[signal.name]};'
        if not self._program.signals:
            yield '  bool none;  // C has no empty struct'
        yield '};'
        yield ''

    def _requirements(self) -> Iterator[str]:
        yield '/// The requirements: indices of verdicts.'
        yield f'enum {self._names.prefix}_requirement'
        yield '{'
        for number, item in enumerate(self._program.properties):
            shown = next(comment(f'{item.id}: {item.title or item.text}'))
            yield f'  {self._names.requirements[number]} = {number},  {shown}'
        count = len(self._program.properties)
        yield f'  {self._names.requirement_count} = {count},  // all of them'
        for place, number in enumerate(self._occurrences):
            yield f'  {self._names.occurrences[number]} = {count + place},  // p of H p'
        total = count + len(self._occurrences)
        yield f'  {self._names.verdict_count} = {total}  // the length of an array of verdicts'
        yield '};'
        yield ''

    @property
    def _occurrences(self) -> list[int]:
        """The requirements with a verdict of their own for occurrences, ascending."""
        return sorted(number for layout in self._layouts
                      for number, _ in layout.group.occurrences)

    @property
    def _is_timed(self) -> bool:
        return self._program.policy is Policy.TIMED

    def _state(self) -> Iterator[str]:
        for number, layout in enumerate(self._layouts):
            yield f'/// State of step group {number}: {self._reads(layout)}.'
            yield self._names.group_struct(number)
            yield '{'
            yield from (f'  {_declaration(item)};' for item in layout.fields)
            if not layout.fields:
                yield '  uint8_t none;  // C has no empty struct'
            yield '};'
            yield ''
        yield '/// All state. Must be reset before the first step.'
        yield self._names.state_struct
        yield '{'
        for number, _ in enumerate(self._layouts):
            yield f'  {self._names.group_struct(number)} group_{number};'
        if not self._layouts:
            yield '  uint8_t none;  // C has no empty struct'
        yield '};'
        yield ''

    def _reads(self, layout: GroupLayout) -> str:
        names = [safe(self._program.signals[index].name) for index in layout.group.signals]
        shown = ', '.join(names[:8]) + (', ...' if len(names) > 8 else '')
        return f'the requirements that read {shown}' if names else \
            'the requirements that read no input'

    def _prototypes(self) -> Iterator[str]:
        names = self._names
        yield '/// Restart all requirements: the next step is the first time point.'
        yield f'FM_EXPORT void {names.prefix}_reset({names.state_struct} * state);'
        yield ''
        if self._is_timed:
            yield from (
                '/// Evaluate all requirements at a tick: nanoseconds since the first, which is',
                '/// 0. Returns the next tick at which a verdict can change although the inputs',
                '/// stay as they are (FM_NEVER: none): call it then, or before if an input has',
                '/// changed. verdicts[i] is true if i is satisfied.')
            yield f'FM_EXPORT int64_t {names.prefix}_step_at('
            yield f'  {names.state_struct} * state, const {names.inputs_struct} * inputs,'
            yield '  bool * verdicts, int64_t tick);'
            yield ''
        else:
            yield '/// Evaluate one step of all requirements; verdicts[i] is true if i is '\
                  'satisfied.'
            yield f'FM_EXPORT void {names.prefix}_step('
            yield f'  {names.state_struct} * state, const {names.inputs_struct} * inputs,'
            yield '  bool * verdicts);'
            yield ''
        yield '/// The constant description by which the evaluator runs the monitors.'
        yield f'FM_EXPORT const struct fm_monitor * {names.symbol}(void);'
        yield ''
        if any(layout.group.outputs for layout in self._layouts):
            yield '/// The numbers that are kept in the state, which aggregates read.'
            yield f'FM_EXPORT const struct fm_outputs * {names.outputs}(void);'
            yield ''
        if self.has_tests:
            yield '/// Where the tests of probabilities are in the state.'
            yield f'FM_EXPORT const struct fm_tests * {names.tests}(void);'
            yield ''
        if self.has_margins:
            yield '/// Where the state has the margins of the requirements.'
            yield f'FM_EXPORT const struct fm_margins * {names.margins}(void);'
            yield ''
        yield '// The functions of each step group, for the description.'
        for number, _ in enumerate(self._layouts):
            yield f'FM_INTERNAL void {names.group_function(number, "reset")}(void * state);'
            yield f'FM_INTERNAL {self._entry_head(number)};'
        yield ''
        if self._is_timed:
            return
        yield '// Functions that step several groups, for the step of all.'
        for groups in self._files():
            for block in self._blocks(groups):
                yield f'FM_INTERNAL void {names.block_function(block[0])}('
                yield f'  {names.state_struct} * state, const {names.inputs_struct} * inputs,'
                yield '  bool * verdicts);'
        yield ''

    # -- sources ------------------------------------------------------------------------------

    def sources(self) -> Iterator[tuple[str, list[str]]]:
        """Yield file names and lines; the description is in the first file."""
        for number, groups in enumerate(self._files()):
            code = [line for group in groups for line in self._group(group)]
            opening = self._opening(number, code)
            lines = [*opening, *code]
            for block in [] if self._is_timed else self._blocks(groups):
                lines.extend(self._block(block[0], block))
            if number == 0:
                lines.extend(self._all_groups())
                lines.extend(self._description())
            yield self._names.source(number), lines

    def _files(self) -> list[list[int]]:
        return list(_runs(range(len(self._layouts)), self._size, _FILE_EQUATIONS))

    def _opening(self, number: int, code: list[str]) -> Iterator[str]:
        yield f'// {self._names.source(number)}: the monitors of {safe(self._program.name)}.'
        yield '// Generated by fret_monitor; changes will be lost.'
        yield ''
        yield f'#include "{self._names.header}"'
        yield ''
        yield from ['#include <math.h>'] if any(map(_USE_OF_MATH_H.search, code)) else []
        yield '#include <string.h>'
        yield ''
        has_windows = any(map(_USE_OF_WINDOWS_H.search, code))
        yield f'#include "{WINDOWS_HEADER if has_windows else "fret_cells.h"}"'
        if any(map(_USE_OF_TRIALS_H.search, code)):
            yield f'#include "{TRIALS_HEADER}"'
        yield from [f'#include "{_MARGINS_HEADER}"'] if any(
            'fm_margin' in line for line in code) else []
        yield ''
        yield '#if FM_ABI != 2'
        yield '#error "this file was generated for another version of fret_monitor.h"'
        yield '#endif'
        yield ''

    def _group(self, number: int) -> Iterator[str]:
        layout = self._layouts[number]
        yield f'// Step group {number}: {self._reads(layout)}.'
        yield from self._reset(number, layout)
        if layout.group.margins is not None:
            writer = MarginWriter(self._program, layout, layout.group.margins, self._names)
            yield from self._function('static', self._names.group_function(number, 'margins'),
                                      number, list(writer.lines()), has_verdicts=False)
        if len(layout.parts) == 1:
            yield from self._single_step(number, layout)
        else:
            yield from self._step_of_parts(number, layout)

    def _reset(self, number: int, layout: GroupLayout) -> Iterator[str]:
        yield f'void {self._names.group_function(number, "reset")}(void * state)'
        yield '{'
        yield from self._locate(number, 'state')
        yield '  memset(s, 0, sizeof(*s));'
        for item in layout.fields:
            if item.n_kept_margins or repr(item.initial) not in (
                    '0', '0.0', 'False'):  # -0.0 is not all zeros
                yield from _initialisation(item)
        yield '}'
        yield ''

    def _locate(self, number: int, state: str) -> Iterator[str]:
        struct = self._names.group_struct(number)
        full = self._names.state_struct
        yield f'  {struct} * const s = &(({full} *){state})->group_{number};'

    def _single_step(self, number: int, layout: GroupLayout) -> Iterator[str]:
        body = list(PartWriter(self._program, layout, 0, self._names).lines())
        yield from self._function('FM_INLINE', self._names.group_function(number, 'body'),
                                  number, body)
        yield from self._entry(number, (self._names.group_function(number, 'body'),))

    def _function(self, kind: str, name: str, number: int, body: list[str],
                  has_verdicts: bool = True) -> Iterator[str]:
        """Yield a function with the parameters `s` (a group's state), `in` and `verdicts`."""
        yield f'{kind} {"int64_t" if self._is_timed else "void"} {name}('
        yield (f'  {self._names.group_struct(number)} * s, const {self._names.inputs_struct} * in'
               f'{", bool * verdicts" if has_verdicts else ""}'
               f'{", int64_t tick" if self._is_timed else ""})')
        yield '{'
        uses = [('s', 's->'), ('in', 'in->')] + [('verdicts', 'verdicts[')] * has_verdicts
        for parameter, use in uses + [('tick', 'tick')] * self._is_timed:
            if not _mentions(body, use):
                yield f'  (void){parameter};'
        yield from body[1:] if body[:1] == [''] else body
        yield from ('}', '')

    def _entry(self, number: int, functions: tuple[str, ...]) -> Iterator[str]:
        yield self._entry_head(number)
        yield '{'
        yield from self._locate(number, 'state')
        inputs = self._names.inputs_struct
        yield f'  const {inputs} * const in = (const {inputs} *)inputs;'
        calls = [f'{function}(s, in, verdicts{", tick" if self._is_timed else ""})'
                 for function in functions]
        if self._layouts[number].group.margins is not None:
            calls.append(f'{self._names.group_function(number, "margins")}(s, in'
                         f'{", tick" if self._is_timed else ""})')
        if not self._is_timed:
            yield from (f'  {call};' for call in calls)
        elif len(calls) == 1:
            yield f'  return {calls[0]};'
        else:
            yield '  int64_t next = FM_NEVER;'
            yield from (f'  fm_lower(&next, true, {call});' for call in calls)
            yield '  return next;'
        yield from ('}', '')

    def _entry_head(self, number: int) -> str:
        """Return the head of the function that steps a group."""
        if self._is_timed:
            name = self._names.group_function(number, 'step_at')
            return f'int64_t {name}(\n' \
                   '  void * state, const void * inputs, bool * verdicts, int64_t tick)'
        return f'void {self._names.group_function(number, "step")}(\n' \
               '  void * state, const void * inputs, bool * verdicts)'

    def _step_of_parts(self, number: int, layout: GroupLayout) -> Iterator[str]:
        functions = []
        for part, _ in enumerate(layout.parts):
            body = list(PartWriter(self._program, layout, part, self._names).lines())
            functions.append(self._names.part_function(number, part))
            yield from self._function('static', functions[-1], number, body)
        yield from self._entry(number, tuple(functions))

    def _blocks(self, groups: list[int]) -> Iterator[list[int]]:
        """Divide a file's groups into runs, one step function each."""
        return _runs(groups, self._size, _BLOCK_EQUATIONS) if groups else iter(())

    def _size(self, group: int) -> int:
        return len(self._layouts[group].group.equations)

    def _block(self, first: int, groups: list[int]) -> Iterator[str]:
        names = self._names
        yield f'void {names.block_function(first)}('
        yield f'  {names.state_struct} * state, const {names.inputs_struct} * inputs,'
        yield '  bool * verdicts)'
        yield '{'
        for group in groups:
            if len(self._layouts[group].parts) == 1 and not self.has_margins:
                yield f'  {names.group_function(group, "body")}(&state->group_{group}, inputs, ' \
                      'verdicts);'
            else:
                yield f'  {names.group_function(group, "step")}(state, inputs, verdicts);'
        yield from ('}', '')

    def _all_groups(self) -> Iterator[str]:
        names = self._names
        yield f'void {names.prefix}_reset({names.state_struct} * state)'
        yield '{'
        for number, _ in enumerate(self._layouts):
            yield f'  {names.group_function(number, "reset")}(state);'
        if not self._layouts:
            yield '  state->none = 0u;'
        yield from ('}', '')
        if self._is_timed:
            yield from self._all_groups_at()
            yield from self._overflows()
            return
        yield f'void {names.prefix}_step('
        yield f'  {names.state_struct} * state, const {names.inputs_struct} * inputs,'
        yield '  bool * verdicts)'
        yield '{'
        yield from self._unused()
        for groups in self._files():
            for block in self._blocks(groups):
                yield f'  {names.block_function(block[0])}(state, inputs, verdicts);'
        yield from ('}', '')
        if self._is_many:
            yield f'static void {names.prefix}_step_any('
            yield '  void * state, const void * inputs, bool * verdicts)'
            yield '{'
            yield f'  {names.prefix}_step('
            yield f'    ({names.state_struct} *)state, (const {names.inputs_struct} *)inputs,'
            yield '    verdicts);'
            yield from ('}', '')

    @property
    def _queues(self) -> list[str]:
        """The queues that can overflow, as members of the state."""
        return [f'group_{number}.{name}_{index}'
                for number, layout in enumerate(self._layouts)
                for name, cells in _cells(layout.group)
                for index, cell in enumerate(cells)
                if (room := room_of(cell)) is not None and room.may_overflow]

    @property
    def _overflows_name(self) -> str:
        return f'{self._names.prefix}_overflows'

    def _overflows(self) -> Iterator[str]:
        if not self._queues:
            return
        yield f'static uint64_t {self._overflows_name}(const void * state)'
        yield '{'
        struct = self._names.state_struct
        yield f'  const {struct} * const s = (const {struct} *)state;'
        yield '  uint64_t sum = 0u;'
        yield from (f'  sum += (uint64_t)s->{queue}[3];' for queue in self._queues)
        yield '  return sum;'
        yield from ('}', '')

    def _all_groups_at(self) -> Iterator[str]:
        names = self._names
        yield f'int64_t {names.prefix}_step_at('
        yield f'  {names.state_struct} * state, const {names.inputs_struct} * inputs,'
        yield '  bool * verdicts, int64_t tick)'
        yield '{'
        yield '  int64_t next = FM_NEVER;'
        yield from self._unused('tick')
        for number, _ in enumerate(self._layouts):
            step = names.group_function(number, 'step_at')
            yield f'  fm_lower(&next, true, {step}(state, inputs, verdicts, tick));'
        yield '  return next;'
        yield from ('}', '')

    def _unused(self, *more: str) -> Iterator[str]:
        """Yield statements for the parameters of a step of no groups."""
        if not self._layouts:
            yield from (f'  (void){name};' for name in ('state', 'inputs', 'verdicts', *more))

    @property
    def _is_many(self) -> bool:
        """Whether there is more than one group."""
        return len(self._layouts) > 1

    # -- description --------------------------------------------------------------------------

    def _description(self) -> Iterator[str]:
        names = self._names
        yield f'const struct fm_monitor * {names.symbol}(void)'
        yield '{'
        yield from self._input_table()
        yield from self._group_table()
        yield from self._requirement_table()
        places = [number for number, _ in enumerate(self._program.properties)]
        for place, number in enumerate(self._occurrences):
            places[number] = len(places) + place
        if self._occurrences:
            yield from _indices('occurrences', places)
        yield '  static const struct fm_monitor monitor = {'
        yield f'    FM_ABI, {len(self._program.signals)}u, {len(self._layouts)}u, ' \
              f'{len(self._program.properties)}u,'
        yield f'    sizeof({names.state_struct}), sizeof({names.inputs_struct}),'
        table = 'inputs' if self._program.signals else 'NULL'
        yield f'    {table}, groups, requirements,' if self._layouts else \
            f'    {table}, NULL, NULL,'
        yield f'    "{names.prefix}",'
        yield f'    "{_HASH_FIELD}",'
        together = 'NULL' if self._is_timed or not self._layouts \
            else f'{names.prefix}_step_any' if self._is_many \
            else names.group_function(0, 'step')
        occurrences = 'occurrences' if self._occurrences else 'NULL'
        yield f'    {together}, {occurrences}, {len(self._occurrences)}u, ' \
              f'{self._overflows_name if self._queues else "NULL"}'
        yield '  };'
        yield '  return &monitor;'
        yield '}'
        yield from self._outputs()
        yield from self._tests()
        yield from self._margins()

    def _margins(self) -> Iterator[str]:
        """Yield the description of the margins, if there are any."""
        if not self.has_margins:
            return
        group_of = {number: group for group, layout in enumerate(self._layouts)
                    for number in layout.group.properties}
        state = self._names.state_struct
        yield from ('', f'const struct fm_margins * {self._names.margins}(void)', '{')
        now = {number for layout in self._layouts if layout.group.margins
               for number, _ in layout.group.margins.occurrences}
        for name, others in (('margins', set[int]()), ('occurrences', now)):
            yield f'  static const uint64_t {name}[] = {{'
            yield from (f'    offsetof({state}, group_{group}.'
                        f'margin_{"now_" if number in others else ""}{number}),'
                        for number, group in sorted(group_of.items()))
            yield '  };'
        yield '  static const uint64_t instants[] = {'
        yield from (f'    offsetof({state}, group_{group}.instant_0),'
                    for group, _ in enumerate(self._layouts))
        yield '  };'
        yield '  static const struct fm_margins all = {margins, occurrences, instants};'
        yield from ('  return &all;', '}')

    def _outputs(self) -> Iterator[str]:
        """Yield the description of the outputs, if there are any."""
        found = [(number, group, layout.group.equations[operand.value].type)
                 for group, layout in enumerate(self._layouts)
                 for number, operand in layout.group.outputs]
        if not found:
            return
        yield from ('', f'const struct fm_outputs * {self._names.outputs}(void)', '{')
        yield '  static const struct fm_output all[] = {'
        for number, group, kind in sorted(found):
            place = f'offsetof({self._names.state_struct}, group_{group}.output_{number})'
            yield f'    {{{place}, {group}u, FM_{kind.name}}},'
        yield '  };'
        yield f'  static const struct fm_outputs outputs = {{all, {len(found)}u}};'
        yield from ('  return &outputs;', '}')

    @property
    def has_tests(self) -> bool:
        """Whether a requirement has a probability."""
        return any(layout.group.tests for layout in self._layouts)

    def _tests(self) -> Iterator[str]:
        """Yield the description of the tests, if there are any."""
        if not self.has_tests:
            return
        struct = self._names.state_struct
        yield from ('', f'const struct fm_tests * {self._names.tests}(void)', '{')
        yield '  static const struct fm_test all[] = {'
        found = [(number, group, test.value) for group, layout in enumerate(self._layouts)
                 for number, test in layout.group.tests]
        for number, group, index in sorted(found):
            asked = self._program.properties[number].probability
            assert asked is not None
            numbers = ', '.join(c.literal(item, ValueType.FLOAT64).text for item in (
                asked.allowed, asked.rest, asked.limit))
            yield f'    {{{number}u, {str(asked.counts_successes).lower()},'
            yield f'      offsetof({struct}, group_{group}.queue_{index}),'
            yield f'      offsetof({struct}, group_{group}.window_{index}),'
            yield f'      {numbers},'
            yield f'      {_string(asked.relation)}, {_string(asked.bound_text)},'
            yield f'      {_string(asked.confidence_text)}}},'
        yield '  };'
        yield f'  static const struct fm_tests tests = {{all, {len(found)}u}};'
        yield from ('  return &tests;', '}')

    def _input_table(self) -> Iterator[str]:
        if not self._program.signals:
            return
        yield '  static const struct fm_input inputs[] = {'
        for signal in self._program.signals:
            place = f'offsetof({self._names.inputs_struct}, {self._names.signals[signal.name]})'
            yield f'    {{{_string(signal.name)}, {place}, FM_{signal.type.name}}},'
        yield '  };'

    def _group_table(self) -> Iterator[str]:
        if not self._layouts:
            return
        for number, layout in enumerate(self._layouts):
            if layout.group.signals:
                yield from _indices(f'inputs_{number}', layout.group.signals)
            yield from _indices(f'requirements_{number}', layout.group.properties)
        yield '  static const struct fm_group groups[] = {'
        for number, layout in enumerate(self._layouts):
            group = layout.group
            inputs = f'inputs_{number}' if group.signals else 'NULL'
            yield f'    {{{inputs}, {len(group.signals)}u, ' \
                  f'requirements_{number}, {len(group.properties)}u,'
            step = self._names.group_function(number, 'step')
            steps = f'NULL, {step}_at' if self._is_timed else f'{step}, NULL'
            yield f'      {self._names.group_function(number, "reset")}, {steps}}},'
        yield '  };'

    def _requirement_table(self) -> Iterator[str]:
        if not self._layouts:
            return
        owner = {index: number for number, layout in enumerate(self._layouts)
                 for index in layout.group.properties}
        yield '  static const struct fm_requirement requirements[] = {'
        for number, item in enumerate(self._program.properties):
            yield f'    {{{_string(item.id)}, {owner[number]}u}},'
        yield '  };'


def _cells(
    group: StepGroup,
) -> Iterator[tuple[str, Iterable[Operation | MarginOperation]]]:
    """Yield the cells of a group's equations and margins, with the name of their queues."""
    yield 'queue', (item.operation for item in group.equations)
    if group.margins is not None:
        yield 'margin_queue', (item.operation for item in group.margins.equations)


def _runs(groups: Iterable[int], size: Callable[[int], int],
          limit: int) -> Iterator[list[int]]:
    """Divide a sequence of groups into runs of at most `limit` equations, or of one group."""
    run: list[int] = []
    total = 0
    for group in groups:
        if run and total + size(group) > limit:
            yield run
            run, total = [], 0
        run.append(group)
        total += size(group)
    yield run


def _declaration(item: StateField) -> str:
    if item.n_margins:
        kept = '_kept' if item.n_kept_margins else ''
        return f'struct fm_margin{kept} {field(item)}[{item.n_margins}]'
    array = f'[{item.length}]' if item.length else ''
    return f'{item.type.c_name} {field(item)}{array}'


def _initialisation(item: StateField) -> Iterator[str]:
    if item.n_kept_margins:
        yield f'  fm_margins_reset(s->{field(item)}, {item.n_kept_margins}u);'
    elif item.length:
        yield f'  for (size_t i = 0u; i < {item.length}u; ++i) {{'
        shown = item.initial if item.type.is_float else f'{item.initial}u'
        yield f'    s->{field(item)}[i] = {shown};'
        yield '  }'
    elif item.type.is_integer and item.type is not ValueType.INT64:
        value = int(item.initial)
        shown = f'UINT64_C({value})' if value >= 2 ** 32 else f'{value}u'
        yield f'  s->{field(item)} = {shown};'
    elif item.initial == FM_NEVER:
        yield f'  s->{field(item)} = FM_NEVER;'
    else:
        yield f'  s->{field(item)} = {c.literal(item.initial, item.type).text};'


def _indices(name: str, numbers: Sequence[int]) -> Iterator[str]:
    yield f'  static const uint32_t {name}[] = {{'
    for start in range(0, len(numbers), 12):
        yield '    ' + ' '.join(f'{number}u,' for number in numbers[start:start + 12])
    yield '  };'


def _mentions(lines: list[str], word: str) -> bool:
    return any(word in line.split('//')[0] for line in lines)


def _string(text: str) -> str:
    return c.string_literal(text.encode())
