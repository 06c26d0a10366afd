"""A run by hand: step by step, with a look at any signal in between, and values for inputs that nothing is wired to."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from cosim.authoring.variables import Input
from cosim.engine import compilation, program, run_state
from cosim.engine.hand_run import HandRun
from cosim.engine.probes import Probes
from cosim.engine.run import ENGINES
from cosim.errors import CosimError, NotWirable, UsageError, WrongShape, WrongValue, nearest
from cosim.language.reader import endpoint
from cosim.machine import importing, interruption
from cosim.wiring.network import Component, Network, Signal


@dataclass(frozen=True)
class SavedState:
    """All that a run by hand knew at a communication point; time: which (s)."""

    time: float
    state: Mapping[str, Any]
    inputs: Mapping[Signal, np.ndarray]


class SteppedRun:
    """A run that stops at every communication point; made by `BlockDiagram.start`, and used as a context manager.

    `sim["plant.x"]` is any signal as it is now, over all members of a fleet; `sim["controller.u"] = 1.5` gives an input
    that nothing is wired to another value from now on. All steps are those of a whole run, to the bit.
    """

    def __init__(self, network: Network, engine: str = "native") -> None:
        """Raises: WrongValue for an engine that there is not, DiagramErrors."""
        if engine not in ENGINES:
            raise WrongValue(f"there is no engine `{engine}`", fix=nearest(engine, ENGINES))
        self._network = network
        self._grid = network.schedule.grid
        self._foreign = [c for c in network.components.values() if c.declaration.foreign]
        names = {component.name for component in self._foreign}
        seen = Probes(tuple(s for s in network.signals() if s.component in names), self._grid)
        with importing.LOADING:
            self._program = program.build(network, network.diagram.run.method)
            kernels = compilation.compile_program(self._program)  # interpreted too, so that both refuse the same
            if engine == "native":
                kernels.load()
        self._simulation = HandRun(self._program, kernels if engine == "native" else None, [seen])
        self._first: dict[Signal, np.ndarray] = {}  # what inputs were before they were given another value
        self._stale = False
        self._closed = True

    def __enter__(self) -> Self:
        """Initialize. Raises: BlockFailed, Diverged, FmuError."""
        if self._simulation.host:
            raise UsageError("this run has been begun before", fix="call .start() once more")
        self._closed = False
        with self._closing():
            self._simulation.initialize()
            self._simulation.go_to(0)
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End it, FMUs too; signals can still be looked at."""
        if not self._closed:
            self._closed = True
            with suppress(CosimError):
                self._simulation.close()

    # ---- time ----

    @property
    def time(self) -> float:
        """The simulated time (s)."""
        return self._simulation.time

    @property
    def done(self) -> bool:
        """Whether the end is reached, or a block has ended the run."""
        return self._simulation.done >= self._simulation.ticks or self._simulation.termination is not None

    @property
    def ended(self) -> str:
        """Which block ended the run, and why; "" where none did."""
        return self._simulation.termination.message if self._simulation.termination else ""

    def step(self, count: int = 1) -> float:
        """Do so many communication steps, no more than are left; returns the time that is reached (s).

        Ctrl-C raises KeyboardInterrupt between two steps. Raises: UsageError where the run is over; as a run does,
        the error that ends it.
        """
        if count < 1:
            raise WrongValue(f"a run cannot go {count} steps ahead", fix=".save() and .restore() lead back")
        self._open()
        if self.done:
            raise UsageError(f"the run is over at {self.time:g} s", fix="a larger run.stop, or `while not sim.done:`")
        for _ in range(count):
            here = self._simulation.done
            self._go_to(min(here - here % self._grid + self._grid, self._simulation.ticks))
            if self.done:
                break
        return self.time

    def _go_to(self, tick: int) -> None:
        with self._closing(), interruption.deferred() as interrupted:
            self._simulation.breakable = interrupted.breakable
            self._simulation.go_to(tick)
            self._stale = False
        interrupted.raise_if_wanted()

    # ---- signals ----

    def __getitem__(self, name: str) -> np.ndarray:
        """A signal now, `block.port`: (members of a fleet, *shape). Raises: UnknownBlock, UnknownPort."""
        signal = self._input(name) or self._network.find(name, None)
        if self._stale:
            self._go_to(self._simulation.done)
        return self._simulation.value(signal)

    def __setitem__(self, name: str, value: Any) -> None:
        """Give an input that nothing is wired to another value, of its own or for all members.

        What depends on it at this very time is evaluated anew.
        Raises: NotWirable for anything else and in a diagram with FMUs, WrongShape, WrongValue.
        """
        self._open()
        signal = self._input(name)
        if signal is None:
            self._network.find(name, None)
            raise NotWirable(f"`{name}` is computed: only inputs that nothing is wired to can be given", fix="")
        self._refuse_held(name, signal)
        stored = self._stored(signal)
        given = np.asarray(value)
        if given.dtype.kind not in "fiub" or not np.can_cast(given.dtype, stored.dtype, "same_kind"):
            raise WrongValue(
                f"`{name}` takes {stored.dtype} numbers, not {given.dtype}", fix="give a number or an array"
            )
        if not np.all(np.isfinite(given)):
            raise WrongValue(f"`{name}` takes finite numbers", fix="give a number")
        try:
            whole = np.broadcast_to(given, stored.shape)
        except ValueError:
            said = "" if stored.shape == self._network.shape(signal) else ", one for all members"
            message = f"`{name}` has the shape {stored.shape}{said}, and the value {given.shape}"
            fix = "give `start` a list with one value for each member, and each can be given its own" if said else ""
            raise WrongShape(message, fix=fix) from None
        self._first.setdefault(signal, stored.copy())
        stored[...] = whole
        self._simulation.forget_point()
        self._stale = True

    def _stored(self, signal: Signal) -> np.ndarray:
        """Where an input's value lies: one for each member, or one for all."""
        return self._program.stored(signal, self._simulation.arena)

    def _input(self, name: str) -> Signal | None:
        """The input of that name that nothing is wired to. Raises: NotWirable for one that is wired."""
        block, port = endpoint(name)
        component = self._network.components.get(block)
        if component is None or not isinstance(component.declaration.variables.get(port), Input):
            return None
        if wires := component.wires.get(port):
            raise NotWirable(f"`{name}` is wired to {', '.join(map(str, wires))}", fix=f"look at {wires[0]} instead")
        return Signal(block, port)

    def _refuse_held(self, name: str, signal: Signal) -> None:
        """Raises: NotWirable where a value would not count from now on."""
        component: Component = self._network.components[signal.component]
        if self._foreign:
            message = (
                f"`{name}` cannot be given: {self._foreign[0].name} is an FMU, which takes no input twice at one time"
            )
            raise NotWirable(
                message,
                fix="set it for the whole run: .set({'blocks." + f"{signal.component}.start.{signal.variable}': …}})",
            )
        if component.clock is not None:
            message = (
                f"`{name}` cannot be given: {component.name} is sampled, and reads its inputs at its sample times only"
            )
            raise NotWirable(message, fix="leave `period` out, or put the input before it in a block of its own")

    # ---- states ----

    def save(self) -> SavedState:
        """All that is known now. Raises: CosimError for FMUs that cannot be saved."""
        self._open()
        if self._stale:
            self._go_to(self._simulation.done)
        with self._closing():
            inputs = {signal: self._stored(signal).copy() for signal in self._first}
            return SavedState(self.time, run_state.state_of(self._simulation), inputs)

    def restore(self, saved: SavedState) -> None:
        """Go on from a state of a run of the same diagram. Raises: CosimError of FMUs, WrongValue for another's."""
        self._open()
        self._simulation.resting = True
        try:
            with self._closing():
                run_state.restore(self._simulation, saved.state)
        except (KeyError, TypeError, ValueError):
            raise WrongValue(
                "this state is of another diagram", fix="restore what .save() of the same one gave"
            ) from None
        for signal, first in self._first.items():
            self._stored(signal)[...] = saved.inputs.get(signal, first)
        self._simulation.termination = None
        self._stale = False

    # ---- life ----

    def _open(self) -> None:
        if self._closed:
            raise UsageError("this run is not open", fix="with diagram.start() as sim: sim.step()")

    def _closing(self) -> Any:
        return _Closing(self)

    def __repr__(self) -> str:
        over = " (over)" if self.done else " (closed)" if self._closed else ""
        return f"{self._network.diagram.title} by hand, at {self.time:g} of {self._network.diagram.run.stop:g} s{over}"


class _Closing:
    """What fails inside ends the run."""

    def __init__(self, run: SteppedRun) -> None:
        self._run = run

    def __enter__(self) -> None:
        return

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is not None:
            self._run.close()
