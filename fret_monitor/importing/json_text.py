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
JSON as other tools wrote it: read with the place of what is wrong, and looked into with care.

What is missing or of another shape than expected is None or empty here: exports differ from
version to version, and the readers say what they cannot do without.
"""

import json
from typing import NoReturn

from fret_monitor.model.diagnostics import refuse, Source, Span

Json = dict[str, object] | list[object] | str | int | float | bool | None

_MOST_DIGITS = 1000


def read_json(source: Source) -> object:
    """
    Return what a JSON text holds.

    Raises
    ------
    CompileError
        if it is no JSON, with the place; if it is nested too deeply.
    """
    try:
        found: object = json.loads(source.text, parse_constant=_no_constant, parse_int=_whole)
        return found
    except json.JSONDecodeError as error:
        place = min(error.pos, len(source.text))
        refuse('this is not JSON', Span(source, place, place + 1), _label(error.msg))
    except _NoNumber as error:
        refuse(f'this is not JSON: {error} is no number of it', Span(source, 0, 1))
    except RecursionError:
        refuse('this JSON is nested too deeply', Span(source, 0, 1), 'begins here')


class _NoNumber(Exception):
    """NaN or an infinity, which Python's reader takes and JSON does not have."""


def _no_constant(text: str) -> NoReturn:
    raise _NoNumber(text)


def _whole(text: str) -> int | float:
    return int(text) if len(text) < _MOST_DIGITS else float('inf')


def _label(message: str) -> str:
    return message[:1].lower() + message[1:]


def mapping(value: object) -> dict[str, object]:
    """Return a value that is an object, else an empty one."""
    return value if isinstance(value, dict) else {}


def items(value: object) -> list[dict[str, object]]:
    """Return those items of a list that are objects."""
    return [item for item in value if isinstance(item, dict)] if isinstance(value, list) else []


def text(item: dict[str, object], *keys: str) -> str:
    """Return the first text under one of the keys that is not blank, else an empty one."""
    for key in keys:
        value = item.get(key)
        if isinstance(value, str) and value.strip():
            return clean(value).strip()
    return ''


def names(value: object) -> list[str]:
    """Return the texts in a list, or in a list's only item."""
    return [clean(item) for item in value if isinstance(item, str)] if (
        isinstance(value, list)) else []


def clean(value: str) -> str:
    """Replace what no file in UTF-8 holds: halves of characters that JSON can escape."""
    return value.encode('utf-8', 'replace').decode('utf-8')
