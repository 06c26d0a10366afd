"""Blocks with matrices beside the same blocks with loops written by hand.

    python benchmarks/arrays.py [--rounds 9]

Each pair computes the same from the same states, a fleet of 100 members of it, Euler steps; both runs take turns. A
figure is the run's `solve` for a step and member, the ratio that of a round, of which the median counts and the range
is shown.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
from collections.abc import Callable
from pathlib import Path

from cosim.engine import run

MEMBERS = 100
BLOCKS = """
import numpy as np
from cosim import Block, Parameter, State, Output
import math

class Space(Block):
    x = State({n}, output=True, start={start})
    u = State({n}, start={start})
    A = Parameter({n}, {n}, default={A})
    B = Parameter({n}, {n}, default={A})
"""
#: By name: the number of states, as people write it, as loops.
PAIRS = {
    "A x + B u": (
        """
    def derivatives(x, u, A, B, d_x, d_u):
        d_x[:] = A @ x + B @ u
        d_u[:] = -u
""",
        """
    def derivatives(x, u, A, B, d_x, d_u):
        for i in range(x.size):
            total = 0.0
            for j in range(x.size):
                total += A[i, j] * x[j]
            for j in range(x.size):
                total += B[i, j] * u[j]
            d_x[i] = total
            d_u[i] = -u[i]
""",
    ),
    "element by element": (
        """
    def derivatives(x, u, A, B, d_x, d_u):
        e = u - x
        d_x[:] = 2.0 * e + np.tanh(e) * x
        d_u[:] = -u + 0.5 * (x - u) ** 2
""",
        """
    def derivatives(x, u, A, B, d_x, d_u):
        for i in range(x.size):
            e = u[i] - x[i]
            d_x[i] = 2.0 * e + math.tanh(e) * x[i]
            d_u[i] = -u[i] + 0.5 * (x[i] - u[i]) ** 2
""",
    ),
    "A' (x - u), its norm": (
        """
    def derivatives(x, u, A, B, d_x, d_u):
        e = A.T @ (x - u)
        d_x[:] = -e / (1.0 + np.linalg.norm(e))
        d_u[:] = -u
""",
        """
    def derivatives(x, u, A, B, d_x, d_u):
        squares = 0.0
        for i in range(x.size):
            total = 0.0
            for j in range(x.size):
                total += A[j, i] * (x[j] - u[j])
            d_u[i] = total
            squares += total * total
        for i in range(x.size):
            d_x[i] = -d_u[i] / (1.0 + math.sqrt(squares))
            d_u[i] = -u[i]
""",
    ),
}


def prepared(folder: Path, name: str, states: int, functions: str, steps: int) -> Callable[[], float]:
    """A run of a fleet of a block: seconds."""
    matrix = [[(-1.0 if i == j else 0.1 / (1 + i + j)) for j in range(states)] for i in range(states)]
    text = BLOCKS.format(n=states, start=[1.0 / (1 + i) for i in range(states)], A=matrix)
    (folder / f"{name}.py").write_text(text + functions)
    (folder / f"{name}.yaml").write_text(
        f"run: {{stop: {steps * 1e-3}, step: 1.0e-3}}\nfleets: {{member: {MEMBERS}}}\n"
        f"blocks:\n  space: {{python: '{name}.py:Space', per: member}}\n"
        "metrics: {x: {signal: space.x, reduce: final}}\n"
    )
    network = run.load(folder / f"{name}.yaml")

    def solve() -> float:
        outcome = run.Run(network).execute()
        assert outcome.status == "completed", outcome.error
        return outcome.seconds["solve"]

    return solve


def main() -> None:
    """Time and print all pairs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=9)
    rounds = parser.parse_args().rounds
    print(f"{'':24}states     arrays      loops   arrays/loops")
    with tempfile.TemporaryDirectory() as folder:
        for k, (name, texts) in enumerate(PAIRS.items()):
            for states in (2, 4, 8):
                steps = 400_000 // states**2
                runs = [
                    prepared(Path(folder), f"p{k}_{states}_{t}", states, text, steps) for t, text in enumerate(texts)
                ]
                times = [[solve() / steps / MEMBERS * 1e9 for solve in runs] for _ in range(rounds)]
                ratios = sorted(a / b for a, b in times)
                arrays, loops = (statistics.median(column) for column in zip(*times, strict=True))
                spread = f"{statistics.median(ratios):.2f} ({ratios[0]:.2f} … {ratios[-1]:.2f})"
                print(f"{name:24}{states:6} {arrays:7.1f} ns {loops:7.1f} ns   {spread}", flush=True)


if __name__ == "__main__":
    main()
