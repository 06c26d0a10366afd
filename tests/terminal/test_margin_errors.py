"""Margins of requirements with their errors, where the truth is known: Euler's x = (1 - h)^(t/h), of exp(-t)."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from cosim.terminal import cli

BLOCKS = Path(__file__).parents[1] / "accuracy" / "known_blocks.py"
EULER, TRUTH = 0.98**50, math.exp(-1.0)
HALF = 0.99**100


@pytest.fixture
def judged(tmp_path, monkeypatch, capsys):
    """Run a command on a decay with a requirement: (exit code, standard output, standard error)."""
    monkeypatch.chdir(tmp_path)

    def call(command: str, formula: str, *options: str) -> tuple[int, str, str]:
        text = f"""
        run: {{stop: 1, step: 0.02}}
        blocks: {{a: {{python: {BLOCKS}:Decay}}}}
        requirements: {{r: "{formula}"}}
        """
        Path("diagram.yaml").write_text(text)
        return cli.main(
            [command, "diagram.yaml", "--engine", "python", *options][: None if command == "run" else 2]
        ), *(capsys.readouterr())

    return call


def test_a_margin_is_told_with_its_true_error(judged):
    code, out, err = judged("run", "always(a.x > 0.1)", "--error", "--json")
    found = json.loads(out)["accuracy"]["r"]
    true = TRUTH - EULER
    assert (code, err) == (0, "")
    assert true <= found["error"] <= 3 * true
    assert found["values"][0] == pytest.approx(EULER - 0.1) and found["values"][1] == pytest.approx(HALF - 0.1)
    code, out, _ = judged("run", "always(a.x > 0.1)", "--error")
    assert code == 0 and "±" in next(line for line in out.splitlines() if line.startswith("r "))


def test_a_margin_below_its_error_is_no_answer(judged):
    bound = EULER - 1e-5
    code, out, _ = judged("run", f"always(a.x > {bound})", "--error")
    assert code == 1 and "r: kept by less than its error: with another step it may be violated" in out


def test_another_verdict_at_another_step_is_no_answer(judged):
    bound = (EULER + HALF) / 2
    code, out, _ = judged("run", f"eventually(a.x < {bound})", "--error")
    assert code == 1 and "depends on the step" in out and "kept by" in out and "violated by" in out
    code, out, _ = judged("accuracy", f"eventually(a.x < {bound})")
    assert code == 1 and "depends on the step" in out


def test_a_violation_is_a_violation_whatever_its_error(judged):
    assert judged("run", "always(a.x < 0.5)", "--error")[0] == 3


def test_accuracy_has_a_table_of_margins(judged):
    code, out, err = judged("accuracy", "always(a.x > 0.1)")
    assert (code, err) == (0, "") and "requirement" in out and "±" in out


def test_a_margin_of_zero_is_a_number(judged):
    """x falls from 1: its margin below 1 is 0 at all steps, from the first sample on."""
    code, out, _ = judged("run", "always(a.x <= 1)", "--error", "--json")
    found = json.loads(out)["accuracy"]["r"]
    assert (found["values"], found["error"]) == ([0.0, 0.0, 0.0], 0.0)
    assert code == 1 and found["kind"] == "changes"  # by nothing at all: a rounding error may violate it
