"""`cosim run --checkpoint` and `--resume` as a user meets them: kills, signals, full disks, mistakes."""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from cosim.results.result_file import open_result
from cosim.terminal import cli
from tests.interrupted import assert_same_results

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
LONG = """
run: {stop: 300, step: 0.001, integrator: rk4}
fleets: {robot: 5}
blocks:
  source: {type: Sine, per: robot, parameters: {f: 0.3}}
  lag: {type: Lag, per: robot, inputs: {u: {from: source.y, delay: 0.25}}, start: {u: 0}}
  slow: {type: Counter, period: 0.07, inputs: {u: swing.x}}
  swing: {type: Oscillator}
record: {period: 0.01, signals: [lag.x, lag.y, slow.count, swing.x]}
metrics:
  rms: {signal: lag.y, reduce: rms}
  top: {signal: lag.x, reduce: max, from: 100}
  last: {signal: slow.held, reduce: final}
"""
OFTEN = """
import sys
from cosim.engine import recording
from cosim.terminal import cli
recording.FLUSH_SECONDS = 0.0
from cosim.engine.simulation import Simulation
batches = Simulation.batches
def told(self, *arguments):
    print("begins", file=sys.stderr, flush=True)
    for number, samples in enumerate(batches(self, *arguments)):
        if number == 5:
            print("runs", file=sys.stderr, flush=True)
        yield samples
Simulation.batches = told
sys.exit(cli.main(sys.argv[1:]))
"""
"""The command line, which says when a run begins, and when it is in the midst; it brings every batch to the file."""


@pytest.fixture
def start(write, tmp_path):
    """Start a run: (process, path of its result)."""
    started = []

    def begin(*options: str, text: str = LONG, **more):
        output = tmp_path / "run.nc"
        command = [sys.executable, "-c", OFTEN, "run", str(write(text)), "-o", str(output), *options]
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
        started.append(subprocess.Popen(command, **{**pipes, **more}))
        return started[-1], output

    yield begin
    for process in started:
        process.kill()
        process.wait()


@pytest.fixture
def whole(write, tmp_path, capsys):
    """The result of the run that nobody kills, and what was printed of it."""

    def run(text: str = LONG) -> tuple[Path, dict]:
        assert cli.main(["run", str(write(text, "whole.yaml")), "-o", str(tmp_path / "whole.nc"), "--json"]) == 0
        return tmp_path / "whole.nc", json.loads(capsys.readouterr().out)

    return run


def test_kills_at_random_instants(start, whole, tmp_path):
    """Eight, or fewer where the machine is done before; whatever it does then, also in the midst of a checkpoint."""
    draw, resume = np.random.default_rng(5), ()
    for _ in range(8):
        process, output = start("--checkpoint", "0.5", "--json", *resume)
        assert process.stderr.readline() == "begins\n"
        time.sleep(draw.uniform(0.0, 0.25))
        process.kill()
        process.wait()
        if (tmp_path / "run.checkpoint").exists():
            resume = ("--resume",)
    process, output = start("--json", *resume)
    out, err = process.communicate(timeout=600)
    assert process.returncode == 0, err
    other, before = whole()
    answer = json.loads(out)
    assert answer["metrics"] == before["metrics"] and answer["steps"] == before["steps"]
    with open_result(output) as result, open_result(other) as expected:
        assert len(result.times) == 30001 and result.times.tobytes() == expected.times.tobytes()
        for name in expected.signals:
            assert result[name].tobytes() == expected[name].tobytes(), name
    assert not list(tmp_path.glob("*run.checkpoint*")) and not list(tmp_path.glob(".*"))


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_leaves_a_checkpoint_from_which_it_goes_on(start, tmp_path, number):
    endless = LONG.replace("stop: 300", "stop: 1.0e+6")
    process, output = start("--checkpoint", "1e9", text=endless)
    assert [process.stderr.readline() for _ in range(2)] == ["begins\n", "runs\n"]
    process.send_signal(number)
    out, err = process.communicate(timeout=600)
    assert process.returncode == 128 + number and "Traceback" not in err
    with open_result(output) as result:
        steps, rows = result.attrs["steps"], len(result.times)
    assert f"checkpoint of t = {steps * 0.001:g} s in {tmp_path / 'run.checkpoint'}: --resume goes on from there" in out
    process, _ = start("--resume", "--json", text=endless)
    assert [process.stderr.readline() for _ in range(2)] == ["begins\n", "runs\n"]
    process.send_signal(number)
    answer = json.loads(process.communicate(timeout=600)[0])
    assert answer["resumed"] == pytest.approx(steps * 0.001) and answer["steps"] > steps
    assert answer["checkpoint"] == {"file": str(tmp_path / "run.checkpoint"), "time": answer["steps"] * 0.001}
    with open_result(output) as result:
        assert len(result.times) > rows and len(result.times) == (answer["steps"] + 9) // 10
        assert np.allclose(result.times, np.arange(len(result.times)) * 0.01, rtol=1e-12)


def test_a_result_that_found_no_space_goes_on_when_there_is_some(start, whole, tmp_path):
    process, output = start("--checkpoint", "2", preexec_fn=limited)
    _, err = process.communicate(timeout=600)
    assert process.returncode == 1 and f"cannot write {output}: File too large" in err
    process, _ = start("--resume", "--json")
    out, err = process.communicate(timeout=600)
    assert process.returncode == 0, err
    assert json.loads(out)["resumed"] % 2 == 0
    other, before = whole()
    assert json.loads(out)["metrics"] == before["metrics"]
    with open_result(output) as result, open_result(other) as expected:
        assert result.times.tobytes() == expected.times.tobytes() and result.attrs["status"] == "completed"
        assert all(result[name].tobytes() == expected[name].tobytes() for name in expected.signals)


def limited() -> None:
    resource.setrlimit(resource.RLIMIT_FSIZE, (700_000,) * 2)


WIDE = """
run: {stop: 2, step: 0.01}
fleets: {robot: 20000}
blocks:
  swing: {type: Oscillator, per: robot}
metrics:
  top: {signal: swing.x, reduce: max}
"""


def test_a_disk_that_is_full_for_a_checkpoint_ends_the_run(start, tmp_path):
    """A limit on the size of files stands for it: the result is small, and the checkpoint has 20,000 robots."""
    process, output = start("--checkpoint", "0.5", text=WIDE, preexec_fn=limited)
    _, err = process.communicate(timeout=600)
    assert process.returncode == 1 and f"cannot write {tmp_path / 'run.checkpoint'}: File too large" in err
    assert "free some space" in err and not list(tmp_path.glob("*checkpoint*"))
    with open_result(output) as result:
        assert result.attrs["status"] == "failed" and result.attrs["steps"] == 0


SHORT = LONG.replace("stop: 300", "stop: 1").replace("from: 100", "from: 0.5")


def test_mistakes_of_the_command_line_are_told(cosim, write):
    diagram = write(SHORT)
    code, _, err = cosim("run", diagram, "--checkpoint", "often")
    assert code == 2 and "`often` is no interval of checkpoints" in err and "such as 100 for every 100 simulated" in err
    code, _, err = cosim("run", diagram, "--checkpoint")
    assert code == 2 and "--checkpoint: expected one argument" in err
    code, out, err = cosim("run", diagram, "--resume", "--json")
    assert code == 2 and "there is no checkpoint results/diagram.checkpoint" in json.loads(out)["error"]
    assert "leave --resume out to begin anew" in err and not Path("results").exists()


def test_what_stands_in_the_place_of_the_checkpoint_stays(cosim, write):
    folder = Path("results", "diagram.checkpoint")
    folder.mkdir(parents=True)
    code, _, err = cosim("run", write(SHORT), "--checkpoint", "0.5")
    assert code == 2 and f"{folder} exists and is not a checkpoint of a run" in err and folder.is_dir()


def test_a_run_that_completes_leaves_its_result_alone(cosim, write):
    code, out, err = cosim("run", write(SHORT), "--checkpoint", "0.25")
    assert code == 0 and not err and "checkpoint" not in out and "resumed" not in out
    assert [path.name for path in Path("results").iterdir()] == ["diagram.nc"]
    content = Path("results/diagram.nc").read_bytes()
    code, out, err = cosim("run", write(SHORT), "--resume", "--csv", "all.csv")
    assert (code, err) == (0, "") and "nothing to do: the run in results/diagram.nc is completed" in out
    code, out, _ = cosim("run", write(SHORT), "--resume", "--json")
    answer = json.loads(out)
    assert code == 0 and answer["status"] == "completed" and {*answer["metrics"]} == {"rms", "top", "last"}
    assert Path("results/diagram.nc").read_bytes() == content and Path("all.csv").read_text().count("\n") == 102


def test_a_run_that_diverged_is_no_success_when_it_is_resumed(cosim, write):
    diagram = write("run: {stop: 9, step: 0.01}\nblocks: {it: {type: Explosive}}\nrecord: {signals: [it.x]}\n")
    assert cosim("run", diagram, "--checkpoint", "1")[0] == 1
    code, out, _ = cosim("run", diagram, "--resume")
    assert code == 1 and "nothing to do: the run in results/diagram.nc is diverged" in out


def test_errors_of_figures_go_without_checkpoints(cosim, write):
    for option in (("--checkpoint", "1"), ("--resume",)):
        code, _, err = cosim("run", write(SHORT), "--error", *option)
        assert code == 2 and "--error makes further runs, which keep no checkpoints" in err and "cosim accuracy" in err


def test_a_resumed_run_says_so_and_shows_the_run_before_beside_it(cosim, write, tmp_path):
    diagram = write(SHORT)
    assert cosim("run", diagram)[0] == 0
    pid = os.fork()
    if pid == 0:
        from cosim.engine import run

        run._judged = lambda *_: os._exit(3)  # killed after its last batch
        cli.main(["run", str(diagram), "--checkpoint", "0.4", "--json"])
        os._exit(0)
    assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 3
    code, out, _ = cosim("run", diagram, "--resume")
    assert code == 0 and ", resumed at t = 0.8 s)" in out and "same" in out
    assert_same_results(Path("results/diagram.nc"), Path("results/diagram.previous.nc"))


def test_a_changed_diagram_ends_with_exit_code_2_and_what_has_changed(cosim, write):
    diagram = write(SHORT)
    pid = os.fork()
    if pid == 0:
        from cosim.engine import run

        run._judged = lambda *_: os._exit(3)
        cli.main(["run", str(diagram), "--checkpoint", "0.4", "--json"])
        os._exit(0)
    os.waitpid(pid, 0)
    code, _, err = cosim("run", diagram, "--resume", "--stop", "2", "--set", "blocks.swing.parameters.w=3")
    assert code == 2 and "is of another run: `run.stop` was 1.0 and is 2.0; `blocks.swing.parameters" in err
    assert cosim("run", diagram, "--resume")[0] == 0
