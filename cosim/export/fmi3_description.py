"""Writes modelDescription.xml for FMI 3.0 (sections 2.4, 3.4, 4.4)."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement

from cosim.export.model_description import CONTINUOUS_TIME, EVENT, Item, ModelDescription, real, text, truth
from cosim.fmu.versions import FMI3


class Fmi3Description(ModelDescription):
    """FMI 3.0's, of arrays, or of their elements for importers that know none."""

    version = FMI3
    state_phases = EVENT | CONTINUOUS_TIME

    def root(self, token: str) -> Element:
        """As of `ModelDescription`."""
        root = Element("fmiModelDescription", self.identity(), instantiationToken=token)
        common = self.capabilities() | {
            "canGetAndSetFMUState": "true",
            "canSerializeFMUState": "true",
            "providesDirectionalDerivatives": "true",
        }
        SubElement(root, "ModelExchange", common, needsCompletedIntegratorStep=truth(self.step_events))
        SubElement(
            root,
            "CoSimulation",
            common,
            canHandleVariableCommunicationStepSize=self.variable_steps,
            fixedInternalStepSize=real(self.model.network.diagram.run.step),
            hasEventMode="true",
            mightReturnEarlyFromDoStep=truth(self.may_end),
        )
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
        description = v.description
        if self.unit(item) is None and isinstance(v.unit, tuple):
            description = f"{description} [{', '.join(v.unit)}]".strip()
        if description:
            attributes["description"] = description
        attributes |= {"causality": v.causality, "variability": v.variability}
        if v.initial:
            attributes["initial"] = v.initial
        attributes |= self.quantities(item)
        if v.start is not None:
            start = v.start.reshape(-1)[item.first : item.first + item.count]
            attributes["start"] = " ".join(text(value) for value in start)
        if v.state:
            attributes["derivative"] = str(self.references(self.model.of(v.state))[item.first])
        element = SubElement(parent, v.type, attributes)
        for size in () if self.scalars else v.shape:
            SubElement(element, "Dimension", start=str(size))

    def _structure(self, structure: Element) -> None:
        for tag, chosen, initial in (
            ("Output", self.outputs(), False),
            ("ContinuousStateDerivative", self.model.derivatives, False),
            ("InitialUnknown", self.initial_unknowns(), True),
        ):
            for reference, dependencies in self.unknowns(chosen, initial):
                SubElement(structure, tag, valueReference=str(reference), dependencies=dependencies)
        for indicator in self.indicators():
            for reference in self.references(indicator):
                SubElement(structure, "EventIndicator", valueReference=str(reference))
