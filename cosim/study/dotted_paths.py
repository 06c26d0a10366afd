"""The dotted paths of what a grid or a draw sets, and what that is called for short."""

from __future__ import annotations

from cosim.language.keys import BLOCK


def paths(text: str) -> tuple[str, ...]:
    """The dotted paths of a key; several, with commas between, take the same value."""
    return tuple(part.strip() for part in text.split(","))


def short_name(text: str) -> str:
    """What an axis or a draw is called, whatever others there are: `plant.mass` for `blocks.plant.parameters.mass`."""
    parts = paths(text)[0].split(".")
    is_value = len(parts) > 3 and parts[0] == "blocks" and parts[2] in ("parameters", "start", "inputs")
    if len(parts) > 2 and parts[0] == "blocks" and parts[2] not in BLOCK:
        return ".".join(parts[1:])
    return ".".join([parts[1], *parts[3:]] if is_value else parts)
