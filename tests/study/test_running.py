"""Running a study: all members, once; what fails is recorded; what was killed goes on."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from cosim.cli import main
from cosim.study import dataset, running, tables
from cosim.study.running import Options
from tests.study.conftest import DIAGRAM, STUDY, written


def lines(tmp_path):
    return [json.loads(line) for line in (tmp_path / "results" / "members.jsonl").read_text().splitlines()]


def test_every_member_runs_once(results, tmp_path):
    first = results()
    assert (first.ran, first.reused, first.total) == (24, 0, 24)
    rows = list(first.rows())
    assert [row["name"] for row in rows[:5]] == ["plain-0-0", "plain-0-1", "plain-0-2", "plain-0-3", "plain-1-0"]
    assert all(row["status"] == "completed" and row["steps"] == 100 for row in rows)
    # dx/dt = v, dv/dt = -w^2 x by forward Euler: x_k = Re (1 + i w h)^k
    for row in rows:
        w = (1, 2, 3)[row["grid"][0]]
        assert row["metrics"]["last"] == pytest.approx(((1 + 1j * w * 0.01) ** 100).real, rel=1e-12)


def test_a_second_call_repeats_nothing(results):
    first, second = results(), results()
    assert (second.ran, second.reused) == (0, 24)
    assert list(first.rows()) == list(second.rows())


def test_one_thread_or_many_give_the_same_bits(results, tmp_path):
    one = [row["metrics"] for row in results(threads=1).rows()]
    (tmp_path / "results" / "members.jsonl").unlink()
    assert [row["metrics"] for row in results(threads=4).rows()] == one


def test_a_change_reruns_only_what_it_changes(results):
    results()
    wider = results(STUDY.replace("[1, 2, 3]", "[1, 2, 3, 4]"))
    assert (wider.ran, wider.reused) == (2 * 4, 24)
    slower = results(STUDY.replace("T: 2", "T: 3"))
    assert (slower.ran, slower.reused) == (12, 12)
    back = results()
    assert (back.ran, back.reused) == (0, 24)


def test_members_that_are_the_same_run_are_run_once(results):
    twice = results("{diagram: diagram.yaml, variants: {a: {}, b: {}}}")
    assert twice.ran == 1
    assert [row["variant"] for row in twice.rows()] == ["a", "b"]


def test_a_diverged_member_is_recorded_and_stops_nothing(results):
    text = "{diagram: diagram.yaml, grid: {blocks.swing.parameters.w: [1, 1.0e200, 2]}}"
    done = results(text)
    assert [row["status"] for row in done.rows()] == ["completed", "diverged", "completed"]
    summary = running.summary(done)
    ((reason, (count, name)),) = summary["reasons"].items()
    assert "swing" in reason and "not finite" in reason
    assert (count, name) == (1, "base-1")
    assert results(text).ran == 0


def test_values_that_a_member_cannot_take_are_its_own_failure(results):
    done = results('{diagram: diagram.yaml, grid: {blocks.swing.parameters.w: [1, "1/0", 2]}}')
    rows = list(done.rows())
    assert [row["status"] for row in rows] == ["completed", "failed", "completed"]
    assert "1/0" in rows[1]["reason"]


def test_recording_writes_one_file_for_each_member(results, tmp_path):
    text = "{diagram: diagram.yaml, record: true, grid: {blocks.swing.parameters.w: [1, 2]}}"
    results(text)
    files = sorted((tmp_path / "results" / "members").glob("*.nc"))
    assert [file.name for file in files] == ["base-0.nc", "base-1.nc"]
    files[0].unlink()
    assert results(text).ran == 1


def test_the_data_set_is_labelled(results, tmp_path):
    xarray = pytest.importorskip("xarray")
    done = results()
    dataset.write(tmp_path / "study.nc", done)
    for engine in ("h5netcdf", "netcdf4"):
        pytest.importorskip("h5netcdf" if engine == "h5netcdf" else "netCDF4")
        with xarray.open_dataset(tmp_path / "study.nc", engine=engine) as data:
            assert dict(data.top.sizes) == {"variant": 2, "w": 3, "draw": 4}
            assert list(data.variant.values) == ["plain", "slow"]
            assert list(data.w.values) == [1, 2, 3]
            row = next(row for row in done.rows() if row["name"] == "slow-2-1")
            one = data.sel(variant="slow", w=3, draw=1)
            assert float(one.top) == row["metrics"]["top"]
            assert str(one.status.values) == "completed"
            assert data.drawn_x.shape == (4, 3, 2)


def test_tables(results, tmp_path):
    text = STUDY.rstrip() + (
        "\n    tables:\n      Tops:\n        rows: [variant, w]\n        columns:\n"
        "          most: {metric: top, over: max, format: .4f}\n          half: {metric: top, over: 0.5}\n"
        "          low: {metric: low, below: -0.5}\n"
    )
    done = results(text)
    (table,) = tables.tables(done)
    assert table.head == ["variant", "w", "most", "half", "low"]
    assert [row[:2] for row in table.rows] == [[v, w] for v in ("plain", "slow") for w in "123"]
    tops = [row["metrics"]["top"] for row in done.rows()][:4]
    assert table.values[0][0] == max(tops)
    assert table.values[0][1] == np.median(tops)
    assert [row[-1] for row in table.rows] == ["0.0%", "0.0%", "100.0%"] * 2
    tables.write(done, [table])
    assert (tmp_path / "results" / "tops.md").read_text().count("|") == 6 * 8
    assert f"{max(tops)!r}" in (tmp_path / "results" / "tops.csv").read_text()


def test_the_command_line(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    written(tmp_path, DIAGRAM, "diagram.yaml")
    written(tmp_path, STUDY, "study.yaml")
    assert main(["study", "study.yaml", "--set", "random.count=2"]) == 0
    output = capsys.readouterr().out
    assert "12 members: 12 completed (ran 12" in output
    assert main(["study", "study.yaml", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["members"], found["ran"], found["counts"]) == (24, 12, {"completed": 24})
    assert main(["study", "study.yaml", "--member", "slow-2-1"]) == 0
    assert (tmp_path / "results" / "study" / "members" / "slow-2-1.nc").exists()
    assert main(["study", "study.yaml", "--member", "slow-9-1"]) == 2
    assert "no member `slow-9-1`" in capsys.readouterr().err


SLOW = DIAGRAM.replace("step: 0.01", "step: 0.00001")


def test_sigkill_loses_nothing_that_is_done(tmp_path):
    written(tmp_path, SLOW, "diagram.yaml")
    path = written(tmp_path, STUDY.replace("count: 4", "count: 40"), "study.yaml")
    command = [sys.executable, "-m", "cosim.cli", "study", str(path), "--results", str(tmp_path)]
    store = tmp_path / "study" / "members.jsonl"
    process = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    )
    deadline = time.monotonic() + 120
    while (not store.exists() or store.read_bytes().count(b"\n") < 10) and time.monotonic() < deadline:
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    process.wait()
    before = store.read_bytes()
    done = before.count(b"\n")
    assert 10 <= done < 240
    with store.open("ab") as file:
        file.write(b'{"key": "cut o')  # as a crash of the machine could leave it
    from cosim.study import description

    resumed = running.run(description.load(path), Options(tmp_path / "study"))
    assert (resumed.ran, resumed.reused) == (240 - done, done)
    assert store.read_bytes().startswith(before)
    keys = [json.loads(line)["key"] for line in store.read_text().splitlines() if not line.startswith('{"key": "cut')]
    assert len(keys) == len(set(keys)) == 240


def test_ctrl_c_keeps_what_is_done(tmp_path):
    written(tmp_path, SLOW, "diagram.yaml")
    path = written(tmp_path, STUDY.replace("count: 4", "count: 400"), "study.yaml")
    # A shell may have told this process to ignore Ctrl-C, which children inherit.
    code = f"""if True:
        import signal
        from cosim.cli import main
        signal.signal(signal.SIGINT, signal.default_int_handler)
        raise SystemExit(main(["study", {str(path)!r}, "--results", {str(tmp_path)!r}]))"""
    store = tmp_path / "study" / "members.jsonl"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.PIPE, text=True, env=environment)
    deadline = time.monotonic() + 120
    while (not store.exists() or store.read_bytes().count(b"\n") < 5) and time.monotonic() < deadline:
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    _, error = process.communicate(timeout=30)
    assert process.returncode == 130
    assert "of 2400 members are done" in error and "Traceback" not in error
    rows = [json.loads(line) for line in store.read_text().splitlines()]
    assert 5 <= len(rows) < 2400
    assert all(row["status"] == "completed" for row in rows)
