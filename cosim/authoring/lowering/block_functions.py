"""The functions of blocks as the engines run them."""

from __future__ import annotations

from typing import Any

from cosim.authoring.author_source import Text
from cosim.authoring.declaration import Declaration, Function, is_scalar, variable_of
from cosim.authoring.lowering import syntax
from cosim.authoring.lowering.axis_sizes import of_axis
from cosim.authoring.lowering.lowered_functions import LoweredFunction, Session
from cosim.authoring.lowering.lowered_values import REAL, TRUTH, WHOLE, ArrayKind, Scalar, Value, stored
from cosim.authoring.lowering.work import Refusal

_known: dict[tuple[Any, ...], tuple[Session, LoweredFunction, Function]] = {}


def lowered(declaration: Declaration, function: Function) -> LoweredFunction:
    """A function of a block as it is run: itself, where there is nothing to lower."""
    return _of(declaration, function)[1]


def refusals(
    declaration: Declaration, function: Function, complete: bool
) -> tuple[list[tuple[Text, Refusal]], set[int]]:
    """What is wrong with the arrays in a function, and the nodes that are lowered, by id.

    complete: whether all names of the module are known.
    """
    session, _, _ = _of(declaration, function)
    code = function.python.__code__
    unknown = [n for n in code.co_names if n not in function.python.__globals__ and not hasattr(__builtins__, n)]
    return ([] if unknown and not complete else session.refusals), session.handled


def _of(declaration: Declaration, function: Function) -> tuple[Session, LoweredFunction, Function]:
    arguments = {name: _argument(declaration, function, name) for name in function.arguments}
    kinds = tuple((n, getattr(v, "kind", None), getattr(v, "element", "")) for n, v in arguments.items())
    key = (function.python, kinds, declaration.compiled, bool(declaration.foreign))
    found = _known.get(key)
    if found is None or not found[0].is_current():
        session = Session(frozenset(declaration.dimension_names()))
        made = None
        if declaration.compiled and not declaration.foreign:
            made = session.function(function.python, arguments, is_helper=False)
        found = _known[key] = session, made or LoweredFunction(function.python), function
    return found


def _argument(declaration: Declaration, function: Function, name: str) -> Value:
    """What an argument stands for. A name that the block does not declare is said elsewhere."""
    if name == "time" or name not in {*declaration.variables, *function.writes}:
        return Scalar(syntax.name(name), REAL if name == "time" else "")
    variable = variable_of(declaration, name)
    element = {"b": TRUTH, "f": REAL}.get(variable.dtype.kind, WHOLE)
    if is_scalar(variable, function, name):
        return Scalar(syntax.name(name), element)
    shape = tuple(of_axis(size) for size in variable.shape or (1,))
    return stored(name, name, ArrayKind(shape, element))
