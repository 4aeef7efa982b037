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
Target `fprime`: a passive component of NASA's F Prime (3.4 and later).

Each topic of the bundle is a port with the inputs as arguments. Logic is in `csrc/export/fprime`;
generated are the model in FPP, the handlers of ports, and the choice of events and channels.
"""

from collections.abc import Iterator
from dataclasses import dataclass
import re

from fret_monitor.build import GeneratedMonitor
from fret_monitor.codegen.comments import safe
from fret_monitor.codegen.inputs import origin
from fret_monitor.export import flight
from fret_monitor.export.content import Content, export_name, hand_written, markdown, Options
from fret_monitor.model.diagnostics import Problems
from fret_monitor.model.manifest import Manifest
from fret_monitor.model.policies import InputSource, Severity
from fret_monitor.model.values import ValueType

_FPP = {ValueType.BOOL: 'bool', ValueType.FLOAT32: 'F32', ValueType.FLOAT64: 'F64'}
_OF_HANDLERS = ('portNum', 'm_runner', 'm_isStarted', 'fm_stored')  # what a handler names itself
# F Prime 3 copies annotations and formats into XML as they are.
_IN_WORDS = {'<->': 'iff', '<=': 'at most', '<>': 'not equal', '<': 'less than', '&': 'and'}
_PORTS = """\
    command recv port cmdIn
    command reg port cmdRegOut
    command resp port cmdResponseOut
    event port eventOut
    text event port textEventOut
    telemetry port tlmOut
    time get port timeCaller
"""


def fprime(generated: GeneratedMonitor, options: Options) -> Content:
    """
    Return the files.

    Raises
    ------
    CompileError
        if an input is a string or the age of a message, messages count by the stamps of their
        headers, the bundle has no inputs, or handlers shall have arguments.
    """
    problems = Problems()
    flight.check(generated, options, 'ports of F Prime', problems)
    for signal in flight.ages(generated):
        problems.error(f"'{signal.name}' is the age of a message, and ports have no stamps",
                       signal.place, help='send the age in an input of type float64')
    problems.raise_errors()
    writer = _FprimeWriter(generated)
    texts = {f'{writer.component}.fpp': writer.model(),
             f'{writer.component}Ports.cpp': writer.ports()}
    hand = {path.replace('COMPONENT', writer.component): text
            for path, text in hand_written('fprime').items()}
    return flight.content(generated, options, texts, hand, writer.values(), flight.MONITORS)


@dataclass(frozen=True)
class _FprimeWriter:
    """Writes the generated files."""

    generated: GeneratedMonitor

    @property
    def name(self) -> str:
        return export_name(self.generated)

    @property
    def component(self) -> str:
        return f'{_camel(self.name)}Monitor'

    @property
    def _manifest(self) -> Manifest:
        return self.generated.manifest

    @property
    def _topics(self) -> tuple[flight.FlightTopic, ...]:
        return flight.topics_of(self._manifest)

    def _port_type(self, topic: flight.FlightTopic) -> str:
        return f'{self.component}_{topic.word}'

    def _arguments(self, topic: flight.FlightTopic) -> list[tuple[int, str, str]]:
        """Return index, name and type of each input that is an argument of a topic's port."""
        spelled = self._argument_names()
        return [(index, spelled[index],
                 _type(self._manifest.inputs[index].value_type))
                for index in topic.inputs
                if self._manifest.inputs[index].source is InputSource.FIELD]

    def _argument_names(self) -> list[str]:
        """Return the name of each input in handlers; no two are equal."""
        found = flight.members(self.generated)
        for index, word in enumerate(found):
            if word in _OF_HANDLERS or word.startswith(f'{self.name}_runner_'):
                others = (f'{word}_{suffix}' for suffix in ('', *range(2, len(found) + 2)))
                found[index] = next(other for other in others if other not in found)
        return found

    def _requirements(self) -> list[str]:
        return flight.requirement_words(self._manifest)

    def _silences(self) -> list[tuple[int, str]]:
        """Return index and word of each input that can be silent."""
        spelled = flight.words(item.name for item in self._manifest.inputs)
        return [(index, spelled[index]) for index, item in enumerate(self._manifest.inputs)
                if item.timeout is not None]

    def model(self) -> Iterator[str]:
        """Yield the lines of the model in FPP."""
        yield f'# {self.component}.fpp: the monitors of {safe(self._manifest.name)}.'
        yield '# Generated by fret_monitor; changes will be lost.'
        yield ''
        yield 'module Fret {'
        for topic in self._topics:
            yield from ('', *self._port(topic))
        yield ''
        yield f'  @ The monitors of {safe(self._manifest.name)}'
        yield f'  passive component {self.component} {{'
        yield ''
        yield from _PORTS.splitlines()
        yield ''
        yield '    @ A period is over, or deadlines may be due'
        yield '    guarded input port run: Svc.Sched'
        for topic in self._topics:
            yield ''
            yield f'    @ {_annotation(topic.name)}'
            yield f'    guarded input port topic_{topic.word}: {self._port_type(topic)}'
        yield ''
        yield '    @ Begin all requirements anew'
        yield '    guarded command RESET opcode 0'
        yield from self._events()
        yield from self._channels()
        yield from ('', '  }', '', '}')

    def _port(self, topic: flight.FlightTopic) -> Iterator[str]:
        yield f'  @ {_annotation(topic.name)}'
        yield f'  port {self._port_type(topic)}('
        for index, name, kind in self._arguments(topic):
            yield f'    ${name}: {kind} @< {_annotation(origin(self._manifest.inputs[index]))}'
        yield '  )'

    def _events(self) -> Iterator[str]:
        for number, (item, word) in enumerate(zip(self._manifest.requirements,
                                                  self._requirements(), strict=True)):
            level = 'high' if item.severity is Severity.ERROR else 'low'
            yield ''
            yield f'    @ {_annotation(item.title or item.text)}'
            yield f'    event violated_{word}(stamp: U64 @< nanoseconds'
            yield f'    ) severity warning {level} id {number} \\'
            yield f'      format "{_label(item.id)} is violated at {{}} ns"'
        first = len(self._manifest.requirements)
        for number, (index, word) in enumerate(self._silences()):
            name = _label(self._manifest.inputs[index].name)
            yield ''
            yield f'    event silent_{word} severity warning low id {first + 2 * number} \\'
            yield f'      format "input {name} is silent"'
            yield ''
            yield f'    event heard_{word} severity activity high id {first + 2 * number + 1} \\'
            yield f'      format "input {name} has a new value"'

    def _silence_rows(self) -> Iterator[str]:
        first = len(self._manifest.requirements)
        for number, (index, word) in enumerate(self._silences()):
            name = markdown(self._manifest.inputs[index].name)
            yield f'| {first + 2 * number} | | `silent_{word}`: the timeout of {name} passed | |'
            yield f'| {first + 2 * number + 1} | | `heard_{word}`: {name} has a value again | |'

    def _channels(self) -> Iterator[str]:
        for number, (item, word) in enumerate(zip(self._manifest.requirements,
                                                  self._requirements(), strict=True)):
            yield ''
            yield f'    @ Steps at which {_annotation(item.id)} was violated'
            yield f'    telemetry violations_{word}: U32 id {number} update on change'

    def ports(self) -> Iterator[str]:
        """Yield the lines of the C++ file with the handlers of ports."""
        yield f'// {self.component}Ports.cpp: messages, and the choice of events and channels.'
        yield '// Generated by fret_monitor; changes will be lost.'
        yield ''
        yield f'#include "{self.component}.hpp"'
        yield from ('', 'namespace Fret', '{', '')
        for number, topic in enumerate(self._topics):
            yield from self._handler(number, topic)
        yield from self._report_violation()
        yield from self._report_silence()
        yield f'void {self.component}::writeCounters()'
        yield '{'
        for number, word in enumerate(self._requirements()):
            yield f'  this->tlmWrite_violations_{word}(this->violations({number}u));'
        yield from ('}', '', '}  // namespace Fret')

    def _signature(self, topic: flight.FlightTopic) -> str:
        arguments = ''.join(f', {kind} {name}' for _, name, kind in self._arguments(topic))
        return f'topic_{topic.word}_handler(FwIndexType portNum{arguments})'

    def _handler(self, number: int, topic: flight.FlightTopic) -> Iterator[str]:
        yield f'void {self.component}::{self._signature(topic)}'
        yield '{'
        yield '  union fm_value fm_stored;'
        yield '  (void)portNum;'
        yield '  this->arrive();'
        named = {index: name for index, name, _ in self._arguments(topic)}
        for index in topic.inputs:
            member = flight.union_member(self._manifest.inputs[index].value_type)
            value = named.get(index, '1')  # a message was received
            if index in named and self._manifest.inputs[index].value_type is ValueType.BOOL:
                value = f'{value} ? 1 : 0'
            yield f'  fm_stored.{member} = {value};'
            yield f'  {self.name}_runner_store(&m_runner, {index}u, fm_stored);'
        yield f'  {self.name}_runner_message(&m_runner, {number}u);'
        yield from ('}', '')

    def _report_violation(self) -> Iterator[str]:
        yield f'void {self.component}::reportViolation(U32 requirement, U64 stamp)'
        yield '{'
        yield '  switch (requirement) {'
        for number, (item, word) in enumerate(zip(self._manifest.requirements,
                                                  self._requirements(), strict=True)):
            level = 'HI' if item.severity is Severity.ERROR else 'LO'
            yield f'    case {number}u:'
            yield f'      this->log_WARNING_{level}_violated_{word}(stamp);'
            yield f'      this->tlmWrite_violations_{word}(this->violations({number}u));'
            yield '      break;'
        yield from ('    default: break;', '  }', '}', '')

    def _report_silence(self) -> Iterator[str]:
        yield f'void {self.component}::reportSilence(U32 input, bool isSilent)'
        yield '{'
        yield '  (void)isSilent;'
        yield '  switch (input) {'
        for index, word in self._silences():
            yield f'    case {index}u:'
            yield '      if (isSilent) {'
            yield f'        this->log_WARNING_LO_silent_{word}();'
            yield '      } else {'
            yield f'        this->log_ACTIVITY_HI_heard_{word}();'
            yield '      }'
            yield '      break;'
        yield from ('    default: break;', '  }', '}', '')

    def values(self) -> dict[str, str]:
        """Return the placeholders that only this target has."""
        rows = zip(self._manifest.requirements, self._requirements(), strict=True)
        return {
            'COMPONENT': self.component,
            'HANDLERS': '\n'.join(f'  void {self._signature(topic)};' for topic in self._topics),
            'PORTS': '\n'.join(
                f'| `topic_{topic.word}` | {markdown(topic.name)} | '
                + ', '.join(f'`{name}: {kind}`' for _, name, kind in self._arguments(topic))
                + ' |' for topic in self._topics),
            'EVENTS': '\n'.join((
                *(f'| {number} | {markdown(item.id)} | `violated_{word}` | `violations_{word}` |'
                  for number, (item, word) in enumerate(rows)),
                *self._silence_rows())),
            'WHEN': flight.when_evaluated(self._manifest, 'A call of `run`'),
        }


def _annotation(text: str) -> str:
    """Return a comment without characters of XML, of which formulas have words."""
    shown = re.sub(r'<(backslash|U[+][0-9A-F]+)>', r'(\1)', safe(text))
    return re.sub(r' ?(<->|<=|<>|<|&) ?', lambda found: f' {_IN_WORDS[found[1]]} ', shown).strip()


def _label(text: str) -> str:
    return flight.label(text).translate({ord('<'): '_', ord('&'): '_'})


def _camel(name: str) -> str:
    return ''.join(part[:1].upper() + part[1:] for part in name.split('_')) or 'Bundle'


def _type(kind: ValueType) -> str:
    """Return a type of FPP, which has the same name in C++."""
    return _FPP.get(kind, f'{"I" if kind.is_signed else "U"}{kind.bits}')
