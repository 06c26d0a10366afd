"""The picture of any runs: what is in the figure, whatever the runs are like."""

import numpy as np
import pytest

from cosim.errors import PlotError, ResultError
from cosim.plot import distribution, legends, style
from cosim.plot.signal_plot import View, plot
from cosim.results.recorded import Recorded
from cosim.results.result_writer import ResultWriter
from cosim.terminal.cli import main

matplotlib = pytest.importorskip("matplotlib", reason="matplotlib is not installed (extra `plot`)")
TIMES = np.linspace(0, 4, 81)


@pytest.fixture
def run(tmp_path):
    """Write a result: signals by name, with arrays (k, *shape) for `times`."""

    def write(name="run", times=TIMES, diagram="", status="completed", end=0.0, about=None, **signals):
        path = tmp_path / f"{name}.nc"
        arrays = {key.replace("__", "."): np.asarray(values) for key, values in signals.items()}
        about = about or {}
        declared = [Recorded(n, v.shape[1:], v.dtype, **about.get(n, {})) for n, v in arrays.items()]
        writer = ResultWriter(path, declared, {"diagram": diagram} if diagram else {})
        if len(times):
            writer.append(np.asarray(times, float), arrays)
        writer.close(status, end=end)
        return path

    return write


def circle():
    """Two robots on circles of 1 and 2 m."""
    x = np.stack([np.cos(TIMES), np.sin(TIMES)], axis=1)
    return np.stack([x, 2 * x], axis=1)


ABOUT = {"p.x": {"fleet": "robot", "unit": "m", "components": ("x", "y")}}


def labels(figure):
    texts = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    return texts + [t.get_text() for a in figure.axes if a.get_legend() for t in a.get_legend().get_texts()]


def saved(figure, tmp_path, kinds=("png", "svg", "pdf")):
    for kind in kinds:
        style.save(figure, tmp_path / f"saved.{kind}")


def test_a_phase_plane_is_one_component_over_another_to_scale(run):
    figure = plot(run(p__x=circle(), about=ABOUT), "p.x[:,2] over p.x[:,1]")
    (axis,) = figure.axes
    assert (axis.get_xlabel(), axis.get_ylabel()) == ("p.x, x (m)", "p.x, y (m)")
    for line, radius in zip(axis.get_lines(), (1, 2), strict=True):
        np.testing.assert_allclose(np.hypot(*line.get_xydata().T), radius)
    assert labels(figure) == ["robot 1", "robot 2"] and axis.get_aspect() == 1.0


def test_a_window_of_time_cuts_a_phase_plane_and_is_the_axis_of_time(run):
    path = run(p__x=circle(), about=ABOUT)
    (axis,) = plot(path, "p.x[1,2] over p.x[1,1]", View(window=(1, 2))).axes
    np.testing.assert_allclose(axis.get_lines()[0].get_xdata(), np.cos(TIMES[20:41]))
    (axis,) = plot(path, "p.x[1,2]", View(window=(1, np.inf))).axes
    assert axis.get_xlim() == (1, 4)
    with pytest.raises(PlotError, match="from 5 to 6 s"):
        plot(path, "p.x[1,2]", View(window=(5, 6)))


def test_one_line_is_named_by_its_axis_alone_however_long_its_name(run):
    figure = plot(run(a__y=TIMES, separation__smallest_gap=TIMES), "a.y, separation.smallest_gap")
    assert [axis.get_ylabel() for axis in figure.axes] == ["a.y", "separation.smallest_gap"]
    assert labels(figure) == []


def test_a_long_legend_takes_no_height_from_the_panels(run):
    runs = [run(name=f"a_run_of_a_long_name_{k}", a__y=TIMES + k, b__y=TIMES - k) for k in range(20)]
    heights = []
    for found in ([runs[0]], runs):
        figure = plot(found, "a.y, b.y")
        figure.draw_without_rendering()
        heights.append(figure.axes[0].get_window_extent().height / figure.dpi)
    assert len(labels(figure)) == 20 and heights[1] > 0.9 * heights[0]


def test_panels_share_time_and_only_the_lowest_numbers_it(run):
    figure = plot(run(a__y=TIMES, b__y=TIMES**2, c__y=-TIMES), "a.y, b.y + c.y")
    upper, lower = figure.axes
    assert upper.get_xlim() == lower.get_xlim() and upper.get_xlabel() == "" and lower.get_xlabel() == "time (s)"
    figure.canvas.draw()
    assert not any(t.label1.get_visible() for t in upper.xaxis.get_major_ticks())
    assert labels(figure) == ["b.y", "c.y"]


def test_a_logarithmic_axis_says_what_it_cannot_show(run, tmp_path):
    path = run(a__y=np.where(TIMES < 1, 0.0, TIMES), b__y=-TIMES - 1)
    (axis,) = plot(path, "a.y", View(log=True)).axes
    assert axis.get_yscale() == "log"
    assert [text.get_text() for text in axis.texts] == ["20 samples at or below 0 are not shown"]
    with pytest.raises(PlotError, match=r"`b\.y` never is"):
        plot(path, "b.y", View(log=True))
    (axis,) = plot(path, "b.y", View(log_x=True)).axes
    assert axis.get_xscale() == "log"
    saved(plot(path, "a.y", View(log=True, log_x=True)), tmp_path, ["png"])


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "values",
    [
        np.full(81, 5.0),
        np.zeros(81),
        5.0 + 1e-15 * np.arange(81),
        np.full(81, np.nan),
        np.where(TIMES > 2, np.inf, TIMES),
        np.where(TIMES > 2, -np.inf, TIMES),
        1e99 * TIMES,
        1e-300 * (1 + TIMES),
        10.0 ** (-100 * TIMES),
        np.arange(81) % 2 == 0,
        np.arange(81, dtype=np.int32),
    ],
)
def test_values_of_all_kinds_are_drawn(run, tmp_path, values):
    figure = plot(run(a__y=values), "a.y")
    saved(figure, tmp_path, ["png"])
    (axis,) = figure.axes
    assert np.isfinite(axis.get_ylim()).all() and axis.get_ylim()[0] < axis.get_ylim()[1]
    drawn = axis.get_lines()[0].get_ydata()
    np.testing.assert_array_equal(drawn, values)


def test_what_is_flat_but_for_rounding_is_a_flat_line(run):
    (axis,) = plot(run(a__y=5.0 + 1e-15 * np.arange(81)), "a.y").axes
    assert axis.get_ylim() == pytest.approx((4.5, 5.5))


@pytest.mark.filterwarnings("error")
def test_one_sample_is_a_dot(run, tmp_path):
    figure = plot(run(times=[0.0], a__y=[3.0]), "a.y")
    (line,) = figure.axes[0].get_lines()
    assert line.get_marker() == "o"
    saved(figure, tmp_path)


def test_no_sample_of_one_of_several_is_told(run, tmp_path, capsys):
    whole, none = run("whole", a__y=TIMES), run("none", times=[], a__y=np.zeros(0))
    assert main(["plot", str(whole), str(none), "-o", str(tmp_path / "a.png")]) == 0
    assert f"without samples, and not drawn: {none}" in capsys.readouterr().err


def test_runs_of_other_periods_and_ends_are_drawn_by_their_own_times(run):
    one = run("one", a__y=TIMES, diagram="run: {step: 1}")
    two = run("two", times=TIMES[:21:5], a__y=TIMES[:21:5], diagram="run: {step: 2}", status="diverged", end=1.0)
    figure = plot([one, two], "a.y")
    lines = figure.axes[0].get_lines()
    assert [len(line.get_xdata()) for line in lines] == [81, 5]
    assert labels(figure) == ["one: run.step = 1", "two: run.step = 2 (diverged at 1 s)"]
    alone = plot(two, "a.y")
    assert alone.get_suptitle() == "diverged at 1 s"


def test_an_element_has_one_name_in_all_runs(run):
    named, bare = run("named", p__x=circle(), about=ABOUT), run("bare", p__x=circle())
    figure = plot([named, bare], "p.x[:,1]")
    assert labels(figure) == ["robot 1", "robot 2", "named", "bare"]


def test_one_run_and_several_have_the_same_axes(run):
    paths = [run(name, a__y=10.0 ** (3 - 2 * TIMES)) for name in ("one", "two")]
    single, double = (plot(p, "a.y").axes[0] for p in (paths[0], paths))
    for what in ("get_yscale", "get_ylim", "get_xlim", "get_ylabel", "get_xlabel"):
        assert getattr(single, what)() == getattr(double, what)()


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", ["a_b.y_1", "_a._y", "a$b.y$", "a%b&c.y#{}", "größe.ä", "моторы.х", "a^2.y~\\"])
def test_names_of_all_kinds_are_drawn_as_they_stand(run, tmp_path, name):
    path = run("50% of $x_1$ & _y", **{name: TIMES, "b.y": TIMES})
    figure = plot(path, [f"{name} + b.y"])
    saved(figure, tmp_path)
    assert labels(figure)[0].strip() == style.plain(name)
    saved(plot([path, path], name), tmp_path, ["png"])


def test_many_runs_that_differ_in_one_number_have_its_colours(run, tmp_path):
    paths = [run(f"r{k}", a__y=k * TIMES, diagram=f"blocks: {{p: {{parameters: {{k: {k + 1}}}}}}}") for k in range(30)]
    figure = plot(paths, "a.y")
    axis, bar = figure.axes
    assert bar.get_ylabel() == "p.k" and not labels(figure)
    assert len({line.get_color() for line in axis.get_lines()}) == 30
    saved(figure, tmp_path, ["png"])


def test_many_other_runs_are_counted(run):
    paths = [run(f"r{k}", a__y=k * TIMES) for k in range(40)]
    figure = plot(paths, "a.y")
    assert [text.get_text() for text in figure.axes[0].texts] == ["40 lines"] and not labels(figure)


def test_a_thousand_members_are_drawn(run, tmp_path):
    x = np.arange(1000.0) + TIMES[:, None]
    figure = plot(run(p__y=x, about={"p.y": {"fleet": "robot"}}), "p.y")
    assert len(figure.axes[0].get_lines()) == 1000
    assert [text.get_text() for text in figure.axes[0].texts] == ["1000 lines"]
    saved(figure, tmp_path, ["png"])


def test_more_runs_than_dashes_have_a_panel_for_each_element(run):
    paths = [run(f"r{k}", p__x=circle(), about=ABOUT) for k in range(6)]
    figure = plot(paths, "p.x")
    assert [axis.get_ylabel() for axis in figure.axes] == [
        f"p.x, robot {i}, {c} (m)" for i in (1, 2) for c in ("x", "y")
    ]
    assert labels(figure) == [f"r{k}" for k in range(6)]


def test_long_lines_are_thinned_without_losing_a_peak_or_a_gap(run):
    times = np.linspace(0, 1e9, 400_000)
    y = np.sin(times)
    y[123_457], y[300_000:300_010] = 50.0, np.nan
    (axis,) = plot(run(times=times, a__y=y), "a.y").axes
    drawn = axis.get_lines()[0].get_ydata()
    assert len(drawn) < 50_000 and np.nanmax(drawn) == 50.0 and np.nanmin(drawn) == np.nanmin(y)
    assert np.isnan(drawn).any()


def test_a_signal_that_only_some_runs_have_is_told_with_the_nearest(run):
    one, two = run("one", a__y=TIMES, b__y=TIMES), run("two", a__y=TIMES)
    with pytest.raises(ResultError, match=r"two.nc has no signal `b\.y`, which others have"):
        plot([one, two], "b.y")
    with pytest.raises(ResultError) as caught:
        plot(one, "a.z")
    assert caught.value.fix == "did you mean `a.y`?"
    assert len(plot([one, two]).axes) == 1  # by default, what all of them have


def test_a_picture_takes_the_place_of_one_of_ours_only(run, tmp_path):
    path = run(a__y=TIMES)
    for kind in ("png", "svg", "pdf"):
        output = tmp_path / f"a.{kind}"
        assert main(["plot", str(path), "-o", str(output)]) == 0
        assert main(["plot", str(path), "-o", str(output)]) == 0  # ours
        output.write_bytes(b"somebody's")
        assert main(["plot", str(path), "-o", str(output)]) == 2
        assert output.read_bytes() == b"somebody's"


def test_no_figure_of_pyplot_is_touched(run):
    from matplotlib import pyplot

    own = pyplot.figure()
    backend, font = matplotlib.get_backend(), matplotlib.rcParams["font.family"]
    plot(run(a__y=TIMES))
    assert pyplot.fignum_exists(own.number)
    assert (matplotlib.get_backend(), matplotlib.rcParams["font.family"]) == (backend, font)
    pyplot.close(own)


def test_what_is_in_memory_is_drawn_as_a_file_is(run):
    from cosim.results.result_file import Result

    with Result(run(a__y=TIMES)) as opened:
        figure = plot({"mine": opened, "again": opened}, "a.y")
    assert labels(figure) == ["mine", "again"]
    assert len(legends.common([])) == 0


def test_a_distribution_rises_from_zero_at_its_smallest_value(tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(style, "save", lambda figure, output: drawn.append(figure))
    groups = {"base": np.array([3.0, np.nan, 1.0, 2.0, 2.0])}
    distribution.draw(distribution.Distribution("m"), {"": groups}, tmp_path / "d.png")
    (line,) = drawn[0].axes[0].get_lines()
    assert line.get_xdata().tolist() == [1, 1, 2, 2, 3] and line.get_ydata().tolist() == [0, 0.25, 0.5, 0.75, 1]
    assert line.get_drawstyle() == "steps-post"
