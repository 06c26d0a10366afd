"""What stands behind a block that is no Python code, and what it and the loop ask of each other."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from cosim.errors import CosimError


class Foreign(Protocol):
    """What stands behind a block that is no Python code, such as an FMU: one kernel does all its functions.

    kernel: ``(time, base, frame) -> status`` over raw memory. frame_words: how many words a frame has for it between
    the instance count and the arguments; whoever opens instances for a run fills them. parts: the instances for one
    run, each a `Part`; loop: a `Loop`; zeros gives memory that all processes of the run share.
    """

    @property
    def kernel(self) -> Callable[[float, int, int], int]: ...
    @property
    def frame_words(self) -> int: ...
    def parts(self, component: Any, calls: Any, arena: Any, loop: Any, wanted: set[str], zeros: Any) -> Any: ...


@dataclass(frozen=True)
class Loop:
    """What a foreign block is told of the loop that calls it.

    step: the address of the communication step (s). inner_steps: in how many its states are integrated in one,
    each of so many stages; tableau: of the integrator, as of `Tableau.words`. joint: with the states of all others.
    ending: the address of the word that ends the run, see `cosim.engine.loop.ENDING`. again: of the word that asks for
    another evaluation of outputs, see `cosim.engine.loop.AGAIN`.
    """

    step: int
    inner_steps: int
    stages: int
    tableau: Sequence[float]
    joint: bool
    ending: int
    again: int


class Trace(Protocol):
    """What shared memory tells of a part: a number that changes with every call, None while none is under way; whether
    one failed, and how all ended."""

    @property
    def activity(self) -> int | None: ...
    @property
    def failed(self) -> bool: ...
    @property
    def terminated(self) -> bool: ...
    def termination(self) -> CosimError: ...
    def warnings(self) -> list[CosimError]: ...
    def ended(self, how: str, hung: bool, time: float) -> CosimError: ...


class Part(Protocol):
    """Instances of a foreign block that live together in one process: that of the name, "" for the engine's.

    `open`, `failure`, `close` and `serve` are called there. A part with a process of its own serves the loop until it
    is told to `stop`; it is `busy` while the loop waits for it.
    """

    process: str
    trace: Trace

    def open(self) -> None: ...
    def failure(self, time: float) -> CosimError: ...
    def close(self, terminate: bool) -> None: ...
    def serve(self) -> None: ...
    def stop(self) -> None: ...
    @property
    def busy(self) -> bool: ...
