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
Target `cfs`: an application of NASA's core Flight System (cFE 7 and later).

Each topic of the bundle is a message of the software bus with an identifier and a C struct, which
a mission can replace by those of the sender. Logic is in `csrc/export/cfs`; generated are the
identifiers, structs, tables of events, and the copying of the fields.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from zlib import crc32

from fret_monitor.build import GeneratedMonitor
from fret_monitor.codegen.comments import comment, safe
from fret_monitor.codegen.inputs import origin
from fret_monitor.export import flight
from fret_monitor.export.content import Content, export_name, hand_written, markdown, Options
from fret_monitor.model.diagnostics import Problems
from fret_monitor.model.policies import InputSource, Severity
from fret_monitor.model.values import ValueType

_MONITORS = f'fsw/src/{flight.MONITORS}'
_LONGEST_NAME = 19  # characters: OS_MAX_API_NAME of OSAL, less the final 0
# Below are those of cFE and the usual applications; a message identifier has 11 bits for a topic.
_FIRST_TOPIC_ID, _END_OF_TOPIC_IDS = 0x100, 0x800
_FIRST_PERF_ID, _END_OF_PERF_IDS = 32, 128  # cFE keeps those below
_LARGEST_MESSAGE = 32768  # bytes: CFE_MISSION_SB_MAX_SB_MSG_SIZE, as cFE has it by default
_OWN_TOPICS = ('CMD', 'SEND_HK', 'WAKEUP', 'HK_TLM')
# Events of the application itself, from 1 on; more can be added at the end.
_EVENTS = (
    'INIT_INF', 'NOOP_INF', 'RESET_INF', 'RESET_MONITORS_INF', 'CC_ERR', 'MID_ERR', 'LEN_ERR',
    'PIPE_ERR', 'SUB_ERR', 'START_ERR', 'HK_ERR', 'SILENT', 'HEARD',
)
_FIRST_VIOLATION = 100
_TYPES = {ValueType.BOOL: 'uint8', ValueType.FLOAT32: 'float', ValueType.FLOAT64: 'double'}


def cfs(generated: GeneratedMonitor, options: Options) -> Content:
    """
    Return the files.

    Raises
    ------
    CompileError
        if an input is a string, messages count by the stamps of their headers, the bundle has no
        inputs, handlers shall have arguments, or there are too many topics or requirements for
        the topic ids or a message of housekeeping.
    """
    problems = Problems()
    flight.check(generated, options, 'messages of cFS', problems)
    writer = _CfsWriter(generated)
    entry = f'{writer.upper}_Main'
    if len(entry) > _LONGEST_NAME:
        problems.warning(
            f"'{entry}' is longer than {_LONGEST_NAME} characters, the limit of cFS for names",
            help=f'give the export a name of at most {_LONGEST_NAME - len("_APP_Main")} '
                 'characters: --name NAME')
    writer.check_sizes(problems)
    problems.raise_errors()
    app = f'{writer.name}_app'
    texts = {
        f'config/default_{app}_messages.h': writer.messages(),
        f'config/default_{app}_topicids.h': writer.topic_ids(),
        f'fsw/inc/{app}_eventids.h': writer.event_ids(),
        f'fsw/src/{app}_map.c': writer.map(),
    }
    return flight.content(generated, options, texts,
                          flight.named(generated, hand_written('cfs')), writer.values(),
                          _MONITORS, problems.warnings)


@dataclass(frozen=True)
class _CfsWriter:
    """Writes the generated files."""

    generated: GeneratedMonitor

    @property
    def name(self) -> str:
        return export_name(self.generated)

    @property
    def upper(self) -> str:
        """What macros, types and functions of the application begin with."""
        return f'{self.name.upper()}_APP'

    @property
    def topics(self) -> tuple[flight.FlightTopic, ...]:
        return flight.topics_of(self.generated.manifest)

    def check_sizes(self, problems: Problems) -> None:
        """Refuse what has no room in the topic ids or in a message."""
        topics, requirements = len(self.topics), len(self.generated.manifest.requirements)
        room = _END_OF_TOPIC_IDS - _FIRST_TOPIC_ID - len(_OWN_TOPICS)
        if topics > room:
            problems.error(f'the bundle has {topics} topics, and cFS has topic ids for {room}',
                           help='split the bundle, and export each part with a name of its own')
        size = 16 + 8 + 4 * topics + 16 * requirements  # config/default_NAME_app_msgstruct.h
        if size > _LARGEST_MESSAGE:
            problems.error(
                f'housekeeping of {requirements} requirements and {topics} topics has {size} '
                f'bytes, and a message of cFS has at most {_LARGEST_MESSAGE}',
                help='split the bundle, and export each part with a name of its own')

    def _derived(self, begin: int, end: int) -> int:
        """Return a number of a range that is another for most other names."""
        return begin + crc32(self.name.encode()) % (end - begin)

    def _header(self, file: str, what: str, *body: Iterator[str]) -> Iterator[str]:
        guard = f'{self.upper}_{file.upper()}_H_'
        yield f'// {self.name}_app_{file}.h: {what}'
        yield '// Generated by fret_monitor.'
        yield from ('', f'#ifndef {guard}', f'#define {guard}', '')
        for lines in body:
            yield from lines
        yield from ('', f'#endif  // {guard}')

    def topic_ids(self) -> Iterator[str]:
        """Yield the lines of the header with the topic ids."""
        return self._header('topicids', 'the topic ids. To be set by the mission.',
                            self._topic_ids())

    def _topic_ids(self) -> Iterator[str]:
        names = [*_OWN_TOPICS, *(f'TOPIC_{topic.word.upper()}' for topic in self.topics)]
        first = f'CFE_MISSION_{self.upper}_FIRST_TOPICID'
        number = self._derived(_FIRST_TOPIC_ID, _END_OF_TOPIC_IDS - len(names) + 1)
        yield f'// The first of {len(names)} in a row, which no other application may use. The'
        yield '// default is derived from the name of the export: look whether it is free.'
        yield from (f'#ifndef {first}', f'#define {first} {number:#x}', '#endif')
        yield f'#if {first} + {len(names)} > {_END_OF_TOPIC_IDS:#x}'
        yield f'#error "{first}: a message identifier has no room for the last topic id"'
        yield from ('#endif', '')
        for number, word in enumerate(names):
            if number == len(_OWN_TOPICS):
                yield from ('', '// Of the messages that have the inputs: those of their senders.')
            yield f'#define CFE_MISSION_{self.upper}_{word}_TOPICID ({first} + {number})'

    def event_ids(self) -> Iterator[str]:
        """Yield the lines of the header with the event ids."""
        return self._header('eventids', f'the event ids of {safe(self.generated.manifest.name)}.',
                            self._event_ids())

    def _event_ids(self) -> Iterator[str]:
        for number, word in enumerate(_EVENTS, 1):
            yield f'#define {self.upper}_{word}_EID {number}'
        yield from ('', '// A requirement is violated.')
        items = self.generated.manifest.requirements
        spelled = flight.requirement_words(self.generated.manifest)
        for number, (item, word) in enumerate(zip(items, spelled, strict=True)):
            yield from comment(f'{item.id}: {item.title or item.text}')
            yield f'#define {self._violation(word)} {_FIRST_VIOLATION + number}'

    def _violation(self, word: str) -> str:
        return f'{self.upper}_VIOLATION_{word.upper()}_EID'

    def messages(self) -> Iterator[str]:
        """Yield the lines of the header with the messages of the topics."""
        return self._header(
            'messages', 'the messages that have the inputs.', iter((
                '// A mission replaces this file to take the inputs from messages that it has:',
                '// of each topic the message identifier and the struct, and of each input the',
                '// member of that struct.', '',
                '#include "cfe_core_api_base_msgids.h"', '#include "cfe_msg_hdr.h"', '',
                f'#include "{self.name}_app_topicids.h"')),
            *map(self._message, self.topics))

    def _message(self, topic: flight.FlightTopic) -> Iterator[str]:
        manifest, spelled = self.generated.manifest, flight.members(self.generated)
        kind = f' ({topic.message_type})' if topic.message_type else ''
        yield ''
        yield f'// ---- {safe(topic.name)}{kind}'
        yield ''
        yield f'#define {self._mid(topic)} \\'
        yield ('  CFE_PLATFORM_TLM_TOPICID_TO_MIDV'
               f'(CFE_MISSION_{self.upper}_TOPIC_{topic.word.upper()}_TOPICID)')
        yield ''
        yield 'typedef struct'
        yield '{'
        yield '  CFE_MSG_TelemetryHeader_t TelemetryHeader;'
        payload = [index for index in topic.inputs
                   if manifest.inputs[index].source is InputSource.FIELD]
        if payload:
            yield from ('  struct', '  {')
        for index in payload:
            item = manifest.inputs[index]
            yield from comment(origin(item), '    ')
            kind = _TYPES.get(item.value_type, item.value_type.value)
            yield f'    {kind} {spelled[index]};'
        if payload:
            yield '  } Payload;'
        yield f'}} {self._struct(topic)};'
        if payload:
            yield ''
        for index in payload:
            yield f'#define {self._access(index)}(message) ((message)->Payload.{spelled[index]})'

    def _mid(self, topic: flight.FlightTopic) -> str:
        return f'{self.upper}_TOPIC_{topic.word.upper()}_MID'

    def _struct(self, topic: flight.FlightTopic) -> str:
        return f'{self.upper}_Topic_{topic.word}_t'

    def _access(self, index: int) -> str:
        names = [item.name for item in self.generated.manifest.inputs]
        return f'{self.upper}_INPUT_{flight.words(names)[index].upper()}'

    def map(self) -> Iterator[str]:
        """Yield the lines of NAME_app_map.c."""
        yield f'// {self.name}_app_map.c: which message has which input, and the events.'
        yield '// Generated by fret_monitor; changes will be lost.'
        yield ''
        yield from (f'#include "{self.name}_app.h"', f'#include "{self.name}_app_eventids.h"',
                    f'#include "{self.name}_app_messages.h"')
        yield ''
        yield from self._tables()
        yield f'CFE_SB_MsgId_Atom_t {self.upper}_GetTopicMsgId(uint32 Topic)'
        yield from self._switch('Topic', enumerate(map(self._mid, self.topics)), '0')
        yield f'size_t {self.upper}_GetTopicSize(uint32 Topic)'
        sizes = (f'sizeof({self._struct(topic)})' for topic in self.topics)
        yield from self._switch('Topic', enumerate(sizes), '0')
        yield f'uint32 {self.upper}_FindTopic(CFE_SB_MsgId_Atom_t MsgId)'
        yield from self._switch('MsgId', ((self._mid(topic), number) for number, topic
                                          in enumerate(self.topics)), f'{self.upper}_N_TOPICS')
        yield from self._store_inputs()

    def _tables(self) -> Iterator[str]:
        manifest = self.generated.manifest
        spelled = flight.requirement_words(manifest)
        yield f'const {self.upper}_Violation_t {self.upper}_Violations[] = {{'
        for item, word in zip(manifest.requirements, spelled, strict=True):
            level = 'ERROR' if item.severity is Severity.ERROR else 'INFORMATION'
            yield (f'  {{{self._violation(word)}, CFE_EVS_EventType_{level}, '
                   f'{flight.literal(item.id)}}},')
        yield from ('};', '')
        yield f'const char * const {self.upper}_InputNames[] = {{'
        yield from (f'  {flight.literal(item.name)},' for item in manifest.inputs)
        yield from ('};', '')

    def _switch(self, on: str, cases: Iterable[tuple[object, object]],
                default: str) -> Iterator[str]:
        """Yield the body of a function that returns a value for each case of an argument."""
        yield '{'
        yield f'  switch ({on}) {{'
        yield from (f'    case {case}: return {value};' for case, value in cases)
        yield f'    default: return {default};'
        yield from ('  }', '}', '')

    def _store_inputs(self) -> Iterator[str]:
        yield f'void {self.upper}_StoreInputs('
        yield (f'  struct {self.name}_runner * Runner, uint32 Topic, '
               'const CFE_SB_Buffer_t * BufPtr)')
        yield '{'
        yield '  union fm_value Value;'
        yield '  switch (Topic) {'
        for number, topic in enumerate(self.topics):
            yield f'    case {number}: {{'
            yield from (f'      {line}' for line in self._store_topic(topic))
            yield from ('      break;', '    }')
        yield '    default: break;'
        yield from ('  }', '}')

    def _store_topic(self, topic: flight.FlightTopic) -> Iterator[str]:
        struct = self._struct(topic)
        inputs = self.generated.manifest.inputs
        if any(inputs[index].source is InputSource.FIELD for index in topic.inputs):
            yield f'const {struct} * const Message = (const {struct} *)BufPtr;'
        for index in topic.inputs:
            yield from self._store(index)

    def _store(self, index: int) -> Iterator[str]:
        item = self.generated.manifest.inputs[index]
        yield from comment(origin(item))
        store = f'{self.name}_runner_store(Runner, {index}u, Value);'
        match item.source:
            case InputSource.FIELD:
                member = flight.union_member(item.value_type)
                kind = {'f': 'double', 'i': 'int64_t', 'u': 'uint64_t'}[member]
                value = f'{self._access(index)}(Message)'
                yield f'Value.{member} = ({kind}){value};' if item.value_type is not \
                    ValueType.BOOL else f'Value.i = {value} ? 1 : 0;'
                yield store
            case InputSource.RECEIVED:
                yield 'Value.i = 1;'
                yield store
            case InputSource.RATE | InputSource.PERIOD | InputSource.TIME:
                yield 'Value.i = 0;  // the evaluator measures it'
                yield store
            case InputSource.AGE:
                yield f'if ({self.upper}_GetAge(&BufPtr->Msg, &Value.f)) {{'
                yield f'  {store}'
                yield '}'

    def values(self) -> dict[str, str]:
        """Return the placeholders that only this target has."""
        return {'PIPE': f'{self.upper}_PIPE'[:_LONGEST_NAME],
                'PERF_ID': str(self._derived(_FIRST_PERF_ID, _END_OF_PERF_IDS)),
                'MESSAGES': '\n'.join(self._message_rows()),
                'EVENTS': '\n'.join(self._event_rows()),
                'WHEN': flight.when_evaluated(self.generated.manifest,
                                              f'A message `{self.upper}_WAKEUP_MID`')}

    def _message_rows(self) -> Iterator[str]:
        manifest, spelled = self.generated.manifest, flight.members(self.generated)
        for topic in self.topics:
            read = [_member(manifest.inputs[index].source, spelled[index])
                    for index in topic.inputs]
            yield (f'| {markdown(topic.name)} | `{self._mid(topic)}` | `{self._struct(topic)}` '
                   f'| {", ".join(read)} |')

    def _event_rows(self) -> Iterator[str]:
        for number, item in enumerate(self.generated.manifest.requirements):
            yield f'| {_FIRST_VIOLATION + number} | {markdown(item.id)} |'


def _member(source: InputSource, name: str) -> str:
    match source:
        case InputSource.FIELD:
            return f'`Payload.{name}`'
        case InputSource.RATE | InputSource.PERIOD | InputSource.TIME:
            return 'when it comes'
        case InputSource.RECEIVED:
            return 'that it comes'
        case InputSource.AGE:
            return 'the time in its header'
        case InputSource.INSTANCES:
            raise AssertionError('a bundle with instances is refused')
