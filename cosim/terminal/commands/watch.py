"""`cosim watch`: a page that shows a diagram and its run, and runs it again at every save."""

from __future__ import annotations

import argparse
import sys
import tempfile
import threading
import webbrowser
from collections.abc import Sequence
from pathlib import Path

from cosim.errors import DiagramErrors, Problems, WrongFile
from cosim.language import diagram as diagrams
from cosim.machine import interruption
from cosim.terminal.commands.options import diagram_arguments, settings_of
from cosim.terminal.exits import DONE
from cosim.terminal.screen import say
from cosim.watch.page_server import PageServer
from cosim.watch.session import WatchSession

LOOK = 0.1
"""Seconds between two looks of the server at whether it is to end."""


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    diagram_arguments(parser)
    parser.add_argument("--port", type=int, default=0, help="where the page is (default: any that is free)")
    parser.add_argument("--no-browser", action="store_true", help="print the page's address, and open no browser")
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.description = (
        "Show a diagram and its run on a page, and run it again whenever it, a diagram that it extends or has in\n"
        "it, or the Python file of a block is saved. Sliders change parameters without a save; no file is written."
    )
    parser.epilog = (
        "examples:\n"
        "  cosim watch diagrams/motor.yaml\n"
        "  cosim watch diagrams/formation.yaml --stop 10 --set blocks.controller.parameters.c=3\n"
        "  cosim watch motor.fmu --port 8123 --no-browser\n\n"
        "The page is on this machine only, and its address holds a token. Ctrl-C ends it."
    )


def run(options: argparse.Namespace) -> int:
    """Show the page until somebody ends the program. Raises: DiagramErrors, UsageError."""
    settings, swaps = tuple(settings_of(options)), tuple(options.swap)
    _refuse(options.diagram, settings, swaps)
    with tempfile.TemporaryDirectory(prefix="cosim-watch-", ignore_cleanup_errors=True) as folder:
        session = WatchSession(options.diagram, settings, swaps, Path(folder))
        try:
            with PageServer(session, options.port) as server:
                threading.Thread(target=server.serve_forever, args=[LOOK], daemon=True).start()
                try:
                    session.start()
                    _tell(options.diagram, server.guard.address)
                    if not options.no_browser:
                        _open(server.guard.address)
                    threading.Event().wait()
                finally:
                    server.shutdown()
        finally:
            with interruption.deferred():
                session.close()
    return DONE


def _tell(path: Path, address: str) -> None:
    say(f"{path} is shown at {address}")
    say("Ctrl-C ends it")
    sys.stdout.flush()


def _refuse(path: Path, settings: Sequence[str], swaps: Sequence[str]) -> None:
    """What no save would put right; all else that is wrong with a diagram the page shows. Raises: DiagramErrors."""
    if path.suffix.lower() == ".fmu" and path.is_file():
        return
    problems = Problems()
    try:
        diagrams.read(path, settings, swaps, problems)
    except DiagramErrors as error:
        if not path.is_file() or any(isinstance(one, WrongFile) for one in error.errors):
            raise
    if slips := [one for one in problems.errors if one.position and not one.position.line]:
        raise DiagramErrors(slips)


def _open(address: str) -> None:
    """In a browser with windows of its own; one in the terminal would take it."""
    try:
        browser = webbrowser.get()
    except webbrowser.Error:
        return
    if type(browser) is not webbrowser.GenericBrowser:
        browser.open(address)
