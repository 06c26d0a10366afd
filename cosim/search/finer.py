"""A search's runs with a tenth of the step, which tell what of a figure is the step's."""

from __future__ import annotations

from cosim.accuracy import refinement
from cosim.accuracy.refinement import Refinement
from cosim.errors import CosimError, Position
from cosim.language import source
from cosim.search.evaluator import Evaluator
from cosim.study.variants import Settings

TENTH = Refinement(steps=10)


def finer(evaluator: Evaluator) -> Settings | None:
    """What gives a run a tenth of the step; None where it cannot have it, or would be another system."""
    network = evaluator.variants.base(evaluator.variant)
    if refinement.sampled_by_the_step(network):
        return None
    found = []
    for text in refinement.settings(network, TENTH):
        path, _, value = text.partition("=")
        found.append((path, source.parse_value(value, Position(f"--set {text}")).value))
    settings = tuple(found)
    try:
        evaluator.variants.wire(evaluator.variant, settings)
    except CosimError:
        return None
    return settings
