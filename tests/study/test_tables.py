"""Tables: what is reduced how, what headings say of it, and that rows and labels are not mixed up."""

import csv
import os
import resource
from types import SimpleNamespace

import numpy as np
import pytest

from cosim.errors import ResultError
from cosim.report import words
from cosim.results.metrics import REDUCTIONS
from cosim.results.step_figures import STEP_FIGURES
from cosim.study import dataset, row_figures, table_files, text_tables
from cosim.study.definition import OVER_RUNS, STATISTICS
from cosim.study.table_files import markdown
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
    (table,) = text_tables.tables(done)
    assert table.head == ["variant", "swing.w", "most, max", "half, 50 % quantile", "low, share"]
    assert [row[:2] for row in table.rows] == [[v, w] for v in ("plain", "slow") for w in "123"]
    tops = [row["metrics"]["top"] for row in done.rows()][:4]
    assert table.values[0][0] == max(tops)
    assert table.values[0][1] == np.median(tops)
    most = 1 - 0.025 ** (1 / 4)  # Clopper and Pearson: 0 of 4
    none, all_ = f"0.0% (0.0% … {most:.1%})", f"100.0% ({1 - most:.1%} … 100.0%)"
    assert [row[-1] for row in table.rows] == [none, none, all_] * 2
    table_files.write(done, [table])
    assert (tmp_path / "results" / "tops.md").read_text().count("|") == 6 * 8
    assert f"{max(tops)!r}" in (tmp_path / "results" / "tops.csv").read_text()


def test_a_metric_is_reduced_over_draws_as_it_is_over_time_and_the_heading_says_so(results):
    done = results(STUDY, ALL)
    (table,) = text_tables.tables(done)
    assert table.head[2:] == ["top, max", "last, mean", "low, min", "average, mean", "effective, rms"]
    rows = [row["metrics"] for row in done.rows()][:4]
    numbers = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    expected = [numbers["top"].max(), numbers["last"].mean(), numbers["low"].min(), numbers["average"].mean()]
    expected.append(np.sqrt(np.mean(numbers["effective"] ** 2)))  # of all samples of all runs, which are equally many
    assert table.values[0] == pytest.approx(expected, rel=1e-15)


def test_a_table_says_which_figures_it_has_no_room_for(results):
    """An array of a run is in no cell; nobody shall take that for a figure that no run had."""
    done = results(STUDY, DIAGRAM.rstrip() + "\n      whole: {signal: lag.x, reduce: final}\n    ")
    (table,) = text_tables.tables(done)
    assert table.notes == ["Arrays, which `study.nc` alone holds: whole."]
    assert {line[-1] for line in table.rows} == {"—"} and len(next(done.rows())["metrics"]["whole"]) == 3


def test_every_reduction_has_its_statistic_over_runs():
    assert set(OVER_RUNS) == {*REDUCTIONS, *STEP_FIGURES, "margin"}
    assert set(OVER_RUNS.values()) <= set(STATISTICS)


def test_events_are_reduced_to_the_run_with_the_most():
    column = text_tables.TableColumn("hits", text_tables.Node("hits", None))
    assert text_tables.with_statistic(column, {"hits": "events"}).statistic == "max"


def test_where_nothing_is_reduced_headings_are_the_metrics_names(results):
    (table,) = text_tables.tables(results("{diagram: diagram.yaml, variants: {a: {}, b: {}}}"))
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
    assert text_tables.tables(done)[0].head == ["variant", expected]


def test_values_that_look_alike_have_rows_of_their_own(results):
    (table,) = text_tables.tables(results("{diagram: diagram.yaml, grid: {blocks.swing.parameters.w: [2, 2.0000001]}}"))
    assert [row[1] for row in table.rows] == ["2", "2.0000001"]
    assert table.head[2:] == ["top", "last", "low"]


def test_texts_and_lists_are_labels_without_quotation_marks(results, tmp_path):
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    text = (
        '{diagram: diagram.yaml, grid: {blocks.lag.parameters.T: ["i / 2", [1, 2, "pi"]], run.method: [jacobi, joint]}}'
    )
    done = results(text)
    made = text_tables.tables(done)
    assert [row[1:3] for row in made[0].rows] == [[t, m] for t in ("i / 2", "[1, 2, pi]") for m in ("jacobi", "joint")]
    table_files.write(done, made)
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
    (table,) = text_tables.tables(done)
    assert table.notes == ["1 of 3 runs did not come to their end: figures are of the time until then."]
    assert table.notes[0] in markdown(table)


@pytest.mark.parametrize("title", ["", ".", "../x", "x" * 900, "ä" * 300, "con"])
def test_a_table_of_any_title_is_written_into_the_folder(results, tmp_path, title):
    done = results(f'{{diagram: diagram.yaml, tables: {{"{title}": {{columns: [top]}}}}}}')
    before = set(tmp_path.rglob("*"))
    table_files.write(done, text_tables.tables(done))
    made = set(tmp_path.rglob("*")) - before
    assert len(made) == 3
    assert all(path.parent == tmp_path / "results" for path in made)


@pytest.mark.parametrize("limit", [1, 50, 4096, 8192])
def test_a_full_disk_leaves_what_was_there(results, tmp_path, limit):
    """In a process of its own: HDF5 takes one along when a write fails."""
    done = results("{diagram: diagram.yaml, tables: {Tops: {columns: [top]}}}")
    there = {tmp_path / "results" / name: b"before" for name in ("study.nc", "tops.md", "tops.tex", "tops.csv")}
    for path, content in there.items():
        path.write_bytes(content)
    child = os.fork()
    if child == 0:
        code = 2
        try:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
            for write in (
                lambda: dataset.write(tmp_path / "results" / "study.nc", done),
                lambda: table_files.write(done, text_tables.tables(done)),
            ):
                try:
                    write()
                except ResultError as error:
                    assert "File too large" in error.message and error.fix == "free some space"
            code = 0
        finally:
            os._exit(code)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    assert (tmp_path / "results" / "study.nc").read_bytes() == b"before"
    for path in there:
        content = path.read_bytes()
        assert content == b"before" or (len(content) <= limit and path.suffix != ".nc")
    assert not list((tmp_path / "results").glob(".*"))


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
    assert row_figures.satisfies(np.array([0.0, 1.0, 2.0, np.nan]), above, below).tolist() == expected


ODD = """
import math
from cosim import Block, Output, Parameter

class Odd(Block):
    k = Parameter()
    y = Output(finite=False)
    def outputs(k, y):
        if k == 4.0:
            raise ValueError("four")
        y[0] = math.nan if k == 0.0 else math.inf if k == 1.0 else -math.inf if k == 2.0 else k
"""
ODD_DIAGRAM = """
    run: {stop: 1, step: 0.5}
    blocks: {odd: {python: odd.py:Odd, parameters: {k: 3}}}
    metrics: {y: {signal: odd.y, reduce: max}}
    """
ODD_STUDY = """
    diagram: diagram.yaml
    grid: {blocks.odd.parameters.k: [0, 1, 2, 3, 4]}
    tables:
      each: {rows: odd.k, columns: [y]}
      all:
        rows: variant
        columns: {big: {metric: y, above: 2}, most: {metric: y, over: max}}
    explain: {baseline: base, metric: y, above: 2}
    """


def test_nan_and_infinity_are_figures_and_no_value_is_none(results, tmp_path):
    xarray = pytest.importorskip("xarray")
    (tmp_path / "odd.py").write_text(ODD)
    done = results(ODD_STUDY, ODD_DIAGRAM)
    each, every = made = text_tables.tables(done)
    assert [row[1:] for row in each.rows] == [["nan"], ["inf"], ["-inf"], ["3"], ["—"]]
    assert every.rows == [["base", "40.0%", "nan"]]
    table_files.write(done, made)
    lines = (tmp_path / "results" / "each.csv").read_text().splitlines()
    assert lines[1:] == ["0,nan", "1,inf", "2,-inf", "3,3.0", "4,"]
    assert "y above 2 in 2 of 5 runs" in next(words.explanation(done.study, list(done.rows())))
    dataset.write(tmp_path / "study.nc", done)
    with xarray.open_dataset(tmp_path / "study.nc", engine="h5netcdf") as data:
        assert np.array_equal(data.y.values.ravel(), [np.nan, np.inf, -np.inf, 3.0, np.nan], equal_nan=True)


INF = float("inf")


@pytest.mark.parametrize(
    ("statistic", "numbers", "expected"),
    [
        ("max", [1.0, None, INF], INF),
        ("max", [None, None], None),
        ("min", [1.0, float("nan")], float("nan")),
        ("median", [INF, INF], INF),
        ("median", [-INF, 1.0, INF], 1.0),
        (0.25, [-INF, 1.0], -INF),
        (0.25, [1.0, INF], INF),
        (0.0, [1.0, INF], 1.0),
        ("mean", [-INF, INF], float("nan")),
        ("mean", [1e308, 1.5e308], 1.25e308),
        ("rms", [1e200, 1e200], 1e200),
        ("rms", [3e-170, 4e-170], 12.5**0.5 * 1e-170),
    ],
)
def test_statistics_of_numbers_that_are_odd(statistic, numbers, expected):
    column = text_tables.TableColumn("m", text_tables.Node("m", None), statistic)
    found = text_tables.cell(column, [{"metrics": {"m": number}} for number in numbers])
    assert found is expected if expected is None else found == pytest.approx(expected, rel=1e-15, abs=0, nan_ok=True)


def test_a_member_without_an_array_loses_none_of_the_others():
    """The first member has no final value, the second has three."""
    rows = [{"metrics": {"m": None}}, {"metrics": {"m": [1.0, 2.0, 3.0]}}]
    rows = [{"status": "completed", "reason": "", "steps": 1, "seconds": 0.0, **row} for row in rows]
    study = SimpleNamespace(dimensions=("variant",), variants=())
    done = SimpleNamespace(study=study, rows=lambda: iter(rows), draws=None)
    dimensions, values, _ = dataset._variables(done, (2,))["m"]
    assert dimensions == ("variant", "m_axis0")
    assert np.array_equal(values, [[np.nan] * 3, [1.0, 2.0, 3.0]], equal_nan=True)


def test_a_share_has_the_interval_of_clopper_and_pearson(results):
    """Of n of n draws, the lower bound is (alpha/2)^(1/n): 0.025^(1/4) = 0.3976 of the four draws of a row."""
    columns = "{good: {metric: top, above: -9}, none: {metric: top, above: 1e9}}"
    done = results(STUDY.rstrip() + f"\n    tables: {{t: {{rows: [variant, w], columns: {columns}}}}}\n")
    (table,) = text_tables.tables(done)
    assert {tuple(row[2:]) for row in table.rows} == {("100.0% (39.8% … 100.0%)", "0.0% (0.0% … 60.2%)")}


def test_a_table_may_show_how_long_a_step_takes(results):
    done = results(
        STUDY.rstrip() + "\n    tables: {t: {rows: variant, columns: {time: {metric: step_time, over: min}}}}\n"
    )
    (table,) = text_tables.tables(done)
    rows = list(done.rows())
    expected = [min(1e6 * r["seconds"] / r["steps"] for r in rows if r["variant"] == v) for v in ("plain", "slow")]
    assert [line[0] for line in table.values] == pytest.approx(expected)
