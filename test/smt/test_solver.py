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

"""The solver: its time limit, and its handling of signals."""

from collections.abc import Iterator
import os
import signal
from threading import Timer

from fret_monitor.smt import solver
from fret_monitor.smt import terms as t
from fret_monitor.smt.solver import ProofAnswer, prove
from fret_monitor.smt.terms import Term
import pytest


@pytest.fixture
def interrupts() -> Iterator[None]:
    """Let SIGINT raise KeyboardInterrupt again; rclpy may have replaced the handler."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before or signal.default_int_handler)


def hard() -> Term:
    """Return that a number is prime, which takes too long to prove."""
    a, b = (t.resized(t.variable(name, t.word(62)), 128, False) for name in 'ab')
    product = t.number((2 ** 61 - 1) * 1_000_000_000_000_000_003, 128)
    return t.negation(t.relation('equal', t.operation('mul', a, b), product))


def test_a_hard_claim_is_neither_proved_nor_refuted() -> None:
    result = prove([hard()], seconds=0.2)
    assert result.answer is ProofAnswer.UNKNOWN
    assert result.values == {}


@pytest.mark.usefixtures('interrupts')
def test_an_interrupt_ends_a_proof() -> None:
    timer = Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        prove([hard()], seconds=2.0)
        timer.join()


@pytest.mark.usefixtures('interrupts')
def test_an_interrupt_while_an_object_is_freed_is_not_lost() -> None:
    class Freed:

        def __del__(self) -> None:
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt), solver._interrupts_kept():
        Freed()


def test_only_consequences_of_the_assumptions_are_proved() -> None:
    a, b = (t.variable(name, t.word(32)) for name in 'ab')
    less = t.relation('ult', a, b)
    assert prove([t.negation(t.relation('equal', a, b))], [less]).answer is ProofAnswer.PROVED
    result = prove([less], [t.negation(t.relation('equal', a, b))])
    assert result.answer is ProofAnswer.REFUTED
    assert result.values[a] > result.values[b]
