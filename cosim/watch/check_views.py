"""What `cosim check` says of a diagram, as the page shows it."""

from __future__ import annotations

from cosim.watch.orders import View
from cosim.wiring.network import Finding, Network
from cosim.wiring.overview import Overview

WORDS = {True: "holds", False: "fails", None: "open"}


def view(network: Network, overview: Overview) -> View:
    """Everything that is known without a run; `findings` of those that only a run judges is added by that."""
    run, count = network.diagram.run, len(overview.diagram.blocks)
    said = [f"{count} block{'' if count == 1 else 's'}, valid"]
    said.append(f"{run.method}, {run.stop:g} s in {run.steps} steps of {run.step:g} s")
    if overview.first_order:
        said.append("inputs are held over a step: coupling is of first order, whatever the integrators' order")
    said += [str(swap) for swap in overview.swaps]
    for ring in overview.loops:
        when = " at initialization" if ring.first else ""
        said.append(f"an algebraic loop{when}, solved for {', '.join(ring.torn)}: {', '.join(ring.tasks)}")
    if due := [f"{part.name} {part.due}" for part in overview.parts if part.due]:
        said.append(f"sampled, and held between: {', '.join(due)}")
    return {"said": said, "order": list(overview.order), "findings": findings(overview.findings)}


def findings(found: tuple[Finding, ...] | list[Finding]) -> list[View]:
    """Conditions, with their numbers."""
    return [{"word": WORDS[finding.holds], "holds": finding.holds, "text": finding.summary} for finding in found]
