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

"""
The folder that `compile` writes and `library:=` opens: libraries, manifest, sources.

Opening it needs neither the parser nor a C compiler.
"""

from collections.abc import Mapping
from dataclasses import replace
import os
from pathlib import Path
import shutil

from fret_monitor.model.folders import check_replaceable, refusing, replaced_folder
from fret_monitor.model.frozen import frozen
from fret_monitor.model.manifest import Manifest, ManifestError
from fret_monitor.native.cache import evaluator_files, evaluator_library, private_copy
from fret_monitor.native.errors import LibraryError

MANIFEST_FILE = 'manifest.json'
EVALUATOR_FILE = 'libfm_evaluator.so'
_SOURCES = Path('src')


@frozen
class CompiledFolder:
    """A compiled folder: its manifest, and the paths of its two libraries."""

    manifest: Manifest
    library: Path
    evaluator: Path

    def private(self) -> 'CompiledFolder':
        """
        Copy the libraries, so that the folder may change while they are loaded (`private_copy`).

        Raises
        ------
        LibraryError
            if a library cannot be read.
        """
        return replace(self, library=private_copy(self.library),
                       evaluator=private_copy(self.evaluator))


def library_file(manifest: Manifest) -> str:
    """Return the file name of a bundle's library."""
    return f'lib{manifest.symbol}.so'


def is_compiled(directory: Path) -> bool:
    """Whether a folder looks like one that `compile` wrote."""
    return (directory / MANIFEST_FILE).is_file() and (directory / EVALUATOR_FILE).is_file()


def open_folder(directory: Path) -> CompiledFolder:
    """
    Read the manifest of a compiled folder and find its libraries.

    Raises
    ------
    LibraryError
        if there is no such folder, or it is not one that `fret-monitor compile` wrote.
    """
    try:
        text = (directory / MANIFEST_FILE).read_text(encoding='utf-8')
        manifest = Manifest.from_json(text)
    except FileNotFoundError:
        raise LibraryError(f"'{directory}' holds no compiled bundle (no {MANIFEST_FILE}); make it "
                           'with: fret-monitor compile BUNDLE --output DIR') from None
    except (OSError, UnicodeDecodeError, ManifestError) as error:
        raise LibraryError(f"cannot read '{directory / MANIFEST_FILE}': {error}") from None
    folder = CompiledFolder(manifest, directory / library_file(manifest),
                            directory / EVALUATOR_FILE)
    for file in (folder.library, folder.evaluator):
        if not file.is_file():
            raise LibraryError(f"'{file}' is missing; compile the bundle again")
    return folder


def check_writable(directory: Path) -> None:
    """
    Refuse a folder that `write_folder` would not write.

    Raises
    ------
    CompileError
        if `directory` is a file, the current folder, or holds files that `compile` did not write.
    """
    with refusing(directory):
        former = _written(Path(os.path.realpath(directory)))
    check_replaceable(directory, former, 'compile')


def write_folder(directory: Path, manifest: Manifest, library: Path,
                 sources: Mapping[str, str]) -> None:
    """
    Write the folder that a robot needs to run a bundle: libraries, manifest, and sources.

    A compiled folder at the same path is replaced. `sources` are the texts of the generated C by
    file name.

    Raises
    ------
    CompileError
        as `check_writable`, or if the folder cannot be written.
    NativeError
        if the evaluator cannot be compiled.
    """
    check_writable(directory)
    evaluator = evaluator_library()
    with replaced_folder(directory) as folder:
        (folder / MANIFEST_FILE).write_text(manifest.to_json(), encoding='utf-8')
        shutil.copyfile(library, folder / library_file(manifest))
        shutil.copyfile(evaluator, folder / EVALUATOR_FILE)
        _write_sources(folder / _SOURCES, sources)


def _written(place: Path) -> set[Path] | None:
    """Return the files of a compiled folder that `compile` writes; None for another folder."""
    if not is_compiled(place):
        return None
    manifest = open_folder(place).manifest
    ours = {Path(MANIFEST_FILE), Path(EVALUATOR_FILE), Path(library_file(manifest))}
    return ours | {_SOURCES / name for name in source_files(dict.fromkeys(manifest.sources, ''))}


def source_files(generated: Mapping[str, str]) -> dict[str, str]:
    """Return all files of the folder `src` by name: the generated and the hand-written C."""
    return {**evaluator_files(), **generated}


def _write_sources(folder: Path, generated: Mapping[str, str]) -> None:
    folder.mkdir()
    for name, text in source_files(generated).items():
        (folder / name).write_text(text, encoding='utf-8')
