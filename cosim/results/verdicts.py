"""One sentence on how a result lies to the first of several: for two, `cosim.results.comparison` says more."""

from __future__ import annotations

from cosim.results.comparison import Comparison


def verdict(result: Comparison, tolerance: float) -> str:
    """Whether they agree, and what differs if they do not."""
    if result.same:
        return "the same, bit by bit"
    if result.agrees:
        name, size = result.largest
        return f"agrees; the most is {size:.2g} of its size, in {name}" if size else "agrees"
    found = []
    if result.ended_differently:
        found.append(result.endings[1].status)
    if result.ends:
        ends = ["no sample" if end is None else f"{end:.6g} s" for end in result.ends]
        found.append(f"ends at {ends[1]} instead of {ends[0]}")
    if result.beyond:
        found.append(f"{result.beyond.signal} by more than {tolerance:g} of its size from t = {result.beyond.time:g} s")
    own = sum(map(len, result.only))
    found += [f"{own} signal{'s' if own > 1 else ''} not in both"] if own else []
    found += [f"another {what}: {', '.join(d)}" for what, d in (("shape", result.shapes), ("unit", result.units)) if d]
    found += [f"metrics: {', '.join(result.figures)}"] if result.figures else []
    found += [f"requirements: {', '.join(result.verdicts)}"] if result.verdicts else []
    return f"differs: {'; '.join(found)}"
