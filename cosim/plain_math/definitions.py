"""The functions of this folder as LLVM IR, by the names that the C library has for them.

For a function NAME, `cosim_NAME` is what scalar code calls. `cosim_NAME_core` has no branch, and is right but where
`cosim_NAME_outside` says otherwise, if there is such a function; there, `cosim_NAME_wide` is. All but the wide ones are
put in where they are called, so that the sine and the cosine of an angle share its remainder.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

from cosim.plain_math import arctangent, circular, exponential, hyperbolic, logarithm, power
from cosim.plain_math.traced import Lines, Traced


@dataclass(frozen=True)
class PlainFunction:
    """A function of so many numbers. core: it, but for arguments of which `outside` holds, where it is `wide`."""

    arguments: int
    core: Callable[..., Any]
    outside: Callable[..., Any] | None = None
    wide: Callable[..., Any] | None = None


FUNCTIONS = {
    "sin": PlainFunction(1, circular.sin, circular.outside, circular.wide_sin),
    "cos": PlainFunction(1, circular.cos, circular.outside, circular.wide_cos),
    "exp": PlainFunction(1, exponential.exp),
    "log": PlainFunction(1, logarithm.log),
    "tanh": PlainFunction(1, hyperbolic.tanh),
    "pow": PlainFunction(2, power.pow),
    "atan2": PlainFunction(2, arctangent.atan2),
}

_ATTRIBUTES = "nounwind willreturn memory(none)"
_NAMES = "|".join(FUNCTIONS)
_OF_C = re.compile(rf"@(?:llvm\.)?({_NAMES})(?:\.f64)?\(")
_OURS = re.compile(rf"@cosim_({_NAMES})(?:_core|_outside)?\(")


def renamed(ir: str) -> str:
    """A module in which calls of the C library's functions are calls of these."""
    return _OF_C.sub(r"@cosim_\1(", _without_declarations(ir, _OF_C))


def with_definitions(ir: str) -> str:
    """A module with the definitions of those that it calls."""
    called = sorted({found[1] for found in _OURS.finditer(ir)})
    return _without_declarations(ir, _OURS) + "".join(map(definition, called))


def with_declarations(ir: str) -> str:
    """A module with the declarations of those that it calls."""
    called = sorted({found[1] for found in _OURS.finditer(ir)})
    return ir + "".join(f"declare double @cosim_{name}({_parameters(name)}) {_ATTRIBUTES}\n" for name in called)


def lane(name: str, group: str) -> str:
    """The IR of `cosim_NAME_lane`, which is the core, and notes in a word where its arguments are outside.

    group: that of accesses which iterations of a loop may do in any order.
    """
    parameters, noting = _parameters(name), ""
    text = f"declare double @cosim_{name}_core({parameters})\n"
    if FUNCTIONS[name].outside:
        text += f"declare i1 @cosim_{name}_outside({parameters})\n"
        noting = _NOTING.format(name=name, parameters=parameters, group=group)
    return text + _LANE.format(name=name, parameters=parameters, noting=noting)


def _parameters(name: str) -> str:
    return ", ".join(f"double %x{k}" for k in range(FUNCTIONS[name].arguments))


def _without_declarations(ir: str, names: re.Pattern[str]) -> str:
    return re.sub(rf"^declare .*{names.pattern}.*$\n?", "", ir, flags=re.MULTILINE)


_LANE = """
define internal double @cosim_{name}_lane(ptr %noted, {parameters}) alwaysinline {{
{noting}  %y = call double @cosim_{name}_core({parameters})
  ret double %y
}}
"""
_NOTING = """  %outside = call i1 @cosim_{name}_outside({parameters})
  %before = load i64, ptr %noted, !llvm.access.group {group}
  %also = zext i1 %outside to i64
  %note = or i64 %before, %also
  store i64 %note, ptr %noted, !llvm.access.group {group}
"""


@cache
def definition(name: str) -> str:
    """The IR of a function, and of all that belongs to it."""
    function = FUNCTIONS[name]
    parameters = _parameters(name)
    text = _traced(f"cosim_{name}_core", "double", function.core, parameters, "alwaysinline")
    if function.outside is None or function.wide is None:
        return text + _ALONE.format(name=name, parameters=parameters, attributes=_ATTRIBUTES)
    text += _traced(f"cosim_{name}_outside", "i1", function.outside, parameters, "alwaysinline")
    text += _traced(f"cosim_{name}_wide", "double", function.wide, parameters, "noinline cold")
    return text + _BRANCHING.format(name=name, parameters=parameters, attributes=_ATTRIBUTES)


def _traced(name: str, kind: str, function: Callable[..., Any], parameters: str, attribute: str) -> str:
    lines = Lines()
    value = function(*(Traced(lines, *parameter.split(" ")) for parameter in parameters.split(", ")))
    tables = {key: f"{name}_{key}" for key in lines.tables}
    texts = [
        f"@{tables[key]} = internal constant [{len(table)} x i64] [{', '.join(f'i64 {n}' for n in table)}]\n"
        for key, table in lines.tables.items()
    ]
    head = f"\ndefine {kind} @{name}({parameters}) {attribute} {_ATTRIBUTES} {{"
    return "".join(texts) + f"{head}\n{lines.text.format_map(tables)}\n  ret {kind} {value.text}\n}}\n"


_ALONE = """
define double @cosim_{name}({parameters}) alwaysinline {attributes} {{
  %y = call double @cosim_{name}_core({parameters})
  ret double %y
}}
"""

_BRANCHING = """
define double @cosim_{name}({parameters}) alwaysinline {attributes} {{
  %outside = call i1 @cosim_{name}_outside({parameters})
  br i1 %outside, label %wide, label %core
core:
  %y = call double @cosim_{name}_core({parameters})
  ret double %y
wide:
  %z = call double @cosim_{name}_wide({parameters})
  ret double %z
}}
"""
