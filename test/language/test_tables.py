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

"""The tables of the parsers are those of the grammars."""

from fret_monitor.language.tables import read_tables
import pytest
from tools.parser_tables import LANGUAGE, STARTS, tables_text


@pytest.mark.parametrize('grammar', sorted(STARTS))
def test_the_tables_are_those_of_the_grammar(grammar: str) -> None:
    pytest.importorskip('lark')
    file = LANGUAGE / f'{grammar}.json'
    assert tables_text(grammar) == file.read_text(encoding='utf-8'), (
        'run: python3 tools/parser_tables.py')


@pytest.mark.parametrize('grammar', sorted(STARTS))
def test_every_method_of_a_rule_is_one_of_the_builder(grammar: str) -> None:
    from fret_monitor.language import cocospec, fretish, smv
    builder = {'cocospec': cocospec, 'fretish': fretish, 'smv': smv}[grammar]._SYNTAX.builder
    methods = {rule.method for rule in read_tables(grammar).rules} - {None}
    assert [method for method in methods if not hasattr(builder, str(method))] == []
