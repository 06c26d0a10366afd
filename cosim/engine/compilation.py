"""The compiled code that a program calls: the loop, and each block type's kernels once."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from cosim.compiling import kernels
from cosim.compiling.kernels import Kernels
from cosim.compiling.tiles.parts import LEAST
from cosim.engine import loop_code
from cosim.engine.program import Program
from cosim.errors import DeclarationError, DiagramErrors, KernelError, Problems
from cosim.master import tables
from cosim.wiring.network import Component


def compile_program(program: Program) -> Kernels:
    """The compiled loop and the kernels of all components of a program, each block type once.

    Raises: DiagramErrors with all that keeps functions from being compiled, each at its line.
    """
    made: dict[tuple[Any, ...], kernels.Module | None] = {}
    modules: dict[str, kernels.Module | None] = {}
    problems = Problems()
    with loop_code.compiled_beside(_is_plain(program)) as loop:
        for name, component in program.network.components.items():
            key = (id(component.declaration), component.count >= LEAST, *component.constants().items())
            if key not in made:
                made[key] = _module(component, problems)
            modules[name] = made[key]
        problems.raise_if_any()
        return Kernels(modules, loop())


def fitting(compiled: Kernels, program: Program) -> Kernels:
    """The kernels of a program with those of another one of the same blocks. Raises: as `compile_program`."""
    with loop_code.compiled_beside(_is_plain(program)) as loop:
        return replace(compiled, loop=loop())


def _is_plain(program: Program) -> bool:
    """Whether the loop does without what most programs do not need."""
    more = (tables.SOLVE, tables.PUSH, tables.TRACE, tables.FORGET)
    chosen = program.banks[:, [tables.CONTROLLED, tables.IMPLICIT]].any()
    return not (program.attempts.needed or chosen or np.isin(program.rows[:, tables.KIND], more).any())


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
