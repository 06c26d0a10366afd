"""How a signal block is declared: its variables, and functions whose argument names say what they read and write.

A block is a class::

    class Lag(Block):
        '''First-order lag, T dx/dt = u - x.'''

        u = Input("n", description="signal to be smoothed")
        x = State("n", output=True, description="smoothed signal")
        T = Parameter(unit="s", default=1.0, description="time constant")

        def derivatives(u, x, T, d_x):
            for q in range(x.size):
                d_x[q] = (u[q] - x[q]) / T

Its functions are plain functions over arrays (no `self`), so they can be called alone, in a test or a notebook. What a
function *reads* are the variables that it names; what it *writes*, in place, follows from its kind:

=================  ==========================================================================================
function           writes
=================  ==========================================================================================
``calculate``      the calculated parameters that it names, once, before the first step
``start``          the states that it names, once, from parameters and inputs at time zero
``outputs…``       the outputs and locals that it names and that no function before it writes; any number of such
                   functions, so that direct feedthrough is known per output
``derivatives``    ``d_<state>`` for the continuous states
``update``         ``next_<state>`` for the discrete states, once a period; it comes with the state's value, so that
                   what stays need not be written
=================  ==========================================================================================

A scalar that is read comes as a number, one that is written as an array of one element. ``time`` (s) may be named by
any function. Raising an exception (with constant arguments) in a function stops the run and names the block, and so
does an index out of bounds (a negative one counts from the end). What is read cannot be written.

Numbers are float64, int64 and bool, whatever the width in which a variable is stored, and behave alike to the bit
compiled and interpreted: real numbers as IEEE 754 has them (1/0 is infinite, ``math.sqrt(-1)`` is NaN), integers wrap;
integer division by zero, and a number that its variable cannot hold, stop the run. What the two could not do alike
(sums over arrays, new arrays, other functions than ``math``'s) is refused with its line.
"""

from __future__ import annotations

import inspect
import types
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from cosim import naming
from cosim.errors import CosimError, DeclarationError, Problems, nearest
from cosim.foreign import Foreign

Unit = str | tuple[str, ...] | None
KINDS = ("calculate", "start", "outputs", "derivatives", "update")


class Variable:
    """One declared quantity of a block.

    shape: sizes or names of dimensions, () for a scalar. unit: one for all elements, or one for each element of the
    first axis, or None where the block does not care. dtype: one of `cosim.naming.TYPES`; a block that is no author's
    may have others. finite: a run in which it
    becomes NaN, infinite or as large as `cosim.engine.LIMIT` has diverged; False for what means something by NaN or
    infinity, such as a table of events or the distance to nobody.
    """

    causality: ClassVar[str]
    any_integer = False  # whether it takes the integer type of the port at the other end, as FMI 2's one type does

    def __init__(
        self,
        *shape: int | str,
        unit: Unit = None,
        description: str = "",
        dtype: Any = float,
        start: Any = None,
        finite: bool = True,
    ) -> None:
        self.name = ""
        self.shape = shape
        self.unit = unit
        self.description = description
        self.dtype = np.dtype(dtype)
        self.start = start
        self.finite = finite

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __repr__(self) -> str:
        return f"{type(self).__name__} {self.name}{list(self.shape)}"


class Input(Variable):
    """A signal that a wire brings; with `start`, it may stay unconnected and holds that value.

    only: the name of the ports that may be wired to it, whatever their block; "" for any.
    """

    causality = "input"

    def __init__(self, *shape: int | str, only: str = "", **more: Any) -> None:
        super().__init__(*shape, **more)
        self.only = only


class Output(Variable):
    """A signal that other blocks may read. `event`: for a boolean, what to report when it first becomes true."""

    causality = "output"

    def __init__(self, *shape: int | str, event: str = "", **more: Any) -> None:
        super().__init__(*shape, **more)
        self.event = event


class Local(Variable):
    """A quantity that recordings, measuring blocks and other locals may read, ports may not.

    Also a work space, whose content lasts for a call: what is to last longer is a State. Every element is written,
    unless it says finite=False.
    """

    causality = "local"

    def __init__(self, *shape: int | str, event: str = "", **more: Any) -> None:
        super().__init__(*shape, **more)
        self.event = event


class State(Variable):
    """A continuous state if `derivatives` writes ``d_<name>``, a discrete one if `update` writes ``next_<name>``.

    With `output=True` it is an output too, one without direct feedthrough; else it is local.
    """

    def __init__(self, *shape: int | str, output: bool = False, start: Any = 0.0, **more: Any) -> None:
        super().__init__(*shape, start=start, **more)
        self.output = output

    @property
    def causality(self) -> str:  # type: ignore[override]
        """FMI causality: ``output`` or ``local``."""
        return "output" if self.output else "local"


class Parameter(Variable):
    """A value fixed before the run; without a default, a diagram has to set it.

    misnamed: whether the default was given as `start`, which its author is told when the block is declared.
    """

    causality = "parameter"

    def __init__(self, *shape: int | str, default: Any = None, start: Any = None, **more: Any) -> None:
        super().__init__(*shape, start=default, **more)
        self.misnamed = start is not None


class CalculatedParameter(Variable):
    """A value that `calculate` computes once from the parameters."""

    causality = "calculatedParameter"


@dataclass
class Dimension:
    """A named dimension with a default size; names used in shapes without this are solved from the wiring."""

    default: int
    description: str = ""


Verdict = bool | None | tuple[bool | None, str]


@dataclass(frozen=True)
class Course:
    """What a variable of one member did along a run: its extremes over all steps and elements, and when (s)."""

    smallest: float
    smallest_at: float
    largest: float
    largest_at: float


@dataclass
class Rule:
    """A condition on a block's parameters: violated, it is an error, or a warning where `warning` is set.

    The function may name parameters, dimensions and inputs (which come as the `Source` at the other end of the
    wire), and returns whether the rule holds, or that and a text with its numbers. A condition may also name `stop`,
    the run's end (s), `method`, the run's, and what its block computes, which comes as a `Course`: then it is judged
    after a run. It may return None for "holds": nobody can say. Anything but True, False or that is a mistake.
    """

    text: str
    source: str
    function: Callable[..., Verdict]
    warning: bool = False

    @cached_property
    def arguments(self) -> tuple[str, ...]:
        """What the rule's function names."""
        return tuple(inspect.signature(self.function).parameters)


def rule(text: str, source: str = "") -> Callable[[Callable[..., Any]], Rule]:
    """Decorate a function of parameters as a rule that every diagram has to keep."""
    return lambda function: Rule(text, source, function)


def condition(text: str, source: str = "") -> Callable[[Callable[..., Any]], Rule]:
    """Decorate a function as a condition of a theorem: `cosim check` shows its numbers and warns where it fails.

    One that names outputs, locals or states of its block is judged along a run: `cosim run` warns where it failed.
    """
    return lambda function: Rule(text, source, function, warning=True)


@dataclass(frozen=True)
class Function:
    """One function of a block with what it reads and writes, in the order of its arguments."""

    name: str
    kind: str
    python: Callable[..., Any]
    arguments: tuple[str, ...]
    writes: frozenset[str]

    @property
    def reads(self) -> tuple[str, ...]:
        """The variables (and `time`) that the function reads."""
        return tuple(a for a in self.arguments if a not in self.writes)


@dataclass
class Declaration:
    """All that a block class says of itself.

    Foreign blocks have functions of further kinds: ``initial`` (instead of `outputs`, at initialization), ``begin``
    (its end), ``step`` (from one communication point to the next), ``events`` (those of the step that ends now begin,
    before outputs are evaluated) and ``settle`` (they end, with the inputs of this communication point). They may be
    `sampled`: what they give changes at communication points only.

    home: the class itself. mistakes: all that contradicts itself in the class, except inside its functions.
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
    most_instances: int | None = None
    home: type | None = None
    mistakes: tuple[CosimError, ...] = ()

    def of(self, *classes: type[Variable]) -> Iterator[Variable]:
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
        return [s for s in self.of(State) if f"d_{s.name}" in driven]  # type: ignore[misc]

    def discrete(self) -> list[State]:
        """The states that `update` drives."""
        driven = {a for f in self.kind("update") for a in f.writes}
        return [s for s in self.of(State) if f"next_{s.name}" in driven]  # type: ignore[misc]


def _declare(cls: Any, compiled: bool) -> Declaration:
    members: dict[str, Any] = {}
    for base in reversed(cls.__mro__):
        members.update(vars(base))
    declaration = Declaration(
        name=cls.__name__,
        doc=inspect.cleandoc(cls.__doc__ or ""),
        variables={k: v for k, v in members.items() if isinstance(v, Variable)},
        dimensions={k: v for k, v in members.items() if isinstance(v, Dimension)},
        rules=tuple(v for v in members.values() if isinstance(v, Rule)),
        measuring=cls.measuring is True,
        compiled=compiled,
        home=cls,
    )
    problems = Problems()
    for mistake in naming.mistakes(cls, members):
        problems.add(mistake)
    written: set[str] = set()
    functions = []
    for name, member in members.items():
        kind = naming.kind(name)
        python = member.__func__ if isinstance(member, staticmethod) else member
        if kind is None or not isinstance(python, types.FunctionType):
            continue
        functions.append(_function(declaration, name, kind, python, written, problems))
        setattr(cls, name, staticmethod(python))
    declaration.functions = tuple(functions)
    _check_complete(declaration, problems)
    for rule in declaration.rules:
        _check_rule(declaration, rule, problems)
    declaration.mistakes = tuple(problems.sorted())
    return declaration


def _check_rule(declaration: Declaration, rule: Rule, problems: Problems) -> None:
    """A rule names what is known when it is judged."""
    known = {v.name for v in declaration.of(Parameter, Input)} | {*declaration.dimension_names()}
    if rule.warning:
        known |= {v.name for v in declaration.of(Output, Local, State)} | {"stop", "method"}
    for argument in rule.arguments:
        if argument not in known:
            message = f"block {declaration.name}: the rule `{rule.text}` names `{argument}`"
            what = "what the block computes can be named by a `condition` only" if not rule.warning else ""
            computed = argument in declaration.variables
            place = naming.place_of_argument(rule.function, argument)
            problems.add(DeclarationError(message, place, what if computed and what else nearest(argument, known)))


def _function(
    declaration: Declaration, name: str, kind: str, python: Any, written: set[str], problems: Problems
) -> Function:
    """Read a function's signature; `written` gathers what the functions before it write."""
    if wrong := naming.signature(python):
        fix = f"write a plain def {name}(…), whose arguments are variables of the block"
        where = naming.place_of_argument(python, "") or naming.place_in(declaration.home, name)
        problems.add(DeclarationError(f"block {declaration.name}: {name}() {wrong}", where, fix))
    arguments = python.__code__.co_varnames[: python.__code__.co_argcount]
    writes = set()
    for argument in arguments:
        said = None
        prefix, _, state = argument.partition("_")
        derived = {"derivatives": "d", "update": "next"}.get(kind) == prefix and argument not in declaration.variables
        if derived and isinstance(declaration.variables.get(state), State):
            writes.add(argument)
        elif argument in declaration.variables:
            variable = declaration.variables[argument]
            target: Any = {"calculate": CalculatedParameter, "start": State, "outputs": (Output, Local)}.get(kind)
            if target and isinstance(variable, target) and argument not in written:
                writes.add(argument)
            elif kind == "calculate" and not isinstance(variable, (Parameter, CalculatedParameter)):
                what = f"names `{argument}`, which has no value yet: it is called once, before anything else"
                said = what, "compute from parameters only, or use start() or outputs()"
        elif argument == "self":
            said = "names `self`, which a block's functions do not have", "remove it: their arguments are variables"
        elif argument != "time":
            said = f"names `{argument}`, which the block does not declare", _meant(declaration, kind, argument)
        if said:
            message, place = f"block {declaration.name}: {name}() {said[0]}", naming.place_of_argument(python, argument)
            problems.add(DeclarationError(message, place, said[1]))
    written |= writes
    return Function(name, kind, python, arguments, frozenset(writes))


def _meant(declaration: Declaration, kind: str, argument: str) -> str:
    """The nearest name that a function of a kind may write or read."""
    prefix = {"derivatives": "d_", "update": "next_"}.get(kind)
    results = [f"{prefix}{s.name}" for s in declaration.of(State)] if prefix else []
    return nearest(argument, [*declaration.variables, *results, "time"])


def _check_complete(declaration: Declaration, problems: Problems) -> None:
    """Everything that the block computes is computed by exactly one function."""
    states = {s.name for s in declaration.of(State)}
    continuous, discrete = ({s.name for s in part} for part in (declaration.continuous(), declaration.discrete()))
    for name in sorted(states):
        said = None
        if name in continuous and name in discrete:
            what = f"state `{name}` has derivatives and an update, and needs either derivatives or an update"
            said = what, f"remove d_{name} from derivatives() or next_{name} from update()"
        elif name not in continuous and name not in discrete:
            what = f"state `{name}` needs either derivatives or an update"
            said = what, f"name d_{name} in derivatives() or next_{name} in update()"
        elif name in continuous and declaration.variables[name].dtype != float:
            what = f"state `{name}` is {declaration.variables[name].dtype}: a continuous state is float64"
            said = what, f"leave out its dtype, or compute it as next_{name} in update()"
        elif name in continuous and not declaration.variables[name].finite:
            what = f"state `{name}` has finite=False: what is integrated is finite, or has diverged"
            said = what, f"leave finite=False out, or compute it as next_{name} in update()"
        if said:
            place = naming.place_in(declaration.home, name)
            problems.add(DeclarationError(f"block {declaration.name}: {said[0]}", place, said[1]))
    for kind, classes in (("outputs", (Output, Local)), ("calculate", (CalculatedParameter,))):
        computed = [name for f in declaration.kind(kind) for name in f.writes]
        for variable in declaration.of(*classes):
            if computed.count(variable.name) != 1:
                message = f"block {declaration.name}: no {kind}() function computes `{variable.name}`"
                fix = f"name `{variable.name}` as an argument of {kind}()"
                problems.add(DeclarationError(message, naming.place_in(declaration.home, variable.name), fix))


#: Whether mistakes wait in the declarations until a file has been read to its end.
def is_scalar(variable: Variable, function: Function, argument: str) -> bool:
    """Whether an argument comes as a number: a scalar that the function only reads."""
    return variable.shape == () and argument not in function.writes


def variable_of(declaration: Declaration, argument: str) -> Variable:
    """The variable behind an argument; ``d_x`` and ``next_x`` have the shape of ``x``."""
    if argument in declaration.variables:
        return declaration.variables[argument]
    return declaration.variables[argument.partition("_")[2]]


_waiting: ContextVar[bool] = ContextVar("waiting", default=False)


@contextmanager
def mistakes_wait() -> Iterator[None]:
    """Inside, a class with mistakes is made all the same: whoever imports it asks its declaration."""
    token = _waiting.set(True)
    try:
        yield
    finally:
        _waiting.reset(token)


def _raise_mistakes(declaration: Declaration) -> None:
    from cosim import authors

    problems = Problems()
    for mistake in (*declaration.mistakes, *authors.mistakes(declaration, complete=False)):
        problems.add(mistake)
    problems.raise_one_or_all()


class Block:
    """Base class of all blocks; see the module's text. ``class B(Block, compiled=False)`` stays plain Python."""

    declaration: ClassVar[Declaration] = Declaration("Block", "")
    measuring: ClassVar[bool] = False

    def __init_subclass__(cls, compiled: bool | None = None, **more: Any) -> None:
        """compiled: as the base class, unless given. Raises: DeclarationError, DiagramErrors with several."""
        super().__init_subclass__(**more)
        inherited = [d for base in cls.__mro__[1:] if isinstance(d := vars(base).get("declaration"), Declaration)]
        cls.declaration = _declare(cls, inherited[0].compiled if compiled is None else compiled)
        if not _waiting.get() and (cls.declaration.functions or cls.declaration.mistakes):
            _raise_mistakes(cls.declaration)


class Measure(Block):
    """Base class of measuring blocks: they may tap local variables, and only measures may read their outputs."""

    measuring = True
