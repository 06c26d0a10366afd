"""The test FMU `guest.c`, which leaves traces in the process that it runs in."""

from __future__ import annotations

from pathlib import Path

from tests.fmu import machine
from tests.fmu.machine import Model, V

SOURCE = Path(__file__).with_name("guest.c")
NOTHING, ROUND, FLUSH, FORK, FORK_EXEC, THREAD, ENVIRONMENT, LONG_MESSAGE = range(8)
IN_STEP, IN_GET, IN_SET_UP, IN_TERMINATE, IN_FREE = 1, 2, 4, 8, 16
EVERYWHERE = 31
VARIABLES = (
    V("u", 1, "Float64", "input", "0"),
    V("y", 2, "Float64", "output", initial="calculated"),
    V("what", 3, "Int32", "parameter", "0", "fixed"),
    V("where", 4, "Int32", "parameter", "0", "fixed"),
)


def build(folder: Path, *options: str, edit=lambda xml: xml) -> Path:
    """The FMU; options: more of the compiler's."""
    return machine.pack(folder, 2, Model("guest", VARIABLES), SOURCE, "cs", edit=edit, options=(*options, "-pthread"))
