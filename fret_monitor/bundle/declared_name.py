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

"""The name of an input, constant or definition, as formulas write it."""

from dataclasses import dataclass

from fret_monitor.bundle.yaml_tree import YamlScalar
from fret_monitor.model.diagnostics import Span, Text


@dataclass(frozen=True, eq=False)
class DeclaredName:
    """
    A declared name.

    The key of a quoted name of FRET includes the quotes: `"hello world"`.
    """

    text: Text
    key: YamlScalar
    is_quoted: bool

    @property
    def value(self) -> str:
        return self.text.value

    @property
    def span(self) -> Span:
        return self.key.span


def declared_name(key: YamlScalar) -> DeclaredName:
    value = key.value
    if len(value) < 2 or not value.startswith('"') or not value.endswith('"'):
        return DeclaredName(key.text, key, False)
    inner = Text(value[1:-1], key.text.source, key.text.offsets[1:len(value)])
    return DeclaredName(inner, key, True)
