"""Authors' functions as plain Python whose numbers behave as in compiled kernels, to the bit.

A kernel computes with float64 (IEEE 754, so that 1/0 is infinite and sqrt(-1) is NaN), int64 (which wraps) and bool,
with which it counts; narrower elements are widened when they are read. Python raises here, its integers grow, and numpy
adds truth values as it pleases. So an interpreted function is its own code, line by line, with other constants, with
the truth of a comparison as an integer, and with stand-ins for `math`, `numpy` and some built-in functions.
"""

from __future__ import annotations

import ast
import builtins
import ctypes
import ctypes.util
import linecache
import math
import types
from collections.abc import Callable, Iterable
from functools import cache, lru_cache
from typing import Any

import numpy as np

_SIGN, _MODULUS = 1 << 63, 1 << 64
_REPEATED = 0x10000  # up to this exponent, an integer power is a repeated product


def _checked(value: int) -> Integer:
    """An integer that is known to have 64 bits."""
    return int.__new__(Integer, value)


def _wrapped(value: int) -> Integer:
    return _checked((value + _SIGN) % _MODULUS - _SIGN)


def _binary(name: str, swapped: bool) -> Callable[[Any, Any], Any]:
    operation = getattr(int, f"__{name}__")
    real = getattr(np.float64, f"__{name}__")
    divides = name in ("floordiv", "mod")

    def compute(self: Any, other: Any) -> Any:
        if isinstance(other, (int, np.integer, np.bool_)):
            a, b = (int(other), int(self)) if swapped else (int(self), int(other))
            if divides and (a, b) == (-_SIGN, -1):
                raise OverflowError("no 64-bit integer")
            return _wrapped(operation(a, b))
        if isinstance(other, float):
            x, y = np.float64(self), np.float64(other)
            return real(y, x) if swapped else real(x, y)
        return NotImplemented

    return compute


def _compared(name: str) -> Callable[[Any, Any], Any]:
    exact, real = getattr(int, f"__{name}__"), getattr(float, f"__{name}__")

    def compare(self: Any, other: Any) -> Any:
        return real(float(self), float(other)) if isinstance(other, float) else exact(self, other)

    return compare


class Integer(int):
    """A 64-bit integer."""

    __array_ufunc__ = None  # so that numpy's numbers leave the operation to this class

    def __new__(cls, value: Any = 0) -> Integer:
        """Raises: OverflowError for what is no 64-bit integer, NaN among it."""
        if not -_SIGN <= value < _SIGN:
            raise OverflowError("no 64-bit integer")
        return super().__new__(cls, value)

    def __truediv__(self, other: Any) -> Any:
        return np.float64(self) / np.float64(other) if isinstance(other, (int, float, np.integer)) else NotImplemented

    def __rtruediv__(self, other: Any) -> Any:
        return np.float64(other) / np.float64(self) if isinstance(other, (int, float, np.integer)) else NotImplemented

    def __pow__(self, other: Any, modulus: Any = None) -> Any:
        if isinstance(other, float):
            return np.float64(_libm("pow", 2)(float(self), float(other)))
        if not 0 <= other <= _REPEATED:
            raise ValueError(f"an integer to a power below 0 or above {_REPEATED}")
        return _wrapped(pow(int(self), int(other), _MODULUS))

    def __rpow__(self, other: Any, modulus: Any = None) -> Any:
        return power(np.float64(other), self) if isinstance(other, float) else Integer(other) ** self

    def __lshift__(self, other: Any) -> Any:
        return _wrapped(int(self) << _places(other))

    def __rlshift__(self, other: Any) -> Any:
        return _wrapped(int(other) << _places(self))

    def __rshift__(self, other: Any) -> Any:
        return Integer(int(self) >> _places(other))

    def __rrshift__(self, other: Any) -> Any:
        return Integer(int(other) >> _places(self))

    def __divmod__(self, other: Any) -> Any:
        return self // other, self % other

    def __rdivmod__(self, other: Any) -> Any:
        return other // self, other % self

    def __neg__(self) -> Integer:
        return _wrapped(-int(self))

    def __abs__(self) -> Integer:
        return _wrapped(abs(int(self)))

    def __invert__(self) -> Integer:
        return Integer(~int(self))

    def __pos__(self) -> Integer:
        return self

    def view(self, dtype: Any) -> Any:
        """The same 64 bits as a number of another type."""
        return number(np.int64(self).view(dtype))

    __hash__ = int.__hash__


_SMALL = tuple(map(_checked, range(1000)))  # those that loops count with

for _name in ("add", "sub", "mul", "floordiv", "mod"):
    setattr(Integer, f"__{_name}__", _binary(_name, swapped=False))
    setattr(Integer, f"__r{_name}__", _binary(_name, swapped=True))
for _name in ("lt", "le", "eq", "ne", "gt", "ge"):
    setattr(Integer, f"__{_name}__", _compared(_name))
for _name in ("and", "or", "xor"):
    for _prefix in ("", "r"):
        _bits = getattr(int, f"__{_name}__")
        setattr(Integer, f"__{_prefix}{_name}__", lambda self, other, bits=_bits: Integer(bits(int(self), int(other))))


class Truth(Integer):
    """A truth value, which counts as 0 or 1: what `bool` is to interpreted functions."""

    def __new__(cls, value: Any = False) -> Truth:
        return _TRUTHS[1 if value else 0]


class _Int64(np.int64):
    """What `np.int64` is to interpreted functions: it makes their integers, and is still that data type."""

    def __new__(cls, value: Any = 0) -> Any:
        """Raises: OverflowError."""
        return Integer(value)


_TRUTHS = tuple(int.__new__(Truth, value) for value in range(2))


def _places(value: Any) -> int:
    if not 0 <= value < 64:
        raise ValueError("a shift by less than 0 or more than 63 places")
    return int(value)


def power(base: np.float64, exponent: int) -> np.float64:
    """An integer power: a repeated product, as kernels have it."""
    if base == 0.0 and exponent < 0:
        raise ZeroDivisionError("0.0 to a negative integer power")
    left = abs(int(exponent))
    if left > _REPEATED:
        return np.float64(_libm("pow", 2)(base, float(exponent)))
    result, factor = np.float64(1.0), base
    while left:
        if left & 1:
            result = result * factor
        left >>= 1
        factor = factor * factor
    return np.float64(1.0) / result if exponent < 0 else result


def truth(value: Any) -> Any:
    """A truth value that counts as in kernels; anything else that a comparison gives as it is."""
    return Truth(value) if isinstance(value, (bool, np.bool_)) else value


def number(value: Any) -> Any:
    """What a kernel makes of a constant, or of an element that it reads."""
    if type(value) is np.float64:
        return value
    if isinstance(value, (bool, np.bool_)):
        return truth(value)
    if isinstance(value, (int, np.integer)):
        return Integer(value)
    if isinstance(value, (float, np.floating)):
        return np.float64(value)
    return value


class Reals(np.ndarray):
    """An array of float64, whose elements numpy reads and writes as kernels do."""

    @property
    def size(self) -> Integer:  # type: ignore[override]
        """How many elements there are."""
        return _checked(super().size)

    @property
    def ndim(self) -> Integer:  # type: ignore[override]
        """How many axes there are."""
        return _checked(super().ndim)

    @property  # type: ignore[misc]
    def shape(self) -> tuple[Integer, ...]:  # type: ignore[override]
        """The sizes of the axes."""
        return tuple(map(_checked, super().shape))


class Array(Reals):
    """An array of another type, whose elements are read as kernels read them, and written where they fit."""

    def __getitem__(self, index: Any) -> Any:
        found = super().__getitem__(index)
        return found if isinstance(found, np.ndarray) else number(found)

    def __setitem__(self, index: Any, value: Any) -> None:
        if not isinstance(value, np.ndarray):
            fits(value, self.dtype)
        super().__setitem__(index, value)


for _name, _ufunc in (("add", np.add), ("sub", np.subtract), ("mul", np.multiply), ("truediv", np.divide)):
    setattr(Reals, f"__i{_name}__", lambda self, other, ufunc=_ufunc: ufunc(self, _plain(other), out=self))


def array(plain: np.ndarray) -> np.ndarray:
    """An array as an interpreted function sees it, in the same memory."""
    return plain.view(Reals if plain.dtype == np.float64 else Array)


def _plain(value: Any) -> Any:
    """A number as numpy knows it."""
    return int(value) if isinstance(value, Integer) else value


_BOUNDS = {np.dtype(kind): (np.iinfo(kind).min, np.iinfo(kind).max) for kind in "bBhHiIqQ"}


def fits(value: Any, dtype: np.dtype) -> None:
    """Raises: TypeError, OverflowError, where an element of that type cannot hold the number."""
    if isinstance(value, float):
        if dtype.kind != "f":
            raise TypeError(f"a real number is put into an array of {dtype}")
    elif dtype in _BOUNDS:
        least, most = _BOUNDS[dtype]
        if not least <= value <= most:
            raise OverflowError(f"{int(value)} does not fit into {dtype}")


# ---- stand-ins --------------------------------------------------------------------------------------------------

_ONE = (
    *("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh", "erf", "erfc"),
    *("exp", "expm1", "log", "log2", "log10", "log1p", "sqrt", "fabs"),
)
_TWO = ("atan2", "pow", "copysign")
_NUMPY = {"arcsin": "asin", "arccos": "acos", "arctan": "atan", "arcsinh": "asinh", "arccosh": "acosh"}
_NUMPY |= {"arctanh": "atanh", "arctan2": "atan2"}


@cache
def _libm(name: str, arguments: int) -> Callable[..., float]:
    library = ctypes.CDLL(ctypes.util.find_library("m") or None)
    function = getattr(library, name)
    function.restype, function.argtypes = ctypes.c_double, [ctypes.c_double] * arguments
    return function


def _of_libm(name: str, arguments: int) -> Callable[..., Any]:
    function = _libm(name, arguments)
    return lambda *values: np.float64(function(*map(float, values)))


def _to_integer(rounded: Callable[[float], int]) -> Callable[[Any], Any]:
    def convert(value: Any) -> Any:
        return Integer(rounded(float(value)) if isinstance(value, float) and math.isfinite(value) else value)

    return convert


def _range(*bounds: Any) -> Iterable[Integer]:
    numbers = range(*bounds)
    if min(numbers.start, numbers.stop) >= 0 and numbers.stop <= len(_SMALL) and numbers.step > 0:
        return _SMALL[numbers.start : numbers.stop : numbers.step]
    return map(_checked, numbers)


def _enumerate(values: Any, start: Any = 0) -> Iterable[tuple[Integer, Any]]:
    return ((_checked(k), value) for k, value in enumerate(values, start))


def _extreme(function: Callable[..., Any]) -> Callable[..., Any]:
    """Of `min` and `max`, which are real where one of the numbers is."""

    def compute(*values: Any) -> Any:
        found = function(*values)
        numbers = values[0] if len(values) == 1 and isinstance(values[0], tuple) else values
        return np.float64(found) if any(isinstance(n, float) for n in numbers) else found

    return compute


def _judged(predicate: Callable[..., Any]) -> Callable[..., Any]:
    return lambda *values: truth(predicate(*values))


_BUILTINS = {
    "range": _range,
    "int": Integer,
    "round": _to_integer(round),
    "float": np.float64,
    "bool": Truth,
    "enumerate": _enumerate,
    "min": _extreme(min),
    "max": _extreme(max),
    "len": lambda value: _checked(len(value)),
}
_MATH: dict[str, Any] = {name: _of_libm(name, 1) for name in _ONE}
_MATH |= {name: _of_libm(name, 2) for name in _TWO}
_MATH |= {name: _to_integer(getattr(math, name)) for name in ("floor", "ceil", "trunc")}
_MATH |= {name: _judged(getattr(math, name)) for name in ("isnan", "isinf", "isfinite")}
_MATH |= {name: np.float64(getattr(math, name)) for name in ("pi", "e", "tau", "inf", "nan")}
_STANDING: dict[Any, Any] = {np.bool_: Truth, np.int64: _Int64}
_STANDING |= {getattr(math, name): function for name, function in _MATH.items() if callable(getattr(math, name))}
_STANDING |= {getattr(builtins, name): function for name, function in _BUILTINS.items()}


class _Module:
    """A module whose functions and numbers are those of interpreted functions."""

    def __init__(self, module: types.ModuleType) -> None:
        self._module = module

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._module, name)
        if self._module is math:
            found = _MATH.get(name, found)
        elif self._module is np and isinstance(found, np.ufunc) and found not in _STANDING:
            found = _elementwise(found, _MATH.get(_NUMPY.get(name, name)))
        else:
            found = seen(found)
        setattr(self, name, found)
        return found


def _elementwise(ufunc: np.ufunc, scalar: Callable[..., Any] | None) -> Callable[..., Any]:
    def compute(*values: Any, **more: Any) -> Any:
        if scalar and not any(isinstance(v, np.ndarray) for v in values):
            return scalar(*values)
        return number(ufunc(*map(_plain, values), **more))

    return compute


def _numpy_extreme(compare: np.ufunc) -> Callable[..., Any]:
    """`np.minimum` and `np.maximum` as kernels have them: of equal numbers the first, whatever sign a zero has."""

    def compute(x: Any, y: Any, *out: Any) -> Any:
        x, y = _plain(x), _plain(y)
        found = np.where(compare(x, y) | np.isnan(x), x, y)
        if out:
            out[0][...] = found
            return out[0]
        return found if found.ndim else number(found[()])

    return compute


_STANDING |= {np.minimum: _numpy_extreme(np.less_equal), np.maximum: _numpy_extreme(np.greater_equal)}


def seen(value: Any) -> Any:
    """What an interpreted function sees of a global, a default value, or a constant."""
    value = getattr(value, "py_func", value)  # a jitted function
    if isinstance(value, types.FunctionType):
        return function(value)
    if isinstance(value, types.ModuleType):
        return _Module(value)
    if isinstance(value, types.CodeType):
        return _code(value)
    if isinstance(value, tuple):
        return tuple(map(seen, value))
    if isinstance(value, np.ndarray):
        constant = array(value)
        constant.flags.writeable = False
        return constant
    try:
        return _STANDING.get(value, number(value))
    except (TypeError, OverflowError):  # not hashable, or no number of ours
        return value


_functions: dict[int, tuple[Any, Any]] = {}


def function(python: Callable[..., Any]) -> Callable[..., Any]:
    """The function with the numbers of kernels. Its file and lines stay, so that breakpoints hold."""
    if id(python) in _functions:
        return _functions[id(python)][1]
    assert isinstance(python, types.FunctionType)
    scope: dict[str, Any] = {
        "__builtins__": vars(builtins) | _BUILTINS | {_TRUTH: truth},
        "__name__": python.__module__,
    }
    cells = tuple(types.CellType() for _ in python.__closure__ or ())
    made = types.FunctionType(_code(_counting(python)), scope, python.__name__, None, cells or None)
    _functions[id(python)] = python, made  # now, as helpers may call each other
    made.__defaults__ = seen(python.__defaults__)
    made.__kwdefaults__ = {k: seen(v) for k, v in (python.__kwdefaults__ or {}).items()} or None
    for cell, origin in zip(cells, python.__closure__ or (), strict=True):
        cell.cell_contents = seen(origin.cell_contents)
    for name in _names(python.__code__):
        if name in python.__globals__:
            scope[name] = seen(python.__globals__[name])
    return made


_TRUTH = "truth of kernels"
"""Under a name that no author can write."""


class _Counting(ast.NodeTransformer):
    """Makes an integer of what comparisons and `not` give; every line stays where it is."""

    def _judge(self, node: Any) -> Any:
        judged: Any = self.generic_visit(node)
        called = ast.Call(ast.Name(_TRUTH, ast.Load()), [judged], [])
        return ast.fix_missing_locations(ast.copy_location(called, node))

    visit_Compare = _judge

    def visit_UnaryOp(self, node: ast.UnaryOp) -> Any:
        return self._judge(node) if isinstance(node.op, ast.Not) else self.generic_visit(node)


def _counting(python: types.FunctionType) -> types.CodeType:
    """A function's code in which truth values count; its own code where its text cannot be read."""
    code = python.__code__
    text = "".join(linecache.getlines(code.co_filename, python.__globals__))
    return next((counting for plain, counting in _module_codes(text, code.co_filename) if plain == code), code)


@lru_cache(maxsize=64)
def _module_codes(text: str, file: str) -> tuple[tuple[types.CodeType, types.CodeType], ...]:
    """The code of every function of a module, and the same in which truth values count."""
    try:
        plain = compile(text, file, "exec", dont_inherit=True)
        counting = compile(_Counting().visit(ast.parse(text)), file, "exec", dont_inherit=True)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return ()
    return tuple(zip(_codes(plain), _codes(counting), strict=True))


def _codes(code: types.CodeType) -> Iterable[types.CodeType]:
    for inner in (c for c in code.co_consts if isinstance(c, types.CodeType)):
        yield inner
        yield from _codes(inner)


def _code(code: types.CodeType) -> types.CodeType:
    return code.replace(co_consts=seen(code.co_consts))


def _names(code: types.CodeType) -> set[str]:
    inner = (c for c in code.co_consts if isinstance(c, types.CodeType))
    return set(code.co_names).union(*map(_names, inner))
