"""One component for each block of a diagram: its class, its fleet, how it is timed, and the sizes that are given."""

from __future__ import annotations

from dataclasses import replace

from cosim.authoring.block import Block
from cosim.errors import TooManyInstances, UnknownParameter, WrongValue, nearest
from cosim.integrators import INTEGRATORS, Integration
from cosim.language.diagram import RunSettings
from cosim.language.entry import BlockEntry
from cosim.language.keys import INTEGRATION
from cosim.language.source import Node
from cosim.wiring import library, replacing
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
    if "period" in given:
        draft.problems.attempt(_sample, component, given["period"], run.step)
    for key in INTEGRATION:
        if key in given and not given[key].inherited:
            draft.problems.attempt(_check_integration, component, key, given[key], run.method)
    draft.problems.attempt(_check_tolerance, component, run)


def _integration(component: Component, run: Integration) -> Integration:
    """How a component is integrated by itself. One that says how many equal steps takes no tolerance from the run."""
    own = {key: node.value for key, node in component.entry.settings.items() if key in INTEGRATION}
    return replace(run, **{**({"tolerance": None} if "inner_steps" in own else {}), **own})


def _sample(component: Component, period: Node, step: float) -> None:
    """Raises: WrongValue."""
    if not component.declaration.kind("update"):
        message = f"block {component.name}: {component.declaration.name} is not sampled, so it takes no period"
        raise WrongValue(message, period.position, "remove `period`, or give the block an update() function")
    steps = float(period.value) / step
    component.every = round(steps)
    if component.every < 1 or abs(steps - component.every) > 1e-9 * steps:
        message = f"block {component.name}: the period {period.value} s is no whole number of steps"
        raise WrongValue(message, period.position, f"choose a multiple of run.step = {step} s")


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


def _count(draft: Draft, component: Component) -> None:
    most = component.declaration.most_instances
    if most is not None and component.count > most:
        count, name = component.count, component.entry.path.name
        message = f"block {component.name}: {count} instances, but one process may have {most} of `{name}`"
        draft.problems.add(TooManyInstances(message, component.entry.position, "write `isolate: true`"))


def _size(draft: Draft, component: Component) -> None:
    """The default sizes of dimensions, and those that the diagram gives."""
    declaration = component.declaration
    component.axes = {name: Axis(size.default) for name, size in declaration.dimensions.items()}
    known = declaration.dimension_names()
    for name, node in component.entry.dimensions.items():
        if name in known:
            component.axes[name] = Axis(int(node.value))
        else:
            message = f"block {component.name}: {declaration.name} has no dimension `{name}`"
            draft.problems.add(UnknownParameter(message, node.key_position, nearest(name, known)))
