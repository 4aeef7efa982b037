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

"""Each character of a YAML scalar has its place in the file."""

import tracemalloc

from fret_monitor.bundle import yaml_tree
from fret_monitor.bundle.yaml_text import scalar_text
from fret_monitor.bundle.yaml_tree import read_tree, YamlMapping, YamlScalar
from fret_monitor.model.diagnostics import Problems, Source, Text
from hypothesis import assume, given, settings, strategies
import pytest
import yaml

_HEADS = (
    'a: ', 'a: >-\n  ', 'a: >\n  ', 'a: |\n  ', 'a: |+\n   ', '- - >2-\n    ', 'a: "', "a: '",
    'a: >1\n  ', 'a:\n b: |2\n    ', 'é: [{a: ', '- # c\n - ', 'k: >- # c\n\n     ',
)
_PIECES = (
    'a', 'bc', ' ', '  ', '\n', '\n  ', '\n    ', '\n\n', '\t', '\\n', '\\x41', '\\u00e9', '\\"',
    '\\\n', '\\\n   ', "''", 'é', '𝄞', '\r\n  ', '#', ' # c', '\u2028', '\x85  ', ':', 'x & y',
    '\n  - ', '\\\\', 'O[0,2]',
)
_TAILS = ('', '"', "'", '\n', '"\n', '\n\nb: c\n', '"}]\n', "'\r\nb: 'c'")
# In one order in every process: pytest-xdist compares what its workers collect.
_LOADERS = tuple(dict.fromkeys([yaml.SafeLoader, getattr(yaml, 'CSafeLoader', yaml.SafeLoader)]))


def _scalars(text: str, loader: type) -> list[tuple[yaml.ScalarEvent, Text]]:
    found = []
    try:
        for event in yaml.parse(text, Loader=loader):
            if isinstance(event, yaml.ScalarEvent) and event.start_mark and not event.tag:
                style = event.style if event.style and event.style in '\'"|>' else ''
                found.append((event, scalar_text(
                    Source('x', text), event.start_mark.index, event.value, style)))
    except yaml.YAMLError:
        assume(False)
    return found


@pytest.mark.parametrize('loader', _LOADERS)
@given(head=strategies.sampled_from(_HEADS),
       middle=strategies.lists(strategies.sampled_from(_PIECES), max_size=14),
       tail=strategies.sampled_from(_TAILS))
@settings(max_examples=3 * settings().max_examples)
def test_a_character_stands_where_its_place_says(
        loader: type, head: str, middle: list[str], tail: str) -> None:
    text = head + ''.join(middle) + tail
    for event, found in _scalars(text, loader):
        places = list(found.offsets)
        assert len(places) == len(event.value) + 1
        assert places == sorted(places)
        for char, place in zip(event.value, places) if event.value.strip() else ():
            there = text[place:place + 1]
            is_escape = event.style == '"' and there == '\\'
            assert is_escape or there == char or char.isspace() and (
                not there or there.isspace())
        assert len(event.value.strip()) < 2 or len(set(places)) > 1


@pytest.mark.parametrize(('text', 'word', 'line', 'column'), [
    ('a: one two', 'two', 1, 8),
    ('a: "one\\ttwo"', 'two', 1, 10),
    ('a: "one \\\n   two"', 'two', 2, 4),
    ("a: 'it''s two'", 'two', 1, 11),
    ("a: 'it''s two'", "'s", 1, 7),
    ('a: one\n  two', 'two', 2, 3),
    ('a: >-\n  one\n  two', 'two', 3, 3),
    ('a: >-\n\n   one\n   two', 'two', 4, 4),
    ('a: >\r\n  one\r\n  two\r\n', 'two', 3, 3),
    ('a: >4-\n     one\n     two', 'two', 3, 6),
    ('a: |\n  one\n    two', 'two', 3, 5),
    ('\ufeffa: >-\n  𝄞é one\n  é two', 'two', 3, 5),
    ('\ufeffa: two', 'two', 1, 5),
])
def test_a_word_is_found_at_its_line_and_column(
        text: str, word: str, line: int, column: int) -> None:
    problems = Problems()
    tree = read_tree(Source('x', text), problems)
    assert not problems.errors
    assert isinstance(tree, YamlMapping)
    value = tree.entries[0][1]
    assert isinstance(value, YamlScalar)
    at = value.value.index(word)
    span = value.text.at(at, at + len(word))
    assert (span.line, span.column) == (line, column)


@pytest.mark.parametrize(('style', 'piece', 'most'), [
    ('"', 'some words ', 2), ("'", 'x', 2), ('"', 'a\\tb ', 30)])
def test_places_take_little_memory(style: str, piece: str, most: int) -> None:
    text = style + piece * (300_000 // len(piece)) + style
    value = yaml.load(text, Loader=_LOADERS[-1])
    tracemalloc.start()
    try:
        found = scalar_text(Source('x', text), 0, value, style)
        assert tracemalloc.get_traced_memory()[1] < most * len(text)
    finally:
        tracemalloc.stop()
    assert len(found.offsets) == len(value) + 1


def test_both_loaders_of_pyyaml_give_the_same_tree(monkeypatch: pytest.MonkeyPatch) -> None:
    text = '\ufeffé: >-\n  a\n  𝄞 b\nc: [x, "y\\n", {z: \'w\'}]\nd:\n- |\n  k\n'
    shown = []
    for loader in _LOADERS:
        monkeypatch.setattr(yaml_tree, '_Loader', loader)
        shown.append(_shown(read_tree(Source('x', text), Problems())))
    assert len(set(shown)) == 1
    assert "'a 𝄞 b' 9" in shown[0]


def _shown(node: yaml_tree.Node | None) -> str:
    match node:
        case YamlMapping():
            return ', '.join(f'{_shown(key)}: {_shown(value)}' for key, value in node.entries)
        case yaml_tree.YamlList():
            return ', '.join(_shown(item) for item in node.items)
        case YamlScalar():
            return f'{node.value!r} {node.text.offsets[0]} {node.style} {node.span.start}'
        case _:
            return repr(node)
