"""Whether the members of a fleet go their own ways: what one of them is changes nothing of another."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from cosim.errors import Problems, TooLarge
from cosim.integrators import REFERENCES
from cosim.wiring import sizes
from cosim.wiring.network import Component, Network, Signal

MOST_STATES = 2000
"""That an implicit integrator solves for together: beyond, a step takes seconds."""


def are_apart(network: Network) -> bool:
    """Whether what the continuous states do to derivatives, through all blocks between, stays with each member.

    That asks for one fleet, whose blocks read each other member by member. What is sampled holds its values meanwhile.
    """
    live = {name: c for name, c in network.components.items() if not c.is_sampled}
    wires = [(c, p, s) for c in live.values() for p, sources in c.wires.items() for s in sources if s.component in live]
    forth, back = dict[str, set[str]](), dict[str, set[str]]()
    for component, _, source in wires:
        forth.setdefault(source.component, set()).add(component.name)
        back.setdefault(component.name, set()).add(source.component)
    owners = [name for name, component in live.items() if component.declaration.continuous()]
    between = _reached(owners, forth) & _reached(owners, back)
    if len({live[name].fleet for name in between} - {None}) != 1 or any(live[name].fleet is None for name in between):
        return False
    return all(_is_own(network, c, p, s) for c, p, s in wires if c.name in between and s.component in between)


def _reached(begin: Iterable[str], ways: Mapping[str, set[str]]) -> set[str]:
    """Where ways lead to, and where they begin."""
    found, waiting = set[str](), [*begin]
    while waiting:
        name = waiting.pop()
        if name not in found:
            found.add(name)
            waiting += ways.get(name, ())
    return found


def _is_own(network: Network, component: Component, port: str, source: Signal) -> bool:
    """Whether each member reads the same member of a source."""
    rank = len(component.shape(component.declaration.variables[port]))
    return source.members is None and not component.is_joined(port) and len(network.shape(source)) == rank + 1


def report_large(network: Network, problems: Problems) -> None:
    """Report what an implicit integrator cannot solve for: too many states that depend on each other."""
    run = network.diagram.run
    owners = [c for c in network.components.values() if c.declaration.continuous()]
    for bank in [owners] if run.method == "joint" else [[component] for component in owners]:
        if not bank or not bank[0].integration.method.is_implicit:
            continue
        apart = run.method != "joint" or (are_apart(network) and run.integrator not in REFERENCES)
        members = bank[0].count if apart else 1
        states = sum(_states(component) for component in bank) // members
        whose = f"block {bank[0].name}: its" if len(bank) == 1 else "the"
        node = {**run.nodes, **bank[0].entry.settings}["integrator"]
        fix = "take an explicit integrator, or another run.method, which solves block by block"
        if states > MOST_STATES:
            message = f"{whose} {states} states depend on each other, and an implicit integrator solves for all at once"
            problems.add(TooLarge(message, node.place, f"at most {MOST_STATES}: {fix}"))
        else:
            what = f"{whose} matrices of an implicit integrator"
            problems.attempt(sizes.require, sizes.COPIES * 16 * members * states**2, what, node.place, fix)


def _states(component: Component) -> int:
    return sum(component.count * component.nbytes(state) // 8 for state in component.declaration.continuous())
