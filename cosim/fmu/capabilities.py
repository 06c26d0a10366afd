"""What the interfaces of an FMU can do, in words: the attributes of a model description, of which FMPy keeps some."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from cosim.fmu import archive

#: By FMI 3's and FMI 2's name of each attribute that is true or false.
_ABLE = {
    "canBeInstantiatedOnlyOncePerProcess": "one instance a process",
    "needsExecutionTool": "needs the tool that made it",
    "canHandleVariableCommunicationStepSize": "takes steps of any size",
    "hasEventMode": "event mode (direct feedthrough without delay)",
    "mightReturnEarlyFromDoStep": "may return early from a step",
    "canReturnEarlyAfterIntermediateUpdate": "can return early after an intermediate update",
    "providesIntermediateUpdate": "intermediate update",
    "canInterpolateInputs": "interpolates inputs",
    "canRunAsynchronuously": "can step asynchronously",
    "needsCompletedIntegratorStep": "wants to know of completed steps",
    "providesEvaluateDiscreteStates": "evaluates discrete states apart",
    "canGetAndSetFMUState": "state can be saved and restored",
    "canGetAndSetFMUstate": "state can be saved and restored",
    "canSerializeFMUState": "state can be serialised",
    "canSerializeFMUstate": "state can be serialised",
    "providesDirectionalDerivatives": "directional derivatives",
    "providesDirectionalDerivative": "directional derivatives",
    "providesAdjointDerivatives": "adjoint derivatives",
    "providesPerElementDependencies": "dependencies of single elements",
    "canNotUseMemoryManagementFunctions": "manages its own memory",
}
#: Of each attribute that is a number, where it is not 0.
_NUMBERS = {
    "fixedInternalStepSize": "fixed steps of {} s inside",
    "maxOutputDerivativeOrder": "derivatives of outputs up to order {}",
    "recommendedIntermediateInputSmoothness": "inputs of smoothness {} recommended",
}
_INTERFACES = {
    "CoSimulation": "co-simulation",
    "ModelExchange": "model-exchange",
    "ScheduledExecution": "scheduled execution (cannot be run here)",
}


def read(folder: Path, version: int) -> dict[str, list[str]]:
    """By the kind of interface of an unpacked FMU, what it can do; version: of FMI, 2 or 3."""
    from lxml import etree

    root = etree.parse(str(folder / archive.DESCRIPTION)).getroot()
    found = {}
    for tag, kind in _INTERFACES.items():
        for element in root.findall(tag):
            attributes = dict(element.attrib)
            if version == 2 and tag == "ModelExchange":  # which says it the other way round
                spared = attributes.get("completedIntegratorStepNotNeeded") in ("true", "1")
                attributes["needsCompletedIntegratorStep"] = str(not spared).lower()
            found[kind] = _words(attributes)
    return found


def _words(attributes: Mapping[str, str]) -> list[str]:
    able = [words for name, words in _ABLE.items() if attributes.get(name) in ("true", "1")]
    numbers = [words.format(attributes[name]) for name, words in _NUMBERS.items() if attributes.get(name, "0") != "0"]
    return able + numbers
