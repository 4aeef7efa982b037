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

"""`check BUNDLE...`: all problems of a bundle, or a table of its requirements."""

from argparse import ArgumentParser, Namespace
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
import math
from pathlib import Path
from typing import NamedTuple

from fret_monitor.bag.results_file import meanings_of
from fret_monitor.build import generate_monitor, GeneratedKind, GeneratedMonitor, read
from fret_monitor.cli.analyze import NEEDED, quick_warnings
from fret_monitor.cli.constants import add_constants
from fret_monitor.cli.document import add_json_option, print_document
from fret_monitor.cli.terminal import print_diagnostics
from fret_monitor.cli.traceability import as_dict, Evidence, evidence, gaps, Link, table
from fret_monitor.elaboration.durations import approximate
from fret_monitor.elaboration.restrict import names_with_keys
from fret_monitor.logic.printing import to_smv
from fret_monitor.logic.specification import (
    Gate, Property, Signal, Specification, written_input,
)
from fret_monitor.model.bundle_files import BUNDLE_HELP, existing_bundle
from fret_monitor.model.diagnostics import (
    by_place, CompileError, counted, Diagnostic, missing_packages, printable, Problems,
    Text,
)
from fret_monitor.model.manifest import ManifestAction
from fret_monitor.model.policies import InputSource, Policy, Stamp
from fret_monitor.model.times import known_text, time_text
from fret_monitor.native.errors import NativeError
from fret_monitor.program.layout import GroupLayout, instance_bytes, lay_out, state_bytes
from fret_monitor.program.lower import lower
from fret_monitor.program.window_sizes import window_sizes, WindowSize
from fret_monitor.traces.gated import doubtful_gates, Repair

_STEPS = {
    Policy.EVERY_MESSAGE: ('a step is a message on any mapped topic', 'messages'),
    Policy.RELEVANT_MESSAGE: ("a step is a message on a topic of the requirement's inputs",
                              'messages'),
    Policy.ALL_INPUTS: ("a step is a round in which each of the requirement's inputs came anew",
                        'rounds'),
    Policy.PERIODIC: ('a step is a period of {period} s', 'steps'),
    Policy.TIMED: ('bounds are times', ''),
}
_MANY = 4
_FORMULA_WIDTH = 2000
_SOLVER_S = 1.5


def add_arguments(parser: ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument('bundles', metavar='BUNDLE', nargs='+', help=BUNDLE_HELP)
    add_constants(parser)
    parser.add_argument('--trace', metavar='FILE', nargs='*', type=Path,
                        help='show where each requirement comes from, what it reads, and what '
                        'exercised it: folders of `tests`, and files of `bag --results` or '
                        '`--junit`')
    parser.add_argument('--analyze', action='store_true', help='also warn of what `analyze` '
                        'finds in two seconds; needs its packages')
    add_json_option(parser)
    parser.set_defaults(run=run)


def run(options: Namespace) -> int:
    """Check each bundle; return 1 if any has an error."""
    problems = Problems()
    traced = None if options.trace is None else evidence(options.trace, problems)
    found = []
    for name in options.bundles:
        item = _checked(name, dict(options.constants), options.analyze)
        found.append(item)
        if not options.json:
            print_diagnostics(item.diagnostics)
            if item.generated is not None:
                print('\n'.join(_report(item.path, item.generated) if traced is None
                                else _traced(item, item.generated, traced)))
    if traced is not None:
        _warn_of_unknown(found, traced, problems)
    if options.json:
        print_document({'bundles': [_as_dict(item, traced) for item in found]},
                       [problem for item in found for problem in item.diagnostics]
                       + [*problems.warnings])
    else:
        print_diagnostics(problems.warnings)
    return int(any(item.generated is None for item in found))


class _Checked(NamedTuple):
    """A bundle, its C unless it has errors, and its errors or warnings."""

    path: Path
    generated: GeneratedMonitor | None
    diagnostics: tuple[Diagnostic, ...]
    sources: Mapping[str, str] = {}  # ids where they come from, if they are others


def _checked(name: str, constants: Mapping[str, Text], is_analyzed: bool) -> _Checked:
    path = Path(name)
    try:
        path = existing_bundle(name)
        reading = read(path, constants=constants, takes_instances=True)
        generated = generate_monitor(reading)
        has_instances = bool(generated.kinds)
        faults = quick_warnings(reading) if is_analyzed and not has_instances else []
    except CompileError as error:
        return _Checked(path, None, error.diagnostics)
    sources = {one.id.value: one.source for one in
               (reading.bundle.requirements if reading.bundle else ()) if one.source}
    return _Checked(path, generated, by_place((
        *generated.warnings, *_of_gates(reading.specification), *faults)), sources)


def _of_gates(specification: Specification) -> Iterator[Diagnostic]:
    """
    Yield what the solver finds about gates, if it is installed, and what their monitors find.

    Without a compiler there is nothing.
    """
    def decide(whole: Specification, gate: Gate) -> Mapping[str, Repair]:
        if missing_packages(NEEDED):
            return {}
        # Imported here: loading the solver is slow, and bundles without gates do not need it.
        from fret_monitor.analysis.repairs import repairs
        return repairs(whole, gate, _SOLVER_S / len(specification.gates))

    with suppress(NativeError):
        yield from doubtful_gates(specification, decide)


def _as_dict(item: _Checked, traced: Evidence | None) -> dict[str, object]:
    if item.generated is None:
        return {'bundle': str(item.path), 'is_valid': False}
    specification, manifest = item.generated.specification, item.generated.manifest
    return {
        'bundle': str(item.path), 'is_valid': True,
        'policy': manifest.policy.value,
        'period': manifest.period,
        'unit': None if specification.unit is None else float(specification.unit),
        'state_bytes': manifest.state_bytes,
        'operations': sum(group.operations for group in manifest.groups),
        'topics': _topics(item.generated),
        'inputs': [{'name': signal.name, 'type': signal.type.value, 'topic': signal.topic,
                    'for_each': signal.variables} for signal in _inputs(item.generated)],
        'instances': [{'for_each': found.variables, 'most': found.most, 'bytes': found.bytes}
                      for found in _instances(item.generated)],
        'requirements': list(map(_requirement_as_dict, _requirements(item.generated))),
        'windows': [{'window': found.text, 'state_bytes': found.bytes, 'room': found.room,
                     'filled_by': found.filled_by, 'requirements': found.ids}
                    for found in _windows(item.generated)],
        'gates': list(map(_gate_as_dict, specification.gates)),
        'actions': [{'name': action.name, 'kind': action.kind.value, 'target': action.target,
                     'requirements': users} for action, users in _users(item.generated)],
        **({} if traced is None else {'trace': [
            as_dict(link) for link in _links(item, item.generated, traced)]}),
    }


def _links(item: _Checked, generated: GeneratedMonitor, traced: Evidence) -> Iterator[Link]:
    """Yield what is known of each requirement, in the bundle's order."""
    topics = {signal.name: signal.topic for signal in _inputs(generated)}
    meanings = meanings_of(generated.manifest)
    for found in _requirements(generated):
        id_ = found.item.id
        meaning = meanings.get(id_, '')
        yield Link(id_, item.sources.get(id_, id_), found.inputs,
                   [*dict.fromkeys(topic for name in found.inputs if (topic := topics.get(name)))],
                   traced.tests.get(id_, ()), traced.seen(id_, meaning),
                   traced.outdated(id_, meaning))


def _traced(item: _Checked, generated: GeneratedMonitor, traced: Evidence) -> Iterator[str]:
    links = [*_links(item, generated, traced)]
    yield from (f'{item.path}: {counted(len(links), "requirement")}', '')
    yield from _table([tuple(map(printable, row)) for row in table(links, traced)])
    lines = [*map(printable, gaps(links, traced))]
    yield from ['', *lines] if lines else []


def _warn_of_unknown(found: Iterable[_Checked], traced: Evidence, problems: Problems) -> None:
    """Warn of results of requirements that no bundle has."""
    known = {one.item.id for item in found if item.generated is not None
             for one in _requirements(item.generated)}
    unknown = [*dict.fromkeys(id_ for id_ in (*traced.tests, *traced.recordings)
                              if id_ not in known)]
    if unknown:
        problems.warning('tests or results of requirements that are in no bundle here: '
                         + ', '.join(unknown))


def _inputs(generated: GeneratedMonitor) -> list[Signal]:
    """Return the inputs of all scopes, without aggregates."""
    found = dict.fromkeys([*generated.specification.signals, *(
        signal for kind in generated.kinds for signal in kind.scope.specification.signals
        if signal.variables)])
    return [item for item in found if item.source is not InputSource.INSTANCES]


def _topics(generated: GeneratedMonitor) -> list[str]:
    """Return the topics of all scopes."""
    manifests = (generated.manifest, *(kind.manifest for kind in generated.kinds))
    return [*dict.fromkeys(topic.name for manifest in manifests for topic in manifest.received)]


class _Instances(NamedTuple):
    """What `check` says about the instances of some variables; bytes and operations of each."""

    variables: tuple[str, ...]
    most: int
    bytes: int
    operations: int


def _instances(generated: GeneratedMonitor) -> Iterator[_Instances]:
    """Yield how many instances there are, and what one needs in all kinds with its key."""
    by_variables: dict[tuple[str, ...], list[GeneratedKind]] = {}
    for kind in generated.kinds:
        by_variables.setdefault(kind.scope.variables, []).append(kind)
    for names, kinds in sorted(by_variables.items(), key=lambda item: len(item[0])):
        most = math.prod(item.most for item in generated.manifest.variables if item.name in names)
        yield _Instances(
            names, most, sum(instance_bytes(kind.program, kind.layouts) for kind in kinds),
            sum(layout.operations for kind in kinds for layout in kind.layouts))


def _instance_lines(generated: GeneratedMonitor) -> Iterator[str]:
    for names, most, size, operations in _instances(generated):
        yield (f'for each {" and ".join(names)}: at most '
               f'{counted(most, "instance")}, {counted(size, "byte")} and '
               f'{counted(operations, "operation")} each, {counted(most * size, "byte")} in all')


def _gate_as_dict(gate: Gate) -> dict[str, object]:
    settings = gate.settings
    return {'name': gate.name, 'is_service': settings.is_service, 'from': settings.source,
            'to': settings.target, 'type': settings.interface, 'keep': gate.keep,
            'otherwise': settings.otherwise.value}


class _Requirement(NamedTuple):
    """What `check` says about a requirement."""

    item: Property
    variables: tuple[str, ...]
    inputs: list[str]
    state_bytes: int
    formula: str


def _requirements(generated: GeneratedMonitor) -> Iterator[_Requirement]:
    found = [*_of_scope((), generated.specification), *(
        item for kind in generated.kinds
        for item in _of_scope(kind.scope.variables, kind.scope.specification,
                              kind.scope.n_reported))]
    ids = generated.manifest.ids
    yield from sorted(found, key=lambda item: ids.index(item.item.id)) if ids else found


def _of_scope(variables: tuple[str, ...], specification: Specification,
              count: int | None = None) -> Iterator[_Requirement]:
    """Yield the first requirements of a scope, all if `count` is None."""
    names = [signal.name for signal in specification.signals]
    values = {signal.name: signal.values for signal in specification.signals if signal.values}
    is_timed = specification.policy is Policy.TIMED
    for item in specification.properties[:count]:
        yield _Requirement(item, variables, sorted(item.inputs, key=names.index),
                           _owned_bytes(specification, item),
                           to_smv(item.formula, _FORMULA_WIDTH, values, is_timed=is_timed))


def _requirement_as_dict(found: _Requirement) -> dict[str, object]:
    item = found.item
    return {'id': item.id, 'title': item.title, 'text': item.text, 'for_each': found.variables,
            'inputs': found.inputs,
            'state_bytes': found.state_bytes, 'bounds': item.bounds, 'horizon': item.horizon,
            'formula': found.formula}


def _report(path: Path, generated: GeneratedMonitor) -> Iterator[str]:
    manifest = generated.manifest
    operations = sum(group.operations for group in manifest.groups)
    inputs = _inputs(generated)
    yield (f'{path}: {counted(len(manifest.ids or manifest.requirements), "requirement")}, '
           f'{counted(len(inputs), "input")} on '
           f'{counted(len(_topics(generated)), "topic")}, '
           f'{counted(manifest.state_bytes, "byte")} of state, '
           f'{counted(operations, "operation")} '
           f'{"an evaluation" if manifest.policy is Policy.TIMED else "a step"}')
    step = _STEPS[manifest.policy][0].format(period=manifest.period)
    yield f'policy {manifest.policy.value}: {step}{_time_options(generated.specification)}'
    if generated.kinds:
        yield from ['', *_instance_lines(generated)]
    yield ''
    of = ('of each',) if generated.kinds else ()
    yield from _table([('id', *of, 'inputs', 'state', 'bounds', 'formula'), *_rows(generated)])
    windows = [*_windows(generated)]
    if windows:
        yield ''
        yield from _table([('window', 'state', 'room for', 'requirements'), *(
            (item.text, f'{item.bytes:,} B', item.filled_by, ', '.join(item.ids))
            for item in windows)])
    is_timed = manifest.policy is Policy.TIMED
    late = [f'{item.id}: known {known_text(item.horizon, is_timed=is_timed)}'
            for item, *_ in _requirements(generated) if item.horizon]
    yield from ['', *late] if late else []
    acting = [*_acting(generated)]
    yield from ['', *acting] if acting else []


class _Window(NamedTuple):
    """What `check` says about a window of numbers, or a rate of messages."""

    text: str
    bytes: int
    room: int
    filled_by: str
    ids: list[str]


def _windows(generated: GeneratedMonitor) -> Iterator[_Window]:
    """Yield the windows of all scopes, each once."""
    yield from _windows_of(generated.specification, generated.layouts)
    for kind in generated.kinds:
        yield from _windows_of(kind.scope.specification, kind.layouts)


def _windows_of(specification: Specification,
                layouts: tuple[GroupLayout, ...]) -> Iterator[_Window]:
    signals, properties = specification.signals, specification.properties
    values = {signal.name: signal.values for signal in signals if signal.values}
    is_timed = specification.policy is Policy.TIMED
    for found in (item for layout in layouts for item in window_sizes(layout)):
        text = ', '.join(to_smv(item, _FORMULA_WIDTH, values, is_timed=is_timed)
                         for item in found.formulas)
        yield _Window(text, found.bytes, found.entries, _filled_by(found, signals),
                      [properties[number].id for number in found.properties])
    for signal in signals:
        if signal.source is InputSource.RATE:
            filled = f'{counted(signal.room, "message")}: max_rate x {time_text(signal.window)}'
            yield _Window(f'{signal.name}: rate({time_text(signal.window)})', 8 * signal.room,
                          signal.room, filled,
                          [item.id for item in properties if signal.name in item.inputs])


def _filled_by(found: WindowSize, signals: tuple[Signal, ...]) -> str:
    entries = counted(found.entries, found.entry)
    names = ', '.join(dict.fromkeys(
        written_input(signals, signals[number]).name for number in found.signals))
    return f'{entries}: max_rate of {names} x {time_text(found.past)}' if names else entries


def _acting(generated: GeneratedMonitor) -> Iterator[str]:
    """Yield a line for each gate and each action."""
    for gate in generated.specification.gates:
        names = names_with_keys(gate, generated.manifest.variables)
        each = '' if names == [gate.name] else f', as {", ".join(names)}'
        yield (f'gate {gate.name}: {gate.settings.source} -> {gate.settings.target}{each}, '
               f'keeps {", ".join(gate.keep)}')
    for action, users in _users(generated):
        yield f'{action.kind.value} {action.name}: {action.target}, of {", ".join(users) or "-"}'


def _users(generated: GeneratedMonitor) -> Iterator[tuple[ManifestAction, list[str]]]:
    """Yield each action and the ids of the requirements that it follows, of all scopes."""
    items = [found.item for found in _requirements(generated)]
    for action in generated.specification.actions:
        yield action, [item.id for item in items
                       if action.name in (*item.on_violation, *item.on_end)]


def _time_options(specification: Specification) -> str:
    """Return what a bundle chose under the policy timed, for messages and plain counts."""
    if specification.policy is not Policy.TIMED:
        return ''
    unit, reorder = specification.unit, specification.reorder
    count = '' if unit is None else f', a plain count is {approximate(unit)} s'
    wait = f', which may be late by {time_text(reorder)}' if reorder else ''
    stamps = f', a message counts at its stamp{wait}' \
        if specification.stamp is Stamp.HEADER else ''
    return count + stamps


def _rows(generated: GeneratedMonitor) -> Iterator[tuple[str, ...]]:
    specification = generated.specification
    for found in _requirements(generated):
        yield (
            found.item.id,
            *((' and '.join(found.variables) or '-',) if generated.kinds else ()),
            ', '.join(found.inputs) or '-',
            f'{found.state_bytes} B',
            _bounds(found.item, specification.policy, specification.period),
            found.formula,
        )


def _table(rows: list[tuple[str, ...]]) -> Iterator[str]:
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]) - 1)]
    for row in rows:
        cells = [cell.ljust(width) for cell, width in zip(row, widths, strict=False)]
        yield '  '.join([*cells, row[-1]])


def _owned_bytes(specification: Specification, item: Property) -> int:
    """Return the bytes of state that a requirement would need in its own bundle."""
    program = lower(replace(specification, properties=(item,)))
    return state_bytes(tuple(lay_out(group) for group in program.groups))


def _bounds(item: Property, policy: Policy, period: Fraction | None) -> str:
    numbers = item.bounds
    if not numbers:
        return '-'
    if policy is Policy.TIMED:
        more = '... ' if len(numbers) > _MANY else ''
        return more + ', '.join(map(_time, numbers[-_MANY:]))
    shown = ', '.join(f'{number:,}' for number in numbers[-_MANY:])
    shown = f'... {shown}' if len(numbers) > _MANY else shown
    if period is None:
        noun = _STEPS[policy][1]
        return f'{shown} {noun.removesuffix("s") if numbers == (1,) else noun}'
    times = ', '.join(f'{float(number * period):g}' for number in numbers[-_MANY:])
    return f'{shown} step{"" if numbers == (1,) else "s"} = {times} s'


def _time(nanoseconds: int) -> str:
    """Return a bound as a time; `<2 s` where the time itself is left out by one nanosecond."""
    exact, below = time_text(nanoseconds), time_text(nanoseconds + 1)
    return f'<{below}' if len(below) < len(exact) else exact
