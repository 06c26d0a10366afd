"""What the workbench answers, in the Language Server Protocol's words, whose columns count in UTF-16."""

from __future__ import annotations

from pathlib import Path

from lsprotocol import types

from cosim.editor.cursor import Cursor
from cosim.editor.suggestions import Suggestion
from cosim.editor.underlining import Span, elsewhere, spans
from cosim.errors import CosimError, Position

ERROR, WARNING = types.DiagnosticSeverity.Error, types.DiagnosticSeverity.Warning
_KINDS = {
    "key": types.CompletionItemKind.Property,
    "type": types.CompletionItemKind.Class,
    "block": types.CompletionItemKind.Module,
    "signal": types.CompletionItemKind.Field,
    "word": types.CompletionItemKind.Value,
    "function": types.CompletionItemKind.Function,
}


def column(line: str, units: int) -> int:
    """How many characters of a line its first code units of UTF-16 are."""
    return len(line.encode("utf-16-le")[: 2 * units].decode("utf-16-le", errors="ignore"))


def units(line: str, characters: int) -> int:
    """How many code units of UTF-16 the first characters of a line are."""
    return len(line[:characters].encode("utf-16-le")) // 2


def span_range(text: str, span: Span) -> types.Range:
    """A part of a line."""
    lines = text.split("\n")
    row = lines[span.line] if span.line < len(lines) else ""
    return types.Range(
        types.Position(span.line, units(row, span.begin)), types.Position(span.line, units(row, span.end))
    )


def location(place: Position) -> types.Location:
    """A place in a file, without a width."""
    at = types.Position(max(place.line - 1, 0), max(place.column - 1, 0))
    return types.Location(Path(place.file).resolve().as_uri(), types.Range(at, at))


def diagnostics(error: CosimError, severity: types.DiagnosticSeverity, path: Path, text: str) -> list[types.Diagnostic]:
    """A mistake at each of its places, with its fix; one of another file says where that is."""
    there = elsewhere(error, path)
    message = error.message + (f"\nfix: {error.fix}" if error.fix else "")
    related = [types.DiagnosticRelatedInformation(location(there), error.message)] if there else None
    return [
        types.Diagnostic(
            span_range(text, span),
            message=f"{there}: {message}" if there else message,
            severity=severity,
            code=type(error).__name__,
            source="cosim",
            related_information=related,
        )
        for span in spans(error, path, text)
    ]


def item(suggestion: Suggestion, here: Cursor, text: str) -> types.CompletionItem:
    """A suggestion, which takes the place of the word that is typed."""
    where = span_range(text, Span(here.line, here.begin, here.end))
    page = types.MarkupContent(types.MarkupKind.Markdown, suggestion.page) if suggestion.page else None
    return types.CompletionItem(
        suggestion.label,
        kind=_KINDS[suggestion.kind],
        detail=suggestion.detail or None,
        documentation=page,
        sort_text=f"{'0' if suggestion.first else '1'}{suggestion.label}",
        filter_text=suggestion.label,
        text_edit=types.TextEdit(where, suggestion.label + suggestion.ending),
    )


def hover(page: str, here: Cursor, text: str) -> types.Hover | None:
    """A page about a word."""
    if not page:
        return None
    where = span_range(text, Span(here.line, here.begin, here.end))
    return types.Hover(types.MarkupContent(types.MarkupKind.Markdown, page), where)
