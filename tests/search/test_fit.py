"""`cosim fit`: it finds what scipy simulated, and its intervals cover that as often as they say.

The measurements are scipy's: a DC motor's speed under a step of the voltage, of second order with its inductance.
"""

import json
import os
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares
from scipy.stats import binom

from cosim.engine import run
from cosim.search import measurements
from cosim.search.estimates import estimates
from cosim.study import study_file
from cosim.terminal.cli import main

OMEGA, ZETA, GAIN, AT, NOISE = 3.3, 0.25, 1.4, 0.5, 0.02
DIAGRAM = """
run: {stop: 4, step: 0.01, method: joint, integrator: rk4}
blocks:
  voltage: {block: Step, parameters: {at: 0.5}}
  motor: {block: SecondOrder, parameters: {omega: 2, zeta: 0.5}, inputs: {u: voltage.y}}
"""
STUDY = """
diagram: diagram.yaml
fit:
  over:
    blocks.motor.parameters.omega: {uniform: [1, 10]}
    blocks.motor.parameters.zeta: {uniform: [0.05, 2]}
    blocks.motor.parameters.k: {uniform: [0.1, 5]}
  data: measured.csv
  signals: {motor.x: {column: speed}}
  starts: 2
"""
TRUTH = {"motor.omega": OMEGA, "motor.zeta": ZETA, "motor.k": GAIN}


def simulated(times: np.ndarray) -> np.ndarray:
    """The motor's states (2, k) from rest, by scipy."""
    found = np.zeros((2, len(times)))
    after = times > AT
    found[:, after] = solve_ivp(
        lambda _, x: [x[1], OMEGA**2 * (GAIN - x[0]) - 2 * ZETA * OMEGA * x[1]],
        (AT, times[-1]),
        [0, 0],
        t_eval=times[after],
        rtol=1e-10,
        atol=1e-12,
    ).y
    return found


@pytest.fixture(scope="module")
def table() -> str:
    times = np.arange(0, 4.0, 0.05)
    speed, rate = simulated(times) + NOISE * np.random.default_rng(1).normal(size=(2, len(times)))
    lines = [f"{t:.6g},{a:.9g},{b:.9g}" for t, a, b in zip(times, speed, rate, strict=True)]
    return "\n".join(["time,speed,rate", *lines])


def written(folder: Path, table: str, study: str = STUDY, diagram: str = DIAGRAM) -> Path:
    (folder / "diagram.yaml").write_text(diagram, encoding="utf-8")
    (folder / "measured.csv").write_text(table, encoding="utf-8")
    (folder / "study.yaml").write_text(study, encoding="utf-8")
    return folder / "study.yaml"


def fit(folder: Path, *options: str, capsys) -> tuple[int, dict]:
    code = main(["fit", str(folder / "study.yaml"), "--results", str(folder / "results"), "--json", *options])
    return code, json.loads(capsys.readouterr().out)


def test_a_motor_is_found_in_noise_and_the_overlay_has_it(tmp_path, table, capsys):
    written(tmp_path, table)
    code, answer = fit(tmp_path, capsys=capsys)
    assert code == 0
    assert answer["warnings"] == []
    for name, truth in TRUTH.items():
        low, high = answer["values"][name]["interval"]
        assert low < truth < high  # of this noise; how often of others stands below
        assert high - low < 0.05 * truth
    assert answer["residuals"]["motor.x"]["after"] == pytest.approx(NOISE, rel=0.3)  # chi of 77: 8 % each way
    assert answer["ends"][0] == pytest.approx(answer["ends"][1], rel=1e-6)
    metrics = "metrics={last: {signal: motor.x, reduce: final}}"
    assert main(["run", answer["overlay"], "-o", str(tmp_path / "run.nc"), "--json", "--set", metrics]) == 0
    last = json.loads(capsys.readouterr().out)["metrics"]["last"]
    assert last == pytest.approx(simulated(np.array([0.0, 4.0]))[0, 1], abs=2 * NOISE)


def test_the_same_fit_runs_nothing_anew_and_other_data_do(tmp_path, table, capsys):
    written(tmp_path, table, STUDY.replace("starts: 2", "starts: 1"))
    _, first = fit(tmp_path, "--threads", "1", capsys=capsys)
    (rows,) = (tmp_path / "results" / "study" / "fit").glob("*/runs.jsonl")
    count = len(rows.read_text().splitlines())
    _, second = fit(tmp_path, "--threads", "3", capsys=capsys)
    assert first == second
    assert len(rows.read_text().splitlines()) == count
    written(tmp_path, "\n".join(table.splitlines()[:60]), STUDY.replace("starts: 2", "starts: 1"))
    _, third = fit(tmp_path, capsys=capsys)
    assert third["measurements"] == 59
    assert third["values"] != first["values"]


def test_several_signals_with_their_deviations(tmp_path, table, capsys):
    """With both columns and the deviation that they have, chi^2 is what it is expected to be, and so no warning."""
    study = STUDY.replace("{motor.x: {column: speed}}", f"{{motor.x: {{column: speed, deviation: {NOISE}}}}}")
    one = fit_of(tmp_path / "one", table, study, capsys)
    both = study.replace(f"{NOISE}}}}}", f"{NOISE}}}, motor.v: {{column: rate, deviation: {NOISE}}}}}")
    two = fit_of(tmp_path / "two", table, both, capsys)
    assert two["warnings"] == []
    assert two["measurements"] == 2 * one["measurements"]
    for name, truth in TRUTH.items():
        (a, b), (c, d) = one["values"][name]["interval"], two["values"][name]["interval"]
        assert d - c < b - a  # more is known
        assert c < truth < d
    wrong = fit_of(tmp_path / "wrong", table, study.replace(f"{NOISE}", f"{NOISE / 3}"), capsys, code=1)
    assert "times the deviations that are said" in wrong["warnings"][0]


def fit_of(folder: Path, table: str, study: str, capsys, code: int = 0) -> dict:
    folder.mkdir()
    written(folder, table, study.replace("starts: 2", "starts: 1"))
    ended, answer = fit(folder, capsys=capsys)
    assert ended == code
    return answer


def test_a_column_in_another_unit_is_converted(tmp_path):
    """An angle in degrees, of a signal in rad, with its deviation."""
    diagram = "run: {stop: 1, step: 0.1}\nblocks: {a: {block: Atan2, inputs: {y: 1.0, x: 1.0}}}\n"
    study = STUDY.replace("motor.x: {column: speed}", "a.theta: {column: phi, unit: deg, deviation: 9}")
    path = written(tmp_path, "time,phi\n0,45\n1,180\n", study, diagram)
    loaded = study_file.load(path)
    measured = measurements.read(loaded.fit, run.load(tmp_path / "diagram.yaml"))
    (course,) = measured.courses
    assert course.values == pytest.approx([np.pi / 4, np.pi])
    assert course.scale == pytest.approx(np.pi / 20)
    assert measured.residuals([[np.pi / 4, np.pi / 2]]) == pytest.approx([0.0, -10.0])


@pytest.mark.parametrize(
    ("own", "unit", "given", "wanted", "deviation"),
    [
        ("degC", "K", 293.15, 20.0, 2.0),  # K begins elsewhere, of one size
        ("K", "degC", 20.0, 293.15, 2.0),
        ("mm", "m", 0.25, 250.0, 2000.0),
        ("km", "m", 250.0, 0.25, 0.002),
    ],
)
def test_units_of_another_size_or_origin_are_converted(tmp_path, own, unit, given, wanted, deviation):
    block = f'class Shown(Block):\n    y = Output(unit="{own}")\n\n    def outputs(y):\n        y[0] = 0.0\n'
    (tmp_path / "own.py").write_text(f"from cosim import Block, Output\n\n\n{block}")
    diagram = "run: {stop: 1, step: 0.1}\nblocks: {a: {python: own.py:Shown}}\n"
    study = STUDY.replace("motor.x: {column: speed}", f"a.y: {{column: y, unit: {unit}, deviation: 2}}")
    path = written(tmp_path, f"time,y\n0,{given}\n1,{given}\n", study, diagram)
    (course,) = measurements.read(study_file.load(path).fit, run.load(tmp_path / "diagram.yaml")).courses
    assert course.values == pytest.approx([wanted, wanted], rel=1e-12)
    assert course.scale == pytest.approx(deviation)


@pytest.mark.parametrize("known", [True, False])
def test_intervals_cover_the_truth_as_often_as_they_say(known):
    """400 fits of a decay to fresh noise, by scipy alone: 95 % of the intervals hold the truth, as a binomial would."""
    times, generator = np.linspace(0, 3, 30), np.random.default_rng(7)
    lower, width = np.array([0.0, 0.0]), np.array([4.0, 2.0])
    truth, deviation = np.array([2.0, 0.8]), 0.05

    def model(point):
        a, b = lower + width * point
        return a * np.exp(-b * times)

    def slopes(point):
        a, b = lower + width * point
        return np.column_stack([np.exp(-b * times), -a * times * np.exp(-b * times)]) * width / scale

    scale, covered = deviation if known else 1.0, np.zeros(2, int)
    for _ in range(400):
        data = model((truth - lower) / width) + deviation * generator.normal(size=len(times))
        found = least_squares(lambda p, data=data: (model(p) - data) / scale, [0.6, 0.6], slopes, (0, 1))
        made = estimates(found.x, lower, width, found.fun, slopes(found.x), known)
        covered += [one.low < value < one.high for one, value in zip(made.values, truth, strict=True)]
    least, most = binom.ppf([5e-4, 1 - 5e-4], 400, 0.95)
    assert np.all((least <= covered) & (covered <= most))


def test_what_the_data_do_not_tell_is_said(tmp_path, table, capsys):
    """Two gains in a row: their product is told, and neither of them."""
    diagram = DIAGRAM.replace("{u: voltage.y}", "{u: drive.y}")
    diagram += "  drive: {block: Gain, parameters: {k: 1}, inputs: {u: voltage.y}}\n"
    study = STUDY.replace("  data:", "    blocks.drive.parameters.k: {uniform: [0.1, 5]}\n  data:")
    written(tmp_path, table, study.replace("starts: 2", "starts: 1"), diagram)
    code, answer = fit(tmp_path, capsys=capsys)
    assert code == 1
    assert answer["warnings"] == [
        "the data do not tell motor.k, drive.k apart: other values of them together give the same"
    ]
    values = answer["values"]
    assert values["motor.k"]["interval"] is values["drive.k"]["interval"] is None
    assert values["motor.k"]["after"] * values["drive.k"]["after"] == pytest.approx(GAIN, rel=0.01)
    low, high = values["motor.omega"]["interval"]
    assert low < OMEGA < high


def test_a_value_at_its_bound_is_said(tmp_path, table, capsys):
    written(tmp_path, table, STUDY.replace("[0.05, 2]", "[0.4, 2]").replace("starts: 2", "starts: 1"))
    assert main(["fit", str(tmp_path / "study.yaml"), "--results", str(tmp_path / "results")]) == 1
    shown = capsys.readouterr()
    assert "motor.zeta is at its bound, 0.4" in shown.err
    assert "at its bound" in shown.out


def test_a_run_that_ends_early_is_no_fit_and_a_perfect_one_needs_no_noise(tmp_path, capsys):
    """x = u t: of u = 1 without a flaw. A requirement ends the runs that go beyond 0.8, which is before the data do."""
    diagram = """
run: {stop: 1, step: 0.001}
blocks: {x: {block: Integrator, inputs: {u: 0.5}, start: {x: 0}}}
requirements: {low: {formula: always(x.x < 0.8), stop: violated}}
"""
    text = """
diagram: diagram.yaml
fit:
  over: {blocks.x.inputs.u: {uniform: [0, 2]}}
  data: measured.csv
  signals: {x.x: {column: x}}
  starts: 1
"""
    written(tmp_path, "time,x\n0,0\n0.5,0.35\n1,0.7\n", text, diagram)
    code, answer = fit(tmp_path, capsys=capsys)
    assert (code, answer["warnings"]) == (0, [])
    assert answer["values"]["x.u"]["after"] == pytest.approx(0.7, abs=1e-8)
    written(tmp_path, "time,x\n0,0\n0.5,0.6\n1,1.2\n", text, diagram)
    code, answer = fit(tmp_path, capsys=capsys)
    assert code == 0
    assert 0.8 < answer["values"]["x.u"]["after"] < 0.8 / 0.899 + 1e-6  # as far as runs end, seen every 100 steps


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("column: speed", "column: sped", ("has no column `sped`", "study.yaml:9:31", "speed")),
        ("  data: measured.csv\n", "", ("`fit` has no `data`", "study.yaml:3:1")),
        ("data: measured.csv", "data: none.csv", ("none.csv", "study.yaml:8:9")),
        ("data: measured.csv", "data: measured.csv\n  time: t", ("has no column `t`", "study.yaml:9:9")),
        ("motor.x:", "motor.z:", ("has no variable `z`", "study.yaml:9:13")),
        ("motor.x:", "motor:", ("`motor` names no signal", "study.yaml:9:13")),
        ("motor.x:", '"motor.x[2]":', ("has no axes, not 1", "study.yaml:9:13")),
        ("column: speed", "column: speed, unit: m/s", ("is in no known unit, its column in m/s", "study.yaml:9:13")),
        ("column: speed", "deviation: 1", ("has no `column`", "study.yaml:9:13")),
        ("uniform: [1, 10]", "normal: [1, 10]", ("is free between two bounds", "study.yaml:5:5")),
        ("diagram.yaml\n", "diagram.yaml\nrandom: {count: 2, draws: {}}\n", ("draws nothing",)),
    ],
)
def test_a_mistake_has_its_place(tmp_path, table, capsys, old, new, told):
    assert old in STUDY
    written(tmp_path, table, STUDY.replace(old, new))
    assert main(["fit", str(tmp_path / "study.yaml"), "--results", str(tmp_path / "results")]) == 2
    shown = capsys.readouterr().err
    assert all(text in shown for text in told), shown


@pytest.mark.parametrize(
    ("row", "told"),
    [
        ("4.5,0,0", "4.5 s, in its row 81, and the run is from 0 to 4 s"),
        ("3.9,0,0", "does not rise after its row 80"),
        ("3.99,nan,0", "measured.csv:82:1"),
        ("3.99,,0", "measured.csv:82:1"),
        ("3.99,inf,0", "is infinite in its row 81"),
    ],
)
def test_a_wrong_row_of_the_data_is_told(tmp_path, table, capsys, row, told):
    written(tmp_path, f"{table}\n{row}")
    assert main(["fit", str(tmp_path / "study.yaml"), "--results", str(tmp_path / "results")]) == 2
    assert told in capsys.readouterr().err.replace(os.linesep, "\n")
