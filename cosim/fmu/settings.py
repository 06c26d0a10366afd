"""How a diagram wants an FMU to be run: what stands in its entry, checked against what the FMU offers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from cosim.errors import FmuError, WrongValue, nearest
from cosim.fmu import messages
from cosim.fmu.fmi import Experiment
from cosim.language.entry import BlockEntry
from cosim.language.keys import BLOCK, MODES
from cosim.language.source import Node
from cosim.machine import supervision

CO_SIMULATION, MODEL_EXCHANGE = MODES


@dataclass(frozen=True)
class FmuSettings:
    """See `cosim keys blocks`.

    categories: of messages to be logged, none for all of them where `logging`. log_file: with its place.
    """

    mode: str = CO_SIMULATION
    event_mode: bool = False
    tolerance: float | None = None
    start_time: float = 0.0
    logging: bool = True
    categories: tuple[str, ...] = ()
    log_file: Node | None = None
    isolated: bool = False

    @property
    def experiment(self) -> Experiment:
        """What FMI's functions take: whether there is a tolerance, it, the start time, and no stop time."""
        return int(self.tolerance is not None), self.tolerance or 0.0, self.start_time, 0, 0.0


def read(entry: BlockEntry, description: Any) -> FmuSettings:
    """The settings of an entry. Raises: FmuError, WrongValue."""
    given = {key: node.value for key, node in entry.settings.items()}
    mode = _mode(entry, description)
    logging, categories = _logged(entry, description)
    if given.get("isolate") and not supervision.AVAILABLE:
        message = f"block {entry.name}: a process of its own needs fork, which this operating system lacks"
        raise FmuError(message, entry.settings["isolate"].position, "remove `isolate`")
    if "log_file" in given and not messages.CAN_WRITE:
        message = f"block {entry.name}: messages cannot be written to a file on this operating system"
        raise FmuError(message, entry.settings["log_file"].position, "remove `log_file`")
    return FmuSettings(
        mode=mode,
        event_mode=_event_mode(entry, description, mode),
        tolerance=given.get("tolerance"),
        start_time=given.get("start_time", BLOCK["start_time"].default),
        logging=logging,
        categories=categories,
        log_file=entry.settings.get("log_file"),
        isolated=bool(given.get("isolate")),
    )


def offered_modes(description: Any) -> list[str]:
    """Of MODES those that an FMU is made for."""
    kinds = dict(zip(MODES, (description.coSimulation, description.modelExchange), strict=True))
    return [mode for mode, kind in kinds.items() if kind is not None]


def _mode(entry: BlockEntry, description: Any) -> str:
    """The entry's own choice, else Co-Simulation where there is one. Raises: FmuError."""
    offered = offered_modes(description)
    if not offered:
        message = f"`{entry.path.name}` is made for scheduled execution only, which cannot be run here"
        raise FmuError(message, entry.type.position, "export it for co-simulation or model exchange")
    chosen = entry.settings.get("mode")
    if chosen and chosen.value not in offered:
        message = f"`{entry.path.name}` is not made for {chosen.value}"
        raise FmuError(message, chosen.position, f"write mode: {offered[0]}")
    return str(chosen.value) if chosen else offered[0]


def _event_mode(entry: BlockEntry, description: Any, mode: str) -> bool:
    """Whether Co-Simulation goes through Event Mode. Raises: WrongValue where there is none."""
    chosen = entry.settings.get("event_mode")
    able = mode == CO_SIMULATION and bool(description.coSimulation.hasEventMode)
    if chosen and chosen.value == "on" and not able:
        why = "model exchange always has one" if mode == MODEL_EXCHANGE else "its description declares none"
        message = f"block {entry.name}: `{entry.path.name}` has no event mode in co-simulation to switch on: {why}"
        raise WrongValue(message, chosen.position, "remove `event_mode`")
    return able and not (chosen and chosen.value == "off")


def _logged(entry: BlockEntry, description: Any) -> tuple[bool, tuple[str, ...]]:
    """Whether to switch logging on, and for which categories. Raises: WrongValue."""
    known = [c.name for c in description.logCategories if c.name]
    chosen = entry.settings.get("log")
    if chosen is None or chosen.value == BLOCK["log"].default:
        return _of_errors(known)
    if not isinstance(chosen.value, list):
        return chosen.value == "all", ()
    for node in chosen.value:
        if node.value not in known:
            message = f"block {entry.name}: `{entry.path.name}` has no log category `{node.value}`"
            raise WrongValue(message, node.position, nearest(node.value, known) or "write log: all")
    return True, tuple(node.value for node in chosen.value)


def _of_errors(names: list[str]) -> tuple[bool, tuple[str, ...]]:
    """The categories of what goes wrong, where others would be noise."""
    telling = [n for n in names if any(w in n.lower() for w in ("error", "fatal", "warning", "discard"))]
    noisy = {*names} - {*telling} - {"logAll"}
    return bool(telling) or not names, tuple(telling) if noisy else ()
