"""The test FMU `ball.c`, a ball that bounces."""

from __future__ import annotations

from pathlib import Path

from tests.fmu import machine
from tests.fmu.machine import Model, V

SOURCE = Path(__file__).with_name("ball.c")
VARIABLES = (
    V("h", 1, "Float64", "output", "1", initial="exact"),
    V("der(h)", 2, "Float64", "local", derivative="h", initial="calculated", depends=("v",)),
    V("v", 3, "Float64", "output", "0", initial="exact"),
    V("der(v)", 4, "Float64", "local", derivative="v", initial="calculated"),
    V("e", 5, "Float64", "parameter", "0.7", "fixed"),
    V("last", 6, "Float64", "output", None, "discrete", "calculated"),
    V("bounces", 7, "Int32", "output", None, "discrete", "calculated"),
    V("z", 8, "Float64", "local", initial="calculated", depends=("h",)),
)
STATES = {2: 'canGetAndSetFMUstate="true"', 3: 'canGetAndSetFMUState="true"'}


def build(folder: Path, version: int, keeps_states: bool = True) -> Path:
    """The FMU, with states that can be kept or not."""
    model = Model("ball", VARIABLES, ("der(h)", "der(v)"), (8,))
    return machine.pack(folder, version, model, SOURCE, "me", STATES[version] if keeps_states else "")
