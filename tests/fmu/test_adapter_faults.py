"""What an FMU does wrong stops the run with its name, the time, the robot and its own words; the rest is kept."""

from __future__ import annotations

import re
import threading

import numpy as np
import pytest

from cosim.engine import run
from cosim.engine.run import Run
from cosim.errors import FmuFailed, TooManyInstances, WrongValue
from cosim.machine import supervision

DISCARD, ERROR, FATAL, NAN, EARLY, END, WARN, REFUSE = 1, 2, 3, 4, 5, 6, 7, 8
EARLY_AT_END = -1
STUCK = 11
CS = [("2", "co-simulation"), ("3", "co-simulation"), ("3e", "co-simulation")]
ME = [("2", "model-exchange"), ("3", "model-exchange")]


@pytest.fixture
def failing(machines, partners, tmp_path):
    """Run a machine that goes wrong at 0.5 s, and give the outcome and what was recorded."""

    def outcome(kind: str, mode: str, fault: int, engine: str = "native", more: str = ""):
        text = f"""
            run: {{stop: 1, step: 0.01}}
            fleets: {{robot: 2}}
            blocks:
              source: {{type: Source}}
              plant:
                fmu: {machines[kind]}
                mode: {mode}
                per: robot
                inputs: {{u: source.u}}
                parameters: {{fault: [0, {fault}], fault_time: 0.5, name: [Ann, Bob]}}
            record: {{period: 0.01, signals: [plant.x]}}
            metrics: {{x: {{signal: plant.x, reduce: final}}}}
            """
        output = tmp_path / "result.nc"
        outcome = Run(run.load(partners(text)), engine, output).execute()
        import h5netcdf

        with h5netcdf.File(output) as file:
            return outcome, np.array(file["time"])

    return outcome


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize(("kind", "mode"), CS)
@pytest.mark.parametrize(
    ("fault", "word", "said"),
    [(DISCARD, "discard", "cannot do this step"), (ERROR, "error", "cannot go on"), (FATAL, "fatal", "all is lost")],
)
def test_a_failed_step_stops_the_run(failing, kind, mode, fault, word, said, engine):
    outcome, recorded = failing(kind, mode, fault, engine)
    assert isinstance(outcome.error, FmuFailed)
    text = str(outcome.error)
    assert f"block plant (machine{kind[0]}.fmu, robot 2) failed at t = 0.5 s" in text
    assert f"fmi{kind[0]}DoStep() returned `{word}`" in text
    assert f"it says {word}: {said} at 0.5" in text
    assert "(Bob)" in text
    assert (outcome.status, outcome.steps) == ("failed", 50)
    assert len(recorded) == 51


@pytest.mark.parametrize(("kind", "mode"), CS)
def test_an_output_that_is_not_finite_stops_the_run(failing, kind, mode):
    outcome, recorded = failing(kind, mode, NAN)
    assert "robot 2) failed at t = 0.5 s: it gave a value that is not finite: `x`" in str(outcome.error)
    assert (outcome.status, len(recorded)) == ("failed", 50)


@pytest.mark.parametrize(("kind", "mode"), ME)
def test_refused_states_stop_the_run(failing, kind, mode):
    outcome, recorded = failing(kind, mode, REFUSE)
    assert f"fmi{kind}SetContinuousStates() returned `discard`" in str(outcome.error)
    assert "it says discard: refuses these states at 0.5" in str(outcome.error)
    assert len(recorded) == 50


@pytest.mark.parametrize(("kind", "mode"), [*CS[1:], ME[0]])
def test_the_end_that_an_fmu_asks_for_is_the_end(failing, kind, mode):
    outcome, recorded = failing(kind, mode, END)
    assert (outcome.status, outcome.error) == ("completed", None)
    assert (outcome.steps, len(recorded)) == (50, 51)
    told = outcome.reason
    assert f"block plant (machine{kind[0]}.fmu, robot 2) ended the simulation at t = 0.5 s" in told


def test_a_step_without_progress_stops_the_run(failing):
    outcome, _ = failing("3e", "co-simulation", STUCK)
    assert "returned early from a step without any progress" in str(outcome.error)


@pytest.mark.parametrize(("kind", "mode"), [*CS, *ME[1:]])
def test_warnings_continue(failing, kind, mode):
    outcome, recorded = failing(kind, mode, WARN)
    assert (outcome.status, outcome.error, len(recorded)) == ("completed", None, 101)
    told = [w.message for w in outcome.warnings if "warning" in w.message]
    assert len(told) == 1
    calls = r"[1-9]\d* calls returned a warning, first at t = 0.(49|5) s; " if mode == "co-simulation" else ""
    assert re.search(rf"block plant \(machine{kind[0]}.fmu, robot 2\): {calls}[1-9]\d* warnings logged", told[0])
    assert re.search(r"it says first: just a warning at 0.\d+, in state \d \(Bob\)", told[0])


def test_a_step_that_returns_early_is_continued_to_its_end(machines, partners, trajectories):
    """Two halves of an Euler step: the lag with half the step."""
    network = run.load(
        partners(f"""
        run: {{stop: 1, step: 0.01}}
        blocks:
          twin: {{type: Lag, inputs: {{u: twin.x}}, start: {{x: 1}}}}
          plant: {{fmu: {machines["3e"]}, start: {{x: 1, u: 0}}, parameters: {{fault: {EARLY}}}}}
          still: {{fmu: {machines["3"]}, start: {{x: 1, u: 0}}}}
        """)
    )
    got = trajectories(network, "plant.x", "still.x")
    steps = np.arange(101)
    assert got["plant.x"] == pytest.approx((1 - 0.005) ** (2 * steps), rel=1e-12)
    assert got["still.x"] == pytest.approx((1 - 0.01) ** steps, rel=1e-12)


def test_an_early_return_at_the_very_end_of_a_step_is_its_end(machines, partners, trajectories):
    """Asked for a rest of no length, the FMU would refuse."""
    network = run.load(
        partners(f"""
        run: {{stop: 1, step: 0.01}}
        blocks:
          plant: {{fmu: {machines["3e"]}, start: {{x: 1, u: 0}}, parameters: {{fault: {EARLY_AT_END}}}}}
        """)
    )
    got = trajectories(network, "plant.x")
    assert got["plant.x"] == pytest.approx((1 - 0.01) ** np.arange(101), rel=1e-12)


SINGLE = """
run: {{stop: 1, step: 0.01}}
fleets: {{robot: 2}}
blocks:
  plant: {{fmu: {fmu}, {more}}}
"""


@pytest.fixture
def singles(tmp_path):
    from tests.fmu import machine

    return machine.build(tmp_path / "single", 2, "cs", 'canBeInstantiatedOnlyOncePerProcess="true"')


def test_one_instance_a_process_is_honoured_by_fleets(singles, partners):
    from cosim.errors import DiagramErrors

    with pytest.raises(DiagramErrors, match=r"2 instances, but one process may have 1 of .*\n.*isolate: true"):
        run.load(partners(SINGLE.format(fmu=singles, more="per: robot")))


def test_one_instance_a_process_is_honoured_by_blocks(singles, partners):
    text = SINGLE.format(fmu=singles, more="start: {x: 1}") + f"  other: {{fmu: {singles}, start: {{x: 1}}}}\n"
    outcome = Run(run.load(partners(text))).execute()
    assert isinstance(outcome.error, TooManyInstances)
    assert Run(run.load(partners(text), ["blocks.other.isolate=true"])).execute().status == "completed"


def test_instances_are_counted_while_they_live(singles, partners, monkeypatch):
    """Without processes of their own, one run may have the only instance; who asks in vain changes nothing."""
    monkeypatch.setattr(supervision, "AVAILABLE", False)
    network = run.load(partners(SINGLE.format(fmu=singles, more="start: {x: 1}")))
    first, second, third = Run(network), Run(network), Run(network)
    first.simulation.initialize()
    for _ in range(2):
        assert isinstance(Run(network).execute().error, TooManyInstances)
    first.simulation.close()
    first.simulation.close()
    second.simulation.initialize()
    first.simulation.close()
    assert isinstance(Run(network).execute().error, TooManyInstances)
    second.simulation.close()
    assert third.execute().status == "completed"


@pytest.mark.skipif(not supervision.AVAILABLE, reason="needs fork")
def test_each_run_has_a_process_of_its_own(singles, partners):
    network = run.load(partners(SINGLE.format(fmu=singles, more="start: {x: 1}")))
    first, second = Run(network), Run(network)
    first.simulation.initialize()
    assert second.execute().status == "completed"
    first.simulation.close()


def test_runs_on_threads_share_no_instance(machines, partners):
    path = partners(SINGLE.format(fmu=machines["2"], more="start: {x: 1}"))
    network = run.load(path, ["run.step=1e-5"])
    outcomes = []

    def one() -> None:
        made = Run(network)
        outcomes.append((made.execute().status, float(made.simulation.value(network.find("plant.x", None)))))

    threads = [threading.Thread(target=one) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(outcomes) == 4
    assert set(outcomes) == {outcomes[0]}
    assert outcomes[0][0] == "completed"


def test_a_start_value_that_the_fmu_calculates_is_refused(partners, tmp_path):
    from tests.fmu import machine

    def edit(xml: str) -> str:
        return re.sub(r'(name="v" [^>]*)initial="exact"><Real start="0"/>', r'\1initial="calculated"><Real/>', xml)

    path = machine.build(tmp_path / "calculated", 2, "me", edit=edit)
    outcome = Run(run.load(partners(SINGLE.format(fmu=path, more="start: {v: 1}")))).execute()
    assert isinstance(outcome.error, WrongValue)
    assert "calculates `v`" in str(outcome.error)


LATE = """from cosim import Block, Input, Output


class Late(Block{more}):
    x = Input()
    y = Output()

    def outputs(time, x, y):
        y[0] = x
        if time > 0.255:
            y[3] = x
"""


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("more", ["", ", compiled=False"])
def test_a_block_that_fails_beside_an_fmu_tells_why_from_its_process(machines, partners, tmp_path, engine, more):
    (tmp_path / "late.py").write_text(LATE.format(more=more))
    text = f"""
        run: {{stop: 1, step: 0.01}}
        blocks:
          plant: {{fmu: {machines["2"]}, mode: co-simulation}}
          late: {{python: late.py:Late, inputs: {{x: plant.x}}}}
        """
    outcome = Run(run.load(partners(text)), engine).execute()
    said = "block late: outputs() failed at t = 0.26 s: IndexError: index 3 is out of bounds for axis 0 of `y`, size 1"
    assert f"{said} (late.py:11)" in str(outcome.error)
