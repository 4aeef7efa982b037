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

"""The engine and the hot path in C: time, threads, sanitizers, the middleware's structs."""

import os
from pathlib import Path
import re
import subprocess
import sys
from typing import Any

from bag.recordings import TYPES
from differential import compiled
from differential.compiled import WARNINGS, ZIG
import fret_monitor
from fret_monitor.native import csrc_directory, csrc_file, csrc_includes
import objects
import pytest
from rosbags.rosbag2 import Reader
from strategies import EXAMPLES, thorough

HERE = Path(__file__).parent
PAUSE = HERE / 'engine_pause.h'
HEADER = 'std_msgs/msg/Header'
SOURCES = objects.engine_sources()
INCLUDES = csrc_includes()
THREADS = ('engine_threads', 'receivers', 'relay', 'locks', 'verdicts', 'actions')

# The names that csrc/ros gives to types of the middleware, and their names in its headers.
STRUCTS = {
    'fm_allocator': ('rcutils_allocator_t', {
        'allocate': 'allocate', 'deallocate': 'deallocate', 'reallocate': 'reallocate',
        'zero_allocate': 'zero_allocate', 'state': 'state'}),
    'fm_serialized': ('rmw_serialized_message_t', {
        'buffer': 'buffer', 'length': 'buffer_length', 'capacity': 'buffer_capacity',
        'allocator': 'allocator'}),
    'fm_type_support': ('rosidl_message_type_support_t', {
        name: name for name in (
            'typesupport_identifier', 'data', 'func', 'get_type_hash_func',
            'get_type_description_func', 'get_type_description_sources_func')}),
    'fm_service_support': ('rosidl_service_type_support_t', {
        name: name for name in (
            'typesupport_identifier', 'data', 'func', 'request_typesupport',
            'response_typesupport')}),
    'fm_service_info': ('rmw_service_info_t', {
        'source_timestamp': 'source_timestamp', 'received_timestamp': 'received_timestamp',
        'writer_guid': 'request_id.writer_guid',
        'sequence_number': 'request_id.sequence_number'}),
    'fm_message_member': ('rosidl_typesupport_introspection_c__MessageMember', {
        name: f'{name}_' for name in (
            'name', 'type_id', 'members', 'is_array', 'offset', 'default_value')}),
    'fm_message_members': ('rosidl_typesupport_introspection_c__MessageMembers', {
        'member_count': 'member_count_', 'size': 'size_of_', 'members': 'members_',
        'init': 'init_function', 'fini': 'fini_function'}),
    'fm_ros_string': ('rosidl_runtime_c__String', {
        name: name for name in ('data', 'size', 'capacity')}),
    'fm_ros_pair': ('diagnostic_msgs__msg__KeyValue', {'key': 'key', 'value': 'value'}),
    'fm_ros_status': ('diagnostic_msgs__msg__DiagnosticStatus', {
        **{name: name for name in ('level', 'name', 'message', 'hardware_id')},
        'values': 'values.data', 'n_values': 'values.size', 'capacity': 'values.capacity'}),
    'fm_ros_statuses': ('diagnostic_msgs__msg__DiagnosticArray', {
        'sec': 'header.stamp.sec', 'nanosec': 'header.stamp.nanosec',
        'frame_id': 'header.frame_id', 'statuses': 'status.data', 'n': 'status.size',
        'capacity': 'status.capacity'}),
    'fm_gid': ('rmw_gid_t', {'implementation': 'implementation_identifier', 'data': 'data'}),
    'fm_message_info': ('rmw_message_info_t', {
        'source_timestamp': 'source_timestamp', 'received_timestamp': 'received_timestamp',
        'publication_sequence_number': 'publication_sequence_number',
        'reception_sequence_number': 'reception_sequence_number',
        'implementation': 'publisher_gid.implementation_identifier', 'gid': 'publisher_gid.data',
        'from_intra_process': 'from_intra_process'}),
}
FUNCTIONS = {
    'take': 'rmw_take_serialized_message_with_info',
    'listen': 'rmw_subscription_set_on_new_message_callback',
    'publish': 'rmw_publish',
    'forget_error': 'rcutils_reset_error',
    'has_error': 'rcutils_error_is_set',
    'count_matched': 'rmw_publisher_count_matched_subscriptions',
    'take_message': 'rmw_take_with_info',
    'is_available': 'rmw_service_server_is_available',
    'send': 'rmw_send_request',
    'take_response': 'rmw_take_response',
    'deserialize': 'rmw_deserialize',
    'publish_serialized': 'rmw_publish_serialized_message',
}
PREFIXES = ('fm_service_support',)  # of a longer struct
KINDS = {'BOOLEAN': 'FM_BOOLEAN_FIELD', 'UINT8': 'FM_UINT8_FIELD', 'STRING': 'FM_STRING_FIELD',
         'MESSAGE': 'FM_MESSAGE_FIELD'}


def run(*command: object, folder: Path | None = None) -> 'subprocess.CompletedProcess[str]':
    return subprocess.run(
        [str(word) for word in command], text=True, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, check=False, timeout=300, cwd=folder)


class Sanitized:
    """The engine compiled with a sanitizer, for the programs of this folder."""

    def __init__(self, folder: Path, flags: tuple[str, ...]) -> None:
        """Compile to objects; skip the test if a program cannot be built here."""
        self._folder = folder
        self._command = objects.command(flags)
        (folder / 'empty.c').write_text('int main(void) {return 0;}\n', encoding='utf-8')
        if run(*self._command, folder / 'empty.c', '-o', folder / 'empty').returncode != 0:
            pytest.skip('this compiler has no such sanitizer')
        self._objects = objects.engine(flags)

    def program(self, name: str, *flags: object, is_preempted: bool = False) -> Path:
        """Build a program of this folder, with pauses in the engine if it is preempted."""
        parts = dict(self._objects)
        if is_preempted:
            changed = [source for source in SOURCES
                       if 'FM_PAUSE' in source.read_text(encoding='utf-8')]
            assert changed
            parts.update(zip(changed, objects.compiled(
                changed, self._folder, [*self._command, '-include', str(PAUSE)])))
            flags = ('-include', PAUSE, *flags)
        program = self._folder / name
        built = run(*self._command, *flags, HERE / f'{name}.c', *parts.values(), '-o', program,
                    '-lm', '-pthread')
        assert (built.returncode, built.stdout) == (0, '')
        return program


@pytest.fixture(scope='module')
def threads(tmp_path_factory: pytest.TempPathFactory) -> Sanitized:
    return Sanitized(tmp_path_factory.mktemp('threads'), ('-fsanitize=thread', '-g1'))


@pytest.fixture(scope='module')
def addresses(tmp_path_factory: pytest.TempPathFactory) -> Sanitized:
    return Sanitized(tmp_path_factory.mktemp('addresses'), compiled.SANITIZERS)


@pytest.fixture(params=['threads', 'addresses'])
def sanitized(request: pytest.FixtureRequest) -> Sanitized:
    found: Sanitized = request.getfixturevalue(request.param)
    return found


# The nodes in C of test/ros run under the sanitizer of addresses, too.
@pytest.mark.parametrize(('sanitized', 'name'), [
    *(('threads', name) for name in THREADS), ('addresses', THREADS[0]),
    *(pytest.param('addresses', name, marks=thorough) for name in THREADS[1:])],
    indirect=['sanitized'])
def test_threads(sanitized: Sanitized, name: str) -> None:
    program = sanitized.program(name)
    for _ in range(max(1, EXAMPLES // 50)):
        done = run(program)
        assert (done.returncode, done.stdout) == (0, '')


def test_questions_to_nodes_that_were_killed(sanitized: Sanitized) -> None:
    done = run(sanitized.program('questions', '-Wl,--wrap=clock_gettime'))
    assert (done.returncode, done.stdout) == (0, '')


def test_the_log_of_violations_after_memory_was_short(addresses: Sanitized) -> None:
    done = run(addresses.program('violation_memory', '-Wl,--wrap=calloc'))
    assert (done.returncode, done.stdout) == (0, '')


def test_files_of_the_black_box(sanitized: Sanitized, tmp_path: Path) -> None:
    done = run(sanitized.program('blackbox_files'), tmp_path)
    assert (done.returncode, done.stdout) == (0, '')

    ends = set[str]()

    def messages(name: str) -> dict[str, int]:
        found = {}
        for path in sorted(filter(Path.is_file, (tmp_path / name).iterdir())):
            with Reader(path) as reader:
                found[path.name] = {item.topic: item.msgcount for item in reader.connections}['/x']
                headers: list[Any] = [TYPES.deserialize_cdr(data, HEADER)
                                      for item, _, data in reader.messages()
                                      if item.msgtype == HEADER]
            ends.update(header.frame_id for header in headers)
        return found

    assert messages('longest') == {
        'blackbox_a_robot_node_R_1.mcap': 2, 'blackbox_b_robot_node_R_1.mcap': 2}
    assert messages('names') == {f'blackbox_name_robot_node_R_1{suffix}.mcap': 0
                                 for suffix in ('', '_2', '_3')}
    assert messages('full') == {}
    assert len(messages('writer')) >= 1
    assert all(number > 0 for number in messages('writer').values())
    assert ends == {'R-1'}


def test_messages_and_deadlines_under_the_policy_timed(sanitized: Sanitized) -> None:
    done = run(sanitized.program('engine_timed', '-Wl,--wrap=clock_gettime'))
    assert (done.returncode, done.stdout) == (0, '')


def test_time_that_is_told_or_of_a_clock(addresses: Sanitized) -> None:
    done = run(addresses.program('engine_time'))
    assert (done.returncode, done.stdout) == (0, '')


def test_an_engine_with_instances(addresses: Sanitized) -> None:
    done = run(addresses.program('engine_instances'))
    assert (done.returncode, done.stdout) == (0, '')


def test_messages_that_wait_in_the_queues_of_the_middleware(addresses: Sanitized) -> None:
    done = run(addresses.program(
        'backlog', '-Wl,--wrap=clock_gettime,--wrap=fm_engine_begin_order'))
    assert (done.returncode, done.stdout) == (0, '')


# Races show under preemption; test_time_that_is_told_or_of_a_clock uses the memory of clocks.
@pytest.mark.parametrize(('sanitized', 'is_preempted'), [
    ('threads', True), *(pytest.param(*case, marks=thorough) for case in (
        ('threads', False), ('addresses', False), ('addresses', True)))], indirect=['sanitized'])
def test_clocks_that_run(sanitized: Sanitized, is_preempted: bool) -> None:
    done = run(sanitized.program('engine_clock', is_preempted=is_preempted))
    assert (done.returncode, done.stdout) == (0, '')


def test_only_the_announcer_takes_violations() -> None:
    users = [path.name for path in csrc_directory().rglob('*.c')
             if 'fm_engine_take(' in path.read_text(encoding='utf-8')]
    assert sorted(users) == ['announcer.c', 'engine.c']
    package = Path(fret_monitor.__file__).parent
    assert [path.name for path in package.rglob('*.py')
            if re.search(r'engine\.take\(|fm_engine_take\(', path.read_text(encoding='utf-8'))
            ] == ['engine.py']


def test_a_violation_queued_just_before_closing_is_published(addresses: Sanitized) -> None:
    program = addresses.program(
        'closing', '-Wl,--wrap=fm_engine_is_closed,--wrap=fm_engine_take')
    for place in ('before_take', 'after_take', 'before_is_closed', 'after_is_closed'):
        done = run(program, place)
        assert (done.returncode, done.stdout) == (0, '')


COMPILERS = {'gcc': compiled.gcc, 'clang': compiled.clang}


@pytest.fixture(params=COMPILERS)
def compiler(request: pytest.FixtureRequest) -> tuple[str, ...]:
    found = COMPILERS[request.param]()
    return found or pytest.skip(f'no {request.param}')


def test_losses_counted_are_messages_dropped(tmp_path: Path, compiler: tuple[str, ...]) -> None:
    program = tmp_path / 'losses'
    built = run(*compiler, '-std=c99', '-O1', *WARNINGS, *INCLUDES, HERE / 'losses.c',
                csrc_file('handover.c'), '-o', program)
    assert (built.returncode, built.stdout) == (0, '')
    for seed in range(4):
        done = run(program, seed)
        assert (done.returncode, done.stdout) == (0, '')


# Objects of all sources are compiled with the same warnings as errors, with -O0 and -O1.
@pytest.mark.parametrize('how', [
    pytest.param(('-std=c99', '-O3', '-c'), marks=thorough),
    pytest.param(('-std=c11', '-fsyntax-only'), marks=thorough), ('-std=gnu11', '-fsyntax-only')])
def test_it_compiles_with_gcc_without_warnings(tmp_path: Path, how: tuple[str, ...]) -> None:
    gcc = compiled.gcc() or pytest.skip('no gcc')
    done = run(*gcc, *how, *WARNINGS, *INCLUDES, *SOURCES, folder=tmp_path)
    assert (done.returncode, done.stdout) == (0, '')


@pytest.mark.parametrize('standard', ['c99', pytest.param('gnu11', marks=thorough)])
def test_it_compiles_with_clang_without_warnings(standard: str) -> None:
    # gcc gives some warnings only after it has optimised, clang gives all of them before.
    clang = compiled.clang_check() or pytest.skip('no clang')
    done = run(*clang, f'-std={standard}', *WARNINGS, *INCLUDES, *SOURCES)
    assert (done.returncode, done.stdout) == (0, '')


def include_flags() -> list[str]:
    """Return the include flags of the headers of ROS: each package has a folder of its own."""
    prefixes = [*filter(None, os.environ.get('AMENT_PREFIX_PATH', '').split(':')), sys.prefix]
    for prefix in prefixes:
        root = Path(prefix) / 'include'
        if (root / 'rmw' / 'rmw' / 'rmw.h').is_file():
            return [f'-isystem{folder}' for folder in sorted(root.iterdir()) if folder.is_dir()]
    pytest.skip('no headers of ROS here')


def test_structs_and_functions_are_those_of_the_middleware(tmp_path: Path) -> None:
    lines = ['#include <rmw/rmw.h>', '#include <rcutils/error_handling.h>',
             '#include "in_place.h"', '#include "service_call.h"', '#include "reports.h"',
             '#include <diagnostic_msgs/msg/diagnostic_array.h>',
             '#include <rosidl_typesupport_introspection_c/message_introspection.h>',
             '#include <rosidl_typesupport_introspection_c/field_types.h>']
    lines += [f'_Static_assert((int){ours} == '
              f'(int)rosidl_typesupport_introspection_c__ROS_TYPE_{name}, "{name}");'
              for name, ours in KINDS.items()]
    for ours, (theirs, fields) in STRUCTS.items():
        if ours not in PREFIXES:
            lines.append(f'_Static_assert(sizeof(struct {ours}) == sizeof({theirs}), "{ours}");')
        for mine, other in fields.items():
            lines.append(f'_Static_assert(offsetof(struct {ours}, {mine}) == '
                         f'offsetof({theirs}, {other}), "{ours}.{mine}");')
            lines.append(f'_Static_assert(sizeof(((struct {ours} *)0)->{mine}) == '
                         f'sizeof((({theirs} *)0)->{other}), "size of {ours}.{mine}");')
    lines.append('_Static_assert(RMW_RET_OK == 0, "ok");')
    lines.append('_Static_assert(sizeof(rmw_ret_t) == sizeof(int), "result");')
    # All arguments are pointers, so a call through our type is correct if both take as many. An
    # assignment with a cast to the middleware's type would hide a missing argument.
    counts = {'take': 5, 'listen': 3, 'publish': 3, 'has_error': 0, 'count_matched': 2,
              'take_message': 5, 'is_available': 3, 'send': 3, 'take_response': 4,
              'deserialize': 3, 'publish_serialized': 3}
    for field, count in counts.items():
        arguments = ', '.join(['(void *)0'] * count)
        lines.append(f'int call_{field}(void) {{return (int){FUNCTIONS[field]}({arguments});}}')
    source = tmp_path / 'same.c'
    source.write_text('\n'.join(lines) + '\n', encoding='utf-8')
    done = run(*(compiled.gcc() or compiled.clang() or ()), '-std=c11', *INCLUDES,
               *include_flags(), '-w', '-c', source, '-o', tmp_path / 'same.o')
    assert (done.returncode, done.stdout) == (0, '')


def test_the_callbacks_of_a_type_support_are_those_of_fast_dds(tmp_path: Path) -> None:
    ours = ('message_namespace', 'message_name', 'cdr_serialize', 'cdr_deserialize',
            'get_serialized_size', 'max_serialized_size', 'key_callbacks')
    theirs = ('message_namespace_', 'message_name_', *ours[2:])
    lines = ['#include <rosidl_typesupport_fastrtps_cpp/message_type_support.h>',
             '#include "in_place.h"',
             'using Theirs = message_type_support_callbacks_t;',
             'static_assert(sizeof(fm_type_callbacks) == sizeof(Theirs), "size");']
    for mine, other in zip(ours, theirs):
        lines.append(f'static_assert(offsetof(fm_type_callbacks, {mine}) == '
                     f'offsetof(Theirs, {other}), "{mine}");')
    source = tmp_path / 'same.cpp'
    source.write_text('\n'.join(lines) + '\n', encoding='utf-8')
    flags = include_flags()
    prefix = Path(flags[0].removeprefix('-isystem')).parent
    done = run(ZIG, 'c++', '-std=c++17', *INCLUDES, *flags,
               f'-isystem{prefix}', '-w', '-c', source, '-o', tmp_path / 'same.o')
    assert (done.returncode, done.stdout) == (0, '')
