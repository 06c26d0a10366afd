"""The C text that is particular to one exported model, behind the generic wrapper: see wrapper/model.h."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from cosim.engine import loop
from cosim.export import model_description
from cosim.export.model import Model, Operations, operations


def layout() -> str:
    """The constants of `cosim.engine.loop` as a header, so that the two cannot drift apart."""
    names = [name for name, value in vars(loop).items() if name.isupper() and isinstance(value, int)]
    lines = [f"    ENGINE_{name.lstrip('_')} = {vars(loop)[name]}," for name in names if not name.startswith("_")]
    return "\n".join(["#ifndef COSIM_LAYOUT_H", "#define COSIM_LAYOUT_H", "enum {", *lines, "};", "#endif", ""])


def model(exported: Model, version: str, token: str, kernels: Sequence[str]) -> str:
    """The constant `model`. kernels: the symbol of each call's function."""
    done = operations(exported)
    image, started = _image(exported, done)
    return "\n".join(
        [
            '#include "model.h"',
            "",
            *(f"int32_t {name}(double, uint8_t *, int64_t *);" for name in dict.fromkeys(kernels)),
            "",
            _array("static const int64_t operations", map(str, done.rows.reshape(-1))),
            _array("static const int64_t banks", map(str, exported.table.banks.reshape(-1))),
            _array("static const Kernel functions", kernels),
            _array("static const char *const labels", (_quote(c.function.name) for c in exported.table.calls)),
            _array("static const char *const blocks", (_quote(c.component) for c in exported.table.calls)),
            _array("static const Started started", started),
            _array("static const int64_t periods", map(str, exported.periods)),
            *_segments(image),
            _array("static const Variable variables", _variables(exported, version)),
            _array("static const Scalar scalars", _scalars(exported) if version == "2.0" else []),
            "",
            *_constant(exported, done, token, len(image), len(started)),
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


def _image(exported: Model, done: Operations) -> tuple[np.ndarray, list[str]]:
    """The arena at first, with shadows behind it, and the rows `Started` that point to them."""
    parts, rows, end = [exported.table.arena], [], exported.table.arena.size
    for operation, signal in done.started:
        variable = exported.of(signal)
        size = variable.size * variable.dtype.itemsize
        place = exported.table.arena[variable.offset : variable.offset + size]
        given = np.full(size, int(exported.started[signal]), np.uint8)
        padding = np.zeros(-2 * size % 8, np.uint8)
        parts += [place, given, padding]
        rows.append(f"{{{operation}, {variable.offset}, {size}, {end}}}")
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


def _variables(exported: Model, version: str) -> Iterator[str]:
    for v in exported.variables:
        phases = model_description.settable(v, version)
        yield f"{{{_quote(v.name)}, {v.offset}, {v.size}, {v.type.upper()}, {v.need}, {phases}, {v.kind}}}"


def _scalars(exported: Model) -> Iterator[str]:
    return (f"{{{scalar.variable}, {scalar.element}}}" for scalar in model_description.scalars(exported))


def _constant(exported: Model, done: Operations, token: str, size: int, started: int) -> Iterator[str]:
    built = exported.table
    yield "const Model model = {"
    yield f"    .token = {_quote(token)},"
    yield f"    .step = {exported.network.diagram.run.step!r},"
    yield f"    .arena_bytes = {-(-size // 8) * 8},"
    yield "    .segments = segments, .n_segments = sizeof segments / sizeof *segments, .words = words,"
    yield "    .operations = operations, .banks = banks, .functions = functions, .labels = labels, .blocks = blocks,"
    yield f"    .n_states = {built.states},"
    yield "    " + " ".join(f".{name.lower()} = {offset}," for name, offset in built.vectors.items())
    for name, (offset, count) in (("published", built.published), ("published32", built.published32)):
        yield f"    .{name} = {offset}, .n_{name} = {count},"
    yield "    " + " ".join(f".{name} = {{{begin}, {end}}}," for name, (begin, end) in done.ranges.items())
    yield f"    .started = started, .n_started = {started}, .periods = periods, .n_periods = {len(exported.periods)},"
    yield f"    .variables = variables, .n_variables = {len(exported.variables)},"
    yield f"    .scalars = scalars, .n_scalars = {sum(v.size for v in exported.variables)},"
    yield "};"
    yield ""
