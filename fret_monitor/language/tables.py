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

Making the tables takes a third of the time of `fret-monitor check`, so lark makes them here, and
whoever reads a formula needs no lark. Run this after a grammar has changed:

    python3 -m fret_monitor.language.tables
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
import json
from pathlib import Path
from typing import Any
import warnings

END = '$END'
STARTS = {
    'cocospec': ('formula', 'program'),
    'fretish': ('sentence', 'definition'),
    'smv': ('start',),
}


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
    content = json.loads(_place(grammar).read_text(encoding='utf-8'))
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
                         if kind.lstrip('$').isupper() and self._is_shifted(kind))

    def _is_shifted(self, kind: str) -> bool:
        states, stack = self._tables.states, list(self._states)
        while (action := states[stack[-1]].get(kind)) is not None:
            if action >= 0:
                return True
            rule = self._tables.rules[~action]
            del stack[len(stack) - len(rule.parts):]
            stack.append(states[stack[-1]][rule.origin])
        return kind == END and stack[-1] == self._last


# -- making the tables ----------------------------------------------------------------------------


def tables_text(grammar: str) -> str:
    """Return the text of the JSON file of a grammar: a line for each rule and each state."""
    with warnings.catch_warnings():
        # lark 0.12 imports two modules that Python 3.11 and later call deprecated.
        warnings.filterwarnings('ignore', r"module 'sre_", DeprecationWarning)
        from lark import Lark
    from lark.parsers.lalr_analysis import Reduce
    text = files(__package__).joinpath(f'{grammar}.lark').read_text(encoding='utf-8')
    lark = Lark(text, parser='lalr', lexer='contextual', start=list(STARTS[grammar]),
                maybe_placeholders=False)
    table = lark.parse_interactive('', STARTS[grammar][0]).parser_state.parse_conf.parse_table
    # lark numbers the states in another order each time.
    order = [table.start_states[start] for start in STARTS[grammar]]
    for state in order:
        for _, (action, target) in sorted(table.states[state].items(), key=lambda item: item[0]):
            if action is not Reduce and target not in order:
                order.append(target)
    rules = sorted({_written(target) for state in order
                    for action, target in table.states[state].values() if action is Reduce})
    starts = {start: [order.index(table.start_states[start]), order.index(table.end_states[start])]
              for start in STARTS[grammar]}
    states = [{kind: ~rules.index(_written(target)) if action is Reduce else order.index(target)
               for kind, (action, target) in sorted(table.states[state].items())}
              for state in order]
    return (f'{{"starts": {json.dumps(starts)},\n"rules": [\n{_lines(rules)}],\n'
            f'"states": [\n{_lines(states)}]}}\n')


def _written(rule: Any) -> tuple[str, str, str | None]:
    """Return a rule of lark as the file has it: without a method if lark makes no tree of it."""
    origin = rule.origin.name
    is_plain = origin.startswith('_') or (rule.options.expand1 and not rule.alias)
    return (origin, ' '.join(part.name for part in rule.expansion),
            None if is_plain else rule.alias or origin)


def _lines(items: Sequence[Any]) -> str:
    return ',\n'.join(map(json.dumps, items))


def _place(grammar: str) -> Any:
    return files(__package__).joinpath(f'{grammar}.json')


if __name__ == '__main__':
    for name in STARTS:
        Path(str(_place(name))).write_text(tables_text(name), encoding='utf-8')
