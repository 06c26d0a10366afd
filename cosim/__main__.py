"""The process of the command line: from its first instant to its last, a signal ends it without a traceback."""

import gc
import os
import signal
import sys

if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # until `main` listens
if gc.isenabled():
    gc.set_threshold(100_000)  # what a start makes stays, and to look through it again and again takes a tenth of one
# Threads of linear algebra turn in circles for a while before they wait for work: up to a quarter of a start.
os.environ.setdefault("OPENBLAS_THREAD_TIMEOUT", "4")

from cosim.machine import interruption
from cosim.terminal.cli import main


def entry() -> int:
    """Run the command line; afterwards no signal may break off what cleans up."""
    try:
        return main()
    finally:
        interruption.ignore()
        gc.freeze()  # what goes with the process need not be looked through at its end: a tenth of a start, too


if __name__ == "__main__":
    sys.exit(entry())
