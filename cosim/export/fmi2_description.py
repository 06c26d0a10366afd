"""Writes modelDescription.xml for FMI 2.0.4 (sections 2.2, 3.3, 4.3)."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement

from cosim.errors import NotExportable
from cosim.export.about import About
from cosim.export.model import Model
from cosim.export.model_description import Item, ModelDescription, text, truth
from cosim.fmu.versions import FMI2


class Fmi2Description(ModelDescription):
    """FMI 2.0's, of scalars."""

    version = FMI2
    state_phases = 0

    def __init__(self, model: Model, about: About, scalars: bool, with_sources: bool) -> None:
        super().__init__(model, about, scalars=True, with_sources=with_sources)

    def root(self, token: str) -> Element:
        """As of `ModelDescription`."""
        root = Element("fmiModelDescription", self.identity(), guid=token)
        root.set("numberOfEventIndicators", str(sum(indicator.size for indicator in self.indicators())))
        common = self.capabilities() | {
            "canNotUseMemoryManagementFunctions": "true",
            "canGetAndSetFMUstate": "true",
            "canSerializeFMUstate": "true",
            "providesDirectionalDerivative": "true",
        }
        exchange = {"completedIntegratorStepNotNeeded": truth(not self.step_events)}
        simulation = {"canHandleVariableCommunicationStepSize": self.variable_steps}
        for tag, own in (("ModelExchange", exchange), ("CoSimulation", simulation)):
            element = SubElement(root, tag, common | own)
            if self.with_sources:
                SubElement(SubElement(element, "SourceFiles"), "File", name=f"{self.model.identifier}.c")
        self.units(root)
        self.experiment(root)
        variables = SubElement(root, "ModelVariables")
        for reference, item in enumerate(self.items, 1):
            self._variable(variables, reference, item)
        self._structure(SubElement(root, "ModelStructure"))
        return root

    def _variable(self, parent: Element, reference: int, item: Item) -> None:
        v = item.variable
        attributes = {"name": item.name, "valueReference": str(reference)}
        if v.description:
            attributes["description"] = v.description
        attributes |= {"causality": v.causality, "variability": v.variability}
        if v.initial:
            attributes["initial"] = v.initial
        element = SubElement(parent, "ScalarVariable", attributes)
        kind = {"f": "Real", "b": "Boolean"}.get(v.dtype.kind, "Integer")
        values = self.quantities(item)
        if v.start is not None:
            values["start"] = text(v.start.reshape(-1)[item.first])
        if kind == "Integer":
            values = _of_32_bits(item.name, values)
        if v.state:
            values["derivative"] = str(self.references(self.model.of(v.state))[item.first])
        SubElement(element, kind, values)

    def _structure(self, structure: Element) -> None:
        for tag, chosen, initial in (
            ("Outputs", self.outputs(), False),
            ("Derivatives", self.model.derivatives, False),
            ("InitialUnknowns", self.initial_unknowns(), True),
        ):
            if not chosen:
                continue
            parent = SubElement(structure, tag)
            for index, dependencies in self.unknowns(chosen, initial):
                SubElement(parent, "Unknown", index=str(index), dependencies=dependencies)


def _of_32_bits(name: str, values: dict[str, str]) -> dict[str, str]:
    """The attributes of an Integer, which has no more bits: wider limits go without saying. Raises: NotExportable."""
    too_large = {key for key, value in values.items() if not -(2**31) <= int(value) < 2**31}
    if "start" in too_large:
        message = f"`{name}` starts as {values['start']}, and FMI 2's integers have 32 bits"
        raise NotExportable(message, fix="export it as FMI 3.0")
    return {key: value for key, value in values.items() if key not in too_large}
