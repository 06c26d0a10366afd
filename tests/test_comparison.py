"""`cosim compare`: the first time and signal at which two results part."""

import json

import h5py
import numpy as np
import pytest

from cosim.cli import main
from cosim.comparison import compare
from cosim.errors import ResultError
from cosim.results import ResultWriter, Signal


@pytest.fixture
def result(tmp_path):
    """Write a result with a signal `b.x` (k, 2) and a scalar `b.y`."""

    def write(name, times, x, y=None, metrics=None, more=()):
        path = tmp_path / name
        samples = {"b.x": x, "b.y": x[:, 0] if y is None else y, **{m: x[:, 0] for m in more}}
        signals = [Signal(n, v.shape[1:], v.dtype) for n, v in samples.items()]
        writer = ResultWriter(path, signals, {})
        writer.append(times, samples)
        writer.close("completed", metrics=metrics or {})
        return path

    return write


TIMES = np.linspace(0, 1, 11)
X = np.sin(TIMES)[:, None] * [1.0, 100.0]


def test_equal_results_are_the_same(result):
    x = X.copy()
    x[3, 0] = np.nan
    found = compare(result("a.nc", TIMES, x), result("b.nc", TIMES, x))
    assert found.parted is None and found.beyond is None
    assert found.samples == 11


def test_the_first_bit_and_the_first_that_matters(result):
    other = X.copy()
    other[4, 1] = np.nextafter(other[4, 1], 1)
    other[7, 0] += 0.5
    other[6, 1] += 1e-3  # small beside 100
    found = compare(result("a.nc", TIMES, X), result("b.nc", TIMES, other, y=X[:, 0]), tolerance=1e-4)
    assert (found.parted.signal, found.parted.time) == ("b.x[2]", TIMES[4])
    assert (found.beyond.signal, found.beyond.time) == ("b.x[1]", TIMES[7])
    assert found.beyond.values == (X[7, 0], X[7, 0] + 0.5)


def test_signed_zeros_and_nan_differ_in_bits(result):
    a, b = np.zeros((11, 2)), np.zeros((11, 2))
    b[2, 0] = -0.0
    found = compare(result("a.nc", TIMES, a), result("b.nc", TIMES, b, y=a[:, 0]))
    assert found.parted.time == TIMES[2] and found.beyond is None
    b[5, 1] = np.nan
    assert compare(result("a.nc", TIMES, a), result("b.nc", TIMES, b, y=a[:, 0])).beyond.time == TIMES[5]


def test_only_common_times_and_signals_are_compared(result):
    fine = np.linspace(0, 1, 101)
    x = np.sin(fine)[:, None] * [1.0, 100.0]
    a = result("a.nc", fine, x, more=["b.extra"])
    b = result("b.nc", TIMES, x[::10])
    found = compare(a, b)
    assert found.samples == 11
    assert found.parted is None
    assert found.only == (["b.extra"], [])
    with pytest.raises(ResultError, match="no time in common"):
        compare(b, result("c.nc", TIMES + 5, X))


def test_the_command_line(result, capsys):
    a = result("a.nc", TIMES, X, metrics={"m": 2.0, "only_a": 1})
    b = result("b.nc", TIMES, X * 1.5, metrics={"m": 3.0})
    assert main(["compare", str(a), str(b)]) == 1
    output = capsys.readouterr().out
    assert "+50.0 %" in output and "b.x[1] is" in output and "they part at t = 0.1 s" in output
    assert main(["compare", str(a), str(b), "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    assert (found["same"], found["parted"]["signal"], found["parted"]["time"]) == (False, "b.x[1]", 0.1)
    assert main(["compare", str(a), str(a)]) == 0
    assert "the same, bit by bit" in capsys.readouterr().out
    assert main(["compare", str(a), "none.nc"]) == 2


@pytest.mark.parametrize("tolerance", ["nan", "-1", "inf", "much"])
def test_a_tolerance_that_compares_nothing_is_refused(result, tolerance, capsys):
    path = str(result("a.nc", TIMES, X))
    assert main(["compare", path, path, "--tolerance", tolerance]) == 2
    assert "--tolerance" in capsys.readouterr().err


def test_the_exit_code_is_1_beyond_the_tolerance_only(result, capsys):
    a, b = str(result("a.nc", TIMES, X)), str(result("b.nc", TIMES, X * (1 + 1e-9)))
    assert main(["compare", a, b]) == 0
    assert "never by more than 1e-06" in capsys.readouterr().out
    assert main(["compare", a, b, "--tolerance", "1e-10"]) == 1


@pytest.mark.parametrize(
    ("other", "said"),
    [
        ({"metrics": {"m": 2.0, "gap": None}}, "metrics that differ by more than 1e-06: m"),
        ({"metrics": {"gap": None}}, "metrics that differ by more than 1e-06: m"),
        ({"more": ["b.extra"]}, "b.nc: b.extra"),
        ({"times": TIMES[:-1], "x": X[:-1]}, "ends at 1 s, "),
    ],
)
def test_metrics_signals_and_an_early_end_are_differences(result, capsys, other, said):
    same = {"times": TIMES, "x": X, "metrics": {"m": 1.0, "gap": None}}
    a, b = str(result("a.nc", **same)), str(result("b.nc", **{**same, **other}))
    assert main(["compare", a, a]) == 0
    capsys.readouterr()
    assert main(["compare", a, b]) == 1
    output = capsys.readouterr().out
    assert said in output and "are the same" not in output.replace("recorded they are the same", "")
    assert main(["compare", a, b, "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    assert (found["same"], found["agree"]) == (False, False)


def test_a_longer_period_is_no_early_end(result):
    a, b = result("a.nc", TIMES, X), result("b.nc", TIMES[::3], X[::3])  # the last sample is at 0.9 s
    assert compare(a, b).agrees and compare(b, a).agrees


def test_of_several_signals_the_largest_difference_and_the_first_time_are_told(result):
    """b.y differs most, b.x beyond the tolerance first."""
    x, y = X.copy(), X[:, 0].copy()
    x[3, 0] += 0.5
    y[6] += 0.7
    found = compare(result("a.nc", TIMES, X), result("b.nc", TIMES, x, y=y))
    assert (found.beyond.signal, found.beyond.time) == ("b.x[1]", TIMES[3])
    assert found.largest == ("b.y", pytest.approx(0.7 / np.sin(1)))
    x[3, 0], y[6], y[2] = X[3, 0], X[6, 0], y[2] + 0.1
    x[5, 1] += 90
    found = compare(result("a.nc", TIMES, X), result("b.nc", TIMES, x, y=y))
    assert (found.beyond.signal, found.beyond.time) == ("b.y", TIMES[2])
    assert found.largest[0] == "b.x"


def test_metrics_that_are_no_mapping_are_told_in_words(result, capsys):
    path = result("a.nc", TIMES, X)
    with h5py.File(path, "r+") as file:
        file.attrs["metrics"] = "[1, 2]"
    assert main(["compare", str(path), str(result("b.nc", TIMES, X))]) == 2
    assert f"cannot read {path}: its metrics are damaged" in capsys.readouterr().err
