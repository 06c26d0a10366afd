"""The command line: finds the command, and turns every error into a message and an exit code."""

from __future__ import annotations

import argparse
import json
import sys
import time
from importlib import import_module

from cosim.errors import CosimError

BAD_INPUT, INTERRUPTED = 2, 130
COMMANDS = {
    "run": "run a diagram and print its metrics",
    "check": "validate a diagram without running it",
    "blocks": "list the blocks, or show one",
    "export": "write blocks of a diagram as an FMU",
    "fmu": "show what an FMU file is",
    "study": "run many variants, grid points and random draws of a diagram",
    "report": "run studies, and write one HTML file with their tables and pictures",
    "plot": "draw recorded signals, or animate a run",
    "compare": "show two results side by side, and where they part",
}


def main(arguments: list[str] | None = None) -> int:
    """Entry point. Returns the exit code: 0 done, 1 stopped, 2 bad input, 130 interrupted."""
    began = time.perf_counter()
    words = sys.argv[1:] if arguments is None else arguments
    options = _parser(words).parse_args(words)
    options.began = began
    try:
        return options.run(options)
    except CosimError as error:
        from cosim import terminal

        if getattr(options, "json", False):
            print(json.dumps({**_subject(options), "status": "failed", "error": str(error)}, ensure_ascii=False))
        sys.stdout.flush()
        terminal.print_errors(error)
        return BAD_INPUT
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        # The reader of standard output has gone; what it read was all it wanted.
        sys.stderr.close()
        return 0


def _subject(options: argparse.Namespace) -> dict[str, str]:
    return {"diagram": str(options.diagram)} if hasattr(options, "diagram") else {}


def _parser(words: list[str]) -> argparse.ArgumentParser:
    """The parser; only the command that is wanted is imported."""
    parser = argparse.ArgumentParser(prog="cosim", description="Co-simulation of block diagrams written in YAML.")
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    wanted = next((word for word in words if not word.startswith("-")), "")
    for name, text in COMMANDS.items():
        command = commands.add_parser(name, help=text, description=f"{text[0].upper()}{text[1:]}.")
        if name == wanted:
            module = import_module(f"cosim.commands.{name}")
            module.arguments(command)
            command.set_defaults(run=module.run)
    return parser


if __name__ == "__main__":
    sys.exit(main())
