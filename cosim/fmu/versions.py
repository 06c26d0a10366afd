"""The versions of FMI that can be run and written."""

from __future__ import annotations

from cosim.fmu.fmi import Version
from cosim.fmu.fmi2 import Fmi2
from cosim.fmu.fmi3 import Fmi3

FMI2, FMI3 = Fmi2(), Fmi3()
VERSIONS: tuple[Version, ...] = (FMI2, FMI3)


def find(name: str) -> Version:
    """The version that a model description calls so. Raises: LookupError where it is none of these."""
    for version in VERSIONS:
        if version.reads(name):
            return version
    raise LookupError(name)
