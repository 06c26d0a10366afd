"""A network as Mermaid's flow chart, which a README or a wiki shows."""

from __future__ import annotations

from collections.abc import Sequence

from cosim.drawing.boxes import boxes
from cosim.drawing.svg import MARK
from cosim.wiring.network import Network

_OPEN = {"fmu": ("[[", "]]"), "diagram": ("[[", "]]"), "expression": ("([", "])")}


def mermaid(network: Network, changed: Sequence[str] = ()) -> str:
    """The text of the chart."""
    found, wires = boxes(network, changed)
    number = {name: f"b{k}" for k, name in enumerate(found)}
    lines = [f"%% {MARK}", "flowchart LR"]
    for name, box in found.items():
        left, right = _OPEN.get(box.kind, ("[", "]"))
        lines.append(f'  {number[name]}{left}"<b>{_safe(name)}</b><br>{_safe(box.said)}"{right}')
    for wire in wires:
        source, target = found[wire.source[0]], found[wire.target[0]]
        a, b = source.outputs[wire.source[1]].name, target.inputs[wire.target[1]].name
        label = a if a == b else f"{a} → {b}"
        line = "-.->" if wire.late else "-->"
        lines.append(f'  {number[source.name]} {line}|"{_safe(label)}"| {number[target.name]}')
    if marked := [number[name] for name, box in found.items() if box.changed]:
        lines += ["  classDef changed stroke:#c1440e,stroke-width:3px", f"  class {','.join(marked)} changed"]
    return "\n".join([*lines, ""])


def _safe(text: str) -> str:
    """A text as it may stand between quotes."""
    return "".join(c if c.isalnum() or c in " _.,→×/-()+*=" else f"#{ord(c)};" for c in text)
