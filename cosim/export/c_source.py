"""The C text that is particular to one exported model, behind the generic wrapper: see wrapper/model.h."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cosim.engine.program import Program
from cosim.export.model import Model
from cosim.export.model_description import ModelDescription
from cosim.export.phases import PHASES, Rows, rows
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
    done = rows(exported.program)
    image = _Image([exported.program.arena], exported.program.arena.size)
    listed = {
        "loops": ("Unsolved", list(_loops(done))),
        "guesses": ("Guess", list(_guesses(exported.program, image))),
        "started": ("Started", list(_started(exported, image))),
        "variables": ("Variable", list(_variables(description))),
        "items": ("Item", list(_items(description))),
    }
    return "\n".join(
        [
            '#include "model.h"',
            "",
            "#include <stddef.h>",
            "",
            *(f"KERNEL int32_t {name}(double, uint8_t *, int64_t *);" for name in dict.fromkeys(kernels)),
            "",
            _array("static const int64_t rows", map(str, done.rows.reshape(-1))),
            _array("static const Range phases", (f"{{{begin}, {end}}}" for begin, end in done.phases)),
            _array("static const int64_t control", map(str, exported.program.control())),
            _array("static const int64_t banks", map(str, exported.program.banks.reshape(-1))),
            _array("static const Kernel functions", kernels),
            _array("static const char *const labels", (_quote(c.function.name) for c in exported.program.calls)),
            _array("static const char *const blocks", (_quote(c.component) for c in exported.program.calls)),
            *_segments(np.concatenate(image.parts)),
            *_numbers(exported),
            *(_array(f"static const {kind} {name}", lines) for name, (kind, lines) in listed.items()),
            "",
            *_constant(exported, token, image.end, {name: len(lines) for name, (_, lines) in listed.items()}),
        ]
    )


def _array(declaration: str, rows: Iterable[str]) -> str:
    """A C array; of one zero where there are no rows, as C has no empty arrays."""
    lines = list(rows) or ["0"]
    return f"{declaration}[] = {{\n" + "".join(f"    {line},\n" for line in lines) + "};"


def _quote(text: str) -> str:
    """A C string. In FMI's log messages, `#` has to be doubled."""
    safe = text.replace("\\", "\\\\").replace("?", "\\?").replace('"', '\\"').replace("\n", "\\n").replace("#", "##")
    return f'"{safe}"'


def _loops(done: Rows) -> Iterator[str]:
    for row, loop in done.loops.items():
        blocks, torn = dict.fromkeys(task.component for task in loop.tasks), ", ".join(map(str, loop.torn))
        yield f"{{{row}, {_quote(', '.join(blocks))}, {_quote(torn)}}}"


@dataclass
class _Image:
    """The arena at first, and behind it what FMUs have besides: `parts`, which end at `end`."""

    parts: list[np.ndarray]
    end: int

    def add(self, content: np.ndarray) -> int:
        """The offset of more bytes."""
        offset, padding = self.end, np.zeros(-content.size % 8, np.uint8)
        self.parts += [content, padding]
        self.end += content.size + padding.size
        return offset


def _started(exported: Model, image: _Image) -> Iterator[str]:
    """The rows `Started`, with the shadows of the states that they name."""
    program = exported.program
    for row, signal in program.started:
        offset, size = program.places[signal].offset, program.layout.bytes_of(signal)
        given = np.full(size, int(exported.started[signal]), np.uint8)
        shadow = image.add(np.concatenate([program.arena[offset : offset + size], given]))
        yield f"{{{row}, {offset}, {size}, {shadow}}}"


def _guesses(program: Program, image: _Image) -> Iterator[str]:
    for signal in dict.fromkeys(signal for loop in program.loops.values() for signal in loop.torn):
        size = program.layout.bytes_of(signal)
        yield f"{{{program.places[signal].offset}, {size}, {image.add(np.zeros(size, np.uint8))}}}"


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


_NUMBERS = ("nominal", "min", "max")


def _numbers(exported: Model) -> Iterator[str]:
    """The nominal values and limits of every element, of the variables that have some."""
    for k, v in enumerate(exported.variables):
        for key in _NUMBERS:
            if (numbers := getattr(v, key)) is not None:
                yield _array(f"static const double {key}{k}", (repr(float(n)) for n in numbers.reshape(-1)))


def _variables(description: ModelDescription) -> Iterator[str]:
    for k, v in enumerate(description.model.variables):
        numbers = ", ".join("NULL" if getattr(v, key) is None else f"{key}{k}" for key in _NUMBERS)
        fields = f"{v.offset}, {v.size}, {v.type.upper()}, {v.need}, {description.settable(v)}, {v.kind}"
        yield f"{{{_quote(v.name)}, {fields}, {numbers}}}"


def _items(description: ModelDescription) -> Iterator[str]:
    place = {variable: k for k, variable in enumerate(description.model.variables)}
    return (f"{{{place[item.variable]}, {item.first}, {item.count}}}" for item in description.items)


def _constant(exported: Model, token: str, size: int, counts: Mapping[str, int]) -> Iterator[str]:
    built, schedule = exported.program, exported.network.schedule
    yield "static const Model model = {"
    yield f"    .token = {_quote(token)},"
    yield f"    .step = {exported.network.diagram.run.step!r},"
    yield f"    .tick = {float(schedule.tick)!r}, .grid = {schedule.grid},"
    yield f"    .arena_bytes = {-(-size // 8) * 8},"
    yield "    .segments = segments, .n_segments = sizeof segments / sizeof *segments, .words = words,"
    yield "    .rows = rows, .phases = phases, .banks = banks,"
    yield "    .functions = functions, .labels = labels, .blocks = blocks,"
    for name, count in counts.items():
        yield f"    .{name} = {name}, .n_{name} = {count},"
    yield "    .control = control,"
    yield f"    .n_states = {built.layout.states}, .x = {built.layout.vectors['X']}, .d = {built.layout.vectors['D']},"
    yield f"    .clocks = {built.clocks}, .n_clocks = {len(schedule.clocks)},"
    yield "};"
    yield ""
