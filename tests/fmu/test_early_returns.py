"""Co-Simulation: where an FMU returns early from a step, or ends the simulation, all others come there too.

`stair.c` has an event at each multiple of 0.7 s. Its y is constant between them, so that another block's integral of y
is exact, whatever the method, if and only if steps end at the events.
"""

from __future__ import annotations

import numpy as np
import pytest

from cosim.engine import run
from cosim.engine.run import Run
from cosim.errors import DiagramErrors, FmuError
from cosim.results import result_file
from tests.fmu import stair
from tests.fmu.conftest import PARTNERS

PERIOD = 0.7
TEXT = """
run: {{stop: 2.8, step: {step}, method: {method}, integrator: heun}}
blocks:
  plant: {{fmu: {fmu}, mode: co-simulation{more}, parameters: {{period: 0.7, last: {last}}}}}
  sum: {{python: {partners}:Sum, inputs: {{u: plant.y}}}}
record: {{period: 0.8, signals: [sum.x, plant.x, plant.counter]}}
"""
METHODS = ["jacobi", "gauss-seidel", "iterated"]


@pytest.fixture(scope="module")
def stairs(tmp_path_factory):
    """FMI 3 with event mode, and FMI 2; both with states that can be kept. Beside them, those that lack something."""
    folder, keeps = tmp_path_factory.mktemp("stairs"), {v: f"{stair.KEEPING[v]} {stair.VARYING}" for v in (2, 3)}
    flags = {
        (3, "returns"): f"{keeps[3]} {stair.RETURNING}",
        (3, "forgets"): f"{stair.VARYING} {stair.RETURNING}",
        (3, "rigid"): f"{stair.KEEPING[3]} {stair.RETURNING}",
        (3, "plain"): keeps[3],
        (2, "plain"): keeps[2],
    }
    made = {key: stair.build(folder / f"{key[0]}{key[1]}", key[0], 1, "cs", said) for key, said in flags.items()}
    flags = f"{stair.VARYING} {stair.RETURNING}"
    return made | {(3, "silent"): stair.build(folder / "silent", 3, 1, "cs", flags, ("-DSILENT",))}


@pytest.fixture
def diagram(stairs, tmp_path):
    """Load the diagram with one of the stairs."""

    def load(kind, *settings, method="jacobi", step=0.4, last=1 << 30, more=""):
        path = tmp_path / "d.yaml"
        path.write_text(
            TEXT.format(fmu=stairs[kind], method=method, step=step, last=last, more=more, partners=PARTNERS)
        )
        return run.load(path, settings)

    return load


def recorded(network, tmp_path, engine="native"):
    """The outcome, and its samples: times, the integral by the other block, the FMU's own, and the counter."""
    outcome = Run(network, engine, tmp_path / "d.nc").execute()
    with result_file.open_result(tmp_path / "d.nc") as result:
        return outcome, result.times, result["sum.x"], result["plant.x"], result["plant.counter"]


def integral(times):
    """Of a counter from 1 that steps at each multiple of the period."""
    past = np.floor(times / PERIOD + 1e-9)
    return times + past * times - PERIOD * past * (past + 1) / 2


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("isolate", ["", ", isolate: true"])
@pytest.mark.parametrize("step", [0.4, 2.8 / 3, 2.8])
@pytest.mark.parametrize("method", METHODS)
def test_others_come_to_where_it_returns(diagram, tmp_path, method, step, isolate, engine):
    network = diagram((3, "returns"), f"record.period={step}", method=method, step=step, more=isolate)
    outcome, times, others, own, counter = recorded(network, tmp_path, engine)
    assert outcome.status == "completed" and times[-1] == pytest.approx(2.8)
    assert others == pytest.approx(integral(times), rel=1e-13, abs=1e-13)
    assert own == pytest.approx(integral(times), rel=1e-13, abs=1e-13)
    assert np.array_equal(counter, 1 + np.floor(times / PERIOD + 1e-9))


@pytest.mark.parametrize("kind", ["forgets", "silent"])
@pytest.mark.parametrize("step", [0.4, 2.8])
def test_one_that_cannot_go_back(diagram, tmp_path, kind, step):
    """One that tells its next event has all come there; one that does not handles its events alone.

    Its own states are right then too; the others see the counter from the next communication point on.
    """
    network = diagram((3, kind), f"record.period={step}", step=step)
    outcome, times, others, own, counter = recorded(network, tmp_path)
    assert outcome.status == "completed"
    assert own == pytest.approx(integral(times), rel=1e-13, abs=1e-13)
    assert np.array_equal(counter, 1 + np.floor(times / PERIOD + 1e-9))
    if kind == "forgets":
        assert others == pytest.approx(integral(times), rel=1e-13, abs=1e-13)
    else:
        assert abs(others[-1] - integral(times)[-1]) > 0.1


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize(
    ("kind", "method"),
    [((3, "returns"), method) for method in METHODS] + [((3, "plain"), "iterated"), ((2, "plain"), "iterated")],
)
def test_an_end_within_a_step_is_reached(diagram, tmp_path, kind, method, engine):
    """Who counts to 3 ends the run at 1.4 s, between two points, where steps can be done anew."""
    outcome, times, others, own, counter = recorded(diagram(kind, method=method, last=3), tmp_path, engine)
    assert (outcome.status, outcome.steps) == ("completed", 4)
    assert outcome.time == pytest.approx(1.4) and "ended the simulation at t = 1.4 s" in outcome.reason
    assert times == pytest.approx([0, 0.8, 1.4])
    assert own[:-1] == pytest.approx(integral(times[:-1]), abs=1e-12) and own[-1] == pytest.approx(2.1, abs=1e-12)
    assert counter[-1] == 3
    if kind[1] == "returns":
        assert others[-1] == pytest.approx(2.1, abs=1e-12)


def test_one_of_two_kinds_at_once(stairs, tmp_path):
    """Early returns, time events of Model Exchange and an end, of three FMUs at times of their own."""
    exchange = stair.build(tmp_path / "me", 3, 1, "me")
    text = f"""
run: {{stop: 3, step: 0.5, integrator: heun}}
blocks:
  one: {{fmu: {stairs[3, "returns"]}, parameters: {{period: 0.7}}}}
  two: {{fmu: {exchange}, parameters: {{period: 0.3}}}}
  three: {{fmu: {stairs[3, "returns"]}, parameters: {{period: 1.1, last: 3}}}}
  sum: {{python: {PARTNERS}:Sum, inputs: {{u: one.y}}}}
  also: {{python: {PARTNERS}:Sum, inputs: {{u: two.y}}}}
record: {{signals: [sum.x, also.x, one.counter, two.counter, three.counter]}}
"""
    (tmp_path / "d.yaml").write_text(text)
    outcome = Run(run.load(tmp_path / "d.yaml"), output=tmp_path / "d.nc").execute()
    assert outcome.status == "completed" and "block three" in outcome.reason
    with result_file.open_result(tmp_path / "d.nc") as result:
        assert result.times == pytest.approx([0, 0.5, 1, 1.5, 2, 2.2])
        for name, period in (("one", 0.7), ("two", 0.3)):
            assert np.array_equal(result[f"{name}.counter"], 1 + np.floor(result.times / period + 1e-9))
        assert result["sum.x"] == pytest.approx(integral(result.times), abs=1e-12)
        assert result["three.counter"].tolist() == [1, 1, 1, 2, 2, 3]


def test_steps_of_one_size_do_not_end_at_events_of_others(stairs, tmp_path):
    """An FMU that takes steps of one size only is told of before the run, where another needs steps to end anywhere."""
    exchange = stair.build(tmp_path / "me", 3, 1, "me")
    text = f"""
run: {{stop: 3, step: 0.5}}
blocks:
  one: {{fmu: {stairs[3, "rigid"]}}}
  two: {{fmu: {exchange}, parameters: {{period: 0.7}}}}
"""
    (tmp_path / "d.yaml").write_text(text)
    outcome = Run(run.load(tmp_path / "d.yaml")).execute()
    assert outcome.status == "failed" and "block one: this FMU takes steps of one size only" in outcome.error.message
    assert "t = 0.7 s" in outcome.error.message and "run.step" in outcome.error.fix
    (tmp_path / "d.yaml").write_text(text.replace("0.7", "1.5"))
    assert Run(run.load(tmp_path / "d.yaml")).execute().status == "completed"
    (tmp_path / "d.yaml").write_text(text + "  ball: {python: ball.py:Ball}\n")
    with pytest.raises((FmuError, DiagramErrors), match="one size only"):
        (tmp_path / "ball.py").write_text(
            "from cosim import Block, Indicator\n\n\nclass Ball(Block):\n    z = Indicator()\n\n"
            "    def indicators(time, z):\n        z[0] = time - 1.0\n\n    def event(z):\n        pass\n"
        )
        Run(run.load(tmp_path / "d.yaml")).execute()


@pytest.mark.parametrize("kind", [(3, "returns"), "exchange"])
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("method", METHODS)
def test_nothing_is_extrapolated_across_an_event_at_a_communication_point(stairs, tmp_path, method, order, kind):
    """Every second communication point has an event, where y jumps; between them it is constant."""
    fmu = stairs[kind] if kind in stairs else stair.build(tmp_path / "me", 3, 1, "me", stair.KEEPING[3])
    text = f"""
run: {{stop: 2.8, step: 0.35, method: {method}, extrapolation: {order}, integrator: rk4}}
blocks:
  plant: {{fmu: {fmu}, parameters: {{period: 0.7}}}}
  sum: {{python: {PARTNERS}:Sum, inputs: {{u: plant.y}}}}
record: {{signals: [sum.x, plant.x]}}
"""
    (tmp_path / "d.yaml").write_text(text)
    outcome = Run(run.load(tmp_path / "d.yaml"), output=tmp_path / "d.nc").execute()
    assert outcome.status == "completed", outcome.error
    with result_file.open_result(tmp_path / "d.nc") as result:
        assert result["sum.x"] == pytest.approx(integral(result.times), abs=1e-12)
        assert result["plant.x"] == pytest.approx(integral(result.times), abs=1e-12)
