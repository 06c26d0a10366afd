"""Tables on a terminal: none is wider than it, no figure is lost, and each part has its labels."""

import io

import pytest

from cosim.results.text_table import TextTable
from cosim.terminal import study_display

HEAD = ["variant", *(f"metric_{k}" for k in range(12))]
ROWS = [[f"v{k}", *(f"{1.5 * k * c:.3f}" for c in range(12))] for k in range(3)]


@pytest.mark.parametrize("width", [40, 80, 120])
def test_a_wide_table_is_printed_in_parts(monkeypatch, width):
    monkeypatch.setenv("COLUMNS", str(width))
    out = io.StringIO()
    study_display.show(TextTable("A title", HEAD, ROWS, [[0.0] * 12] * 3, ["A note."]), out)
    lines = out.getvalue().splitlines()
    assert max(map(len, lines)) <= width and lines[0] == "A title" and lines[-1] == "A note."
    words = out.getvalue().split()
    assert [w for w in words if w.startswith("metric_")] == HEAD[1:]
    for row in ROWS:
        assert all(words.count(cell) >= sum(r.count(cell) for r in ROWS) for cell in row[1:])
    assert words.count("variant") == words.count("v0") == words.count("v2") > (width < 120)


def test_a_pipe_gets_the_table_whole(monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)
    out = io.StringIO()
    study_display.show(TextTable("", HEAD, ROWS, [[0.0] * 12] * 3), out)
    assert out.getvalue().count("variant") == 1


def test_one_column_that_is_too_wide_is_not_cut(monkeypatch):
    monkeypatch.setenv("COLUMNS", "20")
    out = io.StringIO()
    study_display.show(TextTable("", ["a", "b"], [["x", "y" * 50]]), out)
    assert "y" * 50 in out.getvalue()
