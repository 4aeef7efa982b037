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


"""`new --bag`: a first bundle says what was recorded, and leads to a violation in two edits."""

import io
from pathlib import Path

from bag.recordings import FLOAT, START, TYPES, write
from fret_monitor.bag.recording import Recording
from fret_monitor.build import read
from fret_monitor.cli.main import main
from fret_monitor.messages.layout import MessageLayout
from fret_monitor.model.diagnostics import refuse
import numpy
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import get_types_from_msg, get_typestore, Stores

SECOND = 10 ** 9
TWIST, BOOL = 'geometry_msgs/msg/Twist', 'std_msgs/msg/Bool'


def recording(folder: Path) -> Path:
    """Write a recording of a command, a switch, and something without numbers."""
    vector = TYPES.types['geometry_msgs/msg/Vector3']
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        command = writer.add_connection('/base/cmd_vel', TWIST, typestore=TYPES)
        switch = writer.add_connection('/enable', BOOL, typestore=TYPES)
        text = writer.add_connection('/note', 'std_msgs/msg/String', typestore=TYPES)
        for k in range(21):
            message = TYPES.types[TWIST](vector(k / 10, 0.0, 0.0), vector(0.0, 0.0, -1.5))
            writer.write(command, START + k * SECOND // 2 + (k > 10) * SECOND,
                         TYPES.serialize_cdr(message, TWIST))
        for k in range(2):
            writer.write(switch, START + k * SECOND,
                         TYPES.serialize_cdr(TYPES.types[BOOL](bool(k)), BOOL))
        writer.write(text, START, TYPES.serialize_cdr(
            TYPES.types['std_msgs/msg/String']('hello'), 'std_msgs/msg/String'))
    return folder


def with_examples(text: str) -> str:
    """Return a new bundle without the marks before its examples."""
    before, _, after = text.partition('# requirements:')
    return before + ('# requirements:' + after).replace('\n# ', '\n').removeprefix('# ')


def test_each_field_has_what_was_seen_of_it(tmp_path: Path) -> None:
    target = tmp_path / 'new.yaml'
    bag = str(recording(tmp_path / 'run'))
    assert main(['new', '--bag', bag, '--all', '-o', str(target)]) == 0
    text = target.read_text(encoding='utf-8')
    assert ('  # /base/cmd_vel: 21 messages, 1.82 a second, longest gap 1.5 s\n'
            '  cmd_vel_linear_x: {topic: /base/cmd_vel, type: geometry_msgs/msg/Twist, '
            'field: linear.x, timeout: 3}   # 0 to 2\n') in text
    assert 'angular.z, timeout: 3}   # always -1.5\n' in text
    assert '  enable: {topic: /enable, type: std_msgs/msg/Bool, field: data, timeout: 2}   ' \
        '# false and true\n' in text
    assert '/note' not in text


def test_two_edits_find_a_violation(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target, bag = tmp_path / 'new.yaml', recording(tmp_path / 'run')
    main(['new', '--bag', str(bag), '--topics', 'base/cmd_vel', '-o', str(target)])
    text = target.read_text(encoding='utf-8')
    live = with_examples(text)
    target.write_text(live, encoding='utf-8')
    assert len(read(target).specification.properties) == 2
    assert main(['bag', str(target), str(bag)]) == 0
    assert 'EXAMPLE-1    satisfied' in capsys.readouterr().out
    target.write_text(live.replace('cmd_vel_linear_x <= 2.0', 'cmd_vel_linear_x <= 1.5'))
    main(['bag', str(target), str(bag)])
    assert 'EXAMPLE-1    VIOLATED' in capsys.readouterr().out


def test_the_first_example_holds_in_the_recording_though_a_value_was_nan(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag = write(tmp_path / 'run', [('x', 0, -0.0), ('x', SECOND, float('nan')),
                                   ('x', 2 * SECOND, -1.5), ('y', 0, float('inf'))])
    target = tmp_path / 'new.yaml'
    assert main(['new', '--bag', str(bag), '--all', '-o', str(target)]) == 0
    text = target.read_text(encoding='utf-8')
    assert '# -1.5 to 0 and NaN' in text and 'satisfy !(x > 0.0)' in text
    target.write_text(with_examples(text), encoding='utf-8')
    assert main(['bag', str(target), str(bag)]) == 0
    assert 'EXAMPLE-1    satisfied' in capsys.readouterr().out
    endless = write(tmp_path / 'endless', [('y', 0, 1.0), ('y', SECOND, float('inf'))])
    assert main(['new', '--bag', str(endless), '--all']) == 0
    assert 'EXAMPLE-1   # never above 100\n' in capsys.readouterr().out


def test_several_recordings_are_one(tmp_path: Path) -> None:
    bags = [write(tmp_path / name, [('x', 0, low), ('x', gap, high)]) for name, low, high, gap in (
        ('a', 1.0, 2.0, SECOND), ('b', -3.0, 0.5, 4 * SECOND))]
    other = write(tmp_path / 'c', [('y', 0, 7.0)])
    target = tmp_path / 'new.yaml'
    main(['new', '--bag', *map(str, [*bags, other]), '--all', '-o', str(target)])
    text = target.read_text(encoding='utf-8')
    assert '# /x: 4 messages, 0.4 a second, longest gap 4 s\n' in text
    assert f'x: {{topic: /x, type: {FLOAT}, field: data, timeout: 8}}   # -3 to 2\n' in text
    assert f'y: {{topic: /y, type: {FLOAT}, field: data}}   # always 7\n' in text


def test_fields_of_one_name_have_different_names(tmp_path: Path) -> None:
    bag = write(tmp_path / 'run', [(topic, 0, 1.0) for topic in ('/a/x', '/b/x', '/H', '/a_x')])
    target = tmp_path / 'new.yaml'
    main(['new', '--bag', str(bag), '--all', '-o', str(target)])
    lines = target.read_text(encoding='utf-8').splitlines()
    names = [line.split(':')[0].strip() for line in lines if 'field: data' in line]
    assert len(set(names)) == 4 and 'H' not in names


def test_what_a_bundle_cannot_say_is_not_written(tmp_path: Path) -> None:
    int64 = 'std_msgs/msg/Int64'
    with Writer(tmp_path / 'run', version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        big = writer.add_connection('/mode', int64, typestore=TYPES)
        for k in range(3):  # a microsecond apart; the greatest is beyond what a float64 tells
            data = TYPES.serialize_cdr(TYPES.types[int64](2 ** 63 - 3 + k), int64)
            writer.write(big, START + 1000 * k, data)
    endless = write(tmp_path / 'endless', [('until', 0, 1.0), ('until', 1, float('inf'))])
    for bag, name, what in ((tmp_path / 'run', 'mode_value', 'timeout: 0.001'),
                            (endless, 'until_value', '1 to inf')):
        target = tmp_path / f'{name}.yaml'
        assert main(['new', '--bag', str(bag), '--all', '-o', str(target)]) == 0
        text = target.read_text(encoding='utf-8')
        assert f'  {name}: ' in text and what in text
        target.write_text(with_examples(text), encoding='utf-8')
        assert main(['check', str(target)]) == 0
        assert main(['bag', str(target), str(bag)]) == 0 or name == 'until_value'


def test_what_is_always_the_same_was_seen_to_be(tmp_path: Path) -> None:
    kind, target = 'std_msgs/msg/UInt64', tmp_path / 'new.yaml'
    with Writer(tmp_path / 'run', version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        big = writer.add_connection('/big', kind, typestore=TYPES)
        number = writer.add_connection('/x', FLOAT, typestore=TYPES)
        for k in range(4):
            data = TYPES.serialize_cdr(TYPES.types[kind](2 ** 64 - 1 - k), kind)
            writer.write(big, START + k, data)
            value = float('inf') if k % 2 else float('nan')
            writer.write(number, START + k, TYPES.serialize_cdr(TYPES.types[FLOAT](value), FLOAT))
    nan = write(tmp_path / 'nan', [('y', 0, float('nan'))])
    assert main(['new', '--bag', str(tmp_path / 'run'), str(nan), '--all', '-o', str(target)]) == 0
    ranges = dict(line.strip().split(': {', 1) for line in target.read_text().splitlines()
                  if 'field: data' in line)
    assert {name: line.partition('# ')[2] for name, line in ranges.items()} == {
        'big': 'about 1.84467e+19', 'x': 'inf and NaN', 'y': 'always NaN'}


ODD = 'odd_msgs/msg/Odd'


def odd(folder: Path, definition: str = 'float64 x') -> Path:
    """Write a recording of a type that is installed nowhere."""
    types = get_typestore(Stores.ROS2_JAZZY)
    types.register(get_types_from_msg(definition, ODD))
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        own = writer.add_connection('/odd', ODD, typestore=types)
        for k in range(3):
            values = [float(k)] if definition == 'float64 x' else [numpy.array([1.0]), []]
            message = types.types[ODD](*values)
            writer.write(own, START + k, types.serialize_cdr(message, ODD))
    return folder


def test_each_recording_has_its_own_message_types(tmp_path: Path) -> None:
    target = tmp_path / 'new.yaml'
    bags = [str(recording(tmp_path / 'run')), str(odd(tmp_path / 'odd'))]
    assert main(['new', '--bag', *bags, '--all', '-o', str(target)]) == 0
    text = target.read_text(encoding='utf-8')
    assert f'odd_x: {{topic: /odd, type: {ODD}, field: x, timeout: 0.001}}   # 0 to 2\n' in text
    assert '# /base/cmd_vel: 21 messages, 1.82 a second, longest gap 1.5 s\n' in text
    assert f'not installed here: {ODD}. `bag` takes them' in text


def test_topics_of_two_types_and_without_numbers_are_left_out_and_told(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target, path = tmp_path / 'new.yaml', tmp_path / 'two'
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for kind in (FLOAT, BOOL):
            one = writer.add_connection('/x', kind, typestore=TYPES)
            for k in range(3):  # the types alternate in time
                data = TYPES.serialize_cdr(TYPES.types[kind](1), kind)
                writer.write(one, START + k * SECOND + (kind == BOOL), data)
    once = write(tmp_path / 'once', [('/enable', 0, 1.0)])
    bags = [str(recording(tmp_path / 'run')), str(path), str(once)]
    assert main(['new', '--bag', *bags, '--all', '-o', str(target)]) == 0
    said = capsys.readouterr().err
    assert f'warning: /enable is left out: it was recorded as {BOOL} and {FLOAT}\n' in said
    assert f'warning: /x is left out: it was recorded as {BOOL} and {FLOAT}\n' in said
    assert 'warning: left out, as they have no numbers: /note\n' in said
    assert '/x' not in target.read_text() and '/enable' not in target.read_text()
    assert main(['new', '--bag', *bags, '--topics', 'base/cmd_vel']) == 0
    assert capsys.readouterr().err == ''
    assert main(['new', '--bag', *bags, '--topics', 'base/cmd_vel', 'x']) == 0
    said = capsys.readouterr().err
    assert 'warning: /x is left out' in said and '/note' not in said and '/enable is' not in said
    assert main(['new', '--bag', *bags, '--topics', 'note', 'base/cmd_vel']) == 0
    assert capsys.readouterr().err == 'warning: left out, as they have no numbers: /note\n'
    assert main(['new', '--bag', *bags, '--topics', 'note']) == 1
    assert "no topic '/note' with numbers was recorded" in capsys.readouterr().err


def test_messages_of_arrays_alone_are_counted(tmp_path: Path) -> None:
    target, bag = tmp_path / 'new.yaml', odd(tmp_path / 'odd', 'float64[] x\nstring[] names')
    assert main(['new', '--bag', str(bag), '--all', '-o', str(target)]) == 0
    text = target.read_text(encoding='utf-8')
    assert '# /odd: 3 messages\n  # an array: field: "x[0]"' in text and 'names' not in text


class Terminal(io.StringIO):
    """A terminal with what was typed, or what was printed."""

    def isatty(self) -> bool:
        """Return that it is one."""
        return True


@pytest.mark.parametrize(('typed', 'inputs'), [('2\n', 1), ('1, 2\n', 7), ('\n', 7)])
def test_a_menu_asks_for_the_topics(typed: str, inputs: int, tmp_path: Path,
                                    monkeypatch: pytest.MonkeyPatch,
                                    capsys: pytest.CaptureFixture[str]) -> None:
    printed = Terminal()
    bag = str(recording(tmp_path / 'run'))
    monkeypatch.setattr('sys.stdin', Terminal(typed))
    monkeypatch.setattr('sys.stderr', printed)
    assert main(['new', '--bag', bag, '-o', str(tmp_path / 'new.yaml')]) == 0
    assert '   1  /base/cmd_vel\n   2  /enable\n' in printed.getvalue()
    assert f': {inputs} input' in capsys.readouterr().out


def test_a_number_that_is_not_in_the_menu_is_refused(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bag = str(recording(tmp_path / 'run'))
    printed = Terminal()
    monkeypatch.setattr('sys.stdin', Terminal('3\n'))
    monkeypatch.setattr('sys.stderr', printed)
    assert main(['new', '--bag', bag]) == 1
    assert 'is no number of a topic' in printed.getvalue()


def test_what_cannot_be_made_is_refused(tmp_path: Path,
                                        capsys: pytest.CaptureFixture[str]) -> None:
    bag = str(recording(tmp_path / 'run'))
    target = tmp_path / 'new.yaml'
    target.write_text('mine')
    (tmp_path / 't.csv').write_text('time,x\n0,1\n')
    (tmp_path / 't.txt').write_text('hello')
    for arguments, message in (
            ([bag, '--all', '-o', str(target)], 'exists'),
            ([bag, '--topics', '/enabel'], 'did you mean'),
            ([bag], '--topics TOPIC... takes some, --all takes all'),
            ([str(tmp_path / 'none'), '--all'], 'none'),
            ([str(tmp_path / 't.csv'), '--all'], 'is a table of values, which has no topics'),
            ([str(tmp_path / 't.txt'), '--all'], 'file .mcap, .db3 or .bag; `bag` reads')):
        assert main(['new', '--bag', *arguments]) == 1
        assert message in capsys.readouterr().err
    assert target.read_text() == 'mine'


def test_topics_without_a_definition_are_left_out_and_texts_alone_are_no_bundle(
        tmp_path: Path, capsys: pytest.CaptureFixture[str],
        monkeypatch: pytest.MonkeyPatch) -> None:
    real, target = Recording.find_message, tmp_path / 'new.yaml'

    def find_message(recording: Recording, kind: str) -> MessageLayout:
        if kind == BOOL:
            refuse("no messages of a package 'std_msgs' were found")
        return real(recording, kind)

    monkeypatch.setattr(Recording, 'find_message', find_message)
    bag = str(recording(tmp_path / 'run'))
    assert main(['new', '--bag', bag, '--all', '-o', str(target)]) == 0
    said = capsys.readouterr().err
    assert "warning: /enable is left out: no messages of a package 'std_msgs' were found" in said
    assert 'as they have no numbers: /note\n' in said
    assert '/enable' not in target.read_text(encoding='utf-8')
    with Writer(tmp_path / 'text', version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        writer.add_connection('/note', 'std_msgs/msg/String', typestore=TYPES)
    assert main(['new', '--bag', str(tmp_path / 'text'), '--all']) == 1
    assert 'no topic with numbers was recorded' in capsys.readouterr().err
