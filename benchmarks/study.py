"""How much a study costs beyond its runs: random starts of the formation, against the solve time of one run.

    python benchmarks/study.py [COUNT]

Prints total time / (COUNT x one run's solve time / processors), which is 1 for a study that costs nothing; the same in
processor time, which other programs on the machine do not touch; and the peak of memory after a tenth of the runs and
after all of them.
"""

from __future__ import annotations

import json
import resource
import statistics
import sys
import tempfile
import time
from pathlib import Path

from cosim.engine.run import Run
from cosim.machine.parallel import processors
from cosim.study import running, study_file
from cosim.study.plan import members
from cosim.study.running import Options
from cosim.study.variants import Variants

SETTINGS = ("grid={}", "variants={APFTVT: {}}", "figures={}", "tables={}")
SINGLE_RUNS = 7


def study(count: int) -> study_file.Study:
    """The robustness study, of so many draws."""
    path = Path(__file__).parents[1] / "diagrams" / "studies" / "robustness.yaml"
    return study_file.load(path, [*SETTINGS, f"random.count={count}"])


def solve_time() -> tuple[float, float]:
    """Seconds that one run takes to solve, alone, on the clock and of a processor: the medians of several starts."""
    one = study(SINGLE_RUNS)
    variants = Variants(one)
    times, spent = [], []
    for member in members(one, variants.draws()):
        prepared = variants.prepared(member)
        run = Run(prepared.network, prepared=(prepared.program, prepared.kernels))
        began = time.process_time()
        times.append(run.execute().seconds["solve"])
        spent.append(time.process_time() - began)
    return statistics.median(times), statistics.median(spent)


def peak_megabytes() -> float:
    """The most memory that this process has had (MiB)."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main() -> None:
    """Measure, and print what came of it."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    before = solve_time()
    peaks: dict[int, float] = {}
    note = {count // 10, count}

    def watch(done: int, total: int) -> None:
        if done in note:
            peaks[done] = round(peak_megabytes(), 1)

    with tempfile.TemporaryDirectory() as folder:
        began = time.process_time()
        results = running.run(study(count), Options(Path(folder), watch=watch))
        spent = time.process_time() - began
        mean = statistics.mean(row["seconds"] for row in results.rows())
    after = solve_time()
    one, processor = ((a + b) / 2 for a, b in zip(before, after, strict=True))
    ideal = count * one / processors()
    print(
        json.dumps(
            {
                "runs": count,
                "processors": processors(),
                "seconds": round(results.seconds, 2),
                "one_run_alone_seconds": round(one, 4),
                "one_run_in_the_study_seconds": round(mean, 4),
                "ratio": round(results.seconds / ideal, 3),
                "processor_seconds": round(spent, 2),
                "ratio_in_processor_time": round(spent / (count * processor), 3),
                "peak_megabytes": peaks,
            }
        )
    )


if __name__ == "__main__":
    main()
