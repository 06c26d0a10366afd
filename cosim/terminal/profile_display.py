"""What a person sees of a run's profile: what its time went to."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import groupby
from typing import TYPE_CHECKING

from cosim.terminal.screen import figures_table, print_wrapped

if TYPE_CHECKING:
    from cosim.profiling.profile import Cost, Profile


def show(profile: Profile) -> None:
    """Print a table of what a step's time goes to, how that was measured, and what the start took."""
    print()
    rows = [row for costs in _groups(profile) for row in _rows(costs)]
    rows.append(["in all", f"{profile.microseconds:.3f}", "100.0 %", ""])
    figures_table(["spent on", "µs a step", "share", "calls a step"], rows)
    print()
    print_wrapped(profile.measured, 0)
    print_fleets({**dict.fromkeys(profile.vectors, ""), **profile.alone})
    start = ", ".join(f"{part} {seconds:.3g} s" for part, seconds in profile.start.items())
    print_wrapped(f"start: {start}", 2)
    made = [f"{module.name} {module.seconds:.3g} s" for module in profile.compiled if not module.cached]
    found = [module.name for module in profile.compiled if module.cached]
    if made:
        print_wrapped(f"compiled: {', '.join(made)}", 2)
    if found:
        print_wrapped(f"compiled before, from the cache: {', '.join(found)}", 2)


def print_fleets(functions: Mapping[str, str]) -> None:
    """Print which functions of fleets are done for eight members at a time, and why others, by name, are not."""
    reasons = dict.fromkeys(sorted(functions.values(), key=bool))  # the empty one first
    for reason in reasons:
        how = f"one member after the other, as {reason}" if reason else "eight members of a fleet at a time"
        print_wrapped(f"for {how}: {', '.join(name for name, why in functions.items() if why == reason)}", 2)


def _groups(profile: Profile) -> list[list[Cost]]:
    """The costs of each block together, the dearest block first."""
    by_name = sorted(profile.costs, key=lambda cost: cost.name)
    groups = [list(costs) for _, costs in groupby(by_name, lambda cost: cost.name)]
    return sorted(groups, key=lambda costs: -sum(cost.microseconds for cost in costs))


def _rows(costs: list[Cost]) -> Iterator[list[str]]:
    """The row of a block, and where it has several functions one for each."""
    alone = costs[0]
    if len(costs) == 1:
        yield _row(f"{alone.name}, {alone.function}" if alone.function else alone.name, costs)
        return
    yield _row(alone.name, costs)
    for cost in sorted(costs, key=lambda cost: -cost.microseconds):
        yield _row(f"  {cost.function}", [cost])


def _row(name: str, costs: list[Cost]) -> list[str]:
    microseconds, share = (sum(getattr(cost, key) for cost in costs) for key in ("microseconds", "share"))
    calls = f"{costs[0].calls:.4g}" if len(costs) == 1 and costs[0].calls is not None else ""
    return [name, f"{microseconds:.3f}", f"{100.0 * share:.1f} %", calls]
