"""Reductions of a signal over time: the same figures however the samples come in batches."""

from __future__ import annotations

import json
import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim.errors import MetricError
from cosim.results.metrics import REDUCTIONS, for_json, from_json, reduction

TIMES = np.arange(301) * 0.1


def reduce(name, times, samples, start=None, stop=None, batches=7):
    """The value of a reduction that gets the samples in batches."""
    samples = np.asarray(samples)
    figure = reduction(name, start, stop, samples.dtype, samples.shape[1:])
    for part in np.array_split(np.arange(len(times)), batches):
        figure.update(times[part], samples[part])
    return figure.value()


def bits(value):
    """What a value is to the last bit; signed zeros are two."""
    return repr(value)


@given(st.lists(st.integers(0, 301), max_size=40), st.integers(0, 2**32 - 1))
def test_batches_do_not_matter(cuts, seed):
    """Every reduction gives the same bits for every split, of numbers from 1e-300 to 1e150 and of both zeros."""
    random = np.random.default_rng(seed)
    x = random.normal(size=(len(TIMES), 2, 3)) * 10.0 ** random.uniform(-300, 150, (len(TIMES), 1, 3))
    x *= random.integers(0, 2, x.shape)
    rows = np.where(random.random((len(TIMES), 4, 1)) < 0.5, [[1.0, 2.0, 0.0]], np.nan)
    for samples, names in ((x, ["max", "min", "mean", "rms", "final"]), (x > 0, ["first", "mean"]), (rows, ["events"])):
        for name in names:
            figure = reduction(name, None, None, samples.dtype, samples.shape[1:])
            for part in np.split(np.arange(len(TIMES)), sorted(cuts)):
                figure.update(TIMES[part], samples[part])
            assert bits(figure.value()) == bits(reduce(name, TIMES, samples, batches=1)), name


def test_a_mean_is_the_nearest_number_to_the_true_one():
    """Numbers that cancel: in float64, whatever the order, nothing of the small ones would be left."""
    x = np.array([1e300, 1.0, -1e300, 1e-300, 5e-324, 0.1, -0.0, -1e16, 1e16])
    assert reduce("mean", np.arange(9.0), x) == float(sum(map(Fraction, x.tolist())) / 9)
    tenths = np.full(300_000, 0.1)
    assert reduce("mean", np.arange(300_000.0), tenths) == 0.1


def test_of_two_zeros_none_is_the_larger():
    for zeros in ([0.0, -0.0], [-0.0, 0.0]):
        for name in ("max", "min"):
            assert bits(reduce(name, np.arange(2.0), np.array(zeros))) == "0.0"


def test_rms_of_a_sine_over_a_period():
    t = np.arange(1000) / 1000
    assert reduce("rms", t, 3 * np.sin(2 * np.pi * t)) == pytest.approx(3 / math.sqrt(2), rel=1e-12)


def lies_within(value, ulps, squares):
    """Whether a root mean square is within so many units in the last place of the true one."""
    unit, true = ulps * Fraction(math.ulp(value)), Fraction(sum(squares), len(squares))
    return max(Fraction(value) - unit, Fraction(0)) ** 2 <= true <= (Fraction(value) + unit) ** 2


@pytest.mark.parametrize("size", [1e-170, 1e200, 5e-324, 1.7976931348623157e308, 2.0**-511, 2.0**512, 1e-155, 1e154])
def test_rms_of_equal_numbers_of_any_size_is_that_number(size):
    assert reduce("rms", TIMES, np.full(301, size)) == size


FINITE = st.floats(allow_nan=False, allow_infinity=False)
POWERS = st.builds(
    lambda m, e, s: s * math.ldexp(m, e),
    st.floats(0.5, 1, exclude_max=True),
    st.integers(-1073, 1024),
    st.sampled_from([-1, 1]),
)
ONE_SIZE = st.builds(
    lambda xs, e: [math.ldexp(x, e) for x in xs], st.lists(st.floats(0, 4), min_size=1), st.integers(-1070, 1021)
)


@given(
    st.one_of(st.lists(FINITE, min_size=1), st.lists(POWERS, min_size=1), ONE_SIZE),
    st.integers(1, 9),
)
def test_rms_is_the_true_one_to_two_units_in_the_last_place(numbers, batches):
    x = np.array(numbers)
    value = reduce("rms", np.arange(float(len(x))), x, batches=batches)
    assert bits(value) == bits(reduce("rms", np.arange(float(len(x))), x, batches=1))
    assert lies_within(value, 2, [Fraction(number) ** 2 for number in numbers])


@given(st.lists(st.integers(-(2**63), 2**63 - 1), min_size=1))
def test_figures_of_whole_numbers_up_to_64_bits(numbers):
    x = np.array(numbers, np.int64)
    times = np.arange(float(len(x)))
    assert lies_within(reduce("rms", times, x), 2, [number**2 for number in numbers])
    assert reduce("mean", times, x) == sum(numbers) / len(numbers)
    assert reduce("mean", times, x.view(np.uint64)) == sum(number % 2**64 for number in numbers) / len(numbers)
    assert reduce("max", times, x) == max(numbers)


@given(st.lists(st.floats(width=32, allow_nan=False, allow_infinity=False), min_size=1))
def test_rms_of_float32(numbers):
    x = np.array(numbers, np.float32)
    assert lies_within(reduce("rms", np.arange(float(len(x))), x), 2, [Fraction(number) ** 2 for number in numbers])


def test_window_takes_its_bounds_although_times_are_rounded():
    times = np.arange(301) * 0.1  # times[3] is 0.30000000000000004
    x = np.arange(301.0)
    assert times[3] > 0.3
    assert reduce("max", times, x, stop=0.3) == 3
    assert reduce("min", times, x, start=0.1 * 3) == 3
    assert reduce("min", times, x, start=0.3, stop=0.3) == 3
    assert reduce("final", times, x, start=10, stop=20) == 200
    assert reduce("max", times, x, start=0, stop=0) == 0


@pytest.mark.parametrize("name", ["max", "min", "mean", "rms", "final"])
def test_an_empty_window_has_no_value(name):
    assert reduce(name, TIMES, np.ones(301), start=40) is None
    assert reduction(name).value() is None
    assert reduce(name, TIMES, np.ones((301, 0))) is None


@pytest.mark.parametrize("name", ["max", "min", "mean", "rms"])
@pytest.mark.parametrize("at", [0, 150, 300])
def test_nan_is_not_hidden(name, at):
    x = np.ones((301, 3))
    x[at, 1] = np.nan
    assert math.isnan(reduce(name, TIMES, x))
    assert json.dumps(for_json({"N": reduce(name, TIMES, x)})) == '{"N": "nan"}'


def test_what_json_has_no_numbers_for_comes_back_and_null_is_no_value():
    metrics = {"a": math.inf, "b": [-math.inf, [1.5, np.float64(np.nan)]], "c": None, "d": [{"member": 1, "time": 0.5}]}
    text = json.dumps(for_json(metrics), allow_nan=False)
    assert json.loads(text) == {"a": "inf", "b": ["-inf", [1.5, "nan"]], "c": None, "d": [{"member": 1, "time": 0.5}]}
    assert repr(from_json(json.loads(text))) == repr(metrics).replace("np.float64(nan)", "nan")


def test_infinity_is_not_hidden():
    x = np.ones(301)
    x[7] = -np.inf
    assert reduce("min", TIMES, x) == -math.inf
    assert reduce("rms", TIMES, x) == math.inf
    assert reduce("mean", TIMES, x) == -math.inf
    x[8] = np.inf
    assert math.isnan(reduce("mean", TIMES, x)) and reduce("max", TIMES, x) == math.inf
    x[9] = np.nan
    assert math.isnan(reduce("rms", TIMES, x))


def test_integers_and_booleans():
    counts = np.arange(301, dtype=np.int32)
    assert reduce("max", TIMES, counts) == 300 and isinstance(reduce("max", TIMES, counts), int)
    assert reduce("rms", TIMES, np.full(301, 200, np.uint8)) == 200
    flags = counts % 2 == 0
    assert reduce("max", TIMES, flags) is True
    assert reduce("mean", TIMES, flags) == 151 / 301
    assert reduce("final", TIMES, counts) == 300


def test_a_batch_may_be_overwritten_by_its_owner():
    x = np.array([1.0, 2.0])
    figure = reduction("final")
    figure.update(np.array([0.0, 1.0]), x)
    x[:] = 9
    assert figure.value() == 2.0


def test_events_of_the_last_sample_sorted_by_time():
    rows = np.full((2, 4, 3), np.nan)
    rows[1, 0] = [2, 3, 10.0]
    rows[1, 2] = [1, 6, 2.345]
    times = np.array([0.0, 12.0])
    assert reduce("events", times, rows, batches=2) == [
        {"pair": [1, 6], "time": 2.345},
        {"pair": [2, 3], "time": 10.0},
    ]
    assert reduce("events", times, rows, start=5) == [{"pair": [2, 3], "time": 10.0}]
    assert reduce("events", times, rows, stop=5) == [{"pair": [1, 6], "time": 2.345}]  # the sample itself is later
    assert reduce("events", times, rows[:, :, 1:]) == [{"member": 6, "time": 2.345}, {"member": 3, "time": 10.0}]
    assert reduce("events", times, rows[:1].repeat(2, axis=0)) == []


@pytest.mark.parametrize("row", [[0, 2, 1], [1.5, 2, 1], [1, 2, -1], [1, 2, 4], [1, math.inf, 1], [1, 2, math.nan]])
def test_what_is_no_event_is_not_made_one(row):
    with pytest.raises(MetricError, match="which is not"):
        reduce("events", np.array([3.0]), np.array([[row, [math.nan] * 3]]), batches=1)


@pytest.mark.parametrize(
    ("start", "stop", "holds", "reaches"),
    [
        (None, None, True, True),
        (0.3, 0.3, True, False),  # 3 * 0.1 is 0.30000000000000004
        (0.31, 0.39, False, False),
        (30.0, None, True, True),
        (30.01, None, False, True),
        (None, -0.1, False, False),
        (1e300, None, False, True),
        (29.0, 30.0, True, True),
    ],
)
def test_windows_and_the_times_of_a_run(start, stop, holds, reaches):
    figure = reduction("max", start, stop)
    assert figure.holds_sample(0.1, 300) is holds
    assert figure.reaches(30.0) is reaches


def test_events_of_every_member_of_a_fleet():
    rows = np.array([[[[4, 1.5]], [[2, 0.5]]]])  # (1 time, 2 members, 1 row each, 2)
    assert reduce("events", np.array([2.0]), rows, batches=1) == [
        {"member": 2, "time": 0.5},
        {"member": 4, "time": 1.5},
    ]


def test_first_time_that_a_boolean_is_true():
    flags = np.zeros((301, 3), bool)
    flags[50:60, 2] = True
    flags[20:, 0] = True
    flags[0, 2] = False
    assert reduce("first", TIMES, flags) == [{"member": 1, "time": TIMES[20]}, {"member": 3, "time": TIMES[50]}]
    assert reduce("first", TIMES, flags[:, 2]) == TIMES[50]
    assert reduce("first", TIMES, flags[:, 1]) is None
    assert reduce("first", TIMES, flags, start=5.5) == [
        {"member": 1, "time": TIMES[55]},
        {"member": 3, "time": TIMES[55]},
    ]


def test_first_of_a_matrix_names_pairs():
    flags = np.zeros((301, 2, 2), bool)
    flags[100:, 0, 1] = True
    assert reduce("first", TIMES, flags) == [{"pair": [1, 2], "time": TIMES[100]}]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("maximum",), "did you mean `max`"),
        (("finl",), "did you mean `final`"),
        (("max", 20, 10), "must not exceed"),
        (("max", math.nan, None), "not finite"),
        (("events", None, None, float, (3,)), "rows"),
        (("first", None, None, float, (3,)), "boolean"),
    ],
)
def test_mistakes(arguments, said):
    with pytest.raises(MetricError) as caught:
        reduction(*arguments)
    assert said in str(caught.value)


def test_text_says_what_is_reduced_when():
    assert str(reduction("max", 10, 20)) == "max, 10–20 s"
    assert str(reduction("rms", 10)) == "rms, from 10 s"
    assert str(reduction("min", None, 2.5)) == "min, to 2.5 s"
    assert str(reduction("final")) == "final"


def test_memory_does_not_grow_with_the_run():
    import tracemalloc

    figures = [reduction(name, dtype=float, shape=(50, 3)) for name in REDUCTIONS if name != "first"]
    figures.append(reduction("first", dtype=bool, shape=(50, 3)))
    batch = np.random.default_rng(0).normal(size=(100, 50, 3))

    def run(batches):
        for k in range(batches):
            for figure in figures:
                figure.update(np.arange(100.0) + 100 * k, batch if figure.dtype == float else batch > 3)

    run(3)
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    run(100)
    grown = tracemalloc.get_traced_memory()[0] - before
    tracemalloc.stop()
    assert grown < batch.nbytes / 4
