"""No two blocks, nor two members of a fleet, draw the same random numbers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from cosim.authoring.variables import Seed
from cosim.errors import WrongValue
from cosim.language.values import Value
from cosim.wiring.network import Component


def repeated(components: Mapping[str, Component], given: Mapping[tuple[str, str], Value]) -> Iterator[WrongValue]:
    """Seeds that are given twice, at the place of the second. given: values by component and variable."""
    owners: dict[int, str] = {}
    for component in components.values():
        for seed in component.declaration.of(Seed):
            values = component.values.get(seed.name)
            if values is None:
                continue
            for k, number in enumerate(np.broadcast_to(values, (component.count,)).tolist()):
                member = f"{component.fleet} {k + 1} of {component.name}" if component.fleet else component.name
                if (other := owners.setdefault(number, member)) != member:
                    value = given.get((component.name, seed.name))
                    message = f"block {component.name}: {member} has the seed {number} of {other}, and so its numbers"
                    own = "i" if component.fleet else str(max(owners) + 1)
                    fix = f"give each another one, such as `{seed.name}: {own}`, or `{max(owners)} + i` in a fleet"
                    yield WrongValue(message, value.position if value else component.entry.position, fix)
                    break
