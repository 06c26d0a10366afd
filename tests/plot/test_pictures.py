"""Pictures: they are drawn, in all formats, of what was asked for; mistakes are told in words."""

import re
from dataclasses import replace

import numpy as np
import pytest

from cosim.errors import PlotError
from cosim.plot import figures, legends, lines, plane, signal_plot, style
from cosim.plot.signals import curves, read
from cosim.results.recorded import Recorded
from cosim.results.result_file import Result, open_result
from cosim.results.result_writer import ResultWriter
from cosim.terminal.cli import main

matplotlib = pytest.importorskip("matplotlib", reason="matplotlib is not installed (extra `plot`)")
MAGIC = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}
DIAGRAM = "metrics: {error: {signal: test.error, reduce: max}, none: {signal: test.absent, reduce: max}}"


@pytest.fixture
def result(tmp_path):
    """Three robots on circles, an error that falls over four decades."""
    times = np.linspace(0, 6, 61)
    angles = times[:, None] + np.arange(3) * 2 * np.pi / 3
    x = np.stack([np.cos(angles) + 0.3 * times[:, None], np.sin(angles), 0 * angles], axis=2)
    neighbours = np.tile(np.array([[1, -1], [2, -1], [0, 1]], np.int32), (61, 1, 1))
    samples = {
        "plant.x": x,
        "reference.x_d": x + 0.01,
        "plant.radius": np.tile([0.2, 0.3, 0.25], (61, 1)),
        "topology.neighbours": neighbours,
        "test.error": 10.0 ** (2 - times),
    }
    units = {"plant.x": ("m", "m", "rad"), "test.error": "m/s2"}
    names = {"plant.x": ("x", "y", "heading")}
    signals = [
        Recorded(n, v.shape[1:], v.dtype, "" if v.ndim < 2 else "robot", units.get(n), components=names.get(n, ()))
        for n, v in samples.items()
    ]
    path = tmp_path / "run.nc"
    with ResultWriter(path, signals, {"diagram": DIAGRAM}) as writer:
        writer.append(times, samples)
    return path


def test_curves_have_names_units_and_values(result):
    with open_result(result) as opened:
        found = curves(opened, "plant.x")
        assert [c.label for c in found][:4] == ["plant.x[1,1]", "plant.x[1,2]", "plant.x[1,3]", "plant.x[2,1]"]
        assert [c.unit for c in found][:3] == ["m", "m", "rad"]
        (one,) = curves(opened, "plant.x[2,1]")
        assert np.array_equal(one.values, opened["plant.x"][:, 1, 0])
        with pytest.raises(PlotError, match="no such element"):
            read(opened, "plant.x[4,1]")


@pytest.mark.parametrize("kind", ["png", "svg", "pdf"])
def test_the_command_draws_each_format(result, tmp_path, kind, capsys):
    output = tmp_path / "deep" / f"picture.{kind}"
    assert main(["plot", str(result), "-o", str(output)]) == 0
    assert output.read_bytes().startswith(MAGIC[kind])
    assert "test.error\n" in capsys.readouterr().out  # by default, what the metrics reduce and the file has


def test_chosen_signals_and_several_results(result, tmp_path):
    other = tmp_path / "other.nc"
    other.write_bytes(result.read_bytes())
    output = tmp_path / "picture.svg"
    command = ["plot", str(result), str(other), "--signals", "plant.x[1,2],test.error", "-o", str(output)]
    assert main(command) == 0
    assert output.stat().st_size > 10_000


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--signals", "plant.y"], "has no signal `plant.y`"),
        (["--signals", "plant.x[9,9]"], "no such element"),
        (["-o", "picture.bmp"], "pictures are png, svg, pdf"),
        (["--animate", "-o", "picture.mp3"], "animations are mp4, gif, html"),
        (["--signals", "plant.x over plant.x over plant.x"], "has two `over`"),
        (["--signals", "test.error over plant.x"], "has 9 elements, and there is 1 line"),
        (["--from", "7"], "there is nothing to draw from 7 to inf s"),
        (["--from", "3", "--to", "2"], "there is nothing to draw from 3 to 2 s"),
        (["--signals", "test.eror"], "did you mean `test.error`"),
        (["--animate", "--radii", "plant.x"], "`plant.x` has the shape (3, 3), and cannot be the radii of 3 bodies"),
        (["--animate", "--references", "test.error"], "cannot be the references of 3 bodies"),
        (["--animate", "--neighbours", "plant.x"], "`plant.x` has no numbers of 3 bodies"),
        (["--animate", "--weights", "plant.x"], "`plant.x` has the shape (3, 3), and `topology.neighbours` has (3, 2)"),
        (["--positions", "plant.x"], "--positions is a part of an animation"),
        (["--radii", "plant.radius"], "--radii is a part of an animation"),
        (["--animate", "--signals", "plant.x"], "--signals chooses lines"),
        (["--animate", "--from", "2"], "--from is for lines"),
        (["--animate", "--log", "y"], "--log is for lines"),
        (["other.nc", "--animate"], "an animation shows one run, not 2"),
        (["--signals", ","], "`,` names no signal"),
    ],
)
def test_mistakes_are_told_in_words(result, arguments, message, capsys):
    assert main(["plot", str(result), *arguments]) == 2
    assert message in capsys.readouterr().err


def test_axes_carry_names_units_and_a_scale_that_fits(result):
    with open_result(result) as opened, style.style():
        panels = [lines.Panel(["test.error"]), lines.Panel(["plant.x[1,1]", "plant.x[2,1]"], thresholds={"limit": 1})]
        figure = lines.draw({"run": opened}, panels)
        error, positions = figure.axes
        assert error.get_yscale() == "log"
        assert error.get_ylabel() == "test.error (m s$^{-2}$)"
        assert positions.get_yscale() == "linear"
        assert positions.get_xlabel() == "time (s)"
        assert [t.get_text() for t in positions.get_legend().get_texts()] == ["robot 1", "robot 2"]
        assert positions.get_ylabel() == "plant.x, x (m)"
        looks = {(line.get_color(), line.get_linestyle()) for line in positions.get_lines()}
        assert len(looks) == 3


def test_lines_differ_in_grey():
    """The first lines of a figure differ in dash, and neighbours in lightness (Rec. 709 luma) by 0.1 at least."""
    assert len({str(style.line(k)["linestyle"]) for k in range(4)}) == 4
    rgb = [matplotlib.colors.to_rgb(colour) for colour in style.COLOURS[:4]]
    luma = [0.2126 * r + 0.7152 * g + 0.0722 * b for r, g, b in rgb]
    assert np.diff(luma).min() > 0.1


def test_a_jump_has_no_slope():
    x = np.linspace(0, 1, 101)
    y = np.where(x < 0.495, x**2, x**2 - 0.5)
    slope = lines._slope(x, y)
    away = np.abs(x - 0.5) > 0.02
    assert np.allclose(slope[away][1:-1], 2 * x[away][1:-1], atol=1e-9)
    assert np.nanmin(slope) > -0.1


def renamed(result, names, tmp_path):
    """The same result with other names of signals."""
    path = tmp_path / "renamed.nc"
    with open_result(result) as opened:
        signals = [replace(s, name=names.get(s.name, s.name)) for s in opened.signals.values()]
        with ResultWriter(path, signals, {}) as writer:
            writer.append(opened.times, {names.get(name, name): opened[name] for name in opened.signals})
    return path


def test_an_animation_finds_its_signals_whatever_the_blocks_are_called(result, tmp_path, capsys):
    names = {"plant.x": "robots.x", "reference.x_d": "wanted.x_d", "plant.radius": "robots.radius"}
    path = renamed(result, names, tmp_path)
    assert main(["plot", str(path), "--animate", "-o", str(tmp_path / "a.gif")]) == 0
    said = "positions robots.x, references wanted.x_d, radii robots.radius, neighbours topology.neighbours"
    assert said in capsys.readouterr().out


@pytest.mark.parametrize(
    ("names", "more", "message"),
    [
        ({"reference.x_d": "leader.x"}, [], "plant.x and leader.x could be the positions"),
        ({"plant.x": "plant.pose"}, [], "say which: --positions plant.pose"),
        ({"plant.x": "plant.pose"}, ["--positions", "plant.radius"], "is no list of positions"),
        ({}, ["--radii", "plant.rad"], "has no signal `plant.rad`"),
    ],
)
def test_an_animation_says_what_it_cannot_find(result, tmp_path, capsys, names, more, message):
    path = renamed(result, names, tmp_path)
    assert main(["plot", str(path), "--animate", "-o", str(tmp_path / "a.gif"), *more]) == 2
    assert message in " ".join(capsys.readouterr().err.split())


def test_parts_of_an_animation_can_be_named_and_left_out(result, tmp_path, capsys):
    path = renamed(result, {"plant.x": "plant.pose"}, tmp_path)
    more = ["--positions", "plant.pose", "--references", "", "--radii", ""]
    assert main(["plot", str(path), "--animate", "-o", str(tmp_path / "a.html"), *more]) == 0
    assert capsys.readouterr().out.startswith("positions plant.pose, neighbours topology.neighbours\n")
    page = (tmp_path / "a.html").read_text()
    assert not re.search("https?:", page)
    assert 'class="player"' in page


def drawn(runs, panels, columns=1):
    """The axes of a figure of lines."""
    return lines.draw(runs, panels, columns).axes


def test_a_scale_is_the_same_with_a_second_run(result, tmp_path):
    with open_result(result) as opened, style.style():
        other = Result(renamed(result, {}, tmp_path))
        other.read = lambda name: np.full(61, 50.0)  # a run whose error does not fall
        alone = drawn({"a": opened}, [lines.Panel(["test.error"])])[0].get_yscale()
        both = drawn({"a": opened, "b": other}, [lines.Panel(["test.error"])])[0].get_yscale()
    assert alone == both == "log"


def test_channels_of_many_members_have_panels_units_and_names_of_their_own(result, tmp_path):
    with open_result(result) as opened, style.style():
        made = signal_plot.plot(opened, "plant.x")
        labels = [axis.get_ylabel() for axis in made.axes]
        (legend,) = made.legends
    assert labels == ["plant.x, x (m)", "plant.x, y (m)", "plant.x, heading (rad)"]
    assert [text.get_text() for text in legend.get_texts()] == ["robot 1", "robot 2", "robot 3"]


def test_units_that_differ_stand_at_the_lines(result):
    with open_result(result) as opened, style.style():
        (axis,) = drawn({"run": opened}, [lines.Panel(["plant.x[1]"])])
        assert axis.get_ylabel() == "plant.x, robot 1"
        names = [text.get_text() for text in axis.get_legend().get_texts()]
    assert names == ["x (m)", "y (m)", "heading (rad)"]


@pytest.mark.parametrize(("count", "legend"), [(9, True), (legends.LISTED, True), (legends.LISTED + 1, False)])
def test_many_lines_have_a_legend_or_their_number(tmp_path, count, legend):
    path = tmp_path / "many.nc"
    with ResultWriter(path, [Recorded("many.y", (count,))], {}) as writer:
        writer.append(np.arange(2.0), {"many.y": np.arange(2.0 * count).reshape(2, count)})
    with open_result(path) as opened, style.style():
        (axis,) = drawn({"run": opened}, [lines.Panel(["many.y"])])
        assert (axis.get_legend() is not None) == legend
        assert [text.get_text() for text in axis.texts] == ([] if legend else [f"{count} lines"])
        looks = {(line.get_color(), str(line.get_linestyle())) for line in axis.get_lines()}
    assert len({str(style.line(k)) for k in range(count)}) == count
    assert len(looks) >= min(count, 8)


def test_bodies_of_different_times_never_cover_each_other(result):
    """They go on by 0.3 m a second on a circle of 1 m, with radii up to 0.3 m: after 2 s they cover each other."""
    from cosim.plot.plane import Plane

    def panels(*at):
        shown = Plane("plant.x", "reference.x_d", "plant.radius", at)
        return len(figures.plane.draw(opened, shown).axes)

    with open_result(result) as opened, style.style():
        assert panels(0) == 1
        assert panels(0, 6) == 1 + any_covered(opened, 0, 60)
        assert panels(0, 0.1, 0.2) == 4  # one of them empty


def test_a_panel_shows_all_bodies_of_its_time(result):
    with open_result(result) as opened, style.style():
        x, radius = opened["plant.x"], opened["plant.radius"]
        figure = plane.draw(opened, plane.Plane("plant.x", "reference.x_d", "plant.radius", (0, 2.5, 3)))
        for axis, k in zip(figure.axes, (0, 25, 30), strict=False):
            for q, (low, high) in enumerate((axis.get_xlim(), axis.get_ylim())):
                assert low <= np.min(x[k, :, q] - radius[k]) and np.max(x[k, :, q] + radius[k]) <= high
                assert high - low < 6  # beside a circle of 1 m


def test_positions_may_have_no_heading(tmp_path, capsys):
    path, times = tmp_path / "points.nc", np.linspace(0, 1, 5)
    x = np.stack([np.outer(times, [1.0, 2.0]), np.outer(times, [0.0, 1.0])], axis=2)
    with ResultWriter(path, [Recorded("plant.pose", (2, 2))], {}) as writer:
        writer.append(times, {"plant.pose": x})
    output = ["-o", str(tmp_path / "a.gif")]
    assert main(["plot", str(path), "--animate", *output]) == 2
    assert "say which: --positions plant.pose" in " ".join(capsys.readouterr().err.split())
    assert main(["plot", str(path), "--animate", *output, "--positions", "plant.pose"]) == 0


def test_a_heading_ends_at_the_rim_and_leaves_the_number_free():
    with style.style():
        body = plane.Body(style.subplots(1, 1, (3, 3))[1][0, 0], "1", np.array([1.0, 2.0, np.pi / 2]), 0.4, "#000000")
        (heading,) = (artist for artist in body.artists if hasattr(artist, "get_xydata"))
        np.testing.assert_allclose(heading.get_xydata(), [[1.0, 2.2], [1.0, 2.4]])


def any_covered(opened, a, b):
    x, radius = opened["plant.x"][..., :2], opened["plant.radius"][0]
    distance = np.linalg.norm(x[a][:, None] - x[b], axis=2)
    return bool(np.any(distance < radius[:, None] + radius))


@pytest.mark.parametrize("text", ["$\\frac{1$", "$\\nosuch$", "$_$"])
def test_bad_tex_is_told_in_words(result, tmp_path, text):
    with open_result(result) as opened, style.style():
        made = lines.draw({"run": opened}, [lines.Panel(["test.error"], label=text)])
        with pytest.raises(PlotError, match="matplotlib cannot draw this"):
            style.save(made, tmp_path / "a.png")


def test_figures_of_a_study(result, tmp_path):
    from cosim.errors import Position, Problems
    from cosim.language.source import parse_value

    text = """{
      A: {panels: [{signals: test.error, over: "plant.x[1,1]", derivative: true, thresholds: {zero: 0}}]},
      B: {kind: plane, positions: plant.x, references: reference.x_d, radii: plant.radius, at: [0, 3]}}"""
    problems = Problems()
    made = figures.read(parse_value(text, Position("study.yaml")).value, problems)
    problems.raise_if_any()
    for figure in made:
        figure.draw({"run": result}, tmp_path / f"{figure.name}.png")
        assert (tmp_path / f"{figure.name}.png").stat().st_size > 10_000
    with pytest.raises(PlotError, match="no recorded signals"):
        figures.Figure("C", Position("study.yaml"), members=["other"]).draw({"run": result}, tmp_path / "C.png")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{A: {panel: []}}", "no key `panel`"),
        ("{A: {kind: pie}}", "`figures.A.kind` cannot be"),
        ("{A: {panels: [{signals: a.b, limits: 3}]}}", "takes a list of numbers"),
        ("{A: {}}", "has no panels"),
        ("{A: {panels: [{signals: a.b}], columns: 1000000}}", "has 1000000 columns for 1 panel"),
        ("{A: {panels: [{signals: a.b}], height: 1000000}}", "`figures.A.height` cannot be 1e+06 inches"),
        ("{A: {panels: [{signals: a.b, limits: [0, 1, 2]}]}}", "limits` takes two numbers, not a list of 3"),
        ("{A: {panels: [{signals: a.b, limits: [0]}]}}", "limits` takes two numbers, not a list of 1"),
        ("{A: {panels: [{signals: a.b, limits: [1, 1]}]}}", "from 1 to 1 there is nothing"),
        ("{A: {panels: [{signals: a.b, span: [1, 0]}]}}", "from 1 to 0 there is nothing"),
        ("{A: {panels: [{signals: a.b, over_label: x}]}}", "has a label for what it is drawn over"),
        ("{A: {panels: [{signals: a.b, log: true, limits: [-1, 1]}]}}", "a logarithmic axis does not reach -1"),
        ("{A: {kind: distribution, metric: m, limits: [1]}}", "`figures.A.limits` takes two numbers"),
        ("{A: {kind: plane, positions: a.x, at: []}}", "`figures.A.at` is empty"),
        ("{A: {kind: plane, positions: a.x, members: [b, c]}}", "shows bodies of one run, not of 2"),
        ("{A: {kind: plane, positions: a.x, metric: m}}", "no key `metric`, as its kind is plane"),
        ("{A: {kind: plane, positions: a.x, panels: [{signals: a.b}]}}", "no key `panels`, as its kind is plane"),
        ("{A: {kind: distribution, metric: m, columns: 2}}", "no key `columns`, as its kind is distribution"),
        ("{A: {panels: [{signals: a.b}], positions: a.x}}", "no key `positions`, as its kind is lines"),
        ("{A: {panels: [{signals: a.b}], limits: [0, 1]}}", "write it in a panel: panels: [{limits: …}]"),
    ],
)
def test_mistakes_in_figures_are_reported(text, message):
    from cosim.errors import Position, Problems
    from cosim.language.source import parse_value

    problems = Problems()
    figures.read(parse_value(text, Position("study.yaml")).value, problems)
    assert any(message in str(error) for error in problems.errors)
    assert all(error.position and error.fix for error in problems.errors)


@pytest.mark.parametrize(
    ("text", "key", "message"),
    [
        ("{panels: [{signals: test.error, over: plant.x}]}", "over", "`plant.x` has 9 elements, and there is 1 line"),
        ("{panels: [{signals: plant.radius, names: [a, b, c, d]}]}", "names", "there are 4 names for 3 lines"),
        (
            '{panels: [{signals: test.error, over: "plant.radius[1]", span: [5, 6]}]}',
            "span",
            "`plant.radius[1]` is never from 5 to 6",
        ),
        ("{panels: [{signals: test.error, window: [7, 8]}]}", "window", "there is no sample from 7 to 8 s"),
        ("{kind: plane, positions: test.error}", "positions", "`test.error` is no list of positions"),
        ("{kind: plane, positions: plant.x, radii: plant.x}", "radii", "cannot be the radii of 3 bodies"),
        ("{kind: plane, positions: plant.x, references: test.error}", "references", "cannot be the references of 3"),
        ('{kind: plane, positions: plant.x, references: "plant.x[1,:]"}', "references", "cannot be the references"),
    ],
)
def test_what_does_not_fit_a_result_is_told_at_its_place(result, tmp_path, text, key, message):
    from cosim.errors import Problems
    from cosim.language import source

    (tmp_path / "figures.yaml").write_text(f"A: {text}")
    problems = Problems()
    (figure,) = figures.read(source.read(tmp_path / "figures.yaml", problems).value, problems)
    problems.raise_if_any()
    with pytest.raises(PlotError, match=re.escape(message)) as caught:
        figure.draw({"run": result}, tmp_path / "A.png")
    assert caught.value.position.column == len("A: ") + text.index(f"{key}: ") + len(f"{key}: ") + 1
    assert caught.value.fix and not (tmp_path / "A.png").exists()


@pytest.mark.filterwarnings("error")
def test_what_stands_still_is_drawn_without_a_warning(result, tmp_path):
    panels = [
        lines.Panel(["test.error"], over="plant.radius[1]", derivative=True),
        lines.Panel(["test.error"], limits=(-1, 1)),  # over decades, which no logarithmic axis shows down to -1
    ]
    with open_result(result) as opened, style.style():
        figure = lines.draw({"run": opened}, panels)
        style.save(figure, tmp_path / "a.png")
        assert figure.axes[1].get_ylim() == (-1, 1)


def test_without_a_signal_on_the_other_axis_the_derivative_is_that_over_time(result):
    panel = lines.Panel(["plant.x[1,1]"], derivative=True)
    with open_result(result) as opened, style.style():
        (line,) = lines.draw({"run": opened}, [panel]).axes[0].get_lines()
        assert np.allclose(line.get_ydata()[1:-1], 0.3 - np.sin(opened.times)[1:-1], atol=0.01)


def fleet(path, count, channels=2):
    """A result with a signal of a fleet: member i has the value i."""
    x = np.ones((5, count, channels)) * np.arange(1, count + 1)[:, None]
    with ResultWriter(path, [Recorded("b.x", x.shape[1:], fleet="ship")], {}) as writer:
        writer.append(np.arange(5.0), {"b.x": x})
    return path


@pytest.mark.parametrize("counts", [(2, 4), (4, 2), (6, 7), (7, 6), (1, 3)])
def test_lines_of_two_fleets_are_called_by_their_own_run_and_member(tmp_path, counts):
    paths = [fleet(tmp_path / f"run{count}.nc", count) for count in counts]
    with Result(paths[0]) as one, Result(paths[1]) as two:
        runs = {path.stem: result for path, result in zip(paths, (one, two), strict=True)}
        axes = signal_plot.plot(runs, "b.x").axes
    told = [(line.get_label(), line.get_ydata()[0]) for axis in axes for line in axis.get_lines()]
    assert len(told) == 2 * sum(counts)
    first, second = (next(x for x in axes[0].get_lines() if x.get_label().startswith(f"{run}: ")) for run in runs)
    assert first.get_color() == second.get_color()  # which tells the line, and the dash the run
    assert first.get_linestyle() != second.get_linestyle()
    for label, value in told:
        run, _, name = label.partition(": ")
        member = re.sub(r"ship (\d+).*", r"\1", name)
        assert int(member) == value and value <= int(run.removeprefix("run"))
    assert main(["plot", *map(str, paths), "-o", str(tmp_path / "p.svg")]) == 0


def test_a_run_without_samples_makes_no_empty_picture(tmp_path, capsys):
    with ResultWriter(tmp_path / "none.nc", [Recorded("b.x")], {}):
        pass
    assert main(["plot", str(tmp_path / "none.nc")]) == 2
    assert "none.nc has no samples" in capsys.readouterr().err
    assert not (tmp_path / "none.png").exists()


def test_bodies_that_are_nowhere_do_not_stretch_a_moving_picture(tmp_path, capsys):
    x = np.ones((5, 3, 2)) * np.arange(3)[:, None]
    x[2:, 1] = np.inf
    for name, values in (("part", x), ("none", np.full((5, 3, 2), np.nan))):
        with ResultWriter(tmp_path / f"{name}.nc", [Recorded("swarm.x", (3, 2))], {}) as writer:
            writer.append(np.arange(5.0), {"swarm.x": values})
    assert main(["plot", "--animate", str(tmp_path / "part.nc")]) == 0
    capsys.readouterr()
    assert main(["plot", "--animate", str(tmp_path / "none.nc")]) == 2
    assert "no position in `swarm.x` is finite" in capsys.readouterr().err
