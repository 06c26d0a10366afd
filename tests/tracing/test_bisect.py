"""Where two runs part, why, and what explains it, where all of that is known."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from cosim.authoring.variables import Parameter
from cosim.engine import run
from cosim.terminal import cli
from cosim.tracing import causes, forks, shares

LAGS = """
run: {stop: 1, step: 0.1}
blocks:
  input: {block: Sine}
  first: {block: FirstOrder, parameters: {T: 0.5}, inputs: {u: input.y}}
  second: {block: FirstOrder, parameters: {T: 0.5}, inputs: {u: first.x}}
  twice: {block: Gain, parameters: {k: 2}, inputs: {u: second.x}}
metrics:
  last: {signal: twice.y, reduce: final}
"""
PRODUCT = """
run: {stop: 1, step: 0.1}
blocks:
  a: {block: Constant, parameters: {value: 2}}
  b: {block: Gain, parameters: {k: 3}, inputs: {u: a.y}}
metrics:
  product: {signal: b.y, reduce: final}
  other: {signal: a.y, reduce: final}
"""
CODE = '''\
from cosim import Block, Input, State


class Filter(Block):
    """A filter whose gain is written in its code."""

    u = Input()
    x = State(output=True)

    def derivatives(u, x, d_x):
        d_x[0] = 2.0 * (u - x)
'''


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, text in (("lags", LAGS), ("product", PRODUCT)):
        Path(f"{name}.yaml").write_text(text)
    return tmp_path


def bisect(capsys, *words: str) -> tuple[int, dict]:
    code = cli.main(["bisect", *words, "--json"])
    return code, json.loads(capsys.readouterr().out)


def test_a_time_constant_acts_one_step_after_its_input_does(folder, capsys):
    """Euler: the input is 0 at 0 s, so that the first lag moves at 0.2 s, and the second one at 0.3 s."""
    code, found = bisect(capsys, "lags.yaml", "--set", "blocks.second.parameters.T=0.4")
    h, u = 0.1, math.sin(2 * math.pi * 0.1)
    values = [h / T * (h / 0.5 * u) for T in (0.5, 0.4)]
    assert (code, found["step"], found["time"]) == (1, 3, pytest.approx(0.3))
    (cause,) = found["causes"]
    assert (cause["signal"], cause["element"]) == ("second.x", [])
    assert cause["values"] == pytest.approx(values, rel=1e-12)
    assert cause["changes"] == ["parameter T: 0.5 → 0.4"]
    assert [(one["signal"], one["by"]) for one in found["carried"]] == [("twice.y", ["second.x"])]
    change = found["metrics"]["last"][1] - found["metrics"]["last"][0]
    assert found["shares"] == {"blocks.second.parameters.T": {"last": pytest.approx(change, rel=1e-12)}}


def test_a_person_reads_the_signal_its_values_the_change_and_the_share(folder, capsys):
    assert cli.main(["bisect", "lags.yaml", "--set", "blocks.second.parameters.T=0.4"]) == 1
    lines = [" ".join(line.split()) for line in capsys.readouterr().out.splitlines()]
    assert lines[0] == "the runs part at t = 0.3 s, after 3 steps:"
    assert lines[1].startswith("second.x 0.02") and "→" in lines[1]
    assert lines[2] == "second: parameter T: 0.5 → 0.4"
    assert any(line.startswith("last ") and line.endswith("blocks.second.parameters.T 100 %") for line in lines)


def test_an_interrupt_of_a_run_is_one_of_the_command(folder, monkeypatch):
    class Interrupted:
        def __init__(self, network):
            self.signal = 2

        def execute(self):
            return self

    monkeypatch.setattr(shares, "Run", Interrupted)
    with pytest.raises(KeyboardInterrupt):
        shares.shares(run.load("lags.yaml"), run.load("lags.yaml", ["blocks.second.parameters.T=0.4"]))


@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel", "joint"])
def test_what_is_changed_is_the_cause_under_every_method(folder, capsys, method):
    Path("other.yaml").write_text(LAGS.replace("step: 0.1", f"step: 0.1, method: {method}, integrator: rk4"))
    code, found = bisect(capsys, "other.yaml", "--set", "blocks.first.parameters.T=0.25")
    assert code == 1
    assert {cause["signal"] for cause in found["causes"]} == {"first.x"}


def test_two_keys_share_as_shapley_says(folder, capsys):
    """Of 2 · 3 → 4 · 5: (4·3 - 2·3 + 4·5 - 2·5) / 2 = 8 by the first factor, 6 by the second, nothing together."""
    changes = ["--set", "blocks.a.parameters.value=4", "--set", "blocks.b.parameters.k=5"]
    code, found = bisect(capsys, "product.yaml", *changes)
    assert (code, found["step"], found["time"]) == (1, 0, 0.0)
    assert {cause["signal"] for cause in found["causes"]} == {"a.y"} | {"b.y"}
    assert found["shares"] == {
        "blocks.a.parameters.value": {"product": 8.0, "other": 2.0},
        "blocks.b.parameters.k": {"product": 6.0, "other": 0.0},
    }


def test_three_factors_have_something_that_none_explains_alone():
    """1 → 2 each, product 8: each alone explains ((2 - 1) + (8 - 4)) / 2 = 5/2, and 7 - 15/2 is left."""
    each = {name: shares.Contribution(name, (), {"p": 2.5}) for name in "abc"}
    assert shares.Shares(({"p": 1.0}, {"p": 8.0}), tuple(each.values())).together("p") == -0.5


def test_the_same_diagram_has_the_same_bits(folder, capsys):
    code, found = bisect(capsys, "lags.yaml", "--set", "metrics.more={signal: first.x, reduce: max}")
    assert (code, found["same"], found["until"]) == (0, True, 1.0)
    assert bisect(capsys, "lags.yaml", "--set", "run.stop=0.4")[1]["until"] == 0.4
    assert cli.main(["bisect", "lags.yaml", "lags.yaml"]) == 0
    assert "to the bit" in capsys.readouterr().out


def test_code_that_differs_is_named(folder, capsys):
    Path("one.py").write_text(CODE)
    Path("other.py").write_text(CODE.replace("2.0 *", "2.0000001 *"))
    text = LAGS.replace(
        "block: FirstOrder, parameters: {T: 0.5}, inputs: {u: first.x}", "python: one.py:Filter, inputs: {u: first.x}"
    )
    Path("code.yaml").write_text(text)
    code, found = bisect(capsys, "code.yaml", "--swap", "second=other.py:Filter")
    assert (code, found["step"]) == (1, 3)
    assert [(c["signal"], c["changes"]) for c in found["causes"]] == [("second.x", ["the code of derivatives()"])]
    assert list(found["shares"]) == ["blocks.second"]


def test_runs_with_other_steps_are_compared_at_the_times_that_both_have(folder, capsys):
    code, found = bisect(capsys, "lags.yaml", "--set", "run.step=0.05")
    assert (code, found["step"], found["time"]) == (1, 1, pytest.approx(0.1))  # half the step sees the input at 0.05 s
    assert list(found["shares"]) == ["run.step"]


def test_a_run_that_fails_where_the_other_does_not_is_told(folder, capsys):
    Path("tank.py").write_text(
        CODE.replace("        d_x", "        if u > LIMIT:\n            raise ValueError('full')\n        d_x").replace(
            "class", "LIMIT = 9.0\n\n\nclass", 1
        )
    )
    Path("full.py").write_text(Path("tank.py").read_text().replace("LIMIT = 9.0", "LIMIT = 0.5"))
    Path("full.yaml").write_text(
        LAGS.replace(
            "block: FirstOrder, parameters: {T: 0.5}, inputs: {u: input.y}",
            "python: tank.py:Filter, inputs: {u: input.y}",
        )
    )
    a, b = run.load("full.yaml"), run.load("full.yaml", swaps=["first=full.py:Filter"])
    found = forks.fork(a, b)
    assert not found.branches and found.is_one
    assert found.ends[0] == "" and "full" in found.ends[1]
    assert cli.main(["bisect", "full.yaml", "--swap", "first=full.py:Filter"]) == 1
    out = capsys.readouterr().out
    assert "A: comes to its end" in out and "B: block first: derivatives() failed" in out


def test_a_run_that_fails_is_no_success_where_the_other_fails_alike(folder, capsys):
    Path("full.py").write_text(CODE.replace("        d_x", "        raise ValueError('full')\n        d_x"))
    Path("full.yaml").write_text("run: {stop: 1, step: 0.1}\nblocks: {f: {python: full.py:Filter, start: {u: 1}}}\n")
    assert cli.main(["bisect", "full.yaml"]) == 1
    out = capsys.readouterr().out
    assert "both end there" in out and "ValueError: full" in out and "nan" not in out


def test_signals_of_another_shape_are_a_difference(folder, capsys):
    Path("fleet.yaml").write_text(
        "run: {stop: 1, step: 0.1}\nfleets: {robot: 3}\nblocks: {s: {block: Sine, per: robot}, t: {block: Sine}}\n"
    )
    code, found = bisect(capsys, "fleet.yaml", "--set", "fleets.robot=4")
    assert (code, found["same"], found["unlike"]) == (1, False, {"s.y": ["float64 (3,)", "float64 (4,)"]})
    assert cli.main(["bisect", "fleet.yaml", "--set", "fleets.robot=4"]) == 1
    assert "s.y cannot be compared: float64 (3,) → float64 (4,)" in capsys.readouterr().out


def test_runs_without_anything_in_common_are_not_the_same(folder, capsys):
    code, found = bisect(capsys, "lags.yaml", "product.yaml")
    assert (code, found["same"], found["causes"]) == (1, False, [])


def test_what_goes_through_a_joined_input_is_carried(folder, capsys):
    """The mean's input is joined of both lags."""
    text = LAGS.replace("metrics:", "  mean: {block: Mean, inputs: {u: [first.x, second.x]}}\nmetrics:")
    Path("joined.yaml").write_text(text)
    _, found = bisect(capsys, "joined.yaml", "--set", "blocks.first.parameters.T=0.4")
    carried = {one["signal"]: one["by"] for one in found["carried"]}
    assert [cause["signal"] for cause in found["causes"]] == ["first.x"]
    assert carried["mean.y"] == ["first.x"]


def test_a_constant_of_any_block_of_the_formation_is_found(formation):
    """Each number of each block is changed by a tenth of a per cent; where anything parts, that block is the cause."""
    network = run.load(formation, ["run.stop=0.2"])
    found = set()
    for name, component in network.components.items():
        for variable in component.declaration.of(Parameter):
            value = component.values.get(variable.name)
            if value is None or value.dtype.kind != "f" or not np.all(np.isfinite(value)) or not value.any():
                continue
            nested = (value * 1.001).tolist()
            setting = f"blocks.{name}.parameters.{variable.name}={json.dumps(nested if len(nested) > 1 else nested[0])}"
            try:
                other = run.load(formation, ["run.stop=0.2", setting])
            except Exception:  # noqa: BLE001, S112  # a rule of the block refuses it
                continue
            fork = forks.fork(network, other)
            if fork.is_one:
                told = causes.trail(network, other, fork).causes
                assert {cause.signal.component for cause in told} == {name}, setting
                assert any(variable.name in change for cause in told for change in cause.changes)
                found.add(name)
            break
    assert len(found) >= 8
