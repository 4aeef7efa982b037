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
Serves editors over standard input and output.

Changes of a text are taken in the order in which they come. A check begins when nothing has been
typed for `DEBOUNCE_MS`, in a thread of its own, one at a time; a check of a text that has changed
meanwhile is not begun, and its result is not published. What an answer needs of the text alone
does not wait for a check.
"""

import asyncio
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
import logging
import sys
from typing import Any

from fret_monitor import __version__, editing
from fret_monitor.editing import EditedBundle, EditorPosition
from fret_monitor.lsp.convert import Converter, folding
from fret_monitor.lsp.open_files import changed, OpenFile, OpenFiles, path_of, Snapshot
from fret_monitor.model.diagnostics import CompileError, Diagnostic, Span
from lsprotocol import types as lsp
from pygls.exceptions import JsonRpcException
from pygls.lsp.server import LanguageServer

DEBOUNCE_MS = 25
_TRIGGERS = [' ', ':', '.', '/', '{', '(', '=']
_REQUEST_FAILED = -32803
_CONTENT_MODIFIED = -32801


class _Refusal(JsonRpcException):
    """What a request cannot have, such as a name that is taken; no error of this server."""


class _Server(LanguageServer):

    def report_server_error(self, error: Exception, source: Any) -> None:
        if not isinstance(error, _Refusal):
            super().report_server_error(error, source)


def _is_logged(record: logging.LogRecord) -> bool:
    """Whether pygls logs something else than a refusal, of which the editor is told."""
    return not (record.exc_info and isinstance(record.exc_info[1], _Refusal))


class BundleServer:
    """A language server with its open files."""

    def __init__(self, files: OpenFiles | None = None) -> None:
        """Register what it can do."""
        self._server = _Server('fret-monitor', __version__)
        logging.getLogger('pygls.protocol.json_rpc').addFilter(_is_logged)
        self._files = OpenFiles() if files is None else files
        self._worker = ThreadPoolExecutor(1)
        self._waiting: dict[str, asyncio.Task[None]] = {}
        self._checked: dict[str, tuple[int, asyncio.Future[EditedBundle | None]]] = {}
        self._memories: dict[str, editing.RequirementMemory] = {}
        self._published: dict[str, set[str]] = {}
        self._is_shut_down = False
        for name, handler, options in self._features():
            self._server.feature(name, options)(partial(handler))  # a method has no attributes

    def run(self) -> int:
        """Serve until the editor ends; return 0 if it said so before."""
        output = sys.stdout.buffer
        sys.stdout = sys.stderr  # nothing else may write there
        try:
            self._server.start_io(stdout=output)
        finally:
            self._worker.shutdown(wait=False, cancel_futures=True)
        return int(not self._is_shut_down)

    def _features(self) -> Iterator[tuple[str, Callable[..., Any], Any]]:
        yield lsp.TEXT_DOCUMENT_DID_OPEN, self._opened, None
        yield lsp.TEXT_DOCUMENT_DID_CHANGE, self._changed, None
        yield lsp.TEXT_DOCUMENT_DID_SAVE, self._saved, None
        yield lsp.TEXT_DOCUMENT_DID_CLOSE, self._closed, None
        yield lsp.SHUTDOWN, self._shut_down, None
        yield lsp.TEXT_DOCUMENT_HOVER, self._hover, None
        yield lsp.TEXT_DOCUMENT_COMPLETION, self._complete, lsp.CompletionOptions(
            trigger_characters=_TRIGGERS)
        yield lsp.TEXT_DOCUMENT_DEFINITION, self._definition, None
        yield lsp.TEXT_DOCUMENT_REFERENCES, self._references, None
        yield lsp.TEXT_DOCUMENT_PREPARE_RENAME, self._prepare_rename, None
        yield lsp.TEXT_DOCUMENT_RENAME, self._rename, lsp.RenameOptions(prepare_provider=True)
        yield lsp.TEXT_DOCUMENT_CODE_ACTION, self._actions, lsp.CodeActionOptions(
            [lsp.CodeActionKind.QuickFix])
        yield lsp.TEXT_DOCUMENT_FOLDING_RANGE, self._folding, None
        yield lsp.TEXT_DOCUMENT_FORMATTING, self._formatting, None

    # Files

    def _opened(self, params: Any) -> None:
        item = params.text_document
        self._files.put(OpenFile(item.uri, path_of(item.uri), item.version, item.text))
        self._check_soon(item.uri)

    def _changed(self, params: Any) -> None:
        file = self._files.by_uri.get(params.text_document.uri)
        if file is None:
            return
        text = changed(file.text, params.content_changes, self._encoding)
        self._files.put(replace(file, version=params.text_document.version, text=text))
        self._check_soon(file.uri)

    def _saved(self, params: Any) -> None:
        for uri in self._files.by_uri:
            self._check_soon(uri)

    def _closed(self, params: Any) -> None:
        uri = params.text_document.uri
        self._files.close(uri)
        self._checked.pop(uri, None)
        self._memories.pop(uri, None)
        if (task := self._waiting.pop(uri, None)) is not None:
            task.cancel()
        for name in self._published.pop(uri, {uri}):
            self._publish(name, None, [])

    def _shut_down(self, params: Any) -> None:
        self._is_shut_down = True
        for task in self._waiting.values():
            task.cancel()

    @property
    def _encoding(self) -> str:
        chosen = self._server.server_capabilities.position_encoding
        return str(getattr(chosen, 'value', chosen) or 'utf-16')

    @property
    def _converter(self) -> Converter:
        return Converter(self._encoding, lambda name: self._files.uri(path_of(name)))

    # Checks

    def _check_soon(self, uri: str) -> None:
        """Check a file, and others that may take it in, when nothing more is typed."""
        others = [other.uri for other in self._files.by_uri.values()
                  if other.uri != uri and path_of(uri).name in other.text]
        for name in (uri, *others):
            if (task := self._waiting.get(name)) is not None:
                task.cancel()
            self._waiting[name] = asyncio.ensure_future(self._check(name))

    async def _check(self, uri: str) -> None:
        await asyncio.sleep(DEBOUNCE_MS / 1000)
        file = self._files.by_uri[uri]
        found = await self._edited(uri)
        if found is not None and self._files.by_uri.get(uri) is file:
            self._publish_all(file, found)

    def _publish_all(self, file: OpenFile, found: EditedBundle) -> None:
        """Publish the diagnostics of a bundle in its files; of other open ones, their own."""
        by_uri: dict[str, list[Diagnostic]] = {file.uri: []}
        for item in found.diagnostics:
            name = item.span.source.name if item.span else str(file.path)
            by_uri.setdefault(self._files.uri(path_of(name)), []).append(item)
        for uri in self._published.get(file.uri, set()) - set(by_uri):
            self._publish(uri, None, [])
        for uri, items in by_uri.items():
            if uri == file.uri or uri not in self._files.by_uri:
                self._publish(uri, file.version if uri == file.uri else None, items)
        self._published[file.uri] = {uri for uri in by_uri if uri == file.uri
                                     or uri not in self._files.by_uri}

    def _publish(self, uri: str, version: int | None, items: list[Diagnostic]) -> None:
        convert = self._converter
        self._server.text_document_publish_diagnostics(lsp.PublishDiagnosticsParams(
            uri, [convert.diagnostic(item) for item in items], version))

    async def _edited(self, uri: str) -> EditedBundle | None:
        """Return a file with its diagnostics; None if it has changed meanwhile, or was closed."""
        generation, file = self._files.generation, self._files.by_uri.get(uri)
        if file is None:
            return None
        known = self._checked.get(uri)
        if known is None or known[0] != generation:
            task = partial(self.read, file, generation, self._files.reader())
            known = generation, asyncio.get_running_loop().run_in_executor(self._worker, task)
            self._checked[uri] = known
        return await asyncio.shield(known[1])

    def read(self, file: OpenFile, generation: int, reader: Snapshot) -> EditedBundle | None:
        """Check a file, in the worker's thread; not one that has changed already."""
        if generation != self._files.generation:
            return None
        if not editing.looks_like_a_bundle(file.text):
            return editing.unchecked(file.path, file.text, read_file=reader)
        memory = self._memories.setdefault(file.uri, editing.RequirementMemory())
        return editing.read_edited(file.path, file.text, read_file=reader, memory=memory)

    # Requests

    def _unchecked(self, params: Any) -> EditedBundle | None:
        """Return a file that is a bundle without its diagnostics, which takes little time."""
        file = self._files.by_uri.get(params.text_document.uri)
        if file is None or not editing.looks_like_a_bundle(file.text):
            return None
        return editing.unchecked(file.path, file.text, read_file=self._files.reader())

    async def _whole(self, params: Any) -> EditedBundle | None:
        """Return a file that is a bundle with its diagnostics."""
        found = await self._edited(params.text_document.uri)
        if found is None and params.text_document.uri in self._files.by_uri:
            raise _Refusal('the text has changed', _CONTENT_MODIFIED)
        return found if found and editing.looks_like_a_bundle(found.source.text) else None

    def _offset(self, found: EditedBundle, params: Any) -> int:
        at = params.position
        return self._converter.positions(found.source).offset(
            EditorPosition(at.line, at.character))

    async def _hover(self, params: Any) -> Any:
        found = await self._whole(params)
        text = editing.hover(found, self._offset(found, params)) if found else None
        return text and self._converter.hover(text)

    def _complete(self, params: Any) -> Any:
        found = self._unchecked(params)
        return found and self._converter.completion(
            editing.complete(found, self._offset(found, params)))

    def _definition(self, params: Any) -> Any:
        found = self._unchecked(params)
        convert = self._converter
        return [convert.location(span) for span in editing.definition(
            found, self._offset(found, params))] if found else None

    def _references(self, params: Any) -> Any:
        found = self._unchecked(params)
        if found is None:
            return None
        convert, offset = self._converter, self._offset(found, params)
        declared = editing.definition(found, offset)
        is_whole = params.context.include_declaration
        return [convert.location(span) for span in editing.references(found, offset)
                if is_whole or span not in declared]

    def _prepare_rename(self, params: Any) -> Any:
        found = self._unchecked(params)
        if found is None:
            return None
        offset = self._offset(found, params)
        return next((self._converter.range(span) for span in editing.references(found, offset)
                     if span.source.name == found.source.name
                     and span.start <= offset <= span.end), None)

    async def _rename(self, params: Any) -> Any:
        found = await self._whole(params)
        if found is None:
            return None
        try:
            edits = editing.rename(found, self._offset(found, params), params.new_name)
        except CompileError as error:
            item = error.diagnostics[0]
            message = '; '.join(filter(None, (item.title, item.label, item.help)))
            raise _Refusal(message, _REQUEST_FAILED) from None
        return self._converter.edits(edits)

    async def _actions(self, params: Any) -> Any:
        found = await self._whole(params)
        if found is None:
            return None
        convert = self._converter
        lines = range(params.range.start.line, params.range.end.line + 1)
        near = [item for item in found.diagnostics if item.span and item.help
                and item.span.source is found.source
                and convert.range(item.span).start.line in lines]
        memory = self._memories.get(params.text_document.uri)
        tried = [(item, await asyncio.get_running_loop().run_in_executor(
            self._worker, editing.fixes, found, item, memory)) for item in near]
        return [convert.action(fix, item) for item, fixes in tried for fix in fixes]

    def _folding(self, params: Any) -> Any:
        file = self._files.by_uri.get(params.text_document.uri)
        return folding(editing.folds(file.text)) if file else None

    def _formatting(self, params: Any) -> Any:
        found = self._unchecked(params)
        text = editing.formatted(found.source.text) if found else ''
        if found is None or text == found.source.text:
            return []
        whole = Span(found.source, 0, len(found.source.text))
        return [lsp.TextEdit(self._converter.range(whole), text)]


def serve() -> int:
    """Serve an editor over standard input and output; return the exit status."""
    return BundleServer().run()
