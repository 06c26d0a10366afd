"""The compiled code that a program calls: the loop, and each block type's kernels once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, TypeVar

import numpy as np

from cosim.authoring.declaration import BEGINNING
from cosim.compiling import kernels
from cosim.compiling.kernels import Kernels, Module, ModuleSources
from cosim.compiling.tiles.parts import LEAST
from cosim.engine import loop_code
from cosim.engine.program import Program
from cosim.errors import DeclarationError, DiagramErrors, KernelError, Problems
from cosim.master import tables
from cosim.wiring.network import Component

T = TypeVar("T")


def compile_program(program: Program) -> Kernels:
    """The compiled loop and the kernels of all components of a program, each block type once.

    Raises: DiagramErrors with all that keeps functions from being compiled, each at its line.
    """
    kinds: dict[tuple[Any, ...], list[Component]] = {}
    for component in program.network.components.values():
        key = (id(component.declaration), component.count >= LEAST, *component.constants().items())
        kinds.setdefault(key, []).append(component)
    problems = Problems()
    wanted = [_attempted(partial(_wanted, components[0]), components[0], problems) for components in kinds.values()]
    loop = loop_code.wanted(_is_plain(program))
    found = iter(kernels.side_by_side([loop, *filter(None, wanted)]))
    loop_found = next(found)
    modules: dict[str, Module | None] = {}
    for components, each in zip(kinds.values(), wanted, strict=True):
        made = None
        if each is not None:
            made = next(found) or _attempted(partial(kernels.module, each), components[0], problems)
        modules |= {component.name: made for component in components}
    problems.raise_if_any()
    return Kernels({name: modules[name] for name in program.network.components}, loop_found or kernels.module(loop))


def fitting(compiled: Kernels, program: Program) -> Kernels:
    """The kernels of a program with those of another one of the same blocks. Raises: as `compile_program`."""
    return replace(compiled, loop=kernels.module(loop_code.wanted(_is_plain(program))))


def one_by_one(program: Program, compiled: Kernels) -> dict[str, str]:
    """By function of a fleet that is called along a run, why not for eight members at a time; "" if it is."""
    found = {}
    for call in program.calls:
        module, name = compiled.modules[call.component], call.function.name
        if module and call.function.kind not in BEGINNING and any(s.lanes and s.symbol == name for s in module.sources):
            found[f"{call.component}.{name}"] = module.load().text(f"{name}.alone") or ""
    return found


def _is_plain(program: Program) -> bool:
    """Whether the loop does without what most programs do not need."""
    more = (tables.SOLVE, tables.PUSH, tables.TRACE, tables.FORGET)
    chosen = program.banks[:, [tables.CONTROLLED, tables.IMPLICIT]].any()
    return not (program.attempts.needed or chosen or np.isin(program.rows[:, tables.KIND], more).any())


def _wanted(component: Component) -> ModuleSources | None:
    """What is to be compiled of a component's type; None where it stays Python."""
    if component.declaration.foreign:
        return kernels.raw_sources("fmu", [component.declaration.foreign.kernel])
    if not component.declaration.compiled:
        return None
    return kernels.block_sources(component.declaration, component.constants(), component.count >= LEAST)


def _attempted(stage: Callable[[], T], component: Component, problems: Problems) -> T | None:
    """What a stage returns for a component's type; None where there are mistakes, which are kept."""
    try:
        return stage()
    except (KernelError, DeclarationError, DiagramErrors) as error:
        for mistake in error.each:
            place = mistake.position or component.entry.type.position
            problems.add(type(mistake)(f"block {component.name}: {mistake.message}", place, mistake.fix))
        return None
