"""The compiled code that a program calls: the loop, and each block type's kernels once."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from cosim.compiling import kernels
from cosim.engine.program import Program
from cosim.errors import DeclarationError, DiagramErrors, KernelError, Problems
from cosim.master import loop
from cosim.wiring.network import Component


@dataclass
class Kernels:
    """The modules that a program calls, by component, and the loop's; None for a component that stays Python."""

    modules: dict[str, kernels.Module | None] = field(default_factory=dict)
    loop: kernels.Module | None = None

    @property
    def compiled(self) -> int:
        """How many modules had to be compiled rather than found in the cache."""
        found = {m.key: m for m in (*self.modules.values(), self.loop) if m is not None}
        return sum(m.compiled_now for m in found.values())


def compile_program(program: Program) -> Kernels:
    """The compiled loop and the kernels of all components of a program, each block type once.

    Raises: DiagramErrors with all that keeps functions from being compiled, each at its line.
    """
    made: dict[tuple[Any, ...], kernels.Module | None] = {}
    problems = Problems()
    result = Kernels(loop=kernels.raw_module("engine", (loop.run, loop.execute)))
    for name, component in program.network.components.items():
        foreign = component.declaration.foreign
        if foreign:
            result.modules[name] = kernels.raw_module("fmu", [foreign.kernel])
            continue
        if not component.declaration.compiled:
            result.modules[name] = None
            continue
        key = (id(component.declaration), *component.constants().items())
        if key not in made:
            made[key] = _module(component, problems)
        result.modules[name] = made[key]
    problems.raise_if_any()
    return result


def _module(component: Component, problems: Problems) -> kernels.Module | None:
    """The kernels of a component's type; None, and mistakes with its name, where they cannot be compiled."""
    try:
        return kernels.block_module(component.declaration, component.constants())
    except (KernelError, DeclarationError, DiagramErrors) as error:
        for mistake in error.errors if isinstance(error, DiagramErrors) else [error]:
            place = mistake.position or component.entry.type.position
            problems.add(type(mistake)(f"block {component.name}: {mistake.message}", place, mistake.fix))
        return None
