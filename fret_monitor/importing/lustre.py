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
Parse Lustre files of FRET: contracts with local variables, guarantees and modes; or properties.

A contract is a comment (`(*@contract NAME (...) returns (...); let ... tel *)`) or, in Kind 2,
`contract NAME ...`. Each guarantee and each assumption is a requirement; the comment before it
contains FRET's sentence. An `ensure` of a mode is required while the mode holds. The nodes of
FRET's library (H, O, S ...) in the same file are skipped, because `cocospec` has these operators.

For JKind, which checks realizability, FRET writes a node in place of a contract: its equations are
the requirements (`--%PROPERTY NAME;`) and the local variables, and of its inputs those are outputs
that `--%REALIZABLE` does not list. An `assert` is an assumption.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise
import re
from typing import NoReturn

from fret_monitor.bundle.bundle import Language
from fret_monitor.importing.component import (
    ComponentRequirement, ComponentVariable, ImportedComponent, VariableRole, Wording,
)
from fret_monitor.importing.fret import component_name
from fret_monitor.importing.lustre_calls import CalledNode, without_calls
from fret_monitor.model.diagnostics import CompileError, Problems, refuse, Source, Span

_TOKEN = re.compile(
    r'(?P<BLANK>\s+)|(?P<OPEN>\(\*@contract\b)|(?P<MARK>--%[A-Z]+)|(?P<LINE>--[^\n]*)'
    r'|(?P<COMMENT>\(\*.*?\*\)|/\*.*?\*/)|(?P<CLOSE>\*\))|(?P<STRING>"[^"\n]*")'
    r'|(?P<NAME>[A-Za-z_$][A-Za-z0-9_$]*)|(?P<SIGN>.)', re.DOTALL)
_CONTRACT = re.compile(r'\(\*@contract\b|^\s*contract\s+\w+\s*\(', re.MULTILINE)
_SENTENCE = re.compile(r'\(\*\s*Req text:(.*)\*\)', re.DOTALL)
_STRUCTURE = re.compile(r'^[ \t]*type\s+(\w+)\s*=\s*struct\s*\{([^{}]*)\}', re.MULTILINE)
_FIELD = re.compile(r'(\w+)\s*:\s*(\w+)')
_PATH = re.compile(r'[A-Za-z_$][\w$]*(?:\.[A-Za-z_$][\w$]*)+', re.ASCII)
_PROPERTIES = ('guarantee', 'assume')
_PROPERTY, _REALIZABLE, _MAIN = '--%PROPERTY', '--%REALIZABLE', '--%MAIN'


def is_lustre(text: str) -> bool:
    """Whether a text contains a contract or a node."""
    return _CONTRACT.search(text) is not None or re.search(
        r'^\s*node\s+\w+\s*\(.*?\)\s*returns\b', text, re.MULTILINE | re.DOTALL) is not None


@dataclass(frozen=True)
class _Token:
    kind: str
    text: str
    start: int
    end: int


@dataclass
class _Contract:
    """A contract during parsing."""

    name: str
    label: str
    variables: list[ComponentVariable] = field(default_factory=list)
    requirements: list[ComponentRequirement] = field(default_factory=list)


def read_lustre(source: Source, file: str, problems: Problems) -> list[ImportedComponent]:
    """
    Return a component for each contract of a file, or else for each node with properties.

    Raises
    ------
    CompileError
        if there is neither, or one cannot be parsed.
    """
    nodes = _NodeReader(source, file, problems)
    found = [*_ContractReader(source, file, problems).contracts()] or [*nodes.nodes()]
    if not found:
        refuse(f"'{file}' has no contract", Span(source, 0, 1), 'nodes, but no requirements',
               'FRET writes one: (*@contract NAME (...) returns (...); let guarantee ... tel *)')
    words = {match[0] for match in _TOKEN.finditer(source.text) if match.lastgroup == 'NAME'}
    return [_with_fields(without_calls(
        ImportedComponent(component_name(item.name, tuple(item.requirements)), '',
                          tuple(item.variables), tuple(item.requirements), (file,)),
        nodes.called, words), source.text) for item in found]


def _with_fields(component: ImportedComponent, text: str) -> ImportedComponent:
    """Return a component with the fields that its formulas read in place of structures."""
    structures = {match[1]: dict(_FIELD.findall(match[2])) for match in _STRUCTURE.finditer(text)}
    whole = {item.name: item for item in component.variables if item.type in structures}
    wordings = (*(one for item in component.requirements for one in item.wordings),
                *(one for item in component.variables for one in item.assignments))
    paths = dict.fromkeys(path for item in wordings for path in _PATH.findall(item.text))
    fields: list[ComponentVariable] = []
    for path in paths:
        first, *names = path.split('.')
        kind = whole[first].type if first in whole else ''
        for name in names:
            kind = structures.get(kind, {}).get(name, '')
        if kind:
            fields.append(replace(whole[first], name=path, type=kind))
    plain = [item for item in component.variables if item.name not in whole]
    return replace(component, variables=(*plain, *fields))


class _ContractReader:
    """Parses the contracts of one file."""

    _what = 'contract'
    _skipped: tuple[str, ...] = ('BLANK', 'LINE', 'MARK')

    def __init__(self, source: Source, file: str, problems: Problems) -> None:
        self._source = source
        self._file = file
        self._problems = problems
        self._tokens = [_Token(str(match.lastgroup), match[0], match.start(), match.end())
                        for match in _TOKEN.finditer(source.text)
                        if match.lastgroup not in self._skipped]
        self._next = 0
        self._comment = ''

    def contracts(self) -> Iterator[_Contract]:
        """Yield all contracts; skip the text between them."""
        while self._next < len(self._tokens):
            token = self._tokens[self._next]
            self._next += 1
            if token.kind == 'OPEN' or token.kind == 'NAME' and token.text == 'contract':
                yield self._contract(token)

    # Tokens

    def _peek(self) -> _Token:
        while self._next < len(self._tokens):
            token = self._tokens[self._next]
            if token.kind != 'COMMENT':
                return token
            self._comment = token.text
            self._next += 1
        end = len(self._source.text)
        return _Token('END', '', end, end)

    def _take(self) -> _Token:
        token = self._peek()
        self._next += 1
        return token

    def _expect(self, *texts: str) -> _Token:
        token = self._take()
        if token.text not in texts:
            self._refuse(token, f'{" or ".join(map(repr, texts))} was expected')
        return token

    def _name(self, what: str) -> str:
        token = self._take()
        if token.kind != 'NAME':
            self._refuse(token, f'{what} was expected')
        return token.text

    def _refuse(self, token: _Token, label: str) -> NoReturn:
        place = min(token.start, max(len(self._source.text) - 1, 0))
        refuse(f'this {self._what} cannot be read',
               Span(self._source, place, max(token.end, place + 1)), label)

    # Contracts

    def _contract(self, opening: _Token) -> _Contract:
        if self._peek().text in (*_PROPERTIES, 'var', 'const', 'mode', 'import', 'weakly'):
            refuse('a contract inside a node is not supported',
                   Span(self._source, opening.start, opening.end), 'it has no name',
                   'write it as FRET does: contract NAME (inputs) returns (outputs); let ... tel')
        name = self._name("the contract's name")
        contract = _Contract(name, f'{self._file}, {name}')
        contract.variables += self._declarations(VariableRole.INPUT)
        self._expect('returns')
        contract.variables += self._declarations(VariableRole.OUTPUT)
        while self._peek().text == ';':
            self._take()
        self._expect('let')
        while self._peek().text != 'tel':
            self._item(contract)
        self._take()
        return contract

    def _declarations(self, role: VariableRole) -> Iterator[ComponentVariable]:
        """Parse `(a, b: real; c: bool;)`."""
        self._expect('(')
        while self._peek().text != ')':
            found = [self._name('a variable')]
            while self._expect(',', ':').text == ',':
                found.append(self._name('a variable'))
            kind = self._name('a type')
            yield from (ComponentVariable(name, role, kind) for name in found)
            if self._peek().text != ')':
                self._expect(';')
        self._take()

    def _item(self, contract: _Contract) -> None:
        token = self._take()
        match token.text:
            case 'var' | 'const':
                self._local(contract)
            case 'guarantee' | 'assume':
                self._property(contract, self._comment, token.text == 'assume')
            case 'weakly':
                self._item(contract)
            case 'mode':
                self._mode(contract)
            case ';':
                pass
            case 'import':
                self._problems.warning(
                    f"'{self._file}': the imported contract is not read",
                    Span(self._source, token.start, token.end), '', 'give that file as well')
                self._expression()
            case _:
                self._refuse(token, "'var', 'guarantee', 'assume', 'mode' or 'tel' was expected")
        self._comment = ''

    def _local(self, contract: _Contract) -> None:
        """Parse `x: real = 2.0;` (the type of a constant is optional)."""
        name = self._name('a variable')
        kind = ''
        if self._expect(':', '=').text == ':':
            kind = self._name('a type')
            self._expect('=')
        wording = Wording((Language.COCOSPEC,), self._expression(), f'{self._file}, {name}')
        contract.variables.append(ComponentVariable(name, VariableRole.INTERNAL, kind, (wording,)))

    def _property(self, contract: _Contract, comment: str, is_assumption: bool) -> None:
        """Parse `"FSM-001" expression;`, and FRET's sentence in the comment before it."""
        name = self._id(f'{contract.name}_{len(contract.requirements) + 1}')
        self._require(contract, name, self._expression(), comment, is_assumption)

    def _require(self, contract: _Contract, name: str, formula: str, comment: str,
                 is_assumption: bool = False) -> None:
        label = f'{self._file}, {name}'
        wordings = [Wording((Language.COCOSPEC,), formula, label)]
        sentence = _SENTENCE.fullmatch(comment)
        if sentence and sentence[1].strip():
            written = ' '.join(sentence[1].split())
            wordings.insert(0, Wording((Language.FRETISH,), written, f'{label}, sentence'))
        contract.requirements.append(ComponentRequirement(
            name, tuple(wordings), is_assumption=is_assumption))

    def _id(self, default: str) -> str:
        return self._take().text[1:-1] if self._peek().kind == 'STRING' else default

    def _mode(self, contract: _Contract) -> None:
        """Parse `name (require p; ensure q; );`: q is required while p holds."""
        name = self._name("the mode's name")
        self._expect('(')
        requires: list[str] = []
        while self._peek().text != ')':
            kind = self._expect('require', 'ensure').text
            given = self._id('')
            if kind == 'require':
                requires.append(self._expression())
            else:
                self._ensured(contract, given or f'{name}_{len(contract.requirements) + 1}',
                              requires, self._expression())
        self._take()
        if self._peek().text == ';':
            self._take()

    def _ensured(self, contract: _Contract, name: str, requires: list[str],
                 ensured: str) -> None:
        mode = ' and '.join(f'({item})' for item in requires) or 'true'
        wording = Wording((Language.COCOSPEC,), f'H(({mode}) => ({ensured}))',
                          f'{self._file}, {name}')
        contract.requirements.append(ComponentRequirement(name, (wording,)))

    def _expression(self) -> str:
        """Consume the tokens up to the next ';' and return the text before it."""
        parts: list[_Token] = []
        while (token := self._take()).text != ';':
            if token.kind in ('END', 'CLOSE') or token.text in ('tel', 'guarantee'):
                self._refuse(token, "';' is missing before this")
            parts.append(token)
        if not parts:
            self._refuse(token, 'there is no expression')
        return self._joined(parts)

    def _joined(self, parts: list[_Token]) -> str:
        """Return the text of tokens on one line, without comments."""
        text = parts[0].text
        for before, part in pairwise(parts):
            text += ('' if before.end == part.start else ' ') + part.text
        return text


@dataclass(frozen=True)
class _Equation:
    """The right side of an equation of a node, an assertion or property; its comment and name."""

    text: str
    comment: str
    name: str = ''


@dataclass
class _NodeDeclaration:
    """A node during parsing; `types` are those of all its names."""

    name: str
    inputs: list[ComponentVariable]
    outputs: list[ComponentVariable]
    types: dict[str, str] = field(default_factory=dict)
    equations: dict[str, _Equation] = field(default_factory=dict)
    assertions: list[_Equation] = field(default_factory=list)
    properties: list[_Equation] = field(default_factory=list)
    realizable: set[str] | None = None


class _NodeReader(_ContractReader):
    """Parses the nodes of one file."""

    _what = 'node'
    _skipped = ('BLANK', 'LINE')

    def __init__(self, source: Source, file: str, problems: Problems) -> None:
        super().__init__(source, file, problems)
        self._starts = [number for number, token in enumerate(self._tokens)
                        if (token.kind, token.text) == ('NAME', 'node')]

    def nodes(self) -> Iterator[_Contract]:
        """Yield the nodes that have properties; skip the others."""
        for start, end in pairwise([*self._starts, len(self._tokens)]):
            if any(token.text == _PROPERTY for token in self._tokens[start:end]):
                self._next = start + 1
                yield self._required(self._node())

    def called(self, name: str) -> CalledNode | None:
        """Return a node that formulas may call: equations of one result, without assertions."""
        self._next = next((start + 1 for start in self._starts
                           if [token.text for token in self._tokens[start + 1:start + 2]]
                           == [name]), -1)
        if self._next < 0:
            return None
        try:
            node = self._node()
        except CompileError:
            return None
        parameters = tuple(item.name for item in node.inputs)
        if len(node.outputs) != 1 or node.assertions or (
                node.types.keys() - {*parameters} != node.equations.keys()):
            return None
        return CalledNode(parameters, node.outputs[0].name, node.types,
                          {key: item.text for key, item in node.equations.items()})

    def _node(self) -> _NodeDeclaration:
        name = self._name("the node's name")
        inputs = [*self._declarations(VariableRole.INPUT)]
        self._expect('returns')
        node = _NodeDeclaration(name, inputs, [*self._declarations(VariableRole.OUTPUT)])
        variables = [*inputs, *node.outputs]
        while (token := self._take()).text != 'let':
            if token.text == 'var':
                variables += self._locals()
            elif token.text != ';':
                self._refuse(token, "'var' or 'let' was expected")
        node.types = {item.name: item.type for item in variables}
        while (token := self._take()).text != 'tel':
            self._statement(node, token)
        return node

    def _locals(self) -> Iterator[ComponentVariable]:
        """Parse `a, b: real; c: bool;` up to the next keyword."""
        while self._peek().text not in ('let', 'var', ';'):
            found = [self._name('a variable')]
            while self._expect(',', ':').text == ',':
                found.append(self._name('a variable'))
            kind = self._name('a type')
            self._expect(';')
            yield from (ComponentVariable(name, VariableRole.INTERNAL, kind) for name in found)

    def _statement(self, node: _NodeDeclaration, token: _Token) -> None:
        """Parse an equation, an assertion, a property, or what `--%REALIZABLE` lists."""
        comment, self._comment = self._comment, ''
        if token.text == _PROPERTY:
            name = self._id('')
            node.properties.append(_Equation(self._expression(), '', name))
        elif token.text == _REALIZABLE:
            node.realizable = {*self._names()}
        elif token.text == 'assert':
            name = self._id('')
            node.assertions.append(_Equation(self._expression(), comment, name))
        elif token.kind == 'NAME':
            self._expect('=')
            node.equations[token.text] = _Equation(self._expression(), comment)
        elif token.text not in (_MAIN, ';'):
            self._refuse(token, "an equation, 'assert' or 'tel' was expected")

    def _names(self) -> Iterator[str]:
        """Parse `a, b;`, or `;` alone."""
        while (token := self._take()).text != ';':
            if token.kind == 'NAME':
                yield token.text
            elif token.text != ',':
                self._refuse(token, "a variable, ',' or ';' was expected")

    def _required(self, node: _NodeDeclaration) -> _Contract:
        """Return the requirements of a node, and as variables the equations that are none."""
        found = _Contract(node.name, f'{self._file}, {node.name}')
        equations = dict(node.equations)
        for item in node.assertions:
            name = item.name or f'{node.name}_{len(found.requirements) + 1}'
            self._require(found, name, item.text, item.comment, is_assumption=True)
        for item in node.properties:
            equation = equations.pop(item.text, item)
            name = item.name or (item.text if item.text.isidentifier() else
                                 f'{node.name}_{len(found.requirements) + 1}')
            self._require(found, name, equation.text, equation.comment)
        found.variables += [
            item if node.realizable is None or item.name in node.realizable
            else replace(item, role=VariableRole.OUTPUT) for item in node.inputs]
        found.variables += [
            ComponentVariable(name, VariableRole.INTERNAL, node.types.get(name, ''), (
                Wording((Language.COCOSPEC,), equation.text, f'{self._file}, {name}'),))
            for name, equation in equations.items() if name != 'FTP']
        return found
