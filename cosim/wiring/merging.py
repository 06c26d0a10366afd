"""Outputs of a foreign block that can be got together: an FMU is asked once, and not once for each of its outputs.

A foreign block has a function for each set of inputs that outputs depend on. Those are made one that do not wait for
each other. They are found by going through an order of evaluation in which a foreign block waits as long as anything
else can be done: what is ready of it then is done at once.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

from cosim.authoring.declaration import Function
from cosim.wiring import loops, order
from cosim.wiring.network import Component, Network, Task


def merge(network: Network) -> None:
    """Have fewer functions in the declarations of foreign blocks, each of which belongs to one block alone."""
    components = {name for name, c in network.components.items() if _can_merge(network, c)}
    for tasks in _together(network, components) if components else ():
        declaration = network.components[tasks[0].component].declaration
        merged = _merged([network.function(task) for task in tasks])
        gone = {task.function for task in tasks}
        left = [f for f in declaration.functions if f.name not in gone]
        declaration.functions = (merged, *left)


def _can_merge(network: Network, component: Component) -> bool:
    """Whether a block has several such functions. Under Gauss-Seidel turns depend on which of them reads an input."""
    several = bool(component.declaration.foreign) and len(component.declaration.kind("outputs")) > 1
    return several and network.diagram.run.method != "gauss-seidel"


def _together(network: Network, components: set[str]) -> Iterator[Sequence[Task]]:
    """Several tasks of one of these blocks each, that wait for nothing of each other."""
    graph = order.graph_of(network, starts=False)
    parts = loops.groups(graph)
    part_of = {task: k for k, part in enumerate(parts) for task in part}
    before = [{part_of[other] for task in part for other in graph[task]} - {k} for k, part in enumerate(parts)]
    owners = [_owner(part, graph, components) for part in parts]
    for done in _batches(before, owners, [name for name in network.components if name in components]):
        if len(done) > 1:
            yield [parts[k][0] for k in sorted(done)]


def _owner(part: Sequence[Task], graph: loops.Graph, components: set[str]) -> str:
    """The block whose functions may be merged that a part of the order is one of; "" for none."""
    task = part[0]
    return task.component if task.component in components and task.function and not loops.is_loop(part, graph) else ""


def _batches(before: Sequence[set[int]], owners: Sequence[str], names: Sequence[str]) -> Iterator[list[int]]:
    """Numbers of what is done together, in an order; before: of each, what comes first. names: of owners, in order."""
    after: list[list[int]] = [[] for _ in before]
    for k, earlier in enumerate(before):
        for other in earlier:
            after[other].append(k)
    missing, left = [len(earlier) for earlier in before], Counter(owners)
    ready: dict[str, list[int]] = {}
    todo = [k for k, count in enumerate(missing) if not count]
    while todo or ready:
        if todo and owners[todo[-1]]:
            k = todo.pop()
            ready.setdefault(owners[k], []).append(k)
            continue
        name = "" if todo else _next(ready, left, names)
        done = ready.pop(name) if name else [todo.pop()]
        left[name] -= len(done)
        yield done
        for k in done:
            for other in after[k]:
                missing[other] -= 1
                if not missing[other]:
                    todo.append(other)


def _next(ready: Mapping[str, list[int]], left: Mapping[str, int], names: Sequence[str]) -> str:
    """The owner to go on with: the first of whom everything is ready, else the first."""
    waiting = [name for name in names if name in ready]
    return next((name for name in waiting if len(ready[name]) == left[name]), waiting[0])


def _merged(functions: Sequence[Function]) -> Function:
    """One function that does what several do."""
    first = functions[0]
    reads = dict.fromkeys(name for function in functions for name in function.reads)
    writes = dict.fromkeys(name for function in functions for name in function.arguments if name in function.writes)
    return Function(first.name, first.kind, first.python, (*reads, *writes), frozenset(writes))
