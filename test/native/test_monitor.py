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

"""A library is loaded if it fits its manifest, and otherwise refused with the reason."""

import ctypes
from dataclasses import replace
import gc
from pathlib import Path
import shutil
import subprocess
import sys

from fret_monitor.model.manifest import Manifest, ManifestInput, ManifestRequirement
from fret_monitor.model.values import ValueType
from fret_monitor.native import (
    build_library, evaluator_library, LibraryError, load, load_evaluator, Monitor,
)
from fret_monitor.native.binding import ffi
from fret_monitor.runtime.fields import FieldReading, read_fields, ReadOutcome
from native import toys
import pytest


def library(text: str | None = None) -> Path:
    return build_library({'toy.c': text or toys.source()}, name='toy')


def test_a_library_that_fits_its_manifest_is_loaded() -> None:
    monitor = load(library(), toys.manifest())
    assert monitor.state_bytes == 16
    assert monitor.pointer.n_requirements == 2


def test_the_same_library_is_loaded_twice() -> None:
    first, second = load(library(), toys.manifest()), load(library(), toys.manifest())
    del first
    gc.collect()
    assert second.pointer.n_inputs == 2


def test_libraries_with_the_same_symbol_live_side_by_side() -> None:
    first = load(library(), toys.manifest())
    other = toys.source(source_hash='ab')
    second = load(library(other), replace(toys.manifest(), source_hash='ab'))
    assert first.pointer != second.pointer


def test_a_library_adds_no_symbols_to_the_process() -> None:
    monitor = load(library(), toys.manifest())
    assert not hasattr(ctypes.CDLL(None), toys.SYMBOL)
    assert hasattr(ctypes.CDLL(str(monitor.library.path)), toys.SYMBOL)


READERS = """
#include "fret_fields.h"

static bool read_flag(const uint8_t * message, size_t size, struct fm_field * fields)
{
  fields[0].value.i = size != 0u && message[0] == 1u;
  fields[0].outcome = FM_FIELD_READ;
  return size != 0u;
}

static const struct fm_reader TOPICS[] = {{read_flag, 1, NULL}, {read_flag, 1, NULL}};
static const struct fm_readers ALL = {FM_ABI, 2, TOPICS};

FM_EXPORT const struct fm_readers * fm_toy_readers(void);

const struct fm_readers * fm_toy_readers(void)
{
  return &ALL;
}
"""


def load_readers(text: str) -> Monitor:
    """Load the toy with extractors of messages."""
    return load(library(toys.source() + text), replace(toys.manifest(), readers='fm_toy_readers'))


def test_a_monitor_exposes_its_extractors() -> None:
    assert load(library(), toys.manifest()).readers is None
    monitor = load_readers(READERS)
    assert monitor.readers is not None
    assert monitor.readers.n_topics == 2
    assert read_fields(monitor, 0, b'\1') == (FieldReading(ReadOutcome.READ, True),)
    assert read_fields(monitor, 0, b'\0') == (FieldReading(ReadOutcome.READ, False),)
    assert read_fields(monitor, 0, b'') is None


@pytest.mark.parametrize(('old', 'new', 'told'), [
    ('FM_ABI, 2, TOPICS', '7, 2, TOPICS', 'readers of messages were compiled for interface 7'),
    ('return &ALL', '(void)ALL; return NULL', 'it has no readers of messages'),
    ('FM_ABI, 2, TOPICS', 'FM_ABI, 1, TOPICS', 'it reads 1 topics instead of 2'),
    ('{read_flag, 1, NULL}}', '{read_flag, 3, NULL}}',
     "of the topic '/level' it reads 3 inputs instead of 1"),
    ('fm_toy_readers(void)', 'fm_toy_raeders(void)', "does not export 'fm_toy_readers'"),
])
def test_extractors_that_do_not_fit_are_refused(old: str, new: str, told: str) -> None:
    assert old in READERS
    with pytest.raises(LibraryError, match=told):
        load_readers(READERS.replace(old, new))


def test_a_missing_library_is_reported(tmp_path: Path) -> None:
    with pytest.raises(LibraryError, match=r'cannot load .*No such file'):
        load(tmp_path / 'libgone.so', toys.manifest())


def test_a_relative_path_is_not_searched_for_in_other_folders(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path,
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(LibraryError, match='cannot load'):
        load(Path('libm.so.6'), toys.manifest())
    shutil.copy(library(), 'libtoy.so')
    assert load(Path('libtoy.so'), toys.manifest()).state_bytes == 16


@pytest.mark.parametrize('content', [b'', b'text', b'\x7fELF', b'\x7fELF' + bytes(2000)])
def test_a_file_that_is_no_library_is_reported(tmp_path: Path, content: bytes) -> None:
    (tmp_path / 'libtoy.so').write_bytes(content)
    with pytest.raises(LibraryError, match='cannot load'):
        load(tmp_path / 'libtoy.so', toys.manifest())


@pytest.mark.parametrize('part', [0.001, 0.01, 0.1, 0.3, 0.5, 0.7, 0.9, 0.999])
def test_a_truncated_library_is_reported_without_a_crash(tmp_path: Path, part: float) -> None:
    whole = library().read_bytes()
    (tmp_path / 'libtoy.so').write_bytes(whole[:int(part * len(whole))])
    with pytest.raises(LibraryError, match='cannot load'):
        load(tmp_path / 'libtoy.so', toys.manifest())


def test_a_library_without_the_symbol_is_reported() -> None:
    with pytest.raises(LibraryError, match="does not export 'fm_toy_monitor'"):
        load(evaluator_library(), toys.manifest())


def test_an_engine_without_an_interface_number_is_refused_as_of_an_earlier_version() -> None:
    expected = (r'^/folder/lib\.so was compiled by an earlier version of fret_monitor: '
                'compile the bundle again$')
    with pytest.raises(LibraryError, match=expected):
        load_evaluator(library(), origin=Path('/folder/lib.so'))


def test_a_missing_engine_is_reported_under_the_name_of_the_original(tmp_path: Path) -> None:
    with pytest.raises(LibraryError, match=r'cannot load /folder/lib\.so: '):
        load_evaluator(tmp_path / 'libgone.so', origin=Path('/folder/lib.so'))


def test_an_engine_of_another_interface_is_refused() -> None:
    wanted = ffi.integer_const('FM_ENGINE_ABI')
    sources = {'engine.c': '#include "fret_monitor.h"\nFM_EXPORT uint32_t fm_engine_abi(void);\n'
               f'uint32_t fm_engine_abi(void)\n{{\n  return {wanted + 1}u;\n}}\n'}
    expected = (rf"^the engine in '/folder/lib\.so' has interface {wanted + 1}, this version has "
                f'{wanted}: compile the bundle again$')
    with pytest.raises(LibraryError, match=expected):
        load_evaluator(build_library(sources, name='other'), origin=Path('/folder/lib.so'))


@pytest.mark.parametrize(('old', 'new', 'told'), [
    ('FM_ABI, 2', '7, 2', 'compiled for interface 7, this version has 2'),
    ('return &MONITOR', '(void)MONITOR; return NULL', 'describes no monitor'),
    ('"HASH"', '"0123456789abcdef"', 'made of other sources, 0123456789ab instead of unknown'),
    ('{"flag"', '{"lamp"', "input 0 is 'lamp' instead of 'flag'"),
    ('FM_INT16', 'FM_UINT16', "input 'level' is not of type int16"),
    ('FM_ABI, 2, 2, 2', 'FM_ABI, 1, 2, 2', 'has 1 inputs instead of 2'),
    ('FM_ABI, 2, 2, 2', 'FM_ABI, 2, 1, 2', 'has 1 groups instead of 2'),
    ('FM_ABI, 2, 2, 2', 'FM_ABI, 2, 2, 1', 'has 1 requirements instead of 2'),
    ('"LAMP"', '"LAMB"', "requirement 0 is 'LAMB' instead of 'LAMP'"),
    ('{"LAMP", 0}', '{"LAMP", 1}', "requirement 'LAMP' is in another group"),
    ('{FIRST_TWO, 2, FIRST', '{FIRST_TWO, 1, FIRST', 'group 1 reads other inputs'),
    ('FIRST_TWO + 1, 1', 'FIRST_TWO, 1', 'group 1 holds other requirements'),
])
def test_a_library_of_another_manifest_is_refused(
    old: str, new: str, told: str,
) -> None:
    assert old in toys.SOURCE
    text = toys.SOURCE.replace(old, new).replace('LIMIT', '10').replace('HASH', '')
    with pytest.raises(LibraryError, match='does not fit its manifest') as caught:
        load(library(text), toys.manifest())
    assert told in str(caught.value)


def swapped(manifest: Manifest) -> Manifest:
    return replace(manifest, requirements=manifest.requirements[::-1])


def test_the_order_of_inputs_and_requirements_counts() -> None:
    with pytest.raises(LibraryError, match="requirement 0 is 'LAMP' instead of 'COOL'"):
        load(library(), swapped(toys.manifest()))
    inputs: tuple[ManifestInput, ...] = toys.manifest().inputs
    with pytest.raises(LibraryError, match="input 0 is 'flag' instead of 'level'"):
        load(library(), replace(toys.manifest(), inputs=inputs[::-1]))


def test_names_may_hold_any_character() -> None:
    name = 'Größe-1 "π" \\ ü'
    quoted = ''.join(f'\\{byte:03o}' for byte in name.encode())
    requirements: tuple[ManifestRequirement, ...] = toys.manifest().requirements
    manifest = replace(toys.manifest(), requirements=(
        replace(requirements[0], id=name), requirements[1]))
    assert load(library(toys.source().replace('LAMP', quoted)), manifest)


def test_an_input_of_another_type_than_in_the_manifest_is_refused() -> None:
    inputs = toys.manifest().inputs
    changed = replace(inputs[1], value_type=ValueType.FLOAT64)
    with pytest.raises(LibraryError, match="input 'level' is not of type float64"):
        load(library(), replace(toys.manifest(), inputs=(inputs[0], changed)))


def test_loading_needs_neither_parser_nor_compiler() -> None:
    script = (
        'import sys\nimport fret_monitor.native, fret_monitor.runtime\n'
        'heavy = {"lark", "yaml", "pycparser", "cffi", "rclpy"} & set(sys.modules)\n'
        'levels = ("syntax", "logic", "program", "codegen", "build", "ros", "cli")\n'
        'heavy |= {name for name in sys.modules for level in levels\n'
        '          if name.startswith(f"fret_monitor.{level}")}\n'
        'print(sorted(heavy))')
    done = subprocess.run(
        [sys.executable, '-c', script], capture_output=True, text=True, check=True,
        env={'PYTHONPATH': ':'.join(filter(None, sys.path))})
    assert done.stdout.strip() == '[]'
