"""Requirements of runs, from the command line: verdicts, exit codes, early ends, other engines, FMUs, mistakes."""

import json
import math
from pathlib import Path

import pytest

from cosim.engine import run
from cosim.export.exporter import export_fmu
from cosim.language import diagram as diagrams
from cosim.results.result_file import open_result, read_attributes, requirements_in
from tests.interrupted import assert_same, executed, killed

SWING = """
run: {stop: 5, step: 0.01, integrator: rk4}
fleets: {robot: 3}
blocks:
  swing: {type: Oscillator, parameters: {w: 2}}
  source: {type: Sine, per: robot}
  lag: {type: Lag, per: robot, inputs: {u: source.y}, start: {x: [[0, 0], [1, 1], [2, 2]]}}
"""
FORMULAS = """
requirements:
  below: always(swing.x < 1.5)
  turns: eventually[0, 3](always[0, 0.2](swing.x < 0))
  early: (swing.x > -0.5) until[0.5, 2] (swing.x < 0)
  fleet: always[1, 5](norm(lag.x) < 30 and lag.x[2, 1] > -9)
  flags: not always(lag.large)
"""


@pytest.fixture
def judged(cosim, write):
    """Run a diagram: its exit code, and the verdicts on its requirements by name."""

    def verdicts(text: str, *options: object, name: str = "diagram.yaml") -> tuple[int, dict]:
        code, out, err = cosim("run", write(text, name), "--json", *options)
        assert out, err
        return code, {v["name"]: v for v in json.loads(out).get("requirements", [])}

    return verdicts


def requiring(*formulas: str, head: str = SWING) -> str:
    return head + "requirements:\n" + "".join(f"  r{k}: {text}\n" for k, text in enumerate(formulas))


# ---- margins, as theory has them ----


def test_the_margins_of_a_cosine(judged):
    """x = cos 2t: 1 at first, -1 at t = pi/2; samples are 0.01 s apart, and miss the minimum by 5 ms at most."""
    missed = 1 - math.cos(2 * 0.005)
    code, found = judged(
        requiring(
            "always(swing.x < 1.5)",
            "eventually[0, 3](swing.x < -0.9)",
            "always[1, 2](swing.x < 0)",
            "(swing.x > -0.5) until[0.5, 2] (swing.x < 0)",
        )
    )
    assert code == 0 and all(v["holds"] and v["settled"] for v in found.values())
    margins = [v["margin"] for v in found.values()]
    assert margins[0] == 0.5 and found["r0"]["time"] == 0.0
    assert 0.1 - missed <= margins[1] <= 0.1 and found["r1"]["time"] == pytest.approx(math.pi / 2, abs=0.005)
    assert margins[2] == pytest.approx(-math.cos(2), abs=1e-6) and found["r2"]["time"] == 1.0
    # The best moment is where x + 0.5 before it, which falls, meets -x: at x = -0.25.
    assert margins[3] == pytest.approx(0.25, abs=0.01 * 2)


def test_a_person_sees_margin_moment_and_what_changed(cosim, write):
    code, out, err = cosim("run", write(SWING + FORMULAS))
    lines = {words[0]: words[1:] for line in out.splitlines() if (words := line.split())}
    assert code == 0 and "error" not in err
    assert lines["below"] == ["kept", "0.5000", "m", "t", "=", "0", "s"]
    code, out, _ = cosim("run", write(SWING + FORMULAS), "--set", "blocks.swing.start.x=2")
    assert code == 3
    row = next(line for line in out.splitlines() if line.startswith("below"))
    assert "violated" in row and "kept → violated" in row and "-0.5000" in row
    code, out, _ = cosim("run", write((SWING + FORMULAS).replace("< 1.5", "< 2.5")), "--set", "blocks.swing.start.x=2")
    assert next(line for line in out.splitlines() if line.startswith("below")).split()[4:] == [
        "new",
        "t",
        "=",
        "0",
        "s",
    ]


def test_who_is_nearest_is_named(judged):
    _, found = judged(
        requiring("always[0, 0](lag.x < 5)", "always[0, 0](lag.x[2] < 5)", "always[0,0](norm(lag.x) < 9)")
    )
    assert [v["where"] for v in found.values()] == ["robot 3, element 1", "element 1", "robot 3"]
    assert [v["margin"] for v in found.values()] == [3, 4, pytest.approx(9 - math.hypot(2, 2), rel=1e-15)]


def test_a_signal_need_not_be_recorded_and_what_is_recorded_need_not_be_seen(judged, tmp_path):
    text = SWING + "record: {period: 1, signals: [source.y]}\n" + FORMULAS
    assert judged(text)[1] == judged(SWING + FORMULAS)[1]


def test_units_of_margins(judged):
    _, found = judged(
        requiring("always(swing.x < 9)", "always(swing.x * swing.v < 9)", "always(swing.x < 9 and swing.v < 9)")
    )
    assert [v["unit"] for v in found.values()] == ["m", "", ""]


@pytest.mark.parametrize(
    ("formula", "holds"),
    [("swing.x < 1", False), ("swing.x <= 1", True), ("swing.x > 1", False), ("swing.x >= 1", True)],
)
def test_a_margin_of_zero_is_kept_or_not_as_the_sign_says(judged, formula, holds):
    code, found = judged(requiring(f"always[0, 0]({formula})", f"not always[0, 0]({formula})"))
    assert [v["holds"] for v in found.values()] == [holds, not holds] and code == 3
    assert [v["margin"] for v in found.values()] == [0, 0]


def test_truth_values_have_infinite_margins_which_json_can_say(judged):
    code, found = judged(requiring("always[0, 0](lag.large[3])", "always[0, 0](lag.large[1])"))
    assert code == 3 and [v["margin"] for v in found.values()] == ["inf", "-inf"]


# ---- engines, resumed runs, FMUs ----


def test_the_interpreter_has_the_same_verdicts(judged):
    assert judged(SWING + FORMULAS) == judged(SWING + FORMULAS, "--engine", "python")


def test_a_resumed_run_has_the_same_verdicts_to_the_bit(wired, tmp_path):
    text = (SWING + FORMULAS).replace("stop: 5", "stop: 400").replace("fleet: always[1, 5]", "fleet: always[1, 400]")
    text = text.replace("below: ", "late: eventually[0, 350](always[0, 50](swing.x < 0.99))\n  below: ")
    network = wired(text)
    whole = executed(network, tmp_path / "whole.nc")
    killed(network, tmp_path / "again.nc", 300.0, every="20")
    again = executed(network, tmp_path / "again.nc", resume=True)
    assert again[1].resumed > 0
    assert_same(whole, again)
    assert whole[1].requirements == again[1].requirements
    whole, again = (read_attributes(tmp_path / name) for name in ("whole.nc", "again.nc"))
    assert requirements_in(whole) == requirements_in(again)


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_an_fmu_in_place_of_a_block_has_the_same_verdicts(judged, wired, write, tmp_path, version):
    text = SWING.replace(", integrator: rk4", "") + FORMULAS
    fmu = export_fmu(wired(text), ["swing"], tmp_path / "swing.fmu", version)
    _, found = judged(text, "--swap", f"swing={fmu}")
    assert found == judged(text)[1]


def test_outputs_of_a_diagram_as_a_block(judged, write):
    inner = SWING + "outputs: {angle: swing.x, all: lag.x, second: 'lag.x[2]'}\n"
    write(inner, "inner.yaml")
    outer = """
    run: {stop: 5, step: 0.01, integrator: rk4}
    fleets: {robot: 3}
    blocks:
      plant: {diagram: inner.yaml}
    requirements:
      a: always(plant.angle < 1.5)
      b: always(plant.all[2, 1] < 9)
      c: always(plant.second[1] < 9)
      d: always(plant/swing.x < 1.5)
    """
    code, found = judged(outer, name="outer.yaml")
    assert code == 0
    assert found["a"]["margin"] == found["d"]["margin"] == 0.5
    assert found["b"]["margin"] == found["c"]["margin"]


def test_the_resolved_text_has_the_requirements(write):
    write(SWING + "outputs: {second: 'lag.x[2]', all: lag.x}\n", "inner.yaml")
    text = """
    run: {stop: 5, step: 0.01}
    blocks: {plant: {diagram: inner.yaml}}
    requirements:
      one: {formula: "always(plant.second[1] < 9 and plant.all[1, 2] < 8)", stop: violated}
      two: always(max(plant.second) < 9)
    """
    loaded = diagrams.load(write(text))
    again = diagrams.load(write(loaded.resolved(), "again.yaml"))
    assert {name: entry.plain() for name, entry in again.requirements.items()} == {
        "one": {"formula": "always(plant/lag.x[2, 1] < 9 and plant/lag.x[1, 2] < 8)", "stop": "violated"},
        "two": "always(max(plant/lag.x[2]) < 9)",
    }


# ---- times ----


def test_steps_that_follow_a_tolerance_are_seen_at_the_multiples_of_the_step(judged, tmp_path):
    text = """
    run: {stop: 2, step: 0.1, integrator: rk4, extrapolation: 1, coupling_tolerance: 1.0e-4, smallest_step: 1.0e-4}
    blocks:
      swing: {type: Oscillator, parameters: {w: 2}}
      follow: {type: Follow, inputs: {u: swing.x}}
    record: {signals: [follow.x]}
    requirements:
      low: always[0.3, 1.2](follow.x < 0.5)
      nested: always[0, 1](eventually[0, 0.9](follow.x < 0.1))
    """
    _, found = judged(text, "-o", tmp_path / "run.nc")
    with open_result(tmp_path / "run.nc") as result:
        x = result["follow.x"]
    assert len(x) == 21
    assert found["low"]["margin"] == 0.5 - x[3:13].max()
    assert found["nested"]["margin"] == min((0.1 - x[k : k + 10]).max() for k in range(11))


FALLS = """
from cosim import Block, Indicator, State


class Falls(Block):
    x = State(output=True, start=1.0)
    zero = Indicator(crossing="falling", terminal=True)

    def derivatives(d_x):
        d_x[0] = -0.37

    def indicators(x, zero):
        zero[0] = x
"""


def test_the_moment_at_which_a_block_ends_a_run_is_a_sample_too(judged, tmp_path):
    """At an event between two steps; what looks to the run's end looks until there."""
    (tmp_path / "ends.py").write_text(FALLS)
    text = """
    run: {stop: 5, step: 0.5}
    blocks: {one: {python: ends.py:Falls}}
    requirements:
      low: always(one.x > -0.1)
      late: always[0, 4](one.x > -0.1)
      soon: eventually[0, 4](one.x < 0.01)
    """
    code, found = judged(text)
    assert code == 1 and [v["holds"] for v in found.values()] == [True, None, True]
    assert found["low"]["time"] == pytest.approx(1 / 0.37, abs=1e-9)


def test_a_window_between_two_samples_is_undecided(judged):
    code, found = judged(
        requiring("always[0.012, 0.018](swing.x > 9)", "always(eventually[0.012, 0.018](swing.x > 9))")
    )
    assert code == 1
    assert [v["holds"] for v in found.values()] == [None, None]
    assert {v["reason"] for v in found.values()} == {"no sample lies within [0.012, 0.018] s"}


def test_a_shorter_run_leaves_open_what_its_windows_do_not_reach(judged, cosim, write):
    formulas = "always[0, 4](swing.x > -2)", "always[4, inf](swing.x > 9)", "eventually[0, 4](swing.x < 0)"
    text = requiring(*formulas, "always[0, 4](swing.x > 0)")
    code, found = judged(text, "--set", "run.stop=2")
    assert [v["holds"] for v in found.values()] == [None, None, True, False] and code == 3
    assert [v["settled"] for v in found.values()] == [False] * 4
    assert found["r0"]["reason"] == found["r1"]["reason"] == "its windows need 4 s"
    code, out, _ = cosim("run", write(text.replace("  r3: always[0, 4](swing.x > 0)\n", "")), "--set", "run.stop=2")
    assert code == 1
    assert [w for w in ("its windows need 4 s", "≥ 1.000") if w in out] == ["its windows need 4 s", "≥ 1.000"]


# ---- runs that end early ----


def test_a_violation_ends_a_run_that_is_to_stop_there(cosim, write):
    text = (
        SWING
        + """
requirements:
  ends: {formula: "always(swing.x > 0)", stop: violated}
  other: always(swing.x < 2)
"""
    )
    code, out, _ = cosim("run", write(text), "--json")
    answer = json.loads(out)
    crossing = math.pi / 4  # of cos 2t
    assert code == 3 and answer["status"] == "completed"
    assert crossing < answer["time"] < crossing + 0.01 * 101
    ends, other = answer["requirements"]
    assert ends["holds"] is False and other["holds"] is None
    assert other["reason"] == "the run did not come to its end"
    assert "ended as ends is violated" in cosim("run", write(text))[1]
    assert (
        json.loads(cosim("run", write(text), "--json", "--engine", "python")[1])["requirements"]
        == answer["requirements"]
    )


def test_a_resumed_run_ends_where_the_whole_one_does(wired, tmp_path):
    """Which is at a multiple of 100 steps: cos 0.005 t is violated between the checkpoint and the next of them."""
    text = """
    run: {stop: 500, step: 0.01, integrator: rk4}
    blocks: {swing: {type: Oscillator, parameters: {w: 0.005}}}
    record: {signals: [swing.x]}
    requirements: {low: {formula: "always(swing.x > cos(0.005 * 333.333))", stop: violated}}
    """
    network = wired(text)
    whole = executed(network, tmp_path / "whole.nc")
    killed(network, tmp_path / "again.nc", 333.35, every="1.3")
    again = executed(network, tmp_path / "again.nc", resume=True)
    assert again[1].resumed > 0 and whole[1].time == again[1].time == pytest.approx(334)
    assert_same(whole, again)
    assert whole[1].requirements == again[1].requirements


def test_of_a_run_that_a_block_ends_open_windows_are_undecided(judged):
    text = """
    run: {stop: 5, step: 0.01}
    blocks:
      swing: {type: Oscillator, start: {x: -1}}
      line: {block: Join, inputs: {u: [swing.x, swing.x]}}
      picky: {type: Picky, inputs: {u: line.y}}
    requirements:
      kept: always(swing.x > -2)
      violated: always(swing.x < 0)
      early: eventually[0, 1](swing.x > 0)
      nested: always(eventually[0, 0.1](swing.x > -2))
      late: always[0, 4](swing.x > -2)
    """
    code, found = judged(text)
    assert code == 1
    assert [v["holds"] for v in found.values()] == [None, False, True, None, None]
    assert found["kept"]["reason"] == found["nested"]["reason"] == "the run did not come to its end"
    assert found["late"]["reason"] == "its windows need 4 s"


def test_of_a_run_that_diverges(judged):
    text = """
    run: {stop: 3, step: 0.01}
    blocks: {one: {type: Explosive}}
    requirements: {small: always(one.x < 10), large: eventually(one.x > 10), never: always(one.x > 0)}
    """
    code, found = judged(text)
    assert code == 1 and [v["holds"] for v in found.values()] == [False, True, None]


def test_a_margin_that_is_no_number_fails_the_run(cosim, write):
    code, _, err = cosim("run", write(requiring("always(sqrt(swing.x) < 2)")))
    assert code == 1
    assert "diagram.yaml:9:7: error: requirement r0: its margin is no number at t = 0.79 s" in err and "fix:" in err
    assert cosim("run", write(requiring("always[0, 0.7](sqrt(swing.x) < 2)")))[0] == 0  # nobody asks for what is later


# ---- mistakes ----

MISTAKES = {
    "swing.x < 1": "says nothing of when it has to hold",
    "always(1 < 2)": "names no signal",
    "always(swing.y < 1)": "block swing has no variable `y`",
    "always(swng.x < 1)": "`swng.x` names no block of the diagram",
    "always(lag.u < 1)": "what an input reads is recorded where it comes from",
    "always[0, 6](swing.x < 1)": "its windows need 6 s, and the run lasts 5 s",
    "always[0, 3](eventually[1, 3](swing.x < 1))": "its windows need 6 s",
    "always(swing.x < swing.v)": "`<` compares m with m/s",
    "always(swing.x + swing.v < 1)": "`+` between m and m/s",
    "always(swing.x * swing.x < swing.x)": "`<` compares one unit with m",
    "always(max(swing.x, swing.v) < 1)": "`max` between m and m/s",
    "always(sin(swing.x) < 1)": "`sin` of m",
    "always(atan2(swing.x, swing.v) < 1)": "`atan2` between m and m/s",
    "always(swing.x)": "is a number, not true or false",
    "always(lag.large + 1 < 2)": "is true or false, and no number",
    "always(swing.x[1] < 1)": "has no axes",
    "always(lag.x[4, 1] < 1)": "there is no 4",
    "always(lag.x[1, 1, 1] < 1)": "has 2 axes, not 3",
    "always(lag.x[1] < lag.large)": "is true or false",
    "always(lag.x[1] < norm(lag.x))": "joins shapes",
    "(" * 400 + "lag.large" + ")" * 400: "levels of nesting",
}


@pytest.mark.parametrize(("formula", "message"), MISTAKES.items())
def test_what_does_not_fit_is_said_with_its_place_and_a_fix(cosim, write, formula, message):
    code, _, err = cosim("check", write(requiring(f'"{formula}"')))
    assert code == 2 and message in err, err
    assert "diagram.yaml:9:" in err and "fix: " in err and "Traceback" not in err


@pytest.mark.parametrize("before", ["", '"', "'", "|\n    ", "{formula: '"])
@pytest.mark.parametrize("formula", ["always(swng.x < 1)", "always( swing.x < swng.x)", "always(0 < swing.x) ? swng"])
def test_the_place_is_that_of_the_part_however_the_text_is_written(cosim, write, before, formula):
    behind = "'}" if before.startswith("{") else before[:1].strip("|")
    text = requiring(before + formula + behind)
    _, _, err = cosim("check", write(text))
    row, line = next(item for item in enumerate(text.split("\n")) if formula in item[1])
    column = line.index("?" if "?" in formula else "swng")
    assert f"diagram.yaml:{row + 1}:{column + 1}: error" in err, err


def test_every_mistake_is_told_at_once_beside_those_of_the_diagram(cosim, write):
    text = requiring(
        "always(swing.x < 1", "always(swng.x < 1)", "3", "{stop: violated}", "{formula: always(swing.x < 1), stop: x}"
    )
    code, _, err = cosim("check", write(text.replace("w: 2", "ww: 2").replace("stop: 5", "stop: never")))
    assert code == 2 and err.count("error:") == 7, err


def test_a_run_whose_samples_do_not_fit_into_memory_is_refused(cosim, write):
    """Of a single window no sample is kept, and none after the last window."""
    formulas = (
        "always(eventually[0, 1](swing.x > 0))",
        "always(swing.x < 2)",
        "always[0, 1](eventually[0, 1](swing.x > 0))",
    )
    code, _, err = cosim("check", write(requiring(*formulas)), "--set", "run.stop=1e12")
    assert code == 2 and err.count("error:") == 1
    assert "requirement r0: 100000000000000 samples of it need" in err and "of memory" in err


def test_a_name_is_of_a_metric_or_a_requirement(cosim, write):
    code, _, err = cosim(
        "check", write(requiring("always(swing.x < 2)") + "metrics: {r0: {signal: swing.x, reduce: max}}\n")
    )
    assert code == 2 and "`r0` is a requirement and a metric" in err


def test_check_lists_them_and_keys_tell_how_they_are_written(cosim, write):
    code, out, _ = cosim("check", write(SWING + FORMULAS))
    assert code == 0 and "always(swing.x < 1.5)" in out
    code, out, _ = cosim("keys", "requirements")
    assert code == 0 and "stop" in out and "formula" in out


# ---- two results ----


def test_compare_shows_margins_and_a_changed_verdict_is_a_difference(cosim, write, tmp_path):
    text = requiring("always(swing.x < 1.0000001)", "always(swing.x > -3)")
    assert cosim("run", write(text), "-o", "a.nc")[0] == 0
    assert cosim("run", write(text.replace("1.0000001", "0.9999999")), "-o", "b.nc")[0] == 3
    assert cosim("compare", "a.nc", "a.nc")[0] == 0
    code, out, _ = cosim("compare", "a.nc", "b.nc")
    assert code == 1 and "kept → violated" in out and "requirements with another verdict" in out
    code, out, _ = cosim("compare", "a.nc", "b.nc", "--tolerance", "10")
    assert code == 1  # however small the change of the margin is
    answer = json.loads(cosim("compare", "a.nc", "b.nc", "--json")[1])
    assert answer["verdicts"] == ["r0"] and answer["requirements"][1]["r0"]["holds"] is False
    assert "requirements: r0" in cosim("compare", "a.nc", "b.nc", "a.nc")[1]


def test_the_file_of_a_result_has_the_verdicts(cosim, write):
    cosim("run", write(SWING + FORMULAS), "-o", "a.nc")
    said = read_attributes(Path("a.nc"))
    found = requirements_in(said)
    assert found["below"]["margin"] == 0.5 and found["flags"]["margin"] == math.inf
    assert list(requirements_in(said, {"below": "always(swing.x < 1.5)"})) == ["below"]


def test_a_program_asks_a_run_for_them(write):
    one = run.Run(run.load(write(SWING + FORMULAS)))
    outcome = one.execute()
    assert outcome.kept is True and outcome.requirements["below"].margin_text == "0.5000"
