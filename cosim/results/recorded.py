"""A recorded signal: what a result says of it beside its samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

Array = NDArray[Any]


@dataclass(frozen=True)
class Recorded:
    """One recorded signal.

    name: `block.port`. shape: of one sample, the fleet's axis first if the block is one `per:` fleet. components: what
    the elements of its first own axis are called.
    """

    name: str
    shape: tuple[int, ...] = ()
    dtype: Any = float
    fleet: str = ""
    unit: str | tuple[str, ...] | None = None
    description: str = ""
    causality: str = "output"
    components: tuple[str, ...] = ()
