"""The order in which outputs are evaluated: a function comes after every function that computes what it reads.

Direct feedthrough is read off the signatures: an output that is a state, or whose function names no input, depends on
nothing at the same instant. Outputs that depend on each other are an algebraic loop, which is refused.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass, replace
from graphlib import CycleError, TopologicalSorter
from typing import TYPE_CHECKING

from cosim.authoring.declaration import Function
from cosim.authoring.variables import Input, State
from cosim.errors import AlgebraicLoop, DiagramErrors
from cosim.wiring.network import Component, Network, Signal, Task

if TYPE_CHECKING:
    import networkx


def ordered(network: Network) -> Network:
    """The network with its orders. Raises: DiagramErrors with every AlgebraicLoop."""
    return replace(network, initial=tuple(initial_order(network)), evaluation=tuple(evaluation_order(network)))


def evaluation_order(network: Network) -> list[Task]:
    """All `outputs` functions and joins, sources first. Raises: DiagramErrors with every AlgebraicLoop."""
    return _sorted(network, _graph(network, starts=False))


def initial_order(network: Network) -> list[Task]:
    """As `evaluation_order`, with every `start` function before whatever reads the states that it sets."""
    return _sorted(network, _graph(network, starts=True))


def needed_outputs(component: Component) -> list[Function]:
    """The `outputs` functions whose results `derivatives` reads, directly or through others, in order."""
    declaration = component.declaration
    wanted = {a for f in declaration.kind("derivatives") for a in f.reads}
    needed = []
    for function in reversed(declaration.kind("outputs")):
        if wanted & function.writes:
            needed.append(function)
            wanted |= set(function.reads)
    return needed[::-1]


def is_sampled(component: Component) -> bool:
    """Whether a component's outputs change at its sample times only."""
    declaration = component.declaration
    return declaration.sampled or (bool(declaration.kind("update")) and not declaration.kind("derivatives"))


@dataclass(frozen=True)
class Turn:
    """A block's turn under Gauss-Seidel: what is evaluated anew, at the later time, before it steps, and after."""

    component: str
    before: tuple[Task, ...]
    after: tuple[Task, ...]


def has_turn(component: Component) -> bool:
    """Whether a component advances between two communication points by itself; the others are evaluated when asked."""
    return bool(component.declaration.continuous() or component.declaration.kind("step")) and not is_sampled(component)


def turns(network: Network, tasks: list[Task]) -> list[Turn]:
    """The turns of one communication step under Gauss-Seidel; tasks: all, in the order of evaluation.

    Before a block steps, what it reads through blocks without a turn is evaluated anew where it depends on a block that
    has stepped, or on a source, which reads nothing but the time. Once it has, the same holds for its own outputs.
    Sampled outputs stay as they are.
    """
    ways = _Ways(network, tasks)
    stepped: set[str] = set()
    done: dict[Task, frozenset[str]] = {}
    result = []

    def stale(name: str) -> Iterator[Task]:
        for task in ways.before(name):
            newest = frozenset(ways.origins.get(task, set()) & (stepped | {_TIME}))
            if task.component == name or (newest and done.get(task) != newest):
                done[task] = newest
                yield task

    for name in ways.sequence():
        before = tuple(stale(name))
        stepped.add(name)
        own = [task for task in tasks if task.component == name and task.function]
        result.append(Turn(name, before, (*stale(name), *own)))
    return result


_TIME = "time"


class _Ways:
    """How what blocks with a turn publish reaches other such blocks, through the tasks of those without."""

    def __init__(self, network: Network, tasks: list[Task]) -> None:
        self.network = network
        self.tasks = tasks
        self.stepping = [name for name, component in network.components.items() if has_turn(component)]
        self.writers = {signal: task for task in tasks for signal in self._writes(task)}
        self.origins: dict[Task, set[str]] = {}  # of tasks without a turn: the blocks, and the time
        for task in tasks:
            if self._is_free(task):
                self.origins[task] = self._origins(self._reads(task))

    def _is_free(self, task: Task) -> bool:
        component = self.network.components[task.component]
        return not has_turn(component) and not is_sampled(component)

    def _function(self, task: Task) -> Function:
        return next(f for f in self.network.components[task.component].declaration.functions if f.name == task.function)

    def _writes(self, task: Task) -> list[Signal]:
        names = sorted(self._function(task).writes) if task.function else [task.port]
        return [Signal(task.component, name) for name in names]

    def _reads(self, task: Task) -> list[Signal]:
        component = self.network.components[task.component]
        if not task.function:
            return [source.whole for source in component.wires[task.port]]
        return [s for name in self._function(task).reads for s in self._sources(component, name)]

    def _sources(self, component: Component, name: str) -> list[Signal]:
        """Where what a function of a component names comes from; a joined input is the component's own."""
        if name in component.wires and not is_joined(component, name):
            return [component.wires[name][0].whole]
        return [Signal(component.name, name)]

    def _origins(self, signals: list[Signal]) -> set[str]:
        """What signals depend on. Of the time by itself only where on no block: else it moves on with the blocks."""
        found: set[str] = set()
        timed = False
        for signal in signals:
            if (
                signal.variable == _TIME
                and _TIME not in self.network.components[signal.component].declaration.variables
            ):
                timed = True
            elif signal.component in self.stepping:
                found.add(signal.component)
            elif signal in self.writers:
                found |= self.origins.get(self.writers[signal], set())
        return {_TIME} if timed and not found else found

    def before(self, name: str) -> list[Task]:
        """The tasks without a turn that a block reads the results of, and its own joins, in the order of evaluation."""
        component = self.network.components[name]
        waiting = [s.whole for sources in component.wires.values() for s in sources]
        found = {task for task in self.tasks if task.component == name and not task.function}
        while waiting:
            task = self.writers.get(waiting.pop())
            if task in self.origins and task not in found:
                found.add(task)
                waiting += self._reads(task)
        return [task for task in self.tasks if task in found]

    def sequence(self) -> list[str]:
        """The order of the turns: a block after those that it reads. A ring is entered at a block without feedthrough.

        Where none is ready, a block with feedthrough goes first if something that it reads has stepped, so that it
        hands that on.
        """
        reads = {name: self._read_by(name) for name in self.stepping}
        left, result = list(self.stepping), list[str]()
        while left:
            ready = [n for n in left if not reads[n] & set(left) - {n}]
            passing = [n for n in left if self._feeds_through(n)]
            handing = [n for n in passing if reads[n] & set(result)]
            entered = [n for n in left if n not in passing]
            chosen = (ready or handing or entered or left)[0]
            left.remove(chosen)
            result.append(chosen)
        return result

    def _read_by(self, name: str) -> set[str]:
        component = self.network.components[name]
        direct = self._origins([s.whole for sources in component.wires.values() for s in sources])
        return direct | {origin for task in self.before(name) for origin in self.origins.get(task, set())} - {_TIME}

    def _feeds_through(self, name: str) -> bool:
        declaration = self.network.components[name].declaration
        return any(
            isinstance(declaration.variables.get(r), Input) for f in declaration.kind("outputs") for r in f.reads
        )


Graph = dict[Task, dict[Task, str]]
"""Of every task, what has to be done before it, and by which port it is read."""


def _graph(network: Network, starts: bool) -> Graph:
    graph: Graph = {}
    for component in network.components.values():
        setters = component.declaration.kind("start") if starts else ()
        for function in (*setters, *component.declaration.evaluated(starts)):
            before = graph.setdefault(Task(component.name, function.name), {})
            for name in function.reads:
                before.update(_producers(network, component, name, starts))
        for port, sources in component.wires.items():
            if is_joined(component, port):
                before = graph.setdefault(Task(component.name, "", port), {})
                for source in sources:
                    before.update(_producers_of(network, source, starts))
    return graph


def is_joined(component: Component, port: str) -> bool:
    """Whether an input gathers several sources along a fleet."""
    return isinstance(component.entry.inputs[port].value, list)


def _producers(network: Network, component: Component, name: str, starts: bool) -> list[tuple[Task, str]]:
    """The tasks that must be done before a function of a component can read a variable."""
    variable = component.declaration.variables.get(name)
    if isinstance(variable, Input):
        if name not in component.wires:
            return []
        if is_joined(component, name):
            return [(Task(component.name, "", name), name)]
        return _producers_of(network, component.wires[name][0], starts)
    return [] if variable is None else _producers_of(network, Signal(component.name, name), starts)


def _producers_of(network: Network, signal: Signal, starts: bool) -> list[tuple[Task, str]]:
    component = network.components[signal.component]
    declaration = component.declaration
    if isinstance(declaration.variables[signal.variable], State):
        # A start value that the diagram gives is there before the function that would compute it.
        computed = starts and signal.variable not in component.given
        setters = [f for f in declaration.kind("start") if signal.variable in f.writes] if computed else []
        return [(Task(signal.component, f.name), signal.variable) for f in setters]
    writer = declaration.writer(signal.variable, starts)
    return [(Task(signal.component, writer.name), signal.variable)] if writer else []


def _sorted(network: Network, graph: Graph) -> list[Task]:
    """Sources first; of those that could be next, the one that stands first in the diagram."""
    sorter = TopologicalSorter(graph)
    try:
        sorter.prepare()
    except CycleError:
        raise _loops(network, graph) from None
    place = {name: k for k, name in enumerate(network.components)}
    ready: list[tuple[int, str, str, Task]] = []
    order = []
    while sorter.is_active():
        for task in sorter.get_ready():
            heapq.heappush(ready, (place[task.component], task.function, task.port, task))
        order.append(heapq.heappop(ready)[-1])
        sorter.done(order[-1])
    return order


def _loops(network: Network, graph: Graph) -> DiagramErrors:
    """Every loop of a graph that has one."""
    import networkx  # here alone: it takes as long to import as a whole start

    edges = networkx.DiGraph()
    edges.add_nodes_from(graph)
    edges.add_edges_from((before, task, {"port": port}) for task in graph for before, port in graph[task].items())
    parts = networkx.strongly_connected_components(edges)
    loops = [part for part in parts if len(part) > 1 or edges.has_edge(*(list(part) * 2))]
    return DiagramErrors([_loop_error(network, edges.subgraph(loop)) for loop in loops])


def _loop_error(network: Network, loop: networkx.DiGraph) -> AlgebraicLoop:
    import networkx

    cycle = networkx.find_cycle(loop)
    ports = [f"{before.component}.{loop.edges[before, after]['port']}" for before, after in cycle]
    first = network.components[cycle[0][1].component]
    position = next((n.position for n in first.entry.inputs.values() if str(n.value) in ports), first.entry.position)
    fix = "let one of these blocks read a state instead of an output with direct feedthrough, or sample it"
    kind = "algebraic loop"
    started = [
        f"blocks.{t.component}.start.{loop.edges[t, after]['port']}" for t, after in cycle if _is_start(network, t)
    ]
    if started:  # at time zero only: where a run goes on, these are states
        kind, fix = "algebraic loop at initialization", f"give a start value: {' or '.join(started)}"
    return AlgebraicLoop(f"{kind}: {' → '.join([*ports, ports[0]])}", position, fix)


def _is_start(network: Network, task: Task) -> bool:
    return any(f.name == task.function for f in network.components[task.component].declaration.kind("start"))
