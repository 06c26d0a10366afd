"""Integrators are data: what their coefficients must be, what order they have along a run, and how one is added."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

from cosim import integrators
from cosim.engine import run
from cosim.integrators import INTEGRATORS, Row, Tableau

EMBEDDED = {"heun": 1, "bogacki-shampine": 2, "dormand-prince": 4}


def weights(row: Row) -> list[Fraction]:
    return [Fraction(n, row.denominator) for n in row.numerators]


def trees(tableau: Tableau, row: Row) -> dict[int, list[tuple[Fraction, Fraction]]]:
    """The order conditions of Butcher's trees up to order 4: what a method gives, and what it has to give."""
    b = weights(row)
    a = [[]] + [weights(stage) for stage in tableau.stages]
    c = [sum(line, Fraction(0)) for line in a]
    n = range(len(b))

    def times(values: list[Fraction]) -> list[Fraction]:
        return [sum((line[j] * values[j] for j in range(len(line))), Fraction(0)) for line in a]

    def summed(values: list[Fraction]) -> Fraction:
        return sum((b[i] * values[i] for i in n), Fraction(0))

    c2, c3 = [x**2 for x in c], [x**3 for x in c]
    return {
        1: [(summed([Fraction(1)] * len(b)), Fraction(1))],
        2: [(summed(c), Fraction(1, 2))],
        3: [(summed(c2), Fraction(1, 3)), (summed(times(c)), Fraction(1, 6))],
        4: [
            (summed(c3), Fraction(1, 4)),
            (summed([x * y for x, y in zip(c, times(c), strict=True)]), Fraction(1, 8)),
            (summed(times(c2)), Fraction(1, 12)),
            (summed(times(times(c))), Fraction(1, 24)),
        ],
    }


@pytest.mark.parametrize("name", INTEGRATORS)
def test_coefficients_fulfil_the_conditions_of_their_order_and_no_more(name):
    tableau = INTEGRATORS[name]
    rows = [(tableau.weights, tableau.order)]
    rows += [(tableau.embedded, EMBEDDED[name])] if tableau.embedded else []
    for row, order in rows:
        conditions = trees(tableau, row)
        assert all(given == wanted for k in range(1, min(order, 4) + 1) for given, wanted in conditions[k])
        if order < 4:
            assert any(given != wanted for given, wanted in conditions[order + 1])


@pytest.mark.parametrize("name", INTEGRATORS)
def test_nodes_are_the_sums_of_their_rows(name):
    tableau = INTEGRATORS[name]
    for k, row in enumerate(tableau.stages):
        assert len(row.numerators) == k + 1 and row.node == float(sum(weights(row)))
    assert tableau.weights.node == 1 and len(tableau.weights.numerators) == tableau.count
    assert (tableau.embedded is None) == (name not in EMBEDDED)


def error(wired, integrator: str, step: float, method: str, engine: str) -> float:
    """The error of x and v of an oscillator x'' = -4 x after 1 s: one block, so that no method holds its states."""
    network = wired(
        f"run: {{stop: 1, step: {step}, method: {method}, integrator: {integrator}}}\n"
        "metrics:\n  x: {signal: o.x, reduce: final}\n  v: {signal: o.v, reduce: final}\n"
        "blocks:\n  o: {type: Oscillator}\n"
    )
    found = run.Run(network, engine=engine).execute().metrics
    return math.hypot(np.ravel(found["x"])[0] - math.cos(2), np.ravel(found["v"])[0] + 2 * math.sin(2))


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel", "joint"])
@pytest.mark.parametrize("name", INTEGRATORS)
def test_the_error_of_a_run_goes_with_the_step_to_the_order(wired, name, method, engine):
    order = INTEGRATORS[name].order
    coarse, fine = (error(wired, name, step, method, engine) for step in (0.025, 0.0125))
    assert math.log2(coarse / fine) == pytest.approx(order, abs=0.15)


def test_a_new_integrator_is_its_tableau(wired, monkeypatch):
    """Kutta's method of order 3, as somebody would add it: one entry, known to YAML, loop and both engines at once."""
    kutta = Tableau(3, (Row(1 / 2, 2, (1,)), Row(1, 1, (-1, 2))), Row(1, 6, (1, 4, 1)), source="Kutta 1901")
    monkeypatch.setitem(integrators.INTEGRATORS, "kutta", kutta)
    coarse, fine = (
        error(wired, "kutta", step, "joint", engine) for step, engine in ((0.025, "native"), (0.0125, "python"))
    )
    assert math.log2(coarse / fine) == pytest.approx(3, abs=0.15)
