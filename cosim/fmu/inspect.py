"""What a person wants to know of an FMU file: `cosim fmu FILE`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from cosim.errors import FmuError
from cosim.fmu import archive, c_sources, fields, versions
from cosim.fmu.description import read_description
from cosim.fmu.imported import Fmu
from cosim.fmu.ports import Port, ports
from cosim.fmu.settings import FmuSettings
from cosim.fmu.structure import dependencies as read_dependencies
from cosim.language.keys import MODES

_SECTIONS = ("input", "output", "parameter", "calculatedParameter", "local")
_CAPABILITIES = {
    "canBeInstantiatedOnlyOncePerProcess": "one instance a process",
    "needsExecutionTool": "needs the tool that made it",
    "canHandleVariableCommunicationStepSize": "takes steps of any size",
    "canGetAndSetFMUstate": "state can be saved",
    "canSerializeFMUstate": "state can be serialised",
    "providesDirectionalDerivative": "directional derivatives",
    "hasEventMode": "event mode (direct feedthrough without delay)",
    "mightReturnEarlyFromDoStep": "may return early from a step",
    "needsCompletedIntegratorStep": "wants to know of completed steps",
}


def text(path: Path, most: int = 200) -> str:
    """Kinds, platforms, capabilities, variables as ports (at most so many a section), and what validation finds.

    Raises: MissingFile, ArchiveError, FmuError.
    """
    folder, description = read_description(path)
    try:
        return "\n".join(_lines(path, folder, description, most))
    except FmuError as error:
        raise FmuError(f"`{path.name}`: {error.message}", fix=error.fix) from None


def _lines(path: Path, folder: Path, description: Any, most: int) -> Iterator[str]:
    by = f" by {description.generationTool}" if description.generationTool else ""
    yield f"{path.name}: {description.modelName}, FMI {description.fmiVersion}{by}"
    if description.description:
        yield description.description
    yield ""
    kinds = dict(zip(MODES, (description.coSimulation, description.modelExchange), strict=True))
    for mode, kind in {**kinds, "scheduled execution (cannot be run here)": description.scheduledExecution}.items():
        if kind is not None:
            able = [text for name, text in _CAPABILITIES.items() if getattr(kind, name, False)]
            yield f"kind      {mode}" + (f": {', '.join(able)}" if able else "")
    states, indicators = description.numberOfContinuousStates, description.numberOfEventIndicators
    if description.modelExchange is not None:
        yield f"          {states} continuous states, {indicators} event indicators"
    yield f"platforms {', '.join(archive.binaries(folder)) or 'none'}{_runs_here(folder, description)}"
    yield from _variables(path, folder, description, kinds, most)
    problems = _problems(folder)
    yield ""
    yield "validation finds no problem" if not problems else f"validation finds {len(problems)} problems:"
    yield from (f"  {problem}" for problem in problems)


def _runs_here(folder: Path, description: Any) -> str:
    kind = description.coSimulation or description.modelExchange
    if kind is None:
        return ""
    binary = folder, kind.modelIdentifier, versions.find(description.fmiVersion)
    if archive.found_binary(*binary) is not None:
        return " (runs here)"
    if c_sources.build_description(*binary)[0]:
        return "; no binary for this machine: compiled from its C sources as it is run"
    return " (not for this machine)"


def _variables(path: Path, folder: Path, description: Any, kinds: dict[str, Any], most: int) -> Iterator[str]:
    found = ports(description)
    mode = next((mode for mode, kind in kinds.items() if kind is not None), None)
    eventful = mode == MODES[0] and bool(kinds[mode].hasEventMode)
    fmu = Fmu(path, folder, description, FmuSettings(mode or MODES[0], eventful), found)
    feeds = read_dependencies(fmu, description.outputs)
    delayed = mode is not None and fmu.kind == fields.CO_SIMULATION
    for causality in _SECTIONS:
        section = {name: port for name, port in found.items() if port.causality == causality}
        if not section:
            continue
        yield f"\n{causality}s:"
        width = max(len(_shaped(n, p)) for n, p in list(section.items())[:most])
        for name, port in list(section.items())[:most]:
            parts = [_shaped(name, port).ljust(width), port.first.type]
            parts += [f"[{_unit(port)}]"] if port.unit() else []
            parts += [f"start {_start(port)}"] if port.start() is not None else []
            if causality == "output" and feeds.get(name):
                parts.append(f"← {', '.join(sorted(feeds[name] or ()))}" + (" (one step later)" if delayed else ""))
            parts += [f"— {port.first.description}"] if port.first.description else []
            yield "  " + "  ".join(parts)
        if len(section) > most:
            yield f"  … and {len(section) - most} more"
    hidden = len(description.modelVariables) - sum(len(port.members) for port in found.values())
    if hidden > 1:
        yield f"\n{hidden} variables are no ports (clocks, binary data, aliases, texts that are no parameters)"


def _shaped(name: str, port: Port) -> str:
    return name + (f"({', '.join(map(str, port.shape))})" if port.shape else "")


def _unit(port: Port) -> str:
    unit = port.unit()
    return ", ".join(unit) if isinstance(unit, tuple) else str(unit)


def _start(port: Port) -> str:
    start = np.asarray(port.start())
    return repr(start.item()) if start.ndim == 0 else f"{start.size} values" if start.size > 6 else str(start.tolist())


def _problems(folder: Path) -> list[str]:
    from fmpy.validation import validate_fmu

    return list(validate_fmu(str(folder)))
