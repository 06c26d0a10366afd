"""Random draws: their ranges, that they can be repeated, and that conditions hold."""

import numpy as np
import pytest

from cosim.errors import NoAcceptedDraw
from cosim.study import draws as draws_module
from cosim.study.variants import Variants

TEXT = """
    diagram: diagram.yaml
    random:
      count: {count}
      seed: {seed}
      method: {method}
      draws:
        blocks.lag.start.x: {{uniform: [[-1, 2], [1, 3]]}}
        blocks.swing.parameters.w: {{normal: [2, 0.1]}}
      {accept}
    """


def drawn(study, count=16, seed=1, method="random", accept=""):
    draws = Variants(study(TEXT.format(count=count, seed=seed, method=method, accept=accept))).draws()
    return draws, dict(zip(("x", "w"), (values for _, values in draws.values()), strict=True))


@pytest.mark.parametrize("method", ["random", "latin-hypercube", "sobol"])
def test_values_lie_in_their_ranges_element_by_element(study, method):
    _, values = drawn(study, 64, method=method)
    assert values["x"].shape == (64, 3, 2)
    assert values["w"].shape == (64,)
    assert ((values["x"][..., 0] >= -1) & (values["x"][..., 0] < 1)).all()
    assert ((values["x"][..., 1] >= 2) & (values["x"][..., 1] < 3)).all()
    assert len(np.unique(values["x"])) == values["x"].size
    assert abs(values["w"].mean() - 2) < 5 * 0.1 / np.sqrt(64)


@pytest.mark.parametrize("method", ["random", "latin-hypercube", "sobol"])
def test_the_same_seed_gives_the_same_draws_and_another_seed_others(study, method):
    one, two, other = (drawn(study, seed=s, method=method)[1]["x"] for s in (1, 1, 2))
    assert np.array_equal(one, two)
    assert not np.any(one == other)


def test_a_random_draw_does_not_depend_on_how_many_there_are(study):
    few, many = drawn(study, 3)[1]["x"], drawn(study, 30)[1]["x"]
    assert np.array_equal(few, many[:3])


def test_a_latin_hypercube_has_one_point_in_each_slice(study):
    x = drawn(study, 10, method="latin-hypercube")[1]["x"][:, 1, 0]
    assert sorted(np.floor((x + 1) / 2 * 10).astype(int)) == list(range(10))


@pytest.mark.parametrize("method", ["random", "latin-hypercube", "sobol"])
def test_only_accepted_starts_count(study, method):
    draws, values = drawn(study, 20, method=method, accept="accept: {lag.x: {least: 0, most: 2.9}}")
    assert values["x"].min() >= 0
    assert values["x"].max() <= 2.9
    assert draws.tried > 20


def test_a_condition_that_nothing_satisfies_is_an_error_with_a_place(study, monkeypatch):
    monkeypatch.setattr(draws_module, "TRIALS", 50)
    with pytest.raises(NoAcceptedDraw, match="none of 50") as caught:
        drawn(study, accept="accept: {lag.x: {least: 10}}")
    assert "study.yaml:10" in str(caught.value)
