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
Choose every C identifier of generated code.

A user's name is kept if C allows it, else changed in a fixed way; names within one scope are
distinct. Text of a bundle gets into C only through this module, `comments` and string literals.
"""

from collections.abc import Iterable
import re

from fret_monitor.model.values import ValueType
from fret_monitor.program.layout import StateField

C_KEYWORDS = frozenset("""
    auto break case char const continue default do double else enum extern float for goto if inline
    int long register restrict return short signed sizeof static struct switch typedef union
    unsigned void volatile while bool true false asm typeof nullptr constexpr static_assert
    thread_local alignas alignof
""".split())
CPP_KEYWORDS = frozenset("""
    and and_eq bitand bitor catch class compl concept const_cast consteval constinit co_await
    co_return co_yield char8_t char16_t char32_t decltype delete dynamic_cast explicit export
    friend mutable namespace new noexcept not not_eq operator or or_eq private protected public
    reinterpret_cast requires static_cast template this throw try typeid typename using virtual
    wchar_t xor xor_eq
""".split())
_MACROS = frozenset("""
    atomic complex errno generic i386 imaginary linux math_errhandling noreturn unix
""".split())
_OURS = frozenset("""
    s in state inputs verdicts tick next unsettled memset fmod fmodf pow atan2
    sin cos tan asin acos atan sqrt exp log floor ceil round
""".split())
_TAKEN = C_KEYWORDS | CPP_KEYWORDS | _MACROS | _OURS
_GENERATED = re.compile(r'fm_|FM_|group_\d+|[a-z]+_\d+|.*_(t|wide)$|_|[A-Z0-9_]+$')
_MODULE = re.compile(
    r'(req|occ)_.*|requirements|verdicts|step|step_at|step_any|overflows|reset|monitor|readers'
    r'|outputs|tests|margins'
    r'|groups?_.*')
_LONGEST_PREFIX = 100  # characters; file names begin with the prefix

# Suffixes of the functions in fret_cells.h, by the type of their operands, as in `fm_add_i64`.
SUFFIXES = {kind: f'{kind.value[0]}{kind.bits}' for kind in ValueType if kind.is_number}


def identifier(name: str, prefix: str = 'fm') -> str:
    """Return a C identifier similar to `name` that is no keyword, macro or generated name."""
    word = re.sub(r'[^A-Za-z0-9_]', '_', name) or '_'
    is_taken = word in _TAKEN or word[0].isdigit()
    if is_taken or is_of_module(word, prefix) or _GENERATED.match(word):
        return 'v_' + word
    return word


def is_of_module(word: str, prefix: str) -> bool:
    """Return whether a word may be a name that a module with this prefix defines."""
    return word.startswith(f'{prefix}_') and _MODULE.fullmatch(word[len(prefix) + 1:]) is not None


def distinct(names: Iterable[str], prefix: str = 'fm') -> dict[str, str]:
    """Return an identifier for each name, in order; a number is appended if it is taken."""
    chosen: dict[str, str] = {}
    taken: set[str] = set()
    for name in names:
        word = candidate = identifier(name, prefix)
        number = 2
        while candidate in taken:
            candidate = f'{word}_{number}_'
            number += 1
        taken.add(candidate)
        chosen[name] = candidate
    return chosen


class Names:
    """The names of one module; every exported name starts with `prefix`."""

    def __init__(self, module: str, signals: Iterable[str], requirements: Iterable[str],
                 definitions: Iterable[str]) -> None:
        """Choose names for a bundle's inputs, requirement ids and definitions."""
        word = re.sub(r'[^A-Za-z0-9_]', '_', module)[:_LONGEST_PREFIX] or 'bundle'
        is_taken = word[0].isdigit() or word.startswith(('_', 'fm_')) \
            or word.lower() in ('fm', 'fret')
        self.prefix = 'm_' + word if is_taken else word
        signals = list(signals)
        both = distinct([*signals, *definitions], self.prefix)
        self.signals = {name: both[name] for name in signals}
        self.definitions = both
        words = [re.sub(r'[^A-Za-z0-9_]', '_', item) for item in requirements]
        self.requirements = [f'{self.prefix}_req_{word}' for word in words]
        self.occurrences = [f'{self.prefix}_occ_{word}' for word in words]
        self.requirement_count = f'{self.prefix}_requirements'
        self.verdict_count = f'{self.prefix}_verdicts'
        self.symbol = f'{self.prefix}_monitor'  # the function that returns the description
        self.readers = f'{self.prefix}_readers'  # the function that returns the extractors
        self.outputs = f'{self.prefix}_outputs'  # the function that returns the outputs
        self.tests = f'{self.prefix}_tests'  # the function that returns the tests
        self.margins = f'{self.prefix}_margins'  # the function that returns the margins
        self.header = f'{self.prefix}_monitor.h'
        self.fields_source = f'{self.prefix}_fields.c'  # the C file with the extractors
        self.inputs_struct = f'struct {self.prefix}_inputs'
        self.state_struct = f'struct {self.prefix}_state'

    def source(self, number: int) -> str:
        """File name of a C file."""
        return f'{self.prefix}_monitor{f"_{number}" if number else ""}.c'

    def group_struct(self, group: int) -> str:
        """Return the struct of a group's state."""
        return f'struct {self.prefix}_group_{group}'

    def group_function(self, group: int, verb: str) -> str:
        """Return the function that steps or resets a group."""
        return f'{self.prefix}_group_{group}_{verb}'

    def part_function(self, group: int, part: int) -> str:
        """Return the function that computes a part of a group's step."""
        return f'{self.prefix}_group_{group}_part_{part}'

    def block_function(self, first: int) -> str:
        """Return the function that steps a run of groups, named by the first of them."""
        return f'{self.prefix}_groups_from_{first}'


def field(state: StateField) -> str:
    """Return the name of a field of a group's state."""
    return f'{state.kind.value}_{state.number}'
