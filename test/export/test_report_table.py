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

"""The table of texts of a bundle is the same as text of C and as memory that Python makes."""

from pathlib import Path
import subprocess
from typing import Any

from bundles import write_bundle
from fret_monitor.build import generate_monitor, read
from fret_monitor.export.ros2_table import initializer
from fret_monitor.model.parts import NodePart
from fret_monitor.model.report_table import report_table
from fret_monitor.native import csrc_includes
from fret_monitor.native.binding import ffi
from fret_monitor.native.compiler import find_compiler
from fret_monitor.runtime.reporting import ReportTable
import pytest

BUNDLE = """
format: 1
component: arm
constants: {low: -1.5, most: 18446744073709551615}
inputs:
  x: {topic: x, type: std_msgs/msg/Float64, timeout: 0.25, stale: violate, initial: -1.5e300}
  n: {topic: n, type: std_msgs/msg/UInt64, values: {MOST: 18446744073709551615}, timeout: 1.5}
  s: {topic: s, type: std_msgs/msg/String, values: {OPEN: "o\\\\p", SHUT: "s"}}
actions:
  stop: {lock: {topic: e_stop, rate: 4}}
  tell: {publish: {topic: told, type: std_msgs/msg/Int32, message: {data: -7}, rate: 5}}
  reset: {call: {service: /other/reset, type: std_srvs/srv/Trigger, timeout: 3.0}}
requirements:
  - {id: A, title: 'a "title"', ptltl: "x > low", on_violation: [tell, stop], on_end: [reset]}
  - {id: B, ptltl: "H (n != most | s = SHUT)", severity: warn, report: occurrence}
gates:
  g: {from: x_in, to: x_out, type: std_msgs/msg/Float64, keep: [A]}
evaluation: {policy: timed}
"""
LENGTHS = {'topics': 'n_used', 'topic_inputs': 'n_topics', 'follows': 'n_requirements',
           'payload': 'payload_size'}


def plain(found: Any) -> Any:
    """Return a struct of C as a dictionary, without addresses, and without what has no length."""
    return {name: member(found, name, kind.type) for name, kind in ffi.typeof(found).fields
            if name != 'comparisons'}


def member(owner: Any, name: str, kind: Any) -> Any:
    value = getattr(owner, name)
    if kind.cname == 'char *':
        return ffi.string(value)
    if kind.kind == 'pointer':
        n = getattr(owner, LENGTHS.get(name, f'n_{name}'), int(value != ffi.NULL))
        return [item if isinstance(item, int) else plain(item) for item in value[0:n]] if n else []
    return bytes(ffi.buffer(ffi.addressof(owner, name))) if kind.kind == 'union' else value


@pytest.mark.parametrize('part', [None, NodePart('g')])
def test_both_have_the_same_members(tmp_path: Path, part: NodePart | None) -> None:
    manifest = generate_monitor(read(write_bundle(tmp_path, BUNDLE), part=part)).manifest
    assert (manifest.gate is None) is (part is None)
    text, arrays = initializer(report_table(manifest), 'table')
    lines = ['#include "report_table.h"', '#include <math.h>', *arrays,
             'const struct fm_report_table * get(void);',
             f'const struct fm_report_table * get(void) {{static const struct fm_report_table '
             f'found = {text}; return &found;}}']
    source, library = tmp_path / 'table.c', tmp_path / 'table.so'
    source.write_text('\n'.join([*lines, '']), encoding='utf-8')
    subprocess.run(
        [*find_compiler().command, '-std=c99', '-Wall', '-Wextra', '-Wconversion', '-Werror',
         '-shared', '-fPIC', *csrc_includes(), str(source), '-o', str(library)], check=True)
    opened: Any = ffi.dlopen(None)
    handle = opened.dlopen(str(library).encode(), 2)
    get = ffi.cast('const struct fm_report_table * (*)(void)', opened.dlsym(handle, b'get'))
    of_c, made = plain(get()[0]), ReportTable(manifest)
    assert of_c == plain(made.pointer[0])
    assert b'A' in [item['id'] for item in of_c['requirements']]
    assert len(of_c['actions']) == 2 and len(of_c['gate']) == (part is not None)
