"""How many runs, and seconds, `cosim falsify` needs until it has found a violation: quartiles over ten seeds.

The formation's starts, the same with motors of 100 N, and the chasing cars of ARCH-COMP with inputs held for 5 s. What
is timed is the whole command in a process of its own, with its start and the check of what it found; the first seed
of each study is done once before, so that nothing has to be compiled. `python benchmarks/falsify.py [NAME …]`
"""

import json
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
SEEDS = 10
CARS = ("CC1", "CC2", "CC3", "CC4", "CC5", "CCx")
CASES = {
    "formation": ("formation_search.yaml", "no_collision", 20000),
    "weak motors": ("weak_motors_search.yaml", "no_collision", 20000),
    **{name: ("chasing_cars_search.yaml", name, 5000) for name in CARS},
}


def search(study: str, requirement: str, runs: int, seed: int) -> tuple[dict, float]:
    """What is found, and the seconds that it took."""
    with tempfile.TemporaryDirectory() as folder:
        asked = ["--requirement", requirement, "--runs", str(runs), "--seed", str(seed), "--results", folder]
        command = [sys.executable, "-m", "cosim", "falsify", str(HERE / study), *asked, "--json"]
        began = time.perf_counter()
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        return json.loads(done.stdout)["answers"][0], time.perf_counter() - began


def quartiles(values: list[float], form: str) -> str:
    """The median, and the quartiles around it."""
    low, middle, high = np.quantile(values, [0.25, 0.5, 0.75])
    return f"{middle:{form}} ({low:{form}} … {high:{form}})"


def main() -> None:
    """Print a line for each case."""
    for name in sys.argv[1:] or CASES:
        study, requirement, runs = CASES[name]
        search(study, requirement, min(runs, 60), 0)
        found = [search(study, requirement, runs, seed) for seed in range(SEEDS)]
        hits = [pair for pair in found if pair[0]["violated"]]
        verdicts = Counter(answer["verdict"] for answer, _ in hits)
        needed = quartiles([answer["runs"] for answer, _ in found], ".0f")
        seconds = quartiles([spent for _, spent in found], ".1f")
        told = ", ".join(f"{count} {verdict}" for verdict, count in verdicts.items())
        print(f"{name}: {len(hits)} of {SEEDS} ({told}); runs {needed}; seconds {seconds}", flush=True)
        print("   ", [(answer["runs"], round(spent, 1), answer["verdict"]) for answer, spent in found], flush=True)


if __name__ == "__main__":
    main()
