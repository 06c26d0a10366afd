"""A study's YAML: what it may say, and what its mistakes look like."""

import re

import numpy as np
import pytest

from cosim.errors import DiagramErrors
from cosim.study import plan
from cosim.study.description import short_names
from cosim.study.running import Options, run


def test_dimensions_and_size(study):
    loaded = study()
    assert loaded.dimensions == ("variant", "w", "draw")
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


def test_short_names_are_the_shortest_ends_that_tell_apart():
    assert short_names(["blocks.a.parameters.c", "run.step"]) == ["c", "step"]
    assert short_names(["blocks.a.start.x", "blocks.b.start.x"]) == ["a.start.x", "b.start.x"]
    assert short_names(["blocks.a.parameters.draw"]) == ["parameters.draw"]


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
        ("{diagram: diagram.yaml, tables: {t: {columns: {a: {over: max}}}}}", "names no metric", "1:48"),
    ],
)
def test_mistakes_of_the_study_have_a_place(study, text, message, place):
    with pytest.raises(DiagramErrors, match=re.escape(message)) as caught:
        study(text)
    assert f"study.yaml:{place}" in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message", "place"),
    [
        ("{diagram: other.yaml}", "there is no file", "1:11"),
        ("{diagram: diagram.yaml, variants: {a: {diagram: other.yaml}}}", "there is no file", "1:49"),
        ("{diagram: diagram.yaml, variants: {a: {swap: {lagg: Gain}}}}", "no block `lagg`", "1:47"),
        ("{diagram: diagram.yaml, variants: {a: {set: {blocks.lagg.parameters.T: 1}}}}", "no `lagg`", "1:46"),
        ("{diagram: diagram.yaml, grid: {blocks.lag.parameters.TT: [1]}}", "no parameter `TT`", "1:32"),
        ("{diagram: diagram.yaml, grid: {run.stopp: [1]}}", "no `stopp`", "1:32"),
        ("{diagram: diagram.yaml, metrics: [topp]}", "no metric `topp`", "1:35"),
        (
            "{diagram: diagram.yaml, random: {count: 1, draws: {blocks.lag.start.z: {normal: [0, 1]}}}}",
            "no state or input to start `z`",
            "1:52",
        ),
        (
            "{diagram: diagram.yaml, random: {count: 1, draws: {}, accept: {lag.z: {least: 1}}}}",
            "no variable `z`",
            "1:64",
        ),
    ],
)
def test_mistakes_about_the_diagram_stop_before_anything_runs(study, tmp_path, text, message, place):
    with pytest.raises(DiagramErrors, match=re.escape(message)) as caught:
        run(study(text), Options(tmp_path / "results"))
    assert f"study.yaml:{place}" in str(caught.value)
    assert not (tmp_path / "results").exists()
