"""Isolated FMUs: instances in a server process, which the loop calls through a mailbox.

The server was forked with the run's shared memory in place, so it calls the same adapter, on the same variables, as the
loop would; only the frames and tables of the calls are its own.
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from cosim.authoring.foreign import LoopWords
from cosim.compiling import kernels
from cosim.fmu import adapter, fields, mailbox
from cosim.fmu.instance import Instances
from cosim.machine import floating
from cosim.machine.memory import words_at

_KERNEL = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, ctypes.c_void_p, ctypes.c_void_p)


class Served(Instances):
    """Instances in a process of their own; a `cosim.authoring.foreign.Part`."""

    def __init__(self, fmu: Any, component: Any, calls: Sequence[Any], arena: np.ndarray, *arguments: Any) -> None:
        super().__init__(fmu, component, calls, arena, *arguments)
        alone = len(self.members) == component.count
        self.process = component.name if alone else f"{component.name} {self.members[0] + 1}"
        self.box = mailbox.new()
        self.loop_link = np.zeros(0, np.int64)  # as of `mailbox.SERVERS` and what follows
        self._code = kernels.module(kernels.raw_sources("server", (adapter.adapt, mailbox.serve))).load()
        self._frames = [self._frame(call) for call in calls]
        entry = self._code.address("adapt")
        self._table = np.array([(entry, frame.ctypes.data) for frame in self._frames], np.int64)
        self.box[mailbox.CALLS] = self._table.ctypes.data

    def _frame(self, call: Any) -> np.ndarray:
        """A call's frame for these members only."""
        size = fields.FIRST + 2 * sum(place is not None for place in call.arguments)
        frame = words_at(self.arena.ctypes.data + call.frame, size).copy()
        frame[fields.COUNT] = len(self.members)
        frame[fields.FIRST :: 2] += self.members[0] * frame[fields.FIRST + 1 :: 2]
        return frame

    def open(self) -> None:
        """Make the instances, and have the loop's frames lead to the mailboxes, with the number of the call."""
        super().open()
        for number, call in enumerate(self.calls):
            frame = words_at(self.arena.ctypes.data + call.frame, fields.FIRST)
            frame[fields.LINK :] = self.loop_link.ctypes.data, number

    def frames(self) -> list[int]:
        """The addresses of the calls' frames."""
        return [frame.ctypes.data for frame in self._frames]

    def serve(self) -> None:
        """Do calls for the loop, until told to stop."""
        serve = _KERNEL(self._code.address("serve"))
        parent = os.getppid()
        with floating.standard():
            while serve(0.0, self.arena.ctypes.data, self.box.ctypes.data) == mailbox.WARNING:
                if os.getppid() != parent:
                    os._exit(1)

    def stop(self) -> None:
        """Have `serve` return; called by who calls the loop, while it rests."""
        mailbox.post(self.box.ctypes.data, mailbox.STOP, 0.0)

    @property
    def busy(self) -> bool:
        """Whether a call has not been answered."""
        return bool(self.box[mailbox.REQUEST] != self.box[mailbox.ANSWER])


def parts(
    fmu: Any,
    component: Any,
    calls: Sequence[Any],
    arena: np.ndarray,
    loop: LoopWords,
    wanted: set[str],
    zeros: Callable[[int], np.ndarray],
) -> list[Served]:
    """A server for all instances of a block, or one for each where a process may have only one."""
    once = fmu.interface.canBeInstantiatedOnlyOncePerProcess
    groups = [range(k, k + 1) for k in range(component.count)] if once else [range(component.count)]
    servers = [Served(fmu, component, calls, arena, loop, wanted, zeros, members) for members in groups]
    link = zeros(8 * (mailbox.BOXES + len(servers))).view(np.int64)
    link[mailbox.SERVERS] = len(servers)
    link[mailbox.BOXES :] = [server.box.ctypes.data for server in servers]
    for server in servers:
        server.loop_link = link
    return servers
