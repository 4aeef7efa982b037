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
Parse JSON of other tools with places of errors, and access it without exceptions.

A value that is missing or has an unexpected type reads as empty, because exports differ between
versions. The callers refuse a file that lacks required parts.
"""

import json
from typing import NoReturn

from fret_monitor.model.diagnostics import refuse, Source, Span

_MOST_DIGITS = 1000


def read_json(source: Source) -> object:
    """
    Return the value of a JSON text.

    Raises
    ------
    CompileError
        if the text is not JSON, or is nested too deeply.
    """
    try:
        found: object = json.loads(source.text, parse_constant=_no_constant, parse_int=_whole)
        return found
    except json.JSONDecodeError as error:
        place = min(error.pos, len(source.text))
        refuse('this is not JSON', Span(source, place, place + 1),
               error.msg[:1].lower() + error.msg[1:])
    except _NoNumber as error:
        refuse(f'this is not JSON: {error} is not a number in JSON', Span(source, 0, 1))
    except RecursionError:
        refuse('this JSON is nested too deeply', Span(source, 0, 1), 'begins here')


class _NoNumber(Exception):
    """The text has NaN or an infinity, which Python's parser accepts although JSON does not."""


def _no_constant(text: str) -> NoReturn:
    raise _NoNumber(text)


def _whole(text: str) -> int | float:
    return int(text) if len(text) < _MOST_DIGITS else float('inf')


def mapping(value: object) -> dict[str, object]:
    """Return a value if it is an object, else an empty object."""
    return value if isinstance(value, dict) else {}


def items(value: object) -> list[dict[str, object]]:
    """Return the objects in a list; none if the value is not a list."""
    return [item for item in value if isinstance(item, dict)] if isinstance(value, list) else []


def text(item: dict[str, object], *keys: str) -> str:
    """Return the first non-blank text under one of the keys, or ''."""
    for key in keys:
        value = item.get(key)
        if isinstance(value, str) and value.strip():
            return clean(value).strip()
    return ''


def names(value: object) -> list[str]:
    """Return the texts in a list; none if the value is not a list."""
    return [clean(item) for item in value if isinstance(item, str)] if (
        isinstance(value, list)) else []


def clean(value: str) -> str:
    """Replace lone surrogates, which JSON can escape and UTF-8 cannot encode."""
    return value.encode('utf-8', 'replace').decode('utf-8')
