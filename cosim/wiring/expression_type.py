"""A block type whose outputs are expressions of its inputs and parameters."""

from __future__ import annotations

import hashlib
import linecache
from collections.abc import Iterable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import cache
from types import FunctionType
from typing import Any

import numpy as np

from cosim.authoring.block import Block
from cosim.authoring.declaration import Declaration, Function
from cosim.authoring.expression_code import OutputCode
from cosim.authoring.variables import Dimension, Input, Output, Parameter, Variable
from cosim.language.expression import OPERATIONS
from cosim.wiring.network import Component, Signal

NAME = "Expression"
"""What such a block type is called."""
Names = tuple[tuple[str, bool], ...]
"""Of inputs or parameters, each with whether it is a truth value."""


def block_type(
    codes: Iterable[OutputCode], texts: Iterable[str], inputs: Mapping[str, bool], parameters: Mapping[str, bool]
) -> type[Block]:
    """A block type; the same one for outputs that compute the same of the same names.

    codes: each after those that it reads; texts: `y = 2*u`, as they are written. inputs, parameters: whether they are
    truth values.
    """
    return _made(tuple(codes), tuple(texts), tuple(inputs.items()), tuple(parameters.items()))


def function_name(output: str, outputs: Sequence[str]) -> str:
    """What the function of an output is called, which is the name of a C function too."""
    if len(outputs) == 1:
        return "outputs"
    return f"outputs_{output if output.isascii() else outputs.index(output) + 1}"


@cache
def _made(codes: tuple[OutputCode, ...], said: tuple[str, ...], inputs: Names, parameters: Names) -> type[Block]:
    variables: dict[str, Variable] = {name: Input(_size(name), dtype=_dtype(truth)) for name, truth in inputs}
    variables |= {name: Parameter(_size(name), dtype=_dtype(truth)) for name, truth in parameters}
    dimensions: dict[str, Dimension] = {}
    for code, text in zip(codes, said, strict=True):
        sizes = tuple(f"n_{name}" for name in code.reads if name in variables)
        variables[code.name] = Output(_size(code.name), dtype=_dtype(code.truth), description=text)
        if sizes:
            dimensions[f"n_{code.name}"] = Dimension(widest=sizes, description="the common size of what it reads")
    for name, variable in variables.items():
        variable.name = name
    functions = tuple(_function(code) for code in codes)
    made: type[Block] = type(NAME, (Block,), {"__doc__": "\n".join(said)})
    made.declaration = Declaration(NAME, "\n".join(said), variables, dimensions, functions, home=made)
    return made


def take_types(components: Iterable[Component]) -> None:
    """Let inputs that are numbers take those of their sources of any type; as real numbers they are computed with."""
    named = {component.name: component for component in components}
    for component in (c for c in named.values() if c.entry.kind == "expression"):
        variables = component.declaration.variables
        types = {port: _type_of(sources[0], named) for port, sources in component.wires.items() if sources}
        others = {port: t for port, t in types.items() if t.kind in "iuf" and t != variables[port].dtype != bool}
        if others:
            changed = {port: copy(variables[port]) for port in others}
            for port, variable in changed.items():
                variable.dtype = others[port]
            component.declaration = replace(component.declaration, variables={**variables, **changed})


def _type_of(source: Signal, components: Mapping[str, Component]) -> np.dtype:
    """The type of what a wire brings; that of real numbers where it is not known."""
    known = components[source.component].declaration.variables if source.variable else {}
    return known[source.variable].dtype if source.variable else np.dtype(float)


def _size(name: str) -> str:
    """The dimension of a variable, which is a scalar, a vector or a matrix."""
    return f"n_{name}?"


def _dtype(truth: bool) -> type:
    return bool if truth else float


@cache
def _function(code: OutputCode) -> Function:
    file = f"<expression {hashlib.sha256(code.text.encode()).hexdigest()[:12]}>"
    linecache.cache[file] = len(code.text), None, code.text.splitlines(keepends=True), file
    scope: dict[str, Any] = {"__name__": __name__}
    known = {**OPERATIONS, "range": range, "float": float}
    scope |= {name: known[operation] for name, operation in code.calls}
    exec(compile(code.text, file, "exec", dont_inherit=True), scope)  # noqa: S102  # a text of ours
    python: FunctionType = scope[code.function]
    return Function(code.function, "outputs", python, (*code.reads, code.name), frozenset({code.name}))
