"""Arguments of eight members into a tile, and out of it: LLVM IR.

Eight elements of a member at a time are read as one vector, and eight such vectors transposed.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence

from cosim.compiling.tiles.parts import MEMBERS, TilePart

_KINDS = {"float64": "double", "float32": "float", "bool": "i8"}
_KINDS |= {f"{sign}int{bits}": f"i{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)}
_SHORT = {"double": "f64", "float": "f32"}


def declarations(parts: Sequence[TilePart]) -> set[str]:
    """What moving parts declares."""
    found = set[str]()
    for kind in {_KINDS[part.kind] for part in parts}:
        vector, mask, tail = f"<{MEMBERS} x {kind}>", f"<{MEMBERS} x i1>", f"v{MEMBERS}{_SHORT.get(kind, kind)}.p0"
        found.add(f"declare {vector} @llvm.masked.load.{tail}(ptr, i32, {mask}, {vector})")
        found.add(f"declare void @llvm.masked.store.{tail}({vector}, ptr, i32, {mask})")
    return found


def rows(name: str, part: TilePart) -> Iterator[str]:
    """Where an argument of each member begins."""
    for word, what in enumerate(("offset", "stride")):
        yield f"  %{name}_{what}_place = getelementptr i64, ptr %frame, i64 {part.slot + word}"
        yield f"  %{name}_{what} = load i64, ptr %{name}_{what}_place"
    yield f"  %{name} = getelementptr i8, ptr %base, i64 %{name}_offset"
    for lane in range(MEMBERS):
        yield f"  %{name}_ahead{lane} = mul i64 %k{lane}, %{name}_stride"
        yield f"  %{name}_m{lane} = getelementptr i8, ptr %{name}, i64 %{name}_ahead{lane}"


def gathered(name: str, part: TilePart) -> Iterator[str]:
    """An argument of eight members into its tile."""
    kind = _KINDS[part.kind]
    for begin, size in _chunks(part):
        members = [f"%{name}_{begin}_m{lane}" for lane in range(MEMBERS)]
        for lane, row in enumerate(members):
            yield f"  {row}_p = getelementptr i8, ptr %{name}_m{lane}, i64 {begin * part.itemsize}"
        if size == 1:
            before = "poison"
            for lane, row in enumerate(members):
                yield f"  {row} = load {kind}, ptr {row}_p"
                yield f"  {row}_v = insertelement <{MEMBERS} x {kind}> {before}, {kind} {row}, i64 {lane}"
                before = f"{row}_v"
            columns = [before]
        else:
            for row in members:
                yield f"  {row} = {_masked('load', kind, size, row)}"
            columns = yield from _transposed(members, f"{name}_{begin}_in", kind)
        for column in range(size):
            place = f"%{name}_{begin + column}_to"
            offset = part.offset + (begin + column) * MEMBERS * part.itemsize
            yield f"  {place} = getelementptr i8, ptr %tile, i64 {offset}"
            yield f"  store <{MEMBERS} x {kind}> {columns[column]}, ptr {place}, align {part.itemsize * MEMBERS}"


def scattered(name: str, part: TilePart) -> Iterator[str]:
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


def _chunks(part: TilePart) -> Iterator[tuple[int, int]]:
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
    if what == "load":
        return f"call {vector} {name}(ptr {place}_p, i32 1, {mask}, {vector} poison)"
    return f"call void {name}({vector} {value}, ptr {place}_p, i32 1, {mask})"


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
