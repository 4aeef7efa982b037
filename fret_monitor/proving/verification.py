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
The proof of a bundle: first the cells, then each group, then the functions for all groups.

    bundle -> program, C text -> parsed C -> obligations -> solver -> Verification
"""

from dataclasses import dataclass
from functools import cache
import time

from fret_monitor.build import GeneratedMonitor
from fret_monitor.model.progress import no_progress, Progress
from fret_monitor.native.cache import runtime_headers
from fret_monitor.program.monitor_program import SinceBetween
from fret_monitor.proving.c_source import read_program, Unreadable
from fret_monitor.proving.contracts import prove_cells
from fret_monitor.proving.monitor import ALL, ProofSubject, prove_group, prove_whole, wrong_types
from fret_monitor.proving.obligations import Proof
from fret_monitor.proving.queues import prove_queue
from fret_monitor.proving.refutation import Counterexample, find_counterexample
from fret_monitor.smt.solver import ProofAnswer

_SEARCH_S = 10.0
_FIELDS = '_fields.c'
_RUNTIME = ('fret_cells.h', 'fret_monitor.h')


@dataclass(frozen=True)
class GroupResult:
    """The proofs of a group, or of the functions for all groups, and a counterexample."""

    group: int
    proofs: tuple[Proof, ...]
    counterexample: Counterexample | None

    @property
    def is_proved(self) -> bool:
        """Whether all obligations are proved."""
        return all(proof.answer is ProofAnswer.PROVED for proof in self.proofs)


@dataclass(frozen=True)
class Verification:
    """All proofs of a bundle; `unreadable` is the reason if the C could not be parsed."""

    cells: tuple[Proof, ...]
    groups: tuple[GroupResult, ...]
    subject: ProofSubject | None
    unreadable: str
    seconds: float

    @property
    def is_proved(self) -> bool:
        """Whether all obligations are proved."""
        return not self.unreadable and all(item.is_proved for item in self.groups) \
            and all(proof.answer is ProofAnswer.PROVED for proof in self.cells)

    @property
    def counterexample(self) -> Counterexample | None:
        """Return the first counterexample of a group."""
        return next((item.counterexample for item in self.groups if item.counterexample), None)

    @property
    def proofs(self) -> tuple[Proof, ...]:
        """Return all proofs."""
        return (*self.cells, *(proof for item in self.groups for proof in item.proofs))


def proved_files(generated: GeneratedMonitor) -> dict[str, str]:
    """Return the C files to be proved, by name: all except those that decode messages."""
    module, runtime = generated.module, runtime_headers()
    return {**{name: runtime[name] for name in module.runtime_headers}, **dict([module.header]),
            **{name: text for name, text in module.sources if not name.endswith(_FIELDS)}}


def read_subject(generated: GeneratedMonitor) -> ProofSubject:
    """
    Parse the C of a monitor.

    Raises
    ------
    Unreadable
        if it does not have the form that `compile` generates.
    NativeError
        if there is no C compiler, whose preprocessor is needed.
    """
    files = proved_files(generated)
    code = read_program({name: text for name, text in files.items() if name.endswith('.c')},
                        {name: text for name, text in files.items() if name.endswith('.h')})
    module = generated.module
    return ProofSubject(code, generated.program, generated.layouts,
                        module.symbol.removesuffix('_monitor'), module.source_hash)


def verify(generated: GeneratedMonitor, *, seconds: float = 30.0,
           progress: Progress = no_progress) -> Verification:
    """
    Prove a bundle; `seconds` is the time limit of each obligation.

    `progress` is called with the part of the groups that is done, None during the cells.
    """
    before = time.perf_counter()
    try:
        subject = read_subject(generated)
    except Unreadable as error:
        return Verification((), (), None, str(error), time.perf_counter() - before)
    files = proved_files(generated)
    headers = tuple((name, files[name]) for name in _RUNTIME)
    progress(None, 'cells')
    cells = cells_proved(headers, seconds)
    if any(isinstance(equation.operation, SinceBetween) for layout in subject.layouts
           for equation in layout.group.equations):
        cells = *cells, queue_proved(headers, seconds)
    count = len(subject.layouts)
    groups = []
    for number, group in enumerate([*range(count), ALL]):
        progress(number / (count + 1),
                 'all groups' if group == ALL else f'group {number + 1} of {count}')
        groups.append(verify_group(subject, group, seconds))
    return Verification(cells, tuple(groups), subject, '', time.perf_counter() - before)


@cache
def cells_proved(headers: tuple[tuple[str, str], ...], seconds: float) -> tuple[Proof, ...]:
    """Prove the cells in some headers, once in a process."""
    code = read_program({'cells.c': '#include "fret_cells.h"\n'}, dict(headers))
    return tuple(prove_cells(code, seconds))


@cache
def queue_proved(headers: tuple[tuple[str, str], ...], seconds: float) -> Proof:
    """Prove the queue in some headers, once in a process; only few bundles need it."""
    code = read_program({'cells.c': '#include "fret_cells.h"\n'}, dict(headers))
    return prove_queue(code, seconds)


def verify_group(subject: ProofSubject, group: int, seconds: float) -> GroupResult:
    """Prove a group, or the functions for all groups; if that fails, find a counterexample."""
    wrong = wrong_types(subject, group)
    if wrong:
        return GroupResult(group, tuple(wrong), None)
    outcome = prove_whole(subject, seconds) if group == ALL \
        else prove_group(subject, group, seconds)
    found = find_counterexample(subject, group, outcome.values, min(seconds, _SEARCH_S)) \
        if outcome.has_behaviour_unproved else None
    return GroupResult(group, tuple(outcome.proofs), found)
