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

"""A start reuses what was built from the same files, and builds again if any of them changed."""

from collections.abc import Callable
from fractions import Fraction
import json
import os
from pathlib import Path
import shutil
import struct
import subprocess
import sys
from typing import Any

from fret_monitor import build
from fret_monitor.model.diagnostics import CompileError, Source, Text
from fret_monitor.model.policies import Policy
from fret_monitor.native.cache import cache_directory, evaluator_library
from fret_monitor.native.compiled import CompiledMonitor
from fret_monitor.runtime.evaluator import Evaluator
from fret_monitor.runtime.fields import FieldReading, read_fields, ReadOutcome
from fret_monitor.start import _package, start

import pytest
from strategies import some

BUNDLE = """\
format: 1
signals: shared/signals.yaml
requirements:
  - {id: R, ptltl: "x <= limit"}
"""
SIGNALS = """\
constants: {limit: 1.0}
inputs: {x: {topic: a, type: my_msgs/msg/Level, field: level}}
"""
DAMAGES: list[Callable[[dict[str, Any]], Any]] = [
    lambda note: '',
    lambda note: '[' * 100_000,
    lambda note: {},
    lambda note: {**note, 'files': []},
    lambda note: {**note, 'files': {}},
    lambda note: {**note, 'files': note['files'][1:]},
    lambda note: {**note, 'files': None},
    lambda note: {**note, 'warnings': None},
    lambda note: {**note, 'manifest': note['manifest'].replace('"symbol"', '"cymbal"')},
    lambda note: {**note, 'manifest': 3},
    lambda note: {**note, 'library': '/nowhere/lib.so'},
    lambda note: {**note, 'library': 7},
    lambda note: {**note, 'evaluator': '/nowhere/lib.so'},
    lambda note: {**note, 'evaluator': 7},
    lambda note: {**note, 'messages': {}},
    lambda note: {**note, 'messages': None},
    lambda note: {key: value for key, value in note.items() if key != 'messages'},
]


@pytest.fixture(autouse=True)
def ros_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Keep the cache in a folder of the test; the evaluator is in it already."""
    evaluator = evaluator_library().parent
    monkeypatch.setenv('ROS_HOME', str(tmp_path / 'ros'))
    cache_directory().mkdir(parents=True, mode=0o700)
    shutil.copytree(evaluator, cache_directory() / evaluator.name)
    return tmp_path / 'ros'


@pytest.fixture
def bundle(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a bundle with a signals file and a message definition of its own."""
    prefix = tmp_path / 'prefix' / 'share' / 'my_msgs' / 'msg'
    prefix.mkdir(parents=True)
    (prefix / 'Level.msg').write_text('float32 level\n')
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(tmp_path / 'prefix'))
    home = tmp_path / 'robot'
    (home / 'shared').mkdir(parents=True)
    (home / 'shared' / 'signals.yaml').write_text(SIGNALS)
    (home / 'b.yaml').write_text(BUNDLE)
    return home / 'b.yaml'


@pytest.fixture
def built(monkeypatch: pytest.MonkeyPatch) -> list[CompiledMonitor]:
    """Return a list that collects what is built from here on, and not taken from the cache."""
    found: list[CompiledMonitor] = []
    compile_monitor = build.compile_monitor

    def counting(generated: build.GeneratedMonitor) -> CompiledMonitor:
        found.append(compile_monitor(generated))
        return found[-1]

    monkeypatch.setattr(build, 'compile_monitor', counting)
    return found


def limit_of(compiled: CompiledMonitor) -> float:
    """Return the limit of a monitor, found by trying values."""
    evaluator = Evaluator(compiled.monitor)
    for limit in (1.0, 2.0, 3.0):
        evaluator.store(0, limit)
        evaluator.step(0)
        evaluator.store(0, limit + 0.5)
        evaluator.step(0)
        if not evaluator.verdicts[0]:
            return limit
    raise AssertionError('no limit')


def note() -> Path:
    """Return the only note in the cache."""
    found, = (cache_directory() / 'bundles').glob('*.json')
    return found


def test_a_second_start_builds_nothing(bundle: Path, built: list[CompiledMonitor]) -> None:
    first, second = start(bundle), start(bundle)
    assert len(built) == 1
    assert (second.manifest, second.library) == (first.manifest, first.library)
    assert limit_of(second) == 1.0


def test_a_second_start_loads_no_parser(bundle: Path) -> None:
    start(bundle)
    script = ('import sys\nfrom pathlib import Path\nfrom fret_monitor.start import start\n'
              'start(Path(sys.argv[1]))\nprint(*sys.modules)')
    path = os.pathsep.join(filter(None, sys.path))
    done = subprocess.run([sys.executable, '-c', script, str(bundle)], text=True, check=True,
                          capture_output=True, env={**os.environ, 'PYTHONPATH': path})
    assert {'lark', 'yaml', 'fret_monitor.build'} & set(done.stdout.split()) == set()


def test_a_start_knows_the_evaluator_without_reading_its_sources(
    bundle: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    first = start(bundle)
    monkeypatch.setattr('fret_monitor.start.evaluator_library', pytest.fail)
    assert start(bundle).evaluator == first.evaluator == evaluator_library()


def test_the_code_of_the_package_is_read_again_where_a_date_or_a_size_has_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    file = tmp_path / 'code.py'
    monkeypatch.setattr('fret_monitor.start.__file__', str(file))
    monkeypatch.setattr('fret_monitor.start.csrc_directory', lambda: tmp_path / 'csrc')
    (tmp_path / 'csrc' / 'deep').mkdir(parents=True)

    def state(text: str, date: int) -> bytes:
        file.write_text(text)
        (tmp_path / 'csrc' / 'deep' / 'one.c').write_text(text)
        for item in (file, tmp_path / 'csrc' / 'deep' / 'one.c'):
            os.utime(item, (date, date))
        return code_hash()

    code_hash = _package.__wrapped__
    first = state('x = 1', 1)
    assert state('x = 2', 1) == first  # taken from the cache, by date and size
    assert state('x = 1', 2) == first  # read again
    assert len({first, state('x = 2', 3), state('x = 20', 3)}) == 3


def test_a_warning_from_the_cache_still_has_its_place(
    bundle: Path, built: list[CompiledMonitor],
) -> None:
    signals = bundle.parent / 'shared' / 'signals.yaml'
    signals.write_text('\ufeff' + SIGNALS + '  # unread\n')
    bundle.write_text(BUNDLE.replace('x <= limit', '(x <= limit) | (x > 0 & x < 0)') +
                      '  - {id: T, ptltl: "x > 0 & x < 0 | x <= 5"}\n'
                      '  - {id: F, ptltl: "H (x < 1 & false)"}\n')
    first, second = start(bundle), start(bundle)
    assert len(built) == 1
    assert first.warnings and [item.render() for item in second.warnings] == [
        item.render() for item in first.warnings]
    assert all(item.span for item in second.warnings)


@pytest.mark.parametrize('name', ['b.yaml', 'shared/signals.yaml'])
def test_a_changed_file_causes_a_new_build(
    name: str, bundle: Path, built: list[CompiledMonitor],
) -> None:
    start(bundle)
    file = bundle.parent / name
    file.write_text(file.read_text().replace('limit: 1.0', 'limit: 2.0') + '# changed\n')
    assert limit_of(start(bundle)) == (2.0 if 'signals' in name else 1.0)
    assert len(built) == 2


def test_a_file_that_changes_during_the_build_is_noticed_at_the_next_start(
    bundle: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    compile_monitor = build.compile_monitor

    def slow(generated: build.GeneratedMonitor) -> CompiledMonitor:
        (bundle.parent / 'shared' / 'signals.yaml').write_text(SIGNALS.replace('1.0', '2.0'))
        return compile_monitor(generated)

    monkeypatch.setattr(build, 'compile_monitor', slow)
    assert limit_of(start(bundle)) == 1.0
    monkeypatch.setattr(build, 'compile_monitor', compile_monitor)
    assert limit_of(start(bundle)) == 2.0


def test_a_bundle_that_changes_between_two_reads_is_built_again(
    bundle: Path, built: list[CompiledMonitor], monkeypatch: pytest.MonkeyPatch,
) -> None:
    read = build.read
    other = BUNDLE.replace('x <= limit', 'x <= 3.0')

    def late(path: Path, **overrides: Any) -> build.Reading:
        path.write_text(other)
        return read(path, **overrides)

    monkeypatch.setattr(build, 'read', late)
    assert limit_of(start(bundle)) == 3.0
    bundle.write_text(BUNDLE)
    monkeypatch.setattr(build, 'read', read)
    assert limit_of(start(bundle)) == 1.0


def test_a_link_in_a_path_is_followed_as_by_the_system(
    bundle: Path, tmp_path: Path,
) -> None:
    # link/.. is the parent of the link's target, not the folder that contains the link
    (bundle.parent / 'sub').mkdir()
    moved = bundle.rename(bundle.parent / 'sub' / 'b.yaml')
    moved.write_text(BUNDLE.replace('shared/', '../shared/'))
    home = tmp_path / 'home'
    (home / 'shared').mkdir(parents=True)
    (home / 'shared' / 'signals.yaml').write_text(SIGNALS)
    (home / 'link').symlink_to(moved.parent)
    assert limit_of(start(home / 'link' / 'b.yaml')) == 1.0
    (moved.parent.parent / 'shared' / 'signals.yaml').write_text(SIGNALS.replace('1.0', '2.0'))
    assert limit_of(start(home / 'link' / 'b.yaml')) == 2.0


def test_a_changed_message_definition_causes_a_new_build_or_an_error(
    bundle: Path, tmp_path: Path, built: list[CompiledMonitor],
) -> None:
    start(bundle)
    definition = tmp_path / 'prefix' / 'share' / 'my_msgs' / 'msg' / 'Level.msg'
    definition.write_text('float64 level\n')
    assert start(bundle).manifest.inputs[0].value_type.value == 'float64'
    definition.write_text('float64 height\n')
    with pytest.raises(CompileError, match='height'):
        start(bundle)
    assert len(built) == 2


def test_a_change_of_an_earlier_field_causes_a_new_build(
    bundle: Path, tmp_path: Path, built: list[CompiledMonitor],
) -> None:
    folder = tmp_path / 'prefix' / 'share' / 'my_msgs' / 'msg'
    (folder / 'Level.msg').write_text('Head head\nfloat32 level\n')
    (folder / 'Head.msg').write_text('string name\n')
    message = b'\0\1\0\0' + struct.pack('<I4sf', 4, b'abc', 1.5)
    first = start(bundle)
    assert read_fields(first.monitor, 0, message) == (FieldReading(ReadOutcome.READ, 1.5),)
    assert start(bundle).manifest == first.manifest
    (folder / 'Head.msg').write_text('uint8[4] name\nuint8[4] more  # of it\n')
    second = start(bundle)
    assert read_fields(second.monitor, 0, message) == (FieldReading(ReadOutcome.READ, 1.5),)
    (folder / 'Head.msg').write_text('uint8[4] name\n')
    third = start(bundle)
    assert read_fields(third.monitor, 0, message) != (FieldReading(ReadOutcome.READ, 1.5),)
    assert len({item.manifest.bundle_hash for item in (first, second, third)}) == 3
    assert len({item.manifest.source_hash for item in (first, second, third)}) == 3
    assert len(built) == 3


def test_other_overrides_or_compilers_cause_a_new_build(
    bundle: Path, tmp_path: Path, built: list[CompiledMonitor], monkeypatch: pytest.MonkeyPatch,
) -> None:
    start(bundle)
    start(bundle, policy=Policy.RELEVANT_MESSAGE)
    start(bundle, policy=Policy.PERIODIC, period=Fraction(1, 10))
    start(bundle, policy=Policy.PERIODIC, period=Fraction(1, 5))
    assert [item.manifest.period for item in built] == [None, None, 0.1, 0.2]
    for value in ('2.5', '3.5', '2.5'):
        start(bundle, constants={'limit': Text.whole(Source('parameter', value))})
    assert [item.manifest.constants for item in built[3:]] == [
        (('limit', '1.0'),), (('limit', '2.5'),), (('limit', '3.5'),)]
    assert len({item.manifest.bundle_hash for item in built}) == 6
    wrapper = tmp_path / 'cc'
    wrapper.write_text('#!/bin/sh\nexec gcc "$@"\n')
    wrapper.chmod(0o755)
    evaluator = evaluator_library()  # it would be built anew, too, and takes longest
    monkeypatch.setattr('fret_monitor.start.evaluator_library', lambda: evaluator)
    monkeypatch.setenv('CC', str(wrapper))
    start(bundle)
    assert len(built) == 7


@pytest.mark.parametrize('damage', some(DAMAGES, 3))
def test_a_damaged_note_is_ignored(
    damage: Callable[[dict[str, Any]], Any], bundle: Path, built: list[CompiledMonitor],
) -> None:
    start(bundle)
    changed = damage(json.loads(note().read_text()))
    note().write_text(changed if isinstance(changed, str) else json.dumps(changed))
    assert limit_of(start(bundle)) == 1.0
    assert len(built) == 2


def test_a_damaged_library_is_built_again(bundle: Path, built: list[CompiledMonitor]) -> None:
    library = start(bundle).library
    library.write_bytes(library.read_bytes()[:-1])
    assert limit_of(start(bundle)) == 1.0
    assert len(built) == 2


@pytest.mark.parametrize('part', ['note', 'folder', 'link'])
def test_a_note_that_others_can_write_is_ignored(
    part: str, bundle: Path, tmp_path: Path, built: list[CompiledMonitor],
) -> None:
    start(bundle)
    found = note()
    content = json.loads(found.read_text())
    content['manifest'] = content['manifest'].replace('"a"', '"elsewhere"')
    assert 'elsewhere' in content['manifest']
    found.write_text(json.dumps(content))
    if part == 'link':
        found.rename(tmp_path / 'planted')
        found.symlink_to(tmp_path / 'planted')
    else:
        (found if part == 'note' else found.parent).chmod(0o770)
    assert start(bundle).manifest.topics[0].name == 'a'
    assert len(built) == 2


def test_notes_unused_for_90_days_are_removed(
    bundle: Path, built: list[CompiledMonitor],
) -> None:
    start(bundle)
    old = note()
    os.utime(old, (1, 1))
    start(bundle)
    assert len(built) == 1 and old.stat().st_mtime > 1, 'it was asked for'
    os.utime(old, (1, 1))
    start(bundle, policy=Policy.RELEVANT_MESSAGE)
    assert note() != old


def test_a_bad_bundle_leaves_no_note(bundle: Path) -> None:
    bundle.write_text(BUNDLE.replace('limit"', 'limt"'))
    with pytest.raises(CompileError, match='limt'):
        start(bundle)
    assert not (cache_directory() / 'bundles').exists()
