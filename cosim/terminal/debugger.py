"""Python's own debugger around a run as plain Python: it stops in authors' functions, and steps over what is ours."""

from __future__ import annotations

import bdb
import inspect
import pdb  # noqa: T100  # which is what this file is for
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from types import FrameType
from typing import Any

Place = tuple[str, int]
"""Where a function begins: the file of its code, and its first line."""
PASSED = ("cosim", "numpy", "contextlib")
"""Packages through which nobody steps, but for `cosim.blocks`."""


class Debugger(pdb.Pdb):
    """Stops in the first call of a function that begins at one of some places, and at breakpoints that somebody sets.

    passed: how many of those calls are passed over before.
    """

    def __init__(self, places: Iterable[Place], passed: int = 0) -> None:
        super().__init__(skip=PASSED, nosigint=True)
        self.prompt = "(cosim) "
        self._places = {*places}
        self._passed = passed
        self._wanted: FrameType | None = None
        self._stepping = False
        self.quitting = False

    @property
    def has_reason(self) -> bool:
        """Whether there is still anything to stop for."""
        return not self.quitting and bool(self._places or self.breaks or self._stepping)

    def watch(self, function: Callable[[], Any]) -> None:
        """Call a function and stop in what it calls; without a word where somebody quits.

        Who goes line by line does so from one call into the next.
        """
        self.reset()
        self.botframe = inspect.currentframe()  # as of `runcall`, which would stop at once
        if not self._stepping:
            self._set_stopinfo(self.botframe, None, -1)  # type: ignore[attr-defined]
        sys.settrace(self.trace_dispatch)
        try:
            function()
        except bdb.BdbQuit:
            pass
        finally:
            sys.settrace(None)
            self._stepping = self.stopframe is None

    def look_at(self, error: BaseException) -> None:
        """Show where something was raised."""
        self.reset()
        self.interaction(None, error.__traceback__)

    def is_skipped_module(self, module_name: str | None) -> bool:
        """Whether nobody steps through a module."""
        package, _, rest = (module_name or "").partition(".")
        return package in PASSED and not (package == "cosim" and rest.partition(".")[0] == "blocks")

    def lookupmodule(self, filename: str) -> str | None:
        """The file that `b file.py:12` means: of the working folder, as diagrams name it, or of Python's path."""
        return str(Path(filename).resolve()) if Path(filename).is_file() else super().lookupmodule(filename)

    def user_call(self, frame: FrameType, argument_list: None) -> None:
        """At the call of a function that is of interest."""
        if _place(frame) in self._places:
            self._passed -= 1
            if self._passed < 0:
                self._places.clear()
                self._wanted = frame
        super().user_call(frame, argument_list)

    def break_anywhere(self, frame: FrameType) -> bool:
        """Whether a function is of interest."""
        return _place(frame) in self._places or super().break_anywhere(frame)

    def break_here(self, frame: FrameType) -> bool:
        """Whether to stop at a line."""
        if frame is self._wanted:
            self._wanted = None
            return True
        return super().break_here(frame)


def _place(frame: FrameType) -> Place:
    return frame.f_code.co_filename, frame.f_code.co_firstlineno
