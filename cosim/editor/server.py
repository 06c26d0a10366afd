"""The language server: the workbench behind the Language Server Protocol, over two streams."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

from lsprotocol import types
from pygls import uris
from pygls.exceptions import JsonRpcInvalidParams
from pygls.lsp.server import LanguageServer

from cosim.editor import protocol
from cosim.editor.underlining import Span
from cosim.editor.workbench import Workbench
from cosim.errors import CosimError
from cosim.language import unsaved
from cosim.wiring import library

PAUSE = 0.05
"""For how long (s) nothing is typed before a text is checked."""


class Service:
    """Answers an editor's questions about the texts that it has open."""

    def __init__(self, server: LanguageServer) -> None:
        self.server = server
        self.bench = Workbench()
        self.uris: dict[Path, str] = {}  # as the editor writes them
        self.waiting: asyncio.Task[None] | None = None

    # ---- what the editor tells ----

    def opened(self, params: types.DidOpenTextDocumentParams) -> None:
        """A text is open."""
        self._put(params.text_document.uri)
        self.check()

    def changed(self, params: types.DidChangeTextDocumentParams) -> None:
        """A key was pressed: what is wrong now is told as soon as nothing is typed for a moment."""
        self._put(params.text_document.uri)
        if self.waiting:
            self.waiting.cancel()
        self.waiting = asyncio.get_running_loop().create_task(self._check_later())

    def saved(self, params: types.DidSaveTextDocumentParams) -> None:
        """A file is written, perhaps one of Python."""
        self.bench.saved()
        self.check()

    def watched(self, params: types.DidChangeWatchedFilesParams) -> None:
        """Files have changed that may not be open."""
        self.bench.saved()
        self.check()

    def closed(self, params: types.DidCloseTextDocumentParams) -> None:
        """A text is closed; nothing is said of it any more."""
        self.bench.close(_path(params.text_document.uri))
        self._publish(params.text_document.uri, [])

    def _put(self, uri: str) -> None:
        self.uris[_path(uri)] = uri
        if not self.bench.put(_path(uri), self.server.workspace.get_text_document(uri).source):
            self._publish(uri, [])

    async def _check_later(self) -> None:
        await asyncio.sleep(PAUSE)
        self.check()

    def check(self) -> None:
        """Tell what is wrong with every text that is open: one may extend another."""
        root = self.server.workspace.root_path
        self.bench.project = Path(root) if root else self.bench.project
        for path, text in self.bench.texts.items():
            found = self.bench.reading(path)
            with unsaved.counting(self.bench.texts):
                told = [d for e in found.errors for d in protocol.diagnostics(e, protocol.ERROR, path, text)]
                told += [d for w in found.warnings for d in protocol.diagnostics(w, protocol.WARNING, path, text)]
            self._publish(self.uris[path], told)

    def _publish(self, uri: str, found: list[types.Diagnostic]) -> None:
        self.server.text_document_publish_diagnostics(types.PublishDiagnosticsParams(uri, found))

    # ---- what the editor asks, of a place in a text that is looked at ----

    def about(self, answer: Callable[[Path, int, int, Any], Any]) -> Callable[[Any], Any]:
        """A question's answer; None of any other file."""

        def answered(params: Any) -> Any:
            path, line = _path(params.text_document.uri), params.position.line
            if path not in self.bench.texts:
                return None
            rows = self.bench.texts[path].split("\n")
            row = rows[line] if line < len(rows) else ""
            return answer(path, line, protocol.column(row, params.position.character), params)

        return answered

    def completion(self, path: Path, line: int, column: int, params: Any) -> types.CompletionList:
        """What may be written there."""
        here, found = self.bench.suggestions(path, line, column)
        text = self.bench.texts[path]
        return types.CompletionList(False, [protocol.item(one, here, text) for one in found])

    def hover(self, path: Path, line: int, column: int, params: Any) -> types.Hover | None:
        """What the word there means."""
        here, page = self.bench.page(path, line, column)
        return protocol.hover(page, here, self.bench.texts[path])

    def definition(self, path: Path, line: int, column: int, params: Any) -> types.Location | None:
        """Where what the word there stands for is written."""
        found = self.bench.home(path, line, column)
        return protocol.location(found) if found else None

    def prepare_rename(self, path: Path, line: int, column: int, params: Any) -> types.PrepareRenamePlaceholder | None:
        """The block's name that is there."""
        here, name = self.bench.renamed_at(path, line, column)
        if not name:
            return None
        where = protocol.span_range(self.bench.texts[path], Span(line, here.begin, here.begin + len(name)))
        return types.PrepareRenamePlaceholder(where, name)

    def rename(self, path: Path, line: int, column: int, params: types.RenameParams) -> types.WorkspaceEdit | None:
        """A block gets another name in all files that have it. Raises: JsonRpcInvalidParams for what cannot be."""
        _, name = self.bench.renamed_at(path, line, column)
        if not name:
            return None
        try:
            found = self.bench.renaming(name, params.new_name, path)
        except CosimError as error:
            raise JsonRpcInvalidParams(str(error)) from None
        changes: dict[str, list[types.TextEdit]] = {}
        for edit in found:
            file = Path(edit.place.file)
            uri = self.uris.get(file) or file.as_uri()
            text = self.server.workspace.get_text_document(uri).source
            begin = edit.place.column - 1
            where = protocol.span_range(text, Span(edit.place.line - 1, begin, begin + edit.length))
            changes.setdefault(uri, []).append(types.TextEdit(where, params.new_name))
        return types.WorkspaceEdit(changes)


def _path(uri: str) -> Path:
    return Path(uris.to_fs_path(uri) or "")


def serve(stdin: BinaryIO, stdout: BinaryIO, version: str) -> None:
    """Answer until the editor ends it."""
    server = LanguageServer("cosim", version)
    service = Service(server)
    library.all_blocks()  # which takes a moment that nobody waits for yet
    for name, answer, options in (
        (types.TEXT_DOCUMENT_DID_OPEN, service.opened, None),
        (types.TEXT_DOCUMENT_DID_CHANGE, service.changed, None),
        (types.TEXT_DOCUMENT_DID_SAVE, service.saved, None),
        (types.TEXT_DOCUMENT_DID_CLOSE, service.closed, None),
        (types.WORKSPACE_DID_CHANGE_WATCHED_FILES, service.watched, None),
        (
            types.TEXT_DOCUMENT_COMPLETION,
            service.about(service.completion),
            types.CompletionOptions([".", " ", "[", "{"]),
        ),
        (types.TEXT_DOCUMENT_HOVER, service.about(service.hover), None),
        (types.TEXT_DOCUMENT_DEFINITION, service.about(service.definition), None),
        (types.TEXT_DOCUMENT_PREPARE_RENAME, service.about(service.prepare_rename), None),
        (types.TEXT_DOCUMENT_RENAME, service.about(service.rename), types.RenameOptions(prepare_provider=True)),
    ):
        server.feature(name, options)(partial(answer))  # it is marked, which a method cannot be
    server.start_io(stdin, stdout)
