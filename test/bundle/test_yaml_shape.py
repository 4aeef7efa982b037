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

"""The keys of a mapping: what is known, what was meant, what is missing."""

from fret_monitor.bundle.yaml_shape import Shape
from fret_monitor.bundle.yaml_tree import read_tree, YamlMapping
from fret_monitor.model.diagnostics import Problems, Source


def _shape(text: str, **options: dict[str, str]) -> Shape:
    mapping = read_tree(Source('bundle.yaml', text), Problems())
    assert isinstance(mapping, YamlMapping)
    return Shape(mapping, 'a thing', ('id', 'topic'), Problems(), **options)


def test_a_misspelt_key_counts_as_the_one_it_was_meant_to_be() -> None:
    shape = _shape('topc: a')
    assert not shape.lacks('topic')
    assert shape.lacks('id')


def test_a_word_that_is_often_written_instead_counts_as_the_key() -> None:
    shape = _shape('name: a', slips={'name': 'id'})
    assert not shape.lacks('id')
    assert shape.lacks('topic')


def test_a_key_in_the_text_of_a_hint_was_not_meant() -> None:
    shape = _shape('rate: 3', elsewhere={'rate': "write it beside 'topic'"})
    assert shape.lacks('topic')
