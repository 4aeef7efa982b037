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

"""The folder of an export: complete or absent, replaceable, with the user's own files."""

from dataclasses import replace
import hashlib
import json
import os
from pathlib import Path

from cli.command import PUMP
from fret_monitor.build import generate_monitor, GeneratedMonitor, read
from fret_monitor.export.content import Options
from fret_monitor.export.folder import (
    assemble, check_output, MANIFEST_FILE, renamed, write_export,
)
from fret_monitor.export.targets import TARGETS
from fret_monitor.model.diagnostics import CompileError
import pytest

OPTIONS = Options()
OFF_ROS = [name for name in TARGETS if name != 'ros2']  # it has tests of its own


@pytest.fixture(scope='module')
def pump(tmp_path_factory: pytest.TempPathFactory) -> GeneratedMonitor:
    """Return the generated C of a bundle."""
    path = tmp_path_factory.mktemp('bundle') / 'pump.yaml'
    path.write_text(PUMP)
    return generate_monitor(read(path))


@pytest.fixture(scope='module')
def plain(tmp_path_factory: pytest.TempPathFactory) -> GeneratedMonitor:
    """Return the generated C of a bundle that every target can do: without strings."""
    path = tmp_path_factory.mktemp('bundle') / 'pump.yaml'
    path.write_text(PUMP.replace('string', 'uint8').replace('halt', '0').replace('go', '1'))
    return generate_monitor(read(path))


def files_of(pump: GeneratedMonitor, target: str = 'c99', templates: Path | None = None,
             certificate: str | None = None) -> dict[str, str]:
    content = TARGETS[target].content(pump, OPTIONS)
    return assemble(target, pump, OPTIONS, content, templates=templates, certificate=certificate)


def refusal(pump: GeneratedMonitor, templates: Path) -> str:
    with pytest.raises(CompileError) as refused:
        files_of(pump, templates=templates)
    return str(refused.value)


@pytest.mark.parametrize('target', OFF_ROS)
def test_the_same_bundle_gives_the_same_bytes_without_placeholders(
    plain: GeneratedMonitor, target: str, tmp_path: Path,
) -> None:
    again = replace(plain, sources=(tmp_path / 'elsewhere' / plain.sources[0].name,))
    assert files_of(plain, target) == files_of(again, target)
    assert 'README.md' in files_of(plain, target)
    assert not [name for name, text in files_of(plain, target).items() if '@NAME@' in text]


@pytest.mark.parametrize('target', OFF_ROS)
def test_the_manifest_has_the_hash_of_every_other_file(
    plain: GeneratedMonitor, target: str, tmp_path: Path,
) -> None:
    write_export(tmp_path / 'out', files_of(plain, target, certificate='proved\n'))
    manifest = json.loads((tmp_path / 'out' / MANIFEST_FILE).read_text())
    written = {path.relative_to(tmp_path / 'out').as_posix(): path
               for path in (tmp_path / 'out').rglob('*') if path.is_file()}
    assert manifest['files'] == {name: hashlib.sha256(path.read_bytes()).hexdigest()
                                 for name, path in written.items() if name != MANIFEST_FILE}
    assert 'certificate.json' in manifest['files']
    assert manifest['constants'] == dict(plain.manifest.constants)
    assert (manifest['target'], manifest['bundle_hash']) == (target, plain.manifest.bundle_hash)


def test_an_earlier_export_is_replaced_and_other_files_are_not(
    pump: GeneratedMonitor, tmp_path: Path,
) -> None:
    out = tmp_path / 'out'
    write_export(out, files_of(pump, 'c99'))
    write_export(out, files_of(pump, 'copilot'))
    assert sorted(os.listdir(tmp_path)) == ['out']
    assert not (out / 'CMakeLists.txt').exists()
    (out / 'monitors' / 'mine.c').touch()
    with pytest.raises(CompileError, match=r"holds 'monitors/mine\.c', which `export` did not"):
        check_output(out)
    (out / 'monitors' / 'mine.c').rename(tmp_path / 'mine.c')
    (out / 'README.md').write_text('mine')
    with pytest.raises(CompileError, match=r"README\.md' was changed since `export` wrote it"):
        write_export(out, files_of(pump))
    assert (out / 'README.md').read_text() == 'mine'
    with pytest.raises(CompileError, match='name that with --templates'):
        check_output(out, ['README.md'])
    with pytest.raises(CompileError, match='changes are lost: remove it, or keep a copy'):
        check_output(out)
    for folder in (tmp_path, tmp_path / 'mine.c'):
        with pytest.raises(CompileError):
            check_output(folder)
    empty = hashlib.sha256().hexdigest()
    foreign = json.dumps({'export': {'mine': 1}, 'files': {'mine.c': empty}})
    for text in ('[]', foreign):
        (tmp_path / MANIFEST_FILE).write_text(text)
        with pytest.raises(CompileError, match='holds other files'):
            check_output(tmp_path)
    (out / 'README.md').unlink()
    (out / 'README.md').symlink_to(tmp_path / 'nowhere')
    with pytest.raises(CompileError, match=r"README\.md' was changed since `export` wrote it"):
        check_output(out)
    (tmp_path / 'link').symlink_to(tmp_path / 'missing' / 'folder')
    with pytest.raises(CompileError, match=r"link' is a link to '.*folder', which does not exist"):
        check_output(tmp_path / 'link')


def test_an_export_that_fails_leaves_the_earlier_one(
    pump: GeneratedMonitor, tmp_path: Path,
) -> None:
    write_export(tmp_path / 'out', files_of(pump))
    before = (tmp_path / 'out' / MANIFEST_FILE).read_text()
    with pytest.raises(CompileError, match='File name too long'):
        write_export(tmp_path / 'out', {**files_of(pump), 'x' * 300: ''})
    assert (tmp_path / 'out' / MANIFEST_FILE).read_text() == before
    assert os.listdir(tmp_path) == ['out']


def test_a_file_of_the_users_own_takes_the_place_of_one(
    pump: GeneratedMonitor, tmp_path: Path,
) -> None:
    (tmp_path / 'test').mkdir()
    (tmp_path / 'test' / 'test.c').write_bytes(b'int main(void) {return 0;}\r\n')
    (tmp_path / 'README.md').write_text('Ours, of @NAME@.\n')
    files = files_of(pump, templates=tmp_path)
    assert files['README.md'] == 'Ours, of pump.\n'
    assert files['test/test.c'] == 'int main(void) {return 0;}\r\n'
    assert files['CMakeLists.txt'] == files_of(pump)['CMakeLists.txt']


@pytest.mark.parametrize(('name', 'text', 'expected'), [
    ('Readme.md', '',
     "Readme.md' replaces no file of the export\n   = help: these can be replaced: CMake"),
    ('src/pump_monitor.c', '', 'would replace a file that cannot be replaced'),
    ('manifest.json', '', 'would replace a file that cannot be replaced'),
    ('README.md', 'The\n  @TITLE@\n',
     "README.md:2:3: error: there is no placeholder '@TITLE@'\n 2 |   @TITLE@\n   |   ^^^^^^^\n"
     '    = help: there are @BUNDLE@, @BUNDLE_IN_C@, '),
    ('README.md', '\xff', 'is not UTF-8'),
])
def test_a_file_that_cannot_be_used_is_refused(
    pump: GeneratedMonitor, tmp_path: Path, name: str, text: str, expected: str,
) -> None:
    (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / name).write_bytes(text.encode('latin-1'))
    assert expected in refusal(pump, tmp_path)


def test_a_pipe_among_the_templates_is_refused_and_not_waited_for(
    pump: GeneratedMonitor, tmp_path: Path,
) -> None:
    os.mkfifo(tmp_path / 'README.md')
    assert "README.md' is no regular file" in refusal(pump, tmp_path)


def test_a_folder_cannot_replace_a_file(pump: GeneratedMonitor, tmp_path: Path) -> None:
    (tmp_path / 'README.md').mkdir()
    assert "README.md' is no regular file" in refusal(pump, tmp_path)


def test_a_folder_of_templates_must_exist(pump: GeneratedMonitor, tmp_path: Path) -> None:
    assert "there is no folder '" in refusal(pump, tmp_path / 'none')


def test_another_name_begins_files_and_symbols(tmp_path: Path) -> None:
    (tmp_path / 'pump.yaml').write_text(PUMP)
    reading = read(tmp_path / 'pump.yaml')
    files = files_of(generate_monitor(renamed(reading, 'left')))
    assert 'void left_step(' in files['src/left_monitor.h']
    for word in ('', '1st', 'a-b', 'a' * 101, '_x'):
        with pytest.raises(CompileError):
            renamed(reading, word)
