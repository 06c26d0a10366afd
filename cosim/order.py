"""The order in which outputs are evaluated: a function comes after every function that computes what it reads.

Direct feedthrough is read off the signatures: an output that is a state, or whose function names no input, depends on
nothing at the same instant. Outputs that depend on each other are an algebraic loop, which is refused.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from cosim.block import Function, Input, State
from cosim.errors import AlgebraicLoop, Problems
from cosim.network import Network, Signal, Slave

if TYPE_CHECKING:
    import networkx


@dataclass(frozen=True)
class Task:
    """One function of one slave, or (function "") the joining of the sources of one of its inputs."""

    slave: str
    function: str
    port: str = ""


def evaluation_order(network: Network) -> list[Task]:
    """All `outputs` functions and joins, sources first. Raises: DiagramErrors with every AlgebraicLoop."""
    return _sorted(network, _graph(network, starts=False))


def initial_order(network: Network) -> list[Task]:
    """As `evaluation_order`, with every `start` function before whatever reads the states that it sets."""
    return _sorted(network, _graph(network, starts=True))


def needed_outputs(slave: Slave) -> list[Function]:
    """The `outputs` functions whose results `derivatives` reads, directly or through others, in order."""
    declaration = slave.declaration
    wanted = {a for f in declaration.kind("derivatives") for a in f.reads}
    needed = []
    for function in reversed(declaration.kind("outputs")):
        if wanted & function.writes:
            needed.append(function)
            wanted |= set(function.reads)
    return needed[::-1]


def is_sampled(slave: Slave) -> bool:
    """Whether a slave's outputs change at its sample times only."""
    return bool(slave.declaration.kind("update")) and not slave.declaration.kind("derivatives")


def _graph(network: Network, starts: bool) -> networkx.DiGraph:
    import networkx

    graph = networkx.DiGraph()
    for slave in network.slaves.values():
        setters = slave.declaration.kind("start") if starts else ()
        for function in (*setters, *slave.declaration.evaluated(starts)):
            task = Task(slave.name, function.name)
            graph.add_node(task)
            for name in function.reads:
                for before, port in _producers(network, slave, name, starts):
                    graph.add_edge(before, task, port=port)
        for port, sources in slave.wires.items():
            if is_joined(slave, port):
                graph.add_node(join := Task(slave.name, "", port))
                for source in sources:
                    for before, name in _producers_of(network, source, starts):
                        graph.add_edge(before, join, port=name)
    return graph


def is_joined(slave: Slave, port: str) -> bool:
    """Whether an input gathers several sources along a fleet."""
    return isinstance(slave.entry.inputs[port].value, list)


def _producers(network: Network, slave: Slave, name: str, starts: bool) -> list[tuple[Task, str]]:
    """The tasks that must be done before a function of a slave can read a variable."""
    variable = slave.declaration.variables.get(name)
    if isinstance(variable, Input):
        if name not in slave.wires:
            return []
        if is_joined(slave, name):
            return [(Task(slave.name, "", name), name)]
        return _producers_of(network, slave.wires[name][0], starts)
    return [] if variable is None else _producers_of(network, Signal(slave.name, name), starts)


def _producers_of(network: Network, signal: Signal, starts: bool) -> list[tuple[Task, str]]:
    slave = network.slaves[signal.slave]
    declaration = slave.declaration
    if isinstance(declaration.variables[signal.variable], State):
        # A start value that the diagram gives is there before the function that would compute it.
        computed = starts and signal.variable not in slave.given
        setters = [f for f in declaration.kind("start") if signal.variable in f.writes] if computed else []
        return [(Task(signal.slave, f.name), signal.variable) for f in setters]
    writer = declaration.writer(signal.variable, starts)
    return [(Task(signal.slave, writer.name), signal.variable)] if writer else []


def _sorted(network: Network, graph: networkx.DiGraph) -> list[Task]:
    import networkx

    place = {name: k for k, name in enumerate(network.slaves)}
    loops = [c for c in networkx.strongly_connected_components(graph) if len(c) > 1 or graph.has_edge(*(list(c) * 2))]
    if loops:
        problems = Problems()
        for loop in loops:
            problems.add(_loop_error(network, graph.subgraph(loop)))
        problems.raise_if_any()
    return list(networkx.lexicographical_topological_sort(graph, key=lambda t: (place[t.slave], t.function, t.port)))


def _loop_error(network: Network, loop: networkx.DiGraph) -> AlgebraicLoop:
    import networkx

    cycle = networkx.find_cycle(loop)
    ports = [f"{before.slave}.{loop.edges[before, after]['port']}" for before, after in cycle]
    first = network.slaves[cycle[0][1].slave]
    position = next((n.position for n in first.entry.inputs.values() if str(n.value) in ports), first.entry.position)
    fix = "let one of these blocks read a state instead of an output with direct feedthrough, or sample it"
    kind = "algebraic loop"
    started = [f"blocks.{t.slave}.start.{loop.edges[t, after]['port']}" for t, after in cycle if _is_start(network, t)]
    if started:  # at time zero only: where a run goes on, these are states
        kind, fix = "algebraic loop at initialization", f"give a start value: {' or '.join(started)}"
    return AlgebraicLoop(f"{kind}: {' → '.join([*ports, ports[0]])}", position, fix)


def _is_start(network: Network, task: Task) -> bool:
    return any(f.name == task.function for f in network.slaves[task.slave].declaration.kind("start"))
