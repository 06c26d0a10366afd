"""From an author's function to the source of a kernel: frame -> arrays -> the function, for each instance."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache, partial
from typing import Any

from cosim.authoring.declaration import BEGINNING, Declaration, Function, is_scalar, variable_of
from cosim.authoring.lowering.axis_sizes import Size
from cosim.authoring.lowering.block_functions import lowered
from cosim.compiling.fingerprint.own_files import files_text
from cosim.compiling.fingerprint.text import fingerprint
from cosim.compiling.frame import INSTANCES, Frame, frame_of
from cosim.compiling.tiles.parts import LARGEST, MEMBERS, TilePart


@dataclass(frozen=True)
class KernelSource:
    """A function to be compiled: its symbol, how to get it as Python `(time, base, frame)`, what its code depends on.

    meaning: what it computes depends on, which its lines are no part of.

    lanes: as Python `(time, tile, lane)` for one lane of a tile, with the tile's parts, where members of a fleet may be
    done eight at a time; `build` is then `(time, base, frame, first, last)`, for some of the members.

    disjoint: base and frame, and the arrays that it makes of them, are reached in no other way while it runs, so that
    what is written to one of them changes no other. checked: it is an author's, so that its indices are checked.
    absent: functions that it never comes to call, each with what is compiled in its place.
    python: the function that is compiled. place, who: file:line and name of the author's.
    """

    symbol: str
    python: Callable[..., Any]
    build: Callable[[], Callable[..., int]]
    fingerprint: str
    meaning: Callable[[], str]
    disjoint: bool = False
    checked: bool = False
    absent: Mapping[Any, Any] = field(default_factory=dict)
    place: str = ""
    who: str = ""
    lanes: Callable[[], Callable[..., int]] | None = None
    parts: tuple[TilePart, ...] = ()

    @property
    def symbols(self) -> tuple[str, ...]:
        """What is found in the object code by name."""
        return (self.symbol, f"{self.symbol}.alone") if self.lanes else (self.symbol,)


def block_source(
    declaration: Declaration, function: Function, constants: dict[str, int], fleet: bool = False
) -> KernelSource:
    """The kernel around one function of a block. fleet: of several members, which may be done eight at a time."""
    parts = _parts(declaration, function, constants) if fleet else ()
    text = adapter_text(declaration, function, constants, tiled=bool(parts))
    lane = lane_text(declaration, function, constants, parts) if parts else ""
    run = lowered(declaration, function)
    digest = fingerprint(function.python, lines=True) + (fingerprint(run.python, lines=True) if run.changed else "")

    def meaning() -> str:
        return fingerprint(function.python) + (fingerprint(run.python) if run.changed else "") + text + lane

    def adapter(text: str) -> Callable[..., int]:
        return _adapter(text, f"{declaration.name}.{function.name}", run.python)

    def build() -> Callable[..., int]:
        from cosim.authoring import authors

        authors.check([declaration], function)
        return adapter(text)

    # A block never reads what it writes in the same call: an input that its own output feeds is a copy.
    code = function.python.__code__
    return KernelSource(
        function.name,
        run.python,
        build,
        digest + text + lane + _declared(declaration, function),
        meaning,
        disjoint=True,
        checked=True,
        place=f"{code.co_filename}:{code.co_firstlineno}",
        who=f"{declaration.name}.{function.name}()",
        lanes=partial(adapter, lane) if parts else None,
        parts=parts,
    )


def _declared(declaration: Declaration, function: Function) -> str:
    """What the check of a function depends on beside its code: found compiled, it has been checked."""
    variables = [(name, type(v).__name__, v.shape) for name, v in declaration.variables.items()]
    return repr((function.kind, sorted(function.writes), sorted(variables)))


def adapter_text(declaration: Declaration, function: Function, constants: dict[str, int], tiled: bool = False) -> str:
    """Source of the kernel around one function: frame -> arrays -> the author's function, for each instance.

    tiled: for the instances of a range, and with arrays of the type that those of a tile have, so that numba looks at
    the function once.
    """
    frame = frame_of(declaration, function, constants)
    lines = [f"def adapter(time, base, frame{', first, last' if tiled else ''}):"]
    lines += [f"    {name}_size = size(frame[{word}])" for name, word in frame.dimensions.items()]
    lines += _temporaries(declaration, function, constants, frame)
    lines += [f"    for k in range({'first, last' if tiled else f'frame[{INSTANCES}]'}):", "        instance(k)"]
    for argument, slot in frame.slots.items():
        place = f"base, frame[{slot}] + k * frame[{slot + 1}]"
        lines.append(f"        {argument}_ = {_given(declaration, function, constants, argument, place, int(tiled))}")
    return _called(lines, declaration, function, " " * 8)


def lane_text(
    declaration: Declaration, function: Function, constants: dict[str, int], parts: tuple[TilePart, ...]
) -> str:
    """Source of the author's function for one lane of a tile."""
    lines = ["def adapter(time, tile, lane):"]
    arguments = [name for name in function.arguments if name != "time"]
    for argument, part in zip(arguments, parts, strict=True):
        place = f"tile, {part.offset} + lane * {part.itemsize}"
        lines.append(f"    {argument}_ = {_given(declaration, function, constants, argument, place, MEMBERS)}")
    return _called(lines, declaration, function, " " * 4)


def _given(
    declaration: Declaration, function: Function, constants: dict[str, int], argument: str, place: str, apart: int
) -> str:
    """What makes an argument of the memory at a place.

    apart: how far an element is from the next one, in elements, for arrays that say so; 0: for such as numba's own.
    """
    variable = variable_of(declaration, argument)
    kind = variable.dtype.name
    if is_scalar(variable, function, argument):
        return f"widened(load_{kind}({place}))"
    sizes = [str(constants.get(d, f"{d}_size")) if isinstance(d, str) else str(d) for d in variable.shape]
    memory = f"pointer_{kind}({place}), ({', '.join(sizes or ['1'])},)"
    view = f"strided({memory}, {apart * variable.dtype.itemsize})" if apart else f"array({memory})"
    return view if argument in function.writes else f"read_only({view})"


def _called(lines: list[str], declaration: Declaration, function: Function, indent: str) -> str:
    """The source with a call of the author's function at its end."""
    given = (*function.arguments, *(t.name for t in lowered(declaration, function).temporaries))
    call = ", ".join("time" if a == "time" else f"{a}_" for a in given)
    return "\n".join([*lines, f"{indent}function({call})", "    return 0", ""])


def _parts(declaration: Declaration, function: Function, constants: dict[str, int]) -> tuple[TilePart, ...]:
    """The arguments of a function in a tile; none where it has memory of its own, or sizes of a run.

    None either where it is called before the first step only, which is not worth it.
    """
    frame = frame_of(declaration, function, constants)
    if function.kind in BEGINNING or frame.dimensions or lowered(declaration, function).temporaries:
        return ()
    parts = list[TilePart]()
    for argument, slot in frame.slots.items():
        variable = variable_of(declaration, argument)
        elements = math.prod(constants[d] if isinstance(d, str) else d for d in variable.shape)
        begin = parts[-1].end if parts else 0
        kind, written = variable.dtype, argument in function.writes
        parts.append(TilePart(kind.name, kind.itemsize, elements, begin, slot, written))
    return tuple(parts) if sum(p.elements for p in parts) <= LARGEST else ()


def _temporaries(
    declaration: Declaration, function: Function, constants: dict[str, int], frame: Frame
) -> Iterator[str]:
    """The lines that make arrays of what a function needs memory for; all instances share it."""
    for temporary in lowered(declaration, function).temporaries:
        kind = temporary.kind.element
        sizes = [_size(size, constants) for size in temporary.kind.shape]
        if slot := frame.work.get(temporary.name):
            pointer = f"pointer_{kind}(base, frame[{slot}])"
        else:
            pointer = f"stack_{kind}({math.prod(size.of(constants) for size in temporary.kind.shape)})"
        yield f"    {temporary.name}_ = array({pointer}, ({', '.join(sizes)},))"


def _size(size: Size, constants: dict[str, int]) -> str:
    """A size as a text, of numbers and of the sizes of run-time dimensions."""
    if size.dimensions() <= {*constants}:
        return str(size.of(constants))
    terms = [f"{factor} * {constants.get(name, f'{name}_size')}" for name, factor in size.terms]
    return " + ".join([*terms, str(size.number)])


def _adapter(text: str, name: str, function: Callable[..., Any]) -> Callable[..., int]:
    """What a text of ours makes of a function that it calls `function`. name: what it is for."""
    from cosim.compiling import arithmetic, intrinsics

    scope: dict[str, Any] = {**vars(intrinsics), "widened": arithmetic.widened, "function": function}
    exec(compile(text, f"<adapter of {name}>", "exec"), scope)  # noqa: S102
    adapter: Callable[..., int] = scope["adapter"]
    return adapter


@cache
def raw_source(
    module: str, entry: Callable[[float, int, int], int], absent: tuple[Any, ...] = (), instead: Any = None
) -> KernelSource:
    """The kernel around a function of a time and two addresses, of the base and of the frame.

    Such functions are this package's own and stay as they are: what one reaches is known by the text of the files.
    absent: what of that it never comes to call; `instead` is compiled in the place of each.
    """
    name = entry.__name__
    text = "def adapter(time, base, frame):\n    return function(time, address_of(base), address_of(frame))\n"
    left_out = "".join(f"# without {f.__module__}.{f.__qualname__}\n" for f in absent)
    digest = files_text(entry) + (files_text(instead) if absent else "") + left_out + text
    build = partial(_adapter, text, f"{module}.{name}", entry)
    return KernelSource(
        name, entry, build, digest, lambda: fingerprint(entry) + text, absent=dict.fromkeys(absent, instead)
    )
