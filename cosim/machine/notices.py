"""Words on the way, to whoever waits: what takes long, what is not kept, what does not end.

They go to Python's log `cosim`; the command line prints them.
"""

from __future__ import annotations

import logging

LOG = "cosim"
PATIENCE = 0.3
"""Seconds of wall-clock time that pass before a progress bar appears: a short run is not worth one."""


def progress(text: str) -> None:
    """What takes a while; told to nobody who has not asked."""
    logging.getLogger(LOG).info("%s", text)


def warn(text: str) -> None:
    """What costs time or is lost, but not the run."""
    logging.getLogger(LOG).warning("%s", text)


def fail(text: str) -> None:
    """What ends the process, and cannot be raised."""
    logging.getLogger(LOG).error("%s", text)
