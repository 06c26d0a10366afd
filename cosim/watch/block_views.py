"""What the page shows of a block that is clicked: its ports, wires and parameters."""

from __future__ import annotations

from collections.abc import Container
from typing import Any

import numpy as np

from cosim.authoring.variables import Input, Parameter, State, Variable
from cosim.results.formatting import format_value
from cosim.watch.orders import View
from cosim.wiring.network import Component, Network, Signal
from cosim.wiring.overview import ComponentOverview, Overview

SHOWN = 6
"""Elements of a value; of more, the first are shown."""


def views(network: Network, overview: Overview, names: Container[str]) -> dict[str, View]:
    """Of the blocks with these names; blocks of a diagram inside the diagram are called `outer/inner`."""
    recordable = {*network.signals()}
    wanted = [part for part in overview.parts if part.name in names]
    return {part.name: _view(network.components[part.name], part, recordable) for part in wanted}


def _view(component: Component, part: ComponentOverview, recordable: set[Signal]) -> View:
    variables = component.declaration.variables.values()
    sources = {wire.port: wire.constant or ", ".join(wire.sources) for wire in part.wires}
    inputs = [v for v in variables if isinstance(v, Input)]
    others = [
        v for v in variables if Signal(component.name, v.name) in recordable and not isinstance(v, Input | Parameter)
    ]
    others.sort(key=lambda variable: variable.causality != "output")
    return {
        "name": part.name,
        "type": part.type,
        "count": part.count or 0,
        "due": part.due,
        "about": component.declaration.doc.split("\n\n")[0],
        "expressions": list(part.expressions),
        "inputs": [_port(component, v) | {"source": _source(component, v, sources)} for v in inputs],
        "signals": [_port(component, v) | {"signal": f"{component.name}.{v.name}"} for v in others],
        "parameters": [
            _port(component, v) | {"value": text_of(component.values[v.name], per_member=component.fleet is not None)}
            for v in variables
            if isinstance(v, Parameter) and v.name in component.values
        ],
    }


def _port(component: Component, variable: Variable) -> View:
    shape = component.shape(variable) if component.signal_axes(variable) is not None else ()
    units = variable.unit if isinstance(variable.unit, tuple) else (variable.unit or "",)
    unit = ", ".join(dict.fromkeys(units))
    kind = "state" if isinstance(variable, State) else variable.causality
    return {
        "name": variable.name,
        "kind": kind,
        "shape": "×".join(map(str, shape)),
        "unit": "" if unit == "1" else unit,
        "about": variable.description,
    }


def _source(component: Component, variable: Input, sources: dict[str, str]) -> str:
    """Where an input comes from, or the value that it holds."""
    if variable.name in sources:
        return sources[variable.name]
    return text_of(component.values[variable.name], per_member=True) if variable.name in component.values else ""


def text_of(values: np.ndarray, per_member: bool) -> str:
    """Some numbers as text; those of several members, each its own, where they differ."""
    if len(values) == 1 or (per_member and len(values) and bool(np.all(values == values[:1]))):
        values = values[0]
    plain: list[Any] = np.asarray(values).ravel()[: SHOWN + 1].tolist()
    return format_value(plain if np.ndim(values) else plain[0])
