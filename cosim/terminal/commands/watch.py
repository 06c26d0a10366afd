"""`cosim watch`: a page that shows a diagram and its run, and runs it again at every save."""

from __future__ import annotations

import argparse
import sys
import tempfile
import threading
import webbrowser
from pathlib import Path

from cosim.errors import DiagramErrors, MissingFile, Problems, WrongFile
from cosim.language import diagram as diagrams
from cosim.terminal.commands.options import diagram_arguments, settings_of
from cosim.terminal.exits import DONE
from cosim.terminal.screen import say
from cosim.watch.page_server import PageServer
from cosim.watch.session import WatchSession


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
    _refuse(options.diagram)
    with tempfile.TemporaryDirectory(prefix="cosim-watch-", ignore_cleanup_errors=True) as folder:
        session = WatchSession(options.diagram, tuple(settings_of(options)), tuple(options.swap), Path(folder))
        try:
            with PageServer(session, options.port) as server:
                threading.Thread(target=server.serve_forever, daemon=True).start()
                session.start()
                say(f"{options.diagram} is shown at {server.guard.address}")
                say("Ctrl-C ends it")
                sys.stdout.flush()
                if not options.no_browser:
                    _open(server.guard.address)
                threading.Event().wait()
        finally:
            session.close()
    return DONE


def _refuse(path: Path) -> None:
    """A slip of the command line; all else that is wrong with a diagram the page shows. Raises: DiagramErrors."""
    if path.suffix.lower() == ".fmu" and path.is_file():
        return
    try:
        diagrams.read(path, (), (), Problems())
    except DiagramErrors as error:
        if any(
            isinstance(one, WrongFile) or (isinstance(one, MissingFile) and not path.is_file()) for one in error.errors
        ):
            raise


def _open(address: str) -> None:
    """In a browser with windows of its own; one in the terminal would take it."""
    try:
        browser = webbrowser.get()
    except webbrowser.Error:
        return
    if type(browser) is not webbrowser.GenericBrowser:
        browser.open(address)
