"""Elementary functions: the same bits however they are computed, within 1 ulp of the truth, and C's special cases.

The truth is computed with decimal numbers, by series that have nothing in common with the functions'.
"""

from __future__ import annotations

import ctypes
import ctypes.util
import itertools
import math
import re
from decimal import Decimal, localcontext
from functools import cache

import llvmlite.binding as llvm
import numpy as np
import pytest

from cosim.compiling import emission
from cosim.compiling.interpreted.libm import as_compiled
from cosim.machine import object_code
from cosim.plain_math import wide_angles
from cosim.plain_math.definitions import FUNCTIONS, definition, renamed, with_definitions

LARGEST, LEAST, NORMAL = np.finfo(float).max, 5e-324, np.finfo(float).tiny
SPECIAL = [0.0, 1.0, 0.5, 2.0, 3.0, 1e300, 1e-300, LARGEST, LEAST, NORMAL, NORMAL - LEAST, math.inf, math.nan]
SPECIAL += [1 + 2**-52, 1 - 2**-53, 2.0**52 + 1, 2.0**53 - 1, 2.0**53, 2.0**53 + 2, 710.0, 746.0, 22.0]
SPECIAL += [709.782712893384, 709.7827128933841, 745.1332191019411, 745.1332191019412, 708.3964185322641]
SPECIAL += [math.pi / 4, math.pi / 2, math.pi, 823548.9, 823549.0, math.nextafter(823549.0, 0.0)]
SPECIAL += [6381956970095103.0 * 2.0**797]  # of all the nearest to a multiple of pi/2
SPECIAL = np.array(SPECIAL + [-x for x in SPECIAL])
ENDS = (0.0, math.inf, -math.inf)


def scattered(count: int, seed: int) -> np.ndarray:
    """Numbers of all sizes, with many near 1, and next to multiples of pi/2."""
    draw = np.random.default_rng(seed)
    quarters = draw.integers(-(2**19), 2**19, count) * (math.pi / 2)
    return np.concatenate(
        [
            draw.uniform(-4.0, 4.0, count),
            draw.uniform(-750.0, 750.0, count),
            1.0 + draw.uniform(-1.0, 1.0, count) * 2.0 ** draw.uniform(-52, 0, count),
            np.exp2(draw.uniform(-40.0, 40.0, count)) * draw.choice([-1.0, 1.0], count),
            draw.integers(-(2**63), 2**63 - 1, count).view(float),
            quarters + np.spacing(quarters) * draw.integers(-2, 3, count),
        ]
    )


@cache
def arguments(name: str) -> tuple[np.ndarray, ...]:
    """What a function is tried with."""
    x = np.concatenate([scattered(2000, 1), SPECIAL])
    if FUNCTIONS[name].arguments == 1:
        return (x,)
    other = np.random.default_rng(2).permutation(scattered(2000, 3))
    pairs = np.array([*itertools.product(SPECIAL, SPECIAL)]).T
    return np.concatenate([x, pairs[0]]), np.concatenate([other, SPECIAL[::-1], pairs[1]])


def evaluated(name: str, *x: np.ndarray) -> np.ndarray:
    """A function by numpy's operations, one after the other."""
    function = FUNCTIONS[name]
    with np.errstate(all="ignore"):
        core = function.core(*x)
        return core if function.wide is None else np.where(function.outside(*x), function.wide(*x), core)


def assert_same_bits(name: str, found: np.ndarray, wanted: np.ndarray, x: tuple[np.ndarray, ...]) -> None:
    """NaN has many bits."""
    differ = (found.view(np.int64) != wanted.view(np.int64)) & ~(np.isnan(found) & np.isnan(wanted))
    assert not differ.any(), (name, [a[differ][0] for a in x], found[differ][0], wanted[differ][0])


LOOP = """
define void @loop_{name}(i64 %count, ptr noalias %x0, ptr noalias %x1, ptr noalias %y) {{
entry:
  br label %loop
loop:
  %k = phi i64 [ 0, %entry ], [ %next, %loop ]
  %a0 = getelementptr double, ptr %x0, i64 %k
  %a1 = getelementptr double, ptr %x1, i64 %k
  %b = getelementptr double, ptr %y, i64 %k
  %v0 = load double, ptr %a0
  %v1 = load double, ptr %a1
  %r = call double @{called}({values})
  store double %r, ptr %b
  %next = add i64 %k, 1
  %more = icmp slt i64 %next, %count
  br i1 %more, label %loop, label %done
done:
  ret void
}}
"""


def loop_ir(name: str, called: str) -> str:
    values = ", ".join(f"double %v{k}" for k in range(FUNCTIONS[name].arguments))
    return definition(name) + LOOP.format(name=name, called=called, values=values)


def looped(library: object_code.Library, name: str, x: tuple[np.ndarray, ...]) -> np.ndarray:
    y = np.empty_like(x[0])
    run = ctypes.CFUNCTYPE(None, ctypes.c_int64, *[ctypes.c_void_p] * 3)(library.address(f"loop_{name}"))
    run(y.size, x[0].ctypes.data, x[-1].ctypes.data, y.ctypes.data)
    return y


def unoptimised(ir: str) -> object_code.Library:
    object_code.host()
    machine = llvm.Target.from_default_triple().create_target_machine(opt=0, reloc="pic", codemodel="default")
    return object_code.Library(machine.emit_object(llvm.parse_assembly(ir)))


@pytest.mark.parametrize("name", FUNCTIONS)
def test_code_computes_what_python_does_step_by_step(name):
    x = arguments(name)
    wanted = evaluated(name, *x)
    compiled = as_compiled(name, FUNCTIONS[name].arguments)
    assert_same_bits(name, np.array([*map(compiled, *(a.tolist() for a in x))]), wanted, x)
    assert_same_bits(name, looped(unoptimised(loop_ir(name, f"cosim_{name}")), name, x), wanted, x)


@pytest.mark.parametrize("name", FUNCTIONS)
@pytest.mark.parametrize("processor", ["this", "any"])
def test_vectors_have_the_bits_of_scalars(name, processor):
    """The core has no branch, so that LLVM computes as many at once as there is room for."""
    triple, *own = object_code.host()
    target = (triple, *(own if processor == "this" else ("generic", "")))
    ir = loop_ir(name, f"cosim_{name}_core")
    text = str(emission._optimised(ir, *target, [f"loop_{name}"])[1])
    assert re.search(r"fmul <\d+ x double>", text)
    function, x = FUNCTIONS[name], arguments(name)
    if function.outside is not None:
        near = ~function.outside(*x)
        x = tuple(a[near] for a in x)
    found = looped(object_code.Library(emission.emit(ir, *target, [f"loop_{name}"], name)), name, x)
    assert_same_bits(name, found, evaluated(name, *x), x)


def test_nothing_may_be_computed_otherwise_than_it_stands_there():
    """No fast-math flag, no fused operation, no function of a library, and no branch but the one to wide angles."""
    for name in FUNCTIONS:
        for line in definition(name).splitlines():
            if found := re.match(r"  %\w+ = (\w+) (\w+)", line):
                assert found[1] in _INSTRUCTIONS, line
                assert found[1] not in ("fadd", "fsub", "fmul", "fdiv", "fneg") or found[2] == "double", line
        assert {*re.findall(r"@([\w.]+)\(", definition(name))} <= {
            *("llvm.fabs.f64", "llvm.sqrt.f64"),
            *(f"cosim_{name}{part}" for part in ("", "_core", "_outside", "_wide")),
        }
        assert definition(name).count(" br ") == (FUNCTIONS[name].wide is not None)


_INSTRUCTIONS = (
    "fadd fsub fmul fdiv fneg fcmp icmp add sub mul and or xor shl lshr select bitcast call load getelementptr"
)
_INSTRUCTIONS = {*_INSTRUCTIONS.split()}


def test_calls_of_the_c_library_become_calls_of_these_whose_definitions_come_along():
    ir = "declare double @llvm.sin.f64(double) #2\ndeclare double @tanh(double)\ndeclare double @tan(double)\n"
    ir += "define double @f(double %x) {\n  %a = call double @llvm.sin.f64(double %x)\n"
    ir += "  %b = call double @tanh(double %a)\n  %c = call double @tan(double %b)\n  ret double %c\n}\n"
    found = with_definitions(renamed(ir))
    defined = {*re.findall(r"define .*@(\w+)\(", found)}
    assert defined == {"f", "cosim_sin", "cosim_tanh"} | {f"cosim_sin_{p}" for p in ("core", "outside", "wide")} | {
        "cosim_tanh_core"
    }
    assert "declare double @tan(" in found and "llvm.sin" not in found
    llvm.parse_assembly(found)


# ---- the truth ----


def pi_digits(places: int) -> int:
    """pi 10^places, after Machin."""

    def arctangent(n: int) -> int:
        term = total = unit // n
        k = 1
        while term:
            term //= -n * n
            k += 2
            total += term // k
        return total

    unit = 10 ** (places + 10)
    return 4 * (4 * arctangent(5) - arctangent(239)) // 10**10


PI = Decimal(f"{pi_digits(420)}e-420")


def sine(x: Decimal) -> Decimal:
    """By its series, of a remainder modulo 2 pi."""
    x = x - 2 * PI * (x / (2 * PI)).to_integral_value()
    term = total = x
    k = 1
    while abs(term) > Decimal(10) ** -60 * abs(x):
        k += 2
        term = -term * x * x / (k * (k - 1))
        total += term
    return total


def arctangent(x: Decimal) -> Decimal:
    """By its series, of an angle that is halved thrice."""
    for _ in range(3):
        x = x / (1 + (1 + x * x).sqrt())
    total = power = x
    k = 1
    while abs(power) > Decimal(10) ** -60 * abs(x):
        k += 2
        power = -power * x * x
        total += power / k
    return 8 * total


def angle(y: Decimal, x: Decimal) -> Decimal:
    if abs(y) > abs(x):
        return (PI / 2).copy_sign(y) - arctangent(x / y)
    return arctangent(y / x) + (PI.copy_sign(y) if x < 0 else 0)


TRUTH = {
    "exp": lambda x: x.exp(),
    "log": lambda x: x.ln(),
    "sin": sine,
    "cos": lambda x: sine(PI / 2 - x),
    "tanh": lambda x: 1 - 2 / ((2 * x).exp() + 1) if abs(x) > 1e-20 else x - x**3 / 3,
    "pow": lambda x, y: (y * x.ln()).exp(),
    "atan2": angle,
}
DIGITS = {"sin": 400, "cos": 400, "pow": 80, "tanh": 90}


def tried(name: str) -> list[tuple[float, ...]]:
    """Arguments for which there is a finite result."""
    draw = np.random.default_rng(4)
    x = scattered(40, 5)
    if name == "exp":
        x = x[(x > -745.0) & (x < 709.7)]
    elif name == "log":
        x = np.abs(x)
    elif name == "tanh":
        x = x[np.abs(x) < 40.0]
    elif name in ("sin", "cos"):
        x = np.append(x, [1e300, LARGEST, 6381956970095103.0 * 2.0**797])
    x = x[np.isfinite(x) & (x != 0.0)]
    if name == "pow":
        x = np.abs(x[x != 1.0])
        return [*zip(x.tolist(), (draw.uniform(-745.0, 709.0, x.size) / np.log(x)).tolist(), strict=True)]
    if name == "atan2":
        return [*zip(x.tolist(), (x * draw.normal(size=x.size)).tolist(), strict=True)]
    return [(v,) for v in x.tolist()]


@pytest.mark.parametrize("name", FUNCTIONS)
def test_results_are_within_one_unit_in_the_last_place(name):
    function = as_compiled(name, FUNCTIONS[name].arguments)
    worst = 0.0
    for x in tried(name):
        with localcontext() as context:
            context.prec, context.Emin, context.Emax = DIGITS.get(name, 70), -(10**6), 10**6
            truth = TRUTH[name](*map(Decimal, x))
            unit = Decimal(math.ulp(float(truth)))
            error = float(abs(Decimal(function(*x)) - truth) / unit)
        assert error <= 1.0, (name, x, function(*x), truth)
        worst = max(worst, error)
    assert worst > 0.4  # or the truth would be the function's own


def test_the_digits_of_two_over_pi():
    places = 420
    digits = (2 * 10**places << wide_angles.TWO_OVER_PI_BITS) // pi_digits(places)
    assert digits == wide_angles.TWO_OVER_PI


# ---- special cases ----


@pytest.mark.parametrize("name", FUNCTIONS)
def test_special_cases_are_those_of_c(name):
    """Which are 0, infinite, or no number; its other results may be those of any C library."""
    count = FUNCTIONS[name].arguments
    c = ctypes.CDLL(ctypes.util.find_library("m") or None)[name]
    c.restype, c.argtypes = ctypes.c_double, [ctypes.c_double] * count
    ours = as_compiled(name, count)
    for x in itertools.product(SPECIAL.tolist(), repeat=count):
        found, wanted = ours(*x), c(*x)
        if math.isnan(wanted) or math.isnan(found):
            assert math.isnan(wanted) and math.isnan(found), (name, x, found)
        elif found in ENDS or wanted in ENDS:
            assert found == wanted and math.copysign(1.0, found) == math.copysign(1.0, wanted), (name, x, found)


def test_exact_powers_are_exact():
    """The error before the one rounding is below half a unit, so that what can be a float64 is that."""
    power = as_compiled("pow", 2)
    for x, y in itertools.product(range(-40, 41), range(20)):
        if abs(x**y) < 2**53:
            assert power(float(x), float(y)) == x**y
    assert [power(n * n / 16, 0.5) for n in range(1000)] == [n / 4 for n in range(1000)]
