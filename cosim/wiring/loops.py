"""Algebraic loops: tasks that depend on each other at one instant, grouped, torn, and put in order.

A loop is solved as a whole: the values of its torn signals are guessed, its tasks are done in order, and the guess is
right where they give the same values again. Those signals are torn to which the diagram gives a start value, else few
and small ones, as each of their numbers is an unknown.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Hashable, Iterable, Mapping, Sequence
from graphlib import CycleError, TopologicalSorter
from typing import TypeVar

import numpy as np

from cosim.authoring.variables import State
from cosim.errors import AlgebraicLoop
from cosim.wiring.network import Loop, Network, Signal, Task

Node = TypeVar("Node", bound=Hashable)
#: Of every task, what has to be done before it, and by which variable it is read.
Graph = dict[Task, dict[Task, str]]


def groups(graph: Mapping[Node, Collection[Node]]) -> list[list[Node]]:
    """The strongly connected components of a graph, what comes before others first: Tarjan's algorithm.

    Their nodes, and they among themselves, stand in an order that follows from the graph's alone.
    """
    number: dict[Node, int] = {}
    lowest: dict[Node, int] = {}
    height: dict[Node, int] = {}
    stack: list[Node] = []
    inside: set[Node] = set()
    found = []
    for root in graph:
        waiting = [(root, iter(graph[root]))] if root not in number else []
        while waiting:
            node, before = waiting[-1]
            if node not in number:
                number[node] = lowest[node] = len(number)
                height[node] = len(stack)
                stack.append(node)
                inside.add(node)
            new = next((other for other in before if other not in number), None)
            if new is not None:
                waiting.append((new, iter(graph[new])))
                continue
            waiting.pop()
            known = [lowest[other] for other in graph[node] if other in inside]
            lowest[node] = min([lowest[node], *known])
            if lowest[node] == number[node]:
                first = height[node]
                found.append(stack[first:])
                inside -= {*stack[first:]}
                del stack[first:]
    return found


def is_loop(part: Sequence[Task], graph: Graph) -> bool:
    """Whether a component is more than one task that depends on others."""
    return len(part) > 1 or part[0] in graph[part[0]]


def torn(network: Network, part: Sequence[Task], graph: Graph) -> Loop:
    """A component as a loop in order. Raises: AlgebraicLoop where what would be guessed is no real number."""
    place = {name: k for k, name in enumerate(network.components)}
    tasks = sorted(part, key=lambda task: (place[task.component], task.function, task.port))
    members = {*part}
    inside = {task: {other: name for other, name in graph[task].items() if other in members} for task in tasks}
    read = {signal for task in tasks for signal in network.read(task)}
    signals = {task: [signal for signal in network.written(task) if signal in read] for task in tasks}
    costs = {task: _cost(network, task, signals[task], place) for task in tasks}
    cut: dict[Task, None] = {}
    left = inside
    while cyclic := [found for found in groups(left) if is_loop(found, left)]:
        cut |= dict.fromkeys(min(found, key=lambda task: costs[task]) for found in cyclic)
        left = {task: {other: name for other, name in inside[task].items() if other not in cut} for task in tasks}
    unknowns = tuple(signal for task in cut for signal in signals[task])
    _refuse_whole_numbers(network, unknowns, inside)
    return Loop(tuple(TopologicalSorter(left).static_order()), unknowns)


def systems(network: Network, loop: Loop) -> tuple[int, int]:
    """How many systems of equations a loop is that do not depend on each other, and how many unknowns each has.

    A fleet whose members each read their own member is as many systems as it has members.
    """
    numbers = sum(math.prod(network.shape(signal)) for signal in loop.torn)
    members = network.components[loop.torn[0].component].count if _is_memberwise(network, loop) else 1
    return members, numbers // members


def bits(network: Network, loop: Loop) -> int:
    """The bits, behind the leading one, of the coarsest real numbers that are handed on around a loop."""
    read = {signal for task in loop.tasks for signal in network.read(task)}
    handed = {*loop.torn, *(signal for task in loop.tasks for signal in network.written(task) if signal in read)}
    types = {network.variable(signal).dtype for signal in handed}
    return min(int(np.finfo(dtype).nmant) for dtype in types if dtype.kind == "f")


def derived(network: Network, loop: Loop) -> list[str]:
    """The blocks of a loop whose part in its equations follows from directional derivatives that they give."""
    found: dict[str, None] = {}
    for task in loop.tasks:
        component = network.components[task.component]
        foreign = component.declaration.foreign
        if task.function and foreign and foreign.derives(component, network.function(task)):
            found[component.name] = None
    return [*found]


def _is_memberwise(network: Network, loop: Loop) -> bool:
    """Whether each member of a fleet depends on itself alone."""
    parts = {task.component for task in loop.tasks}
    fleets = {network.components[name].fleet for name in parts}
    if len(fleets) > 1 or None in fleets:
        return False
    names = {(t.component, n) for t in loop.tasks for n in (network.function(t).reads if t.function else (t.port,))}
    return all(
        _is_own(network, Signal(component, name), source)
        for component, name in names
        for source in network.components[component].wires.get(name, ())
        if source.component in parts
    )


def _is_own(network: Network, port: Signal, source: Signal) -> bool:
    """Whether each member reads that of a source which is its own, and nothing else."""
    component = network.components[port.component]
    whole = source.members is None and not isinstance(component.entry.inputs[port.variable].value, list)
    return whole and len(network.shape(source)) == len(component.shape(network.variable(port))) + 1


def _cost(
    network: Network, task: Task, signals: Iterable[Signal], place: Mapping[str, int]
) -> tuple[bool, bool, tuple[bool, int], bool, int, str]:
    """What is worse to guess: what is held, what nobody has guessed, what is large, and what is only joined."""
    held = network.is_held(task)
    weight = _weight(network, signals)
    guessed = _is_guessed(network, signals)
    return held, not guessed, weight, not task.function, place[task.component], task.function


def _is_guessed(network: Network, signals: Iterable[Signal]) -> bool:
    """Whether the diagram says where to begin."""
    return any(signal.variable in network.components[signal.component].given for signal in signals)


def _weight(network: Network, signals: Iterable[Signal]) -> tuple[bool, int]:
    """How costly it is to guess signals: those that are no real numbers last, then by their axes."""
    variables = [network.variable(signal) for signal in signals]
    return any(v.dtype != np.float64 for v in variables), sum(1 + len(v.shape) for v in variables)


def _refuse_whole_numbers(network: Network, unknowns: Iterable[Signal], inside: Graph) -> None:
    wrong = [signal for signal in unknowns if network.variable(signal).dtype != np.float64]
    starts = [task for task in inside if _is_start(network, task)]
    if not wrong and not starts:
        return
    cycle = _cycle(inside)
    ports = [f"{before.component}.{name}" for before, name in cycle]
    first = network.components[cycle[0][0].component]
    inputs = [node for component in network.components.values() for node in component.entry.inputs.values()]
    position = next((node.position for node in inputs if node.value in ports), first.entry.position)
    text = " → ".join([*ports, ports[0]])
    if starts:  # at time zero only: where a run goes on, these are states
        states = [f"blocks.{task.component}.start.{name}" for task in starts for name in _set_by(task, inside)]
        fix = f"give a start value: {' or '.join(states)}"
        raise AlgebraicLoop(f"algebraic loop at initialization: {text}", position, fix)
    kind = network.variable(wrong[0]).dtype
    message = f"algebraic loop: {text}, in which `{wrong[0]}` is {kind}: only real numbers can be solved for"
    raise AlgebraicLoop(message, position, "let one of these blocks read a state instead, or sample it")


def _set_by(task: Task, inside: Graph) -> list[str]:
    """The states that a start function sets and that others in a loop read."""
    return sorted({name for before in inside.values() for other, name in before.items() if other == task})


def _cycle(inside: Graph) -> list[tuple[Task, str]]:
    """One cycle of a loop: each task with its variable that the next one reads."""
    try:
        TopologicalSorter(inside).prepare()
    except CycleError as error:
        tasks = error.args[1][:-1]  # graphlib names each before what depends on it
        return [(task, inside[after][task]) for task, after in zip(tasks, [*tasks[1:], tasks[0]], strict=True)]
    raise AssertionError(inside)


def _is_start(network: Network, task: Task) -> bool:
    if not task.function or network.function(task).kind != "start":
        return False
    return any(isinstance(network.variable(signal), State) for signal in network.written(task))
