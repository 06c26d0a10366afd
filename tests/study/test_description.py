"""A study's YAML: what it may say, and what its mistakes look like."""

import re

import numpy as np
import pytest

from cosim.errors import DiagramErrors
from cosim.study import plan
from cosim.study.dotted_paths import short_name
from cosim.study.running import Options, run
from cosim.study.variants import Variants
from tests.study.conftest import DIAGRAM, STUDY


def test_dimensions_and_size(study):
    loaded = study()
    assert loaded.dimensions == ("variant", "swing.w", "draw")
    assert plan.size(loaded) == 2 * 3 * 4
    assert loaded.title == "study"


def test_a_study_of_nothing_but_a_diagram_is_one_run(study):
    loaded = study("diagram: diagram.yaml")
    assert [m.name for m in plan.members(loaded, None)] == ["base"]


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ("[1, 2.5]", (1, 2.5)),
        ("{linspace: [0, 1, 3]}", (0.0, 0.5, 1.0)),
        ("{geomspace: [1, 100, 3]}", (1.0, 10.0, 100.0)),
        ("{range: [0, 0.3, 0.1]}", (0.0, 0.1, 0.2, 0.3)),
        ('{linspace: [0, "2*pi", 2]}', (0.0, 2 * np.pi)),
    ],
)
def test_axes(study, values, expected):
    (axis,) = study(f"{{diagram: diagram.yaml, grid: {{run.stop: {values}}}}}").grid
    assert axis.values == pytest.approx(expected, rel=1e-12)


def test_settings_change_the_study(study):
    assert study(settings=("random.count=7", "random.seed=1")).random.count == 7


@pytest.mark.parametrize(
    ("path", "name"),
    [
        ("blocks.a.parameters.c", "a.c"),
        ("blocks.a.parameters.c, blocks.b.parameters.c", "a.c"),
        ("blocks.a.start.x.0.1", "a.x.0.1"),
        ("run.step", "run.step"),
        ("blocks.a.period", "blocks.a.period"),
        ("blocks.a.dimensions.n", "blocks.a.dimensions.n"),
        ("other.a.parameters.k", "other.a.parameters.k"),
    ],
)
def test_an_axis_has_a_name_of_its_own_whatever_others_there_are(path, name):
    assert short_name(path) == name


def test_rows_of_a_table_name_a_dimension_by_an_end_that_no_other_has(study):
    grid = "grid: {blocks.swing.parameters.w: [1, 2], blocks.lag.parameters.T: [1, 2], blocks.source.parameters.T: [1]}"
    loaded = study(f"{{diagram: diagram.yaml, {grid}, tables: {{t: {{rows: [variant, w, lag.T]}}}}}}")
    assert loaded.tables[0].rows == ("variant", "swing.w", "lag.T")
    with pytest.raises(DiagramErrors, match=r"`tables\.t\.rows` cannot be the text `T`"):
        study(f"{{diagram: diagram.yaml, {grid}, tables: {{t: {{rows: [T]}}}}}}")


@pytest.mark.parametrize(
    ("text", "message", "place"),
    [
        ("{variants: {a: {}}}", "names no diagram", "1:1"),
        ("{diagram: diagram.yaml, randon: {}}", "no key `randon`", "1:25"),
        ("{diagram: diagram.yaml, variants: {a: {sett: {}}}}", "no key `sett`", "1:40"),
        ("{diagram: diagram.yaml, grid: {run.stop: 3}}", "takes a list of values", "1:42"),
        ("{diagram: diagram.yaml, random: {count: 2}}", "has no `draws`", "1:25"),
        ("{diagram: diagram.yaml, random: {count: 0, draws: {}}}", "whole number from 1", "1:41"),
        ("{diagram: diagram.yaml, random: {count: 1, method: lhs, draws: {}}}", "`random.method` cannot be", "1:52"),
        ("{diagram: diagram.yaml, random: {count: 1, draws: {a.b: {uniform: [1]}}}}", "takes a distribution", "1:57"),
        ("{diagram: diagram.yaml, random: {count: 1, draws: {a.b: {uniform: [2, 1]}}}}", "wrong way round", "1:57"),
        ("{diagram: diagram.yaml, tables: {t: {rows: variants}}}", "`tables.t.rows` cannot be", "1:44"),
        ("{diagram: diagram.yaml, tables: {t: {columns: [{metric: m}]}}}", "takes names of metrics", "1:47"),
        ("{diagram: diagram.yaml, tables: {t: {columns: {a: {over: max}}}}}", "names no metric", "1:48"),
        ("{diagram: diagram.yaml, grid: {a.b: {geomspace: [-1, 1, 3]}}}", "no constant ratios", "1:37"),
        ("{diagram: diagram.yaml, grid: {a.b: {geomspace: [0, 1, 3]}}}", "no constant ratios", "1:37"),
        ("{diagram: diagram.yaml, grid: {a.b: {range: [2, 1, 1]}}}", "there is no value", "1:37"),
        ("{diagram: diagram.yaml, grid: {a.b: [1, null]}}", "cannot be nothing", "1:41"),
        ("{diagram: diagram.yaml, grid: {a.b: [1, 1.0]}}", "has the value 1 twice", "1:37"),
        ('{diagram: diagram.yaml, grid: {a.b: [2, "2"]}}', "has the value 2 twice", "1:37"),
        ("{diagram: diagram.yaml, random: {count: 1, draws: {}}}", "draws nothing", "1:51"),
        ("{diagram: diagram.yaml, random: {count: 1, seed: -1, draws: {a.b: {uniform: [0, 1]}}}}", "from 0", "1:50"),
        ("{diagram: diagram.yaml, random: {count: 1, seed: 0.5, draws: {a.b: {uniform: [0, 1]}}}}", "from 0", "1:50"),
        ("{diagram: diagram.yaml, random: {count: 1, draws: {a.b: {uniform: [[], []]}}}}", "is empty", "1:68"),
        ("{diagram: diagram.yaml, tables: {a b: {}, a-b: {}}}", "would be written to one file", "1:43"),
        ("{diagram: diagram.yaml, figures: {F: {panels: [{signals: lag.x}]}}}", "the study records none", "1:35"),
        ("{diagram: diagram.yaml, record: true, figures: {F: {panels: [{label: x}]}}}", "has no `signals`", "1:62"),
        ("{diagram: diagram.yaml, record: true, figures: {F: {kind: plane}}}", "has no `positions`", "1:49"),
        ("{diagram: diagram.yaml, figures: {F: {kind: distribution}}}", "has no `metric`", "1:35"),
        ("{diagram: diagram.yaml, grid: {a.b: {linspace: [-1e308, 1e308, 3]}}}", "beyond all numbers", "1:37"),
        (
            "{diagram: diagram.yaml, random: {count: 1, draws: {a.b: {uniform: [-1e308, 1e308]}}}}",
            "a range beyond all numbers",
            "1:57",
        ),
        (
            "{diagram: diagram.yaml, random: {count: 1, draws: {a.b: {normal: [0, 1e308]}}}}",
            "a range beyond all numbers",
            "1:57",
        ),
        (
            "{diagram: diagram.yaml, random: {count: 1, draws: {a.b: {uniform: [0, 1]}}, "
            "accept: {a.x: {least: 1, most: 0}}}}",
            "nothing is at least 1 and at most 0",
            "1:91",
        ),
        ("{diagram: diagram.yaml, tables: {t: {rows: [variant, variant]}}}", "has `variant` twice", "1:54"),
        ("{diagram: diagram.yaml, tables: {t: {columns: {a: {metric: m, over: 95}}}}}", "0.95 is the 95 %", "1:69"),
        (
            "{diagram: diagram.yaml, tables: {t: {columns: {a: {metric: m, above: 0, over: median}}}}}",
            "beside `above` nothing is reduced by `over`",
            "1:79",
        ),
    ],
)
def test_mistakes_of_the_study_have_a_place(study, text, message, place):
    with pytest.raises(DiagramErrors, match=re.escape(message)) as caught:
        study(text)
    assert f"study.yaml:{place}" in str(caught.value)


ONE, TWO = "blocks.lag.parameters", "blocks.lag.parameters.T"


@pytest.mark.parametrize(
    ("sections", "message"),
    [
        (f"grid: {{{TWO}: [1, 2]}}, random: {{count: 2, draws: {{{TWO}: {{uniform: [1, 2]}}}}}}", "same value `blocks"),
        (f"grid: {{{TWO}: [1, 2]}}, random: {{count: 2, draws: {{{ONE}: {{uniform: [1, 2]}}}}}}", "set the same value"),
        (f"random: {{count: 2, draws: {{{TWO}: {{uniform: [1, 2]}}, {TWO}.0: {{normal: [0, 1]}}}}}}", "set the same"),
        (f'grid: {{"{TWO}, run.stop": [1, 2], run.stop: [3]}}', "`grid` and `grid` set the same value `run.stop`"),
        (f"variants: {{a: {{set: {{{TWO}: 1}}}}}}, grid: {{{TWO}: [1, 2]}}", "which `grid` replaces in every run"),
        (f"variants: {{a: {{set: {{{TWO}: 1}}}}}}, grid: {{{ONE}: [1, 2]}}", "which `grid` replaces in every run"),
    ],
)
def test_two_places_that_set_one_value_are_a_mistake(study, sections, message):
    with pytest.raises(DiagramErrors, match=re.escape(message)):
        study(f"{{diagram: diagram.yaml, {sections}}}")


def test_a_grid_may_change_one_element_of_what_a_variant_sets(study):
    text = "variants: {a: {set: {blocks.lag.parameters.T: [1, 2, 3]}}}, grid: {blocks.lag.parameters.T.0: [4, 5]}"
    assert len(list(plan.members(study(f"{{diagram: diagram.yaml, {text}}}"), None))) == 2


@pytest.mark.parametrize(
    "name",
    ["../../evil", "/tmp/evil", "a/b", r"a\\b", ".", "..", ".hidden", r"a\tb", r"a\x1b[31m", r"a\u202eb", "CON",
     "nul.txt", "com1", "a:b", "a?", "a ", " a", "-a", "a.", "", "x" * 101, "a.previous", r"a\0"],
)  # fmt: skip
def test_a_variant_that_is_no_name_of_a_file_is_refused(study, name):
    with pytest.raises(DiagramErrors, match="a variant cannot be called"):
        study(f'{{diagram: diagram.yaml, variants: {{"{name}": {{}}}}}}')


@pytest.mark.parametrize("pair", [("Slow", "slow"), ("\u00e4", "a\u0308"), ("stra\u00dfe", "STRASSE")])
def test_variants_that_some_file_system_takes_for_one_are_refused(study, pair):
    with pytest.raises(DiagramErrors, match="have one name"):
        study(f'{{diagram: diagram.yaml, variants: {{"{pair[0]}": {{}}, "{pair[1]}": {{}}}}}}')


@pytest.mark.parametrize("name", ["ring alone", "NBOVP", "größer", "x" * 100, "a.b", "k=2", "1"])
def test_a_variant_may_have_any_other_name(study, name):
    assert list(study(f'{{diagram: diagram.yaml, variants: {{"{name}": {{}}}}}}').variants) == [name]


@pytest.mark.parametrize(
    ("text", "message", "place"),
    [
        ("{diagram: other.yaml}", "there is no file", "1:11"),
        ("{diagram: study.yaml}", "study.yaml` is a study, not a diagram", "1:11"),
        (
            "{diagram: diagram.yaml, record: true, figures: {F: {panels: [{signals: lag.x, span: [50, 60]}]}}}",
            "shows nothing from 50 to 60 s",
            "1:85",
        ),
        (
            "{diagram: diagram.yaml, record: true, figures: {F: {kind: plane, positions: lag.x, at: [50]}}}",
            "shows bodies at 50 s, when there is no run",
            "1:88",
        ),
        (
            "{diagram: diagram.yaml, record: true, figures: {F: {kind: plane, positions: lag.x, at: [-1]}}}",
            "shows bodies at -1 s, when there is no run",
            "1:88",
        ),
        ("{diagram: diagram.yaml, variants: {a: {diagram: other.yaml}}}", "there is no file", "1:49"),
        ("{diagram: diagram.yaml, variants: {a: {swap: {lagg: Gain}}}}", "no block `lagg`", "1:47"),
        ("{diagram: diagram.yaml, variants: {a: {set: {blocks.lagg.parameters.T: 1}}}}", "no `lagg`", "1:46"),
        ("{diagram: diagram.yaml, grid: {blocks.lag.parameters.TT: [1]}}", "no parameter `TT`", "1:32"),
        ("{diagram: diagram.yaml, grid: {run.stopp: [1]}}", "no `stopp`", "1:32"),
        ("{diagram: diagram.yaml, metrics: [topp]}", "no metric `topp`", "1:35"),
        ("{diagram: diagram.yaml, tables: {t: {columns: [topp]}}}", "no metric `topp`", "1:48"),
        ("{diagram: diagram.yaml, tables: {t: {columns: {a: {metric: topp}}}}}", "no metric `topp`", "1:60"),
        ("{diagram: diagram.yaml, explain: {baseline: base, metric: topp, above: 0}}", "no metric `topp`", "1:59"),
        ("{diagram: diagram.yaml, references: {book: {base: {topp: 1}}}}", "no metric `topp`", "1:52"),
        ("{diagram: diagram.yaml, figures: {F: {kind: distribution, metric: topp}}}", "no metric `topp`", "1:35"),
        ("{diagram: diagram.yaml, record: true, figures: {F: {panels: [{signals: lag.y}]}}}", "not recorded", "1:49"),
        (
            "{diagram: diagram.yaml, record: true, figures: {F: {members: bas, panels: [{signals: lag.x}]}}}",
            "no member `bas`",
            "1:49",
        ),
        (
            "{diagram: diagram.yaml, metrics: {all: {signal: lag.x, reduce: final}}, tables: {t: {columns: [all]}}}",
            "takes single numbers",
            "1:96",
        ),
        ("{diagram: diagram.yaml, metrics: {steps: {signal: lag.x, reduce: max}}}", "no figure can be called", "1:35"),
        (
            "{diagram: diagram.yaml, random: {count: 1, draws: {blocks.lag.start.x: {uniform: [[0, 0, 0], 1]}}}}",
            "has the shape (3, 2), and its draw the shape (3,)",
            "1:52",
        ),
        (
            "{diagram: diagram.yaml, random: {count: 1, draws: {blocks.lag.start.x.0.7: {uniform: [0, 1]}}}}",
            "there is no element 7",
            "1:52",
        ),
        (
            "{diagram: diagram.yaml, random: {count: 1, draws: {blocks.lag.start.x.0.2: {uniform: [0, 1]}}}}",
            "there is no element 2",
            "1:52",
        ),
        (
            "{diagram: diagram.yaml, random: {count: 1, draws: {blocks.lag.start.z: {normal: [0, 1]}}}}",
            "no state or input to start `z`",
            "1:52",
        ),
        (
            "{diagram: diagram.yaml, random: {count: 1, draws: {run.stop: {uniform: [1, 2]}}, "
            "accept: {lag.z: {least: 1}}}}",
            "no variable `z`",
            "1:91",
        ),
    ],
)
def test_mistakes_about_the_diagram_stop_before_anything_runs(study, tmp_path, text, message, place):
    with pytest.raises(DiagramErrors, match=re.escape(message)) as caught:
        run(study(text), Options(tmp_path / "results"))
    assert f"study.yaml:{place}" in str(caught.value)
    assert not (tmp_path / "results").exists()


def test_a_study_of_studies_is_one_mistake(study, tmp_path):
    (tmp_path / "inner.yaml").write_text("diagram: diagram.yaml")
    text = "{diagram: inner.yaml, variants: {a: {}, b: {}}, metrics: [top], grid: {run.stop: [1, 2]}}"
    with pytest.raises(DiagramErrors, match="is a study, not a diagram") as caught:
        run(study(text), Options(tmp_path / "results"))
    assert len(caught.value.errors) == 1


def test_metrics_that_are_no_mapping_are_told_where_the_diagram_has_them(study, tmp_path):
    broken = DIAGRAM[: DIAGRAM.index("    metrics:")] + "    metrics: [top]\n"
    with pytest.raises(DiagramErrors, match=r"diagram\.yaml:9:10: `metrics` must be a mapping, not a list of 1"):
        run(study("{diagram: diagram.yaml, metrics: [top]}", broken), Options(tmp_path / "results"))


def test_a_span_may_lie_in_the_longer_runs_of_a_grid(study):
    text = "record: true, figures: {F: {panels: [{signals: lag.x, span: [2, 3]}]}}, grid: {run.stop: [1, 3]}"
    Variants(study(f"{{diagram: diagram.yaml, {text}}}")).check()


def test_a_variant_lies_over_its_diagram_and_may_take_away_what_that_says(study):
    text = STUDY.replace(
        "plain:\n", "plain:\n      bare: {metrics: {low: ~}, blocks: {swing: {parameters: {w: ~}}}}\n", 1
    )
    variants = Variants(study(text.replace("blocks.swing.parameters.w: [1, 2, 3]", "run.stop: [1]")))
    assert set(variants.base("plain").diagram.metrics) == {"top", "last", "low"}
    assert set(variants.base("bare").diagram.metrics) == {"top", "last"}
    assert "w" in variants.base("plain").diagram.blocks["swing"].parameters
    assert "w" not in variants.base("bare").diagram.blocks["swing"].parameters


def test_an_unknown_row_is_one_mistake(study):
    with pytest.raises(DiagramErrors) as caught:
        study(STUDY.rstrip() + "\n    tables: {t: {rows: [variant, tau]}}\n")
    (error,) = caught.value.errors
    assert "tau" in error.message
