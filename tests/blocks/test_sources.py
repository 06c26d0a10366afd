"""Sources against scipy.signal and closed forms, in every instant of a run that does not hit their edges."""

import itertools
import math

import numpy as np
import pytest
from scipy import signal

from tests.blocks.library_runs import run_block, run_diagram

TIMES = np.linspace(0.0, 2.0, 2001)


def test_constant():
    assert np.all(run_block("Constant", "value: [1, 2]")["y"] == [1, 2])


@pytest.mark.parametrize("at", [0.0, 0.5, 0.7003, 1.99995])
def test_step_jumps_at_its_time(at):
    found = run_block("Step", f"at: {at}, initial: -1, final: 2")
    np.testing.assert_array_equal(found["y"], np.where(found["time"] >= at - 1e-12, 2.0, -1.0))


def test_ramp():
    found = run_block("Ramp", "slope: 3, at: 0.4, initial: 1")
    np.testing.assert_allclose(found["y"], 1.0 + 3.0 * np.maximum(0.0, TIMES - 0.4), atol=1e-14)


def test_sine():
    found = run_block("Sine", "amplitude: [1, 2], frequency: [3, 5], phase: 0.1, bias: 4")
    expected = 4.0 + np.array([1, 2]) * np.sin(2 * np.pi * np.outer(TIMES, [3, 5]) + 0.1)
    np.testing.assert_allclose(found["y"], expected, atol=1e-13)


def test_chirp_is_scipys_within_the_sweep_and_a_sine_after_it():
    found = run_block("Chirp", "first: 1, last: 9, duration: 1.5")["y"]
    within = TIMES < 1.5
    expected = signal.chirp(TIMES, 1.0, 1.5, 9.0, phi=-90)
    np.testing.assert_allclose(found[within], expected[within], atol=1e-12)
    phase = 2 * np.pi * ((1 + 9) / 2 * 1.5 + 9 * (TIMES - 1.5))
    np.testing.assert_allclose(found[~within], np.sin(phase)[~within], atol=1e-12)


def test_pulse():
    found = run_block("Pulse", "at: 0.5, width: 0.2505, high: 3, low: 1")
    inside = (TIMES > 0.5 - 1e-9) & (TIMES < 0.7505)
    np.testing.assert_array_equal(found["y"], np.where(inside, 3.0, 1.0))


@pytest.mark.parametrize(("frequency", "duty"), [(1.0, 0.5), (7.3, 0.31), (250.0, 0.25)])
def test_square_is_scipys(frequency, duty):
    found = run_block("Square", f"frequency: {frequency}, duty: {duty}")["y"]
    cycles = TIMES * frequency
    sure = np.minimum(np.abs(cycles - np.round(cycles)), np.abs(cycles - np.floor(cycles) - duty)) > 1e-9
    np.testing.assert_array_equal(found[sure], signal.square(2 * np.pi * cycles, duty)[sure])
    np.testing.assert_array_equal(
        found[np.abs(cycles - np.round(cycles)) <= 1e-9], 1.0
    )  # an edge belongs to what follows


def test_square_with_a_delay():
    found = run_block("Square", "frequency: 2, delay: 0.3, low: 0")["y"]
    phase = (TIMES - 0.3) * 2 % 1
    sure = (np.abs(phase - 0.5) > 1e-6) & (np.abs(phase - np.round(phase)) > 1e-6)
    expected = np.where((TIMES >= 0.3) & (phase < 0.5), 1.0, 0.0)
    np.testing.assert_array_equal(found[sure], expected[sure])


def test_table_is_numpys_interpolation():
    times, values = [0.2, 0.5, 0.9, 1.6], [1.0, -2.0, 4.0, 3.0]
    found = run_block("TableSource", f"times: {times}, values: {values}")["y"]
    np.testing.assert_allclose(found, np.interp(TIMES, times, values), atol=1e-13)
    rows = [[a, 2 * a] for a in values]
    found = run_block("TableSource", f"times: {times}, values: {rows}")["y"]
    np.testing.assert_allclose(found[:, 1], 2 * np.interp(TIMES, times, values), atol=1e-13)


def test_table_held_and_repeated():
    found = run_block("TableSource", "times: [0, 0.25, 0.75], values: [1, 2, 3], hold: true, repeat: true")["y"]
    at = TIMES % 0.75
    sure = (np.abs(at - 0.25) > 1e-9) & (np.minimum(at, 0.75 - at) > 1e-9)
    np.testing.assert_array_equal(found[sure], np.where(at < 0.25, 1.0, 2.0)[sure])
    held = run_block("TableSource", "times: [0.5, 1.0], values: [1, 2], hold: true")["y"]
    np.testing.assert_array_equal(held, np.where(TIMES >= 1.0, 2.0, 1.0))


def lag_behind(times, values, hold, stop, T):
    """x of T dx/dt = u - x at the end, from 0, where u is a table's: its closed form from knot to knot."""
    x = 0.0
    edges = [t for t in (0.0, *times) if t < stop] + [stop]
    for begin, end in itertools.pairwise(edges):
        low, high = np.interp([begin, end], times, values)
        if hold:
            low = high = values[max(0, np.searchsorted(times, begin, "right") - 1)]
        slope = (high - low) / (end - begin)
        forced = low - slope * T
        x = forced + slope * (end - begin) + (x - forced) * math.exp(-(end - begin) / T)
    return x


@pytest.mark.parametrize("hold", [False, True])
def test_a_table_whose_knots_fall_between_steps_leaves_rk4_its_order(hold):
    """From h to h / 8 the error falls by 8^4; with kinks within steps by 8^2, with jumps by 8."""
    times, values, errors = [0.137, 0.571, 0.8313, 1.2177], [1.0, -2.0, 4.0, 0.5], []
    exact = lag_behind(times, values, hold, 2.0, 0.5)
    for step in (0.1, 0.0125):
        given = f"times: {times}, values: {values}, hold: {str(hold).lower()}"
        table = f"  wave: {{block: TableSource, parameters: {{{given}}}}}\n"
        settings = "integrator: rk4, method: joint"
        x = run_block("FirstOrder", "T: 0.5", "u: wave.y", table, ("x",), step=step, settings=settings)["x"]
        errors.append(abs(x[-1].item() - exact))
    assert errors[0] / errors[1] > 8**3.5


def test_a_repeated_table_begins_where_time_does():
    """Also before its first time, and where its knots are closer than steps."""
    found = run_block("TableSource", "times: [0.5, 0.504, 0.511], values: [1, 3, 1], repeat: true", step=0.01)["y"]
    at = 0.5 + (np.linspace(0, 2, 201) - 0.5) % 0.011
    expected = np.interp(at, [0.5, 0.504, 0.511], [1, 3, 1])
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_edges_that_time_cannot_tell_apart_are_not_missed():
    """An edge nearer to a run's begin, or to the edge before it, than time can tell is passed with it."""
    blocks = {
        "step": ("Step", "at: 1.0e-14", 1.0),
        "never": ("Step", "at: inf", 0.0),
        "pulse": ("Pulse", "at: 0.2, width: 1.0e-15", 0.0),
        "square": ("Square", "duty: 1.0e-15, frequency: 3", -1.0),
        "table": ("TableSource", "times: [0.1, 0.1000000000000002, 1], values: [1, 2, 2]", 2.0),
    }
    lines = [f"  {name}: {{block: {block}, parameters: {{{given}}}}}" for name, (block, given, _) in blocks.items()]
    text = "\n".join(["run: {stop: 0.5, step: 0.125}", "blocks:", *lines, ""])
    found = run_diagram(text, *(f"{name}.y" for name in blocks))
    assert {name: found[f"{name}.y"][-1] for name in blocks} == {name: last for name, (_, _, last) in blocks.items()}
