"""A process that is killed before whatever write leaves a result that can be read, with no row that was not recorded.

A library that is loaded before all others kills it there. What is forked from one process is killed at one call after
the other, until one comes to its end.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROWS = """
import ctypes, os, sys
from pathlib import Path
import numpy as np
from cosim.results.recorded import Recorded
from cosim.results.result_file import open_result
from cosim.results.result_writer import ResultWriter

SIGNALS = [Recorded("o.x"), Recorded("o.y", (3,)), Recorded("o.n", dtype=np.int32)]

def samples(k):
    return {"o.x": np.cos(k), "o.y": np.sin(k)[:, None] + np.arange(3.0), "o.n": -k}

def work(path):
    with ResultWriter(path, SIGNALS, {"title": "second"}) as writer:
        for first in range(0, 1800, 600):  # the second flush needs new chunks
            k = np.arange(first, first + 600)
            writer.append(k + 1.0, samples(k))
            writer.state() if len(sys.argv) > 2 else writer.flush()
        writer.close("completed", "what is said at the end")

def look(path):
    with open_result(path) as result:
        k = np.arange(len(result.times))
        assert np.array_equal(result.times, k + 1.0)
        for name, expected in samples(k).items():
            assert np.array_equal(result[name], expected), name
        return result.attrs["title"], len(k), result.attrs["status"]

path, calls, seen = Path(sys.argv[1]), 0, set()
library = ctypes.CDLL(os.environ["LD_PRELOAD"])
ResultWriter(path, SIGNALS, {"title": "first"}).close("completed")
while True:
    child = os.fork()
    if child == 0:
        library.cut(ctypes.c_long(calls), str(path.parent).encode())
        work(path)
        os._exit(0)
    ended = os.WIFEXITED(os.waitpid(child, 0)[1])
    try:
        seen.add(look(path))
    except Exception as error:
        raise SystemExit(f"killed before call {calls + 1}: {error!r}") from error
    if ended:
        break
    calls += 1
print(calls, sorted(seen))
"""


@pytest.fixture(scope="session")
def cut(tmp_path_factory) -> Path:
    """The library that kills."""
    if shutil.which("gcc") is None or not Path("/proc/self/fd").exists():
        pytest.skip("needs gcc and Linux")
    library = tmp_path_factory.mktemp("cut") / "cut.so"
    source = Path(__file__).with_name("cut.c")
    subprocess.run(["gcc", "-shared", "-fPIC", "-O1", "-o", library, source, "-ldl"], check=True)
    return library


@pytest.mark.parametrize("options", [(), ("with the state for a checkpoint",)])
def test_a_kill_before_any_write_leaves_a_result_without_a_wrong_row(cut, tmp_path, options):
    (tmp_path / "results").mkdir()
    done = subprocess.run(
        [sys.executable, "-c", ROWS, str(tmp_path / "results" / "run.nc"), *options],
        env={**os.environ, "LD_PRELOAD": str(cut)}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    calls, seen = done.stdout.split(" ", 1)
    assert int(calls) > 40  # some ten to a flush
    for state in (("first", 0, "completed"), *(("second", rows, "running") for rows in (0, 600, 1200, 1800))):
        assert str(state) in seen
    assert "('second', 1800, 'completed')" in seen
