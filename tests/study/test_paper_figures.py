"""The figures of the paper show what their panels say."""

from pathlib import Path

import pytest
import yaml

DIAGRAMS = Path(__file__).parents[2] / "diagrams"


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
