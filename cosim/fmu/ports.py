"""The variables of a model description as ports: FMI 2's scalars gathered into arrays, FMI 3's arrays as they are.

Each has the type that the framework sees, and the way its values travel. Texts and binary data are no signals: they are
parameters here, also where FMI calls them inputs.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np

from cosim.errors import CosimError, FmuError
from cosim.fmu import versions
from cosim.language import units

MOST_ELEMENTS = 10_000_000
IS_TIME = "is the time"
_LARGEST_REFERENCE = 2**32 - 1


@dataclass(frozen=True)
class Port:
    """One variable as we see it.

    members: the FMU's variables behind it, in row-major order (one for FMI 3). resized: whether the diagram gives it
    another shape than the description's start value has.
    """

    name: str
    members: tuple[Any, ...]
    shape: tuple[int, ...]
    dtype: np.dtype
    code: int
    accessor: str
    resized: bool = False

    @property
    def first(self) -> Any:
        """The first of the FMU's variables; all agree in type, causality and variability."""
        return self.members[0]

    @property
    def causality(self) -> str:
        """As a diagram sees it."""
        fmi: str = self.first.causality
        return "parameter" if self.is_structural or (self.is_text and fmi == "input") else fmi

    @property
    def is_structural(self) -> bool:
        """Whether shapes of ports follow from it."""
        return bool(self.first.causality == "structuralParameter")

    @property
    def is_text(self) -> bool:
        """Whether it is text, or binary data written as one, which parameters only can be."""
        return self.dtype == object

    @property
    def is_binary(self) -> bool:
        """Whether it is binary data, which is written in hexadecimal digits."""
        return bool(self.first.type == "Binary")

    @property
    def is_discrete(self) -> bool:
        """Whether it may change at events only."""
        return bool(self.first.variability == "discrete")

    @property
    def is_calculated(self) -> bool:
        """Whether the FMU calculates where it starts."""
        return any(member.initial == "calculated" for member in self.members)

    @property
    def can_start(self) -> bool:
        """Whether its start value may be set."""
        exact = all(member.initial in ("exact", "approx") for member in self.members)
        return exact and self.first.variability != "constant"

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

    def items(self) -> dict[str, int]:
        """The items of an enumeration by name; none of anything else. Raises: FmuError where one has no number."""
        declared = self.first.declaredType
        try:
            return {item.name: int(item.value) for item in declared.items} if declared is not None else {}
        except (TypeError, ValueError):
            message = f"an item of `{declared.name}`, the type of its variable `{self.name}`, has no number"
            raise FmuError(message, fix="export the FMU again") from None

    def start(self) -> Any:
        """The start value that the description gives, as nested lists; None without one."""
        starts = [member.start for member in self.members]
        if self.resized or any(start is None for start in starts):
            return None
        if self.is_text:
            values: list[Any] = [text for start in starts for text in (start if isinstance(start, list) else [start])]
        else:
            values = [self._number(word) for text in starts for word in text.split()]
        if len(values) == 1:
            return values[0]
        return np.array(values, self.dtype).reshape(self.shape).tolist() if len(values) == self.size else None

    def encoded(self, text: str) -> bytes:
        """A text as the FMU takes it. Raises: ValueError for binary data that are not written in pairs of digits."""
        return bytes.fromhex(text) if self.is_binary else text.encode()

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


def ports(description: Any, sizes: Mapping[str, int] | None = None) -> dict[str, Port]:
    """The ports of a model description by name; sizes: what the diagram gives structural parameters.

    Raises: FmuError where sizes make no sense.
    """
    _check_references(description.modelVariables)
    version = versions.find(description.fmiVersion)
    usable = [v for v in description.modelVariables if not why_unusable(v)]
    _check_names(usable)
    found = {}
    for name, (members, given_shape) in version.groups(usable).items():
        dtype, code, accessor = version.types[members[0].type]
        shape = _shape(members[0], sizes or {}) if members[0].dimensions else given_shape
        if prod(shape) > MOST_ELEMENTS or any(size < (0 if sizes else 1) for size in shape):
            raise FmuError(f"its variable `{name}` has the size {shape}", fix="export the FMU again")
        if prod(shape):
            found[name] = Port(name, members, shape, np.dtype(dtype), code, accessor, shape != given_shape)
    return found


def _shape(variable: Any, sizes: Mapping[str, int]) -> tuple[int, ...]:
    """The shape of FMI 3's array."""
    return tuple(
        d.start if d.variable is None else sizes.get(d.variable.name, int(d.variable.start))
        for d in variable.dimensions
    )


def _check_references(variables: Any) -> None:
    """Raises: FmuError for a value reference that is none, naming the first."""
    for variable in variables:
        if not 0 <= variable.valueReference <= _LARGEST_REFERENCE:
            message = f"its variable `{variable.name}` has the value reference {variable.valueReference}"
            raise FmuError(f"{message}, which is no unsigned number of 32 bits", fix="export the FMU again")


def _check_names(variables: Any) -> None:
    """Raises: FmuError for a name that two variables have, so that nobody knows whose values are meant."""
    for name, times in Counter(variable.name for variable in variables).items():
        if times > 1:
            raise FmuError(f"{times} of its variables are called `{name}`", fix="export the FMU again")


def why_unusable(variable: Any) -> str:
    """Why a variable cannot be a port; "" if it can."""
    if variable.type == "Clock":
        return "is a clock"
    if variable.clocks:
        return "belongs to a clock"
    if variable.causality == "independent":
        return IS_TIME
    if variable.type in ("String", "Binary") and variable.causality not in ("parameter", "input"):
        return f"is {'text' if variable.type == 'String' else 'binary data'}, which is no signal"
    return ""


def hidden(description: Any, found: Mapping[str, Port]) -> dict[str, str]:
    """Why the variables are no ports that are not among those found."""
    ours = {member.name for port in found.values() for member in port.members}
    return {v.name: why_unusable(v) or "has no elements" for v in description.modelVariables if v.name not in ours}
