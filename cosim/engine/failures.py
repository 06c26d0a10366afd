"""Why a run ended early: what a status of the loop, and what it left behind, say of whose fault it is."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from cosim.authoring.variables import Indicator, Local, State, Variable
from cosim.engine import faults
from cosim.engine.layout import UNWRITTEN
from cosim.engine.program import Program
from cosim.engine.writer import Call
from cosim.errors import BlockFailed, CosimError, Diverged, Terminated
from cosim.language.entry import outputs_of
from cosim.master import integration, linear, loop, newton, tables
from cosim.wiring.network import Component

#: An error of a loop, over the unknown's size, that may be what an FMU iterates to inside.
COARSE = 1e-3
#: The usual fix for what has no value.
_DOMAIN = "keep to where the expression has a value, as sqrt(max(x, 0)) and if(x > 0, 1/x, 0) do"
KINDS = {"output": "output", "calculatedParameter": "calculated parameter"}


def divergence(program: Program, arena: np.ndarray, offset: int, time: float) -> CosimError:
    """The error for a value at an offset that the loop found to be not finite at a time (s)."""
    signal, instance, element = program.owner(offset)
    component, variable = program.network.components[signal.component], program.network.variable(signal)
    value = arena[offset : offset + variable.dtype.itemsize].view(variable.dtype)[0]
    mark = UNWRITTEN[variable.dtype]
    if value.view(mark.dtype) == mark and (error := _unwritten(program, program.calls, arena, time)):
        return error
    name = _named(component, variable, element)
    member = f" of {component.fleet} {instance + 1}" if component.fleet else ""
    what = f"is {value:.3g}, beyond {loop.LIMIT:.0e}" if np.isfinite(value) else f"is not finite ({value})"
    is_state = isinstance(variable, State)
    kind = "state" if is_state else KINDS.get(variable.causality, "local")
    message = f"block {signal.component}: {kind} `{name}`{member} {what} at t = {time:g} s"
    fix = "try a smaller step, or look at what drives it" if is_state else "look at what it is computed from"
    if component.entry.kind == "expression" and variable.causality == "output":
        return Diverged(message, outputs_of(component.entry.type)[variable.name].position, _DOMAIN)
    return Diverged(message, component.entry.position, fix)


def _named(component: Component, variable: Variable, element: int) -> str:
    """A variable, with the indices of one of its elements from 1."""
    index = np.unravel_index(element, component.shape(variable))
    return variable.name + (f"[{','.join(str(int(i) + 1) for i in index)}]" if index else "")


def stalled(program: Program, arena: np.ndarray, offset: int) -> CosimError:
    """The error for a state at an offset whose tolerance is not kept, however small or many the inner steps are."""
    signal, instance, element = program.owner(offset)
    component, variable = program.network.components[signal.component], program.network.variable(signal)
    index = (offset - program.layout.vectors["X"]) // 8
    bank = next(b for b in program.banks if b[tables.BEGIN] <= index < b[tables.END])
    begin = int(bank[tables.MEMORY])
    step, time = arena[begin : begin + 16].view(float)
    name = _named(component, variable, element)
    member = f" of {component.fleet} {instance + 1}" if component.fleet else ""
    state = f"block {signal.component}: state `{name}`{member}"
    if np.isnan(step):
        integrator = program.network.diagram.run.integrator
        message = f"{state} has a derivative that is not finite at t = {time:.15g} s, where `{integrator}` tries a step"
        fix = "look for a pole, or a root or logarithm of what is below zero; rodas5p would try a smaller step"
        return BlockFailed(message, component.entry.position, fix)
    if step >= integration.SMALLEST * abs(time):
        many = f"more than {integration.MOST_STEPS} inner steps in one step of the run for its tolerance"
        fix = "choose an implicit integrator such as rodas5p, a smaller `run.step`, or a larger `tolerance`"
        return BlockFailed(f"{state} asks at t = {time:g} s for {many}", component.entry.position, fix)
    message = f"{state} does not keep its tolerance at t = {time:.15g} s, however small the inner step ({step:.1g} s)"
    fix = "look for a jump or a pole in its derivative there; or choose a larger `tolerance`"
    return BlockFailed(message, component.entry.position, fix)


def _unwritten(program: Program, calls: Iterable[Call], arena: np.ndarray, time: float) -> BlockFailed | None:
    """The error for the first of some functions, in their order, that has not written a number of its own."""
    for call in calls:
        component = program.network.components[call.component]
        if component.declaration.foreign:
            continue
        found = _left_out(call, arena)
        if found is None:
            continue
        name, k, element = found
        member = f" of {component.fleet} {k + 1}" if component.fleet else ""
        message = f"block {component.name}: {call.function.name}() has not written `{element}`{member}"
        fix = f"write every element of `{name}`, and of what it is computed from, before it is read"
        if isinstance(component.declaration.variables.get(name), Local):
            fix += "; if it is work space, declare it with finite=False"
        return BlockFailed(f"{message} at t = {time:g} s", component.entry.position, fix)
    return None


def _left_out(call: Call, arena: np.ndarray) -> tuple[str, int, str] | None:
    """What a call has not written: the argument, the instance, from 0, and its first such element."""
    for name, place in zip(call.function.arguments, call.arguments, strict=True):
        mark = UNWRITTEN.get(place.dtype) if place and name in call.function.writes else None
        if place is None or mark is None:
            continue
        for k in range(call.count):
            left = np.argwhere(place.view(arena, k).view(mark.dtype) == mark)
            if len(left):
                return name, k, f"{name}[{','.join(str(i + 1) for i in left[0])}]" if len(left[0]) else name
    return None


def unsolved(program: Program, arena: np.ndarray, row: int, time: float) -> BlockFailed:
    """The error for an algebraic loop whose row found no solution at a time (s)."""
    loop, rows = program.loops[row], program.rows[row + 1 :][: program.rows[row, tables.B]]
    calls = [program.calls[a] for a in rows[rows[:, tables.KIND] == tables.CALL, tables.A]]
    if error := _unwritten(program, calls, arena, time):
        return error
    component = program.network.components[loop.torn[0].component]
    left, member = program.unsolved(row, arena)
    parts = [*dict.fromkeys(task.component for task in loop.tasks)]
    where = ", ".join(parts) + (f" ({component.fleet} {member + 1})" if member is not None else "")
    position, torn = component.entry.position, ", ".join(map(str, loop.torn))
    if left == newton.UNDETERMINED:
        message = (
            f"the algebraic loop of {where} leaves {torn} undetermined at t = {time:g} s: other values would do too"
        )
        return BlockFailed(message, position, "let one of these blocks read a state instead, or sample it")
    message = f"no solution was found of the algebraic loop of {where} at t = {time:g} s: "
    way = f"does not come back to itself, but {left:.1g} away" if left < linear.HUGE else "gives no number"
    guess = f"blocks.{loop.torn[0].component}.start.{loop.torn[0].variable}"
    fix = f"say where to look, {guess}; or sample a block, or let it read a state"
    fmus = [name for name in parts if program.network.components[name].declaration.foreign]
    if left < COARSE and fmus:
        fix = f"look whether {', '.join(fmus)}, an FMU, computes no better than that (see its `tolerance`); or {fix}"
    return BlockFailed(f"{message}{torn} {way}", position, fix)


def restless(program: Program, time: float) -> BlockFailed:
    """The error for events of which one followed another without end, in the step after a time (s)."""
    network = program.network
    eventful = network.watched or [c for c in network.components.values() if c.declaration.kind("times")]
    names = ", ".join(component.name for component in eventful)
    message = f"block {names}: events follow each other without end after t = {time:g} s"
    fix = "reset what the indicator is computed from, so that it does not cross zero again at once, or say which way "
    fix += 'counts, as `Indicator(crossing="falling")` does'
    if not network.watched:
        fix = "choose a smaller run.step, which has fewer events, or look at what the FMU says of its next one"
    return BlockFailed(message, eventful[0].entry.position, fix)


def indivisible(program: Program, event: float) -> BlockFailed:
    """The error for a time event (s) between two communication points where a step cannot end."""
    component = program.network.rigid[0]
    message = f"block {component.name}: this FMU takes steps of one size only, and at t = {event:g} s is an event"
    fix = "choose a run.step of which the times of all events are multiples, or model exchange"
    return BlockFailed(message, component.entry.type.position, fix)


def terminated(program: Program, number: int, time: float) -> Terminated:
    """Whose indicator, by its number among all, ended the run at a time (s)."""
    for component in program.network.watched:
        for indicator in component.declaration.of(Indicator):
            size = component.nbytes(indicator) // 8
            if number < size * component.count:
                name = _named(component, indicator, number % size)
                member = f" of {component.fleet} {number // size + 1}" if component.fleet else ""
                message = f"block {component.name}: `{name}`{member} ended the simulation at t = {time:.9g} s"
                return Terminated(message, component.entry.position)
            number -= size * component.count
    raise IndexError(number)


def failure(program: Program, arena: np.ndarray, call: Call, time: float, interpreted: bool) -> BlockFailed:
    """The error for a call of an author's function that failed."""
    fault = faults.left(arena.ctypes.data + call.frame) or faults.Fault("an error", time, 0)
    component = program.network.components[call.component]
    member = f" of {component.fleet} {fault.instance + 1}" if component.fleet else ""
    if component.entry.kind == "expression":  # of which nothing else fails
        output = call.function.arguments[-1]
        message = (
            f"block {call.component}: output `{output}`{member} compares what is no number at t = {fault.time:g} s"
        )
        return BlockFailed(message, outputs_of(component.entry.type)[output].position, _DOMAIN)
    message = f"block {call.component}: {call.function.name}(){member} failed at t = {fault.time:g} s: {fault.text}"
    debug = "`cosim debug` instead of `cosim run` stops just before, in Python's debugger"
    fix = "set a breakpoint in the block" if interpreted else debug
    if call.function.kind == "calculate":
        fix = f"other values of {', '.join(call.function.reads)}; or {fix}"
    return BlockFailed(message, component.entry.position, fix)
