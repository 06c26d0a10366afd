"""The order in which outputs are evaluated: a function comes after every function that computes what it reads.

Direct feedthrough is read off the signatures: an output that is a state, or whose function names no input, depends on
nothing at the same instant. Outputs that depend on each other are an algebraic loop, one item of the order: see
`loops`.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from graphlib import TopologicalSorter

from cosim.authoring.declaration import Function
from cosim.authoring.variables import Input, Output, State
from cosim.errors import Problems, WrongValue
from cosim.wiring import loops
from cosim.wiring.draft import Draft
from cosim.wiring.loops import Graph
from cosim.wiring.network import Component, Loop, Network, Signal, Task
from cosim.wiring.sequence import sequence


def ordered(network: Network) -> Network:
    """The network with its orders. Raises: DiagramErrors with every AlgebraicLoop that cannot be solved."""
    return replace(network, initial=tuple(initial_order(network)), evaluation=tuple(evaluation_order(network)))


def evaluation_order(network: Network) -> list[Task | Loop]:
    """All `outputs` functions and joins, sources first. Raises: DiagramErrors with every loop that cannot be solved."""
    return _sorted(network, graph_of(network, starts=False))


def initial_order(network: Network) -> list[Task | Loop]:
    """As `evaluation_order`, with every `start` function before whatever reads the states that it sets."""
    return _sorted(network, graph_of(network, starts=True))


def needed_outputs(component: Component) -> list[Function]:
    """The `outputs` functions whose results `derivatives` reads, directly or through others, and are not held."""
    declaration = component.declaration
    wanted = {a for f in declaration.kind("derivatives") for a in f.reads}
    needed = []
    for function in reversed(declaration.kind("outputs")):
        if wanted & function.writes and not function.held:
            needed.append(function)
            wanted |= set(function.reads)
    return needed[::-1]


@dataclass(frozen=True)
class Turn:
    """A block's turn under Gauss-Seidel: what is evaluated anew, at the later time, before it steps, and after.

    newest: the inputs that are extrapolated of which all is known at the later time already.
    """

    component: str
    before: tuple[Task | Loop, ...]
    after: tuple[Task | Loop, ...]
    newest: tuple[str, ...]


def has_turn(component: Component) -> bool:
    """Whether a component advances between two communication points by itself; the others are evaluated when asked."""
    return (
        bool(component.declaration.continuous() or component.declaration.kind("step"))
        and not component.declaration.sampled
    )


def check_given(draft: Draft) -> None:
    """What `run.order` names are blocks with a turn, and the method has turns."""
    run = draft.diagram.run
    node = run.nodes.get("order")
    if node is None or not run.order:
        return
    if run.method != "gauss-seidel":
        message = f"`run.order` is of no use under `{run.method}`, where no block takes its turn before another"
        draft.problems.add(WrongValue(message, node.place, "remove it, or write `method: gauss-seidel`"))
    for named in node.value:
        component = draft.named(named.value, named) if isinstance(named.value, str) else None
        if component and not has_turn(component):
            message = f"`run.order`: {named.value} has no turn, as it is {_instead(component)}"
            draft.problems.add(WrongValue(message, named.position, "remove it"))


def _instead(component: Component) -> str:
    return "sampled" if component.is_sampled else "evaluated whenever it is read"


def turns(network: Network, order: Sequence[Task | Loop]) -> list[Turn]:
    """The turns of one communication step under Gauss-Seidel; order: of the evaluation of all.

    Before a block steps, what it reads through blocks without a turn is evaluated anew where it depends on a block that
    has stepped, or on a source, which reads nothing but the time. Once it has, the same holds for its own outputs.
    Sampled outputs stay as they are. An algebraic loop is evaluated anew as a whole.
    """
    ways = _Ways(network, order)
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
        before = ways.whole(stale(name))
        newest = tuple(port for port in ways.extrapolated(name) if ways.origin(name, port) <= stepped | {_TIME})
        stepped.add(name)
        after = sorted({*stale(name), *ways.own.get(name, ())}, key=ways.place.__getitem__)
        result.append(Turn(name, before, ways.whole(after), newest))
    return result


_TIME = ""  # among the names of blocks, none of which is empty


class _Ways:
    """How what blocks with a turn publish reaches other such blocks, through the tasks of those without."""

    def __init__(self, network: Network, order: Sequence[Task | Loop]) -> None:
        self.network = network
        self.place = {task: k for k, task in enumerate(flat(order))}
        self.loops = {task: item for item in order if isinstance(item, Loop) for task in item.tasks}
        self.stepping = [name for name, component in network.components.items() if has_turn(component)]
        self.writers = {signal: task for task in self.place for signal in network.written(task)}
        self.own: dict[str, list[Task]] = {}  # of each block, its functions in the order of evaluation
        self.joins: dict[str, list[Task]] = {}
        for task in self.place:
            (self.own if task.function else self.joins).setdefault(task.component, []).append(task)
        self.origins: dict[Task, set[str]] = {}  # of tasks without a turn: the blocks, and the time
        for item in order:  # what a task of a loop depends on, all of them do
            free = [task for task in flat([item]) if self._is_free(task)]
            found = self._origins([signal for task in free for signal in self._read(task)])
            self.origins.update(dict.fromkeys(free, found))

    def whole(self, tasks: Iterable[Task]) -> tuple[Task | Loop, ...]:
        """The same with every loop, of which there is a task, once, in the place of its first."""
        return tuple(dict.fromkeys(self.loops.get(task, task) for task in tasks))

    def _read(self, task: Task) -> list[Signal]:
        """What a task reads at one instant: where it is read late, nothing but the time."""
        late = not task.function and self.network.components[task.component].is_late(task.port)
        return [Signal(task.component, "time")] if late else self.network.read(task)

    def _brought(self, component: Component) -> list[Signal]:
        """What a component's inputs read at one instant."""
        return [s.whole for port, sources in component.wires.items() if not component.is_late(port) for s in sources]

    def _is_free(self, task: Task) -> bool:
        return not has_turn(self.network.components[task.component]) and not self.network.is_held(task)

    def _origins(self, signals: list[Signal]) -> set[str]:
        """What signals depend on. Of the time by itself only where on no block: else it moves on with the blocks."""
        found: set[str] = set()
        timed = False
        for signal in signals:
            component = self.network.components[signal.component]
            if signal.variable == "time" and "time" not in component.declaration.variables:
                timed = True
            elif has_turn(component):
                found.add(signal.component)
            elif signal in self.writers:
                found |= self.origins.get(self.writers[signal], set())
        return {_TIME} if timed and not found else found

    def before(self, name: str) -> list[Task]:
        """The tasks without a turn that a block reads the results of, and its own joins, in the order of evaluation."""
        component = self.network.components[name]
        waiting = self._brought(component)
        found = {task for task in self.joins.get(name, ()) if task.port not in self.extrapolated(name)}
        while waiting:
            task = self.writers.get(waiting.pop())
            if task in self.origins and task not in found:
                found.add(task)
                waiting += self._read(task)
        return sorted(found, key=self.place.__getitem__)

    def extrapolated(self, name: str) -> list[str]:
        """The inputs of a block that are extrapolated; its turn says when they take what is new."""
        return [port for port, coupling in self.network.components[name].couplings.items() if coupling.order]

    def origin(self, name: str, port: str) -> set[str]:
        """The blocks with a turn on which an input depends."""
        return self._origins([source.whole for source in self.network.components[name].wires[port]])

    def sequence(self) -> list[str]:
        """The order of the turns: what the diagram gives, then as of `sequence.py`."""
        reads = {name: self._read_by(name) - {name} for name in self.stepping}
        passing = {name for name in self.stepping if self._feeds_through(name)}
        return sequence(reads, passing, self.network.diagram.run.order)

    def _read_by(self, name: str) -> set[str]:
        component = self.network.components[name]
        direct = self._origins(self._brought(component))
        return direct.union(*(self.origins.get(task, ()) for task in self.before(name))) - {_TIME}

    def _feeds_through(self, name: str) -> bool:
        """Whether an output depends on an input at the same instant, at once or by way of locals."""
        declaration = self.network.components[name].declaration
        if self.network.components[name].is_sampled:
            return False
        reached = dict.fromkeys(output.name for output in declaration.of(Output))
        waiting = [*reached]
        while waiting:
            writer = declaration.writer(waiting.pop())
            new = dict.fromkeys(read for read in (writer.reads if writer else ()) if read not in reached)
            reached |= new
            waiting += new
        return any(isinstance(declaration.variables.get(read), Input) for read in reached)


def graph_of(network: Network, starts: bool) -> Graph:
    """What has to be done before each task, at a communication point or (`starts`) at initialization."""
    graph: Graph = {}
    for component in network.components.values():
        setters = component.declaration.kind("start") if starts else ()
        for function in (*setters, *component.declaration.evaluated(starts)):
            before = graph.setdefault(Task(component.name, function.name), {})
            for name in function.reads:
                before.update(_producers(network, component, name, starts))
        for port, sources in component.wires.items():
            if component.is_joined(port):
                before = graph.setdefault(Task(component.name, "", port), {})
                started = starts and port not in component.given
                for source in sources if started or not component.is_late(port) else ():
                    before.update(_producers_of(network, source, starts))
    return graph


def _producers(network: Network, component: Component, name: str, starts: bool) -> list[tuple[Task, str]]:
    """The tasks that must be done before a function of a component can read a variable."""
    variable = component.declaration.variables.get(name)
    if isinstance(variable, Input):
        if name not in component.wires:
            return []
        if component.is_joined(name):
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


def _sorted(network: Network, graph: Graph) -> list[Task | Loop]:
    """Sources first; of those that could be next, the one that stands first in the diagram.

    Raises: DiagramErrors with every loop that cannot be solved.
    """
    problems = Problems()
    parts = loops.groups(graph)
    part_of = {task: k for k, part in enumerate(parts) for task in part}
    before = {k: {part_of[other] for task in part for other in graph[task]} - {k} for k, part in enumerate(parts)}
    made = [
        problems.attempt(loops.torn, network, part, graph) if loops.is_loop(part, graph) else part[0] for part in parts
    ]
    problems.raise_if_any()
    place = {name: k for k, name in enumerate(network.components)}
    first = [min((place[t.component], t.function, t.port) for t in part) for part in parts]
    sorter = TopologicalSorter(before)
    sorter.prepare()
    ready: list[tuple[tuple[int, str, str], int]] = []
    order: list[Task | Loop] = []
    while sorter.is_active():
        for k in sorter.get_ready():
            heapq.heappush(ready, (first[k], k))
        k = heapq.heappop(ready)[-1]
        done = made[k]
        assert done is not None
        order.append(done)
        sorter.done(k)
    return order


def continuous(network: Network, order: Iterable[Task | Loop]) -> Iterator[Task | Loop]:
    """What of an order is evaluated between two communication points, where the rest is held."""
    for item in order:
        left = tuple(task for task in flat([item]) if not network.is_held(task))
        if left:
            yield Loop(left, item.torn) if isinstance(item, Loop) else item


def flat(order: Iterable[Task | Loop]) -> list[Task]:
    """All tasks, those of loops in their places."""
    return [task for item in order for task in (item.tasks if isinstance(item, Loop) else (item,))]
