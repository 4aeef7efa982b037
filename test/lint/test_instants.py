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

"""Warnings about reports that come once only, and about single nanoseconds."""

from pathlib import Path

from fret_monitor.build import read
import pytest

BUNDLE = """
format: 1
component: sw
evaluation: {policy: POLICY}
inputs: {p: {type: bool}, q: {type: bool}, x: {type: float64}}
definitions: {was: Y q, earlier: {cocospec: false -> pre q}}
requirements:
  - {id: R, LANGUAGE: "TEXT"}
"""
TIMED = [
    ('ptltl', 'H (p -> Y q)', 'looks back one nanosecond'),
    ('ptltl', 'H (p -> was)', 'looks back one nanosecond'),
    ('ptltl', 'H (p -> (O (Y q) & q))', 'looks back one nanosecond'),
    ('cocospec', 'H(p => (true -> pre q))', 'looks back one nanosecond'),
    ('ptltl', 'H ((p & Y !p) -> O[0, 2 s] q)', ''),
    ('ptltl', 'H (abs(x - preReal(0.0, x)) < 5.0)', ''),
    ('ptltl', 'FTP -> p', ''),
    ('cocospec', 'a = p -> q or pre a; r = a;', ''),
    ('fretish', 'when p sw shall within 2 seconds satisfy q', ''),
    ('fretish', 'when preBool(false, p) sw shall within 2 seconds satisfy q',
     'looks back one nanosecond'),
    ('fretish', 'sw shall always satisfy preReal(0.0, x) < 5', 'looks back one nanosecond'),
    ('fretish', 'sw shall always satisfy p => earlier', 'looks back one nanosecond'),
    ('fretish', 'when p & !preBool(true, p) sw shall within 2 seconds satisfy q', ''),
    ('fretish', 'sw shall always satisfy abs(x - preReal(0.0, x)) < 5', ''),
    ('fretish', 'upon p sw shall always satisfy prevOcc(p, q)', ''),
    ('fretish', 'when p sw shall after 2 seconds satisfy q', 'at exactly one nanosecond'),
    ('fretish', 'when p sw shall at the next timepoint satisfy q', 'one nanosecond later'),
    ('mltl', 'p R[1 ns,4 ns] (q R[2 ns,4 ns] x > 1)', ''),
    ('mltl', 'p -> F[1 ns, 1 ns] q', ''),
    ('mltl', 'p -> X q', ''),
    ('mltl', 'p -> Y q', 'looks back one nanosecond'),
    ('mltl', 'F[0, 2 s] (p -> Y q)', 'looks back one nanosecond'),
]


def titles(folder: Path, text: str) -> list[str]:
    """Return the titles of the warnings about a bundle."""
    bundle = folder / 'bundle.yaml'
    bundle.write_text(text, encoding='utf-8')
    return [item.title for item in read(bundle).warnings]


def bundle_of(policy: str, language: str, text: str) -> str:
    """Return a bundle with one requirement."""
    return BUNDLE.replace('POLICY', policy).replace('LANGUAGE', language).replace('TEXT', text)


@pytest.mark.parametrize(('language', 'text', 'warning'), TIMED)
def test_what_concerns_one_nanosecond_is_warned_of(
        tmp_path: Path, language: str, text: str, warning: str) -> None:
    found = titles(tmp_path, bundle_of('timed', language, text))
    assert len(found) == bool(warning)
    assert all(warning in title for title in found)


@pytest.mark.parametrize(('text', 'is_doubtful'), [
    ('H (scanned -> Y scanned)', True), ('H (q -> Z (p & scanned))', True),
    ('H (scanned & Y !scanned)', True), ('H (O[0, 100 ms] scanned)', False),
    ('H (q & Y (O[0, 1 s] scanned) & O[0, 1 s] scanned)', False), ('scanned -> q & Y !q', False)])
def test_a_received_input_one_nanosecond_ago_is_warned_of(
        tmp_path: Path, text: str, is_doubtful: bool) -> None:
    scanned = '{topic: t, type: std_msgs/msg/Bool, field: received()}'
    for policy in ('timed', 'periodic, period: 0.001'):
        bundle = bundle_of(policy, 'ptltl', text).replace(
            'inputs: {', f'inputs: {{scanned: {scanned}, ')
        assert [item for item in titles(tmp_path, bundle) if "at 'scanned'" in item] == [
            "R looks back one nanosecond at 'scanned'"] * (is_doubtful and policy == 'timed')


def test_steps_are_no_nanoseconds_under_other_policies(tmp_path: Path) -> None:
    assert titles(tmp_path, bundle_of('all_inputs', 'ptltl', 'H (p -> Y q)')) == []


@pytest.mark.parametrize('policy', ['all_inputs', 'timed'])
def test_an_onset_that_comes_once_only_is_warned_of(tmp_path: Path, policy: str) -> None:
    for text, report, is_doubtful in (
            ('H p', 'onset', True), ('H p', 'occurrence', False), ('H p', 'every_step', False),
            ('p -> O q', 'onset', False), ('H[0,0] p', 'onset', False)):
        bundle = bundle_of(policy, 'ptltl', text) + f'report: {report}\n'
        assert titles(tmp_path, bundle) == ['R is announced once and never again'] * is_doubtful


def test_an_order_by_stamps_needs_stamps(tmp_path: Path) -> None:
    policy = 'timed, reorder: 0.05, stamp: '
    assert titles(tmp_path, bundle_of(policy + 'header', 'ptltl', 'H p')) == []
    assert titles(tmp_path, bundle_of(policy + 'received', 'ptltl', 'H p')) == [
        'reorder has no effect with stamp: received']
    (warning,) = read(tmp_path / 'bundle.yaml').warnings
    assert ':4:29: warning: reorder' in warning.render()
