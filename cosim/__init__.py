"""Co-simulation of block diagrams: independent signal blocks, YAML wiring, one native master."""

from cosim.block import (
    Block,
    CalculatedParameter,
    Dimension,
    Input,
    Local,
    Measure,
    Output,
    Parameter,
    State,
    condition,
    rule,
)

__all__ = [
    "Block",
    "CalculatedParameter",
    "Dimension",
    "Input",
    "Local",
    "Measure",
    "Output",
    "Parameter",
    "State",
    "condition",
    "rule",
]
