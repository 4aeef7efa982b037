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

"""What `editing` answers, as values of the protocol."""

from collections.abc import Callable, Iterable
from typing import Any

from fret_monitor.editing import (
    code_of, FoldedLines, HoverText, PositionMap, Proposal, ProposalKind, QuickFix, TextEdit,
)
from fret_monitor.model.diagnostics import Diagnostic, Level, Source, Span
from lsprotocol import types as lsp

SOURCE = 'fret-monitor'
_SEVERITIES = {Level.ERROR: lsp.DiagnosticSeverity.Error,
               Level.WARNING: lsp.DiagnosticSeverity.Warning}
_KINDS = {
    ProposalKind.KEY: lsp.CompletionItemKind.Property,
    ProposalKind.VALUE: lsp.CompletionItemKind.EnumMember,
    ProposalKind.INPUT: lsp.CompletionItemKind.Variable,
    ProposalKind.CONSTANT: lsp.CompletionItemKind.Constant,
    ProposalKind.DEFINITION: lsp.CompletionItemKind.Reference,
    ProposalKind.WORD: lsp.CompletionItemKind.Keyword,
    ProposalKind.FUNCTION: lsp.CompletionItemKind.Function,
    ProposalKind.TYPE: lsp.CompletionItemKind.Struct,
    ProposalKind.FIELD: lsp.CompletionItemKind.Field,
    ProposalKind.TOPIC: lsp.CompletionItemKind.Event,
    ProposalKind.NAME: lsp.CompletionItemKind.Value,
}


class Converter:
    """Converts places to ranges, in the units that the editor has chosen."""

    def __init__(self, encoding: str, uri_of: Callable[[str], str]) -> None:
        """Take the encoding, and what returns an editor's name of a file of a source."""
        self._encoding = encoding
        self._uri_of = uri_of
        self._maps: dict[Source, PositionMap] = {}

    def positions(self, source: Source) -> PositionMap:
        """Return the positions of a source, which are counted once."""
        return self._maps.setdefault(source, PositionMap(source.text, self._encoding))

    def range(self, span: Span) -> Any:
        """Return the range of a place."""
        lines = self.positions(span.source)
        start, end = (lsp.Position(*lines.position(at)) for at in (span.start, span.end))
        return lsp.Range(start, end)

    def location(self, span: Span) -> Any:
        """Return a place with its file."""
        return lsp.Location(self._uri_of(span.source.name), self.range(span))

    def diagnostic(self, found: Diagnostic) -> Any:
        """Return a diagnostic; one without a place is at the beginning."""
        related = [lsp.DiagnosticRelatedInformation(self.location(found.related), 'the other one')
                   ] if found.related else None
        message = '\n'.join(filter(None, (found.title, found.label, found.help)))
        place = self.range(found.span) if found.span else lsp.Range(
            lsp.Position(0, 0), lsp.Position(0, 0))
        return lsp.Diagnostic(place, message, _SEVERITIES[found.level], code_of(found),
                              source=SOURCE, related_information=related)

    def hover(self, found: HoverText) -> Any:
        """Return a text about a place."""
        return lsp.Hover(lsp.MarkupContent(lsp.MarkupKind.Markdown, found.markdown),
                         self.range(found.place))

    def completion(self, found: Iterable[Proposal]) -> Any:
        """Return proposals, in their order."""
        return lsp.CompletionList(False, [
            lsp.CompletionItem(
                item.label, kind=_KINDS[item.kind], detail=item.detail or None,
                filter_text=item.text, sort_text=f'{number:06}',
                text_edit=lsp.TextEdit(self.range(item.place), item.text))
            for number, item in enumerate(found)])

    def edits(self, found: Iterable[TextEdit]) -> Any:
        """Return edits of one or more files."""
        changes: dict[str, list[Any]] = {}
        for edit in found:
            changes.setdefault(self._uri_of(edit.place.source.name), []).append(
                lsp.TextEdit(self.range(edit.place), edit.text))
        return lsp.WorkspaceEdit(changes)

    def action(self, fix: QuickFix, diagnostic: Diagnostic) -> Any:
        """Return a quick fix of a diagnostic."""
        return lsp.CodeAction(fix.title, lsp.CodeActionKind.QuickFix,
                              [self.diagnostic(diagnostic)], edit=self.edits([fix.edit]))


def folding(found: Iterable[FoldedLines]) -> list[Any]:
    """Return ranges of lines that can be folded."""
    return [lsp.FoldingRange(item.first, item.last) for item in found]
