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

"""The certificate of a proof, as text and as JSON: obligations, results and assumptions."""

from collections.abc import Iterator
from dataclasses import dataclass
import hashlib
from typing import Any

from fret_monitor.build import GeneratedMonitor
from fret_monitor.logic.formula import BinaryOperator
from fret_monitor.model.diagnostics import counted
from fret_monitor.model.policies import Policy
from fret_monitor.program.monitor_program import (
    ApplyBinary, ApplyUnary, Equation, MonitorProgram, PreviousNumber, SinceBetween, WindowState,
)
from fret_monitor.proving.obligations import Proof
from fret_monitor.proving.queues import PROVED_CAPACITY
from fret_monitor.proving.verification import GroupResult, proved_files, Verification
from fret_monitor.smt.solver import ProofAnswer, solver_version

ASSUMED = (
    'the C compiler, its flags and the machine do what C99 and IEEE 754 say: an int of 32 bits, '
    "long, size_t and pointers of 64, two's complement, float and double without excess "
    'precision, fused operations or other rounding than to nearest; all NaNs count as one',
    "the preprocessor, pycparser, z3, and fret_monitor's own reading of C in fret_monitor/proving",
    'the caller passes state and inputs that do not overlap and that no one else changes, truth '
    'values that are 0 or 1, and resets the state before the first step',
    'not covered: from the text of a requirement to the equations of the program (tested against '
    "an independent evaluator and FRET's own verdicts)",
    'not covered: how messages are decoded, when a step is due, and what is reported',
)
_TICKS = ('the caller steps a group first at tick 0, then at each tick at which an input changes '
          'and at each tick that the step before returned, with ticks that increase')
_SAME = ('fm_same_f32 and fm_same_f64 compare the bits of two numbers (they read a union, which '
         'is not modelled here; tested)')
_QUEUE = (f'fm_since_between_at with more than {PROVED_CAPACITY} intervals (windows [a,b] with a '
          'above about half of b) and fm_overflowed_at: tested against the reference, not proved')
_WINDOWS = ('the windows of numbers (fret_windows.h) compute what the program says: not proved; '
            'that they are called rightly is. Tested: all values in windows of up to 64 steps, '
            'and all traces of 6 ticks in windows of up to 4, but for sums of floats and slopes; '
            'all else on random traces against the reference')
_LIBRARY = ('the functions of mathematics are those of the C library, and give the same value for '
            'the same arguments; what they compute is not proved')
_PROVED = ('For every trace of inputs, each verdict of the C is that of the program, and no',
           'step has undefined behaviour.')
_PROVED_AT_TICKS = (
    'For every trace of inputs, each verdict of the C is that of the program, which takes a step',
    'every nanosecond. No verdict changes before the tick that a step returns, so that the',
    'steps in between can be left out. No step has undefined behaviour.')
_SHOWN = 10


@dataclass(frozen=True)
class Certificate:
    """A verification, with the name and the C text of the bundle."""

    bundle: str
    generated: GeneratedMonitor
    verification: Verification

    @property
    def code_hash(self) -> str:
        """Return the SHA-256 of the C that was proved: names and texts, in order of the names."""
        digest = hashlib.sha256()
        for name, text in sorted(proved_files(self.generated).items()):
            digest.update(f'{name}\0{text}\0'.encode())
        return digest.hexdigest()

    @property
    def assumed(self) -> tuple[str, ...]:
        """Return the assumptions of the proof and the parts that it does not cover."""
        program = self.generated.program
        found = [_LIBRARY] if _uses_library(program) else []
        found += [_WINDOWS] if _has_windows(program) else []
        if program.policy is Policy.TIMED:
            found += [_TICKS, *_trusted_cells(program)]
        return (*ASSUMED[:3], *found, *ASSUMED[3:])


def _has_windows(program: MonitorProgram) -> bool:
    return any(isinstance(equation.operation, WindowState)
               for group in program.groups for equation in group.equations)


def _uses_library(program: MonitorProgram) -> bool:
    return any(_is_library_call(equation)
               for group in program.groups for equation in group.equations)


def _is_library_call(equation: Equation) -> bool:
    match equation.operation:
        case ApplyUnary(operator):
            return operator.is_library
        case ApplyBinary(operator):
            return equation.type.is_float and operator in (
                BinaryOperator.MOD, BinaryOperator.POW, BinaryOperator.ATAN2)
        case _:
            return False


def _trusted_cells(program: MonitorProgram) -> Iterator[str]:
    """Yield what is assumed of the functions of a program that are not proved."""
    equations = [equation for group in program.groups for equation in group.equations]
    stored = [item.type for item in equations if isinstance(item.operation, PreviousNumber)]
    stored += [item.type for group in program.groups for item in group.feedback]
    if any(kind.is_float for kind in stored):
        yield _SAME
    if any(isinstance(item.operation, SinceBetween)
           and ((item.operation.room.capacity or 0) > PROVED_CAPACITY
                or item.operation.room.may_overflow)
           for item in equations):
        yield _QUEUE


def _count(proofs: tuple[Proof, ...], answer: ProofAnswer = ProofAnswer.PROVED) -> int:
    return sum(proof.answer is answer for proof in proofs)


def as_dict(certificate: Certificate) -> dict[str, Any]:
    """Return the certificate as a JSON object."""
    found = certificate.verification
    manifest = certificate.generated.manifest
    return {
        'bundle': certificate.bundle,
        'bundle_hash': manifest.bundle_hash,
        'source_hash': manifest.source_hash,
        'code_hash': certificate.code_hash,
        'proved': found.is_proved,
        'unreadable': found.unreadable or None,
        'requirements': [
            {'id': item.id, 'proved': found.is_proved or _is_proved(found, item.group)}
            for item in manifest.requirements],
        'cells': [_proof(proof) for proof in found.cells],
        'obligations': {'total': len(found.proofs), 'proved': _count(found.proofs)},
        'not_proved': [_proof(proof) for item in found.groups for proof in item.proofs
                       if proof.answer is not ProofAnswer.PROVED],
        'seconds': round(found.seconds, 3),
        'solver': solver_version(),
        'assumed': list(certificate.assumed),
    }


def _is_proved(found: Verification, group: int) -> bool:
    """Whether a group, the functions for all groups and the cells are all proved."""
    needed = [item for item in found.groups if item.group in (group, -1)]
    return bool(needed) and all(item.is_proved for item in needed) \
        and all(proof.answer is ProofAnswer.PROVED for proof in found.cells)


def _proof(proof: Proof) -> dict[str, Any]:
    return {'name': proof.name, 'answer': proof.answer.value,
            'seconds': round(proof.seconds, 3), 'detail': proof.detail}


def lines(certificate: Certificate) -> Iterator[str]:
    """Yield the lines of the certificate as text."""
    found, manifest = certificate.verification, certificate.generated.manifest
    is_timed = certificate.generated.program.policy is Policy.TIMED
    verdict = 'proved' if found.is_proved else 'NOT PROVED'
    yield (f'{certificate.bundle}: {verdict}, '
           f'{counted(len(manifest.requirements), "requirement")}')
    yield ''
    yield f'bundle        sha256 {manifest.bundle_hash}'
    yield f'source        sha256 {manifest.source_hash}'
    yield f'code          sha256 {certificate.code_hash}'
    if found.unreadable:
        yield f'not read      {found.unreadable}'
    else:
        yield from _counts(certificate)
    yield f'solver        {solver_version()}, {found.seconds:.1f} s'
    yield ''
    if found.is_proved:
        yield from _PROVED_AT_TICKS if is_timed else _PROVED
        yield ''
    yield from _failures(found)
    if is_timed and any(not item.is_proved for item in found.groups):
        yield 'No counterexample was searched for under the policy `timed`.'
        yield ''
    yield 'Assumed, or not covered by this proof:'
    yield from (f'- {text}' for text in certificate.assumed)


def _counts(certificate: Certificate) -> Iterator[str]:
    found = certificate.verification
    yield f'cells         {_count(found.cells)} of {len(found.cells)} obligations proved'
    others = tuple(proof for item in found.groups for proof in item.proofs)
    groups = len(found.groups) - 1
    yield (f'monitor       {_count(others)} of {len(others)} obligations proved, '
           f'{counted(groups, "step group")}')


def _failures(found: Verification) -> Iterator[str]:
    for proof in found.cells:
        if proof.answer is not ProofAnswer.PROVED:
            yield f'{proof.answer.value}: {proof.name}'
            yield from _detail(proof)
    for item in found.groups:
        yield from _group_failures(item)


def _group_failures(item: GroupResult) -> Iterator[str]:
    failed = [proof for proof in item.proofs if proof.answer is not ProofAnswer.PROVED]
    for proof in failed[:_SHOWN]:
        yield f'not proved: {proof.name}'
        yield from _detail(proof)
    if len(failed) > _SHOWN:
        yield f'and {len(failed) - _SHOWN} more'
    if failed:
        yield ''


def _detail(proof: Proof) -> Iterator[str]:
    if proof.detail:
        what = 'at' if proof.answer is ProofAnswer.REFUTED else 'because'
        yield f'  {what}: {proof.detail[:1000]}'
    elif proof.answer is ProofAnswer.UNKNOWN:
        yield '  the obligation ran out of time: allow more with --timeout'
