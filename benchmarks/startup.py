"""From the command to its exit: `cosim run diagrams/formation.yaml`, warm and with an empty cache.

    python benchmarks/startup.py [--rounds 5]

Whole processes are timed from outside; the phases are what the run itself reports.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time as clock
from pathlib import Path

DIAGRAM = Path(__file__).parent.parent / "diagrams" / "formation.yaml"
PHASES = ("setup", "compile", "solve")


def start(cache: Path, *options: str) -> tuple[float, dict[str, float], str]:
    """Run the formation in a new process: (seconds, seconds of each phase, what it wrote to standard error)."""
    output = cache / "formation.nc"
    command = [sys.executable, *options, "-m", "cosim.terminal.cli", "run", DIAGRAM, "--json", "-o", output]
    began = clock.perf_counter()
    done = subprocess.run(command, check=True, capture_output=True, text=True, env=os.environ | {"COSIM_CACHE": cache})
    whole = clock.perf_counter() - began
    outcome = json.loads(done.stdout)
    return whole, outcome["seconds"] | {"kernels": outcome["kernels_compiled"]}, done.stderr


def show(name: str, rows: list[tuple[float, dict[str, float], str]]) -> None:
    """One line: median and range of the whole process, medians of the phases."""
    wholes = [row[0] for row in rows]
    phases = ", ".join(f"{phase} {statistics.median(row[1][phase] for row in rows):.3f}" for phase in PHASES)
    kernels = f"{rows[0][1]['kernels']:.0f} kernels compiled"
    print(f"{name:<6} {statistics.median(wholes):6.2f} s ({min(wholes):.2f} … {max(wholes):.2f})   {phases}; {kernels}")


def imports(cache: Path, most: int = 12) -> None:
    """Print what takes longest to import on a warm start (ms, cumulative)."""
    pattern = re.compile(r"import time:\s+(\d+) \|\s+(\d+) \| (\s*)(\S+)")
    lines = pattern.findall(start(cache, "-X", "importtime")[2])
    tops = sorted(((int(total) / 1e3, name) for _, total, _, name in lines if "." not in name), reverse=True)
    print("imports, ms: " + ", ".join(f"{name} {total:.0f}" for total, name in tops[:most]))


def main() -> None:
    """Time cold and warm starts in turn."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rounds", type=int, default=5)
    rounds = parser.parse_args().rounds
    cold, warm = [], []
    for _ in range(rounds):
        with tempfile.TemporaryDirectory() as name:
            cold.append(start(Path(name)))
            warm += [start(Path(name)) for _ in range(2)]
            assert warm[-1][1]["kernels"] == 0
    show("cold", cold)
    show("warm", warm)
    with tempfile.TemporaryDirectory() as name:
        start(Path(name))
        imports(Path(name))


if __name__ == "__main__":
    main()
