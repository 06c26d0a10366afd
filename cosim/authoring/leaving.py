"""An author's code that asks the whole program to end."""

from __future__ import annotations

import traceback
from pathlib import Path

from cosim.authoring.author_source import shown
from cosim.errors import CosimError, Position


def left(leaving: SystemExit) -> CosimError:
    """An exit out of an author's code, which would end the program without a word, as a mistake at its line."""
    own = str(Path(__file__).parents[1])
    frames = [f for f in traceback.extract_tb(leaving.__traceback__) if not f.filename.startswith((own, "<"))]
    place = (
        Position(shown(frames[-1].filename), frames[-1].lineno or 0, (frames[-1].colno or 0) + 1) if frames else None
    )
    asked = "" if leaving.code is None else repr(leaving.code)
    message = f"a block's code asks the whole program to end: SystemExit({asked})"
    return CosimError(message, place, 'a rule returns whether it holds; elsewhere raise ValueError("…")')
