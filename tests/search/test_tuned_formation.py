"""Gains that `cosim tune diagrams/studies/gains.yaml` has found keep what it asks, and are as good as is said."""

from pathlib import Path

import pytest

from cosim.engine import run
from cosim.engine.run import Run
from cosim.study import study_file

DIAGRAMS = Path(__file__).parents[2] / "diagrams"
PAPER = 0.0351  # e_x of the paper's gains at 0.1 ms
FOUND = {
    "controller.parameters.c": 5.938,
    "controller.parameters.lambda_": 1.858,
    "formation.parameters.lambda_": 1.858,
    "controller.parameters.b": 1.309,
    "formation.parameters.b": 1.309,
    "observer.parameters.alpha_2": 3.906,
    "potential_field.parameters.alpha": 11.04,
    "potential_field.parameters.epsilon_2": 2.029,
    "topology.parameters.eta_2": 4.033,
    "topology_rate.parameters.eta_2": 4.033,
}
METRICS = (
    "metrics={e_x: {signal: formation.e_x, reduce: max, from: 10}, force: {signal: controller.u, reduce: max},"
    " min_gap: {signal: separation.min_gap, reduce: min}, delta_x: {signal: formation.delta_x, reduce: max, from: 10}}"
)


def test_the_study_may_find_them():
    space = study_file.load(DIAGRAMS / "studies" / "gains.yaml").tuning.space
    assert {f"blocks.{name}" for name in FOUND} == {path for draw in space.draws for path in draw.paths}
    for draw in space.draws:
        assert draw.a < FOUND[draw.paths[0].removeprefix("blocks.")] < draw.b


def test_the_error_is_less_than_a_quarter_with_all_conditions_and_at_every_step():
    settings = [f"blocks.{name}={value}" for name, value in FOUND.items()]
    outcomes = [
        Run(run.load(DIAGRAMS / "formation.yaml", [*settings, METRICS, "record=null", f"run.step={step}"])).execute()
        for step in (1e-3, 1e-4)
    ]
    for outcome in outcomes:
        assert outcome.status == "completed"
        assert len(outcome.conditions) == 4
        assert all(finding.holds for finding in outcome.conditions)
        assert outcome.metrics["e_x"] <= PAPER / 4
        assert outcome.metrics["min_gap"] >= 0.13
        assert outcome.metrics["force"] <= 240
    coarse, fine = (outcome.metrics for outcome in outcomes)
    for name in ("e_x", "min_gap", "force", "delta_x"):
        assert coarse[name] == pytest.approx(fine[name], rel=0.05)
