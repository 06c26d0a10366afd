"""State events of FMUs: a ball in Model Exchange, and a native one as our own FMU, against the closed form."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import cosim
from cosim.engine import run
from cosim.errors import FmuError
from cosim.results.result_file import open_result
from tests.fmu import ball

BALL = """
from cosim import Block, Indicator, Parameter, State


class Ball(Block):
    e = Parameter(default=0.7)
    h = State(output=True, start=1.0)
    v = State(output=True)
    bounces = State(output=True, start=0, dtype="int32")
    last = State(output=True, start=-1.0)
    ground = Indicator(crossing="falling")

    def derivatives(v, d_h, d_v):
        d_h[0] = v
        d_v[0] = -9.81

    def indicators(h, ground):
        ground[0] = h

    def event(time, ground, v, e, bounces, next_v, next_bounces, next_last):
        if ground < 0:
            next_v[0] = -e * v
            next_bounces[0] = bounces + 1
            next_last[0] = time
"""
TEXT = """
run: {{stop: 1.9, step: 0.01, method: {method}, integrator: heun}}
blocks:
  b: {{fmu: {fmu}{more}}}
record: {{signals: [b.h, b.bounces, b.last]}}
"""


@pytest.fixture(scope="module")
def balls(tmp_path_factory):
    folder = tmp_path_factory.mktemp("balls")
    return {(v, keeps): ball.build(folder / f"{v}{keeps}", v, keeps) for v in (2, 3) for keeps in (True, False)}


def recorded(tmp_path, text, *settings, engine="native"):
    """Times, heights, bounces, and the time of the last one."""
    (tmp_path / "d.yaml").write_text(text)
    output = tmp_path / "d.nc"
    outcome = run.Run(run.load(tmp_path / "d.yaml", settings), engine, output).execute()
    assert outcome.status == "completed", outcome.error
    with open_result(output) as result:
        return result.times, result["b.h"], result["b.bounces"], result["b.last"]


def check(times, h, bounces, last):
    """Against the closed form: hits at v/g (1 + 2 e + 2 e² + …)."""
    hits = [math.sqrt(2 / 9.81)]
    for k in range(1, 12):
        hits.append(hits[-1] + 2 * hits[0] * 0.7**k)
    assert bounces[-1] == 4
    for time, n, at in zip(times, bounces, last, strict=True):
        assert n == sum(hit <= time for hit in hits)
        assert n == 0 or at == pytest.approx(hits[n - 1], abs=1e-9)
    assert h.min() > -1e-9


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel", "iterated", "joint"])
def test_a_ball_in_model_exchange_bounces_when_it_hits_the_ground(balls, tmp_path, method, version, engine):
    text = TEXT.format(method=method, fmu=balls[version, True], more=", mode: model-exchange")
    check(*recorded(tmp_path, text, engine=engine))


@pytest.mark.parametrize("version", [2, 3])
def test_in_a_process_of_its_own_too(balls, tmp_path, version):
    text = TEXT.format(method="jacobi", fmu=balls[version, True], more=", mode: model-exchange, isolate: true")
    check(*recorded(tmp_path, text))


@pytest.mark.parametrize("version", [2, 3])
def test_one_that_cannot_go_back_is_looked_at_once_a_step(balls, tmp_path, version):
    text = TEXT.format(method="jacobi", fmu=balls[version, False], more=", mode: model-exchange")
    _, h, bounces, last = recorded(tmp_path, text)
    assert last[-1] == pytest.approx(round(last[-1], 2), abs=1e-9) and -0.05 < h.min() < 0 and bounces[-1] >= 3


@pytest.mark.parametrize("version", [2, 3])
def test_a_native_ball_as_our_own_fmu_bounces_alike(tmp_path, version):
    """Co-Simulation: the FMU finds its events inside its steps."""
    (tmp_path / "ball.py").write_text(BALL)
    native = TEXT.format(method="jacobi", fmu="x", more="").replace("fmu: x", "python: ball.py:Ball")
    wanted = recorded(tmp_path, native)
    check(*wanted)
    (tmp_path / "native.yaml").write_text(native)
    exported = tmp_path / "ball.fmu"
    cosim.export_fmu(cosim.load(tmp_path / "native.yaml").network, ["b"], exported, f"{version}.0")
    found = recorded(tmp_path, TEXT.format(method="jacobi", fmu=exported, more=""))
    assert all(np.array_equal(one, two) for one, two in zip(wanted, found, strict=True))


@pytest.mark.parametrize("version", [2, 3])
def test_what_needs_to_go_back_is_refused_where_an_fmu_cannot(balls, tmp_path, version):
    text = TEXT.format(method="jacobi", fmu=balls[version, False], more=", mode: model-exchange")
    (tmp_path / "d.yaml").write_text(text)
    for setting, fix in (
        ("run.method=iterated", "another run.method"),
        ("run.coupling_tolerance=0.1", "rollback: false"),
    ):
        with pytest.raises(FmuError, match="cannot go back to a state") as caught:
            run.Run(run.load(tmp_path / "d.yaml", [setting]))
        assert fix in caught.value.fix and Path(caught.value.position.file).name == "d.yaml"
