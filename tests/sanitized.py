"""Runs a diagram on code that AddressSanitizer watches.

python -m tests.sanitized KIND DIAGRAM [SETTING …]

To be started as `tests/test_sanitizers.py` does: libasan preloaded, and a folder for the code, $SANITIZED. KIND is:

run     a run of the diagram
fmu     all its blocks as one FMU, whose wrapper is watched too, by UBSan as well
broken  a run whose buffers claim to have room for a row more than they have, beside that for the end of a run at an
        event, which the sanitizer has to find

Words of the arena that belong to nobody may not be touched.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import numpy as np

from cosim.compiling import compiler
from cosim.engine import probes, run
from cosim.engine.layout import OF_STAGES, VECTORS
from cosim.engine.simulation import Simulation
from cosim.export import build, exporter
from cosim.integrators import HEAD
from cosim.machine import object_code, parallel
from cosim.master import tables
from cosim.master.histories import FRESH, HISTORY_WORDS, ROOM, TO, WORDS, words

WORK = Path(os.environ["SANITIZED"])
os.environ["COSIM_CACHE"] = str(WORK / "cache")  # its code is watched, or none
SANITIZERS = ["-fsanitize=address", "-fno-omit-frame-pointer"]


def watched(ir: str, name: str, symbols: list[str]) -> Path:
    """Object code of an IR text in which every access to memory is checked."""
    module = llvm.parse_assembly(re.sub(r"^target (triple|datalayout) = .*$", "", ir, flags=re.MULTILINE))
    for value in (*module.functions, *module.global_variables):
        if not value.is_declaration and value.name not in symbols:
            value.linkage = "internal"
    ir = re.sub(r"^(define .*) \{$", r"\1 sanitize_address {", str(module), flags=re.MULTILINE)
    name = f"{name}-{hashlib.sha256(ir.encode()).hexdigest()[:16]}"
    text, code = WORK / f"{name}.ll", WORK / f"{name}.o"
    if code.exists():
        return code
    text.write_text(f'target triple = "x86_64-unknown-linux-gnu"\n{ir}')
    zig = [sys.executable, "-m", "ziglang", "cc", "-target", "x86_64-linux-gnu", "-Wno-override-module"]
    subprocess.run([*zig, "-c", "-fPIC", "-O1", "-ffp-contract=off", *SANITIZERS, text, "-o", code], check=True)
    return code


class Library:
    """As `cosim.machine.object_code.Library`, of a shared library whose path is the code."""

    def __init__(self, code: bytes) -> None:
        self._library = ctypes.CDLL(code.decode())

    def address(self, symbol: str) -> int:
        return ctypes.cast(getattr(self._library, symbol), ctypes.c_void_p).value or 0


def compile_object(name: str, sources: Any) -> bytes:
    sources = tuple(sources)
    code = watched(compiler.compile_ir(name, sources), name, [s.symbol for s in sources])
    path = code.with_suffix(".so")
    subprocess.run(["gcc", "-shared", *SANITIZERS, code, "-o", path, "-lm"], check=True)
    return str(path).encode()


def fence(one: Simulation) -> None:
    """Forbid to touch what lies between two variables of the arena."""
    program, owned = one.program, np.zeros(one.arena.size, bool)
    layout = program.layout
    spans = [(offset, 8 * layout.states * layout.slopes) for offset in (layout.vectors["SLOPES"],)]
    spans += [(layout.vectors[name], 8 * layout.states) for name in VECTORS]
    spans += [(layout.vectors[name], 8 * layout.states) for name in OF_STAGES if layout.slopes]
    spans.append((program.clocks, 8 * tables.CLOCK_WORDS * len(program.network.schedule.clocks)))
    for history in layout.histories.values():
        head = one.arena[history : history + 8 * HISTORY_WORDS].view(np.int64)
        spans.append((history, 8 * words(head[ROOM], head[WORDS])))
        spans += [(head[place], 8 * head[WORDS]) for place in (TO, FRESH)]
    for bank in program.banks:
        spans += list(bank_spans(bank, one.arena))
    for call in program.calls:
        component = program.network.components[call.component]
        spans.append((call.frame, 8 * (6 + len(component.axes) + 2 * len(call.arguments))))
        for place in call.arguments:
            if place is not None:
                size = int(np.prod(place.shape)) * place.dtype.itemsize
                spans += [(place.offset + k * place.stride, size) for k in range(call.count)]
    for begin, size in spans:
        owned[begin : begin + -(-size // 8) * 8] = True
    copies = program.rows[program.rows[:, tables.KIND] == tables.COPY]
    for row in copies:
        for begin in (row[tables.A], row[tables.B]):
            owned[begin : begin + 8 * row[tables.C]] = True
    for begin, count in program.layout.published.values():
        owned[begin : begin + 8 * count] = True  # the padding between them is read, and is zero
    library = ctypes.CDLL(None)
    for begin, end in _runs(~owned):
        library.__asan_poison_memory_region(
            ctypes.c_void_p(one.arena.ctypes.data + begin), ctypes.c_size_t(end - begin)
        )


def bank_spans(bank: np.ndarray, arena: np.ndarray) -> Iterator[tuple[int, int]]:
    """What an integration has of its own: tableau, tolerances, memory; an implicit one its equations and work space."""
    stages = bank[tables.STAGES]
    rows = 2 * stages if bank[tables.IMPLICIT] else stages + bank[tables.CONTROLLED]
    yield bank[tables.TABLEAU], 8 * (rows * (HEAD + stages) + int(bank[tables.IMPLICIT] > 0))
    yield bank[tables.TOLERANCES], 16
    yield bank[tables.MEMORY], 8 * tables.MEMORY_WORDS
    if begin := bank[tables.IMPLICIT]:
        words = arena[begin:].view(np.int64)
        size, states = words[tables.SYSTEM_SIZE], words[tables.SYSTEMS] * words[tables.SYSTEM_SIZE]
        yield begin, 8 * (tables.SYSTEMS_WORDS + states)
        yield words[tables.SYSTEM_WORK], 8 * states * (tables.SYSTEM_VECTORS + 2 * size)


def _runs(mask: np.ndarray) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def watch_run(path: str, settings: list[str], broken: bool) -> None:
    parallel.processors = lambda: 1  # what another process compiles is not watched
    compiler.compile_object = compile_object
    object_code.Library = Library  # type: ignore[misc]
    probes.BUFFER_BYTES = 2_000
    run.Run._look = lambda *_: 0.0  # it reads the whole arena, to copy it
    one = run.Run(run.load(path, settings))
    fence(one.simulation)
    if broken:
        one.simulation.buffers.groups[:, tables.CAPACITY] += 2
    outcome = one.execute()
    print(outcome.as_json())
    assert outcome.status == "completed", outcome.error


def watch_fmu(path: str, settings: list[str]) -> None:
    from tests.fmu.fmu_host import Host

    def of(self: Any, unit: build.CodeUnit, platform: build.Platform) -> bytes:
        return watched(
            compiler.compile_ir(unit.name, unit.sources), unit.name, [s.symbol for s in unit.sources]
        ).read_bytes()

    build.KernelCode._object = of  # type: ignore[method-assign]
    build._FLAGS += ["-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=undefined"]
    build._link_flags = lambda platform, path: ["-shared", "-fPIC"]  # the sanitizers' symbols stay open
    network = run.load(path, settings)
    for version in ("2.0", "3.0"):
        file = Path(path).parent / f"watched{version[0]}.fmu"
        exporter.export_fmu(network, [], file, version)
        for how in ({}, {"me": True}):
            host = Host(file, **how)
            host.initialize()
            if not how:
                for k in range(50):
                    host.step(k * network.diagram.run.step, network.diagram.run.step)
            state = host.state()
            host.restore(state)
            differentiate(host)
            host.free()


def differentiate(host: Any) -> None:
    """All real outputs by all real inputs, or by time."""
    real = [v for v in host.variables.values() if v.type in ("Real", "Float64")]
    outputs, inputs = ([v for v in real if v.causality == kind] for kind in ("output", "input"))
    knowns = inputs or [v for v in real if v.causality == "independent"]
    n, m = (sum(int(np.prod(v.shape or 1)) for v in part) for part in (outputs, knowns))
    more = [n] if host.version == "3.0" else []
    references = [[v.valueReference for v in part] for part in (outputs, knowns)]
    host.fmu.getDirectionalDerivative(*references, [1.0] * m, *more)


if __name__ == "__main__":
    kind, diagram, *given = sys.argv[1:]
    watch_fmu(diagram, given) if kind == "fmu" else watch_run(diagram, given, kind == "broken")
