"""Tables: what is reduced how, what headings say of it, and that rows and labels are not mixed up."""

import csv

import numpy as np
import pytest

from cosim.metrics import REDUCTIONS
from cosim.study import dataset, tables
from cosim.study.model import OVER_RUNS, STATISTICS
from cosim.study.tables import markdown
from tests.study.conftest import DIAGRAM, STUDY

ALL = (
    DIAGRAM.rstrip()
    + """
      average: {signal: swing.x, reduce: mean}
      effective: {signal: swing.x, reduce: rms}
    """
)


def test_tables(results, tmp_path):
    text = STUDY.rstrip() + (
        "\n    tables:\n      Tops:\n        rows: [variant, w]\n        columns:\n"
        "          most: {metric: top, over: max, format: .4f}\n          half: {metric: top, over: 0.5}\n"
        "          low: {metric: low, below: -0.5}\n"
    )
    done = results(text)
    (table,) = tables.tables(done)
    assert table.head == ["variant", "swing.w", "most, max", "half, 50 % quantile", "low, share"]
    assert [row[:2] for row in table.rows] == [[v, w] for v in ("plain", "slow") for w in "123"]
    tops = [row["metrics"]["top"] for row in done.rows()][:4]
    assert table.values[0][0] == max(tops)
    assert table.values[0][1] == np.median(tops)
    assert [row[-1] for row in table.rows] == ["0.0%", "0.0%", "100.0%"] * 2
    tables.write(done, [table])
    assert (tmp_path / "results" / "tops.md").read_text().count("|") == 6 * 8
    assert f"{max(tops)!r}" in (tmp_path / "results" / "tops.csv").read_text()


def test_a_metric_is_reduced_over_draws_as_it_is_over_time_and_the_heading_says_so(results):
    done = results(STUDY, ALL)
    (table,) = tables.tables(done)
    assert table.head[2:] == ["top, max", "last, mean", "low, min", "average, mean", "effective, rms"]
    rows = [row["metrics"] for row in done.rows()][:4]
    numbers = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    expected = [numbers["top"].max(), numbers["last"].mean(), numbers["low"].min(), numbers["average"].mean()]
    expected.append(np.sqrt(np.mean(numbers["effective"] ** 2)))  # of all samples of all runs, which are equally many
    assert table.values[0] == pytest.approx(expected, rel=1e-15)


def test_every_reduction_has_its_statistic_over_runs():
    assert set(OVER_RUNS) == set(REDUCTIONS)
    assert set(OVER_RUNS.values()) <= set(STATISTICS)


def test_events_are_reduced_to_the_run_with_the_most():
    column = tables.Column("hits", tables.Node("hits", None))
    assert tables.with_statistic(column, {"hits": "events"}).statistic == "max"


def test_where_nothing_is_reduced_headings_are_the_metrics_names(results):
    (table,) = tables.tables(results("{diagram: diagram.yaml, variants: {a: {}, b: {}}}"))
    assert table.head == ["variant", "top", "last", "low"]


@pytest.mark.parametrize(
    ("column", "expected"),
    [
        ("median gap: {metric: top, over: median}", "median gap"),
        ("top_max: {metric: top}", "top_max"),
        ("maximal: {metric: top}", "maximal, max"),
        ("good: {metric: top, above: 0}", "good, share"),
        ("most: {metric: low}", "most, min"),
        ("q: {metric: top, over: 0.05}", "q, 5 % quantile"),
        ("spread: {metric: top, over: std}", "spread, std"),
    ],
)
def test_a_heading_names_its_statistic_unless_it_does_so_already(results, column, expected):
    done = results(STUDY.rstrip() + f"\n    tables: {{t: {{rows: variant, columns: {{{column}}}}}}}\n")
    assert tables.tables(done)[0].head == ["variant", expected]


def test_values_that_look_alike_have_rows_of_their_own(results):
    (table,) = tables.tables(results("{diagram: diagram.yaml, grid: {blocks.swing.parameters.w: [2, 2.0000001]}}"))
    assert [row[1] for row in table.rows] == ["2", "2.0000001"]
    assert table.head[2:] == ["top", "last", "low"]


def test_texts_and_lists_are_labels_without_quotation_marks(results, tmp_path):
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    text = (
        '{diagram: diagram.yaml, grid: {blocks.lag.parameters.T: ["i / 2", [1, 2, "pi"]], run.method: [jacobi, joint]}}'
    )
    done = results(text)
    made = tables.tables(done)
    assert [row[1:3] for row in made[0].rows] == [[t, m] for t in ("i / 2", "[1, 2, pi]") for m in ("jacobi", "joint")]
    tables.write(done, made)
    with (tmp_path / "results" / "study.csv").open(newline="") as file:
        assert [row[1] for row in csv.reader(file)] == ["lag.T", "i / 2", "i / 2", "[1, 2, pi]", "[1, 2, pi]"]
    dataset.write(tmp_path / "study.nc", done)
    with xarray.open_dataset(tmp_path / "study.nc", engine="h5netcdf") as data:
        assert list(data["run.method"].values) == ["jacobi", "joint"]
        assert list(data["lag.T"].values) == ["i / 2", "[1, 2, pi]"]


def test_true_and_1_are_two_values(study):
    (axis,) = study("{diagram: diagram.yaml, grid: {a.b: [true, 1]}}").grid
    assert axis.labels == ("true", "1")
    assert not axis.numeric


def test_runs_that_did_not_come_to_their_end_are_said(results):
    done = results("{diagram: diagram.yaml, grid: {blocks.swing.parameters.w: [1, 1.0e200, 2]}}")
    (table,) = tables.tables(done)
    assert table.notes == ["1 of 3 runs did not come to their end: figures are of the time until then."]
    assert table.notes[0] in markdown(table)


@pytest.mark.parametrize("title", ["", ".", "../x", "x" * 900, "ä" * 300, "con"])
def test_a_table_of_any_title_is_written_into_the_folder(results, tmp_path, title):
    done = results(f'{{diagram: diagram.yaml, tables: {{"{title}": {{columns: [top]}}}}}}')
    before = set(tmp_path.rglob("*"))
    tables.write(done, tables.tables(done))
    made = set(tmp_path.rglob("*")) - before
    assert len(made) == 2
    assert all(path.parent == tmp_path / "results" for path in made)


@pytest.mark.parametrize(
    ("above", "below", "expected"),
    [
        (None, None, [True, True, True, False]),
        (1.0, None, [False, False, True, False]),  # the limit itself is not above it
        (None, 1.0, [True, False, False, False]),
        (0.0, 2.0, [False, True, False, False]),
        (1.0, 1.0, [False, False, False, False]),
    ],
)
def test_a_share_counts_what_is_beyond_all_limits(above, below, expected):
    assert tables.satisfies(np.array([0.0, 1.0, 2.0, np.nan]), above, below).tolist() == expected
