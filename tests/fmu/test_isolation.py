"""An FMU in a process of its own gives the same bits with every method and engine, and leaves no process behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from cosim.engine import run
from cosim.engine.run import Run
from cosim.errors import FmuCrashed
from cosim.machine import supervision
from cosim.results import result_file
from cosim.study import running, study_file
from cosim.study.running import Options
from tests.fmu import machine

pytestmark = pytest.mark.skipif(not supervision.AVAILABLE, reason="needs fork")
EVERY = [("2", "co-simulation"), ("3", "co-simulation"), ("3e", "co-simulation")]
EVERY += [("2", "model-exchange"), ("3", "model-exchange")]
FLEET = """
run: {{stop: 1, step: 0.01, method: {method}, integrator: rk4}}
fleets: {{robot: 3}}
blocks:
  source: {{type: Source, per: robot, parameters: {{A: i}}}}
  lag: {{type: Lag, per: robot, inputs: {{u: plant.x}}}}
  plant:
    fmu: {fmu}
    mode: {mode}
    per: robot
    inputs: {{u: source.u, n: source.n, on: source.on}}
    parameters: {{T: [0.2, 0.4, 0.8], name: [a, b, c], {more}}}
    start: {{x: i, h: [1, 2, 3]}}
"""
SIGNALS = ("plant.x", "plant.y", "plant.h", "plant.v", "plant.bounces", "plant.m", "plant.off", "lag.x")


@pytest.fixture
def fleet(partners):
    """Wire three machines; isolated or not."""

    def wire(path: Path, mode: str, isolated: bool, method: str = "jacobi", more: str = ""):
        text = FLEET.format(fmu=path, mode=mode, method=method, more=more)
        return run.load(partners(text), [f"blocks.plant.isolate={str(isolated).lower()}"])

    return wire


# Co-Simulation FMUs step by themselves, and cannot be integrated jointly with others.
METHODS = {"co-simulation": ("jacobi", "gauss-seidel"), "model-exchange": ("jacobi", "gauss-seidel", "joint")}


@pytest.mark.parametrize(("kind", "mode", "method"), [(k, m, how) for k, m in EVERY for how in METHODS[m]])
def test_isolated_trajectories_have_the_same_bits(machines, fleet, trajectories, kind, mode, method):
    apart = trajectories(fleet(machines[kind], mode, True, method), *SIGNALS)
    together = trajectories(fleet(machines[kind], mode, False, method), *SIGNALS)
    for name in SIGNALS:
        assert np.array_equal(apart[name], together[name]), name
    assert np.ptp(apart["plant.x"]) > 0.5


def test_the_interpreted_engine_calls_servers_as_well(machines, fleet, trajectories):
    network = fleet(machines["3e"], "co-simulation", True)
    native, python = trajectories(network, *SIGNALS), trajectories(network, *SIGNALS, engine="python")
    for name in SIGNALS:
        assert np.array_equal(native[name], python[name]), name


def test_one_instance_a_process_means_a_server_for_each(fleet, trajectories, tmp_path):
    path = machine.build(tmp_path / "single", 2, "cs", 'canBeInstantiatedOnlyOncePerProcess="true"')
    plain = machine.build(tmp_path / "plain", 2, "cs")
    network = fleet(path, "co-simulation", True)
    before = children(os.getpid())
    one = Run(network)
    assert children(os.getpid()) == before  # a constructor starts nothing
    most = []
    assert one.execute(lambda time: most.append(len(children(os.getpid())))).status == "completed"
    assert max(most) - len(before) == 3 + 1  # and the engine
    assert children(os.getpid()) == before
    apart = trajectories(network, *SIGNALS)
    together = trajectories(fleet(plain, "co-simulation", False), *SIGNALS)
    for name in SIGNALS:
        assert np.array_equal(apart[name], together[name]), name


def test_a_failing_server_among_several_is_named(fleet, tmp_path):
    path = machine.build(tmp_path / "single", 2, "cs", 'canBeInstantiatedOnlyOncePerProcess="true"')
    for fault, words in ((2, "fmi2DoStep() returned `error`"), (9, "segmentation fault in fmi2DoStep()")):
        network = fleet(path, "co-simulation", True, more=f"fault: [0, {fault}, 0], fault_time: 0.3")
        outcome = Run(network).execute()
        assert f"block plant (machine2.fmu, robot 2) failed at t = 0.3 s: {words}" in str(outcome.error)
        assert "it says" in str(outcome.error)


def test_a_killed_server_stops_the_run(machines, fleet):
    network = fleet(machines["2"], "co-simulation", True)
    network.diagram.run.stop = 1e5
    one = Run(network)
    killed = []

    def watch(time: float) -> None:
        if time > 1.0 and not killed:
            killed.append(one.simulation.host._crew._processes["plant"].pid)
            os.kill(killed[0], signal.SIGKILL)

    outcome = one.execute(watch)
    assert isinstance(outcome.error, FmuCrashed)
    assert "block plant (machine2.fmu" in str(outcome.error) and "killed the process" in str(outcome.error)


def test_native_diagrams_need_no_process_of_their_own(formation, monkeypatch):
    monkeypatch.setattr(supervision.Crew, "hire", lambda *_: pytest.fail("forked"))
    assert Run(run.load(formation, ["run.stop=0.01"])).execute().status == "completed"


def test_a_study_survives_the_members_that_crash(machines, tmp_path):
    (tmp_path / "diagram.yaml").write_text(
        f"run: {{stop: 0.5, step: 0.01}}\nblocks: {{plant: {{fmu: {machines['2']}, start: {{x: 1, u: 0}}}}}}\n"
        "metrics: {x: {signal: plant.x, reduce: final}}\n"
    )
    (tmp_path / "study.yaml").write_text(
        "diagram: diagram.yaml\nvariants: {plain: , apart: {set: {blocks.plant.isolate: true}}}\n"
        "grid: {blocks.plant.parameters.fault: [0, 9, 8]}\n"
    )
    study = running.run(study_file.load(tmp_path / "study.yaml"), Options(tmp_path / "results"))
    rows = list(study.rows())
    assert [row["status"] for row in rows] == ["completed", "failed", "completed"] * 2
    assert all("segmentation fault in fmi2DoStep()" in row["reason"] for row in rows if row["status"] == "failed")
    assert len({row["metrics"]["x"] for row in rows if row["status"] == "completed"}) == 1


def test_what_compiled_code_is_called_does_not_depend_on_the_process():
    code = (
        "from cosim.compiling.fingerprint.text import fingerprint; from cosim.fmu import adapter, mailbox; "
        "print(*map(fingerprint, (adapter.adapt, mailbox.remote, mailbox.serve)))"
    )
    texts = {
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False).stdout
        for _ in range(2)
    }
    assert len(texts) == 1 and len(texts.pop().split()) == 3


# ---- processes ----


def test_a_run_that_is_dropped_leaves_no_process(machines, fleet):
    before = children(os.getpid())
    one = Run(fleet(machines["2"], "co-simulation", True))
    one.simulation.initialize()
    assert len(children(os.getpid()) - before) == 2
    del one
    assert children(os.getpid()) == before


LONG = """
run: {{stop: 1000000, step: 0.01}}
blocks:
  source: {{type: Source}}
  plant: {{fmu: {fmu}, isolate: {isolated}, inputs: {{u: source.u}}, parameters: {{fault: {fault}, fault_time: 1}}}}
record: {{period: 0.1, signals: [plant.x]}}
"""


def children(pid: int) -> set[int]:
    """The processes that a process has."""
    command = ["ps", "-o", "pid=", "--ppid", str(pid)]
    listed = subprocess.run(command, capture_output=True, text=True, check=False).stdout.split()
    return {int(child) for child in listed if lives(int(child))}


def lives(pid: int) -> bool:
    """Whether a process is there, and no zombie."""
    command = ["ps", "-o", "stat=", "-p", str(pid)]
    found = subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip()
    return bool(found) and not found.startswith("Z")


def wait_until(condition, seconds: float = 30.0) -> bool:
    limit = time.monotonic() + seconds
    while not condition() and time.monotonic() < limit:
        time.sleep(0.05)
    return condition()


@pytest.fixture
def long_run(machines, partners, tmp_path):
    """A long run by the command line: its process, its children, its result."""
    started = []

    def start(isolated: str, fault: int = 0, after: float = 0.5) -> tuple[subprocess.Popen, set[int], Path]:
        output = tmp_path / "long.nc"
        path = partners(LONG.format(fmu=machines["2"], isolated=isolated, fault=fault))
        command = [sys.executable, "-m", "cosim", "run", str(path), "-o", str(output)]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        started.append(process)
        assert wait_until(output.exists)
        time.sleep(after)
        return process, children(process.pid), output

    yield start
    for process in started:
        process.kill()
        process.communicate()


@pytest.mark.parametrize(("isolated", "processes"), [("false", 1), ("true", 2)])
def test_interruption_keeps_data_and_leaves_no_process(long_run, isolated, processes):
    process, forked, output = long_run(isolated)
    assert len(forked) == processes
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=30)
    assert process.returncode == 130 and "Traceback" not in err
    assert not any(lives(pid) for pid in forked)
    with result_file.open_result(output) as result:
        assert result.attrs["status"] == "interrupted" and len(result.times) > 0


@pytest.mark.parametrize("isolated", ["false", "true"])
def test_a_second_interruption_breaks_through_a_call_that_hangs(long_run, isolated):
    for after in (0.5, 2.0, 8.0, 32.0):  # a busy machine may not have come to the call that hangs
        process, forked, output = long_run(isolated, 10, after)
        process.send_signal(signal.SIGINT)
        time.sleep(0.5)
        hung = process.poll() is None
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=60)
        assert process.returncode == 130 and "Traceback" not in err
        assert not any(lives(pid) for pid in forked)
        with result_file.open_result(output) as result:
            assert result.attrs["status"] == "interrupted"
            rows = len(result.times)
        if hung and rows == 11:
            return
        output.unlink()
    raise AssertionError("it did not come to the call that hangs")


@pytest.mark.parametrize("isolated", ["false", "true"])
def test_processes_end_with_a_killed_run(long_run, isolated):
    process, forked, _ = long_run(isolated)
    assert forked
    process.kill()
    assert wait_until(lambda: not any(lives(pid) for pid in forked), 10.0)
