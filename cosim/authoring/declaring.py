"""Reads a class as a declaration, and says what contradicts itself in it."""

from __future__ import annotations

import inspect
import types
from dataclasses import replace
from typing import Any

from cosim.authoring import naming
from cosim.authoring.declaration import PREFIXES, Declaration, Function
from cosim.authoring.rules import Rule
from cosim.authoring.variables import (
    CalculatedParameter,
    Dimension,
    Indicator,
    Input,
    Local,
    Output,
    Parameter,
    Period,
    State,
    Stream,
    Variable,
)
from cosim.errors import DeclarationError, Problems, nearest

#: What functions of a kind write.
_WRITTEN: dict[str, tuple[type[Variable], ...]] = {
    "calculate": (CalculatedParameter,),
    "start": (State,),
    "outputs": (Output, Local),
    "indicators": (Indicator,),
}


def declare(cls: Any, compiled: bool) -> Declaration:
    """The declaration of a class, whose functions become static. Its mistakes are kept in it."""
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
    held = _held(declaration)
    declaration.functions = tuple(replace(f, held=bool(f.writes) and f.writes <= held) for f in functions)
    _check_complete(declaration, problems)
    _check_held(declaration, held, problems)
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
    if "period" in arguments and "period" not in declaration.variables:
        declaration.variables["period"] = period = Period(unit="s", description="time between two samples")
        period.name = "period"
    for argument in arguments:
        said = None
        prefix, _, state = argument.partition("_")
        derived = PREFIXES.get(kind) == f"{prefix}_" and argument not in declaration.variables
        if derived and isinstance(declaration.variables.get(state), State):
            writes.add(argument)
        elif argument in declaration.variables:
            variable = declaration.variables[argument]
            target: Any = _WRITTEN.get(kind)
            if target and isinstance(variable, target) and argument not in written:
                writes.add(argument)
            elif kind == "calculate" and not isinstance(variable, (Parameter, CalculatedParameter, Period)):
                what = f"names `{argument}`, which has no value yet: it is called once, before anything else"
                said = what, "compute from parameters only, or use start() or outputs()"
            elif isinstance(variable, Indicator) and kind != "event":
                what = f"names the indicator `{argument}`, of which event() alone knows how it has crossed zero"
                said = what, "name what it is computed from"
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
    prefix = PREFIXES.get(kind)
    results = [f"{prefix}{s.name}" for s in declaration.of(State)] if prefix else []
    return nearest(argument, [*declaration.variables, *results, "time", "period"])


def _check_complete(declaration: Declaration, problems: Problems) -> None:
    """Everything that the block computes is computed by exactly one function."""
    states = {s.name for s in declaration.of(State)}
    jumping = {s.name for s in declaration.jumping()}
    continuous, discrete = ({s.name for s in part} for part in (declaration.continuous(), declaration.discrete()))
    for name in sorted(states):
        said = None
        if name in continuous and name in discrete:
            what = f"state `{name}` has derivatives and an update, and needs either derivatives or an update"
            said = what, f"remove d_{name} from derivatives() or next_{name} from update()"
        elif name in discrete and name in jumping:
            what = f"state `{name}` has an update and is reset by event(), and needs either of them"
            said = what, f"remove next_{name} from update() or from event()"
        elif name not in continuous | discrete | jumping:
            what = f"state `{name}` needs derivatives, an update or an event"
            said = what, f"name d_{name} in derivatives(), or next_{name} in update() or event()"
        elif name in continuous and declaration.variables[name].dtype != float:
            what = f"state `{name}` is {declaration.variables[name].dtype}: a continuous state is float64"
            said = what, f"leave out its dtype, or compute it as next_{name} in update()"
        elif name in continuous and not declaration.variables[name].finite:
            what = f"state `{name}` has finite=False: what is integrated is finite, or has diverged"
            said = what, f"leave finite=False out, or compute it as next_{name} in update()"
        if said:
            place = naming.place_in(declaration.home, name)
            problems.add(DeclarationError(f"block {declaration.name}: {said[0]}", place, said[1]))
    for function in declaration.kind("event"):
        if not any(isinstance(declaration.variables.get(a), Indicator) for a in function.arguments):
            message = f"block {declaration.name}: event() names no indicator, so it cannot know what has happened"
            fix = "name the indicators that it answers to, and look which of them is not 0"
            problems.add(DeclarationError(message, naming.place_in(declaration.home, function.name), fix))
    _check_streams(declaration, problems)
    for kind, classes in _WRITTEN.items():
        if kind == "start":
            continue
        computed = [name for f in declaration.kind(kind) for name in f.writes]
        for variable in declaration.of(*classes):
            if computed.count(variable.name) != 1:
                message = f"block {declaration.name}: no {kind}() function computes `{variable.name}`"
                fix = f"name `{variable.name}` as an argument of {kind}()"
                problems.add(DeclarationError(message, naming.place_in(declaration.home, variable.name), fix))


def _held(declaration: Declaration) -> set[str]:
    """The names of what stays between two communication points and events."""
    return {name for name, v in declaration.variables.items() if isinstance(v, (Output, Local)) and v.held}


def _check_held(declaration: Declaration, held: set[str], problems: Problems) -> None:
    """What is held has indicators that say where it jumps, and functions of its own."""
    for name in sorted(held) if not any(declaration.of(Indicator)) else ():
        message = f"block {declaration.name}: `{name}` is held, and no indicator says where it jumps"
        fix = "declare an Indicator() that crosses zero there, or leave held=True out"
        problems.add(DeclarationError(message, naming.place_in(declaration.home, name), fix))
    for function in declaration.kind("outputs"):
        if function.writes & held and not function.held:
            message = f"block {declaration.name}: {function.name}() computes what is held, and what is not"
            place = naming.place_in(declaration.home, function.name)
            problems.add(DeclarationError(message, place, "write a function for each"))


def _check_streams(declaration: Declaration, problems: Problems) -> None:
    """Streams of random numbers are begun by the block."""
    for stream in declaration.of(Stream):
        if not any(stream.name in f.writes for f in declaration.kind("start")):
            message = f"block {declaration.name}: no start() begins the stream `{stream.name}`"
            fix = f"declare seed = Seed(), and write def start(seed, {stream.name}): random.begin({stream.name}, seed)"
            problems.add(DeclarationError(message, naming.place_in(declaration.home, stream.name), fix))
