"""Which functions are done for eight members at a time."""

from __future__ import annotations

from graphlib import CycleError, TopologicalSorter
from typing import Any


def is_worthwhile(module: Any, symbol: str) -> bool:
    """Whether the function of one lane, optimised, has no loop, cannot fail, and always computes elementary functions.

    For others, taking the arguments into a tile costs more than vectors gain; what only some members compute, vectors
    would compute for all.
    """
    calls, ways = dict[str, set[str]](), dict[str, set[str]]()
    for block in module.get_function(f"{symbol}.lane").blocks:
        for statement in block.instructions:
            operands = list(statement.operands)
            if statement.opcode == "alloca" or (statement.opcode == "ret" and str(operands[0]) != "i32 0"):
                return False
            if statement.opcode == "call":
                calls.setdefault(block.name, set()).add(operands[-1].name)
        ways[block.name] = {o.name for o in operands if str(o.type) == "label"}
    try:
        TopologicalSorter(ways).prepare()
    except CycleError:
        return False
    elementary = {block for block, names in calls.items() if any(name.startswith("cosim_") for name in names)}
    known = all(name.startswith(("llvm.", "cosim_")) for names in calls.values() for name in names)
    return bool(elementary) and known and not any(_may_be_left_out(block, ways) for block in elementary)


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
