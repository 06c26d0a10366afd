"""Eight members of a fleet at a time: the same function for all of them, in the processor's vector instructions.

A kernel takes the arguments of eight members into a *tile* on the stack, in which an element of all eight stands in one
row, has the function done for each *lane* of it, in a loop that LLVM makes one pass of vector instructions, and puts
back what the function writes. The last tile takes the last member several times. The bits are those of one member after
the other: an operation on a vector is the same operation on each of its elements.

`worth` says which functions are done so. Where a lane leaves the domain of an elementary function's core, the members
of its tile are done one after the other.
"""

from __future__ import annotations

import re
from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from typing import TYPE_CHECKING, Any

import llvmlite.binding as llvm

from cosim.compiling import emission
from cosim.compiling.frame import INSTANCES
from cosim.compiling.plain_math import definitions
from cosim.machine import object_code

if TYPE_CHECKING:
    from cosim.compiling.adapters import KernelSource

MEMBERS = 8
LEAST = 3  # members that are worth a tile
LARGEST = 128  # elements of all arguments, of one member

_KINDS = {"float64": "double", "float32": "float", "bool": "i8"}
_KINDS |= {f"{sign}int{bits}": f"i{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)}


_SHORT = {"double": "f64", "float": "f32"}


@dataclass(frozen=True)
class Part:
    """An argument of a function in a tile: so many elements from an offset (bytes) on; slot: its word in the frame."""

    kind: str
    itemsize: int
    elements: int
    offset: int
    slot: int
    written: bool

    @property
    def end(self) -> int:
        """The first byte behind it at which vectors may stand."""
        return self.offset + -(-self.elements * MEMBERS * self.itemsize // 64) * 64


def in_tiles(ir: str, sources: Sequence[KernelSource], name: str) -> str:
    """A module with the kernels of sources whose members may be done in tiles, and are where that is worth it."""
    if not sources:
        return ir
    lanes = emission.scalars(
        definitions.with_declarations(ir), *object_code.host(), [f"{s.symbol}.member" for s in sources]
    )
    worthy = [s for s in sources if worth(lanes, s.symbol)]
    for source in sources:
        ir = ir.replace(f"define i32 @{source.symbol}.member(", f"define internal i32 @{source.symbol}.alone(")
    module = llvm.parse_assembly(
        definitions.with_declarations(ir) + "".join(one_by_one(s.symbol) for s in sources if s not in worthy)
    )
    if worthy:
        module.link_in(llvm.parse_assembly(kernels(str(lanes), {s.symbol: s.parts for s in worthy})))
    return str(module)


def worth(module: Any, symbol: str) -> bool:
    """Whether the function of one lane, optimised, goes straight on, cannot fail, and computes an elementary function.

    For others, taking the arguments into a tile costs more than vectors gain.
    """
    called, ways = set[str](), dict[str, set[str]]()
    for block in module.get_function(f"{symbol}.member").blocks:
        for statement in block.instructions:
            operands = list(statement.operands)
            if statement.opcode == "alloca" or (statement.opcode == "ret" and str(operands[0]) != "i32 0"):
                return False
            if statement.opcode == "call":
                called.add(operands[-1].name)
            if statement.opcode in ("br", "switch"):
                ways[block.name] = {o.name for o in operands if str(o.type) == "label"}
    try:
        TopologicalSorter(ways).prepare()
    except CycleError:
        return False
    elementary = {name for name in called if name.startswith("cosim_")}
    return bool(elementary) and all(name.startswith("llvm.") for name in called - elementary)


# ---- IR ----

#: What numba makes of a function of one lane becomes this; a fault, which it must not have, is written nowhere.
MEMBER = """
define i32 @{symbol}.member(double %time, ptr %tile, i64 %lane, ptr %outside) {{
  %result = alloca i32
  %raised = call i32 @{symbol}.member.numba(ptr %result, ptr null, double %time, ptr %tile, i64 %lane)
  ret i32 %raised
}}
"""

_DECLARED = f"""
declare i64 @llvm.smin.i64(i64, i64)
declare i64 @llvm.vector.reduce.or.v{MEMBERS}i64(<{MEMBERS} x i64>)
declare double @llvm.sqrt.f64(double)
"""
_HEAD = """
declare i32 @{symbol}.range(double, ptr, ptr, i64, i64)
define i32 @{symbol}(double %time, ptr %base, ptr %frame) #90000 {{
begin:
  %tile = alloca [{size} x i8], align 64
  %outside = alloca [{members} x i64], align 64
  %place = getelementptr i64, ptr %frame, i64 {instances}
  %n = load i64, ptr %place
  br label %next
next:
  %first = phi i64 [ 0, %begin ], [ %end, %more ]
  %left = sub i64 %n, %first
  %few = icmp slt i64 %left, {least}
  br i1 %few, label %rest, label %take
rest:
  %status = call i32 @{symbol}.range(double %time, ptr %base, ptr %frame, i64 %first, i64 %n)
  ret i32 %status
take:
  %end = add i64 %first, {members}
  %stop = call i64 @llvm.smin.i64(i64 %end, i64 %n)
  %last = add i64 %stop, -1
  store <{members} x i64> zeroinitializer, ptr %outside
"""
_LANES = """
  br label %lanes
lanes:
  %lane = phi i64 [ 0, %take ], [ %following, %lanes ]
  %mark = getelementptr i64, ptr %outside, i64 %lane
  %done = call i32 @{symbol}.member(double %time, ptr %tile, i64 %lane, ptr %mark)
  %following = add nuw nsw i64 %lane, 1
  %again = icmp ult i64 %following, {members}
  br i1 %again, label %lanes, label %judge, !llvm.loop !90001
judge:
  %marks = load <{members} x i64>, ptr %outside
  %any = call i64 @llvm.vector.reduce.or.v{members}i64(<{members} x i64> %marks)
  %inside = icmp eq i64 %any, 0
  br i1 %inside, label %put, label %singly
singly:
  %failed = call i32 @{symbol}.range(double %time, ptr %base, ptr %frame, i64 %first, i64 %stop)
  %went = icmp slt i32 %failed, 2
  br i1 %went, label %more, label %leave
leave:
  ret i32 %failed
put:
"""
_FOOT = """
  br label %more
more:
  %all = icmp sge i64 %end, %n
  br i1 %all, label %finish, label %next
finish:
  ret i32 0
}
"""
_GROUP = "!90000"
_METADATA = f"""
attributes #90000 = {{ "prefer-vector-width"="512" "min-legal-vector-width"="512" }}
{_GROUP} = distinct !{{}}
!90001 = distinct !{{!90001, !90002, !90003, !90004}}
!90002 = !{{!"llvm.loop.parallel_accesses", {_GROUP}}}
!90003 = !{{!"llvm.loop.unroll.disable"}}
!90004 = !{{!"llvm.loop.vectorize.width", i32 {MEMBERS}}}
"""


def kernels(lanes: str, parts: Mapping[str, Sequence[Part]]) -> str:
    """The IR of kernels that do functions tile by tile. lanes: the optimised IR of one lane of each; parts: by symbol."""
    ir = _parallel(lanes)
    for symbol in parts:
        ir = ir.replace(f"define i32 @{symbol}.member(", f"define internal i32 @{symbol}.member(")
        ir = ir.replace(f"define noundef i32 @{symbol}.member(", f"define internal noundef i32 @{symbol}.member(")
    called = sorted(set(re.findall(r"@cosim_(\w+)_lane\(", ir)))
    declared = [line for line in _DECLARED.splitlines() if line not in ir]
    texts = [_kernel(symbol, parts[symbol]) for symbol in parts]
    for kind in _KINDS.values():
        short, vector, mask = _SHORT.get(kind, kind), f"<{MEMBERS} x {kind}>", f"<{MEMBERS} x i1>"
        pair = (
            f"declare {vector} @llvm.masked.load.v{MEMBERS}{short}.p0(ptr, i32, {mask}, {vector})",
            f"declare void @llvm.masked.store.v{MEMBERS}{short}.p0({vector}, ptr, i32, {mask})",
        )
        declared += [d for d in pair if d not in declared]
    return "\n".join([ir, *declared, *(definitions.lane(name, _GROUP) for name in called), *texts, _METADATA])


def _kernel(symbol: str, parts: Sequence[Part]) -> str:
    """The IR of a kernel that does a function tile by tile."""
    facts = {"symbol": symbol, "members": MEMBERS, "instances": INSTANCES, "least": LEAST}
    lines = [_HEAD.format(size=max((p.end for p in parts), default=64), **facts)]
    for lane in range(MEMBERS):
        lines.append(f"  %ahead{lane} = add i64 %first, {lane}")
        lines.append(f"  %k{lane} = call i64 @llvm.smin.i64(i64 %ahead{lane}, i64 %last)")
    for n, part in enumerate(parts):
        lines += [*_rows(f"a{n}", part), *_gathered(f"a{n}", part)]
    lines.append(_LANES.format(**facts))
    for n, part in enumerate(parts):
        if part.written:
            lines += _scattered(f"a{n}", part)
    return "\n".join([*lines, _FOOT])


def _rows(name: str, part: Part) -> Iterator[str]:
    """Where an argument of each member begins."""
    for word, what in enumerate(("offset", "stride")):
        yield f"  %{name}_{what}_place = getelementptr i64, ptr %frame, i64 {part.slot + word}"
        yield f"  %{name}_{what} = load i64, ptr %{name}_{what}_place"
    yield f"  %{name} = getelementptr i8, ptr %base, i64 %{name}_offset"
    for lane in range(MEMBERS):
        yield f"  %{name}_ahead{lane} = mul i64 %k{lane}, %{name}_stride"
        yield f"  %{name}_m{lane} = getelementptr i8, ptr %{name}, i64 %{name}_ahead{lane}"


def _gathered(name: str, part: Part) -> Iterator[str]:
    """An argument of eight members into its tile."""
    kind = _KINDS[part.kind]
    for begin, size in _chunks(part):
        rows = [f"%{name}_{begin}_m{lane}" for lane in range(MEMBERS)]
        for lane, row in enumerate(rows):
            yield f"  {row}_p = getelementptr i8, ptr %{name}_m{lane}, i64 {begin * part.itemsize}"
        if size == 1:
            before = "poison"
            for lane, row in enumerate(rows):
                yield f"  {row} = load {kind}, ptr {row}_p"
                yield f"  {row}_v = insertelement <{MEMBERS} x {kind}> {before}, {kind} {row}, i64 {lane}"
                before = f"{row}_v"
            columns = [before]
        else:
            for row in rows:
                yield f"  {row} = {_masked('load', kind, size, row)}"
            columns = yield from _transposed(rows, f"{name}_{begin}_in", kind)
        for column in range(size):
            place = f"%{name}_{begin + column}_to"
            offset = part.offset + (begin + column) * MEMBERS * part.itemsize
            yield f"  {place} = getelementptr i8, ptr %tile, i64 {offset}"
            yield f"  store <{MEMBERS} x {kind}> {columns[column]}, ptr {place}, align {part.itemsize * MEMBERS}"


def _scattered(name: str, part: Part) -> Iterator[str]:
    """An argument of eight members out of its tile."""
    kind = _KINDS[part.kind]
    for begin, size in _chunks(part):
        columns = [f"%{name}_{begin + column}_all" for column in range(size)]
        for column, vector in enumerate(columns):
            place = f"%{name}_{begin + column}_to"
            yield f"  {vector} = load <{MEMBERS} x {kind}>, ptr {place}, align {part.itemsize * MEMBERS}"
        places = [f"%{name}_{begin}_m{lane}" for lane in range(MEMBERS)]
        if size == 1:
            for lane, row in enumerate(places):
                yield f"  {row}_w = extractelement <{MEMBERS} x {kind}> {columns[0]}, i64 {lane}"
                yield f"  store {kind} {row}_w, ptr {row}_p"
            continue
        rows = yield from _transposed([*columns, *["poison"] * (MEMBERS - size)], f"{name}_{begin}_out", kind)
        for row, place in zip(rows, places, strict=True):
            yield f"  {_masked('store', kind, size, place, row)}"


def _chunks(part: Part) -> Iterator[tuple[int, int]]:
    """The elements of a part, at most so many at a time as a vector has: from where, and how many."""
    for begin in range(0, part.elements, MEMBERS):
        size = min(MEMBERS, part.elements - begin)
        if size == 2:
            yield begin, 1
            yield begin + 1, 1
        else:
            yield begin, size


def _masked(what: str, kind: str, size: int, place: str, value: str = "") -> str:
    """A load or a store of the first elements of a vector."""
    vector, name = f"<{MEMBERS} x {kind}>", f"@llvm.masked.{what}.v{MEMBERS}{_SHORT.get(kind, kind)}.p0"
    mask = f"<{MEMBERS} x i1> <" + ", ".join(f"i1 {int(k < size)}" for k in range(MEMBERS)) + ">"
    align = 1
    if what == "load":
        return f"call {vector} {name}(ptr {place}_p, i32 {align}, {mask}, {vector} poison)"
    return f"call void {name}({vector} {value}, ptr {place}_p, i32 {align}, {mask})"


def _transposed(rows: Sequence[str], name: str, kind: str) -> Generator[str, None, list[str]]:
    """Columns of eight rows: those of each half of them change places with those of the other half, and so on."""
    vector, done = f"<{MEMBERS} x {kind}>", [*rows]
    for distance in (4, 2, 1):
        for i in range(MEMBERS):
            if i & distance:
                continue
            pair = (done[i], done[i + distance])
            for k, low in ((i, True), (i + distance, False)):
                mask = [_from(p, distance, low) for p in range(MEMBERS)]
                words = ", ".join(f"i32 {word}" for word in mask)
                done[k] = f"%{name}_{distance}_{k}"
                of = f"{vector} {pair[0]}, {vector} {pair[1]}"
                yield f"  {done[k]} = shufflevector {of}, <{MEMBERS} x i32> <{words}>"
    return done


def _from(place: int, distance: int, low: bool) -> int:
    """Which element of two vectors comes to a place of the first one, or of the second, in a step of transposing."""
    if low:
        return MEMBERS + place - distance if place & distance else place
    return MEMBERS + place if place & distance else place + distance


def one_by_one(symbol: str) -> str:
    """The IR of a kernel that does a function for one member after the other."""
    return f"""
define i32 @{symbol}(double %time, ptr %base, ptr %frame) {{
  %place = getelementptr i64, ptr %frame, i64 {INSTANCES}
  %n = load i64, ptr %place
  %status = tail call i32 @{symbol}.range(double %time, ptr %base, ptr %frame, i64 0, i64 %n)
  ret i32 %status
}}
"""


def _parallel(ir: str) -> str:
    """Optimised IR of lanes, as a loop over them may have it: nothing that one of them touches is another's."""
    lines = []
    for line in ir.splitlines():
        if "llvm.experimental.noalias.scope.decl" in line:
            continue  # which the vectoriser takes for an access of memory
        if re.match(r"\s+(%\S+ = load|store) ", line):
            line += f", !llvm.access.group {_GROUP}"
        elif " call " in line:
            line = re.sub(r"@(cosim_\w+)\(", r"@\1_lane(ptr %outside, ", line).replace("@sqrt(", "@llvm.sqrt.f64(")
        lines.append(line)
    return re.sub(r"^target .*$", "", "\n".join(lines), flags=re.MULTILINE)
