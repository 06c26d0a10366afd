"""Which blocks of a diagram are to stand out, as they are not what they are in another one."""

from __future__ import annotations

from cosim.language.diagram import Diagram
from cosim.results.diagram_differences import differences, plain


def changed(diagram: Diagram, before: Diagram) -> list[str]:
    """The blocks of a diagram that another one does not have, or has otherwise."""
    keys = [item.key for item in differences([plain(one.resolved()) for one in (before, diagram)])]
    return sorted({key.split(".")[1] for key in keys if key.startswith("blocks.")} & {*diagram.blocks})
