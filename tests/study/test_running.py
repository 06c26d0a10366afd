"""Running a study: all members, once; what fails is recorded; what was killed goes on."""

import io
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from cosim.errors import ResultError
from cosim.results.result_file import open_result
from cosim.study import counter, dataset, running
from cosim.study.running import Options
from cosim.study.store import Store
from cosim.terminal.cli import main
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


RECORDED = "{{diagram: diagram.yaml, record: true, variants: {{{}}}}}"


def variant(name, w):
    return f"{name}: {{set: {{blocks.swing.parameters.w: {w}}}}}"


def final(done):
    """What the files of a study end with, and what its rows say."""
    found = {}
    for name, file in done.files().items():
        with open_result(file) as result:
            found[name] = float(result["swing.x"][-1])
    assert found == {row["name"]: row["metrics"]["last"] for row in done.rows()}
    return found


def test_signals_are_those_of_the_member_also_after_it_was_changed_and_changed_back(results):
    one, two = (RECORDED.format(variant("a", w)) for w in (1, 2))
    first = final(results(one))
    assert final(results(two)) != first
    assert final(results(one)) == first


def test_signals_follow_variants_that_swap_names(results):
    first = final(results(RECORDED.format(f"{variant('a', 1)}, {variant('b', 2)}")))
    swapped = final(results(RECORDED.format(f"{variant('a', 2)}, {variant('b', 1)}")))
    assert (swapped["a"], swapped["b"]) == (first["b"], first["a"])
    third = final(results(RECORDED.format(f"{variant('a', 3)}, {variant('b', 1)}")))
    assert third["b"] == first["a"]


@pytest.mark.parametrize("left", [0, 7, 1000, -1])
def test_a_file_that_was_cut_is_written_anew(results, tmp_path, left):
    text = RECORDED.format(variant("a", 1))
    first = final(results(text))
    file = tmp_path / "results" / "members" / "a.nc"
    file.write_bytes(file.read_bytes()[:left])
    again = results(text)
    assert (again.ran, final(again)) == (1, first)


def test_two_calls_at_once_in_one_folder_are_refused(results, tmp_path):
    done = results()
    store = Store(tmp_path / "results" / "members.jsonl")
    with pytest.raises(ResultError, match="another call"):
        results()
    store.close()
    assert results().reused == done.ran


def test_a_metric_with_another_name_and_a_comment(results):
    results()
    assert results(STUDY + "\n    # a comment\n").ran == 0
    renamed = results(STUDY, DIAGRAM.replace(" top:", " highest:"))
    assert renamed.ran == 24
    assert all("highest" in row["metrics"] and "top" not in row["metrics"] for row in renamed.rows())


def test_the_data_set_is_labelled(results, tmp_path):
    xarray = pytest.importorskip("xarray")
    done = results()
    dataset.write(tmp_path / "study.nc", done)
    for engine in ("h5netcdf", "netcdf4"):
        pytest.importorskip("h5netcdf" if engine == "h5netcdf" else "netCDF4")
        with xarray.open_dataset(tmp_path / "study.nc", engine=engine) as data:
            assert dict(data.top.sizes) == {"variant": 2, "swing.w": 3, "draw": 4}
            assert list(data.variant.values) == ["plain", "slow"]
            assert list(data["swing.w"].values) == [1, 2, 3]
            row = next(row for row in done.rows() if row["name"] == "slow-2-1")
            one = data.sel({"variant": "slow", "swing.w": 3, "draw": 1})
            assert float(one.top) == row["metrics"]["top"]
            assert str(one.status.values) == "completed"
            assert data["drawn_lag.x"].shape == (4, 3, 2)


def test_the_command_line(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    written(tmp_path, DIAGRAM, "diagram.yaml")
    written(tmp_path, STUDY, "study.yaml")
    assert main(["study", "study.yaml", "--set", "random.count=2"]) == 0
    output = capsys.readouterr().out
    assert "12 members: 12 completed, none failed (ran 12" in output
    assert main(["study", "study.yaml", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["members"], found["ran"], found["counts"]) == (24, 12, {"completed": 24})
    assert main(["study", "study.yaml", "--member", "slow-2-1"]) == 0
    assert (tmp_path / "results" / "study" / "members" / "slow-2-1.nc").exists()
    assert main(["study", "study.yaml", "--member", "slow-9-1"]) == 2
    assert "no member `slow-9-1`" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("values", "code", "said"),
    [("[1, 1.0e200]", 0, "1 completed, 1 diverged"), ("[1.0e199, 1.0e200]", 1, "2 diverged")],
)
@pytest.mark.parametrize("command", ["study", "report"])
def test_the_exit_code_says_whether_any_member_came_to_its_end(
    tmp_path, monkeypatch, capsys, values, code, said, command
):
    monkeypatch.chdir(tmp_path)
    written(tmp_path, DIAGRAM, "diagram.yaml")
    written(tmp_path, f"{{diagram: diagram.yaml, grid: {{blocks.swing.parameters.w: {values}}}}}", "study.yaml")
    assert main([command, "study.yaml"]) == code
    assert said in capsys.readouterr().out or command == "report"
    if command == "study":
        assert main(["study", "study.yaml", "--member", "base-1"]) == 1


def test_two_studies_of_one_name_cannot_share_a_folder(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        written(tmp_path / folder, DIAGRAM, "diagram.yaml")
        written(tmp_path / folder, STUDY, "study.yaml")
    for command in ("study", "report"):
        assert main([command, "a/study.yaml", "b/study.yaml"]) == 2
        assert "would be written to one folder" in capsys.readouterr().err
    assert not (tmp_path / "results").exists()


@pytest.mark.parametrize("threads", ["-1", "1.5", "many", "99999"])
def test_threads_are_a_whole_number(tmp_path, capsys, threads):
    assert main(["study", "study.yaml", "--threads", threads]) == 2
    assert "whole number from 0" in capsys.readouterr().err


SLOW = DIAGRAM.replace("step: 0.01", "step: 0.00001")


def test_who_watches_is_told_of_every_member_that_is_done(study, tmp_path):
    told = []
    options = Options(tmp_path / "results", threads=1, watch=lambda *numbers: told.append(numbers))
    running.run(study(STUDY.replace("count: 4", "count: 2")), options)
    assert told == [(done, 12) for done in range(1, 13)]
    told.clear()
    results = running.run(study(), options)
    assert (results.ran, results.reused) == (12, 12)
    assert [done for done, _ in told] == sorted({done for done, _ in told}) and told[-1] == (24, 24) and len(told) == 12


def test_the_time_left_is_that_of_the_members_that_run(monkeypatch):
    """Five were done before, one a second runs since: 18 more take 18 s; what needed no run says nothing about it."""
    now = [100.0]
    monkeypatch.setattr(counter.time, "perf_counter", lambda: now[0])
    monkeypatch.setenv("TERM", "xterm")
    terminal = io.StringIO()
    terminal.isatty = lambda: True
    with counter.Counter(terminal) as bar:
        for done in range(6, 13):
            bar.update(done, 30)
            now[0] += 1.0
    assert "12/30" in terminal.getvalue() and re.search(r"\b18 s left", terminal.getvalue())


def test_sigkill_loses_nothing_that_is_done(tmp_path):
    written(tmp_path, SLOW, "diagram.yaml")
    path = written(tmp_path, STUDY.replace("count: 4", "count: 40"), "study.yaml")
    command = [sys.executable, "-m", "cosim.terminal.cli", "study", str(path), "--results", str(tmp_path)]
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
    from cosim.study import study_file

    resumed = running.run(study_file.load(path), Options(tmp_path / "study"))
    assert (resumed.ran, resumed.reused) == (240 - done, done)
    assert store.read_bytes().startswith(before)
    keys = [json.loads(line)["key"] for line in store.read_text().splitlines() if not line.startswith('{"key": "cut')]
    assert len(keys) == len(set(keys)) == 240


def test_members_that_are_finished_and_not_yet_looked_at_are_kept(study, tmp_path):
    def interrupted(done, total):
        time.sleep(0.3)  # so that others come to their end
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        running.run(study(), Options(tmp_path / "results", threads=2, watch=interrupted))
    kept = lines(tmp_path)
    assert len(kept) == len({row["key"] for row in kept}) > 1
    assert all(row["status"] == "completed" for row in kept)


@pytest.mark.parametrize("shareable", [True, False])
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_signal_ends_all_members_and_keeps_what_is_done(tmp_path, shareable, name):
    """On threads and in processes, in the middle of runs without end; the signal comes to the first process alone."""
    written(tmp_path, DIAGRAM, "diagram.yaml")
    text = STUDY.replace("count: 4", "count: 40").replace("parameters.w: [1, 2, 3]", "parameters.w: [1]")
    path = written(tmp_path, text.replace("random:", "  run.stop: [1, 1.0e+9]\n    random:"), "study.yaml")
    # A shell may have told this process to ignore Ctrl-C, which children inherit.
    code = f"""if __name__ == "__main__":
        import signal
        from cosim.terminal.cli import main
        from cosim.study.variants import Variants
        Variants.shareable = lambda self: {shareable}
        signal.signal(signal.SIGINT, signal.default_int_handler)
        raise SystemExit(main(["study", {str(path)!r}, "--results", {str(tmp_path)!r}, "--threads", "2"]))"""
    store = tmp_path / "study" / "members.jsonl"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.PIPE, text=True, env=environment)
    deadline = time.monotonic() + 120
    while (not store.exists() or store.read_bytes().count(b"\n") < 3) and time.monotonic() < deadline:
        time.sleep(0.01)
    time.sleep(0.5)
    process.send_signal(getattr(signal, name))
    _, error = process.communicate(timeout=60)
    assert process.returncode == 128 + getattr(signal, name)
    assert "came as far as" in error and "of 160 members; all that is done is kept" in error
    assert "Traceback" not in error
    rows = [json.loads(line) for line in store.read_text().splitlines()]
    assert 3 <= len(rows) < 160
    assert all(row["status"] == "completed" for row in rows)


def runs(process: str) -> bool:
    """Whether a process has not ended; one that nobody has asked for its end may still be listed."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


@pytest.mark.skipif(sys.platform != "linux", reason="looks for the children in /proc")
def test_processes_end_with_the_first_one_however_that_ends(tmp_path):
    written(tmp_path, DIAGRAM.replace("stop: 1,", "stop: 1.0e+9,"), "diagram.yaml")
    path = written(tmp_path, STUDY, "study.yaml")
    code = f"""if __name__ == "__main__":
        from cosim.terminal.cli import main
        from cosim.study.variants import Variants
        Variants.shareable = lambda self: False
        main(["study", {str(path)!r}, "--results", {str(tmp_path)!r}, "--threads", "2"])"""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.DEVNULL, env=environment)
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
    deadline = time.monotonic() + 120
    while len(found := children.read_text().split()) < 3 and time.monotonic() < deadline:
        time.sleep(0.01)
    time.sleep(2.0)
    process.kill()
    process.wait()
    deadline = time.monotonic() + 120
    while any(map(runs, found)) and time.monotonic() < deadline:
        time.sleep(0.01)
    assert len(found) == 3 and not any(map(runs, found))


def test_members_of_different_sizes_lose_no_element(results, tmp_path):
    """Of a fleet that the grid makes larger, in whatever order, and of a metric that is a number in one variant."""
    xarray = pytest.importorskip("xarray")
    diagram = DIAGRAM.replace("{x: [[0, 0], [1, 1], [2, 2]]}", "{x: 1}").replace(
        "fleets: {robot: 3}", "fleets: {robot: 2}"
    )
    diagram = diagram.replace("reduce: max", "reduce: final")
    text = """
        diagram: diagram.yaml
        variants: {several: , one: {metrics: {top: {signal: swing.x}}}}
        grid: {fleets.robot: [1, 4, 2]}
        """
    done = results(text, diagram)
    dataset.write(tmp_path / "study.nc", done)
    rows = {(row["variant"], *row["grid"]): row["metrics"]["top"] for row in done.rows()}
    with xarray.open_dataset(tmp_path / "study.nc") as data:
        tops = data["top"].values
    assert tops.shape == (2, 3, 4, 2)
    for k, count in enumerate((1, 4, 2)):
        member = np.array(rows["several", k])
        assert member.shape == (count, 2)
        assert np.array_equal(tops[0, k, :count], member) and np.isnan(tops[0, k, count:]).all()
        assert tops[1, k, 0, 0] == rows["one", k] and np.isnan(tops[1, k].ravel()[1:]).all()
