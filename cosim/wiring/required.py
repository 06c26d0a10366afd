"""The monitors that a diagram's requirements ask for, and what of their windows the run does not reach."""

from __future__ import annotations

from cosim.errors import CosimError, FormulaError, Position, Problems
from cosim.language.formula_tree import horizon, is_open
from cosim.language.requirement import RequirementEntry, told
from cosim.requirements.monitor import Monitor
from cosim.requirements.terms import Look, Scope, Seen
from cosim.wiring import sizes
from cosim.wiring.network import Network, Signal

BEYOND = 1e-9  # of a time: as near as that, a window ends with the run


def monitors(network: Network, native: bool = True) -> dict[str, Monitor]:
    """A monitor for each requirement, by name; native: whether compiled code does what is dear.

    Raises: DiagramErrors with every mistake, each with the requirement's name.
    """
    problems, found = Problems(), {}
    for name, entry in network.diagram.requirements.items():
        try:
            found[name] = monitor(network, entry, native)
        except CosimError as error:
            problems.add(told(name, error))
    problems.raise_if_any()
    return found


def monitor(network: Network, entry: RequirementEntry, native: bool) -> Monitor:
    """The monitor of one requirement. Raises: FormulaError, UnknownBlock, UnknownPort, WrongUnit, TooLarge."""
    made = Monitor(entry.condition, scope(network, entry, native))
    run = network.diagram.run
    needed, stop = horizon(entry.condition), run.stop
    if needed > stop * (1.0 + BEYOND) and run.nodes["stop"].position.line:  # not shortened from outside
        message = f"its windows need {needed:g} s, and the run lasts {stop:g} s"
        raise FormulaError(message, entry.place(0), "windows within the run, or a longer run")
    fix = "a single window, of which no samples are kept, or an element of the signal"
    samples = run.steps if is_open(entry.condition) or not run.steps else min(run.steps, int(needed / run.step) + 1)
    sizes.require(8 * made.words * samples, f"{samples} samples of it", entry.place(0), fix)
    return made


def scope(network: Network, entry: RequirementEntry, native: bool = True) -> Scope:
    """What a formula's terms are read by; native: as of `monitors`."""
    return Scope(_look(network, entry), entry.place, native)


def _look(network: Network, entry: RequirementEntry) -> Look:
    """What finds the signals of a formula; of an output that takes a member, that member."""

    def look(text: str, position: Position | None) -> Seen:
        name, _, member = str(entry.signals[text].value).rstrip("]").partition("[")
        signal = network.find(name, position)
        if member and not member.isdigit():
            message = f"`{text}` is {entry.signals[text].value}, several members"
            raise FormulaError(message, position, "let the diagram's output show one member, or all")
        return seen(network, signal, (int(member),) if member else ())

    return look


def seen(network: Network, signal: Signal, index: tuple[int, ...] = ()) -> Seen:
    """A signal as formulas see it; index: as of `Seen`."""
    axes, variable = network.axes(signal), network.variable(signal)
    shape, fleets = tuple(axis.size for axis in axes), tuple(axis.fleet for axis in axes)
    return Seen(signal, shape, fleets, variable.dtype, variable.unit, index)
