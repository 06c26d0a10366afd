"""A run by hand: the bits of a whole run at every point, inputs that count from when they are given, and a way back."""

from __future__ import annotations

import math

import numpy as np
import pytest

import cosim
from cosim.errors import Diverged, NotWirable, UnknownBlock, UsageError, WrongShape, WrongValue


@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel", "iterated", "joint"])
@pytest.mark.parametrize("engine", ["native", "python"])
def test_every_step_is_that_of_a_whole_run(folder, method, engine):
    diagram = cosim.load("lags.yaml").set({"run.method": method, "record.period": 0.01})
    run = diagram.run()
    with diagram.start(engine) as sim:
        for k in range(101):
            assert sim.time == run.times[k]
            assert all(sim[name].tobytes() == run[name][k].tobytes() for name in run)
            if not sim.done:
                sim.step()
        assert sim.done
        with pytest.raises(UsageError, match="the run is over at 1 s"):
            sim.step()
    assert sim["first.x"].tobytes() == run["first.x"][-1].tobytes()


def test_nothing_is_changed_by_looking_or_by_the_number_of_steps(folder):
    diagram = cosim.load("lags.yaml").set({"run.coupling_tolerance": 1e-4, "run.integrator": "rk4"})
    last = diagram.run().metrics["last"]
    for stride in (1, 7, 100, 1000):
        with diagram.start() as sim:
            while not sim.done:
                sim.step(stride)
        assert sim["second.x"] == last


def test_an_input_counts_from_when_it_is_given(folder):
    """x' = (u - x)/T by Euler's method, in closed form on both sides of the jump; y = u + x follows at once."""
    with cosim.load("lags.yaml").start() as sim:
        sim.step(30)
        before = sim["first.x"]
        assert before == pytest.approx(1 - 0.99**30, rel=1e-12)
        sim["first.u"] = 3
        assert sim["first.u"] == 3.0 and sim["first.x"] == before and sim["first.y"] == 3.0 + before
        assert sim["second.y"] == sim["first.y"] + sim["second.x"]
        assert sim.step(20) == 0.5
        assert sim["first.x"] == pytest.approx(3 - (3 - before) * 0.99**20, rel=1e-12)


def test_given_once_or_at_every_step_is_the_same(folder):
    diagram = cosim.load("lags.yaml").set({"run.integrator": "rk4"})
    with diagram.start() as sim:
        while not sim.done:
            sim["first.u"] = 1.0
            sim.step()
    assert sim["second.x"] == diagram.run().metrics["last"]


def test_saved_and_restored_it_goes_on_to_the_same_bits(folder):
    diagram = cosim.load("lags.yaml")
    with diagram.start() as sim:
        sim.step(40)
        state = sim.save()
        sim["first.u"] = -5.0
        sim.step(60)
        other = sim["second.x"]
        sim.restore(state)
        assert sim.time == state.time == 0.4 and not sim.done
        assert sim["first.u"] == 1.0
        sim.step(60)
        assert sim["second.x"] == diagram.run().metrics["last"] != other


def test_what_is_sampled_goes_on_from_a_point_at_which_it_is_due(folder):
    """Whether a clock is due is part of what is saved: the delay is so at 0.4 s, and is not at 0.5 s."""
    delay = {"block": "UnitDelay", "period": 0.2, "inputs": {"u": "first.x"}}
    diagram = cosim.load("lags.yaml").set({"run.step": 0.1, "blocks.delay": delay, "record.signals": ["delay.y"]})
    whole = diagram.run()
    with diagram.start() as sim:
        sim.step(4)
        state = sim.save()
        sim.step()
        sim.restore(state)
        sim.step(2)
        assert sim["delay.y"].tobytes() == whole["delay.y"][6].tobytes()


def test_members_of_a_fleet(folder):
    fleet = cosim.load("lags.yaml").set(
        {"fleets": {"cart": 3}, "blocks.first.per": "cart", "blocks.second.per": "cart"}
    )
    with fleet.start() as sim:
        with pytest.raises(WrongShape, match="one for all members"):
            sim["first.u"] = [1, 2, 3]
        sim["first.u"] = 2
        assert sim["first.y"].tolist() == [2, 2, 2]
    with fleet.set({"blocks.first.start.u": [1, 1, 1.5]}).start() as sim:
        sim["first.u"] = [1, 2, 3]
        assert sim["first.y"].tolist() == [1, 2, 3]
        with pytest.raises(WrongShape):
            sim["first.u"] = [1, 2]


def test_what_cannot_be_given_is_refused(folder):
    diagram = cosim.load("lags.yaml")
    with diagram.start() as sim:
        for name, value, error, said in (
            ("first.x", 1, NotWirable, "is computed"),
            ("second.u", 1, NotWirable, "is wired to first.y"),
            ("third.u", 1, UnknownBlock, "no block `third`"),
            ("first.u", math.nan, WrongValue, "finite"),
            ("first.u", "1", WrongValue, "takes float64 numbers"),
            ("first.u", 1j, WrongValue, "takes float64 numbers"),
            ("first.u", [1, 2], WrongShape, "shape"),
        ):
            with pytest.raises(error, match=said):
                sim[name] = value
        with pytest.raises(WrongValue, match="cannot go 0 steps"):
            sim.step(0)
        with pytest.raises(NotWirable):
            sim["second.u"]
    with pytest.raises(UsageError, match="not open"):
        sim.step()
    with pytest.raises(UsageError, match="begun before"), sim:
        pass
    with diagram.set({"blocks.first.period": 0.1}).start() as sim, pytest.raises(NotWirable, match="sampled"):
        sim["first.u"] = 2


def test_a_failure_ends_it(folder):
    with cosim.load("lags.yaml").set({"blocks.first.T": -1e-3}).start() as sim:
        with pytest.raises(Diverged):
            sim.step(1000)
        with pytest.raises(UsageError):
            sim.step()


def test_fmus_are_stepped_and_looked_at(folder):
    diagram = cosim.load("lags.yaml")
    cosim.export_fmu(diagram.network, ["second"], folder / "second.fmu")
    fmu = diagram.swap(second="second.fmu").set({"record.period": 0.01})
    run = fmu.run()
    with fmu.start() as sim:
        for k in range(101):
            assert sim["second.x"].tobytes() == run["second.x"][k].tobytes()
            assert k == 100 or sim.step() > 0
        with pytest.raises(NotWirable, match="is an FMU"):
            sim["first.u"] = 1
    with fmu.start() as sim:
        sim.step(50)
        state = sim.save()
        sim.step(50)
        end = sim["second.x"]
        sim.restore(state)
        sim.step(50)
        assert sim["second.x"] == end == run.metrics["last"]
    assert np.isfinite(end)
