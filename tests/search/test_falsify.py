"""`cosim falsify`: it finds what theory says is there, tells real from numerical, and loses no run."""

import json
import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from cosim.engine.run import Run, load
from cosim.terminal.cli import main

# x' = u: x(1) = x_0 + u, so that x < 1 at all times is violated where x_0 + max(u, 0) >= 1.
RAMP = """
run: {stop: 1, step: 0.0625}
blocks:
  plant: {block: Integrator, inputs: {u: 0.5}, start: {x: 0}}
"""
REACH = """
diagram: diagram.yaml
requirements: {below: always(plant.x < 1)}
search:
  over:
    blocks.plant.start.x: {uniform: [-1, MOST]}
    blocks.plant.inputs.u: {uniform: [-1, 1]}
  runs: RUNS
"""
# x' = k x with forward Euler: x_n+1 = (1 + k h) x_n, which grows from k < -2/h on; the solution decays for all k < 0.
DECAY = """
run: {stop: 2, step: 0.1}
blocks:
  gain: {block: Gain, inputs: {u: plant.x}, parameters: {k: -1}}
  plant: {block: Integrator, inputs: {u: gain.y}, start: {x: 1}}
"""
STIFF = """
diagram: diagram.yaml
requirements: {bounded: always(abs(plant.x) < 2)}
search: {over: {blocks.gain.parameters.k: {uniform: [-29, 0]}}, runs: 200}
"""


def written(folder: Path, diagram: str, study: str) -> Path:
    (folder / "diagram.yaml").write_text(diagram, encoding="utf-8")
    path = folder / "study.yaml"
    path.write_text(study, encoding="utf-8")
    return path


def falsify(folder: Path, *options: str, capsys) -> tuple[int, list[dict]]:
    code = main(["falsify", str(folder / "study.yaml"), "--results", str(folder / "results"), "--json", *options])
    return code, json.loads(capsys.readouterr().out)["answers"]


def reach(most: float, runs: int = 300) -> str:
    return REACH.replace("MOST", str(most)).replace("RUNS", str(runs))


def stored(folder: Path) -> int:
    return len((folder / "results" / "study" / "falsify" / "runs.jsonl").read_text(encoding="utf-8").splitlines())


def test_what_can_be_violated_is_found_is_real_and_runs_again(tmp_path, capsys):
    """One in 800 points violates it, far from the middle."""
    written(tmp_path, RAMP, reach(0.05))
    code, (answer,) = falsify(tmp_path, capsys=capsys)
    assert (code, answer["violated"], answer["verdict"]) == (3, True, "real")
    start, rate = answer["values"]["blocks.plant.start.x"], answer["values"]["blocks.plant.inputs.u"]
    assert answer["margin"] == pytest.approx(1 - start - max(rate, 0), abs=1e-12)
    assert answer["margin"] <= 0
    for rerun in answer["reruns"]:  # forward Euler is exact here
        assert rerun["margin"] == pytest.approx(answer["margin"], abs=1e-12)
    main(["run", answer["overlay"], "-o", str(tmp_path / "again.nc"), "--json"])
    again = json.loads(capsys.readouterr().out)["requirements"][0]
    assert again["margin"] == answer["margin"]  # to the bit


# A valley that goes down for ever to (0.1, …), and far from it one corner in 16 that violates.
VALLEY = """
from cosim import *

class Valley(Block):
    p = Parameter(4)
    g = Output()

    def outputs(p, g):
        low, square = 1.0, 0.0
        for k in range(4):
            low = min(low, p[k])
            square += (p[k] - 0.1) ** 2
        g[0] = -1.0 if low > 0.85 else square
"""
TRAP = """
diagram: diagram.yaml
requirements: {outside: always(valley.g > 0)}
search: {over: {blocks.valley.parameters.p: {uniform: [0, 1]}}, runs: 2000, seed: 3}
"""


def test_a_valley_without_an_exit_does_not_take_all_runs(tmp_path, capsys):
    """A descent takes 300 generations of 16 runs; of 100 corners looked at meanwhile none violates once in 600."""
    (tmp_path / "own.py").write_text(VALLEY)
    blocks = "blocks: {valley: {python: 'own.py:Valley', parameters: {p: [0, 0, 0, 0]}}}\n"
    written(tmp_path, "run: {stop: 1, step: 1}\n" + blocks, TRAP)
    code, (answer,) = falsify(tmp_path, capsys=capsys)
    assert (code, answer["verdict"], answer["margin"]) == (3, "real", -1.0)
    assert 49 < answer["runs"] < 2000


EDGE = """
from cosim import Block, Output, Parameter


class Edge(Block):
    p = Parameter(8)
    g = Output()

    def outputs(p, g):
        far = 0.0
        for k in range(4):
            far += p[k] + max(abs(p[4 + k] - 0.5) - 0.2, 0.0)
        g[0] = far if far > 0.0 else -1.0
"""


def test_a_violation_at_bounds_of_some_coordinates_and_within_those_of_others_is_found(tmp_path, capsys):
    """Only where four coordinates are 0 exactly, and four lie in 0.3 … 0.7: no corner, and no point by chance."""
    (tmp_path / "own.py").write_text(EDGE)
    blocks = "blocks: {valley: {python: 'own.py:Edge', parameters: {p: [1, 1, 1, 1, 0, 0, 0, 0]}}}\n"
    written(tmp_path, "run: {stop: 1, step: 1}\n" + blocks, TRAP)
    code, (answer,) = falsify(tmp_path, capsys=capsys)
    assert (code, answer["verdict"], answer["margin"]) == (3, "real", -1.0)
    values = answer["values"]["blocks.valley.parameters.p"]
    assert values[:4] == [0, 0, 0, 0]
    assert all(0.3 <= value <= 0.7 for value in values[4:])


def test_what_cannot_be_violated_is_not_found_and_nothing_is_claimed(tmp_path, capsys):
    written(tmp_path, RAMP, reach(-0.05))
    code, (answer,) = falsify(tmp_path, capsys=capsys)
    assert (code, answer["violated"], answer["runs"], answer["overlay"]) == (0, False, 300, None)
    assert 0.05 <= answer["margin"] < 0.06  # the least is 0.05, at a corner
    assert main(["falsify", str(tmp_path / "study.yaml"), "--results", str(tmp_path / "results")]) == 0
    assert "that does not show that there is none" in capsys.readouterr().out


def test_what_only_a_step_violates_is_numerical(tmp_path, capsys):
    written(tmp_path, DECAY, STIFF)
    code, (answer,) = falsify(tmp_path, capsys=capsys)
    assert (code, answer["verdict"]) == (1, "numerical")
    assert answer["values"]["blocks.gain.parameters.k"] < -20
    tenth = next(r for r in answer["reruns"] if r["how"] == "a tenth of the step")
    assert tenth["margin"] == pytest.approx(1.0, abs=1e-12)  # it begins at 1, and decays


def test_what_ends_before_its_end_is_a_violation_of_its_own_kind(tmp_path, capsys):
    """x' = k x with k of some hundred leaves all numbers within 100 s."""
    diagram = DECAY.replace("stop: 2", "stop: 100").replace("{k: -1}", "{k: 1}")
    study = STIFF.replace("[-29, 0]", "[1, 1000]").replace("always(abs(plant.x) < 2)", "always(plant.x > -1)")
    written(tmp_path, diagram, study)
    code, (answer,) = falsify(tmp_path, capsys=capsys)
    assert (code, answer["violated"], answer["verdict"]) == (3, True, "real")
    assert answer["ended"].startswith("diverged")


def test_points_that_are_not_accepted_are_not_run(tmp_path, capsys):
    study = reach(2.0).replace("  runs:", "  accept: {plant.x: {most: 0.2}}\n  runs:")
    written(tmp_path, RAMP, study)
    code, (answer,) = falsify(tmp_path, capsys=capsys)
    assert code == 3
    assert answer["values"]["blocks.plant.start.x"] <= 0.2
    written(tmp_path, RAMP, study.replace("most: 0.2", "most: -7"))
    assert main(["falsify", str(tmp_path / "study.yaml"), "--results", str(tmp_path / "none")]) == 2
    assert "no point is accepted" in capsys.readouterr().err


def test_the_same_search_runs_nothing_anew_and_threads_change_nothing(tmp_path, capsys):
    written(tmp_path, RAMP, reach(-0.05, 100))
    _, first = falsify(tmp_path, "--threads", "1", capsys=capsys)
    count = stored(tmp_path)
    _, second = falsify(tmp_path, "--threads", "4", capsys=capsys)
    assert stored(tmp_path) == count
    assert first == second
    falsify(tmp_path, "--seed", "1", capsys=capsys)
    assert stored(tmp_path) > count


def test_an_interrupted_search_keeps_its_runs(tmp_path, capsys):
    diagram = RAMP.replace("0.0625", "9.5367431640625e-07")  # 2 ** -20
    path = written(tmp_path, diagram, reach(-0.05, 4000))
    command = [sys.executable, "-m", "cosim", "falsify", str(path), "--results", str(tmp_path / "results")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=tmp_path) as running:
        rows = tmp_path / "results" / "study" / "falsify" / "runs.jsonl"
        while not (rows.exists() and rows.read_bytes().count(b"\n") > 40):
            assert running.poll() is None
            time.sleep(0.05)
        os.kill(running.pid, signal.SIGINT)
        _, said = running.communicate(timeout=120)
    assert running.returncode == 130
    assert b"all is kept" in said
    kept = stored(tmp_path)
    code, (answer,) = falsify(tmp_path, "--runs", "33", capsys=capsys)
    assert (code, answer["runs"], stored(tmp_path)) == (0, 33, kept)  # all of which had been run


def test_each_requirement_is_searched_alone(tmp_path, capsys):
    both = "{below: always(plant.x < 1), above: always(plant.x > -3)}"
    written(tmp_path, RAMP, reach(0.5).replace("{below: always(plant.x < 1)}", both))
    code, answers = falsify(tmp_path, capsys=capsys)
    assert code == 3
    assert [(a["requirement"], a["violated"]) for a in answers] == [("below", True), ("above", False)]
    _, (alone,) = falsify(tmp_path, "--requirement", "above", capsys=capsys)
    assert alone["requirement"] == "above"
    assert main(["falsify", str(tmp_path / "study.yaml"), "--requirement", "abov"]) == 2
    assert "did you mean `above`?" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("search:", "find:", "`study` has no key `find`"),
        ("  over:", "  ovr:", "`study.search` has no key `ovr`"),
        ("[-1, 1]", "[1, -1]", "`search.over.blocks.plant.inputs.u` has its bounds the wrong way round"),
        ("uniform: [-1, 1]", "unifrm: [-1, 1]", "`search.over.blocks.plant.inputs.u` takes a distribution"),
        ("uniform: [-1, 1]", "normal: [0, 1]", "`search.over.blocks.plant.inputs.u` has no bounds"),
        ("blocks.plant.inputs.u", "blocks.plant.inputs.w", "has no input `w`"),
        ("runs: 300", "runs: 0", "`search.runs` must be a whole number from 1"),
        ("requirements: {below: always(plant.x < 1)}", "", "neither the study nor its diagram has a requirement"),
        ("plant.x < 1", "plant.y < 1", "no variable `y`"),
    ],
)
def test_a_mistake_has_its_place(tmp_path, capsys, old, new, told):
    study = reach(0.5)
    assert old in study
    written(tmp_path, RAMP, study.replace(old, new))
    assert main(["falsify", str(tmp_path / "study.yaml"), "--results", str(tmp_path / "results")]) == 2
    assert told in capsys.readouterr().err


def test_a_study_without_a_search_says_what_to_write(tmp_path, capsys):
    written(tmp_path, RAMP, "diagram: diagram.yaml\nrequirements: {below: always(plant.x < 1)}\n")
    assert main(["falsify", str(tmp_path / "study.yaml")]) == 2
    assert "write search: {over:" in capsys.readouterr().err


def test_a_search_looks_no_further_than_what_decides(tmp_path, capsys):
    """x' = -x falls from x_0 on, so that the margin of x < 2 is 2 - x_0, decided at once; the least is at the bound."""
    diagram = DECAY.replace("stop: 2", "stop: 64")
    study = """
diagram: diagram.yaml
requirements: {below: always(plant.x < 2)}
search: {over: {blocks.plant.start.x: {uniform: [0, 1.5]}}, runs: 200}
"""
    written(tmp_path, diagram, study)
    code, (answer,) = falsify(tmp_path, capsys=capsys)
    assert (code, answer["violated"], answer["time"]) == (0, False, 0.0)
    assert answer["margin"] == pytest.approx(0.5, abs=1e-3)
    lines = (tmp_path / "results" / "study" / "falsify" / "runs.jsonl").read_text(encoding="utf-8").splitlines()
    steps = {row["key"].endswith(" until inf"): set[int]() for row in map(json.loads, lines)}
    for row in map(json.loads, lines):
        steps[row["key"].endswith(" until inf")].add(row["steps"])
    assert steps == {True: {640}, False: {5}}  # whole runs, and runs of 64 s / 128
    written(tmp_path, diagram, study.replace("< 2", "< 1.49"))
    code, (answer,) = falsify(tmp_path, capsys=capsys)
    assert (code, answer["violated"]) == (3, True)
    main(["run", answer["overlay"], "-o", str(tmp_path / "again.nc"), "--json"])
    assert json.loads(capsys.readouterr().out)["requirements"][0]["margin"] == answer["margin"]  # of the whole run


@pytest.mark.parametrize(
    ("formula", "bound", "time"),
    [
        ("always(plant.x < 2)", 1.75, 0.5),  # x = t/2, so that the margin falls
        ("always[0, 0.25](plant.x < 2)", 1.875, 0.25),  # all is seen
        ("eventually(plant.x > 2)", math.inf, math.nan),  # what comes may be better
    ],
)
def test_what_a_broken_off_run_says_of_the_margin(tmp_path, formula, bound, time):
    (tmp_path / "diagram.yaml").write_text(RAMP + f"requirements: {{r: '{formula}'}}\n", encoding="utf-8")
    run = Run(load(tmp_path / "diagram.yaml"), engine="python", until=0.5)
    outcome = run.execute()
    assert (outcome.steps, outcome.time) == (8, 0.5)
    assert run.reductions.monitors["r"].bound(False) == pytest.approx((bound, time), nan_ok=True)


@pytest.mark.parametrize(
    ("old", "new", "code", "violated"),
    [
        ("plant.x < 1", "plant.x < -5", 3, True),  # at the very start, everywhere
        ("uniform: [-1, MOST]", "uniform: [-0.5, -0.5]", 0, False),  # one of two values that has no room
        ("  runs:", "  accept: {plant.x: {least: 0.04}}\n  runs:", 3, True),  # one point in a hundred is accepted
    ],
)
def test_a_search_at_its_limits(tmp_path, capsys, old, new, code, violated):
    written(tmp_path, RAMP, REACH.replace(old, new).replace("MOST", "0.05").replace("RUNS", "40"))
    got, (answer,) = falsify(tmp_path, capsys=capsys)
    assert (got, answer["violated"]) == (code, violated)


def test_a_search_over_nothing_is_a_mistake(tmp_path, capsys):
    study = "diagram: diagram.yaml\nrequirements: {below: always(plant.x < 1)}\nsearch: {over: {}}\n"
    written(tmp_path, RAMP, study)
    assert main(["falsify", str(tmp_path / "study.yaml")]) == 2
    assert "`search.over` draws nothing" in capsys.readouterr().err


def test_of_several_diagrams_one_has_to_be_named(tmp_path, capsys):
    """u reaches 1, so x(1) reaches 1.5 from 0.5, and -8 from -9."""
    both = reach(0.5).replace(
        "search:",
        "variants: {up: {blocks: {plant: {start: {x: 0.5}}}}, down: {blocks: {plant: {start: {x: -9}}}}}\nsearch:",
    )
    written(tmp_path, RAMP, both.replace("blocks.plant.start.x: {uniform: [-1, 0.5]}", ""))
    study, results = str(tmp_path / "study.yaml"), ["--results", str(tmp_path / "results")]
    assert main(["falsify", study, *results]) == 2
    assert "has 2 variants, and a search is of one diagram\n    fix: --variant" in capsys.readouterr().err
    assert main(["falsify", study, *results, "--variant", "dwn"]) == 2
    assert "did you mean `down`?" in capsys.readouterr().err
    assert main(["falsify", study, *results, "--variant", "up"]) == 3
    assert main(["falsify", study, *results, "--variant", "down"]) == 0
    written(tmp_path, RAMP, reach(0.5).replace("search:", "grid: {run.stop: [1, 2]}\nsearch:"))
    assert main(["falsify", study, *results]) == 2 and "has a grid" in capsys.readouterr().err


def test_a_violation_that_the_last_run_of_the_budget_finds_is_told(tmp_path, capsys):
    """x' = -x from 1 on, y = (1 - d²) x, d the distance to a point: y(0) alone decides, so that runs are broken off."""
    (tmp_path / "own.py").write_text(
        "from cosim import *\n\nclass Peak(Block):\n    a = Parameter(2)\n    x = State(start=1.0)\n"
        "    y = Output()\n\n"
        "    def derivatives(x, d_x):\n        d_x[0] = -x\n\n    def outputs(x, a, y):\n"
        "        y[0] = (1.0 - (a[0] - 0.37) ** 2 - (a[1] - 0.61) ** 2) * x\n"
    )
    study = """
diagram: diagram.yaml
requirements: {low: always(peak.y < 0.99998)}
search: {over: {blocks.peak.parameters.a: {uniform: [0, 1]}}, runs: RUNS}
"""
    diagram = "run: {stop: 10, step: 0.1}\nblocks: {peak: {python: 'own.py:Peak', parameters: {a: [0, 0]}}}\n"
    written(tmp_path, diagram, study.replace("RUNS", "1000"))
    _, (whole,) = falsify(tmp_path, capsys=capsys)
    assert whole["violated"]
    told = []
    for runs in range(whole["runs"] - 17, whole["runs"] + 1):  # the last generation, run by run
        results = tmp_path / f"{runs} runs"
        code, (answer,) = falsify(tmp_path, "--runs", str(runs), "--results", str(results), capsys=capsys)
        lines = (results / "study" / "falsify" / "runs.jsonl").read_text(encoding="utf-8").splitlines()
        assert answer["violated"] == any((json.loads(line)["metrics"]["low"] or 1.0) <= 0.0 for line in lines), runs
        assert (code == 3) == answer["violated"]
        told.append(answer["violated"])
    assert answer["margin"] == whole["margin"]
    assert {True, False} <= {*told} and sum(
        told
    ) >= 2  # a generation that the budget cuts off, and one that it does not
