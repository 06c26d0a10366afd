"""What the instances of a block leave behind in shared memory, so that another process can tell how they ended.

Written just before each call of the FMU, and by its logger, so that it is true after a crash.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from cosim.errors import SlaveCrashed, SlaveFailed, SlaveHung
from cosim.fmu import layout, messages

_NAMES, _NAME_BYTES = 64, 56


class Trace:
    """The link that the adapter keeps, the names of the FMU's functions, and each instance's last messages.

    fmu: a `cosim.fmu.importer.Fmu`. members: which of the slave's instances these are, from 0.
    """

    def __init__(self, fmu: Any, slave: Any, members: range, zeros: Callable[[int], np.ndarray]) -> None:
        self.fmu = fmu
        self.slave = slave
        self.members = members
        self.link = zeros(8 * layout.LINK_WORDS).view(np.int64)
        self._names = zeros((8 + _NAME_BYTES) * _NAMES).view([("address", "i8"), ("name", f"S{_NAME_BYTES}")])
        rings = zeros(messages.RING_BYTES * len(members)).reshape(len(members), -1)
        self.messages = [messages.Messages(ring) for ring in rings]

    def name(self, address: int, name: str) -> None:
        """Note what a function is called."""
        for row in self._names:
            if row["address"] in (0, address):
                row["name"], row["address"] = name.encode(), address
                return

    def name_of(self, address: int) -> str:
        """What a function is called."""
        return next((row["name"].decode() for row in self._names if address and row["address"] == address), "")

    def calling(self, k: int, address: int) -> None:
        """Note that a function of instance k is about to be called."""
        self.link[layout.INSTANCE], self.link[layout.CALLING] = k, address
        self.link[layout.CALLED] += 1

    @property
    def activity(self) -> int:
        """A number that changes with every call of the FMU."""
        return int(self.link[layout.CALLED])

    @property
    def failed(self) -> bool:
        """Whether a call of the loop's failed."""
        return int(self.link[layout.STATUS]) > layout.WARNING

    def failure(
        self, text: str, k: int, time: float, kind: type[SlaveFailed] = SlaveFailed, fix: str = ""
    ) -> SlaveFailed:
        """What went wrong with instance k at a time (s), with its last messages."""
        member = f", {self.slave.fleet} {self.members[k] + 1}" if self.slave.fleet else ""
        message = f"block {self.slave.name} ({self.fmu.name}{member}) failed at t = {time:g} s: {text}"
        message += "".join(f"\n    it says {line}" for line in self.messages[k].last())
        return kind(message, self.slave.entry.type.position, fix)

    def ended(self, how: str, hung: bool, time: float) -> SlaveFailed:
        """How the process of these instances ended: in the function that was called last, or while loading."""
        k = min(max(int(self.link[layout.INSTANCE]), 0), len(self.members) - 1)
        name = self.name_of(int(self.link[layout.CALLING]))
        where = f" in {name}()" if name else " while its binary was loaded"
        if hung:
            return self.failure(f"{how}{where}", k, time, SlaveHung, "where it only is slow, raise `run.patience` (s)")
        return self.failure(f"{how}{where}", k, time, SlaveCrashed)
