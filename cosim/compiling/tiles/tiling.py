"""Eight members of a fleet at a time: the same function for all of them, in the processor's vector instructions.

A kernel takes the arguments of eight members into a tile on the stack, has the function done for each *lane* of it, in
a loop that LLVM makes one pass of vector instructions, and puts back what the function writes. The last tile has its
last member several times. The bits are those of one member after the other: an operation on a vector is the same
operation on each of its elements.

Where a lane leaves the domain of an elementary function's core, the members of its tile are done one after the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import llvmlite.binding as llvm

from cosim.compiling import emission
from cosim.compiling.tiles import kernel_ir
from cosim.compiling.tiles.worthwhile import why_alone
from cosim.machine import object_code
from cosim.plain_math import definitions

if TYPE_CHECKING:
    from cosim.compiling.adapters import KernelSource


def in_tiles(ir: str, sources: Sequence[KernelSource]) -> str:
    """A module with the kernels of sources that have lanes, which are done in tiles where that is worth it.

    ir: with `SYMBOL.range`, the function for some members, and `SYMBOL.lane`, for one lane, of each. What keeps one
    from being done in tiles is the text `SYMBOL.alone`, which is empty for the others.
    """
    if not sources:
        return ir
    declared, alone = definitions.with_declarations(ir), [f"{source.symbol}.lane" for source in sources]
    lanes = emission.scalars(declared, *object_code.host(), alone)
    reasons = {s.symbol: why_alone(lanes, s.symbol) for s in sources}
    worthy = {s.symbol: s.parts for s in sources if not reasons[s.symbol]}
    for symbol in alone:
        declared = declared.replace(f"define i32 @{symbol}(", f"define internal i32 @{symbol}.unused(")
    texts = [kernel_ir.text(f"{symbol}.alone", reason) for symbol, reason in reasons.items()]
    others = [kernel_ir.one_by_one(symbol) for symbol, reason in reasons.items() if reason]
    module = llvm.parse_assembly("".join([declared, *texts, *others]))
    if worthy:
        module.link_in(llvm.parse_assembly(kernel_ir.kernels(str(lanes), worthy)))
    return str(module)
