"""How cost grows with the fleet: diagrams/fleet_1000.yaml with 10 to 100,000 robots, beside the six.

    python benchmarks/growth.py [--sizes 10 100 1000 10000 100000] [--rounds 5]

Each size runs in a process of its own, so that its peak memory is its own.
"""

from __future__ import annotations

import argparse
import json
import resource
import statistics
import subprocess
import sys
import time as clock
from pathlib import Path

import numpy as np

from cosim.engine import run

DIAGRAMS = Path(__file__).parent.parent / "diagrams"
ROBOT_STEPS = 3_000_000  # how much a measurement does: robots times steps


def measure(robots: int) -> dict[str, float]:
    """One run of a fleet: microseconds a robot and step, seconds to set up, bytes of its arena, peak memory."""
    before = peak()
    six = robots == 6
    diagram = DIAGRAMS / ("formation.yaml" if six else "fleet_1000.yaml")
    steps = max(20, ROBOT_STEPS // robots // 10 if not six else 30_000)
    began = clock.perf_counter()
    network = run.load(diagram, [f"run.stop={steps * 1e-3}"] + [f"fleets.robot={robots}"] * (not six))
    simulation = run.Run(network)
    setup = clock.perf_counter() - began
    outcome = simulation.execute()
    assert outcome.status == "completed", outcome
    return {
        "step": 1e6 * outcome.seconds["solve"] / outcome.steps / robots,
        "setup": setup,
        "arena": simulation.simulation.arena.nbytes,
        "memory": peak() - before,
    }


def peak() -> int:
    """The largest memory that this process has had (bytes)."""
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit


def main() -> None:
    """Measure every size several times, in turn, and print medians."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--sizes", type=int, nargs="+", default=[10, 100, 1000, 10_000, 100_000])
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--measure", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.measure:
        print(json.dumps(measure(options.measure)))
        return
    sizes = [6, *options.sizes]
    found: dict[int, list[dict[str, float]]] = {n: [] for n in sizes}
    for _ in range(options.rounds):
        for robots in sizes:
            command = [sys.executable, __file__, "--measure", str(robots)]
            found[robots].append(json.loads(subprocess.run(command, check=True, capture_output=True).stdout))
    print("robots    us a robot and step      over six   arena, bytes a robot   peak, MB   setup, s")
    for robots, rows in found.items():
        steps = [row["step"] for row in rows]
        ratio = statistics.median(a["step"] / b["step"] for a, b in zip(rows, found[6], strict=True))
        middle = {key: float(np.median([row[key] for row in rows])) for key in rows[0]}
        print(
            f"{robots:7d}   {middle['step']:.3f} ({min(steps):.3f} … {max(steps):.3f})   {ratio:8.2f}   "
            f"{middle['arena'] / robots:20.0f}   {middle['memory'] / 1e6:8.1f}   {middle['setup']:8.2f}"
        )


if __name__ == "__main__":
    main()
