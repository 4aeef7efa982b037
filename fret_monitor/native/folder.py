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
The folder that `compile` writes and `library:=` runs: libraries, manifest, sources.

A robot opens it without parser or compiler; `build.write` makes it.
"""

from dataclasses import dataclass
from pathlib import Path

from fret_monitor.model.manifest import Manifest, ManifestError
from fret_monitor.native.errors import LibraryError

MANIFEST_FILE = 'manifest.json'
EVALUATOR_FILE = 'libfm_evaluator.so'


@dataclass(frozen=True)
class CompiledFolder:
    """What a folder holds: the manifest, and where the two libraries are."""

    manifest: Manifest
    library: Path
    evaluator: Path


def library_file(manifest: Manifest) -> str:
    """Return the file name of a bundle's library."""
    return f'lib{manifest.symbol}.so'


def is_compiled(directory: Path) -> bool:
    """Whether a folder looks like one that was compiled."""
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
