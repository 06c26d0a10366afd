"""`cosim tune`: it finds the minimum that theory gives, keeps its bounds, and is not deceived by a step."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from cosim.errors import Position
from cosim.language.source import Node
from cosim.search.worth import figures
from cosim.study import executors
from cosim.study.plan import Member
from cosim.terminal.cli import main

# The integrals of u1 = p and u2 = q over 1 s, from 0: x(1) = p, y(1) = q, exact under any method.
PLANE = """
run: {stop: 1, step: 0.125}
blocks:
  x: {block: Integrator, inputs: {u: 1.5}, start: {x: 0}}
  y: {block: Integrator, inputs: {u: 0.2}, start: {x: 0}}
metrics:
  p: {signal: x.x, reduce: final}
  q: {signal: y.x, reduce: final}
"""
BOWL = """
diagram: diagram.yaml
tune:
  over:
    blocks.x.inputs.u: {uniform: [-2, 2]}
    blocks.y.inputs.u: {uniform: [-2, 2]}
  minimise: (p - 1)**2 + 2*(q + 0.5)**2
  runs: 900
"""
# x' = -k x, x_0 = 1, with forward Euler: x(h) = 0 for k = 1/h, however small x is to be; exactly it is exp(-k t).
DECAY = """
run: {stop: 1, step: 0.1}
blocks:
  gain: {block: Gain, inputs: {u: plant.x}, parameters: {k: -1}}
  plant: {block: Integrator, inputs: {u: gain.y}, start: {x: 1}}
metrics:
  last: {signal: plant.x, reduce: final}
"""
DECEIVED = """
diagram: diagram.yaml
tune:
  over: {blocks.gain.parameters.k: {uniform: [-12, -0.1]}}
  minimise: abs(last)
  accuracy: ACCURACY
  runs: 200
"""


def written(folder: Path, diagram: str, study: str) -> Path:
    (folder / "diagram.yaml").write_text(diagram, encoding="utf-8")
    path = folder / "study.yaml"
    path.write_text(study, encoding="utf-8")
    return path


def tune(folder: Path, *options: str, capsys) -> tuple[int, dict]:
    code = main(["tune", str(folder / "study.yaml"), "--results", str(folder / "results"), "--json", *options])
    return code, json.loads(capsys.readouterr().out)


def after(answer: dict) -> dict[str, float]:
    return {path: pair[1] for path, pair in answer["values"].items()}


def test_a_bowl_is_gone_down_to_its_bottom_and_the_overlay_has_it(tmp_path, capsys):
    written(tmp_path, PLANE, BOWL)
    code, answer = tune(tmp_path, capsys=capsys)
    assert code == 0
    found = after(answer)
    assert found["blocks.x.inputs.u"] == pytest.approx(1.0, abs=1e-3)
    assert found["blocks.y.inputs.u"] == pytest.approx(-0.5, abs=1e-3)
    assert answer["values"]["blocks.x.inputs.u"][0] == 1.5
    assert main(["run", answer["overlay"], "-o", str(tmp_path / "run.nc"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["metrics"]["p"] == answer["after"]["runs"][0]["p"]  # to the bit


def test_functions_of_an_objective_are_no_figures():
    objective = Node("max(p, 1) + abs(q)*pi", Position(""))
    assert figures(SimpleNamespace(objective=objective, subject=())) == ["p", "q"]


def test_bounds_are_kept_where_the_minimum_lies_beyond_them(tmp_path, capsys):
    """With p <= 0.4 and q >= 0 the minimum is at (0.4, 0)."""
    study = BOWL + "  subject: {p: {most: 0.4}, q: {least: 0}}\n"
    written(tmp_path, PLANE, study)
    code, answer = tune(tmp_path, capsys=capsys)
    assert code == 0
    found = after(answer)
    assert found["blocks.x.inputs.u"] == pytest.approx(0.4, abs=0.02)
    assert found["blocks.x.inputs.u"] <= 0.4
    assert found["blocks.y.inputs.u"] == pytest.approx(0.0, abs=0.02)
    assert found["blocks.y.inputs.u"] >= 0.0


def test_requirements_are_bounds_too(tmp_path, capsys):
    study = BOWL.replace("tune:", "requirements: {slow: always(x.x < 0.4)}\ntune:")
    written(tmp_path, PLANE, study)
    code, answer = tune(tmp_path, capsys=capsys)
    assert code == 0
    assert 0.38 < after(answer)["blocks.x.inputs.u"] < 0.4
    assert answer["before"]["broken"] == ["slow"]


def test_what_only_a_step_makes_small_does_not_count(tmp_path, capsys):
    """Forward Euler gives 0 at k = -10; within a tenth of the truth it is from 10 steps up to |k| of about 0.2 only."""
    written(tmp_path, DECAY, DECEIVED.replace("ACCURACY", "0.1"))
    code, answer = tune(tmp_path, capsys=capsys)
    assert code == 0
    k = -after(answer)["blocks.gain.parameters.k"]
    coarse, fine = (1 - 0.1 * k) ** 10, (1 - 0.01 * k) ** 100
    assert abs(coarse - fine) <= 0.1 * fine
    assert answer["after"]["changes"] == pytest.approx(abs(coarse - fine) / fine, rel=1e-6)
    edge = next(k for k in np.arange(0.1, 12, 1e-3) if abs((1 - 0.1 * k) ** 10 / (1 - 0.01 * k) ** 100 - 1) > 0.1)
    assert k == pytest.approx(edge, rel=0.05)  # as far as the accuracy lets it go


def test_a_figure_of_several_draws_is_their_mean_and_some_are_held_out(tmp_path, capsys):
    """x(1) = start + p, with starts s_i: the mean of (x(1) - 1)^2 is least at p = 1 - mean(s)."""
    random = "random: {count: 6, seed: 3, draws: {blocks.x.start.x: {uniform: [-1, 1]}}}\n"
    study = random + BOWL.replace("runs: 900", "runs: 3000\n  held_out: 2")
    written(tmp_path, PLANE, study)
    code, answer = tune(tmp_path, capsys=capsys)
    assert code == 0
    assert [len(answer["after"][kind]) for kind in ("runs", "held_out")] == [4, 2]
    p = after(answer)["blocks.x.inputs.u"]
    starts = [run["p"] - p for run in answer["after"]["runs"]]
    assert p == pytest.approx(1 - np.mean(starts), abs=0.01)


def test_another_process_has_the_smaller_step_too(tmp_path):
    """As runs with FMUs have it, each in a process of its own: what it reads says nothing of a tenth of the step."""
    path = written(tmp_path, PLANE, BOWL)
    chosen = Member("base", settings=(("blocks.x.inputs.u", 1.0), ("run.step", 0.0125)))
    row = executors.run_elsewhere(executors.StudyFile(str(path), ()), chosen, None, "")
    assert (row["status"], row["steps"]) == ("completed", 80)


def test_where_nothing_is_better_that_is_said(tmp_path, capsys):
    written(tmp_path, PLANE, BOWL + "  subject: {p: {least: 5}}\n")
    code, answer = tune(tmp_path, "--runs", "60", capsys=capsys)
    assert (code, answer["found"], answer["overlay"]) == (1, False, None)
    assert answer["before"]["broken"] == ["p is at least 5"]


def test_the_same_tuning_runs_nothing_anew(tmp_path, capsys):
    written(tmp_path, PLANE, BOWL)
    rows = tmp_path / "results" / "study" / "tune" / "runs.jsonl"
    _, first = tune(tmp_path, "--runs", "200", "--threads", "1", capsys=capsys)
    count = len(rows.read_text().splitlines())
    _, second = tune(tmp_path, "--runs", "200", "--threads", "3", capsys=capsys)
    assert first == second
    assert len(rows.read_text().splitlines()) == count


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("minimise: (p - 1)**2 + 2*(q + 0.5)**2", "minimise: (r - 1)**2", "there is no metric `r`"),
        ("  minimise: (p - 1)**2 + 2*(q + 0.5)**2\n", "", "`tune` has no `minimise`"),
        ("minimise: (p - 1)**2 + 2*(q + 0.5)**2", "minimise: 3", "must be text"),
        ("  over:", "  ovr:", "`study.tune` has no key `ovr`"),
        ("{uniform: [-2, 2]}", "{normal: [0, 1]}", "is free between two bounds"),
        ("runs: 900", "held_out: 1", "leaves none of 1 draws to tune with"),
        ("runs: 900", "subject: {z: {most: 1}}", "there is no metric `z`"),
        ("runs: 900", "subject: {p: {}}", "keeps nothing within bounds"),
        ("runs: 900", "conditions: some", "`tune.conditions` cannot be the text `some`"),
    ],
)
def test_a_mistake_has_its_place(tmp_path, capsys, old, new, told):
    assert old in BOWL
    written(tmp_path, PLANE, BOWL.replace(old, new))
    assert main(["tune", str(tmp_path / "study.yaml"), "--results", str(tmp_path / "results")]) == 2
    assert told in capsys.readouterr().err


def test_values_that_cannot_be_run_are_no_begin(tmp_path, capsys):
    diagram = DECAY.replace("stop: 1", "stop: 200").replace("k: -1", "k: 50")
    written(tmp_path, diagram, DECEIVED.replace("ACCURACY", "1"))
    assert main(["tune", str(tmp_path / "study.yaml"), "--results", str(tmp_path / "results")]) == 2
    assert "with the values before, `abs(last)` has no value" in capsys.readouterr().err
