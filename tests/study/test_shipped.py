"""The studies that come with the project, and a study of every diagram that does."""

from pathlib import Path

import pytest

from cosim.study import plan, study_file
from cosim.study.plan import Member
from cosim.study.variants import Variants

DIAGRAMS = Path(__file__).parents[2] / "diagrams"
STUDIES = sorted((DIAGRAMS / "studies").glob("*.yaml"))
ALL = sorted(path for path in DIAGRAMS.glob("*.yaml"))


@pytest.mark.parametrize("path", STUDIES, ids=lambda path: path.name)
def test_the_first_member_of_every_variant_is_ready_to_run(path):
    study = study_file.load(path)
    variants = Variants(study)
    variants.check()
    point = plan.grid_settings(study, (0,) * len(study.grid))
    typical = draws.typical() if (draws := variants.draws()) else ()
    keys = {name: variants.prepared(Member(name, settings=(*point, *typical))).key for name in study.variants}
    assert len(set(keys.values())) == len(keys)  # no two variants are the same run


@pytest.mark.parametrize("path", ALL, ids=lambda path: path.name)
def test_every_diagram_can_be_studied(path, tmp_path):
    (tmp_path / "study.yaml").write_text(f"diagram: {path}\nvariants: {{alone: {{}}}}\n", encoding="utf-8")
    variants = Variants(study_file.load(tmp_path / "study.yaml"))
    assert variants.prepared(Member("alone")).key == Variants(variants.study).prepared(Member("alone")).key
