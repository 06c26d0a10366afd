"""Members of a fleet that are done eight at a time: the same bits as one by one, and which functions are."""

from __future__ import annotations

import ctypes
import math
import warnings
from typing import Any

import llvmlite.binding as llvm
import numpy as np
import pytest

from cosim import Block, Input, Output, Parameter, State
from cosim.authoring.declaration import Function, variable_of
from cosim.blocks.control_gain import OmnidirectionalGain
from cosim.blocks.neural_observer import NeuralObserver
from cosim.blocks.robot import OmnidirectionalRobot
from cosim.blocks.uncertainty import Uncertainty
from cosim.compiling import compiler
from cosim.compiling.adapters import block_source
from cosim.compiling.frame import frame_of
from cosim.compiling.interpreted.functions import interpreted
from cosim.machine import object_code

Arrays = dict[str, np.ndarray]
SPECIAL = (0.0, -0.0, 1e-310, 1e300, -1e300, 8.3e5, -1e9, math.inf, -math.inf, math.nan)


class Everything(Block):
    """All elementary functions, of elements of several types."""

    x = Input(5)
    number = Parameter(dtype=np.int32, unit="1")
    on = Parameter(dtype=bool, unit="1")
    y = Output(9)
    counts = Output(2, dtype=np.int32, unit="1")
    high = Output(dtype=bool, unit="1")
    single = Output(3, dtype=np.float32)
    kept = State()

    def outputs(time, x, number, on, y, counts, high, single):
        y[0] = math.exp(x[0]) + time
        y[1] = math.sin(x[1]) * number
        y[2] = math.cos(x[1])
        y[3] = math.tanh(x[2])
        y[4] = math.log(abs(x[3]) + 1e-300)
        y[5] = math.atan2(x[0], x[4])
        y[6] = math.pow(abs(x[3]), 0.3)
        y[7] = math.sqrt(abs(x[0]))
        y[8] = x[4] if on else 0.0
        counts[0], counts[1] = number, 2 if x[0] > 0.0 else 1
        high[0] = x[1] > x[2]
        for q in range(3):
            single[q] = 0.5 if x[q] > 1.0 else 0.25

    def derivatives(x, d_kept):
        d_kept[0] = math.sin(x[0])


class Stubborn(Block):
    """Functions that are done one by one: a loop as long as the values say, a failure, and what only some compute."""

    x = Input()
    y = Output()
    z = Output()
    w = Output()
    t = Output()
    s = Output()
    o = Output()

    def outputs_loop(x, y):
        y[0] = x
        while y[0] > 1.0:
            y[0] = 0.5 * math.exp(-x) * y[0]

    def outputs_failing(x, z):
        if x > 1e9:
            raise ValueError("too large")
        z[0] = math.exp(x)

    def outputs_seldom(x, w):
        w[0] = math.exp(x) if x > 0.0 else x

    def outputs_often(x, o):
        o[0] = math.exp(-x) * (math.sin(x) if x > 0.0 else x)

    def outputs_tangent(x, t):
        t[0] = math.tan(x)

    def outputs_sum(x, s):
        s[0] = x + x * x


def compiled(block: Any, function: Function, constants: dict[str, int], fleet: bool) -> object_code.Library:
    return object_code.Library(compiler.compile_object("case", [block_source(block, function, constants, fleet)]))


def called(library: object_code.Library, symbol: str, time: float, arena: np.ndarray, frame: np.ndarray) -> int:
    kind = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, ctypes.c_void_p, ctypes.c_void_p)
    return int(kind(library.address(symbol))(time, arena.ctypes.data, frame.ctypes.data))


def values(block: Any, function: Function, constants: dict[str, int], n: int, special: bool) -> Arrays:
    """What every argument is at first, by name, one row a member."""
    rng = np.random.default_rng(n)
    found = {}
    for name in function.arguments:
        if name == "time":
            continue
        variable = variable_of(block, name)
        shape = (n, *(constants[d] if isinstance(d, str) else d for d in variable.shape))
        if variable.dtype == np.float64:
            found[name] = rng.normal(scale=3.0, size=shape)
            if special and name not in function.writes:
                found[name] = np.where(rng.random(shape) < 0.3, rng.choice(SPECIAL, shape), found[name])
        else:
            found[name] = rng.integers(0, 2, shape).astype(variable.dtype)
    return found


def laid_out(
    block: Any, function: Function, constants: dict[str, int], given: Arrays
) -> tuple[Any, Any, dict[str, Any]]:
    """An arena with the values, rows apart from each other, the frame of a call, and where each argument is."""
    frame = frame_of(block, function, constants)
    n = len(next(iter(given.values())))
    arena, places, offset = np.zeros(1 << 20, np.uint8), {}, 64
    for name, value in given.items():
        stride = -(-value[0].nbytes // 8) * 8 + 24
        places[name] = (offset, stride)
        for k in range(n):
            arena[offset + k * stride :][: value[k].nbytes] = np.frombuffer(value[k].tobytes(), np.uint8)
        offset += n * stride + 64
    words = np.array(frame.words(n, constants, places), np.int64)
    return arena, words, places


CASES = {
    "Uncertainty": (Uncertainty.declaration, "outputs", {}),
    "OmnidirectionalGain": (OmnidirectionalGain.declaration, "outputs", {}),
    "OmnidirectionalRobot": (OmnidirectionalRobot.declaration, "derivatives", {}),
    "NeuralObserver": (NeuralObserver.declaration, "outputs", {"n": 3, "neurons": 8, "bands": 5}),
    "Everything": (Everything.declaration, "outputs", {}),
    "Everything's state": (Everything.declaration, "derivatives", {}),
}


def function_of(block: Any, name: str) -> Function:
    return next(function for function in block.functions if function.name == name)


def without_nans(arena: np.ndarray) -> bytes:
    """The words of an arena, with one NaN for all of them."""
    words = arena.view(np.float64).copy()
    words[np.isnan(words)] = np.nan
    return words.tobytes()


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("special", [False, True])
def test_bits_are_those_of_one_by_one(name, special):
    block, symbol, constants = CASES[name]
    function = function_of(block, symbol)
    tiled, single = (compiled(block, function, constants, fleet) for fleet in (True, False))
    for n in (1, 2, 3, 5, 8, 9, 11, 16, 100):
        given = values(block, function, constants, n, special)
        arenas = []
        for library in (tiled, single):
            arena, frame, _ = laid_out(block, function, constants, given)
            assert called(library, symbol, 0.7, arena, frame) == 0
            arenas.append(arena)
        assert without_nans(arenas[0]) == without_nans(arenas[1]), n


@pytest.mark.parametrize("name", CASES)
def test_bits_are_those_of_the_interpreter(name):
    block, symbol, constants = CASES[name]
    function = function_of(block, symbol)
    given = values(block, function, constants, 11, special=False)
    arena, frame, places = laid_out(block, function, constants, given)
    assert called(compiled(block, function, constants, True), symbol, 0.7, arena, frame) == 0
    python = interpreted(function.python)
    for k in range(11):
        row = {name: value[k].copy() for name, value in given.items()}
        scalars = {a for a in row if row[a].shape == () and a not in function.writes}
        arguments = {a: row[a].item() if a in scalars else np.atleast_1d(row[a]) for a in row}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            python(*(0.7 if a == "time" else arguments[a] for a in function.arguments))
        for written in function.writes:
            offset, stride = places[written]
            got = arena[offset + k * stride :][: given[written][k].nbytes].tobytes()
            assert got == arguments[written].tobytes(), (written, k)


@pytest.mark.parametrize("name", CASES)
def test_what_becomes_vectors(name):
    block, symbol, constants = CASES[name]
    assert compiled(block, function_of(block, symbol), constants, True).text(f"{symbol}.alone") == ""


@pytest.mark.parametrize("name", CASES)
def test_a_lane_is_an_element_of_vectors(name):
    """The loop over lanes is gone: of each product of one lane, the kernel has one of eight."""
    block, symbol, constants = CASES[name]
    source = block_source(block, function_of(block, symbol), constants, True)
    triple, cpu, features = object_code.host()
    avx512 = "+sse2,+avx,+avx2,+avx512f,+avx512vl,+avx512dq,+avx512bw"
    if "x86_64" in triple:
        cpu, features = "x86-64-v4", avx512
    from cosim.compiling import emission

    _, module = emission._optimised(compiler.compile_ir("case", [source]), triple, cpu, features, [symbol])
    kernel = str(module.get_function(symbol))
    before_lanes, _, after = kernel.partition("take:")
    assert "fmul <8 x double>" in after
    assert " fmul double" not in after.partition("singly:")[0]
    assert before_lanes


@pytest.mark.parametrize(
    ("symbol", "reason"),
    [
        ("outputs_loop", "it has a loop of many rounds, or of as many as its values say"),
        ("outputs_failing", "it may fail"),
        ("outputs_seldom", "only some members compute exp"),
        ("outputs_often", "only some members compute sin"),
        ("outputs_tangent", "it calls tan of the C library"),
        ("outputs_sum", "it computes no exp, sin or the like, for which it would pay"),
    ],
)
def test_what_stays_one_by_one_says_why(symbol, reason):
    block = Stubborn.declaration
    function = function_of(block, symbol)
    library = compiled(block, function, {}, True)
    assert library.text(f"{symbol}.alone") == reason
    given = {name: np.linspace(-2.0, 5.0, 11) for name in function.arguments}
    arena, frame, places = laid_out(block, function, {}, given)
    assert called(library, symbol, 0.0, arena, frame) == 0
    written = next(iter(function.writes))
    offset, stride = places[written]
    got = [arena[offset + k * stride :][:8].view(np.float64)[0] for k in range(11)]
    for x, y in zip(given["x"], got, strict=True):
        expected = np.zeros(1)
        interpreted(function.python)(x, expected)
        assert y == expected[0]


def test_a_member_that_fails_is_told():
    function = function_of(Stubborn.declaration, "outputs_failing")
    x = np.linspace(0.0, 1.0, 11)
    x[9] = 2e9
    arena, frame, _ = laid_out(Stubborn.declaration, function, {}, {"x": x, "z": np.zeros(11)})
    library = compiled(Stubborn.declaration, function, {}, True)  # which has the text
    assert called(library, function.name, 0.0, arena, frame) == 3
    assert frame[3] == 9
    assert ctypes.cast(int(frame[0]), ctypes.c_char_p).value.startswith(b"ValueError: too large")


@pytest.mark.skipif("x86_64" not in object_code.host()[0], reason="code for x86-64 processors")
@pytest.mark.parametrize("cpu", ["x86-64", "x86-64-v3", "x86-64-v4"])
def test_bits_are_the_same_for_each_processor(cpu):
    have = llvm.get_host_cpu_features()
    needs = {"x86-64": (), "x86-64-v3": ("avx2", "fma"), "x86-64-v4": ("avx512f", "avx512vl")}[cpu]
    if not all(have.get(feature) for feature in needs):
        pytest.skip(f"this processor has no {cpu}")
    from cosim.compiling import emission

    block, symbol, constants = CASES["Everything"]
    function = function_of(block, symbol)
    source = block_source(block, function, constants, True)
    triple = object_code.host()[0]
    code = emission.emit(compiler.compile_ir("case", [source]), triple, cpu, "", [symbol], "case")
    given = values(block, function, constants, 100, special=True)
    arenas = []
    for library in (object_code.Library(code), compiled(block, function, constants, False)):
        arena, frame, _ = laid_out(block, function, constants, given)
        assert called(library, symbol, 0.7, arena, frame) == 0
        arenas.append(without_nans(arena))
    assert arenas[0] == arenas[1]
