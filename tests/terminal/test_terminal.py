"""What is printed: to be read by people, on terminals of every kind, and in files."""

from __future__ import annotations

import io
import re
import sys

import pytest

from cosim.errors import DiagramErrors, MissingFile, Position, RuleViolation, UnknownParameter, WrongType
from cosim.results.formatting import format_change, format_duration, format_value
from cosim.terminal import screen
from cosim.terminal.screen import (
    TIED,
    Progress,
    metrics_table,
    print_errors,
    print_rows,
    print_warnings,
    print_wrapped,
)

METRICS = {
    "N_x": 5.1e-7,
    "min_gap": 0.13412,
    "lost": None,
    "collisions": [{"pair": [1, 6], "time": 2.345}, {"pair": [2, 3], "time": 10.1}],
}
UNITS = {"N_x": "m", "min_gap": "m", "collisions": "s"}
WINDOWS = {"N_x": "max, 10–20 s", "min_gap": "min", "collisions": "events"}


class Screen(io.StringIO):
    """A terminal that keeps what it is shown."""

    def isatty(self):
        return True


class Ascii(io.StringIO):
    """A file that takes ASCII only."""

    encoding = "ascii"

    def write(self, text):
        return super().write(text.encode("ascii").decode())


@pytest.fixture(autouse=True)
def plain_environment(monkeypatch):
    for name in ("NO_COLOR", "FORCE_COLOR", "TTY_COMPATIBLE", "TTY_INTERACTIVE", "COLORTERM"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.setenv("COLUMNS", "80")


def table(*arguments, file=None):
    """The lines of a table without the spaces at their ends."""
    file = file or io.StringIO()
    metrics_table(*arguments, file=file)
    return [line.rstrip() for line in file.getvalue().splitlines()]


def test_table_of_a_first_run():
    assert table(METRICS, None, UNITS, WINDOWS) == [
        "metric                value   unit   reduction",
        "─────────────────────────────────────────────────",
        "N_x               5.100e-07   m      max, 10–20 s",
        "min_gap              0.1341   m      min",
        "lost                      —",
        "collisions    1–6 at 2.35 s          events",
        "             2–3 at 10.10 s",
    ]


def test_table_beside_the_run_before():
    previous = {"N_x": 1.7e-4, "min_gap": 0.13412, "collisions": []}
    lines = table(METRICS, previous, UNITS, WINDOWS)
    assert lines[0].split() == ["metric", "value", "unit", "previous", "change", "reduction"]
    assert lines[2].split() == ["N_x", "5.100e-07", "m", "0.0001700", "-99.7", "%", "max,", "10–20", "s"]
    assert lines[3].split() == ["min_gap", "0.1341", "m", "0.1341", "same", "min"]
    assert lines[4].split() == ["lost", "—", "new"]
    assert lines[5].split() == ["collisions", "1–6", "at", "2.35", "s", "none", "changed", "events"]
    assert max(map(len, lines)) <= 80


def test_table_without_units_and_windows_and_brackets_are_not_markup():
    assert [line.split() for line in table({"[bold]x": 3})[2:]] == [["[bold]x", "3"]]


def test_table_in_ascii():
    lines = table({**METRICS, "µ": 1.0}, {"N_x": 1e-9}, UNITS, WINDOWS, file=Ascii())
    assert "1-6 at 2.35 s" in lines[4] and "x 510" in lines[1]


WIDE = {
    "a_metric_with_quite_a_long_name" * 2: [0.123456] * 6,
    "huge": 10**150,
    "small": -1.234567e-305,
    "matrix": [[1e300, -1.2e-7, 3.0]] * 3,
    "c": [{"member": 3, "time": 1e-3}] * 20,
}


def test_names_numbers_and_units_are_in_one_piece_however_narrow_the_terminal():
    lines = table(WIDE, WIDE, dict.fromkeys(WIDE, "kg.m2/s3"), dict.fromkeys(WIDE, "max, 10.5–20.25 s"))
    text = "\n".join(lines)
    for name in WIDE:
        assert any(line.startswith(f"{name} ") for line in lines)
    row = next(line for line in lines if line.startswith("huge"))
    assert row.split() == ["huge", "1.000e+150", "kg.m2/s3", "1.000e+150", "same", "max,"]
    for whole in ("-1.235e-305", "[[1.000e+300, -1.200e-07,", "3.000]]", "10.5–20.25 s", "and 12 more"):
        assert whole in text
    assert "…" not in text


def test_a_table_of_usual_width_fits_into_80_columns_and_a_pipe_takes_lines_of_any_length(monkeypatch):
    shown = {"largest_error": 1e300, "gap": -1e-300}
    arguments = (
        shown,
        {"largest_error": 1.0, "gap": 1.0},
        dict.fromkeys(shown, "kg.m2/s3"),
        dict.fromkeys(shown, "mean, 10.5–20.25 s"),
    )
    lines = table(*arguments)
    assert max(map(len, lines)) <= 80 and lines[2].endswith("mean,") and lines[3].split() == ["10.5–20.25", "s"]
    monkeypatch.delenv("COLUMNS")
    lines = table(*arguments)
    assert len(lines) == 4 and lines[2].endswith("mean, 10.5–20.25 s")


def test_words_are_broken_between_words_and_rows_stay_columns():
    rows = [["plant", "3 × Robot", f"u{TIED}←{TIED}controller.u; " * 5 + "w"], ["b", "Lag", "y" * 90]]
    file = io.StringIO()
    print_rows(rows, "  ", file)
    *wrapped, long = file.getvalue().splitlines()
    assert max(map(len, wrapped)) <= 80 and len(wrapped) == 2
    assert wrapped[0].startswith("  plant  3 × Robot  u ← controller.u; u") and wrapped[1].startswith(" " * 20 + "u ← ")
    assert all(not line.endswith("←") for line in wrapped)
    assert long.split() == ["b", "Lag", "y" * 90]


def test_a_narrow_column_of_words_goes_below_and_a_pipe_breaks_nothing(monkeypatch):
    file = io.StringIO()
    print_rows([["x" * 70, "some words that belong to it"]], "", file)
    assert file.getvalue() == f"{'x' * 70}\n    some words that belong to it\n"
    file = io.StringIO()
    print_rows([["key", "a | " * 30 + "b", "which it is"]], "", file)
    assert max(map(len, file.getvalue().splitlines())) <= 80
    assert file.getvalue().split() == ["key", *("a | " * 30).split(), "b", "which", "it", "is"]
    monkeypatch.delenv("COLUMNS")
    file = io.StringIO()
    print_wrapped("word " * 100, 4, file)
    assert file.getvalue() == "word " * 99 + "word\n"


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0130, "0.01300"),
        (1234.5, "1234"),
        (123.45, "123.5"),
        (-2e8, "-2.000e+08"),
        (0.0, "0.000"),
        (30000, "30000"),
        (999_999_999, "999999999"),
        (-(10**150), "-1.000e+150"),
        (10**400, "1.000e+400"),
        (1.234e150, "1.234e+150"),
        (True, "yes"),
        (None, "—"),
        (float("nan"), "nan"),
        (float("-inf"), "-inf"),
        ([], "none"),
        ([1, 2.5], "[1, 2.500]"),
        ([[1.0, 0.0], [0.0, 1.0]], "[[1.000, 0.000], [0.000, 1.000]]"),
        ([0] * 9, "[0, 0, 0, 0, 0, 0, …]"),
        ([{"member": 3, "time": 0.0123}], "3 at 0.0123 s"),
        ([{"pair": [1, 6], "time": 0.0}], "1–6 at 0.00 s"),
    ],
)
def test_values(value, text):
    assert format_value(value) == text


@pytest.mark.parametrize(
    ("value", "before", "text"),
    [
        (1.0, 1.0, "same"),
        (1.1, 1.0, "+10.0 %"),
        (-1.1, -1.0, "-10.0 %"),
        (0.5, -1.0, "+150.0 %"),
        (1.0 + 1e-14, 1.0, ""),
        (1.0 + 1e-6, 1.0, ""),
        (1.0 + 4e-4, 1.0, ""),  # both are shown as 1.000
        (1.0 + 6e-4, 1.0, "+0.06 %"),
        (0.99999, 1.0, ""),
        (30000, 30001, "-0.0033 %"),  # whole numbers show all digits
        (30000, 30003, "-0.01 %"),
        (-1e300, 1.0, "-1e+302 %"),
        (1e300, 1e-300, "changed"),
        (10**400, 10, "changed"),
        (float("inf"), 1.0, "changed"),
        (50.0, 1.0, "× 50"),
        (10.5, 1.0, "× 10.5"),
        (9.5, 1.0, "+850.0 %"),
        (5.0, -0.1, "+5100.0 %"),
        (1.0, 0.0, "changed"),
        (1.0, None, "changed"),
        (None, None, "same"),
        (float("nan"), None, "changed"),
        (float("nan"), float("nan"), "same"),
        (float("inf"), float("inf"), "same"),
        (float("inf"), float("nan"), "changed"),
        (True, False, "changed"),
        ([{"pair": [1, 6], "time": 2.3}], [{"pair": [1, 6], "time": 2.3}], "same"),
    ],
)
def test_changes(value, before, text):
    assert format_change(value, {"N": before}, "N") == text
    assert format_change(value, {}, "N") == "new"


@pytest.fixture
def diagram(tmp_path):
    path = tmp_path / "formation.yaml"
    path.write_text("title: x\nblocks:\n  plant: {parameters: {mas: 3}}\n\t漢字: [3, foo]\n", encoding="utf-8")
    return str(path)


def test_errors_point_at_the_line(diagram):
    file = io.StringIO()
    print_errors(
        DiagramErrors(
            [
                UnknownParameter("block `plant`: no parameter `mas`", Position(diagram, 3, 24), "did you mean `mass`?"),
                WrongType("`foo` is [not] a number", Position(diagram, 4, 10)),
                MissingFile("no such file", Position("nowhere.yaml", 2, 3)),
                MissingFile("no diagram given"),
            ]
        ),
        file,
    )
    assert file.getvalue().splitlines() == [
        f"{diagram}:3:24: error: block `plant`: no parameter `mas`",
        "      3 |   plant: {parameters: {mas: 3}}",
        "        |                        ^",
        "    fix: did you mean `mass`?",
        f"{diagram}:4:10: error: `foo` is [not] a number",
        "      4 |  漢字: [3, foo]",
        "        |            ^",  # two of the characters before it are two cells wide
        "nowhere.yaml:2:3: error: no such file",
        "error: no diagram given",
        "4 errors",
    ]


def test_one_error_is_not_counted_and_a_place_may_lack_its_column_or_lie_beyond_the_file(diagram):
    file = io.StringIO()
    print_errors(WrongType("no number", Position(diagram)), file)
    print_errors(WrongType("no number", Position(diagram, 99, 1)), file)
    assert file.getvalue() == f"{diagram}: error: no number\n{diagram}:99:1: error: no number\n"


def test_long_lines_are_not_broken(tmp_path):
    file = io.StringIO()
    place = Position(str(tmp_path / ("long" * 30) / "x.yaml"), 3, 4)
    print_warnings([RuleViolation("Theorem 3: " + "σ " * 60, place)], file)
    assert file.getvalue().startswith(f"{place}: warning: Theorem 3: σ") and file.getvalue().count("\n") == 1


def test_errors_go_to_standard_error(capsys):
    print_errors(WrongType("no number"))
    print_warnings([RuleViolation("Theorem 3")])
    assert capsys.readouterr() == ("", "error: no number\nwarning: Theorem 3\n")


@pytest.mark.parametrize(
    ("environment", "coloured"), [({}, True), ({"NO_COLOR": "1"}, False), ({"TERM": "dumb"}, False)]
)
def test_colours_on_a_terminal_that_wants_them(monkeypatch, environment, coloured):
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    screen = Screen()
    print_errors(WrongType("no number"), screen)
    assert ("\x1b[1;31m" in screen.getvalue()) is coloured
    assert re.sub(r"\x1b\[[0-9;]*m", "", screen.getvalue()) == "error: no number\n"


def test_what_an_ascii_terminal_cannot_show_does_no_harm():
    file = Ascii()
    print_warnings([RuleViolation("σ(Q₁) – 3 × 4 µm", fix="…")], file)
    assert file.getvalue() == "warning: ?(Q?) - 3 x 4 um\n    fix: ...\n"


def run_with_progress(file, monkeypatch, stop=30.0):
    clock = iter(range(1000))
    monkeypatch.setattr(screen.time, "perf_counter", lambda: float(next(clock)))
    with Progress(stop, file) as progress:
        for simulated in (10.0, 20.0, 30.0):
            progress.update(simulated)


def test_progress_shows_time_speed_and_time_left(monkeypatch):
    from rich.progress import Progress as Bar

    shown = []
    monkeypatch.setattr(Bar, "update", lambda self, task, **fields: shown.append(fields))
    run_with_progress(Screen(), monkeypatch)
    assert shown[0] == {"completed": 10.0, "total": 30.0, "speed": "10 × real time", "left": "2 s left"}
    assert shown[-1] == {"completed": 30.0, "total": 30.0, "speed": "10 × real time", "left": "0 s left"}


def test_the_end_may_be_told_on_the_way():
    screen = Screen()
    with Progress(30.0, screen) as progress:
        progress._began -= 10
        progress.update(15.0, 60.0)
        progress._bar.refresh()
        progress.update(30.0, 120.0)
        progress._bar.refresh()
    text = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", screen.getvalue())
    assert "15 / 60 s 1.5 × real time 30 s left" in text and "30 / 120 s" in text


def test_progress_is_drawn_and_taken_away():
    screen = Screen()
    with Progress(30.0, screen) as progress:
        progress._began -= 10
        progress.update(15.0)
        progress._bar.refresh()
    text = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", screen.getvalue())
    assert "15 / 30 s 1.5 × real time 10 s left" in text
    assert screen.getvalue().endswith("\x1b[2K")


@pytest.mark.parametrize(("file", "term"), [(io.StringIO(), "xterm"), (Screen(), "dumb")])
def test_no_progress_where_nobody_watches(monkeypatch, file, term):
    monkeypatch.setenv("TERM", term)
    run_with_progress(file, monkeypatch)
    assert file.getvalue() == ""


def test_a_short_run_shows_no_progress():
    screen = Screen()
    with Progress(1.0, screen) as progress:
        progress.update(0.0)
        progress.update(1.0)
    assert screen.getvalue() == ""


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.4, "0 s"), (59.7, "1 min 0 s"), (125, "2 min 5 s"), (3600, "1 h 0 min"), (9000, "2 h 30 min")],
)
def test_durations(seconds, text):
    assert format_duration(seconds) == text


def test_rich_is_imported_only_to_print():
    import subprocess

    code = (
        "import sys, cosim.terminal.screen, cosim.results.result_writer, cosim.results.metrics; "
        "print({'rich', 'h5py', 'numba'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"
