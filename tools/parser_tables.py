#!/usr/bin/env python3
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
Write the LALR tables of the grammars in fret_monitor/language; run it after a grammar has changed.

    python3 tools/parser_tables.py

It needs lark (0.12 or 1.x). Never install it over the `lark-parser` of ROS 2, but elsewhere with
`pip install --target`, as test/language/test_tables.py does.

`fret_monitor.language.tables` explains the files.
"""

from collections.abc import Sequence
import json
from pathlib import Path
from typing import Any
import warnings

LANGUAGE = Path(__file__).resolve().parent.parent / 'fret_monitor' / 'language'
STARTS = {
    'cocospec': ('formula', 'program'),
    'fretish': ('sentence', 'definition'),
    'smv': ('start',),
}


def tables_text(grammar: str) -> str:
    """Return the text of the JSON file of a grammar: a line for each rule and each state."""
    with warnings.catch_warnings():
        # lark 0.12 imports two modules that Python 3.11 and later call deprecated.
        warnings.filterwarnings('ignore', r"module 'sre_", DeprecationWarning)
        from lark import Lark
    from lark.parsers.lalr_analysis import Reduce
    text = (LANGUAGE / f'{grammar}.lark').read_text(encoding='utf-8')
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


def main() -> None:
    """Write the tables of each grammar."""
    for grammar in STARTS:
        (LANGUAGE / f'{grammar}.json').write_text(tables_text(grammar), encoding='utf-8')


if __name__ == '__main__':
    main()
