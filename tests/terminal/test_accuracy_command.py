"""`cosim accuracy` and `cosim run --error` as a user meets them."""

from __future__ import annotations

import errno
import io
import json
import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from cosim.results import result_file, result_writer
from cosim.results.formatting import format_error, format_seconds, format_with_error
from cosim.terminal import cli
from cosim.terminal.screen import metrics_table

BLOCKS = Path(__file__).parents[1] / "accuracy" / "known_blocks.py"
DECAY = """
title: decay
run: {stop: 2, step: 0.02}
blocks:
  a: {type: Decay}
  w: {type: Watch, parameters: {level: 0.5}, inputs: {u: a.x}}
record: {period: 0.1, signals: [a.x]}
metrics:
  last: {signal: a.x, reduce: final}
  when: {signal: w.log, reduce: events}
  below: {signal: w.below, reduce: max}
"""
CHANGING = DECAY.replace("level: 0.5", f"level: {(0.98**100 + 0.99**200) / 2!r}")
DRAG = """
run: {stop: 1, step: 0.01}
blocks: {a: {type: Drag, parameters: {k: 250}}}
metrics: {last: {signal: a.x, reduce: final}}
"""
SAMPLES = """
run: {stop: 1, step: 0.01}
blocks: {a: {type: Decay}, d: {type: Delay, parameters: {most: 150}, inputs: {u: a.x}}}
metrics: {last: {signal: a.x, reduce: final}}
"""


@pytest.fixture
def cosim(tmp_path, monkeypatch, capsys):
    """Run the command line in an empty folder on a diagram: (exit code, standard output, standard error)."""
    monkeypatch.chdir(tmp_path)

    def call(command: str, text: str, *options: str) -> tuple[int, str, str]:
        Path("diagram.yaml").write_text(text.replace("type: ", f"python: {BLOCKS}:"), encoding="utf-8")
        code = cli.main([command, "diagram.yaml", *options])
        return code, *capsys.readouterr()

    return call


def rows(text: str) -> dict[str, list[str]]:
    """The cells of each line of a table, by the first."""
    return {words[0]: words[1:] for line in text.splitlines() if (words := line.split())}


def test_what_is_unstable_at_all_steps_is_warned_of(cosim):
    """Euler at h k = -40, -20, -10: what is reduced is the same at all of them, and the run is worth nothing."""
    text = """
run: {stop: 1, step: 0.1}
blocks: {a: {type: Decay, parameters: {k: -400}, start: {x: -1}}}
metrics: {low: {signal: a.x, reduce: min, to: 0}}
"""
    code, out, err = cosim("accuracy", text)
    assert code == 0 and "rounding" in out
    assert "warning: block a: at the start h·|λ| = 40 is beyond the stability limit 2 of euler" in err
    _, out, _ = cosim("accuracy", text, "--json")
    assert "beyond the stability limit" in json.loads(out)["warnings"][0]
    _, out, err = cosim("accuracy", text, "--set", "blocks.a.parameters.k=-4")
    assert not err and "limit" not in out


def test_the_tables_say_error_order_and_parts(cosim):
    code, out, err = cosim("accuracy", DECAY)
    assert (code, err) == (0, "")
    found = rows(out)
    assert found["metric"] == ["value", "unit", "order", "coupling", "integration"]
    assert found["signal"] == ["error", "of", "range", "order", "coupling", "integration"]
    value, _, error, order, coupling, integration = found["last"]
    assert abs(float(value) - 0.98**100) <= 10.0 ** -len(value.partition(".")[2])
    assert math.exp(-2) - 0.98**100 <= float(error) <= 1.6 * (math.exp(-2) - 0.98**100)
    assert float(order) == pytest.approx(1, abs=0.1) and coupling == "rounding"
    assert float(integration) == pytest.approx(0.98**100 - math.exp(-2), rel=0.05)
    assert found["when"][-1] == "agrees"
    assert "steps of 20 ms, 10 ms, 5 ms (jacobi; 8 runs, 19.2 times the work of one, " in out


def test_the_tables_fit_into_80_columns(cosim, monkeypatch, formation):
    monkeypatch.setenv("COLUMNS", "80")
    out = cosim(
        "accuracy",
        f"extends: {formation}\nrun: {{stop: 0.1}}\nmetrics: {{N_x: ~, N_v: ~, N_w: ~, delta_x: ~, e_x: ~, S: ~}}\n",
    )[1]
    assert "observer.w_hat" in out and max(map(len, out.splitlines())) <= 80


def test_json_is_one_object_with_all_numbers(cosim):
    code, out, err = cosim("accuracy", DECAY, "--json", "--wanted", "1e-3")
    answer = json.loads(out)
    assert (code, err, out.count("\n"), answer["status"]) == (0, "", 1, "done")
    assert answer["steps"] == [0.02, 0.01, 0.005] and answer["changing"] == []
    last = answer["metrics"]["last"]
    assert last["values"][0] == pytest.approx(0.98**100) and last["kind"] == "order"
    assert last["interval"][0] <= math.exp(-2) <= last["interval"][1]
    assert last["error"] == last["errors"][0] and last["relative"] == pytest.approx(last["error"] / 0.98**100)
    assert set(last["coupling"]) == {"error", "signed", "kind", "order"}
    assert last["largest_step"] < 0.02 and last["wanted"] == pytest.approx(1e-3 * 0.98**100)
    assert answer["signals"]["a.x"]["order"] == pytest.approx(1, abs=0.1)


def test_what_depends_on_the_step_is_an_exit_code(cosim):
    code, out, _ = cosim("accuracy", CHANGING)
    line = "below: yes at 20 ms, no at 10 ms, no at 5 ms, yes at 18.2 ms: depends on the step"
    assert code == 1 and "CHANGES" in out and line in " ".join(out.split())  # however wide the terminal is
    code, out, _ = cosim("accuracy", CHANGING, "--json")
    assert code == 1 and json.loads(out)["status"] == "depends on the step" and json.loads(out)["changing"] == [line]
    code, out, _ = cosim("run", CHANGING, "--error")
    assert code == 1 and line in " ".join(out.split()) and "completed after 100 steps" in out


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (DRAG, "with steps of 10 ms the run diverges: block a: "),
        (SAMPLES, "with steps of 5 ms the run fails: block d: "),
    ],
)
def test_no_certificate_is_an_exit_code_with_the_step(cosim, text, words):
    code, out, err = cosim("accuracy", text, "--json")
    answer = json.loads(out)
    assert (code, answer["status"]) == (1, "failed") and words in answer["error"] and words in err
    code, out, err = cosim("accuracy", text)
    assert (code, out) == (1, "") and words in err and "diagram.yaml:3:" in err


def test_a_run_prints_its_metrics_with_their_errors_and_notes_them_in_its_result(cosim):
    code, out, err = cosim("run", DECAY, "--error")
    assert (code, err) == (0, "")
    assert (
        rows(out)["last"][1] == "±" and "steps of 20 ms, 10 ms, 5 ms (jacobi; 5 runs, 9.2 times the work of one" in out
    )
    kept = result_file.open_result("results/diagram.nc").attrs
    code, out, _ = cosim("run", DECAY, "--error", "--json")
    answer = json.loads(out)
    assert code == 0 and kept["accuracy"] == answer["accuracy"] and kept["status"] == "completed"
    whole = json.loads(cosim("accuracy", DECAY, "--json")[1])["metrics"]["last"]
    assert {**answer["accuracy"]["last"], **{name: whole[name] for name in ("coupling", "integration")}} == whole


def test_a_run_with_errors_has_the_figures_and_signals_of_a_run_without(cosim):
    plain = json.loads(cosim("run", DECAY, "--json")[1])
    signals = result_file.open_result("results/diagram.nc")["a.x"]
    for engine in ("native", "python"):
        other = json.loads(cosim("run", DECAY, "--json", "--error", "--engine", engine)[1])
        assert other["metrics"] == plain["metrics"] and "accuracy" not in plain
        assert (result_file.open_result("results/diagram.nc")["a.x"] == signals).all()


def test_a_run_whose_errors_cannot_be_told_is_done_and_says_so(cosim):
    code, out, err = cosim("run", SAMPLES, "--error")
    assert code == 1 and "completed after 100 steps" in out and "±" not in out
    assert "warning: nobody can tell how wrong the figures are: with steps of 5 ms the run fails: block d" in err
    code, out, err = cosim("run", DRAG, "--error", "--json")
    assert code == 1 and json.loads(out)["status"] == "diverged" and "accuracy" not in json.loads(out)


def test_the_settings_of_the_command_line_reach_all_runs(cosim):
    options = ("--method", "joint", "--step", "0.1", "--stop", "1", "--set", "run.integrator=rk4", "--json")
    answer = json.loads(cosim("accuracy", DECAY, *options)[1])
    assert answer["steps"] == [0.1, 0.05, 0.025] and answer["method"] == "joint"
    last = answer["metrics"]["last"]
    assert last["order"] == pytest.approx(4, abs=0.2) and abs(last["values"][0] - math.exp(-1)) <= last["error"] < 1e-6


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--wanted", "lost=1e-3"), "there is no metric and no recorded signal `lost`\n    fix: did you mean `last`?"),
        (("--wanted", "last=x"), "--wanted: `last=x` is no number above zero, nor NAME=NUMBER"),
        (("--wanted", "-1"), "`-1` is no number above zero"),
        (("--wanted", "inf"), "`inf` is no number above zero"),
        (("--step", "0.03"), "`run.stop` of 2 s is not a whole number of steps"),
        (("--set", "metrics=~", "--set", "record=~"), "has no metric, no requirement and no recorded signal"),
    ],
)
def test_bad_input_is_exit_code_2(cosim, options, words):
    code, out, err = cosim("accuracy", DECAY, *options)
    assert (code, out) == (2, "") and words in err and "Traceback" not in err


def test_errors_of_a_run_need_a_metric(cosim):
    code, _, err = cosim("run", DECAY, "--error", "--set", "metrics=~")
    assert code == 2 and "has no metric and no requirement, so there is no figure that may be wrong" in err
    assert not Path("results").exists()


def test_the_errors_are_drawn_over_the_step(cosim):
    code, _, err = cosim("accuracy", DECAY, "--plot", "errors.svg")
    drawn = Path("errors.svg").read_text()
    assert (code, err) == (0, "") and drawn.startswith("<?xml") and "</svg>" in drawn
    code, out, err = cosim("accuracy", DECAY, "--plot", "errors.txt")
    assert code == 2 and out == "" and "the name of a picture ends in .png or .svg or .pdf" in err
    code, out, err = cosim(
        "accuracy", DECAY, "--plot", "none.svg", "--set", "metrics.last=~", "--set", "metrics.when=~"
    )
    assert code == 2 and "no metric has an error that could be drawn" in err


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
@pytest.mark.parametrize("command", ["accuracy", "run"])
def test_a_signal_ends_all_runs(tmp_path, command, name):
    text = DECAY.replace("stop: 2,", "stop: 4.0e+4," if command == "run" else "stop: 1.0e+8,").replace(
        "period: 0.1", "period: 1000"
    )
    (tmp_path / "long.yaml").write_text(text.replace("type: ", f"python: {BLOCKS}:"), encoding="utf-8")
    code = "import sys; from cosim.terminal import cli, screen; from cosim.accuracy import refined_runs as r\n"
    code += "observation = r.RefinedRuns._observation\n"
    code += "def told(*all):\n    print('running', file=sys.stderr, flush=True)\n    return observation(*all)\n"
    code += "r.RefinedRuns._observation = told\nsys.exit(cli.main(sys.argv[1:]))\n"
    options = ["--error"] if command == "run" else []
    started = subprocess.Popen(
        [sys.executable, "-c", code, command, "long.yaml", *options],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    with started as process:
        assert process.stderr.readline() == "running\n"
        time.sleep(0.2)
        process.send_signal(getattr(signal, name))
        out, err = process.communicate(timeout=60)
    assert process.returncode == 128 + getattr(signal, name) and out == "" and f"interrupted by {name}" in err
    assert "Traceback" not in err
    if command == "run":
        assert "the run itself is recorded in results/long.nc" in err
        assert result_file.open_result(tmp_path / "results" / "long.nc").attrs["status"] == "completed"


def test_a_result_that_takes_no_more_is_an_error_after_the_figures(cosim, monkeypatch):
    def full(path, accuracy):
        raise result_writer.ResultError(f"cannot write {path}: No space left on device")

    monkeypatch.setattr(result_writer, "add_accuracy", full)
    code, out, err = cosim("run", DECAY, "--error")
    assert code == 1 and rows(out)["last"][1] == "±" and "No space left on device" in err


def test_a_full_disk_is_no_trouble_of_the_step(cosim, monkeypatch):
    """Of seven runs, those that find no space."""
    left = [4]

    def full(file, at, size):
        left[0] -= 1
        if left[0] < 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "posix_fallocate", full)
    code, out, err = cosim("accuracy", DECAY)
    assert code == 2 and "No space left on device" in err and "free some space" in err
    assert "step" not in err and "±" not in out


def test_many_metrics_find_room_in_a_result(cosim):
    many = "".join(f"  m{k}: {{signal: a.x, reduce: max}}\n" for k in range(300))
    code, out, _ = cosim("run", DECAY + many, "--error", "--json")
    answer = json.loads(out)
    assert code == 0 and result_file.open_result("results/diagram.nc").attrs["accuracy"] == answer["accuracy"]
    assert len(answer["accuracy"]) == 303


def test_the_table_of_a_terminal_that_knows_ascii_only(capsys):
    class Ascii(io.StringIO):
        encoding = "ascii"

    file = Ascii()
    metrics_table({"x": 1.0}, errors={"x": 0.01}, file=file)
    assert "1.000 +/- 0.010" in file.getvalue()


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (0.13192371, 0.00041, "0.1319 ± 0.0005"),
        (0.13192371, 0.00014, "0.13192 ± 0.00014"),
        (0.13192371, 4.0, "0 ± 4"),
        (-0.0038, 0.15, "0.00 ± 0.15"),
        (5.798e-7, 1.41e-8, "(5.80 ± 0.15)e-07"),
        (1234567.0, 3.0, "1234567 ± 3"),
        (123.456, 20.0, "120 ± 20"),
        (12345678.0, 3.2e3, "(1.2346 ± 0.0004)e+07"),
        (0.24, 3e-17, "0.24 ± 3e-17"),
        (0.0, 0.1, "0.00 ± 0.10"),
        (1.0, 0.0999, "1.00 ± 0.10"),
        (1.0, 0.0, "1.000 ± 0"),
        (1.0, math.inf, "1.000 ± inf"),
        (1e100, 1e80, "1e+100 ± 1e+80"),
        (1.0, None, "1.000"),
        (True, None, "yes"),
        ([1.0, 2.0], 0.012, "[1.000, 2.000] ± 0.012"),
        ([{"pair": [1, 6], "time": 2.35}], 0.001, "1–6 at 2.35 s\n± 0.0010"),
    ],
)
def test_values_with_errors(value, error, text):
    assert format_with_error(value, error) == text


def test_errors_are_rounded_up():
    for error in (0.00011, 0.0019, 0.02, 0.99, 1.01, 9.9, 123.0, 4e-20, 3e33):
        shown = format_error(error)
        assert error <= float(shown) <= 1.34 * error


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(30, "30 s"), (0.1, "0.1 s"), (0.05, "50 ms"), (1e-3, "1 ms"), (0.00025, "0.25 ms"), (1.5625e-5, "15.625 µs")],
)
def test_steps(seconds, text):
    assert format_seconds(seconds) == text
