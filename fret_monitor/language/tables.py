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
The LALR tables of the grammars, in JSON files beside them, and a parser that uses them.

lark makes the tables when a grammar changes (`tools/parser_tables.py`), not in each process that
reads a formula: that was a third of the time of `fret-monitor check`.
"""

from dataclasses import dataclass
from functools import cache
from importlib.resources import files
import json
from typing import Any

END = '$END'


@dataclass(frozen=True)
class Rule:
    """A rule of a grammar; `method` of the builder makes a tree of the parts, if it has one."""

    origin: str
    parts: tuple[str, ...]
    method: str | None

    @property
    def is_repetition(self) -> bool:
        """Return whether its parts are parts of the rule around it, as those of `(...)*`."""
        return self.origin.startswith('_')


@dataclass(frozen=True)
class Tables:
    """
    What an LALR parser does in each state, by the kind of the next lexeme or the rule just read.

    A number from 0 on is the next state; ~n says that rule n is complete. `starts` has the first
    and the last state of each kind of text.
    """

    starts: dict[str, tuple[int, int]]
    rules: tuple[Rule, ...]
    states: tuple[dict[str, int], ...]


class UnexpectedLexemeError(Exception):
    """A lexeme that fits nowhere here; `expected` are the kinds in the table of the state."""

    def __init__(self, expected: frozenset[str]) -> None:
        """Take the kinds of lexemes."""
        super().__init__()
        self.expected = expected


@cache
def read_tables(grammar: str) -> Tables:
    """Return the tables of a grammar."""
    content = json.loads(
        files(__package__).joinpath(f'{grammar}.json').read_text(encoding='utf-8'))
    return Tables(
        {name: (first, last) for name, (first, last) in content['starts'].items()},
        tuple(Rule(origin, tuple(parts.split()), method)
              for origin, parts, method in content['rules']),
        tuple(content['states']))


class Parser:
    """Reads lexemes one by one; the methods of a builder make trees of what has been read."""

    def __init__(self, tables: Tables, start: str, builder: Any) -> None:
        """Begin a text of the kind `start`."""
        first, self._last = tables.starts[start]
        self._tables = tables
        self._builder = builder
        self._states = [first]
        self._values: list[Any] = []

    def feed(self, lexeme: Any) -> Any:
        """Read a lexeme; after `END`, return the tree. Raises `UnexpectedLexemeError`."""
        while True:
            actions = self._tables.states[self._states[-1]]
            action = actions.get(lexeme.type)
            if action is None:
                raise UnexpectedLexemeError(frozenset(filter(str.isupper, actions)))
            if action >= 0:
                self._states.append(action)
                self._values.append(lexeme)
                return None
            self._reduce(self._tables.rules[~action])
            if lexeme.type == END and self._states[-1] == self._last:
                return self._values[-1]

    def _reduce(self, rule: Rule) -> None:
        begin = len(self._values) - len(rule.parts)
        parts: list[Any] = []
        for name, value in zip(rule.parts, self._values[begin:], strict=True):
            if not name.startswith('_'):
                parts.append(value)
            elif parts:
                parts += value
            else:
                parts = value  # not copied, so that long repetitions take linear time
        del self._values[begin:], self._states[begin + 1:]
        self._states.append(self._tables.states[self._states[-1]][rule.origin])
        if rule.method is not None:
            self._values.append(getattr(self._builder, rule.method)(parts))
        else:
            self._values.append(parts if rule.is_repetition else parts[0])

    def fitting(self) -> frozenset[str]:
        """
        Return the kinds of lexemes, including `END`, that may come next.

        LALR tables merge states and allow too many, so each kind is tried on the stack of states.
        """
        return frozenset(kind for kind in self._tables.states[self._states[-1]]
                         if kind.isupper() and self._is_shifted(kind))

    def _is_shifted(self, kind: str) -> bool:
        states, stack = self._tables.states, list(self._states)
        while (action := states[stack[-1]].get(kind)) is not None:
            if action >= 0:
                return True
            rule = self._tables.rules[~action]
            del stack[len(stack) - len(rule.parts):]
            stack.append(states[stack[-1]][rule.origin])
        return kind == END and stack[-1] == self._last
