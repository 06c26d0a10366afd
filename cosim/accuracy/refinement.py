"""Which runs tell the errors of a diagram apart, and what each of them changes in it.

total         steps of h, h/2, h/4, with as many inner steps in each: all errors fall together
integration   inner steps alone are halved: what blocks make of inputs that are held, or taken, as before
coupling      the communication step alone is halved, inner steps are as small as in the finest of all runs

All of these have points in common, so that they agree on what happens just before one. Two more tell:

elsewhere     steps of 10/11 h have most points between those of the others, but meet them at round times
early         steps of h are cut a little before each of these
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from cosim.integrators import INTEGRATORS, KNOWN
from cosim.language.keys import MOST_INNER_STEPS
from cosim.language.reader import multiple
from cosim.wiring import jumps
from cosim.wiring.clocks import MOST_TICKS, Clock, exact
from cosim.wiring.network import Component, Network


@dataclass(frozen=True)
class Refinement:
    """A run that takes so many steps where the diagram's own takes one, each with so many times the inner steps.

    coarser: or one step where the diagram takes so many. early: every how many steps it also stops a little before the
    next point; 0 for never.
    """

    steps: int = 1
    inner: int = 1
    coarser: int = 1
    early: int = 0

    @property
    def lies_elsewhere(self) -> bool:
        """Whether most of its points lie between those of the diagram's own run."""
        return self.steps > 1 and self.coarser > 1

    @property
    def cost(self) -> float:
        """How many times as long as the diagram's own run it takes."""
        return self.steps * self.inner / self.coarser + (1.0 / self.early if self.early else 0.0)

    @property
    def is_extra(self) -> bool:
        """Whether it is left out where it does not fit the diagram."""
        return self.lies_elsewhere or self.early > 0

    def step(self, step: float) -> float:
        """The communication step (s) where that of the diagram is `step`."""
        return step * self.coarser / self.steps


MOST_KEPT = 10
"""How many steps there are from one common point to the next, if that is possible, see `beside`."""
EARLY = 2**12
"""Into how many parts a step is divided, of which the last begins where a run stops early."""
Triple = tuple[Refinement, Refinement, Refinement]
TOTAL: Triple = (Refinement(1), Refinement(2), Refinement(4))
INTEGRATION: Triple = (Refinement(1, 1), Refinement(1, 2), Refinement(1, 4))
COUPLING: Triple = (Refinement(1, 4), Refinement(2, 2), Refinement(4, 1))


def beside(network: Network) -> list[Refinement]:
    """The runs that tell what those with points in common do not, of those that there can be: elsewhere, early.

    Nothing lies elsewhere that would have no point of its own. No run stops early where FMUs take steps of one size
    only, or where inputs are extrapolated, which is another thing from two samples that are near each other.
    """
    kept = _kept(network)
    found = [Refinement(steps=kept + 1, coarser=kept)] if kept > 1 else []
    schedule, run = network.schedule, network.diagram.run
    couplings = [coupling for component in network.components.values() for coupling in component.couplings.values()]
    fits = run.stop * EARLY < MOST_TICKS * float(schedule.tick) and not any(coupling.order for coupling in couplings)
    return [*found, Refinement(early=kept)] if fits and not network.rigid else found


def _kept(network: Network) -> int:
    """How many steps there are from one point that all runs have in common to the next.

    Ten, if it can be, as times are round numbers, so that an input that changes at 0.3 s does so at such a point; so
    are whatever times the diagram names: the ends of windows, and all periods.
    """
    run = network.diagram.run
    named = [float(e.settings["period"].value) for e in network.diagram.blocks.values() if "period" in e.settings]
    named += [bound for metric in network.diagram.metrics.values() for bound in (metric.start, metric.stop)]
    counts = [count for time in named if math.isfinite(time) and (count := multiple(time, run.step))]
    common = math.gcd(run.steps, *counts)
    return max((count for count in range(2, MOST_KEPT + 1) if common % count == 0), default=common)


def stopping_early(network: Network, every: int) -> Network:
    """A network, made for this, whose master also stops a little before the end of every so many steps."""
    step = exact(network.diagram.run.step)
    changed = replace(network, stops=(Clock(every * step, every * step - step / EARLY),))
    jumps.settle(changed)
    return changed


def settings(network: Network, refinement: Refinement) -> list[str]:
    """What a refinement changes in a diagram, as of --set.

    What is recorded is so at the times at which the diagram says, or at those of them that are whole numbers of steps.
    """
    changed, own = [], network.diagram.run.step
    if refinement != Refinement():
        changed.append(f"run.step={refinement.step(own)!r}")
        if record := network.diagram.record:
            steps = round(record.period / own)
            changed.append(f"record.period={own * math.lcm(steps, refinement.coarser)!r}")
    if refinement.inner > 1:
        changed.append(f"run.inner_steps={network.diagram.run.inner_steps * refinement.inner}")
        changed += [
            f"blocks.{c.name}.inner_steps={c.integration.inner_steps * refinement.inner}" for c in _with_own(network)
        ]
    return changed


def _with_own(network: Network) -> list[Component]:
    """The components with inner steps of their own."""
    own = [c for c in network.components.values() if "inner_steps" in c.entry.settings]
    return [c for c in own if c.declaration.continuous() and network.diagram.run.method != "joint"]


def steps_of_their_own(network: Network) -> list[str]:
    """The components that step by themselves: co-simulation FMUs, whose inner steps are their own."""
    return [name for name, component in network.components.items() if component.declaration.kind("step")]


def why_not_parts(network: Network) -> str:
    """Why the errors of coupling and of integration cannot be told apart; nothing where they can."""
    most = max([network.diagram.run.inner_steps, *(c.integration.inner_steps for c in network.components.values())])
    if alone := steps_of_their_own(network):
        return f"the inner steps of {', '.join(alone)} cannot be halved"
    if not any(c.declaration.continuous() for c in network.components.values()):
        return "no block has continuous states"
    if most * COUPLING[0].inner > MOST_INNER_STEPS:
        return f"there can be no more than {MOST_INNER_STEPS} inner steps"
    return ""


def highest_order(network: Network) -> int:
    """The highest order that theory admits: of the best integrator; an FMU may have any."""
    components = network.components.values()
    if steps_of_their_own(network):
        return max(tableau.order for tableau in INTEGRATORS.values())
    run = network.diagram.run
    used = (
        [run.integrator]
        if run.method == "joint"
        else [c.integration.integrator for c in components if c.declaration.continuous()]
    )
    return max((KNOWN[name].order for name in used), default=1)


def sampled_by_the_step(network: Network) -> dict[str, str]:
    """The components on which a block acts that is sampled at every step, by name, with that block.

    Its period is the step, so that a smaller step makes another system of it: a unit delay has another delay, and noise
    other values. Measures are sampled to see more, and act on nothing.
    """
    readers: dict[str, set[str]] = {}
    for component in network.components.values():
        for source in (source for wires in component.wires.values() for source in wires):
            readers.setdefault(source.component, set()).add(component.name)
    found: dict[str, str] = {}
    for component in network.components.values():
        if _is_sampled_by_the_step(component):
            todo = [component.name]
            while todo:
                name = todo.pop()
                if name not in found:
                    found[name] = component.name
                    todo += readers.get(name, ())
    return found


def _is_sampled_by_the_step(component: Component) -> bool:
    declaration = component.declaration
    sampled = declaration.kind("update") and not (declaration.measuring or declaration.foreign)
    return bool(sampled) and "period" not in component.entry.settings
