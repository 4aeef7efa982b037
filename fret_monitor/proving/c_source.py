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
Parse C text into functions, types and constants.

The C compiler's preprocessor runs without the system's headers and predefined macros. The few
standard headers that monitors include are replaced by the declarations below, for 32-bit int and
64-bit pointers.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
import subprocess
import tempfile
from typing import Any, TypeAlias

from fret_monitor.native.compiler import find_compiler
from fret_monitor.native.errors import NativeError
from fret_monitor.smt.terms import LIBRARY
from pycparser import c_ast, CParser
from pycparser.c_generator import CGenerator
from pycparser.c_parser import ParseError

_LIMITS = ('#define INT64_MAX 9223372036854775807LL\n'
           '#define INT64_MIN (-9223372036854775807LL - 1)\n'
           '#define INT64_C(c) c ## LL\n#define UINT64_C(c) c ## ULL\n')
_HEADERS = {
    'stdbool.h': '#define bool _Bool\n#define true 1\n#define false 0\n',
    'stddef.h': 'typedef unsigned long long size_t;\n#define NULL ((void *)0)\n'
                '#define offsetof(type, member) fm_offset(sizeof(type), #member)\n',
    'stdint.h': ''.join(
        f'typedef signed {name} int{bits}_t;\ntypedef unsigned {name} uint{bits}_t;\n'
        for name, bits in (('char', 8), ('short', 16), ('int', 32), ('long long', 64))) + _LIMITS,
    'float.h': '',
    'math.h': 'double fmod(double, double);\nfloat fmodf(float, float);\n'
              + ''.join(f'double {name}({", ".join(["double"] * count)});\n'
                        for name, count in LIBRARY.items() if name != 'fmod') +
              '#define NAN FM_NAN\n#define INFINITY FM_INFINITY\n',
    'string.h': 'void * memset(void *, int, unsigned long long);\n',
}


class Unreadable(Exception):
    """The C text has a form that `compile` does not generate; the message describes it."""


@dataclass(frozen=True)
class ArithmeticType:
    """An arithmetic type; `kind` is 'bool', 'int' or 'float'."""

    kind: str
    bits: int
    is_signed: bool = False

    def __str__(self) -> str:
        """Return its name."""
        if self.kind != 'int':
            return 'bool' if self.kind == 'bool' else {32: 'float', 64: 'double'}[self.bits]
        return f'{"" if self.is_signed else "u"}int{self.bits}_t'


@dataclass(frozen=True)
class Struct:
    """A struct type, identified by its tag."""

    tag: str


@dataclass(frozen=True)
class Array:
    """An array type."""

    item: 'Type'
    length: int


@dataclass(frozen=True)
class Pointer:
    """A pointer type; a target of None is `void`."""

    target: 'Type | None'


Type: TypeAlias = ArithmeticType | Struct | Array | Pointer

BOOL = ArithmeticType('bool', 8)
INT = ArithmeticType('int', 32, True)
UNSIGNED = ArithmeticType('int', 32)
LONG = ArithmeticType('int', 64, True)
SIZE = ArithmeticType('int', 64)
FLOAT = ArithmeticType('float', 32)
DOUBLE = ArithmeticType('float', 64)
_MODELLED = {'const', 'extern', 'inline', 'static', 'typedef'}
_WORDS = {'char': 8, 'short': 16, 'int': 32, 'long': 64}


@dataclass(frozen=True)
class CFunction:
    """A function: its parameters (names and types), result type (None: void) and body."""

    name: str
    parameters: tuple[tuple[str, Type], ...]
    result: Type | None
    body: Any


@dataclass(frozen=True)
class CProgram:
    """The declarations in some C files."""

    functions: Mapping[str, CFunction]
    structs: Mapping[str, tuple[tuple[str, Type], ...]]
    constants: Mapping[str, int]
    types: Mapping[str, Type]

    def size(self, kind: Type) -> int:
        """Return the size of a type in bytes."""
        return self._layout(kind)[0]

    def _layout(self, kind: Type) -> tuple[int, int]:
        match kind:
            case ArithmeticType():
                return kind.bits // 8, kind.bits // 8
            case Array():
                size, alignment = self._layout(kind.item)
                return size * kind.length, alignment
            case Pointer():
                return 8, 8
            case Struct():
                return self._struct(kind)

    def _struct(self, kind: Struct) -> tuple[int, int]:
        end, widest = 0, 1
        for _, inner in self.structs[kind.tag]:
            size, alignment = self._layout(inner)
            end = -(-end // alignment) * alignment + size
            widest = max(widest, alignment)
        return -(-end // widest) * widest, widest


def preprocess(sources: Mapping[str, str], headers: Mapping[str, str]) -> dict[str, str]:
    """
    Return the preprocessed texts.

    Raises
    ------
    Unreadable
        if the preprocessor fails, with its message.
    NativeError
        if there is no C compiler.
    """
    command = find_compiler().command
    with tempfile.TemporaryDirectory(prefix='fret_monitor-') as name:
        folder = Path(name)
        for file, text in {**_HEADERS, **headers, **sources}.items():
            (folder / file).write_text(text, encoding='utf-8')
        return {file: _preprocessed([*command, '-E', '-P', '-undef', '-nostdinc', '-std=c99',
                                     '-I.', file], folder) for file in sources}


def _preprocessed(command: list[str], folder: Path) -> str:
    try:
        done = subprocess.run(command, cwd=folder, capture_output=True, encoding='utf-8',
                              check=False, timeout=120)
    except OSError as error:
        raise NativeError(f'cannot run {command[0]}: {error.strerror}') from None
    except subprocess.TimeoutExpired:
        raise NativeError(f'{command[0]} takes more than two minutes to preprocess') from None
    if done.returncode:
        raise Unreadable(f'the preprocessor failed: {done.stderr.strip()[-500:]}')
    return done.stdout


def read_program(sources: Mapping[str, str], headers: Mapping[str, str]) -> CProgram:
    """Preprocess and parse some C files; errors as those of `preprocess` and `parse`."""
    return parse(preprocess(sources, headers))


def parse(texts: Mapping[str, str]) -> CProgram:
    """
    Parse preprocessed files.

    Raises
    ------
    Unreadable
        if a text is not C, or uses types that monitors do not use.
    """
    reader = _CReader()
    for name, text in texts.items():
        try:
            reader.read(CParser().parse(text, name))
        except ParseError as error:
            raise Unreadable(str(error)) from None
    return CProgram(reader.functions, reader.structs, reader.constants, reader.types)


def shown(node: Any) -> str:
    """Return the C text of a syntax node, on one line."""
    text: str = CGenerator().visit(node)
    return ' '.join(text.split())


class _CReader:

    def __init__(self) -> None:
        self.functions: dict[str, CFunction] = {}
        self.structs: dict[str, tuple[tuple[str, Type], ...]] = {}
        self.constants: dict[str, int] = {}
        self.types: dict[str, Type] = {}
        self._texts: dict[str, str] = {}

    def read(self, tree: Any) -> None:
        _refuse_unmodelled(tree)
        for item in tree.ext:
            match item:
                case c_ast.Typedef():
                    kind = self.type(item.type)
                    if self.types.setdefault(item.name, kind) != kind:
                        raise Unreadable(f'{item.name} is declared twice')
                case c_ast.FuncDef():
                    self._function(item)
                case c_ast.Decl() if isinstance(item.type, c_ast.Struct):
                    self._declared(item.type)
                case c_ast.Decl() if isinstance(item.type, c_ast.Enum):
                    self._enumerated(item.type)
                case c_ast.Decl() if isinstance(item.type, c_ast.FuncDecl):
                    pass
                case c_ast.Decl() if isinstance(item.type, c_ast.Union):
                    pass  # for decoding messages, which is not part of the proof
                case _:
                    raise Unreadable(f'outside of functions: {shown(item)[:80]}')

    def _function(self, item: Any) -> None:
        declared = item.decl.type
        parameters = tuple(self._parameters(declared))
        result = None if is_void(declared.type) else self.type(declared.type)
        # Several files may define a static function; the definitions must be equal.
        text = shown(item)
        if self._texts.setdefault(item.decl.name, text) != text or \
                (item.decl.name in self.functions and 'static' not in item.decl.storage):
            raise Unreadable(f'{item.decl.name} is defined twice')
        self.functions[item.decl.name] = CFunction(item.decl.name, parameters, result, item.body)

    def _parameters(self, declared: Any) -> Iterator[tuple[str, Type]]:
        for each in declared.args.params if declared.args else ():
            if each.name is not None:
                yield each.name, self.type(each.type)

    def _declared(self, item: Any) -> None:
        if item.decls is None:
            return
        fields = tuple((field.name, self.type(field.type)) for field in item.decls)
        if self.structs.setdefault(item.name, fields) != fields:
            raise Unreadable(f'struct {item.name} is declared twice')

    def _enumerated(self, item: Any) -> None:
        following = 0
        for each in item.values.enumerators if item.values else ():
            if each.value is not None:
                following = _whole(each.value)
            if self.constants.setdefault(each.name, following) != following:
                raise Unreadable(f'{each.name} is declared twice')
            following += 1

    def type(self, node: Any) -> Type:
        """Return a type as declared; a struct may be declared there."""
        inner = node
        while inner is not None and not isinstance(inner, c_ast.Struct | c_ast.FuncDecl):
            inner = getattr(inner, 'type', None)
        if isinstance(inner, c_ast.Struct):
            self._declared(inner)
        return declared_type(node, self.types)


def declared_type(node: Any, types: Mapping[str, Type]) -> Type:
    """Return the type of a declaration, or of a type name."""
    match node:
        case c_ast.TypeDecl() | c_ast.Typename():
            return declared_type(node.type, types)
        case c_ast.PtrDecl() if is_void(node.type) or isinstance(node.type, c_ast.FuncDecl):
            return Pointer(None)
        case c_ast.PtrDecl():
            return Pointer(declared_type(node.type, types))
        case c_ast.ArrayDecl() if node.dim is not None:
            return Array(declared_type(node.type, types), _whole(node.dim))
        case c_ast.Struct():
            return Struct(node.name)
        case c_ast.IdentifierType():
            return _named_type(node.names, types)
        case _:
            raise Unreadable(f'type {shown(node)[:80]}')


def _named_type(names: list[str], types: Mapping[str, Type]) -> Type:
    """Return the type that a list of keywords names."""
    if len(names) == 1 and names[0] in types:
        return types[names[0]]
    if names == ['_Bool']:
        return BOOL
    if names in (['float'], ['double']):
        return FLOAT if names == ['float'] else DOUBLE
    sizes = [_WORDS[name] for name in names if name in _WORDS]
    if not {*names} <= {*_WORDS, 'signed', 'unsigned'}:
        raise Unreadable(f'type {" ".join(names)}')
    if not sizes and 'unsigned' not in names:
        raise Unreadable(f'type {" ".join(names)}')
    bits = {8: 8, 16: 16}.get(min(sizes, default=32), max(sizes, default=32))
    return ArithmeticType('int', bits, 'unsigned' not in names)


def _refuse_unmodelled(node: Any) -> None:
    """Refuse qualifiers, storage classes, bit-fields and alignments that are not modelled."""
    words = [*(getattr(node, 'quals', None) or ()), *(getattr(node, 'storage', None) or ()),
             *(getattr(node, 'funcspec', None) or ()), *(getattr(node, 'dim_quals', None) or ())]
    # It is unspecified in C which definition of an inline function without `static` is called.
    is_left_open = words.count('inline') > words.count('static')
    if not {*words} <= _MODELLED or is_left_open or getattr(node, 'align', None) or \
            getattr(node, 'bitsize', None) is not None or _may_be_signed(node):
        raise Unreadable(f'not modelled: {shown(node)[:80]}')
    for _, child in node.children():
        _refuse_unmodelled(child)


def _may_be_signed(node: Any) -> bool:
    """Whether a type is plain `char`, whose signedness is implementation-defined."""
    inner = getattr(getattr(node, 'type', None), 'type', None)
    return isinstance(inner, c_ast.IdentifierType) and not isinstance(node, c_ast.PtrDecl) \
        and 'char' in inner.names and not {'signed', 'unsigned'} & {*inner.names}


def is_void(node: Any) -> bool:
    """Whether a type is `void`."""
    inner = node
    while isinstance(inner, c_ast.TypeDecl | c_ast.Typename):
        inner = inner.type
    return isinstance(inner, c_ast.IdentifierType) and inner.names == ['void']


def _whole(node: Any) -> int:
    """Return the value of a literal."""
    if not isinstance(node, c_ast.Constant):
        raise Unreadable(f'not a literal: {shown(node)[:80]}')
    return integer(node.value)


def integer(text: str) -> int:
    """Return the value of an integer literal of C, without its suffix."""
    digits = text.rstrip('uUlL')
    if digits.startswith('0') and len(digits) > 1 and digits[1] not in 'xX':
        raise Unreadable(f'octal literal {text}')
    return int(digits, 0)
