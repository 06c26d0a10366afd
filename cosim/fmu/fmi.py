"""What one version of FMI is to the rest: the names that it has, the types of its variables, how its calls go."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

from cosim.fmu import fields

#: The variables behind a port, in row-major order, and its shape.
Group = tuple[tuple[Any, ...], tuple[int, ...]]
#: A function without FMI's prefix, and what it is called with after the instance.
Call = tuple[str, *tuple[int | float, ...]]

#: Whether there is a tolerance, it, the start time (s), whether there is a stop time, it (s).
Experiment = tuple[int, float, float, int, float]
STEPPING = {fields.EXIT_INITIALIZATION: "ExitInitializationMode", fields.DO_STEP: "DoStep"}
INTEGRATING = {
    fields.EXIT_INITIALIZATION: "ExitInitializationMode",
    fields.SET_TIME: "SetTime",
    fields.SET_STATES: "SetContinuousStates",
    fields.GET_STATES: "GetContinuousStates",
    fields.GET_DERIVATIVES: "GetContinuousStateDerivatives",
    fields.GET_INDICATORS: "GetEventIndicators",
    fields.ENTER_EVENT_MODE: "EnterEventMode",
    fields.UPDATE_DISCRETE_STATES: "UpdateDiscreteStates",
    fields.LEAVE_EVENT_MODE: "EnterContinuousTimeMode",
}


def able(get: str, set_: str) -> dict[int, str]:
    """The functions that keep a state, go back to it, and give derivatives, by the word of the link."""
    derivatives = {fields.DIRECTIONAL_DERIVATIVE: "GetDirectionalDerivative"}
    return {fields.GET_FMU_STATE: get, fields.SET_FMU_STATE: set_} | derivatives


class ValueType(NamedTuple):
    """A type of variables: our data type, how values travel, the word in the names of getter and setter."""

    dtype: Any
    code: int
    accessor: str


class StateFunctions(NamedTuple):
    """The functions that save an instance's state, as bytes too, and give it back, without FMI's prefix."""

    get: str
    set: str
    free: str
    size: str
    write: str
    read: str


@dataclass(frozen=True)
class NewInstance:
    """What an FMU is told of an instance that it is to make.

    kind: of `cosim.fmu.fields`. early: whether it may return early from a step. logger: the address of the call-back,
    environment: of what that is called with.
    """

    name: str
    token: str
    resources: Path
    kind: int
    early: bool
    logging: bool
    logger: int
    environment: int


class Version(ABC):
    """A version of FMI.

    number: of the tables, the headers and the C functions. name: as a person writes it. delay: where it says that a
    step comes between an input and what follows from it. types: by their names in a model description.
    functions, optional: what the adapter calls of each kind of FMU, and what it does where there is such a function, by
    the word of the link. saving: what saves the state of an instance as bytes. can_save: the attribute that says that
    there is all of this.
    """

    number: ClassVar[int]
    name: ClassVar[str]
    delay: ClassVar[str]
    types: ClassVar[dict[str, ValueType]]
    functions: ClassVar[dict[int, dict[int, str]]]
    optional: ClassVar[dict[int, dict[int, str]]]
    saving: ClassVar[StateFunctions]
    can_save: ClassVar[str]

    @property
    def prefix(self) -> str:
        """What the names of its C functions begin with."""
        return f"fmi{self.number}"

    @abstractmethod
    def reads(self, version: str) -> bool:
        """Whether a model description is of this version, as of its attribute `fmiVersion`."""

    @abstractmethod
    def folder(self, system: str, architecture: str) -> str:
        """The folder below `binaries` that a library for a platform is written to."""

    @abstractmethod
    def folders(self, system: str, architecture: str) -> list[str]:
        """The folders below `binaries` that may have a library for a platform, the version's own name first."""

    @abstractmethod
    def groups(self, variables: Sequence[Any]) -> dict[str, Group]:
        """The variables of a model description as scalars and arrays, by name."""

    @abstractmethod
    def setup(self, experiment: Experiment) -> tuple[Call, ...]:
        """The calls before values are set."""

    @abstractmethod
    def entry(self, experiment: Experiment) -> Call:
        """The call into Initialization Mode."""

    @abstractmethod
    def counts(self, values: int) -> tuple[int, ...]:
        """What a getter or a setter takes behind the address of so many values."""

    @abstractmethod
    def instantiation(self, new: NewInstance) -> tuple[str, tuple[Any, ...]]:
        """The function that makes an instance, and its typed arguments, which have to live as long as the instance."""
