"""How an input is read where it is not what a wire brings now: late, or extrapolated from what it has brought."""

from __future__ import annotations

import math

import numpy as np

from cosim.errors import WrongValue
from cosim.wiring import jumps
from cosim.wiring.clocks import exact
from cosim.wiring.draft import Draft
from cosim.wiring.network import Component, Coupling

_FIX = "remove it, or write `extrapolation: 0`"


def couple(draft: Draft) -> None:
    """Fill in `Component.couplings`, of wires that are known."""
    extrapolated = False
    for component in draft.components.values():
        for port in component.wires:
            coupling = draft.problems.attempt(_coupling, draft, component, port)
            if coupling:
                component.couplings[port] = coupling
                extrapolated |= coupling.order > 0
    if draft.is_whole():
        jumps.settle(draft.network())
    run = draft.diagram.run
    if run.method == "joint" and run.coupling_tolerance:
        message = "`run.coupling_tolerance` has nothing to judge under `joint`, which couples by its integrator"
        fix = "remove it, or choose another run.method"
        draft.problems.add(WrongValue(message, run.nodes["coupling_tolerance"].place, fix))
    if run.extrapolation and not extrapolated and draft.is_whole():
        message = "`run.extrapolation` changes nothing: no input is read between two communication points"
        fix = "choose an integrator of several stages, or inner steps, under jacobi or gauss-seidel; or remove it"
        draft.problems.add(WrongValue(message, run.nodes["extrapolation"].place, fix))


def _coupling(draft: Draft, component: Component, port: str) -> Coupling | None:
    """How an input is read; None: as it comes. Raises: WrongValue."""
    beside, run = component.entry.inputs[port].beside, draft.diagram.run
    delay, order = beside.get("delay"), beside.get("extrapolation")
    why = _held(draft, component, port)
    if order and order.value and (why or delay):
        message = f"block {component.name}: `{port}` is not extrapolated: {why or 'it is read late'}"
        raise WrongValue(message, order.place, _FIX)
    if not delay:
        reached = 0 if why else order.value if order else run.extrapolation
        interpolated = run.method == "iterated" and not why
        judged = bool(run.coupling_tolerance) and _is_judged(draft, component, port)
        return Coupling(order=reached, interpolated=interpolated) if reached or interpolated or judged else None
    if math.isnan(run.step):  # which is told
        return Coupling(exact(delay.value))
    late = exact(delay.value, run.step)
    if late < exact(run.step):
        message = f"block {component.name}: `{port}` is read {delay.value:g} s late, which is less than a step"
        raise WrongValue(message, delay.place, f"at least run.step = {run.step:g} s, or remove it")
    return Coupling(late)


def _is_judged(draft: Draft, component: Component, port: str) -> bool:
    """Whether what an input is held at over a step differs from what its source then gives."""
    sources = [draft.components[s.component] for s in component.wires[port] if s.variable]
    real = component.declaration.variables[port].dtype == np.float64
    steps = component.declaration.continuous() or component.declaration.kind("step")
    return bool(real and steps and not component.samples_inputs and not all(s.is_sampled for s in sources))


def _held(draft: Draft, component: Component, port: str) -> str:
    """Why an input cannot be extrapolated, "" if it can."""
    sources = [(s, draft.components[s.component]) for s in component.wires[port] if s.variable]
    sampled = [s for s, there in sources if there.is_sampled]
    if draft.diagram.run.method == "joint":
        return "under `joint` it is evaluated anew at every stage"
    foreign, interpolates = component.declaration.foreign, component.declaration.interpolates
    if foreign and not interpolates:
        return "this FMU holds its inputs over a step (`canInterpolateInputs` of FMI 2's Co-Simulation is missing)"
    if not foreign and (not component.declaration.continuous() or component.integration.is_one_euler_step):
        return f"{component.name} reads its inputs at communication points only"
    if component.samples_inputs:
        return f"{component.name} samples its inputs"
    if sampled:
        return f"{sampled[0]} is sampled, and does not change in between"
    if component.declaration.variables[port].dtype != np.float64:
        return "it is no real number of double precision"
    return ""
