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

"""The keys that a place of a bundle may have, and their values, from the schema of a bundle."""

from collections.abc import Iterator, Sequence
from functools import cache

from fret_monitor.bundle.schema import bundle_schema, Schema
from fret_monitor.editing.outline import ITEM

_TRUTHS = ('true', 'false')


def described(path: Sequence[str], is_signals: bool) -> Iterator[str]:
    """Yield the description of the key at the end of a path, if it has one."""
    found = (item.get('description', '') for item in _schemas_at(tuple(path), is_signals))
    yield from dict.fromkeys(filter(None, found))


def keys_at(path: Sequence[str], is_signals: bool) -> dict[str, str]:
    """Return the keys that may stand below a path, each with its description."""
    return {key: inner.get('description', '') for item in _schemas_at(tuple(path), is_signals)
            for key, inner in item.get('properties', {}).items()}


def values_at(path: Sequence[str], is_signals: bool) -> list[str]:
    """Return the values of the key at the end of a path, if they are listed."""
    found: list[str] = []
    for item in _schemas_at(tuple(path), is_signals):
        found += map(str, item.get('enum', ()))
        found += [str(item['const'])] if 'const' in item else []
        found += _TRUTHS if item.get('type') == 'boolean' else ()
    return list(dict.fromkeys(found))


@cache
def _schema() -> Schema:
    return bundle_schema()


@cache
def _schemas_at(path: tuple[str, ...], is_signals: bool) -> tuple[Schema, ...]:
    """Return the schemas that a value at a path may have."""
    found = _alternatives(_schema()['$defs']['signals' if is_signals else 'bundle'])
    for step in path:
        found = [inner for item in found for below in _below(item, step)
                 for inner in _alternatives(below)]
    return tuple(found)


def _below(item: Schema, step: str) -> Iterator[Schema]:
    if step == ITEM:
        inner = item.get('items')
    else:
        inner = item.get('properties', {}).get(step, item.get('additionalProperties'))
    if isinstance(inner, dict):
        yield inner


def _alternatives(item: Schema) -> list[Schema]:
    """Return a schema, and those of which it must satisfy one."""
    return [item, *(inner for way in ('anyOf', 'oneOf') for other in item.get(way, ())
                    for inner in _alternatives(other))]
