"""The extended Kalman filter against one in plain numpy: all measurements at once, in Joseph's form."""

import numpy as np
import pytest

from cosim.blocks.jacobian import jacobian
from cosim.engine import run
from cosim.errors import CosimError
from cosim.export.exporter import export_fmu
from cosim.results.result_file import open_result
from tests.blocks.library_runs import run_diagram

FILTERS = '''
import math

import numpy as np

from cosim import Block, Parameter
from cosim.blocks.extended_kalman import ExtendedKalmanFilter
from cosim.blocks.jacobian import jacobian


def seen(x, other):
    return np.array([math.sin(x[0]), x[0] * x[1], x[1]])


def swing(x, other):
    return np.array([x[0] + other[1] * x[1], x[1] + other[1] * (other[0] - 4.0 * math.sin(x[0]))])


fill_seen = jacobian(seen)
fill_swing = jacobian(swing)


class Exact(ExtendedKalmanFilter, Block):
    """Its Jacobians are written."""

    stiffness = Parameter(default=4.0)

    def outputs_measurement(x, h, H):
        h[:] = seen(x, x)
        H[:] = np.array([[math.cos(x[0]), 0.0], [x[1], x[0]], [0.0, 1.0]])

    def outputs_transition(x_hat, u, stiffness, period, f, F):
        f[0] = x_hat[0] + period * x_hat[1]
        f[1] = x_hat[1] + period * (u[0] - stiffness * math.sin(x_hat[0]))
        F[:] = np.array([[1.0, period], [-period * stiffness * math.cos(x_hat[0]), 1.0]])


class Differences(Exact):
    """They are found by differences."""

    def outputs_measurement(x, h, H):
        h[:] = seen(x, x)
        fill_seen(x, x, H)

    def outputs_transition(x_hat, u, period, f, F):
        other = np.array([u[0], period])
        f[:] = swing(x_hat, other)
        fill_swing(x_hat, other, F)
'''
Q, R, DT = np.diag([1e-4, 1e-3]), np.diag([0.01, 0.04, 0.09]), 0.05
DIAGRAM = """
run: {{stop: 3, step: 0.05}}
blocks:
  u: {{block: Sine, parameters: {{frequency: 0.4}}}}
  y: {{block: Sine, parameters: {{amplitude: [0.4, 0.3, 0.8], frequency: 0.3, phase: [0, 0.5, 1.5]}}}}
  b:
    python: {file}:{name}
    period: 0.05
    parameters: {{Q: [[1e-4, 0], [0, 1e-3]], R: [0.01, 0.04, 0.09]}}
    start: {{x: [0.5, 0], P: [[1, 0.1], [0.1, 1]]}}
    inputs: {{u: u.y, y: y.y}}
"""


@pytest.fixture
def own(tmp_path):
    (tmp_path / "own.py").write_text(FILTERS)
    return tmp_path / "own.py"


def filtered(u, y):
    """Estimates and their covariances, sample by sample."""
    x, p = np.array([0.5, 0.0]), np.array([[1, 0.1], [0.1, 1]])
    for u_k, y_k in zip(u, y, strict=True):
        row = np.array([[np.cos(x[0]), 0], [x[1], x[0]], [0, 1]])
        gain = p @ row.T @ np.linalg.inv(row @ p @ row.T + R)
        x = x + gain @ (y_k - [np.sin(x[0]), x[0] * x[1], x[1]])
        kept = np.eye(2) - gain @ row
        p = kept @ p @ kept.T + gain @ R @ gain.T
        yield x, p
        f = np.array([[1, DT], [-DT * 4 * np.cos(x[0]), 1]])
        x, p = np.array([x[0] + DT * x[1], x[1] + DT * (u_k - 4 * np.sin(x[0]))]), f @ p @ f.T + Q


# Central differences over h = 8e-6 with third derivatives of 4 DT at most are right to h^2 / 6 = 1e-11 and rounding's
# 1e-16 / h = 1e-11; the filter forgets, so that they are not multiplied by more than the innovations' size and 1/R.
@pytest.mark.parametrize(("name", "tolerance"), [("Exact", 1e-12), ("Differences", 1e-8)])
def test_it_is_numpys_in_josephs_form(own, name, tolerance):
    found = run_diagram(DIAGRAM.format(file=own, name=name), "u.y", "y.y", "b.x_hat", "b.P_hat")
    assert len(found["time"]) == 61
    for k, (x, p) in enumerate(filtered(found["u.y"], found["y.y"])):
        np.testing.assert_allclose(found["b.x_hat"][k], x, atol=tolerance)
        np.testing.assert_allclose(found["b.P_hat"][k], p, atol=tolerance)


def test_a_linear_system_has_the_linear_filters_estimates(tmp_path):
    (tmp_path / "linear.py").write_text(
        "import numpy as np\nfrom cosim import Block\n"
        "from cosim.blocks.extended_kalman import ExtendedKalmanFilter\n\n\n"
        'class Linear(ExtendedKalmanFilter, Block):\n    """x is a place and a speed."""\n\n'
        "    def outputs_measurement(x, h, H):\n        h[0] = x[0]\n        H[:] = np.array([[1.0, 0.0]])\n\n"
        "    def outputs_transition(x_hat, u, f, F):\n"
        "        f[:] = np.array([x_hat[0] + 0.1 * x_hat[1] + 0.005 * u[0], x_hat[1] + 0.1 * u[0]])\n"
        "        F[:] = np.array([[1.0, 0.1], [0.0, 1.0]])\n"
    )
    same = "period: 0.1, inputs: {u: u.y, y: y.y}, start: {x: [1, 2], P: [[1, 0], [0, 1]]}"
    given = "Q: [[0.1, 0], [0, 0.2]], R: [0.3]"
    text = (
        "run: {stop: 3, step: 0.1}\nblocks:\n  u: {block: Sine}\n  y: {block: Sine, parameters: {frequency: 0.3}}\n"
        f"  linear: {{block: KalmanFilter, {same}, parameters:"
        f" {{A: [[1, 0.1], [0, 1]], B: [[0.005], [0.1]], C: [[1, 0]], {given}}}}}\n"
        f"  extended: {{python: {tmp_path}/linear.py:Linear, {same}, parameters: {{{given}}}}}\n"
    )
    found = run_diagram(text, "linear.x_hat", "extended.x_hat", "linear.P_hat", "extended.P_hat")
    np.testing.assert_allclose(found["extended.x_hat"], found["linear.x_hat"], atol=1e-13)
    np.testing.assert_allclose(found["extended.P_hat"], found["linear.P_hat"], atol=1e-13)


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_compiled_interpreted_and_as_fmu_it_has_the_same_bits(own, tmp_path, version):
    """The FMU holds the sources of the filter's inputs, too: at a sample it is asked for what follows from them."""
    native, exported = tmp_path / "native.yaml", tmp_path / "exported.yaml"
    native.write_text(DIAGRAM.format(file=own, name="Differences") + "record: {signals: [b.x_hat, b.P_hat]}\n")
    fmu = export_fmu(run.load(native), [], tmp_path / "b.fmu", version)
    exported.write_text(
        f"run: {{stop: 3, step: 0.05}}\nblocks: {{f: {{fmu: {fmu}}}}}\nrecord: {{signals: [f.b.x_hat, f.b.P_hat]}}\n"
    )
    results = []
    for path, engine, name in ((native, "native", "b"), (native, "python", "b"), (exported, "native", "f.b")):
        output = tmp_path / f"{len(results)}.nc"
        assert run.Run(run.load(path), output=output, engine=engine).execute().status == "completed"
        with open_result(output) as result:
            results.append([np.array(result[f"{name}.{v}"]).reshape(61, -1) for v in ("x_hat", "P_hat")])
    for other in results[1:]:
        for expected, found in zip(results[0], other, strict=True):
            np.testing.assert_array_equal(found, expected)


def test_a_function_that_is_left_out_is_told_before_the_run(own):
    own.write_text(FILTERS.replace("outputs_transition(x_hat, u, st", "outputs_other(x_hat, u, st"))
    with pytest.raises(CosimError, match=r"block Exact defines no outputs_transition\(\)") as caught:
        run_diagram(DIAGRAM.format(file=own, name="Exact"), "b.x_hat")
    told = str(caught.value)
    assert f"{own.name}:" in told and "write `def outputs_transition(x_hat, f, F):` in it" in told


def test_a_variance_that_is_not_positive_is_refused(own):
    text = DIAGRAM.format(file=own, name="Exact").replace("0.04", "0")
    with pytest.raises(CosimError, match="R > 0"):
        run_diagram(text, "b.x_hat")


def test_a_jacobian_by_differences_is_the_derivative():
    """To h^2 / 6 times third derivatives, and rounding over h; relatively where x is large."""
    fill, result = jacobian(lambda x, _: np.array([x[0] ** 3 * x[1], np.exp(x[0] / 1e6)])), np.zeros((2, 2))
    for a, b in ((0.7, -2.0), (2e6, 3.0)):
        fill(np.array([a, b]), np.zeros(0), result)
        expected = [[3 * a * a * b, a**3], [np.exp(a / 1e6) / 1e6, 0]]
        np.testing.assert_allclose(result, expected, rtol=1e-9, atol=1e-10)
