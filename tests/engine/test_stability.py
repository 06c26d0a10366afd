"""A step beyond the stability limit is said with the limit, which theory has; what is no mistake is not."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cosim.engine import compilation, program, run, stability
from cosim.engine.simulation import Simulation
from cosim.integrators import INTEGRATORS, Tableau

#: Where |R(z)| = 1 on the negative real axis: Hairer and Wanner II, table 2.1, and, for orders 1 to 4, of
#: the exponential series' first terms, where as many stages as the order leave no choice.
REAL = {"euler": 2.0, "heun": 2.0, "ralston": 2.0, "bogacki-shampine": 2.5127, "rk4": 2.7853, "dormand-prince": 3.3066}
#: And on the imaginary axis.
IMAGINARY = {"bogacki-shampine": math.sqrt(3.0), "rk4": 2.0 * math.sqrt(2.0)}
OWN = """
import math
from cosim import Block, Input, Output, Parameter, State

class Fast(Block):
    'slow and fast: dx/dt = -x, dy/dt = rate (x - y)'
    rate = Parameter(default=100.0)
    x = State(output=True, start=1.0)
    y = State(output=True)
    def derivatives(rate, x, y, d_x, d_y):
        d_x[0] = -x
        d_y[0] = rate * (x - y)

class Through(Block):
    'dx/dt = -rate y, where y = x is an output'
    rate = Parameter(default=100.0)
    x = State(start=1.0)
    y = Output()
    def outputs(x, y):
        y[0] = x
    def derivatives(rate, y, d_x):
        d_x[0] = -rate * y

class Root(Block):
    'dx/dt = -1e4 sqrt(|x|) sign(x): as steep as one likes near zero, and over in a moment'
    x = State(output=True)
    def derivatives(x, d_x):
        d_x[0] = -1e4 * math.copysign(math.sqrt(abs(x)), x)

class Jump(Block):
    x = State(output=True)
    def derivatives(x, d_x):
        d_x[0] = -1.0 if x > 0.0 else 1.0

class Growing(Block):
    x = State(output=True, start=1e-9)
    def derivatives(x, d_x):
        d_x[0] = 30.0 * x

class Fails(Block):
    x = State(output=True, start=1.0)
    def derivatives(x, d_x):
        if x != 1.0:
            raise ValueError("moved")
        d_x[0] = 0.0

class Plain(Block, compiled=False):
    'its functions may have effects'
    x = State(output=True, start=1.0)
    def derivatives(x, d_x):
        d_x[0] = -1e3 * x
"""


@pytest.fixture
def said(tmp_path):
    """What is said of a diagram's steps before it runs."""

    def warnings(blocks: str, settings: str, more: str = "") -> list:
        (tmp_path / "own.py").write_text(OWN)
        text = f"run: {{{settings}}}\n{more}blocks:\n{blocks}".replace("own: ", "python: own.py:")
        (tmp_path / "d.yaml").write_text(text)
        return looked(run.load(tmp_path / "d.yaml"))

    return warnings


def looked(network) -> list:
    built = program.build(network, network.diagram.run.method)
    kernels = compilation.compile_program(built)
    one = Simulation(built, kernels)
    one.initialize()
    return stability.warnings(built, kernels, one.arena, lambda: False)


@pytest.mark.parametrize("name", REAL)
def test_limits_are_those_of_theory(name):
    method = INTEGRATORS[name]
    assert isinstance(method, Tableau)
    assert stability.limit(method, -100.0 + 0.0j) == pytest.approx(REAL[name], abs=1e-4)
    if name in IMAGINARY:
        assert stability.limit(method, 10.0j) == pytest.approx(IMAGINARY[name], abs=1e-6)
    z = 0.3 - 0.2j  # an error of the first order that is missed
    left = stability.amplification(method, z) - np.exp(z)
    assert abs(left) < abs(z) ** (method.order + 1)


@pytest.mark.parametrize("inner", [1, 3])
@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel", "joint"])
@pytest.mark.parametrize("name", REAL)
def test_a_step_beyond_the_limit_is_said_and_one_within_is_not(said, name, method, inner):
    blocks = "  f: {own: Fast, per: r, parameters: {rate: [1, 50, 100]}}\n"
    for over, warned in ((1.02, 1), (0.98, 0)):
        step = over * inner * REAL[name] / 100.0
        settings = f"stop: {1000 * step!r}, step: {step!r}, method: {method}, integrator: {name}, inner_steps: {inner}"
        found = said(blocks, settings, "fleets: {r: 3}\n")
        assert len(found) == warned
    (warning,) = said(
        blocks,
        settings.replace(repr(step), repr(10.0 * step)).replace(f"stop: {1000 * step!r}", f"stop: {10000 * step!r}"),
        "fleets: {r: 3}\n",
    )
    assert f"h·|λ| = {9.8 * REAL[name]:.3g} is beyond the stability limit {REAL[name]:.3g} of {name}" in warning.message
    assert warning.message.startswith("block f: ") and warning.position.line == 4 and "rodas5p" in warning.fix
    longest = float(warning.fix.partition("= ")[2].partition(" s")[0])
    assert 0.9 * inner * REAL[name] / 100.0 < longest < inner * REAL[name] / 100.0


@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel", "joint"])
@pytest.mark.parametrize("integrator", ["euler", "rk4"])
def test_what_a_derivative_reads_of_its_own_block_counts(said, method, integrator):
    settings = f"stop: 10, step: 0.1, method: {method}, integrator: {integrator}"
    assert len(said("  t: {own: Through}\n", settings)) == 1


@pytest.mark.parametrize("integrator", ["euler", "rk4"])
@pytest.mark.parametrize("block", ["Root", "Jump", "Growing", "Fails", "Plain"])
def test_what_is_no_decay_of_a_derivative_that_exists_is_no_mistake(said, block, integrator):
    assert said(f"  b: {{own: {block}}}\n", f"stop: 1, step: 0.01, integrator: {integrator}") == []


def test_an_oscillation_is_a_matter_of_accuracy(wired):
    """Euler's method amplifies it whatever the step; only what decays in truth is told."""
    for integrator in ("euler", "heun"):
        text = f"run: {{stop: 1000, step: 0.01, integrator: {integrator}}}\nblocks:\n  o: {{type: Oscillator}}\n"
        assert looked(wired(text)) == []


@pytest.mark.parametrize("how", ["integrator: rodas4", "integrator: heun, tolerance: 1.0e-3"])
def test_what_chooses_its_steps_or_is_stable_is_not_warned_of(said, how):
    assert said("  f: {own: Fast}\n", f"stop: 10, step: 1, {how}") == []


def test_a_diagram_without_states_is_not_looked_at(wired):
    text = "run: {stop: 1, step: 0.1, method: joint}\nblocks:\n  s: {type: Sine, parameters: {A: 1}}\n"
    assert looked(wired(text)) == []


@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel", "joint"])
@pytest.mark.parametrize("integrator", ["euler", "rk4"])
@pytest.mark.parametrize("name", ["formation", "oft_observer", "static_gains"])
def test_the_shipped_diagrams_raise_no_alarm(formation, name, method, integrator):
    network = run.load(formation.with_name(f"{name}.yaml"), [f"run.method={method}", f"run.integrator={integrator}"])
    assert looked(network) == []


@pytest.mark.parametrize("engine", ["native", "python"])
def test_a_run_tells_it_whether_it_diverges_or_not(wired, engine):
    text = "run: {{stop: {stop}, step: {step}}}\nblocks:\n  f: {{type: Follow, start: {{u: 1}}}}\n"
    for stop, step, status in ((200, 4, "completed"), (2000, 4, "diverged"), (20, 1, "completed")):
        outcome = run.Run(wired(text.format(stop=stop, step=step)), engine=engine).execute()
        assert outcome.status == status
        said = [warning.message for warning in outcome.warnings]
        expected = "block f: at the start h·|λ| = 4 is beyond the stability limit 2 of euler"
        assert said == ([expected] if step == 4 else [])


MANY = """run: {stop: 5, step: 1.0e-3}
fleets: {robot: 3000}
blocks:
  own: {python: own.py:Fast, per: robot, parameters: {rate: "5000 if i == 1234 else 1 + i % 40"}}
  lone: {python: own.py:Fast}
"""


@pytest.mark.parametrize("most", [50_000, 60])
def test_of_a_large_fleet_those_are_looked_at_that_matter(tmp_path, monkeypatch, most):
    """One of 3,000 robots has a state that decays 25 times as fast as the step can follow."""
    monkeypatch.setattr(stability, "MOST_STATES", most)
    monkeypatch.setattr(stability, "PIECE", 700)
    (tmp_path / "own.py").write_text(OWN)
    (tmp_path / "d.yaml").write_text(MANY)
    (warning,) = looked(run.load(tmp_path / "d.yaml"))
    assert "block own: at the start h·|λ| = 5 is beyond the stability limit 2 of euler" in warning.message
    assert looked(run.load(tmp_path / "d.yaml", ["blocks.own.parameters.rate=40"])) == []


def test_a_run_of_which_there_is_one_arena_is_the_same_run(formation, monkeypatch, tmp_path):
    """A large one is looked at in its own memory, and begins again; and its image is made anew each time."""
    found = []
    for large in (program.LARGE, 0):
        monkeypatch.setattr(program, "LARGE", large)
        network = run.load(formation.with_name("fleet_1000.yaml"), ["run.stop=0.05", "fleets.robot=20"])
        one = run.Run(network, output=tmp_path / f"{large}.nc")
        assert (one.simulation.program.image is None) == (large == 0)
        outcome = one.execute()
        found.append((outcome.metrics, [w.message for w in outcome.warnings], one.simulation.arena.tobytes()))
    assert found[0] == found[1]


def test_what_is_looked_at_where_it_runs_and_fails_is_no_start_of_a_run(tmp_path, monkeypatch):
    """A look that somebody stops leaves nothing of its own in the figures of the run."""
    monkeypatch.setattr(program, "LARGE", 0)
    (tmp_path / "own.py").write_text(OWN)
    (tmp_path / "d.yaml").write_text("run: {stop: 1, step: 0.1}\nblocks:\n  own: {python: own.py:Growing}\n")
    one = run.Run(run.load(tmp_path / "d.yaml"))

    def stopped(_program, _kernels, arena, _wanted):
        arena.view(np.int64)[:] = 7
        raise KeyboardInterrupt

    monkeypatch.setattr(stability, "warnings", stopped)
    outcome = one.execute()
    assert outcome.status == "interrupted" and outcome.time == 0.0
    assert one.simulation.arena.tobytes() == begun(one).arena.tobytes()


def begun(one) -> Simulation:
    """A simulation of the same program, initialized."""
    other = Simulation(one.simulation.program, one.simulation.kernels)
    other.initialize()
    return other
