"""Studies of expressions: their parameters, their texts in a grid, as variants, and in the place of a block."""

import pytest

from cosim.errors import DiagramErrors

SPRINGS = """\
run: {stop: 1, step: 0.1}
blocks:
  law: {expression: "k*(r - x)", parameters: {k: 4}, inputs: {r: 1, x: 0.5}}
metrics: {y: {signal: law.y, reduce: final}}
"""


@pytest.fixture
def springs(tmp_path):
    (tmp_path / "springs.yaml").write_text(SPRINGS)


@pytest.mark.usefixtures("springs")
def test_a_grid_of_texts_and_of_numbers(results):
    done = results("""
        diagram: springs.yaml
        grid: {blocks.law.expression: ["k*(r - x)", "k*r - x"], blocks.law.parameters.k: [1, 10]}
        """)
    assert [own["metrics"]["y"] for own in done.rows()] == [0.5, 5.0, 0.5, 9.5]


@pytest.mark.usefixtures("springs")
def test_variants_change_it_and_put_it_in_the_place_of_a_block(results):
    done = results("""
        diagram: springs.yaml
        variants:
          plain:
          swapped: {swap: {law: "k*r + x"}}
          told: {set: {blocks.law.expression: "k*r*x"}}
          layer: {blocks: {law: {expression: {y: "k + e", e: "r - x"}}}}
          block: {swap: {law: Bias}, set: {blocks.law.drop: [k, r, x], blocks.law.inputs.u: 7}}
        """)
    assert [own["metrics"]["y"] for own in done.rows()] == [2.0, 4.5, 2.0, 4.5, 7.0]


@pytest.mark.usefixtures("springs")
def test_a_mistake_is_told_at_its_place_before_anything_runs(results):
    with pytest.raises(DiagramErrors) as caught:
        results('{diagram: springs.yaml, grid: {blocks.law.expression: ["k*r - q*x", "k*(r - x)"]}}')
    (error,) = caught.value.errors
    assert "`q` is neither an input nor a parameter" in error.message and error.position.file.endswith("study.yaml")
