"""Members whose native code, or plain Python, never ends: each is lost alone, with what it had seen till then."""

import json
import signal
import subprocess
import sys
import time

import pytest

# x' = 1 from a on, and in Bad a call that never ends at the fourth sample, where a > 0.5.
ENDLESS = """
from cosim import *
import time as clock

class Bad(Block):
    a = Parameter(default=0.0)
    x = State()
    y = Output()

    def derivatives(d_x):
        d_x[0] = 1.0

    def outputs(time, x, a, y):
        y[0] = x + a
        k = 0
        while a > 0.5 and time > 0.025 and k >= 0:
            k = (k + 1) % 1000

class Sleeper(Block, compiled=False):
    a = Parameter(default=0.0)
    y = Output()

    def outputs(time, a, y):
        y[0] = a
        while a > 0.5 and time > 0.025:
            clock.sleep(0.01)
"""
DIAGRAM = "run: {stop: 0.1, step: 0.01, patience: PATIENCE}\nblocks: {bad: {python: 'own.py:KIND'}}\n"
METRIC = "metrics: {y: {signal: bad.y, reduce: max}}\n"
GRID = """
diagram: own.yaml
requirements: {low: always(bad.y < 0.99)}
grid: {blocks.bad.parameters.a: [0, 1, 0.25]}
"""


def written(folder, kind, patience):
    (folder / "own.py").write_text(ENDLESS)
    (folder / "own.yaml").write_text(DIAGRAM.replace("PATIENCE", patience).replace("KIND", kind) + METRIC)
    (folder / "grid.yaml").write_text(GRID)


def test_what_it_had_seen_counts(tmp_path):
    """y = 1 at the begin violates y < 0.99 whatever comes; of y = a + t, sampled up to 0.02, the largest is 1.02."""
    written(tmp_path, "Bad", "0.3")
    command = [sys.executable, "-m", "cosim", "study", "grid.yaml", "--json"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False)
    found = json.loads(done.stdout)
    assert found["counts"] == {"completed": 2, "failed": 1} and done.returncode == 3
    assert "block bad: no sign of life for 0.3 s in outputs() at t = 0.03 s" in done.stdout
    rows = map(json.loads, (tmp_path / "results" / "grid" / "members.jsonl").read_text().splitlines())
    (lost,) = [row for row in rows if row["status"] == "failed"]
    assert lost["metrics"]["y"] == pytest.approx(1.02) and lost["metrics"]["low"] == pytest.approx(0.99 - 1.02)
    assert lost["requirements"]["low"][0] is False


@pytest.mark.parametrize("kind", ["Bad", "Sleeper"])
def test_ctrl_c_waits_for_none_that_never_ends(tmp_path, kind):
    written(tmp_path, kind, "600")
    command = [sys.executable, "-m", "cosim", "study", "grid.yaml", "--threads", "2"]
    store = tmp_path / "results" / "grid" / "members.jsonl"
    with subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        while process.poll() is None and not (store.exists() and len(store.read_text().splitlines()) == 2):
            time.sleep(0.05)  # until the one that never ends is alone
        process.send_signal(signal.SIGINT)
        output, errors = process.communicate(timeout=60)
    assert process.returncode == 130 and "2 of 3 members" in output + errors
