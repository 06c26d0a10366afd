"""The test FMU `slopes.c`, which knows its directional derivatives, or lies about them, or will not tell."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

from tests.fmu import machine
from tests.fmu.machine import Model, V

SOURCE = Path(__file__).with_name("slopes.c")
#: What the attribute is called, by version.
PROVIDES = {2: 'providesDirectionalDerivative="true"', 3: 'providesDirectionalDerivatives="true"'}
PARAMETERS = {"K11": 21, "K12": 22, "K21": 23, "K22": 24, "a": 25, "b1": 26, "b2": 27, "q": 28, "lie": 29}
ANSWERS = ("ok", "warning", "discard", "error", "fatal", "nan")
VARIABLES = (
    *(V(name, reference, "Float64", "input", "0") for name, reference in (("u1", 1), ("u2", 2))),
    V("on", 3, "Boolean", "input", "false", "discrete"),
    V("y1", 11, "Float64", "output", initial="calculated", depends=("u1", "u2", "on")),
    V("y2", 12, "Float64", "output", initial="calculated", depends=("u1", "u2", "on")),
    *(V(n, r, "Float64", "parameter", "1" if n == "lie" else "0", "fixed") for n, r in PARAMETERS.items()),
    V("answer", 30, "Int32", "parameter", "0", "fixed"),
    V("nth", 31, "Int32", "parameter", "1", "fixed"),
)


def build(
    folder: Path, version: int, kinds: str, flags: str = "", provides: bool = True, discrete: bool = False
) -> Path:
    """The FMU. provides: whether it promises derivatives; discrete: whether its real inputs change at events only."""
    flags = f"{flags} {PROVIDES[version]}" if provides else flags
    variables = tuple(
        replace(v, variability="discrete") if discrete and v.causality == "input" else v for v in VARIABLES
    )
    return machine.pack(folder, version, Model("slopes", variables), SOURCE, kinds, flags)


def counts(path: Path) -> Counter[str]:
    """The calls of each function so far, of all instances of a process together."""
    found: Counter[str] = Counter()
    for line in path.read_text().splitlines() if path.exists() else ():
        name, number = line.split()
        found[name] += int(number)
    return found
