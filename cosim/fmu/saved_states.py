"""The state of an instance as bytes that another instance takes, in another process: what FMI's functions write.

Whether that is all of its state, the FMU alone knows. What shows outside is compared: an instance that has been given a
state has the outputs of the one that it comes from.
"""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from typing import Any

import numpy as np

from cosim.errors import CheckpointError, CosimError
from cosim.fmu import fields
from cosim.fmu.handles import Handles
from cosim.fmu.ports import Port
from cosim.fmu.trace import FmuTrace

WITHOUT = "run it without checkpoints"


def refusal(fmu: Any, component: Any) -> CosimError | None:
    """Why the instances of a block cannot be saved, and what does without; None where they can."""
    able = fmu.version.can_save
    if fmu.interface.canSerializeFMUstate:
        return None
    mode = "model-exchange" if fmu.kind == fields.MODEL_EXCHANGE else "co-simulation"
    message = f"block {component.name}: `{fmu.name}` cannot save its state as {mode}, as {able} is not true"
    others = {"model-exchange": fmu.description.modelExchange, "co-simulation": fmu.description.coSimulation}
    can = [mode for mode, kind in others.items() if kind is not None and kind.canSerializeFMUstate]
    fix = f"{WITHOUT}, or write `mode: {can[0]}`" if can else f"{WITHOUT}, or swap the block"
    return CheckpointError(message, component.entry.type.position, fix)


def save(fmu: Any, handles: Handles, trace: FmuTrace, k: int, time: float) -> dict[str, Any]:
    """The state of instance k at a time (s), and its outputs. Raises: FmuError, FmuFailed."""
    names, state, size = fmu.version.saving, ctypes.c_void_p(), ctypes.c_size_t()
    handles.call(k, names.get, ctypes.addressof(state), time=time)
    handles.call(k, names.size, state.value or 0, ctypes.addressof(size), time=time)
    try:
        content = np.zeros(size.value, np.uint8)
    except (MemoryError, ValueError):
        raise trace.failure(f"its state has {size.value} bytes, it says", k, time) from None
    handles.call(k, names.write, state.value or 0, content.ctypes.data, size.value, time=time)
    handles.call(k, names.free, ctypes.addressof(state), time=time)
    return {"bytes": content, "outputs": outputs(fmu, handles, k, time)}


def restore(fmu: Any, handles: Handles, trace: FmuTrace, k: int, saved: Mapping[str, Any], time: float) -> None:
    """Give a state to instance k, at a time (s). Raises: FmuError, FmuFailed."""
    names, state, content = fmu.version.saving, ctypes.c_void_p(), saved["bytes"]
    handles.call(k, names.read, content.ctypes.data, content.size, ctypes.addressof(state), time=time)
    handles.call(k, names.set, state.value or 0, time=time)
    handles.call(k, names.free, ctypes.addressof(state), time=time)
    for name, value in outputs(fmu, handles, k, time).items():
        if value.tobytes() != saved["outputs"][name].tobytes():
            text = (
                f"it has not taken its saved state: `{name}` is {value.tolist()}, not {saved['outputs'][name].tolist()}"
            )
            raise trace.failure(text, k, time, fix=WITHOUT)


def outputs(fmu: Any, handles: Handles, k: int, time: float) -> dict[str, np.ndarray]:
    """The outputs of instance k as they are, by name. Raises: FmuError, FmuFailed."""
    ports = {name: port for name, port in fmu.ports.items() if port.causality == "output"}
    return {name: _value(fmu, handles, k, name, port, time) for name, port in ports.items()}


def _value(fmu: Any, handles: Handles, k: int, name: str, port: Port, time: float) -> np.ndarray:
    narrow = port.code in (fields.INTEGER32, fields.BOOLEAN32)
    value = np.zeros(port.size, np.int32 if narrow else port.dtype)
    references = np.array(port.references, np.uint32)
    arguments = (references.ctypes.data, len(references), value.ctypes.data, *fmu.version.counts(port.size))
    handles.call(k, f"Get{port.accessor}", *arguments, about=name, time=time)
    return value
