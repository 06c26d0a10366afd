"""A process that is killed at whatever moment leaves a result that can be read, with every row that was flushed.

A library that is loaded before all others kills it there. What is forked from one process is killed at one change after
the other, until one comes to its end. Chunks have few rows, so that their index grows by nodes, roots and levels.
"""

from __future__ import annotations

import ast
import os
import shutil
import signal
import subprocess
import sys
import time
from io import BytesIO
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray

from cosim.results import attributes, netcdf_layout, object_header
from cosim.results.growing_file import GrowingFile
from cosim.results.new_result import new_result
from cosim.results.recorded import Recorded
from cosim.results.result_file import open_result
from cosim.results.result_writer import ResultWriter

SIGNALS = [Recorded("o.x"), Recorded("o.y", (3,)), Recorded("o.n", dtype=np.int32)]
CHUNK_ROWS = 2
LEVEL_1, LEVEL_2 = 64 * CHUNK_ROWS, 64**2 * CHUNK_ROWS
"""Rows that an index of one node has entries for, and one of two levels."""


def rows(first, last):
    """Times and samples of the rows first … last-1."""
    k = np.arange(first, last)
    return k + 1.0, {"o.x": np.cos(k), "o.y": np.sin(k)[:, None] + np.arange(3.0), "o.n": -k}


def append(writer, first, last):
    writer.append(*rows(first, last))
    writer.flush()


def look(path):
    """The title of a result, how many rows it has, which are as they were written, and its status."""
    with open_result(path) as result:
        times, expected = rows(0, len(result.times))
        assert np.array_equal(result.times, times)
        for name, values in expected.items():
            assert np.array_equal(result[name], values), name
        return result.attrs["title"], len(times), result.attrs["status"]


CUT = """
import ctypes, os, sys
from pathlib import Path
from tests.results.test_kills import *

netcdf_layout.CHUNK_ROWS = CHUNK_ROWS
path, changes, seen = Path(sys.argv[1]), 0, {}
library = ctypes.CDLL(os.environ["LD_PRELOAD"])
#
while True:
    before()
    child = os.fork()
    if child == 0:
        library.cut(ctypes.c_long(changes), str(path.parent).encode())
        work()
        os._exit(0)
    ended = os.WIFEXITED(os.waitpid(child, 0)[1])
    try:
        found = look(path)
    except BaseException as error:
        raise SystemExit(f"killed before change {changes + 1}: {error!r}") from error
    seen[found] = seen.get(found, 0) + 1
    if ended:
        break
    changes += 1
print(changes, list(seen))
"""

FROM_NEW = """
ResultWriter(path, SIGNALS, {"title": "first"}).close("completed")
def before(): pass
def work():
    with ResultWriter(path, SIGNALS, {"title": "second"}) as writer:
        for first in (0, 5, 10):
            append(writer, first, first + 5)
        writer.close("completed", "what is said at the end " * 200, {f"metric {k}": k / 7 for k in range(200)}, 3)
"""

GROWING = """
at = int(sys.argv[2])
writer = ResultWriter(path, SIGNALS, {"title": "second"})
append(writer, 0, at)
content = path.read_bytes()
def before(): path.write_bytes(content)
def work():
    append(writer, at, at + 3)
    len(sys.argv) > 3 and writer.state()
"""

RESUMED = """
at = int(sys.argv[2])
writer = ResultWriter(path, SIGNALS, {"title": "second"})
append(writer, 0, at)
state = writer.state()
append(writer, at, at + 150)
writer.close("interrupted", "Ctrl-C", {"x": 1.0})
content = path.read_bytes()
def before(): path.write_bytes(content)
def work():
    append(ResultWriter(path, SIGNALS, {}, state), at, at + 3)
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


@pytest.fixture
def killed(cut, tmp_path):
    """Kill a program before each of its changes: how many there were, and what was found after those."""

    def run(program, *options):
        (tmp_path / "results").mkdir()
        done = subprocess.run(
            [sys.executable, "-c", CUT.replace("#", program), tmp_path / "results" / "run.nc", *map(str, options)],
            env={**os.environ, "LD_PRELOAD": str(cut)}, capture_output=True, text=True, check=False,
            cwd=Path(__file__).parents[2],
        )  # fmt: skip
        assert done.returncode == 0, done.stderr[-2000:]
        changes, seen = done.stdout.split(" ", 1)
        return int(changes), set(ast.literal_eval(seen))

    return run


def test_from_a_new_file_to_its_end(killed):
    changes, seen = killed(FROM_NEW)
    assert changes > 100
    assert seen == {
        ("first", 0, "completed"),
        *(("second", count, "running") for count in (0, 5, 10, 15)),
        ("second", 15, "completed"),
    }


@pytest.mark.parametrize("options", [(), ("with the state for a checkpoint",)])
@pytest.mark.parametrize("at", [LEVEL_1 - 2, 2 * LEVEL_1 - 1, LEVEL_2 - 1])
def test_while_an_index_gets_a_node_a_root_or_a_level(killed, at, options):
    _, seen = killed(GROWING, at, *options)
    assert seen == {("second", at, "running"), ("second", at + 3, "running")}


@pytest.mark.parametrize("at", [10, LEVEL_1 - 1, LEVEL_1, 2 * LEVEL_1 + 1])
def test_while_a_result_is_brought_back_to_a_checkpoint(killed, at):
    """It loses the rows behind the checkpoint, and no row before."""
    _, seen = killed(RESUMED, at)
    found = ((150, "interrupted"), (150, "running"), (0, "running"), (3, "running"))
    assert seen == {("second", at + more, status) for more, status in found}


def test_kills_at_random_moments(tmp_path, monkeypatch):
    """By their number, over some dozen nodes of the index; the rows are read by others too."""
    monkeypatch.setattr(netcdf_layout, "CHUNK_ROWS", CHUNK_ROWS)
    draw, path = np.random.default_rng(0), tmp_path / "run.nc"
    for _ in range(24):
        told, tell = os.pipe()
        child = os.fork()
        if child == 0:
            writer = ResultWriter(path, SIGNALS, {})
            for first in range(0, 10**9, 7):
                append(writer, first, first + 7)
                os.write(tell, first.to_bytes(4, "little"))
        os.close(tell)
        wanted, last = int(draw.integers(1, 500)), -7
        for _ in range(wanted):
            last = int.from_bytes(os.read(told, 4), "little")
        time.sleep(draw.uniform(0.0, 0.002))
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        while report := os.read(told, 4):
            last = int.from_bytes(report, "little")
        os.close(told)
        _, count, status = look(path)
        assert count >= last + 7 and status == "running"
        times, expected = rows(0, count)
        with netCDF4.Dataset(path) as file, xarray.open_dataset(path, engine="h5netcdf") as data:
            assert np.array_equal(file["time"][:count], times) and np.array_equal(data["time"][:count], times)
            for name, values in expected.items():
                assert np.array_equal(file[name][:count], values) and np.array_equal(data[name][:count], values)


@pytest.mark.parametrize("more", [0, 1, 10, 30])
def test_what_changes_at_the_end_lies_in_the_first_page(more):
    """So that each of it is changed at once."""
    content, _ = new_result(SIGNALS, {**{f"key {k}": "text" for k in range(more)}, "diagram": "title: x\n" * 2000})
    places = object_header.attributes_of(GrowingFile(BytesIO(content), len(content)), 96)
    changing = [places[key] for key in ("status", *attributes.NUMBERS, *attributes.LAST)]
    assert min(changing) == places["status"] and max(changing) + attributes.STATUS_BYTES <= 4096
