"""What `cosim check` says of a diagram, and `cosim blocks` of the library, in the terminal."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Mapping

from cosim.authoring.author_source import shown
from cosim.authoring.block import Block
from cosim.authoring.declaration import Declaration
from cosim.authoring.variables import Dimension, Variable, shape_text
from cosim.errors import Position
from cosim.language.entry import BlockEntry
from cosim.language.source import Node
from cosim.terminal.profile_display import print_fleets
from cosim.terminal.screen import TIED, print_rows, print_warnings, print_wrapped, say
from cosim.wiring import library, variable_words
from cosim.wiring.network import Network
from cosim.wiring.overview import ComponentOverview, Overview, Wired, describe

VERDICTS = {True: "holds", False: "FAILS", None: "open "}
TEXT_COLUMN = 9


def print_network(network: Network, fleets: Mapping[str, str]) -> None:
    """The components in the order of their evaluation, their shapes and wires, and every condition with its numbers.

    fleets: by function of a fleet, why it is done for one member after the other; "" if it is not.
    """
    overview = describe(network)
    run, title = overview.diagram.run, overview.diagram.title or overview.diagram.path.name
    valid = "valid as far as can be told without their code" if overview.unchecked else "valid"
    say(f"{title}: {len(overview.diagram.blocks)} blocks, {valid}")
    say(f"{run.method}, {run.stop:g} s in {run.steps} steps of {run.step:g} s")
    if overview.first_order:
        say("inputs are held over a step: coupling is of first order, whatever the integrators' order")
    say("")
    for swap in overview.swaps:
        say(str(swap))
    if overview.swaps:
        say("")
    print_rows([_row(part) for part in overview.parts])
    say("")
    if overview.unchecked:
        files = [f"{name} ({path})" for name, path in overview.unchecked.items()]
        print_wrapped(f"not checked, as only their code tells what they are: {', '.join(files)}", 2)
        say("nor what is wired to them, the order of evaluation, and conditions")
        return
    print_wrapped(f"evaluated in this order: {', '.join(overview.order)}", 2)
    if due := [f"{part.name} {part.due}" for part in overview.parts if part.due]:
        print_wrapped(f"sampled, and held between: {', '.join(due)}", 2)
    if overview.turns:
        print_wrapped(f"turns are taken in this order: {', '.join(overview.turns)}", 2)
    for ring in overview.loops:
        by = f", by directional derivatives of {', '.join(ring.derived)}" if ring.derived else ""
        when = " at initialization" if ring.first else ""
        print_wrapped(f"an algebraic loop{when}, solved for {', '.join(ring.torn)}{by}: {', '.join(ring.tasks)}", 2)
    print_fleets(fleets)
    _print_conditions(overview)
    if overview.requirements:
        say("\nrequirements, which a run judges:")
        print_rows([[name, formula] for name, formula in overview.requirements.items()], indent="  ")
    sys.stdout.flush()
    print_warnings(overview.warnings)


def _print_conditions(overview: Overview) -> None:
    if overview.findings or overview.open:
        say("\nconditions:")
    for finding in overview.findings:
        print_wrapped(f"  {VERDICTS[finding.holds]}  {finding.summary}", TEXT_COLUMN)
    for waiting in overview.open:
        said = f"{waiting.component}: {waiting.source or 'condition'}, {waiting.text}: `cosim run` judges it"
        print_wrapped(f"  run    {said}", TEXT_COLUMN)


def _row(part: ComponentOverview) -> list[str]:
    wires = [
        f"{w.port}{TIED}={TIED}{w.constant}"
        if w.constant
        else f"{w.port}{TIED}←{TIED}{', '.join(w.sources)}{_dealt(w)}"
        for w in part.wires
    ]
    kind = part.type if part.count is None else f"{part.count} × {part.type}"
    return [part.name, kind, "; ".join([*part.expressions, *wires])]


def _dealt(wire: Wired) -> str:
    """A word where the members of a fleet get one element each of something else than that fleet's own signal."""
    others = [f"of the fleet {fleet}" for fleet in wire.dealt if fleet]
    return f" (one{TIED}each{''.join(f' {other}' for other in others)})" if wire.dealt else ""


def print_block(name: str) -> None:
    """Everything about one block type. Raises: UnknownBlock, AmbiguousBlock, and of its file whatever that raises."""
    block = _block(name)
    declaration = block.declaration
    say(f"{declaration.name}\n")
    for paragraph in declaration.doc.split("\n\n"):
        _print_paragraph(paragraph)
    file, key = inspect.getsourcefile(block) or "", "python" if ".py:" in name else "block"
    say(f"in {shown(file)}")
    say(f"a diagram writes  {key}: {name}")
    say("")
    for title, causality in (
        ("inputs", "input"),
        ("outputs", "output"),
        ("parameters", "parameter"),
        ("locals", "local"),
    ):
        variables = [v for v in declaration.variables.values() if v.causality == causality]
        if variables:
            say(f"{title}:")
            print_rows([_variable_row(declaration, v) for v in variables], indent="  ")
            say("")
    if declaration.dimensions:
        say("dimensions:")
        print_rows([[n, _size(d), d.description] for n, d in declaration.dimensions.items()], indent="  ")
        say("")
    for rule in declaration.rules:
        source = f" ({rule.source})" if rule.source else ""
        print_wrapped(f"{'condition' if rule.warning else 'rule'}: {rule.text}{source}", 2)


def _print_paragraph(text: str) -> None:
    """Words are broken where the line ends; equations and lists stay as they are written."""
    if any(line.startswith((" ", "-", "::")) for line in text.splitlines()):
        say(text)
    else:
        print_wrapped(" ".join(text.split()), 0)
    say("")


def _size(dimension: Dimension) -> str:
    sign = "-" if dimension.less > 0 else "+"
    return f"{dimension.of} {sign} {abs(dimension.less)}" if dimension.of else f"default {dimension.default}"


def _block(name: str) -> type[Block]:
    place = Position(name)
    return library.find(BlockEntry(name, "python" if ".py:" in name else "block", Node(name, place), place))


def _variable_row(declaration: Declaration, variable: Variable) -> list[str]:
    kind = "" if variable.dtype == float else variable.dtype.name
    notes = "; ".join(variable_words.notes(declaration, variable))
    return [f"{variable.name}{shape_text(variable.shape)}", variable_words.unit(variable), kind, notes]
