"""`cosim compare`: the first time and signal at which two results part."""

import json
import math

import h5py
import numpy as np
import pytest

from cosim.errors import ResultError
from cosim.results.comparison import compare
from cosim.results.recorded import Recorded
from cosim.results.result_writer import ResultWriter
from cosim.terminal.cli import main


@pytest.fixture
def result(tmp_path):
    """Write a result with a signal `b.x` (k, 2) and a scalar `b.y`."""

    def write(
        name, times, x, y=None, metrics=None, more=(), unit=None, step=None, steps=0, status="completed", message=""
    ):
        path = tmp_path / name
        samples = {"b.x": x, "b.y": x[:, 0] if y is None else y, **dict.fromkeys(more, x[:, 0])}
        signals = [Recorded(n, v.shape[1:], v.dtype, unit=unit) for n, v in samples.items()]
        writer = ResultWriter(path, signals, {"settings": {"step": step}} if step else {})
        writer.append(times, samples)
        writer.close(status, message, metrics or {}, steps, end=(step or 0.0) * steps)
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


def agrees(capsys, one, two, code):
    """Compare on the command line both ways round; returns what the first said, as text and as JSON."""
    assert main(["compare", str(two), str(one)]) == code
    capsys.readouterr()
    assert main(["compare", str(one), str(two)]) == code
    text = capsys.readouterr().out
    assert main(["compare", str(one), str(two), "--json"]) == code
    return text, json.loads(capsys.readouterr().out)


def test_runs_that_ended_in_different_ways_differ(result, capsys):
    a = result("a.nc", TIMES, X, step=0.1, steps=10)
    b = result("b.nc", TIMES, X, step=0.1, steps=10, status="diverged", message="block b: state `x` is nan")
    text, found = agrees(capsys, a, b, 1)
    assert f"{a} is completed, {b} diverged: block b: state `x` is nan" in text
    assert (found["same"], found["agree"], found["status"]) == (False, False, ["completed", "diverged"])
    assert found["message"] == ["", "block b: state `x` is nan"]
    c = result("c.nc", TIMES, X, step=0.1, steps=10, status="diverged", message="block c: output `y` is nan")
    assert "diverged: block c" in agrees(capsys, b, c, 1)[0]
    assert "the same, bit by bit" in agrees(capsys, b, b, 0)[0]


def test_a_run_broken_off_between_two_samples_has_another_end(result, capsys):
    a = result("a.nc", TIMES, X, step=0.01, steps=103, status="interrupted")
    b = result("b.nc", TIMES, X, step=0.01, steps=107, status="interrupted")
    assert "ends at 1.03 s" in agrees(capsys, a, b, 1)[0]
    twice_as_fine = result("c.nc", TIMES, X, step=0.005, steps=206, status="interrupted")
    assert agrees(capsys, a, twice_as_fine, 0)[1]["same"]


def test_a_result_without_samples_is_compared_by_its_end(result, capsys):
    none = result("none.nc", TIMES[:0], X[:0], status="diverged", message="why", step=0.1)
    assert "diverged: why" in agrees(capsys, none, result("a.nc", TIMES, X, step=0.1, steps=10), 1)[0]
    agrees(capsys, none, none, 0)
    bare = result("bare.nc", TIMES[:0], X[:0])
    assert "has no sample" in agrees(capsys, bare, result("b.nc", TIMES, X), 1)[0]


@pytest.mark.parametrize("step", [1e-10, 1e-3, 1e6])
def test_times_are_compared_by_the_time_between_them(result, step):
    """Samples that are half a step apart, or ten steps of another run, whatever a step is."""
    k = np.arange(101)
    x = np.sin(k)[:, None] * [1.0, 2.0]
    fine = result("fine.nc", k * step, x)
    assert compare(fine, result("same.nc", k * step, x)).same
    found = compare(fine, result("tenth.nc", np.arange(11) * (10 * step), x[::10]))
    assert (found.samples, found.parted, found.ends) == (11, None, None)
    found = compare(fine, result("half.nc", np.concatenate(([0.0], (k[:-1] + 0.5) * step)), x))
    assert found.samples == 1
    assert compare(fine, result("short.nc", k[:-1] * step, x[:-1])).ends == (100 * step, 99 * step)


def test_long_runs_of_small_steps_meet_where_their_times_do(result):
    """After 1e5 s the times of two recordings, of 1e-6 and 3e-6 s, are rounded to 1.5e-11 s."""
    k = np.concatenate((np.arange(7), 10**11 + np.arange(7)))
    x = np.sin(k)[:, None] * [1.0, 2.0]
    every_third = k % 3 == 0
    a, b = result("a.nc", k * 1e-6, x), result("b.nc", (k[every_third] // 3) * 3e-6, x[every_third])
    found = compare(a, b)
    assert (found.samples, found.parted) == (every_third.sum(), None)


@pytest.mark.parametrize(
    ("one", "two", "agree"),
    [
        (math.inf, math.inf, True),
        (math.nan, math.nan, True),
        (math.inf, math.nan, False),
        (math.inf, -math.inf, False),
        (math.inf, None, False),
        (math.nan, None, False),
        (math.inf, 1.0, False),
        (None, None, True),
        ([1.0, math.nan], [1.0, math.nan], True),
        ([1.0, 1e-9], [1.0 + 1e-12, 0.0], True),
        ([1.0, 2.0], [1.0, 2.1], False),
        ([1.0, 2.0], [1.0], False),
        ([[1.0], [math.inf]], [[1.0], [math.inf]], True),
        ([{"pair": [1, 2], "time": 1.0}], [{"pair": [1, 2], "time": 1.0 + 1e-12}], True),
        ([{"pair": [1, 2], "time": 1.0}], [{"pair": [1, 3], "time": 1.0}], False),
        ([{"pair": [1, 2], "time": 1.0}], [], False),
        (2**63 - 1, 2**63 - 1, True),
    ],
)
def test_metrics_are_compared_as_what_they_are(result, capsys, one, two, agree):
    a, b = (result(f"{n}.nc", TIMES, X, metrics={"m": value}) for n, value in (("a", one), ("b", two)))
    assert compare(a, b).figures == ([] if agree else ["m"])
    text, _ = agrees(capsys, a, b, 0 if agree else 1)
    if one == math.inf:
        assert "inf" in text.splitlines()[3]


def test_a_unit_that_differs_is_said_and_a_difference(result, capsys):
    a, b = result("a.nc", TIMES, X, unit="m"), result("b.nc", TIMES, X, unit="rad")
    text, found = agrees(capsys, a, b, 1)
    assert f"b.x has the unit m in {a} and rad in {b}" in text
    assert found["units"] == {"b.x": ["m", "rad"], "b.y": ["m", "rad"]}
    for equal in (None, "m", ("m", "m")):
        assert agrees(capsys, a, result("c.nc", TIMES, X, unit=equal), 0)[1]["same"]
    # What nobody can read, as another tool may write it, is itself and nothing else.
    furlong = result("f.nc", TIMES, X, unit="furlong")
    agrees(capsys, furlong, result("g.nc", TIMES, X, unit="ell"), 1)
    assert agrees(capsys, furlong, result("h.nc", TIMES, X, unit="furlong"), 0)[1]["same"]
    pose = result("d.nc", TIMES, X, unit=("m", "rad"))
    assert f"m in {a} and m, rad in" in agrees(capsys, a, pose, 1)[0]


def test_numbers_of_two_types_are_compared_by_value(result, capsys):
    x = X.astype(np.float32)
    a, b = result("a.nc", TIMES, x), result("b.nc", TIMES, x.astype(float))
    text, found = agrees(capsys, a, b, 0)
    assert f"b.x has the type float32 in {a} and float64 in {b}" in text
    assert "they part" not in text and "the same, number by number" in text
    assert (found["same"], found["agree"], found["parted"]) == (False, True, None)
    text, found = agrees(capsys, a, result("c.nc", TIMES, X), 0)
    assert "they part at t = 0.1 s" in text and "never by more than 1e-06" in text
    flags = X > 0.5
    assert agrees(capsys, result("d.nc", TIMES, flags), result("e.nc", TIMES, flags.astype(np.int64)), 0)[1]["types"]


def test_whole_numbers_are_compared_to_the_last(result, capsys):
    k = np.array([[2**63 - 1, 2**63 - 2]] * 11)
    other = k.copy()
    other[3, 1] += 1
    text, _ = agrees(capsys, result("a.nc", TIMES, k), result("b.nc", TIMES, other, y=k[:, 0]), 1)
    assert "b.x[2] is 9223372036854775806 and 9223372036854775807" in text


def test_a_signal_of_another_shape_is_in_both(result, capsys):
    a, b = result("a.nc", TIMES, X), result("b.nc", TIMES, X[:, [0, 1, 1]])
    text, found = agrees(capsys, a, b, 1)
    assert f"b.x has the shape (2,) in {a} and (3,) in {b}" in text and "only in" not in text
    assert found["shapes"] == {"b.x": [[2], [3]]} and found["only"] == [[], []]


def test_no_number_is_small_beside_a_signal_that_is_zero(result, capsys):
    agrees(capsys, result("a.nc", TIMES, X * 0), result("b.nc", TIMES, X * 1e-9), 1)


def test_the_smallest_difference_counts_where_none_is_tolerated(result):
    x = X * [0.0, 1e10]
    other = x.copy()
    other[2, 0] = 5e-324
    a, b = result("a.nc", TIMES, x), result("b.nc", TIMES, other, y=x[:, 0])
    assert not compare(a, b, 0.0).agrees and compare(a, b, 1e-6).agrees


def test_results_without_signals_are_compared_by_their_metrics(tmp_path, capsys):
    for name, value in (("a", 1.0), ("b", 2.0)):
        writer = ResultWriter(tmp_path / f"{name}.nc", [], {})
        writer.append(TIMES, {})
        writer.close("completed", metrics={"m": value})
    assert "metrics that differ" in agrees(capsys, tmp_path / "a.nc", tmp_path / "b.nc", 1)[0]
    agrees(capsys, tmp_path / "a.nc", tmp_path / "a.nc", 0)


def test_results_of_one_name_are_told_apart_by_their_folders(result, tmp_path, capsys):
    (tmp_path / "old").mkdir()
    a, b = result("old/run.nc", TIMES, X, metrics={"m": 1.0}), result("run.nc", TIMES, X, metrics={"m": 1.0})
    text, _ = agrees(capsys, a, b, 0)
    assert "old/run" in text.splitlines()[1] and f"{tmp_path.name}/run" in text.splitlines()[1]


@pytest.mark.parametrize(
    ("ours", "agree"), [([1000.0005, 1.0], True), ([1000.0, 1.0005], True), ([1000.0, 1.01], False)]
)
def test_a_list_of_numbers_is_as_large_as_its_largest(result, ours, agree):
    """A tolerance of 1e-6 is 1e-3 beside 1000."""
    a = result("a.nc", TIMES, X, metrics={"last": [1000.0, 1.0]})
    assert compare(a, result("b.nc", TIMES, X, metrics={"last": ours})).agrees == agree
