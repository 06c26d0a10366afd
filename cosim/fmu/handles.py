"""The instances that an FMU has made: what is called of them outside the loop, through ctypes."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any

from cosim.fmu import fields, messages
from cosim.fmu.binary import Binary
from cosim.fmu.fmi import NewInstance
from cosim.fmu.trace import FmuTrace
from cosim.machine.memory import invoke

_SHOWN = 5


class Handles:
    """Instances by number, from 0. made: their addresses. lost: those that failed, with their status."""

    def __init__(self, binary: Binary, trace: FmuTrace) -> None:
        self.made: list[int] = []
        self.lost: dict[int, int] = {}
        self._binary = binary
        self._trace = trace
        self._kept: list[Any] = []

    def make(self, new: NewInstance) -> None:
        """Have one more made. Raises: FmuError, FmuFailed."""
        k = len(self.made)
        name, arguments = self._binary.version.instantiation(new)
        self._kept.append(arguments)
        address = self._binary.address(name)
        function = ctypes.CFUNCTYPE(ctypes.c_void_p, *map(type, arguments))(address)
        with self._trace.calling(k, address):
            handle = function(*arguments)
        if not handle:
            text = f"{self._binary.version.prefix}Instantiate() gave no instance"
            off = f"where it cannot do event mode, --set blocks.{self._trace.component.name}.event_mode=off"
            fix = off if new.kind == fields.EVENT_CO_SIMULATION else ""
            raise self._trace.failure(text, k, 0.0, fix=fix)
        self.made.append(handle)

    def call(self, k: int, name: str, *arguments: float, about: str = "", time: float = 0.0) -> None:
        """Call a function of instance k; about: the variables that it is for; time: that of the run (s).

        Raises: FmuError, FmuFailed.
        """
        status = self.ask(k, name, *arguments)
        link = self._trace.link
        if status == fields.WARNING:
            link[fields.WARNINGS] += 1
            link[fields.WARNED] = link[fields.WARNED] or k + 1
        elif status != fields.OK:
            self.lost[k] = status
            function = f"{self._binary.version.prefix}{name}"
            raise self._trace.failure(returned(function, about, status), k, time)

    def ask(self, k: int, name: str, *arguments: float) -> int:
        """Call a function of instance k. Returns its status. Raises: FmuError."""
        address = self._binary.address(name)
        with self._trace.calling(k, address):
            return invoke(address, (self.made[k], *arguments))

    def free(self, terminate: bool) -> None:
        """Terminate (if they were initialized) and free all, as far as their state allows."""
        if fields.FATAL in self.lost.values():
            return  # nothing may be called any more
        for k, handle in enumerate(self.made):
            if terminate and self.lost.get(k, fields.OK) <= fields.DISCARD:
                self.ask(k, "Terminate")
            address = self._binary.address("FreeInstance")
            with self._trace.calling(k, address):
                ctypes.CFUNCTYPE(None, ctypes.c_void_p)(address)(handle)


def returned(function: str, about: str, status: int) -> str:
    """What to say of a function that failed; about: the variables that it was for, if any."""
    names = messages.STATUS
    status_name = f"`{names[status]}`" if 0 <= status < len(names) else f"the unknown status {status}"
    on = f" for {about}" if about else ""
    return f"{function}(){on} returned {status_name}"


def listed(names: Sequence[str]) -> str:
    """Some of the names of variables."""
    more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    return ", ".join(f"`{name}`" for name in names[:_SHOWN]) + more
