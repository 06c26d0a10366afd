"""One component for each block of a diagram: its class, its fleet, how it is timed, and the sizes that are given."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction

from cosim.authoring.block import Block
from cosim.authoring.variables import Period
from cosim.errors import MissingParameter, TooManyInstances, UnknownParameter, WrongValue, nearest
from cosim.integrators import INTEGRATORS, REFERENCES, Integration
from cosim.language.diagram import RunSettings
from cosim.language.entry import BlockEntry
from cosim.language.keys import INTEGRATION
from cosim.language.source import Node
from cosim.wiring import library, replacing
from cosim.wiring.clocks import MOST_TICKS, Clock, exact, schedule
from cosim.wiring.draft import Draft
from cosim.wiring.network import Axis, Component


def draft_all(draft: Draft) -> None:
    """Draft the component of each block that could be read, and note what is left out as its code may not run."""
    for entry in draft.diagram.blocks.values():
        if entry.kind == "python" and not draft.code:
            draft.unchecked.append(entry.name)
        elif entry.name not in draft.diagram.unread:
            draft.problems.attempt(_draft, draft, entry)
    draft.absent.report_fleets(draft.diagram.fleets, draft.problems)
    _check_ticks(draft)


def _check_ticks(draft: Draft) -> None:
    """A WrongValue for the first clock that leaves no tick of which a run has a countable number."""
    run, clocks = draft.diagram.run, list[Clock]()
    for component in draft.components.values():
        if component.clock and component.clock not in clocks:
            clocks.append(component.clock)
            longest = max(exact(run.stop), *(clock.period + clock.offset for clock in clocks))
            if longest >= MOST_TICKS * schedule(run.step, clocks).tick:
                message = f"block {component.name}: {component.clock} has no common measure with the rest"
                place = component.entry.settings["period"].position
                fix = f"such as a multiple of {run.step:g}, or a fraction such as 1/3"
                draft.problems.add(WrongValue(message, place, fix))
                return


def _draft(draft: Draft, entry: BlockEntry) -> None:
    block: type[Block] = library.find(entry)
    swap = replacing.settle(entry, block.declaration, draft.problems, draft.code)
    if swap:
        draft.swaps.append(swap)
    component = Component(entry.name, entry, block.declaration)
    if per := entry.settings.get("per"):
        fleet, fleets = per.value, draft.diagram.fleets
        if fleet not in fleets:
            draft.absent.fleets.setdefault(str(fleet), []).append(entry)
            return
        component.fleet, component.count = fleet, fleets[fleet]
    _time(draft, component)
    _count(draft, component)
    _size(draft, component)
    draft.components[entry.name] = component


def _time(draft: Draft, component: Component) -> None:
    """When it is sampled, or how it is integrated."""
    given, run = component.entry.settings, draft.diagram.run
    component.integration = run.integration if run.method == "joint" else _integration(component, run.integration)
    draft.problems.attempt(_sample, component, run)
    for key in _own_keys(component):
        if key in given and not given[key].inherited:
            draft.problems.attempt(_check_integration, component, key, given[key], run.method)
    draft.problems.attempt(_check_tolerance, component, run)


def _own_keys(component: Component) -> list[str]:
    """What a component may say of its integration; the `tolerance` of an FMU is for what that solves inside."""
    return [key for key in INTEGRATION if not (component.declaration.foreign and key == "tolerance")]


def _integration(component: Component, run: Integration) -> Integration:
    """How a component is integrated by itself. One that says how many equal steps takes no tolerance from the run."""
    own = {key: node.value for key, node in component.entry.settings.items() if key in _own_keys(component)}
    return replace(run, **{**({"tolerance": None} if "inner_steps" in own else {}), **own})


def _sample(component: Component, run: RunSettings) -> None:
    """Raises: WrongValue, MissingParameter."""
    given, declaration = component.entry.settings, component.declaration
    period, offset = given.get("period"), given.get("offset")
    if math.isnan(run.step) or math.isnan(run.stop):
        return  # a mistake that is told
    if period:
        start = exact(offset.value, run.step) if offset else Fraction(0)
        component.clock = Clock(exact(period.value, run.step), start)
    elif offset:
        message = f"block {component.name}: an `offset` is that of a `period`, and there is none"
        raise WrongValue(message, offset.key_position, "write `period` (s) too")
    elif declaration.kind("update") and declaration.measuring:
        component.clock = Clock(exact(run.step))
    elif declaration.kind("update") or any(declaration.of(Period)):
        said = "is sampled" if declaration.kind("update") else "asks for its `period`"
        message = f"block {component.name}: {declaration.name} {said}, and has no `period`"
        fix = f"add `period: {run.step:g}` (s) under blocks.{component.name}, or another"
        raise MissingParameter(message, component.entry.position, fix)


def _check_tolerance(component: Component, run: RunSettings) -> None:
    """Raises: WrongValue for a tolerance that an integrator cannot keep, or that stands beside equal steps."""
    integration, name = component.integration, component.name
    own = component.entry.settings if run.method != "joint" else {}
    if not component.declaration.continuous():
        return
    if integration.tolerance is None:
        if "absolute_tolerance" in own:
            message = f"block {name}: `absolute_tolerance` does nothing without a tolerance"
            raise WrongValue(message, own["absolute_tolerance"].place, "add `tolerance`, such as 1e-6")
        return
    if "inner_steps" in own:
        message = f"block {name}: `inner_steps` is how many equal steps there are, `tolerance` makes them as it allows"
        raise WrongValue(message, own["inner_steps"].place, "remove one of them")
    if not integration.method.estimates:
        said = f"`{integration.integrator}` does not estimate its error, so it cannot keep a tolerance"
        given = own.get("integrator") or own.get("tolerance") or run.nodes.get("integrator") or run.nodes["tolerance"]
        message = f"block {name}: {said}" if {"integrator", "tolerance"} & own.keys() else said
        able = ", ".join(name for name, method in INTEGRATORS.items() if method.estimates)
        raise WrongValue(message, given.place, f"choose one of {able}; or `inner_steps` for equal steps")


def _check_integration(component: Component, key: str, node: Node, method: str) -> None:
    """Raises: WrongValue for an integrator of a block's own that would be ignored."""
    if not component.declaration.continuous():
        message = (
            f"block {component.name}: {component.declaration.name} has no continuous states, so it takes no `{key}`"
        )
        raise WrongValue(message, node.place, f"remove `{key}`")
    if method == "joint":
        message = f"block {component.name}: `{key}` is ignored under `joint`, which integrates all blocks as one system"
        raise WrongValue(message, node.place, f"remove it, set run.{key}, or choose another run.method")
    if key == "integrator" and node.value in REFERENCES:
        said = f"`{node.value}` is scipy's, which integrates all blocks as one system"
        fix = f"write it under run, with run.method: joint; or choose one of {', '.join(INTEGRATORS)}"
        raise WrongValue(f"block {component.name}: {said}", node.place, fix)


def _count(draft: Draft, component: Component) -> None:
    most = component.declaration.most_instances
    if most is not None and component.count > most:
        count, name = component.count, component.entry.path.name
        message = f"block {component.name}: {count} instances, but one process may have {most} of `{name}`"
        draft.problems.add(TooManyInstances(message, component.entry.position, "write `isolate: true`"))


def _size(draft: Draft, component: Component) -> None:
    """The default sizes of dimensions, and those that the diagram gives."""
    declaration = component.declaration
    component.axes = {name: Axis(d.default) for name, d in declaration.dimensions.items() if d.default}
    names = dict.fromkeys((*declaration.dimension_names(), *declaration.dimensions))
    known = [name for name in names if not getattr(declaration.dimensions.get(name), "of", "")]
    for name, node in component.entry.dimensions.items():
        if name in known:
            component.axes[name] = Axis(int(node.value))
        else:
            message = f"block {component.name}: {declaration.name} has no dimension `{name}`"
            draft.problems.add(UnknownParameter(message, node.key_position, nearest(name, known)))
