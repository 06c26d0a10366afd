"""What somebody may mean by a name that a block does not have at this place."""

from __future__ import annotations

from collections.abc import Iterable

from cosim.authoring.declaration import Declaration
from cosim.authoring.variables import Input, Parameter, State
from cosim.errors import nearest


def usual_fix(declaration: Declaration, name: str, known: Iterable[str]) -> str:
    """The usual fix for a name that is none of those known: what it is instead, else the nearest of them."""
    variable = declaration.variables.get(name)
    if name in declaration.elsewhere:
        return f"`{name}` {declaration.elsewhere[name]}"
    if isinstance(variable, Parameter):
        return f"`{name}` is a parameter: write it below `parameters:`"
    if isinstance(variable, Input):
        return f"`{name}` is an input: below `inputs:` it is wired, or given a constant"
    if isinstance(variable, State):
        return f"`{name}` is a state: where it begins stands below `start:`"
    if variable is not None:
        return f"`{name}` is computed by the block"
    return nearest(name, known)
