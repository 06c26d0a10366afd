"""Two lags, one after the other, whose motion is known, in a folder of their own."""

from __future__ import annotations

import pytest

BLOCKS = """
from cosim import Block, Input, Output, Parameter, State


class Lag(Block):
    \"\"\"First-order lag, T dx/dt = u - x.\"\"\"

    u = Input()
    x = State(output=True)
    y = Output()
    T = Parameter(unit="s", default=1.0)

    def derivatives(u, x, T, d_x):
        d_x[0] = (u - x) / T

    def outputs(u, x, y):
        y[0] = u + x
"""
DIAGRAM = """
title: Two lags
run: {stop: 1, step: 0.01}
blocks:
  first: {python: lag.py:Lag, start: {u: 1}}
  second: {python: lag.py:Lag, inputs: {u: first.y}, parameters: {T: 0.5}}
record: {period: 0.1, signals: [first.x, second.x, second.y]}
metrics:
  last: {signal: second.x, reduce: final}
  largest: {signal: second.y, reduce: max}
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The working folder, with `lag.py` and `lags.yaml`."""
    (tmp_path / "lag.py").write_text(BLOCKS, encoding="utf-8")
    (tmp_path / "lags.yaml").write_text(DIAGRAM, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path
