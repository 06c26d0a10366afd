"""Kernels that do a function tile by tile, as LLVM IR around the function of one lane."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from cosim.compiling.frame import INSTANCES
from cosim.compiling.tiles.moving import declarations, gathered, rows, scattered
from cosim.compiling.tiles.parts import LEAST, MEMBERS, TilePart
from cosim.plain_math import definitions

#: What numba makes of a function of one lane becomes this; a fault, which it must not have, is written nowhere.
LANE = """
define i32 @{symbol}.lane(double %time, ptr %tile, i64 %lane, ptr %outside) {{
  %result = alloca i32
  %raised = call i32 @{symbol}.lane.numba(ptr %result, ptr null, double %time, ptr %tile, i64 %lane)
  ret i32 %raised
}}
"""

_DECLARED = (
    "declare i64 @llvm.smin.i64(i64, i64)",
    f"declare i64 @llvm.vector.reduce.or.v{MEMBERS}i64(<{MEMBERS} x i64>)",
    "declare double @llvm.sqrt.f64(double)",
)
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
  %done = call i32 @{symbol}.lane(double %time, ptr %tile, i64 %lane, ptr %mark)
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


def kernels(lanes: str, parts: Mapping[str, Sequence[TilePart]]) -> str:
    """The IR of kernels that do functions tile by tile, from the optimised IR of one lane of each and its parts."""
    ir = _parallel(lanes)
    for symbol in parts:
        ir = re.sub(rf"define (.*@{re.escape(symbol)}\.lane\()", r"define internal \1", ir)
    called = sorted(set(re.findall(r"@cosim_(\w+)_lane\(", ir)))
    wanted = {*_DECLARED, *(text for some in parts.values() for text in declarations(some))}
    declared = sorted(text for text in wanted if text.rpartition("(")[0].split("@")[1] + "(" not in ir)
    kernel = [_kernel(symbol, some) for symbol, some in parts.items()]
    return "\n".join([ir, *declared, *(definitions.lane(name, _GROUP) for name in called), *kernel, _METADATA])


def _kernel(symbol: str, parts: Sequence[TilePart]) -> str:
    """The IR of a kernel that does a function tile by tile."""
    facts = {"symbol": symbol, "members": MEMBERS, "instances": INSTANCES, "least": LEAST}
    lines = [_HEAD.format(size=max((p.end for p in parts), default=64), **facts)]
    for lane in range(MEMBERS):
        lines.append(f"  %ahead{lane} = add i64 %first, {lane}")
        lines.append(f"  %k{lane} = call i64 @llvm.smin.i64(i64 %ahead{lane}, i64 %last)")
    for n, part in enumerate(parts):
        lines += [*rows(f"a{n}", part), *gathered(f"a{n}", part)]
    lines.append(_LANES.format(**facts))
    for n, part in enumerate(parts):
        if part.written:
            lines += scattered(f"a{n}", part)
    return "\n".join([*lines, _FOOT])


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


def text(symbol: str, content: str) -> str:
    """The IR of a text, of ASCII characters, that ends with a zero."""
    return f'@{symbol} = constant [{len(content) + 1} x i8] c"{content}\\00"\n'


def _parallel(ir: str) -> str:
    """Optimised IR of lanes, as a loop over them may have it: nothing that one of them touches is another's."""
    scopes = re.compile(r"^.*@llvm\.experimental\.noalias\.scope\.decl\(.*$", re.MULTILINE)
    access = re.compile(r"^(\s+(?:%\S+ = load|store) .*)$", re.MULTILINE)
    ir = re.sub(r"^target .*$", "", scopes.sub("", ir), flags=re.MULTILINE)  # the vectoriser takes scopes for accesses
    ir = re.sub(r"ptr[^%]*%outside\)", "ptr %outside)", ir)  # which nobody has used so far
    ir = access.sub(rf"\1, !llvm.access.group {_GROUP}", ir)
    ir = re.sub(r"( call .*)@(cosim_\w+)\(", r"\1@\2_lane(ptr %outside, ", ir)
    return re.sub(r"( call .*)@sqrt\(", r"\1@llvm.sqrt.f64(", ir)
