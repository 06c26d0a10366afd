"""Checkpoints: a run that is killed goes on from the last one to the same bits as if nothing had happened.

    at a communication point where one is due, or somebody wants the run to end:
        have all recorded rows so far on the disk, and keep what brings the result back to what it is
        save what the simulation and the reductions know
        put that, with what the run is, in the place of the last checkpoint
    to resume:
        see that the run is the same one, and the result the one that it has begun
        bring the result back
        initialize as ever, then have simulation and reductions know what they knew

The first one is taken before the first step: what cannot be saved ends the run there, and not when it is too late.
"""

from __future__ import annotations

import math
import os
import re
import time as clock
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from cosim.engine import run_state
from cosim.engine.changes import differences
from cosim.engine.outcome import Outcome
from cosim.engine.reductions import Reductions
from cosim.engine.run_state import Resumable
from cosim.errors import CheckpointError, CosimError, NothingToResume, Problems, ResultError, WrongValue
from cosim.results import result_image
from cosim.results.checkpoint_file import CheckpointFile
from cosim.results.result_errors import as_result_error
from cosim.results.result_file import open_result
from cosim.results.result_writer import ResultWriter, previous_path
from cosim.wiring.clocks import exact
from cosim.wiring.network import Network

MARK = "checkpoints"
"""The attribute of a result by which it is known which checkpoints go with it."""
ANEW = "leave --resume out to begin anew"
COME_TO_AN_END = ("completed", "terminated", "diverged")
_WALL_CLOCK = {"min": 60.0, "h": 3600.0}


@dataclass(frozen=True)
class Interval:
    """How often a checkpoint is taken: every so many seconds, simulated ones in whole steps, or of wall-clock time."""

    text: str
    simulated: float = math.inf
    passed: float = math.inf

    @classmethod
    def read(cls, text: str) -> Self:
        """As a person writes it: `100` for simulated seconds, `10min` or `2h`. Raises: WrongValue."""
        match = re.fullmatch(r"\s*([0-9.eE+-]+)\s*(min|h)?\s*", text)
        try:
            number = float(match[1]) if match else math.nan
        except ValueError:
            number = math.nan
        if not match or not 0.0 < number < math.inf:
            fix = "such as 100 for every 100 simulated seconds, or 10min of wall-clock time"
            raise WrongValue(f"`{text}` is no interval of checkpoints", fix=fix)
        return cls(text, passed=number * _WALL_CLOCK[match[2]]) if match[2] else cls(text, simulated=number)


class Checkpoints:
    """Those of one run, beside its result.

    output: the result. every: how often, as of `Interval`; None: as before. resume: whether the run goes on from the
    last one.
    """

    def __init__(self, output: Path | None, every: str | None, resume: bool) -> None:
        """Raises: WrongValue, ResultError where something else stands in the place of the checkpoint."""
        if output is None:
            raise WrongValue("a checkpoint goes with a result, and this run has none", fix="give it an `output`")
        self.output = output
        self.file = CheckpointFile(output.with_suffix(".checkpoint"))
        self.result: Any = None  # what the result is brought back to
        self.mark = ""
        self._interval = None if every is None else Interval.read(every)
        self._resume = resume
        self._tree: Any = None
        self._identity: dict[str, Any] = {}
        self._time: float | None = None  # of the last one (s)
        self.resumed: float | None = None  # from when (s), where it goes on
        self._warnings: list[CosimError] = []

    @property
    def marked(self) -> dict[str, str]:
        """What the result says of itself, by which it is known that they go with it."""
        return {MARK: self.mark}

    @contextmanager
    def of(self, network: Network, identity: dict[str, Any]) -> Iterator[None]:
        """Inside, the checkpoint is that of a run, and read if it goes on from there; identity: as of `identity`.

        Raises: CheckpointError, DiagramErrors with several.
        """
        try:
            self._begin(network, identity)
            yield
        finally:
            self.file.release()

    def _begin(self, network: Network, identity: dict[str, Any]) -> None:
        self._warnings, self._identity = list(_judged(network)), identity
        self.mark = f"{identity['key']} {os.urandom(8).hex()}"
        if not self._resume:
            self.file.claim()
            return
        if not self.file.path.exists():
            raise self._missing()
        about, self._tree = self.file.take()
        try:
            changed = differences(about["identity"], self._identity)
            self.mark, self.resumed = str(about["mark"]), float(about["time"])
            self._interval = self._interval or Interval.read(about["interval"])
            self.result = self._tree["result"]
        except (KeyError, TypeError, ValueError, CosimError):
            raise self.file.damaged() from None
        if changed:
            message = f"{self.file.path} is of another run: {'; '.join(changed)}"
            raise CheckpointError(message, fix=f"undo that, or {ANEW}")
        self._see_result()
        self._time = self.resumed

    def _see_result(self) -> None:
        """Raises: CheckpointError where the result is not the one that the checkpoint goes with."""
        try:
            why = "" if result_image.holds(self.output, self.mark) else f"another run has written {self.output} since"
        except OSError as error:
            why = f"{self.output}: {error.strerror}"
        if why:
            fix = f"put the result there that it goes with, maybe {previous_path(self.output)}, or {ANEW}"
            raise CheckpointError(f"{self.file.path} cannot be resumed: {why}", fix=fix)

    def _missing(self) -> CheckpointError:
        """That there is none: as the run has come to its end and needs none any more, or for no good reason."""
        missing = f"there is no checkpoint {self.file.path}"
        try:
            with open_result(self.output) as result:
                status, mark = result.attrs["status"], str(result.attrs.get(MARK, ""))
        except ResultError:
            return CheckpointError(missing, fix=ANEW)
        if status not in COME_TO_AN_END:
            return CheckpointError(missing, fix=ANEW)
        if mark.startswith(f"{self._identity['key']} "):
            return NothingToResume(f"nothing to do: the run in {self.output} is {status}", status)
        other = "kept none" if not mark else "was another one"
        return CheckpointError(f"{missing}, and the run in {self.output}, which is {status}, {other}", fix=ANEW)

    # ---- along the run ----

    def start(self, simulation: Resumable, reductions: Reductions, writer: ResultWriter) -> None:
        """Go on from the checkpoint, else take the first one; the simulation is initialized. Raises: CosimError."""
        assert self._interval
        schedule = simulation.program.network.schedule
        if self._interval.simulated < math.inf:
            steps = math.ceil(exact(self._interval.simulated) / (schedule.grid * schedule.tick))
            simulation.rests_at = min(steps * schedule.grid, simulation.rests_at)
        if self._tree is None:
            self._take(simulation, reductions, writer)
            return
        try:
            run_state.restore(simulation, self._tree["simulation"])
            reductions.restore(self._tree["reductions"])
        except (KeyError, TypeError, ValueError, IndexError) as error:
            raise self.file.damaged() from error
        self._tree = None
        self._taken = clock.perf_counter(), simulation.done

    def follow(self, simulation: Resumable, reductions: Reductions, writer: ResultWriter, wanted: bool) -> None:
        """Take one after a batch, if it is due, or somebody wants the run to end. Raises: CosimError."""
        assert self._interval
        at, tick = self._taken
        every = simulation.rests_at
        due = simulation.done // every > tick // every or clock.perf_counter() - at >= self._interval.passed
        if simulation.resting and (due or wanted):
            self._take(simulation, reductions, writer)

    def _take(self, simulation: Resumable, reductions: Reductions, writer: ResultWriter) -> None:
        assert self._interval
        about = {
            "identity": self._identity,
            "mark": self.mark,
            "time": simulation.time,
            "interval": self._interval.text,
        }
        tree = {
            "simulation": run_state.state_of(simulation),
            "reductions": reductions.state(),
            "result": writer.state(),
        }
        with as_result_error("write", self.file.path):
            self.file.write(about, tree)
        self._time = simulation.time
        self._taken = clock.perf_counter(), simulation.done

    # ---- at its end ----

    def end(self, outcome: Outcome) -> None:
        """Remove the checkpoint of a run that has come to its end; tell what there is to know of it."""
        outcome.resumed = self.resumed
        outcome.warnings += self._warnings
        if outcome.status in COME_TO_AN_END:
            self.file.remove()
        elif self._time is not None:
            outcome.checkpoint = str(self.file.path), self._time


def _judged(network: Network) -> Iterable[CosimError]:
    """Blocks of which a checkpoint may not hold all. Raises: CheckpointError, DiagramErrors with several."""
    problems = Problems()
    for component in network.components.values():
        foreign = component.declaration.foreign
        if foreign and (error := foreign.unsaved(component)):
            problems.add(error)
        elif not foreign and not component.declaration.compiled:
            message = f"block {component.name} is plain Python: what it keeps outside of its states is in no checkpoint"
            yield CheckpointError(message, component.entry.type.position, "keep in states what is to last")
    problems.raise_one_or_all()
