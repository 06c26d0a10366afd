"""The rules and conditions that blocks state, judged on the values and wires of a diagram."""

from __future__ import annotations

import itertools
import os
import reprlib
from collections.abc import Container, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cosim.authoring.rules import Course, Rule
from cosim.authoring.variables import Input, Parameter
from cosim.errors import CosimError, DeclarationError, Problems, RuleViolation
from cosim.machine import streams
from cosim.wiring.network import Component, Finding, Network, Signal


@dataclass(frozen=True)
class Source:
    """What a block's rule sees of the block at the other end of a wire, and through `inputs` of those before it.

    A constant in the place of a wire is seen as a block `Constant` without parameters.
    """

    block: str
    parameters: dict[str, np.ndarray]
    inputs: Mapping[str, Source] = field(default_factory=dict)
    members: int = 1


def check(
    components: dict[str, Component],
    names: Iterable[str],
    problems: Problems,
    changed: Container[Signal] | None = None,
) -> None:
    """Judge the rules of the named components, those that see only what is known, where other mistakes hide some of it.

    changed: what alone has changed since they were judged; None where they never were. Every RuleViolation, and the
    DeclarationError of a rule that is broken itself, goes to `problems`.
    """
    for name in names:
        component = components[name]
        for rule in component.declaration.rules:
            if rule.warning or (changed is not None and not _sees(component, rule, changed)):
                continue
            if _can_judge(components, component, rule):
                problems.attempt(_enforce, components, component, rule)


def _sees(component: Component, rule: Rule, changed: Container[Signal]) -> bool:
    """Whether a rule may see something of what has changed; through an input it sees other blocks."""
    variables = component.declaration.variables
    return any(
        Signal(component.name, name) in changed or isinstance(variables.get(name), Input) for name in rule.arguments
    )


def _enforce(components: dict[str, Component], component: Component, rule: Rule) -> None:
    for member, _ in _told_apart(component, rule):
        holds, numbers = _judge(components, component, rule, member, {})
        if not holds:
            raise _violation(component, rule, numbers)


def _told_apart(component: Component, rule: Rule) -> list[tuple[int, int]]:
    """Members whose values a rule can tell apart: the first of each such kind, rising, and how many are of it."""
    values = [component.values[name] for name in rule.arguments if name in component.values]
    own = [value for value in values if len(value) > 1]
    if not own:
        return [(0, component.count)]
    if any(value.dtype.hasobject for value in own):
        return [(member, 1) for member in range(component.count)]
    flat = [np.ascontiguousarray(value).reshape(component.count, -1).view(np.uint8) for value in own]
    rows = np.concatenate(flat, axis=1)
    _, firsts, counts = np.unique(rows.view(f"V{rows.shape[1]}"), return_index=True, return_counts=True)
    return sorted(zip(firsts.tolist(), counts.tolist(), strict=True))


def _can_judge(components: dict[str, Component], component: Component, rule: Rule) -> bool:
    """Whether all that a rule may see is known; one that names an input may see any block before its own."""
    variables = component.declaration.variables
    if any(isinstance(variables.get(name), Input) for name in rule.arguments):
        wires = [source for other in components.values() for sources in other.wires.values() for source in sources]
        return all(source.variable for source in wires) and all(
            v.name in other.values for other in components.values() for v in other.declaration.of(Parameter)
        )
    return all(name in component.axes or name in component.values for name in rule.arguments)


def conditions(network: Network) -> list[Finding]:
    """Every theorem's condition that can be judged before a run, with its numbers."""
    return [
        finding
        for component in network.components.values()
        for rule in component.declaration.rules
        if rule.warning and not component.declaration.along(rule)
        for finding in _findings(network, component, rule, {})
    ]


def along(network: Network) -> list[tuple[Component, Rule, tuple[Signal, ...]]]:
    """The conditions that are judged after a run, with the signals whose courses they need."""
    return [
        (component, rule, tuple(Signal(component.name, name) for name in component.declaration.along(rule)))
        for component in network.components.values()
        for rule in component.declaration.rules
        if rule.warning and component.declaration.along(rule)
    ]


def judge_run(network: Network, courses: Mapping[Signal, list[Course]]) -> list[Finding]:
    """The conditions that name what their block computes, judged on its members' courses along a run.

    A function that raises leaves the others, and the run's figures, as they are.
    """
    findings: list[Finding] = []
    for component, rule, signals in along(network):
        try:
            findings += _findings(network, component, rule, {s.variable: courses[s] for s in signals})
        except Exception as error:  # noqa: BLE001  # whatever a condition's function raises
            cause = error.__cause__ or error
            text = f"cannot be judged: {type(cause).__name__}: {cause}"
            findings.append(Finding(component.name, rule.text, rule.source, False, text))
    return findings


def as_warning(network: Network, finding: Finding) -> CosimError:
    """A condition that fails, as a warning at its block's place."""
    return CosimError(finding.summary, network.components[finding.component].entry.position)


def _findings(
    network: Network, component: Component, rule: Rule, courses: Mapping[str, list[Course]]
) -> Iterator[Finding]:
    """One finding for each verdict that members share, with the numbers of the first of them."""
    verdicts: dict[bool | None, list[tuple[int, int, str]]] = {}
    alone = [(member, 1) for member in range(component.count)]
    for member, count in alone if courses else _told_apart(component, rule):
        known: dict[str, Any] = {name: course[member] for name, course in courses.items()}
        settings = {"stop": network.diagram.run.stop, "method": network.diagram.run.method}
        known |= {name: value for name, value in settings.items() if name not in component.declaration.variables}
        holds, numbers = _judge(network.components, component, rule, member, known)
        verdicts.setdefault(holds, []).append((member, count, numbers))
    for holds, members in verdicts.items():
        member, _, numbers = members[0]
        if len({text for _, _, text in members}) > 1 or len(verdicts) > 1:
            others = sum(count for _, count, _ in members) - 1
            more = f" and {others} more" if others else ""
            numbers = f"{component.fleet} {member + 1}{more}: {numbers}"
        yield Finding(component.name, rule.text, rule.source, holds, numbers)


def _judge(
    components: dict[str, Component], component: Component, rule: Rule, member: int, known: Mapping[str, Any]
) -> tuple[bool | None, str]:
    """Whether a rule holds, None where nobody can say, and its numbers. Raises: DeclarationError.

    Where several blocks are joined for an input that it names, it holds if it holds for each of them.
    """
    choices = [_arguments(components, component, name, member, known) for name in rule.arguments]
    verdicts = [_verdict(component, rule, arguments) for arguments in itertools.product(*choices)]
    return next((v for doubt in (False, None) for v in verdicts if v[0] is doubt), verdicts[0])


def _verdict(component: Component, rule: Rule, arguments: Iterable[Any]) -> tuple[bool | None, str]:
    try:
        with streams.aside():
            answer = rule.function(*arguments)
        return _read(rule, answer)
    except _SeveralSources as several:
        return None, str(several)
    except KeyboardInterrupt as stopped:  # it may never end, and then nobody else knows where it is
        stopped.add_note(f"while block {component.name} judged the {_described(component, rule)}{_place(rule)}")
        raise
    except Exception as error:
        fix = f"correct its function{_place(rule)}; it returns whether it holds, or that and a text"
        message = f"block {component.name}: the {_described(component, rule)} cannot be judged: "
        raise DeclarationError(f"{message}{type(error).__name__}: {error}", component.entry.position, fix) from error


def _read(rule: Rule, result: Any) -> tuple[bool | None, str]:
    """What a rule's function returns, as a verdict and its numbers. Raises: TypeError where it is none.

    Nothing else counts as true or false: what an author forgot to compare would hold.
    """
    holds, numbers = result if isinstance(result, tuple) and len(result) == 2 else (result, "")
    if isinstance(holds, bool | np.bool_) and isinstance(numbers, str):
        return bool(holds), numbers
    if holds is None and isinstance(numbers, str) and rule.warning:
        return None, numbers
    raise TypeError(f"it returned {' '.join(reprlib.repr(result).split())}, of type {type(result).__name__}")


def _described(component: Component, rule: Rule) -> str:
    return f"{'condition' if rule.warning else 'rule'} `{rule.text}` of {component.declaration.name}"


def _place(rule: Rule) -> str:
    code = getattr(rule.function, "__code__", None)
    return f" at {os.path.relpath(code.co_filename)}:{code.co_firstlineno}" if code else ""


def _arguments(
    components: dict[str, Component], component: Component, name: str, member: int, known: Mapping[str, Any]
) -> list[Any]:
    """What a rule's function names: for an input, each block that is joined for it.

    known: what is no value of the diagram, the run's settings and its courses.
    """
    if name in component.axes:
        return [component.axes[name].size]
    if name in known:
        return [known[name]]
    if isinstance(component.declaration.variables[name], Input):
        if name in component.entry.constants:
            return [Source("Constant", {})]
        return [_source(components, source) for source in _first_of_each(component.wires.get(name, ()))] or [None]
    value = component.values[name]
    own = value[member if len(value) > 1 else 0]
    return [own.item() if own.shape == () else own]


def _first_of_each(sources: Iterable[Signal]) -> list[Signal]:
    """One signal for each block that is wired to an input."""
    return list({source.component: source for source in reversed(list(sources))}.values())[::-1]


def _source(components: dict[str, Component], signal: Signal) -> Source:
    component = components[signal.component]
    parameters = {v.name: component.values[v.name] for v in component.declaration.of(Parameter)}
    unmapped = {k: v if component.fleet else v[0] for k, v in parameters.items()}
    return Source(component.declaration.name, unmapped, _Sources(components, component), component.count)


class _SeveralSources(Exception):
    """One block before a block is asked for where there are several."""


class _Sources(Mapping[str, Source]):
    """The blocks before a block, found when they are asked for, as wires may run in rings."""

    def __init__(self, components: dict[str, Component], component: Component) -> None:
        self._components = components
        self._name = component.name
        self._wires = {name: _first_of_each(sources) for name, sources in component.wires.items() if sources}

    def __getitem__(self, name: str) -> Source:
        first, *others = self._wires[name]
        if others:
            raise _SeveralSources(f"input `{name}` of {self._name} joins several blocks")
        return _source(self._components, first)

    def __iter__(self) -> Iterator[str]:
        return iter(self._wires)

    def __len__(self) -> int:
        return len(self._wires)


def _violation(component: Component, rule: Rule, numbers: str) -> RuleViolation:
    """The error at a value that the rule names; where the diagram gives several, nobody knows which one is wrong."""
    nodes = {name: component.entry.parameters[name] for name in rule.arguments if name in component.entry.parameters}
    # What the command line sets is what was changed last.
    node = min(nodes.values(), key=lambda n: n.position.line > 0, default=None)
    source = f" ({rule.source})" if rule.source else ""
    message = f"block {component.name}: {component.declaration.name} requires {rule.text}{source}"
    places = {name: f" ({n.position})" for name, n in nodes.items()} if len(nodes) > 1 else {}
    names = ", ".join(f"{name}{places.get(name, '')}" for name in rule.arguments)
    fix = f"change {names}" + (f"; now {numbers}" if numbers else "")
    return RuleViolation(message, node.position if node else component.entry.position, fix)
