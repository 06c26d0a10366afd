"""A simulation that goes to the communication points that somebody wants, and knows all that is published there."""

from __future__ import annotations

from cosim.engine.simulation import Simulation
from cosim.machine import supervision
from cosim.master import tables


class HandRun(Simulation):
    """A simulation by hand. What it does in a step is what a whole run does, to the bit, however often it stops."""

    def go_to(self, tick: int) -> None:
        """Go on to a communication point, which is evaluated; what the probes saw is lost.

        Raises: as `batches`. Where a block ends the run before, `termination` says so.
        """
        self.control[tables.LAST], self.control[tables.FINAL], self.control[tables.STOP] = tick, 1, 0
        while self.control[tables.FINAL] and self.control[tables.ENDING] != tables.ENDED:
            status, error = self._do_batch(supervision.never)
            self.buffers.take()
            if error:
                raise error
            self._raise(status)
        if self.control[tables.ENDING] == tables.ENDED:
            self.termination = self.ended_by()
        else:
            self.control[tables.ARRIVED] = 1

    def forget_point(self) -> None:
        """Have what is published at this communication point be evaluated anew, with other inputs."""
        self.control[tables.ARRIVED] = 0
