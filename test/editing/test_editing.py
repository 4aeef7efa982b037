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

"""What an editor knows of a bundle: places, hover, proposals, names, fixes, of broken text too."""

from dataclasses import dataclass
from pathlib import Path
import time

from fret_monitor import editing
from fret_monitor.build import generate_monitor, read
from fret_monitor.bundle.bundle import Language
from fret_monitor.bundle.source_file import read_source
from fret_monitor.editing.edited_bundle import EditedBundle
from fret_monitor.editing.outline import ITEM
from fret_monitor.elaboration.languages import read_formula
from fret_monitor.model.diagnostics import CompileError, Level, Source, Text
import golden
import pytest
from strategies import some, thorough

CONFIG = Path(__file__).resolve().parents[2] / 'config'
BUNDLE = """\
format: 1
component: base
constants: {limit: 1.5, steps: 3}
inputs:
  speed: {topic: odom, type: nav_msgs/msg/Odometry, field: twist.twist.linear.x}
  battery:   # a comment
    topic: battery_state
    type: sensor_msgs/msg/BatteryState
    field: percentage
  state:
    type: int32
    values: {IDLE: 0, DRIVING: 1}
  "\\"mode\\"": {type: bool}
definitions:
  fast: speed > limit
actions:
  stop: {lock: {topic: e_stop}}
requirements:
  - id: SLOW
    title: not too fast
    fretish: whenever state = IDLE the base shall immediately satisfy ! fast
    on_violation: stop
  - id: CHARGED
    ptltl: "H[0,steps] (battery > 0.2) | speed <= limit"
"""

HEAD = 'format: 1\ninputs:\n  speed: {type: float64}\n'


@dataclass(frozen=True)
class Marked:
    """A text without the mark, and where that was."""

    text: str
    offset: int

    @property
    def edited(self) -> EditedBundle:
        return editing.read_edited(Path('b.yaml'), self.text)


def marked(text: str) -> Marked:
    """Return a text in which `<>` marks a place."""
    before, _, after = text.partition('<>')
    return Marked(before + after, len(before))


def at(word: str, behind: str = '', text: str = BUNDLE) -> Marked:
    """Return a bundle with a place in a word, the first one behind another text."""
    return Marked(text, text.index(word, text.index(behind)) + len(word) // 2)


def labels(place: Marked, **given: object) -> dict[str, str]:
    """Return the proposals at a place: their labels with the texts that they would write."""
    found = editing.complete(place.edited, place.offset, **given)  # type: ignore[arg-type]
    return {item.label: item.text for item in found}


# -- diagnostics ---------------------------------------------------------------------------------

@pytest.mark.parametrize('path', [*golden.cases('bundle')[::6], *golden.cases('check')[::3]],
                         ids=lambda path: path.stem)
def test_the_diagnostics_of_a_text_are_those_of_check(path: Path) -> None:
    try:
        expected = generate_monitor(read(path, takes_instances=True)).warnings
    except CompileError as error:
        expected = error.diagnostics
    found = editing.read_edited(path, read_source(path).text)
    assert [item.render() for item in found.diagnostics] == [item.render() for item in expected]


def test_a_diagnostic_names_the_other_place_and_its_kind() -> None:
    text = BUNDLE.replace('id: CHARGED', 'id: SLOW').replace('steps: 3', 'steps: 3, speed: 4')
    found = editing.read_edited(Path('b.yaml'), text).diagnostics
    assert [(editing.code_of(item), item.span and item.span.line,
             item.related and item.related.line) for item in found] == [
        ('is-declared-twice', 5, 3), ('the-id-is-given-twice', 23, 19)]


def test_more_state_than_there_may_be_is_an_error_here_too() -> None:
    text = BUNDLE.replace('H[0,steps] (battery > 0.2)', 'O[1000000000,2000000000] fast')
    found, = editing.read_edited(Path('b.yaml'), text).diagnostics
    assert found.level is Level.ERROR and 'state' in found.title


def test_a_text_that_is_open_counts_in_place_of_the_file(tmp_path: Path) -> None:
    path, signals = tmp_path / 'b.yaml', tmp_path / 'signals.yaml'
    path.write_text('broken', encoding='utf-8')
    signals.write_text('inputs: {old: {type: bool}}\n', encoding='utf-8')
    text = 'format: 1\nsignals: signals.yaml\nrequirements: [{id: A, ptltl: new}]\n'
    saved = editing.read_edited(path, text)
    assert [item.title for item in saved.diagnostics] == ["'new' is not declared"]
    opened = editing.read_edited(path, text, read_file=lambda other: Source(
        str(other), 'inputs: {new: {type: bool}}'))
    assert opened.diagnostics == ()
    assert [str(item.source.name) for item in editing.definition(opened, text.index('new'))] == [
        str(signals)]


TYPED = """\
format: 1
constants: {limit: 1.5}
inputs:
  speed: {topic: odom, type: nav_msgs/msg/Odometry, field: twist.twist.linear.x}
  on: {topic: on, type: std_msgs/msg/Bool}
definitions: {fast: speed > limit}
requirements:
  - {id: ONE, ptltl: "on -> ! fast"}
  - {id: TWO, fretish: when on the base shall eventually satisfy speed <= limit}
  - {id: SAME, ptltl: "speed = 0.1 | on"}
  - {id: MANY, ptltl: "H[0, 3] on -> speed < 2 * limit"}
"""


@pytest.mark.parametrize('behind, typed', [
    ('! fast', ' & speed > 0.1'), ('! fast', ' &\n   on'), ('speed <= limit', ' & "o'),
    ('limit: 1.5', '0'), ('  on', 'e'), ('SAME', ' | Y on'), ('speed > limit', ' + ')])
def test_what_was_read_before_changes_no_diagnostic(behind: str, typed: str) -> None:
    memory, path = editing.RequirementMemory(), Path('b.yaml')
    place = TYPED.index(behind) + len(behind)
    for end in (*range(len(typed) + 1), *range(len(typed), -1, -1)):
        text = TYPED[:place] + typed[:end] + TYPED[place:]
        found = editing.read_edited(path, text, memory=memory)
        expected = editing.read_edited(path, text)
        assert [item.render() for item in found.diagnostics] == [
            item.render() for item in expected.diagnostics], text
        assert (found.reading is None) == (expected.reading is None)
        if found.reading and expected.reading:
            assert generate_monitor(found.reading).manifest == generate_monitor(
                expected.reading).manifest


def test_only_the_requirement_that_changes_is_read_again(monkeypatch: pytest.MonkeyPatch) -> None:
    read_again = []

    def count(language: Language, text: Text, *, is_timed: bool = False) -> object:
        read_again.append(text.value)
        return read_formula(language, text, is_timed=is_timed)

    monkeypatch.setattr('fret_monitor.elaboration.elaborate.read_formula', count)
    memory = editing.RequirementMemory()
    text = TYPED.replace('eventually', 'always').replace('speed = 0.1', 'speed < 0.1')
    for replaced, expected in (('', 4), ('! fast & on', 1), ('! fast &', 1), ('! fast & !on', 1)):
        editing.read_edited(Path('b.yaml'), text.replace('! fast', replaced or '! fast'),
                            memory=memory)
        assert len(read_again) == expected, replaced
        read_again.clear()
    editing.read_edited(Path('b.yaml'), text.replace('1.5', '1.25'), memory=memory)
    assert len(read_again) == 4


def test_a_signals_file_has_the_errors_of_its_inputs_and_needs_no_requirements() -> None:
    text = 'inputs:\n  x: {type: bool}\n  y: {type: std_msgs/msg/Floot32}\n'
    found = editing.read_edited(Path('signals.yaml'), text)
    assert [(item.title, item.span and item.span.line) for item in found.diagnostics] == [
        ("the package 'std_msgs' has no message 'Floot32'", 3)]
    assert editing.read_edited(Path('signals.yaml'), text.partition('  y')[0]).diagnostics == ()


@pytest.mark.parametrize(('text', 'is_one'), [
    (BUNDLE, True), ('inputs: {}\nrequirements: []', True), ('format: 1', True),
    ('services:\n  web: {image: x}\n', False), ('', False), ('inputs:\n  - a', False)])
def test_other_files_of_yaml_are_no_bundles(text: str, is_one: bool) -> None:
    assert editing.looks_like_a_bundle(text) is is_one


# -- half-typed text -----------------------------------------------------------------------------

def prefixes(step: int) -> list[str]:
    """Return the texts that somebody types who writes some bundles from their beginnings."""
    texts = [(CONFIG / 'docking.yaml').read_text(encoding='utf-8'), BUNDLE]
    return [text[:end] for text in texts for end in range(0, len(text), step)]


def ask_everything(text: str, offset: int) -> None:
    found = editing.read_edited(Path('b.yaml'), text)
    editing.complete(found, offset)
    for place in (offset, max(0, offset - 3)):
        editing.hover(found, place)
        editing.references(found, place)
    editing.folds(text)
    editing.formatted(text)


@pytest.mark.parametrize('step', [89, pytest.param(1, marks=thorough)])
def test_a_text_that_is_half_typed_never_fails_and_is_never_late(step: int) -> None:
    for text in prefixes(step):
        begin = time.process_time()
        ask_everything(text, len(text))
        assert time.process_time() - begin < 1.0, text[-80:]  # usually 10 ms


@pytest.mark.parametrize('line', some([
    'x' * 100_000, ' ' * 100_000, '{' * 2_000, '- ' * 2_000, 'x' * 100_000 + ': y', '(' * 20_000,
    '"' * 100_001, ', a' * 20_000], 2), ids=lambda line: line[:3])
@pytest.mark.parametrize('before', ['fretish: "', '    x: {a: '])
def test_a_long_line_is_not_late(before: str, line: str) -> None:
    text = f'{HEAD}requirements:\n  - id: A\n    {before}{line}'
    begin = time.process_time()
    ask_everything(text, len(text))
    assert time.process_time() - begin < 10.0  # usually 0.2 s


@pytest.mark.parametrize('step', [151, pytest.param(3, marks=thorough)])
def test_a_text_with_a_gap_never_fails(step: int) -> None:
    for text in (BUNDLE, (CONFIG / 'fleet.yaml').read_text(encoding='utf-8')):
        for place in range(0, len(text), step):
            ask_everything(text[:place] + text[place + 5:], place)


# -- hover ---------------------------------------------------------------------------------------

@pytest.mark.parametrize(('place', 'expected'), [
    (at('battery', 'ptltl'), ['`battery`: input, float32', 'topic `battery_state`',
                              'Charge percentage on 0 to 1 range']),
    (at('speed', 'inputs'), ['`speed`: input, float64', 'field `twist.twist.linear.x`']),
    (at('state', 'whenever'), ['values `IDLE` = 0, `DRIVING` = 1']),
    (at('fast', 'satisfy'), ['definition, `speed > limit`', '`speed > 1.5`']),
    (at('limit', 'ptltl'), ['`limit`: constant 1.5']),
    (at('H', 'ptltl'), ['p at every step 0 to t']),
    (at('whenever'), ['each step in the scope at which p holds']),
    (at('immediately'), ['the response holds at that step']),
    (at('SLOW'), ['**SLOW** not too fast', 'condition: whenever state = IDLE', '`H (']),
    (at('on_violation'), ['the actions that follow a violation']),
    (at('sensor_msgs'), ['std_msgs/msg/Header header', 'float32 percentage']),
], ids=lambda item: '' if isinstance(item, Marked) else item[0][:20])
def test_hovering_says_what_is_known(place: Marked, expected: list[str]) -> None:
    found = editing.hover(place.edited, place.offset)
    assert found is not None
    assert [text for text in expected if text not in found.markdown] == []
    assert found.place.start <= place.offset <= found.place.end


@pytest.mark.parametrize('place', [at('comment'), at('not too'), at('e_stop')])
def test_hovering_over_anything_else_says_nothing(place: Marked) -> None:
    assert editing.hover(place.edited, place.offset) is None


@pytest.mark.parametrize(('field', 'unit'), [
    ('rate(5 s)', 'in messages a second'), ('period()', 'in seconds'),
    ('header.stamp', 'in seconds')])
def test_the_unit_of_what_is_measured_is_known(field: str, unit: str) -> None:
    place = marked('inputs:\n  <>x: {topic: a, type: sensor_msgs/msg/Imu, max_rate: 9, '
                   f'field: {field}}}\nrequirements: [{{id: A, ptltl: x > 1.0}}]\n')
    found = editing.hover(place.edited, place.offset)  # without the line of the format, too
    assert found is not None and unit in found.markdown.split('\n\n')


def test_hovering_works_beside_a_line_that_is_half_typed() -> None:
    text = BUNDLE.replace('    ptltl: ', '    ptl\n    ptltl: ')
    place = at('battery', 'ptltl', text)
    found = editing.hover(place.edited, place.offset)
    assert found is not None and '`battery`: input, float32' in found.markdown


# -- completion ----------------------------------------------------------------------------------


@pytest.mark.parametrize(('text', 'wanted', 'unwanted'), [
    ('format: 1\nreq<>', {'requirements'}, {'format', 'ptltl'}),
    ('format: 1\nevaluation:\n  po<>', {'policy', 'period'}, {'inputs'}),
    ('format: 1\nevaluation: {policy: <>}', {'timed', 'periodic'}, {'policy'}),
    ('format: 1\nevaluation: {policy: periodic, <>', {'rate', 'unit'}, {'policy', 'timed'}),
    (HEAD + 'requirements:\n  - id: A\n    <>', {'fretish', 'ptltl', 'report'}, {'id', 'topic'}),
    (HEAD + 'requirements:\n- i<>', {'id', 'fretish'}, {'inputs'}),
    (HEAD + 'requirements:\n  - id: A\n    report: <>', {'onset'}, {'report'}),
    (HEAD + '  other:\n    topic: x\n    ty<>\n', {'type', 'field', 'timeout'}, {'topic'}),
    (HEAD + '  other: {topic: x, ty<>', {'type', 'field'}, {'topic', 'id'}),
    (HEAD + '  other: {type: std_ms<>', {'std_msgs/msg/Float32', 'float64'}, {'type'}),
    (HEAD + '  b: {type: sensor_msgs/msg/BatteryState, field: <>}', {'voltage', 'max()'}, set()),
    (HEAD + '  o:\n    type: nav_msgs/msg/Odometry\n    field: pose.pose.<>',
     {'position', 'orientation'}, {'pose'}),
    (HEAD + 'requirements:\n  - id: A\n    ptltl: "H (sp<>', {'speed', 'persisted(n, p)', 'H'},
     {'S', 'within'}),
    (HEAD + 'requirements:\n  - id: A\n    ptltl: speed > 3 <>', {'S', 'xor'}, {'speed', 'H'}),
    (HEAD + 'requirements:\n  - {id: A, fretish: when speed > 1 the x shall <>',
     {'within', 'always', 'satisfy', 'until'}, {'speed', 'when', 'while'}),
    (HEAD + 'requirements:\n  - id: A\n    fretish: >-\n      when speed > 1 the x shall\n'
     '      within 3 <>', {'seconds', 'ticks'}, {'within', 'speed'}),
    (HEAD + 'component: base\nrequirements:\n  - {id: A, fretish: the <>', {'base'}, {'speed'}),
    (HEAD + 'definitions:\n  fast: <>', {'speed', 'H'}, {'within'}),
    (HEAD + 'definitions:\n  fast: {fretish: <>', {'speed', 'if'}, {'shall'}),
    ('format: 1\ninputs: {m: {type: int8, values: {ON: 1, OFF: 0}}}\nrequirements: [{id: A, '
     'ptltl: m = <>', {'ON', 'OFF'}, set()),
    (BUNDLE.replace('on_violation: stop', 'on_violation: <>'), {'stop'}, {'id'}),
])
def test_what_fits_is_proposed(text: str, wanted: set[str], unwanted: set[str]) -> None:
    found = set(labels(marked(text)))
    assert wanted - found == set()
    assert found & unwanted == set()


def test_a_proposal_replaces_what_is_typed_of_its_word() -> None:
    place = marked(HEAD + 'requirements:\n  - id: A\n    ptltl: "H (sp<>')
    proposal, = (item for item in editing.complete(place.edited, place.offset)
                 if item.label == 'speed')
    assert place.text[proposal.place.start:proposal.place.end] == 'sp'


def test_a_name_that_is_a_word_is_proposed_in_quotes() -> None:
    text = BUNDLE.replace('satisfy ! fast', 'satisfy <>')
    assert labels(marked(text))['mode'] == '"mode"'


def test_topics_of_the_running_graph_are_proposed_where_topics_are() -> None:
    running = {'/odom': ['nav_msgs/msg/Odometry']}
    place = marked(HEAD + '  other: {topic: <>}')
    assert labels(place, topics=lambda: running) == {'/odom': '/odom'}
    assert '/odom' in labels(marked('format: 1\ntopics:\n  <>'), topics=lambda: running)
    assert '/odom' not in labels(marked(HEAD + '  other: {field: <>}'), topics=lambda: running)


# -- names ---------------------------------------------------------------------------------------

@pytest.mark.parametrize(('place', 'line', 'uses'), [
    (at('speed', 'definitions'), 5, [15, 24]), (at('limit', 'constants'), 3, [15, 24]),
    (at('steps', 'ptltl'), 3, [24]), (at('fast', 'satisfy'), 15, [21]),
    (at('battery', 'ptltl'), 6, [24]), (at('stop', 'on_violation'), 17, [22]),
    (at('mode', 'values'), 13, [])])
def test_a_name_leads_to_its_declaration_and_its_uses(place: Marked, line: int,
                                                      uses: list[int]) -> None:
    assert [item.line for item in editing.definition(place.edited, place.offset)] == [line]
    assert [item.line for item in editing.references(place.edited, place.offset)] == [line, *uses]


def test_a_name_of_a_value_is_no_input_of_that_name() -> None:
    text = BUNDLE.replace('  fast: speed', '  idle: state = IDLE\n  fast: speed').replace(
        '  state:\n', '  IDLE: {type: bool}\n  state:\n')
    place = at('IDLE', 'inputs', text)
    assert [item.line for item in editing.references(place.edited, place.offset)] == [10]


@pytest.mark.parametrize(('place', 'name', 'changed'), [
    (at('speed', 'inputs'), 'v', {'  speed: {t': '  v: {t', 'fast: speed': 'fast: v',
                                  '| speed': '| v'}),
    (at('battery', 'inputs'), 'charge left', {
        '  battery: ': "  '\"charge left\"': ", '(battery': '(\\"charge left\\"'}),
    (at('fast', 'satisfy'), 'within', {'  fast': '  within', '! fast': '! "within"'})])
def test_a_name_is_changed_wherever_it_is_written(place: Marked, name: str,
                                                  changed: dict[str, str]) -> None:
    if '\\"' in str(changed):
        place = Marked(place.text.replace('ptltl: "H[0,steps] (battery > 0.2) | speed <= limit"',
                                          "ptltl: 'H[0,steps] (battery > 0.2) | speed <= limit'"),
                       place.offset)
    edits = editing.rename(place.edited, place.offset, name)
    expected = place.text
    for old, new in changed.items():
        assert expected.count(old) == 1
        expected = expected.replace(old, new.replace('\\"', '"'))
    assert editing.with_edits(place.text, edits) == expected


@pytest.mark.parametrize(('place', 'name', 'reason'), [
    (at('speed', 'inputs'), 'limit', "'speed' cannot be named 'limit'"),
    (at('speed', 'inputs'), 'H', "'speed' cannot be named 'H'"),
    (at('speed', 'inputs'), 'a"b', "'a\"b' cannot be a name in quotes"),
    (at('stop', 'on_violation'), 'halt', 'only inputs, constants and definitions can be renamed'),
    (at('speed', 'inputs', BUNDLE.replace('battery > 0.2', 'battery >')), 'v',
     'nothing can be renamed while the bundle has errors'),
    (Marked(BUNDLE.replace('  fast: speed', '  idle: state = fast\n  fast: speed'), 0), 'v',
     'only inputs, constants and definitions can be renamed')])
def test_a_name_that_is_not_free_is_refused(place: Marked, name: str, reason: str) -> None:
    with pytest.raises(CompileError) as refused:
        editing.rename(place.edited, place.offset, name)
    assert [item.title for item in refused.value.diagnostics] == [reason]


def test_a_new_name_may_not_be_read_as_a_value() -> None:
    text = BUNDLE.replace('  fast: speed', '  same: state = code\n  fast: speed').replace(
        '  state:\n', '  code: {type: int32}\n  state:\n')
    place = at('code', 'inputs', text)
    with pytest.raises(CompileError) as refused:
        editing.rename(place.edited, place.offset, 'IDLE')
    assert "'IDLE' has another meaning here" in str(refused.value)


# -- quick fixes ---------------------------------------------------------------------------------

@pytest.mark.parametrize(('old', 'new', 'titles'), [
    ('speed > limit', 'sped > limit', ['write speed']),
    ('title: not', 'titel: not', ['write title']),
    ('ptltl: "H[0,steps] (battery > 0.2) | speed <= limit"', 'ptltl: !fast & speed > 1',
     ['write ptltl: "!fast & speed > 1"']),
    ('! fast', 'fast && fast', ['write &']),
    ('format: 1\n', '', ['write format: 1']),
    ('topic: odom, ', 'topic: odom, timeout: 500 ms, ', ['write 0.5']),
    ('topic: e_stop', 'topic: e_stop, after: 1', []),
    ('H[0,steps]', 'H[3,1]', ['write [1,3]']),
    ('whenever state = IDLE the base shall immediately satisfy ! fast',
     'the base shall satisfy fast within 3 ticks',
     ['write the base shall within 3 ticks satisfy fast'])])
def test_a_line_to_write_is_a_quick_fix(old: str, new: str, titles: list[str]) -> None:
    found = editing.read_edited(Path('b.yaml'), BUNDLE.replace(old, new))
    first = next(item for item in found.diagnostics if item.help)
    fixes = editing.fixes(found, first)
    assert [item.title for item in fixes] == titles
    for fix in fixes:
        text = editing.with_edits(found.source.text, [fix.edit])
        after = editing.read_edited(Path('b.yaml'), text)
        assert [item for item in after.diagnostics if item.level is Level.ERROR] == []


@pytest.mark.parametrize('inputs', [
    '\n  speed: {topic: speed, type: std_msgs/msg/Float64}',
    ' # these\n\n    # a comment\n    speed: {topic: speed, type: std_msgs/msg/Float64}',
    ' {speed: {topic: speed, type: std_msgs/msg/Float64}}',
    ' {\n  speed: {topic: speed, type: std_msgs/msg/Float64},\n}', '', ' {}', None])
@pytest.mark.parametrize(('condition', 'kind', 'end'), [
    ('new', 'Bool', '\n'), ('new < 0.5', 'Float64', '\r\n')])
def test_an_unknown_name_is_declared_as_an_input(
    inputs: str | None, condition: str, kind: str, end: str,
) -> None:
    response = 'speed <= 1.0' if inputs and 'speed' in inputs else 'TRUE'
    text = f"""\
format: 1
{'' if inputs is None else f'inputs:{inputs}'}
requirements:
  - {{id: A, fretish: when {condition} the robot shall satisfy {response}}}
""".replace('\n', end)
    found = editing.read_edited(Path('b.yaml'), text)
    first = next(item for item in found.diagnostics if "'new'" in item.title)
    fix, = editing.fixes(found, first)
    after = editing.read_edited(Path('b.yaml'), editing.with_edits(text, [fix.edit]))
    assert [item for item in after.diagnostics if item.level is Level.ERROR] == []
    assert f'new: {{topic: new, type: std_msgs/msg/{kind}}}' in after.source.text
    assert text.splitlines()[-1] in after.source.text
    assert after.source.text.count('\n') == after.source.text.count(end)


def test_a_name_in_braces_keeps_them_in_its_quick_fix() -> None:
    text = """\
format: 1
for_each: {robot: {most: 3}}
inputs:
  v: {topic: "/{Robot}/s", type: std_msgs/msg/Float64}
requirements:
  - {id: A, ptltl: "v > 1"}
"""
    found = editing.read_edited(Path('b.yaml'), text)
    first = next(item for item in found.diagnostics if item.help.startswith('did you mean'))
    fix, = editing.fixes(found, first)
    assert fix.title == 'write {robot}'
    assert editing.with_edits(text, [fix.edit]) == text.replace('Robot', 'robot')


def test_many_of_the_lines_to_write_are_quick_fixes() -> None:
    count = 0
    for path in golden.cases('bundle')[::4]:
        found = editing.read_edited(path, read_source(path).text)
        count += sum(bool(editing.fixes(found, item)) for item in found.diagnostics)
    assert count > 20


# -- folding and formatting ----------------------------------------------------------------------

def test_what_is_indented_below_a_line_can_be_folded() -> None:
    found = [(item.first + 1, item.last + 1) for item in editing.folds(BUNDLE)]
    assert {(4, 13), (6, 9), (18, 24), (19, 22), (23, 24)} - set(found) == set()
    beside = editing.folds('a:\n- b\n- c: 1\n  d: 2\ne: 3\n')
    assert [(item.first, item.last) for item in beside] == [(0, 3), (2, 3)]


UNEVEN = """\
format:   1   # aligned
# of inputs
inputs:
   speed:  {type: float64,
            values: {A: 1}}  \n\
      # of other
   other:
        type: bool # end
requirements:
-   id: A
    # inside
    fretish: >-
        when other
          the x shall satisfy speed > 1
-   id: B
    ptltl: |
      other
        & other
    title:  "two
       lines"


"""
EVEN = """\
format:   1   # aligned
# of inputs
inputs:
  speed:  {type: float64,
           values: {A: 1}}
     # of other
  other:
    type: bool # end
requirements:
- id: A
  # inside
  fretish: >-
      when other
        the x shall satisfy speed > 1
- id: B
  ptltl: |
    other
      & other
  title:  "two
     lines"
"""


def test_formatting_indents_by_two_and_keeps_comments_and_values() -> None:
    assert editing.formatted(UNEVEN) == EVEN
    assert editing.formatted(EVEN) == EVEN


@pytest.mark.parametrize('text', [
    'format: 1\ninputs: {a: [\n', 'a: |+\n  x\n\n\n', '', 'a: !p\n',
    'a: |2\n    x  \n  y\n', 'a: 1\r\nb: 2\r\n'])
def test_formatting_leaves_alone_what_is_not_sure(text: str) -> None:
    assert editing.formatted(text) == text


@pytest.mark.parametrize('path', sorted(CONFIG.glob('*.yaml')), ids=lambda path: path.name)
def test_the_bundles_of_this_package_are_formatted(path: Path) -> None:
    text = path.read_text(encoding='utf-8')
    assert editing.formatted(text) == text
    deeper = '\n'.join(f'{line[:len(line) - len(line.lstrip())]}{line}'
                       for line in text.split('\n'))
    assert editing.formatted(deeper).split() == text.split()


# -- positions -----------------------------------------------------------------------------------

def test_positions_count_utf16_units_and_the_line_ends_of_editors() -> None:
    text = 'a\U0001d11eb\r\nc\u2028d\re\n'
    lines = editing.PositionMap(text)
    places = [lines.position(offset) for offset in range(len(text) + 1)]
    assert places == [(0, 0), (0, 1), (0, 3), (0, 4), (0, 5), (1, 0), (1, 1), (1, 2), (1, 3),
                      (2, 0), (2, 1), (3, 0)]
    for offset in (0, 1, 2, 3, 5, 6, 7, 8, 9, 10, 11):
        assert lines.offset(places[offset]) == offset
    assert lines.offset(editing.EditorPosition(0, 99)) == 3
    assert lines.offset(editing.EditorPosition(9, 0)) == len(text)


def test_a_path_goes_through_lists_and_braces() -> None:
    place = marked('requirements:\n  - id: A\n    x: {y: [1, <>')
    assert place.edited.place_at(place.offset).path == ('requirements', ITEM, 'x', 'y', ITEM)
