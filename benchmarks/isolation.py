"""What one call costs that another process does: through the mailbox alone, without any FMU.

    python benchmarks/isolation.py [--calls 100000] [--rounds 9]

The compiled loop calls a server that does nothing, as it calls an isolated FMU, and for comparison the same nothing by
its address. Both processes need a processor each while this runs.
"""

from __future__ import annotations

import argparse
import ctypes
import statistics
import time as clock

import numpy as np

from cosim.compiling import kernels
from cosim.fmu import mailbox
from cosim.machine import supervision
from cosim.machine.memory import call, words_at

KERNEL = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, ctypes.c_void_p, ctypes.c_void_p)


def nothing(time: float, base: int, frame: int) -> int:
    """What the server does."""
    return 0


def repeat(time: float, base: int, frame: int) -> int:
    """Call a function many times; frame: [its address, how often, its frame]."""
    w = words_at(frame, 3)
    for _ in range(w[1]):
        call(w[0], time, base, w[2])
    return 0


def exchange(calls: int, rounds: int) -> dict[str, list[float]]:
    """Microseconds a call in each round, by address and through the mailbox."""
    near = kernels.module(kernels.raw_sources("nothing", (nothing, repeat))).load()
    far = kernels.module(kernels.raw_sources("mailbox", mailbox.KERNELS)).load()
    box = mailbox.new()
    table = np.array([[near.address("nothing"), 0]], np.int64)
    box[mailbox.CALLS] = table.ctypes.data
    link = np.array([1, 0, box.ctypes.data], np.int64)
    frame = np.array([0, 1, link.ctypes.data, 0], np.int64)

    def serve() -> None:
        while KERNEL(far.address("serve"))(0.0, 0, box.ctypes.data) == mailbox.WARNING:
            pass

    crew = supervision.Crew(lambda: None, 10.0)
    crew.hire("server", {"serve": serve})
    crew.tell("server", "serve")
    functions = {"by address": near.address("nothing"), "through the mailbox": far.address("remote")}
    times: dict[str, list[float]] = {name: [] for name in functions}
    for _ in range(rounds):
        for name, function in functions.items():
            words = np.array([function, calls, frame.ctypes.data], np.int64)
            began = clock.perf_counter()
            KERNEL(near.address("repeat"))(0.0, 0, words.ctypes.data)
            times[name].append((clock.perf_counter() - began) / calls * 1e6)
    mailbox.post(box.ctypes.data, mailbox.STOP, 0.0)
    crew.answer("server")
    crew.dismiss()
    return times


def main() -> None:
    """Print a line for each way."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--calls", type=int, default=100_000)
    parser.add_argument("--rounds", type=int, default=9)
    options = parser.parse_args()
    for name, times in exchange(options.calls, options.rounds).items():
        print(f"{name:<20} {statistics.median(times):8.3f} µs a call ({min(times):.3f} … {max(times):.3f})")


if __name__ == "__main__":
    main()
