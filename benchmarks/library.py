"""What blocks of the library cost, beside the same loops in C: one function of each, over 1,000 elements or so.

    python benchmarks/library.py [--rounds 15] [--cc gcc]

Kernels are called at their address, as the loop calls them, and the C functions likewise, by turns; both results are
compared. The time is the least of all rounds; ratios are of these.
"""

from __future__ import annotations

import argparse
import ctypes
import subprocess
import tempfile
import time as clock
from collections.abc import Callable
from pathlib import Path

import numpy as np

from cosim.compiling import kernels
from cosim.compiling.frame import frame_of
from cosim.wiring import library

HERE = Path(__file__).resolve().parent
N, CALLS = 1000, 200
POINTER = ctypes.POINTER(ctypes.c_double)
KERNEL = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, ctypes.c_void_p, ctypes.c_void_p)
#: Block, function, the arguments of both in order, and the shapes of those that are no vectors of N; sizes are numbers,
#: of which `n` is how many elements there are.
CASES = {
    "Gain": ("outputs", "u k y", {}),
    "Saturation": ("outputs", "u lower upper y", {}),
    "Sin": ("outputs", "u y", {}),
    "FirstOrder": ("derivatives", "u k T x d_x", {}),
    "LowPass": ("derivatives", "u cutoff x v d_x d_v", {}),
    "LookUp1D": ("outputs", "u k points values y", {"points": (20,), "values": (20,), "k": 20}),
    "FIR": ("outputs", "u taps b x y", {"b": (8,), "x": (N, 7), "taps": 8}),
    "MatrixGain": ("outputs", "u K y", {"K": (N, N)}),
    "TransferFunction": (
        "derivatives",
        "u coefficients den x d_x",
        {"coefficients": 5, "zeros": 1, "order": 4, "den": (5,), "x": (N, 4), "d_x": (N, 4)},
    ),
    "StateSpace": (
        "derivatives",
        "u m A B x d_x",
        {"n": 20, "m": 2, "u": (2,), "A": (20, 20), "B": (20, 2), "x": (20,), "d_x": (20,)},
    ),
    "TransportDelay": ("derivatives", "u T x d_x", {"x": (N, 2), "d_x": (N, 2)}),
    "Notch": ("derivatives", "u centre Q x z d_x d_z", {}),
    "PID": ("outputs", "r y feed_forward k_p k_d T_f b c lower upper i x v u", {}),
    "LookUp2D": (
        "outputs",
        "u_1 u_2 rows columns points_1 points_2 values y",
        {"rows": 20, "columns": 30, "points_1": (20,), "points_2": (30,), "values": (20, 30)},
    ),
    "KalmanFilter": (
        "outputs",
        "y p C R x P x_hat P_hat",
        {"n": 6, "p": 2, "C": (2, 6), "R": (2,), "y": (2,), "x": (6,), "P": (6, 6), "x_hat": (6,), "P_hat": (6, 6)},
    ),
    "WhiteNoise": ("update", "mean deviation next_stream next_y", {"next_stream": (2,)}),
    "Delay": ("outputs", "samples depth past head y", {"samples": (), "depth": 64, "past": (64, N), "head": ()}),
}


def values(name: str, shape: tuple[int, ...]) -> np.ndarray:
    """Something to compute with, the same for both."""
    whole = {"next_stream": ([7, 0], np.int64), "samples": (5, np.int32), "head": (3, np.int32)}
    if name in whole:
        return np.array(*whole[name])
    found = np.random.default_rng(len(name)).uniform(-1.0, 1.0, shape)
    if name.startswith("points"):
        return np.sort(found)
    shifted = {
        "lower": found - 1.5,
        "upper": found + 1.5,
        "T": found + 2.0,
        "T_f": found + 2.0,
        "Q": found + 2.0,
        "R": found + 2.0,
        "P": found @ found.T if found.ndim == 2 else found,
    }
    return np.asarray(shifted.get(name, found))


def of_kernel(block: str, function: str, arrays: dict[str, np.ndarray], sizes: dict[str, int]) -> Callable[[], None]:
    """A call of a block's kernel over arrays."""
    declaration = library.all_blocks()[block].declaration
    ports = [v for v in declaration.variables.values() if v.causality in ("input", "output")]
    constants = {d: sizes[d] for v in ports for d in v.shape if isinstance(d, str)}
    compiled = kernels.module(kernels.block_sources(declaration, constants))
    called = next(f for f in declaration.functions if f.name == function)
    frame = frame_of(declaration, called, constants)
    extra = np.zeros(1)  # what C is not given, such as a truth value
    places = {a: (arrays.get(a, extra).ctypes.data, 0) for a in called.arguments}
    words = np.array(frame.words(1, sizes, places), np.int64)
    entry = KERNEL(compiled.load().address(function))
    address = words.ctypes.data

    def call() -> None:
        assert entry(0.0, 0, address) == 0

    call.keep = (words, extra, arrays)  # type: ignore[attr-defined]
    return call


def of_c(
    library_: ctypes.CDLL, block: str, arguments: list[str], arrays: dict[str, np.ndarray], sizes: dict[str, int]
) -> Callable[[], None]:
    """A call of the C function over arrays."""
    entry = getattr(library_, block)
    given = [arrays[a].ctypes.data_as(POINTER) if a in arrays else ctypes.c_int(sizes[a]) for a in arguments]
    return lambda: entry(sizes["n"], *given)


def least(call: Callable[[], None]) -> float:
    """Seconds of one call, of several."""
    begin = clock.perf_counter()
    for _ in range(CALLS):
        call()
    return (clock.perf_counter() - begin) / CALLS


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--cc", default="gcc")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / "library.so"
        command = [options.cc, "-O3", "-ffp-contract=off", "-shared", "-fPIC", HERE / "library.c", "-o", made, "-lm"]
        subprocess.run(command, check=True)  # a compiler that was asked for
        native = ctypes.CDLL(str(made))
    print(f"{'block':16} {'cosim':>10} {'C -O3':>10} {'ratio':>6}   ns an element")
    for block, (function, text, more) in CASES.items():
        arguments = text.split()
        shapes = {a: more.get(a, (N,)) for a in arguments if not isinstance(more.get(a), int)}
        arrays = {a: np.ascontiguousarray(values(a, shape)) for a, shape in shapes.items()}
        others = {a: array.copy() for a, array in arrays.items()}
        sizes = {"n": N, "m": N, "p": N, "k": 20, "taps": 8, "past": 7}
        sizes |= {name: size for name, size in more.items() if isinstance(size, int)}
        ours, theirs = of_kernel(block, function, arrays, sizes), of_c(native, block, arguments, others, sizes)
        ours(), theirs()
        for name, array in arrays.items():
            assert np.allclose(array, others[name], rtol=1e-12), (block, name)
        times = [(least(ours), least(theirs)) for _ in range(options.rounds)]
        mine, other = (min(column) * 1e9 / sizes["n"] for column in zip(*times, strict=True))
        print(f"{block:16} {mine:10.3f} {other:10.3f} {mine / other:6.2f}")


if __name__ == "__main__":
    main()
