"""The shared library of an FMU, loaded into this process."""

from __future__ import annotations

import ctypes
import os
import sys
from typing import Any

from cosim.errors import FmuError, Position
from cosim.fmu import archive
from cosim.fmu.fmi import Version
from cosim.fmu.trace import FmuTrace


class Binary:
    """The shared library of an FMU, and the addresses of its functions."""

    def __init__(self, fmu: Any, trace: FmuTrace, place: Position) -> None:
        """trace: where the names of functions are noted; place: of the FMU in the diagram. Raises: FmuError."""
        self._trace = trace
        self._place = place
        self._addresses: dict[str, int] = {}
        self.path = archive.binary(fmu.folder, fmu.interface.modelIdentifier, fmu.version, fmu.name)
        self.version: Version = fmu.version
        try:
            with trace.calling(0, 0):
                self._handle = self._load()
        except OSError as error:
            why = str(error).replace(str(self.path), self.path.relative_to(fmu.folder).as_posix())
            fix = f"export it again for this platform ({self.path.parent.name})"
            raise FmuError(f"`{fmu.name}`: its binary cannot be loaded: {why}", place, fix) from None

    def _load(self) -> ctypes.CDLL:
        if sys.platform != "win32":
            return ctypes.CDLL(str(self.path))
        with os.add_dll_directory(str(self.path.parent)):
            return ctypes.CDLL(str(self.path))

    def address(self, name: str) -> int:
        """The address of a function, without FMI's prefix. Raises: FmuError."""
        address = self.find(name)
        if not address:
            message = f"`{self.path.name}` has no function {self.version.prefix}{name}"
            raise FmuError(message, self._place, "export the FMU again")
        return address

    def find(self, name: str) -> int:
        """The address of a function, 0 where the library has none."""
        if name not in self._addresses:
            full = self.version.prefix + name
            names = (full, f"{self.path.stem}_{full}")  # what is compiled from sources may have the longer one
            function = next((f for f in (getattr(self._handle, n, None) for n in names) if f), None)
            self._addresses[name] = ctypes.cast(function, ctypes.c_void_p).value or 0 if function else 0
            if self._addresses[name]:
                self._trace.name(self._addresses[name], full)
        return self._addresses[name]
