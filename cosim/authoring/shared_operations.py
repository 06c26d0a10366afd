"""What a compiled function may do: that whose result is the same, to the last bit, in compiled code and in Python.

What the compiler refuses is not listed here, but for what authors write most often; `cosim.compiling.compiler` explains
the rest. Of numpy exact operations are shared, and the functions of one number that `cosim.compiling.interpreted` takes
from the C library as compiled code does; numpy's own sums add in another order. What becomes loops, see
`cosim.authoring.lowering`, is shared too, and not looked at here.
"""

from __future__ import annotations

import ast
import builtins
import math
import types
from collections.abc import Container, Iterator
from typing import Any

import numpy as np

from cosim.authoring.author_source import Text, function_text
from cosim.authoring.scope import resolve, scope_of

_BUILTINS = "abs min max range len int float bool round enumerate zip divmod tuple slice"
SHARED_BUILTINS = frozenset(getattr(builtins, name) for name in _BUILTINS.split())
_EXACT = "add subtract multiply divide true_divide negative positive absolute fabs minimum maximum square sqrt copysign"
#: Functions of numpy whose result is exact, also of whole arrays.
EXACT_NUMPY = frozenset(getattr(np, name) for name in _EXACT.split())
_OF_NUMBERS = (
    "sin cos tan arcsin arccos arctan arctan2 sinh cosh tanh arcsinh arccosh arctanh exp expm1 log log2 log10 log1p "
    "isnan isinf isfinite float64 int64 bool_"
)
SHARED_NUMPY = EXACT_NUMPY | {getattr(np, name) for name in _OF_NUMBERS.split()}
_SHARED_MATH = (
    "sin cos tan asin acos atan atan2 sinh cosh tanh asinh acosh atanh exp expm1 log log2 log10 log1p sqrt pow fabs "
    "erf erfc copysign floor ceil trunc isnan isinf isfinite"
)
SHARED_MATH = frozenset(getattr(math, name) for name in _SHARED_MATH.split())
#: What to write for other functions of `math`.
_INSTEAD = {
    "hypot": "math.sqrt(a * a + b * b)",
    "dist": "math.sqrt() of the sum of squares",
    "fmod": "a % b, which has the sign of b",
    "mod": "a % b, which has the sign of b",
    "remainder": "a % b, which has the sign of b",
    "cbrt": "math.copysign(abs(a) ** (1.0 / 3.0), a)",
    "exp2": "2.0**a",
    "rad2deg": "a * (180.0 / math.pi)",
    "deg2rad": "a * (math.pi / 180.0)",
    "degrees": "a * (180.0 / math.pi)",
    "radians": "a * (math.pi / 180.0)",
    "isclose": "abs(a - b) < 1e-9",
    "isqrt": "int(math.sqrt(a))",
}
_MAKING = (
    "zeros ones empty full zeros_like ones_like empty_like full_like array arange linspace eye identity concatenate "
    "stack vstack hstack where clip outer cross diag sort argsort copy tile repeat roll flip"
)
MAKING_NUMPY = frozenset(getattr(np, name) for name in _MAKING.split())

#: Methods of arrays whose result depends on the order of additions.
ADDING = frozenset({"sum", "mean", "std", "var", "prod", "cumsum", "cumprod", "dot", "trace"})
WORLD = frozenset(
    {"time", "random", "os", "posix", "sys", "datetime", "secrets", "uuid", "io", "_io", "logging", "threading"}
)
WORK_SPACE = "use np.array([…]) or np.zeros(n), a Local, or a tuple for a few numbers"


def unshared(function: Any, lowered: Container[int]) -> Iterator[tuple[Text, Any, str, str]]:
    """What a function and its helpers do that the engines do not share: (text, node, what, fix).

    lowered: the nodes that become loops, by id.
    """
    waiting, seen = [function], set()
    while waiting:
        current = waiting.pop()
        text = function_text(current)
        if text is None or current in seen:
            continue
        seen.add(current)
        scope = scope_of(current)
        for name in current.__code__.co_varnames:
            scope.pop(name, None)
        for node, what, fix in _found(text.node, scope):
            if id(node) not in lowered:
                yield text, node, what, fix
        for argument in text.node.args.kwonlyargs:
            what = f"takes `{argument.arg}` by name only, which compiled code cannot"
            yield text, argument, what, "leave out the `*` before it"
        for node in ast.walk(text.node):
            helper = resolve(node.func, scope) if isinstance(node, ast.Call) else None
            helper = getattr(helper, "py_func", helper)
            if isinstance(helper, types.FunctionType) and not (helper.__module__ or "").startswith(("numpy", "numba")):
                waiting.append(helper)


def _found(function: Any, scope: dict[str, Any]) -> Iterator[tuple[Any, str, str]]:
    allowed = _constant_lists(function)
    annotations = _annotations(function)
    waiting = list(function.body)
    while waiting:
        node = waiting.pop()
        if id(node) in annotations:
            continue
        waiting.extend(ast.iter_child_nodes(node))
        if id(node) not in allowed:
            said = _statement(node) or _expression(node, scope)
            if said:
                yield node, *said


def _constant_lists(function: Any) -> set[int]:
    """Lists and sets of constants after `in`, which Python itself makes tuples of."""
    found = set()
    for node in ast.walk(function):
        sources: list[Any] = []
        if isinstance(node, ast.For):
            sources = [node.iter]
        elif isinstance(node, ast.Compare):
            sources = node.comparators
        for source in sources:
            if isinstance(source, ast.List | ast.Set) and all(_is_constant(e) for e in source.elts):
                found.add(id(source))
    return found


def _is_constant(node: Any) -> bool:
    return isinstance(node, ast.Constant) or (isinstance(node, ast.UnaryOp) and isinstance(node.operand, ast.Constant))


def _annotations(function: Any) -> set[int]:
    return {id(n.annotation) for n in ast.walk(function) if isinstance(n, ast.AnnAssign)}


def _statement(node: Any) -> tuple[str, str] | None:
    match node:
        case ast.Try() | ast.TryStar():
            return (
                "catches exceptions, which compiled code does not raise where Python does",
                "test the values with `if`",
            )
        case ast.With() | ast.AsyncWith():
            return "has a `with`, which compiled code lacks", "leave it out"
        case ast.Import() | ast.ImportFrom():
            return "imports, which compiled code cannot", "import at the top of the file"
        case ast.FunctionDef() | ast.AsyncFunctionDef() | ast.ClassDef():
            return f"defines `{node.name}` inside", "define it outside the class, with what it needs as arguments"
        case ast.Lambda():
            return "defines a lambda inside", "define a function outside the class, with what it needs as arguments"
        case ast.Match():
            return "has a `match`, which compiled code lacks", "write `if` and `elif`"
    return None


def _expression(node: Any, scope: dict[str, Any]) -> tuple[str, str] | None:
    match node:
        case ast.Constant(value=complex()):
            return "computes with complex numbers, which blocks do not have", "compute with real and imaginary parts"
        case ast.JoinedStr():
            return (
                "formats text, which the two engines do differently",
                "compute with numbers; messages are constant texts",
            )
        case ast.Dict() | ast.DictComp() | ast.Set() | ast.SetComp():
            return "makes a dictionary or a set, which needs memory of its own", WORK_SPACE
        case ast.List() | ast.ListComp() | ast.GeneratorExp() if not isinstance(getattr(node, "ctx", None), ast.Store):
            return "makes a list, which needs memory of its own", WORK_SPACE
        case ast.UnaryOp(op=ast.Invert(), operand=ast.Compare() | ast.BoolOp() | ast.UnaryOp(op=ast.Not())):
            return "inverts a truth value with `~`, which makes -1 or -2 of it in Python", "write `not`"
        case ast.BinOp(op=ast.MatMult()) | ast.AugAssign(op=ast.MatMult()):
            fix = "write the sums as loops, such as y[i] += A[i, j] * x[j]"
            return "multiplies matrices with `@`, which makes a new array and adds in another order", fix
        case ast.BinOp(op=ast.Mod(), left=ast.Constant(value=str())):
            return (
                "formats text, which the two engines do differently",
                "compute with numbers; messages are constant texts",
            )
        case ast.Compare() if any(isinstance(o, ast.Is | ast.IsNot) for o in node.ops):
            return "asks with `is` for the same object, which numbers are not", "compare with == or !="
        case ast.Call():
            return _call(node, scope)
        case ast.Subscript(ctx=ast.Store() | ast.Del(), value=ast.Name(id=name)) if name in scope:
            return f"writes `{name}`, which belongs to the module", "keep what is to last in a State"
        case ast.Attribute() | ast.Name() if isinstance(node.ctx, ast.Load):
            value = resolve(node, scope)
            if isinstance(value, types.ModuleType):
                return None
            return _value(value, ast.unparse(node)) if _is_world(value) else None
    return None


def _call(node: ast.Call, scope: dict[str, Any]) -> tuple[str, str] | None:
    func = node.func
    value = resolve(func, scope)
    if value is round and len(node.args) + len(node.keywords) > 1:
        what = "rounds to decimal digits with `round()`, which the two engines do differently"
        return what, "scale it, such as math.floor(x * 100.0 + 0.5) / 100.0"
    if isinstance(func, ast.Attribute) and value is None:
        owner = resolve(func.value, scope)
        if func.attr in ADDING and owner is None:
            return _adds(f".{func.attr}()")
        if func.attr in ("copy", "flatten", "tolist") and owner is None:
            return _makes(f".{func.attr}()")
        if func.attr in ("format", "join", "split", "encode"):
            return "handles text, which the two engines do differently", "compute with numbers"
        return None
    return None if _is_world(value) else _value(value, ast.unparse(func))  # what is of the world is said of its name


def _value(value: Any, name: str) -> tuple[str, str] | None:
    """What is said of a function that is called."""
    module = getattr(value, "__module__", None) or ""
    if _is_world(value):
        if isinstance(value, types.BuiltinFunctionType | types.MethodType) and _is_random(value, name):
            return _draws(name)
        fix = "name `time` as an argument for the simulated time" if module == "time" else "bring it in by an input"
        return f"asks the world outside with `{name}`, which no run could repeat", fix
    if module == "builtins" and isinstance(value, types.BuiltinFunctionType | type):
        return _of_builtins(value, name)
    if module == "math":
        return _of_math(value, name)
    if module.startswith("numpy") or isinstance(value, np.ufunc):
        return _of_numpy(value, name, module)
    return None


def _of_builtins(value: Any, name: str) -> tuple[str, str] | None:
    if value in SHARED_BUILTINS or (isinstance(value, type) and issubclass(value, BaseException)):
        return None
    if value is sum:
        return _adds("sum()")
    if value is print:
        return "prints, which compiled code does not do as Python does", "declare a Local and record it"
    what = f"calls `{name}()`, which compiled code does not have as Python has it"
    return what, "compute with numbers and `math`"


def _of_numpy(value: Any, name: str, module: str) -> tuple[str, str] | None:
    if _is_in(value, SHARED_NUMPY):
        return None
    owner = type(getattr(value, "__self__", None)).__module__
    if module.startswith("numpy.random") or owner.startswith("numpy.random"):
        return _draws(name)
    if _is_in(value, MAKING_NUMPY):
        return _makes(f"{name}()")
    short = name.rpartition(".")[2]
    twin = _TWINS.get(short, short)
    if getattr(math, twin, None) in SHARED_MATH:
        return f"calls `{name}`, which the two engines do not have alike", f"use math.{twin}"
    if isinstance(value, type) and issubclass(value, np.generic):
        return f"makes a `{name}` of a number, and numbers are float64, int64 and bool", "leave it out"
    if isinstance(value, np.ufunc):
        fix = f"write {_INSTEAD[twin]}" if twin in _INSTEAD else "write it with `math`"
        return f"calls `{name}`, whose last bit may differ between the two engines", fix
    if short in ADDING | {"norm", "average", "einsum", "matmul", "vdot", "inner"}:
        return _adds(f"{name}()")
    return f"calls `{name}()`, which the two engines do not have alike", "write it as a loop, with numbers and `math`"


def _of_math(function: Any, name: str) -> tuple[str, str] | None:
    if function in SHARED_MATH:
        return None
    instead = _INSTEAD.get(function.__name__)
    what = f"calls `{name}()`, which the two engines do not have alike"
    return what, f"write {instead}" if instead else "write it as a loop, with numbers and other functions of `math`"


_TWINS = {"arcsin": "asin", "arccos": "acos", "arctan": "atan", "arctan2": "atan2", "power": "pow"} | {
    "arcsinh": "asinh",
    "arccosh": "acosh",
    "arctanh": "atanh",
}


def _adds(name: str) -> tuple[str, str]:
    what = f"calls `{name}`, which does not compute in the same order in the two engines"
    return what, "write the loop, such as total += u[q]"


def _makes(name: str) -> tuple[str, str]:
    what = f"makes a new array with `{name}`, which the two engines do not have alike"
    return what, "write a loop, such as into np.zeros(n) or a Local"


def _draws(name: str) -> tuple[str, str]:
    fix = "draw the numbers in a study and give them as parameters, or compute them from a State"
    return f"draws random numbers with `{name}`, which no run could repeat", fix


def _is_in(value: Any, functions: frozenset[Any]) -> bool:
    try:
        return value in functions
    except TypeError:
        return False


def _is_world(value: Any) -> bool:
    if not callable(value):
        return False
    owner = getattr(value, "__self__", None)
    own = type(owner).__module__ if owner is not None and not isinstance(owner, types.ModuleType) else ""
    return (getattr(value, "__module__", None) or own or "") in WORLD or own in WORLD


def _is_random(value: Any, name: str) -> bool:
    return type(getattr(value, "__self__", None)).__module__ == "random" or name.startswith("random.")
