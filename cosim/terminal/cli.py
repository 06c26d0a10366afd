"""The command line: finds the command, and turns every error and signal into a message and an exit code."""

from __future__ import annotations

import argparse
import faulthandler
import json
import signal
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module

import cosim
from cosim.errors import CosimError, UsageError
from cosim.machine import interruption, streams
from cosim.terminal import notice_printer
from cosim.terminal.command_names import COMMANDS
from cosim.terminal.exits import BAD_INPUT, BY_SIGNAL, DONE, MEANINGS, STOPPED
from cosim.terminal.usage import Install, Parser


def main(arguments: list[str] | None = None) -> int:
    """Entry point. Returns the exit code, as of `cosim.terminal.exits`."""
    began = time.perf_counter()
    with streams.forgiving() as output, notice_printer.printed():
        if not faulthandler.is_enabled():
            faulthandler.enable(file=streams.DESCRIPTORS["stderr"])
        code = _run(sys.argv[1:] if arguments is None else arguments, began)
        if failure := output.failure():
            print(f"error: cannot write to standard output: {failure}", file=sys.stderr)
            code = code or STOPPED
    return code


def _run(words: list[str], began: float) -> int:
    if words[:1] == ["--complete"]:  # of a shell, at every press of Tab
        return _complete(words[1:])
    try:
        with interruption.heard() as heard:
            with interruption.deferred() as interrupted:  # an import that is broken off may leave anything
                parser = _parser(words)
            interrupted.raise_if_wanted()
            try:
                options = parser.parse_args(words)
            except UsageError as error:
                return _failed(error, {}, "--json" in words)
            options.began = began
            return _command(options, heard)
    except KeyboardInterrupt as stopped:
        number = stopped.number if isinstance(stopped, interruption.Interrupted) else signal.SIGINT
        print(" ".join((f"interrupted by {signal.Signals(number).name}", *_notes(stopped))), file=sys.stderr)
        return BY_SIGNAL + number
    except SystemExit as leaving:  # of --help
        return leaving.code if isinstance(leaving.code, int) else DONE


def _complete(words: list[str]) -> int:
    """Tell a shell what may come next. What goes wrong is no answer, as nobody has asked for words."""
    from cosim.terminal import completion

    with suppress(Exception):
        print(completion.answer(*words), end="")
    return DONE


def _notes(error: BaseException) -> list[str]:
    """What was added to an error on its way."""
    return getattr(error, "__notes__", [])


def _command(options: argparse.Namespace, heard: interruption.Interruption) -> int:
    try:
        command: Callable[[argparse.Namespace], int] = options.run
        return command(options)
    except CosimError as error:
        wrong = error
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        wrong = CosimError(f"{where}{error.strerror or error}")
    except SystemExit as leaving:  # of a rule's function, for one: nobody has said why
        from cosim.authoring.leaving import left

        wrong = left(leaving)
    except MemoryError:
        wrong = CosimError("there is not enough memory", fix="run fewer members or steps at a time, or record less")
    heard.raise_if_wanted()  # Python wraps what is raised in some calls, and an import may translate it
    return _failed(wrong, _subject(options), getattr(options, "json", False))


def _failed(error: CosimError, subject: dict[str, str], in_json: bool) -> int:
    if in_json:
        print(json.dumps({**subject, "status": "failed", "error": str(error)}, ensure_ascii=False))
    sys.stdout.flush()
    from cosim.terminal import screen

    screen.print_errors(error)
    return BAD_INPUT


def _subject(options: argparse.Namespace) -> dict[str, str]:
    return {"diagram": str(options.diagram)} if hasattr(options, "diagram") else {}


def _parser(words: list[str]) -> argparse.ArgumentParser:
    """The parser; only the command that is wanted is imported."""
    parser = Parser(
        prog="cosim",
        description="Co-simulation of block diagrams written in YAML.",
        epilog=MEANINGS,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"cosim {cosim.__version__}")
    asked = not {"-h", "--help"}.isdisjoint(words)
    help_ = "let Tab complete what is typed"
    parser.add_argument("--install-completion", action=Install, asked=asked, metavar="SHELL", help=help_)
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    wanted = next((word for word in words if not word.startswith("-")), "")
    for name, text in COMMANDS.items():
        command = commands.add_parser(name, help=text, description=f"{text[0].upper()}{text[1:]}.")
        if name == wanted:
            module = import_module(f"cosim.terminal.commands.{name}")
            module.arguments(command)
            command.set_defaults(run=module.run)
    return parser


if __name__ == "__main__":
    sys.exit(main())
