"""An FMU as a diagram uses it: what its description says, with the diagram's settings and names."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cosim.fmu import fields, settings, versions
from cosim.fmu.fmi import Version
from cosim.fmu.ports import Port
from cosim.fmu.settings import FmuSettings


@dataclass
class Fmu:
    """An FMU as a diagram uses it.

    ports: by our names. hidden: why other variables of the FMU are no ports. states: (port, element) of each continuous
    state, in the FMU's order. indicators: the number of event indicators.
    """

    path: Path
    folder: Path
    description: Any
    settings: FmuSettings
    ports: dict[str, Port]
    hidden: dict[str, str] = field(default_factory=dict)
    states: list[tuple[str, int]] = field(default_factory=list)
    indicators: int = 0
    inputs_of: dict[str, frozenset[str] | None] = field(default_factory=dict)  # None: not stated
    initial_inputs_of: dict[str, frozenset[str] | None] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """The file's name."""
        return self.path.name

    @property
    def version(self) -> Version:
        """FMI's version."""
        return versions.find(self.description.fmiVersion)

    @property
    def interface(self) -> Any:
        """What the description says of the kind that is used."""
        mode, description = self.settings.mode, self.description
        return description.coSimulation if mode == settings.CO_SIMULATION else description.modelExchange

    @property
    def kind(self) -> int:
        """The adapter's name for the kind."""
        if self.settings.mode == settings.MODEL_EXCHANGE:
            return fields.MODEL_EXCHANGE
        return fields.EVENT_CO_SIMULATION if self.settings.event_mode else fields.CO_SIMULATION
