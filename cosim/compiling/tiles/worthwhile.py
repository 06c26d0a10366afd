"""Which functions are done for eight members at a time, and why others are not."""

from __future__ import annotations

from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from itertools import chain
from typing import Any


def why_alone(module: Any, symbol: str) -> str:
    """What keeps the function of one lane, optimised, from being done for eight of them at once; "" if nothing does.

    Where it computes no elementary function, taking the arguments into a tile would cost more than vectors gain; what
    only some members compute, they would compute for all.
    """
    calls, ways, reasons = dict[str, set[str]](), dict[str, set[str]](), list[str]()
    for block in module.get_function(f"{symbol}.lane").blocks:
        for statement in block.instructions:
            operands = list(statement.operands)
            if statement.opcode == "alloca":
                reasons.append("it needs memory of its own")
            if statement.opcode == "ret" and str(operands[0]) != "i32 0":
                reasons.append("it may fail")
            if statement.opcode == "call":
                calls.setdefault(block.name, set()).add(operands[-1].name)
        ways[block.name] = {o.name for o in operands if str(o.type) == "label"}
    return next(chain(reasons, _ways(ways), _calls(calls, ways)), "")


def _ways(ways: dict[str, set[str]]) -> Iterator[str]:
    try:
        TopologicalSorter(ways).prepare()
    except CycleError:
        yield "it has a loop of many rounds, or of as many as its values say"


def _calls(calls: dict[str, set[str]], ways: dict[str, set[str]]) -> Iterator[str]:
    called = {name for names in calls.values() for name in names if not name.startswith("llvm.")}
    foreign = sorted(name for name in called if not name.startswith("cosim_"))
    if foreign:
        yield f"it calls {foreign[0]} of the C library"
    if not called:
        yield "it computes no exp, sin or the like, for which it would pay"
    for block, names in calls.items():
        if names & called and _may_be_left_out(block, ways):
            yield f"only some members compute {min(names & called).removeprefix('cosim_')}"


def _may_be_left_out(block: str, ways: dict[str, set[str]]) -> bool:
    """Whether there is a way from the first block to the end of a function that does not lead through one."""
    waiting = [name for name in (next(iter(ways)),) if name != block]
    seen = {*waiting, block}
    while waiting:
        name = waiting.pop()
        if not ways[name]:
            return True
        waiting += ways[name] - seen
        seen |= ways[name]
    return False
