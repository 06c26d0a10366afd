"""Writes modelDescription.xml for FMI 3.0 (sections 2.4, 3.4, 4.4)."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement

from cosim.export.model import FmiVariable
from cosim.export.model_description import CONTINUOUS_TIME, EVENT, TOOL, ModelDescription, real, text, truth
from cosim.fmu.versions import FMI3


class Fmi3Description(ModelDescription):
    """FMI 3.0's, of arrays."""

    version = FMI3
    state_phases = EVENT | CONTINUOUS_TIME

    def root(self, token: str) -> Element:
        """As of `ModelDescription`."""
        model = self.model
        root = Element(
            "fmiModelDescription",
            fmiVersion=self.version.name,
            modelName=model.name,
            instantiationToken=token,
            description=model.description,
            generationTool=TOOL,
            variableNamingConvention="structured",
        )
        common = self.capabilities() | {"canGetAndSetFMUState": "true", "canSerializeFMUState": "true"}
        SubElement(root, "ModelExchange", common, needsCompletedIntegratorStep=truth(self.step_events))
        SubElement(
            root,
            "CoSimulation",
            common,
            canHandleVariableCommunicationStepSize=self.variable_steps,
            fixedInternalStepSize=real(model.network.diagram.run.step),
            hasEventMode="true",
        )
        self.units(root)
        self.experiment(root)
        variables = SubElement(root, "ModelVariables")
        for reference, variable in enumerate(model.variables):
            self._variable(variables, reference, variable)
        self._structure(SubElement(root, "ModelStructure"))
        return root

    def element_units(self, variable: FmiVariable) -> tuple[str | None, ...]:
        """An array has one unit; where its rows differ, the description lists them."""
        if variable.dtype.kind != "f" or (isinstance(variable.unit, tuple) and len(set(variable.unit)) > 1):
            return ()
        return (variable.unit[0] if isinstance(variable.unit, tuple) else variable.unit,)

    def _variable(self, parent: Element, reference: int, v: FmiVariable) -> None:
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
            attributes["start"] = " ".join(text(value) for value in v.start.reshape(-1))
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

    def _reference(self, variable: FmiVariable) -> str:
        return str(self.place[variable])
