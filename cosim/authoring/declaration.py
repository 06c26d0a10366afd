"""All that a block class says of itself: its variables, its functions with what they read and write, its rules."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

from cosim.authoring.foreign import Foreign
from cosim.authoring.rules import Rule
from cosim.authoring.variables import Dimension, Input, Local, Output, State, Variable
from cosim.errors import CosimError

AnyVariable = TypeVar("AnyVariable", bound=Variable)
KINDS = ("calculate", "start", "outputs", "derivatives", "update", "indicators", "event")
#: Of these, what is called before the first step of a run only.
BEGINNING = KINDS[:2]
#: What the name of a state begins with where a function writes what becomes of it.
PREFIXES = {"derivatives": "d_", "update": "next_", "event": "next_"}


@dataclass(frozen=True)
class Function:
    """One function of a block with what it reads and writes, in the order of its arguments.

    held: whether what it writes stays between two communication points and events.
    """

    name: str
    kind: str
    python: Callable[..., Any]
    arguments: tuple[str, ...]
    writes: frozenset[str]
    held: bool = False

    @property
    def reads(self) -> tuple[str, ...]:
        """The variables (and `time`) that the function reads."""
        return tuple(a for a in self.arguments if a not in self.writes)


@dataclass
class Declaration:
    """All that a block class says of itself.

    Foreign blocks have functions of further kinds: ``initial`` (instead of `outputs`, at initialization), ``begin``
    (its end), ``step`` (from one communication point to the next), ``events`` (those of the step that ends now begin,
    before outputs are evaluated), ``settle`` (they end, with the inputs of this communication point) and ``times`` (the
    next one that is known). They may be `sampled`: what they give changes at communication points only. Some take steps
    of one size only (`rigid`), or may stop within a step at an event (`early`), or goes on with its inputs in a step
    as they are extrapolated (`interpolates`).

    home: the class itself. mistakes: all that contradicts itself in the class, except inside its functions. elsewhere:
    what became of names that a foreign block has and this does not.
    """

    name: str
    doc: str
    variables: dict[str, Variable] = field(default_factory=dict)
    dimensions: dict[str, Dimension] = field(default_factory=dict)
    functions: tuple[Function, ...] = ()
    rules: tuple[Rule, ...] = ()
    measuring: bool = False
    compiled: bool = True
    foreign: Foreign | None = None
    sampled: bool = False
    rigid: bool = False
    early: bool = False
    interpolates: bool = False
    most_instances: int | None = None
    home: type | None = None
    mistakes: tuple[CosimError, ...] = ()
    elsewhere: Mapping[str, str] = field(default_factory=dict)

    def of(self, *classes: type[AnyVariable]) -> Iterator[AnyVariable]:
        """The variables of the given classes, in the order of their declaration."""
        return (v for v in self.variables.values() if isinstance(v, classes))

    def dimension_names(self) -> list[str]:
        """The named dimensions of all variables, in the order in which they are first used."""
        return list(dict.fromkeys(d for v in self.variables.values() for d in v.shape if isinstance(d, str)))

    def kind(self, kind: str) -> tuple[Function, ...]:
        """The functions of one kind, in the order of their definition."""
        return tuple(f for f in self.functions if f.kind == kind)

    def evaluated(self, starts: bool) -> tuple[Function, ...]:
        """The functions that give outputs and locals, at a communication point or (`starts`) at initialization."""
        return self.kind("initial" if starts and self.foreign else "outputs")

    def writer(self, name: str, starts: bool = False) -> Function | None:
        """The function that computes an output or local, as of `evaluated`; None for a state."""
        return next((f for f in self.evaluated(starts) if name in f.writes), None)

    def startable(self) -> list[Variable]:
        """What a diagram may give a start value: states, inputs, and outputs of a foreign block that have one."""
        return [v for v in self.of(State, Input, Output, Local) if isinstance(v, (State, Input)) or v.start is not None]

    def guessable(self) -> list[Variable]:
        """What a diagram may give a guess: a real output of an author's block, which may be in an algebraic loop."""
        return [] if self.foreign else [v for v in self.of(Output) if v.dtype == float]

    def along(self, rule: Rule) -> list[str]:
        """What a rule names of that which the block computes: if anything, it is judged after a run."""
        computed = {v.name for v in self.of(Output, Local, State)}
        return [name for name in rule.arguments if name in computed]

    def feeds_locals_only(self, name: str) -> bool:
        """Whether nothing but locals comes of an input: what it brings then reaches no port and no state."""
        reached = {name}
        for function in self.functions:
            if reached & set(function.reads):
                if not all(isinstance(self.variables.get(w), Local) for w in function.writes):
                    return False
                reached |= function.writes
        return True

    def continuous(self) -> list[State]:
        """The states that `derivatives` drives."""
        driven = {a for f in self.kind("derivatives") for a in f.writes}
        return [s for s in self.of(State) if f"d_{s.name}" in driven]

    def discrete(self) -> list[State]:
        """The states that `update` drives."""
        driven = {a for f in self.kind("update") for a in f.writes}
        return [s for s in self.of(State) if f"next_{s.name}" in driven]

    def jumping(self) -> list[State]:
        """The states that `event` resets."""
        driven = {a for f in self.kind("event") for a in f.writes}
        return [s for s in self.of(State) if f"next_{s.name}" in driven]


def is_scalar(variable: Variable, function: Function, argument: str) -> bool:
    """Whether an argument comes as a number: a scalar that the function only reads."""
    return variable.shape == () and argument not in function.writes


def variable_of(declaration: Declaration, argument: str) -> Variable:
    """The variable behind an argument; ``d_x`` and ``next_x`` have the shape of ``x``."""
    if argument in declaration.variables:
        return declaration.variables[argument]
    return declaration.variables[argument.partition("_")[2]]
