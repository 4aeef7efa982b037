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


"""What FRETish means in a bundle: durations, ends of intervals, warnings; and `formalize`."""

from fractions import Fraction
from pathlib import Path
from random import Random

from fret.sentences import formalise, INPUTS, parse, sentence_for
from fret_monitor.cli.main import main
from fret_monitor.elaboration.durations import TimeScale
from fret_monitor.elaboration.elaborate import specify
from fret_monitor.elaboration.formalize import formalize, scope_by_use
from fret_monitor.elaboration.fretish import is_not_yet
from fret_monitor.language.cocospec import parse_cocospec
from fret_monitor.language.expression import Duration, Equations, Unit
from fret_monitor.language.smv import parse_smv
from fret_monitor.lint.sentences import doubtful_sentences
from fret_monitor.logic.evaluate import evaluate_all
from fret_monitor.logic.formula import Formula, Variable
from fret_monitor.logic.specification import Specification
from fret_monitor.model.diagnostics import by_place, CompileError, Problems, Source, Text
from fret_monitor.model.policies import Policy
from fret_monitor.model.values import ValueType
import golden
from hypothesis import given, strategies as st
from oracle import KEYS
import pytest
from stages import elaborate, read_bundle, scope_of

_HEAD = 'format: 1\ninputs: {m: {type: bool}, p: {type: bool}, q: {type: bool}}\n'


def text_of(text: str) -> Text:
    return Text.whole(Source('<sentence>', text))


def specification(folder: Path, sentence: str, evaluation: str = '',
                  definitions: str = '') -> Specification:
    path = folder / 'bundle.yaml'
    path.write_text(f'{_HEAD}{evaluation}\n{definitions}\nrequirements:\n'
                    f'  - {{id: R, fretish: "{sentence}"}}\n', encoding='utf-8')
    return specify(read_bundle(path))[0]


def formula(folder: Path, sentence: str, evaluation: str = '', definitions: str = '') -> Formula:
    return specification(folder, sentence, evaluation, definitions).properties[0].formula


def smv(text: str, names: str = 'mpq') -> Formula:
    return elaborate(parse_smv(text_of(text)),
                     scope_of([Variable(name, ValueType.BOOL) for name in names]))


def column(rng: Random, steps: int) -> list[bool]:
    found: list[bool] = []
    while len(found) < steps:
        found += [rng.random() < 0.5] * rng.choice((1, 1, 2, 5))
    return found[:steps]


def check_equal(ours: Formula, theirs: Formula, names: str) -> None:
    rng = Random(1)
    for _ in range(40):
        trace = {name: column(rng, 25) for name in names}
        found = evaluate_all([ours, theirs], trace)
        assert found[0] == found[1]


# Bundles

@pytest.mark.parametrize('case', golden.cases('fretish'), ids=lambda path: path.stem)
def test_the_messages_about_a_bundle_are_its_golden_file(
        case: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(case.parent)
    bundle = read_bundle(Path(case.name))
    try:
        meant, warnings = specify(bundle)
        told = by_place((*warnings, *doubtful_sentences(meant)))
    except CompileError as error:
        told = error.diagnostics
    golden.check(case, ''.join(item.render() + '\n' for item in told))


def test_the_sentence_of_a_bundle_becomes_its_formula(tmp_path: Path) -> None:
    found = formula(tmp_path, 'if persisted(10, p) the sw shall within 10 seconds satisfy q')
    assert found is smv('H (O[10,10] ((H[0,10] p & H[0,9] !FTP) & Z !(H[0,10] p & H[0,9] !FTP) '
                        '& !q) -> O[0,9] (FTP | q))')


def test_any_component_will_do_where_the_bundle_names_none(tmp_path: Path) -> None:
    for name in ('sw', 'ROS_component', 'a.b'):
        formula(tmp_path, f'{name} shall always satisfy q')


def test_a_definition_is_an_expression_that_looks_back_to_the_first_step(tmp_path: Path) -> None:
    definitions = 'definitions: {lasting: {fretish: "persisted(2, p)"}}'
    found = formula(tmp_path, 'in m mode the sw shall always satisfy lasting', '', definitions)
    assert found is smv('H (m -> (H[0,2] p & H[0,1] !FTP))')


# Durations

def scale_of(period: str | None) -> TimeScale:
    """Return the scale of the policy periodic; without a period, that of another policy."""
    return TimeScale(Policy.PERIODIC, Fraction(period)) if period else TimeScale()


@pytest.mark.parametrize(('number', 'unit', 'period', 'steps'), [
    ('10', Unit.SECOND, None, 10), ('10', Unit.HOUR, None, 10), ('2.0', Unit.SECOND, None, 2),
    ('1e3', Unit.TICK, None, 1000), ('0', Unit.TICK, None, 0),
    ('10', Unit.SECOND, '0.1', 100), ('0.5', Unit.SECOND, '0.1', 5),
    ('10', Unit.TICK, '0.1', 10), ('20', Unit.MILLISECOND, '0.004', 5),
    ('500', Unit.MICROSECOND, '0.0001', 5), ('2', Unit.MINUTE, '0.25', 480),
    ('1', Unit.HOUR, '0.01', 360_000), ('1', Unit.SECOND, '1/3', 3),
    ('0.3', Unit.SECOND, '0.1', 3),
])
def test_durations_become_steps_exactly(number: str, unit: Unit, period: str | None,
                                        steps: int) -> None:
    duration = Duration(number, unit, text_of('x').span)
    assert scale_of(period).timing(duration) == steps


@pytest.mark.parametrize(('number', 'unit', 'period', 'told'), [
    ('10', Unit.SECOND, '0.3', 'period: 0.25 or 0.3125'),
    ('1', Unit.SECOND, '0.15', 'period: 0.125 or 0.2'),
    ('0.1', Unit.SECOND, '0.3', 'period: 0.1'),
    ('1', Unit.SECOND, '0.30', 'period: 0.25 or 0.5'),
    ('0.5', Unit.TICK, '0.1', 'whole number'), ('0.5', Unit.SECOND, None, 'policy: periodic'),
    ('1e30', Unit.SECOND, None, 'at most'), ('1e99999', Unit.SECOND, None, 'cannot be used'),
    ('2147483647', Unit.TICK, None, 'at most'),
])
def test_a_duration_that_is_no_whole_number_of_steps_is_refused(
        number: str, unit: Unit, period: str | None, told: str) -> None:
    duration = Duration(number, unit, text_of('x').span)
    with pytest.raises(CompileError, match=told):
        scale_of(period).timing(duration)


def test_the_longest_duration_is_one_nanosecond_less_than_the_longest_bound() -> None:
    def timing(nanoseconds: int) -> int:
        duration = Duration(str(nanoseconds), Unit.NANOSECOND, text_of('x').span)
        return TimeScale(Policy.TIMED).timing(duration)

    assert timing(2 ** 62 - 1) == 2 ** 62 - 1
    with pytest.raises(CompileError, match='a duration is at most'):
        timing(2 ** 62)


def test_only_the_policy_periodic_makes_steps_of_seconds(tmp_path: Path) -> None:
    sentence = 'the sw shall for 2 seconds satisfy q'
    periodic = 'evaluation: {policy: periodic, period: 0.5}'
    assert formula(tmp_path, sentence) is smv('H (O[0,2] FTP -> q)')
    assert formula(tmp_path, sentence, periodic) is smv('H (O[0,4] FTP -> q)')
    ticks = sentence.replace('seconds', 'ticks')
    assert formula(tmp_path, ticks, periodic) is smv('H (O[0,2] FTP -> q)')
    counts = 'the sw shall always satisfy persisted(2, q)'
    assert formula(tmp_path, counts, periodic) is smv('H (H[0,2] q & H[0,1] !FTP)')


# Where persisted and its like end

@pytest.mark.parametrize(('sentence', 'meaning'), [
    ('in m mode the sw shall always satisfy persisted(1,3,p)',
     'H (m -> (H[1,3] p & H[0,2] !(m & Z !m)))'),
    ('in m mode the sw shall always satisfy occurred(3,p)',
     'H (m -> ((!(m & Z !m)) S p & O[0,3] p))'),
    ('in m mode the sw shall always satisfy occurred(1,3,p)',
     'H (m -> ((!(m & Z !m)) S[1,3] p))'),
    ('while persisted(3,p) the sw shall always satisfy q', 'H (H[0,3] p -> q)'),
    ('while occurred(1,3,p) the sw shall always satisfy q', 'H (O[1,3] p -> q)'),
    ('while prevOcc(p,q) the sw shall always satisfy m', 'H (Y (!p S (p & q)) -> m)'),
    ('the sw shall always satisfy at the previous occurrence of p, q',
     'H (FTP | Y (((!FTP & !p) S p) -> ((!FTP & !p) S (p & q))))'),
    ('before m the sw shall always satisfy persisted(2, p)',
     'H (H !m -> (H[0,2] p & H[0,1] !FTP))'),
    ('the sw shall until persisted(2, p) satisfy q',
     'H (H !(H[0,2] p & H[0,1] !FTP) -> q)'),
])
def test_functions_look_back_to_the_left_end_of_the_scope(sentence: str, meaning: str) -> None:
    scope = scope_of([Variable(name, ValueType.BOOL) for name in 'mpq'])
    check_equal(formalise(sentence, scope), smv(meaning), 'mpq')


# Not yet

def test_seventy_two_keys_say_not_yet() -> None:
    waiting = {key for key in KEYS if is_not_yet(parse(sentence_for(key, 3)))}
    assert len(waiting) == 72
    assert {timing for scope, _, timing in waiting if scope.startswith('only')} == {
        'always', 'never', 'finally'}
    assert {timing for scope, _, timing in waiting if not scope.startswith('only')} == {
        'null', 'eventually', 'finally'}


def test_those_keys_alone_can_become_true_again() -> None:
    rng = Random(8)
    formulas = [formalise(sentence_for(key, 2)) for key in KEYS]
    recovered = set()
    for _ in range(150):
        trace = {name: column(rng, 14) for name in 'mcrs'}
        for key, values in zip(KEYS, evaluate_all(formulas, trace), strict=True):
            if any(values[i + 1] and not values[i] for i in range(13)):
                recovered.add(key)
    assert recovered == {key for key in KEYS if is_not_yet(parse(sentence_for(key, 2)))}


# formalize

def readback(text: str, language: str) -> Formula:
    sentence = parse(text)
    scope = scope_by_use(sentence)
    if language == 'smv':
        return elaborate(parse_smv(text_of(formalize(sentence)[0])), scope)
    tree = parse_cocospec(text_of(formalize(sentence, 'cocospec')[0]))
    assert not isinstance(tree, Equations)
    return elaborate(tree, scope)


@pytest.mark.parametrize('language', ['smv', 'cocospec'])
def test_what_formalize_prints_reads_back_with_equal_verdicts(language: str) -> None:
    rng = Random(6)
    texts = [sentence_for(key, duration) for key in KEYS for duration in (0, 2)]
    printed = [readback(text, language) for text in texts]
    direct = [formalise(text) for text in texts]
    for _ in range(4):
        trace = {item.name: column(rng, 20) for item in INPUTS}
        assert evaluate_all(printed, trace) == evaluate_all(direct, trace)


_ATOMS = st.sampled_from(['p', 'q', 'x > 3', 'x + y <= 2.5', 'k = 3', 'persisted(2, p)', 'FTP',
                          'occurred(1, 2, q)', 'prevOcc(p, q)', 'preBool(true, p)', 'b.c = x',
                          'preInt(0, k) < k', 'p = q', 'ite(p, x, y) > 0', '"a b" < 3'])
_EXPRESSIONS = st.recursive(_ATOMS, lambda inner: st.one_of(
    st.builds('({} {} {})'.format, inner, st.sampled_from(['&', '|', '->', '<->', 'xor']), inner),
    st.builds('!({})'.format, inner), st.builds('(if {} then {})'.format, inner, inner)),
    max_leaves=4)


@given(scope=st.sampled_from(['', 'while {}', 'after {}', 'only before {}', 'except while {}']),
       condition=st.sampled_from(['', 'upon {}', 'whenever {}', 'unless {}']),
       timing=st.sampled_from(['', 'always', 'until {}', 'before {}', 'within 2 ticks',
                               'for 3 ticks', 'after 1 ticks']),
       data=st.data())
def test_any_sentence_reads_back_as_what_it_means(scope: str, condition: str, timing: str,
                                                  data: st.DataObject) -> None:
    parts = [part.format(data.draw(_EXPRESSIONS)) for part in (scope, condition)]
    timing = timing.format(data.draw(_EXPRESSIONS))
    text = f'{parts[0]} {parts[1]} the sw shall {timing} satisfy {data.draw(_EXPRESSIONS)}'
    try:
        direct = formalise(text, scope_by_use(parse(text)))
    except CompileError:
        # k = 3 beside preInt(0, k) is whole, and real without it: one may not fit the other.
        return
    assert readback(text, 'smv') is direct


def test_names_are_typed_by_their_use() -> None:
    sentence = parse('while p = q the sw shall always satisfy q & x > 3 & preInt(0, k) = n & '
                     'ite(r, y, z) = w & a')
    problems = Problems()
    kinds = {}
    for name, item in scope_by_use(sentence).names.items():
        assert isinstance(item.term.value, Variable)
        kinds[name] = item.term.value.type
    assert not problems.errors
    assert {name for name, kind in kinds.items() if kind is ValueType.BOOL} == set('pqra')
    assert {name for name, kind in kinds.items() if kind is ValueType.FLOAT64} >= set('xyzw')
    assert kinds['k'] is ValueType.INT64


def test_a_duration_is_less_than_the_longest_bound(tmp_path: Path) -> None:
    def within(nanoseconds: int) -> Formula:
        time = f'{nanoseconds // 1000}.{nanoseconds % 1000:03} microseconds'
        return formula(tmp_path, f'the robot shall within {time} satisfy p',
                       'evaluation: {policy: timed}')

    within(2**62 - 1)
    with pytest.raises(CompileError, match='a duration is at most'):
        within(2**62)


def test_formalize_prints_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    sentence = 'in m mode the sw shall always satisfy x > 3'
    assert main(['formalize', sentence]) == 0
    assert capsys.readouterr() == ('H (m -> x > 3.0)\n', '')
    assert main(['formalize', sentence, '--language', 'cocospec']) == 0
    assert capsys.readouterr() == ('H(m => x > 3.0)\n', '')


def test_formalize_reports_a_mistake_at_its_place(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['formalize', 'the sw shal satisfy r']) == 1
    out, err = capsys.readouterr()
    assert out == ''
    assert err.startswith('<sentence>:1:8: error: ')
    assert "did you mean 'shall'?" in err
