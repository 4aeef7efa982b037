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
Requirements that are violated while a response with a deadline is waited for, and at triggers.

They are compiled in place of the requirements of a bundle, as monitors beside its own.
"""

from collections.abc import Iterator
from dataclasses import replace

from fret_monitor.bag.observers import beside
from fret_monitor.bag.waits import WaitLanes
from fret_monitor.build import Reading
from fret_monitor.elaboration.durations import TimeScale
from fret_monitor.elaboration.fretish import has_deadline, required_so_far
from fret_monitor.elaboration.signals import FindMessage
from fret_monitor.explain.goals import begin_of, sentences_of, with_texts, written
from fret_monitor.explain.report import meanings
from fret_monitor.language.sentence import Sentence
from fret_monitor.logic.formula import Formula, variables
from fret_monitor.logic.propositions import untriggered
from fret_monitor.logic.specification import Property, Specification
from fret_monitor.model.policies import Report, Stale


def with_lanes(reading: Reading, find: FindMessage) -> Reading:
    """Return two requirements for each sentence with a deadline (`WaitLanes`), in a bundle."""
    return _instead(reading, tuple(_deadlines(reading, find)))


def with_denials(reading: Reading, find: FindMessage) -> Reading:
    """Return requirements that are violated where those of a bundle are triggered."""
    known = meanings(reading, find)
    denials = [(item, known[item.id].denial or untriggered(item))
               for item in reading.specification.properties]
    return _instead(reading, tuple(
        replace(beside(denial, item, reading.specification), report=Report.OCCURRENCE,
                on_violation=(), on_end=(), horizon=0, probability=None)
        for item, denial in denials if denial is not None and variables(denial)))


def _instead(reading: Reading, properties: tuple[Property, ...]) -> Reading:
    """Return a bundle with other requirements, which only observe."""
    # A trigger or a response counts as it came, also while an input is silent.
    specification = reading.specification
    return replace(reading, specification=replace(
        specification, properties=properties, actions=(), gates=(), has_margins=False,
        signals=tuple(replace(item, stale=Stale.WARN) for item in specification.signals)))


def _deadlines(reading: Reading, find: FindMessage) -> Iterator[Property]:
    """Yield the requirements beside those with a deadline."""
    bundle, specification = reading.bundle, reading.specification
    if bundle is None:
        return
    items = {item.id: item for item in specification.properties}
    sentences = {name: sentence for name, sentence in sentences_of(bundle, items).items()
                 if has_deadline(sentence)}
    scale = TimeScale(specification.policy, specification.period, specification.unit)
    found = with_texts(bundle, [
        (item, text) for item in bundle.requirements if item.id.value in sentences
        for text in _lane_texts(sentences[item.id.value])], find)
    for number, (waits, at_once) in enumerate(zip(found[::2], found[1::2], strict=True)):
        item, timing = items[waits.id], sentences[waits.id].timing
        assert timing is not None and timing.duration is not None
        lanes = WaitLanes(item.id, scale.timing(timing.duration))
        yield _lane(lanes.waits, f'waits_{number}', waits, required_so_far(waits.formula), item,
                    specification)
        yield _lane(lanes.at_once, f'at_once_{number}', at_once, at_once.formula, item,
                    specification)


def _lane_texts(sentence: Sentence) -> Iterator[str]:
    """Yield sentences that are violated while a response is missing, and where it is there."""
    start, name = begin_of(sentence), sentence.component.name
    response = written(sentence.response.span)
    # An `only` scope requires the negation of the sentence.
    some_time = 'always' if sentence.scope_kind.is_only else 'eventually'
    yield f'{start} {name} shall {some_time} satisfy ({response})'
    yield f'{start} {name} shall immediately satisfy !({response})'


def _lane(name: str, handler: str, meant: Property, formula: Formula, item: Property,
          specification: Specification) -> Property:
    """Return a requirement with a formula that steps together with another one."""
    lane = beside(formula, replace(item, feedback=meant.feedback), specification)
    return replace(lane, id=name, handler=handler, report=Report.ONSET, on_violation=(),
                   on_end=())
