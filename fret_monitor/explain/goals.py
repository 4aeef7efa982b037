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
Goals of examples for FRETish sentences: events that make an example nontrivial.

The trigger should occur within the scope, and the response and the stop condition after it. Each
goal is the negation of a FRETish sentence: the trigger has occurred if the sentence with the same
scope and condition and with "immediately satisfy FALSE" is violated.
"""

from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import replace

from fret_monitor.bundle.bundle import Bundle, Language, Requirement
from fret_monitor.elaboration.elaborate import specify
from fret_monitor.elaboration.signals import FindMessage
from fret_monitor.language.fretish import parse_fretish
from fret_monitor.language.sentence import Sentence, TimingKind
from fret_monitor.logic.formula import Formula, Unary, UnaryOperator
from fret_monitor.logic.specification import Property
from fret_monitor.model.diagnostics import CompileError, Problems, Source, Span, Text


def goals(bundle: Bundle, sentences: Mapping[str, Sentence],
          find_message: FindMessage | None = None) -> dict[str, list[Formula]]:
    """Return, by id, the formulas that an example should make true; the trigger comes first."""
    wanted = [(item, text) for item in bundle.requirements if item.id.value in sentences
              for text in _denials(sentences[item.id.value])]
    found: dict[str, list[Formula]] = {item.id.value: [] for item, _ in wanted}
    for (item, _), denial in zip(
            wanted, with_texts(bundle, wanted, find_message), strict=False):
        found[item.id.value].append(Unary(UnaryOperator.NOT, denial.formula))
    return found


def sentences_of(bundle: Bundle, chosen: Container[str]) -> dict[str, Sentence]:
    """Return the FRETish sentences among the requirements with these ids."""
    return {item.id.value: parse_fretish(on_one_line(item.text)) for item in bundle.requirements
            if item.language is Language.FRETISH and item.id.value in chosen}


def on_one_line(text: Text) -> Text:
    """Return a text without its line breaks."""
    return Text.whole(Source('<sentence>', ' '.join(text.value.split())))


def with_texts(bundle: Bundle, wanted: Sequence[tuple[Requirement, str]],
               find_message: FindMessage | None) -> Sequence[Property]:
    """Return what requirements mean with other texts; nothing if one of them has a mistake."""
    requirements = tuple(replace(item, text=Text.whole(Source('<goal>', text)))
                         for item, text in wanted)
    try:
        meant, _ = specify(replace(bundle, requirements=requirements), find_message,
                           problems=Problems())
    except CompileError:
        return ()  # examples without goals are better than an error
    return meant.properties


def _denials(sentence: Sentence) -> Iterator[str]:
    """Yield sentences that are violated once a relevant event occurs."""
    stop = sentence.timing.stop if sentence.timing else None
    if not (sentence.scope or sentence.condition or stop):
        return
    is_only = sentence.scope_kind.is_only
    component, start = sentence.component.name, begin_of(sentence)
    # An `only` scope applies outside of its mode, with the negated response.
    yield f'{start} {component} shall immediately satisfy {"TRUE" if is_only else "FALSE"}'
    if stop is not None:
        never = 'eventually' if is_only else 'never'
        yield f'{start} {component} shall {never} satisfy ({written(stop.span)})'
    if is_only:
        yield f'{component} shall never satisfy ({written(sentence.response.span)})'
    elif sentence.timing_kind is not TimingKind.NEVER:
        yield f'{start} {component} shall never satisfy ({written(sentence.response.span)})'


def begin_of(sentence: Sentence) -> str:
    """Return the text of the scope and the condition."""
    return ' '.join(written(part.span) for part in (sentence.scope, sentence.condition) if part)


def written(span: Span) -> str:
    """Return the text of a part of a sentence."""
    return span.source.text[span.start:span.end]
