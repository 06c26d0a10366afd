"""How long a sweep from Python takes beside a study of the same runs: random starts of the formation, 3 s each.

    python benchmarks/sweep.py [COUNT] [ROUNDS]

Prints the seconds of both in each round, the ratio of the medians, on the clock and in processor time, which other
programs on the machine do not touch, and what one `diagram.set(…).run()` takes, which wires the diagram anew.
"""

from __future__ import annotations

import json
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cosim
from cosim.study import running, study_file
from cosim.study.plan import members
from cosim.study.running import Options
from cosim.study.variants import Variants

FORMATION = Path(__file__).parents[1] / "diagrams" / "formation.yaml"
CHANGES = {"run.stop": 3, "record": None, "metrics": None}
METRICS = {"metrics": {"min_gap": {"signal": "separation.min_gap", "reduce": "min"}}}
STUDY = """
diagram: {formation}
variants: {{base: {{set: {{run.stop: 3}}}}}}
metrics: [min_gap]
random:
  count: {count}
  draws: {{blocks.plant.start.x: {{uniform: [[-2.5, -2.5, "-pi"], [2.5, 2.5, pi]]}}}}
"""


def timed(call: Callable[[], Any]) -> tuple[tuple[float, float], Any]:
    """Seconds on the clock and of the processor, and what the call gives."""
    began, spent = time.perf_counter(), time.process_time()
    found = call()
    return (time.perf_counter() - began, time.process_time() - spent), found


def main() -> None:
    """Measure, and print what came of it."""
    count, rounds = (int(given) for given in (*sys.argv[1:], *("1000", "3")[len(sys.argv) - 1 :]))
    diagram = cosim.load(FORMATION).set(CHANGES).set(METRICS)
    times: dict[str, list[tuple[float, float]]] = {"study": [], "sweep": []}
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "study.yaml"
        file.write_text(STUDY.format(formation=FORMATION, count=count), encoding="utf-8")
        study = study_file.load(file)
        changes = [dict(member.settings) for member in members(study, Variants(study).draws())]
        for k in range(rounds):
            spent, results = timed(lambda k=k: running.run(study, Options(Path(folder) / str(k))))
            times["study"].append(spent)
            spent, table = timed(lambda: diagram.sweep(changes))
            times["sweep"].append(spent)
            gaps = [row["metrics"]["min_gap"] for row in results.rows()]
            assert gaps == table["min_gap"].tolist(), "the runs are not the same"
    medians = {name: [statistics.median(part) for part in zip(*pairs, strict=True)] for name, pairs in times.items()}
    single = statistics.median(timed(lambda k=k: diagram.set(changes[k]).run())[0][0] for k in range(min(5, count)))
    about = {
        "runs": count,
        "seconds": {name: [round(pair[0], 2) for pair in pairs] for name, pairs in times.items()},
        "ratio": round(medians["sweep"][0] / medians["study"][0], 3),
        "ratio_in_processor_time": round(medians["sweep"][1] / medians["study"][1], 3),
        "one_set_and_run_seconds": round(single, 3),
    }
    print(json.dumps(about))


if __name__ == "__main__":
    main()
