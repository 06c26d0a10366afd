"""Events: where indicators cross zero, against closed forms and an independent solver, under every method."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cosim.engine import run
from cosim.errors import BlockFailed, DeclarationError, DiagramErrors
from tests.engine.bouncing_balls import BALL, BALLS, METHODS, bounces, recorded, wire

BLOCKS = (
    BALL
    + '''

class Force(Block):
    A = Parameter(default=1.6)
    w = Parameter(default=2.0)
    F = Output()

    def outputs(time, A, w, F):
        F[0] = A * math.sin(w * time)


class Friction(Block):
    """dv/dt = F - mu sign(v) while it slips; it sticks where v is 0 and |F| below the static friction."""

    F = Input()
    kinetic = Parameter(default=0.5)
    static = Parameter(default=1.0)
    x = State(output=True)
    v = State(output=True)
    slip = State(output=True, start=0, dtype=int)
    stops = Indicator()
    breaks = Indicator(crossing="rising")

    def derivatives(F, kinetic, v, slip, d_x, d_v):
        d_x[0] = v
        d_v[0] = 0.0
        if slip != 0:
            d_v[0] = F - kinetic * slip

    def indicators(F, static, v, slip, stops, breaks):
        stops[0] = v if slip != 0 else 1.0
        breaks[0] = abs(F) - static if slip == 0 else -1.0

    def event(F, static, stops, breaks, slip, next_slip, next_v):
        if breaks > 0:
            next_slip[0] = 1 if F > 0 else -1
        elif stops != 0 and slip != 0:
            next_v[0] = 0.0
            next_slip[0] = 0
            if abs(F) > static:
                next_slip[0] = 1 if F > 0 else -1


class Switch(Block):
    """Counts the half periods of what comes in, and notes the time of the last."""

    u = Input()
    n = State(output=True, start=0, dtype=int)
    last = State(output=True, start=-1.0)
    zero = Indicator()

    def indicators(u, zero):
        zero[0] = u

    def event(time, zero, n, next_n, next_last):
        if zero != 0:
            next_n[0] = n + 1
            next_last[0] = time


class Alarm(Block):
    """A time event: resets its state at `at`."""

    at = Parameter()
    x = State(output=True, start=1.0)
    due = Indicator(crossing="rising")

    def derivatives(x, d_x):
        d_x[0] = -x

    def indicators(time, at, due):
        due[0] = time - at

    def event(due, next_x):
        if due > 0:
            next_x[0] = 1.0


class Domino(Block):
    """Falls as soon as the one before has fallen."""

    before = Input()
    fallen = State(output=True)
    hit = Indicator(crossing="rising")

    def indicators(before, hit):
        hit[0] = before - 0.5

    def event(hit, next_fallen):
        if hit > 0:
            next_fallen[0] = 1.0


class Restless(Block):
    u = Input()
    x = State(output=True, start=-1.0)
    zero = Indicator()

    def indicators(u, x, zero):
        zero[0] = u * x

    def event(zero, x, next_x):
        if zero != 0:
            next_x[0] = -x


class Lag(Block):
    u = Input()
    x = State(output=True)

    def derivatives(u, x, d_x):
        d_x[0] = u - x


class Sampled(Block):
    u = Input()
    y = Output()

    def outputs(u, y):
        y[0] = u
'''
)


@pytest.fixture
def wired(tmp_path):
    return lambda text, *settings: wire(tmp_path, BLOCKS, text, *settings)


@pytest.fixture
def ran(wired, tmp_path):
    """The recorded signals of a run, by name."""
    return lambda text, *settings, engine="native": recorded(wired(text, *settings), tmp_path / f"{engine}.nc", engine)


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("method", METHODS)
def test_a_ball_bounces_when_it_hits_the_ground(ran, method, engine):
    """Heun's method is exact between two bounces, so the time of each is that of the closed form up to rounding."""
    got = ran(BALLS, f"run.method={method}", engine=engine)
    seen = set()
    for member, (e, h) in enumerate(((0.7, 1.0), (0.8, 0.5), (0.5, 2.0))):
        times = bounces(e, h)
        for time, n, last in zip(got["time"], got["b.n"][:, member], got["b.last"][:, member], strict=True):
            seen.add((member, int(n)))
            assert n == sum(t <= time for t in times)
            assert n == 0 or last == pytest.approx(times[n - 1], abs=1e-11)
    assert {(0, 4), (1, 5), (2, 6)} <= seen
    assert (got["b.h"] > -1e-10).all()


@pytest.mark.parametrize("step", ["0.1", "0.05", "0.0137"])
def test_the_step_does_not_move_a_bounce(ran, step):
    stop = 1.0 if step != "0.0137" else 0.959
    got = ran(BALLS, f"run.step={step}", f"run.stop={stop}")
    times = [t for t in bounces(0.7, 1.0) if t <= stop]
    assert got["b.n"][-1, 0] == len(times) and got["b.last"][-1, 0] == pytest.approx(times[-1], abs=1e-11)


def force(t):
    return 1.6 * math.sin(2.0 * t)


def slide(begun, stop, x, v, slip):
    """The way of a body from where it begins to slip to where it stops."""

    def stopped(t, y):
        return y[1] if t > begun + 1e-6 else 1.0 * slip

    stopped.terminal = True
    options = {"rtol": 1e-12, "atol": 1e-14, "method": "DOP853", "dense_output": True, "events": stopped}
    return solve_ivp(lambda t, y: [y[1], force(t) - 0.5 * slip], (begun, stop), [x, v], **options)


def friction(stop):
    """Positions at a hundred times, by a solver of its own that goes from one mode to the next."""
    times, t, x, v, slip = np.linspace(0, stop, 101), 0.0, 0.0, 0.0, 0
    found = np.zeros(101)
    while t < stop:
        if slip == 0:
            grid = t + np.linspace(1e-9, 4, 400_001)
            over = grid[np.abs(1.6 * np.sin(2.0 * grid)) > 1.0]
            low, high = over[0] - 1e-5, over[0]
            for _ in range(60):
                middle = 0.5 * (low + high)
                low, high = (low, middle) if abs(force(middle)) > 1.0 else (middle, high)
            found[(times >= t) & (times < high)] = x
            t, slip = high, 1 if force(high) > 0 else -1
            continue

        way = slide(t, stop, x, v, slip)
        inside = (times >= t) & (times <= way.t[-1])
        found[inside] = way.sol(times[inside])[0]
        t, x, v = way.t[-1], way.y[0, -1], 0.0
        slip = 0 if abs(force(t)) <= 1.0 else (1 if force(t) > 0 else -1)
    return times, found


@pytest.mark.parametrize("method", ["gauss-seidel", "joint"])
def test_friction_sticks_and_slips(ran, method):
    """Against a solution of its own to 1e-6, with a force that comes from another block."""
    text = """
    run: {stop: 8, step: 0.001, integrator: rk4}
    blocks:
      body: {own:Friction, inputs: {F: force.F}}
      force: {own:Force}
    record: {period: 0.08, signals: [body.x, body.slip]}
    """
    extrapolated = () if method == "joint" else ("run.extrapolation=2",)
    got = ran(text, f"run.method={method}", *extrapolated)
    _, wanted = friction(8.0)
    assert np.abs(got["body.x"] - wanted).max() < 1e-6
    assert set(got["body.slip"]) == {-1, 0, 1} and np.abs(wanted).max() > 0.1


@pytest.mark.parametrize("method", METHODS)
def test_an_event_of_an_input_is_found_between_two_points(ran, method):
    """sin(2 t) crosses zero at every half period, which no communication point hits."""
    text = """
    run: {stop: 10, step: 0.1, integrator: rk4}
    blocks:
      switch: {own:Switch, inputs: {u: force.F}}
      force: {own:Force}
      lag: {own:Lag, inputs: {u: force.F}}
    record: {signals: [switch.n, switch.last]}
    """
    got = ran(text, f"run.method={method}")
    for time, n, last in zip(got["time"], got["switch.n"], got["switch.last"], strict=True):
        assert n == int(time / (math.pi / 2))  # where it begins at zero, it has not crossed it
        assert n == 0 or last == pytest.approx(n * math.pi / 2, abs=1e-10)


@pytest.mark.parametrize("method", METHODS)
def test_a_time_event_is_hit(ran, method):
    text = """
    run: {stop: 2, step: 0.125, integrator: dormand-prince}
    blocks: {a: {own:Alarm, parameters: {at: 1/3}}}
    record: {signals: [a.x]}
    """
    got = ran(text, f"run.method={method}")
    t = got["time"]
    assert got["a.x"] == pytest.approx(np.where(t < 1 / 3, np.exp(-t), np.exp(1 / 3 - t)), abs=1e-8)


def test_an_event_causes_others_at_the_same_time(ran):
    names = [f"d{k}" for k in range(6)]
    pairs = zip(["f.F", *(f"{name}.fallen" for name in names[:-1])], names, strict=True)
    blocks = [f"  {name}: {{own:Domino, inputs: {{before: {before}}}}}" for before, name in pairs]
    text = "run: {stop: 0.5, step: 0.5}\nblocks:\n  f: {own:Force}\n" + "\n".join(blocks)
    got = ran(text + f"\nrecord: {{signals: [{', '.join(f'{name}.fallen' for name in names)}]}}\n")
    assert all(got[f"{name}.fallen"].tolist() == [0.0, 1.0] for name in names)


def test_what_a_sampled_block_sets_may_be_an_event(ran):
    """The held sine crosses zero where it is sampled, and nowhere else; at first it is zero, and crosses nothing."""
    text = """
    run: {stop: 4, step: 0.1}
    blocks:
      switch: {own:Switch, inputs: {u: held.y}}
      held: {own:Sampled, inputs: {u: force.F}, period: 0.5}
      force: {own:Force}
    record: {signals: [switch.n, switch.last]}
    """
    got = ran(text)
    signs = [math.sin(2 * 0.5 * k) > 0 for k in range(9)]
    crossed = [0.5 * k for k in range(2, 9) if signs[k] != signs[k - 1]]
    assert got["switch.last"][-1] == pytest.approx(crossed[-2 if crossed[-1] == 4.0 else -1])
    assert got["switch.n"][-1] == len([t for t in crossed if t < 4.0])


def test_events_without_end_are_an_error(wired):
    text = "run: {stop: 2, step: 0.1}\nblocks:\n  r: {own:Restless, inputs: {u: f.F}}\n  f: {own:Force}\n"
    outcome = run.Run(wired(text)).execute()
    assert outcome.status == "failed" and isinstance(outcome.error, BlockFailed)
    assert "block r: events follow each other without end" in outcome.error.message


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("def event(x, next_x):\n        next_x[0] = 0.0", r"event\(\) names no indicator"),
        ("def event(z, next_x):\n        next_x[0] = z", None),
        ("def outputs(z, y):\n        y[0] = z", "of which event\\(\\) alone knows how it has crossed"),
    ],
)
def test_an_indicator_is_for_event_alone(tmp_path, body, said):
    text = "from cosim import Block, Indicator, Output, State\n\nclass B(Block):\n    x = State()\n    y = Output()\n"
    text += "    z = Indicator()\n\n    def derivatives(x, d_x):\n        d_x[0] = x\n\n"
    text += "    def indicators(x, z):\n        z[0] = x\n\n"
    if "outputs" not in body:
        text += "    def outputs(x, y):\n        y[0] = x\n\n"
    (tmp_path / "b.py").write_text(text + f"    {body}\n")
    (tmp_path / "d.yaml").write_text("run: {stop: 1, step: 0.1}\nblocks:\n  b: {python: 'b.py:B'}\n")
    if said is None:
        run.load(tmp_path / "d.yaml")
    else:
        with pytest.raises((DeclarationError, DiagramErrors), match=said):
            run.load(tmp_path / "d.yaml")
