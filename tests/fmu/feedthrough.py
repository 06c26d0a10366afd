"""The test FMU `feedthrough.c`: each input is handed on at once, and calls are counted."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from tests.fmu import machine
from tests.fmu.machine import Model, V

SOURCE = Path(__file__).with_name("feedthrough.c")
EVENTFUL = 'hasEventMode="true"'
#: Inputs, by name: reference, type, variability, shape. FMI 2 has those of the first four types.
INPUTS = {
    "u1": (1, "Float64", "continuous", ()),
    "u2": (2, "Float64", "continuous", ()),
    "u3": (3, "Float64", "discrete", ()),
    "i1": (4, "Int64", "discrete", ()),
    "i2": (5, "Int64", "discrete", ()),
    "b1": (6, "Boolean", "discrete", ()),
    "b2": (7, "Boolean", "discrete", ()),
}
INPUTS3 = {
    "a": (9, "Float64", "continuous", (4,)),
    "f1": (10, "Float32", "continuous", ()),
    "f2": (11, "Float32", "continuous", ()),
    "s1": (12, "Int8", "discrete", ()),
    "s2": (13, "Int8", "discrete", ()),
}
ALL = {2: INPUTS, 3: {**INPUTS, **INPUTS3}}


def output(name: str) -> str:
    """The output that an input is handed on to."""
    return f"{name}_out"


def variables(version: int) -> tuple[V, ...]:
    """The FMU's variables."""
    found = []
    for name, (reference, kind, variability, shape) in ALL[version].items():
        start = "false" if kind == "Boolean" else " ".join("0" * (4 if shape else 1))
        found.append(V(name, reference, kind, "input", start, variability, shape=shape))
    for name, (reference, kind, variability, shape) in ALL[version].items():
        more = {"initial": "calculated", "depends": (name,), "shape": shape}
        found.append(V(output(name), reference + 100, kind, "output", None, variability, **more))
    return tuple(found)


def build(folder: Path, version: int, kinds: str = "me cs", flags: str = "") -> Path:
    """The FMU."""
    return machine.pack(folder, version, Model("feedthrough", variables(version)), SOURCE, kinds, flags)


def counts(path: Path) -> Counter[str]:
    """The calls of each function so far, of all instances of a process together."""
    found: Counter[str] = Counter()
    for line in path.read_text().splitlines() if path.exists() else ():
        name, number = line.split()
        found[name] += int(number)
    return found
