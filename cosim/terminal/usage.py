"""A parser of command lines whose mistakes are errors as all others are: what is wrong, and the usual fix."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterable
from typing import Any, NoReturn

from cosim.errors import UsageError, nearest

KINDS = {"float": "number", "int": "whole number"}


class Install(argparse.Action):
    """The option that installs completion for a shell, that of $SHELL unless it is named, and ends the program.

    asked: whether somebody asks for help, too, which is given instead.
    """

    def __init__(self, option_strings: list[str], dest: str, asked: bool, **more: Any) -> None:
        super().__init__(option_strings, argparse.SUPPRESS, nargs="?", **more)
        self._asked = asked

    def __call__(self, parser: argparse.ArgumentParser, namespace: Any, values: Any, option: str | None = None) -> None:
        """Raises: UsageError, SystemExit."""
        if self._asked:
            return
        from cosim.terminal import completion

        completion.install(values)
        parser.exit()


class Parser(argparse.ArgumentParser):
    """An ArgumentParser that raises UsageError."""

    def error(self, message: str) -> NoReturn:
        """Raises: UsageError."""
        choice = re.fullmatch(r"argument (.+): invalid choice: '(.*)' \(choose from (.*)\)", message)
        if choice:
            name, given, known = choice.groups()
            fix = nearest(given, re.findall(r"[\w.-]+", known))
            raise self._mistake(f"{name} cannot be `{given}`", fix)
        value = re.fullmatch(r"argument (.+): invalid _?(\w+) value: '(.*)'", message)
        if value:
            name, kind, given = value.groups()
            raise self._mistake(f"{name}: `{given}` is no {KINDS.get(kind, kind)}")
        missing = message.removeprefix("the following arguments are required: ")
        if missing != message:
            verb = "are" if "," in missing else "is"
            raise self._mistake(f"{missing} {verb} missing", self._usage() if missing != "COMMAND" else "")
        raise self._mistake(message.removeprefix("argument "))

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> tuple[Any, list[str]]:
        """As of ArgumentParser, but what nobody knows is a mistake of the command that it was given to."""
        found, unknown = super().parse_known_args(args, namespace)
        if unknown:
            raise self._unknown(unknown)
        return found, unknown

    def _unknown(self, words: Iterable[str]) -> UsageError:
        first, *_ = sorted(words, key=lambda word: not word.startswith("-"))
        option = first.partition("=")[0]
        if not first.startswith("-"):
            return self._mistake(f"`{first}` is one argument too many")
        return self._mistake(f"there is no option `{option}`", nearest(option, self._option_string_actions))

    def _usage(self) -> str:
        return " ".join(self.format_usage().split()[1:])

    def _mistake(self, message: str, fix: str = "") -> UsageError:
        return UsageError(f"{self.prog}: {message}", fix=fix or f"see `{self.prog} --help`")
