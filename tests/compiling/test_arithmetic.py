"""Both engines compute alike, to the bit, or refuse alike: widths, domain errors, what numbers may become."""

import bdb
import itertools
import json
import math
import re
import sys

import numpy as np
import pytest

from cosim.engine import program, run
from cosim.engine.simulation import Simulation
from cosim.errors import BlockFailed
from cosim.terminal import cli

REALS = [0.0, -0.0, 1.0, -1.0, 2.5, -2.5, 0.5, 3.0, 1e-310, 1e300, -1e300, 709.0, 1e16, math.pi]
WHOLE = [0, 1, -1, 2, -7, 63, 2**31, -(2**31), 2**53 + 1, 2**62, 2**63 - 1, -(2**63)]

# Expressions in the reals a, b, the integers i, j (j is not 0), the booleans p, q, and narrow ones.
REAL = """
a + b; a - b; a * b; a / b; -a; abs(a); a // b; a % b; a ** b; a ** 0.5; a ** 2; a ** 3; (a or 1.0) ** -1; a ** 7
a ** (j % 9); a + i; i - a; a * i; i / a; a / i; i / j; i // a; a % i; 2 ** a; (a > b) * a; min(a, b); max(a, b)
max(a, i); math.sqrt(a); math.log(a); math.log2(a); math.log10(a); math.log1p(a); math.exp(a)
math.expm1(a); math.acos(a)
math.asin(a); math.atan(a); math.atan2(a, b); math.sin(a); math.cos(a); math.tan(a); math.sinh(a); math.cosh(a)
math.tanh(a); math.asinh(a); math.acosh(a); math.atanh(a); math.erf(a); math.erfc(a)
math.pow(a, b); math.pow(2.0, a); math.pow(10.0, a); math.pow(a, 2.0); math.pow(a, 0.5); math.fabs(a)
math.copysign(a, b); np.sin(a); np.exp(a); np.log(a); np.sqrt(a); np.arctan2(a, b); np.abs(a); np.sqrt(abs(i)); 1 / a
1.0 / (a - a); math.inf - a; a * math.nan; float(i); f32 + f32; -f32; f32 * f32 / 3; f32 + u8; math.sqrt(i)
a if p else b; ZERO / ZERO; 0.0 / ZERO; 1.0 / ZERO; a * LIST[1]; divmod(a, b)[0]; divmod(a, b)[1]
sum_of(a, b, i); default(a); math.pi * a; abs(-a) ** 1.5; (-a) ** b; (a or 1.0) ** i8; 2.0 ** -1074 * a
min(f) * min(f); max(f) - 1e-9; -max(f); SINGLE * SINGLE; SINGLE + f32; (a > b) / 4; ((a > 0) + (b > 0)) * 0.5
np.arctanh(a); np.minimum(a, b); np.maximum(a, b); np.minimum(a, 0.0); np.minimum(-0.0, a); np.maximum(i, a)
np.add(a, p)
np.int64(i).view(np.float64); np.int64(np.float64(a).view(np.int64) ^ 1).view(np.float64)
COUPLE[0] * COUPLE[1]; -COUPLE[0] / 3; np.float64(i) / 3; (np.bool_(a) + np.bool_(b)) / 2; -np.bool_(a) / 2
(a > b) / (a < b); -p / q; (not p) / (i > 0); n8.size / (n8.size - n8.shape[0]); share(a, b)
""".replace("\n", ";").split(";")
INTEGER = """
i + j; i - j; i * j; -i; ~i; abs(i); i & j; i | j; i ^ j; i // (j & 62 | 3); i % (j & 62 | 3);
i << (j & 63); i >> (j & 63)
i8 + i8; i8 * i8; i8 - 1; -i8; u8 - 3; u8 * 300; -u8; ~u8; u8 << 9; i32 * i32; i32 + i32; i32 - 1; -i32; u8 // 7; u8 % 7
u64 - 9; u64 * 5; -u64; p + q; p - q; -p; p * i; p & q; p | q; p ^ q; (a > b) + (a < b); max(i, j); min(i, j); int(p)
math.floor(c); math.ceil(c); math.trunc(c); int(c); round(c); i ** 2; i ** 3; (-1) ** (j & 7); 3 ** 4
divmod(i, j & 62 | 3)[0]; divmod(i, j & 62 | 3)[1]; i + p; i > a; i == a; 2**53 + i; BIG * i; len((a, b)); int(u8) - 5
i8 % 3; (i < j) == p; a < i; a == b; a != a; i8 // -2; i8 >> 1; bool(a) + 1; bool(i) + 1; math.isnan(a) + 0
math.isinf(a / b) + 0; min(n8) - max(n8); -max(n8); -min(n8); abs(min(n8)); min(TABLE) - max(TABLE); -BYTE; BYTE + BYTE
-n8.item(); n8.item() * 300
TRIPLE[0] * TRIPLE[1]; -TRIPLE[2]; np.int64(c) * 3; np.minimum(i, j); np.maximum(i, j); np.add(i, p)
BYTE * i; (a > b) + (a >= b); (a > b) - (a < b); -(a > b); +(a > b); (not a) + (not b); (0.0 < a < b) + (p == q)
n8.size - 2; n8.shape[0] - 2; n8.ndim - 2; ranks(a, b); 2**63 - 1 + (i > j); (i > j) - 2**63; p + p + q; (p + q) ** 5
math.isnan(a) + math.isinf(b) + math.isfinite(a); np.isnan(a) + np.isfinite(b); bool(a) + bool(b) + bool(i)
(i in (1, 2)) + (i in (1, 3)); (i > j) * i; i * i + (i > j); sorted_by(a, b, i)
""".replace("\n", ";").split(";")
REAL, INTEGER = ([e.strip() for e in expressions if e.strip()] for expressions in (REAL, INTEGER))

HEAD = """import math
import numpy as np
from cosim import Block, Output, Parameter

ZERO, BIG, LIST = 0.0, 2**61, (1.0, 2.0)
BYTE, SINGLE, TABLE = np.uint8(200), np.float32(0.1), np.array([200, 3], np.uint8)
COUPLE, TRIPLE = (np.float32(0.1), np.int8(100)), (np.uint32(4000000000),) * 3


def sum_of(a, b, i):
    total = 0
    for value in (a, b, a * i):
        total += value
    return total


def default(x, y=0.0):
    return x / y


def share(a, b):
    total = 0.0
    for k, value in enumerate((a, b)):
        total += value * (k / k)
    return total


def ranks(a, b):
    total = 0
    for k, value in enumerate((a, b, a), 3):
        total += k ** (k ** 3 - (value > 0) - (value > 1))
    return total


def sorted_by(a, b, i):
    n = (a > b) + (a > 0) + (b > 0)
    for _ in range((a > b) + (a == b) + 1):
        n = n * n + i
    return n


def bits(x):
    return np.float64(x).view(np.int64)


class Own(Block):
    a = Parameter()
    b = Parameter()
    c = Parameter()
    i = Parameter(dtype="int64")
    j = Parameter(dtype="int64")
    p = Parameter(dtype=bool)
    q = Parameter(dtype=bool)
    n8 = Parameter(1, dtype="int8")
    w8 = Parameter(dtype="uint8")
    i32 = Parameter(dtype="int32")
    w64 = Parameter(dtype="uint64")
    f = Parameter(1, dtype="float32")
    y = Output({size}, dtype="int64")

    def outputs(a, b, c, i, j, p, q, n8, w8, i32, w64, f, y):
        i8, f32, u8, u64 = n8[0], f[0], w8, w64
"""
REAL_SOURCES = {f"bits({e})" for e in REAL}
SOURCES = [*(f"bits({e})" for e in REAL), *INTEGER]
VALUES = {"n8": [-128, 127, 5, 0, -1], "w8": [0, 255, 7, 100], "i32": [-(2**31), 2**31 - 1, 65537], "p": [0, 1]}
VALUES |= {"w64": [0, 2**63 - 1, 12], "f": [0.1, 3.4e38, -2.5, 16777216.0], "c": [0.5, -0.5, 1.5, 2.5, -7.9, 1e15]}


def run_both(folder, reals, trajectories):
    """The sources for every pair of some reals, with integers and narrow numbers in turn: (native, interpreted)."""
    pairs = list(itertools.product(reals, reals))
    size = len(pairs)
    turns = {"i": WHOLE, "j": [w or 5 for w in WHOLE[1:]], **VALUES, "q": [0, 0, 1]}
    lists: dict[str, list] = {name: [values[k % len(values)] for k in range(size)] for name, values in turns.items()}
    lists |= {"a": [float(a) for a, _ in pairs], "b": [float(b) for _, b in pairs]}
    lists |= {name: [[v] for v in lists[name]] for name in ("n8", "f")}
    lists |= {name: [bool(v) for v in lists[name]] for name in ("p", "q")}
    body = "".join(f"        y[{k}] = {source}\n" for k, source in enumerate(SOURCES))
    (folder / "own.py").write_text(HEAD.format(size=len(SOURCES)) + body)
    block = {"python": "own.py:Own", "per": "robot", "parameters": lists}
    diagram = {"run": {"stop": 0.1, "step": 0.1}, "fleets": {"robot": size}, "blocks": {"b": block}}
    (folder / "d.yaml").write_text(json.dumps(diagram))
    network = run.load(folder / "d.yaml")
    return tuple(trajectories(network, "b.y", engine=engine)["b.y"][0] for engine in ("native", "python"))


def assert_equal(native, python, reals):
    """Equal to the bit; NaN has many bits."""
    for k, source in enumerate(SOURCES):
        for member, (one, other) in enumerate(zip(native[:, k], python[:, k], strict=True)):
            a, b = reals[member // len(reals)], reals[member % len(reals)]
            nan = source in REAL_SOURCES and np.isnan([one.view(float), other.view(float)]).all()
            assert one == other or nan, f"{source} for a = {a}, b = {b}: {one} and {other}"


@pytest.mark.filterwarnings("error")
def test_special_numbers_are_computed_alike(tmp_path, trajectories):
    native, python = run_both(tmp_path, REALS, trajectories)
    assert_equal(native, python, REALS)


@pytest.mark.parametrize("scale", [1.0, 30.0])
def test_other_numbers_are_computed_alike(tmp_path, trajectories, scale):
    reals = list(np.random.default_rng(5).normal(scale=scale, size=30))
    native, python = run_both(tmp_path, reals, trajectories)
    assert_equal(native, python, reals)


POWERS = """
from cosim import Block, Input, Output


class Powers(Block):
    u = Input("n")
    y = Output("n", 4)

    def outputs(u, y):
        for k in range(u.size):
            y[k, 0] = u[k] ** 0.5
            y[k, 1] = u[k] ** 2.0
            y[k, 2] = 2.0 ** u[k]
            y[k, 3] = 10.0 ** u[k]
"""


def test_powers_with_a_constant_are_powers_like_all_others(tmp_path, trajectories):
    """No root, product or exp2 as LLVM would make of them: some per cent would differ in the last bit."""
    (tmp_path / "own.py").write_text(POWERS)
    values = np.random.default_rng(3).uniform(0.0, 30.0, 20_000).tolist()
    block = {"python": "own.py:Powers", "inputs": {"u": values}}
    (tmp_path / "d.yaml").write_text(json.dumps({"run": {"stop": 1, "step": 1}, "blocks": {"b": block}}))
    network = run.load(tmp_path / "d.yaml")
    native, python = (trajectories(network, "b.y", engine=engine)["b.y"][0] for engine in ("native", "python"))
    np.testing.assert_array_equal(native, python)
    np.testing.assert_array_max_ulp(native, np.array([[u**0.5, u**2.0, 2.0**u, 10.0**u] for u in values]), 1)


COUNTED = """
import numpy as np
from cosim import Block, Output, Parameter

BYTE = np.uint8(200)


class Counted(Block):
    p = Parameter(default=0.6)
    u = Parameter(3, dtype="uint8", default=(255, 7, 3))
    f = Parameter(2, dtype="float32", default=(0.1, 3.0))
    top = Parameter(dtype="int64", default=2**63 - 1)
    y = Output(9)
    n = Output(2, dtype="int64")

    def outputs(p, u, f, top, y, n):
        y[0] = (p > 0.1) + (p < 2.0)
        y[1] = ((p > 0.1) + (p < 2.0)) * 0.5
        y[2] = min(u) - max(u)
        y[3] = -max(u)
        y[4] = min(f) * min(f)
        y[5] = -BYTE
        y[6] = 0.0
        for k, value in enumerate(u):
            y[6] += k / 2
        y[7] = -(p > 0.1) / 4
        y[8] = u.size / 2
        n[0] = 0x7FFFFFFFFFFFFFFF + (p > 0.1)
        n[1] = top + top
"""


@pytest.mark.parametrize("engine", ["native", "python"])
def test_truths_count_widths_do_not_matter_and_integers_wrap(tmp_path, trajectories, engine):
    """As plain Python has it, but for the wrapping, which is that of two's complement."""
    (tmp_path / "own.py").write_text(COUNTED)
    (tmp_path / "d.yaml").write_text("run: {stop: 1, step: 1}\nblocks: {b: {python: own.py:Counted}}\n")
    found = trajectories(run.load(tmp_path / "d.yaml"), "b.y", "b.n", engine=engine)
    tenth = float(np.float32(0.1))
    assert found["b.y"][0].tolist() == [2.0, 1.0, -252.0, -255.0, tenth * tenth, -200.0, 1.5, -0.25, 1.5]
    assert found["b.n"][0].tolist() == [-(2**63), -2]


MIXED = """
import math
import numpy as np
from cosim import Block, Output, Parameter

NOUGHT = np.int32(0)


def clipped(x):
    if x > 1.0:
        return 1
    return x


def sums(x, n):
    p = q = 0
    for k in range(n):
        p += x[k]
        q += 0.5 * x[k]
    return p, q


class Mixed(Block):
    c = Parameter(default=0.6)
    x = Parameter(3, default=(0.5, 0.25, 1.0))
    n = Parameter(2, dtype="int64", default=(3, 0))
    y = Output(22, finite=False)
    z = Output(2, 3, finite=False)

    def outputs(c, x, n, y, z):
        y[0] = c if c > 1.0 else 0
        y[1] = -(c if c > 1.0 else 3)
        y[2] = 2 * (c if c > 1.0 else NOUGHT)
        y[3] = (c if c > 1.0 else 3) ** 2 - 10
        total = 0
        for k in range(x.size):
            total += x[k]
        y[4] = total / 2
        total = False
        for k in range(n[1]):
            total += x[k]
        y[5] = total
        y[6] = -clipped(c + 1.0)
        y[7], y[8] = sums(x, 3)
        y[9] = math.sqrt(c if c > 1.0 else 4)
        y[10] = -min(n[1], c)
        y[11] = -max(-c, 0)
        y[12] = abs(c if c > 1.0 else -3) * c
        p, q = sums(x, n[1])
        y[13] = p + q
        y[14] = (c if c > 1.0 else 3) < n[0] + 1
        total = 0
        for k in range(n[1]):
            total += x[k]
        y[15] = total / x.size
        y[16] = 1 / total if total > 0 else 7
        y[17] = np.arctan2(total, n[0])
        y[18] = 1.0 / total
        y[19] = 1.0 / -max((0, -0.0 * c))
        y[20] = max(1, 2, 2 * clipped(1.5), (c if c > 1.0 else 3))
        y[21] = (c if c > 1.0 else 0) ** 0
        z[0, 0] = z[1, 2] = 0.0
        z[0, 1] = z[0, 2] = -0.0
        z[1, 0] = -0.0
        z[1, 1] = math.nan
        np.minimum(z[0], z[1], z[0])
        np.maximum(z[1], x, z[1])
"""


@pytest.mark.parametrize("engine", ["native", "python"])
def test_a_constant_that_is_an_integer_on_one_path_only_is_the_same_number(tmp_path, trajectories, engine):
    """As plain Python has it, but that `min` and `max` of a real number and an integer are real: a zero has a sign."""
    (tmp_path / "own.py").write_text(MIXED)
    (tmp_path / "d.yaml").write_text("run: {stop: 1, step: 1}\nblocks: {b: {python: own.py:Mixed}}\n")
    got = trajectories(run.load(tmp_path / "d.yaml"), "b.y", "b.z", engine=engine)
    assert [repr(v) for v in got["b.z"][0].ravel().tolist()] == ["0.0", "nan", "-0.0", "0.5", "nan", "1.0"]
    found = got["b.y"][0]
    expected = [0.0, -3.0, 0.0, -1.0, 0.875, 0.0, -1.0, 1.75, 0.875, 2.0, -0.0, -0.0, 3.0 * 0.6, 0.0, 1.0]
    expected += [0.0, 7.0, 0.0, np.inf, -np.inf, 3.0, 1.0]
    assert found.tolist() == expected
    assert np.signbit(found).tolist() == np.signbit(expected).tolist()


#: What both engines stop at: (statement, what is said)
FAULTS = {
    "y[0] = i // z": "ZeroDivisionError",
    "y[0] = i % z": "ZeroDivisionError",
    "y[0] = divmod(i, z)[0]": "ZeroDivisionError",
    "y[0] = 7 // z": "ZeroDivisionError",
    "y[0] //= z": "ZeroDivisionError",
    "y[0] = low // (z - 1)": "OverflowError: no 64-bit integer",
    "y[0] = i << (z - 1)": "ValueError: a shift by less than 0 or more than 63 places",
    "y[0] = i >> (z + 64)": "ValueError: a shift by less than 0 or more than 63 places",
    "y[0] = i ** (z - 1)": "ValueError: an integer to a power below 0",
    "r[0] = zero ** (z - 1)": "ZeroDivisionError: 0.0 to a negative integer power",
    "y[0] = np.int64(zero / zero)": "OverflowError: no 64-bit integer",
    "y[0] = int(zero / zero)": "OverflowError: no 64-bit integer",
    "y[0] = int(1.0 / zero)": "OverflowError: no 64-bit integer",
    "y[0] = math.floor(math.sqrt(zero - 1.0))": "OverflowError: no 64-bit integer",
    "y[0] = round(1e19 + zero)": "OverflowError: no 64-bit integer",
    "small[0] = i + 200": "OverflowError: 207 does not fit into int8",
    "byte[0] = i - 8": "OverflowError: -1 does not fit into uint8",
    "y[0] = big": "OverflowError: no 64-bit integer",
    "r[0] = jitted(two, i)": "IndexError: index 7 is out of bounds for axis 0 of `array`, size 2 (tools.py:6)",
}
#: What the compiler refuses: (statement, what is said)
REFUSED = {
    "y[0] = zero": "puts a real number where a whole number or a truth value has its place",
    "flag[0] = zero": "puts a real number where a whole number or a truth value has its place",
    "r[0] = two.cumsum()[1]": r"calls `\.cumsum\(\)`, which does not compute in the same order",
    "r[0] = np.var(two)": r"calls `np\.var\(\)`, which does not compute in the same order",
    "np.sin(two, r)": "sin\\(\\) of arrays: not among what",
    "r[0] = np.hypot(zero, 1.0)": r"calls `np\.hypot`, whose last bit may differ",
    "r[0] = round(zero, 2)": r"rounds to decimal digits with `round\(\)`",
    "r[0] = round(number=zero, ndigits=2)": r"rounds to decimal digits with `round\(\)`",
    "y[0] = ~(zero > 1.0)": "inverts a truth value with `~`",
    "y[0] = ~(zero > 1.0 or i > 2)": "inverts a truth value with `~`",
    "y[0] = ~flag[0]": "inverts a truth value with `~`",
    "r[zero > 1.0] = zero": "takes an element at an index that is a truth value",
    "r[0] = two[zero > 1.0]": "takes an element at an index that is a truth value",
    "r[0] = (-8.0) ** (1 / 3)": "puts a complex number where a real one has its place",
    "r[0] = NUMBERS[1]": "uses the list `NUMBERS` of the module, and compiled code knows constants only",
    "y[0] = np.int32(i)": r"makes a `np\.int32` of a number, and numbers are float64, int64 and bool",
    "r[0] = float(zero > 1.0)": r"gives a truth value to float\(\), which takes numbers",
    "r[0] = abs((1j * zero) ** 2.5)": "computes with complex numbers",
    "r[0] = complex(zero, zero).real": r"calls `complex\(\)`",
    "r[0] = np.floor(zero)": r"calls `np\.floor`, which the two engines do not have alike",
    "r[0] = np.ptp(two)": r"calls `np\.ptp\(\)`, which the two engines do not have alike",
    "r[0] = zero @ zero": "multiplies matrices with `@`",
    "r[0] = np.linspace(0.0, 1.0, 3)[1]": r"makes a new array with `np\.linspace\(\)`",
    "r[0] = np.zeros(i)[1]": "makes an array whose size `i` is known only while it runs",
    "r[0] = np.linalg.norm(two, 1)": r"calls `np\.linalg\.norm\(\)`",
    "r[0] = np.random.normal()": "draws random numbers",
    "r[0] = math.hypot(zero, 1.0)": r"calls `math\.hypot\(\)`, which the two engines do not have alike",
    "r[0] = math.fmod(zero, 1.0)": r"calls `math\.fmod\(\)`, which the two engines do not have alike",
    "r[0] = math.lgamma(zero)": r"calls `math\.lgamma\(\)`, which the two engines do not have alike",
    "r[0] = np.lib.stride_tricks.as_strided(r, (9,), (8,))[8]": "which the two engines do not have alike",
    "r[0] = numba.carray(two, 9)[8]": "carray",
    "r[0] = vectorized(zero)": "not among what",
    "r[0] = C_COS(zero)": "a function that cannot be checked",
    "r[0] = zero if i > 8 else i": "an integer on one path and a real number on another",
    "r[0] = zero if i > 8 else flag[0]": "an integer on one path and a real number on another",
    "r[0] = -(zero if i > 8 else 0)": "an integer on one path and a real number on another",
    "r[0] = -(zero if i > 8 else False)": "an integer on one path and a real number on another",
    "r[0] = -((zero if i > 8 else 1) - 1)": "an integer on one path and a real number on another",
    "r[0] = -2 * (zero if i > 8 else 0)": "an integer on one path and a real number on another",
    "r[0] = i + (zero if i > 8 else 1)": "an integer on one path and a real number on another",
    "r[0] = 2.5 ** (zero if i > 8 else 2)": "an integer on one path and a real number on another",
    "r[0] = (zero if i > 8 else 2) ** -1": "an integer on one path and a real number on another",
    "r[0] = (zero if i > 8 else 5) // 2": "an integer on one path and a real number on another",
    "r[0] = divmod(zero if i > 8 else 5, 2)[0]": "an integer on one path and a real number on another",
    "r[0] = zero if i > 8 else 2**53 + 1": "an integer on one path and a real number on another",
    "r[0] = (zero if i > 8 else 2**50) * 100": "an integer on one path and a real number on another",
    "q = (0, 0) if i > 8 else (zero, zero); r[0] = q[1]": "an integer on one path and a real number on another",
    "q = zero if i > 8 else 1; r[0] = np.minimum(q, i)": "`q`, which is an integer on one path and a real",
    "r[0] = -dead(zero)": "an integer on one path and a real number on another",
    "q = pair(zero); r[0] = i * q[0]": "an integer on one path and a real number on another",
    "q = zero if i > 8 else 0; r[0] = -first((q, zero))": "an integer on one path and a real number on another",
    "q = zero if i > 8 else 0; r[0] = -several(zero, zero, q)": "an integer on one path and a real number on another",
    "q = (zero, zero if i > 8 else 0); r[0] = several(*q)": "an integer on one path and a real number on another",
    "for v in (zero if i > 8 else 0, zero): r[0] = -v": "an integer on one path and a real number on another",
    "for k, v in enumerate((zero if i > 8 else 0, zero)): r[k] = -v": "an integer on one path and a real number on",
    "q = (zero if i > 8 else 0,) + (zero,); r[0] = -q[0]": "an integer on one path and a real number on another",
    "q = ((0, zero), zero) if i > 8 else ((zero, zero), zero); r[0] = -q[0][0]": "an integer on one path and a real",
    "r[0] = max((zero if i > 8 else 0, two[0]))": "an integer on one path and a real number on another",
    "q = zero if i > 8 else 0; r[0] = -(q.real)": "`q`, which is an integer on one path and a real number on",
    "r[0] = (zero if i > 8 else 2**53) < i": "an integer on one path and a real number on another",
    "q = zero if i > 8 else 3; r[0] = max(q, q, q, q, q, q, q, i)": "`q`, which is an integer on one path and a real",
    "y[0] = math.floor(i)": r"rounds an integer with floor\(\)",
    "y[0] = math.ceil(2**53 + 1)": r"rounds an integer with ceil\(\)",
    "y[0] = math.trunc(zero > 1.0)": r"rounds an integer with trunc\(\)",
    "y[0] = round(i)": r"rounds an integer with round\(\)",
    "y[0] = np.add(zero > 1.0, flag[0])": r"gives truth values alone to `np\.add`",
    "r[0] = isinstance(zero, int)": r"calls `isinstance\(\)`, which compiled code does not have",
    "print(i)": "prints, which compiled code does not do",
    "r[0] = two.ctypes.data": "an address",
    "raise ValueError(i)": "the arguments of an exception have to be constants",
}
TOOLS = """import numba


@numba.njit
def jitted(array, k):
    return array[k]


@numba.vectorize
def vectorized(x):
    return x + 1.0
"""
SMALL = """import ctypes
import math
import numba
import numpy as np
import tools
from cosim import Block, Output, Parameter
from tools import jitted, vectorized

NUMBERS = [1.0, 2.0]
C_COS = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double)(math.cos)


def dead(x):
    if abs(x) < 1.0:
        return 0
    return x


def pair(x):
    p = q = 0
    for k in range(2):
        p += x
    return p, q


def opposite(x):
    return -x


def first(x):
    return x[0]


def several(x, *others):
    return others[-1]


class Own(Block):
    i = Parameter(dtype="int64", default=7)
    low = Parameter(dtype="int64", default=-(2**63))
    z = Parameter(dtype="int32", default=0)
    zero = Parameter(default=0.0)
    two = Parameter(2, default=(1.0, 2.0))
    large = Parameter(dtype="uint64", default=2**63)
    y = Output(2, dtype="int64")
    r = Output(2)
    small = Output(dtype="int8")
    byte = Output(dtype="uint8")
    flag = Output(dtype=bool)

    def outputs(i, low, z, zero, two, {large}y, r, small, byte, flag):
        y[0] = y[1] = i
        r[0] = r[1] = zero
        small[0] = byte[0] = 0
        flag[0] = False
        {statement}
"""


@pytest.fixture
def told(tmp_path, monkeypatch, capsys):
    """Exit code and all that is said of a block with a statement."""

    def run_it(statement: str, engine: str):
        monkeypatch.chdir(tmp_path)
        large = "large, " if "big" in statement else ""
        text = SMALL.format(statement=statement.replace("big", "large"), large=large)
        (tmp_path / "own.py").write_text(text)
        (tmp_path / "tools.py").write_text(TOOLS)
        monkeypatch.delitem(sys.modules, "tools", raising=False)
        (tmp_path / "d.yaml").write_text("run: {stop: 0.1, step: 0.1}\nblocks:\n  b: {python: 'own.py:Own'}\n")
        code = cli.main(["run", "d.yaml", "--engine", engine])
        return code, " ".join(capsys.readouterr().err.split())

    return run_it


LINE = SMALL.count("\n")


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("statement", FAULTS)
def test_what_has_no_answer_is_an_error_in_both_engines(told, engine, statement):
    code, said = told(statement, engine)
    assert code == 1 and f"block b: outputs() failed at t = 0 s: {FAULTS[statement]}" in said
    assert f"own.py:{LINE})" in said or "big" in statement or "jitted" in statement


SMALL_BLOCK = """
from cosim import Block, Output

class Small(Block):
    y = Output(dtype="int8")
    def outputs(time, y):
        y[0] = time
"""


@pytest.mark.parametrize("size", ["2.0", "two[1]", "zero"])
def test_a_real_number_is_no_range_in_either_engine(told, size):
    statement = f"for q in range({size}): r[q] = zero"
    code, said = told(statement, "native")
    assert code == 2 and re.search(rf"own\.py:{LINE}:\d+: error: .*range\(\) of a real number", said), said
    assert told(statement, "python") == (code, said)


@pytest.mark.parametrize("statement", REFUSED)
def test_what_the_engines_cannot_share_is_refused_by_both_with_its_line(told, statement):
    code, said = told(statement, "native")
    assert code == 2 and re.search(rf"own\.py:{LINE}:\d+: error: .*{REFUSED[statement]}", said), said
    assert told(statement, "python") == (code, said)


@pytest.mark.parametrize("engine", ["native", "python"])
def test_what_a_helper_is_given_is_followed_into_it(told, engine):
    """A real number may be negated, and so may the other zero of a pair."""
    line = SMALL[: SMALL.index("    return -x")].count("\n") + 1
    code, said = told("q = zero if i > 8 else 0; r[0] = math.atan2(opposite(q), -1.0)", engine)
    assert code == 2 and re.search(rf"own\.py:{line}:\d+: error: .*`x`, which is an integer on one path and a", said), (
        said
    )
    assert told("q = zero if i > 8 else 1; r[0] = opposite(q) + opposite(zero)", engine)[0] == 0


def test_a_real_number_is_no_integer_for_the_interpreter_either(tmp_path, trajectories):
    """Where nothing was compiled before, as in a notebook."""
    (tmp_path / "own.py").write_text(SMALL_BLOCK)
    (tmp_path / "d.yaml").write_text("run: {stop: 1, step: 1}\nblocks: {b: {python: own.py:Small}}\n")
    network = run.load(tmp_path / "d.yaml")
    with pytest.raises(BlockFailed, match="TypeError: a real number is put into an array of int8"):
        trajectories(network, "b.y", engine="python")


def test_breakpoints_hold_in_interpreted_functions(tmp_path, monkeypatch):
    """A debugger finds a line by file and number, of the code object that runs."""
    (tmp_path / "own.py").write_text(SMALL.format(statement="y[0] = i // 2", large=""))
    (tmp_path / "tools.py").write_text(TOOLS)
    monkeypatch.chdir(tmp_path)
    monkeypatch.delitem(sys.modules, "tools", raising=False)
    (tmp_path / "d.yaml").write_text("run: {stop: 0.1, step: 0.1}\nblocks:\n  b: {python: 'own.py:Own'}\n")
    reached = []

    class Debugger(bdb.Bdb):
        def user_line(self, frame):
            if self.get_breaks(frame.f_code.co_filename, frame.f_lineno):
                reached.append((frame.f_lineno, frame.f_locals["i"]))
            self.set_continue()

    debugger = Debugger()
    network = run.load(tmp_path / "d.yaml")
    python = network.components["b"].declaration.functions[0].python
    assert debugger.set_break(python.__code__.co_filename, LINE) is None
    one = Simulation(program.build(network, "jacobi"), None)
    debugger.runcall(one.initialize)
    assert (LINE, 7) in reached
