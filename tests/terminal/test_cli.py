"""The command line as a user meets it."""

import csv
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

from cosim.results import result_file
from cosim.terminal import cli

KEYS = {"diagram", "status", "steps", "time", "method", "engine", "kernels_compiled", "seconds", "metrics", "results"}
SMALL = """
title: small
run: {stop: 1, step: 0.01}
fleets: {robot: 2}
blocks:
  source: {type: Sine, per: robot}
  lag: {type: Lag, per: robot, inputs: {u: source.y}}
  second: {type: Lag, per: robot, inputs: {u: lag.y}}
record: {period: 0.1, signals: [lag.x]}
metrics:
  largest: {signal: lag.x, reduce: max}
"""


def test_json_is_one_object_and_nothing_else(cosim, write):
    code, out, _ = cosim("run", write(SMALL), "--json")
    answer = json.loads(out)
    assert code == 0 and set(answer) == KEYS and out.count("\n") == 1
    assert (answer["status"], answer["steps"], answer["method"], answer["engine"]) == (
        "completed",
        100,
        "jacobi",
        "native",
    )
    assert set(answer["seconds"]) == {"setup", "compile", "solve"}
    assert answer["metrics"]["largest"] == pytest.approx(2 * 2 * np.sin(1) / 2, abs=1.5)
    assert answer["results"] == str(Path("results", "diagram.nc"))


def test_the_table_says_what_changed_since_the_run_before(cosim, write):
    path = write(SMALL)
    first = cosim("run", path)[1]
    assert "largest" in first and "previous" not in first
    assert "same" in cosim("run", path)[1]
    changed = cosim("run", path, "--set", "blocks.lag.parameters.T=0.1")[1]
    assert "previous" in changed and "%" in changed


def test_a_result_whose_reductions_are_damaged_is_told_in_words(cosim, write):
    path = write(SMALL)
    cosim("run", path)
    with h5py.File("results/diagram.nc", "r+") as file:
        file.attrs["reductions"] = "[1]"
    code, _, said = cosim("run", path)
    assert code == 2 and "cannot read results/diagram.nc: its reductions are damaged" in said


def test_a_result_of_an_earlier_version_stands_beside_this_one(cosim, write):
    """It does not say what its metrics mean."""
    path = write(SMALL)
    cosim("run", path)
    with h5py.File("results/diagram.nc", "r+") as file:
        del file.attrs["reductions"]
    code, out, _ = cosim("run", path)
    assert code == 0 and "same" in out


@pytest.mark.parametrize("other", ["reduce=min", "signal=second.x", "from=0.5"])
def test_a_metric_that_means_something_else_is_not_compared_with_the_run_before(cosim, write, other):
    path = write(SMALL)
    cosim("run", path)
    again = cosim("run", path, "--set", f"metrics.largest.{other}")[1]
    assert "new" in again and "%" not in again and "same" not in again


def test_nothing_known_is_compiled_twice(cosim, write):
    path = write(SMALL)
    cosim("run", path, "--json")
    cosim("run", path, "--json", "--set", "fleets.robot=3")  # from three members on, several are done at a time
    for options in (
        (),
        ("--set", "blocks.lag.parameters.T=[0.1, 0.2]"),
        ("--set", "fleets.robot=40"),
        ("--method", "joint"),
        ("--set", "blocks.second.inputs.u=source.y"),
        ("--step", "0.001", "--stop", "0.5"),
    ):
        answer = json.loads(cosim("run", path, "--json", *options)[1])
        assert (answer["status"], answer["kernels_compiled"]) == ("completed", 0), options


def test_a_swap_keeps_what_the_new_block_declares(cosim, write):
    text = SMALL.replace("inputs: {u: source.y}", "parameters: {T: 2}, inputs: {u: source.y}")
    path = write(text.replace("u: lag.y", "u: lag.x"))
    blocks = path.read_text().split("python: ")[1].split(":Sine")[0]
    swap = ("--swap", f"lag={blocks}:Integrator")
    code, _, err = cosim("run", path, "--json", *swap)
    assert code == 2 and "parameters.T at" in err and "--set 'blocks.lag.drop=[T]'" in err
    code, out, err = cosim("run", path, "--json", *swap, "--set", "blocks.lag.drop=[T]")
    assert code == 0 and err == ""
    assert json.loads(out)["metrics"]["largest"] == pytest.approx(4 * (1 - np.cos(1)), rel=0.02)


def test_settings_reach_every_part(cosim, write):
    answer = json.loads(cosim("run", write(SMALL), "--json", "--stop", "2", "--step", "0.02", "--method", "joint")[1])
    assert (answer["steps"], answer["method"]) == (100, "joint")


def test_csv_holds_what_was_recorded(cosim, write, tmp_path):
    code, _, _ = cosim("run", write(SMALL), "--csv", "out.csv", "-o", "out.nc")
    rows = list(csv.reader((tmp_path / "out.csv").open()))
    assert code == 0 and len(rows) == 12 and rows[0][:2] == ["time", "lag.x[1,1]"]
    with result_file.open_result(tmp_path / "out.nc") as result:
        assert float(rows[-1][4]) == result["lag.x"][-1, 1, 1]


def test_a_diverged_run_keeps_what_was_recorded(cosim, write, tmp_path):
    text = "run: {stop: 3, step: 0.01}\nblocks:\n  bang: {type: Explosive}\nrecord: {period: 0.01, signals: [bang.x]}\n"
    code, out, err = cosim("run", write(text), "--json", "-o", "bang.nc")
    answer = json.loads(out)
    assert code == 1 and answer["status"] == "diverged" and 100 < answer["steps"] < 300
    assert "block bang: state `x` is 3.52e+173, beyond 9e+99 at t = 1." in err and "Traceback" not in err
    with result_file.open_result(tmp_path / "bang.nc") as result:
        assert result.attrs["status"] == "diverged" and len(result.times) == answer["steps"]
        assert np.isfinite(result["bang.x"]).all() and result["bang.x"][-1] > 1e3


def test_a_failing_block_ends_in_exit_code_1(cosim, write):
    text = """
    run: {stop: 3, step: 0.01}
    blocks:
      source: {type: Sine, parameters: {A: 1}}
      picky: {type: Picky, inputs: {u: source.y}}
    """
    for engine in ("native", "python"):
        code, out, err = cosim("run", write(text), "--json", "--engine", engine)
        assert code == 1 and json.loads(out)["status"] == "failed"
        assert "block picky: outputs() failed at t = 0.26 s: ValueError: input too large" in err


def test_interruption_keeps_what_was_recorded(write, tmp_path):
    path = write(SMALL.replace("stop: 1, step: 0.01", "stop: 1000000, step: 0.01"))
    command = [sys.executable, "-m", "cosim.terminal.cli", "run", str(path), "--json", "-o", str(tmp_path / "long.nc")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        deadline = time.monotonic() + 60
        while not (tmp_path / "long.nc").exists() and time.monotonic() < deadline:
            time.sleep(0.05)
        time.sleep(0.5)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=30)
    answer = json.loads(out)
    assert process.returncode == 130 and answer["status"] == "interrupted" and "Traceback" not in err
    with result_file.open_result(tmp_path / "long.nc") as result:
        assert result.attrs["status"] == "interrupted" and answer["steps"] > 100
        assert len(result.times) == (answer["steps"] + 9) // 10


def test_bad_input_is_exit_code_2_also_as_json(cosim, write):
    code, out, err = cosim("run", write(SMALL.replace("source.y", "source.z")), "--json")
    assert code == 2 and json.loads(out)["status"] == "failed" and "has no output `z`" in err


def test_an_unwritable_result_is_named(cosim, write, tmp_path):
    (tmp_path / "folder").mkdir()
    code, _, err = cosim("run", write(SMALL), "-o", tmp_path / "folder")
    assert code == 2 and "folder" in err and "Traceback" not in err


@pytest.mark.parametrize("option", ["-o", "--csv"])
def test_a_run_never_replaces_what_is_not_its_own(cosim, write, option):
    """The diagram itself, say; and it is said before anything runs."""
    path = write(SMALL)
    text = path.read_text()
    code, out, err = cosim("run", path, option, path)
    assert code == 2 and out == "" and f"{path} exists and is not a" in err and "choose another name" in err
    assert path.read_text() == text
    for _ in range(2):
        assert cosim("run", path, "-o", "again.nc", "--csv", "again.csv")[0] == 0


@pytest.mark.parametrize("name", ["x" * 300 + ".nc", "x" * 250 + ".nc", "file/run.nc", "a\0b.nc"])
def test_a_result_with_an_impossible_name(cosim, write, tmp_path, name):
    (tmp_path / "file").write_text("no folder")
    code, _, err = cosim("run", write(SMALL), "-o", name)
    assert code == 2 and "cannot write" in err and "Traceback" not in err


@pytest.mark.skipif(sys.platform == "darwin", reason="its file systems take UTF-8 names alone")
@pytest.mark.parametrize("encoding", ["utf-8:strict", "utf-8:surrogateescape", "ascii:strict"])
def test_names_of_any_bytes_on_a_terminal_of_any_encoding(tmp_path, encoding):
    folder = tmp_path / os.fsdecode(b"f\xff")
    folder.mkdir()
    own = "from cosim import Block, Output\nclass One(Block):\n    y = Output()\n"
    (folder / "own.py").write_text(own + "    def outputs(time, y):\n        y[0] = time\n")
    diagram = folder / os.fsdecode(b"d\xfe.yaml")
    diagram.write_text("run: {stop: 1, step: 0.5}\nblocks: {b: {python: own.py:One}}\nrecord: {signals: [b.y]}\n")
    given = {**os.environ, "PYTHONIOENCODING": encoding}
    for words in ("run", "run --json", "check"):
        first, *options = words.split()
        command = [sys.executable, "-m", "cosim", first, diagram, *options]
        ran = subprocess.run(command, cwd=folder, env=given, capture_output=True, timeout=300, check=False)
        assert ran.returncode == 0, ran.stderr.decode(errors="replace")
        if options:
            result = folder / json.loads(ran.stdout.decode("ascii"))["results"]
            assert result.name == os.fsdecode(b"d\xfe.nc")
            np.testing.assert_array_equal(result_file.open_result(result).read("b.y").ravel(), [0.0, 0.5, 1.0])


@pytest.mark.skipif(sys.platform == "darwin", reason="its file systems take UTF-8 names alone")
def test_a_study_and_its_report_whose_name_is_no_text(write, tmp_path):
    write(SMALL)
    study = tmp_path / os.fsdecode(b"s\xff.yaml")
    study.write_text("diagram: diagram.yaml\ngrid: {blocks.lag.parameters.T: [1, 2]}\n")
    for command in ("study", "report"):
        ran = subprocess.run(
            [sys.executable, "-m", "cosim", command, study], cwd=tmp_path, capture_output=True, timeout=300, check=False
        )
        assert ran.returncode == 0, ran.stderr.decode(errors="replace")
    report = tmp_path / "results" / study.stem / "report.html"
    assert r"s\udcff" in report.read_text(encoding="utf-8")


def test_check_shows_blocks_wires_and_order(cosim, write):
    code, out, _ = cosim("check", write(SMALL))
    assert code == 0 and "2 × Lag" in out and "u ← source.y" in out
    assert out.index("source.outputs") < out.index("lag.outputs_mean")


def test_check_says_where_members_get_one_element_each_of_something_else(cosim, write):
    text = "run: {stop: 1, step: 0.1}\nfleets: {robot: 2, cart: 2}\nblocks:\n  s: {type: Sine, per: robot}\n"
    text += "  own: {type: Lag, per: robot, inputs: {u: s.y}}\n  other: {type: Lag, per: cart, inputs: {u: s.y}}\n"
    text += "  v: {type: Sine, parameters: {A: 1}}\n  all: {type: Lag, per: cart, inputs: {u: v.y}}\n"
    text += "  one: {type: Counter, per: cart, period: 0.2, inputs: {u: v.y}}\n"
    code, out, _ = cosim("check", write(text))
    assert code == 0 and re.findall(r"u ← (.*)", out) == [
        "s.y",
        "s.y (one each of the fleet robot)",
        "v.y",
        "v.y (one each)",
    ]


@pytest.mark.parametrize(("method", "integrator"), [("jacobi", "euler"), ("jacobi", "rk4"), ("joint", "rk4")])
def test_check_says_where_an_integrators_order_is_lost(cosim, write, method, integrator):
    settings = ("--set", f"run.method={method}", "--set", f"run.integrator={integrator}")
    code, out, _ = cosim("check", write(SMALL), *settings)
    assert code == 0 and ("coupling is of first order" in out) == ((method, integrator) == ("jacobi", "rk4"))


def test_blocks_lists_the_library_and_shows_one(cosim):
    code, out, _ = cosim("blocks")
    assert code == 0 and "NeuralObserver" in out and "OmnidirectionalRobot" in out
    assert "pid: PID controllers, in continuous time and sampled.\n  DiscretePID " in out  # by file
    code, out, _ = cosim("blocks", "SlidingModeDifferentiator")
    assert code == 0 and "(29)" in out and "xi_1[n]" in out and "lipschitz" in out
    code, _, err = cosim("blocks", "NeuralObservr")
    assert code == 2 and "NeuralObserver" in err


@pytest.mark.parametrize(("command", "more"), [("run", ""), ("check", "h5py cosim.terminal.commands.run")])
def test_what_is_compiled_imports_what_it_uses_and_no_more(write, command, more):
    """The time of a start is that of its imports, mostly."""
    path = write(SMALL)
    unused = (
        f"{more} numba scipy networkx matplotlib xarray fmpy lxml requests cosim.language.formula cosim.requirements"
    )
    unused += " cosim.requirements.monitor cosim.authoring.lowering.lowered_functions"
    unused += " cosim.wiring.expression_blocks cosim.engine.checkpoints cosim.engine.identity"
    unused += " importlib.metadata email socket"
    code = "import sys; from cosim.terminal import cli; code = cli.main(sys.argv[2:]); "
    code += "found = {*sys.argv[1].split()} & {*sys.modules}; "
    code += "assert not found, found; sys.exit(code)"
    for _ in range(2):
        words = [sys.executable, "-c", code, unused, command, str(path)]
        done = subprocess.run(words, capture_output=True, text=True, check=False, cwd=path.parent)
    assert done.returncode == 0, done.stderr


def test_two_processes_may_compile_at_once(write, tmp_path, new_cache):
    """Neither finds the block; each sees whole files or none."""
    path = write("run: {stop: 0.1, step: 0.01}\nblocks:\n  o: {type: Oscillator}\n")
    command = [sys.executable, "-m", "cosim.terminal.cli", "run", str(path), "--json", "-o"]
    both = [subprocess.Popen([*command, str(tmp_path / f"{n}.nc")], stdout=subprocess.PIPE) for n in range(2)]
    answers = [json.loads(process.communicate()[0]) for process in both]  # however long a compiler takes here
    assert [answer["status"] for answer in answers] == ["completed"] * 2
    assert answers[0]["kernels_compiled"] + answers[1]["kernels_compiled"] >= 1
    assert not list(new_cache.glob("*.tmp"))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["run", "-o", "out.csv"], "`out.csv`: the name of a result ends in .nc\n    fix: such as out.nc"),
        (["run", "--csv", "x.xlsx"], "`x.xlsx`: the name of a table ends in .csv"),
        (["report", "-o", "r.pdf"], "`r.pdf`: the name of a report ends in .html or .htm"),
        (["export", "-o", "x.nc"], "`x.nc`: the name of an FMU ends in .fmu"),
        (["run", "-o", "."], "name a file in that folder"),
    ],
)
def test_a_name_that_contradicts_its_content_is_refused_before_anything_runs(cosim, write, tmp_path, words, message):
    path = write(SMALL)
    before = list(tmp_path.iterdir())
    code, out, err = cosim(words[0], path, *words[1:])
    assert code == 2 and out == "" and message in err
    assert list(tmp_path.iterdir()) == before


@pytest.mark.parametrize(
    ("words", "message"),
    [([","], "`,` names no block"), (["swing", "--member", "3"], "no member 3: swing is not of one fleet")],
)
def test_what_an_export_would_not_use_is_refused(cosim, write, words, message):
    text = SMALL.replace("record:", "  swing: {type: Oscillator, parameters: {w: 2}}\nrecord:")
    code, _, err = cosim("export", write(text), *words)
    assert code == 2 and message in err


def test_an_export_says_which_outputs_other_importers_may_refuse(cosim, write, tmp_path):
    (tmp_path / "own.py").write_text(
        "from cosim import Block, Output, State\n\nclass Far(Block):\n    y = Output(finite=False)\n    z = Output()\n"
        "    x = State(output=True, finite=False)\n    def update(x, next_x):\n        next_x[0] = x\n"
        "    def outputs(y, z):\n        y[0] = 1e308 * 10.0\n        z[0] = 1.0\n"
    )
    text = SMALL.replace("record:", "  far: {python: own.py:Far, period: 0.01}\nrecord:")
    code, out, err = cosim("export", write(text), "far", "-o", str(tmp_path / "far.fmu"))
    assert code == 0 and out.startswith("wrote ") and "far.z" not in err
    assert "cosim: left out, as importers refuse what is NaN or infinite at the initialization: `far.y`" in err
    assert (
        "cosim: outputs that may become NaN or infinite, which this program and others refuse of an FMU: `far.x`" in err
    )


@pytest.mark.parametrize(
    ("words", "message", "fix"),
    [
        ("", "cosim: COMMAND is missing", "cosim --help"),
        ("plt x.nc", "cosim: COMMAND cannot be `plt`", "did you mean `plot`?"),
        ("run", "cosim run: diagram is missing", "cosim run [-h] [--set a.b.c=VALUE]"),
        ("run a.yaml --stopp 1", "cosim run: there is no option `--stopp`", "did you mean `--stop`?"),
        ("run a.yaml --stopp=1", "cosim run: there is no option `--stopp`", "did you mean `--stop`?"),
        ("run a.yaml b.yaml", "cosim run: `b.yaml` is one argument too many", "cosim run --help"),
        ("run a.yaml --engine pythn", "cosim run: --engine cannot be `pythn`", "did you mean `python`?"),
        ("run a.yaml --stop", "cosim run: --stop: expected one argument", "cosim run --help"),
        ("compare a b --tolerance much", "cosim compare: --tolerance: `much` is no tolerance", "cosim compare --help"),
    ],
)
def test_a_mistake_in_the_command_line_is_an_error_as_all_others_are(capsys, words, message, fix):
    assert cli.main(words.split()) == 2
    said = capsys.readouterr()
    assert said.out == "" and said.err.startswith(f"error: {message}\n    fix: ") and fix in said.err
    assert cli.main([*words.split(), "--json"]) == 2
    if words.startswith("run"):
        assert message in json.loads(capsys.readouterr().out)["error"]


def test_inner_steps_are_told(cosim, write):
    settings = "stop: 10, step: 1, integrator: rodas4, tolerance: 1.0e-4"
    path = write(f"run: {{{settings}}}\nblocks:\n  o: {{type: Oscillator}}\n")
    code, out, _ = cosim("run", path)
    assert code == 0 and "inner steps within tolerance: o " in out and " rejected)" in out
    code, out, _ = cosim("run", path, "--json")
    steps = json.loads(out)["inner_steps"]
    assert steps["o"]["taken"] > 10
    with result_file.open_result(Path("results/diagram.nc")) as result:
        assert result.attrs["inner_steps"] == steps
        assert result.attrs["settings"]["tolerance"] == 1e-4


@pytest.mark.parametrize(("given", "found"), [({}, "4"), ({"OPENBLAS_THREAD_TIMEOUT": "20"}, "20")])
def test_threads_of_linear_algebra_wait_at_rest_unless_somebody_wants_it_otherwise(given, found):
    """They read it when numpy is loaded, which the command line has to come before."""
    code = "import os, cosim.__main__; print(os.environ['OPENBLAS_THREAD_TIMEOUT'])"
    environment = {**{k: v for k, v in os.environ.items() if k != "OPENBLAS_THREAD_TIMEOUT"}, **given}
    ran = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert ran.stdout.split() == [found]


def test_nothing_loads_numpy_before_the_command_line_has_said_how_its_threads_wait():
    code = "import sys, os; f = os.environ.setdefault; os.environ.__class__.setdefault = lambda s, *a: "
    code += "print(*a, 'numpy' in sys.modules); import cosim.__main__"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "OPENBLAS_THREAD_TIMEOUT 4 False" in ran.stdout
