"""Stiff blocks: Van der Pol's and Robertson's, alone, as fleets, and in diagrams, against solutions of others."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cosim.engine import program, run
from cosim.integrators import INTEGRATORS
from cosim.master import tables

IMPLICIT = [name for name, method in INTEGRATORS.items() if method.is_implicit]
METHODS = ("jacobi", "gauss-seidel", "joint")

# Mazzia and Magherini, Test Set for Initial Value Problem Solvers, release 2.4: the problems vdpolm at 2000 and rober.
VAN_DER_POL = (1.706167732170469, -0.8928097010248125e-3)
ROBERTSON = (0.2083340149701255e-07, 0.8333360770334713e-13, 0.9999999791665050)
#: At 3000, by scipy's Radau with a tolerance of 1e-12, which has the eleven first digits of the above at 2000.
LATER = (-1.510606936744, 0.001178380000731)


def finals(network, *names: str, engine: str = "native"):
    """The last values of signals, each a metric of that name."""
    outcome = run.Run(network, engine=engine).execute()
    assert outcome.status == "completed", outcome.error
    return [np.ravel(outcome.metrics[name]) for name in names], outcome


def metrics(*signals: str) -> str:
    return "metrics:\n" + "".join(f"  {s.replace('.', '_')}: {{signal: {s}, reduce: final}}\n" for s in signals)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("tolerance", [1e-4, 1e-7])
@pytest.mark.parametrize("name", IMPLICIT)
def test_van_der_pol_to_the_second_jump_and_beyond(wired, name, tolerance, method):
    """Errors shift the jumps and then fade, but v = x/(mu (1 - x²)) has (x² + 1)/(x² - 1) < 3 times the error of x."""
    settings = f"method: {method}, step: 100, integrator: {name}, tolerance: {tolerance}, absolute_tolerance: 1.0e-10"
    for stop, reference in ((2000, VAN_DER_POL), (3000, LATER)):
        text = f"run: {{stop: {stop}, {settings}}}\n{metrics('o.x', 'o.v')}blocks:\n  o: {{type: VanDerPol}}\n"
        found, outcome = finals(wired(text), "o_x", "o_v")
        np.testing.assert_allclose(np.concatenate(found), reference, rtol=3 * tolerance)
        assert outcome.inner_steps["o"]["taken"] < 20_000


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("tolerance", [1e-4, 1e-7])
@pytest.mark.parametrize("name", IMPLICIT)
def test_robertson_over_eleven_decades(wired, name, tolerance, method):
    settings = f"method: {method}, integrator: {name}, tolerance: {tolerance}, absolute_tolerance: 1.0e-18"
    text = f"run: {{stop: 1.0e+11, step: 1.0e+10, {settings}}}\n{metrics('o.y')}blocks:\n  o: {{type: Robertson}}\n"
    (y,), outcome = finals(wired(text), "o_y")
    np.testing.assert_allclose(y, ROBERTSON, rtol=tolerance)
    assert y.sum() == pytest.approx(1.0, abs=1e-12)  # no step loses mass: a linear invariant
    assert outcome.inner_steps["o"]["taken"] < 2000


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", IMPLICIT)
def test_a_fleet_of_vectors_of_states(wired, name, method):
    """Three states each, side by side in memory by member; the middle one begins as the published solution does."""
    settings = f"method: {method}, integrator: {name}, tolerance: 1.0e-6, absolute_tolerance: 1.0e-18"
    start = "[[0.5, 0, 0.5], [1, 0, 0], [0, 1.0e-4, 1]]"
    text = (
        f"run: {{stop: 1.0e+11, step: 1.0e+10, {settings}}}\nfleets: {{r: 3}}\n{metrics('o.y')}"
        f"blocks:\n  o: {{type: Robertson, per: r, start: {{y: {start}}}}}\n"
    )
    (y,), outcome = finals(wired(text), "o_y")
    np.testing.assert_allclose(y.reshape(3, 3)[1], ROBERTSON, rtol=1e-6)
    np.testing.assert_allclose(y.reshape(3, 3).sum(axis=1), [1.0, 1.0, 1.0001], atol=1e-12)
    assert outcome.inner_steps["o"]["taken"] < 2000


@pytest.mark.parametrize("engine", ["native", "python"])
def test_equal_steps_do_not_follow_what_is_over_at_once(wired, engine):
    """L-stable: where a motion lasts a billionth of a step, it is gone after one step."""
    text = (
        "run: {stop: 10, step: 1, integrator: rodas4, inner_steps: 2}\n"
        f"{metrics('o.v', 'o.x')}"
        "blocks:\n  o: {type: VanDerPol, parameters: {mu: 1.0e+9}}\n"
    )
    (v, x), _ = finals(wired(text), "o_v", "o_x", engine=engine)
    assert abs(v[0] - x[0] / (1e9 * (1.0 - x[0] ** 2))) <= 1e-6 * abs(v[0])  # on the slow curve, from v = 0


COUPLED = (
    (
        "run: {{stop: 60, step: {step}, method: {method}, integrator: rodas5p, tolerance: {tolerance}}}\n"
        + metrics("o.x", "o.v", "f.x")
        + "blocks:\n  o: {{type: VanDerPol, parameters: {{mu: 50}}, inputs: {{u: f.x}}}}\n"
        "  f: {{type: Follow, inputs: {{u: o.x}}}}\n"
    )
    .replace("{signal", "{{signal")
    .replace("final}", "final}}")
)


@cache
def coupled() -> np.ndarray:
    def f(_, y):
        return [y[1], 50.0 * (1.0 - y[0] ** 2) * y[1] - y[0] + y[2], y[0] - y[2]]

    return solve_ivp(f, (0.0, 60.0), [2.0, 0.0, 0.0], method="Radau", rtol=1e-11, atol=1e-12).y[:, -1]


@pytest.mark.parametrize("engine", ["native", "python"])
def test_a_stiff_block_in_a_ring_is_as_exact_jointly_as_alone(wired, engine):
    found, outcome = finals(
        wired(COUPLED.format(step=5, method="joint", tolerance=1e-6)), "o_x", "o_v", "f_x", engine=engine
    )
    np.testing.assert_allclose(np.concatenate(found), coupled(), rtol=1e-4, atol=1e-5)
    assert list(outcome.inner_steps) == ["joint"]


@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel"])
def test_block_by_block_the_error_is_that_of_the_coupling(wired, method):
    """Whatever the tolerance: of first order in the communication step."""
    reference = coupled()
    errors = []
    for step in (0.1, 0.05):
        found, _ = finals(wired(COUPLED.format(step=step, method=method, tolerance=1e-9)), "o_x", "o_v", "f_x")
        errors.append(abs(found[2][0] - reference[2]))
    assert errors[0] < 0.1 and errors[0] / errors[1] == pytest.approx(2.0, rel=0.2)


@cache
def alone(mu: float) -> float:
    """Van der Pol's x after 20 s."""

    def f(_, y):
        return [y[1], mu * (1.0 - y[0] ** 2) * y[1] - y[0]]

    return solve_ivp(f, (0.0, 20.0), [2.0, 0.0], method="Radau", rtol=1e-10, atol=1e-12).y[0, -1]


FLEET = (
    "run: {{stop: 20, step: 2, method: {method}, integrator: {name}, tolerance: 1.0e-6}}\n"
    "fleets: {{r: 4}}\n"
    + metrics("o.x", "f.x").replace("{signal", "{{signal").replace("final}", "final}}")
    + "blocks:\n  o: {{type: VanDerPol, per: r, parameters: {{mu: [1, 10, 100, 1000]}}}}\n"
    "  f: {{type: Follow, {f}}}\n"
)
APART = "per: r, inputs: {u: o.x}"


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", IMPLICIT)
def test_members_of_a_fleet_are_solved_side_by_side(wired, name, method, engine):
    """Four systems of two states, or jointly of three; each has the figures of a solution of its own."""
    network = wired(FLEET.format(method=method, name=name, f=APART))
    (x, _), _ = finals(network, "o_x", "f_x", engine=engine)
    np.testing.assert_allclose(x, [alone(mu) for mu in (1.0, 10.0, 100.0, 1000.0)], atol=2e-5)


@pytest.mark.parametrize(
    ("method", "wire", "shapes"),
    [
        ("jacobi", APART, [(4, 2), (4, 1)]),
        ("gauss-seidel", APART, [(4, 2), (4, 1)]),
        ("joint", APART, [(4, 3)]),
        ("joint", 'per: r, inputs: {u: ["o.x[2..4]", "o.x[1]"]}', [(1, 12)]),  # members read each other
        ("jacobi", 'per: r, inputs: {u: ["o.x[2..4]", "o.x[1]"]}', [(4, 2), (4, 1)]),  # but hold what they read
    ],
)
def test_what_depends_on_each_other_is_one_system(wired, method, wire, shapes):
    built = program.build(wired(FLEET.format(method=method, name="rodas4", f=wire)), method)
    found = []
    for bank in built.banks:
        words = built.arena[bank[tables.IMPLICIT] :].view(np.int64)
        found.append((words[tables.SYSTEMS], words[tables.SYSTEM_SIZE]))
        states = words[tables.SYSTEMS_WORDS :][: found[-1][0] * found[-1][1]]
        assert sorted(states) == [*range(bank[tables.END] - bank[tables.BEGIN])]
    assert found == shapes


@pytest.mark.parametrize(("method", "shape"), [("jacobi", (4, 2)), ("joint", (1, 8))])
def test_a_block_whose_members_read_each_other_is_one_system_jointly(wired, method, shape):
    wire = 'per: r, inputs: {u: ["o.x[2..4]", "o.x[1]"]}'
    text = f"run: {{stop: 1, step: 1, method: {method}, integrator: rodas4}}\nfleets: {{r: 4}}\n"
    built = program.build(wired(f"{text}blocks:\n  o: {{type: VanDerPol, {wire}}}\n"), method)
    words = built.arena[built.banks[0][tables.IMPLICIT] :].view(np.int64)
    assert (words[tables.SYSTEMS], words[tables.SYSTEM_SIZE]) == shape


@pytest.mark.parametrize("how", ["integrator: rodas4", "integrator: heun, tolerance: 1.0e-3"])
def test_a_diagram_without_states_has_nothing_to_integrate(wired, how):
    text = f"run: {{stop: 1, step: 0.1, method: joint, {how}}}\n{metrics('s.y')}"
    (y,), _ = finals(wired(f"{text}blocks:\n  s: {{type: Sine, parameters: {{A: 1}}}}\n"), "s_y")
    np.testing.assert_allclose(y, [np.sin(1.0), 2.0 * np.sin(1.0)], rtol=1e-15)


@pytest.mark.parametrize("name", IMPLICIT)
def test_a_fleet_whose_members_read_each_other_is_solved_as_a_whole(wired, name):
    """The same figures as with tolerances a hundred times smaller, by an explicit integrator."""
    wire = 'per: r, inputs: {u: ["o.x[2..4]", "o.x[1]"]}'
    found, _ = finals(wired(FLEET.format(method="joint", name=name, f=wire)), "o_x", "f_x")
    network = wired(FLEET.format(method="joint", name="dormand-prince", f=wire), "run.tolerance=1e-8")
    exact, _ = finals(network, "o_x", "f_x")
    np.testing.assert_allclose(np.concatenate(found), np.concatenate(exact), atol=2e-5)
