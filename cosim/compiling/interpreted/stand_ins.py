"""What stands for built-in functions, `math` and `numpy` in interpreted functions."""

from __future__ import annotations

import builtins
import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from cosim.compiling.interpreted.libm import as_compiled
from cosim.compiling.interpreted.numbers import Integer, Truth, checked, number, plain, truth

_ONE = (
    *("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh", "erf", "erfc"),
    *("exp", "expm1", "log", "log2", "log10", "log1p", "sqrt", "fabs"),
)
_TWO = ("atan2", "pow", "copysign")
_NUMPY = {"arcsin": "asin", "arccos": "acos", "arctan": "atan", "arcsinh": "asinh", "arccosh": "acosh"}
_NUMPY |= {"arctanh": "atanh", "arctan2": "atan2"}
_SMALL = tuple(map(checked, range(1000)))  # those that loops count with


class _Int64(np.int64):
    """What `np.int64` is to interpreted functions: it makes their integers, and is still that data type."""

    def __new__(cls, value: Any = 0) -> Any:
        """Raises: OverflowError."""
        return Integer(value)


def _real(name: str, arguments: int) -> Callable[..., Any]:
    function = as_compiled(name, arguments)
    return lambda *values: np.float64(function(*map(float, values)))


def _to_integer(rounded: Callable[[float], int]) -> Callable[[Any], Any]:
    def convert(value: Any) -> Any:
        return Integer(rounded(float(value)) if isinstance(value, float) and math.isfinite(value) else value)

    return convert


def _range(*bounds: Any) -> Iterable[Integer]:
    numbers = range(*bounds)
    if min(numbers.start, numbers.stop) >= 0 and numbers.stop <= len(_SMALL) and numbers.step > 0:
        return _SMALL[numbers.start : numbers.stop : numbers.step]
    return map(checked, numbers)


def _enumerate(values: Any, start: Any = 0) -> Iterable[tuple[Integer, Any]]:
    return ((checked(k), value) for k, value in enumerate(values, start))


def _extreme(function: Callable[..., Any]) -> Callable[..., Any]:
    """Of `min` and `max`, which are real where one of the numbers is."""

    def compute(*values: Any) -> Any:
        found = function(*values)
        numbers = values[0] if len(values) == 1 and isinstance(values[0], tuple) else values
        return np.float64(found) if any(isinstance(n, float) for n in numbers) else found

    return compute


def _judged(predicate: Callable[..., Any]) -> Callable[..., Any]:
    return lambda *values: truth(predicate(*values))


def _numpy_extreme(compare: np.ufunc) -> Callable[..., Any]:
    """`np.minimum` and `np.maximum` as kernels have them: of equal numbers the first, whatever sign a zero has."""

    def compute(x: Any, y: Any, *out: Any) -> Any:
        x, y = plain(x), plain(y)
        found = np.where(compare(x, y) | np.isnan(x), x, y)
        if out:
            out[0][...] = found
            return out[0]
        return found if found.ndim else number(found[()])

    return compute


def elementwise(ufunc: np.ufunc, name: str) -> Callable[..., Any]:
    """What stands for a function of numpy: for numbers the one of `math`, where there is one."""
    scalar = MATH.get(_NUMPY.get(name, name))

    def compute(*values: Any, **more: Any) -> Any:
        if scalar and not any(isinstance(v, np.ndarray) for v in values):
            return scalar(*values)
        return number(ufunc(*map(plain, values), **more))

    return compute


#: By name, what interpreted functions find of Python's own, and of `math`.
BUILTINS = {
    "range": _range,
    "int": Integer,
    "round": _to_integer(round),
    "float": np.float64,
    "bool": Truth,
    "enumerate": _enumerate,
    "min": _extreme(min),
    "max": _extreme(max),
    "len": lambda value: checked(len(value)),
}
MATH: dict[str, Any] = {name: _real(name, 1) for name in _ONE}
MATH |= {name: _real(name, 2) for name in _TWO}
MATH |= {name: _to_integer(getattr(math, name)) for name in ("floor", "ceil", "trunc")}
MATH |= {name: _judged(getattr(math, name)) for name in ("isnan", "isinf", "isfinite")}
MATH |= {name: np.float64(getattr(math, name)) for name in ("pi", "e", "tau", "inf", "nan")}
#: What stands for a function or type, wherever it is met.
STANDING: dict[Any, Any] = {np.bool_: Truth, np.int64: _Int64}
STANDING |= {getattr(math, name): function for name, function in MATH.items() if callable(getattr(math, name))}
STANDING |= {getattr(builtins, name): function for name, function in BUILTINS.items()}
STANDING |= {np.minimum: _numpy_extreme(np.less_equal), np.maximum: _numpy_extreme(np.greater_equal)}
