"""An FMU as a declaration: a block type whose functions are all the adapter's kernel.

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
from typing import Any

from cosim.authoring.declaration import Declaration, Function
from cosim.authoring.rules import condition
from cosim.authoring.variables import Indicator, Input, Local, Output, Parameter, State, Variable
from cosim.errors import FmuError
from cosim.fmu import adapter, fields
from cosim.fmu.imported import Fmu
from cosim.fmu.ports import Port
from cosim.language.entry import BlockEntry


def declaration(fmu: Fmu, entry: BlockEntry) -> Declaration:
    """The declaration of an FMU with its ports and its structure. Raises: FmuError."""
    states = list(dict.fromkeys(name for name, _ in fmu.states))
    if "time" in fmu.ports:
        message = "it has a variable called `time`, which in a diagram is the time"
        raise FmuError(message, fix="give it another name, ports: {clock: time}")
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
        sampled=_samples(fmu) and not _computed(fmu, "continuous"),
        rigid=fmu.kind != fields.MODEL_EXCHANGE and _is_rigid(fmu),
        interpolates=fmu.kind == fields.CO_SIMULATION and bool(getattr(fmu.interface, "canInterpolateInputs", False)),
        early=fmu.kind == fields.EVENT_CO_SIMULATION and bool(fmu.interface.mightReturnEarlyFromDoStep),
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


def _is_rigid(fmu: Fmu) -> bool:
    """Whether an FMU needs steps of one size in Co-Simulation."""
    stepping = fmu.description.coSimulation
    return stepping is not None and not stepping.canHandleVariableCommunicationStepSize


def _samples(fmu: Fmu) -> bool:
    """Whether an FMU has something sampled in it, as far as its description tells: it needs steps of one size."""
    return _is_rigid(fmu) and bool(_computed(fmu, "discrete"))


def _most_instances(fmu: Fmu) -> int | None:
    return 1 if fmu.interface.canBeInstantiatedOnlyOncePerProcess and not fmu.settings.isolated else None


def _variable(name: str, port: Port, is_state: bool) -> Variable:
    """A port as a variable of a block type; calculated parameters, constants and locals can be recorded."""
    more: dict[str, Any] = {
        "unit": port.unit(),
        "description": port.first.description or "",
        "dtype": port.dtype,
    }
    start = port.start()
    variable: Variable
    if is_state:
        variable = State(*port.shape, output=port.causality == "output", start=start, **more)
    elif port.causality == "parameter":
        variable = Parameter(*port.shape, default="" if start is None and port.is_text else start, **more)
    elif port.causality == "input":
        variable = Input(*port.shape, start=start, **more)
    else:
        kind = Output if port.causality == "output" else Local
        variable = kind(*port.shape, start=start if port.can_start else None, **more)
    variable.name = name
    variable.any_integer = port.code == fields.INTEGER32
    variable.items = port.items()
    variable.structural = port.is_structural
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
    calculated = [n for n in states if n in fmu.initial_inputs_of or fmu.ports[n].is_calculated]
    for k, (known, names) in enumerate(_grouped(calculated, fmu.initial_inputs_of, inputs)):
        functions.append(_function(f"start_{k}", "start", known, names))
    functions.append(_function("begin", "begin", inputs, states))
    if fields.EVENT_INDICATORS in declaration.variables:
        functions.append(_function("indicators", "indicators", (*reads, *inputs), [fields.EVENT_INDICATORS]))
    if feedthrough and not declaration.rigid:
        functions.append(_function("times", "times", (), ()))
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
        reading = entry.inputs.keys() - entry.constants.keys()
        wired = {n: (fmu.inputs_of.get(n) or frozenset()) & reading for n in named}
        stated = [f"{n} on {', '.join(sorted(wired[n]))}" for n in named if wired[n]]
        unstated = [n for n in named if fmu.inputs_of.get(n) is None] if reading else []
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
