"""`cosim init`: begin a project of one's own."""

from __future__ import annotations

import argparse
import shlex
from pathlib import Path

from cosim.project import starting
from cosim.terminal.screen import print_rows, say

PROJECT = (
    ["cosim run diagrams/motor.yaml", "a run, and its figures"],
    ["cosim study studies/gains.yaml", "many runs"],
    ["python -m pytest", "its tests, if pytest is installed"],
    ["cosim new block ServoMotor", "a block of your own, with a test"],
)
EXAMPLES = (
    ["cosim run formation.yaml", "the paper's six robots"],
    ["cosim run motor.yaml", "a motor with a PID controller"],
    ["cosim study studies/observers.yaml", "the paper's table of observers"],
)


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("folder", type=_folder, help="which is made if there is none; nothing in it is replaced")
    help_ = "the framework's own diagrams and studies instead: the formation, a motor, a thermostat"
    parser.add_argument("--examples", action="store_true", help=help_)


def _folder(text: str) -> Path:
    if not text.strip():
        raise argparse.ArgumentTypeError("the folder has no name; `.` is the current one")
    return Path(text)


def run(options: argparse.Namespace) -> int:
    """Write the project, and say what to do with it."""
    files = starting.examples(options.folder) if options.examples else starting.begin(options.folder)
    say(f"written into {options.folder}:")
    say("".join(f"\n  {path.relative_to(options.folder)}" for path in files).lstrip("\n"))
    say("\nit runs as it is:")
    there = str(options.folder)
    go = [[f"cd {shlex.quote(f'./{there}' if there.startswith('-') else there)}", ""]]
    if options.folder.resolve() == Path.cwd():
        go = []
    print_rows([*go, *(EXAMPLES if options.examples else PROJECT)], indent="  ")
    return 0
