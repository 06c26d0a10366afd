"""A diagram as an object: the command line's figures, its errors, and never another diagram than was loaded."""

from __future__ import annotations

import copy
import json
import math
import os
import pickle
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction

import numpy as np
import pytest
import xarray

import cosim
from cosim.errors import (
    ChangedFile,
    DiagramErrors,
    Diverged,
    MissingFile,
    MissingPackage,
    PlotError,
    UnknownPort,
    WrongType,
    WrongValue,
)
from cosim.terminal import cli
from tests.face.conftest import BLOCKS, DIAGRAM

MAPPING = {
    "title": "Two lags",
    "run": {"stop": 1, "step": Fraction(1, 100)},
    "blocks": {
        "first": {"python": "lag.py:Lag", "start": {"u": np.float64(1)}},
        "second": {"python": "lag.py:Lag", "inputs": {"u": "first.y"}, "parameters": {"T": np.array(0.5)}},
    },
    "record": {"period": 0.1, "signals": ("first.x", "second.x", "second.y")},
    "metrics": {
        "last": {"signal": "second.x", "reduce": "final"},
        "largest": {"signal": "second.y", "reduce": "max"},
    },
}


def test_figures_and_signals_are_those_of_the_command_line(folder, capsys):
    options = ["--set", "blocks.first.parameters.T=0.3", "--set", "run.integrator=rk4", "--json"]
    assert cli.main(["run", "lags.yaml", *options]) == 0
    said = json.loads(capsys.readouterr().out)
    run = cosim.load("lags.yaml").set({"blocks.first.T": 0.3, "run.integrator": "rk4"}).run()
    assert run.metrics == said["metrics"] and run.status == said["status"] == "completed" and run.steps == said["steps"]
    with xarray.open_dataset("results/lags.nc") as file:
        xarray.testing.assert_equal(run.signals, file)
        assert all(run.signals[n].attrs.items() <= file[n].attrs.items() for n in run)
    run.save("saved.nc")
    with cosim.open_result("saved.nc") as saved, cosim.open_result("results/lags.nc") as file:
        assert saved.attrs["metrics"] == file.attrs["metrics"] and saved.attrs["diagram"] == file.attrs["diagram"]
        assert all(saved[name].tobytes() == file[name].tobytes() == run[name].tobytes() for name in run)


def test_both_engines_and_a_mapping_give_the_same_bits(folder):
    runs = [cosim.load("lags.yaml").run(), cosim.load("lags.yaml").run("python"), cosim.diagram(MAPPING).run()]
    for name in runs[0]:
        assert len({run[name].tobytes() for run in runs}) == 1
    x = runs[0]["first.x"]
    assert x == pytest.approx(1 - 0.99 ** (10 * np.arange(11)), rel=1e-12)  # Euler's method, in closed form
    again = cosim.diagram(MAPPING).yaml
    (folder / "again.yaml").write_text(again, encoding="utf-8")
    assert cosim.load("again.yaml").run().metrics == runs[0].metrics


def test_a_fleet_has_its_members_first(folder):
    fleet = cosim.load("lags.yaml").set(
        {"fleets": {"cart": 3}, "blocks.first.per": "cart", "blocks.second.per": "cart"}
    )
    run = fleet.set({"blocks.second.parameters.T": [0.5, 1.0, 2.0], "blocks.first.start.x": "i"}).run()
    assert run["second.x"].shape == (11, 3) and run["first.x"][0].tolist() == [1, 2, 3]
    assert run.signals["second.x"].dims == ("time", "cart") and run.signals["cart"].values.tolist() == [1, 2, 3]


def test_a_value_alone_is_a_parameter_or_a_start_value(folder, capsys):
    """On the command line, from Python, and on the axes of a study."""
    for name, value in (("blocks.first.u", 3.0), ("blocks.first.T", 3.0)):
        full = name.replace(".u", ".start.u").replace(".T", ".parameters.T")
        runs = [cosim.load("lags.yaml").set({path: value}).run().metrics for path in (name, full)]
        assert cli.main(["run", "lags.yaml", "--json", "--set", f"{name}={value}"]) == 0
        assert runs == [json.loads(capsys.readouterr().out)["metrics"]] * 2
        table = cosim.study(cosim.load("lags.yaml"), grid={name: [1.0, value]}).run()
        assert table["last"][1] == runs[0]["last"] and table.dimensions == (name.removeprefix("blocks."),)


def test_nothing_changes_a_diagram(folder):
    diagram = cosim.load("lags.yaml")
    longer = diagram.set({"run.stop": 2})
    other = longer.set({"metrics.last": None}).swap(second="lag.py:Lag")
    assert [d.run().time for d in (diagram, longer, other)] == [1.0, 2.0, 2.0]
    assert list(other.run().metrics) == ["largest"] and list(longer.run().metrics) == ["last", "largest"]
    with pytest.raises(ValueError, match="read-only"):
        diagram.run()["first.x"][0] = 1.0


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"run.stp": 1}, r".set(run.stp): `run` has no `stp`" + "\n    fix: did you mean `stop`?"),
        ({"blocks.frist.T": 1}, r".set(blocks.frist.T): `blocks` has no `frist`" + "\n    fix: did you mean `first`?"),
        ({"blocks.first.TT": 1}, "block first: Lag has no parameter `TT`\n    fix: did you mean `T`?"),
        ({"blocks.first.perid": 1}, "`blocks.first` has no `perid`\n    fix: did you mean `period`?"),
        ({"run.stop": object()}, ".set(run.stop): a value of type object is nothing that a diagram says"),
        ({"run.stop": 0.015}, "`run.stop` of 0.015 s is not a whole number of steps of 0.01 s"),
        ({"blocks.first.T": 1 + 2j}, "a value of type complex is nothing that a diagram says"),
        ({"blocks.first.parameters": {"T": [1, 2]}}, "block first"),
    ],
)
def test_mistakes_name_the_key_and_the_nearest_name(folder, values, said):
    with pytest.raises(cosim.CosimError) as raised:
        cosim.load("lags.yaml").set(values).check()
    assert said in str(raised.value)


def test_mistakes_of_a_mapping_name_the_path_of_its_keys(folder):
    wrong = {**MAPPING, "run": {"stop": 1, "step": -1}, "metrics": {"last": {"signal": "third.x", "reduce": "final"}}}
    with pytest.raises(DiagramErrors) as raised:
        cosim.diagram(wrong).check()
    assert [str(e.position) for e in raised.value.errors] == ["run.step", "metrics.last.signal"]
    listed = {**MAPPING, "record": {"signals": ["first.x", "first.z"]}}
    with pytest.raises(cosim.CosimError, match=r"^record\.signals\[1\]: "):
        cosim.diagram(listed).check()
    with pytest.raises(WrongType, match="takes a mapping"):
        cosim.load("lags.yaml").set([("run.stop", 1)])
    with pytest.raises(WrongType, match="run: a key is text, not a value of type float"):
        cosim.diagram({"run": {1.5: 2}})
    with pytest.raises(WrongType, match="a diagram is a mapping, not a value of type list"):
        cosim.diagram([1])
    loop = {}
    loop["blocks"] = loop
    with pytest.raises(cosim.CosimError, match="nested more than"):
        cosim.diagram(loop)
    with pytest.raises(DiagramErrors, match="is a study, not a diagram"):
        cosim.diagram({"diagram": "lags.yaml"})


def test_a_mapping_extends_a_file_and_has_diagrams_in_it(folder):
    (folder / "sub").mkdir()
    (folder / "sub" / "inner.yaml").write_text(DIAGRAM.replace("lag.py", "../lag.py"), encoding="utf-8")
    whole = cosim.load("lags.yaml").set({"run.stop": 0.5, "blocks.first.start.u": 2}).run().metrics
    over = {"extends": "inner.yaml", "run": {"stop": 0.5}, "blocks": {"first": {"start": {"u": 2}}}}
    inside = {
        "run": {"stop": 0.5, "step": 0.01},
        "blocks": {"lags": {"diagram": "inner.yaml", "start": {"first.u": 2}}},
        "metrics": {"last": {"signal": "lags/second.x", "reduce": "final"}},
    }
    assert cosim.diagram(over, folder="sub").set({}).run().metrics == whole
    made = cosim.diagram(inside, folder="sub")
    assert made.run().metrics == {"last": whole["last"]}
    slower = made.set({"blocks.lags/second.T": 2.0}).run().metrics
    assert slower == made.set({"blocks.lags.parameters": {"second.T": 2.0}}).run().metrics != made.run().metrics
    (folder / "sub" / "inner.yaml").write_text(DIAGRAM, encoding="utf-8")
    with pytest.raises(ChangedFile, match=r"`sub/inner\.yaml`"):
        made.run()


def test_errors_have_the_words_of_the_command_line(folder, capsys):
    (folder / "wrong.yaml").write_text(DIAGRAM.replace("first.y", "first.z"), encoding="utf-8")
    cli.main(["run", "wrong.yaml"])
    shown = capsys.readouterr().err
    with pytest.raises(DiagramErrors) as raised:
        cosim.load("wrong.yaml").run()
    (mistake,) = raised.value.errors
    assert mistake.message.split(":")[-1].strip() in " ".join(shown.split()) and "wrong.yaml:6:" in str(raised.value)
    with pytest.raises(DiagramErrors) as raised:
        cosim.load("lag.yaml")
    assert isinstance(raised.value.errors[0], MissingFile) and "did you mean `lags.yaml`?" in str(raised.value)


def test_a_run_that_fails_raises_with_what_there_is_of_it(folder):
    diagram = cosim.load("lags.yaml").set({"blocks.first.T": -1e-3})
    with pytest.raises(Diverged) as raised:
        diagram.run()
    run = raised.value.run
    assert run.status == "diverged" and 0 < run.time < 1 and np.all(np.isfinite(run["first.x"])) and len(run.times) > 1
    same = diagram.run(check=False)
    assert same.status == "diverged" and str(same.error) == str(raised.value) and same.ended in repr(same)
    with pytest.raises(WrongValue, match="there is no engine `nativ`"):
        diagram.run("nativ")


def test_a_signal_that_is_not_recorded_says_how(folder):
    run = cosim.load("lags.yaml").run()
    with pytest.raises(UnknownPort, match=r"record\.signals"):
        run["first.y"]
    with pytest.raises(UnknownPort, match="did you mean `x`"):
        run["second.xx"]
    with pytest.raises(UnknownPort, match=r"`first\.y` is not recorded"):
        run.plot("first.y[1]")
    bare = cosim.load("lags.yaml").set({"record": None}).run()
    assert not list(bare) and not bare.signals.data_vars
    with pytest.raises(PlotError, match="recorded no signals"):
        bare.plot()


def test_without_xarray_there_are_numpy_s_arrays(folder, monkeypatch):
    monkeypatch.setitem(sys.modules, "xarray", None)
    diagram = cosim.load("lags.yaml")
    run, table = diagram.run(), diagram.sweep([{"blocks.first.T": 1}])
    for ask in (lambda: run.signals, lambda: table.dataset):
        with pytest.raises(MissingPackage, match=r"pip install 'cosim\[xarray\]'"):
            ask()
    assert run["first.x"].shape == (11,) and table["last"].shape == (1,)


def test_files_that_change_are_never_run_in_silence(folder):
    diagram = cosim.load("lags.yaml")
    before = diagram.run().metrics
    (folder / "lag.py").write_text(BLOCKS.replace("(u - x) / T", "(u - x) / T / 2"), encoding="utf-8")
    for attempt in (diagram.run, diagram.set({"run.stop": 1}).run, lambda: diagram.sweep([{"blocks.first.T": 1}])):
        with pytest.raises(ChangedFile, match=r"`lag\.py` is not what it was"):
            attempt()
    assert cosim.load("lags.yaml").run().metrics["last"] < before["last"]
    (folder / "lag.py").write_text(BLOCKS, encoding="utf-8")
    assert diagram.run().metrics == before
    late = cosim.load("lags.yaml")
    (folder / "lags.yaml").write_text(DIAGRAM.replace("stop: 1", "stop: 2"), encoding="utf-8")
    with pytest.raises(ChangedFile):
        late.run()
    assert cosim.load("lags.yaml").run().time == 2.0


def test_a_table_that_changes_is_never_run_in_silence(folder):
    np.save("T.npy", 2.0)
    diagram = cosim.load("lags.yaml").set({"blocks.first.parameters.T": {"file": "T.npy"}})
    before = diagram.run().metrics
    np.save("T.npy", 3.0)
    for attempt in (diagram.run, diagram.set({"run.stop": 1}).run, lambda: diagram.sweep([{"blocks.second.T": 1}])):
        with pytest.raises(ChangedFile, match=r"`T\.npy` is not what it was"):
            attempt()
    np.save("T.npy", 2.0)
    assert diagram.run().metrics == before


def test_the_working_folder_may_change(folder, tmp_path_factory):
    (folder / "outer.yaml").write_text(
        "run: {stop: 1, step: 0.01}\nblocks: {inner: {diagram: inner.yaml}}\nrecord: {signals: [inner/first.x]}\n"
        "metrics: {last: {signal: inner/first.x, reduce: final}}",
        encoding="utf-8",
    )
    (folder / "inner.yaml").write_text("blocks: {first: {python: lag.py:Lag, start: {u: 1}}}", encoding="utf-8")
    outer, mapped = cosim.load("outer.yaml"), cosim.diagram(MAPPING)
    swapped = outer.swap({"inner/first": "lag.py:Lag"})
    before = [outer.run().metrics, mapped.run().metrics]
    other = tmp_path_factory.mktemp("other")
    (other / "lag.py").write_text("raise RuntimeError", encoding="utf-8")
    os.chdir(other)
    assert [d.run().metrics for d in (outer, mapped, outer.set({}), swapped)] == [*before, before[0], before[0]]
    assert outer.sweep([{"blocks.inner/first.T": 1.0}])["last"][0] == before[0]["last"]


def test_diagrams_are_copied_and_pickled(folder):
    for diagram in (cosim.load("lags.yaml").set({"blocks.first.T": 2}), cosim.diagram(MAPPING)):
        metrics = diagram.run().metrics
        for twin in (copy.copy(diagram), copy.deepcopy(diagram), pickle.loads(pickle.dumps(diagram))):  # noqa: S301
            assert twin.run().metrics == metrics


def test_threads_run_diagrams_at_once(folder):
    def figure(k: int) -> float:
        return cosim.load("lags.yaml").set({"blocks.first.T": 1.0 + k % 4}).run().metrics["last"]

    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(figure, range(24)))
    assert found == [figure(k) for k in range(4)] * 6
    shared = cosim.load("lags.yaml")
    started = threading.Barrier(4)

    def together(_: int) -> str:
        started.wait()
        return json.dumps(shared.run().metrics)

    with ThreadPoolExecutor(4) as pool:
        assert len(set(pool.map(together, range(4)))) == 1


def test_ctrl_c_ends_a_run_and_keeps_what_there_is(folder):
    script = """
import cosim, os, signal, sys
diagram = cosim.load("lags.yaml").set({"run.stop": 1e6, "record.period": 100})
def strike(time):
    if time > 1000:
        os.kill(os.getpid(), signal.SIGINT)
try:
    diagram.run(watch=strike)
except KeyboardInterrupt as stopped:
    run = stopped.run
    print(run.status, run.time > 1000, len(run.times) > 10)
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["interrupted", "True", "True"] and not done.stderr


def test_words_and_pictures(folder):
    diagram = cosim.load("lags.yaml")
    assert repr(diagram).splitlines()[0] == "Two lags: 1 s in steps of 0.01 s (jacobi)"
    shown = diagram._repr_mimebundle_()
    assert shown["image/svg+xml"].count("<rect") == 3 and ">first<" in shown["image/svg+xml"]
    assert "first.y → second.u" in diagram.draw("lags.svg").svg and (folder / "lags.svg").exists()
    wrong = diagram.set({"blocks.first.T": "x"})
    assert "image/svg+xml" not in wrong._repr_mimebundle_() and "a diagram that cannot run" in repr(wrong)
    run = diagram.run()
    assert run._repr_html_().count("<tr>") == 3 and "completed at 1 s" in run._repr_html_()
    assert [line.split()[0] for line in repr(run).splitlines()[:3]] == ["metric", "last", "largest"]
    assert max(map(len, repr(run).splitlines())) < 80
    assert "<svg" in run.plot("first.x", output="x.png")._repr_svg_() and (folder / "x.png").exists()
    assert diagram.check().order and not diagram.check().warnings


def test_an_fmu_alone_and_in_a_block_s_place(folder):
    diagram = cosim.load("lags.yaml")
    cosim.export_fmu(diagram.network, ["second"], folder / "second.fmu")
    run = diagram.run()
    with_fmu = diagram.swap(second="second.fmu")
    assert with_fmu.run().metrics == run.metrics
    alone = cosim.load("second.fmu").set({"run.stop": 1, "run.step": 0.01, "run.integrator": "euler"})
    assert alone.run()["second.x"].shape == (101,)
    table = with_fmu.sweep([{"blocks.first.T": T} for T in (0.5, 1.0, 2.0)])
    assert table["last"][1] == run.metrics["last"] and np.all(np.diff(table["last"]) < 0)
    with (folder / "second.fmu").open("ab") as file:
        file.write(b" ")
    with pytest.raises(ChangedFile):
        with_fmu.run()


def test_time_constants_in_closed_form(folder):
    """With scipy's method under `joint`: x = 1 - exp(-t/T)."""
    exact = {"run.method": "joint", "run.integrator": "dop853", "run.tolerance": 1e-10}
    run = cosim.load("lags.yaml").set({**exact, "blocks.first.T": 0.25}).run()
    assert run["first.x"] == pytest.approx([1 - math.exp(-t / 0.25) for t in run.times], abs=1e-8)
