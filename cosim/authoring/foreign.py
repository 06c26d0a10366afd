"""What stands behind a block that is no Python code, and what it and the loop ask of each other."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from cosim.errors import CosimError, Terminated


class Foreign(Protocol):
    """What stands behind a block that is no Python code, such as an FMU: one kernel does all its functions."""

    @property
    def kernel(self) -> Callable[[float, int, int], int]:
        """``(time, base, frame) -> status`` over raw memory."""

    @property
    def frame_words(self) -> int:
        """How many words a frame has for it between the instance count and the arguments.

        Whoever opens instances for a run fills them.
        """

    def library(self) -> bytes:
        """The code that computes it on this machine."""

    def derives(self, component: Any, function: Any) -> bool:
        """Whether instances of a block give directional derivatives of what a function of it computes."""

    def unsaved(self, component: Any) -> CosimError | None:
        """Why the instances of a block cannot be saved, with the usual fix; None where they can."""

    def parts(
        self, component: Any, calls: Any, arena: Any, loop: LoopWords, wanted: set[str], zeros: Any
    ) -> Sequence[Part]:
        """The instances for one run. zeros: gives memory that all processes of the run share."""


@dataclass(frozen=True)
class LoopWords:
    """What a foreign block is told of the loop that calls it.

    step: the address of the size (s) of the step that is done.
    ending: the address of the word that ends the run, see `cosim.master.tables`. again: of the word that asks for
    another evaluation of outputs. next_event: of the time (s) of the next time event that anybody knows of. left: of
    whether what is evaluated lies before the events of its time. early: of the time (s) of the first event at which
    anybody stops within a step, which is then done anew; 0 where none can be. tangent: of how those are evaluated that
    know their directional derivatives. histories: of inputs that go on in a
    step, where `cosim.master.histories` has what wires brought.
    """

    step: int
    ending: int
    again: int
    next_event: int
    left: int
    early: int
    tangent: int
    histories: Mapping[str, int]


class Trace(Protocol):
    """What shared memory tells of a part."""

    @property
    def activity(self) -> int | None:
        """A number that changes with every call; None while none is under way."""

    @property
    def failed(self) -> bool:
        """Whether a call of the loop's failed."""

    @property
    def terminated(self) -> bool:
        """Whether an instance asked for the end of the simulation."""

    def termination(self) -> Terminated:
        """Who asked for it, and when."""

    def warnings(self) -> list[CosimError]:
        """What the instances warned of."""

    def ended(self, how: str, hung: bool, time: float) -> CosimError:
        """How the process of the part ended; hung: by our hand, as it fell silent; time: that of the run (s)."""


class Part(Protocol):
    """Instances of a foreign block that live together in one process: that of the name, "" for the engine's.

    `open`, `failure`, `save`, `restore`, `close` and `serve` are called there.
    """

    process: str
    trace: Trace

    def open(self) -> None:
        """Make all instances. Raises: CosimError."""

    def failure(self, time: float) -> CosimError:
        """What stopped the loop in one of the calls, at a time (s)."""

    def save(self, time: float) -> Any:
        """All that the instances know at a communication point (s), in arrays. Raises: CosimError."""

    def restore(self, state: Any, time: float) -> None:
        """Go on from there, after initialization. Raises: CosimError, KeyError or ValueError where it does not fit."""

    def close(self, terminate: bool) -> None:
        """Free all instances; terminate: after telling them of the end."""

    def serve(self) -> None:
        """Do what the loop asks for, in a process of its own, until it is told to `stop`."""

    def stop(self) -> None:
        """Have `serve` return."""

    @property
    def busy(self) -> bool:
        """Whether the loop waits for it."""
