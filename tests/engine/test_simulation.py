"""The loop against exact solutions and against itself: methods, integrators, engines, rates."""

import math

import numpy as np
import pytest

from cosim.engine import compilation, program
from cosim.engine.simulation import Simulation
from cosim.errors import BlockFailed, Diverged
from cosim.wiring.network import Signal

LOOP = """
run: {stop: 1, step: 0.01}
fleets: {robot: 3}
blocks:
  source: {type: Sine, per: robot, parameters: {f: [1, 2, 3]}}
  lag: {type: Lag, per: robot, parameters: {T: "0.1 * i"}, inputs: {u: source.y}, start: {x: [0.5, "i"]}}
  filter: {type: Lag, per: robot, inputs: {u: lag.y}}
  average: {type: Average, inputs: {u: filter.x}}
  counter: {type: Counter, per: robot, period: 0.03, inputs: {u: average.mean}, dimensions: {}}
"""
LOOP = LOOP.replace("inputs: {u: average.mean}, dimensions: {}", "inputs: {u: delay.y}") + (
    "  delay: {type: Table, inputs: {u: probe.x}}\n  probe: {type: Oscillator}\n"
)
SIGNALS = ("lag.x", "lag.y", "filter.x", "filter.large", "average.mean", "average.number", "counter.held", "probe.x")
METHODS = ("jacobi", "gauss-seidel", "joint")


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("settings", [(), ("run.integrator=rk4", "run.inner_steps=2")], ids=["euler", "rk4"])
def test_compiled_and_interpreted_agree_bit_for_bit(wired, trajectories, method, settings):
    network = wired(LOOP, *settings)
    compiled = trajectories(network, *SIGNALS, method=method)
    interpreted = trajectories(network, *SIGNALS, method=method, engine="python")
    for name in SIGNALS:
        assert compiled[name].tobytes() == interpreted[name].tobytes(), name
    assert np.abs(compiled["filter.x"]).max() > 0.1


def test_jacobi_with_one_euler_step_is_joint_euler_bit_for_bit(wired, trajectories):
    network = wired(LOOP)
    jacobi, joint = (trajectories(network, *SIGNALS, method=m) for m in ("jacobi", "joint"))
    assert all(jacobi[name].tobytes() == joint[name].tobytes() for name in SIGNALS)


def errors(wired, trajectories, integrator, *settings):
    """Largest error of an oscillator for a step and for half of it."""
    found = []
    for step in (0.02, 0.01):
        text = f"run: {{stop: 2, step: {step}, integrator: {integrator}}}\nblocks:\n  o: {{type: Oscillator}}\n"
        x = trajectories(wired(text, *settings), "o.x")["o.x"]
        t = np.arange(len(x)) * step
        found.append(np.abs(x - np.cos(2 * t)).max())
    return found


@pytest.mark.parametrize(("integrator", "order"), [("euler", 1), ("rk4", 4)])
def test_the_error_falls_with_the_order_of_the_integrator(wired, trajectories, integrator, order):
    coarse, fine = errors(wired, trajectories, integrator)
    assert math.log2(coarse / fine) == pytest.approx(order, abs=0.1)


def test_inner_steps_are_steps(wired, trajectories):
    """An autonomous block with 4 inner steps of 0.04 is the same block with steps of 0.01."""
    fine = "run: {stop: 1, step: 0.01}\nblocks:\n  o: {type: Oscillator}\n"
    coarse = "run: {stop: 1, step: 0.04, inner_steps: 4}\nblocks:\n  o: {type: Oscillator}\n"
    assert trajectories(wired(coarse), "o.x")["o.x"].tobytes() == trajectories(wired(fine), "o.x")["o.x"][::4].tobytes()


def test_joint_rk4_couples_blocks_within_the_step(wired, trajectories):
    """Two integrators in a ring are an oscillator: joint RK4 has its order, Jacobi holds inputs: first order."""
    text = """
    run: {{stop: 2, step: {step}, integrator: rk4}}
    blocks:
      x: {{type: Integrator, inputs: {{u: v.x}}, start: {{x: 1}}, dimensions: {{n: 1}}}}
      v: {{type: Integrator, inputs: {{u: minus.y}}}}
      minus: {{type: Gain, parameters: {{k: -4}}, inputs: {{u: x.x}}}}
    """
    for method, order in (("joint", 4), ("jacobi", 1)):
        found = []
        for step in (0.02, 0.01):
            x = trajectories(wired(text.format(step=step)), "x.x", method=method)["x.x"][:, 0]
            found.append(np.abs(x - np.cos(2 * np.arange(len(x)) * step)).max())
        assert math.log2(found[0] / found[1]) == pytest.approx(order, abs=0.15), method


RING = """
run: {{stop: 10, step: 0.1, method: gauss-seidel}}
blocks:
{blocks}
"""
IN_RING = {
    "x": "  x: {type: Integrator, inputs: {u: v.x}, start: {x: 1}, dimensions: {n: 1}}",
    "minus": "  minus: {type: Gain, parameters: {k: -4}, inputs: {u: x.x}}",
    "v": "  v: {type: Integrator, inputs: {u: minus.y}}",
}


@pytest.mark.parametrize("names", [("x", "minus", "v"), ("x", "v", "minus"), ("minus", "x", "v")], ids="-".join)
def test_gauss_seidel_is_the_symplectic_euler_method_for_an_oscillator(wired, trajectories, names):
    """x steps on the old v, v on the gain of the new x, wherever the gain stands in the diagram."""
    got = trajectories(wired(RING.format(blocks="\n".join(IN_RING[n] for n in names))), "x.x", "v.x")
    x, v, h = 1.0, 0.0, 0.1
    for k in range(101):
        assert (got["x.x"][k, 0], got["v.x"][k, 0]) == (x, v), k
        x = x + h * v
        v = v + h * (-4.0 * x)
    energy = 0.5 * got["v.x"][-1, 0] ** 2 + 2.0 * got["x.x"][-1, 0] ** 2
    assert energy < 2.0 / (1.0 - 0.1)  # bounded for ever by 1 / (1 - h); explicit Euler's grows as (1 + 4 h²)^k


def test_gauss_seidel_knows_a_block_named_time_from_the_time(wired, trajectories):
    """A, `time`, the gain anew, B: whatever the second one is called."""
    text = """
    run: {{stop: 1, step: 0.1, method: gauss-seidel}}
    blocks:
      a: {{type: Integrator, inputs: {{u: p.y}}, start: {{x: 1}}, dimensions: {{n: 1}}}}
      {name}: {{type: Integrator, inputs: {{u: a.x}}, start: {{x: 1}}}}
      p: {{type: Gain, parameters: {{k: 2}}, inputs: {{u: {name}.x}}}}
      b: {{type: Integrator, inputs: {{u: p.y}}, start: {{x: 1}}}}
    """
    for name in ("time", "other"):
        got = trajectories(wired(text.format(name=name)), "b.x")["b.x"][:, 0]
        a = second = b = 1.0
        for k in range(11):
            assert got[k] == pytest.approx(b, rel=1e-14), (name, k)
            a += 0.1 * 2.0 * second
            second += 0.1 * a
            b += 0.1 * 2.0 * second


def test_a_sampled_block_changes_at_its_samples_and_holds_between(wired, trajectories):
    text = """
    run: {stop: 1, step: 0.01}
    blocks:
      o: {type: Oscillator}
      counter: {type: Counter, period: 0.05, inputs: {u: o.x}}
    """
    got = trajectories(wired(text), "o.x", "counter.count", "counter.held")
    k = np.arange(101)
    assert (got["counter.count"] == k // 5).all()
    before = np.maximum((k // 5 - 1) * 5, 0)
    assert (got["counter.held"][5:] == got["o.x"][before][5:]).all()
    assert (got["counter.held"][:5] == 0).all()


def test_start_values_given_win_and_calculated_parameters_follow(wired, trajectories):
    got = trajectories(wired(LOOP), "lag.x", "lag.rate")
    assert got["lag.x"][0].tolist() == [[0.5, 1.0], [0.5, 2.0], [0.5, 3.0]]
    assert got["lag.rate"][0] == pytest.approx([10.0, 5.0, 10 / 3])


def test_sources_are_joined_along_a_fleet(wired, trajectories):
    text = """
    run: {stop: 1, step: 0.01}
    fleets: {robot: 3, most: 2}
    blocks:
      first: {type: Sine, per: most}
      last: {type: Sine, parameters: {A: 7}}
      gain: {type: Gain, per: robot, parameters: {k: "i"}, inputs: {u: [first.y, last.y]}}
      average: {type: Average, inputs: {u: [first.y, last.y]}}
    """
    got = trajectories(wired(text), "gain.y", "average.mean")
    sine = np.sin(np.arange(101) * 0.01)
    expected = sine[:, None, None] * np.array([[1, 2], [4, 8], [21, 42]])
    assert np.abs(got["gain.y"] - expected).max() < 1e-14
    assert np.abs(got["average.mean"][:, 0] - sine * 10 / 3).max() < 1e-14


def test_a_wire_may_take_some_members(wired, trajectories):
    """Members count from 1; those of a fleet, of a network block's output, and a single one without the axis."""
    text = """
    run: {stop: 0.1, step: 0.01}
    fleets: {robot: 5, few: 2}
    blocks:
      all: {type: Sine, per: robot}
      few: {type: Gain, per: few, inputs: {u: "all.y[3..4]"}}
      one: {type: Gain, inputs: {u: "all.y[5]"}}
      swapped: {type: Average, inputs: {u: ["all.y[4..5]", "all.y[1..2]", "all.y[3]"]}}
      average: {type: Average, inputs: {u: all.y}}
      numbers: {type: Numbers, inputs: {k: ["average.number[5]", "average.number[1..3]"]}}
    """
    got = trajectories(wired(text), "all.y", "few.y", "one.y", "swapped.memory", "numbers.y")
    assert (got["few.y"] == got["all.y"][:, 2:4]).all() and (got["one.y"] == got["all.y"][:, 4]).all()
    assert (got["swapped.memory"][:, :, 0] == got["all.y"][:, [3, 4, 0, 1, 2], 0]).all()
    assert (got["numbers.y"] == [5, 1, 2, 3]).all() and got["one.y"][-1, 0] > 0.4


def test_a_failing_block_is_named_with_time_and_cause(wired):
    text = """
    run: {stop: 3, step: 0.01}
    blocks:
      source: {type: Sine, parameters: {A: 1}}
      picky: {type: Picky, inputs: {u: source.y}}
    """
    network = wired(text)
    built = program.build(network, "jacobi")
    for kernels in (compilation.compile_program(built), None):
        one = Simulation(built, kernels)
        one.initialize()
        with pytest.raises(BlockFailed, match=r"block picky: outputs\(\) failed at t = 0.26 s: ValueError: input too"):
            for _ in one.batches():
                pass
        assert one.done == 26  # 2 sin(0.26) is the first above 0.5


def test_a_diverged_state_is_named_with_the_time(wired):
    text = """
    run: {stop: 3, step: 0.01}
    fleets: {robot: 2}
    blocks:
      fine: {type: Oscillator}
      bang: {type: Explosive, per: robot, start: {x: [0.1, 1]}}
    """
    built = program.build(wired(text), "jacobi")
    one = Simulation(built, compilation.compile_program(built))
    one.initialize()
    with pytest.raises(Diverged, match=r"block bang: state `x` of robot 2 is .*, beyond 9e\+99 at t = 1\.\d+ s"):
        for _ in one.batches():
            pass
    assert np.isfinite(one.value(Signal("fine", "x"))).all()


@pytest.mark.parametrize("engine", ["native", "python"])
def test_a_value_that_a_fleet_shares_is_recorded_for_each_member(wired, trajectories, engine):
    """One number, or one array, in memory; and what follows it there is another's."""
    text = """
    run: {stop: 1, step: 0.5}
    fleets: {robot: 3}
    blocks:
      source: {type: Sine, per: robot, parameters: {f: 2}}
      last: {type: Sine, per: robot, parameters: {f: 5}}
    """
    network = wired(text)
    got = trajectories(network, "source.f", "last.f", engine=engine)
    assert got["source.f"].tolist() == [[2.0] * 3] * 3 and got["last.f"].tolist() == [[5.0] * 3] * 3
    one = Simulation(program.build(network, "jacobi"), None)
    assert one.value(network.find("source.f", None)).tolist() == [2.0] * 3


def test_runs_of_one_table_do_not_share_memory(wired):
    built = program.build(wired("run: {stop: 1, step: 0.1}\nblocks:\n  o: {type: Oscillator}\n"), "jacobi")
    kernels = compilation.compile_program(built)
    runs = [Simulation(built, kernels) for _ in range(2)]
    for one in runs:
        one.initialize()
    list(runs[0].batches())
    assert runs[0].done == 10 and runs[1].done == 0
    assert runs[1].value(Signal("o", "x")) == 1.0
