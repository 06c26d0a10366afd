"""The report: one file, in plain words computed from the numbers, which a browser shows without a network."""

import re
import shutil
import subprocess

import pytest

from cosim.errors import ResultError
from cosim.report import document, words
from cosim.study import kept
from cosim.terminal.cli import main
from tests.study.conftest import DIAGRAM, STUDY, written

pytest.importorskip("matplotlib", reason="matplotlib is not installed (extra `plot`)")
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
TEXT = """
    title: A & B <are studied>
    diagram: diagram.yaml
    variants:
      plain: {description: as it is}
      slow: {description: slower, set: {blocks.lag.parameters.T: 2}}
    record: true
    references:
      the book: {plain: {top: 2.0, low: -0.5}, slow: {top: 20}}
    figures:
      Fig. 1: {caption: all lags, panels: [{signals: swing.x, label: x}]}
      Fig. 2: {kind: distribution, metric: top, caption: how tops are spread}
    """


@pytest.fixture
def report(tmp_path, monkeypatch):
    """Write a study, report it, and return the page's path."""

    def make(text=TEXT):
        monkeypatch.chdir(tmp_path)
        written(tmp_path, DIAGRAM, "diagram.yaml")
        written(tmp_path, text, "study.yaml")
        assert main(["report", "study.yaml"]) == 0
        return tmp_path / "results" / "study" / "report.html"

    return make


def test_the_page_holds_everything_itself(report):
    text = report().read_text()
    assert "A &amp; B &lt;are studied&gt;" in text
    assert text.count("<figure>") == 2
    assert not re.search(r"""(src|href)\s*=\s*["']?(https?:)?//""", text)
    assert "resolved diagram of slow" in text
    assert "numpy" in text and "numba" in text
    assert "3 figures beside the book" in text


def test_a_browser_shows_tables_and_pictures_without_a_network(report, tmp_path):
    browser = next((found for name in BROWSERS if (found := shutil.which(name))), None)
    if browser is None:
        pytest.skip("no browser: apt-get install chromium")
    script = """<script>addEventListener("load", () => {
      const images = [...document.images].filter(i => i.complete && i.naturalWidth > 100).length;
      const rows = document.querySelectorAll("tbody tr").length;
      const wide = document.documentElement.scrollWidth > innerWidth;
      document.body.setAttribute("data-seen", `${images} pictures, ${rows} rows, ${wide ? "too wide" : "fits"}`);
    })</script>"""
    page = tmp_path / "watched.html"
    page.write_text(report().read_text().replace("</body>", script + "</body>"))
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--host-resolver-rules=MAP * ~NOTFOUND"]
    command = [browser, *options, f"--user-data-dir={tmp_path / 'profile'}", "--dump-dom", page.as_uri()]
    dom = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True).stdout
    assert 'data-seen="4 pictures, 5 rows, fits"' in dom


@pytest.mark.parametrize(
    ("ours", "theirs", "expected"),
    [
        (1.0, 4.0, "m: 1 here, 4 in X: 4 times smaller."),
        (1.5, 1.0, "m: 1.5 here, 1 in X: 50 % larger."),
        (-3.0, -1.0, "m: -3 here, -1 in X: 3 times larger in size."),
        (-1.0, 1.0, "m: -1 here, 1 in X."),
        (None, 1.0, "m: no value here, 1 in X."),
        (float("nan"), 1.0, "m: nan here, 1 in X."),
        (float("inf"), 1.0, "m: inf here, 1 in X."),
    ],
)
def test_differences_in_words(ours, theirs, expected):
    assert words.difference("m", ours, "X", theirs) == expected


def test_confidence_is_that_of_clopper_and_pearson():
    # With no failure in n runs the lower bound is (alpha / 2)^(1 / n); the intervals of k and n - k mirror each other.
    low, high = kept.interval(500, 500)
    assert (low, high) == (pytest.approx(0.025 ** (1 / 500)), 1.0)
    assert kept.interval(3, 20) == pytest.approx(tuple(1 - p for p in kept.interval(17, 20)[::-1]))
    # Binomial tails at the bounds are 2.5 % each.
    from math import comb

    low, high = kept.interval(3, 20)
    assert sum(comb(20, k) * low**k * (1 - low) ** (20 - k) for k in range(3, 21)) == pytest.approx(0.025)
    assert sum(comb(20, k) * high**k * (1 - high) ** (20 - k) for k in range(4)) == pytest.approx(0.025)


def test_failures_are_explained_by_what_differs(results):
    done = results(STUDY.rstrip() + "\n    explain: {baseline: plain, metric: top, below: 1.7}\n")
    rows = list(done.rows())
    text = "\n".join(words.explanation(done.study, rows))
    good = {v: sum(r["metrics"]["top"] < 1.7 for r in rows if r["variant"] == v) for v in ("plain", "slow")}
    assert f"plain: top below 1.7 in {good['plain']} of 12 runs" in text
    assert f"slow: top below 1.7 in {good['slow']} of 12 runs" in text
    assert good["plain"] != good["slow"]
    assert "cosim study" in text and "--member" in text


@pytest.mark.parametrize(("baseline", "other"), [("plain", "slow"), ("slow", "plain")])
def test_runs_of_one_start_whose_outcome_differs_are_named_and_can_be_replayed(results, baseline, other):
    done = results(STUDY.rstrip() + f"\n    explain: {{baseline: {baseline}, metric: top, below: 1.7}}\n")
    rows = list(done.rows())
    text = "\n".join(words.explanation(done.study, rows))
    good = {row["name"]: row["metrics"]["top"] < 1.7 for row in rows}
    pairs = [(name, name.replace(other, baseline)) for name in good if name.startswith(other)]
    worse = [name for name, base in pairs if good[base] and not good[name]]
    better = [name for name, base in pairs if good[name] and not good[base]]
    assert bool(worse) != bool(better)
    if worse:
        assert (
            len(worse) > 1
            and f"{len(worse)} of the runs that succeed in {baseline} fail in {other}, {worse[0]}" in text
        )
        assert f"Replay the first: cosim study {done.study.path} --member {worse[0]}" in text
    else:
        assert f"{len(better)} of the failures of {baseline} do not happen in {other}" in text


def test_pictures_can_be_had_as_files(report, tmp_path):
    report()
    assert main(["report", "study.yaml", "--pictures", "png"]) == 0
    pictures = sorted(path.name for path in (tmp_path / "results" / "study").glob("*.png"))
    assert pictures == ["fig__1.png", "fig__2.png"]


def test_bad_tex_in_a_figure_has_its_place_and_loses_no_member(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    written(tmp_path, DIAGRAM, "diagram.yaml")
    written(tmp_path, TEXT.replace("label: x", 'label: "$\\\\frac{1$"'), "study.yaml")
    assert main(["report", "study.yaml"]) == 2
    error = " ".join(capsys.readouterr().err.split())
    assert "study.yaml:11:" in error and "`figures.Fig. 1`: matplotlib cannot draw this" in error
    assert len((tmp_path / "results" / "study" / "members.jsonl").read_text().splitlines()) == 2


def test_failed_runs_are_counted_with_their_reasons(results, tmp_path):
    done = results("{diagram: diagram.yaml, grid: {blocks.swing.parameters.w: [1, 1.0e200, 2]}}")
    text = "\n".join(words.failures(list(done.rows())))
    assert "1 of 3 runs did not come to their end" in text
    assert "not finite" in text and "(base-1)" in text
    document.write(tmp_path / "report.html", [done])
    assert "not finite" in (tmp_path / "report.html").read_text()
    document.write(tmp_path / "report.html", [done])


def test_a_report_takes_no_place_but_that_of_a_report(tmp_path):
    page = tmp_path / "index.html"
    page.write_text("<html><title>mine</title></html>")
    with pytest.raises(ResultError, match="exists and is not a report"):
        document.write(page, [])
    assert page.read_text() == "<html><title>mine</title></html>"


def test_figures_are_written_into_a_folder_in_any_format(report, tmp_path, capsys):
    report()
    assert main(["report", "study.yaml", "--figures", "here/figs"]) == 0
    assert sorted(path.name for path in (tmp_path / "here" / "figs").iterdir()) == ["fig__1.pdf", "fig__2.pdf"]
    assert main(["report", "study.yaml", "--figures", "figs", "--pictures", "svg,png"]) == 0
    assert "drawn in figs/fig__1.svg" in capsys.readouterr().out
    assert len(list((tmp_path / "figs").iterdir())) == 4
    (tmp_path / "figs" / "fig__2.png").write_text("mine")
    assert main(["report", "study.yaml", "--figures", "figs", "--pictures", "png"]) == 2
    assert "it is not replaced" in capsys.readouterr().err
    assert (tmp_path / "figs" / "fig__2.png").read_text() == "mine"
    assert main(["report", "study.yaml", "--pictures", "bmp"]) == 2
    assert "`bmp` is none of png, svg, pdf" in capsys.readouterr().err


def test_two_studies_have_their_figures_apart(report, tmp_path):
    report()
    written(tmp_path, TEXT, "other.yaml")
    assert main(["report", "study.yaml", "other.yaml", "--figures", "figs", "--pictures", "svg"]) == 0
    assert sorted(str(p.relative_to(tmp_path)) for p in (tmp_path / "figs").rglob("*.svg")) == [
        f"figs/{study}/fig__{k}.svg" for study in ("other", "study") for k in (1, 2)
    ]


def test_a_figure_that_moves_is_a_player_in_the_page(report, tmp_path):
    moving = TEXT.rstrip() + "\n      Fig. 3: {kind: animation, members: plain, positions: lag.x, caption: they move}\n"
    path = report(moving)
    text = path.read_text()
    assert text.count('class="player"') == 1 and text.count("querySelectorAll") == 1
    assert not re.search(r"""(src|href)\s*=\s*["']?(https?:)?//""", text)
    assert "<b>Fig. 3.</b> they move" in text


def test_a_figure_that_cannot_move_is_told_at_its_place(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    written(tmp_path, DIAGRAM, "diagram.yaml")
    moving = TEXT.rstrip() + "\n      Fig. 3: {kind: animation, positions: swing.x}\n"
    written(tmp_path, moving, "study.yaml")
    assert main(["report", "study.yaml"]) == 2
    error = " ".join(capsys.readouterr().err.split())
    assert "study.yaml:13:" in error and "`figures.Fig. 3`: `swing.x` is no list of positions" in error


BODIES = """
run: {stop: 1, step: 0.0625}
fleets: {robot: 2}
blocks:
  plant: {block: Integrator, per: robot, inputs: {u: [0.5, 0]}, start: {x: [[0, 0], [2, 2]]}}
record: {period: 0.0625, signals: [plant.x]}
"""
SOUGHT = """
diagram: diagram.yaml
requirements: {left: "always(plant.x[1, 1] < 1)", low: "always(plant.x[2, 2] < 9)"}
search: {over: {"blocks.plant.inputs.u": {uniform: [[0, 0], [2, 0]]}}, runs: 20}
"""


def test_what_a_search_has_found_is_shown_with_pictures(tmp_path, monkeypatch):
    """Two bodies move to the right: the first one violates `left` from u = 1 on, at the end most."""
    monkeypatch.chdir(tmp_path)
    written(tmp_path, BODIES, "diagram.yaml")
    written(tmp_path, SOUGHT, "study.yaml")
    assert main(["falsify", "study.yaml"]) == 3
    assert main(["report", "study.yaml"]) == 0
    page = tmp_path / "results" / "study" / "report.html"
    text = page.read_text()
    assert "What violates a requirement" in text
    assert "left: real, as it is there at every step" in text and "<td>none found</td>" in text
    assert text.count("<figure>") == 2  # the signal, and the ways
    assert "violated most at 1 s" in text
    written(tmp_path, SOUGHT.replace("runs: 20", "runs: 21"), "study.yaml")  # of another study nothing is said
    assert main(["report", "study.yaml"]) == 0
    assert "What violates a requirement" not in page.read_text()
