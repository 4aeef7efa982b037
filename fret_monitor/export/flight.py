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
What the targets `cfs` and `fprime` share: topics without ROS, and the runner of a bundle.

The runner is one C file that includes the monitors and the evaluator. It takes messages and the
time, and calls back for violations. Inputs without a topic come in one message,
`inputs`.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
import re
import textwrap

from fret_monitor.build import GeneratedMonitor
from fret_monitor.codegen import c
from fret_monitor.codegen.comments import safe
from fret_monitor.codegen.names import Names
from fret_monitor.export.content import (
    common_values, Content, csrc_files, EVALUATOR, export_name, ExportPart, hand_written,
    HandlerArguments, Options, runtime_files, structs,
)
from fret_monitor.logic.specification import Signal
from fret_monitor.model.diagnostics import counted, Diagnostic, Problems
from fret_monitor.model.manifest import Manifest, ManifestInput
from fret_monitor.model.policies import InputSource, Policy, Stale, Stamp
from fret_monitor.model.values import ValueType

MONITORS = 'monitors'

_WITHOUT_TOPIC = 'inputs'

SOURCES = {InputSource.FIELD: 'FM_FIELD', InputSource.RECEIVED: 'FM_RECEPTION',
           InputSource.AGE: 'FM_AGE', InputSource.RATE: 'FM_RATE',
           InputSource.PERIOD: 'FM_PERIOD', InputSource.TIME: 'FM_TIME'}
"""The names in C of what an input is taken from."""

_NS_PER_S = 1e9
_RATE_WORDS = 6  # FM_RATE_WORDS
_MOST_REQUIREMENTS = 10_000
_LONGEST_LABEL = 60


@dataclass(frozen=True)
class FlightTopic:
    """
    A message: the topic's name, the word for it in C, and its inputs as indices.

    `message_type` is '' if the bundle names no type of ROS.
    """

    name: str
    word: str
    inputs: tuple[int, ...]
    message_type: str = ''


def topics_of(manifest: Manifest) -> tuple[FlightTopic, ...]:
    """Return the topics of a bundle, also those without a type of ROS, and `inputs`."""
    types = {item.name: item.message_type for item in manifest.topics}
    fed: dict[str, list[int]] = {item.name: [] for item in manifest.topics}
    for index, item in enumerate(manifest.inputs):
        fed.setdefault(item.topic or _WITHOUT_TOPIC, []).append(index)
    return tuple(FlightTopic(name, word, tuple(fed[name]), types.get(name, ''))
                 for name, word in zip(fed, words(fed), strict=True))


def words(names: Iterable[str]) -> list[str]:
    """Return a word of lower-case letters, digits and _ for each name; no two are equal."""
    found: list[str] = []
    for name in names:
        word = candidate = re.sub('[^a-z0-9]+', '_', name.lower()).strip('_')[:40] or 'x'
        number = 2
        while candidate in found:
            candidate = f'{word}_{number}'
            number += 1
        found.append(candidate)
    return found


def requirement_words(manifest: Manifest) -> list[str]:
    """Return a word for each requirement, as `words`."""
    return words(item.id for item in manifest.requirements)


def label(text: str) -> str:
    """Return a text of a bundle for an event: printable ASCII, without what formats react to."""
    return re.sub(r'[^ -~]|["{}%\\]', '_', ' '.join(text.split()))[:_LONGEST_LABEL]


def members(generated: GeneratedMonitor) -> list[str]:
    """Return the name in C of each input, as in the generated struct of inputs."""
    program = generated.program
    names = Names(program.name, (item.name for item in program.signals), (),
                  (word for word, _ in program.definitions)).signals
    return [names[item.name] for item in generated.manifest.inputs]


def check(generated: GeneratedMonitor, options: Options, messages: str,
          problems: Problems) -> None:
    """Report what neither target can do; `messages` says what its messages are."""
    if options.handler_arguments is not HandlerArguments.NONE:
        problems.error('this target calls no handlers',
                       help='leave --handler-arguments out: a violation is an event')
    specification = generated.specification
    for signal in specification.signals:
        if signal.is_string:
            problems.error(
                f"'{signal.name}' is a string, which {messages} do not have", signal.place,
                help='send a number: give its `values` numbers, and a type such as uint8')
        if signal.made:
            problems.error(f"'{signal.name}' is {signal.made.kind.words}", signal.place,
                           help=f'{messages} have none: name a topic')
        if specification.stamp is Stamp.HEADER and signal.topic is not None:
            problems.error(
                f"'{signal.name}' has no header in {messages}", signal.place,
                'the bundle has `stamp: header`', 'stamp: received')
    first = specification.properties[0]
    if not specification.signals:
        problems.error('the bundle has no inputs, so that nothing would ever be evaluated',
                       first.place)
    if len(specification.properties) > _MOST_REQUIREMENTS:
        problems.error(f'{counted(len(specification.properties), "requirement")} are more than '
                       f'{_MOST_REQUIREMENTS:,}, for which there are event ids', first.place)


def ages(generated: GeneratedMonitor) -> list[Signal]:
    """Return the inputs that are the age of a message."""
    return [item for item in generated.specification.signals if item.source is InputSource.AGE]


def content(generated: GeneratedMonitor, options: Options, texts: Mapping[str, Iterable[str]],
            templates: Mapping[str, str], values: Mapping[str, str], monitors: str,
            warnings: tuple[Diagnostic, ...] = ()) -> Content:
    """
    Return the files of a target: its own, and the runner in the folder `monitors`.

    `texts` are the lines of generated files; `templates` and `values` are as in a `Content`.
    """
    name = export_name(generated)
    return Content(
        generated={**{file: '\n'.join(lines) + '\n' for file, lines in texts.items()},
                   **_runner_files(generated, monitors)},
        templates={**templates, **_runner_templates(generated, monitors)},
        values={**common_values(generated, options), **runner_values(generated), **values},
        parts=(ExportPart('monitors with evaluator, without the application or component',
                          (f'{monitors}/{name}_runner.c',), monitors, f'{name}_runner.h',
                          structs(f'{name}_runner')),),
        warnings=warnings)


def _runner_files(generated: GeneratedMonitor, folder: str) -> dict[str, str]:
    """Return the generated files of the runner in a folder: all but its templates."""
    name = export_name(generated)
    module = {file: text for file, text in generated.module.files.items()
              if file != f'{name}_fields.c'}  # no serialized messages are read
    hand = hand_written('flight')
    files = {**runtime_files(generated), **csrc_files(*EVALUATOR), **module,
             'fret_static.h': hand['fret_static.h'],
             f'{name}_options.h': '\n'.join(options_header(generated)) + '\n'}
    return {f'{folder}/{file}': text for file, text in files.items()}


def _runner_templates(generated: GeneratedMonitor, folder: str) -> dict[str, str]:
    """Return the files of the runner in a folder that have placeholders."""
    return {f'{folder}/{file}': text
            for file, text in named(generated, hand_written('flight')).items()
            if file != 'fret_static.h'}


def named(generated: GeneratedMonitor, files: Mapping[str, str]) -> dict[str, str]:
    """Return hand-written files with NAME in their paths replaced."""
    return {path.replace('NAME', export_name(generated)): text for path, text in files.items()}


def runner_values(generated: GeneratedMonitor) -> dict[str, str]:
    """Return the placeholders of the runner."""
    name, manifest = export_name(generated), generated.manifest
    sources = (file for file in generated.module.files
               if file.endswith('.c') and file != f'{name}_fields.c')
    return {
        'UPPER': name.upper(),
        'BUNDLE_IN_C': safe(manifest.name),
        'INPUTS': str(len(manifest.inputs)),
        'TOPICS': str(len(topics_of(manifest))),
        'REQUIREMENT_COUNT': str(len(manifest.requirements)),
        'GROUPS': str(len(manifest.groups)),
        'READINGS': str(sum(len(group.inputs) for group in manifest.groups)),
        'CONSTANT_GROUPS': str(sum(not group.inputs for group in manifest.groups)),
        'MEASURE_WORDS': str(sum(measure_words(item) for item in manifest.inputs)),
        'INCLUDES': '\n'.join(f'#include "{file}"' for file in sources),
        'HAS_PERIODS': str(int(manifest.policy is Policy.PERIODIC)),
    }


def measure_words(item: ManifestInput) -> int:
    """Return the words of memory that a measured input takes (`tables.c`)."""
    match item.source:
        case InputSource.RATE:
            return _RATE_WORDS + item.room
        case InputSource.PERIOD:
            return 1
        case _:
            return 0


def when_evaluated(manifest: Manifest, wakeup: str) -> str:
    """Return when requirements are evaluated, as a sentence; `wakeup` is what keeps the time."""
    sentence = _when(manifest, wakeup)
    if any(item.stale is Stale.VIOLATE for item in manifest.inputs):
        sentence += (' A requirement that reads an input with `stale: violate` is also violated '
                     'when the timeout of that input has passed.')
    return sentence


def _when(manifest: Manifest, wakeup: str) -> str:
    match manifest.policy:
        case Policy.TIMED:
            return ('A requirement is evaluated when a message that it reads comes, and at its '
                    f'deadlines. {wakeup} makes deadlines known at most its own period late; the '
                    'time in the event is that of the deadline.')
        case Policy.PERIODIC:
            return f'{wakeup} is one period: it has to come every {manifest.period:g} s.'
        case Policy.EVERY_MESSAGE:
            return 'All requirements are evaluated at each message of a topic.'
        case Policy.RELEVANT_MESSAGE:
            return 'A requirement is evaluated at each message of a topic that it reads.'
        case Policy.ALL_INPUTS:
            return ('A requirement is evaluated once each of its inputs has come since its last '
                    'evaluation.')


def options_header(generated: GeneratedMonitor) -> Iterator[str]:
    """Yield the lines of NAME_options.h: how the evaluator runs the monitors."""
    name, manifest = export_name(generated), generated.manifest
    topics = topics_of(manifest)
    yield f'// {name}_options.h: how the evaluator runs the monitors of {safe(manifest.name)}.'
    yield '// Generated by fret_monitor; changes will be lost.'
    yield ''
    for number, topic in enumerate(topics):
        yield f'// {safe(topic.name)}'
        yield _array(f'const uint32_t {name}_topic_{number}', (f'{i}u' for i in topic.inputs))
    yield _array(f'const struct fm_topic {name}_topics', (
        f'{{{name}_topic_{number}, {len(topic.inputs)}u}}' for number, topic in enumerate(topics)))
    yield _array(f'const uint8_t {name}_reports',
                 (f'FM_{item.report.name}' for item in manifest.requirements))
    yield _array(f'const uint8_t {name}_sources', (SOURCES[item.source]
                                                   for item in manifest.inputs))
    yield _array(f'const int64_t {name}_timeouts',
                 (nanoseconds(item.timeout) for item in manifest.inputs))
    yield _array(f'const int64_t {name}_startups',
                 (nanoseconds(item.startup) for item in manifest.inputs))
    yield _array(f'const bool {name}_violates',
                 (str(item.stale is Stale.VIOLATE).lower() for item in manifest.inputs))
    yield _array(f'const int64_t {name}_windows',
                 (f'INT64_C({item.window})' for item in manifest.inputs))
    yield _array(f'const uint32_t {name}_rooms', (f'{item.room}u' for item in manifest.inputs))
    yield ''
    yield f'static struct fm_evaluator_options {name}_options(void)'
    yield '{'
    yield '  struct fm_evaluator_options options = {0};'
    yield f'  options.monitor = {manifest.symbol}();'
    yield f'  options.topics = {name}_topics;'
    yield f'  options.n_topics = {len(topics)}u;'
    yield f'  options.policy = FM_{manifest.policy.name};'
    for key in ('reports', 'sources', 'timeouts', 'startups', 'violates', 'windows', 'rooms'):
        yield f'  options.{key} = {name}_{key};'
    if manifest.margins:
        yield f'  options.margins = {manifest.margins}();'
    yield from ('  return options;', '}', '')
    yield f'static void {name}_set_initial_values(struct fm_evaluator * evaluator)'
    yield '{'
    yield '  (void)evaluator;'
    for index, item in enumerate(manifest.inputs):
        if item.initial is not None:
            yield (f'  fm_evaluator_initial(evaluator, {index}u, '
                   f'(union fm_value){union_value(item.value_type, item.initial)});')
    yield '}'


def _array(declaration: str, items: Iterable[str]) -> str:
    return textwrap.fill(f'static {declaration}[] = {{{", ".join(items)}}};', 98,
                         subsequent_indent='  ', break_long_words=False, break_on_hyphens=False)


def nanoseconds(seconds: float | None) -> str:
    """Return a duration as a constant of C; 0 stands for none."""
    return f'INT64_C({max(1, round(seconds * _NS_PER_S)) if seconds else 0})'


def union_member(kind: ValueType) -> str:
    """Return the member of `union fm_value` for a type."""
    if kind.is_float:
        return 'f'
    return 'i' if kind is ValueType.BOOL or kind.is_signed else 'u'


def union_value(kind: ValueType, value: bool | int | float) -> str:
    """Return a value as an initializer of `union fm_value`."""
    match union_member(kind):
        case 'f':
            return f'{{.f = {c.literal(float(value), ValueType.FLOAT64).text}}}'
        case 'u':
            return f'{{.u = {c.literal(int(value), ValueType.UINT64).text}}}'
        case _:
            return f'{{.i = {c.literal(int(value), ValueType.INT64).text}}}'


def literal(text: str) -> str:
    """Return a C string of a label."""
    return c.string_literal(label(text).encode())
