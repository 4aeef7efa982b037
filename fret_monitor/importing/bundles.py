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

"""Import files of FRET and Ogma as bundles; reads all files before it writes any."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from fret_monitor.bundle.bundle import Bundle
from fret_monitor.bundle.reader import parse_bundle
from fret_monitor.importing.compare import Difference, differences, overlaps
from fret_monitor.importing.component import Exclusion, ImportedComponent
from fret_monitor.importing.draft import Draft, draft
from fret_monitor.importing.emit import emit
from fret_monitor.importing.files import choose, ImportOptions, read_files
from fret_monitor.importing.topics import Connection
from fret_monitor.model.diagnostics import (
    CompileError, counted, Diagnostic, did_you_mean, Level, Problems, refuse, Source,
)
from fret_monitor.model.names import fret_name, handler_name, HANDLER_PREFIX, shown
from fret_monitor.model.output import open_output, refuse_existing, refuse_overwriting
from fret_monitor.traces.csv_trace import trace_text

_LONGEST_NAME = 100
_MOST_LISTED = 20


@dataclass(frozen=True)
class Imported:
    """
    A bundle that is not written yet: its path and its text.

    `traces` are the paths and texts of traces on which two wordings of a requirement differ.
    """

    path: Path
    text: str
    draft: Draft
    traces: tuple[tuple[Path, str], ...]
    warnings: tuple[Diagnostic, ...]


def import_bundles(paths: Sequence[Path], output: Path, component: str | None = None,
                   *, is_folder: bool = False,
                   options: ImportOptions | None = None) -> list[Imported]:
    """
    Return the bundle of the chosen component, or with `is_folder` a bundle of each component.

    Warnings about parts of the files that are in no bundle belong to the first bundle.

    Raises
    ------
    CompileError
        if a file cannot be read, or no component results in a bundle.
    """
    problems = Problems()
    files = read_files(paths, problems, options or ImportOptions())
    chosen = [choose(files.components, component)] if component or not is_folder else list(
        files.components)
    targets = _targets(chosen, output) if is_folder else [output]
    problems.extend(_not_chosen(files.components, chosen))
    found: list[Imported] = []
    failed: list[tuple[ImportedComponent, CompileError]] = []
    for item, target in zip(chosen, targets, strict=True):
        own = Problems()
        try:
            found.append(_imported(draft(item, files.connections, own), target, own,
                                   item.exclusions))
        except CompileError as error:
            failed.append((item, error))
    if not found:
        raise CompileError([item for _, error in failed for item in error.diagnostics])
    for item, reason in failed:
        problems.extend(_not_made(item, reason))
    if len(found) == len(files.components):  # others might use the names
        problems.extend(_unknown(files.connections, found))
    warnings = (*problems.warnings, *found[0].warnings)
    return [replace(found[0], warnings=warnings), *found[1:]]


def _not_chosen(components: Iterable[ImportedComponent],
                chosen: Sequence[ImportedComponent]) -> Iterator[Diagnostic]:
    """Report the components in the files that were not chosen."""
    others = [item for item in components if item not in chosen]
    named = [f'{item.full_name} ({counted(len(item.requirements), "requirement")})'
             for item in others if item.name]
    if named:
        yield Diagnostic(f'left out, as not part of {chosen[0].full_name}: {", ".join(named)}',
                         level=Level.WARNING)
    yield from (_unnamed(item) for item in others if not item.name)


def _not_made(component: ImportedComponent, error: CompileError) -> Iterator[Diagnostic]:
    """Report the errors because of which a component has no bundle."""
    yield from (replace(item, level=Level.WARNING) for item in error.diagnostics)
    yield _unnamed(component) if not component.name else Diagnostic(
        f"no bundle for '{component.full_name}', as no requirement can be monitored: "
        f'{_ids(component)}', level=Level.WARNING)


def _unknown(connections: Mapping[str, Connection],
             found: Iterable[Imported]) -> Iterator[Diagnostic]:
    """Report the names in lists and databases that occur in no component."""
    names = {fret_name(name): name for item in found
             for name in (*(one.name for one in item.draft.inputs), *item.draft.unused,
                          *(old for old, _ in item.draft.renamed))}
    unknown = [item for key, item in connections.items() if key not in names]
    for item in unknown:
        if item.place is not None:
            yield Diagnostic(f'no input is called {shown(item.name)}', item.place,
                             help=did_you_mean(item.name, names.values()), level=Level.WARNING)
    for file in dict.fromkeys(item.file for item in unknown if item.place is None and item.file):
        unread = [shown(item.name) for item in unknown if item.file == file and not item.place]
        more = f' and {len(unread) - _MOST_LISTED} more' if len(unread) > _MOST_LISTED else ''
        yield Diagnostic(f'{file}: no requirement or variable is called '
                         f'{", ".join(unread[:_MOST_LISTED])}{more}', level=Level.WARNING)


def _unnamed(component: ImportedComponent) -> Diagnostic:
    return Diagnostic(f'in no bundle, because they have no component: {_ids(component)}',
                      help="a sentence names its component before 'shall'", level=Level.WARNING)


def _ids(component: ImportedComponent) -> str:
    return ', '.join(item.id for item in component.requirements)


def _targets(components: Sequence[ImportedComponent], folder: Path) -> list[Path]:
    """Return a path for each component; includes the project if components share a name."""
    names = [_file_name(item.name) for item in components]
    found: dict[str, None] = {}
    for item, name in zip(components, names, strict=True):
        free = base = name if names.count(name) == 1 else _file_name(item.full_name)
        while free in found:
            free = f'{base}_{len(found) + 1}'
        found[free] = None
    return [folder / f'{name}.yaml' for name in found]


def _file_name(name: str) -> str:
    return handler_name(name).removeprefix(HANDLER_PREFIX)[:_LONGEST_NAME] or 'component'


def _imported(found: Draft, path: Path, problems: Problems,
              exclusions: Sequence[Exclusion]) -> Imported:
    different = [item for one in found.comparisons for item in differences(one)]
    traces = [_trace_file(path, item, number) for number, item in enumerate(different)]
    for item, trace in zip(different, traces, strict=True):
        _warn(item, trace, problems)
    whole = replace(found, todo=(*found.todo, *_tasks(different, traces)))
    text = emit(whole)
    problems.extend(overlaps(exclusions, _read_back(text, whole, path)))
    return Imported(path, text, whole,
                    tuple((trace, _csv(item, whole)) for item, trace
                          in zip(different, traces, strict=True)), problems.warnings)


def _trace_file(path: Path, item: Difference, number: int) -> Path:
    return path.with_name(f'{path.stem}.{_file_name(item.id)}.{number + 1}.csv')


def _warn(item: Difference, trace: Path, problems: Problems) -> None:
    words = ('true', 'false') if item.verdict else ('false', 'true')
    problems.warning(
        f"'{item.id}': two wordings differ at step {item.step} of the trace {trace.name}", None,
        '', f'{item.first}: {words[0]}\n{item.other}: {words[1]}\nthe bundle contains the first')


def _tasks(different: Sequence[Difference], traces: Sequence[Path]) -> Iterator[str]:
    for item, trace in zip(different, traces, strict=True):
        yield (f"'{item.id}': decide which one is right; {item.first} and {item.other} differ on "
               f'{trace.name}, at step {item.step}')


def _csv(item: Difference, whole: Draft) -> str:
    """Return a trace in the format of `simulate`: a column for each input of the bundle."""
    signals = [entry.signal for entry in whole.inputs]
    return trace_text(signals, ([item.trace[signal.name][step] if signal.name in item.trace else 0
                                 for signal in signals] for step in range(item.step + 1)))


def _read_back(text: str, whole: Draft, path: Path) -> Bundle:
    """Parse the bundle again, compare it with the draft, and return it."""
    bundle = parse_bundle(Source(str(path), text), path.parent)
    written = [(item.id, item.text, item.title, item.rationale, item.source)
               for item in whole.requirements]
    read = [(item.id.value, item.text.value, item.title, item.rationale, item.source)
            for item in bundle.requirements]
    names = [item.name.strip('"') for item in whole.inputs]
    if read != written or [item.name.value for item in bundle.inputs] != names:
        raise AssertionError(f'the bundle of {whole.component} does not read as it was written')
    return bundle


def write_bundles(found: Sequence[Imported], *, force: bool = False,
                  read: Sequence[Path] = ()) -> None:
    """
    Write bundles and traces; write nothing if a bundle exists, unless `force` is set.

    Raises
    ------
    CompileError
        if a bundle exists, a file is one of those in `read`, or a file cannot be written.
    """
    for item in found:
        for path in (item.path, *(trace for trace, _ in item.traces)):
            refuse_overwriting(path, read)
        refuse_existing(item.path, force=force)
    for item in found:
        for path, text in (*item.traces, (item.path, item.text)):
            _write(path, text)


def _write(path: Path, text: str) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        refuse(f'cannot write {shown(str(path))}: {error.strerror or error}')
    with open_output(path) as file:
        file.write(text)
