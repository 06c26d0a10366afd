"""`cosim keys`: list what may be written in a diagram or a study."""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Iterator, Mapping
from pathlib import Path

from cosim.errors import UnknownKey, nearest
from cosim.language.keys import ANY, DIAGRAM, TYPES, Key
from cosim.terminal.screen import print_rows, say


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("section", nargs="?", default="", help="such as run or blocks; study.random of a study")
    help_ = "print a JSON Schema instead, with the blocks of the libraries and of the Python files here"
    parser.add_argument("--schema", choices=["diagram", "study"], help=help_)


def run(options: argparse.Namespace) -> int:
    """Print the keys of a section, or all, or their schema. Raises: UnknownKey."""
    if options.schema:
        from cosim.project import starting

        print(starting.schema_text(options.schema, Path()), end="")
        return 0
    known = sections()
    if options.section and options.section not in known:
        raise UnknownKey(f"there is no section `{options.section}`", fix=nearest(options.section, known))
    for name in [options.section] if options.section else known:
        say(f"{name}:")
        print_rows([row(key, declared) for key, declared in known[name].items()], indent="  ")
        if name == "study.variants":
            say("  and the sections of a diagram, which lie over those of the variant's")
        say("")
    return 0


def sections() -> dict[str, Mapping[str, Key]]:
    """The keys of every section of a diagram and of a study."""
    from cosim.plot.figures import PANEL
    from cosim.study.study_keys import BOUNDS, COLUMN, STUDY

    of_diagram = dict(_sections(DIAGRAM, ""))
    known = {"diagram": of_diagram.pop(""), **of_diagram, **dict(_sections(STUDY, "study"))}
    known |= {"study.random.accept.SIGNAL": BOUNDS, "study.tables.TITLE.columns.HEADING": COLUMN}
    known |= {"study.figures.NAME.panels": PANEL}
    return known


def _sections(keys: Mapping[str, Key], name: str) -> Iterator[tuple[str, Mapping[str, Key]]]:
    """The sections with keys of their own, the whole first. What lies over a diagram is told with the diagram."""
    own = {key: declared for key, declared in keys.items() if not (declared.layer and key in DIAGRAM)}
    yield name, own
    for key, declared in own.items():
        below = declared.below[ANY].below if ANY in declared.below else declared.below
        if below and ANY not in below:
            yield from _sections(below, f"{name}.{key}".strip("."))


def row(name: str, key: Key) -> list[str]:
    """The key, what may be written there, and what it says."""
    kind = key.type.words if key.type else _below(key)
    default = "" if key.default in (None, "", math.inf, -math.inf) else f"default {json.dumps(key.default)}"
    goes = "" if key.kinds == TYPES else f"goes with {', '.join(f'{kind}:' for kind in key.kinds)}"
    unit = f" ({key.unit})" if key.unit else ""
    return [name, kind + unit, "; ".join(part for part in (key.help, default, goes) if part)]


def _below(section: Key) -> str:
    """What stands below a section."""
    each = section.below[ANY].type if ANY in section.below else None
    return f"names, each with {each.words}" if each and each.words else "section"
