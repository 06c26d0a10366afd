"""The figures of the paper show what their panels say; what the documentation says of a study is what it gives."""

from pathlib import Path

import pytest
import yaml

from cosim.study import running, study_file, text_tables
from cosim.study.running import Options

ROOT = Path(__file__).parents[2]
DIAGRAMS = ROOT / "diagrams"


def test_each_column_of_fig_6_is_one_pair_with_its_edge_and_the_distance_at_which_it_collides():
    study = yaml.safe_load((DIAGRAMS / "studies" / "collisions.yaml").read_text(encoding="utf-8"))
    blocks = yaml.safe_load((DIAGRAMS / "measured_pairs.yaml").read_text(encoding="utf-8"))["blocks"]
    formation = yaml.safe_load((DIAGRAMS / "formation.yaml").read_text(encoding="utf-8"))
    radii = formation["blocks"]["plant"]["parameters"]["radius"]
    figure = study["figures"]["Fig. 6"]
    pairs, edges = blocks["pairs"]["parameters"]["pairs"], blocks["edges"]["parameters"]["edges"]
    assert figure["columns"] == 3 and len(figure["panels"]) == 6
    for gap, edge in zip(figure["panels"][:3], figure["panels"][3:], strict=True):
        pair = pairs[int(gap["signals"].removeprefix("pairs.gaps[").rstrip("]")) - 1]
        heard = edges[int(edge["signals"].removeprefix("edges.a_2[").rstrip("]")) - 1]
        assert set(pair) == set(heard)
        assert gap["title"] == f"pair {{{pair[0]}, {pair[1]}}}"
        assert edge["label"] == f"$a^2_{{{heard[0]}{heard[1]}}}$"
        (threshold,) = gap["thresholds"].values()
        assert threshold == pytest.approx(sum(radii[member - 1] for member in pair))


def test_the_guide_has_the_convergence_times_that_its_study_gives():
    """And what it says of them: the paper's order with one bound for both, the other with the bound of each."""
    study = study_file.load(DIAGRAMS / "studies" / "convergence.yaml")
    (table,) = text_tables.tables(running.run(study, Options(None)))
    paper = {item.variant: f"{item.value:g}" for item in study.references}
    guide = (ROOT / "docs" / "guide" / "formation.md").read_text(encoding="utf-8")
    for name, *cells in table.rows:
        assert f"| {' | '.join([name, paper[name], *cells])} |" in guide
    (common, _, own, _), (other_common, other_own, never, _) = table.values
    assert common < other_common
    assert own > other_own
    assert never is None
