"""The pages of the reference that come from declarations: every key, every block, every command."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator
from html import escape
from importlib import import_module
from pathlib import Path

import block_drawing

from cosim.authoring.block import Block
from cosim.authoring.variables import Parameter, Variable
from cosim.terminal import cli
from cosim.terminal.commands import keys
from cosim.wiring import library, limits

KINDS = (("input", "Inputs"), ("output", "Outputs"), ("parameter", "Parameters"), ("local", "States and locals"))


def write(folder: Path) -> None:
    """Write the pages to a folder, those that have changed only."""
    folder.mkdir(exist_ok=True)
    pages = {"keys.md": _keys(), "commands.md": _commands(), "blocks.md": _blocks()}
    for name, lines in pages.items():
        text = "\n".join(lines) + "\n"
        path = folder / name
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


# ---- keys ----


def _keys() -> Iterator[str]:
    yield "# Every key of a diagram and of a study\n"
    yield "As `cosim keys` prints them, from the declarations by which files are read.\n"
    for name, section in keys.sections().items():
        yield f"## `{name}`\n"
        yield from _table(("key", "value", "what it says"), (keys.row(key, k) for key, k in section.items()))


# ---- commands ----


def _commands() -> Iterator[str]:
    yield "# Every command\n"
    for name, text in cli.COMMANDS.items():
        command = argparse.ArgumentParser(prog=f"cosim {name}")
        import_module(f"cosim.terminal.commands.{name}").arguments(command)
        yield f"## `cosim {name}`\n"
        yield f"{text[0].upper()}{text[1:]}.\n"
        yield from ("```text", command.format_usage().strip(), "```\n")
        told = [a for a in command._actions if a.help and a.help != argparse.SUPPRESS]
        rows = [(f"`{_invocation(a)}`", escape(str(a.help) % {"default": a.default}, quote=False)) for a in told]
        yield from _table(("argument", "meaning"), rows)


def _invocation(action: argparse.Action) -> str:
    value = action.metavar or (action.dest.upper() if action.option_strings else action.dest)
    if not action.option_strings:
        return str(value)
    return ", ".join(action.option_strings) + ("" if action.nargs == 0 else f" {value}")


# ---- blocks ----


def _blocks() -> Iterator[str]:
    yield "# Every block of the library\n"
    yield "As `cosim blocks NAME` shows them, from the declarations in `blocks/`, by file.\n"
    files: dict[str, list[type[Block]]] = {}
    for block in library.all_blocks().values():
        files.setdefault(block.__module__.rpartition(".")[2], []).append(block)
    for file in sorted(files):
        yield f"## {file.replace('_', ' ').capitalize()}\n"
        for block in files[file]:
            yield from _block(block)


def _block(block: type[Block]) -> Iterator[str]:
    declaration = block.declaration
    yield f"### {declaration.name}\n"
    summary, _, rest = declaration.doc.partition("\n\n")
    yield from (f"{summary}\n", f"{block_drawing.svg(declaration)}\n")
    yield from _text(rest)
    for causality, title in KINDS:
        variables = [v for v in declaration.variables.values() if v.causality == causality]
        if variables:
            yield from _table((title.lower(), "shape, unit", "meaning"), map(_variable, variables))
    for rule in declaration.rules:
        source = f" ({rule.source})" if rule.source else ""
        yield f"- {'Condition' if rule.warning else 'Rule'}: {rule.text}{source}"
    if declaration.rules:
        yield ""


def _text(doc: str) -> Iterator[str]:
    """A docstring whose indented paragraphs after `::` are equations."""
    inside = False
    for line in doc.splitlines():
        if inside and line and not line.startswith(" "):
            inside = False
            yield "```\n"
        if line.strip() == "::":
            continue
        if not inside and line.startswith("    "):
            inside = True
            yield "```text"
        yield line[4:] if inside else line.replace("::", ":")
    yield "```\n" if inside else ""


def _variable(variable: Variable) -> tuple[str, str, str]:
    shape = f"[{', '.join(map(str, variable.shape))}]" if variable.shape else "scalar"
    unit = ", ".join(variable.unit) if isinstance(variable.unit, tuple) else variable.unit or ""
    notes = [variable.description]
    if isinstance(variable, Parameter):
        notes.append("required" if variable.start is None else f"default `{variable.start}`")
    notes.append(limits.words(variable))
    return f"`{variable.name}`", ", ".join(filter(None, (shape, unit))), "; ".join(filter(None, notes))


# ---- Markdown ----


def _table(heading: Iterable[str], rows: Iterable[Iterable[str]]) -> Iterator[str]:
    heading = list(heading)
    yield f"| {' | '.join(heading)} |"
    yield "|" + " --- |" * len(heading)
    for row in rows:
        yield f"| {' | '.join(cell.replace('|', chr(92) + '|').replace(chr(10), ' ') for cell in row)} |"
    yield ""
