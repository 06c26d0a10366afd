"""What `cosim check` says of a diagram, and `cosim blocks` of the library, in the terminal."""

from __future__ import annotations

import re
import sys

from cosim import library, order, rules, windows
from cosim.block import Block, Declaration, Parameter, State, Variable
from cosim.entry import BlockEntry
from cosim.errors import Position
from cosim.network import Network, Slave
from cosim.source import Node
from cosim.terminal import TIED, print_rows, print_warnings, print_wrapped, say

VERDICTS = {True: "holds", False: "FAILS", None: "open "}
TEXT_COLUMN = 9


def print_network(network: Network) -> None:
    """The slaves in the order of their evaluation, their shapes and wires, and every condition with its numbers."""
    run = network.diagram.run
    _, warnings = windows.reduced(network)
    valid = "valid as far as can be told without their code" if network.unchecked else "valid"
    say(f"{network.diagram.title or network.diagram.path.name}: {len(network.diagram.blocks)} blocks, {valid}")
    say(f"{run.method}, {run.stop:g} s in {run.steps} steps of {run.step:g} s")
    if run.method != "joint" and _higher_order(network):
        say("inputs are held over a step: coupling is of first order, whatever the integrators' order")
    say("")
    for swap in network.swaps:
        say(str(swap))
    if network.swaps:
        say("")
    print_rows([_slave_row(network, slave) for slave in network.slaves.values()])
    say("")
    if network.unchecked:
        files = [f"{name} ({network.diagram.blocks[name].path})" for name in network.unchecked]
        print_wrapped(f"not checked, as only their code tells what they are: {', '.join(files)}", 2)
        say("nor what is wired to them, the order of evaluation, and conditions")
        return
    shown = [f"{t.slave}.{t.function}" for t in order.evaluation_order(network) if t.function]
    print_wrapped(f"evaluated in this order: {', '.join(shown)}", 2)
    findings = rules.conditions(network)
    along = rules.along(network)
    if findings or along:
        say("\nconditions:")
    for finding in findings:
        print_wrapped(f"  {VERDICTS[finding.holds]}  {finding.summary}", TEXT_COLUMN)
    for slave, rule, _ in along:
        said = f"{slave.name}: {rule.source or 'condition'}, {rule.text}: `cosim run` judges it"
        print_wrapped(f"  run    {said}", TEXT_COLUMN)
    sys.stdout.flush()
    broken = [rules.as_warning(network, finding) for finding in findings if finding.holds is False]
    print_warnings([*warnings, *broken])


def _higher_order(network: Network) -> bool:
    """Whether a block that reads others is integrated by a method of an order above one."""
    return any(s.method != "euler" and s.wires and s.declaration.continuous() for s in network.slaves.values())


def _slave_row(network: Network, slave: Slave) -> list[str]:
    wires = [
        f"{port}{TIED}←{TIED}{', '.join(map(str, sources))}{_dealt(network, slave, port)}"
        for port, sources in slave.wires.items()
    ]
    count = f"{slave.count} × {slave.declaration.name}" if slave.fleet else slave.declaration.name
    return [slave.name, count, "; ".join(wires)]


def _dealt(network: Network, slave: Slave, port: str) -> str:
    """A word where the members of a fleet get one element each of something else than that fleet's own signal."""
    axes = [network.axes(source) for source in slave.wires[port]]
    dealt = slave.fleet and max(map(len, axes)) > len(slave.declaration.variables[port].shape)
    fleets = dict.fromkeys(own[0].fleet for own in axes if own)
    if not dealt or slave.fleet in fleets:
        return ""
    others = [f"of the fleet {fleet}" for fleet in fleets if fleet]
    return f" (one{TIED}each{''.join(f' {other}' for other in others)})"


def print_blocks(name: str | None) -> None:
    """All blocks with a line each, or everything about one. Raises: UnknownBlock."""
    if name is None:
        blocks = library.all_blocks()
        print_rows([[n, _first_line(b.declaration)] for n, b in sorted(blocks.items())])
        say("\n`cosim blocks NAME` shows one block's ports, parameters and equations.")
        return
    declaration = _block(name).declaration
    say(f"{declaration.name}\n\n{declaration.doc}\n")
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
        print_rows([[n, f"default {d.default}", d.description] for n, d in declaration.dimensions.items()], indent="  ")
        say("")
    for rule in declaration.rules:
        say(f"{'condition' if rule.warning else 'rule'}: {rule.text}{f' ({rule.source})' if rule.source else ''}")


def _block(name: str) -> type[Block]:
    place = Position(name)
    return library.find(BlockEntry(name, "python" if ".py:" in name else "block", Node(name, place), place))


def _variable_row(declaration: Declaration, variable: Variable) -> list[str]:
    shape = f"[{', '.join(map(str, variable.shape))}]" if variable.shape else ""
    unit = ", ".join(variable.unit) if isinstance(variable.unit, tuple) else variable.unit or ""
    notes = [variable.description]
    if isinstance(variable, Parameter):
        notes.append("required" if variable.start is None else f"default {variable.start}")
    if only := getattr(variable, "only", ""):
        notes.append(f"takes ports called `{only}`")
    if variable.causality == "output":
        notes.append(_feedthrough(declaration, variable))
    kind = "" if variable.dtype == float else variable.dtype.name
    return [f"{variable.name}{shape}", unit, kind, "; ".join(n for n in notes if n)]


def _feedthrough(declaration: Declaration, variable: Variable) -> str:
    """What an output depends on at the same instant, in words."""
    if isinstance(variable, State):
        return "a state"
    reached: set[str] = set()
    waiting = [variable.name]
    while waiting:
        writer = declaration.writer(waiting.pop())
        for name in writer.reads if writer else ():
            if name not in reached:
                reached.add(name)
                waiting.append(name)
    inputs = [n for n in declaration.variables if n in reached and declaration.variables[n].causality == "input"]
    return f"direct feedthrough from {', '.join(inputs)}" if inputs else "no direct feedthrough"


def _first_line(declaration: Declaration) -> str:
    return re.split(r"\n\s*\n", declaration.doc)[0].replace("\n", " ") if declaration.doc else ""
