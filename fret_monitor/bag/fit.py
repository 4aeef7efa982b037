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
Finds the tightest value of a constant with which all recordings satisfy the requirements.

Several values are judged in one run: each is compiled in as if it were the bundle's, in a copy of
the requirements that name the constant. Whether verdicts are monotone in it is what the values
show that were tried; if they are not, the result is an interval.
"""

from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import BrokenExecutor, Executor
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import NamedTuple

from fret_monitor.bag.check import is_trace, opened, read_bundle, run, Selection
from fret_monitor.bag.constant_range import ConstantRange, range_of
from fret_monitor.build import compile_monitor, generate_monitor, Reading
from fret_monitor.logic.numbers import parse_number
from fret_monitor.logic.specification import Property
from fret_monitor.messages.installed import fingerprint
from fret_monitor.model.diagnostics import CompileError, refuse, Source, Text
from fret_monitor.model.manifest import Manifest
from fret_monitor.model.names import fret_name, is_integer
from fret_monitor.model.policies import Policy
from fret_monitor.model.progress import no_progress, Progress
from fret_monitor.native.cache import build_library, runtime_headers
from fret_monitor.native.monitor import load, Monitor

_AT_ONCE = 15  # values that are judged in one run
_MARK = '#'  # between an id and the number of a value


class Deciding(NamedTuple):
    """What forbids the next tighter value: a recording, a requirement, a time (ns)."""

    path: Path
    requirement: str
    time: int | None


@dataclass(frozen=True)
class Fit:
    """
    The tightest value of a constant, as text, and the next one, which is violated.

    `is_least`: greater values are satisfied, too. If verdicts are not monotone, all values that
    were tried from `value` to `other_end` are satisfied, and there are others that are, or are
    not, beyond. `tried` counts the values. `places` are nearest violations on the sides that end.
    """

    name: str
    before: str
    value: str
    tighter: str
    is_least: bool
    deciding: Deciding
    tried: int
    requirements: tuple[str, ...]
    kind: str
    other_end: str | None = None

    @property
    def is_monotone(self) -> bool:
        """Whether all values that were tried show one limit."""
        return self.other_end is None


class _Judged(NamedTuple):
    """Of a recording: by value the first violation, its requirement and time; None: satisfied."""

    path: Path
    violations: tuple[tuple[str, int | None] | None, ...]
    errors: tuple[str, ...]
    is_judged: bool


class _Copies(NamedTuple):
    """The C of copies of requirements; a process compiles it, or has it in its cache."""

    manifest: Manifest
    sources: Mapping[str, str]
    headers: Mapping[str, str]

    def monitor(self) -> Monitor:
        """Return it as a loaded library."""
        library = build_library(self.sources, name=self.manifest.symbol,
                                headers={**runtime_headers(), **self.headers})
        return load(library, self.manifest)


def fit(bundle: Path, paths: Sequence[Path], name: str, selection: Selection, *,
        executor: Executor | None = None, progress: Progress = no_progress) -> Fit:
    """
    Return the tightest value of a constant; the others are as in the bundle or the selection.

    The `executor` reads the recordings; None: this process does.

    Raises
    ------
    CompileError
        if the bundle has no such constant, or no requirement names it, a recording cannot be read
        or does not fit the bundle, no value is satisfied, or every value is.
    NativeError
        if the compiler fails.
    """
    return _FitSearch(bundle, paths, name, selection, executor, progress).result()


class _FitSearch:
    """One search; `found` has the keys that were tried, with what violates them."""

    def __init__(self, bundle: Path, paths: Sequence[Path], name: str, selection: Selection,
                 executor: Executor | None, progress: Progress) -> None:
        self._bundle, self._paths, self._selection = bundle, paths, selection
        self._executor, self._progress = executor, progress
        self._reading = self._read({})
        known = dict(self._reading.constants)
        self._name = next((item for item in known if fret_name(item) == fret_name(name)), name)
        if self._name not in known:
            names = ', '.join(known)
            refuse(f"'{bundle.name}' has no constant '{name}'",
                   help=f'it has {names}' if names else 'it has no constants')
        self._before = known[self._name]
        if self._before.lower() in ('true', 'false'):
            refuse(f"'{self._name}' is {self._before}: only numbers are fitted")
        self._ids = tuple(item.id for item in self._naming(self._reading))
        if self._reading.specification.instance_variables:
            refuse('`fit` does not take bundles with for_each yet')
        if not self._ids:
            refuse(f"no requirement names the constant '{self._name}'",
                   help='requirements with probabilities do not count')
        self._current = Fraction(parse_number(self._before).value)
        self._range = self._range_of()
        self._found: dict[int, Deciding | None] = {}
        self._violating: dict[int, list[Path]] = {}  # by value, of the recordings that judged it
        self._is_judged = False

    def _range_of(self) -> ConstantRange:
        is_whole = is_integer(self._before)
        step = 1 if is_whole else Fraction(1, 3) * (abs(self._current) or 1)
        other = str(int(self._current + step)) if is_whole else repr(float(self._current + step))
        changed = self._naming(self._read({self._name: other}))
        return range_of([root for item in self._naming(self._reading) for root in item.roots],
                        [root for item in changed for root in item.roots], is_whole=is_whole)

    def _read(self, constants: Mapping[str, str]) -> Reading:
        texts = {name: Text.whole(Source(f'--constant {name}', value))
                 for name, value in constants.items()}
        selection = replace(self._selection, constants={**self._selection.constants, **texts})
        with opened(self._paths[0]) as (_, find):
            return read_bundle(self._bundle, selection, find)

    def _naming(self, reading: Reading) -> list[Property]:
        return [item for item in reading.specification.properties
                if item.probability is None and self._name in item.constants]

    # -- judging --------------------------------------------------------------------------------

    def _judge(self, keys: Sequence[int], paths: Sequence[Path]) -> None:
        """Judge values by recordings; those that cannot be compiled are out of the range."""
        for start in range(0, len(keys), _AT_ONCE):
            self._judge_some(keys[start:start + _AT_ONCE], paths)

    def _judge_some(self, keys: Sequence[int], paths: Sequence[Path]) -> None:
        alike = [[path for path in paths if is_trace(path) is kind] for kind in (True, False)]
        try:
            copies = [(self._copies(keys, some[0]), some) for some in alike if some]
        except CompileError:
            if len(keys) > 1:
                self._judge_some(keys[:len(keys) // 2], paths)
                self._judge_some(keys[len(keys) // 2:], paths)
            elif keys[0] == self._range.key(self._current):
                raise
            else:
                self._narrow(keys[0])
            return
        for judged in [item for each, some in copies for item in self._run(each, len(keys), some)]:
            if judged.errors:
                refuse(f"'{judged.path}': {judged.errors[0]}",
                       help='fit takes whole recordings: fret-monitor bag says what is missing')
            self._is_judged |= judged.is_judged
            for key, violation in zip(keys, judged.violations, strict=True):
                self._violating.setdefault(key, []).extend([judged.path] if violation else [])
                if self._found.get(key) is None:
                    self._found[key] = violation and Deciding(judged.path, *violation)

    def _narrow(self, key: int) -> None:
        """Leave out a value that cannot be compiled, and those beyond it."""
        is_above = key > self._range.key(self._current)
        self._range = replace(self._range, most=key - 1) if is_above else replace(
            self._range, least=key + 1)
        for other in [item for item in self._found if (item > key) is is_above]:
            del self._found[other]

    def _copies(self, keys: Sequence[int], path: Path) -> _Copies:
        """Return copies of the requirements that name the constant, for recordings as this one."""
        readings = [self._read({self._name: self._range.text(key)}) for key in keys]
        copies = [replace(item, id=f'{item.id}{_MARK}{place}',
                          handler=f'{item.handler}_{place}', on_violation=(), on_end=())
                  for place, reading in enumerate(readings) for item in self._naming(reading)]
        first, read = readings[0], {name for item in copies for name in item.inputs}
        # What they do not read need not be recorded. Its messages may be steps, but are no rows.
        reads_all = first.specification.policy is Policy.EVERY_MESSAGE and not is_trace(path)
        generated = generate_monitor(replace(first, specification=replace(
            first.specification, properties=tuple(copies), actions=(), gates=(), definitions=(),
            signals=tuple(item for item in first.specification.signals
                          if reads_all or item.name in read))))
        compile_monitor(generated)  # once, before the processes on this machine look for it
        return _Copies(generated.manifest, generated.c_sources, generated.c_headers)

    def _run(self, copies: _Copies, count: int, paths: Sequence[Path]) -> Iterable[_Judged]:
        arguments = [(path, copies, self._selection, count, self._reading.messages)
                     for path in paths]
        self._progress(None, f'{self._name}: {len(self._found)} values tried')
        if self._executor is None or len(paths) == 1:
            return [_judge_recording(*item) for item in arguments]
        try:
            return list(self._executor.map(_judge_recording, *zip(*arguments, strict=True)))
        except BrokenExecutor:
            refuse('a process that read a recording died',
                   help='fret-monitor bag says which recording it was')

    # -- searching ------------------------------------------------------------------------------

    def result(self) -> Fit:
        self._judge(self._range.first(self._current), self._paths)
        if not self._is_judged:
            refuse(f'no recording judges {", ".join(self._ids)}',
                   help='their inputs have no values: fret-monitor bag says why')
        passing = self._passing()
        low, high = self._edge(passing[0], -1), self._edge(passing[-1], 1)
        if low is None and high is None:
            refuse(f"every value of '{self._name}' that was tried is satisfied: "
                   f'{self._range.text(self._range.least)} to '
                   f'{self._range.text(self._range.most)}',
                   help='the recordings do not limit it')
        return self._fit(low, high)

    def _passing(self) -> list[int]:
        """Return the run of neighbouring tried values that are satisfied, around the present."""
        runs: list[list[int]] = [[]]
        for key in sorted(self._found):
            if self._found[key] is None:
                runs[-1].append(key)
            elif runs[-1]:
                runs.append([])
        here = self._range.key(self._current)
        runs = [run for run in runs if run]
        if not runs:
            nearest = min(self._found, key=lambda key: abs(key - here))
            by = self._found[nearest]
            assert by is not None
            refuse(f"no value of '{self._name}' that was tried is satisfied",
                   help=f"with {self._range.text(nearest)}, {by.requirement} is violated in "
                   f"'{by.path}'")
        return next((run for run in runs if here in run), max(runs, key=len))

    def _edge(self, key: int, step: int, *, by_all: bool = False) -> int | None:
        """
        Return the last satisfied value in a direction from a satisfied one; None: no end.

        Only recordings that violate a value farther out decide about those in between, unless
        `by_all`. That is an assumption, which the others confirm or not for the value found.
        """
        failing = [item for item in self._found
                   if self._found[item] is not None and (item - key) * step > 0]
        if not failing:
            return None
        outside, found = min(failing, key=lambda item: abs(item - key)), key
        others: list[Path] = []
        while abs(outside - found) > 1:
            paths = self._paths if by_all else self._violating[outside]
            others = [path for path in self._paths if path not in paths]
            tried = self._range.between(min(found, outside), max(found, outside), _AT_ONCE)
            self._judge(tried, paths)
            found, outside = self._nearest(found, outside, tried)
        if found != key and others:
            self._judge([found], others)
            if self._found[found] is not None:
                return self._edge(key, step, by_all=True)
        return found

    def _nearest(self, found: int, outside: int, tried: Iterable[int]) -> tuple[int, int]:
        """Return the last satisfied of some values outward, and the first one that is not."""
        for item in sorted(tried, key=lambda item: abs(item - found)):
            if self._found[item] is not None:
                return found, item
            found = item
        return found, outside

    def _fit(self, low: int | None, high: int | None) -> Fit:
        is_least = low is not None
        key = low if low is not None else high
        assert key is not None
        tighter = key - 1 if is_least else key + 1
        by = self._found[tighter]
        assert by is not None
        is_monotone = all((found is None) is (item >= key if is_least else item <= key)
                          for item, found in self._found.items())
        end = None if is_monotone else high if is_least else low
        shown = None if is_monotone else self._range.text(
            end if end is not None else self._range.most if is_least else self._range.least)
        return Fit(self._name, self._before, self._range.text(key), self._range.text(tighter),
                   is_least, by, len(self._found), self._ids, self._range.what, shown)


def _judge_recording(path: Path, copies: _Copies, selection: Selection, count: int,
                     messages: Sequence[tuple[str, str]]) -> _Judged:
    """Run copies of requirements over a recording."""
    with opened(path) as (recording, find):
        types = {item.message_type for item in copies.manifest.topics}
        for name, known in messages:
            if name in types and fingerprint(find(name)) != known:
                refuse(f"'{path}' has another definition of {name} than the first recording")
        result = run(copies.monitor(), recording, selection, checks_remaps=False,
                     needs_all=False)
    violations: list[tuple[str, int | None] | None] = [None] * count
    for item in result.findings:
        name, _, place = item.id.rpartition(_MARK)
        if item.verdict is False:
            earlier = violations[int(place)]
            if earlier is None or (item.first or 0) < (earlier[1] or 0):
                violations[int(place)] = name, item.first
    is_judged = any(item.verdict is not None or item.is_open for item in result.findings)
    return _Judged(path, tuple(violations), result.errors, is_judged)
