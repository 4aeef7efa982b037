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
Formulas as a program for Copilot, with the operators of its libraries as Ogma writes them.

Copilot's unbounded `since` is not that of FRET: formulas with S are not translated.
"""

from collections.abc import Iterable, Sequence

from fret_monitor.logic.formula import (
    Binary, BinaryOperator, Constant, Formula, Historically, Once, Unary, UnaryOperator, Variable,
    WeakYesterday, Window, Yesterday,
)
from fret_monitor.model.manifest import Manifest
from fret_monitor.model.values import ValueType

_INFIX = {
    BinaryOperator.AND: '&&', BinaryOperator.OR: '||', BinaryOperator.IMPLIES: '==>',
    BinaryOperator.IFF: '==', BinaryOperator.LT: '<', BinaryOperator.LE: '<=',
    BinaryOperator.GT: '>', BinaryOperator.GE: '>=', BinaryOperator.EQ: '==',
    BinaryOperator.NE: '/=',
}
_TYPES = {
    ValueType.BOOL: 'Bool', ValueType.FLOAT32: 'Float', ValueType.FLOAT64: 'Double',
    ValueType.INT16: 'Int16', ValueType.UINT8: 'Word8',
}

_PROGRAM = """\
module Main (main) where

import Copilot.Compile.C99 (compile)
import qualified Copilot.Library.MTL as MTL
import qualified Copilot.Library.PTLTL as PTLTL
import Language.Copilot hiding (alwaysBeen, eventuallyPrev, previous)
import qualified Prelude as P

clock :: Stream Int64
clock = [0] ++ (clock + 1)

{inputs}
main :: P.IO ()
main = reify spec P.>>= compile "{name}"

spec :: Spec
spec = do
{triggers}
"""


def program(name: str, manifest: Manifest, formulas: Sequence[Formula]) -> str:
    """Return the Haskell text; each handler gets the inputs that its requirement reads."""
    inputs = '\n'.join(
        f'{item.name} :: Stream {_TYPES[item.value_type]}\n'
        f'{item.name} = extern "{item.name}" Nothing\n' for item in manifest.inputs)
    triggers = '\n'.join(
        f'  trigger "{item.handler}" (not ({haskell(formula)})) ['
        + ', '.join(f'arg {manifest.inputs[index].name}' for index in item.inputs) + ']'
        for item, formula in zip(manifest.requirements, formulas, strict=True))
    return _PROGRAM.format(name=name, inputs=inputs, triggers=triggers)


def haskell(formula: Formula) -> str:
    """Return a formula without S as an expression of Copilot."""
    match formula:
        case Constant(value):
            return str(value).lower() if isinstance(value, bool) else f'({value})'
        case Variable(name):
            return name
        case Unary(UnaryOperator.NOT, operand):
            return f'not ({haskell(operand)})'
        case Binary(operator, left, right):
            return f'(({haskell(left)}) {_INFIX[operator]} ({haskell(right)}))'
        case Yesterday(operand):
            return f'PTLTL.previous ({haskell(operand)})'
        case WeakYesterday(operand):
            return f'([True] ++ ({haskell(operand)}))'
        case Historically(window, operand):
            return _window('alwaysBeen', window, haskell(operand))
        case Once(window, operand):
            return _window('eventuallyPrev', window, haskell(operand))
        case _:
            raise NotImplementedError(type(formula))


def _window(operator: str, window: Window, operand: str) -> str:
    if window.high is None:
        assert window.low == 0
        return f'PTLTL.{operator} ({operand})'
    return f'MTL.{operator} {window.low} {window.high} clock 1 ({operand})'


def is_translatable(formulas: Iterable[Formula]) -> bool:
    """Return whether formulas can be written for Copilot."""
    try:
        return all(map(haskell, formulas))
    except NotImplementedError:
        return False
