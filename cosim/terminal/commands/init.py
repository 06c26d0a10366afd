"""`cosim init`: begin a project of one's own."""

from __future__ import annotations

import argparse
import shlex
from pathlib import Path

from cosim.project import starting
from cosim.terminal.screen import print_rows, say


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("folder", type=_folder, help="which is made if there is none; nothing in it is replaced")


def _folder(text: str) -> Path:
    if not text.strip():
        raise argparse.ArgumentTypeError("the folder has no name; `.` is the current one")
    return Path(text)


def run(options: argparse.Namespace) -> int:
    """Write the project, and say what to do with it."""
    files = starting.begin(options.folder)
    say(f"written into {options.folder}:")
    say("".join(f"\n  {path.relative_to(options.folder)}" for path in files).lstrip("\n"))
    say("\nit runs as it is:")
    there = str(options.folder)
    go = [[f"cd {shlex.quote(f'./{there}' if there.startswith('-') else there)}", ""]]
    if options.folder.resolve() == Path.cwd():
        go = []
    steps = [
        ["cosim run diagrams/motor.yaml", "a run, and its figures"],
        ["cosim study studies/gains.yaml", "many runs"],
        ["python -m pytest", "its tests, if pytest is installed"],
        ["cosim new block ServoMotor", "a block of your own, with a test"],
    ]
    print_rows([*go, *steps], indent="  ")
    return 0
