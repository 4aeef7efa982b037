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

"""FRET's case studies, where they are present, with the answers that FRET gives."""

from pathlib import Path

from analysis.search import reference
import facts
from fret_monitor.analysis.answers import Answer, Question
from fret_monitor.analysis.checks import analyze
from fret_monitor.elaboration.elaborate import specify
from fret_monitor.importing import import_bundles, write_bundles
from stages import read_bundle


def realizability(name: str, folder: Path) -> list[Answer]:
    """Import a project, and return the answers about its components."""
    [found] = import_bundles([facts.path(name)], folder / 'bundle.yaml')
    write_bundles([found])
    specification = specify(read_bundle(found.path))[0]
    return list(analyze(specification, reference(specification),
                        [Question.REALIZABILITY]).answers)


def test_the_finite_state_machine_has_two_components_that_are_not_realizable(
        tmp_path: Path) -> None:
    answers = realizability('fret/exports/fsm_reqts_and_vars.json', tmp_path)
    assert [item.holds for item in answers] == [False, False, True]
    assert ('FSM-002', 'FSM-003') in answers[0].conflicts


def test_one_of_six_components_of_the_liquid_mixer_is_not_realizable(tmp_path: Path) -> None:
    answers = realizability('fret/exports/LM_reqts_and_vars.json', tmp_path)
    assert [item.holds for item in answers].count(False) == 1 and len(answers) == 6
    assert [item.conflicts for item in answers if item.holds is False] == [
        (('LM-001', 'LM-009'),)]
