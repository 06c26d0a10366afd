"""What a key, a block type, a block or a port is, as a page in Markdown of a few lines."""

from __future__ import annotations

import json
import math

from cosim.authoring.declaration import Declaration
from cosim.authoring.variables import Variable, shape_text
from cosim.editor.reading import Reading
from cosim.language.diagram import Diagram
from cosim.language.keys import TYPES, Key
from cosim.wiring import variable_words
from cosim.wiring.network import Axis, Component


def of_key(name: str, key: Key) -> str:
    """A key: what may be written, its help, unit and default."""
    kind = key.type.words if key.type else ""
    unit = f" ({key.unit})" if key.unit else ""
    lines = [f"**{name}**" + (f": {kind}{unit}" if kind else unit), key.help]
    if key.default not in (None, "", (), math.inf, -math.inf):
        lines.append(f"default {json.dumps(key.default)}")
    if key.kinds != TYPES:
        lines.append(f"goes with {', '.join(f'`{kind}:`' for kind in key.kinds)}")
    return "\n\n".join(line for line in lines if line)


def of_type(declaration: Declaration) -> str:
    """A block type: its text, with the equations."""
    return f"**{declaration.name}**\n\n{_as_markdown(declaration.doc)}"


def of_block(name: str, declaration: Declaration, reading: Reading) -> str:
    """A block of a diagram: of what type, how many, and that type's text."""
    component = _component(name, reading)
    many = f", {component.count} × {component.fleet}" if component and component.fleet else ""
    return f"block `{name}`{many}\n\n{of_type(declaration)}"


def of_diagram(name: str, diagram: Diagram) -> str:
    """A block that is a diagram: its title and ports."""
    ports = [
        f"{word}: {', '.join(names)}" for word, names in (("in", diagram.inputs), ("out", diagram.outputs)) if names
    ]
    return "\n\n".join((f"block `{name}`, the diagram **{diagram.title}**", *ports))


def of_variable(declaration: Declaration, variable: Variable, name: str, reading: Reading) -> str:
    """A port, parameter or state of a block: its shape, unit, what it is, and how its block computes it."""
    unit = variable_words.unit(variable)
    head = f"**{name}.{variable.name}**{shape_text(variable.shape)}" + (f" ({unit})" if unit else "")
    kind = "" if variable.dtype == float else f", {variable.dtype.name}"
    lines = [f"{head}: {variable.causality} of {declaration.name}{kind}"]
    if shape := shape_of(variable, name, reading):
        lines.append(f"shape {shape}")
    component = _component(name, reading)
    if component and (sources := component.wires.get(variable.name)):
        lines.append(f"reads {', '.join(map(str, sources))}")
    lines.append("; ".join(variable_words.notes(declaration, variable)))
    lines.append(_as_markdown(declaration.doc))
    return "\n\n".join(line for line in lines if line)


def shape_of(variable: Variable, name: str, reading: Reading) -> str:
    """The shape of a block's variable over all members of its fleet, where the diagram settles it; "" elsewhere."""
    component = _component(name, reading)
    if component is None or variable.name not in component.declaration.variables:
        return ""
    axes = component.signal_axes(component.declaration.variables[variable.name])
    if axes is None:
        return ""
    return f"({', '.join(map(_axis, axes))})" if axes else "scalar"


def _axis(axis: Axis) -> str:
    return f"{axis.fleet}: {axis.size}" if axis.fleet else str(axis.size)


def _component(name: str, reading: Reading) -> Component | None:
    return reading.network.components.get(name) if reading.network else None


def _as_markdown(doc: str) -> str:
    """A text whose equations are indented below `::`, in fences."""
    paragraphs = []
    for paragraph in doc.strip().split("\n\n"):
        lines = paragraph.splitlines()
        if lines and all(line.startswith(" ") for line in lines):
            paragraphs.append("```text\n" + paragraph + "\n```")
        elif paragraph.strip() != "::":
            paragraphs.append(paragraph.replace("::", ":"))
    return "\n\n".join(paragraphs)
