"""From nothing to Initialization Mode: instances are made, and get their parameters and start values."""

from __future__ import annotations

import ctypes
from collections.abc import Collection
from typing import Any

import numpy as np

from cosim.authoring.variables import Input, Parameter
from cosim.errors import WrongValue
from cosim.fmu import fields, messages
from cosim.fmu.fmi import NewInstance
from cosim.fmu.handles import Handles
from cosim.fmu.ports import Port
from cosim.fmu.trace import FmuTrace


class Initialization:
    """The first calls of the instances of a block.

    fmu: a `cosim.fmu.imported.Fmu`. component: its block in the network. members: which of its instances, from 0.
    """

    def __init__(self, fmu: Any, component: Any, members: range, trace: FmuTrace, handles: Handles) -> None:
        self._fmu = fmu
        self._component = component
        self._members = members
        self._trace = trace
        self._handles = handles

    def instantiate(self, k: int) -> None:
        """Make instance k. Raises: FmuError, FmuFailed."""
        fmu = self._fmu
        resources = fmu.folder / "resources"
        resources.mkdir(exist_ok=True)
        categories = fmu.settings.categories
        new = NewInstance(
            name=self._trace.instance_name(k),
            token=fmu.description.guid or "",
            resources=resources,
            kind=fmu.kind,
            early=fmu.kind == fields.EVENT_CO_SIMULATION and bool(fmu.interface.mightReturnEarlyFromDoStep),
            logging=fmu.settings.logging,
            logger=messages.logger(fmu.version.number),
            environment=self._trace.messages[k].environment,
        )
        self._handles.make(new)
        if categories:
            names = (ctypes.c_char_p * len(categories))(*[c.encode() for c in categories])
            self._handles.call(k, "SetDebugLogging", 1, len(categories), ctypes.addressof(names))

    def enter(self, k: int) -> None:
        """Set parameters and start values of instance k, and have it enter Initialization Mode.

        Raises: FmuError, FmuFailed, WrongValue.
        """
        fmu = self._fmu
        self._configure(k, {name for name, port in fmu.ports.items() if port.is_structural})
        for call in fmu.version.setup(fmu.settings.experiment):
            self._handles.call(k, *call)
        inputs = {name for name, port in fmu.ports.items() if port.first.causality == "input"}
        self._set_given(k, {name for name, port in fmu.ports.items() if not port.is_structural} - inputs)
        self._handles.call(k, *fmu.version.entry(fmu.settings.experiment))
        self._set_given(k, inputs - self._component.wires.keys())  # the loop sets those that are wired

    def _configure(self, k: int, names: Collection[str]) -> None:
        """Give instance k those structural parameters that the diagram gives other values than the FMU has."""
        if any(name in self._component.values and self._is_given(name, self._fmu.ports[name]) for name in names):
            self._handles.call(k, "EnterConfigurationMode")
            self._set_given(k, names)
            self._handles.call(k, "ExitConfigurationMode")

    def _set_given(self, k: int, names: Collection[str]) -> None:
        """Set those of these variables of instance k that the diagram gives other values than the FMU does."""
        given = self._component.values
        for name, port in self._fmu.ports.items():
            if name in names and name in given and self._is_given(name, port):
                self._set(k, name, port, given[name][self._members[k] if len(given[name]) > 1 else 0])

    def _is_given(self, name: str, port: Port) -> bool:
        """Whether a value has to be set, because it is not the FMU's own. Raises: WrongValue."""
        component = self._component
        variable = component.declaration.variables[name]
        if isinstance(variable, (Parameter, Input)):
            own = port.start()
            if name in component.given or own is None:
                return name in component.given or not port.is_text
            return bool(np.any(component.values[name] != np.array(own, port.dtype)))
        if name in component.given and not port.can_start:
            message = f"block {component.name}: `{self._fmu.name}` calculates `{name}`, which has no start value"
            raise WrongValue(message, component.entry.start[name].position, "remove this start value")
        return name in component.given

    def _set(self, k: int, name: str, port: Port, value: np.ndarray) -> None:
        references = np.array(port.references, np.uint32)
        sizes: tuple[int, ...] = ()
        if port.is_text:
            raw = [port.encoded(str(text)) for text in np.asarray(value, object).reshape(-1)]
            lengths = np.array([len(data) for data in raw], np.uint64)
            sizes = (lengths.ctypes.data,) if port.is_binary else ()
            data: Any = (ctypes.c_char_p * len(raw))(*raw)
            address = ctypes.addressof(data)
        else:
            narrow = port.code in (fields.INTEGER32, fields.BOOLEAN32)
            data = np.ascontiguousarray(value, np.int32 if narrow else port.dtype)
            address = data.ctypes.data
        counts = self._fmu.version.counts(port.size)
        arguments = (references.ctypes.data, len(references), *sizes, address, *counts)
        self._handles.call(k, f"Set{port.accessor}", *arguments, about=f"`{name}`")
