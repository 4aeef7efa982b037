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
What an editor or a page knows of a bundle while it is written. No meaning of its own.

Text goes in, with its path; places come out as `Span`s of its `Source`, character offsets, which
`PositionMap` converts to lines and UTF-16 units. Nothing here raises for a text that is half
typed: what can be read of it is used, and the rest has a diagnostic.

| function | returns |
|---|---|
| `looks_like_a_bundle(text)` | whether a file is meant as a bundle, and not as any other YAML |
| `read_edited(path, text, read_file=...)` | an `EditedBundle`: `diagnostics` as of `check`, \
`bundle`, `reading` (None while there are errors; for `explain`, `simulate`, `analyze`), \
`inputs`, `signal(name)`, `uses` |
| `RequirementMemory()` | given to `read_edited` again and again, requirements that have not \
changed are not read again |
| `unchecked(path, text)` | the same without diagnostics and reading, sooner |
| `code_of(diagnostic)` | the kind of a diagnostic, a word for filters |
| `fixes(edited, diagnostic)` | `QuickFix`es: a title and a `TextEdit`; each was tried |
| `hover(edited, offset)` | a `HoverText` in Markdown, or None |
| `complete(edited, offset, topics)` | `Proposal`s: label, detail, place and text |
| `definition(edited, offset)`, `references(edited, offset)` | places, in all files of the bundle |
| `rename(edited, offset, name)` | `TextEdit`s, or a `CompileError` with the reason |
| `picture(edited)` | a `Picture`: nodes (topics, inputs, definitions, requirements, actions, \
gates), and links from what is read to what reads it |
| `sentence_form(edited, id)` | the fields of a FRETish sentence; `with_sentence(edited, id, \
fields)`: a `TextEdit` that writes them |
| `blank_form()`, `with_requirement(edited, id, fields)` | the fields of no sentence yet; a \
`TextEdit` that writes a new requirement |
| `folds(text)`, `formatted(text)` | lines that can be folded; the text in the usual indentation |

`read_file` is as `read_source`: it has the texts of other open files, such as of `signals`.
An `EditedBundle` is of one text: after a change, make another one. It may be used in any thread,
but not in two at once. No C compiler runs.
"""

from fret_monitor.editing.completion import (
    complete, Proposal, ProposalKind, RunningTopics,
)
from fret_monitor.editing.edited_bundle import (
    code_of, EditedBundle, looks_like_a_bundle, read_edited, unchecked,
)
from fret_monitor.editing.edits import edited as with_edits, TextEdit
from fret_monitor.editing.fixes import fixes, QuickFix
from fret_monitor.editing.folding import FoldedLines, folds
from fret_monitor.editing.formatting import formatted
from fret_monitor.editing.hover import hover, HoverText
from fret_monitor.editing.new_requirement import with_requirement
from fret_monitor.editing.picture import Picture, picture, PictureKind, PictureNode
from fret_monitor.editing.positions import EditorPosition, PositionMap
from fret_monitor.editing.references import definition, references, rename
from fret_monitor.editing.sentence_form import (
    blank_form, sentence_form, sentence_of, SentenceField, with_sentence,
)
from fret_monitor.elaboration.memory import RequirementMemory

__all__ = [
    'blank_form', 'code_of', 'complete', 'definition', 'EditedBundle', 'EditorPosition',
    'fixes', 'FoldedLines', 'folds', 'formatted', 'hover', 'HoverText', 'looks_like_a_bundle',
    'picture', 'Picture', 'PictureKind', 'PictureNode', 'PositionMap', 'Proposal',
    'ProposalKind', 'QuickFix', 'read_edited', 'references', 'rename', 'RequirementMemory',
    'RunningTopics', 'sentence_form', 'sentence_of', 'SentenceField', 'TextEdit', 'unchecked',
    'with_edits', 'with_requirement', 'with_sentence']
