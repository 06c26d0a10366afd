"""Which blocks of a diagram are to stand out, as they are not what they are in another one."""

from __future__ import annotations

from cosim.errors import Position
from cosim.language import source
from cosim.results import diagram_differences
from cosim.wiring.network import Network


def changed(network: Network, before: Network) -> list[str]:
    """The blocks of a network that another one does not have, or has otherwise."""
    trees = [source.parse_value(one.diagram.resolved(), Position("")).plain() for one in (before, network)]
    keys = [item.key for item in diagram_differences.differences(trees)]
    return sorted({key.split(".")[1] for key in keys if key.startswith("blocks.")} & {*network.components})
