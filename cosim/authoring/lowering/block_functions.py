"""The functions of blocks as the engines run them."""

from __future__ import annotations

import builtins
from typing import TYPE_CHECKING, Any

from cosim.authoring.author_source import Text
from cosim.authoring.declaration import Declaration, Function, is_scalar, variable_of
from cosim.authoring.lowering import syntax
from cosim.authoring.lowering.axis_sizes import of_axis
from cosim.authoring.lowering.lowered_values import REAL, TRUTH, WHOLE, Array, ArrayKind, Scalar, Value, stored
from cosim.authoring.lowering.plain_functions import Glance
from cosim.authoring.lowering.work import LoweredFunction, Refusal

if TYPE_CHECKING:
    from cosim.authoring.lowering.lowered_functions import Session

Shape = tuple[int | str, ...]
_ELEMENTS = {"b": TRUTH, "f": REAL}

#: What has been found of functions for arguments of some kinds: how, and the function as it is run.
_known: dict[tuple[Any, ...], tuple[Glance | Session, LoweredFunction]] = {}


def lowered(declaration: Declaration, function: Function) -> LoweredFunction:
    """A function of a block as it is run: itself, where there is nothing to lower."""
    return _of(declaration, function)[1]


def refusals(
    declaration: Declaration, function: Function, complete: bool
) -> tuple[list[tuple[Text, Refusal]], set[int]]:
    """What is wrong with the arrays in a function, and the nodes that are lowered, by id.

    complete: whether all names of the module are known.
    """
    session, _ = _of(declaration, function)
    if isinstance(session, Glance):
        return [], set()
    names = function.python.__code__.co_names
    unknown = [n for n in names if n not in function.python.__globals__ and not hasattr(builtins, n)]
    return ([] if unknown and not complete else session.refusals), session.handled


def _of(declaration: Declaration, function: Function) -> tuple[Glance | Session, LoweredFunction]:
    kinds = tuple((name, _kind(declaration, function, name)) for name in function.arguments)
    key = (function.python, kinds, declaration.compiled, bool(declaration.foreign))
    found = _known.get(key)
    if found is None or not found[0].is_current():
        found = _known[key] = _found(declaration, function, {name: _argument(name, *kind) for name, kind in kinds})
    return found


def _found(
    declaration: Declaration, function: Function, arguments: dict[str, Value]
) -> tuple[Glance | Session, LoweredFunction]:
    glance, same = Glance(), LoweredFunction(function.python)
    if not declaration.compiled or declaration.foreign:
        return glance, same
    if glance.is_plain(function.python, {n: v.axes if isinstance(v, Array) else 0 for n, v in arguments.items()}):
        return glance, same
    from cosim.authoring.lowering.lowered_functions import Session

    session = Session(frozenset(declaration.dimension_names()))
    return session, session.function(function.python, arguments, is_helper=False) or same


def _kind(declaration: Declaration, function: Function, name: str) -> tuple[Shape | None, str]:
    """An argument's shape, None for a number, and kind of number. What a block does not declare is said elsewhere."""
    if name == "time" or (name not in declaration.variables and name not in function.writes):
        return None, REAL if name == "time" else ""
    variable = variable_of(declaration, name)
    element = _ELEMENTS.get(variable.dtype.kind, WHOLE)
    return None if is_scalar(variable, function, name) else variable.shape or (1,), element


def _argument(name: str, shape: Shape | None, element: str) -> Value:
    """What an argument stands for."""
    if shape is None:
        return Scalar(syntax.name(name), element)
    return stored(name, name, ArrayKind(tuple(map(of_axis, shape)), element))
