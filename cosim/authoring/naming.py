"""What a block class may call its variables and functions, and how both are to be declared."""

from __future__ import annotations

import inspect
import keyword
import types
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from cosim.authoring import quantities
from cosim.authoring.author_source import class_text, function_text, shown
from cosim.authoring.declaration import KINDS
from cosim.authoring.variables import CROSSINGS, Indicator, OpenDimension, Parameter, State, Variable
from cosim.errors import DeclarationError, ExpressionError, Position, nearest
from cosim.language import expression

_OWN = ("declaration", "measuring")

#: The types of an author's variables: those that compiled code stores, and that an exported FMU can show.
TYPES = ("bool", *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)), "float32", "float64")


def mistakes(cls: type, members: dict[str, Any]) -> Iterator[DeclarationError]:
    """What is wrong with the names in a class. members: its own and the inherited ones."""
    states = {k for k, v in members.items() if isinstance(v, State)}
    sizes = {d for v in members.values() if isinstance(v, Variable) for d in v.shape}
    for name, member in vars(cls).items():
        said = None
        if isinstance(member, Variable):
            said = _variable(name, member, states, sizes)
        elif isinstance(member, type) and issubclass(member, Variable) and name != member.__name__:
            said = f"`{name} = {member.__name__}` declares nothing", f"write {name} = {member.__name__}()"
        elif isinstance(member, types.FunctionType) and not name.startswith("_") and kind(name) is None:
            said = _stray(name, member)
        elif member is not None and kind(name) and not isinstance(member, types.FunctionType | staticmethod):
            said = f"`{name}` is no plain function, as a block's functions are", f"write def {name}(…):"
        if said:
            yield DeclarationError(f"block {cls.__name__}: {said[0]}", place_in(cls, name), said[1])
        for what, fix in _settings(name, member) if isinstance(member, Variable) else ():
            yield DeclarationError(f"block {cls.__name__}: {what}", place_in(cls, name), fix)


def kind(name: str) -> str | None:
    """The kind of the function that a name is for."""
    return next((k for k in KINDS if name == k or (k == "outputs" and name.startswith("outputs_"))), None)


def _variable(name: str, variable: Any, states: set[str], sizes: set[Any]) -> tuple[str, str] | None:
    word = type(variable).__name__.lower()
    if name == "time":
        return "`time` is the simulated time, and cannot name a variable", "call it otherwise, such as `t_end`"
    if kind(name):
        return f"`{name}` names a kind of function, and cannot name a variable", f"call it otherwise, such as `{name}_`"
    if name in _OWN or (name.startswith("__") and name.endswith("__")):
        return f"`{name}` has a meaning of its own in a class, and cannot name a variable", "call it otherwise"
    if keyword.iskeyword(name) or not name.isidentifier():
        return f"`{name}` cannot name an argument of a function", f"call it otherwise, such as `{name}_`"
    for prefix, meaning in (("d_", "derivatives() writes the derivative"), ("next_", "update() writes the next value")):
        if name.startswith(prefix) and name[len(prefix) :] in states:
            what = f"`{name}` is the name under which {meaning} of state `{name[len(prefix) :]}`"
            return what, f"call the {word} otherwise"
    if name in sizes:
        return (
            f"`{name}` is also the name of a dimension, so that rules could not tell them apart",
            "rename one of them",
        )
    for size in variable.shape:
        named = isinstance(size, str) and size.isidentifier() and not keyword.iskeyword(size)
        if not named and (isinstance(size, bool) or not isinstance(size, int) or size < 1):
            what = f"the shape of `{name}` has {size!r}, which is neither a name nor a whole number from 1"
            return what, 'write the sizes one by one, such as ("robots", 2)'
    if sum(isinstance(size, OpenDimension) for size in variable.shape) > 1:
        what = f"the shape of `{name}` has two open dimensions, so that nobody could tell which axis is whose"
        return what, "write `?` behind one of them only"
    return None


def _settings(name: str, variable: Any) -> Iterator[tuple[str, str]]:
    """What is wrong with that which a variable is declared with."""
    for key, kind, words, fix in (
        ("description", str, "text", 'description="…"'),
        ("event", str, "text", 'event="…", what to report when it first becomes true'),
        ("only", str, "text", 'only="…", the name of the ports that it takes'),
        ("finite", bool, "True or False", "finite=False"),
        ("output", bool, "True or False", "output=True"),
        ("terminal", bool, "True or False", "terminal=True"),
    ):
        given = getattr(variable, key, kind())
        if not isinstance(given, kind):
            yield f"the `{key}` of `{name}` is {given!r}, and not {words}", f"write {fix}"
    if isinstance(variable, Indicator) and variable.crossing not in CROSSINGS:
        what = f"the `crossing` of `{name}` is {variable.crossing!r}, and not one of {', '.join(CROSSINGS)}"
        yield what, 'write crossing="falling", or leave it out for both'
    if isinstance(variable, Indicator) and variable.dtype != float:
        yield f"the indicator `{name}` is {variable.dtype}: what crosses zero is float64", "leave out its dtype"
    if getattr(variable, "misnamed", False):
        yield f"the parameter `{name}` has a `start`, which is for what changes along a run", "use default="
    if variable.dtype.name not in TYPES or not variable.dtype.isnative:
        yield f"`{name}` is of the type {variable.dtype}, which no engine computes with", f"use {', '.join(TYPES)}"
    if not variable.dtype.hasobject:
        for text in _texts(variable.start):
            try:
                expression.check(text, expression.OF_A_FLEET)
            except ExpressionError as error:
                word = "default" if isinstance(variable, Parameter) else "start value"
                yield f"the {word} of `{name}`: {error.message}", error.fix
    yield from quantities.mistakes(name, variable)


def _texts(value: Any) -> Iterator[str]:
    """The expressions in a value, or in nested sequences of values."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, list | tuple | np.ndarray):
        for item in value:
            yield from _texts(item)


def _stray(name: str, function: Any) -> tuple[str, str]:
    """A function that the framework would never call."""
    if function.__name__ in (name, "<lambda>"):
        known = [*KINDS, "outputs_…"]
        what = f"`{name}` is neither a function that the framework calls nor a rule"
        return what, f"{nearest(name, known)} Rules are decorated with @rule(…); helpers stand outside the class"
    return f"`{name}` is neither a function that the framework calls nor a rule", "move it out of the class"


def twice(cls: type, variables: Iterable[str]) -> Iterator[DeclarationError]:
    """Names that a class body gives twice, so that the first meaning is lost."""
    text = class_text(cls)
    first: dict[str, Any] = {}
    for statement in text.node.body if text else ():
        for name in _names(statement):
            known = name in variables or kind(name) is not None
            if name in first and known and text:
                what = f"block {cls.__name__}: `{name}` is defined twice, and the first definition is lost"
                fix = "give one of them another name" + (", such as outputs_first" if kind(name) == "outputs" else "")
                yield DeclarationError(what, text.place(statement), fix)
            first[name] = statement


def _names(statement: Any) -> list[str]:
    if hasattr(statement, "name"):
        return [statement.name]
    targets = getattr(statement, "targets", None) or [getattr(statement, "target", None)]
    return [t.id for t in targets if hasattr(t, "id") and getattr(statement, "value", None) is not None]


def signature(python: Any) -> str:
    """What is wrong with the way in which a function is declared, or ""."""
    if not isinstance(python, types.FunctionType) or hasattr(python, "__wrapped__"):
        return "is decorated or no plain function"
    flags = python.__code__.co_flags
    if python.__name__ == "<lambda>":
        return "is a lambda, which cannot write"
    if flags & (inspect.CO_COROUTINE | inspect.CO_ASYNC_GENERATOR):
        return "is asynchronous"
    if flags & inspect.CO_GENERATOR:
        return "has a `yield`"
    if flags & (inspect.CO_VARARGS | inspect.CO_VARKEYWORDS):
        return "takes any number of arguments (*), where they tell what it reads and writes"
    if python.__code__.co_kwonlyargcount:
        return "has arguments by keyword only"
    if python.__defaults__:
        return "has arguments with defaults, which are never used"
    return ""


def place_in(cls: type | None, name: str) -> Position | None:
    """Where a class defines a name; where the class begins, if that cannot be told."""
    text = class_text(cls) if cls else None
    if text is None:
        return None
    for statement in text.node.body:
        if name in _names(statement):
            return text.place(statement)
    return text.place()


def place_of_argument(python: Any, argument: str) -> Position | None:
    """Where a function names an argument; where it begins, if that cannot be told."""
    text = function_text(python)
    if text is None:
        code = getattr(python, "__code__", None)
        return Position(shown(code.co_filename), code.co_firstlineno, 1) if code else None
    for node in (*text.node.args.args, *text.node.args.posonlyargs):
        if node.arg == argument:
            return text.place(node)
    return text.place()
