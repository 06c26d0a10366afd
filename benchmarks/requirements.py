"""What requirements cost: the operators on a run's samples, and a run of the formation with five beside one with none.

    python benchmarks/requirements.py [ROUNDS]

Prints microseconds of a moving extreme over 3,001 samples, the least of many calls; and in each round, one after the
other in turns, the processor time of a run of the formation, with and without, and the ratio, as median with quartiles
and range. The runs record nothing.
"""

from __future__ import annotations

import json
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from cosim.engine import run
from cosim.engine.run import Run
from cosim.requirements.operators import Operators

FORMATION = Path(__file__).parents[1] / "diagrams" / "formation.yaml"
REQUIREMENTS = {
    "no_collision": "always(separation.min_gap > 0)",
    "settles": "eventually[0, 5](always(formation.e_x < 0.05))",
    "gentle": "always[1, 30](max(abs(controller.u)) < 150)",
    "near": "always[5, 30](norm(plant.x) < 12)",
    "nested": "always[0, 20](eventually[0, 10](formation.delta_x < 0.03))",
}
CALLS, REPEATED = 100, 50


def microseconds(call: Callable[[], object]) -> float:
    """The least that a call takes, of many."""
    call()
    found = []
    for _ in range(REPEATED):
        began = time.perf_counter()
        for _ in range(CALLS):
            call()
        found.append((time.perf_counter() - began) / CALLS)
    return 1e6 * min(found)


def operators() -> dict[str, float]:
    """Microseconds of the operators on 3,001 samples of noise, 0.01 s apart."""
    times, values = np.arange(3001) * 0.01, np.random.default_rng(1).normal(size=3001)
    even, uneven = Operators(True, times), Operators(True, times + 1e-4 * (np.arange(3001) % 2))
    return {
        "always[0, 5]": round(microseconds(lambda: even.lowest(values, 0.0, 5.0)), 1),
        "always[1, 6]": round(microseconds(lambda: even.lowest(values, 1.0, 6.0)), 1),
        "always[0, 5] at uneven times": round(microseconds(lambda: uneven.lowest(values, 0.0, 5.0)), 1),
        "until": round(microseconds(lambda: even.until(values, values)), 1),
    }


def seconds(prepared: Run) -> float:
    """Processor time (s) of a run that is compiled."""
    prepared.simulation  # noqa: B018
    began = time.process_time()
    outcome = prepared.execute()
    assert outcome.kept
    return time.process_time() - began


def spread(found: list[float]) -> dict[str, list[float] | float]:
    """The median, quartiles and range."""
    low, middle, high = statistics.quantiles(found, n=4)
    return {
        "median": round(middle, 4),
        "quartiles": [round(low, 4), round(high, 4)],
        "range": [round(min(found), 4), round(max(found), 4)],
    }


def main() -> None:
    """Measure, and print what came of it."""
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 25
    settings = ["record=null"]
    plain = run.load(FORMATION, settings)
    judged = run.load(FORMATION, [*settings, f"requirements={json.dumps(REQUIREMENTS)}"])
    ratios, times = [], []
    for k in range(rounds):
        pair = [seconds(Run(network)) for network in ((plain, judged) if k % 2 else (judged, plain))]
        without, with_ = pair if k % 2 else pair[::-1]
        times.append(without)
        ratios.append(with_ / without)
    print(json.dumps({"microseconds": operators(), "seconds": spread(times), "ratio": spread(ratios)}))


if __name__ == "__main__":
    main()
