"""Integrators within a tolerance beside scipy's: time, work and error on stiff problems and one that is not.

    python benchmarks/stiff.py [--rounds 5]

Each solver is asked for the solution's end alone, with the same relative and absolute tolerance; the programs take
turns. scipy's call a right-hand side in Python, and one that numba has compiled, as the blocks are. A figure of ours is
the run's `solve`, from the initialization to the last step; scipy's is that of `solve_ivp`.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numba
import numpy as np
from scipy.integrate import solve_ivp

from cosim.engine import run

BLOCKS = """
from cosim import Block, State

class VanDerPol(Block):
    y = State(2, output=True, start=[2.0, 0.0])
    def derivatives(y, d_y):
        d_y[0] = y[1]
        d_y[1] = 1000.0 * (1.0 - y[0] * y[0]) * y[1] - y[0]

class Robertson(Block):
    y = State(3, output=True, start=[1.0, 0.0, 0.0])
    def derivatives(y, d_y):
        d_y[0] = -0.04 * y[0] + 1e4 * y[1] * y[2]
        d_y[2] = 3e7 * y[1] * y[1]
        d_y[1] = -d_y[0] - d_y[2]

class Orbit(Block):
    'eccentricity 0.6'
    y = State(4, output=True, start=[0.4, 0.0, 0.0, 2.0])
    def derivatives(y, d_y):
        cube = (y[0] * y[0] + y[1] * y[1]) ** 1.5
        d_y[0] = y[2]
        d_y[1] = y[3]
        d_y[2] = -y[0] / cube
        d_y[3] = -y[1] / cube
"""


def van_der_pol(_: float, y: Any) -> Any:
    """x'' = 1000 (1 - x²) x' - x."""
    return np.array([y[1], 1000.0 * (1.0 - y[0] * y[0]) * y[1] - y[0]])


def robertson(_: float, y: Any) -> Any:
    """Three reactions."""
    slow, fast = -0.04 * y[0] + 1e4 * y[1] * y[2], 3e7 * y[1] * y[1]
    return np.array([slow, -slow - fast, fast])


def orbit(_: float, y: Any) -> Any:
    """A planet around a sun of mass 1."""
    cube = (y[0] * y[0] + y[1] * y[1]) ** 1.5
    return np.array([y[2], y[3], -y[0] / cube, -y[1] / cube])


@dataclass(frozen=True)
class Problem:
    """reference: of the stated sources; an orbit is closed after each period of 2 pi."""

    block: str
    function: Callable[[float, Any], Any]
    start: tuple[float, ...]
    stop: float
    steps: int
    absolute: float  # over the relative tolerance
    reference: tuple[float, ...]
    ours: tuple[str, ...]
    theirs: tuple[str, ...]


PROBLEMS = (
    Problem(  # at 3000, by scipy's Radau with a tolerance of 1e-12
        *("VanDerPol", van_der_pol, (2.0, 0.0), 3000.0, 30, 1e-3, (-1.510606936744, 0.001178380000731)),
        *(("rodas4", "rodas5p"), ("LSODA", "Radau", "BDF")),
    ),
    Problem(  # Mazzia and Magherini, Test Set for Initial Value Problem Solvers
        *("Robertson", robertson, (1.0, 0.0, 0.0), 1e11, 10, 1e-8),
        (0.2083340149701255e-07, 0.8333360770334713e-13, 0.9999999791665050),
        *(("rodas4", "rodas5p"), ("LSODA", "Radau", "BDF")),
    ),
    Problem(
        *("Orbit", orbit, (0.4, 0.0, 0.0, 2.0), 20.0 * np.pi, 10, 1e-3, (0.4, 0.0, 0.0, 2.0)),
        *(("bogacki-shampine", "dormand-prince"), ("RK45", "DOP853", "LSODA")),
    ),
)


def ours(folder: Path, problem: Problem, integrator: str, tolerance: float) -> Callable[[], tuple[float, Any, str]]:
    """A run of ours: seconds, the end, what it took."""
    path = folder / f"{problem.block}.yaml"
    path.write_text(
        f"run: {{stop: {problem.stop!r}, step: {problem.stop / problem.steps!r}, integrator: {integrator},\n"
        f"      tolerance: {tolerance!r}, absolute_tolerance: {problem.absolute * tolerance!r}}}\n"
        f"blocks:\n  o: {{python: 'blocks.py:{problem.block}'}}\nmetrics:\n  y: {{signal: o.y, reduce: final}}\n"
    )
    network = run.load(path)

    def solve() -> tuple[float, Any, str]:
        outcome = run.Run(network).execute()
        assert outcome.status == "completed", outcome.error
        steps = outcome.inner_steps["o"]
        return outcome.seconds["solve"], outcome.metrics["y"], f"{steps['taken']} steps, {steps['rejected']} rejected"

    return solve


def theirs(problem: Problem, function: Any, solver: str, tolerance: float) -> Callable[[], tuple[float, Any, str]]:
    """A solution of scipy's: seconds, the end, what it took."""

    def solve() -> tuple[float, Any, str]:
        began = time.perf_counter()
        span, start = (0.0, problem.stop), np.array(problem.start)
        tolerances = {"rtol": tolerance, "atol": problem.absolute * tolerance}
        found = solve_ivp(function, span, start, method=solver, t_eval=[problem.stop], **tolerances)
        seconds = time.perf_counter() - began
        return seconds, found.y[:, -1] if found.success else np.full(len(start), np.nan), f"{found.nfev} evaluations"

    return solve


def table(folder: Path, problem: Problem, tolerance: float, rounds: int) -> None:
    """Print a table of all solvers for one problem and tolerance."""
    compiled = numba.njit(problem.function)
    solvers = {f"cosim {name}": ours(folder, problem, name, tolerance) for name in problem.ours}
    for name in problem.theirs:
        solvers[f"scipy {name}"] = theirs(problem, problem.function, name, tolerance)
        solvers[f"scipy {name}, compiled"] = theirs(problem, compiled, name, tolerance)
    seconds: dict[str, list[float]] = {}
    last: dict[str, tuple[Any, str]] = {}
    for solve in solvers.values():
        solve()  # compiles
    for _ in range(rounds):
        for name, solve in solvers.items():
            spent, *last[name] = solve()  # type: ignore[assignment]
            seconds.setdefault(name, []).append(spent)
    print(f"\n{problem.block}, tolerance {tolerance:g}{'':14}milliseconds   error")
    size = np.maximum(np.abs(problem.reference), 1.0 if problem.block == "Orbit" else 0.0)
    for name, values in seconds.items():
        end, took = last[name]
        error = np.max(np.abs(np.asarray(end) - problem.reference) / size)
        print(f"  {name:<28} {1e3 * statistics.median(values):12.2f}   {error:8.1e}   {took}")


def main() -> None:
    """Print all tables."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "blocks.py").write_text(BLOCKS)
        for problem in PROBLEMS:
            for tolerance in (1e-4, 1e-6, 1e-8):
                table(folder, problem, tolerance, options.rounds)


if __name__ == "__main__":
    main()
