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
Symbolic execution of C: memory after a function call, as terms over memory before it.

The semantics is that of C99 with an int of 32 bits, two's complement and IEEE 754 without excess
precision. Each undefined or implementation-defined behaviour becomes a condition that must hold:
signed overflow, shifts, division, conversions, indices, reads of uninitialised memory, and calls
in one expression that access the same memory.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from fractions import Fraction
import struct
from typing import Any, NamedTuple, TypeAlias

from fret_monitor.model.floats import to_float32, to_float64
from fret_monitor.proving import c_source as c
from fret_monitor.smt import terms as t
from fret_monitor.smt.terms import Sort, Term
from pycparser import c_ast

Path: TypeAlias = tuple[str | int, ...]
Memory: TypeAlias = dict[Path, Term]

_BYTE = c.ArithmeticType('int', 8)
_WORDS = (c.LONG, c.SIZE)  # the items of arrays that are one value
_LONGEST_LOOP = 100_000
_ARITHMETIC = {'+': ('add', 'fadd'), '-': ('sub', 'fsub'), '*': ('mul', 'fmul')}
_BITWISE = {'&': 'bitand', '|': 'bitor', '^': 'bitxor'}
_RELATIONS = ('<', '<=', '>', '>=', '==', '!=')


class Value(NamedTuple):
    """A term with its C type."""

    type: c.ArithmeticType
    term: Term


@dataclass(frozen=True)
class Reference:
    """A pointer to the object at `path`, or, with an index, to an element of that array."""

    path: Path
    type: c.Type
    index: Term | None = None
    length: int = 0


NULL = Reference(('NULL',), c.INT)

Result: TypeAlias = Value | Reference | None


@dataclass(frozen=True)
class Condition:
    """A condition that must hold for the behaviour to be defined."""

    what: str
    holds: Term


@dataclass
class _Effects:
    reads: set[Path]
    writes: set[Path]


Contract: TypeAlias = Callable[['Machine', Sequence[Value | Reference]], Result]
_Locals: TypeAlias = dict[str, Any]
_FELL_THROUGH = object()


def sort_of(kind: c.Type) -> Sort:
    """Return the sort of the values of a type."""
    match kind:
        case c.ArithmeticType(kind='bool'):
            return t.BOOL
        case c.ArithmeticType(kind='float', bits=bits):
            return t.real(bits)
        case c.ArithmeticType(bits=bits):
            return t.word(bits)
        case c.Array(item, length) if item == _BYTE:
            return t.ring(length)
        case c.Array(item, length) if item in _WORDS:
            return t.word(64 * length)
        case _:
            raise c.Unreadable(f'no value: {kind}')


def places(program: c.CProgram, kind: c.Type, path: Path = ()) -> Iterator[tuple[Path, c.Type]]:
    """Yield the path and type of each scalar, ring and array of words in an object."""
    if isinstance(kind, c.Struct):
        for name, inner in program.structs[kind.tag]:
            yield from places(program, inner, (*path, name))
    elif isinstance(kind, c.Array) and kind.item not in (_BYTE, *_WORDS):
        for number in range(kind.length):
            yield from places(program, kind.item, (*path, number))
    else:
        yield path, kind


class Machine:
    """
    Executes functions of a program; `memory` and `conditions` are the result.

    `contracts` maps names of functions to the contracts that replace them.
    """

    def __init__(self, program: c.CProgram, memory: Mapping[Path, Term],
                 contracts: Mapping[str, Contract] | None = None) -> None:
        """Start with the given memory."""
        self.memory: Memory = dict(memory)
        self.conditions: list[Condition] = []
        self._program = program
        self._contracts = contracts or {}
        self._path = [t.TRUE]
        self._effects = [_Effects(set(), set())]
        self._running: list[c.CFunction] = []
        self._addressed: dict[str, frozenset[str]] = {}

    def call(self, name: str, arguments: Sequence[Value | Reference]) -> Result:
        """Execute a function, or apply its contract."""
        function = self._program.functions.get(name)
        if function is None:
            return self._library(name, arguments)
        if len(arguments) != len(function.parameters):
            raise c.Unreadable(f'{name} takes {len(function.parameters)} arguments')
        passed = [self._passed(value, kind, name)
                  for (_, kind), value in zip(function.parameters, arguments, strict=True)]
        if name in self._contracts:
            return self._contracts[name](self, passed)
        if any(function is other for other in self._running):
            raise c.Unreadable(f'{name} calls itself')
        self._running.append(function)
        local: _Locals = {parameter: (kind, value) for (parameter, kind), value
                          in zip(function.parameters, passed, strict=True)}
        result = self._run(list(function.body.block_items or ()), local)
        for path in [path for path in self.memory if path[:2] == self._frame]:
            del self.memory[path]
        self._running.pop()
        if result is _FELL_THROUGH:
            if function.result is not None:
                raise c.Unreadable(f'{name} may end without a return')
            return None
        return result if function.result is None else self._passed(result, function.result, name)

    @property
    def _frame(self) -> Path:
        """The first part of the paths of the running function's variables that have an address."""
        return 'local', len(self._running)

    def _has_address(self, name: str) -> bool:
        """Whether the running function takes the address of a variable."""
        function = self._running[-1]
        if function.name not in self._addressed:
            self._addressed[function.name] = frozenset(_addressed(function.body))
        return name in self._addressed[function.name]

    def _passed(self, value: Any, kind: c.Type, name: str) -> Value | Reference:
        if isinstance(kind, c.ArithmeticType):
            if not isinstance(value, Value):
                raise c.Unreadable(f'{name}: a pointer where a number is expected')
            return self.converted(value, kind)
        if not isinstance(value, Reference) or not isinstance(kind, c.Pointer):
            raise c.Unreadable(f'{name}: not a pointer')
        return self._pointing(value, kind, name)

    def _pointing(self, value: Reference, kind: c.Pointer, name: str) -> Reference:
        if value == NULL:
            return value
        if kind.target is not None and value.type != kind.target:
            self.require(f'{name}: a pointer to {value.type} is used as one to {kind.target}',
                         t.FALSE)
        return value

    def require(self, what: str, holds: Term) -> None:
        """Add a condition, unless it is trivially true."""
        needed = t.implies(t.all_of(self._path), holds)
        if needed is not t.TRUE:
            where = self._running[-1].name if self._running else ''
            self.conditions.append(Condition(f'{where}: {what}', needed))

    def _library(self, name: str, arguments: Sequence[Value | Reference]) -> Result:
        if name == 'memset':
            self._memset(arguments)
            return None
        if name in t.LIBRARY or name == 'fmodf':
            kind = c.FLOAT if name == 'fmodf' else c.DOUBLE
            passed = [self._passed(item, kind, name) for item in arguments]
            return Value(kind, t.library(
                'fmod' if name == 'fmodf' else name,
                *(item.term for item in passed if isinstance(item, Value))))
        raise c.Unreadable(f'{name} is not defined')

    def _memset(self, arguments: Sequence[Value | Reference]) -> None:
        target, byte, count = arguments
        if not isinstance(target, Reference) or not isinstance(byte, Value) \
                or not isinstance(count, Value) or not t.is_constant(count.term) \
                or not t.is_constant(byte.term):
            raise c.Unreadable('memset with arguments that are not constant')
        size = self._program.size(target.type)
        if count.term.value > size:
            self.require('memset writes beyond the object', t.FALSE)
        if count.term.value != size or byte.term.value not in (0, 1):
            raise c.Unreadable('memset of a part of an object, or to a value other than 0')
        for path, kind in places(self._program, target.type, target.path):
            self.memory[path] = filled(kind, byte.term.value)

    # -- memory -------------------------------------------------------------------------------

    def load(self, place: Reference) -> Value:
        """Read a number."""
        if not isinstance(place.type, c.ArithmeticType):
            raise c.Unreadable(f'no number at {place.path}')
        path = self._element(place)
        self._effects[-1].reads.add(path)
        if path not in self.memory:
            self.require(f'{path}: read before it is written', t.FALSE)
            return Value(place.type, t.variable(f'unknown.{path}', sort_of(place.type)))
        found = self.memory[path]
        if found.sort[0] == 'ring':
            found = t.select(found, self._index(place))
        elif found.sort != sort_of(place.type):
            raise c.Unreadable(f'{path}: a part of a queue')
        return Value(place.type, found)

    def store(self, place: Reference, value: Value) -> None:
        """Write a number of the type of the place."""
        path = self._element(place)
        if place == NULL:
            self.require('a write through a null pointer', t.FALSE)
        self._effects[-1].writes.add(path)
        before = self.memory.get(path)
        if before is not None and before.sort[0] == 'ring':
            self.memory[path] = t.store(before, self._index(place), value.term)
        elif before is not None and before.sort != value.term.sort:
            raise c.Unreadable(f'{path}: a part of a queue')
        else:
            self.memory[path] = value.term

    def record_access(self, path: Path) -> None:
        """Record that an object is read and written."""
        self._effects[-1].reads.add(path)
        self._effects[-1].writes.add(path)

    def _index(self, place: Reference) -> Term:
        assert place.index is not None
        return t.resized(place.index, 32, False)

    def _element(self, place: Reference) -> Path:
        """Return the path of the referenced object; for a byte of a ring, the ring's path."""
        if place.index is None:
            return place.path
        inside = t.relation('ult', place.index, t.number(place.length, place.index.sort[1]))
        self.require(f'index of {place.path}', inside)
        if self.memory.get(place.path) is not None:
            return place.path
        if not t.is_constant(place.index):
            raise c.Unreadable(f'{place.path}: an index that is not constant')
        return (*place.path, place.index.value)

    # -- statements ---------------------------------------------------------------------------

    def _run(self, statements: list[Any], local: _Locals) -> Any:
        """Execute statements up to the end or a return; return the value of the latter."""
        for place, item in enumerate(statements):
            match item:
                case c_ast.Compound():
                    inner = [*(item.block_items or ()), *statements[place + 1:]]
                    return self._run(inner, local)
                case c_ast.If():
                    return self._branch(item, statements[place + 1:], local)
                case c_ast.Return():
                    return None if item.expr is None else self._returned(item.expr, local)
                case c_ast.For():
                    self._loop(item, local)
                case _:
                    self._simple(item, local)
        return _FELL_THROUGH

    def _returned(self, node: Any, local: _Locals) -> Result:
        function, value = self._running[-1], self._whole(node, local)
        return value if function.result is None \
            else self._passed(value, function.result, function.name)

    def _simple(self, item: Any, local: _Locals) -> None:
        match item:
            case c_ast.Decl():
                if item.storage:
                    raise c.Unreadable(f'not modelled: {c.shown(item)[:80]}')
                kind = self._declared(item.type)
                value = None if item.init is None else self._whole(item.init, local)
                passed = None if value is None else self._passed(value, kind, item.name)
                if isinstance(kind, c.ArithmeticType) and self._has_address(item.name):
                    place = Reference((*self._frame, item.name), kind)
                    if isinstance(passed, Value):
                        self.store(place, passed)
                    local[item.name] = (kind, place)
                else:
                    local[item.name] = (kind, passed)
            case c_ast.DeclList():
                for each in item.decls:
                    self._simple(each, local)
            case c_ast.EmptyStatement():
                pass
            case _:
                self._whole(item, local)

    def _declared(self, node: Any) -> c.Type:
        return c.declared_type(node, self._program.types)

    def _branch(self, item: Any, rest: list[Any], local: _Locals) -> Any:
        condition = self._truth(item.cond, local)
        yes = [*([item.iftrue] if item.iftrue else []), *rest]
        no = [*([item.iffalse] if item.iffalse else []), *rest]
        if t.is_constant(condition):
            return self._run(yes if condition.value else no, local)
        memory, kept = dict(self.memory), dict(local)
        with self._assuming(condition):
            one = self._run(yes, local)
        after, later = self.memory, dict(local)
        self.memory = memory
        local.clear()
        local.update(kept)
        with self._assuming(t.negation(condition)):
            other = self._run(no, local)
        for path in {*after, *self.memory}:
            if path not in after or path not in self.memory:
                raise c.Unreadable(f'{path} is written in one of two cases')
            self.memory[path] = t.choice(condition, after[path], self.memory[path])
        for name in kept:
            kind, value = later.get(name, (None, None))
            known = local.pop(name, (None, None))[1]
            # A pointer to different objects may not be used from here on.
            if kind is not None and (value == known or not isinstance(value, Reference)):
                local[name] = (kind, _either(condition, value, known))
        return _either(condition, one, other)

    @contextmanager
    def _assuming(self, condition: Term) -> Iterator[None]:
        self._path.append(condition)
        yield
        self._path.pop()

    def _loop(self, item: Any, local: _Locals) -> None:
        if self._fills(item, local):
            return
        if item.init is not None:
            self._simple(item.init, local)
        for _ in range(_LONGEST_LOOP):
            condition = self._truth(item.cond, local)
            if not t.is_constant(condition):
                raise c.Unreadable('a loop without a fixed bound')
            if not condition.value:
                return
            if self._run([item.stmt], local) is not _FELL_THROUGH:
                raise c.Unreadable('a return inside a loop')
            self._whole(item.next, local)
        raise c.Unreadable(f'a loop of more than {_LONGEST_LOOP} rounds')

    def _fills(self, item: Any, local: _Locals) -> bool:
        """Execute `for (i = 0; i < N; ++i) {bytes[i] = constant;}` as one store to N bytes."""
        match item:
            case c_ast.For(
                init=c_ast.DeclList(decls=[
                    c_ast.Decl(name=name, init=c_ast.Constant(value=zero))]),
                cond=c_ast.BinaryOp(op='<', left=c_ast.ID(name=compared),
                                    right=c_ast.Constant(value=limit)),
                next=c_ast.UnaryOp(op='++' | 'p++', expr=c_ast.ID(name=counted)),
                stmt=c_ast.Compound(block_items=[c_ast.Assignment(
                    op='=', lvalue=c_ast.ArrayRef(name=array, subscript=c_ast.ID(name=index)),
                    rvalue=c_ast.Constant(value=byte))]),
            ) if name == compared == counted == index and c.integer(zero) == 0:
                place = self._place(array, local)
                if isinstance(place.type, c.Array) and place.type.length == c.integer(limit) \
                        and place.type.item == _BYTE:
                    self.memory[place.path] = t.filled(place.type.length, c.integer(byte) & 255)
                    return True
        return False

    # -- expressions --------------------------------------------------------------------------

    def _whole(self, node: Any, local: _Locals) -> Result:
        """Evaluate a full expression."""
        self._effects.append(_Effects(set(), set()))
        found = self._value(node, local)
        self._merge_effects(self._effects.pop())
        return found

    def _merge_effects(self, inner: _Effects) -> None:
        self._effects[-1].reads |= inner.reads
        self._effects[-1].writes |= inner.writes

    def _unsequenced(self, nodes: Sequence[Any], local: _Locals) -> list[Any]:
        """Evaluate operands, and refuse conflicting accesses: C does not specify the order."""
        results = []
        total = _Effects(set(), set())
        for node in nodes:
            self._effects.append(_Effects(set(), set()))
            results.append(self._value(node, local))
            found = self._effects.pop()
            if found.writes & (total.reads | total.writes) or total.writes & found.reads:
                what = f'{c.shown(node)}: accesses the same memory as another operand'
                self.require(what, t.FALSE)
            total.reads |= found.reads
            total.writes |= found.writes
        self._merge_effects(total)
        return results

    def _truth(self, node: Any, local: _Locals) -> Term:
        return t.is_true(self._number(node, local).term)

    def _number(self, node: Any, local: _Locals) -> Value:
        found = self._value(node, local)
        if not isinstance(found, Value):
            raise c.Unreadable(f'no number: {c.shown(node)}')
        return found

    def _value(self, node: Any, local: _Locals) -> Result:
        match node:
            case c_ast.Constant():
                return literal(node)
            case c_ast.ID():
                return self._named(node.name, local)
            case c_ast.Assignment():
                return self._assign(node, local)
            case c_ast.UnaryOp():
                return self._unary(node, local)
            case c_ast.BinaryOp(op='&&' | '||'):
                return self._shortened(node, local)
            case c_ast.BinaryOp():
                left, right = self._unsequenced([node.left, node.right], local)
                return self.binary(node.op, left, right, node)
            case c_ast.TernaryOp():
                return self._conditional(node, local)
            case c_ast.Cast():
                return self._cast(node, local)
            case c_ast.FuncCall():
                arguments = self._unsequenced(node.args.exprs if node.args else [], local)
                return self.call(node.name.name, arguments)
            case c_ast.StructRef() | c_ast.ArrayRef():
                return self._read(self._place(node, local))
            case _:
                raise c.Unreadable(f'{type(node).__name__}: {c.shown(node)[:80]}')

    def _named(self, name: str, local: _Locals) -> Result:
        if name in local:
            kind, value = local[name]
            if value is None:
                self.require(f'{name} is read before it is written', t.FALSE)
                return Value(kind, t.variable(f'unknown.{name}', sort_of(kind)))
            if isinstance(value, Reference) and isinstance(kind, c.ArithmeticType):
                return self.load(value)
            return value  # type: ignore[no-any-return]
        if name in self._program.constants:
            return Value(c.INT, t.number(self._program.constants[name], 32))
        special = {'FM_NAN': float('nan'), 'FM_INFINITY': float('inf')}
        if name in special:
            return Value(c.FLOAT, t.floating(special[name], 32))
        raise c.Unreadable(f'{name} is not declared')

    def _read(self, place: Reference) -> Result:
        """Return the value at a place; an array becomes a pointer to its first element."""
        if isinstance(place.type, c.Array):
            return Reference(place.path, place.type.item, t.number(0, 64), place.type.length)
        if isinstance(place.type, c.ArithmeticType):
            return self.load(place)
        raise c.Unreadable(f'{place.path} is no number')

    def _place(self, node: Any, local: _Locals) -> Reference:
        """Return the place in memory of an expression."""
        match node:
            case c_ast.StructRef():
                return self._field(node, local)
            case c_ast.ArrayRef():
                base = self._value(node.name, local)
                index = self._number(node.subscript, local)
                if not isinstance(base, Reference) or base.index is None \
                        or index.type.kind != 'int' or base.index.op != 'constant':
                    raise c.Unreadable(f'no element of an array: {c.shown(node)}')
                # The bounds check must not truncate the index, so keep its promoted width.
                wanted = self._promoted(index)
                if base.index.value != 0:
                    wanted = self.binary('+', Value(c.LONG, base.index), wanted, node)
                return replace(base, index=wanted.term)
            case c_ast.ID(name=name) if name in local and isinstance(local[name][1], Reference) \
                    and isinstance(local[name][0], c.ArithmeticType):
                return local[name][1]  # type: ignore[no-any-return]
            case c_ast.UnaryOp(op='*'):
                found = self._value(node.expr, local)
                if isinstance(found, Reference):
                    return found
        raise c.Unreadable(f'no place in memory: {c.shown(node)}')

    def _field(self, node: Any, local: _Locals) -> Reference:
        base = self._value(node.name, local) if node.type == '->' \
            else self._place(node.name, local)
        if not isinstance(base, Reference) or not isinstance(base.type, c.Struct) \
                or base.index is not None:
            raise c.Unreadable(f'no field: {c.shown(node)}')
        fields = dict(self._program.structs[base.type.tag])
        name = node.field.name
        if name not in fields:
            raise c.Unreadable(f'struct {base.type.tag} has no {name}')
        return Reference((*base.path, name), fields[name])

    def _assign(self, node: Any, local: _Locals) -> Result:
        value = self._number(node.rvalue, local)
        if node.op != '=':
            before = self._number(node.lvalue, local)
            value = self.binary(node.op[:-1], before, value, node)
        return self._put(node.lvalue, value, local)

    def _put(self, node: Any, value: Value, local: _Locals) -> Value:
        if isinstance(node, c_ast.ID):
            kind = local[node.name][0] if node.name in local else None
            if not isinstance(kind, c.ArithmeticType):
                raise c.Unreadable(f'{node.name} is no number')
            value = self.converted(value, kind)
            place = local[node.name][1]
            if isinstance(place, Reference):
                self.store(place, value)
            else:
                local[node.name] = (kind, value)
            return value
        place = self._place(node, local)
        if not isinstance(place.type, c.ArithmeticType):
            raise c.Unreadable(f'{c.shown(node)} is no number')
        value = self.converted(value, place.type)
        self.store(place, value)
        return value

    def _unary(self, node: Any, local: _Locals) -> Result:
        match node.op:
            case '&':
                return self._place(node.expr, local)
            case '*':
                return self._read(self._place(node, local))
            case 'sizeof':
                size = self._program.size(self._type(node.expr, local))
                return Value(c.SIZE, t.number(size, 64))
            case '++' | 'p++':
                before = self._number(node.expr, local)
                after = self.binary('+', before, Value(c.INT, t.number(1, 32)), node)
                stored = self._put(node.expr, after, local)
                return stored if node.op == '++' else before
            case '!':
                return _boolean(t.negation(self._truth(node.expr, local)))
            case '-' | '~':
                return self._negative(node, self._promoted(self._number(node.expr, local)))
        raise c.Unreadable(f'operator {node.op}')

    def _negative(self, node: Any, value: Value) -> Value:
        if value.type.kind == 'float':
            if node.op == '~':
                raise c.Unreadable('~ of a float')
            return Value(value.type, t.unary('fneg', value.term))
        if node.op == '~':
            return Value(value.type, t.unary('complement', value.term))
        return self.binary('-', Value(value.type, t.number(0, value.type.bits)), value, node)

    def _type(self, node: Any, local: _Locals) -> c.Type:
        match node:
            case c_ast.Typename():
                return self._declared(node)
            case c_ast.UnaryOp(op='*', expr=c_ast.ID(name=name)) if name in local:
                found = local[name][0]
                if isinstance(found, c.Pointer) and found.target is not None:
                    return found.target
        raise c.Unreadable(f'sizeof {c.shown(node)}')

    def _shortened(self, node: Any, local: _Locals) -> Value:
        left = self._truth(node.left, local)
        decided = t.negation(left) if node.op == '||' else left
        if decided is t.FALSE:
            return _boolean(left)
        with self._assuming(decided):
            right = self._truth(node.right, local)
        return _boolean(t.disjunction(left, right) if node.op == '||'
                        else t.conjunction(left, right))

    def _conditional(self, node: Any, local: _Locals) -> Result:
        condition = self._truth(node.cond, local)
        if t.is_constant(condition) and c.shown(node.iffalse) == '(void *) 0':
            return self._value(node.iftrue if condition.value else node.iffalse, local)
        if t.is_constant(condition):
            chosen = self._number(node.iftrue if condition.value else node.iffalse, local)
            other = self._silently(node.iffalse if condition.value else node.iftrue, local)
            return self.converted(chosen, self.common(chosen.type, other.type))
        memory = dict(self.memory)
        with self._assuming(condition):
            yes = self._number(node.iftrue, local)
        with self._assuming(t.negation(condition)):
            no = self._number(node.iffalse, local)
        if memory != self.memory:
            raise c.Unreadable(f'writes to memory in one of two cases: {c.shown(node)}')
        kind = self.common(yes.type, no.type)
        return Value(kind, t.choice(condition, self.converted(yes, kind).term,
                                    self.converted(no, kind).term))

    def _silently(self, node: Any, local: _Locals) -> Value:
        """Return the value of an operand that C does not evaluate; only its type is used."""
        memory = dict(self.memory)
        with self._assuming(t.FALSE):
            found = self._number(node, local)
        self.memory = memory
        return found

    def _cast(self, node: Any, local: _Locals) -> Result:
        if c.is_void(node.to_type):
            self._value(node.expr, local)
            return None
        kind = self._declared(node.to_type)
        found = self._value(node.expr, local)
        if isinstance(found, Reference) and isinstance(kind, c.Pointer):
            return self._pointing(found, kind, c.shown(node))
        if isinstance(found, Value) and isinstance(kind, c.ArithmeticType):
            return self.converted(found, kind)
        if isinstance(found, Value) and kind == c.Pointer(None) and found.term is t.number(0, 32):
            return NULL
        raise c.Unreadable(f'cast: {c.shown(node)}')

    # -- numbers ------------------------------------------------------------------------------

    def common(self, left: c.ArithmeticType, right: c.ArithmeticType) -> c.ArithmeticType:
        """Return the common type of the usual arithmetic conversions."""
        floats = [item for item in (left, right) if item.kind == 'float']
        if floats:
            return max(floats, key=lambda item: item.bits)
        pair = [promoted_type(left), promoted_type(right)]
        widest = max(item.bits for item in pair)
        is_signed = all(item.is_signed for item in pair if item.bits == widest)
        return c.ArithmeticType('int', widest, is_signed)

    def _promoted(self, value: Value) -> Value:
        return value if value.type.kind == 'float' \
            else self.converted(value, promoted_type(value.type))

    def converted(self, value: Value, kind: c.ArithmeticType) -> Value:
        """Convert a value as an assignment does."""
        have, item = value
        if have == kind:
            return value
        if kind.kind == 'bool':
            return Value(kind, t.is_true(item))
        if kind.kind == 'float':
            return Value(kind, self._as_float(have, item, kind.bits))
        if have.kind == 'float':
            raise c.Unreadable(f'{have} converted to {kind}')
        if have.kind == 'bool':
            return Value(kind, t.from_truth(item, kind.bits))
        found = t.resized(item, kind.bits, have.is_signed)
        if kind.is_signed and (have.bits > kind.bits or
                               (have.bits == kind.bits and not have.is_signed)):
            back = t.resized(found, have.bits, True)
            fits = t.relation('equal', back, item)
            if not have.is_signed:
                fits = t.conjunction(fits, t.negation(t.bit(found, kind.bits - 1)))
            self.require(f'{have} converted to {kind}', fits)
        return Value(kind, found)

    def _as_float(self, have: c.ArithmeticType, item: Term, bits: int) -> Term:
        if have.kind == 'bool':
            return t.choice(item, t.floating(1.0, bits), t.floating(0.0, bits))
        return t.to_real(item, bits, have.is_signed)

    def binary(self, op: str, left: Any, right: Any, node: Any) -> Value:
        """Return the result of an infix operator on two numbers."""
        if op == '!=' and NULL in (left, right) and not isinstance(left, Value):
            return _boolean(t.truth(left != right))
        if not isinstance(left, Value) or not isinstance(right, Value):
            raise c.Unreadable(f'arithmetic on pointers: {c.shown(node)}')
        if op in ('<<', '>>'):
            return self._shift(op, self._promoted(left), self._promoted(right), node)
        kind = self.common(left.type, right.type)
        a, b = self.converted(left, kind).term, self.converted(right, kind).term
        if op in _RELATIONS:
            return _boolean(_related(op, a, b, kind))
        if op in _BITWISE and kind.kind == 'int':
            return Value(kind, t.operation(_BITWISE[op], a, b))
        if op in _ARITHMETIC:
            return Value(kind, self._computed(op, a, b, kind, node))
        if op in ('/', '%'):
            return Value(kind, self._divided(op, a, b, kind, node))
        raise c.Unreadable(f'operator {op} of {kind}')

    def _computed(self, op: str, a: Term, b: Term, kind: c.ArithmeticType, node: Any) -> Term:
        word, real = _ARITHMETIC[op]
        if kind.kind == 'float':
            return t.operation(real, a, b)
        found = t.operation(word, a, b)
        if kind.is_signed and not _is_small(op, a, b):
            wide = 2 * kind.bits if op == '*' else kind.bits + 1
            exact = t.operation(word, t.resized(a, wide, True), t.resized(b, wide, True))
            fits = t.relation('equal', exact, t.resized(found, wide, True))
            self.require(f'{c.shown(node)}: signed overflow', fits)
        return found

    def _divided(self, op: str, a: Term, b: Term, kind: c.ArithmeticType, node: Any) -> Term:
        if kind.kind == 'float':
            if op == '%':
                raise c.Unreadable('% of floats')
            return t.operation('fdiv', a, b)
        zero = t.relation('equal', b, t.number(0, kind.bits))
        self.require(f'{c.shown(node)}: division by zero', t.negation(zero))
        if kind.is_signed:
            least = t.relation('equal', a, t.number(1 << (kind.bits - 1), kind.bits))
            minus = t.relation('equal', b, t.number(-1, kind.bits))
            self.require(f'{c.shown(node)}: signed overflow',
                         t.negation(t.conjunction(least, minus)))
        return t.operation(('s' if kind.is_signed else 'u') + ('div' if op == '/' else 'rem'),
                           a, b)

    def _shift(self, op: str, left: Value, right: Value, node: Any) -> Value:
        kind, a = left
        if kind.kind != 'int' or right.type.kind != 'int':
            raise c.Unreadable(f'shift of a float: {c.shown(node)}')
        inside = t.relation('ult', right.term, t.number(kind.bits, right.type.bits))
        self.require(f'{c.shown(node)}: shift by the width or more', inside)
        count = t.resized(right.term, kind.bits, False)
        found = t.operation('shl' if op == '<<' else 'lshr', a, count)
        if kind.is_signed:
            is_natural = t.negation(t.relation('slt', a, t.number(0, kind.bits)))
            self.require(f'{c.shown(node)}: shift of a negative number', is_natural)
            if op == '<<':
                back = t.relation('equal', t.operation('lshr', found, count), a)
                fits = t.negation(t.relation('slt', found, t.number(0, kind.bits)))
                self.require(f'{c.shown(node)}: signed overflow', t.conjunction(back, fits))
        return Value(kind, found)


def _addressed(node: Any) -> Iterator[str]:
    """Yield the names of the variables whose address is taken."""
    match node:
        case c_ast.UnaryOp(op='&', expr=c_ast.ID(name=name)):
            yield name
    for _, child in node.children():
        yield from _addressed(child)


def _is_small(op: str, a: Term, b: Term) -> bool:
    """Whether the known leading zeros of two words exclude an overflow of `op`."""
    def bits(item: Term) -> int:
        if item.op == 'word':
            return 1
        if item.op == 'zext':
            return item.args[0].sort[1]
        if item.op == 'lshr' and item.args[1].op == 'constant':
            return max(1, bits(item.args[0]) - int(item.args[1].value))
        if item.op == 'constant' and not item.value >> (item.sort[1] - 1):
            return max(1, int(item.value).bit_length())
        return item.sort[1]
    width = a.sort[1]
    need = bits(a) + bits(b) if op == '*' else max(bits(a), bits(b)) + 1
    return need < width and max(bits(a), bits(b)) < width


def _related(op: str, a: Term, b: Term, kind: c.ArithmeticType) -> Term:
    if op in ('>', '>='):
        a, b, op = b, a, op.replace('>', '<')
    if op in ('==', '!='):
        found = t.relation('feq' if kind.kind == 'float' else 'equal', a, b)
        return t.negation(found) if op == '!=' else found
    prefix = 'f' if kind.kind == 'float' else 's' if kind.is_signed else 'u'
    return t.relation(prefix + ('lt' if op == '<' else 'le'), a, b)


def _boolean(item: Term) -> Value:
    return Value(c.INT, t.from_truth(item, 32))


def _either(condition: Term, one: Any, other: Any) -> Any:
    if one is other or one == other:
        return one
    if isinstance(one, Value) and isinstance(other, Value):
        if one.type != other.type:
            kind = max((one.type, other.type), key=lambda item: item.bits)
            if {one.type.kind, other.type.kind} != {'int'} and one.type.kind != other.type.kind:
                raise c.Unreadable('two cases give values of different types')
            one, other = (Value(kind, _widened(item, kind)) for item in (one, other))
        return Value(one.type, t.choice(condition, one.term, other.term))
    raise c.Unreadable('two cases of different kinds')


def _widened(value: Value, kind: c.ArithmeticType) -> Term:
    if kind.kind == 'float':
        return t.to_real(value.term, kind.bits)
    return t.resized(value.term, kind.bits, value.type.is_signed)


def promoted_type(kind: c.ArithmeticType) -> c.ArithmeticType:
    """Return the type after integer promotion."""
    return c.INT if kind.kind == 'bool' or (kind.kind == 'int' and kind.bits < 32) else kind


def whole_array(machine: Machine, place: Reference) -> Term:
    """Return an array of words as one value, and record that it is read and written."""
    array = machine.memory.get(place.path)
    if array is None or array.sort != t.word(64 * place.length) \
            or place.index is not t.number(0, 64):
        raise c.Unreadable('a queue or window that is no array of a group')
    machine.record_access(place.path)
    return array


def filled(kind: c.Type, byte: int) -> Term:
    """Return the value whose bytes are all 0 or all 1."""
    sort = sort_of(kind)
    if sort[0] == 'ring':
        return t.filled(sort[1], byte)
    size = max(1, sort[1] // 8)
    if sort[0] == 'real':
        value = struct.unpack('<f' if size == 4 else '<d', bytes([byte]) * size)[0]
        return t.floating(value, sort[1])
    return t.constant(int.from_bytes(bytes([byte]) * size, 'little'), sort)


def literal(node: Any) -> Value:
    """Return the value of a literal."""
    text = node.value
    if 'int' in node.type:
        return _whole_literal(text)
    if node.type not in ('float', 'double'):
        raise c.Unreadable(f'literal {text[:80]}')
    is_single = text[-1] in 'fF'
    kind = c.FLOAT if is_single else c.DOUBLE
    try:
        exact = Fraction(text.rstrip('fF'))
    except ValueError:
        raise c.Unreadable(f'literal {text[:80]}') from None
    value = to_float32(exact) if is_single else to_float64(exact)
    return Value(kind, t.floating(value, kind.bits))


def _whole_literal(text: str) -> Value:
    value = c.integer(text)
    suffix = text[len(text.rstrip('uUlL')):].lower()
    candidates = (c.UNSIGNED, c.SIZE) if 'u' in suffix else (c.INT, c.LONG)
    is_hex = text[:2].lower() == '0x'
    if is_hex and 'u' not in suffix:
        candidates = (c.INT, c.UNSIGNED, c.LONG, c.SIZE)  # type: ignore[assignment]
    for kind in candidates:
        limit = 1 << (kind.bits - kind.is_signed)
        if value < limit and not ('l' in suffix and kind.bits < 64):
            return Value(kind, t.number(value, kind.bits))
    raise c.Unreadable(f'literal {text} is too large')
