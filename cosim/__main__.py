"""The process of the command line: from its first instant to its last, a signal ends it without a traceback."""

import signal
import sys

if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # until `main` listens

from cosim.machine import interruption
from cosim.terminal.cli import main


def entry() -> int:
    """Run the command line; afterwards no signal may break off what cleans up."""
    try:
        return main()
    finally:
        interruption.ignore()


if __name__ == "__main__":
    sys.exit(entry())
