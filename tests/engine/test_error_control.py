"""Inner steps within a tolerance: what they keep, what they remember, how they end where nothing keeps it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cosim.engine import compilation, program, run
from cosim.engine.probes import Probes
from cosim.engine.simulation import Simulation
from cosim.errors import BlockFailed, DiagramErrors, TooLarge, WrongType, WrongValue
from cosim.integrators import INTEGRATORS, Integration
from cosim.master import integration, tables

ABLE = [name for name, method in INTEGRATORS.items() if method.estimates]
OWN = """
import math
from cosim import Block, Input, Output, Parameter, State

class Clock(Block):
    x = State(output=True)
    def derivatives(d_x):
        d_x[0] = 1.0

class Turn(Block):
    'dx/dt = 1 before t = 0.5 and -1 after it'
    x = State(output=True)
    def derivatives(time, d_x):
        d_x[0] = 1.0 if time < 0.5 else -1.0

class Pole(Block):
    'dx/dt = x^2 from 1: x = 1/(1 - t)'
    x = State(output=True, start=1.0)
    def derivatives(x, d_x):
        d_x[0] = x * x

class Decay(Block):
    rate = Parameter(default=1.0)
    x = State("n", output=True)
    def derivatives(rate, x, d_x):
        for q in range(x.size):
            d_x[q] = -rate * x[q]

class Log(Block):
    'its derivative is no number where x is below zero'
    x = State(output=True, start=1.0)
    def derivatives(x, d_x):
        d_x[0] = math.log(x) - 1.0
"""


@pytest.fixture
def load(tmp_path):
    """Wire a diagram of blocks of `OWN` (`own: Clock`) and of the library; `settings` as of --set."""

    def wired(blocks: str, settings: str, more: str = "", *sets: str):
        (tmp_path / "own.py").write_text(OWN)
        (tmp_path / "d.yaml").write_text(
            f"run: {{{settings}}}\n{more}blocks:\n{blocks}".replace("own: ", "python: own.py:")
        )
        return run.load(tmp_path / "d.yaml", sets)

    return wired


OSCILLATOR = (
    "run: {{stop: 10, step: {step}, method: {method}, integrator: {name}, tolerance: {tolerance}}}\n"
    "metrics:\n  x: {{signal: o.x, reduce: final}}\n  v: {{signal: o.v, reduce: final}}\n"
    "blocks:\n  o: {{type: Oscillator}}\n"
)


def oscillator(wired, name: str, tolerance: float, step: float = 2.0, method: str = "jacobi", engine: str = "native"):
    """The error of the oscillator's energy norm at 10 s, which nothing amplifies, and its inner steps."""
    network = wired(OSCILLATOR.format(step=step, method=method, name=name, tolerance=tolerance))
    outcome = run.Run(network, engine=engine).execute()
    x, v = outcome.metrics["x"], outcome.metrics["v"]
    return math.hypot(2.0 * (x - math.cos(20)), v + 2.0 * math.sin(20)), outcome.inner_steps["o"]


@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel", "joint"])
@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-9])
@pytest.mark.parametrize("name", ABLE)
def test_errors_add_up_to_no_more_than_is_tolerated_of_each_step(wired, name, tolerance, method):
    """Each step may add 1.001 times the tolerance to 2 x and to v, which is at most 2."""
    if INTEGRATORS[name].order < 3 and tolerance < 1e-6:
        pytest.skip("millions of steps")
    error, steps = oscillator(wired, name, tolerance, method=method)
    assert error <= steps["taken"] * 1.001 * tolerance * math.hypot(2.0, 2.0)


@pytest.mark.parametrize("name", ABLE)
def test_the_number_of_steps_goes_with_the_root_of_the_tolerance(wired, name):
    """Of something nonlinear that depends on the time: elsewhere, an estimate may be better than its order."""
    order = INTEGRATORS[name].order
    taken = []
    for tolerance in (1e-4, 1e-7):
        settings = f"{{stop: 60, step: 60, integrator: {name}, tolerance: {tolerance}}}"
        outcome = run.Run(wired(f"run: {settings}\nblocks:\n  o: {{type: Riccati}}\n")).execute()
        taken.append(outcome.inner_steps["o"]["taken"])
    assert math.log10(taken[1] / taken[0]) == pytest.approx(3 / order, rel=0.2)


@pytest.mark.parametrize("engine", ["native", "python"])
def test_the_last_inner_step_ends_at_the_communication_point(load, trajectories, engine):
    """A clock's derivative is 1, so that it shows the time that was integrated over."""
    network = load("  c: {own: Clock}\n", "stop: 7, step: 0.7, integrator: dormand-prince, tolerance: 1.0e-6")
    found = trajectories(network, "c.x", engine=engine)["c.x"]
    np.testing.assert_allclose(found, 0.7 * np.arange(11), rtol=1e-14)


def test_a_step_is_remembered_from_one_communication_step_to_the_next(wired):
    """With ten points within each step that the tolerance allows, every communication step is one inner step."""
    steps = oscillator(wired, "dormand-prince", 1e-4, step=0.01)[1]
    assert steps["rejected"] == 0 and 1000 <= steps["taken"] <= 1010


def test_the_next_step_follows_from_the_error():
    """h (0.9 / error)^(1/p) with limits, no longer than one that was rejected; and what is cut is no reason."""
    bank = np.zeros(tables.BANK_WORDS, int)
    bank[tables.ESTIMATED] = 2
    cases = [
        (1.0, 1.0, 0.81, False, 1.0),
        (1.0, 1.0, 0.09, False, 3.0),
        (1.0, 1.0, 0.09, True, 1.0),
        (1.0, 1.0, 0.0, False, 5.0),
        (1.0, 1.0, 1e-9, False, 5.0),
        (1.0, 1.0, 3.24, False, 0.5),
        (1.0, 1.0, 1e9, False, 0.2),
        (1.0, 1.0, math.nan, False, 0.2),
        (1.0, 1.0, math.inf, False, 0.2),
        (0.01, 7.0, 0.81, False, 7.0),
        (0.01, 7.0, 3.24, False, 0.005),
    ]
    for h, planned, error, rejected, expected in cases:
        assert integration.following(bank, h, planned, error, rejected) == pytest.approx(expected, rel=1e-12)


def test_few_communication_points_cost_few_steps(wired):
    few, many = (oscillator(wired, "dormand-prince", 1e-6, step=step)[1] for step in (10.0, 0.5))
    assert few["taken"] <= many["taken"] <= few["taken"] + 20


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("name", ABLE)
def test_a_jump_of_the_derivative_is_crossed_by_rejected_steps(load, name, engine):
    settings = f"stop: 1, step: 1, integrator: {name}, tolerance: 1.0e-6, absolute_tolerance: 1.0e-6"
    network = load("  t: {own: Turn}\n", settings, "metrics:\n  x: {signal: t.x, reduce: final}\n")
    outcome = run.Run(network, engine=engine).execute()
    steps = outcome.inner_steps["t"]
    assert steps["rejected"] > 3
    assert abs(outcome.metrics["x"]) <= steps["taken"] * 2e-6


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("name", ["bogacki-shampine", "dormand-prince", "rodas4"])
def test_a_pole_ends_the_run_with_block_state_and_time(load, name, engine):
    network = load("  p: {own: Pole, per: r}\n", f"stop: 2, step: 0.5, integrator: {name}, tolerance: 1.0e-6", FLEET)
    outcome = run.Run(network, engine=engine).execute()
    assert outcome.status == "failed" and isinstance(outcome.error, BlockFailed)
    text, time = outcome.error.message.split(" at t = ")
    assert text.startswith("block p: state `x` of r ") and "does not keep its tolerance" in text
    assert float(time.split()[0]) == pytest.approx(1.0, abs=1e-4)  # the pole, moved by errors of 1e-6 a step
    assert outcome.error.position.line == 4


FLEET = "fleets: {r: 2}\n"


def test_a_derivative_that_is_no_number_is_not_stepped_over(load):
    network = load("  l: {own: Log}\n", "stop: 9, step: 1, integrator: dormand-prince, tolerance: 1.0e-6")
    outcome = run.Run(network).execute()
    assert outcome.status == "failed" and "block l: state `x` does not keep its tolerance" in outcome.error.message


def test_what_asks_for_too_many_steps_says_so(load):
    settings = "stop: 1, step: 1, integrator: dormand-prince, tolerance: 1.0e-3"
    network = load("  d: {own: Decay, parameters: {rate: 1.0e+8}, start: {x: [1.0]}}\n", settings)
    outcome = run.Run(network).execute()
    assert outcome.status == "failed"
    assert (
        "block d: state `x[1]` asks at t = " in outcome.error.message and "1000000 inner steps" in outcome.error.message
    )
    assert "rodas5p" in outcome.error.fix
    assert (
        run.Run(
            load(
                "  d: {own: Decay, parameters: {rate: 1.0e+8}, start: {x: [1.0]}}\n",
                settings,
                "",
                "run.integrator=rodas4",
            )
        )
        .execute()
        .status
        == "completed"
    )


EVERYTHING = """
run: {{stop: 0.4, step: 0.02, method: {method}, integrator: {name}, tolerance: {tolerance}}}
fleets: {{robot: 3}}
blocks:
  o: {{type: Oscillator, per: robot, start: {{x: ["i", "2 * i", "3 * i"]}}}}
  count: {{type: Counter, per: robot, period: 0.1, inputs: {{u: o.x}}}}
  gain: {{type: Gain, per: robot, parameters: {{k: 0.5}}, inputs: {{u: o.x}}}}
  lag: {{type: Lag, per: robot, inputs: {{u: gain.y}}}}
  mean: {{type: Average, inputs: {{u: lag.y}}}}
"""


@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel", "joint"])
@pytest.mark.parametrize("name", ABLE)
def test_both_engines_give_the_same_bits(wired, trajectories, name, method):
    network = wired(EVERYTHING.format(method=method, name=name, tolerance=1e-5))
    names = ("o.x", "o.v", "lag.x", "lag.y", "count.count")
    native, python = (trajectories(network, *names, engine=engine) for engine in ("native", "python"))
    for signal in names:
        assert native[signal].tobytes() == python[signal].tobytes(), signal


@pytest.mark.parametrize("name", ["dormand-prince", "heun", "rodas5p"])
@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel", "joint"])
def test_all_that_a_step_remembers_lies_in_the_state_segment(wired, method, name):
    network = wired(EVERYTHING.format(method=method, name=name, tolerance=1e-5))
    built = program.build(network, method)
    one = Simulation(built, compilation.compile_program(built), [Probes(tuple(network.signals()))])
    one.initialize()

    def steps(first: int, last: int) -> bytes:
        one.control[tables.TICK], one.control[tables.LAST], one.control[tables.FINAL] = first, last, 1
        assert one.host.run("run") == tables.OK
        (samples,) = one.buffers.take()
        return b"".join(values.tobytes() for values in samples.values.values())

    steps(0, 5)
    saved = one.arena[: built.layout.changing].copy()
    expected = steps(5, 20)
    one.arena[built.layout.vectors["W"] : built.layout.changing] = 0xA5  # what a rejected step may leave
    one.arena[: built.layout.changing] = saved
    assert steps(5, 20) == expected


# ---- settings ----


def test_a_block_goes_its_own_way(load):
    """Its own tolerance, or its own number of equal steps, wins over what the run says."""
    settings = "stop: 1, step: 0.1, integrator: dormand-prince, tolerance: 1.0e-4, absolute_tolerance: 1.0e-5"
    network = load(
        "  a: {own: Clock}\n"
        "  b: {own: Clock, tolerance: 1.0e-8, integrator: rodas4}\n"
        "  c: {own: Clock, inner_steps: 2, integrator: euler}\n",
        settings,
    )
    found = {name: component.integration for name, component in network.components.items()}
    assert found == {
        "a": Integration("dormand-prince", 1, 1e-4, 1e-5),
        "b": Integration("rodas4", 1, 1e-8, 1e-5),
        "c": Integration("euler", 2, None, 1e-5),
    }
    outcome = run.Run(network).execute()
    assert sorted(outcome.inner_steps) == ["a", "b"]
    assert sorted(
        run.Run(load("  a: {own: Clock}\n  b: {own: Clock}\n", settings + ", method: joint")).execute().inner_steps
    ) == ["joint"]


def test_without_a_word_the_absolute_tolerance_is_a_thousandth():
    assert Integration("heun", 1, 1e-4).tolerances == pytest.approx((1e-4, 1e-7))
    assert Integration("heun", 1, 1e-4, 3.0).tolerances == (1e-4, 3.0)


@pytest.mark.parametrize(
    ("blocks", "settings", "said", "line"),
    [
        ("{own: Clock}", "integrator: rk4, tolerance: 1.0e-4", "`rk4` does not estimate its error", 1),
        ("{own: Clock}", "tolerance: 1.0e-4", "`euler` does not estimate its error", 1),
        ("{own: Clock, integrator: rk4}", "integrator: heun, tolerance: 1.0e-4", "block a: `rk4` does not estim", 3),
        ("{own: Clock, tolerance: 1.0e-4}", "integrator: ralston", "block a: `ralston` does not estimate", 3),
        (
            "{own: Clock, tolerance: 1.0e-4, inner_steps: 2}",
            "integrator: heun",
            "block a: `inner_steps` is how many",
            3,
        ),
        ("{own: Clock}", "integrator: heun, tolerance: 1.0e-4, inner_steps: 2", "`run.inner_steps` is how many", 1),
        ("{own: Clock}", "absolute_tolerance: 1.0e-4", "`run.absolute_tolerance` does nothing without", 1),
        ("{own: Clock, absolute_tolerance: 1.0e-4}", "", "block a: `absolute_tolerance` does nothing without", 3),
        ("{own: Clock}", "tolerance: 0", "`run.tolerance` must be a number from 1e-13 to 0.1, not `0`", 1),
        ("{own: Clock}", "tolerance: 1", "`run.tolerance` must be a number from 1e-13 to 0.1, not `1`", 1),
        ("{own: Clock}", "tolerance: small", "`small`", 1),
        (
            "{own: Clock, tolerance: 1.0e-4}",
            "method: joint, integrator: heun",
            "block a: `tolerance` is ignored under",
            3,
        ),
    ],
)
def test_what_cannot_be_kept_is_refused_at_its_line(load, blocks, settings, said, line):
    with pytest.raises(DiagramErrors) as caught:
        load(f"  a: {blocks}\n", ", ".join(filter(None, ("stop: 1, step: 0.1", settings))))
    (error,) = caught.value.errors
    assert said in error.message and error.position.line == line and error.fix
    assert isinstance(error, WrongValue | WrongType) or "small" in said


def test_resolved_text_says_the_same(load, tmp_path):
    network = load("  a: {own: Clock}\n", "stop: 1, step: 0.1, integrator: heun, tolerance: 1.0e-4")
    (tmp_path / "again.yaml").write_text(network.diagram.resolved())
    again = run.load(tmp_path / "again.yaml")
    assert again.components["a"].integration == network.components["a"].integration == Integration("heun", 1, 1e-4)


def test_what_an_implicit_integrator_cannot_solve_is_refused(load):
    text = "  a: {own: Decay, dimensions: {n: 2001}, start: {x: 1}, integrator: rodas4}\n"
    with pytest.raises(DiagramErrors, match="block a: its 2001 states depend on each other") as caught:
        load(text, "stop: 1, step: 0.1")
    (error,) = caught.value.errors
    assert isinstance(error, TooLarge) and error.position.line == 3 and "explicit" in error.fix
    fleet = "  a: {own: Decay, per: r, dimensions: {n: 1}, start: {x: 1}}\n"
    network = load(fleet, "stop: 1, step: 0.1, integrator: rodas4, method: joint", "fleets: {r: 2001}\n")
    assert run.Run(network).execute().status == "completed"  # each member by itself
