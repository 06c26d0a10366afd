"""Which parameters of a diagram have sliders, between which values, and what to write to keep what one says."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from cosim.authoring.variables import Parameter
from cosim.language import source
from cosim.language.source import Node
from cosim.watch.orders import View
from cosim.wiring.network import Component, Network

MOST_ELEMENTS = 24
"""Of a parameter that is a list, with a slider each."""


def views(network: Network) -> list[View]:
    """The parameters that are finite numbers, and elements of short lists of them."""
    found = [view for component in network.components.values() for view in _of(component)]
    return [view for view in found if math.isfinite(view["value"])]


def _of(component: Component) -> Iterator[View]:
    for variable in component.declaration.variables.values():
        if not isinstance(variable, Parameter) or variable.structural or variable.items:
            continue
        if variable.dtype.kind not in "fi" or variable.name not in component.values:
            continue
        node = component.entry.parameters.get(variable.name)
        if node is not None and isinstance(node.value, list):
            yield from _elements(component, variable, node)
            continue
        values = component.values[variable.name]
        if values[0].size == 1 and bool(np.all(values == values[:1])):
            yield _view(component, variable, values.ravel()[0].item(), (), None)


def _elements(component: Component, variable: Parameter, node: Node) -> Iterator[View]:
    """A list as the file has it; elements that are no numbers, such as arithmetic, have no slider."""
    whole = node.plain()
    found = list(_numbers(whole, ()))
    if len(found) <= MOST_ELEMENTS:
        for indices, value in found:
            yield _view(component, variable, value, indices, whole)


def _numbers(value: Any, indices: tuple[int, ...]) -> Iterator[tuple[tuple[int, ...], float]]:
    if isinstance(value, list):
        for k, item in enumerate(value):
            yield from _numbers(item, (*indices, k))
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield indices, value


def _view(component: Component, variable: Parameter, value: float, indices: tuple[int, ...], whole: Any) -> View:
    integer = variable.dtype.kind == "i"
    least, most = _limits(variable)
    low, high = _range(float(value), least, most) if math.isfinite(value) else (0.0, 0.0)
    place = f"[{','.join(str(k + 1) for k in indices)}]" if indices else ""
    unit = variable.unit if isinstance(variable.unit, str) and variable.unit != "1" else ""
    return {
        "path": ".".join(["blocks", component.name, "parameters", variable.name, *map(str, indices)]),
        "block": component.name,
        "variable": variable.name,
        "indices": list(indices),
        "name": f"{variable.name}{place}",
        "value": value,
        "low": math.floor(low) if integer else low,
        "high": math.ceil(high) if integer else high,
        "least": least,
        "most": most,
        "integer": integer,
        "unit": unit,
        "about": variable.description,
        "whole": whole,
    }


def _limits(variable: Parameter) -> tuple[float | None, float | None]:
    """The declared ones; None where there is none, or one for each element."""
    ends = (variable.min, variable.max)
    least, most = (end if isinstance(end, int | float) and math.isfinite(end) else None for end in ends)
    return least, most


def _range(value: float, least: float | None, most: float | None) -> tuple[float, float]:
    """From zero to twice the value, within the limits; between both limits where there are two."""
    if least is not None and most is not None:
        return least, most
    low, high = (min(0.0, 2 * value), max(0.0, 2 * value)) if value else (-1.0, 1.0)
    return (low if least is None else max(low, least)), (high if most is None else min(high, most))


def lines(sliders: Mapping[str, View], chosen: Mapping[str, float]) -> list[View]:
    """For each value that is chosen by a slider, what the diagram would say, and the command line."""
    return [_line(sliders[path], value) for path, value in chosen.items() if path in sliders]


def _line(slider: View, value: float) -> View:
    said = _replaced(slider["whole"], slider["indices"], value)
    text = source.dump({"blocks": {slider["block"]: {"parameters": {slider["variable"]: said}}}})
    option = f"--set {slider['path']}={value!r}"
    return {"path": slider["path"], "value": value, "was": slider["value"], "yaml": text.strip(), "option": option}


def _replaced(whole: Any, indices: Sequence[int], value: float) -> Any:
    """A value, or nested lists of such, with the one at the indices replaced."""
    if not indices:
        return value
    return [_replaced(item, indices[1:], value) if k == indices[0] else item for k, item in enumerate(whole)]
