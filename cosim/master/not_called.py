"""What stands in compiled code in the place of a function that is not called: see `cosim.engine.loop_code`."""

from __future__ import annotations

from typing import Any

from cosim.master.tables import FATAL


def not_called(*_: Any) -> int:
    """End the run, which does call it, rather than go on without."""
    return FATAL
