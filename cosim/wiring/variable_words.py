"""What a block's variable is, in words: its unit, default, limits, and what it depends on at the same instant."""

from __future__ import annotations

from cosim.authoring.declaration import Declaration
from cosim.authoring.variables import Parameter, State, Variable
from cosim.wiring import limits


def unit(variable: Variable) -> str:
    """Its unit, or those of its elements; "" where the block does not care."""
    return ", ".join(variable.unit) if isinstance(variable.unit, tuple) else variable.unit or ""


def notes(declaration: Declaration, variable: Variable) -> list[str]:
    """Its description, default, limits, and what else a user has to know."""
    found = [variable.description]
    if isinstance(variable, Parameter):
        found.append("required" if variable.start is None else f"default {variable.start}")
    found.append(limits.words(variable))
    if variable.nominal is not None:
        found.append(f"nominal {limits.text(variable.nominal)}")
    if only := getattr(variable, "only", ""):
        found.append(f"takes ports called `{only}`")
    if variable.causality == "output":
        found.append(_feedthrough(declaration, variable))
    return [note for note in found if note]


def _feedthrough(declaration: Declaration, variable: Variable) -> str:
    """What an output depends on at the same instant, in words."""
    if isinstance(variable, State):
        return "a state"
    reached: set[str] = set()
    waiting = [variable.name]
    while waiting:
        writer = declaration.writer(waiting.pop())
        for name in writer.reads if writer else ():
            if name not in reached:
                reached.add(name)
                waiting.append(name)
    inputs = [n for n in declaration.variables if n in reached and declaration.variables[n].causality == "input"]
    return f"direct feedthrough from {', '.join(inputs)}" if inputs else "no direct feedthrough"
