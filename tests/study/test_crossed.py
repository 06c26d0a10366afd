"""Axes of the grid with names, and variants that are crossed with others: each pair is the run that both say."""

import csv
import json

import numpy as np
import pytest

from cosim.errors import DiagramErrors
from cosim.study import table_files, text_tables

CROSSED = """
    diagram: diagram.yaml
    variants:
      plain:
      slow: {set: {blocks.lag.parameters.T: 2}}
    grid:
      speed: {variants: {one: , twice: {set: {blocks.swing.parameters.w: 3}}}}
      step: {path: run.step, values: {coarse: 0.1, fine: 0.05}}
    tables: {t: {rows: [variant, speed, step], columns: [top]}}
    """


def test_each_pair_is_the_run_that_both_say(results, tmp_path):
    done = results(CROSSED)
    (table,) = text_tables.tables(done)
    assert table.head[:3] == ["variant", "speed", "step"]
    assert [row[:3] for row in table.rows] == [
        [v, w, s] for v in ("plain", "slow") for w in ("one", "twice") for s in ("coarse", "fine")
    ]
    by = {tuple(row[:3]): own["metrics"] for row, own in zip(table.rows, done.rows(), strict=True)}
    table_files.write(done, [table])
    assert r"plain & one & coarse & $" in (tmp_path / "results" / "t.tex").read_text()
    for (v, w, s), value in by.items():
        own = {"blocks.lag.parameters.T": 2} if v == "slow" else {}
        own |= {"blocks.swing.parameters.w": 3} if w == "twice" else {}
        own |= {"run.step": {"coarse": 0.1, "fine": 0.05}[s]}
        alone = results(f"{{diagram: diagram.yaml, variants: {{p: {{set: {json.dumps(own)}}}}}}}")
        assert next(alone.rows())["metrics"] == value  # the same run by itself, bit by bit


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{speed: {variants: {}}}", "has no variants"),
        ("{speed: {variants: }}", "has no variants"),
        ("{speed: {path: run.step}}", "`grid.speed` has no `values`"),
        ("{speed: {values: [1]}}", "`grid.speed` has no `path`"),
        ("{variant: {path: run.step, values: [0.1]}}", "no axis of the grid can be called `variant`"),
        ("{speed: {variants: {a: {diagram: x.yaml}}}}", "no key `diagram`"),
        ("{speed: {variants: {a: {set: {blocks.nobody.parameters.k: 1}}}}}", "nobody"),
        ("{speed: {variants: {a: {}, b: {swap: {lag: Nothing}}}}}", "Nothing"),
        ("{run.step: [0.1], s: {variants: {a: {set: {run.step: 0.05}}}}}", "which `grid` replaces in every run"),
    ],
)
def test_mistakes_have_their_place(results, text, message):
    with pytest.raises(DiagramErrors) as caught:
        results(f"{{diagram: diagram.yaml, grid: {text}}}")
    assert message in str(caught.value)
    assert all(error.position for error in caught.value.errors)


def test_means_stand_with_their_deviations(results, tmp_path):
    text = """
    diagram: diagram.yaml
    random: {count: 5, draws: {blocks.swing.parameters.w: {uniform: [1, 2]}}}
    tables:
      t: {rows: variant, columns: {tops: {metric: top, over: [mean, std], format: .2f}, low: {metric: low}}}
      turned: {rows: variant, columns: {tops: {metric: top, over: [mean, std]}}, transpose: true}
    """
    done = results(text)
    table, turned = made = text_tables.tables(done)
    tops = np.array([row["metrics"]["top"] for row in done.rows()])
    assert table.head == ["variant", "tops, mean ± std", "low, min"]
    assert table.rows[0][1] == f"{tops.mean():.2f} ± {tops.std():.2f}"
    table_files.write(done, made)
    with (tmp_path / "results" / "t.csv").open(newline="") as file:
        head, row = csv.reader(file)
    assert head == ["variant", "tops, mean ± std", "low, min", "tops, std"]
    assert float(row[1]) == pytest.approx(tops.mean(), rel=1e-15) and float(row[3]) == pytest.approx(tops.std())
    assert r" \pm " in (tmp_path / "results" / "t.tex").read_text()
    assert turned.rows == [["tops, mean ± std", f"{tops.mean():.3g} ± {tops.std():.3g}"]]


def test_one_run_has_no_deviation(results):
    text = "{diagram: diagram.yaml, tables: {t: {rows: variant, columns: {x: {metric: top, over: [mean, std]}}}}}"
    (table,) = text_tables.tables(results(text))
    assert "±" not in table.rows[0][1]


def test_other_pairs_of_statistics_are_refused(results):
    text = "{diagram: diagram.yaml, tables: {t: {rows: variant, columns: {x: {metric: top, over: [max, min]}}}}}"
    with pytest.raises(DiagramErrors, match=r"takes two statistics as \[mean, std\] only"):
        results(text)
