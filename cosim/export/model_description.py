"""modelDescription.xml, and what else FMI says of a model's variables: what its two versions share."""

from __future__ import annotations

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import ClassVar
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from cosim.authoring.variables import Indicator, Unit
from cosim.errors import WrongUnit
from cosim.export.about import About
from cosim.export.model import FmiVariable, Model
from cosim.fmu.fmi import Version
from cosim.language import units

TOOL = "cosim"
#: The phases of wrapper/instance.h.
INSTANTIATED, INITIALIZATION, EVENT, CONTINUOUS_TIME, STEP = (1 << k for k in range(5))
CATEGORIES = {
    "logEvents": "initialization and sample instants",
    "logStatusWarning": "what a block warns of, and rejected steps",
    "logStatusError": "errors of blocks, and calls that the standard forbids",
}


#: Characters that no XML may hold.
_NO_XML = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


@dataclass
class Item:
    """What a value reference stands for: elements of a variable, all or one.

    Value references are the places in the list of items, from 1: some importers take 0 for none, or a reference among
    the dependencies for a place in the list, which so is one.
    """

    variable: FmiVariable
    first: int
    count: int
    name: str


class ModelDescription(ABC):
    """A model as a version of FMI describes it.

    scalars: whether each element of an array has a value reference of its own. state_phases: those in which a
    continuous state may be set in the course of a run. with_sources: whether the FMU holds C files.
    """

    version: ClassVar[Version]
    state_phases: ClassVar[int]

    def __init__(self, model: Model, about: About, scalars: bool, with_sources: bool) -> None:
        self.model = model
        self.with_sources = with_sources
        self.about = about
        self.scalars = scalars
        self.items: list[Item] = []
        self.first: dict[FmiVariable, int] = {}
        for variable in model.variables:
            self.first[variable] = len(self.items) + 1
            self.items += _elements(variable) if scalars else [Item(variable, 0, variable.size, variable.name)]

    def write(self, token: str) -> bytes:
        """The XML. token: the FMI 2 GUID or FMI 3 instantiation token."""
        root = self.root(token)
        for element in root.iter():
            for name, value in element.items():
                element.set(name, _NO_XML.sub("\ufffd", value))
        ElementTree.indent(root)
        written: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
        return written

    @abstractmethod
    def root(self, token: str) -> Element:
        """The element `fmiModelDescription`."""

    def settable(self, variable: FmiVariable) -> int:
        """The phases in which FMI lets an importer set a variable, as bits.

        FMI 2.0.4, tables in 3.2.3 and 4.2.4; FMI 3.0, "Allowed Function Calls" of each state in 2.3, 3.2 and 4.2.
        """
        if variable.causality == "input":
            smooth = CONTINUOUS_TIME if variable.variability == "continuous" else 0
            return INSTANTIATED | INITIALIZATION | EVENT | STEP | smooth
        if variable.causality == "parameter":
            return INSTANTIATED | INITIALIZATION | EVENT | STEP
        start = {"exact": INSTANTIATED | INITIALIZATION, "approx": INSTANTIATED}.get(variable.initial or "", 0)
        return start | self.state_phases if variable.kind == "CONTINUOUS_STATE" else start

    def identity(self) -> dict[str, str]:
        """Attributes of `fmiModelDescription` that both versions have."""
        named = {"fmiVersion": self.version.name, "modelName": self.model.name}
        tool = {"generationTool": TOOL, "variableNamingConvention": "structured"}
        return {**named, "description": self.model.description, **self.about.attributes(), **tool}

    def capabilities(self) -> dict[str, str]:
        """Attributes of either kind."""
        return {"modelIdentifier": self.model.identifier}

    @property
    def variable_steps(self) -> str:
        """Sampled blocks count inner steps, so that each has to be as long as the others."""
        return truth(not self.model.network.schedule.clocks)

    def experiment(self, root: Element) -> None:
        """The categories of messages, and the run of the diagram."""
        categories = SubElement(root, "LogCategories")
        for name, description in CATEGORIES.items():
            SubElement(categories, "Category", name=name, description=description)
        run = self.model.network.diagram.run
        values = {"startTime": "0", "stopTime": real(run.stop), "stepSize": real(run.step)}
        SubElement(root, "DefaultExperiment", values)

    def units(self, root: Element) -> None:
        """The definitions of all units that are named, each with those in which it is shown."""
        known: dict[str, dict[str, None]] = {}
        for item in self.items:
            if name := self.unit(item):
                displays = known.setdefault(name, {})
                if display := self.display(item):
                    displays[display] = None
        if not known:
            return
        definitions = SubElement(root, "UnitDefinitions")
        for name, displays in known.items():
            unit = SubElement(definitions, "Unit", name=name)
            try:
                base = units.base(name)
            except WrongUnit:
                continue  # a unit of its own: FMI compares units without base by name
            exponents = zip(units.BASES, base.exponents, strict=True)
            attributes = {symbol: str(exponent) for symbol, exponent in exponents if exponent}
            SubElement(unit, "BaseUnit", attributes | _conversion(base.factor, base.offset))
            for shown in displays:
                to = units.base(shown)
                conversion = _conversion(base.factor / to.factor, (base.offset - to.offset) / to.factor)
                SubElement(unit, "DisplayUnit", {"name": shown} | conversion)

    def unit(self, item: Item) -> str | None:
        """An item's one unit."""
        return _of_item(item, item.variable.unit) if item.variable.dtype.kind == "f" else None

    def display(self, item: Item) -> str | None:
        """The unit in which an item is shown, if it is another one."""
        unit = self.unit(item)
        display = _of_item(item, item.variable.display) if unit else None
        return None if display == unit else display

    def quantities(self, item: Item) -> dict[str, str]:
        """The attributes of a variable's type, which belong to a whole array: what its elements have in common."""
        found = {"unit": self.unit(item), "displayUnit": self.display(item)}
        for key in ("min", "max", "nominal"):
            numbers = getattr(item.variable, key)
            if numbers is not None:
                part = numbers.reshape(-1)[item.first : item.first + item.count]
                number = part[0] if (part == part[0]).all() else None
                found[key] = None if number is None else text(number)
        return {key: value for key, value in found.items() if value}

    def outputs(self) -> list[FmiVariable]:
        """The outputs, in their order."""
        return [v for v in self.model.variables if v.causality == "output"]

    def initial_unknowns(self) -> list[FmiVariable]:
        """FMI 2.0.4, section 2.2.8; FMI 3.0, section 2.4.8."""
        states = {d.state for d in self.model.derivatives}
        computed = [v for v in self.model.variables if v.initial in ("approx", "calculated")]
        return [v for v in computed if v.causality in ("output", "calculatedParameter") or v.signal in states]

    def unknowns(self, chosen: Iterable[FmiVariable], initial: bool = False) -> Iterator[tuple[int, str]]:
        """The value references of some variables, each with those that it depends on."""
        for variable in chosen:
            knowns = variable.initial_knowns if initial else variable.knowns
            known = [v for v in self.model.variables if v.signal in knowns and not v.state]
            for member in range(variable.shape[0]) if variable.mapped and self.scalars else (None,):
                members = [self.references(k, member if knowns[k.signal] and k.mapped else None) for k in known]
                dependencies = " ".join(str(reference) for part in members for reference in part)
                for reference in self.references(variable, member):
                    yield reference, dependencies

    def references(self, variable: FmiVariable, member: int | None = None) -> range:
        """The value references of a variable, or of one member of a fleet."""
        first = self.first[variable]
        if not self.scalars:
            return range(first, first + 1)
        if member is None:
            return range(first, first + variable.size)
        size = variable.size // variable.shape[0]
        return range(first + member * size, first + (member + 1) * size)

    def indicators(self) -> list[FmiVariable]:
        """The event indicators, in their order."""
        return [v for v in self.model.variables if v.is_indicator]

    @property
    def may_end(self) -> bool:
        """Whether an indicator may end the run."""
        declared = (i for c in self.model.network.components.values() for i in c.declaration.of(Indicator))
        return any(indicator.terminal for indicator in declared)

    @property
    def step_events(self) -> bool:
        """Whether outputs that are no reals may change while an importer integrates, or indicators may cross zero."""
        return any(v.kind == "DISCRETE_OUTPUT" or v.is_indicator for v in self.model.variables)


def _of_item(item: Item, unit: Unit) -> str | None:
    """A tuple has a unit for each element of the first axis, behind that of a fleet's members."""
    variable = item.variable
    if not isinstance(unit, tuple):
        return unit
    if item.count == variable.size:
        return unit[0] if len(set(unit)) == 1 else None
    return unit[np.unravel_index(item.first, variable.shape)[int(variable.mapped)]]


def _conversion(factor: float, offset: float) -> dict[str, str]:
    attributes = {"factor": real(factor)} if factor != 1 else {}
    return attributes | ({"offset": real(offset)} if offset != 0 else {})


def _elements(variable: FmiVariable) -> Iterator[Item]:
    """The elements of a variable, row by row."""
    derivative = variable.name.startswith("der(")
    for element, index in enumerate(np.ndindex(variable.shape)):
        subscript = f"[{','.join(str(n + 1) for n in index)}]" if index else ""
        name = f"{variable.name[:-1]}{subscript})" if derivative else f"{variable.name}{subscript}"
        yield Item(variable, element, 1, name)


def truth(value: bool) -> str:
    """An xs:boolean."""
    return "true" if value else "false"


def text(value: np.generic) -> str:
    """A start value."""
    if value.dtype.kind == "b":
        return truth(bool(value))
    return real(float(value)) if value.dtype.kind == "f" else str(int(value))


def real(value: float) -> str:
    """An xs:double that reads back to the same bits."""
    if math.isfinite(value):
        return repr(value)
    return "NaN" if math.isnan(value) else "INF" if value > 0 else "-INF"
