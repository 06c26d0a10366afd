"""Texts of diagrams that an editor has open: inside `counting`, each counts in the place of its file."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from types import MappingProxyType

_texts: ContextVar[Mapping[str, str]] = ContextVar("texts", default=MappingProxyType({}))


@contextmanager
def counting(texts: Mapping[Path, str]) -> Iterator[None]:
    """Inside, these texts are what stands in the files of their paths."""
    token = _texts.set({os.path.realpath(path): text for path, text in texts.items()})
    try:
        yield
    finally:
        _texts.reset(token)


def text(path: str | Path) -> str | None:
    """The text that counts in the place of a file; None where that is the file's own."""
    texts = _texts.get()
    return texts.get(os.path.realpath(path)) if texts else None
