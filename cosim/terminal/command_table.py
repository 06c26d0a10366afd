"""The commands with their options and arguments, and the keys of the YAML, as plain data."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from importlib import import_module
from typing import Any

from cosim.language.keys import ANY, DIAGRAM, Key
from cosim.terminal.command_names import COMMANDS
from cosim.terminal.commands import keys


def build() -> dict[str, Any]:
    """All of it: every command is imported."""
    commands = {}
    for name, help_ in COMMANDS.items():
        parser = argparse.ArgumentParser(add_help=True)
        import_module(f"cosim.terminal.commands.{name}").arguments(parser)
        commands[name] = {"help": help_, **_parser(parser)}
    own = {"--help": "how to use it", "--version": "which version it is", "--install-completion": "let Tab complete"}
    options = {option: {"help": text, "takes": False, "choices": []} for option, text in own.items()}
    paths = [path for section in ("run", "record") for path in _paths(DIAGRAM[section].below, section)]
    return {"commands": commands, "options": options, "paths": paths, "sections": sorted(keys.sections())}


def _parser(parser: argparse.ArgumentParser) -> dict[str, Any]:
    options, arguments = {}, []
    for action in parser._actions:  # noqa: SLF001  # argparse tells nobody else
        choices = [str(choice) for choice in action.choices or ()]
        help_ = " ".join((action.help or "").split())
        if not action.option_strings:
            several = action.nargs in ("*", "+")
            arguments.append({"name": action.dest, "choices": choices, "several": several})
        elif option := next((o for o in action.option_strings if o.startswith("--")), ""):
            options[option] = {"help": help_, "takes": action.nargs != 0, "choices": choices}
        for short in action.option_strings:
            if not short.startswith("--"):
                options[short] = {"help": help_, "takes": action.nargs != 0, "choices": choices}
    return {"options": options, "arguments": arguments}


def _paths(section: Mapping[str, Key], name: str) -> Iterator[str]:
    yield from (f"{name}.{key}" for key in section if key != ANY)
