"""What a run reduces and records: windows that fit the run, and how its end is told."""

from __future__ import annotations

import math

import pytest

from cosim.engine import run
from cosim.engine.run import Run
from cosim.errors import CosimError, DiagramErrors, WrongValue
from cosim.results.result_file import open_result

TIMER = """
run: {stop: 3, step: 0.01}
blocks:
  clock: {type: Clock, period: 0.01}
record: {period: 0.1, signals: [clock.t]}
metrics:
  m: {signal: clock.t, reduce: max}
"""


def mistakes(wired, text):
    """What is wrong with a diagram, told when it is wired."""
    with pytest.raises(DiagramErrors) as caught:
        wired(text)
    return caught.value.errors


@pytest.mark.parametrize(
    "window",
    [
        "max, from: 5",
        "final, from: 3.001",
        "min, from: 1.001, to: 1.002",
        "events, from: 4",
    ],
)
def test_a_window_without_a_sample_is_an_error_at_its_line(wired, window):
    text = TIMER.replace("max", window)
    (error,) = mistakes(wired, text if "events" not in window else text.replace("clock.t, ", "clock.log, "))
    assert "metric m: no sample lies in its window" in error.message and error.position.line == 7
    assert error.fix == "the times of this run are 0, 0.01, … 3 s"


def test_all_that_stays_empty_is_told_at_once_and_only_warned_of_where_the_command_line_shortened_the_run(wired):
    text = TIMER.replace("max", "max, from: 2, to: 3").replace("period: 0.1", "period: 2")
    assert Run(wired(text)).execute().metrics["m"] == pytest.approx(3)
    short = text.replace("stop: 3", "stop: 1")
    places = [(e.position.line, e.position.column) for e in mistakes(wired, short)]
    assert places == [(5, 18), (7, 3)]
    outcome = Run(wired(text, "run.stop=1")).execute()
    assert outcome.status == "completed" and outcome.metrics == {"m": None}
    assert [w.position.line for w in outcome.warnings] == [7, 5]


def test_a_recording_of_both_ends_is_one(wired):
    """A period that is as long as the run is not longer than it."""
    assert wired(TIMER.replace("period: 0.1", "period: 3")).diagram.record.period == 3
    (error,) = mistakes(wired, TIMER.replace("period: 0.1", "period: 3.01"))
    assert "`record.period` of 3.01 s is longer than the run" in error.message


def test_what_the_end_of_the_run_cuts_off_is_warned_of(wired):
    """A figure named `max, 2-60 s` of a run of 3 s would say more than it knows."""

    def warned(text, *settings):
        return [(w.position.line, w.message) for w in Run(wired(text, *settings)).execute().warnings]

    text = TIMER.replace("max", "max, from: 2, to: 60")
    assert warned(text) == [(7, "metric m: its window (max, 2–60 s) ends after the run, at 3 s")]
    assert warned(text, "run.stop=60") == []
    assert [line for line, _ in warned(text, "run.stop=1")] == [7]
    assert warned(TIMER.replace("max", "max, to: 3")) == []


def test_a_period_that_the_run_does_not_last_is_warned_of(wired):
    text = TIMER.replace("period: 0.01", "period: 1000", 1)
    (warning,) = Run(wired(text)).execute().warnings
    assert "block clock: its period of 1000 s is longer than the run" in warning.message and warning.position.line == 4
    assert not Run(wired(text.replace("1000", "3"))).execute().warnings


def test_final_is_the_last_value_in_its_window(wired):
    for window, value in (("", 3.0), (", to: 3", 3.0), (", to: 2", 2.0), (", from: 1, to: 2.005", 2.0)):
        assert Run(wired(TIMER.replace("max", f"final{window}"))).execute().metrics["m"] == pytest.approx(value)


def test_events_before_the_end_of_their_window_are_found(wired):
    text = TIMER.replace("{signal: clock.t, reduce: max}", "{signal: clock.log, reduce: events, to: 2}")
    assert Run(wired(text)).execute().metrics["m"] == [{"member": 7, "time": 1.5}]


def test_only_a_table_that_starts_as_nan_has_events(wired):
    text = TIMER.replace("{signal: clock.t, reduce: max}", "{signal: clock.ones, reduce: events}")
    (error,) = mistakes(wired, text)
    assert "metric m: `events` needs a table that starts as NaN" in error.message and error.position.line == 7


def test_rows_that_are_no_events_fail_the_run_at_the_metrics_line(wired):
    text = TIMER.replace("{signal: clock.t, reduce: max}", "{signal: clock.torn, reduce: events}")
    text += "  other: {signal: clock.t, reduce: max}\n"
    outcome = Run(wired(text)).execute()
    assert outcome.status == "failed" and outcome.error.position.line == 7
    assert "`events` found the row [7, -1]" in outcome.error.message
    assert outcome.metrics["m"] is None and math.isclose(outcome.metrics["other"], 3)


def test_a_fleet_that_no_block_is_mapped_over_is_warned_of(wired):
    """An overlay that means to make the fleet larger, and misspells it."""
    text = TIMER.replace("blocks:", "fleets: {robot: 2, robots: 5}\nblocks:").replace(
        "type: Clock", "type: Clock, per: robot"
    )
    warnings = Run(wired(text.replace("clock.t, reduce", "clock.t, reduce"))).execute().warnings
    assert [(w.message, w.fix) for w in warnings] == [
        ("no block is `per: robots`, so the fleet `robots` changes nothing", "did you mean `robot`?")
    ]
    assert not Run(wired(text.replace(", robots: 5", ""))).execute().warnings


def test_a_run_is_executed_once_and_by_an_engine_that_there_is(formation, tmp_path):
    network = run.load(formation, ["run.stop=0.1"])
    one = run.Run(network, output=tmp_path / "run.nc")
    assert one.execute().status == "completed"
    content = (tmp_path / "run.nc").read_bytes()
    with pytest.raises(CosimError, match="has been executed"):
        one.execute()
    assert (tmp_path / "run.nc").read_bytes() == content
    with pytest.raises(WrongValue, match="no engine `Native`"):
        run.Run(network, engine="Native")


def test_what_a_watch_raises_loses_no_row(formation, tmp_path):
    network = run.load(formation, ["run.stop=1", "record={period: 0.01, signals: [plant.x]}"])

    def watch(time: float) -> None:
        raise KeyError("who watches")

    with pytest.raises(KeyError, match="who watches"):
        run.Run(network, output=tmp_path / "run.nc").execute(watch)
    with open_result(tmp_path / "run.nc") as result:
        assert result.attrs["status"] == "failed" and "who watches" in result.attrs["message"] and len(result.times)
