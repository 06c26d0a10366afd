"""FMI 2's Co-Simulation with inputs that go on in a step: the orders that theory gives, against a closed form.

A native block z' = -x and an FMU x' = u - x, u = z, which solves its own equation to rounding: all error is coupling.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

from cosim.engine import run
from cosim.errors import DiagramErrors
from cosim.results.result_file import open_result
from tests.fmu import machine
from tests.fmu.machine import Model, V

NATIVE = '''
from cosim import Block, Input, State


class Integral(Block):
    """dz/dt = -x, of two elements."""

    x = Input(2)
    z = State(2, output=True, start=[1.0, -2.0])

    def derivatives(x, d_z):
        for k in range(2):
            d_z[k] = -x[k]
'''
TEXT = """
run: {{stop: 1, step: {step}, method: {method}, extrapolation: {order}, integrator: rk4, inner_steps: 4}}
fleets: {{robot: 3}}
blocks:
  follower:
    {{fmu: {fmu}, per: robot, inputs: {{u: integral.z}}, ports: {{u: "u_{{1..2}}", x: "x_{{1..2}}"}},
     start: {{x: [[0.5, 0], [1, 1], [0, 0]]}}{more}}}
  integral: {{python: own.py:Integral, per: robot, inputs: {{x: follower.x}}}}
record: {{signals: [follower.x, integral.z]}}
"""
VARIABLES = tuple(V(f"u_{k}", k, "Float64", "input", "0") for k in (1, 2)) + tuple(
    V(f"x_{k}", 10 + k, "Float64", "output", "0", initial="exact") for k in (1, 2)
)
FLAGS = 'canInterpolateInputs="true" canHandleVariableCommunicationStepSize="true" canGetAndSetFMUstate="true"'


@pytest.fixture(scope="module")
def smooth(tmp_path_factory):
    """The FMU with and without the flag."""
    source = Path(__file__).with_name("smooth.c")
    folder = tmp_path_factory.mktemp("smooth")
    model = Model("smooth", VARIABLES)
    return {
        flags: machine.pack(folder / str(k), 2, model, source, "cs", flags)
        for k, flags in enumerate((FLAGS, FLAGS.partition(" ")[2]))
    }


@pytest.fixture
def error(smooth, tmp_path):
    """The largest error at the end."""
    (tmp_path / "own.py").write_text(NATIVE)

    def measured(step, method="jacobi", order=0, more="", engine="native"):
        text = TEXT.format(step=step, method=method, order=order, fmu=smooth[FLAGS], more=more)
        (tmp_path / "d.yaml").write_text(text)
        outcome = run.Run(run.load(tmp_path / "d.yaml"), engine, tmp_path / "d.nc").execute()
        assert outcome.status == "completed", outcome.error
        with open_result(tmp_path / "d.nc") as result:
            x, z = result["follower.x"][-1], result["integral.z"][-1]
        exact = expm(np.array([[-1.0, 1.0], [-1.0, 0.0]]))
        starts = np.array([[[0.5, 0], [1, 1], [0, 0]], [[1, -2]] * 3])
        wanted = np.einsum("ij,jrk->irk", exact, starts)
        return max(np.abs(x - wanted[0]).max(), np.abs(z - wanted[1]).max())

    return measured


@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel"])
@pytest.mark.parametrize("order", [0, 1, 2])
def test_extrapolation_gives_its_order(error, method, order):
    errors = [error(step, method, order) for step in (0.05, 0.025, 0.0125)]
    found = np.log2(errors[:-1]) - np.log2(errors[1:])
    assert found == pytest.approx(order + 1, abs=0.25)


@pytest.mark.parametrize("order", [0, 1, 2])
def test_iterated_gives_one_more(error, order):
    """But no more than 3: the first step has nothing but its begin and its end to go by, and errs by h^3 each time."""
    errors = [error(step, "iterated", order) for step in (0.1, 0.05, 0.025)]
    found = np.log2(errors[:-1]) - np.log2(errors[1:])
    assert found == pytest.approx(min(order + 2, 3), abs=0.3)


def test_in_a_process_of_its_own_the_same(error):
    assert error(0.05, "jacobi", 2) == error(0.05, "jacobi", 2, ", isolate: true")


def test_both_engines_alike(error):
    assert error(0.05, "iterated", 1) == error(0.05, "iterated", 1, engine="python")


def test_an_fmu_that_holds_its_inputs_says_so(smooth, tmp_path):
    (tmp_path / "own.py").write_text(NATIVE)
    text = TEXT.format(step=0.1, method="jacobi", order=0, fmu=smooth[FLAGS.partition(" ")[2]], more="")
    text = text.replace("u: integral.z", "u: {from: integral.z, extrapolation: 1}")
    (tmp_path / "d.yaml").write_text(text)
    with pytest.raises(DiagramErrors, match=r"this FMU holds its inputs.*canInterpolateInputs"):
        run.load(tmp_path / "d.yaml")
