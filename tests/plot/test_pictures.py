"""Pictures: they are drawn, in all formats, of what was asked for; mistakes are told in words."""

import numpy as np
import pytest

from cosim.cli import main
from cosim.errors import PlotError
from cosim.plot import figures, lines, style
from cosim.plot.signals import curves, read
from cosim.results import ResultWriter, Signal, open_result

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
    signals = [Signal(n, v.shape[1:], v.dtype, unit=units.get(n)) for n, v in samples.items()]
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
        (["--animate", "-o", "picture.mp3"], "animations are gif, html"),
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
        assert [t.get_text() for t in positions.get_legend().get_texts()] == ["plant.x[1,1]", "plant.x[2,1]"]
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


@pytest.mark.parametrize(("kind", "magic"), [("gif", b"GIF89a"), ("html", b"<link")])
def test_animations_move(result, tmp_path, kind, magic):
    from cosim.plot import animation

    output = tmp_path / f"robots.{kind}"
    with open_result(result) as opened:
        animation.animate(opened, animation.Motion(), output, seconds=1, frames=5)
    data = output.read_bytes()
    assert data.lstrip().startswith(magic)
    if kind == "gif":
        from PIL import Image

        with Image.open(output) as image:
            assert image.n_frames == 5


def test_figures_of_a_study(result, tmp_path):
    from cosim.errors import Position, Problems
    from cosim.source import parse_value

    text = """{
      A: {panels: [{signals: test.error, over: "plant.x[1,1]", derivative: true, thresholds: {zero: 0}}], columns: 2},
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
    ],
)
def test_mistakes_in_figures_are_reported(text, message):
    from cosim.errors import Position, Problems
    from cosim.source import parse_value

    problems = Problems()
    figures.read(parse_value(text, Position("study.yaml")).value, problems)
    assert any(message in str(error) for error in problems.errors)
