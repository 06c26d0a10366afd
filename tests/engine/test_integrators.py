"""Integrators are data: what their coefficients must be, what order they have along a run, and how one is added."""

from __future__ import annotations

import math
from collections.abc import Iterator
from fractions import Fraction

import numpy as np
import pytest

from cosim import integrators
from cosim.engine import run
from cosim.integrators import INTEGRATORS, Rosenbrock, Row, Tableau

IMPLICIT = [name for name, method in INTEGRATORS.items() if method.is_implicit]
EXPLICIT = [name for name in INTEGRATORS if name not in IMPLICIT]
EMBEDDED = {"heun": 1, "bogacki-shampine": 2, "dormand-prince": 4, "rodas4": 3, "rodas5p": 4}
ROUNDED = 1e-14  # of Rosenbrock coefficients, of which 16 digits are published

Matrix = list[list[Fraction]]
Tree = tuple["Tree", ...]


def fractions(row: Row) -> list[Fraction]:
    return [Fraction(n, row.denominator) for n in row.numerators]


def square(rows: list[list[Fraction]]) -> Matrix:
    return [line + [Fraction(0)] * (len(rows) - len(line)) for line in rows]


def butcher(method: Tableau | Rosenbrock) -> tuple[Matrix, Matrix, dict[int, list[Fraction]]]:
    """α, α + γ and the weights, by the order that they have, of a method in the form of its order conditions."""
    if isinstance(method, Tableau):
        a = square([[], *map(fractions, method.stages)])
        rows = {method.order: method.weights} | ({method.order - 1: method.embedded} if method.embedded else {})
        return a, a, {order: fractions(row) for order, row in rows.items()}
    # u = G k, with G = (γ_ij): a = (α_ij) G⁻¹, c = 1/γ_ii - G⁻¹, and m = b G⁻¹ (Hairer and Wanner II, IV.7.24)  # noqa: RUF003
    n = method.count
    inverse = [[-c for c in line] for line in square([[*map(Fraction, s.slopes)] for s in method.stages])]
    for k in range(n):
        inverse[k][k] += 1 / Fraction(method.gamma)
    gamma = inverted(inverse)
    alpha = product(square([[*map(Fraction, s.states)] for s in method.stages]), gamma)
    last = [*map(Fraction, method.stages[-1].states)]
    weights = {o: product([[*last, Fraction(end)]], gamma)[0] for o, end in ((method.order, 1), (method.order - 1, 0))}
    return alpha, [[x + y for x, y in zip(*lines, strict=True)] for lines in zip(alpha, gamma, strict=True)], weights


def product(a: Matrix, b: Matrix) -> Matrix:
    return [[sum((x * b[k][j] for k, x in enumerate(line)), Fraction(0)) for j in range(len(b[0]))] for line in a]


def inverted(lower: Matrix) -> Matrix:
    n = len(lower)
    result = [[Fraction(int(i == j)) for j in range(n)] for i in range(n)]
    for i in range(n):
        for j in range(n):
            rest = sum((lower[i][k] * result[k][j] for k in range(i)), Fraction(0))
            result[i][j] = (result[i][j] - rest) / lower[i][i]
    return result


def trees(order: int) -> set[Tree]:
    """The rooted trees of an order: 1, 1, 2, 4, 9, 20."""
    return {tuple(sorted(tree, key=repr)) for tree in forests(order - 1)}


def forests(nodes: int) -> Iterator[Tree]:
    if nodes == 0:
        yield ()
    for first in range(1, nodes + 1):
        yield from ((tree, *rest) for tree in trees(first) for rest in forests(nodes - first))


def size(tree: Tree) -> int:
    return 1 + sum(map(size, tree))


def density(tree: Tree) -> int:
    return size(tree) * math.prod(map(density, tree))


def elementary(tree: Tree, alpha: Matrix, beta: Matrix) -> list[Fraction]:
    """Of each stage; where a tree has one branch, it is β that a Rosenbrock method has there (IV.7.15)."""
    value = [Fraction(1)] * len(alpha)
    for branch in tree:
        inner = elementary(branch, alpha, beta)
        lines = beta if len(tree) == 1 else alpha
        sums = [sum((x * y for x, y in zip(line, inner, strict=True)), Fraction(0)) for line in lines]
        value = [x * y for x, y in zip(value, sums, strict=True)]
    return value


def missed(name: str, order: int, of: int) -> Fraction:
    """By how much the weights of an order miss the conditions of another."""
    alpha, beta, weights = butcher(INTEGRATORS[name])
    given = (
        sum((b * x for b, x in zip(weights[of], elementary(tree, alpha, beta), strict=True)), Fraction(0))
        - Fraction(1, density(tree))
        for tree in trees(order)
    )
    return max(map(abs, given))


def test_there_are_as_many_trees_as_there_should_be():
    assert [len(trees(order)) for order in range(1, 7)] == [1, 1, 2, 4, 9, 20]


@pytest.mark.parametrize("name", INTEGRATORS)
def test_coefficients_fulfil_the_conditions_of_their_order_and_no_more(name):
    method = INTEGRATORS[name]
    tolerated = ROUNDED if name in IMPLICIT else 0
    assert method.estimates == (name in EMBEDDED)
    for order in (method.order, *([EMBEDDED[name]] if name in EMBEDDED else [])):
        assert all(missed(name, k, order) <= tolerated for k in range(1, order + 1))
        assert missed(name, order + 1, order) > 1e-4


@pytest.mark.parametrize("name", EXPLICIT)
def test_nodes_are_the_sums_of_their_rows(name):
    tableau = INTEGRATORS[name]
    for k, row in enumerate(tableau.stages):
        assert len(row.numerators) == k + 1 and row.node == float(sum(fractions(row)))
    assert tableau.weights.node == 1 and len(tableau.weights.numerators) == tableau.count


@pytest.mark.parametrize("name", IMPLICIT)
def test_nodes_of_a_rosenbrock_method_are_the_sums_of_its_rows(name):
    alpha, beta, _ = butcher(INTEGRATORS[name])
    for k, stage in enumerate(INTEGRATORS[name].stages):
        assert len(stage.states) == len(stage.slopes) == k
        assert abs(sum(alpha[k]) - Fraction(stage.node)) <= ROUNDED
        assert abs(sum(beta[k]) - sum(alpha[k]) - Fraction(stage.gamma)) <= ROUNDED


@pytest.mark.parametrize("name", IMPLICIT)
def test_implicit_methods_are_l_stable(name):
    """|R(z)| ≤ 1 on the imaginary axis, and R vanishes at infinity, for the method and its estimate."""
    _, beta, weights = butcher(INTEGRATORS[name])
    b, one = np.array(beta, float), np.eye(len(beta))
    for of in weights.values():
        w = np.array(of, float)

        def amplification(z: complex, w: np.ndarray = w) -> complex:
            return 1.0 + z * (w @ np.linalg.solve(one - z * b, one @ np.ones(len(b))))

        assert max(abs(amplification(1j * y)) for y in np.logspace(-2, 4, 500)) <= 1.0 + 1e-9
        assert abs(amplification(-1e9)) < 1e-6


@pytest.mark.parametrize(("name", "hands_on"), [("dormand-prince", True), ("bogacki-shampine", True), ("heun", False)])
def test_a_last_stage_that_is_the_next_first_one_is_seen(name, hands_on):
    assert INTEGRATORS[name].ends_with_slope is hands_on


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
@pytest.mark.parametrize("name", EXPLICIT)
def test_the_error_of_a_run_goes_with_the_step_to_the_order(wired, name, method, engine):
    order = INTEGRATORS[name].order
    coarse, fine = (error(wired, name, step, method, engine) for step in (0.025, 0.0125))
    assert math.log2(coarse / fine) == pytest.approx(order, abs=0.15)


def error_in_time(wired, integrator: str, step: float, method: str, engine: str) -> float:
    """The error of dy/dt = y² cos t, y(0) = 1/2, after 1 s: y = 1/(2 - sin t), nonlinear and not autonomous."""
    network = wired(
        f"run: {{stop: 1, step: {step}, method: {method}, integrator: {integrator}, inner_steps: 2}}\n"
        "metrics:\n  y: {signal: o.y, reduce: final}\nblocks:\n  o: {type: Riccati}\n"
    )
    return abs(run.Run(network, engine=engine).execute().metrics["y"] - 1.0 / (2.0 - math.sin(1.0)))


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel", "joint"])
@pytest.mark.parametrize("name", ["rk4", *IMPLICIT])
def test_the_order_holds_for_what_depends_on_the_time_and_is_not_linear(wired, name, method, engine):
    coarse, fine = (error_in_time(wired, name, step, method, engine) for step in (0.1, 0.05))
    assert math.log2(coarse / fine) == pytest.approx(INTEGRATORS[name].order, abs=0.15)


def test_a_new_integrator_is_its_tableau(wired, monkeypatch):
    """Kutta's method of order 3, as somebody would add it: one entry, known to YAML, loop and both engines at once."""
    kutta = Tableau(3, (Row(1 / 2, 2, (1,)), Row(1, 1, (-1, 2))), Row(1, 6, (1, 4, 1)), source="Kutta 1901")
    monkeypatch.setitem(integrators.INTEGRATORS, "kutta", kutta)
    coarse, fine = (
        error(wired, "kutta", step, "joint", engine) for step, engine in ((0.025, "native"), (0.0125, "python"))
    )
    assert math.log2(coarse / fine) == pytest.approx(3, abs=0.15)
