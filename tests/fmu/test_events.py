"""Time events of Model Exchange are handled at their own time, under every method, and the end that an FMU asks for.

`stair.c` refuses to be integrated beyond an event, and handles one at its own time only.
"""

from __future__ import annotations

import json

import numpy as np
import pytest

from cosim.engine import run
from cosim.engine.run import Run
from cosim.results import result_file
from cosim.terminal import cli
from tests.fmu import stair
from tests.fmu.conftest import PARTNERS

STAIR = """
run: {{stop: {stop}, step: {step}, method: {method}, integrator: {integrator}, inner_steps: {inner}}}
fleets: {{robot: 2}}
blocks:
  plant:
    fmu: {fmu}
    mode: {mode}
    per: robot
    start: {{u: 0.5}}
    parameters: {{period: [1, 0.7], jump: {jump}, last: {last}}}
"""
METHODS = [(m, i) for m in ("jacobi", "gauss-seidel", "joint") for i in ("euler", "rk4")]


@pytest.fixture(scope="session")
def stairs(tmp_path_factory):
    """The FMU by version and number of states."""
    folder = tmp_path_factory.mktemp("stairs")
    return {(v, n): stair.build(folder / f"{v}{n}", v, n) for v in (2, 3) for n in (0, 1, 2)}


@pytest.fixture
def diagram(stairs, write):
    """Write a diagram with two stairs."""

    def text(version: int, states: int, **more):
        usual = {"stop": 6, "step": 0.3, "method": "jacobi", "integrator": "euler", "inner": 1, "jump": 0}
        usual |= {"mode": "model-exchange", "last": 1 << 30, "fmu": stairs[version, states]}
        return write(STAIR.format(**(usual | more)))

    return text


def counted(times: np.ndarray, period: float) -> np.ndarray:
    """1, and one more from each multiple of the period on; what rounding does to a time is no matter."""
    return 1 + np.floor(times / period + 1e-9)


def integral(times: np.ndarray, period: float, jump: float) -> np.ndarray:
    """The integral of the counter and of 0.5, with a jump at each event."""
    past = counted(times, period) - 1
    return 0.5 * times + times + past * times - period * past * (past + 1) / 2 + jump * past


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize(("method", "integrator"), METHODS)
@pytest.mark.parametrize(("step", "inner"), [(0.3, 1), (0.3, 3), (2.0, 1), (0.1, 1)])
def test_time_events_between_points_are_handled(
    diagram, trajectories, version, method, integrator, step, inner, engine
):
    for states in (0, 1):
        path = diagram(version, states, method=method, integrator=integrator, step=step, inner=inner, jump=0.25)
        got = trajectories(run.load(path), "plant.counter", *["plant.x"] * states, engine=engine)
        times = step * np.arange(len(got["plant.counter"]))
        for robot, period in enumerate((1, 0.7)):
            assert np.array_equal(got["plant.counter"][:, robot], counted(times, period))
            if states:  # constant between events, so that every method is exact up to rounding
                assert got["plant.x"][:, robot] == pytest.approx(integral(times, period, 0.25), rel=1e-13, abs=1e-13)


def twice_integrated(times: np.ndarray, period: float, jump: float) -> list[float]:
    """The integral of `integral`, from one event to the next: a parabola each."""
    found = []
    for time in times:
        w = x = begin = 0.0
        for past in range(int(counted(time, period))):
            h = min((past + 1) * period, time) - begin
            w += h * (x + 0.5 * h * (1.5 + past))
            x += h * (1.5 + past) + jump
            begin += h
        found.append(w)
    return found


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel", "joint"])
def test_between_events_all_states_are_integrated_by_the_runs_integrator(
    diagram, trajectories, version, method, engine
):
    """Runge and Kutta's method is exact for parabolas; an Euler step of 0.3 s would be wrong by 0.1 a second."""
    path = diagram(version, 2, method=method, integrator="rk4", jump=0.25)
    got = trajectories(run.load(path), "plant.w", engine=engine)["plant.w"]
    times = 0.3 * np.arange(len(got))
    for robot, period in enumerate((1, 0.7)):
        assert got[:, robot] == pytest.approx(twice_integrated(times, period, 0.25), rel=1e-13, abs=1e-13)


SAMPLING = """
run: {{stop: 4, step: 0.25, method: {method}}}
blocks:
  behind: {{type: Double, inputs: {{u: first.held}}}}
  second: {{fmu: {fmu}, mode: model-exchange, inputs: {{u: first.held}}}}
  first: {{fmu: {fmu}, mode: model-exchange, inputs: {{u: clock.y}}}}
  clock: {{type: Clock}}
"""


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel", "joint"])
def test_an_event_sees_the_inputs_of_its_time(stairs, write, trajectories, method, version, engine):
    """One keeps the time, a block behind it sees that at once; another FMU keeps what there was before the event."""
    text = SAMPLING.format(method=method, fmu=stairs[version, 1]).replace("type: ", f"python: {PARTNERS}:")
    got = trajectories(run.load(write(text)), "first.held", "second.held", "behind.y", engine=engine)
    floor = np.floor(0.25 * np.arange(17))
    assert np.array_equal(got["first.held"], floor)
    assert np.array_equal(got["second.held"], np.maximum(floor - 1, 0))
    assert np.array_equal(got["behind.y"], 2 * floor)


@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel", "joint"])
def test_a_neighbour_of_an_event_keeps_its_bits(diagram, trajectories, stairs, method):
    """The states of robot 1 and of a native block are those of a run in which robot 2 has no event."""
    path = diagram(3, 1, method=method, step=0.25)
    calm = trajectories(run.load(path, ["blocks.plant.parameters.period=[1,1e9]"]), "plant.x")
    got = trajectories(run.load(path, ["blocks.plant.parameters.period=[1,0.7]"]), "plant.x")
    assert np.array_equal(calm["plant.x"][:, 0], got["plant.x"][:, 0])
    assert not np.array_equal(calm["plant.x"][:, 1], got["plant.x"][:, 1])


LATE = """
run: {{stop: 2, step: 0.4, method: {method}, integrator: heun}}
blocks:
  plant: {{fmu: {fmu}, mode: model-exchange, parameters: {{period: 0.7, last: {last}}}}}
  sum: {{type: Sum, inputs: {{u: plant.y}}}}
  behind: {{type: Lag, inputs: {{u: plant.x}}}}
"""


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("states", [0, 1])
@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel", "joint"])
def test_the_others_see_an_event_at_its_time(stairs, write, trajectories, method, states, version, engine):
    """What is constant between events is integrated exactly by another block, whatever the method."""
    text = LATE.format(method=method, fmu=stairs[version, states], last=100).replace("type: ", f"python: {PARTNERS}:")
    text = text if states else text.partition("  behind")[0]
    got = trajectories(run.load(write(text)), "sum.x", engine=engine)["sum.x"]
    times = 0.4 * np.arange(6)
    assert got == pytest.approx(integral(times, 0.7, 0.0) - 0.5 * times, rel=1e-13, abs=1e-13)


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel", "joint"])
def test_an_end_between_two_points_has_a_sample(stairs, write, tmp_path, method, version, engine):
    """The third of 0.7 s ends the run; who records every second point only has that sample too."""
    text = LATE.format(method=method, fmu=stairs[version, 1], last=3).replace("type: ", f"python: {PARTNERS}:")
    text += "record: {period: 0.8, signals: [sum.x]}\nmetrics: {last: {signal: sum.x, reduce: final}}\n"
    network = run.load(write(text))
    outcome = Run(network, engine, tmp_path / "out.nc").execute()
    assert (outcome.status, outcome.steps, outcome.time) == ("completed", 4, pytest.approx(1.4, rel=1e-15))
    assert "block plant (stair" in outcome.reason and "ended the simulation at t = 1.4 s" in outcome.reason
    with result_file.open_result(tmp_path / "out.nc") as result:
        assert result.times == pytest.approx([0, 0.8, 1.4], rel=1e-15)
        wanted = integral(np.array([0, 0.8, 1.4 - 1e-15]), 0.7, 0.0) - 0.5 * np.array([0, 0.8, 1.4])
        assert result["sum.x"] == pytest.approx(wanted, abs=1e-13)
        assert result.attrs["end"] == outcome.time
    assert outcome.metrics["last"] == pytest.approx(2.1, abs=1e-13)


# ---- the end of the simulation ----


@pytest.mark.parametrize(
    ("version", "states", "mode"),
    [(v, n, "model-exchange") for v in (2, 3) for n in (0, 1)] + [(v, 1, "co-simulation") for v in (2, 3)],
)
@pytest.mark.parametrize("isolated", ["false", "true"])
def test_an_end_at_a_point_keeps_its_sample(diagram, tmp_path, capfd, version, states, mode, isolated):
    path = diagram(version, states, mode=mode, step=0.25, last=4)
    output = tmp_path / "result.nc"
    settings = [f"blocks.plant.isolate={isolated}", "blocks.plant.parameters.period=[1,1e9]"]
    settings += ["record.period=0.25", "record.signals=[plant.counter]"]
    code = cli.main(["run", str(path), "--json", "-o", str(output), *(w for s in settings for w in ("--set", s))])
    told = json.loads(capfd.readouterr().out)
    assert (code, told["status"], told["time"]) == (0, "completed", 3)
    assert "error" not in told and "warnings" not in told
    assert "ended the simulation at t = 3 s" in told["ended"]
    assert f"block plant (stair{version}.fmu, robot 1)" in told["ended"]
    with result_file.open_result(output) as result:
        assert result.attrs["status"] == "completed"
        assert np.array_equal(result.times, 0.25 * np.arange(13))
        assert np.array_equal(result["plant.counter"][:, 0], counted(np.array(result.times), 1))


@pytest.mark.parametrize("version", [2, 3])
def test_an_end_within_a_step_that_cannot_be_repeated_keeps_the_sample_before_it(diagram, version):
    path = diagram(version, 1, mode="co-simulation", last=5)
    outcome = Run(run.load(path, ["blocks.plant.parameters.period=1"])).execute()
    assert (outcome.status, outcome.steps) == ("terminated", 13)
    assert "ended the simulation at t = 4 s" in outcome.reason


def test_an_end_at_the_end_is_completion(diagram):
    outcome = Run(run.load(diagram(3, 1, last=4, stop=3), ["blocks.plant.parameters.period=1"])).execute()
    assert (outcome.status, outcome.steps) == ("completed", 10)


def test_a_study_says_which_runs_an_fmu_ended(diagram, write, tmp_path):
    from cosim.study import running, study_file

    diagram(3, 1, stop=6, last=4)
    study = study_file.load(write("{diagram: diagram.yaml, grid: {blocks.plant.parameters.last: [4, 1000]}}", "s.yaml"))
    rows = list(running.run(study, running.Options(tmp_path / "results")).rows())
    assert [row["status"] for row in rows] == ["completed", "completed"]
    assert "block plant (stair3.fmu, robot 2) ended the simulation at t = 2.1 s" in rows[0]["reason"]


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel", "joint"])
@pytest.mark.parametrize("step", ["0.1", "0.3"])
@pytest.mark.parametrize("how", [("rodas4", ()), ("dormand-prince", ("run.tolerance=1e-6",))])
def test_implicit_integrators_and_tolerances_stop_at_time_events_too(
    diagram, trajectories, version, method, how, step, engine
):
    path = diagram(version, 1, method=method, integrator=how[0], step=step, jump=0.25)
    got = trajectories(run.load(path, how[1]), "plant.counter", "plant.x", engine=engine)
    times = float(step) * np.arange(len(got["plant.counter"]))
    for robot, period in enumerate((1, 0.7)):
        assert np.array_equal(got["plant.counter"][:, robot], counted(times, period))
        assert got["plant.x"][:, robot] == pytest.approx(integral(times, period, 0.25), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("version", [2, 3])
def test_time_events_without_end_are_an_error(diagram, version):
    outcome = Run(run.load(diagram(version, 1, step=3), ["blocks.plant.parameters.period=1e-5"])).execute()
    assert outcome.status == "failed" and "block plant: events follow each other without end" in outcome.error.message
    assert "run.step" in outcome.error.fix
