"""The compiled code that a program calls: the loop, and each block type's kernels once."""

from __future__ import annotations

from typing import Any

from cosim.compiling import kernels
from cosim.compiling.kernels import Kernels
from cosim.compiling.tiles.parts import LEAST
from cosim.engine import loop_code
from cosim.engine.program import Program
from cosim.errors import DeclarationError, DiagramErrors, KernelError, Problems
from cosim.wiring.network import Component


def compile_program(program: Program) -> Kernels:
    """The compiled loop and the kernels of all components of a program, each block type once.

    Raises: DiagramErrors with all that keeps functions from being compiled, each at its line.
    """
    made: dict[tuple[Any, ...], kernels.Module | None] = {}
    modules: dict[str, kernels.Module | None] = {}
    problems = Problems()
    with loop_code.compiled_beside() as loop:
        for name, component in program.network.components.items():
            key = (id(component.declaration), component.count >= LEAST, *component.constants().items())
            if key not in made:
                made[key] = _module(component, problems)
            modules[name] = made[key]
        problems.raise_if_any()
        return Kernels(modules, loop())


def _module(component: Component, problems: Problems) -> kernels.Module | None:
    """The kernels of a component's type; None for one that stays Python, or, with mistakes, cannot be compiled."""
    if component.declaration.foreign:
        return kernels.raw_module("fmu", [component.declaration.foreign.kernel])
    if not component.declaration.compiled:
        return None
    try:
        return kernels.block_module(component.declaration, component.constants(), component.count >= LEAST)
    except (KernelError, DeclarationError, DiagramErrors) as error:
        for mistake in error.each:
            place = mistake.position or component.entry.type.position
            problems.add(type(mistake)(f"block {component.name}: {mistake.message}", place, mistake.fix))
        return None
