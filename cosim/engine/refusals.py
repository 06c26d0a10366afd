"""What FMUs of a network are asked for and cannot do, told before anything runs."""

from __future__ import annotations

from cosim.errors import FmuError
from cosim.wiring.network import Network


def refuse_what_cannot_go_back(network: Network) -> None:
    """Raises: FmuError for an FMU that cannot go back to a state."""
    watched, stuck, run = network.watched, network.stuck, network.diagram.run
    if not stuck:
        return
    events = f", and so does finding the events of {watched[0].name}" if watched else ""
    message = f"block {stuck[0].name}: this FMU cannot go back to a state, which repeating a step needs{events}"
    fix = "choose another run.method, or model exchange"
    if run.coupling_tolerance:
        fix = "write run.rollback: false, so that only the next step is shorter"
    raise FmuError(message, stuck[0].entry.type.position, "use another FMU" if watched else fix)


def refuse_steps_of_one_size(network: Network) -> None:
    """Raises: FmuError for an FMU that takes steps of one size only, where steps are of several."""
    schedule, run = network.schedule, network.diagram.run
    due = {c.name: (c.clock.period, c.clock.offset) for c in network.components.values() if c.clock}
    off = [name for name, times in due.items() if any(schedule.ticks(time) % schedule.grid for time in times)]
    why, fix = "", "use another FMU, or model exchange"
    if network.watched:
        why = f"{network.watched[0].name} has events, which end steps"
    elif run.coupling_tolerance is not None:
        why, fix = (
            "run.coupling_tolerance chooses steps",
            "remove run.coupling_tolerance, or use model exchange",
        )
    elif off:
        why = f"{off[0]} is due between the multiples of run.step"
        fix = "choose a run.step of which all periods and offsets are multiples, or use model exchange"
    if network.rigid and why:
        message = f"block {network.rigid[0].name}: this FMU takes steps of one size only, and {why}"
        raise FmuError(message, network.rigid[0].entry.type.position, fix)
