"""The loop's speed beside hand-written C and NumPy: 30 s of diagrams/formation.yaml at 1 ms, Euler.

    python benchmarks/loop.py [--rounds 15] [--cc gcc]

The programs take turns, so that whatever else the machine does meets all of them; ratios are of one round each.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import formation_numpy
import numpy as np

from cosim.compiling import emission
from cosim.engine import run
from cosim.machine import object_code
from cosim.plain_math.definitions import FUNCTIONS, definition

HERE = Path(__file__).parent
DIAGRAM = HERE.parent / "diagrams" / "formation.yaml"
NAMES = ("N_x", "N_v", "N_w", "delta_x", "e_x", "S", "min_gap", "L_2", "dL_2", "coverage")
#: What the run measures for the conditions that are judged after it, made visible as metrics.
SETTINGS = (
    "metrics.L_2={signal: topology_rate.L_2, reduce: max}",
    "metrics.dL_2={signal: topology_rate.dL_2, reduce: max}",
    "metrics.coverage={signal: observer.coverage, reduce: min}",
)
STEPS, NUMPY_STEPS = 30_000, 1_000

#: The observers are not Lipschitz at zero error: whatever moves a last bit is amplified, in N_x to a few percent.
AMPLIFIED = 5e-2


def own_functions(folder: Path) -> list[str]:
    """What C is compiled with so that it calls cosim's elementary functions: they have the C library's names."""
    ir = "".join(definition(name).replace(f"@cosim_{name}(", f"@{name}(") for name in FUNCTIONS)
    code = emission.emit(ir, *object_code.host(), list(FUNCTIONS), "functions")
    (folder / "functions.o").write_bytes(code)
    return ["-fno-builtin", "-DEACH_NEURON", str(folder / "functions.o")]


def build(compiler: str, folder: Path, name: str, *options: str) -> Callable[[], dict[str, Any]]:
    """Compile formation.c; returns what runs it and reads its figures."""
    program = folder / name
    subprocess.run([compiler, "-O3", *options, HERE / "formation.c", "-o", program, "-lm"], check=True)
    return lambda: json.loads(subprocess.run([program], capture_output=True, check=True, text=True).stdout)


def ours(network: Any, output: Path | None) -> dict[str, Any]:
    """Run the diagram; seconds: the loop as C's clock sees it; whole: with reductions and files."""
    outcome = run.Run(network, output=output).execute()
    assert outcome.status == "completed", outcome
    return {"seconds": outcome.seconds["solve"], **outcome.metrics}


def compare(name: str, figures: dict[str, Any], reference: dict[str, Any]) -> None:
    """Print how far figures are from the diagram's. Exits if they are farther than amplified rounding explains."""
    differences = {n: abs(figures[n] - reference[n]) / abs(reference[n]) for n in NAMES if n in figures}
    worst = max(differences, key=lambda n: differences[n])
    text = "to the last bit" if differences[worst] == 0.0 else f"to {differences[worst]:.1g} ({worst})"
    print(f"  {name:<28} agrees {text}")
    if not differences[worst] <= AMPLIFIED:
        sys.exit(f"{name} simulates something else: {figures} instead of {reference}")


def quartiles(values: list[float]) -> str:
    """Median, quartiles and range, as one text."""
    low, first, middle, third, high = np.percentile(values, [0, 25, 50, 75, 100])
    return f"{middle:9.2f}  {first:9.2f} … {third:.2f}  ({low:.2f} … {high:.2f})"


def main() -> None:
    """Build, compare figures, take turns, print."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--cc", default="gcc")
    options = parser.parse_args()
    network = run.load(DIAGRAM, SETTINGS)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        c = build(options.cc, folder, "formation")
        tuned = build(options.cc, folder, "tuned", "-march=native", "-fno-math-errno")
        seconds: dict[str, list[float]] = {}
        reference = ours(network, None)
        print("Figures of the run beside the diagram's:")
        compare("C -O3", c(), reference)
        compare("C -O3, cosim's functions", build(options.cc, folder, "same", *own_functions(folder))(), reference)
        compare("C -O3 -march=native", tuned(), reference)
        compare("NumPy", vars(formation_numpy.run(STEPS)[1]), reference)
        programs: dict[str, Callable[[], float]] = {
            "C -O3": lambda: c()["seconds"] / STEPS,
            "cosim": lambda: ours(network, None)["seconds"] / STEPS,
            "cosim, recording": lambda: ours(network, folder / "formation.nc")["seconds"] / STEPS,
            "C -O3 -march=native": lambda: tuned()["seconds"] / STEPS,
            "NumPy": lambda: formation_numpy.run(NUMPY_STEPS)[0] / NUMPY_STEPS,
        }
        for _ in range(options.rounds):
            for what, program in programs.items():
                seconds.setdefault(what, []).append(program())
    print(f"\nMicroseconds a step, {options.rounds} rounds:  median   quartiles       (range)")
    for name, values in seconds.items():
        print(f"  {name:<26} {quartiles([1e6 * v for v in values])}")
    print("\nRatios within a round:              median   quartiles       (range)")
    for over, under in (
        ("cosim", "C -O3"),
        ("cosim, recording", "C -O3"),
        ("cosim", "C -O3 -march=native"),
        ("NumPy", "cosim"),
    ):
        pairs = [a / b for a, b in zip(seconds[over], seconds[under], strict=True)]
        print(f"  {over + ' / ' + under:<26} {quartiles(pairs)}")


if __name__ == "__main__":
    main()
