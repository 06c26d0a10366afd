"""Drives one FMU of either version through FMPy, with variables by name as arrays."""

from __future__ import annotations

import re
from ctypes import byref, c_double
from pathlib import Path

import numpy as np
from fmpy import extract, read_model_description
from fmpy.fmi2 import (
    FMU2Model,
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)
from fmpy.fmi3 import FMU3Model, FMU3Slave
from fmpy.logging import addLoggerProxy

FMI2 = {"Real": "Real", "Integer": "Integer", "Boolean": "Boolean"}


class Host:
    """One instance. version: "2.0" or "3.0"; me: Model Exchange; events: FMI 3 Co-Simulation with Event Mode."""

    def __init__(self, path: Path, me: bool = False, events: bool = False, token: str | None = None) -> None:
        self.folder = extract(path)
        self.description = read_model_description(self.folder)
        self.version = self.description.fmiVersion
        self.variables = {v.name: v for v in self.description.modelVariables}
        self.messages: list[str] = []
        interface = self.description.modelExchange if me else self.description.coSimulation
        types = {
            ("2.0", True): FMU2Model,
            ("2.0", False): FMU2Slave,
            ("3.0", True): FMU3Model,
            ("3.0", False): FMU3Slave,
        }
        self.fmu = types[self.version, me](
            guid=token or self.description.guid or self.description.instantiationToken,
            unzipDirectory=self.folder,
            modelIdentifier=interface.modelIdentifier,
            instanceName="one",
        )
        if self.version == "2.0":
            self.fmu.instantiate(callbacks=self._callbacks(), loggingOn=True)
        elif me:
            self.fmu.instantiate(loggingOn=True, logMessage=self._log3)
        else:
            self.fmu.instantiate(loggingOn=True, logMessage=self._log3, eventModeUsed=events)

    def _callbacks(self):
        from fmpy import fmi2

        def log(environment, name, status, category, message):
            self.messages.append(message.decode())

        self.keep = fmi2CallbackLoggerTYPE(log)
        callbacks = fmi2CallbackFunctions()
        callbacks.logger = self.keep
        callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(fmi2.calloc)
        callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(fmi2.free)
        addLoggerProxy(byref(callbacks))
        return callbacks

    def _log3(self, environment, status, category, message):
        self.messages.append(message.decode())

    # ---- variables ----

    def _elements(self, name: str):
        """FMI 2: the elements of an array in order."""
        if name in self.variables:
            return [self.variables[name]]
        head, tail = (name[:-1], r"\)") if name.startswith("der(") else (name, "")
        pattern = re.compile(re.escape(head) + r"\[[0-9,]+\]" + tail)
        return [v for n, v in self.variables.items() if pattern.fullmatch(n)]

    def get(self, name: str) -> np.ndarray:
        """A variable, flat."""
        if self.version == "2.0":
            chosen = self._elements(name)
            values = getattr(self.fmu, f"get{chosen[0].type}")([v.valueReference for v in chosen])
            return np.array([v if chosen[0].type == "Real" else int(v) for v in values])
        v = self.variables[name]
        size = int(np.prod(v.shape)) if v.shape else 1
        return np.array(getattr(self.fmu, f"get{v.type}")([v.valueReference], size))

    def set(self, name: str, values) -> None:
        """A variable, flat."""
        values = np.asarray(values).reshape(-1).tolist()
        if self.version == "2.0":
            chosen = self._elements(name)
            getattr(self.fmu, f"set{chosen[0].type}")([v.valueReference for v in chosen], values)
        else:
            v = self.variables[name]
            getattr(self.fmu, f"set{v.type}")([v.valueReference], values)

    # ---- phases ----

    def initialize(self, start: float = 0.0, stop: float | None = None, **values) -> Host:
        """From instantiated to the first communication point (or Event Mode); values are set before."""
        for name, value in values.items():
            self.set(name, value)
        if self.version == "2.0":
            self.fmu.setupExperiment(startTime=start, stopTime=stop)
            self.fmu.enterInitializationMode()
        else:
            self.fmu.enterInitializationMode(startTime=start, stopTime=stop)
        self.fmu.exitInitializationMode()
        return self

    def step(self, time: float, size: float) -> None:
        """One communication step."""
        self.fmu.doStep(currentCommunicationPoint=time, communicationStepSize=size)

    def state(self):
        """A copy of the whole FMU state, serialized."""
        if self.version == "2.0":
            state = self.fmu.getFMUstate()
            data = self.fmu.serializeFMUstate(state)
            self.fmu.freeFMUstate(state)
        else:
            state = self.fmu.getFMUState()
            data = self.fmu.serializeFMUState(state)
            self.fmu.freeFMUState(state)
        return data

    def restore(self, data) -> None:
        """Go back to a serialized state."""
        if self.version == "2.0":
            self.fmu.setFMUstate(self.fmu.deSerializeFMUstate(data))
        else:
            self.fmu.setFMUState(self.fmu.deserializeFMUState(data))

    def new_discrete_states(self) -> float | None:
        """Event Mode: the time of the next event."""
        if self.version == "2.0":
            again, terminate, nominals, states, defined, time = self.fmu.newDiscreteStates()
        else:
            again, terminate, nominals, states, defined, time = self.fmu.updateDiscreteStates()
        assert not (again or terminate or nominals or states)
        return time if defined else None

    def derivatives(self, n: int) -> np.ndarray:
        """Model Exchange: the derivatives."""
        values = (c_double * n)()
        if self.version == "2.0":
            self.fmu.getDerivatives(values, n)
        else:
            self.fmu.getContinuousStateDerivatives(values, n)
        return np.array(values)

    def states(self, n: int) -> np.ndarray:
        """Model Exchange: the continuous states."""
        values = (c_double * n)()
        self.fmu.getContinuousStates(values, n)
        return np.array(values)

    def set_states(self, x: np.ndarray) -> None:
        """Model Exchange: set the continuous states."""
        self.fmu.setContinuousStates((c_double * len(x))(*x), len(x))

    def free(self) -> None:
        """End the instance."""
        self.fmu.freeInstance()
