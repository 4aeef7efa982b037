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

"""The folder of an export: its files, the user's own in place of some, and a manifest."""

from collections.abc import Collection, Iterator, Mapping, Sequence
import hashlib
import json
import os
from pathlib import Path, PurePosixPath
import re

from fret_monitor import __version__
from fret_monitor.build import GeneratedMonitor, Reading, with_name
from fret_monitor.export.content import Content, export_name, fill, Options
from fret_monitor.model.diagnostics import refuse
from fret_monitor.model.folders import check_replaceable, refusing, replaced_folder

FORMAT = 1
MANIFEST_FILE = 'manifest.json'
CERTIFICATE_FILE = 'certificate.json'

_NAME = re.compile('[A-Za-z][A-Za-z0-9_]{0,99}')


def is_name(word: str) -> bool:
    """Return whether a word can begin names in C."""
    return _NAME.fullmatch(word) is not None


def renamed(reading: Reading, name: str) -> Reading:
    """
    Give a bundle another name, which its files and symbols in C begin with.

    Raises
    ------
    CompileError
        if `name` cannot begin a name in C.
    """
    if not is_name(name):
        refuse(f"'{name}' cannot begin names in C",
               help='use a letter, then at most 99 letters, digits and _')
    return with_name(reading, name)


def assemble(target: str, generated: GeneratedMonitor, options: Options, content: Content, *,
             others: Sequence[GeneratedMonitor] = (), templates: Path | None = None,
             certificate: str | None = None) -> dict[str, str]:
    """
    Return all files of an export by relative path, the manifest last.

    `others` are further bundles of the same export.
    `templates` is a folder with the user's own files, each in place of one of the export;
    `certificate` is the text of the proof.

    Raises
    ------
    CompileError
        if a file in `templates` has no counterpart, or cannot be used.
    """
    texts = dict(content.templates)
    own = _own_files(templates, content) if templates is not None else {}
    names = {name: str(templates / name) if templates and name in own else name for name in texts}
    texts.update(own)
    files = {**content.generated, **{name: fill(names[name], text, content.values)
                                     for name, text in texts.items()}}
    if certificate is not None:
        files[CERTIFICATE_FILE] = certificate
    files = dict(sorted(files.items()))
    return {**files, MANIFEST_FILE: _manifest(
        target, (generated, *others), options, files)}


def _manifest(target: str, monitors: Sequence[GeneratedMonitor], options: Options,
              files: Mapping[str, str]) -> str:
    bundles = [_bundle(item) for item in monitors]
    content = {
        'export': FORMAT,
        'target': target,
        'fret_monitor': __version__,
        'name': options.name or export_name(monitors[0]),
        'prefix': options.prefix,
        'handler_arguments': options.handler_arguments.value,
        **(bundles[0] if len(bundles) == 1 else {'bundles': bundles}),
        'files': {name: _hash(text.encode()) for name, text in files.items()},
    }
    return json.dumps(content, indent=1, ensure_ascii=False) + '\n'


def _bundle(generated: GeneratedMonitor) -> dict[str, object]:
    manifest = generated.manifest
    return {
        'policy': manifest.policy.value,
        'constants': dict(manifest.constants),
        'bundle_hash': manifest.bundle_hash,
        'source_hash': manifest.source_hash,
    }


def _hash(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _own_files(folder: Path, content: Content) -> dict[str, str]:
    """Return the user's files by their path in the export."""
    if not folder.is_dir():
        refuse(f"there is no folder '{folder}'",
               help='--templates names a folder with files in place of those of the export')
    with refusing(folder):
        return {path.relative_to(folder).as_posix(): _own_text(path, folder, content)
                for path in sorted(folder.rglob('*'))
                if not path.is_dir() or path.relative_to(folder).as_posix() in content.templates}


def _own_text(path: Path, folder: Path, content: Content) -> str:
    name = path.relative_to(folder).as_posix()
    if name in content.generated or name in (MANIFEST_FILE, CERTIFICATE_FILE):
        refuse(f"'{path}' would replace a file that cannot be replaced",
               help='these can be replaced: ' + ', '.join(sorted(content.templates)))
    if name not in content.templates:
        refuse(f"'{path}' replaces no file of the export",
               help='these can be replaced: ' + ', '.join(sorted(content.templates)))
    if path.exists() and not path.is_file():
        refuse(f"'{path}' is no regular file")
    try:
        return path.read_bytes().decode('utf-8')  # with its ends of lines
    except UnicodeDecodeError:
        refuse(f"'{path}' is not UTF-8")
    except OSError as error:
        refuse(f"cannot read '{path}': {error.strerror or error}")


def check_output(directory: Path, replaceable: Collection[str] = ()) -> None:
    """
    Refuse a folder that `write_export` would not write.

    `replaceable` are the files that `--templates` can replace, for the advice.

    Raises
    ------
    CompileError
        as `check_replaceable`, or if a file of an earlier export was changed since.
    """
    place = Path(os.path.realpath(directory))
    if directory.is_symlink() and not place.exists():
        refuse(f"'{directory}' is a link to '{place}', which does not exist")
    former = _former(place)
    check_replaceable(
        directory,
        None if former is None else {Path(MANIFEST_FILE), *(Path(name) for name in former)},
        'export')
    with refusing(directory):
        for name in _changed(place, former or {}):
            refuse(f"'{directory / name}' was changed since `export` wrote it",
                   help='move it to another folder, and name that with --templates'
                   if name in replaceable else
                   'an export writes this file anew, so that changes are lost: remove it, or keep '
                   'a copy in another folder')


def write_export(directory: Path, files: Mapping[str, str]) -> None:
    """
    Write the files of an export to a folder, as a whole or not at all.

    An earlier export in the same folder is replaced. Errors are those of `check_output`, and a
    `CompileError` if the folder cannot be written.
    """
    check_output(directory)
    with replaced_folder(directory) as folder:
        for name, text in files.items():
            path = folder / PurePosixPath(name)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding='utf-8', newline='')


def _former(place: Path) -> dict[str, str] | None:
    """Return the hashes of the files of an earlier export; None if the folder is no export."""
    try:
        content = json.loads((place / MANIFEST_FILE).read_text(encoding='utf-8'))
    except (OSError, ValueError, RecursionError):
        return None
    is_export = isinstance(content, dict) and content.get('export') == FORMAT
    files = content.get('files') if is_export and 'fret_monitor' in content else None
    if not isinstance(files, dict):
        return None
    return {name: digest for name, digest in files.items() if isinstance(digest, str)}


def _changed(place: Path, former: Mapping[str, str]) -> Iterator[str]:
    for name, digest in former.items():
        path = place / name
        if place in path.parents and (path.is_symlink() or (
                path.is_file() and _hash(path.read_bytes()) != digest)):
            yield name
