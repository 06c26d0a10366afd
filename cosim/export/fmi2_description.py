"""Writes modelDescription.xml for FMI 2.0.4 (sections 2.2, 3.3, 4.3)."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement

import numpy as np

from cosim.export.model import FmiVariable, Model
from cosim.export.model_description import TOOL, ModelDescription, Scalar, text, truth
from cosim.fmu.versions import FMI2


class Fmi2Description(ModelDescription):
    """FMI 2.0's, of scalars."""

    version = FMI2
    state_phases = 0

    def __init__(self, model: Model) -> None:
        super().__init__(model)
        self.scalars = _scalars(model)
        self.first: list[int] = []
        count = 0
        for variable in model.variables:
            self.first.append(count)
            count += variable.size

    def root(self, token: str) -> Element:
        """As of `ModelDescription`."""
        model = self.model
        root = Element(
            "fmiModelDescription",
            fmiVersion=self.version.name,
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
        SubElement(root, "ModelExchange", common, completedIntegratorStepNotNeeded=truth(not self.step_events))
        SubElement(root, "CoSimulation", common, canHandleVariableCommunicationStepSize=self.variable_steps)
        self.units(root)
        self.experiment(root)
        variables = SubElement(root, "ModelVariables")
        for reference, scalar in enumerate(self.scalars):
            self._variable(variables, reference, scalar)
        self._structure(SubElement(root, "ModelStructure"))
        return root

    def element_units(self, variable: FmiVariable) -> tuple[str | None, ...]:
        """As of `ModelDescription`."""
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
            values["start"] = text(v.start.reshape(-1)[scalar.element])
        if v.state:
            state = self.place[self.model.of(v.state)]
            values["derivative"] = str(self.first[state] + scalar.element + 1)
        SubElement(element, kind, values)

    def _unit(self, variable: FmiVariable, element: int) -> str | None:
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

    def _indices(self, variable: FmiVariable, member: int | None) -> range:
        """The places of a variable's elements (of one member of a fleet) among the model's variables, from 1."""
        first = self.first[self.place[variable]] + 1
        if member is None:
            return range(first, first + variable.size)
        size = variable.size // variable.shape[0]
        return range(first + member * size, first + (member + 1) * size)


def _scalars(model: Model) -> list[Scalar]:
    """All elements of all variables, row by row."""
    result = []
    for k, variable in enumerate(model.variables):
        for element, index in enumerate(np.ndindex(variable.shape)):
            subscript = f"[{','.join(str(n + 1) for n in index)}]" if index else ""
            derivative = variable.name.startswith("der(")
            name = f"{variable.name[:-1]}{subscript})" if derivative else f"{variable.name}{subscript}"
            result.append(Scalar(k, element, name))
    return result
