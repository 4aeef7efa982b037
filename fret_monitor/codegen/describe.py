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

"""The manifest of a monitor program."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain

from fret_monitor.codegen.extractors import Feed, sources_of, topics_of
from fret_monitor.codegen.inputs import described_input
from fret_monitor.codegen.margins import comparisons, LONGEST_COMPARISON
from fret_monitor.codegen.module import CModule
from fret_monitor.logic.formula import Formula, variables
from fret_monitor.logic.printing import to_smv
from fret_monitor.logic.scopes import InstanceScope
from fret_monitor.logic.specification import Gate, Property, Signal, Specification
from fret_monitor.model.made import SourceTopic
from fret_monitor.model.manifest import (
    Manifest, ManifestAggregate, ManifestComparison, ManifestGate, ManifestGroup, ManifestKind,
    ManifestRequirement, ManifestTopic,
)
from fret_monitor.model.policies import Policy
from fret_monitor.program.layout import GroupLayout, state_bytes
from fret_monitor.program.monitor_program import MonitorProgram

_LONGEST_FORMULA = 10_000


def describe(program: MonitorProgram, layouts: tuple[GroupLayout, ...], module: CModule,
             specification: Specification, bundle_hash: str,
             constants: tuple[tuple[str, str], ...] = (),
             topics: Mapping[Feed, ManifestTopic] | None = None,
             users: Sequence[Property] | None = None) -> Manifest:
    """
    Return the manifest of a program and its generated C.

    The program was lowered from the specification; see `Manifest` for the `constants`. `topics`
    are those of the whole bundle, of which the program is a part, and `users` its requirements,
    whose actions the manifest has; None: those of its inputs, and its own.
    """
    used = {name for item in (program.properties if users is None else users)
            for name in (*item.on_violation, *item.on_end)}
    actions = tuple(item for item in specification.actions if item.name in used)
    action_of = {item.name: index for index, item in enumerate(actions)}
    fed = topics_of(program.signals)
    all_topics = tuple(
        replace(item, inputs=tuple(fed.get(feed, ()))) for feed, item in
        (described_topics(program.signals) if topics is None else topics).items())
    group_of = {number: index for index, group in enumerate(program.groups)
                for number in group.properties}
    values = {signal.name: signal.values for signal in program.signals if signal.values}
    constant_of = {name: index for index, (name, _) in enumerate(constants)}
    signal_of = {signal.name: index for index, signal in enumerate(program.signals)}
    return Manifest(
        # A file name may hold bytes that are not valid UTF-8.
        name=program.name.encode(errors='replace').decode(),
        symbol=module.symbol,
        component=program.component,
        policy=program.policy,
        period=program.period,
        inputs=tuple(described_input(signal) for signal in program.signals),
        topics=all_topics,
        groups=tuple(ManifestGroup(layout.group.signals, layout.group.properties, layout.size,
                                   layout.operations) for layout in layouts),
        requirements=tuple(
            _requirement(item, group_of[number], signal_of, constant_of, action_of,
                         to_smv(item.formula, _LONGEST_FORMULA, values,
                                is_timed=program.policy is Policy.TIMED))
            for number, item in enumerate(program.properties)),
        state_bytes=state_bytes(layouts),
        bundle_hash=bundle_hash,
        source_hash=module.source_hash,
        sources=tuple(module.files),
        readers=module.readers,
        stamp=program.stamp,
        reorder=program.reorder,
        constants=constants,
        actions=actions,
        gate=_gate(specification.gate, all_topics) if specification.gate else None,
        kept=specification.kept,
        outputs=module.outputs,
        tests=module.tests,
        margins=module.margins,
        comparisons=tuple(_comparison(item.formula, values, signal_of, program.policy)
                          for item in comparisons(program) if item.formula),
    )


def _comparison(formula: Formula, values: Mapping[str, tuple[tuple[str, int | str], ...]],
                signal_of: Mapping[str, int], policy: Policy) -> ManifestComparison:
    return ManifestComparison(
        to_smv(formula, LONGEST_COMPARISON, values, is_timed=policy is Policy.TIMED),
        tuple(sorted(signal_of[item.name] for item in variables(formula))))


def with_kinds(manifest: Manifest, kinds: list[tuple[InstanceScope, Manifest]],
               specification: Specification) -> Manifest:
    """Return the manifest of a bundle with those of its kinds; `specification` is of them all."""
    place_of = {item.name: place for place, item in enumerate(specification.instance_variables)}
    input_of = {item.name: place for place, item in enumerate(manifest.inputs)}
    aggregates = tuple(
        ManifestAggregate(item.function, kind, operand, input_of[item.signal.name])
        for kind, (scope, _) in enumerate(kinds) for operand, item in scope.aggregates)
    found: list[ManifestKind] = []
    for scope, described in kinds:
        shared = tuple(None if item.variables else input_of[item.name]
                       for item in scope.specification.signals)
        found.append(ManifestKind(
            tuple(place_of[name] for name in scope.variables),
            _with_aggregates(described, shared, aggregates, found), shared, scope.n_reported))
    return replace(
        manifest, variables=specification.instance_variables, kinds=tuple(found),
        aggregates=aggregates, ids=tuple(item.id for item in specification.properties))


def _with_aggregates(manifest: Manifest, shared: Sequence[int | None],
                     aggregates: Sequence[ManifestAggregate],
                     kinds: Sequence[ManifestKind]) -> Manifest:
    """Return the manifest of a kind, whose topics feed aggregates, too; `kinds` are before it."""
    def fed(topic: int) -> Iterator[int]:
        for item in aggregates:
            if item.input in shared and _feeds(topic, kinds[item.kind].manifest, item.operand):
                yield shared.index(item.input)

    return replace(manifest, topics=tuple(
        replace(topic, inputs=(*topic.inputs, *fed(place)))
        for place, topic in enumerate(manifest.topics)))


def _feeds(topic: int, manifest: Manifest, operand: int) -> bool:
    """Whether the group of an operand reads an input of a topic, or no input at all."""
    read = manifest.groups[manifest.requirements[operand].group].inputs
    return not read or not {*manifest.topics[topic].inputs}.isdisjoint(read)


def _gate(gate: Gate, topics: tuple[ManifestTopic, ...]) -> ManifestGate:
    # Without a namespace, `x` and `/x` are one topic; a difference must not let messages pass.
    names = [topic.name.lstrip('/') for topic in topics]
    source = gate.settings.judged_topic.lstrip('/')
    return replace(gate.settings, topic=names.index(source) if source in names else None)


def described_topics(signals: Sequence[Signal],
                     kinds: Sequence[Sequence[Signal]] = ()) -> dict[Feed, ManifestTopic]:
    """Return the topics of a bundle as the manifest has them, without their inputs."""
    first: dict[Feed, Signal] = {}
    for signal in chain(signals, *kinds):
        if signal.topic is not None:
            first.setdefault((signal.topic, signal.where), signal)
    sources = sources_of(signals)
    return {feed: _topic(feed, first.get(feed), sources) for feed in topics_of(signals, kinds)}


def _topic(feed: Feed, first: Signal | None,
           sources: Mapping[str, SourceTopic]) -> ManifestTopic:
    name, where = feed
    if first is None:
        return ManifestTopic(name, sources[name].message_type, (), sources[name].qos)
    return ManifestTopic(name, first.message_type or '', (), first.qos, first.made,
                         str(where or ''))


def _requirement(item: Property, group: int, signal_of: dict[str, int],
                 constant_of: dict[str, int], action_of: dict[str, int],
                 formula: str) -> ManifestRequirement:
    return ManifestRequirement(
        id=item.id,
        handler=item.handler,
        text=item.text,
        title=item.title,
        formula=formula,
        report=item.report,
        severity=item.severity,
        group=group,
        inputs=tuple(sorted(signal_of[name] for name in item.inputs)),
        constants=tuple(constant_of[name] for name in item.constants if name in constant_of),
        on_violation=tuple(action_of[name] for name in item.on_violation),
        on_end=tuple(action_of[name] for name in item.on_end),
        horizon=item.horizon,
        probability=item.probability,
    )
