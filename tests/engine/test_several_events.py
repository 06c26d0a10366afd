"""Several events in one step, events at its end, and inputs that go on through them: against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from tests.engine.bouncing_balls import BALL, BALLS, METHODS, bounces, recorded, wire

BLOCKS = (
    BALL
    + '''

class Toggle(Block):
    """Its output goes along a line, and changes its sign at 1/3 s."""

    s = State(output=True, start=1.0)
    y = Output()
    due = Indicator(crossing="rising")

    def outputs(time, s, y):
        y[0] = s * (1.0 + time)

    def derivatives(d_s):
        d_s[0] = 0.0

    def indicators(time, due):
        due[0] = time - 1.0 / 3.0

    def event(due, s, next_s):
        if due > 0:
            next_s[0] = -s


class Alarm(Block):
    at = Parameter(unit="s")
    n = State(output=True, start=0, dtype=int)
    last = State(output=True, start=-1.0)
    due = Indicator()

    def indicators(time, at, due):
        due[0] = time - at

    def event(time, due, n, next_n, next_last):
        if due != 0:
            next_n[0] = n + 1
            next_last[0] = time


class Sum(Block):
    u = Input()
    x = State(output=True)

    def derivatives(u, d_x):
        d_x[0] = u
'''
)


@pytest.fixture
def ran(tmp_path):
    """The recorded signals of a run, by name."""
    return lambda text, *settings, engine="native": recorded(
        wire(tmp_path, BLOCKS, text, *settings), tmp_path / f"{engine}.nc", engine
    )


@pytest.mark.parametrize("method", METHODS)
def test_a_ball_bounces_several_times_in_one_step(ran, method):
    got = ran(BALLS, "run.step=1.9", f"run.method={method}")
    times = [[t for t in bounces(e, h) if t < 1.9] for e, h in ((0.7, 1.0), (0.8, 0.5), (0.5, 2.0))]
    assert got["b.n"][-1].tolist() == [len(own) for own in times] == [4, 5, 7]
    assert got["b.last"][-1] == pytest.approx([own[-1] for own in times], abs=1e-11)


@pytest.mark.parametrize("engine", ["native", "python"])
def test_a_ball_that_has_bounced_at_the_end_of_a_step_bounces_in_the_next(ran, engine):
    """It is there at 1 s a rounding error below the ground, and falls again at 1.8 s."""
    block = "{own:Ball, parameters: {g: 2.0, e: 0.4}, start: {h: 0.9999999999999999}}"
    text = f"run: {{stop: 2, step: 1, integrator: heun}}\nblocks: {{b: {block}}}\n"
    text += "record: {signals: [b.h, b.n, b.last]}\n"
    got = ran(text, engine=engine)
    assert -1e-15 < got["b.h"][1] < 0.0
    assert got["b.n"].tolist() == [0, 1, 2] and got["b.last"][-1] == pytest.approx(1.8, abs=1e-11)
    assert got["b.h"][-1] == pytest.approx(0.2 * 0.32 - 0.2**2, abs=1e-11)


@pytest.mark.parametrize("method", METHODS)
def test_indicators_of_both_directions_that_cross_closely_after_each_other_are_all_seen(ran, method):
    times = [0.3, 0.3 + 1e-13, 0.3 + 1e-10, 0.3 + 1e-8, 0.3 + 1e-6]
    text = f"""
    run: {{stop: 1, step: 0.5, method: {method}}}
    fleets: {{alarm: {len(times)}}}
    blocks: {{b: {{own:Alarm, per: alarm, parameters: {{at: {times}}}}}}}
    record: {{signals: [b.n, b.last]}}
    """
    got = ran(text)
    assert got["b.n"][-1].tolist() == [1] * len(times)
    assert got["b.last"][-1] == pytest.approx(times, abs=1e-12)


def test_events_that_follow_each_other_closely_all_happen(ran):
    """What crosses zero in the moment after another's event is found all the same."""
    heights = [1.0, 1.0 + 1e-15, 1.0 + 1e-12, 1.0 + 1e-9, 1.0 + 1e-7, 1.0 - 1e-8]
    text = f"""
    run: {{stop: 1, step: 0.5, integrator: heun}}
    fleets: {{ball: {len(heights)}}}
    blocks: {{b: {{own:Ball, per: ball, start: {{h: {heights}}}}}}}
    record: {{signals: [b.n, b.last]}}
    """
    got = ran(text)
    assert got["b.n"][-1].tolist() == [1] * len(heights)
    assert got["b.last"][-1] == pytest.approx([bounces(0.7, h)[0] for h in heights], abs=1e-11)


@pytest.mark.parametrize(
    ("method", "extrapolation"), [("gauss-seidel", 1), ("gauss-seidel", 2), ("jacobi", 2), ("iterated", 1)]
)
def test_inputs_go_on_to_an_event_and_from_there(ran, method, extrapolation):
    """A line is extrapolated and interpolated without an error, whatever times are tried to find the event."""
    text = """
    run: {stop: 1, step: 0.1, integrator: heun}
    blocks: {t: {own:Toggle}, i: {own:Sum, inputs: {u: t.y}}}
    record: {signals: [i.x]}
    """
    got = ran(text, f"run.method={method}", f"run.extrapolation={extrapolation}")
    t = got["time"]
    way = t + 0.5 * t**2
    assert got["i.x"] == pytest.approx(np.where(t < 1 / 3, way, 7 / 9 - way), abs=1e-12)
