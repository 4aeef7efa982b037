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
Mutants of hand-written C and Python: one operator, number, condition or statement is changed.

`changes` finds the places in a text and `sample` chooses among them. Whether a mutant is chosen
depends on its own line only, so that an edit elsewhere in a file leaves the sample as it is.
Nothing of `fret_monitor` is imported: `mutation` imports a changed copy of it.
"""

import ast
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path
import re

OPERATORS = {'&': '|', '|': '&', '^': '&', '==': '!=', '!=': '==', '<': '<=', '<=': '<',
             '>': '>=', '>=': '>', '+': '-', '-': '+', '*': '+', '/': '*', '<<': '>>',
             '>>': '<<', '&&': '||', '||': '&&'}


@dataclass(frozen=True)
class SourceMutant:
    """A change of one place: the text from `start` to `end` of a file is replaced by `new`."""

    path: str
    line: int
    start: int
    end: int
    new: str
    before: str
    """The line as it is, without indentation."""
    after: str
    """The line as it becomes."""
    number: int = 0
    """The place among those of the file with the same two lines."""
    place: str = ''
    """What stands for the folder in the key; empty: the folder itself."""

    @property
    def key(self) -> str:
        """Return what names the mutant although its file changes elsewhere, or moves."""
        number = f' #{self.number}' if self.number else ''
        path = f'{self.place}/{Path(self.path).name}' if self.place else self.path
        return f'{path}: {self.before} => {self.after}{number}'

    def applied(self, text: str) -> str:
        """Return the file's text with the change."""
        return text[:self.start] + self.new + text[self.end:]


def changes(path: str, text: str) -> list[SourceMutant]:
    """Return every mutant of a C or Python file, in the order of the file."""
    found = _python(text) if path.endswith('.py') else _c(text)
    seen: Counter[str] = Counter()
    mutants = []
    for start, end, new in sorted(set(found)):
        mutant = _mutant(path, text, start, end, new)
        mutants.append(replace(mutant, number=seen[mutant.key]))
        seen[mutant.key] += 1
    return mutants


def sample(mutants: Iterable[SourceMutant], count: int, seed: str = '') -> list[SourceMutant]:
    """Return `count` mutants; the same for the same lines and seed."""
    return sorted(mutants, key=lambda item: sha256(f'{seed}{item.key}'.encode()).digest())[:count]


def _mutant(path: str, text: str, start: int, end: int, new: str) -> SourceMutant:
    first = text.rfind('\n', 0, start) + 1
    last = text.find('\n', end)
    before = ' '.join(text[first:last].split())
    after = ' '.join((text[first:start] + new + text[end:last]).split())
    return SourceMutant(path, text.count('\n', 0, start) + 1, start, end, new, before, after)


def _others(value: int) -> set[int]:
    """Return the numbers beside one; a greater one is a limit or a time that somebody chose."""
    return {value + 1, value - 1} - {-1} if value < 64 else set()


# ---- C -----------------------------------------------------------------------------------------

_Place = tuple[int, int, str]
_NO_CODE = re.compile(
    r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\])+\'|^[ \t]*#(?:\\\n|[^\n])*',
    re.DOTALL | re.MULTILINE)
# `*` and `&` with spaces around them are declarations as often as operators.
_BINARY = re.compile(r'(?<= )(==|!=|<=|>=|<|>|\+|-|/|<<|>>|&&|\|\||&|\|)(?=[ \n])')
_WITHOUT_ONE = re.compile(r' [+-] 1\b(?![.\w])')
_NOT = re.compile(r'!(?=[\w(])')
_NUMBER = re.compile(r'(?<![\w.])(\d+)([uUlL]*)(?![\w.])')
_TRUTH = re.compile(r'\b(true|false)\b')
_CONDITION = re.compile(r'\b(?:if|while) \(')
_STATEMENT = re.compile(
    r'^[ ]+((?!return|else|if|for|while|do|switch|case|const|struct|static|goto|typedef)'
    r'(?:\(void\))?\w[\w.\[\]>*-]*(?: (?:[-+|&]?=) [^\n]*|\([^\n]*\))?;)$|^[ ]+(\*?\w[\w.\[\]>-]*'
    r' (?:[-+|&]?=) [^\n]*;)$', re.MULTILINE)
_SIZE = re.compile(r'\w\[[^\]]*\];|_Static_assert|\benum\b|= *\d+,\s*$')


def _c(text: str) -> Iterator[_Place]:
    code = _NO_CODE.sub(lambda found: re.sub(r'[^\n]', ' ', found[0]), text)
    for found in _BINARY.finditer(code):
        yield found.start(), found.end(), OPERATORS[found[0]]
    for found in _WITHOUT_ONE.finditer(code):
        yield found.start(), found.end(), ''
    for found in _NOT.finditer(code):
        yield found.start(), found.end(), ''
    for found in _TRUTH.finditer(code):
        yield found.start(), found.end(), 'false' if found[0] == 'true' else 'true'
    for found in _NUMBER.finditer(code):
        if not _SIZE.search(_line(code, found.start())):
            for value in _others(int(found[1])):
                yield found.start(), found.end(), f'{value}{found[2]}'
    for found in _CONDITION.finditer(code):
        end = _closing(code, found.end() - 1)
        yield found.end(), end, f'!({text[found.end():end]})'
    for found in _STATEMENT.finditer(code):
        place = 1 if found[1] else 2
        yield found.start(place), found.end(place), ';'


def _line(text: str, place: int) -> str:
    return text[text.rfind('\n', 0, place) + 1:text.find('\n', place)]


def _closing(code: str, opening: int) -> int:
    depth = 0
    for place in range(opening, len(code)):
        depth += {'(': 1, ')': -1}.get(code[place], 0)
        if depth == 0:
            return place
    raise ValueError('a parenthesis is not closed')


# ---- Python ------------------------------------------------------------------------------------

_COMPARISONS: dict[type[ast.cmpop], tuple[str, str]] = {
    ast.Eq: ('==', '!='), ast.NotEq: ('!=', '=='), ast.Lt: ('<', '<='), ast.LtE: ('<=', '<'),
    ast.Gt: ('>', '>='), ast.GtE: ('>=', '>'), ast.Is: ('is', 'is not'),
    ast.IsNot: ('is not', 'is'), ast.In: ('in', 'not in'), ast.NotIn: ('not in', 'in')}


class _Text:
    """The text of a file by the places of its syntax tree, which count bytes in a line."""

    def __init__(self, text: str) -> None:
        self.text = text
        self._lines = text.split('\n')
        self._starts = [0]
        for line in self._lines:
            self._starts.append(self._starts[-1] + len(line) + 1)

    def start(self, node: ast.expr | ast.stmt) -> int:
        return self._place(node.lineno, node.col_offset)

    def end(self, node: ast.expr | ast.stmt) -> int:
        assert node.end_lineno is not None and node.end_col_offset is not None
        return self._place(node.end_lineno, node.end_col_offset)

    def of(self, node: ast.expr | ast.stmt) -> str:
        return self.text[self.start(node):self.end(node)]

    def _place(self, line: int, column: int) -> int:
        before = self._lines[line - 1].encode()[:column].decode()
        return self._starts[line - 1] + len(before)


def _python(text: str) -> Iterator[_Place]:
    places = _Text(text)
    for node in _evaluated(ast.parse(text)):
        match node:
            case ast.Compare():
                for left, comparison, right in zip([node.left, *node.comparators], node.ops,
                                                   node.comparators):
                    old, new = _COMPARISONS[type(comparison)]
                    yield from _between(places, left, right, rf'(?<!\w){old}(?!\w)', new)
            case ast.BoolOp():
                old, new = ('and', 'or') if isinstance(node.op, ast.And) else ('or', 'and')
                for left, right in zip(node.values, node.values[1:]):
                    yield from _between(places, left, right, rf'\b{old}\b', new)
            case ast.UnaryOp(op=ast.Not()):
                yield places.start(node), places.start(node) + len('not '), ''
            case ast.BinOp(op=ast.Add() | ast.Sub()):
                old, new = ('+', '-') if isinstance(node.op, ast.Add) else ('-', '+')
                for start, end, sign in _between(places, node.left, node.right,
                                                 re.escape(old), new):
                    if not isinstance(node.left, ast.Constant | ast.JoinedStr):
                        yield start, end, sign
                    if isinstance(node.right, ast.Constant) and node.right.value == 1:
                        yield start, places.end(node.right), ''
            case ast.Constant(value=bool()):
                yield places.start(node), places.end(node), str(not node.value)
            case ast.Constant(value=int(number)):
                for value in _others(number):
                    yield places.start(node), places.end(node), str(value)
            case ast.If() | ast.While() | ast.IfExp():
                yield (places.start(node.test), places.end(node.test),
                       f'(not ({places.of(node.test)}))')
            case ast.Expr(value=ast.Call() | ast.Await()) | ast.AugAssign():
                yield places.start(node), places.end(node), 'pass'
            case ast.Assign(targets=[ast.Attribute() | ast.Subscript()]):
                yield places.start(node), places.end(node), 'pass'


def _evaluated(node: ast.AST) -> Iterator[ast.AST]:
    """Yield the nodes that run: not annotations, imports, or decorators."""
    yield node
    left_out: list[object] = []
    match node:
        case ast.FunctionDef() | ast.AsyncFunctionDef():
            left_out = [node.args, node.returns, *node.decorator_list]
        case ast.AnnAssign():
            left_out = [node.annotation]
        case ast.ClassDef():
            left_out = [*node.decorator_list, *node.keywords]
    for child in ast.iter_child_nodes(node):
        if not any(child is item for item in left_out):
            yield from _evaluated(child)


def _between(places: _Text, left: ast.expr, right: ast.expr, pattern: str,
             new: str) -> Iterator[_Place]:
    start, end = places.end(left), places.start(right)
    found = re.search(pattern, places.text[start:end])
    if found is not None and '#' not in places.text[start:end]:
        yield start + found.start(), start + found.end(), new


def all_changes(root: Path, paths: Iterable[str]) -> list[SourceMutant]:
    """Return every mutant of some files of the repository."""
    return [mutant for path in paths
            for mutant in changes(path, (root / path).read_text(encoding='utf-8'))]
