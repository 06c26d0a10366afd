"""Result files: what is written comes back, in this reader and in others, also after a kill or on a full disk."""

from __future__ import annotations

import csv
import errno
import math
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from pathlib import Path
from textwrap import dedent

import h5py
import numpy as np
import pytest
import xarray

from cosim.errors import ResultError
from cosim.results.csv_table import write_csv
from cosim.results.growing_file import CLOSING_BYTES
from cosim.results.recorded import Recorded
from cosim.results.result_file import is_result, metrics_in, open_result, read_attributes
from cosim.results.result_writer import ResultWriter, previous_path

SIGNALS = [
    Recorded("plant.x", (6, 3), float, "robot", ("m", "m", "rad"), "position and heading", "output"),
    Recorded("plant.touching", (6,), bool, "robot", None, "touches another", "local"),
    Recorded("team/graph.weights", (2, 2), np.float32, "", "1", "edge weights", "output"),
    Recorded("count.k", (), np.int64),
]
ATTRIBUTES = {
    "title": "Formation — Σ",
    "diagram": "title: x\n" * 20_000,
    "settings": ["run.stop=1"],
    "method": "jacobi",
    "engine": "compiled",
}


ROW_BYTES = 8 + 18 * 8 + 6 + 4 * 4 + 8
ATTRIBUTES_BYTES = 400_000


def samples(first, last):
    """Times and samples of the rows first … last-1; each row differs from every other."""
    rows = np.arange(first, last)
    return rows * 1e-3, {
        "plant.x": rows[:, None, None] + np.arange(18).reshape(6, 3) / 7,
        "plant.touching": (rows[:, None] + np.arange(6)) % 3 == 0,
        "team/graph.weights": (rows[:, None, None] / np.array([[1, 2], [3, 4]])).astype(np.float32),
        "count.k": rows,
    }


def write(path, last=2500, batch=400):
    with ResultWriter(path, SIGNALS, ATTRIBUTES) as writer:
        for first in range(0, last, batch):
            writer.append(*samples(first, min(first + batch, last)))
            writer.flush()
        metrics = {"N_x": 5.1e-7, "gap": math.nan, "far": math.inf, "never": None}
        metrics |= {"hits": [{"pair": [1, 6], "time": 2.345}]}
        writer.close("completed", "", metrics, steps=last, seconds={"solve": 0.25})
    return path


def check_samples(path, last):
    times, expected = samples(0, last)
    with open_result(path) as result:
        assert np.array_equal(result.times, times)
        assert set(result.signals) == set(expected)
        for name, values in expected.items():
            assert result[name].dtype == values.dtype
            assert np.array_equal(result[name], values)


def test_reads_back_what_was_written(tmp_path):
    path = write(tmp_path / "new" / "folder" / "run.nc")
    check_samples(path, 2500)
    with open_result(path) as result:
        about = result.attrs
        assert about["conditions"] == []
        assert about["title"] == ATTRIBUTES["title"] and about["diagram"] == ATTRIBUTES["diagram"]
        assert about["settings"] == ["run.stop=1"] and about["method"] == "jacobi"
        assert about["status"] == "completed" and about["steps"] == 2500 and about["seconds"] == {"solve": 0.25}
        assert {"python", "numpy", "numba", "llvmlite", "cosim", "platform"} <= set(about["versions"])
        assert about["created"].endswith("+00:00")
        x = result.signals["plant.x"]
        assert (x.shape, x.fleet, x.unit, x.causality) == ((6, 3), "robot", "m, m, rad", "output")
        assert result.signals["count.k"].unit is None
    metrics = metrics_in(read_attributes(path))
    assert math.isnan(metrics.pop("gap"))
    assert metrics == {"N_x": 5.1e-7, "far": math.inf, "never": None, "hits": [{"pair": [1, 6], "time": 2.345}]}
    assert [p.name for p in path.parent.iterdir()] == ["run.nc"]


@pytest.mark.parametrize("engine", ["h5netcdf", "netcdf4"])
def test_xarray_sees_dimensions_coordinates_units_and_values(tmp_path, engine):
    if engine == "netcdf4":
        pytest.importorskip("netCDF4")
    path = write(tmp_path / "run.nc")
    times, expected = samples(0, 2500)
    with xarray.open_dataset(path, engine=engine) as data:
        assert np.array_equal(data.time, times) and data.time.units == "s"
        assert data["plant.x"].dims == ("time", "robot", "axis3")
        assert data["plant.x"].units == "m, m, rad" and data["plant.x"].long_name == "position and heading"
        assert data.robot.values.tolist() == [1, 2, 3, 4, 5, 6]
        weights = data["team.graph.weights"]
        assert weights.dims == ("time", "axis2", "axis2_2")
        assert weights.signal == "team/graph.weights" and weights.dtype == np.float32 and weights.units == "1"
        assert data["plant.touching"].dtype == bool and data["plant.touching"].causality == "local"
        assert data["count.k"].dims == ("time",) and data["count.k"].dtype == np.int64
        for variable in data.data_vars.values():
            assert np.array_equal(variable, expected[variable.signal])
        assert set(data.coords) == {"time", "robot"}
        assert data.attrs["status"] == "completed" and data.attrs["message"] == ""
        assert data.encoding["unlimited_dims"] == {"time"}
        third = data["plant.x"].sel(robot=3).sel(time=1.0, method="nearest")
        assert np.array_equal(third, expected["plant.x"][1000, 2])


def test_a_fleet_called_time_and_one_in_a_nested_diagram(tmp_path):
    path = tmp_path / "run.nc"
    with ResultWriter(
        path, [Recorded("a.x", (2,), float, "time"), Recorded("b.x", (3,), float, "team/robot")], {}
    ) as w:
        w.append(np.zeros(1), {"a.x": np.ones((1, 2)), "b.x": np.ones((1, 3))})
    with xarray.open_dataset(path, engine="h5netcdf") as data:
        assert data["a.x"].dims == ("time", "time_") and data["b.x"].dims == ("time", "team.robot")


def test_an_empty_recording_opens(tmp_path):
    path = tmp_path / "run.nc"
    ResultWriter(path, SIGNALS, ATTRIBUTES).close("diverged", "block plant at 0 s")
    check_samples(path, 0)
    with xarray.open_dataset(path, engine="h5netcdf") as data:
        assert data.sizes["time"] == 0 and data.attrs["message"] == "block plant at 0 s"


def test_large_batches_do_not_wait_in_memory(tmp_path, monkeypatch):
    monkeypatch.setattr("cosim.results.result_writer.WAITING_BYTES", 10_000)
    writer = ResultWriter(tmp_path / "run.nc", SIGNALS, ATTRIBUTES)
    writer.append(*samples(0, 500))
    check_samples(tmp_path / "run.nc", 500)
    writer.close("completed")


def test_a_batch_may_be_overwritten_by_its_owner(tmp_path):
    with ResultWriter(tmp_path / "run.nc", SIGNALS, ATTRIBUTES) as writer:
        times, batch = samples(0, 10)
        writer.append(times, batch)
        times[:] = 0
        for values in batch.values():
            values[:] = 0
    check_samples(tmp_path / "run.nc", 10)


def test_wrong_shape_is_refused_at_once(tmp_path):
    with (
        ResultWriter(tmp_path / "run.nc", [Recorded("a.x", (3,))], {}) as writer,
        pytest.raises(ValueError, match=r"`a\.x`: samples of shape"),
    ):
        writer.append(np.zeros(2), {"a.x": np.zeros((3, 2))})


@pytest.mark.parametrize(
    ("error", "status", "message"),
    [(None, "completed", ""), (KeyboardInterrupt(), "interrupted", ""), (ValueError("why"), "failed", "why")],
)
def test_the_way_out_gives_the_status(tmp_path, error, status, message):
    path = tmp_path / "run.nc"
    try:
        with ResultWriter(path, SIGNALS, ATTRIBUTES) as writer:
            writer.append(*samples(0, 5))
            if error:
                raise error
    except (KeyboardInterrupt, ValueError) as raised:
        assert raised is error
    check_samples(path, 5)
    with open_result(path) as result:
        assert (result.attrs["status"], result.attrs["message"]) == (status, message)


def test_the_run_before_is_kept(tmp_path):
    path = tmp_path / "run.nc"
    for steps in (10, 20, 30):
        write(path, steps)
    assert previous_path(path) == tmp_path / "run.previous.nc"
    check_samples(path, 30)
    check_samples(previous_path(path), 20)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run.nc", "run.previous.nc"]


def test_two_writers_of_one_file_do_not_meet(tmp_path):
    path = tmp_path / "run.nc"
    first = ResultWriter(path, SIGNALS, ATTRIBUTES)
    first.append(*samples(0, 10))
    second = ResultWriter(path, SIGNALS, ATTRIBUTES)
    second.append(*samples(0, 20))
    first.close("completed")
    second.close("completed")
    check_samples(path, 20)
    check_samples(previous_path(path), 10)


def test_a_running_result_can_be_watched(tmp_path):
    path = tmp_path / "run.nc"
    writer = ResultWriter(path, SIGNALS, ATTRIBUTES)
    writer.append(*samples(0, 10))
    writer.flush()
    watch = "import sys, xarray; print(xarray.open_dataset(sys.argv[1], engine='h5netcdf').sizes['time'])"
    seen = subprocess.run([sys.executable, "-c", watch, path], capture_output=True, text=True, check=True)
    assert seen.stdout == "10\n"
    assert metrics_in(read_attributes(path)) == {}
    writer.close("completed")


CHILD = dedent("""
    import sys, time
    sys.path.insert(0, sys.argv[2])
    from test_results import *
    writer = ResultWriter(sys.argv[1], SIGNALS, ATTRIBUTES)
    for first in range(0, 2000, 100):
        writer.append(*samples(first, first + 100))
        writer.flush()
    writer.append(*samples(2000, 2100))
    print("flushed", flush=True)
    time.sleep(60)
""")


def test_flushed_samples_survive_sigkill(tmp_path):
    path = tmp_path / "run.nc"
    folder = Path(__file__).parent
    with subprocess.Popen([sys.executable, "-c", CHILD, path, folder], stdout=subprocess.PIPE, text=True) as child:
        assert child.stdout.readline() == "flushed\n"
        os.kill(child.pid, signal.SIGKILL)
    check_samples(path, 2000)
    with xarray.open_dataset(path, engine="h5netcdf") as data:
        assert data.sizes["time"] == 2000 and data.attrs["status"] == "running"
    assert metrics_in(read_attributes(path)) == {}
    write(path, 10)
    check_samples(previous_path(path), 2000)


FULL = dedent("""
    import resource, sys
    sys.path.insert(0, sys.argv[2])
    from test_results import *
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[3]),) * 2)
    try:
        with ResultWriter(sys.argv[1], SIGNALS, ATTRIBUTES) as writer:
            for first in range(0, 20000, 500):
                writer.append(*samples(first, first + 500))
                writer.flush()
                print(first + 500)
    except ResultError as error:
        print(error)
""")


@pytest.mark.parametrize("limit", [10_000, 1_000_000, 1_500_000])
def test_a_full_disk_is_an_error_and_keeps_what_was_flushed(tmp_path, limit):
    """A limit on the size of files stands for the full disk: both fail in the same call, in the same way."""
    path = write(tmp_path / "run.nc", 10)
    folder = Path(__file__).parent
    child = subprocess.run(
        [sys.executable, "-c", FULL, path, folder, str(limit)], capture_output=True, text=True, check=False
    )
    assert (child.returncode, child.stderr) == (0, "")
    *flushed, error, fix = child.stdout.splitlines()
    assert error == f"cannot write {path}: File too large" and "free some space" in fix
    if limit == 10_000:
        assert flushed == [] and not previous_path(path).exists()
        check_samples(path, 10)
    else:
        with open_result(path) as result:
            kept = len(result.times)
        assert 500 <= int(flushed[-1]) <= kept < int(flushed[-1]) + 500  # of the last batch, what fits
        check_samples(path, kept)
        check_samples(previous_path(path), 10)
        with open_result(path) as result:
            assert result.attrs["status"] == "failed" and "File too large" in result.attrs["message"]
    assert not [p for p in tmp_path.iterdir() if p.name.startswith(".")]


@pytest.mark.parametrize("limit", [300_000, 1_000_000, 1_234_567])
def test_on_a_full_disk_every_row_that_fits_is_kept(tmp_path, monkeypatch, limit):
    real = os.posix_fallocate

    def full(file, at, size):
        if at + size > limit:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        real(file, at, size)

    monkeypatch.setattr("os.posix_fallocate", full)

    def kept(count):
        """Of so many rows."""
        with pytest.raises(ResultError) if count > most else nullcontext(), ResultWriter(path, SIGNALS, {}) as writer:
            writer.append(*samples(0, count))
            writer.flush()
        with open_result(path) as result:
            return len(result.times)

    path, most = tmp_path / "run.nc", 0
    most = kept(20_000)
    assert 0 < most < 20_000
    check_samples(path, most)
    assert kept(most) == most and kept(most + 1) == most


def test_writers_of_several_threads_do_not_meet(tmp_path):
    """Each has HDF5 make a file in memory; of one name there is one at a time."""

    def work(k):
        for _ in range(20):
            write(tmp_path / f"{k}.nc", last=50, batch=50)

    with ThreadPoolExecutor(4) as executor:
        list(executor.map(work, range(4)))
    check_samples(tmp_path / "3.nc", 50)


def test_only_results_are_replaced(tmp_path):
    path = tmp_path / "diagram.yaml"
    path.write_text("title: precious")
    for target in (path, tmp_path):
        with pytest.raises(ResultError, match="exists and is not a result"):
            ResultWriter(target, SIGNALS, ATTRIBUTES)
    assert path.read_text() == "title: precious" and list(tmp_path.iterdir()) == [path]
    foreign = tmp_path / "measured.nc"
    with h5py.File(foreign, "w") as file:
        file["voltage"] = 3
    with pytest.raises(ResultError, match="exists and is not a result"):
        ResultWriter(foreign, SIGNALS, ATTRIBUTES)
    empty = tmp_path / "empty.nc"
    empty.touch()
    check_samples(write(empty, 10), 10)


@pytest.mark.parametrize("text", ["title: precious", "\ntitle: x", "time,voltage\n0,1\n", "name\n", "x" * 200_000])
def test_only_tables_of_signals_are_replaced_by_csv(tmp_path, text):
    table = tmp_path / "table.csv"
    table.write_text(text)
    with open_result(write(tmp_path / "run.nc", 3)) as result:
        with pytest.raises(ResultError, match="exists and is not a table of a run's signals"):
            write_csv(table, result)
        assert table.read_text() == text
        table.unlink()
        for _ in range(2):
            write_csv(table, result)
        assert len(table.read_text().splitlines()) == 4


def test_a_closed_file_has_no_space_set_aside(tmp_path):
    """While a run goes on, space is reserved beyond what is written."""
    path = tmp_path / "run.nc"
    writer = ResultWriter(path, SIGNALS, ATTRIBUTES)
    writer.append(*samples(0, 1500))
    writer.flush()
    assert path.stat().st_size > CLOSING_BYTES
    writer.close("completed")
    with h5py.File(path) as file:
        assert path.stat().st_size == file.id.get_filesize()
    assert path.stat().st_size < ATTRIBUTES_BYTES + 2 * 1500 * ROW_BYTES


def test_a_writer_killed_between_two_variables_leaves_the_rows_that_all_have(tmp_path):
    path = write(tmp_path / "run.nc", 30)
    with h5py.File(path, "r+") as file:
        for name, count in (("plant.x", 50), ("count.k", 40)):
            file[name].resize(count, axis=0)
    check_samples(path, 30)
    with h5py.File(path, "r+") as file:
        file["time"].resize(60, axis=0)
        file["plant.touching"].resize(20, axis=0)
    check_samples(path, 20)


def test_a_folder_that_cannot_be_made_or_written(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ResultError, match="cannot write"):
        ResultWriter(tmp_path / "file" / "run.nc", SIGNALS, ATTRIBUTES)
    with pytest.raises(ResultError, match=r"cannot write /proc/run\.nc"):
        ResultWriter("/proc/run.nc", SIGNALS, ATTRIBUTES)


@pytest.mark.parametrize(
    ("signal", "said"),
    [(Recorded("a.z", (), complex), "`a.z`.*complex128"), (Recorded("a.x", (0, 3)), "`a.x`.*elements")],
)
def test_signals_that_netcdf_does_not_have(tmp_path, signal, said):
    with pytest.raises(ResultError, match=said):
        ResultWriter(tmp_path / "run.nc", [signal], {})
    assert list(tmp_path.iterdir()) == []


def test_what_is_no_result_cannot_be_opened(tmp_path):
    text, foreign, cut = tmp_path / "a.nc", tmp_path / "b.nc", write(tmp_path / "c.nc")
    text.write_text("hello")
    h5py.File(foreign, "w").close()
    cut.write_bytes(cut.read_bytes()[:3000])
    for path in (text, foreign, cut, tmp_path, tmp_path / "none.nc"):
        with pytest.raises(ResultError, match=path.name):
            open_result(path)
        with pytest.raises(ResultError):
            metrics_in(read_attributes(path))


def test_an_unknown_signal_is_answered_with_the_nearest(tmp_path):
    with (
        open_result(write(tmp_path / "run.nc")) as result,
        pytest.raises(ResultError, match=r"did you mean `plant\.x`"),
    ):
        result["plant.y"]


def test_csv_gives_back_the_same_numbers(tmp_path):
    numbers = np.random.default_rng(0).normal(size=(1500, 2, 2)) * 10.0 ** np.arange(-300, 300, 0.4)[:, None, None]
    numbers[3, 0, 1], numbers[4, 1, 1] = np.nan, -np.inf
    single = np.float32(0.1) * np.arange(1500, dtype=np.float32)
    signals = [
        Recorded("plant.x", (2, 2), float, "robot"),
        Recorded("b.f", (), np.float32),
        Recorded("b.on", (1,), bool),
    ]
    path, table = tmp_path / "run.nc", tmp_path / "run.csv"
    times = np.arange(1500) * 0.1
    with ResultWriter(path, signals, {}) as writer:
        writer.append(times, {"plant.x": numbers, "b.f": single, "b.on": single[:, None] > 30})
    with open_result(path) as result:
        write_csv(table, result)
    with table.open(newline="") as file:
        header, *rows = csv.reader(file)
    assert header == ["time", "plant.x[1,1]", "plant.x[1,2]", "plant.x[2,1]", "plant.x[2,2]", "b.f", "b.on[1]"]
    read = np.array([[float(cell) for cell in row[:-1]] for row in rows])
    assert np.array_equal(read[:, 0], times)
    assert np.array_equal(read[:, 1:5], numbers.reshape(1500, 4), equal_nan=True)
    assert np.array_equal(read[:, 5].astype(np.float32), single)
    assert [row[-1] for row in rows] == ["True" if on else "False" for on in single > 30]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run.csv", "run.nc"]


def test_csv_that_cannot_be_written(tmp_path):
    with open_result(write(tmp_path / "run.nc")) as result, pytest.raises(ResultError, match="cannot write"):
        write_csv(tmp_path / "no" / "run.csv", result)


def test_recording_costs_little_more_than_the_bytes(tmp_path):
    """Time of the processor, beside plain h5py writing the same numbers: five times as much was measured."""
    signals = [Recorded(f"b{q}.x", (6, 3), float, "robot", "m") for q in range(20)]
    times, x = np.arange(3000) * 1e-2, np.random.default_rng(0).normal(size=(3000, 6, 3))

    def ours():
        with ResultWriter(tmp_path / "run.nc", signals, ATTRIBUTES) as writer:
            writer.append(times, {s.name: x for s in signals})

    def plain():
        with h5py.File(tmp_path / "plain.h5", "w") as file:
            for signal in signals:
                file[signal.name] = x

    taken = {}
    for work in (ours, plain) * 5:
        began = time.process_time()
        work()
        taken.setdefault(work, []).append(time.process_time() - began)
    assert min(taken[ours]) < 15 * min(taken[plain])


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs a child that looks first")
def test_a_damaged_file_in_which_hdf5_has_no_end_is_refused(tmp_path, monkeypatch):
    """In these bytes, among others, HDF5 goes round for ever; in a process of its own, as only SIGKILL ends it."""
    monkeypatch.setattr("cosim.results.damage.WALK_SECONDS", 1)
    path = write(tmp_path / "run.nc")
    whole, ends = path.read_bytes(), Counter()
    for at in range(0, 12_000, 1500):
        path.write_bytes(whole[:at] + bytes(3000) + whole[at + 3000 :])
        child = os.fork()
        if child == 0:
            code = 2
            try:
                is_result(path)
                with open_result(path) as result:
                    for name in result.signals:
                        result.read(name)
                code = 0
            except ResultError:
                code = 1
            finally:
                os._exit(code)
        limit = time.monotonic() + 20
        while (found := os.waitpid(child, os.WNOHANG))[0] == 0:
            if time.monotonic() > limit:
                os.kill(child, signal.SIGKILL)
            time.sleep(0.01)
        ends[os.waitstatus_to_exitcode(found[1])] += 1
    assert set(ends) <= {0, 1} and ends[1]
    path.write_bytes(whole)
    check_samples(path, 2500)


def test_what_does_not_fit_where_it_was_to_be_is_kept_whole(tmp_path):
    """The attributes written last have room set aside; also texts of any length and language are read back."""
    message, metrics = "µ" * 3000, {f"metric_{k}": k / 7 for k in range(500)}
    writer = ResultWriter(tmp_path / "run.nc", [], {})
    writer.close("failed", message, metrics, 7)
    with open_result(tmp_path / "run.nc") as result:
        assert (result.attrs["status"], result.attrs["message"], result.attrs["steps"]) == ("failed", message, 7)
        assert result.attrs["metrics"] == metrics


def test_figures_that_find_no_space_cost_no_row(tmp_path, monkeypatch):
    writer = ResultWriter(tmp_path / "run.nc", [], {})
    writer.append(np.arange(50) * 0.1, {})
    writer.flush()

    def full(file, at, size):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("os.posix_fallocate", full)
    with pytest.raises(ResultError, match="No space left"):
        writer.close("completed", "", {f"metric_{k}": k / 7 for k in range(500)}, 7)
    with open_result(tmp_path / "run.nc") as result:
        assert len(result.times) == 50 and result.attrs["status"] == "failed" and result.attrs["metrics"] == {}
        assert "found no space" in result.attrs["message"]


def test_a_run_that_goes_on_has_no_ending_yet(tmp_path):
    with ResultWriter(tmp_path / "run.nc", [], {}), open_result(tmp_path / "run.nc") as result:
        assert result.attrs["status"] == "running" and not {"metrics", "steps", "conditions"} & result.attrs.keys()


def test_a_file_of_before_conditions_were_kept_is_read(tmp_path):
    import h5py

    path = write(tmp_path / "run.nc")
    with h5py.File(path, "r+") as file:
        del file.attrs["conditions"]
    check_samples(path, 2500)
    assert metrics_in(read_attributes(path))["N_x"] == 5.1e-7
