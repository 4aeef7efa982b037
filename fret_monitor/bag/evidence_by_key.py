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
Evidence of a bundle whose requirements are one for each key.

What is shown of an instance is what is of a plain bundle in which its key is written in place of
the variable. The recording is read once more for all instances of a variable that are shown.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from fret_monitor.bag.check import AnyRecording, RecordingResult, Selection
from fret_monitor.bag.evidence import evidence, Occurrence
from fret_monitor.bag.overview import Start
from fret_monitor.bag.trace import InstanceTrace, Trace
from fret_monitor.build import Reading
from fret_monitor.codegen.inputs import described_input
from fret_monitor.explain.report import Meaning
from fret_monitor.logic.expansion import Expansion, with_keys, Written
from fret_monitor.logic.formula import variables
from fret_monitor.logic.scopes import instance_scopes, InstanceScope
from fret_monitor.logic.specification import Signal, Specification
from fret_monitor.model.manifest import Manifest, ManifestInput
from fret_monitor.model.names import parts_of_key
from fret_monitor.model.policies import Policy


def evidence_by_key(
    reading: Reading, meanings: Mapping[str, Meaning], recording: AnyRecording,
    selection: Selection, result: RecordingResult, starts: Sequence[Sequence[Start]],
) -> tuple[list[list[Occurrence]], list[ManifestInput]]:
    """
    Return, for each requirement, what is shown of its first occurrences, or why it is open.

    Return also the inputs that the plots refer to: those of the bundle, then those of instances.
    """
    specification, inputs = reading.specification, [*result.manifest.inputs]
    own = [place for place, item in enumerate(result.findings) if not item.variables]
    found = evidence(
        replace(reading, specification=replace(specification, properties=tuple(
            specification.properties[place] for place in own))),
        meanings, [recording] * len(own), selection,
        replace(result, findings=tuple(result.findings[place] for place in own)),
        [starts[place] for place in own])
    shown: list[list[Occurrence]] = [[] for _ in starts]
    for place, occurrences in zip(own, found, strict=True):
        shown[place] = occurrences
    for scope in instance_scopes(specification):
        ids = {item.id for item in scope.specification.properties[:scope.n_reported]}
        items = [_Instance(place, key) for place, item in enumerate(specification.properties)
                 if item.id in ids
                 for key in dict.fromkeys(start.key for start in starts[place])
                 if key is not None and _is_text(key, scope.variables)]
        written, means = _written(items, scope, specification, meanings)
        found = evidence(
            replace(reading, specification=written), means,
            _recordings(items, scope, recording, result.manifest), selection,
            replace(result, findings=tuple(
                result.findings[item.place].instances[item.key] for item in items)),
            [[start for start in starts[item.place] if start.key == item.key] for item in items])
        for item, occurrences in zip(items, found, strict=True):
            shown[item.place] += [_shifted(each, len(inputs)) for each in occurrences]
            shown[item.place].sort(key=lambda each: each.start.time)
        inputs += map(described_input, written.signals)
    return shown, inputs


@dataclass(frozen=True)
class _Instance:
    """A requirement (index) of the instance of a key."""

    place: int
    key: bytes


def _is_text(key: bytes, variables: Sequence[str]) -> bool:
    """Whether the keys of an instance can be written in a bundle."""
    return all(part.decode(errors='replace').encode() == part
               for part in parts_of_key(key, variables))


def _keys(item: _Instance, variables: Sequence[str]) -> Written:
    return tuple(zip(variables, (part.decode() for part in parts_of_key(item.key, variables)),
                     strict=True))


def _written(items: Sequence[_Instance], scope: InstanceScope, specification: Specification,
             meanings: Mapping[str, Meaning]) -> tuple[Specification, dict[str, Meaning]]:
    """Return some requirements of instances as a plain bundle, and what they mean."""
    all_keys = [dict(_keys(item, scope.variables)) for item in items]
    part = replace(scope.specification, instance_variables=specification.instance_variables)
    expansion = Expansion(part, {
        name: [*dict.fromkeys(keys[name] for keys in all_keys)] for name in scope.variables})
    properties, means = [], dict[str, Meaning]()
    for item in items:
        written = _keys(item, scope.variables)
        original = specification.properties[item.place]
        properties.append(expansion.property(original, written))
        meaning = meanings[original.id]
        means[properties[-1].id] = meaning if meaning.denial is None else replace(
            meaning, denial=expansion.formula(meaning.denial, written))
    read = {name for item in properties for name in item.inputs}
    signals = [found for item in part.signals for found in expansion.signals(item)
               if len(item.variables) < 2 or found.name in read]  # not each with each
    names = {item.name for item in signals}
    # An instance steps at the messages of its key, not at those of all.
    is_for_all = specification.policy is Policy.EVERY_MESSAGE
    return replace(
        part, instance_variables=(), properties=tuple(properties),
        policy=Policy.RELEVANT_MESSAGE if is_for_all else specification.policy,
        signals=tuple(signals), definitions=tuple(
            found for item in part.definitions for found in expansion.definitions(*item)
            if names.issuperset(one.name for one in variables(found[1])))), means


def _recordings(items: Sequence[_Instance], scope: InstanceScope, recording: AnyRecording,
                manifest: Manifest) -> list[AnyRecording]:
    """Return what there is of each instance: the recording, or the rows of a table."""
    if not isinstance(recording, Trace):
        return [recording] * len(items)
    rows: dict[bytes, AnyRecording] = {}
    for item in items:
        if item.key not in rows:
            keys = _keys(item, scope.variables)
            rows[item.key] = InstanceTrace(
                recording, manifest, {name: key.encode() for name, key in keys},
                {_name_with(signal, keys): signal.name
                 for signal in scope.specification.signals})
    return [rows[item.key] for item in items]


def _name_with(signal: Signal, keys: Written) -> str:
    own = tuple((name, key) for name, key in keys if name in signal.variables)
    return with_keys(signal.name, own) if own else signal.name


def _shifted(item: Occurrence, by: int) -> Occurrence:
    """Return an occurrence whose plots refer to inputs that come after others."""
    return replace(item, plots=tuple(
        replace(plot, input=plot.input + by) for plot in item.plots))
