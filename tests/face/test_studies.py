"""Many runs from a program: the bits of single runs and of the command line's study, and mistakes told at once."""

from __future__ import annotations

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import xarray

import cosim
from cosim.errors import BlockFailed, DiagramErrors, UnknownPort, UsageError, WrongType
from cosim.terminal import cli

STUDY = """
diagram: lags.yaml
grid: {blocks.first.parameters.T: [0.5, 1, 2], blocks.second.parameters.T: {linspace: [0.5, 1, 2]}}
random: {count: 3, seed: 7, draws: {blocks.first.start.x: {uniform: [-1, 1]}}}
"""


def test_a_sweep_gives_the_bits_of_single_runs(folder):
    diagram = cosim.load("lags.yaml")
    changes = [{"blocks.first.T": 0.3 + 0.1 * k, "blocks.second.start.x": k} for k in range(6)] + [{"run.stop": 2}, {}]
    table = diagram.sweep(changes)
    single = [diagram.set(change).run().metrics for change in changes]
    assert table["last"].tolist() == [m["last"] for m in single] and table.dimensions == ("run",)
    assert [row["largest"] for row in table] == [m["largest"] for m in single] and len(table) == 8
    assert table.rows[0]["blocks.first.T"] == 0.3 and table.rows[7]["status"] == "completed" and not table.failed
    assert table.dataset["last"].dims == ("run",) and table.dataset["last"].values.tolist() == table["last"].tolist()
    assert table["steps"].tolist() == [100] * 6 + [200, 100]


def test_a_study_is_that_of_the_command_line(folder):
    (folder / "study.yaml").write_text(STUDY, encoding="utf-8")
    assert cli.main(["study", "study.yaml"]) == 0
    grid = {"blocks.first.parameters.T": [0.5, 1, 2], "blocks.second.parameters.T": np.array([0.5, 1.0])}
    random = {"count": 3, "seed": 7, "draws": {"blocks.first.start.x": {"uniform": [-1, 1]}}}
    made = cosim.study(cosim.load("lags.yaml"), grid=grid, random=random)
    assert repr(made) == "a study of 3 of first.T × 2 of second.T × 3 draws: .run()"
    table, loaded = made.run(), cosim.load_study("study.yaml").run()
    assert table["last"].shape == (3, 2, 3) and table.dimensions == ("first.T", "second.T", "draw")
    with xarray.open_dataset("results/study/study.nc") as file:
        for found in (table, loaded):
            for name in ("last", "largest", "drawn_first.x"):
                assert found[name].tobytes() == file[name].values.tobytes()
            xarray.testing.assert_equal(found.dataset["last"], file["last"].isel(variant=0, drop=True))
    kept = cosim.load_study("study.yaml", {"random.count": 4}).run(results="results")
    assert kept["last"].shape == (3, 2, 4) and kept._results.reused == 18


def test_values_with_names_are_shown_by_these(folder):
    grid = {"lag": {"path": "blocks.first.T", "values": {"quick": 0.5, "slow": 2}}}
    table = cosim.study(cosim.load("lags.yaml"), grid=grid, metrics=["last"]).run()
    assert [(row["lag"], row["blocks.first.T"]) for row in table] == [("quick", 0.5), ("slow", 2)]
    assert [line.split()[0] for line in repr(table).splitlines()[:3]] == ["lag", "quick", "slow"]


def test_sweeps_in_two_threads_are_those_in_one(folder):
    diagram = cosim.load("lags.yaml")
    lists = [[{"blocks.first.T": 0.5 + 0.1 * k, "run.stop": stop} for k in range(20)] for stop in (0.5, 1.0, 1.5)]
    one = [diagram.sweep(changes)["last"].tolist() for changes in lists]
    with ThreadPoolExecutor(3) as pool:
        assert list(pool.map(lambda changes: cosim.load("lags.yaml").sweep(changes)["last"].tolist(), lists)) == one


def test_variants_and_progress(folder):
    told = []
    variants = {"short": {"set": {"run.stop": 0.5}}, "other": {"swap": {"second": "lag.py:Lag"}}}
    table = cosim.study(cosim.load("lags.yaml"), variants=variants, metrics=["last"]).run(
        progress=lambda *n: told.append(n)
    )
    assert table.dimensions == ("variant",) and table["last"].shape == (2,) and told == [(1, 2), (2, 2)]
    assert [row["variant"] for row in table] == ["short", "other"]
    assert "completed" in repr(table) and table._repr_html_().count("<tr>") == 3
    with pytest.raises(UnknownPort, match="did you mean `last`"):
        table["lasst"]


def test_mistakes_of_a_sweep_are_told_before_it_runs(folder):
    diagram = cosim.load("lags.yaml")
    good = {"blocks.first.T": 1}
    for wrong, said in (
        ({"blocks.first.TT": 1}, "did you mean `T`"),
        ({"blocks.frist.T": 1}, r"\.sweep\(\[1\], blocks\.frist\.T\): `blocks` has no `frist`"),
        ({"run.stop": 0.015}, "not a whole number of steps"),
    ):
        with pytest.raises(DiagramErrors, match=said):
            diagram.sweep([good, wrong])
    with pytest.raises(WrongType, match="run 1 is a str"):
        diagram.sweep([good, "run.stop=1"])
    with pytest.raises(UsageError, match="a sweep of no runs"):
        diagram.sweep([])
    with pytest.raises(DiagramErrors, match="`grdi`"):
        cosim.study(diagram, grdi={})
    with pytest.raises(UsageError, match="need a folder"):
        cosim.study(diagram, record=True).run()


def test_runs_that_fail_are_rows(folder):
    diagram = cosim.load("lags.yaml")
    table = diagram.sweep([{"blocks.first.T": 1.0}, {"blocks.first.T": -1e-3}])
    assert table["status"].tolist() == ["completed", "diverged"] and table.failed == 1
    assert "first" in table.rows[1]["reason"] and "1 × " in table.warnings[0] and "reason" in repr(table)
    with pytest.raises(BlockFailed, match="not one of 2 runs") as raised:
        diagram.sweep([{"blocks.first.T": -1e-3}, {"blocks.first.T": -0.9e-3}])
    assert raised.value.run["status"].tolist() == ["diverged", "diverged"]


def test_a_script_sweeps_fmus_without_a_guard(folder):
    """Processes of their own have the FMUs, and do not run the script once more."""
    diagram = cosim.load("lags.yaml")
    cosim.export_fmu(diagram.network, ["second"], folder / "second.fmu")
    script = """
print("once")
import cosim
table = cosim.load("lags.yaml").swap(second="second.fmu").sweep([{"blocks.first.T": T} for T in (0.5, 1.0)])
print(*table["last"].tolist())
class Own(cosim.Block):
    u = cosim.Input()
    y = cosim.Output()
    def outputs(u, y):
        y[0] = 2 * u
own = cosim.diagram({"run": {"stop": 1, "step": 0.01}, "metrics": {"last": {"signal": "second.x", "reduce": "final"}},
    "blocks": {"own": {"block": Own, "start": {"u": 1}}, "second": {"fmu": "second.fmu", "inputs": {"u": "own.y"}}}})
print(*own.sweep([{"blocks.own.start.u": u} for u in (0.5, 1.0)])["last"].tolist())
"""
    (folder / "script.py").write_text(script, encoding="utf-8")
    done = subprocess.run([sys.executable, "script.py"], capture_output=True, text=True, check=True)
    lines = done.stdout.splitlines()
    assert lines[0] == "once" and len(lines) == 3
    assert [float(v) for v in lines[1].split()] == diagram.sweep([{"blocks.first.T": T} for T in (0.5, 1.0)])[
        "last"
    ].tolist()
    first, second = map(float, lines[2].split())
    assert second == pytest.approx(2 * first, rel=1e-12)
