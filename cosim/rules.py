"""The rules and conditions that blocks state, judged on the values and wires of a diagram."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from cosim.block import Input, Parameter, Rule
from cosim.errors import Problems, RuleViolation
from cosim.network import Finding, Network, Slave


@dataclass(frozen=True)
class Source:
    """What a block's rule sees of the block at the other end of a wire."""

    block: str
    parameters: dict[str, np.ndarray]


def check(slaves: dict[str, Slave], names: Iterable[str], problems: Problems) -> None:
    """Judge the rules of the named slaves. Every RuleViolation goes to `problems`."""
    for name in names:
        slave = slaves[name]
        for rule in slave.declaration.rules:
            if rule.warning:
                continue
            for member in range(slave.count):
                holds, numbers = _judge(slaves, slave, rule, member)
                if not holds:
                    problems.add(_violation(slave, rule, numbers))
                    break


def conditions(network: Network) -> list[Finding]:
    """Every theorem's condition with its numbers, once for members that share them."""
    findings: dict[tuple[str, str, str], Finding] = {}
    for slave in network.slaves.values():
        for rule in slave.declaration.rules:
            for member in range(slave.count if rule.warning else 0):
                holds, numbers = _judge(network.slaves, slave, rule, member)
                finding = Finding(slave.name, rule.text, rule.source, holds, numbers)
                findings.setdefault((slave.name, rule.text, numbers), finding)
    return list(findings.values())


def _judge(slaves: dict[str, Slave], slave: Slave, rule: Rule, member: int) -> tuple[bool, str]:
    arguments = [_argument(slaves, slave, name, member) for name in rule.arguments]
    result = rule.function(*arguments)
    return result if isinstance(result, tuple) else (bool(result), "")


def _argument(slaves: dict[str, Slave], slave: Slave, name: str, member: int) -> Any:
    if name in slave.axes:
        return slave.axes[name].size
    variable = slave.declaration.variables[name]
    if isinstance(variable, Input):
        sources = slave.wires.get(name)
        if not sources:
            return None
        other = slaves[sources[0].slave]
        parameters = {v.name: other.values[v.name] for v in other.declaration.of(Parameter)}
        unmapped = {k: v if other.fleet else v[0] for k, v in parameters.items()}
        return Source(other.declaration.name, unmapped)
    value = slave.values[name]
    own = value[member if len(value) > 1 else 0]
    return own.item() if own.shape == () else own


def _violation(slave: Slave, rule: Rule, numbers: str) -> RuleViolation:
    nodes = [slave.entry.parameters[a] for a in rule.arguments if a in slave.entry.parameters]
    # What the command line sets is what was changed last.
    node = min(nodes, key=lambda n: n.position.line > 0, default=None)
    source = f" ({rule.source})" if rule.source else ""
    message = f"block {slave.name}: {slave.declaration.name} requires {rule.text}{source}"
    fix = f"change {', '.join(a for a in rule.arguments)}" + (f"; now {numbers}" if numbers else "")
    return RuleViolation(message, node.position if node else slave.entry.position, fix)
