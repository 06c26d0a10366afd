"""The study of a command that searches: of one diagram, where a study may be of many."""

from __future__ import annotations

import argparse
from dataclasses import replace

from cosim.errors import UsageError, nearest
from cosim.study import study_file
from cosim.study.definition import Study


def load(options: argparse.Namespace) -> Study:
    """The study with the variant that is asked for alone.

    Raises: DiagramErrors; UsageError where nobody says which variant, and for a grid, of which a search has no point.
    """
    study = study_file.load(options.study, options.set)
    if study.grid:
        fix = "a variant with the values that are wanted, and no grid: --set 'grid=~'"
        raise UsageError(f"{study.path} has a grid, and a search is of one diagram", fix=fix)
    name = options.variant or next(iter(study.variants))
    if name not in study.variants:
        fix = nearest(name, study.variants) or f"one of {', '.join(study.variants)}"
        raise UsageError(f"--variant: {study.path} has no variant `{name}`", fix=fix)
    if len(study.variants) > 1 and not options.variant:
        message = f"{study.path} has {len(study.variants)} variants, and a search is of one diagram"
        raise UsageError(message, fix=f"--variant, with one of: {', '.join(study.variants)}")
    return replace(study, variants={name: study.variants[name]})
