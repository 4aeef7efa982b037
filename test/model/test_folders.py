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

"""Folders that take the place of others."""

from pathlib import Path

from fret_monitor.model import folders
import pytest


def replace(directory: Path, text: str) -> None:
    with folders.replaced_folder(directory) as folder:
        (folder / 'file').write_text(text)


@pytest.mark.parametrize('can_exchange', [True, False])
def test_a_folder_is_replaced_by_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, can_exchange: bool,
) -> None:
    if not can_exchange:
        monkeypatch.setattr(folders, '_exchange', lambda one, other: False)
    for text in ('first', 'second'):
        replace(tmp_path / 'out', text)
        assert [path.name for path in tmp_path.iterdir()] == ['out']
        assert (tmp_path / 'out' / 'file').read_text() == text


def test_the_name_of_a_replaced_folder_is_never_free(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name in ('one', 'other'):
        (tmp_path / name).mkdir()
    if not folders._exchange(tmp_path / 'one', tmp_path / 'other'):
        pytest.skip('needs a file system that exchanges names')

    def rename(self: Path, target: Path) -> Path:
        raise AssertionError(f'{self} was renamed to {target}')

    (tmp_path / 'other' / 'file').write_text('first')
    monkeypatch.setattr(Path, 'rename', rename)
    replace(tmp_path / 'other', 'second')
    assert (tmp_path / 'other' / 'file').read_text() == 'second'
