"""What a person wants to know of an FMU file: `cosim fmu FILE`."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from cosim.errors import FmuError
from cosim.fmu import archive, c_sources, capabilities, fields, settings, versions
from cosim.fmu.description import read_description
from cosim.fmu.imported import Fmu
from cosim.fmu.ports import IS_TIME, Port, hidden, ports
from cosim.fmu.settings import FmuSettings
from cosim.fmu.structure import dependencies as read_dependencies

_SECTIONS = ("input", "output", "parameter", "calculatedParameter", "local")


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
    for kind, able in capabilities.read(folder, versions.find(description.fmiVersion).number).items():
        yield f"kind      {kind}" + (f": {', '.join(able)}" if able else "")
    states, indicators = description.numberOfContinuousStates, description.numberOfEventIndicators
    if description.modelExchange is not None:
        yield f"          {states} continuous states, {indicators} event indicators"
    yield f"platforms {', '.join(archive.binaries(folder)) or 'none'}{_runs_here(folder, description)}"
    if experiment := _experiment(description.defaultExperiment):
        yield f"run       {experiment}"
    if categories := [c.name for c in description.logCategories if c.name]:
        yield f"log       {', '.join(categories)}"
    yield from _enumerations(description)
    yield from _variables(path, folder, description, most)
    problems = _problems(folder, description)
    yield ""
    found = f"validation finds {len(problems)} problem{'s' if len(problems) > 1 else ''}:"
    yield found if problems else "validation finds no problem"
    yield from (f"  {problem}" for problem in problems)


def _experiment(given: Any) -> str:
    """The default experiment in words."""
    words = {
        "startTime": "from {} s",
        "stopTime": "to {} s",
        "stepSize": "in steps of {} s",
        "tolerance": "tolerance {}",
    }
    return ", ".join(text.format(value) for name, text in words.items() if (value := getattr(given, name, None)))


def _enumerations(description: Any) -> Iterator[str]:
    """The enumerations that variables have, with their items."""
    used = {id(v.declaredType): v.declaredType for v in description.modelVariables if v.type == "Enumeration"}
    types = [declared for declared in used.values() if declared is not None]
    if types:
        yield "\nenumerations:"
    for declared in types:
        rows = [f"{i.name} = {i.value}" + (f" ({i.description})" if i.description else "") for i in declared.items]
        yield f"  {declared.name}: {', '.join(rows)}"


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


def _variables(path: Path, folder: Path, description: Any, most: int) -> Iterator[str]:
    found = ports(description)
    mode = next(iter(settings.offered_modes(description)), "")
    eventful = mode == settings.CO_SIMULATION and bool(description.coSimulation.hasEventMode)
    fmu = Fmu(path, folder, description, FmuSettings(mode or settings.CO_SIMULATION, eventful), found)
    feeds = read_dependencies(fmu, description.outputs)
    delayed = bool(mode) and fmu.kind == fields.CO_SIMULATION
    for causality in _SECTIONS:
        section = {name: port for name, port in found.items() if port.causality == causality}
        if not section:
            continue
        yield f"\n{causality}s:"
        width = max(len(_shaped(n, p)) for n, p in list(section.items())[:most])
        for name, port in list(section.items())[:most]:
            fed = sorted(feeds.get(name) or ()) if causality == "output" else []
            yield "  " + "  ".join(_words(name, port, width, fed, delayed))
        if len(section) > most:
            yield f"  … and {len(section) - most} more"
    left = {name: why for name, why in hidden(description, found).items() if why != IS_TIME}
    if left:
        shown = [f"{name} {why}" for name, why in list(left.items())[:most]]
        more = f"; and {len(left) - most} more" if len(left) > most else ""
        yield f"\nno ports: {'; '.join(shown)}{more}"


def _words(name: str, port: Port, width: int, fed: list[str], delayed: bool) -> Iterator[str]:
    """What there is to say of a variable; fed: the inputs that it depends on at the same instant."""
    declared = port.first.declaredType if port.items() else None
    yield _shaped(name, port).ljust(width)
    yield port.first.type + (f" {declared.name}" if declared is not None else "")
    if port.is_structural:
        yield "structural"
    if port.is_text and port.first.causality == "input":
        yield "an input by FMI, set once"
    if port.unit():
        yield f"[{_unit(port)}]"
    if port.start() is not None:
        yield f"start {_start(port)}"
    if port.first.alias is not None:
        yield f"= {port.first.alias.name}"
    if fed:
        yield f"← {', '.join(fed)}" + (" (one step later)" if delayed else "")
    if port.first.description:
        yield f"— {port.first.description}"


def _shaped(name: str, port: Port) -> str:
    return name + (f"({', '.join(map(str, port.shape))})" if port.shape else "")


def _unit(port: Port) -> str:
    unit = port.unit()
    return ", ".join(unit) if isinstance(unit, tuple) else str(unit)


def _start(port: Port) -> str:
    start = np.asarray(port.start())
    names = {number: name for name, number in port.items().items()}
    if start.ndim == 0 and start.item() in names:
        return names[start.item()]
    return repr(start.item()) if start.ndim == 0 else f"{start.size} values" if start.size > 6 else str(start.tolist())


def _problems(folder: Path, description: Any) -> list[str]:
    """What FMPy finds, but for aliases that it misses in the model structure, where variables stand once."""
    from fmpy.validation import validate_fmu

    aliases = {v.name for v in description.modelVariables if v.alias is not None}
    return [problem for problem in validate_fmu(str(folder)) if not _misses(problem, aliases)]


def _misses(problem: str, names: set[str]) -> bool:
    """Whether a problem is that these names are missing in a set, and nothing else."""
    match = re.search(r"Expected \{(.*)\} but was \{(.*)\}", problem)
    expected, there = (set(match[k].split(", ")) for k in (1, 2)) if match else (set[str](), set[str]())
    return expected != there and expected - names == there - names
