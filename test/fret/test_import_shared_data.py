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

"""Real exports of FRET and Ogma, if present: imported completely, with equal verdicts."""

from pathlib import Path

from facts import FOLDER, path as facts_path
from fret_monitor.bundle.bundle import Language
from fret_monitor.elaboration.elaborate import specify
from fret_monitor.importing import import_bundles, Imported, write_bundles
from fret_monitor.model.diagnostics import CompileError
import pytest
from stages import read_bundle

FSM = ('fret/exports/fsm_reqts_and_vars.json', 'fret/exports/FSMSpec.json',
       'fret/exports/FSMSpec.lus')


def imported(folder: Path, *names: str) -> Imported:
    """Import files, and see that our own reader understands the bundle."""
    [found] = import_bundles([facts_path(name) for name in names], folder / 'bundle.yaml')
    write_bundles([found])
    specify(read_bundle(found.path))
    return found


@pytest.mark.parametrize('names', [FSM[:1], FSM[1:2], FSM[2:], FSM])
def test_the_project_of_fret_is_imported_from_each_of_its_exports(
        tmp_path: Path, names: tuple[str, ...]) -> None:
    found = imported(tmp_path, *names)
    draft = found.draft
    assert draft.component == 'FSM'
    assert len(draft.requirements) == 13
    assert {item.language for item in draft.requirements} == {Language.FRETISH}
    assert len(draft.constants) == 7
    assert len(draft.inputs) == 11
    assert len(draft.todo) == 1  # the topics
    assert sum(len(item.properties) for item in draft.comparisons) >= 26
    assert found.traces == ()


def test_ogmas_tutorial_gives_a_bundle_that_is_ready(tmp_path: Path) -> None:
    found = imported(tmp_path, 'ogma/ros2-hello-expressions.json', 'ogma/ros2-hello-db.json')
    assert found.draft.todo == ()
    assert found.draft.inputs[0].topic == '/ros2/example1'


def test_ogmas_example_gives_a_bundle_that_is_ready(tmp_path: Path) -> None:
    found = imported(tmp_path, 'ogma/ros-copilot-document.json', 'ogma/ros-copilot-vars-db.json')
    assert found.draft.todo == ()
    assert len(found.draft.inputs) == 3
    assert 'result_formula' in found.warnings[0].title


def test_placeholders_of_ogma_are_no_formulas(tmp_path: Path) -> None:
    # Its CoCoSpec is `true`, its sentence 'Meaning not specified', and its ptLTL names inputs
    # that it does not declare.
    found = imported(tmp_path, 'ogma/fcs-2.json')
    assert found.traces == ()
    assert found.warnings == ()
    assert found.draft.requirements[0].language is Language.PTLTL
    assert {item.name for item in found.draft.inputs} == {
        'flight_mode', 'conflict_detected', 'replanning_mode'}


def test_every_other_file_is_imported_or_refused(tmp_path: Path) -> None:
    files = sorted(item for item in FOLDER.rglob('*') if item.is_file())
    if not files:
        pytest.skip('no facts are here')
    for number, file in enumerate(files):
        try:
            found = import_bundles([file], tmp_path / str(number), is_folder=True)
        except CompileError as error:
            assert 'requirement' in str(error) or 'not a file that can be imported' in str(error)
        else:
            write_bundles(found)
            for item in found:
                specify(read_bundle(item.path))
