"""The loop calls FMUs: the same bits as native blocks, events, feedthrough, fleets, both engines, every method."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.engine import run
from cosim.errors import FmuError
from cosim.wiring import order

PLANT = """
title: machine
run: {{stop: 2, step: 1.0e-3, method: {method}, integrator: {integrator}}}
blocks:
  source: {{type: Source}}
  twin: {{type: Lag, inputs: {{u: source.u}}, parameters: {{T: 0.3}}, start: {{x: 0.25}}}}
  plant:
    fmu: {fmu}
    mode: {mode}
    inputs: {{u: source.u, n: source.n, on: source.on}}
    parameters: {{T: 0.3}}
    start: {{x: 0.25}}
"""
EVERY = [("2", "co-simulation"), ("3", "co-simulation"), ("3e", "co-simulation")]
EVERY += [("2", "model-exchange"), ("3", "model-exchange")]
DIRECT = EVERY[2:]


@pytest.fixture
def plant(machines, partners):
    """Wire the plant of a kind beside its native twin."""

    def wire(kind: str, mode: str, method: str = "jacobi", integrator: str = "euler", *settings: str):
        text = PLANT.format(fmu=machines[kind], mode=mode, method=method, integrator=integrator)
        return run.load(partners(text), settings)

    return wire


@pytest.mark.parametrize(("kind", "mode"), EVERY)
def test_states_have_the_bits_of_the_native_twin(plant, trajectories, kind, mode):
    got = trajectories(plant(kind, mode), "twin.x", "plant.x")
    assert np.array_equal(got["twin.x"], got["plant.x"])
    assert got["plant.x"][0] == 0.25
    assert np.ptp(got["plant.x"]) > 0.5


@pytest.mark.parametrize(("kind", "mode"), DIRECT)
def test_feedthrough_has_no_delay_where_the_standard_allows_it(plant, trajectories, kind, mode):
    got = trajectories(plant(kind, mode), "twin.y", "plant.y")
    assert np.array_equal(got["twin.y"], got["plant.y"])


@pytest.mark.parametrize("kind", ["2", "3"])
def test_plain_cosimulation_delays_feedthrough_by_one_step(plant, trajectories, kind):
    network = plant(kind, "co-simulation")
    got = trajectories(network, "source.u", "plant.x", "plant.y")
    assert np.array_equal(got["plant.y"][1:], 2 * got["source.u"][:-1] + got["plant.x"][1:])
    assert got["plant.y"][0] == 2 * got["source.u"][0] + got["plant.x"][0]  # Initialization Mode knows the inputs


def test_the_delay_is_a_finding(plant):
    from cosim.wiring import conditions

    findings = {
        f.component: f.numbers for f in conditions.conditions(plant("2", "co-simulation")) if "one step" in f.numbers
    }
    assert findings == {"plant": "y on u; m on n; off on on: one step of delay"}
    for kind, mode in DIRECT:
        assert not [f for f in conditions.conditions(plant(kind, mode)) if "one step" in f.numbers]


@pytest.mark.parametrize(("kind", "mode"), DIRECT[1:])
def test_rk4_of_model_exchange_has_the_bits_of_the_native_twin(plant, trajectories, kind, mode):
    network = plant(kind, mode, "jacobi", "rk4", "run.inner_steps=2")
    got = trajectories(network, "twin.x", "plant.x")
    assert np.array_equal(got["twin.x"], got["plant.x"])


@pytest.mark.parametrize("method", ["gauss-seidel", "joint"])
@pytest.mark.parametrize(("kind", "mode"), DIRECT[1:])
def test_model_exchange_goes_with_every_method(plant, trajectories, kind, mode, method):
    got = trajectories(plant(kind, mode, method), "twin.x", "plant.x", "twin.y", "plant.y")
    assert np.array_equal(got["twin.x"], got["plant.x"])
    assert np.array_equal(got["twin.y"], got["plant.y"])


@pytest.mark.parametrize(("kind", "mode"), EVERY[:3])
def test_cosimulation_goes_with_gauss_seidel_and_is_refused_jointly(plant, trajectories, kind, mode):
    got = trajectories(plant(kind, mode, "gauss-seidel"), "twin.x", "plant.x")
    assert np.array_equal(got["twin.x"], got["plant.x"])
    with pytest.raises(FmuError, match="plant: a co-simulation FMU steps by itself"):
        trajectories(plant(kind, mode, "joint"), "plant.x")


def bounced(steps: int, h: float) -> dict[str, np.ndarray]:
    """The ball by explicit Euler, each bounce at the end of the step in which it falls through the floor."""
    rows = [(1.0, 0.0, 0)]
    for _ in range(steps):
        height, speed, count = rows[-1]
        height, speed = height + h * speed, speed + h * -9.81
        if height <= 0 and speed < 0:
            height, speed, count = 0.0, speed * -0.7, count + 1
        rows.append((height, speed, count))
    height, speed, count = (np.array(column) for column in zip(*rows, strict=True))
    return {"plant.h": height, "plant.v": speed, "plant.bounces": count}


@pytest.mark.parametrize(("kind", "mode"), EVERY)
def test_events_are_handled_at_the_end_of_their_step(plant, trajectories, kind, mode):
    expected = bounced(2000, 1e-3)
    got = trajectories(plant(kind, mode), *expected, "plant.ticks")
    assert expected["plant.bounces"][-1] >= 2
    for name in ("plant.h", "plant.bounces", "plant.v"):
        assert np.array_equal(got[name], expected[name]), name
    time = 1e-3 * np.arange(2001)
    assert np.array_equal(got["plant.ticks"], np.floor((time + 1e-9) / 0.25))


@pytest.mark.parametrize(("kind", "mode"), DIRECT)
def test_discrete_inputs_and_truths_arrive_at_once(plant, trajectories, kind, mode):
    got = trajectories(plant(kind, mode), "source.n", "source.on", "plant.m", "plant.off")
    assert np.array_equal(got["plant.m"], got["source.n"] + 1)
    assert np.array_equal(got["plant.off"], ~got["source.on"])
    assert got["plant.off"].dtype == bool


@pytest.mark.parametrize("mode", ["co-simulation", "model-exchange"])
def test_arrays_singles_and_bytes_of_fmi3(machines, partners, trajectories, mode):
    kind = "3e" if mode == "co-simulation" else "3"
    network = run.load(
        partners(f"""
        run: {{stop: 0.5, step: 0.01}}
        blocks:
          grid: {{type: Grid}}
          plant:
            fmu: {machines[kind]}
            mode: {mode}
            inputs: {{array: grid.array, short: grid.short, byte: grid.byte}}
        """)
    )
    got = trajectories(
        network, "grid.array", "grid.short", "grid.byte", "plant.twice", "plant.short_next", "plant.byte_next"
    )
    assert got["plant.twice"].shape == (51, 2, 3)
    assert np.array_equal(got["plant.twice"], 2 * got["grid.array"])
    assert np.array_equal(got["plant.short_next"], got["grid.short"] + np.float32(1))
    assert np.array_equal(got["plant.byte_next"], got["grid.byte"] + 1)


FLEET = """
run: {{stop: 1, step: 0.01}}
fleets: {{robot: 3}}
blocks:
  source: {{type: Source, per: robot, parameters: {{A: i}}}}
  twin: {{type: Lag, per: robot, inputs: {{u: source.u}}, parameters: {{T: [0.2, 0.4, 0.8]}}, start: {{x: i}}}}
  plant:
    fmu: {fmu}
    mode: {mode}
    per: robot
    inputs: {{u: source.u}}
    parameters: {{T: [0.2, 0.4, 0.8], name: [a, b, c]}}
    start: {{x: i, h: [1, 2, 3]}}
"""


@pytest.mark.parametrize(("kind", "mode"), EVERY)
def test_each_member_of_a_fleet_has_its_instance_and_parameters(machines, partners, trajectories, kind, mode):
    network = run.load(partners(FLEET.format(fmu=machines[kind], mode=mode)))
    got = trajectories(network, "twin.x", "plant.x", "plant.h", "plant.v")
    assert got["plant.x"].shape == (101, 3)
    assert np.array_equal(got["twin.x"], got["plant.x"])
    assert np.array_equal(got["plant.h"][0], [1, 2, 3])


@pytest.mark.parametrize(("kind", "mode"), EVERY)
def test_both_engines_give_the_same_bits(machines, partners, trajectories, kind, mode):
    network = run.load(partners(FLEET.format(fmu=machines[kind], mode=mode)), ["run.stop=0.6"])
    names = ("plant.x", "plant.y", "plant.h", "plant.v", "plant.bounces")
    native = trajectories(network, *names)
    python = trajectories(network, *names, engine="python")
    for name in names:
        assert np.array_equal(native[name], python[name]), name


@pytest.mark.parametrize(("kind", "mode"), EVERY)
def test_a_mixed_fleet_is_joined(machines, partners, trajectories, kind, mode):
    network = run.load(
        partners(f"""
        run: {{stop: 1, step: 0.01}}
        fleets: {{five: 5, six: 6}}
        blocks:
          source: {{type: Source}}
          native: {{type: Lag, per: five, inputs: {{u: source.u}}, parameters: {{T: "i/8"}}}}
          other: {{fmu: {machines[kind]}, mode: {mode}, inputs: {{u: source.u}}, parameters: {{T: 0.75}}}}
          all: {{type: Lag, per: six, inputs: {{u: source.u}}, parameters: {{T: "i/8"}}}}
          follower: {{type: Follower, inputs: {{u: [native.x, other.x]}}}}
          reference: {{type: Follower, inputs: {{u: all.x}}}}
        """)
    )
    got = trajectories(network, "follower.x", "reference.x")
    assert got["follower.x"].shape == (101, 6)
    assert np.array_equal(got["follower.x"], got["reference.x"])


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("version", "23")
def test_feedthrough_of_an_fmu_closes_a_loop_that_is_solved(machines, partners, trajectories, version, engine):
    """At every step each output is what its own equation makes of the other."""
    text = """
        run: {{stop: 1, step: 0.01}}
        blocks:
          lag: {{type: Lag, inputs: {{u: plant.y}}, start: {{x: 1}}}}
          plant: {{fmu: {fmu}, mode: model-exchange, inputs: {{u: lag.y}}}}
        """
    network = run.load(partners(text.format(fmu=machines[version])))
    got = trajectories(network, "lag.y", "lag.x", "plant.y", "plant.x", engine=engine)
    lag_y, plant_y = got["lag.y"].ravel(), got["plant.y"].ravel()
    size = np.abs(plant_y) + np.abs(lag_y) + 1.0
    assert np.all(np.abs(plant_y - (2.0 * lag_y + got["plant.x"].ravel())) <= 1e-12 * size)
    assert np.all(np.abs(lag_y - (2.0 * plant_y + got["lag.x"].ravel())) <= 1e-12 * size)


def test_outputs_that_depend_on_no_input_break_a_loop(machines, partners, trajectories):
    network = run.load(
        partners(f"""
        run: {{stop: 1, step: 0.01}}
        blocks:
          lag: {{type: Lag, inputs: {{u: plant.x}}}}
          plant: {{fmu: {machines["2"]}, mode: model-exchange, inputs: {{u: lag.y}}, start: {{x: 1}}}}
        """)
    )
    tasks = [t.component for t in order.evaluation_order(network) if t.function == "outputs" or t.component == "plant"]
    assert tasks.index("lag") < len(tasks) - 1
    assert np.all(np.isfinite(trajectories(network, "lag.y")["lag.y"]))
