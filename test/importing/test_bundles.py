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

"""Whole imports: the bundle, the manual tasks, and that the reader accepts the bundle."""

from pathlib import Path
from typing import Any

from fret_monitor.bundle.bundle import Language
from fret_monitor.elaboration.elaborate import specify
from fret_monitor.importing import bundles, import_bundles, Imported, write_bundles
from fret_monitor.importing.draft import Draft, Times
from fret_monitor.logic.specification import Specification
from fret_monitor.model.diagnostics import CompileError, refuse
from fret_monitor.model.policies import InputRole, Policy
from fret_monitor.model.values import ValueType
from importing.examples import (
    DATABASE, DOCUMENT, imported, LUSTRE, PROJECT, refused, requirement, SPECIFICATION, variable,
    written,
)
import pytest
from stages import read_bundle


def meaning(found: Imported) -> Specification:
    """Write a bundle, read it again and return its specification."""
    write_bundles([found])
    return specify(read_bundle(found.path))[0]


def test_a_project_becomes_sentences_constants_definitions_and_inputs(tmp_path: Path) -> None:
    found = imported(tmp_path, moon_json=PROJECT)
    draft = found.draft
    assert [(item.id, item.language) for item in draft.requirements] == [
        ('R-1', Language.FRETISH), ('R-2', Language.FRETISH), ('R-3', Language.FRETISH)]
    assert draft.constants == (('top', '2.5'),)
    assert [(item.name, item.text) for item in draft.definitions] == [
        ('fast', 'speed > top and not armed')]
    assert {item.name: item.type for item in draft.inputs} == {
        'speed': 'float64', 'armed': 'bool', 'hold': 'bool'}
    assert draft.unused == ('unread',)
    assert 'model_port' not in found.text
    assert draft.requirements[0].rationale == 'Wheels wear.\nSee the manual.'
    assert [item.id for item in meaning(found).properties] == ['R-1', 'R-2', 'R-3']


def test_types_of_undeclared_names_in_an_old_export_are_inferred(tmp_path: Path) -> None:
    old = [requirement('A', 'pump shall always satisfy on => level < 4 & this = other',
                       component='<b><i>pump</i></b>')]
    found = imported(tmp_path, old_json=old)
    assert found.draft.component == 'pump'
    assert {item.name: item.type for item in found.draft.inputs} == {
        'on': 'bool', 'level': 'float64', 'this': 'float64', 'other': 'float64'}
    assert any('guessed from the use: on (bool)' in item for item in found.draft.todo)
    meaning(found)


@pytest.mark.timeout(60)
def test_undeclared_names_may_be_compared_twice(tmp_path: Path) -> None:
    found = imported(tmp_path, old_json=[
        requirement('A', 'rover shall always satisfy speed = speed'),
        requirement('B', 'rover shall always satisfy speed = wheel_speed & wheel_speed = speed')])
    assert {item.name: item.type for item in found.draft.inputs} == {
        'speed': 'float64', 'wheel_speed': 'float64'}


def test_html_in_old_exports_is_removed(tmp_path: Path) -> None:
    old = [requirement('A', '', '(H (<b><i>p</i></b> &amp; (<b><i>x</i></b> &lt; 3)))')]
    assert imported(tmp_path, old_json=old).draft.requirements[0].text == '(H (p & (x < 3)))'


def test_a_specification_and_its_database_give_a_complete_bundle(tmp_path: Path) -> None:
    found = imported(tmp_path, spec_json=SPECIFICATION, db_json=DATABASE)
    assert found.draft.component == 'rover'
    assert [(item.name, item.topic, item.type, item.field) for item in found.draft.inputs] == [
        ('speed', '/wheels/speed', 'std_msgs/msg/Float32', None)]
    assert found.draft.todo == ()
    assert 'TO DO' not in found.text
    assert meaning(found).signals[0].type is ValueType.FLOAT32


def test_a_document_of_ogma_is_read_and_its_results_are_left_out(tmp_path: Path) -> None:
    found = imported(tmp_path, doc_json=DOCUMENT, db_json=DATABASE)
    assert found.draft.requirements[0].text == 'level >= 1 && !high'
    assert found.draft.requirements[0].title == 'neither low nor high'
    assert found.draft.definitions[0].text == 'level > 3'
    warnings = '\n'.join(item.render() for item in found.warnings)
    assert "'result_type' and 'result_formula' left out" in warnings
    assert ('level: {topic: ..., type: std_msgs/msg/Int32}   '
            "# db.json connects it to 'cfs', not 'ros/message'") in found.text
    meaning(found)


def test_lustre_gives_guarantees_modes_and_local_variables(tmp_path: Path) -> None:
    found = imported(tmp_path, rover_lus=LUSTRE)
    draft = found.draft
    assert [(item.id, item.language, item.text) for item in draft.requirements] == [
        ('slow', Language.COCOSPEC, 'H(((not fast)) => (out <= top))'),
        ('R-1', Language.FRETISH, 'rover shall always satisfy speed <= top'),
        ('R-assumption', Language.COCOSPEC, '(last >= 0.0)'),
        ('roverSpec_4', Language.COCOSPEC, 'on => armed')]
    assert {item.name: item.text for item in draft.definitions} == {
        'last': '0.0 -> pre speed', 'fast': 'speed > top and not armed'}
    assert draft.constants == (('top', '2.5'),)
    assert any('R-assumption' in item and "'cocospec' is used" in item for item in draft.todo)
    meaning(found)


def test_files_of_one_component_are_one_bundle(tmp_path: Path) -> None:
    found = imported(tmp_path, moon_json=PROJECT, spec_json=SPECIFICATION, rover_lus=LUSTRE)
    assert [item.id for item in found.draft.requirements] == [
        'R-1', 'R-2', 'R-3', 'slow', 'R-assumption', 'roverSpec_4']
    assert found.draft.files == ('moon.json', 'spec.json', 'rover.lus')
    meaning(found)


def test_a_list_gives_topics_and_their_types_are_guessed(tmp_path: Path) -> None:
    listed = '# signals\nspeed /wheels/speed\narmed, battery std_msgs::msg::Bool data\n'
    found = imported(tmp_path, spec_json=SPECIFICATION, signals_txt=listed)
    assert [(item.topic, item.type) for item in found.draft.inputs] == [
        ('/wheels/speed', 'std_msgs/msg/Float64')]
    assert found.draft.todo == (
        "the message type of /wheels/speed ('speed') is guessed: std_msgs/msg/Float64",)
    meaning(found)


def test_a_type_in_a_file_is_not_listed_as_guessed(tmp_path: Path) -> None:
    rover = [requirement('R-1', 'the rover shall always satisfy speed <= 2.0')]
    found = imported(tmp_path, rover_json=rover, list_txt='speed speed std_msgs/msg/Float64\n')
    assert found.draft.todo == ()
    found = imported(tmp_path, rover_json=rover, list_txt='speed speed\n')
    assert [item.partition(':')[0] for item in found.draft.todo] == [
        'no file gives the type of this input; guessed from the use',
        "the message type of speed ('speed') is guessed"]


def test_an_unknown_name_in_a_list_is_reported_with_its_line(tmp_path: Path) -> None:
    listed = 'speed /wheels/speed\nsped foo\n'
    found = imported(tmp_path, spec_json=SPECIFICATION, signals_txt=listed)
    [warning] = found.warnings
    assert warning.title == "no input is called 'sped'"
    assert warning.help == "did you mean 'speed'?"
    assert warning.span is not None
    assert (warning.span.source.name, warning.span.line) == (str(tmp_path / 'signals.txt'), 2)


def test_a_message_with_several_fields_is_a_manual_task(tmp_path: Path) -> None:
    listed = 'speed /battery sensor_msgs/msg/BatteryState\n'
    found = imported(tmp_path, spec_json=SPECIFICATION, signals_txt=listed)
    [todo] = found.draft.todo
    assert todo.startswith("the input 'speed' on /battery: ")
    assert 'field: voltage' in todo


def test_a_message_that_is_not_installed_does_not_stop_an_import(tmp_path: Path) -> None:
    listed = 'speed /speed other_msgs/msg/Speed value\n'
    found = imported(tmp_path, spec_json=SPECIFICATION, signals_txt=listed)
    assert found.draft.inputs[0].type == 'other_msgs/msg/Speed'
    assert 'other_msgs' in found.draft.todo[0]
    assert [item.id for item in found.draft.requirements] == ['R-1']


def test_a_definition_may_refer_to_the_past_of_itself_and_of_others(tmp_path: Path) -> None:
    project = {
        'requirements': [requirement('A', 'rover shall always satisfy top >= start & odd')],
        'variables': [
            variable('x', 'Input', 'double'),
            variable('start', 'Internal', 'double', 'x -> pre start'),
            variable('top', 'Internal', 'double', 'x -> if x > pre top then x else pre top'),
            variable('odd', 'Internal', 'boolean', 'true -> not pre even'),
            variable('even', 'Internal', 'boolean', 'false -> pre odd')]}
    found = imported(tmp_path, own_json=project)
    texts = {item.name: item.text for item in found.draft.definitions}
    assert texts['start'] == 'start = x -> pre start;'
    assert texts['odd'] == 'even = false -> pre odd; odd = true -> not pre even;'
    assert {item.name for item in found.draft.inputs} == {'x'}
    meaning(found)


def test_a_definition_that_cannot_be_used_is_a_manual_task(tmp_path: Path) -> None:
    project: dict[str, Any] = {**PROJECT, 'variables': [
        variable('speed', 'Input', 'double'), variable('armed', 'Input', 'boolean'),
        variable('top', 'Internal', 'double', 'table(speed)'),
        variable('fast', 'Internal', 'boolean'), variable('hold', 'Mode', 'boolean')]}
    found = imported(tmp_path, moon_json=project)
    assert {item.name for item in found.draft.inputs} == {'speed', 'armed', 'hold', 'top', 'fast'}
    assert any("'top' is an internal variable, and its value cannot be" in item
               for item in found.draft.todo)
    assert any("'fast' is an internal variable, and it has no value" in item
               for item in found.draft.todo)
    meaning(found)


def test_what_cannot_be_monitored_is_a_comment_and_a_task(tmp_path: Path) -> None:
    project = {'requirements': [
        requirement('Good', 'rover shall always satisfy speed < 3'),
        requirement('Sine', 'rover shall always satisfy gamma(speed) < 0.5',
                    '(H (gamma(speed) < 1))'),
        requirement('Empty', '')]}
    found = imported(tmp_path, moon_json=project)
    assert [item.id for item in found.draft.requirements] == ['Good']
    assert [item.id for item, _ in found.draft.left_out] == ['Sine', 'Empty']
    assert '#  left out: Sine (' in found.text
    assert any('not monitored' in item and 'Sine' in item for item in found.draft.todo)
    assert any('Empty' in item and 'no formula' in item for item in found.draft.todo)
    meaning(found)


def test_real_time_is_offered_where_durations_have_units(tmp_path: Path) -> None:
    timed = requirement('R-4', 'when armed rover shall within 2 seconds satisfy fast')
    counted = requirement('R-5', 'rover shall always satisfy persisted(3, fast)')
    plain = imported(tmp_path, moon_json=PROJECT)
    assert plain.draft.times is None
    assert 'timed' not in plain.text
    project = {**PROJECT, 'requirements': [timed]}
    found = imported(tmp_path, moon_json=project)
    assert '# Durations count messages here. For real time (R-4) write:\n' \
        '# evaluation: {policy: timed}\nrequirements:\n' in found.text
    assert meaning(found).policy is Policy.EVERY_MESSAGE
    found.path.write_text(found.text.replace('# evaluation', 'evaluation'), encoding='utf-8')
    assert specify(read_bundle(found.path))[0].properties[0].bounds == (2_000_000_000,)
    found = imported(tmp_path, moon_json={**PROJECT, 'requirements': [timed, counted]})
    assert found.draft.times == Times(('R-4',), (), 'evaluation: {policy: timed, unit: 1}')
    ticks = {**PROJECT, 'requirements': [*PROJECT['requirements'], timed]}
    found = imported(tmp_path, moon_json=ticks)
    assert found.draft.times is not None
    assert found.draft.times.refused == ('R-3',)
    assert '# and give times to the counts of R-3\n' in found.text


def test_the_formula_is_used_if_the_sentence_is_invalid(tmp_path: Path) -> None:
    project = {'requirements': [
        requirement('A', 'It may not speed', '(H (speed < 3))', 'H(speed < 3)')]}
    found = imported(tmp_path, moon_json=project)
    [item] = found.draft.requirements
    assert (item.language, item.text) == (Language.PTLTL, '(H (speed < 3))')
    assert item.title == 'It may not speed'
    assert any("'ptltl' is used, because the 'fretish'" in task for task in found.draft.todo)


def test_wordings_that_differ_are_reported_with_the_trace(tmp_path: Path) -> None:
    project = {'requirements': [requirement(
        'A', 'rover shall always satisfy speed < 3', '(H (speed <= 3))', 'H(speed < 3)')]}
    found = imported(tmp_path, moon_json=project)
    [(path, text)] = found.traces
    assert path == tmp_path / 'bundle.A.1.csv'
    rows = text.split()
    assert rows[0] == 'speed'
    assert rows[-1] == '3.0'
    [warning] = found.warnings
    assert "'A': two wordings differ at step" in warning.title
    assert 'sentence: false\n' in warning.help
    assert 'ptLTL: true' in warning.help
    assert found.draft.requirements[0].language is Language.FRETISH
    assert path.name in found.text


def test_wordings_that_agree_are_not_reported(tmp_path: Path) -> None:
    found = imported(tmp_path, spec_json=SPECIFICATION)
    assert found.traces == ()
    assert found.warnings == ()


def test_ids_with_the_same_handler_get_numbers(tmp_path: Path) -> None:
    project = {'requirements': [
        requirement('A-1', 'rover shall always satisfy p'),
        requirement('A.1', 'rover shall always satisfy q'),
        requirement('A-1', 'rover shall always satisfy r')]}
    found = imported(tmp_path, moon_json=project)
    assert [item.id for item in found.draft.requirements] == ['A-1', 'A.1_2', 'A-1_3']
    assert len(found.warnings) == 2
    meaning(found)


def test_names_of_fret_keep_their_dots_and_blanks(tmp_path: Path) -> None:
    project = {
        'requirements': [requirement('A', 'rover shall always satisfy arm.angle < 3 & "is on"',
                                     '(H ((arm_DOT_angle < 3) & _DQT_is_SPC_on_DQT_))')],
        'variables': [variable('arm.angle', 'Input', 'double'),
                      variable('"is on"', 'Input', 'boolean')]}
    found = imported(tmp_path, moon_json=project)
    assert [item.name for item in meaning(found).signals] == ['arm.angle', 'is on']
    assert len(found.draft.comparisons[0].properties) == 2
    assert found.traces == ()


def test_a_variable_with_an_invalid_name_is_reported(tmp_path: Path) -> None:
    project: dict[str, Any] = {**PROJECT, 'variables': [
        *PROJECT['variables'], variable('H', 'Input', 'double')]}
    found = imported(tmp_path, moon_json=project)
    assert any("the variable 'H' is left out" in item.title for item in found.warnings)


SEVERAL = {'requirements': [
    requirement('A', 'rover shall always satisfy p'),
    requirement('A', 'lander shall always satisfy p', component='lander'),
    requirement('A', 'rover shall always satisfy q', project='Mars')]}


def test_several_components_are_refused_with_their_names(tmp_path: Path) -> None:
    reason = refused(tmp_path, many_json=SEVERAL)
    assert 'Moon/rover, Moon/lander, Mars/rover' in reason
    assert '--component Moon/rover' in reason


@pytest.mark.parametrize('name, texts', [
    ('lander', ['lander shall always satisfy p']),
    ('Mars/rover', ['rover shall always satisfy q'])])
def test_a_component_is_chosen_by_its_name(tmp_path: Path, name: str, texts: list[str]) -> None:
    paths = written(tmp_path, many_json=SEVERAL)
    [found] = import_bundles(paths, tmp_path / 'bundle.yaml', name)
    assert [item.text for item in found.draft.requirements] == texts


def test_an_ambiguous_component_name_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CompileError, match='there are 2 components'):
        import_bundles(written(tmp_path, many_json=SEVERAL), tmp_path / 'b.yaml', 'rover')


def test_an_unknown_component_is_refused_with_the_known_ones(tmp_path: Path) -> None:
    with pytest.raises(CompileError, match="did you mean 'Moon/lander'"):
        import_bundles(written(tmp_path, many_json=SEVERAL), tmp_path / 'b.yaml', 'Moon/landr')


def test_a_folder_takes_a_bundle_of_each_component(tmp_path: Path) -> None:
    found = import_bundles(written(tmp_path, many_json=SEVERAL), tmp_path / 'all', is_folder=True)
    assert [item.path.name for item in found] == ['Moon_rover.yaml', 'lander.yaml',
                                                  'Mars_rover.yaml']
    write_bundles(found)
    for item in found:
        specify(read_bundle(item.path))


def test_an_existing_bundle_is_not_overwritten(tmp_path: Path) -> None:
    found = import_bundles(written(tmp_path, moon_json=PROJECT), tmp_path / 'bundle.yaml')
    found[0].path.write_text('mine')
    with pytest.raises(CompileError, match='--force'):
        write_bundles(found)
    assert found[0].path.read_text() == 'mine'
    write_bundles(found, force=True)
    assert found[0].path.read_text() == found[0].text
    assert sorted(path.name for path in tmp_path.iterdir()) == ['bundle.yaml', 'moon.json']


@pytest.mark.parametrize('content, reason', [
    ('{"requirements": [', '1:19: error: this is not JSON'),
    ('{"requirements": [{"reqid": }]}', '1:29: error: this is not JSON'),
    ('[' * 100_000, 'nested too deeply'),
    ('{"a": NaN}', 'NaN is not a number'),
    ('{"requirements": [{"a": 1}]}', 'not an export of FRET or Ogma'),
    ('[1, 2]', 'not an export of FRET or Ogma'),
    ('{"inputs": [], "topics": []}', 'there is no requirement in'),
    ('{"C": {"Requirements": [], "Other_variables": []}}', 'there is no requirement in'),
    ('', 'is not a file that can be imported'),
    ('a b c d e f', 'is not a file that can be imported'),
    ('%PDF-1.4', 'is not a file that can be imported'),
    ('node f(x: bool) returns (y: bool);\nlet y = x; tel', 'has no contract'),
    ('contract c (x: bool) returns (y: bool);\nlet guarantee x', "';' is missing"),
    ('contract c (x: bool) returns (y: bool);\nlet guarantee ; tel', 'there is no expression'),
    ('contract c (x bool) returns (y: bool);', "',' or ':' was expected"),
    ('(*@contract guarantee "a" x; *)', 'a contract inside a node is not supported')])
def test_what_cannot_be_imported_is_refused_with_a_reason(tmp_path: Path, content: str,
                                                          reason: str) -> None:
    assert reason in refused(tmp_path, odd_json=content)


def test_a_project_without_usable_requirements_is_refused(tmp_path: Path) -> None:
    project = {'requirements': [requirement('A', 'rover shall always satisfy gamma(x) < 1')]}
    reason = refused(tmp_path, moon_json=project)
    assert "there is no function 'gamma'" in reason and 'did you mean' not in reason


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CompileError, match='there is no file'):
        import_bundles([tmp_path / 'none.json'], tmp_path / 'b.yaml')


@pytest.mark.parametrize('value', [None, 1, 'text', [], {}, [[]], {'reqid': {}}])
@pytest.mark.parametrize('key', ['fulltext', 'semantics', 'project', 'rationale', '_id'])
def test_values_of_another_shape_are_ignored(tmp_path: Path, key: str, value: object) -> None:
    item = {**requirement('A', 'rover shall always satisfy p', '(H p)', 'H(p)'), key: value}
    good = requirement('B', 'rover shall always satisfy p')
    paths = written(tmp_path, odd_json={'requirements': [item, good], 'variables': value})
    for found in import_bundles(paths, tmp_path / 'all', is_folder=True):
        assert found.draft.requirements


@pytest.mark.parametrize('name, sentence, component', [
    ('roverSpec', 'rover shall always satisfy p', 'rover'),
    ('roverSpec', 'roverSpec shall always satisfy p', 'roverSpec'),
    ('Any', 'when q the rover shall always satisfy p', 'rover'),
    ('roverSpec', '', 'rover'),
    ('Spec', '', 'Spec')])
def test_the_component_is_the_one_that_sentences_name(tmp_path: Path, name: str, sentence: str,
                                                      component: str) -> None:
    specification = {name: {'Other_variables': [], 'Requirements': [
        {'name': 'A', 'fretish': sentence, 'ptLTL': 'H p'}]}}
    found = imported(tmp_path, spec_json=specification)
    assert found.draft.component == component
    assert found.draft.requirements[0].language is (
        Language.FRETISH if sentence else Language.PTLTL)


def test_a_broken_definition_that_nothing_uses_is_not_a_task(tmp_path: Path) -> None:
    project: dict[str, Any] = {**PROJECT, 'variables': [
        *PROJECT['variables'], variable('odd', 'Internal', 'double', 'table(speed)')]}
    found = imported(tmp_path, moon_json=project)
    assert len(found.draft.todo) == 1
    assert found.draft.unused == ('unread', 'odd')


STRAY = requirement('R-3', 'rover must be nice', component='')
SINE = requirement('S', 'arm shall always satisfy gamma(x) < 1', component='arm')


def test_a_requirement_without_component_is_a_comment_in_the_only_one(tmp_path: Path) -> None:
    project = {'requirements': [
        requirement('R-1', 'rover shall always satisfy p'), STRAY,
        requirement('R-2', 'rover shall always satisfy q')]}
    found = imported(tmp_path, moon_json=project)
    assert found.draft.component == 'rover'
    assert [item.id for item in found.draft.requirements] == ['R-1', 'R-2']
    assert [item.id for item, _ in found.draft.left_out] == ['R-3']
    assert '#  left out: R-3 (' in found.text
    assert 'fretish: rover must be nice' in found.text
    assert any('not monitored' in item and 'R-3' in item for item in found.draft.todo)
    meaning(found)
    [alone] = import_bundles([tmp_path / 'moon.json'], tmp_path / 'all', is_folder=True)
    assert alone.draft == found.draft
    [chosen] = import_bundles([tmp_path / 'moon.json'], tmp_path / 'b.yaml', 'Moon/rover')
    assert chosen.draft == found.draft
    assert [item.title for item in chosen.warnings] == ["'must be' is not FRETish"]


def test_a_stray_requirement_joins_the_only_component_of_its_project(tmp_path: Path) -> None:
    project = {'requirements': [
        requirement('A', 'rover shall always satisfy p'),
        requirement('A', 'rover shall always satisfy q', project='Mars'), STRAY]}
    found = import_bundles(written(tmp_path, many_json=project), tmp_path / 'all', is_folder=True)
    assert [(item.path.name, [one.id for one, _ in item.draft.left_out]) for item in found] == [
        ('Moon_rover.yaml', ['R-3']), ('Mars_rover.yaml', [])]


def test_a_stray_requirement_joins_the_component_of_a_specification(tmp_path: Path) -> None:
    found = imported(tmp_path, moon_json={'requirements': [STRAY]}, spec_json=SPECIFICATION)
    assert [item.id for item in found.draft.requirements] == ['R-1']
    assert [item.id for item, _ in found.draft.left_out] == ['R-3']


def test_a_folder_gets_the_usable_components_and_the_rest_is_reported(tmp_path: Path) -> None:
    project = {'requirements': [
        SINE, STRAY, requirement('R-1', 'rover shall always satisfy p'),
        requirement('R-1', 'lander shall always satisfy p', component='lander')]}
    found = import_bundles(written(tmp_path, many_json=project), tmp_path / 'all', is_folder=True)
    assert [item.path.name for item in found] == ['rover.yaml', 'lander.yaml']
    titles = [item.title for item in found[0].warnings]
    assert "no bundle for 'Moon/arm', as no requirement can be monitored: S" in titles
    assert 'in no bundle, because they have no component: R-3' in titles
    assert "there is no function 'gamma'" in titles
    assert found[1].warnings == ()


def test_a_folder_without_any_usable_requirement_is_refused(tmp_path: Path) -> None:
    paths = written(tmp_path, many_json={'requirements': [
        SINE, requirement('L', 'lander shall always satisfy erf(x) < 1', component='lander')]})
    with pytest.raises(CompileError) as raised:
        import_bundles(paths, tmp_path / 'all', is_folder=True)
    assert "there is no function 'gamma'" in str(raised.value)
    assert "there is no function 'erf'" in str(raised.value)
    assert 'warning' not in str(raised.value)


@pytest.mark.parametrize('is_folder', [True, False])
def test_requirements_of_other_components_are_reported(tmp_path: Path, is_folder: bool) -> None:
    paths = written(tmp_path, many_json={'requirements': [*SEVERAL['requirements'], requirement(
        'B', 'lander shall always satisfy q', component='lander'), STRAY, requirement(
        'L-1', 'lander shall always satisfy r', component='lander')]})
    [found] = import_bundles(paths, tmp_path / 'b', 'Moon/rover', is_folder=is_folder)
    assert [item.title for item in found.warnings] == [
        'left out, as not part of Moon/rover: Moon/lander (3 requirements), Mars/rover '
        '(1 requirement)',
        'in no bundle, because they have no component: R-3']


def test_components_to_choose_from_have_names(tmp_path: Path) -> None:
    reason = refused(tmp_path, many_json={'requirements': [STRAY, *SEVERAL['requirements']]})
    assert 'there are 3 components, but a bundle is for one: Moon/rover, Moon/lander' in reason
    assert 'Moon/,' not in reason


def test_requirements_without_any_component_are_a_bundle(tmp_path: Path) -> None:
    project = {'requirements': [STRAY, requirement('A', '', 'H p', component='')]}
    found = imported(tmp_path, moon_json=project)
    assert found.draft.component == ''
    assert [item.id for item in found.draft.requirements] == ['A']
    assert [item.title for item in found.warnings] == ["'must be' is not FRETish"]
    meaning(found)


def test_files_in_a_folder_have_distinct_names(tmp_path: Path) -> None:
    project = {'requirements': [
        requirement('A', 'it shall always satisfy p', 'H p', component=name)
        for name in ('a b', 'a_b', 'x' * 300, 'x' * 300 + 'y')]}
    found = import_bundles(written(tmp_path, many_json=project), tmp_path / 'all', is_folder=True)
    write_bundles(found)
    assert len({item.path for item in found}) == 4
    assert found[1].path.name == 'Moon_a_b_2.yaml'


def test_modes_of_an_old_export_are_true_or_false(tmp_path: Path) -> None:
    old = requirement('A', '', 'H (mode_a = mode_b)')
    old['semantics']['variables'] = {'regular': ['mode_b'], 'modes': ['mode_a']}
    assert {item.type for item in imported(tmp_path, old_json=[old]).draft.inputs} == {'bool'}


def test_functions_and_probabilities_of_a_specification_are_left_out(tmp_path: Path) -> None:
    specification = {'roverSpec': {
        'Other_variables': [{'name': 'x', 'type': 'real'}],
        'Functions': [{'name': 'sine', 'moduleName': 'math'}],
        'Requirements': [{'name': 'A', 'ptLTL': 'H (x < 1)', 'PCTL': 'P>=0.9 [G (x < 1)]'}]}}
    found = imported(tmp_path, spec_json=specification)
    assert 'sine' not in found.text
    assert 'its probability is left out' in found.warnings[0].title


def test_a_second_topic_of_an_input_is_reported(tmp_path: Path) -> None:
    found = imported(tmp_path, spec_json=SPECIFICATION, db_json=DATABASE,
                     more_txt='speed /other\n')
    assert found.draft.inputs[0].topic == '/wheels/speed'
    warning, _ = found.warnings  # the other one is about unused names
    assert "'speed' has a topic already" in warning.title


def test_lone_surrogates_do_not_get_into_a_bundle(tmp_path: Path) -> None:
    project = {'requirements': [requirement('A\ud800', 'rover shall always satisfy p',
                                            rationale='half \udc00')]}
    found = imported(tmp_path, moon_json=project)
    assert found.draft.requirements[0].id == 'A?'
    assert found.draft.requirements[0].rationale == 'half ?'
    meaning(found)


def test_equations_in_a_specification_keep_their_own_names(tmp_path: Path) -> None:
    specification = {'roverSpec': {
        'Other_variables': [{'name': 'x', 'type': 'real'}],
        'Requirements': [{'name': 'A', 'CoCoSpecCode': 'low = x < 1; all = H(low);'}]}}
    found = imported(tmp_path, spec_json=specification)
    assert [item.name for item in found.draft.inputs] == ['x']
    meaning(found)


def test_a_reserved_name_is_renamed(tmp_path: Path) -> None:
    project = {
        'requirements': [
            requirement('A', 'rover shall always satisfy pre > 3 & (H | speed < pre)',
                        '(H ((pre > 3) & speed))'),
            requirement('B', 'in Y mode rover shall always satisfy armed => fast')],
        'variables': [
            variable('pre', 'Input', 'integer'), variable('pre_value', 'Input', 'double'),
            variable('fast', 'Internal', 'boolean', 'speed > Z'), variable('Y', 'Mode', '')]}
    found = imported(tmp_path, moon_json=project, topics_txt='pre /wheels/pre')
    assert {item.name: item.type for item in found.draft.inputs} == {
        'pre_value_2': 'std_msgs/msg/Int64', 'H_value': 'bool', 'speed': 'float64',
        'Y_value': 'bool', 'armed': 'bool', 'Z_value': 'float64'}
    assert [item.text for item in found.draft.requirements] == [
        'rover shall always satisfy pre_value_2 > 3 & (H_value | speed < pre_value_2)',
        'in Y_value mode rover shall always satisfy armed => fast']
    assert [(item.name, item.text) for item in found.draft.definitions] == [
        ('fast', 'speed > Z_value')]
    assert '# Renamed: pre is pre_value_2, H is H_value' in found.text
    titles = [item.title for item in found.warnings]
    assert "'pre' is named 'pre_value_2' in the bundle" in titles
    assert "no input is called 'pre'" not in titles
    meaning(found)


def test_one_component_that_cannot_be_written_does_not_stop_the_others(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    [path] = written(tmp_path, moon_json=[
        requirement('A', 'rover shall always satisfy speed < 3'),
        requirement('B', 'lander shall always satisfy speed < 3', component='lander')])
    monkeypatch.setattr(bundles, '_read_back', refuse_lander)
    found = import_bundles([path], tmp_path / 'bundles', is_folder=True)
    assert [item.draft.component for item in found] == ['rover']
    assert 'not a name' in [item.title for item in found[0].warnings]


def refuse_lander(text: str, whole: Draft, path: Path) -> None:
    """Refuse one component as the reader of bundles would."""
    if whole.component == 'lander':
        refuse('not a name')


@pytest.mark.parametrize('type', ['', 'enum'])
def test_an_unknown_type_of_fret_is_guessed(tmp_path: Path, type: str) -> None:
    project = {'requirements': [requirement('A', 'rover shall always satisfy speed < 3 & armed')],
               'variables': [variable('speed', 'Input', type), variable('armed', 'Input', 'bool')]}
    found = imported(tmp_path, moon_json=project)
    [guess] = [item for item in found.draft.todo if 'guessed' in item]
    assert guess.endswith(': speed (float64)')


def test_a_mode_without_a_type_is_not_guessed(tmp_path: Path) -> None:
    project = {'requirements': [requirement('A', 'in hold mode rover shall always satisfy armed')],
               'variables': [variable('hold', 'Mode', ''), variable('armed', 'Input', 'boolean')]}
    assert not any('guess' in item for item in imported(tmp_path, moon_json=project).draft.todo)


@pytest.mark.parametrize('placeholder', [
    'Meaning not specified', 'No meaning assigned.', 'Under construction.', 'Unhandled.'])
def test_placeholders_of_tools_are_not_read_as_formulas(tmp_path: Path, placeholder: str) -> None:
    sentence = 'rover shall always satisfy speed < 3'
    found = imported(tmp_path, moon_json=[
        requirement('A', sentence, placeholder, 'true'),
        requirement('B', placeholder, '(H (speed < 3))', 'true'),
        requirement('C', placeholder, placeholder, placeholder)])
    assert found.warnings == () and found.traces == ()
    assert [item.text for item in found.draft.requirements] == [sentence, '(H (speed < 3))']
    assert found.draft.requirements[1].title == ''
    assert [(item.id, reason) for item, reason in found.draft.left_out] == [
        ('C', 'it has no formula')]


def test_arrays_are_reported_as_unsupported(tmp_path: Path) -> None:
    project = {'requirements': [
        requirement('A', 'rover shall always satisfy wheels(3) < 3'),
        requirement('B', 'rover shall always satisfy length(wheels, 2) < speed'),
        requirement('C', 'rover shall always satisfy speed < 3'),
        requirement('D', 'rover shall always satisfy yout(3) < 3')],
        'variables': [variable('wheels', 'Input', 'double'), variable('length', 'Input', '')]}
    found = imported(tmp_path, moon_json=project)
    assert [(item.id, reason) for item, reason in found.draft.left_out] == [
        ('A', 'arrays are not supported'), ('B', "there is no function 'length'"),
        ('D', "there is no function 'yout', and arrays are not supported")]


def test_unused_names_of_a_database_are_reported(tmp_path: Path) -> None:
    found = imported(tmp_path, spec_json=SPECIFICATION, db_json=DATABASE)
    titles = [item.title for item in found.warnings]
    assert "db.json: no requirement or variable is called 'level'" in titles


def test_free_text_in_quotes_is_not_read_as_a_formula(tmp_path: Path) -> None:
    found = imported(tmp_path, moon_json=[
        requirement('A', 'rover shall always satisfy speed < 3'),
        requirement('B', '"the rover is nice"')])
    [(_, reason)] = found.draft.left_out
    assert reason == 'free text cannot be monitored'


def test_types_are_inferred_from_a_definition_of_its_own_past(tmp_path: Path) -> None:
    project = {'requirements': [requirement('A', 'rover shall always satisfy !latched')],
               'variables': [variable('latched', 'Internal', 'boolean',
                                      'tripped or (false -> pre latched)')]}
    found = imported(tmp_path, moon_json=project)
    assert {item.name: item.type for item in found.draft.inputs} == {'tripped': 'bool'}
    assert [item.name for item in found.draft.definitions] == ['latched']
    meaning(found)


def test_outputs_and_assumptions_of_fret_are_kept(tmp_path: Path) -> None:
    items = [requirement('A-assumption', 'rover shall always satisfy speed < 4'),
             requirement('B', 'rover shall always satisfy speed < 2 => open')]
    variables = [variable('speed', 'Input', 'double'), variable('open', 'Output', 'boolean')]
    contract = ('(*@contract roverSpec (speed: real;) returns (open: bool;); let '
                'assume "A" speed < 4.0; guarantee "B" speed < 2.0 => open; tel *)')
    for files in ({'a_json': {'requirements': items, 'variables': variables}},
                  {'a_lus': contract}):
        meant = meaning(imported(tmp_path, **files))
        assert [item.is_assumption for item in meant.properties] == [True, False]
        assert {item.name: item.role for item in meant.signals} == {
            'speed': InputRole.INPUT, 'open': InputRole.OUTPUT}
        (tmp_path / 'bundle.yaml').unlink(missing_ok=True)


def test_the_formula_for_r2u2_is_taken_where_there_is_no_other(tmp_path: Path) -> None:
    code = '((((mode == 2) && (speed <= 20.0)) && armed) -> (F[1,1] (mode == 2)))'
    project = {'requirements': [
        {'reqid': 'R-1', 'project': 'P', 'fulltext': '', 'semantics': {
            'component_name': 'rover', 'pt': 'Meaning not specified', 'R2U2Code': code}},
        {'reqid': 'R-2', 'project': 'P', 'fulltext': 'the rover shall always satisfy armed',
         'semantics': {'component_name': 'rover', 'R2U2Code': 'G[0,3] armed'}}]}
    found = imported(tmp_path, p_json=project)
    assert [(item.language.value, item.text) for item in found.draft.requirements] == [
        ('mltl', code), ('fretish', 'the rover shall always satisfy armed')]
    assert [item.horizon for item in meaning(found).properties] == [1, 0]
