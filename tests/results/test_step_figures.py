"""Figures of a response against closed forms: a second-order step, a ramp, an exponential."""

import json
import math

import numpy as np
import pytest

from cosim.errors import MetricError
from cosim.results.step_figures import STEP_FIGURES, reduced_by
from cosim.terminal.cli import main

H = 1e-3
T = np.arange(0, 20 + H / 2, H)
ZETA, OMEGA = 0.4, 2.0
DAMPED = OMEGA * math.sqrt(1 - ZETA**2)
SWING = 1 - np.exp(-ZETA * OMEGA * T) * (np.cos(DAMPED * T) + ZETA * OMEGA / DAMPED * np.sin(DAMPED * T))


def figure(name, samples, times=T, start=None, stop=None, **options):
    samples = np.asarray(samples)
    made = reduced_by(name, options, start, stop, samples.dtype, samples.shape[1:])
    for part in np.array_split(np.arange(len(times)), 7):
        made.update(times[part], samples[part])
    return made.value()


def test_the_overshoot_of_a_second_order_step_is_that_of_theory():
    theory = 100 * math.exp(-math.pi * ZETA / math.sqrt(1 - ZETA**2))
    assert figure("overshoot", SWING, reference=1.0) == pytest.approx(theory, abs=100 * (DAMPED * H) ** 2 / 8)
    assert figure("time_of_max", SWING) == pytest.approx(math.pi / DAMPED, abs=H)


def test_the_settling_time_is_where_the_swing_leaves_its_band_last():
    inside = np.abs(SWING - 1) <= 0.02
    last = T[np.flatnonzero(~inside)[-1]]
    assert last < figure("settling_time", SWING, reference=1.0) < last + H
    assert figure("settling_time", SWING) == pytest.approx(figure("settling_time", SWING, reference=1.0), abs=1e-3)
    wide = figure("settling_time", SWING, reference=1.0, band=0.3)
    assert wide < figure("settling_time", SWING, reference=1.0, band=0.05)


def test_a_settling_time_may_be_of_a_band_in_the_signals_unit():
    """Of 3 - 2 e^-t: |y - 3| < 0.1 from ln 20 on; and of what begins where it ends, which has no way."""
    course = 3 - 2 * np.exp(-T)
    assert figure("settling_time", course, reference=3.0, within=0.1) == pytest.approx(math.log(20), abs=1e-6)
    assert figure("settling_time", T * np.exp(-T), reference=0.0, within=T[-1] * np.exp(-T[-1])) == T[-1]
    assert figure("settling_time", np.sin(T), reference=0.0, within=0.1) is None
    with pytest.raises(MetricError, match="both say how near"):
        reduced_by("settling_time", {"band": 0.1, "within": 1.0}, None, None, float, ())


def test_a_first_order_lag_has_the_times_of_theory():
    lag = 1 - np.exp(-T)
    assert figure("rise_time", lag, reference=1.0) == pytest.approx(math.log(9), abs=1e-6)  # ln 0.9 - ln 0.1
    assert figure("settling_time", lag, reference=1.0, band=0.05) == pytest.approx(math.log(20), abs=1e-6)
    assert figure("overshoot", lag) == 0.0


def test_integrals_of_an_exponential_error_are_those_of_theory():
    """Up to t = 20, of e^-t, e^-2t, t e^-t, each by the trapezoidal rule to h^2/12 of its slopes."""
    error = np.exp(-T)
    assert figure("iae", error) == pytest.approx(1.0, abs=1e-6)
    assert figure("iae", 3 + error, reference=3.0) == pytest.approx(1.0, abs=1e-6)
    assert figure("ise", error) == pytest.approx(0.5, abs=1e-6)
    assert figure("itae", -error) == pytest.approx(1.0, abs=1e-6)


def test_a_falling_response_and_one_that_begins_elsewhere_are_measured_alike():
    assert figure("overshoot", 5 - 3 * SWING) == pytest.approx(figure("overshoot", SWING), rel=1e-9)
    assert figure("rise_time", 5 - 3 * SWING) == pytest.approx(figure("rise_time", SWING), rel=1e-9)


def test_what_does_not_settle_has_no_settling_time():
    assert figure("settling_time", np.sin(T), reference=0.5) is None
    assert figure("rise_time", np.zeros_like(T)) is None
    assert figure("rise_time", SWING, reference=3.0) is None  # it never comes to nine tenths of that
    assert figure("settling_time", np.ones_like(T)) == 0.0


def test_of_an_array_the_largest_is_given_and_none_where_an_element_has_none():
    both = np.stack([SWING, 1 - np.exp(-T)], axis=1)
    assert figure("overshoot", both) == figure("overshoot", SWING)
    assert figure("settling_time", np.stack([SWING, np.sin(T)], axis=1), reference=0.5) is None
    assert figure("time_of_max", np.stack([SWING, 0.5 * SWING], axis=1)) == figure("time_of_max", SWING)


def test_a_percentile_is_numpys_and_a_window_is_kept():
    assert figure("percentile", SWING, percent=30.0) == np.percentile(SWING, 30)
    assert figure("time_of_min", SWING, start=1.0, stop=5.0) >= 1.0
    assert figure("iae", np.ones_like(T), start=2.0, stop=5.0) == pytest.approx(3.0, rel=1e-12)


@pytest.mark.parametrize("name", STEP_FIGURES)
def test_a_figure_goes_on_from_its_state_to_the_bit(name):
    whole = reduced_by(name, {}, None, None, float, ())
    whole.update(T, SWING)
    first, second = (reduced_by(name, {}, None, None, float, ()) for _ in range(2))
    first.update(T[:5000], SWING[:5000])
    second.restore(first.state())
    second.update(T[5000:], SWING[5000:])
    assert second.value() == whole.value()
    assert reduced_by(name, {}, None, None, float, ()).value() is None
    nan = reduced_by(name, {}, None, None, float, ())
    nan.update(T[:2], np.array([1.0, np.nan]))
    assert math.isnan(nan.value())


def test_options_that_do_not_go_with_a_figure_are_refused():
    with pytest.raises(MetricError, match="`band` does not go with `reduce: iae`"):
        reduced_by("iae", {"band": 0.1}, None, None, float, ())
    with pytest.raises(MetricError, match="`percent` does not go with `reduce: max`"):
        reduced_by("max", {"percent": 5.0}, None, None, float, ())
    with pytest.raises(MetricError, match="needs a signal of numbers"):
        reduced_by("overshoot", {}, None, None, bool, ())


def test_from_a_diagram_with_its_unit_and_from_a_study(tmp_path, capsys):
    (tmp_path / "d.yaml").write_text(
        """
        run: {stop: 10, step: 0.01, integrator: rk4}
        blocks:
          plant: {block: SecondOrder, parameters: {omega: 2, zeta: 0.4}, inputs: {u: 1}}
        metrics:
          beyond: {signal: plant.x, reduce: overshoot, reference: 1}
          settled: {signal: plant.x, reduce: settling_time, band: 0.05}
        """
    )
    main(["run", str(tmp_path / "d.yaml"), "-o", str(tmp_path / "r.nc")])
    shown = capsys.readouterr().out
    assert "overshoot, reference 1" in shown
    assert " %" in shown
    main(["run", str(tmp_path / "d.yaml"), "-o", str(tmp_path / "r.nc"), "--json"])
    theory = 100 * math.exp(-math.pi * ZETA / math.sqrt(1 - ZETA**2))
    assert json.loads(capsys.readouterr().out)["metrics"]["beyond"] == pytest.approx(theory, abs=1e-2)
    (tmp_path / "s.yaml").write_text(
        "diagram: d.yaml\ngrid: {blocks.plant.parameters.zeta: [0.3, 0.5]}\ntables: {t: {columns: [beyond, settled]}}\n"
    )
    assert main(["study", str(tmp_path / "s.yaml"), "--results", str(tmp_path / "results")]) == 0
    assert "37.2" in capsys.readouterr().out
    (tmp_path / "d.yaml").write_text((tmp_path / "d.yaml").read_text().replace("reference: 1", "band: 0.1"))
    assert main(["check", str(tmp_path / "d.yaml")]) == 2
    assert "metric beyond: `band` does not go with `reduce: overshoot`" in capsys.readouterr().err
