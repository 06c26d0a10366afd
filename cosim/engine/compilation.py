"""The compiled code that a program calls: the loop, and each block type's kernels once."""

from __future__ import annotations

from typing import Any

from cosim.compiling import kernels
from cosim.compiling.kernels import Kernels
from cosim.engine.program import Program
from cosim.errors import DeclarationError, DiagramErrors, KernelError, Problems
from cosim.master import integration, loop
from cosim.wiring.network import Component


def compile_program(program: Program) -> Kernels:
    """The compiled loop and the kernels of all components of a program, each block type once.

    Raises: DiagramErrors with all that keeps functions from being compiled, each at its line.
    """
    made: dict[tuple[Any, ...], kernels.Module | None] = {}
    problems = Problems()
    result = Kernels(loop=kernels.raw_module("engine", (loop.run, loop.execute, integration.derive)))
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
