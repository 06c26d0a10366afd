"""Which conditions of theorems the runs of a study keep."""

import json

import pytest
import xarray

from cosim.report import document
from cosim.study import dataset, member_run, running
from cosim.study.running import Options
from cosim.terminal.cli import main
from cosim.wiring.network import Finding

WAVE = '''
import math
from cosim import Block, Output, Parameter
from cosim import condition

class Wave(Block):
    """A sine of the time."""
    amplitude = Parameter(default=1.0)
    y = Output()
    low = condition("y < 2", "Theorem 9")(lambda y: y.largest < 2.0)
    open = condition("y is fit")(lambda y: (None, "nobody can say"))
    def outputs(time, amplitude, y):
        y[0] = amplitude * math.sin(time)
'''
DIAGRAM = """
    run: {stop: 2, step: 0.1}
    fleets: {ship: 2}
    blocks:
      wave: {python: blocks.py:Wave, per: ship}
    metrics: {top: {signal: wave.y, reduce: max}}
    """
STUDY = """
    title: Waves
    diagram: diagram.yaml
    grid: {blocks.wave.parameters.amplitude: [1, [1, 3], 4, 1.5]}
    """
LOW, FIT = "wave: Theorem 9, y < 2", "wave: condition, y is fit"


@pytest.fixture
def waves(study, tmp_path):
    (tmp_path / "blocks.py").write_text(WAVE)
    return lambda: running.run(study(STUDY, DIAGRAM), Options(tmp_path / "results"))


def test_each_member_keeps_the_verdicts(waves):
    verdicts = [row["conditions"] for row in waves().rows()]
    assert verdicts == [
        {LOW: True, FIT: None},
        {LOW: False, FIT: None},
        {LOW: False, FIT: None},
        {LOW: True, FIT: None},
    ]


def test_an_edited_condition_is_judged_anew(waves, tmp_path):
    waves()
    (tmp_path / "blocks.py").write_text(WAVE.replace("y.largest < 2.0", "y.largest < 20.0"))
    results = waves()
    assert (results.ran, results.reused) == (4, 0)
    assert all(row["conditions"][LOW] for row in results.rows())
    assert waves().reused == 4


def test_a_fleet_has_one_verdict():
    def finding(text, holds):
        return Finding("a", text, "", holds, "")

    found = member_run._verdicts([finding(t, h) for t, h in (("x", True), ("x", None), ("y", None), ("y", False))])
    assert found == {"a: condition, x": None, "a: condition, y": False}


def test_the_data_set_has_them_as_json(waves, tmp_path):
    done = waves()
    dataset.write(tmp_path / "study.nc", done)
    with xarray.open_dataset(tmp_path / "study.nc") as data:
        kept = [json.loads(text) for text in data.conditions.values.ravel()]
    assert kept == [row["conditions"] for row in done.rows()]


def test_one_line_says_how_many_members_break_which(waves, tmp_path, monkeypatch, capsys):
    waves()
    sentence = f"{LOW} fails in 2 of 4 runs, first in base-1"
    monkeypatch.chdir(tmp_path)
    assert main(["study", "study.yaml"]) == 0
    assert capsys.readouterr().err.count(f"warning: {sentence}\n") == 1
    assert main(["study", "study.yaml", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["conditions"] == [sentence]


def test_the_report_says_so_too(waves, tmp_path):
    pytest.importorskip("matplotlib", reason="matplotlib is not installed (extra `plot`)")
    document.write(tmp_path / "report.html", [waves()])
    assert "wave: Theorem 9, y &lt; 2 fails in 2 of 4 runs, first in base-1." in (tmp_path / "report.html").read_text()


def test_rows_of_before_and_runs_that_never_began_are_not_counted():
    rows = [{"name": "a"}, {"name": "b", **member_run.lost("refused")}, {"name": "c", "conditions": {LOW: False}}]
    assert list(running.broken(rows)) == [f"{LOW} fails in 1 of 1 runs, first in c"]
    assert list(running.broken(rows[:2])) == []
