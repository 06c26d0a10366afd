"""The test FMU `stair.c`, whose counter steps upwards at time events."""

from __future__ import annotations

from pathlib import Path

from tests.fmu import machine
from tests.fmu.machine import Model, V

SOURCE = Path(__file__).with_name("stair.c")
PARAMETERS = (
    V("period", 5, "Float64", "parameter", "1", "fixed"),
    V("jump", 6, "Float64", "parameter", "0", "fixed"),
    V("last", 8, "Int32", "parameter", str(1 << 30), "fixed"),
)
COUNTER = (
    V("u", 1, "Float64", "input", "0"),
    V("y", 4, "Float64", "output", initial="calculated", depends=("u",)),
    V("counter", 7, "Int32", "output", None, "discrete", "calculated"),
    V("held", 10, "Float64", "output", None, "discrete", "calculated"),
)
STATES = (
    V("x", 2, "Float64", "output", "0", initial="exact"),
    V("der(x)", 3, "Float64", "local", derivative="x", initial="calculated", depends=("u",)),
    V("w", 11, "Float64", "output", "0", initial="exact"),
    V("der(w)", 12, "Float64", "local", derivative="w", initial="calculated", depends=("x",)),
)


VARYING = 'canHandleVariableCommunicationStepSize="true"'
KEEPING = {2: 'canGetAndSetFMUstate="true"', 3: 'canGetAndSetFMUState="true"'}
RETURNING = 'hasEventMode="true" mightReturnEarlyFromDoStep="true"'


def build(
    folder: Path, version: int, states: int, kinds: str = "me cs", flags: str = "", options: tuple[str, ...] = ()
) -> Path:
    """The FMU with `states` (0 to 2) continuous states. options: -DSILENT has it not tell of its next event."""
    variables = COUNTER + PARAMETERS + STATES[: 2 * states]
    model = Model("stair", variables, ("der(x)", "der(w)")[:states])
    return machine.pack(folder, version, model, SOURCE, kinds, flags, options=(f"-DSTATES={states}", *options))
