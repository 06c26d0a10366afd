"""From a model description to a declaration: an FMU as a block type whose functions are all the adapter's kernel.

What each kind of FMU is to the loop:

================================  =====================================================================
FMI 2 and plain Co-Simulation     outputs without feedthrough, and a `step`
FMI 3 Co-Simulation, event mode   outputs with the feedthrough that ModelStructure states, and a `step`
Model Exchange                    states, outputs with feedthrough, `derivatives`, `events` and `settle`
================================  =====================================================================

One that computes nothing but discrete variables, in steps of one size, is sampled: its outputs are held between two
communication points, and its inputs are those of the first.

Outputs that depend on the same inputs are got together, by one function.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cosim.authoring.block import Block
from cosim.authoring.declaration import Declaration, Function
from cosim.authoring.rules import condition
from cosim.authoring.variables import Indicator, Input, Local, Output, Parameter, State, Variable
from cosim.errors import FmuError, UnknownPort, WrongValue, nearest
from cosim.fmu import adapter, archive, fields, log_file, settings, versions
from cosim.fmu.description import read_description
from cosim.fmu.fmi import Version
from cosim.fmu.ports import Port
from cosim.fmu.ports import ports as read_ports
from cosim.fmu.settings import FmuSettings
from cosim.language.entry import BlockEntry


@dataclass
class Fmu:
    """An FMU as a diagram uses it. states: (port, element) of each continuous state, in the FMU's order."""

    path: Path
    folder: Path
    description: Any
    settings: FmuSettings
    ports: dict[str, Port]
    states: list[tuple[str, int]] = field(default_factory=list)
    inputs_of: dict[str, frozenset[str] | None] = field(default_factory=dict)  # None: not stated
    initial_inputs_of: dict[str, frozenset[str] | None] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """The file's name."""
        return self.path.name

    @property
    def version(self) -> Version:
        """FMI's version."""
        return versions.find(self.description.fmiVersion)

    @property
    def interface(self) -> Any:
        """What the description says of the kind that is used."""
        mode, description = self.settings.mode, self.description
        return description.coSimulation if mode == settings.CO_SIMULATION else description.modelExchange

    @property
    def kind(self) -> int:
        """The adapter's name for the kind."""
        if self.settings.mode == settings.MODEL_EXCHANGE:
            return fields.MODEL_EXCHANGE
        return fields.EVENT_CO_SIMULATION if self.settings.event_mode else fields.CO_SIMULATION

    frame_words = fields.FIRST - fields.LINK

    @property
    def kernel(self) -> Callable[[float, int, int], int]:
        """What does the FMU's functions in the loop."""
        from cosim.fmu import mailbox

        return mailbox.remote if self.settings.isolated else adapter.adapt

    def parts(self, component: Any, *arguments: Any) -> Any:
        """The instances of one run, by process; see `cosim.fmu.instance` and `cosim.fmu.isolation`."""
        from cosim.fmu import instance, isolation

        isolated = self.settings.isolated
        made: Any = (isolation.parts if isolated else instance.parts)(self, component, *arguments)
        if node := self.settings.log_file:
            log_file.attach(component, node, [part.trace for part in made])
        return made


def block(entry: BlockEntry) -> type[Block]:
    """The block type that a diagram's entry of kind `fmu` names.

    Raises: MissingFile, ArchiveError, FmuError, UnknownPort.
    """
    folder, description = read_description(entry.path, entry.type.position)
    fmu = Fmu(entry.path, folder, description, settings.read(entry, description), {})
    archive.binary(folder, fmu.interface.modelIdentifier, fmu.version, fmu.name, entry.type.position)
    try:
        fmu.ports = _renamed(read_ports(description), entry)
        _read_structure(fmu)
        declaration = _declaration(fmu, entry)
    except FmuError as error:
        raise FmuError(f"`{fmu.name}`: {error.message}", entry.type.position, error.fix) from None
    made: type[Block] = type(description.modelName, (Block,), {"__doc__": description.description})
    made.declaration = declaration
    return made


def _renamed(ports: dict[str, Port], entry: BlockEntry) -> dict[str, Port]:
    """The ports under the names that `ports:` gives them. Raises: UnknownPort, WrongValue for names that collide."""
    names: dict[str, str] = {}
    for ours, node in entry.ports.items():
        if node.value not in ports:
            if node.inherited:  # written for another FMU
                continue
            message = f"block {entry.name}: `{entry.path.name}` has no variable `{node.value}`"
            raise UnknownPort(message, node.position, nearest(node.value, ports))
        if node.value in names:
            message = f"block {entry.name}: `{names[node.value]}` and `{ours}` name one variable, `{node.value}`"
            raise WrongValue(message, node.position, "leave one of them out; wires go to as many ports as they like")
        names[node.value] = ours
    for theirs, ours in names.items():
        if ours in ports and ours not in names:
            message = (
                f"block {entry.name}: `{ours}` is to name `{theirs}`, but the FMU has a variable `{ours}` of its own"
            )
            raise WrongValue(message, entry.ports[ours].position, f"choose another name, or rename `{ours}` too")
    return {names.get(name, name): port for name, port in ports.items()}


# ---- structure ----


def _read_structure(fmu: Fmu) -> None:
    """Which inputs each output depends on, and where the states are. Raises: FmuError."""
    description = fmu.description
    owner = _owners(fmu)
    fmu.inputs_of = dependencies(fmu, description.outputs)
    fmu.initial_inputs_of = dependencies(fmu, description.initialUnknowns)
    if fmu.kind != fields.MODEL_EXCHANGE:
        return
    for unknown in description.derivatives:
        state = unknown.variable.derivative
        if state is None or id(state) not in owner:
            raise FmuError(f"nothing says which state `{unknown.variable.name}` is the derivative of")
        name, element = owner[id(state)]
        fmu.states += [(name, element + k) for k in range(fmu.ports[name].member_size)]
    for name in {name for name, _ in fmu.states}:
        if sum(other == name for other, _ in fmu.states) != fmu.ports[name].size:
            raise FmuError(f"only some elements of `{name}` are states")


def _owners(fmu: Fmu) -> dict[int, tuple[str, int]]:
    """The port and the element that each of the FMU's variables is, by the variable's identity."""
    return {id(m): (name, k) for name, port in fmu.ports.items() for k, m in enumerate(port.members)}


def dependencies(fmu: Fmu, unknowns: Any) -> dict[str, frozenset[str] | None]:
    """For each port the input ports that it depends on; None where the description does not say."""
    owner = _owners(fmu)
    inputs = {name for name, port in fmu.ports.items() if port.causality == "input"}
    found: dict[str, frozenset[str] | None] = {}
    for unknown in unknowns:
        if id(unknown.variable) not in owner:
            continue
        name = owner[id(unknown.variable)][0]
        before = found.get(name, frozenset())
        if unknown.dependencies is None or before is None:
            found[name] = None
        else:
            known = {owner[id(d)][0] for d in unknown.dependencies if id(d) in owner}
            found[name] = before | (known & inputs)
    return found


# ---- declaration ----


def _declaration(fmu: Fmu, entry: BlockEntry) -> Declaration:
    states = list(dict.fromkeys(name for name, _ in fmu.states))
    variables = {name: _variable(name, port, name in states) for name, port in fmu.ports.items()}
    for name in states:
        clash = variables.get(f"d_{name}")
        if isinstance(clash, Local):
            del variables[clash.name]
        elif clash is not None:
            raise FmuError(
                f"the name `{clash.name}` stands for the derivative of `{name}`", fix="rename it in `ports:`"
            )
    declaration = Declaration(
        name=fmu.description.modelName,
        doc=fmu.description.description or "",
        variables=variables,
        foreign=fmu,
        sampled=_samples(fmu) and not _computed(fmu, "continuous"),
        most_instances=_most_instances(fmu),
    )
    indicators = fmu.description.numberOfEventIndicators
    if fmu.kind == fields.MODEL_EXCHANGE and indicators and fmu.interface.canGetAndSetFMUstate:
        variables[fields.EVENT_INDICATORS] = watched = Indicator(indicators)
        watched.name = fields.EVENT_INDICATORS
    declaration.functions = _functions(fmu, declaration, states)
    declaration.rules = tuple(_rules(fmu, declaration, entry))
    return declaration


def _computed(fmu: Fmu, variability: str) -> list[str]:
    """What an FMU computes in the course of a run, of one variability."""
    made = {name: port.first for name, port in fmu.ports.items() if port.causality in ("output", "local")}
    return [name for name, variable in made.items() if variable.variability == variability]


def _samples(fmu: Fmu) -> bool:
    """Whether an FMU has something sampled in it, as far as its description tells: it needs steps of one size."""
    stepping = fmu.description.coSimulation
    fixed = stepping is not None and not stepping.canHandleVariableCommunicationStepSize
    return fixed and bool(_computed(fmu, "discrete"))


def _most_instances(fmu: Fmu) -> int | None:
    return 1 if fmu.interface.canBeInstantiatedOnlyOncePerProcess and not fmu.settings.isolated else None


def _variable(name: str, port: Port, is_state: bool) -> Variable:
    """A port as a variable of a block type; calculated parameters, constants and locals can be recorded."""
    more: dict[str, Any] = {
        "unit": port.unit(),
        "description": port.first.description or "",
        "dtype": port.dtype,
    }
    variable: Variable
    if is_state:
        variable = State(*port.shape, output=port.causality == "output", start=port.start(), **more)
    elif port.causality == "parameter":
        default = port.start()
        variable = Parameter(*port.shape, default="" if default is None and port.is_string else default, **more)
    elif port.causality == "input":
        variable = Input(*port.shape, start=port.start(), **more)
    else:
        kind = Output if port.causality == "output" else Local
        variable = kind(*port.shape, start=port.start() if port.can_start else None, **more)
    variable.name = name
    variable.any_integer = port.code == fields.INTEGER32
    return variable


def _functions(fmu: Fmu, declaration: Declaration, states: list[str]) -> tuple[Function, ...]:
    inputs = [v.name for v in declaration.of(Input)]
    outputs = [v.name for v in declaration.of(Output)]
    locals_ = [v.name for v in declaration.of(Local)]
    feedthrough = fmu.kind != fields.CO_SIMULATION
    unstated = inputs if feedthrough else []
    reads = ("time", *states) if fmu.kind == fields.MODEL_EXCHANGE else ()
    functions = []
    for k, (known, names) in enumerate(_grouped(outputs, fmu.inputs_of if feedthrough else {}, unstated)):
        functions.append(_function(f"outputs_{k}", "outputs", (*reads, *known), names))
    if locals_:
        functions.append(_function("outputs_locals", "outputs", (*reads, *unstated), locals_))
    starting = {**fmu.inputs_of, **fmu.initial_inputs_of}
    for k, (known, names) in enumerate(_grouped(outputs, starting, unstated)):
        functions.append(_function(f"initial_{k}", "initial", known, names))
    calculated = [n for n in states if n in fmu.initial_inputs_of or fmu.ports[n].first.initial == "calculated"]
    for k, (known, names) in enumerate(_grouped(calculated, fmu.initial_inputs_of, inputs)):
        functions.append(_function(f"start_{k}", "start", known, names))
    functions.append(_function("begin", "begin", inputs, states))
    if fields.EVENT_INDICATORS in declaration.variables:
        functions.append(_function("indicators", "indicators", (*reads, *inputs), [fields.EVENT_INDICATORS]))
    if fmu.kind == fields.MODEL_EXCHANGE:
        functions.append(_function("events", "events", (), states))
        functions.append(_function("settle", "settle", inputs, states))
        if states:
            derivatives = [f"d_{name}" for name in states]
            reads = (*reads, *inputs)
            functions.append(_function("derivatives", "derivatives", reads, derivatives))
    else:
        functions.append(_function("step", "step", inputs, []))
    if fmu.interface.canGetAndSetFMUstate:
        functions += [_function("save", "save", (), ()), _function("restore", "restore", (), ())]
    return tuple(functions)


def _function(name: str, kind: str, reads: Any, writes: Any) -> Function:
    return Function(name, kind, adapter.adapt, (*reads, *writes), frozenset(writes))


def _grouped(
    names: list[str], inputs_of: dict[str, frozenset[str] | None], unstated: list[str]
) -> list[tuple[list[str], list[str]]]:
    """The names in groups that depend on the same inputs: (inputs, names) each."""
    groups: dict[tuple[str, ...], list[str]] = {}
    for name in names:
        known = inputs_of.get(name)
        groups.setdefault(tuple(unstated if known is None else sorted(known)), []).append(name)
    return [(list(known), group) for known, group in groups.items()]


def _rules(fmu: Fmu, declaration: Declaration, entry: BlockEntry) -> Any:
    """What a person should know before running it, as conditions that do not hold."""
    if fmu.kind == fields.CO_SIMULATION:
        named = [v.name for v in declaration.of(Output)]
        stated = [f"{n} on {', '.join(sorted(fmu.inputs_of[n] or ()))}" for n in named if fmu.inputs_of.get(n)]
        unstated = [n for n in named if fmu.inputs_of.get(n) is None] if list(declaration.of(Input)) else []
        numbers = [f"{'; '.join(stated)}: one step of delay"] if stated else []
        numbers += [f"not stated for {', '.join(unstated)}: if they do, one step of delay"] if unstated else []
        if numbers:
            text = "outputs depend on no input at the same instant"
            yield condition(text, fmu.version.delay)(_fails("; ".join(numbers)))
    if fmu.kind != fields.MODEL_EXCHANGE and _samples(fmu) and not declaration.sampled and list(declaration.of(Input)):
        seen = f"under gauss-seidel {', '.join(_computed(fmu, 'discrete'))} may see those of its end"
        text = "what is sampled at the beginning of a step sees the inputs of that time"
        yield condition(text, "co-simulation")(lambda method: (method != "gauss-seidel", seen))
    held = [f"{v.name} = {v.start}" for v in declaration.of(Input) if v.name not in entry.inputs]
    held = [text for text in held if text.partition(" ")[0] not in entry.start]
    if held:
        yield condition("every input is connected or has a start value", "FMU")(_fails(f"held: {', '.join(held)}"))


def _fails(numbers: str) -> Callable[[], tuple[bool, str]]:
    return lambda: (False, numbers)
