"""`cosim sensitivity` against the closed form of Ishigami's function, and of a sum."""

import json
import math
from pathlib import Path

import pytest

from cosim.terminal.cli import main

# Ishigami and Homma, ISUMA 1990: y = sin x_1 + a sin^2 x_2 + b x_3^4 sin x_1, each x uniform over [-pi, pi].
A, B = 7.0, 0.1
VARIANCE = A**2 / 8 + B * math.pi**4 / 5 + B**2 * math.pi**8 / 18 + 0.5
ALONE_1 = 0.5 * (1 + B * math.pi**4 / 5) ** 2
ALONE_2 = A**2 / 8
TOGETHER_13 = B**2 * math.pi**8 * (1 / 18 - 1 / 50)
FIRST = [ALONE_1 / VARIANCE, ALONE_2 / VARIANCE, 0.0]
TOTAL = [(ALONE_1 + TOGETHER_13) / VARIANCE, ALONE_2 / VARIANCE, TOGETHER_13 / VARIANCE]
BLOCK = """
import math

from cosim import Block, Output, Parameter


class Ishigami(Block):
    x = Parameter(3, default=0.0)
    a = Parameter(default=7.0)
    b = Parameter(default=0.1)
    y = Output()

    def outputs(x, a, b, y):
        y[0] = math.sin(x[0]) + a * math.sin(x[1]) ** 2 + b * x[2] ** 4 * math.sin(x[0])
"""
DIAGRAM = """
run: {stop: 1, step: 1}
blocks: {f: {python: ishigami.py:Ishigami}}
metrics: {y: {signal: f.y, reduce: final}}
"""
STUDY = """
diagram: diagram.yaml
random:
  count: 1
  draws: {blocks.f.parameters.x: {uniform: [[-3.141592653589793, -3.141592653589793, -3.141592653589793],
                                            [3.141592653589793, 3.141592653589793, 3.141592653589793]]}}
"""


@pytest.fixture
def study(tmp_path) -> Path:
    (tmp_path / "ishigami.py").write_text(BLOCK, encoding="utf-8")
    (tmp_path / "diagram.yaml").write_text(DIAGRAM, encoding="utf-8")
    (tmp_path / "study.yaml").write_text(STUDY, encoding="utf-8")
    return tmp_path / "study.yaml"


def sensitivity(study: Path, *options: str, capsys) -> list[dict]:
    assert main(["sensitivity", str(study), "--results", str(study.parent / "results"), "--json", *options]) == 0
    return json.loads(capsys.readouterr().out)["indices"]


def test_the_indices_of_ishigamis_function_lie_in_their_intervals(study, capsys):
    found = sensitivity(study, "--runs", str(5 * 1024), capsys=capsys)
    assert [one["name"] for one in found] == ["f.x[1]", "f.x[2]", "f.x[3]"]
    for one, first, total in zip(found, FIRST, TOTAL, strict=True):
        assert one["first"]["low"] <= first <= one["first"]["high"]  # as in each of eight seeds
        assert one["total"]["low"] <= total <= one["total"]["high"]
        assert one["first"]["value"] == pytest.approx(first, abs=0.05)
        assert one["total"]["value"] == pytest.approx(total, abs=0.05)


def test_more_runs_make_intervals_narrower_and_the_same_runs_are_not_repeated(study, capsys):
    few = sensitivity(study, "--runs", "320", capsys=capsys)
    many = sensitivity(study, "--runs", "5120", capsys=capsys)
    for one, other in zip(few, many, strict=True):
        assert other["total"]["high"] - other["total"]["low"] < one["total"]["high"] - one["total"]["low"]
    rows = study.parent / "results" / "study" / "sensitivity" / "runs.jsonl"
    count = len(rows.read_text().splitlines())
    assert sensitivity(study, "--runs", "5120", "--threads", "3", capsys=capsys) == many
    assert len(rows.read_text().splitlines()) == count


def test_what_does_not_vary_is_explained_by_nothing(study, capsys):
    diagram = study.parent / "diagram.yaml"
    diagram.write_text(DIAGRAM.replace("Ishigami}}", "Ishigami, parameters: {a: 0}}}").replace("f.y", "f.a"))
    found = sensitivity(study, "--runs", "64", capsys=capsys)
    assert [one["total"]["value"] for one in found] == [0.0, 0.0, 0.0]


def test_a_table_ranks_what_matters_most_first(study, capsys):
    assert main(["sensitivity", str(study), "--runs", "5120", "--results", str(study.parent / "results")]) == 0
    shown = capsys.readouterr().out
    assert shown.index("f.x[1]") < shown.index("f.x[2]") < shown.index("f.x[3]")
    assert "95 % intervals" in shown


@pytest.mark.parametrize(
    ("study_change", "options", "told"),
    [
        (("random:", "rndom:"), (), "has no key `rndom`"),
        (("  count: 1", "  accept: {f.y: {least: 0}}\n  count: 1"), (), "depend on each other"),
        (("", ""), ("--runs", "10"), "10 runs are too few for 3 drawn values"),
        (("", ""), ("--metric", "z"), "there is no metric `z` that is a number"),
    ],
)
def test_mistakes_say_what_to_do(study, capsys, study_change, options, told):
    study.write_text(STUDY.replace(*study_change) if study_change[0] else STUDY)
    assert main(["sensitivity", str(study), "--results", str(study.parent / "r"), *options]) == 2
    assert told in capsys.readouterr().err
