"""A real client of the language server, over standard input and output, as an editor is."""

from __future__ import annotations

import asyncio
import os
import sys
from pathlib import Path
from typing import Self

from lsprotocol import types
from pygls.lsp.client import LanguageClient

PATIENCE = 60.0  # of a machine that is busy


class Editor:
    """Opens files, types, asks. Lines and columns count from 1, as in messages."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.client = LanguageClient("test", "1")
        self.versions: dict[str, int] = {}
        self.told: dict[str, list[types.Diagnostic]] = {}
        self.news = asyncio.Event()

        @self.client.feature(types.TEXT_DOCUMENT_PUBLISH_DIAGNOSTICS)
        def publish(params: types.PublishDiagnosticsParams) -> None:
            self.told[params.uri] = list(params.diagnostics)
            self.news.set()

    async def __aenter__(self) -> Self:
        environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
        await self.client.start_io(sys.executable, "-m", "cosim", "lsp", "--stdio", env=environment)
        about = types.InitializeParams(types.ClientCapabilities(), root_uri=self.folder.as_uri())
        self.about = await asyncio.wait_for(self.client.initialize_async(about), PATIENCE)
        self.client.initialized(types.InitializedParams())
        return self

    async def __aexit__(self, *_) -> None:
        await asyncio.wait_for(self.client.shutdown_async(None), PATIENCE)
        self.client.exit(None)
        self.code = await asyncio.wait_for(self.client._server.wait(), PATIENCE)
        await self.client.stop()

    def uri(self, name: str) -> str:
        return (self.folder / name).as_uri()

    async def open(self, name: str, text: str | None = None) -> list[types.Diagnostic]:
        """Open a file, with another text than it has perhaps; what is wrong with it."""
        written = (self.folder / name).read_text() if text is None else text
        document = types.TextDocumentItem(self.uri(name), "yaml", 1, written)
        self.versions[name] = 1
        return await self._after(
            name, lambda: self.client.text_document_did_open(types.DidOpenTextDocumentParams(document))
        )

    async def change(self, name: str, text: str) -> list[types.Diagnostic]:
        """Have another text; what is wrong with it."""
        return await self._after(name, lambda: self.type(name, text))

    def type(self, name: str, text: str) -> None:
        """Have another text, and wait for nothing."""
        self.versions[name] += 1
        here = types.VersionedTextDocumentIdentifier(self.versions[name], self.uri(name))
        whole = types.TextDocumentContentChangeWholeDocument(text)
        self.client.text_document_did_change(types.DidChangeTextDocumentParams(here, [whole]))

    async def save(self, name: str) -> list[types.Diagnostic]:
        """Say that a file was written; what is wrong with the one that is open."""
        here = types.TextDocumentIdentifier(self.uri(name))
        opened = next(iter(self.versions))
        return await self._after(
            opened, lambda: self.client.text_document_did_save(types.DidSaveTextDocumentParams(here))
        )

    async def _after(self, name: str, act) -> list[types.Diagnostic]:
        self.told.pop(self.uri(name), None)
        act()
        while self.uri(name) not in self.told:
            self.news.clear()
            await asyncio.wait_for(self.news.wait(), PATIENCE)
        return self.told[self.uri(name)]

    def _at(self, name: str, line: int, column: int) -> dict:
        here = types.TextDocumentIdentifier(self.uri(name))
        return {"text_document": here, "position": types.Position(line - 1, column - 1)}

    async def offered(self, name: str, line: int, column: int) -> dict[str, types.CompletionItem]:
        """What may be written at a place, by its label, the likeliest first."""
        asked = types.CompletionParams(**self._at(name, line, column))
        answer = await asyncio.wait_for(self.client.text_document_completion_async(asked), PATIENCE)
        return {item.label: item for item in sorted(answer.items, key=lambda item: item.sort_text)}

    async def hover(self, name: str, line: int, column: int) -> str:
        asked = types.HoverParams(**self._at(name, line, column))
        answer = await asyncio.wait_for(self.client.text_document_hover_async(asked), PATIENCE)
        return answer.contents.value if answer else ""

    async def definition(self, name: str, line: int, column: int) -> tuple[str, int] | None:
        """The file's name and the line."""
        asked = types.DefinitionParams(**self._at(name, line, column))
        answer = await asyncio.wait_for(self.client.text_document_definition_async(asked), PATIENCE)
        return (Path(answer.uri).name, answer.range.start.line + 1) if answer else None

    async def rename(self, name: str, line: int, column: int, new: str) -> dict[str, list[types.TextEdit]]:
        """The changes, by the file's path from the folder."""
        asked = types.RenameParams(**self._at(name, line, column), new_name=new)
        answer = await asyncio.wait_for(self.client.text_document_rename_async(asked), PATIENCE)
        return {uri.removeprefix(f"{self.folder.as_uri()}/"): edits for uri, edits in answer.changes.items()}


def using(folder: Path, session):
    """What a session with an editor of a folder gives: a function that takes the editor and is awaited."""

    async def run():
        async with Editor(folder) as editor:
            found = await session(editor)
        assert editor.code == 0
        return found

    return asyncio.run(run())


def edited(text: str, edits: list[types.TextEdit]) -> str:
    """A text with changes, none of which overlap; of characters that UTF-16 has as one unit."""
    lines = text.split("\n")
    for edit in sorted(edits, key=lambda e: (e.range.start.line, e.range.start.character), reverse=True):
        begin, end = edit.range.start, edit.range.end
        row = lines[begin.line]
        lines[begin.line] = row[: begin.character] + edit.new_text + row[end.character :]
    return "\n".join(lines)
