"""Writes modelDescription.xml for FMI 2.0.4 (sections 2.2, 3.3, 4.3) and FMI 3.0 (sections 2.4, 3.4, 4.4)."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from cosim.errors import WrongUnit
from cosim.export.model import Knowns, Model, Variable
from cosim.language import units

TOOL = "cosim"
#: The phases of wrapper/instance.h.
INSTANTIATED, INITIALIZATION, EVENT, CONTINUOUS_TIME, STEP = (1 << k for k in range(5))
CATEGORIES = {
    "logEvents": "initialization and sample instants",
    "logStatusWarning": "what a block warns of, and rejected steps",
    "logStatusError": "errors of blocks, and calls that the standard forbids",
}


def settable(variable: Variable, version: str) -> int:
    """The phases in which FMI lets an importer set a variable, as bits.

    FMI 2.0.4, tables in 3.2.3 and 4.2.4; FMI 3.0, "Allowed Function Calls" of each state in 2.3, 3.2 and 4.2.
    """
    if variable.causality == "input":
        smooth = CONTINUOUS_TIME if variable.variability == "continuous" else 0
        return INSTANTIATED | INITIALIZATION | EVENT | STEP | smooth
    if variable.causality == "parameter":
        return INSTANTIATED | INITIALIZATION | EVENT | STEP
    start = {"exact": INSTANTIATED | INITIALIZATION, "approx": INSTANTIATED}.get(variable.initial or "", 0)
    if variable.kind == "CONTINUOUS_STATE" and version == "3.0":
        return start | EVENT | CONTINUOUS_TIME
    return start


def write(model: Model, version: str, token: str) -> bytes:
    """The model description as XML. token: the FMI 2 GUID or FMI 3 instantiation token."""
    root = _Fmi2(model).root(token) if version == "2.0" else _Fmi3(model).root(token)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)


@dataclass
class Scalar:
    """FMI 2: one element of a variable; its value reference is its place in the list."""

    variable: int
    element: int
    name: str


def scalars(model: Model) -> list[Scalar]:
    """All elements of all variables, row by row."""
    result = []
    for k, variable in enumerate(model.variables):
        for element, index in enumerate(np.ndindex(variable.shape)):
            subscript = f"[{','.join(str(n + 1) for n in index)}]" if index else ""
            derivative = variable.name.startswith("der(")
            name = f"{variable.name[:-1]}{subscript})" if derivative else f"{variable.name}{subscript}"
            result.append(Scalar(k, element, name))
    return result


class _Writer(ABC):
    """What both versions share."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.place = {variable: k for k, variable in enumerate(model.variables)}

    def capabilities(self) -> dict[str, str]:
        return {"modelIdentifier": self.model.identifier}

    @property
    def variable_steps(self) -> str:
        """Sampled blocks count inner steps, so that each has to be as long as the others."""
        return _truth(not self.model.periods)

    def experiment(self, root: Element) -> None:
        categories = SubElement(root, "LogCategories")
        for name, description in CATEGORIES.items():
            SubElement(categories, "Category", name=name, description=description)
        run = self.model.network.diagram.run
        values = {"startTime": "0", "stopTime": _real(run.stop), "stepSize": _real(run.step)}
        SubElement(root, "DefaultExperiment", values)

    def units(self, root: Element) -> None:
        known = dict.fromkeys(u for v in self.model.variables for u in self.element_units(v) if u)
        if not known:
            return
        definitions = SubElement(root, "UnitDefinitions")
        for name in known:
            unit = SubElement(definitions, "Unit", name=name)
            try:
                base = units.base(name)
            except WrongUnit:
                continue  # a unit of its own: FMI compares units without base by name
            exponents = zip(units.BASES, base.exponents, strict=True)
            attributes = {symbol: str(exponent) for symbol, exponent in exponents if exponent}
            if base.factor != 1:
                attributes["factor"] = _real(base.factor)
            if base.offset != 0:
                attributes["offset"] = _real(base.offset)
            SubElement(unit, "BaseUnit", attributes)

    @abstractmethod
    def element_units(self, variable: Variable) -> tuple[str | None, ...]:
        """The units that a variable's attributes can name."""

    def outputs(self) -> list[Variable]:
        return [v for v in self.model.variables if v.causality == "output"]

    def initial_unknowns(self) -> list[Variable]:
        """FMI 2.0.4, section 2.2.8; FMI 3.0, section 2.4.8."""
        states = {d.state for d in self.model.derivatives}
        computed = [v for v in self.model.variables if v.initial in ("approx", "calculated")]
        return [v for v in computed if v.causality in ("output", "calculatedParameter") or v.signal in states]

    def known(self, knowns: Knowns) -> list[Variable]:
        """The variables of knowns, in their order."""
        return [v for v in self.model.variables if v.signal in knowns and not v.state]

    @property
    def step_events(self) -> bool:
        """Whether outputs that are no reals may change while an importer integrates, which makes an event."""
        return any(v.kind == "DISCRETE_OUTPUT" for v in self.model.variables)


class _Fmi2(_Writer):
    def __init__(self, model: Model) -> None:
        super().__init__(model)
        self.scalars = scalars(model)
        self.first: list[int] = []
        count = 0
        for variable in model.variables:
            self.first.append(count)
            count += variable.size

    def root(self, token: str) -> Element:
        model = self.model
        root = Element(
            "fmiModelDescription",
            fmiVersion="2.0",
            modelName=model.name,
            guid=token,
            description=model.description,
            generationTool=TOOL,
            variableNamingConvention="structured",
            numberOfEventIndicators="0",
        )
        common = self.capabilities() | {
            "canNotUseMemoryManagementFunctions": "true",
            "canGetAndSetFMUstate": "true",
            "canSerializeFMUstate": "true",
        }
        SubElement(root, "ModelExchange", common, completedIntegratorStepNotNeeded=_truth(not self.step_events))
        SubElement(root, "CoSimulation", common, canHandleVariableCommunicationStepSize=self.variable_steps)
        self.units(root)
        self.experiment(root)
        variables = SubElement(root, "ModelVariables")
        for reference, scalar in enumerate(self.scalars):
            self._variable(variables, reference, scalar)
        self._structure(SubElement(root, "ModelStructure"))
        return root

    def element_units(self, variable: Variable) -> tuple[str | None, ...]:
        if variable.dtype.kind != "f":
            return ()
        return variable.unit if isinstance(variable.unit, tuple) else (variable.unit,)

    def _variable(self, parent: Element, reference: int, scalar: Scalar) -> None:
        v = self.model.variables[scalar.variable]
        attributes = {"name": scalar.name, "valueReference": str(reference)}
        if v.description:
            attributes["description"] = v.description
        attributes |= {"causality": v.causality, "variability": v.variability}
        if v.initial:
            attributes["initial"] = v.initial
        element = SubElement(parent, "ScalarVariable", attributes)
        kind = {"f": "Real", "b": "Boolean"}.get(v.dtype.kind, "Integer")
        values: dict[str, str] = {}
        if unit := self._unit(v, scalar.element):
            values["unit"] = unit
        if v.start is not None:
            values["start"] = _text(v.start.reshape(-1)[scalar.element])
        if v.state:
            state = self.place[self.model.of(v.state)]
            values["derivative"] = str(self.first[state] + scalar.element + 1)
        SubElement(element, kind, values)

    def _unit(self, variable: Variable, element: int) -> str | None:
        """A tuple has a unit for each element of the variable's own first axis, behind that of a fleet's members."""
        possible = self.element_units(variable)
        if len(possible) <= 1:
            return possible[0] if possible else None
        return possible[np.unravel_index(element, variable.shape)[int(variable.mapped)]]

    def _structure(self, structure: Element) -> None:
        for tag, chosen, initial in (
            ("Outputs", self.outputs(), False),
            ("Derivatives", self.model.derivatives, False),
            ("InitialUnknowns", self.initial_unknowns(), True),
        ):
            if not chosen:
                continue
            parent = SubElement(structure, tag)
            for variable in chosen:
                knowns = variable.initial_knowns if initial else variable.knowns
                known = self.known(knowns)
                for member in range(variable.shape[0]) if variable.mapped else (None,):
                    members = [self._indices(k, member if knowns[k.signal] and k.mapped else None) for k in known]
                    dependencies = " ".join(str(index) for indices in members for index in indices)
                    for index in self._indices(variable, member):
                        SubElement(parent, "Unknown", index=str(index), dependencies=dependencies)

    def _indices(self, variable: Variable, member: int | None) -> range:
        """The places of a variable's elements (of one member of a fleet) among the model's variables, from 1."""
        first = self.first[self.place[variable]] + 1
        if member is None:
            return range(first, first + variable.size)
        size = variable.size // variable.shape[0]
        return range(first + member * size, first + (member + 1) * size)


class _Fmi3(_Writer):
    def root(self, token: str) -> Element:
        model = self.model
        root = Element(
            "fmiModelDescription",
            fmiVersion="3.0",
            modelName=model.name,
            instantiationToken=token,
            description=model.description,
            generationTool=TOOL,
            variableNamingConvention="structured",
        )
        common = self.capabilities() | {"canGetAndSetFMUState": "true", "canSerializeFMUState": "true"}
        SubElement(root, "ModelExchange", common, needsCompletedIntegratorStep=_truth(self.step_events))
        SubElement(
            root,
            "CoSimulation",
            common,
            canHandleVariableCommunicationStepSize=self.variable_steps,
            fixedInternalStepSize=_real(model.network.diagram.run.step),
            hasEventMode="true",
        )
        self.units(root)
        self.experiment(root)
        variables = SubElement(root, "ModelVariables")
        for reference, variable in enumerate(model.variables):
            self._variable(variables, reference, variable)
        self._structure(SubElement(root, "ModelStructure"))
        return root

    def element_units(self, variable: Variable) -> tuple[str | None, ...]:
        """An array has one unit; where its rows differ, the description lists them."""
        if variable.dtype.kind != "f" or (isinstance(variable.unit, tuple) and len(set(variable.unit)) > 1):
            return ()
        return (variable.unit[0] if isinstance(variable.unit, tuple) else variable.unit,)

    def _variable(self, parent: Element, reference: int, v: Variable) -> None:
        attributes = {"name": v.name, "valueReference": str(reference)}
        description = v.description
        possible = self.element_units(v)
        if not possible and isinstance(v.unit, tuple):
            description = f"{description} [{', '.join(v.unit)}]".strip()
        if description:
            attributes["description"] = description
        attributes |= {"causality": v.causality, "variability": v.variability}
        if v.initial:
            attributes["initial"] = v.initial
        if possible and possible[0]:
            attributes["unit"] = possible[0]
        if v.start is not None:
            attributes["start"] = " ".join(_text(value) for value in v.start.reshape(-1))
        if v.state:
            attributes["derivative"] = self._reference(self.model.of(v.state))
        element = SubElement(parent, v.type, attributes)
        for size in v.shape:
            SubElement(element, "Dimension", start=str(size))

    def _structure(self, structure: Element) -> None:
        for tag, chosen, initial in (
            ("Output", self.outputs(), False),
            ("ContinuousStateDerivative", self.model.derivatives, False),
            ("InitialUnknown", self.initial_unknowns(), True),
        ):
            for variable in chosen:
                knowns = variable.initial_knowns if initial else variable.knowns
                dependencies = " ".join(self._reference(k) for k in self.known(knowns))
                SubElement(structure, tag, valueReference=self._reference(variable), dependencies=dependencies)

    def _reference(self, variable: Variable) -> str:
        return str(self.place[variable])


def _truth(value: bool) -> str:
    return "true" if value else "false"


def _text(value: np.generic) -> str:
    if value.dtype.kind == "b":
        return _truth(bool(value))
    return _real(float(value)) if value.dtype.kind == "f" else str(int(value))


def _real(value: float) -> str:
    """An xs:double that reads back to the same bits."""
    if math.isfinite(value):
        return repr(value)
    return "NaN" if math.isnan(value) else "INF" if value > 0 else "-INF"
