"""An FMU alone as a diagram: one block, run as its default experiment says, with every signal recorded.

Inputs keep their start values. What `--set` and `--swap` say lies over it, as over any diagram.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from cosim.authoring.declaration import Declaration
from cosim.authoring.variables import Indicator, Input, Parameter
from cosim.errors import CosimError, DiagramErrors, FmuError, Position, Problems
from cosim.fmu import importer, settings
from cosim.fmu.description import read_description
from cosim.language import diagram as diagrams
from cosim.language.diagram import Diagram
from cosim.language.overlay import Change, apply_settings, apply_swaps
from cosim.language.source import Node

STEPS, MOST_STEPS = 500, 100_000
"""Of a run, where nothing says how long one is to be; with the steps that an FMU takes inside, at most."""
_POSITIVE = ("stepSize", "tolerance", "fixedInternalStepSize")
_INTEGRATOR = "rk4"
"""Of Model Exchange, whose default experiment was not chosen with Euler's method in mind."""


def load(path: Path, given: Iterable[str], swaps: Iterable[str], problems: Problems) -> Diagram:
    """The diagram of an FMU; given as of --set, swaps as of --swap. Mistakes go to `problems`.

    Raises: DiagramErrors where the FMU cannot be read at all.
    """
    return diagrams.build(read(path, given, swaps, problems), [path], problems)


def read(path: Path, given: Iterable[str | Change], swaps: Iterable[str], problems: Problems) -> Node:
    """The tree of that diagram. Raises: as `load`."""
    place = Position(str(path))
    try:
        _, description = read_description(path, place)
        tree = _tree(path, description, place)
    except CosimError as error:
        problems.add(error)
        raise DiagramErrors(problems.errors) from None
    tree = apply_settings(apply_swaps(tree, swaps, problems), given, problems)
    tree = _with_run(tree, description, path, place, problems)
    if problems.errors:
        return tree
    entry = diagrams.build(tree, [path], problems).blocks.get(_name(path))
    if entry is None or entry.kind != "fmu" or problems.errors:
        return tree
    try:
        declaration = importer.block(entry).declaration
    except CosimError:
        return tree  # told as it is wired
    return _with_all(tree, declaration, _name(path), place)


def _name(path: Path) -> str:
    """The block's name: the file's, as far as a block can be called so."""
    name = re.sub(r"[^\w-]", "_", path.stem)
    return name if re.match(r"[^\W\d]", name) else f"fmu_{name}"


def _tree(path: Path, description: Any, place: Position) -> Node:
    """What a person would write. Raises: FmuError for an experiment that makes no sense."""
    experiment = description.defaultExperiment
    start, stop = (_number(experiment, name, path, place) for name in ("startTime", "stopTime"))
    block: dict[str, Any] = {"fmu": str(path)}
    if (tolerance := _number(experiment, "tolerance", path, place)) is not None:
        block["tolerance"] = tolerance
    if start:
        block["start_time"] = start
    run: dict[str, Any] = {}
    if stop is not None and stop > (start or 0.0):
        run["stop"] = stop - (start or 0.0)
    if (step := _number(experiment, "stepSize", path, place)) is not None:
        run["step"] = step
    title = (description.modelName or path.stem) + (f", from {start:g} s of its own time" if start else "")
    return _node({"title": title, "run": run, "blocks": {_name(path): block}}, place)


def _number(holder: Any, name: str, path: Path, place: Position) -> float | None:
    """A number of a part of the description, if that has it. Raises: FmuError where it is none."""
    text = getattr(holder, name, None)
    try:
        number = float(text) if text is not None else None
        if number is not None and (not np.isfinite(number) or (name in _POSITIVE and number <= 0)):
            raise ValueError
    except ValueError:
        raise FmuError(f"`{path.name}`: its {name} cannot be `{text}`", place, "export the FMU again") from None
    return number


def _with_run(tree: Node, description: Any, path: Path, place: Position, problems: Problems) -> Node:
    """The tree with what the default experiment leaves open: a step, an integrator."""
    run, stop = _at(tree, "run"), _at(tree, "run", "stop")
    if run is None or not isinstance(run.value, dict):  # told as it is built
        return tree
    found = dict(run.value)
    if stop is None:
        message = f"`{path.name}` has no default experiment that says when it stops"
        problems.add(FmuError(message, place, "write --stop 10"))
        found["stop"] = stop = Node(1.0, place)
    chosen = _at(tree, "blocks", _name(path), "mode")
    mode = chosen.value if chosen else next(iter(settings.offered_modes(description)), "")
    if "step" not in found:
        stepping = description.coSimulation if mode == settings.CO_SIMULATION else None
        own = problems.attempt(_number, stepping, "fixedInternalStepSize", path, place)
        found["step"] = Node(_step(stop.value, own), place)
    if mode == settings.MODEL_EXCHANGE and "integrator" not in found:
        found["integrator"] = Node(_INTEGRATOR, place)
    return replace(tree, value={**tree.value, "run": replace(run, value=found)})


def _at(tree: Node, *path: str) -> Node | None:
    """What stands at a path, as far as the tree goes."""
    for key in path:
        below = tree.value.get(key) if isinstance(tree.value, dict) else None
        if below is None:
            return None
        tree = below
    return tree


def _step(stop: Any, own: float | None) -> Any:
    """A communication step (s) where nothing says one: the FMU's own, unless those were too many for the run."""
    if isinstance(stop, str):
        return own or f"({stop})/{STEPS}"
    if isinstance(stop, bool) or not isinstance(stop, int | float):
        return 1.0  # told as it is built
    return own if own and stop <= MOST_STEPS * own else stop / STEPS


def _with_all(tree: Node, declaration: Declaration, name: str, place: Position) -> Node:
    """The tree with all signals recorded, unless it says which, and with the start values of inputs as given."""
    sections = dict(tree.value)
    record = dict(sections["record"].value) if "record" in sections else {}
    if "signals" not in record:
        shown = [v for v in declaration.variables.values() if not isinstance(v, (Input, Parameter, Indicator))]
        record["signals"] = _node([f"{name}.{v.name}" for v in shown if v.name and v.name.strip() == v.name], place)
        sections["record"] = Node(record, place)
    blocks = sections["blocks"]
    keys = dict(blocks.value[name].value)
    wired, given = ({*keys[section].value} if section in keys else set() for section in ("inputs", "start"))
    held = {
        v.name: _node(np.asarray(v.start).tolist(), place)
        for v in declaration.of(Input)
        if v.start is not None and v.name not in wired | given and np.all(np.isfinite(v.start))
    }
    if held:
        before = keys["start"].value if "start" in keys else {}
        keys["start"] = Node({**before, **held}, place)
        block = replace(blocks.value[name], value=keys)
        sections["blocks"] = replace(blocks, value={**blocks.value, name: block})
    return replace(tree, value=sections)


def _node(value: Any, place: Position) -> Node:
    if isinstance(value, dict):
        return Node({key: replace(_node(item, place), key_position=place) for key, item in value.items()}, place)
    if isinstance(value, list):
        return Node([_node(item, place) for item in value], place)
    return Node(value, place)
