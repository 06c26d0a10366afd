"""FMI 3.0: variables are arrays of many types, and Co-Simulation may have an event mode."""

from __future__ import annotations

import os
from collections.abc import Sequence
from ctypes import c_bool, c_char_p, c_size_t, c_void_p
from typing import Any, ClassVar

import numpy as np

from cosim.fmu import fields, fmi, folders
from cosim.fmu.fmi import Call, Experiment, Group, NewInstance, StateFunctions, ValueType

_INTEGERS = [f"{kind}{bits}" for kind in ("Int", "UInt") for bits in (8, 16, 32, 64)]


class Fmi3(fmi.Version):
    """FMI 3.0."""

    number = 3
    name = "3.0"
    delay = "FMI 3.0.2, section 4.2, Step Mode"
    types: ClassVar = {
        "Float64": ValueType(np.float64, fields.FLOAT64, "Float64"),
        "Float32": ValueType(np.float32, fields.FLOAT32, "Float32"),
        **{name: ValueType(name.lower(), fields.PLAIN, name) for name in _INTEGERS},
        "Enumeration": ValueType(np.int64, fields.PLAIN, "Int64"),
        "Boolean": ValueType(np.bool_, fields.PLAIN, "Boolean"),
        "String": ValueType(object, fields.PLAIN, "String"),
        "Binary": ValueType(object, fields.PLAIN, "Binary"),
    }
    functions: ClassVar = {
        fields.CO_SIMULATION: fmi.STEPPING,
        fields.EVENT_CO_SIMULATION: {
            fields.EXIT_INITIALIZATION: "ExitInitializationMode",
            fields.ENTER_EVENT_MODE: "EnterEventMode",
            fields.UPDATE_DISCRETE_STATES: "UpdateDiscreteStates",
            fields.DO_STEP: "DoStep",
            fields.LEAVE_EVENT_MODE: "EnterStepMode",
        },
        fields.MODEL_EXCHANGE: fmi.INTEGRATING,
    }
    optional: ClassVar = {kind: fmi.able("GetFMUState", "SetFMUState") for kind in functions}
    saving = StateFunctions(
        *("GetFMUState", "SetFMUState", "FreeFMUState"),
        *("SerializedFMUStateSize", "SerializeFMUState", "DeserializeFMUState"),
    )
    can_save = "canSerializeFMUState"

    def reads(self, version: str) -> bool:
        """As of `Version`."""
        return version.startswith("3.")

    def folder(self, system: str, architecture: str) -> str:
        """As of `Version`."""
        return folders.long(system, architecture)

    def folders(self, system: str, architecture: str) -> list[str]:
        """As of `Version`."""
        return folders.both(system, architecture)

    def groups(self, variables: Sequence[Any]) -> dict[str, Group]:
        """As of `Version`."""
        return {v.name: ((v,), tuple(v.shape or ())) for v in variables}

    def setup(self, experiment: Experiment) -> tuple[Call, ...]:
        """As of `Version`."""
        return ()

    def entry(self, experiment: Experiment) -> Call:
        """As of `Version`."""
        return ("EnterInitializationMode", *experiment)

    def counts(self, values: int) -> tuple[int, ...]:
        """As of `Version`."""
        return (values,)

    def instantiation(self, new: NewInstance) -> tuple[str, tuple[Any, ...]]:
        """As of `Version`."""
        where = str(new.resources.resolve()) + os.sep
        texts = (c_char_p(text.encode()) for text in (new.name, new.token, where))
        first = (*texts, c_bool(False), c_bool(new.logging))
        callback = (c_void_p(new.environment), c_void_p(new.logger))
        if new.kind == fields.MODEL_EXCHANGE:
            return "InstantiateModelExchange", (*first, *callback)
        events = (c_bool(new.kind == fields.EVENT_CO_SIMULATION), c_bool(new.early))
        no_intermediate_variables, no_callback = (c_void_p(None), c_size_t(0)), c_void_p(None)
        return "InstantiateCoSimulation", (*first, *events, *no_intermediate_variables, *callback, no_callback)
