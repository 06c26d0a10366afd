"""What the instances of a block leave behind in shared memory, so that another process can tell how they ended.

Written just before each call of the FMU, and by its logger, so that it is true after a crash.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, BinaryIO

import numpy as np

from cosim.errors import CosimError, FmuCrashed, FmuFailed, FmuHung, Terminated
from cosim.fmu import fields, messages
from cosim.machine import floating

_NAMES, _NAME_BYTES = 64, 56


class FmuTrace:
    """The link that the adapter keeps, the names of the FMU's functions, and each instance's last messages.

    fmu: a `cosim.fmu.imported.Fmu`. members: which of the component's instances these are, from 0.
    """

    def __init__(self, fmu: Any, component: Any, members: range, zeros: Callable[[int], np.ndarray]) -> None:
        self.fmu = fmu
        self.component = component
        self.members = members
        self.link = zeros(8 * fields.LINK_WORDS).view(np.int64)
        self._names = zeros((8 + _NAME_BYTES) * _NAMES).view([("address", "i8"), ("name", f"S{_NAME_BYTES}")])
        rings = zeros(messages.RING_BYTES * len(members)).reshape(len(members), -1)
        self.messages = [messages.Messages(ring) for ring in rings]
        self._log: BinaryIO | None = None  # open as long as this

    def log_to(self, file: BinaryIO) -> None:
        """Have all messages written to a file, too."""
        self._log = file
        for k, ring in enumerate(self.messages):
            ring.write_to(file.fileno(), self.instance_name(k))

    def instance_name(self, k: int) -> str:
        """What an instance is called."""
        name = str(self.component.name)
        return f"{name}_{self.members[k] + 1}" if self.component.fleet else name

    def name(self, address: int, name: str) -> None:
        """Note what a function is called."""
        for row in self._names:
            if row["address"] in (0, address):
                row["name"], row["address"] = name.encode(), address
                return

    def name_of(self, address: int) -> str:
        """What a function is called."""
        return next((row["name"].decode() for row in self._names if address and row["address"] == address), "")

    @contextmanager
    def calling(self, k: int, address: int) -> Iterator[None]:
        """Inside, a function of instance k is called (0: the library is loaded or left). See `transfer.bad`."""
        self.link[fields.INSTANCE], self.link[fields.CALLING] = k, address
        owner = os.getpid()
        self.link[fields.CALLED] += 1
        try:
            with floating.kept():
                yield
        finally:
            if os.getpid() != owner:
                os._exit(0)
            self.link[fields.CALLED] += 1

    @property
    def activity(self) -> int | None:
        """A number that changes with every call of the FMU; None while none is under way."""
        called = int(self.link[fields.CALLED])
        return called if called % 2 else None

    @property
    def failed(self) -> bool:
        """Whether a call of the loop's failed."""
        return int(self.link[fields.STATUS]) > fields.WARNING

    def failure(self, text: str, k: int, time: float, kind: type[FmuFailed] = FmuFailed, fix: str = "") -> FmuFailed:
        """What went wrong with instance k at a time (s), with its last messages."""
        message = f"block {self.component.name} ({self._who(k)}) failed at t = {time:g} s: {text}{self._words(k)}"
        return kind(message, self.component.entry.type.position, fix)

    def _who(self, k: int) -> str:
        """The file, and which member of a fleet."""
        return str(self.fmu.name) + (f", {self.component.fleet} {self.members[k] + 1}" if self.component.fleet else "")

    def _words(self, k: int) -> str:
        """The last messages of an instance."""
        return "".join(f"\n    it says {line}" for line in self.messages[k].last())

    def state(self) -> dict[str, Any]:
        """What the run will have to tell of the instances."""
        return {"link": self.link[list(fields.TOLD)], "messages": [said.state() for said in self.messages]}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Have this to tell, and nothing else. Raises: ValueError where it does not fit."""
        self.link[list(fields.TOLD)] = state["link"]
        for said, before in zip(self.messages, state["messages"], strict=True):
            said.restore(before)

    @property
    def terminated(self) -> bool:
        """Whether an instance asked for the end of the simulation at a communication point."""
        return bool(self.link[fields.ENDED])

    def warnings(self) -> list[CosimError]:
        """What the instances warned of."""
        text = self._warned()
        return [CosimError(f"block {self.component.name} {text}", self.component.entry.type.position)] if text else []

    def _warned(self) -> str:
        """How often instances warned, who did first and when, and with what words."""
        calls, logged = int(self.link[fields.WARNINGS]), sum(m.warnings for m in self.messages)
        if not calls and not logged:
            return ""
        talkers = [k for k, m in enumerate(self.messages) if m.warnings]
        k = int(self.link[fields.WARNED]) - 1 if self.link[fields.WARNED] else talkers[0]
        first = f"first at t = {self._real(fields.WARNED_AT):g} s"
        parts = [f"{_times(calls, 'call')} returned a warning, {first}"] if calls else []
        parts += [f"{_times(logged, 'warning')} logged"] if logged else []
        said = next((self.messages[j].first_warning for j in (k, *talkers) if self.messages[j].warnings), "")
        return f"({self._who(k)}): {'; '.join(parts)}" + (f"\n    it says first: {said}" if said else "")

    def _real(self, word: int) -> float:
        return float(self.link.view(np.float64)[word])

    def termination(self, k: int | None = None) -> Terminated:
        """Who asked for the end of the simulation, and when; k: the instance, if it was within a step."""
        k = int(self.link[fields.ENDED]) - 1 if k is None else k
        time = self._real(fields.ENDED_AT)
        message = f"block {self.component.name} ({self._who(k)}) ended the simulation at t = {time:g} s"
        return Terminated(message + self._words(k), self.component.entry.type.position)

    def ended(self, how: str, hung: bool, time: float) -> FmuFailed:
        """How the process of these instances ended: in the function that was called last, or while loading."""
        k = min(max(int(self.link[fields.INSTANCE]), 0), len(self.members) - 1)
        name = self.name_of(int(self.link[fields.CALLING]))
        where = f" in {name}()" if name else " while its binary was loaded"
        if hung:
            return self.failure(f"{how}{where}", k, time, FmuHung, "where it only is slow, raise `run.patience` (s)")
        return self.failure(f"{how}{where}", k, time, FmuCrashed)


def _times(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"
