"""How sure one metric or recorded signal is, as the certificate has it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from cosim.accuracy.limit import Limit

AGREES, CHANGES = "agrees", "changes"
"""What a figure does that is counted, not measured: it is the same at all steps, or it depends on them."""


@dataclass(frozen=True)
class ErrorPart:
    """The error of coupling or of integration alone, as a guess with its sign where `signed`; else how large it may be.

    kind, order: as of `Fall`.
    """

    error: float
    kind: str
    order: float | None = None
    signed: bool = False

    def as_json(self) -> dict[str, Any]:
        """For JSON."""
        return {"error": self.error, "signed": self.signed, "kind": self.kind, "order": self.order}


@dataclass
class Accuracy:
    """How sure a metric or a recorded signal is.

    kind, order: as of `Fall`, or AGREES or CHANGES. values: of a metric at the steps h, h/2 and h/4. errors: by how
    much it may be off at these, nothing where nobody can say; of an array that of its worst element, of a signal the
    largest along the run. size: of the value, or of the signal's range. limits: of each element of a metric. said: how
    it depends on the step, or why it has no order. largest_step: that keeps the wanted error (s), or None.
    """

    kind: str
    order: float | None = None
    unit: str = ""
    values: tuple[Any, ...] = ()
    errors: tuple[float, ...] = ()
    size: float = 0.0
    limits: Mapping[int, Limit] = field(default_factory=dict)
    coupling: ErrorPart | None = None
    integration: ErrorPart | None = None
    said: str = ""
    wanted: float | None = None
    largest_step: float | None = None

    @property
    def error(self) -> float | None:
        """By how much the value at the diagram's step may be off."""
        return self.errors[0] if self.errors else None

    @property
    def relative(self) -> float | None:
        """The error beside the size of the value, or beside the range of the signal."""
        return self.errors[0] / self.size if self.errors and self.size else None

    def as_json(self) -> dict[str, Any]:
        """For JSON: what is known of it."""
        content: dict[str, Any] = {"kind": self.kind, "error": self.error, "relative": self.relative}
        content |= {"order": self.order, "unit": self.unit}
        if self.values:
            content["values"] = list(self.values)
        if self.errors:
            content["errors"] = list(self.errors)
        if len(self.limits) == 1 and 0 in self.limits:
            content["interval"] = [self.limits[0].low, self.limits[0].high]
        for name in ("coupling", "integration"):
            if part := getattr(self, name):
                content[name] = part.as_json()
        if self.said:
            content["said"] = self.said
        if self.wanted is not None:
            content |= {"wanted": self.wanted, "largest_step": self.largest_step}
        return content
