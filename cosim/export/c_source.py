"""The C text that is particular to one exported model, behind the generic wrapper: see wrapper/model.h."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from cosim.export.model import PHASES, Model, rows
from cosim.export.model_description import ModelDescription
from cosim.master import tables


def layout() -> str:
    """The constants of `cosim.master.tables` as a header, so that the two cannot drift apart."""
    names = {name: value for name, value in vars(tables).items() if name.isupper() and isinstance(value, int)}
    names |= {name: number for number, name in enumerate(PHASES)}
    lines = [f"    ENGINE_{name} = {value}," for name, value in names.items() if not name.startswith("_")]
    return "\n".join(["#ifndef COSIM_LAYOUT_H", "#define COSIM_LAYOUT_H", "enum {", *lines, "};", "#endif", ""])


def model(description: ModelDescription, token: str, kernels: Sequence[str]) -> str:
    """The constant `model`. kernels: the symbol of each call's function."""
    exported = description.model
    done = rows(exported)
    image, started = _image(exported)
    return "\n".join(
        [
            '#include "model.h"',
            "",
            *(f"int32_t {name}(double, uint8_t *, int64_t *);" for name in dict.fromkeys(kernels)),
            "",
            _array("static const int64_t rows", map(str, done.rows.reshape(-1))),
            _array("static const Range phases", (f"{{{begin}, {end}}}" for begin, end in done.phases)),
            _array("static const int64_t banks", map(str, exported.program.banks.reshape(-1))),
            _array("static const Kernel functions", kernels),
            _array("static const char *const labels", (_quote(c.function.name) for c in exported.program.calls)),
            _array("static const char *const blocks", (_quote(c.component) for c in exported.program.calls)),
            _array("static const Started started", started),
            *_segments(image),
            _array("static const Variable variables", _variables(description)),
            _array("static const Scalar scalars", _scalars(description)),
            "",
            *_constant(exported, token, len(image), len(started)),
        ]
    )


def _array(declaration: str, rows: Iterable[str]) -> str:
    """A C array; of one zero where there are no rows, as C has no empty arrays."""
    lines = list(rows) or ["0"]
    return f"{declaration}[] = {{\n" + "".join(f"    {line},\n" for line in lines) + "};"


def _quote(text: str) -> str:
    """A C string. In FMI's log messages, `#` has to be doubled."""
    safe = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n").replace("#", "##")
    return f'"{safe}"'


def _image(exported: Model) -> tuple[np.ndarray, list[str]]:
    """The arena at first, with shadows behind it, and the rows `Started` that point to them."""
    parts, rows, end = [exported.program.arena], [], exported.program.arena.size
    for row, signal in exported.program.started:
        variable = exported.of(signal)
        size = variable.size * variable.dtype.itemsize
        place = exported.program.arena[variable.offset : variable.offset + size]
        given = np.full(size, int(exported.started[signal]), np.uint8)
        padding = np.zeros(-2 * size % 8, np.uint8)
        parts += [place, given, padding]
        rows.append(f"{{{row}, {variable.offset}, {size}, {end}}}")
        end += 2 * size + padding.size
    return np.concatenate(parts), rows


def _segments(image: np.ndarray) -> Iterator[str]:
    """The words that are not zero, in runs."""
    words = np.concatenate([image, np.zeros(-image.size % 8, np.uint8)]).view(np.uint64)
    used = np.flatnonzero(words)
    runs = np.split(used, np.flatnonzero(np.diff(used) > 2) + 1) if used.size else []
    rows: list[str] = []
    content: list[str] = []
    for run in runs:
        begin, end = int(run[0]), int(run[-1]) + 1
        rows.append(f"{{{8 * begin}, {len(content)}, {end - begin}}}")
        content += [f"{int(word):#x}" for word in words[begin:end]]
    yield _array("static const Segment segments", rows)
    yield _array("static const uint64_t words", content)


def _variables(description: ModelDescription) -> Iterator[str]:
    for v in description.model.variables:
        phases = description.settable(v)
        yield f"{{{_quote(v.name)}, {v.offset}, {v.size}, {v.type.upper()}, {v.need}, {phases}, {v.kind}}}"


def _scalars(description: ModelDescription) -> Iterator[str]:
    return (f"{{{scalar.variable}, {scalar.element}}}" for scalar in description.scalars)


def _constant(exported: Model, token: str, size: int, started: int) -> Iterator[str]:
    built, schedule = exported.program, exported.network.schedule
    yield "const Model model = {"
    yield f"    .token = {_quote(token)},"
    yield f"    .step = {exported.network.diagram.run.step!r},"
    yield f"    .tick = {float(schedule.tick)!r}, .grid = {schedule.grid},"
    yield f"    .arena_bytes = {-(-size // 8) * 8},"
    yield "    .segments = segments, .n_segments = sizeof segments / sizeof *segments, .words = words,"
    yield "    .rows = rows, .phases = phases, .banks = banks,"
    yield "    .functions = functions, .labels = labels, .blocks = blocks,"
    yield f"    .n_states = {built.layout.states},"
    yield "    " + " ".join(f".{name.lower()} = {offset}," for name, offset in built.layout.vectors.items())
    for name, kind in (("published", "float64"), ("published32", "float32")):
        offset, count = built.layout.published[kind]
        yield f"    .{name} = {offset}, .n_{name} = {count},"
    yield f"    .started = started, .n_started = {started},"
    yield f"    .clocks = {built.clocks}, .n_clocks = {len(schedule.clocks)},"
    yield f"    .variables = variables, .n_variables = {len(exported.variables)},"
    yield f"    .scalars = scalars, .n_scalars = {sum(v.size for v in exported.variables)},"
    yield "};"
    yield ""
