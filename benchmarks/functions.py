"""How exact elementary functions are, and how fast, beside the C library's.

    python benchmarks/functions.py [--points 10000000] [--cc gcc]

Errors are those of 10^7 points a function, in units in the last place, beside the C library's long double functions:
that type has to have more digits than double, as on x86, whose 64 leave 0.001 units open.
"""

from __future__ import annotations

import argparse
import ctypes
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from cosim.compiling import emission
from cosim.machine import object_code
from cosim.plain_math.definitions import FUNCTIONS, definition

HERE = Path(__file__).parent
USUAL = {"sin": (-4, 4), "cos": (-4, 4), "exp": (-3, 3), "log": (0.1, 5), "tanh": (-2, 2), "pow": (0.1, 3)}


class Points:
    """Numbers to try, so many a time."""

    def __init__(self, count: int) -> None:
        self.count = count
        self.draw = np.random.default_rng(1)

    def between(self, low: float, high: float) -> np.ndarray:
        return self.draw.uniform(low, high, self.count)

    def of_sizes(self, low: float, high: float) -> np.ndarray:
        """2^low to 2^high, of both signs."""
        return np.exp2(self.between(low, high)) * self.draw.choice([-1.0, 1.0], self.count)

    def any(self) -> np.ndarray:
        """Any bits: NaN, infinities and subnormal numbers among them."""
        return self.draw.integers(-(2**63), 2**63 - 1, self.count).view(float)

    def near_quarters(self) -> np.ndarray:
        """Next to multiples of pi/2."""
        found = self.draw.integers(1, 2**19, self.count) * (np.pi / 2)
        return found + np.spacing(found) * self.draw.integers(-3, 4, self.count)

    def with_results(self, base: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Bases, with exponents that lead to all results that there are."""
        return base, self.between(-745.0, 709.7) / np.log(base)


def ranges(name: str, points: Points) -> Iterator[tuple[str, tuple[np.ndarray, ...]]]:
    """What a function is tried with."""
    p = points
    if name in ("sin", "cos"):
        yield "-4 … 4", (p.between(-4, 4),)
        yield "-8e5 … 8e5", (p.between(-823549, 823549),)
        yield "next to k pi/2", (p.near_quarters(),)
        yield "1e-300 … 8e5", (p.of_sizes(-1000, 19),)
        yield "8e5 … 1.8e308", (p.of_sizes(20, 1023.99),)
    elif name == "exp":
        yield "-1 … 1", (p.between(-1, 1),)
        yield "-708 … 709.8", (p.between(-708, 709.8),)
        yield "subnormal results", (p.between(-746, -708),)
        yield "small", (p.of_sizes(-1000, 0),)
    elif name == "log":
        yield "0.3 … 3", (p.between(0.3, 3),)
        yield "all sizes", (np.abs(p.of_sizes(-1074, 1023.99)),)
        yield "next to 1", (1 + p.of_sizes(-52, -2),)
    elif name == "tanh":
        yield "-1 … 1", (p.between(-1, 1),)
        yield "-25 … 25", (p.between(-25, 25),)
        yield "all sizes", (p.of_sizes(-1074, 6),)
    elif name == "pow":
        yield "0 … 3, -5 … 5", (p.between(0, 3), p.between(-5, 5))
        yield "all results", p.with_results(np.abs(p.of_sizes(-1074, 1023.99)))
        yield "bases 0.7 … 1.5", p.with_results(p.between(0.7, 1.5))
        yield "bases next to 1", (1 + p.of_sizes(-52, -2), p.of_sizes(-5, 60))
        yield "whole exponents", (p.of_sizes(-5, 5), p.draw.integers(-200, 200, p.count).astype(float))
    else:
        yield "-1 … 1", (p.between(-1, 1), p.between(-1, 1))
        yield "all sizes", (p.of_sizes(-1074, 1023), p.of_sizes(-1074, 1023))
        x = p.of_sizes(-1000, 1000)
        yield (
            "next to corners",
            (x, x * p.draw.choice([-1, 1, 0.41421356, 2.41421356], p.count) * (1 + p.of_sizes(-52, -3))),
        )
        yield "subnormal", (p.of_sizes(-1074, -1000), p.of_sizes(-1074, -900))
    yield "any bits", tuple(p.any() for _ in range(FUNCTIONS[name].arguments))


def address(array: np.ndarray) -> Any:
    """Of its first number."""
    return ctypes.c_void_p(array.ctypes.data)


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--points", type=int, default=10**7)
    parser.add_argument("--cc", default="gcc")
    options = parser.parse_args()
    symbols = [f"cosim_{name}" for name in FUNCTIONS]
    code = emission.emit("".join(map(definition, FUNCTIONS)), *object_code.host(), symbols, "functions")
    ours = object_code.Library(code)
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / "functions.so"
        subprocess.run([options.cc, "-O2", "-shared", "-fPIC", HERE / "functions.c", "-o", made, "-lm"], check=True)
        c: Any = ctypes.CDLL(str(made))
    print("function  arguments              largest error  C library   at")
    for name in FUNCTIONS:
        library = getattr(c, f"library_{name}")
        worst, clock = getattr(c, f"worst_{name}"), getattr(c, f"time_{name}")
        library.restype, worst.restype, clock.restype = ctypes.c_void_p, ctypes.c_long, ctypes.c_double
        both = [ctypes.c_void_p(ours.address(f"cosim_{name}")), ctypes.c_void_p(library())]
        kinds = sum(1 for _ in ranges(name, Points(1)))
        for what, x in ranges(name, Points(options.points // kinds)):
            errors, places = [], []
            for function in both:
                most = ctypes.c_double()
                count = ctypes.c_long(x[0].size)
                places.append(worst(function, address(x[0]), address(x[-1]), count, ctypes.byref(most)))
                errors.append(most.value)
            at = ", ".join(repr(float(a[places[0]])) for a in x)
            print(f"{name:<9} {what:<22} {errors[0]:>12.3f} {errors[1]:>12.3f}   {at}", flush=True)
        points = Points(1000)
        low, high = USUAL.get(name, (-1, 1))
        x = points.between(low, high), points.between(-3, 3)
        seconds = [
            min(clock(function, address(x[0]), address(x[1]), ctypes.c_long(1000)) for _ in range(500))
            for function in both
        ]
        print(f"{name:<9} ns a call              {seconds[0]:>12.1f} {seconds[1]:>12.1f}")


if __name__ == "__main__":
    main()
