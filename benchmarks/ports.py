"""What exchanging many values with FMUs costs: two in a chain, FMI 3 with event mode, few or all ports wired.

    python benchmarks/ports.py [--rounds 9] [--cc gcc]

The FMUs do nothing but hand on 20 real numbers, 10 integers and 10 truth values. The programs take turns; a ratio is
given of the fastest round of each, which other work on the machine disturbs least, and within a round.
"""

from __future__ import annotations

import argparse
import subprocess
import tempfile
import time as clock
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from cosim.engine import compilation, program, run
from cosim.engine.simulation import Simulation
from cosim.export import build
from cosim.fmu import versions

HERE = Path(__file__).resolve().parent
STEP, STEPS = 1e-3, 100_000
TYPES = {"Float64": 20, "Int32": 10, "Boolean": 10}
NAMES = [f"{kind}_{k}" for kind, count in TYPES.items() for k in range(count)]
OUTPUTS = 100  # as in ports.c


def description() -> str:
    """The model description."""
    rows, structure = [], []
    for reference, name in enumerate(NAMES):
        kind = name.partition("_")[0]
        start = "false" if kind == "Boolean" else "0"
        rows.append(f'<{kind} name="{name}" valueReference="{reference}" causality="input" start="{start}"/>')
        rows.append(f'<{kind} name="{name}_out" valueReference="{reference + OUTPUTS}" causality="output"/>')
        structure.append(f'<Output valueReference="{reference + OUTPUTS}" dependencies="{reference}"/>')
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="ports" instantiationToken="ports">
<CoSimulation modelIdentifier="ports" hasEventMode="true"/>
<ModelVariables>{"".join(rows)}</ModelVariables>
<ModelStructure>{"".join(structure)}</ModelStructure></fmiModelDescription>"""


def built(compiler: str, folder: Path) -> tuple[Path, Path, Path]:
    """The FMU, its library, and the program in C."""
    options = [compiler, "-O2", "-w", f"-I{build.headers()}", HERE / "ports.c"]
    library, host = folder / "ports.so", folder / "host"
    subprocess.run([*options, "-DFMU", "-shared", "-fPIC", "-o", library], check=True)
    subprocess.run([*options, "-o", host, "-ldl"], check=True)
    path = folder / "ports.fmu"
    here = build.host()
    with zipfile.ZipFile(path, "w") as archive:
        archive.write(library, f"binaries/{here.folder(versions.FMI3)}/ports{here.suffix}")
        archive.writestr("modelDescription.xml", description())
    return path, library, host


def called_from_c(host: Path, library: Path, wires: int) -> Callable[[], float]:
    """Microseconds a step of the loop by hand."""

    def once() -> float:
        command = [str(host), str(library), str(library), str(wires), str(STEPS)]
        return 1e6 / STEPS * float(subprocess.run(command, stdout=subprocess.PIPE, check=True, text=True).stdout)

    return once


def cosim(path: Path, wires: int) -> Callable[[], float]:
    """Microseconds a step of cosim's loop."""
    inputs = ", ".join(f"{name}: one.{name}_out" for name in NAMES[:wires])
    diagram = path.with_suffix(".yaml")
    blocks = f"blocks:\n  one: {{fmu: {path}}}\n  other: {{fmu: {path}, inputs: {{{inputs}}}}}\n"
    diagram.write_text(f"run: {{stop: {STEPS * STEP}, step: {STEP}}}\n{blocks}")
    made = program.build(run.load(diagram), "jacobi")
    kernels = compilation.compile_program(made)

    def once() -> float:
        simulated = Simulation(made, kernels)
        simulated.initialize()
        began = clock.perf_counter()
        for _ in simulated.batches():
            pass
        seconds = clock.perf_counter() - began
        simulated.close()
        return 1e6 * seconds / STEPS

    return once


def main() -> None:
    """Build, take turns, print."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--cc", default="gcc")
    options = parser.parse_args()
    print(f"Microseconds a step, fastest of {options.rounds} rounds, and cosim / C:")
    print(f"{'wired':>8}{'C':>10}{'cosim':>10}{'fastest':>10}   within a round: median (quartiles)")
    with tempfile.TemporaryDirectory() as name:
        path, library, host = built(options.cc, Path(name))
        for wires in (1, 20, len(NAMES)):
            by_hand, ours = called_from_c(host, library, wires), cosim(path, wires)
            rounds = np.array([(by_hand(), ours()) for _ in range(options.rounds)])
            c, us = np.min(rounds, axis=0)
            first, middle, third = np.percentile(rounds[:, 1] / rounds[:, 0], [25, 50, 75])
            print(f"{wires:>8}{c:>10.3f}{us:>10.3f}{us / c:>10.2f}   {middle:.2f} ({first:.2f} … {third:.2f})")


if __name__ == "__main__":
    main()
