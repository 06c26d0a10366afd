"""FMI 2.0: variables are scalars of four types, and functions are handed in for memory and messages."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from ctypes import c_char_p, c_int
from typing import Any, ClassVar

import numpy as np

from cosim.fmu import c_library, elements, fields, fmi, folders
from cosim.fmu.fmi import Call, Experiment, Group, NewInstance, StateFunctions, ValueType


class _Callbacks(ctypes.Structure):
    """fmi2CallbackFunctions."""

    _fields_ = [(n, ctypes.c_void_p) for n in ("logger", "allocate", "free", "step_finished", "environment")]


class Fmi2(fmi.Version):
    """FMI 2.0."""

    number = 2
    name = "2.0"
    delay = "FMI 2.0.5, section 4.2.4"
    types: ClassVar = {
        "Real": ValueType(np.float64, fields.FLOAT64, "Real"),
        "Integer": ValueType(np.int32, fields.INTEGER32, "Integer"),
        "Enumeration": ValueType(np.int32, fields.INTEGER32, "Integer"),
        "Boolean": ValueType(np.bool_, fields.BOOLEAN32, "Boolean"),
        "String": ValueType(object, fields.PLAIN, "String"),
    }
    functions: ClassVar = {
        fields.CO_SIMULATION: fmi.STEPPING,
        fields.MODEL_EXCHANGE: {
            **fmi.INTEGRATING,
            fields.GET_DERIVATIVES: "GetDerivatives",
            fields.UPDATE_DISCRETE_STATES: "NewDiscreteStates",
        },
    }
    optional: ClassVar = {
        fields.CO_SIMULATION: {
            fields.BOOLEAN_STATUS: "GetBooleanStatus",
            fields.REAL_STATUS: "GetRealStatus",
            fields.SET_INPUT_DERIVATIVES: "SetRealInputDerivatives",
            **fmi.able("GetFMUstate", "SetFMUstate"),
        },
        fields.MODEL_EXCHANGE: fmi.able("GetFMUstate", "SetFMUstate"),
    }
    saving = StateFunctions(
        *("GetFMUstate", "SetFMUstate", "FreeFMUstate"),
        *("SerializedFMUstateSize", "SerializeFMUstate", "DeSerializeFMUstate"),
    )
    can_save = "canSerializeFMUstate"

    def reads(self, version: str) -> bool:
        """As of `Version`."""
        return version == self.name

    def folder(self, system: str, architecture: str) -> str:
        """Where FMI 2 has no name for a platform, FMI 3's is usual."""
        return folders.short(system, architecture) or folders.long(system, architecture)

    def folders(self, system: str, architecture: str) -> list[str]:
        """As of `Version`."""
        return folders.both(system, architecture)[::-1]

    def groups(self, variables: Sequence[Any]) -> dict[str, Group]:
        """As of `Version`."""
        return elements.gathered(variables)

    def setup(self, experiment: Experiment) -> tuple[Call, ...]:
        """As of `Version`."""
        return (("SetupExperiment", *experiment),)

    def entry(self, experiment: Experiment) -> Call:
        """As of `Version`."""
        return ("EnterInitializationMode",)

    def counts(self, values: int) -> tuple[int, ...]:
        """As of `Version`."""
        return ()

    def instantiation(self, new: NewInstance) -> tuple[str, tuple[Any, ...]]:
        """As of `Version`."""
        calloc, free = c_library.address("calloc"), c_library.address("free")
        callbacks = _Callbacks(new.logger, calloc, free, None, new.environment)
        return "Instantiate", (
            c_char_p(new.name.encode()),
            c_int(new.kind != fields.MODEL_EXCHANGE),
            c_char_p(new.token.encode()),
            c_char_p(new.resources.resolve().as_uri().encode()),
            ctypes.pointer(callbacks),
            c_int(False),
            c_int(new.logging),
        )
