"""How sure recorded signals are, beside their closed forms; and which step keeps an error that is wanted."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cosim.accuracy import signal_accuracy
from cosim.accuracy.accuracies import AGREES, CHANGES
from cosim.accuracy.largest_step import Wanted
from cosim.accuracy.limit import NO_ORDER, ORDER, ROUNDING
from cosim.accuracy.observed import Crest, Trough
from cosim.engine import run
from cosim.engine.run import Run

SIGNALS = """
run: {stop: 2, step: 0.02}
blocks:
  a: {type: Decay}
  o: {type: Oscillator}
  w: {type: Watch, parameters: {level: 0.5}, inputs: {u: a.x}}
  s: {type: Switched, parameters: {T: 0.8862}}
  wave: {type: Wave}
record: {period: 0.1, signals: [a.x, o.x, o.v, w.below, s.y, wave.y]}
"""


def test_the_largest_error_along_a_run_is_told_within_a_factor_of_three(certified):
    times = np.arange(21) * 0.1
    truth = {"a.x": np.exp(-times), "o.x": np.cos(2 * times), "o.v": -2 * np.sin(2 * times)}
    steps = np.arange(101)
    growth = np.linalg.matrix_power  # of Euler's method, (1 + h A)^n
    matrix = np.eye(2) + 0.02 * np.array([[0, 1], [-4, 0]])
    computed = {"a.x": 0.98**steps}
    computed["o.x"], computed["o.v"] = np.array([growth(matrix, n) @ [1, 0] for n in steps]).T
    made = certified(SIGNALS)
    for name, course in truth.items():
        error = np.abs(computed[name][::5] - course).max()
        found = made.signals[name]
        assert found.kind == ORDER and found.order == pytest.approx(1, abs=0.15)
        assert 1.0 <= found.error / error <= 1.6
        assert found.size == pytest.approx(np.ptp(computed[name][::5])) and found.relative == found.error / found.size


def test_functions_of_time_are_at_rounding_and_truth_values_agree_or_not(certified):
    made = certified(SIGNALS)
    assert made.signals["wave.y"].kind == ROUNDING and 1e-17 < made.signals["wave.y"].error < 1e-14
    assert made.signals["w.below"].kind == AGREES
    other = certified(SIGNALS, "blocks.w.parameters.level=0.6684", "record.period=0.02")
    assert other.signals["w.below"].kind == CHANGES
    assert any(note.startswith("w.below: not the same with steps of 20 ms, 10 ms, 5 ms at ") for note in other.notes)
    assert other.changing == []


def test_a_jump_of_a_signal_between_recorded_times_is_no_error_at_them(certified):
    """s.y jumps at 0.8862 s, a.x is recorded at multiples of 0.1 s."""
    assert certified(SIGNALS).signals["s.y"].kind == ROUNDING
    assert certified(SIGNALS, "blocks.s.parameters.T=0.86001", "record.period=0.02").signals["s.y"].kind == ROUNDING


def test_a_signal_that_is_as_wrong_with_all_nested_steps_is_told_by_another(certified):
    """A switch at 0.8862 s is seen at 0.88 s with steps of 40, 20 and 10 ms, and the signal is off from there on."""
    text = """
    run: {stop: 2, step: 0.04, method: gauss-seidel}
    blocks: {a: {type: Decay, parameters: {k: 0}, inputs: {u: s.y}}, s: {type: Switched, parameters: {T: 0.8862}}}
    record: {period: 0.4, signals: [a.x]}
    """
    found = certified(text).signals["a.x"]
    assert found.kind == NO_ORDER and found.error >= 2 * 0.0062


def test_a_jump_that_moves_over_a_recorded_time_is_an_error_of_its_size(certified):
    """What slides changes its sign at every step."""
    text = """
    run: {stop: 2, step: 0.02}
    blocks:
      a: {type: Decay, parameters: {k: 0}, start: {x: 1.0372}, inputs: {u: w.y}}
      w: {type: Relay, inputs: {u: a.x}}
    record: {signals: [w.y]}
    """
    found = certified(text).signals["w.y"]
    assert found.kind == NO_ORDER and found.error >= 2.0


def test_signals_are_read_in_parts(certified, monkeypatch):
    whole = certified(SIGNALS).as_json()["signals"]
    monkeypatch.setattr(signal_accuracy, "NUMBERS_AT_ONCE", 4)
    assert certified(SIGNALS).as_json()["signals"] == whole


@pytest.mark.parametrize("wanted", [0.5, 1e-2, 1e-3, 1e-5])
def test_the_largest_step_keeps_the_error_and_ten_times_the_step_does_not(certified, diagram, wanted):
    text = "run: {stop: 2, step: 0.02}\nblocks: {a: {type: Decay}}\nmetrics: {x: {signal: a.x, reduce: final}}\n"
    found = certified(text, wanted=Wanted(absolute={"x": wanted})).metrics["x"]
    assert found.wanted == wanted and found.largest_step

    def error(step):
        outcome = Run(run.load(diagram(text), [f"run.step={step!r}"])).execute()
        return abs(outcome.metrics["x"] - math.exp(-2))

    assert error(found.largest_step) <= wanted
    if found.largest_step < 0.02:
        assert error(10 * found.largest_step) > wanted


def test_larger_steps_are_tried_and_those_that_diverge_are_not_taken(certified):
    """dx/dt = -20 x: Euler's method diverges with steps above 0.1; at 0.08 the final value is still nothing."""
    text = """
    run: {stop: 3.2, step: 0.02}
    blocks: {a: {type: Decay, parameters: {k: -20}}}
    record: {period: 0.02, signals: [a.x]}
    metrics: {x: {signal: a.x, reduce: final}}
    """
    made = certified(text, wanted=Wanted(absolute={"x": 1e-6, "a.x": 1.0}))
    assert made.metrics["x"].largest_step == 0.08
    assert made.signals["a.x"].largest_step == 0.08 and made.runs == 8 + 3


def test_a_larger_step_with_which_a_run_fails_is_not_taken(certified):
    """With steps of 0.08, Euler's method has -0.6 after the first, where a block refuses to go on; the largest is 1."""
    text = """
    run: {stop: 3.2, step: 0.02}
    blocks: {a: {type: Decay, parameters: {k: -20}}, s: {type: Strict, inputs: {u: a.x}}}
    metrics: {x: {signal: a.x, reduce: max}}
    """
    assert certified(text, wanted=Wanted(absolute={"x": 0.1})).metrics["x"].largest_step == 0.04


def test_a_wanted_error_is_relative_to_the_figure_or_to_the_range_of_the_signal(certified):
    made = certified(
        SIGNALS.replace("record", "metrics: {x: {signal: a.x, reduce: final}}\nrecord"), wanted=Wanted(0.01)
    )
    assert made.metrics["x"].wanted == pytest.approx(0.01 * 0.98**100)
    assert made.signals["o.v"].wanted == pytest.approx(0.01 * made.signals["o.v"].size)
    assert made.signals["w.below"].wanted is None


def test_without_an_order_only_steps_that_were_run_are_known_to_keep_an_error(certified):
    text = """
    run: {stop: 2, step: 0.04}
    blocks: {a: {type: Decay, parameters: {k: 0}, inputs: {u: s.y}}, s: {type: Switched, parameters: {T: 0.8862}}}
    metrics: {x: {signal: a.x, reduce: final}}
    """
    found = certified(text, "run.method=gauss-seidel", wanted=Wanted(absolute={"x": 1e-9})).metrics["x"]
    assert found.kind == NO_ORDER and found.largest_step is None


@pytest.mark.parametrize("batches", [1, 7, 400])
@pytest.mark.parametrize("shift", [0.0, 0.3, 0.5])
def test_the_crest_of_a_wave_is_found_between_samples(batches, shift):
    """sin has its largest value 1 wherever samples lie; theirs is off by up to h^2/8, the parabola's by h^4 or so."""
    h = 0.05
    times = h * np.arange(200)
    samples = np.sin(times + shift * h)[:, None] * [1.0, -0.5]
    crest, trough = (kind(None, None, np.dtype(float), (2,)) for kind in (Crest, Trough))
    for part in np.array_split(np.arange(200), batches):
        crest.update(times[part], samples[part])
        trough.update(times[part], samples[part])
    assert crest.value() == pytest.approx(1.0, abs=h**4) and trough.value() == pytest.approx(-1.0, abs=h**4)


def test_a_jump_a_kink_and_noise_have_no_crest_beyond_their_samples():
    times = 0.1 * np.arange(100)
    for samples in (
        np.where(times < 5.05, 0.0, 1.0),
        np.where(times == times[50], 1.0, 0.0),
        np.sign(np.sin(37 * times)),
    ):
        crest = Crest(None, None, np.dtype(float), ())
        crest.update(times, samples)
        assert crest.value() == 1.0
    empty = Crest(5.0, 6.0, np.dtype(float), ())
    empty.update(times[:10], times[:10])
    assert empty.value() is None
    short = Crest(None, None, np.dtype(float), ())
    short.update(times[:2], np.array([2.0, 1.0]))
    assert short.value() == 2.0
