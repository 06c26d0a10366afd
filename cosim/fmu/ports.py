"""The variables of a model description as ports: FMI 2's scalars gathered into arrays, FMI 3's arrays as they are.

Each has the type that the framework sees, and the way its values travel.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np

from cosim.errors import CosimError, FmuError
from cosim.fmu import versions
from cosim.language import units

MOST_ELEMENTS = 10_000_000
_LARGEST_REFERENCE = 2**32 - 1


@dataclass(frozen=True)
class Port:
    """One variable as we see it. members: the FMU's variables behind it, in row-major order (one for FMI 3)."""

    name: str
    members: tuple[Any, ...]
    shape: tuple[int, ...]
    dtype: np.dtype
    code: int
    accessor: str

    @property
    def first(self) -> Any:
        """The first of the FMU's variables; all agree in type, causality and variability."""
        return self.members[0]

    @property
    def causality(self) -> str:
        """FMI's."""
        causality: str = self.first.causality
        return causality

    @property
    def is_string(self) -> bool:
        """Whether it is text, which parameters only can be."""
        return self.dtype == object

    @property
    def is_discrete(self) -> bool:
        """Whether it may change at events only."""
        return bool(self.first.variability == "discrete")

    @property
    def can_start(self) -> bool:
        """Whether its start value may be set."""
        return self.first.initial in ("exact", "approx") and self.first.variability != "constant"

    @property
    def references(self) -> list[int]:
        """The value references."""
        return [member.valueReference for member in self.members]

    @property
    def size(self) -> int:
        """The number of values."""
        return prod(self.shape)

    @property
    def member_size(self) -> int:
        """The number of values of each of the FMU's variables."""
        return self.size // len(self.members)

    def start(self) -> Any:
        """The start value that the description gives, as nested lists; None without one."""
        texts = [member.start for member in self.members]
        if any(text is None for text in texts):
            return None
        if self.is_string:
            return texts[0]
        values = [self._number(word) for text in texts for word in text.split()]
        if len(values) == 1:
            return values[0]
        return np.array(values, self.dtype).reshape(self.shape).tolist() if len(values) == self.size else None

    def _number(self, text: str) -> Any:
        """Raises: FmuError where it is no value of the variable's type."""
        try:
            if self.dtype == np.bool_:
                return {"true": True, "1": True, "false": False, "0": False}[text]
            if self.dtype.kind == "f":
                return float(text)
            number = int(text)
            np.array(number, self.dtype)
        except (KeyError, ValueError, OverflowError):
            message = f"the start value `{text}` of its variable `{self.name}` is no {self.first.type}"
            raise FmuError(message, fix="export the FMU again") from None
        return number

    def unit(self) -> units.Unit:
        """Its unit, or units along the first axis; None without one, or where it is no unit that we can read."""
        names = [_unit(member) for member in self.members]
        if all(name == names[0] for name in names):
            return names[0]
        return tuple(str(name or "1") for name in names) if len(self.shape) == 1 else None


def _unit(member: Any) -> str | None:
    declared = member.declaredType.unit if member.declaredType is not None else None
    name = member.unit or declared
    try:
        return name if name is not None and units.base(name) else None
    except CosimError:
        return None


def ports(description: Any) -> dict[str, Port]:
    """The ports of a model description by name. Raises: FmuError where sizes make no sense."""
    _check_references(description.modelVariables)
    version = versions.find(description.fmiVersion)
    usable = [v for v in description.modelVariables if _is_usable(v, version.types)]
    found = {}
    for name, (members, shape) in version.groups(usable).items():
        dtype, code, accessor = version.types[members[0].type]
        if prod(shape) > MOST_ELEMENTS or any(size < 1 for size in shape):
            raise FmuError(f"its variable `{name}` has the size {shape}", fix="export the FMU again")
        if np.dtype(dtype) == object and shape:
            continue
        found[name] = Port(name, members, shape, np.dtype(dtype), code, accessor)
    return found


def _check_references(variables: Any) -> None:
    """Raises: FmuError for a value reference that is none, naming the first."""
    for variable in variables:
        if not 0 <= variable.valueReference <= _LARGEST_REFERENCE:
            message = f"its variable `{variable.name}` has the value reference {variable.valueReference}"
            raise FmuError(f"{message}, which is no unsigned number of 32 bits", fix="export the FMU again")


def _is_usable(variable: Any, types: dict[str, Any]) -> bool:
    """Whether a variable can be a port: no clocks, no binary data, no aliases, no structural parameters."""
    if variable.type not in types or variable.alias is not None or variable.clocks:
        return False
    if variable.causality in ("independent", "structuralParameter"):
        return False
    return variable.type != "String" or (variable.causality == "parameter" and not variable.shape)
