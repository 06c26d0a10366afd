"""The error of coupling over the communication step: two masses with a known motion, tied by a soft and a stiff spring.

    python benchmarks/coupling.py [-o diagrams/coupling.png]

Each mass is a block that reads the other's position, and integrates its own motion to 1e-12, so that what is left is
what coupling does. The error is the largest of the first mass's position at the communication points of 10 s, over its
first deflection, beside the matrix exponential. One above 1, where nothing of the motion is left, is not drawn.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import expm

from cosim.engine import run
from cosim.plot import style
from cosim.results.result_file import open_result

BLOCK = """
from cosim import Block, Input, Parameter, State

class Mass(Block):
    'm dv/dt = k_12 (X - x) - k x'
    X = Input()
    m = Parameter()
    k = Parameter()
    k_12 = Parameter()
    x = State(output=True)
    v = State(output=True)
    def derivatives(X, m, k, k_12, x, v, d_x, d_v):
        d_x[0] = v
        d_v[0] = (k_12 * (X - x) - k * x) / m
"""
DIAGRAM = """
run:
  {{stop: 10, step: {step!r}, method: {method}, extrapolation: {order}, integrator: dormand-prince, tolerance: 1.0e-12}}
blocks:
  a: {{python: 'mass.py:Mass', parameters: {{m: 1, k: 1, k_12: {k_12}}}, start: {{x: 1}}, inputs: {{X: b.x}}}}
  b: {{python: 'mass.py:Mass', parameters: {{m: 2, k: 3, k_12: {k_12}}}, inputs: {{X: a.x}}}}
record: {{signals: [a.x]}}
"""
STOP = 10.0
SPRINGS = {"soft: $k_{12}$ = 0.5 N/m": 0.5, "stiff: $k_{12}$ = 50 N/m": 50.0}
WAYS = [(method, order) for method in ("jacobi", "gauss-seidel", "iterated") for order in range(3)]
STEPS = [STOP / n for n in (10, 20, 40, 100, 250, 1000, 4000)]


def error(folder: Path, method: str, order: int, k_12: float, step: float) -> float:
    """The largest error of one run (of the first deflection); infinite where it ends early."""
    (folder / "mass.py").write_text(BLOCK)
    path = folder / "masses.yaml"
    path.write_text(DIAGRAM.format(step=step, method=method, order=order, k_12=k_12))
    outcome = run.Run(run.load(path), output=folder / "masses.nc").execute()
    if outcome.status != "completed":
        return float("inf")
    with open_result(folder / "masses.nc") as result:
        found = np.ravel(result.read("a.x"))
    return float(np.abs(found - exact(k_12, step, len(found))).max())


def exact(k_12: float, step: float, points: int) -> Any:
    """The first mass's position at all communication points."""
    matrix = np.array([[0, 1, 0, 0], [-1 - k_12, 0, k_12, 0], [0, 0, 0, 1], [0.5 * k_12, 0, -0.5 * (3 + k_12), 0]])
    further, now, found = expm(matrix * step), np.array([1.0, 0, 0, 0]), np.empty(points)
    for n in range(points):
        found[n] = now[0]
        now = further @ now
    return found


def draw(errors: dict[str, dict[tuple[str, int], list[float]]], output: Path) -> None:
    """A panel for each spring."""
    with style.style():
        figure, axes = style.subplots(1, len(errors), (style.WIDTH, 3.4), sharey=True)
        for axis, (title, curves) in zip(axes.flat, errors.items(), strict=True):
            _slopes(axis)
            for (method, order), values in curves.items():
                shown = [value if value < 1.0 else np.nan for value in values]
                k = ("jacobi", "gauss-seidel", "iterated").index(method)
                look = style.line(k, order)
                name = f"{method}, extrapolation {order}" if order else method
                axis.loglog(STEPS, shown, marker="os^"[k], markersize=3, label=name, **look)
            axis.set(title=title, xlabel="communication step (s)", xlim=(2e-3, 1.3), ylim=(1e-11, 2.0))
        axes[0, 0].set_ylabel("largest error, relative to the first deflection")
        handles, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3)
        style.save(figure, output)


def _slopes(axis: Any) -> None:
    """What goes with the first, second and third power of the step."""
    steps = np.array([0.06, 0.6])
    for power in (1, 2, 3):
        values = 3e-11 * (steps / steps[0]) ** power
        axis.loglog(steps, values, color="#8c8c8c", linewidth=0.8)
        name = f"slope {power}" if power == 1 else f"{power}"
        axis.annotate(name, (steps[1], values[1]), (3, -2), textcoords="offset points", color="#6c6c6c", fontsize=8)


def main() -> None:
    """Run all, print a table, and draw the picture if that is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, help="the picture: .png, .svg or .pdf")
    output = parser.parse_args().output
    errors: dict[str, dict[tuple[str, int], list[float]]] = {}
    print("errors over the step (s):" + "".join(f"{step:>9.3g}" for step in STEPS))
    with tempfile.TemporaryDirectory() as name:
        for title, k_12 in SPRINGS.items():
            print(title)
            errors[title] = {}
            for way in WAYS:
                errors[title][way] = [error(Path(name), *way, k_12, step) for step in STEPS]
                print(f"  {way[0]:>14}, {way[1]}       " + "".join(f"{e:9.1e}" for e in errors[title][way]))
    if output:
        draw(errors, output)


if __name__ == "__main__":
    main()
