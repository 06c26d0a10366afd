"""Lines of a plot: of each pixel the least and the largest sample, so that no peak is lost, whatever is zoomed to."""

import base64
from pathlib import Path

import numpy as np
import pytest

from cosim.engine.probes import Samples
from cosim.results.recorded import Recorded
from cosim.watch import curve_views
from cosim.watch.spool import Spool, Track
from cosim.wiring.network import Signal


@pytest.fixture
def spooled(tmp_path):
    """The track of some signals, written in batches of 1000 samples."""

    def spool(times, *signals: tuple[Recorded, np.ndarray]) -> Track:
        one = Spool(tmp_path / "samples", [recorded for recorded, _ in signals])
        for k in range(0, len(times), 1000):
            parts = {Signal(*recorded.name.split(".")): values[k : k + 1000] for recorded, values in signals}
            one.append(Samples(times[k : k + 1000], parts))
        return Track(one.close({}))

    return spool


def numbers(text: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), "<f8")


def drawn(track, name="a.x", span=None, width=100, first=0, count=20, channel=0):
    wanted = {"name": name, "channel": channel, "first": first, "count": count}
    found = curve_views.window(track, wanted, span or tuple(curve_views.span_of(track)), width)
    t = numbers(found["t"])
    return t, *(numbers(found[key]).reshape(found["lines"], len(t)) for key in ("low", "high"))


def test_samples_come_back_to_the_bit(spooled):
    rng = np.random.default_rng(1)
    times = np.arange(2500) * 0.01
    x, flags, counts = rng.normal(size=(2500, 3, 2)), rng.random(2500) > 0.5, rng.integers(-5, 5, (2500, 4))
    signals = [Recorded("a.x", (3, 2)), Recorded("a.on", (), bool), Recorded("a.n", (4,), "int32")]
    track = spooled(times, *zip(signals, (x, flags, counts), strict=True))
    np.testing.assert_array_equal(track.times, times)
    for name, values in (("a.x", x), ("a.on", flags), ("a.n", counts)):
        np.testing.assert_array_equal(track.read(name), values)


def test_each_point_is_the_least_and_the_largest_of_its_samples(spooled):
    rng = np.random.default_rng(2)
    times = np.cumsum(rng.random(10_000))  # nothing says that samples are equally far apart
    x = rng.normal(size=10_000)
    x[7777] = 1e6  # a peak of one sample
    track = spooled(times, (Recorded("a.x"), x))
    for span in [(times[0], times[-1]), (times[2000], times[9000]), (times[7000], times[8000])]:
        t, low, high = drawn(track, span=span, width=100)
        assert len(t) <= 100 and high.max() == 1e6
        edges = np.searchsorted(times, t)
        for k, (begin, end) in enumerate(zip(edges, [*edges[1:], None], strict=True)):
            if end is not None:
                assert low[0, k] == x[begin:end].min() and high[0, k] == x[begin:end].max()
                assert times[end - 1] - times[begin] <= (span[1] - span[0]) / 100 + 2.0  # a pixel, and two gaps


def test_few_samples_are_drawn_as_they_are_and_reach_the_edges(spooled):
    times = np.arange(1000) * 0.1
    track = spooled(times, (Recorded("a.x"), np.sin(times)))
    t, low, high = drawn(track, span=(10.05, 12.05))
    assert t[0] <= 10.05 and t[-1] >= 12.05 and len(t) == 22
    np.testing.assert_array_equal(low[0], np.sin(t))
    np.testing.assert_array_equal(low, high)


def test_what_is_no_number_is_a_gap_where_no_number_is_beside_it(spooled):
    times = np.arange(10_000) * 0.1
    x = np.ones(10_000)
    x[5000:6000], x[100] = np.nan, np.nan
    t, low, _ = drawn(spooled(times, (Recorded("a.x"), x)))
    np.testing.assert_array_equal(np.isnan(low[0]), (t >= 500) & (t < 599))


def test_lines_are_members_of_a_fleet_and_else_elements(spooled):
    times = np.arange(5) * 1.0
    fleet = np.arange(5 * 1000 * 3.0).reshape(5, 1000, 3)
    free = np.arange(5 * 4.0).reshape(5, 2, 2)
    robots = Recorded("a.x", (1000, 3), fleet="robot", unit=("m", "m", "rad"), components=("x", "y", "heading"))
    track = spooled(times, (robots, fleet), (Recorded("b.y", (2, 2)), free))
    layout = curve_views.layout(track.signals["a.x"])
    assert (layout["lines"], layout["word"], layout["channels"]) == (1000, "robot", ["x", "y", "heading"])
    assert layout["units"] == ["m", "m", "rad"]
    _, low, _ = drawn(track, first=500, channel=2, count=1000)
    assert len(low) == curve_views.MOST_LINES
    np.testing.assert_array_equal(low[3], fleet[:, 503, 2])
    _, low, _ = drawn(track, "b.y")
    np.testing.assert_array_equal(low, free.reshape(5, 4).T)
    assert curve_views.layout(track.signals["b.y"])["lines"] == 4


def test_a_run_without_samples_has_no_lines(spooled):
    track = spooled(np.empty(0), (Recorded("a.x"), np.empty(0)))
    assert curve_views.span_of(track) is None
    wanted = {"name": "a.x", "channel": 0, "first": 0, "count": 1}
    assert curve_views.window(track, wanted, (0.0, 1.0), 100) is None
    assert Path(track.path).is_dir() and not track.remove() and not Path(track.path).exists()
