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


"""The memory of all instances of a bundle: it is taken when it is used."""

from pathlib import Path
import re

from bundles import write_bundle
from fret_monitor import build
from fret_monitor.native.binding import ffi
from fret_monitor.runtime.scopes import Scopes
import pytest

FLEET = """
format: 1
for_each: {robot: {most: MOST}}
inputs:
  speed: {topic: "/{robot}/speed", type: std_msgs/msg/Float32}
requirements:
  - {id: SPEED, ptltl: "speed <= 1.0"}
"""
SMAPS = Path('/proc/self/smaps')


def scopes_of(folder: Path, most: int) -> Scopes:
    path = write_bundle(folder, FLEET.replace('MOST', str(most)))
    return Scopes(build.compile_monitor(build.generate_monitor(
        build.read(path, takes_instances=True))).monitor)


def mapping_at(place: int) -> str:
    """Return what the system says of the mapping of an address that is one for itself."""
    found = re.split('(?m)^(?=[0-9a-f]+-[0-9a-f]+ )', SMAPS.read_text(encoding='utf-8'))
    for text in found[1:]:
        begin, end = (int(word, 16) for word in text.split(' ', 1)[0].split('-'))
        if begin <= place < end:
            return text
    raise AssertionError('no mapping')


@pytest.mark.skipif(not Path('/sys/kernel/mm/transparent_hugepage').exists(),
                    reason='the system has no large pages')
def test_many_instances_ask_for_large_pages_and_few_do_not(tmp_path: Path) -> None:
    many, few = (scopes_of(tmp_path, most) for most in (60_000, 100))
    inside = int(ffi.cast('uintptr_t', many.pointer)) + 8 * 2**20
    assert 'hg' in mapping_at(inside).rpartition('VmFlags:')[2].split()
    assert int(re.search(r'Rss: +(\d+) kB', mapping_at(inside))[1]) < 8 * 1024  # type: ignore
    at_begin = mapping_at(int(ffi.cast('uintptr_t', few.pointer)))
    assert 'hg' not in at_begin.rpartition('VmFlags:')[2].split()
