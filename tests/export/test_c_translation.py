"""C that is translated from LLVM IR computes what LLVM's own object code of that IR does: LLVM is the oracle."""

from __future__ import annotations

import ctypes
import math
import shutil
import struct
import subprocess
import sys
from importlib import util
from itertools import product
from pathlib import Path

import llvmlite.binding as llvm
import numpy as np
import pytest

from cosim.compiling import emission
from cosim.compiling.interpreted.libm import as_compiled
from cosim.export import sources
from cosim.export.c_code.c_translation import translate
from cosim.export.c_code.llvm_reader import Untranslatable, read
from cosim.machine import object_code
from cosim.plain_math.definitions import FUNCTIONS, definition

KERNEL = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_double, ctypes.c_void_p, ctypes.c_void_p)
HEAD = "#include <stdint.h>\n#define KERNEL\ntypedef int32_t (*Kernel)(double, uint8_t *, int64_t *);\n"
WIDTHS = (8, 16, 32, 64)
INTEGERS = (
    0,
    1,
    2,
    3,
    7,
    31,
    100,
    127,
    128,
    255,
    32767,
    32768,
    2**31 - 1,
    2**31,
    2**32 - 1,
    2**63 - 1,
    2**63,
    2**64 - 1,
)
REALS = (
    0.0,
    -0.0,
    1.0,
    -1.5,
    3.0,
    1e-310,
    -1e-310,
    -7.25,
    1e300,
    0.1,
    math.inf,
    -math.inf,
    math.nan,
    255.0,
    2.0**52 + 0.5,
)
SIGNALLING = bytes.fromhex("010000000000f07f")  # a NaN
#: Two operands a and b of a type, or what is computed of them first, and the type of the result.
CASES: dict[str, tuple[str, str, str]] = {}
for n in WIDTHS:
    for op in ("add", "sub", "mul", "and", "or", "xor", "add nsw", "mul nuw"):
        CASES[f"{op} i{n}"] = (f"i{n}", f"%r = {op} i{n} %a, %b", f"i{n}")
    for op in ("shl", "lshr", "ashr"):
        CASES[f"{op} i{n}"] = (f"i{n}", f"%c = and i{n} %b, {n - 1}\n  %r = {op} i{n} %a, %c", f"i{n}")
    for op in ("udiv", "urem", "sdiv", "srem"):
        CASES[f"{op} i{n}"] = (
            f"i{n}",
            f"%c = and i{n} %b, {2 ** (n - 1) - 1}\n  %d = or i{n} %c, 1\n  %r = {op} i{n} %a, %d",
            f"i{n}",
        )
    for p in ("eq", "ne", "ugt", "uge", "ult", "ule", "sgt", "sge", "slt", "sle"):
        CASES[f"icmp {p} i{n}"] = (f"i{n}", f"%q = icmp {p} i{n} %a, %b\n  %r = zext i1 %q to i8", "i8")
    for f in ("smax", "smin", "umax", "umin"):
        CASES[f"{f} i{n}"] = (f"i{n}", f"%r = call i{n} @llvm.{f}.i{n}(i{n} %a, i{n} %b)", f"i{n}")
    CASES[f"abs i{n}"] = (f"i{n}", f"%r = call i{n} @llvm.abs.i{n}(i{n} %a, i1 false)", f"i{n}")
    for s, f in product("su", ("add", "sub", "mul")):
        CASES[f"{s}{f} overflow i{n}"] = (
            f"i{n}",
            f"%p = call {{ i{n}, i1 }} @llvm.{s}{f}.with.overflow.i{n}(i{n} %a, i{n} %b)\n"
            f"  %v = extractvalue {{ i{n}, i1 }} %p, 0\n  %o = extractvalue {{ i{n}, i1 }} %p, 1\n"
            f"  %w = zext i1 %o to i{n}\n  %r = xor i{n} %v, %w",
            f"i{n}",
        )
    for m in (x for x in WIDTHS if x > n):
        for op in ("zext", "sext"):
            CASES[f"{op} i{n} to i{m}"] = (f"i{n}", f"%r = {op} i{n} %a to i{m}", f"i{m}")
        CASES[f"trunc i{m} to i{n}"] = (f"i{m}", f"%r = trunc i{m} %a to i{n}", f"i{n}")
    for op in ("sitofp", "uitofp"):
        CASES[f"{op} i{n}"] = (f"i{n}", f"%r = {op} i{n} %a to double", "double")
        CASES[f"{op} i{n} to float"] = (f"i{n}", f"%r = {op} i{n} %a to float", "float")
for n in (3, 13, 33, 47):  # what optimisers make of sums and flags
    CASES[f"i{n}"] = (
        "i64",
        f"%c = trunc i64 %a to i{n}\n  %d = trunc i64 %b to i{n}\n  %e = mul i{n} %c, %d\n"
        f"  %f = sub i{n} %e, {2 ** (n - 1) - 1}\n"
        f"  %g = sext i{n} %f to i64\n  %h = icmp slt i{n} %f, %d\n  %i = zext i1 %h to i64\n  %j = ashr i{n} %f, 2\n"
        f"  %k = zext i{n} %j to i64\n  %l = shl i64 %k, 7\n  %m = xor i64 %l, %g\n  %r = add i64 %m, %i",
        "i64",
    )
CASES["i128"] = (
    "i64",
    "%c = zext i64 %a to i128\n  %d = sext i64 %b to i128\n  %e = mul i128 %c, %d\n  %f = add i128 %e, -5\n"
    "  %g = lshr i128 %f, 61\n  %r = trunc i128 %g to i64",
    "i64",
)
for op in ("fadd", "fsub", "fmul", "fdiv", "frem"):
    CASES[f"{op} double"] = ("double", f"%r = {op} double %a, %b", "double")
for op in ("fadd", "fsub", "fmul", "fdiv"):
    CASES[f"{op} float"] = ("float", f"%r = {op} float %a, %b", "float")
CASES["a product and a sum"] = ("double", "%p = fmul double %a, %b\n  %r = fadd double %p, %a", "double")
CASES["a sum beside a difference"] = (
    "double",
    "%p = fmul double %a, %b\n  %q = fmul double %b, 3.3\n  %s = fadd double %p, %a\n  %t = fsub double %q, %a\n"
    "  %r = fdiv double %s, %t",
    "double",
)
for kind, p in product(
    ("double", "float"),
    ("oeq", "ogt", "oge", "olt", "ole", "one", "ord", "ueq", "ugt", "uge", "ult", "ule", "une", "uno", "true", "false"),
):
    CASES[f"fcmp {p} {kind}"] = (kind, f"%q = fcmp {p} {kind} %a, %b\n  %r = zext i1 %q to i8", "i8")
for name in ("fabs", "sqrt", "floor", "ceil", "trunc", "rint"):
    CASES[name] = ("double", f"%r = call double @llvm.{name}.f64(double %a)", "double")
for name in ("copysign", "minnum", "maxnum"):
    CASES[name] = ("double", f"%r = call double @llvm.{name}.f64(double %a, double %b)", "double")
for name in ("atan", "cbrt", "expm1", "asinh", "tan"):
    CASES[name] = ("double", f"%r = call double @{name}(double %a)", "double")
CASES["fneg"] = ("double", "%r = fneg double %a", "double")
CASES["freeze"] = ("double", "%q = freeze double %a\n  %r = fadd double %q, 0x3FB999999999999A", "double")
CASES["bitcast"] = (
    "double",
    "%q = bitcast double %a to i64\n  %s = xor i64 %q, 1\n  %r = bitcast i64 %s to double",
    "double",
)
CASES["bitcast float"] = ("float", "%r = bitcast float %a to i32", "i32")
CASES["fpext"] = ("float", "%r = fpext float %a to double", "double")
CASES["fptrunc"] = ("double", "%r = fptrunc double %a to float", "float")
CASES["constants"] = (
    "double",
    "%q = fcmp olt double %a, 0x7FF0000000000000\n  %s = select i1 %q, double 0xFFF0000000000000, double 1.000000e-01\n"
    "  %r = fadd double %s, -2.500000e+00",
    "double",
)
CASES["constants of single precision"] = ("float", "%r = fmul float %a, 0x3FB99999A0000000", "float")
CASES["to an integer"] = (
    "double",
    "%c = fcmp olt double %a, 1.0e18\n  %q = select i1 %c, double %a, double 1.0e18\n"
    "  %d = fcmp ogt double %q, -1.0e18\n  %s = select i1 %d, double %q, double -1.0e18\n"
    "  %r = fptosi double %s to i64",
    "i64",
)
for mask in (1, 2, 3, 4, 8, 16, 32, 64, 128, 256, 512, 0b1000000100):
    CASES[f"class {mask}"] = (
        "double",
        f"%q = call i1 @llvm.is.fpclass.f64(double %a, i32 {mask})\n  %r = zext i1 %q to i8",
        "i8",
    )
for name, more in (("ctpop", ""), ("ctlz", ", i1 false"), ("cttz", ", i1 false"), ("bswap", "")):
    CASES[name] = ("i64", f"%r = call i64 @llvm.{name}.i64(i64 %a{more})", "i64")
for name in ("fshl", "fshr"):
    CASES[name] = ("i64", f"%r = call i64 @llvm.{name}.i64(i64 %a, i64 %b, i64 %b)", "i64")
CASES["usub.sat"] = ("i64", "%r = call i64 @llvm.usub.sat.i64(i64 %a, i64 %b)", "i64")
CASES["places"] = (
    "i64",
    "%i = and i64 %a, 3\n  %p = getelementptr [4 x i64], ptr %base, i64 0, i64 %i\n  %u = load i64, ptr %p\n"
    "  %t = trunc i64 %b to i32\n  %j = or i32 %t, -4\n"
    "  %q = getelementptr { i32, i64, i8 }, ptr %frame, i32 %j, i32 1\n"
    "  %n = ptrtoint ptr %q to i64\n  %m = ptrtoint ptr %frame to i64\n  %d = sub i64 %n, %m\n  %r = add i64 %u, %d",
    "i64",
)
CASES["memory"] = (
    "i64",
    "%m = alloca [4 x i64], align 8\n  call void @llvm.memset.p0.i64(ptr %m, i8 5, i64 32, i1 false)\n"
    "  %p = getelementptr i8, ptr %m, i64 8\n  call void @llvm.memcpy.p0.p0.i64(ptr %p, ptr %base, i64 16, i1 false)\n"
    "  %q = getelementptr i8, ptr %m, i64 13\n  %r = load i64, ptr %q, align 1",
    "i64",
)
CASES["shared memory"] = ("i64", "%r = load atomic volatile i64, ptr %base monotonic, align 8", "i64")
CASES["a constant table"] = (
    "i64",
    "%i = and i64 %a, 3\n  %p = getelementptr [4 x i32], ptr @table, i64 0, i64 %i\n  %u = load i32, ptr %p\n"
    "  %j = and i64 %b, 3\n  %q = getelementptr i8, ptr @text, i64 %j\n  %v = load i8, ptr %q\n"
    "  %x = zext i8 %v to i64\n  %y = sext i32 %u to i64\n  %r = mul i64 %x, %y",
    "i64",
)
CASES["a switch, and phis that change places"] = (
    "i64",
    "%n = and i64 %b, 15\n  br label %loop\nloop:\n  %k = phi i64 [ 0, %0 ], [ %k1, %again ]\n"
    "  %x = phi i64 [ %a, %0 ], [ %y, %again ]\n  %y = phi i64 [ %b, %0 ], [ %z, %again ]\n"
    '  switch i64 %k, label %again [\n    i64 3, label %"third one"\n    i64 7, label %again\n  ]\n"third one":\n'
    '  br label %again\nagain:\n  %s = phi i64 [ 1, %loop ], [ 1, %loop ], [ 5, %"third one" ]\n'
    "  %z = add i64 %x, %s\n  %k1 = add i64 %k, 1\n  %more = icmp ult i64 %k1, %n\n"
    "  br i1 %more, label %loop, label %end\nend:\n  %r = sub i64 %x, %y",
    "i64",
)
CASES["a function of its own"] = ("i64", "%r = call fastcc i64 @twice(i64 noundef %a) #0", "i64")
MORE = """
@table = private unnamed_addr constant [4 x i32] [i32 1, i32 -2, i32 3, i32 -4], align 4
@text = internal constant [5 x i8] c"a\\22%\\FF\\00"
define internal fastcc i64 @twice(i64 noundef %0) unnamed_addr #0 {
  %2 = add nuw i64 %0, %0
  ret i64 %2
}
attributes #0 = { nounwind }
"""
FORMATS = {"i8": "<B", "i16": "<H", "i32": "<I", "i64": "<Q", "double": "<d", "float": "<f"}


def probe(k: int, kind: str, body: str, result: str) -> str:
    return (
        f"define i32 @probe{k}(double %time, ptr %base, ptr %frame) {{\n  %a = load {kind}, ptr %base\n"
        f"  %b0 = getelementptr i8, ptr %base, i64 16\n  %b = load {kind}, ptr %b0\n  {body}\n"
        f"  %out = getelementptr i8, ptr %base, i64 32\n  store {result} %r, ptr %out\n  ret i32 0\n}}\n"
    )


def declared(texts: str) -> str:
    """What is called, declared as it is called."""
    found = {}
    for line in texts.splitlines():
        if "call " in line and "fastcc" not in line:
            head, _, rest = line.partition("call ")[2].partition("(")
            types = [part.split()[0] for part in rest.rpartition(")")[0].split(", ")]
            found[head.split("@")[1]] = f"declare {head}({', '.join(types)})"
    return "\n".join(found.values())


COMPILERS = {"gcc": ["gcc", "-O2"], "gcc, for this processor": ["gcc", "-O3", "-march=native", "-std=gnu17"]}
if util.find_spec("ziglang"):
    COMPILERS["clang"] = [sys.executable, "-m", "ziglang", "cc", "-O2"]


@pytest.fixture(scope="module")
def module():
    """All cases as LLVM prints them."""
    probes = "".join(probe(k, *case) for k, case in enumerate(CASES.values()))
    object_code.host()  # which makes LLVM ready
    return str(llvm.parse_assembly(MORE + declared(probes) + "\n" + probes))


@pytest.fixture(scope="module")
def oracle(module):
    """LLVM's object code."""
    names = [f"probe{k}" for k in range(len(CASES))]
    return object_code.Library(emission.emit(module, *object_code.host(), names, "probes"))


@pytest.fixture(scope="module", params=COMPILERS)
def compiled(request, tmp_path_factory):
    """A function that makes a library of C, by one of the compilers."""
    command = COMPILERS[request.param]
    if not shutil.which(command[0]):
        pytest.skip(f"there is no {command[0]}")
    words = [*command, "-std=c11"] if "-std=gnu17" not in command else command
    wrapper = Path(sources.__file__).parent / "wrapper"

    def library(text: str) -> ctypes.CDLL:
        folder = tmp_path_factory.mktemp("c")
        made, file = folder / "probes.so", folder / "probes.c"
        file.write_text(HEAD + text)
        subprocess.run([*words, "-shared", "-fPIC", f"-I{wrapper}", "-o", made, file, "-lm"], check=True)
        return ctypes.CDLL(str(made))

    return library


@pytest.fixture(scope="module")
def translated(compiled, module):
    return compiled(translate(module, "unit", [f"probe{k}" for k in range(len(CASES))]))


def operands(kind: str) -> list[bytes]:
    if kind in ("double", "float"):
        values = REALS if kind == "double" else [v for v in REALS if not 1e38 < abs(v) < math.inf]
        signalling = [SIGNALLING] if kind == "double" else []
        return [*(struct.pack(FORMATS[kind], v) for v in values), *signalling]
    bits = int(kind[1:])
    return [struct.pack(FORMATS[kind], v) for v in dict.fromkeys(n % 2**bits for n in INTEGERS)]


def bits_of(call, a: bytes, b: bytes, size: int) -> bytes:
    memory = ctypes.create_string_buffer(a.ljust(16, b"\x11") + b.ljust(16, b"\x22") + b"\x33" * 16, 48)
    frame = ctypes.create_string_buffer(64)
    assert call(0.5, ctypes.addressof(memory), ctypes.addressof(frame)) == 0
    return memory.raw[32 : 32 + size]


def is_nan(found: bytes, kind: str) -> bool:
    return kind in ("double", "float") and math.isnan(struct.unpack(FORMATS[kind], found)[0])


@pytest.mark.parametrize("case", CASES)
def test_c_computes_what_object_code_does(translated, oracle, case):
    k = [*CASES].index(case)
    kind, _, result = CASES[case]
    ours = KERNEL((f"probe{k}", translated))
    theirs = KERNEL(oracle.address(f"probe{k}"))
    seen = set()
    for a, b in product(operands(kind), repeat=2):
        got, want = (bits_of(call, a, b, struct.calcsize(FORMATS[result])) for call in (ours, theirs))
        silent = "num" in case and SIGNALLING in (a, b)  # of which the C library may make what it likes
        assert got == want or silent or (is_nan(got, result) and is_nan(want, result)), (a, b, got, want)
        seen.add(want)
    assert len(seen) > 1 or case.startswith(("fcmp true", "fcmp false")), "these operands tell nothing"


MATHEMATICS = """
define i32 @probe_{name}(double %time, ptr %base, ptr %frame) {{
  %p1 = getelementptr double, ptr %base, i64 1
  %p2 = getelementptr double, ptr %base, i64 2
  %v0 = load double, ptr %base
  %v1 = load double, ptr %p1
  %r = call double @cosim_{name}({values})
  store double %r, ptr %p2
  ret i32 0
}}
"""


def test_elementary_functions_have_the_same_bits_in_c(compiled):
    """Wide angles, whose digits of 2/pi are a table, among them."""
    ir = ""
    for name, function in FUNCTIONS.items():
        values = ", ".join(f"double %v{k}" for k in range(function.arguments))
        ir += definition(name) + MATHEMATICS.format(name=name, values=values)
    probes = [f"probe_{name}" for name in FUNCTIONS]
    triple, processor, _ = object_code.host()
    library = compiled(translate(emission.plain_ir(ir, triple, processor, probes, "probes"), "unit", probes))
    draw = np.random.default_rng(6)
    x = np.concatenate([draw.uniform(-30.0, 30.0, 2000), draw.integers(-(2**63), 2**63 - 1, 2000).view(float), REALS])
    for name, function in FUNCTIONS.items():
        theirs = as_compiled(name, function.arguments)
        ours = KERNEL((f"probe_{name}", library))
        for given in zip(x, draw.permutation(x), strict=True):
            memory = np.array([*given, 0.0])
            assert ours(0.5, memory.ctypes.data, None) == 0
            wanted = np.float64(theirs(*given[: function.arguments]))
            assert memory[2].tobytes() == wanted.tobytes() or np.isnan([memory[2], wanted]).all(), (name, given)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("%r = add <2 x i64> %v, %v", "type `<`"),
        ("%r = call double @llvm.powi.f64.i32(double %a, i32 3)", "llvm.powi.f64.i32"),
        ("%r = call double @unheard(double %a)", "it calls `unheard`"),
        ("%r = atomicrmw add ptr %base, i64 1 monotonic", "atomicrmw|type|constant"),
        ("%r = fadd half %a, %a", "type `half`"),
        ("%r = load { i64, i64 }, ptr %base", "an LLVM struct"),
        ("%r = add i256 %a, %a", "type `i256`"),
        ("%r = load double, ptr @elsewhere", "it names `@elsewhere`"),
    ],
)
def test_what_has_no_translation_is_refused_with_its_text(text, said):
    head = "define i32 @probe(double %time, ptr %base, ptr %frame) {\n  %a = load double, ptr %base\n"
    ir = f"{head}  {text}\n  ret i32 0\n}}"
    with pytest.raises(Untranslatable, match=said):
        translate(ir, "unit", ["probe"])


def test_blocks_come_after_those_through_which_all_ways_lead():
    text = (
        "define i32 @f(double %t, ptr %b, ptr %f) {\n  br label %one\nthree:\n  ret i32 0\ntwo:\n  br label %three\n"
        "lost:\n  br label %three\none:\n  br i1 true, label %two, label %three\n}"
    )
    (function,) = read(text).functions
    assert [block.label for block in function.ordered()] == ["%0", "%one", "%two", "%three"]


@pytest.mark.parametrize(("method", "fits"), [(0, True), (16, True), (1, False), (2, False)])
def test_numbers_are_kept_as_they_are_rounded(tmp_path, method, fits):
    """Methods of ISO/IEC TS 18661-3: 0 and 16 (a processor with half floats) compute doubles as doubles."""
    if not shutil.which("gcc"):
        pytest.skip("there is no gcc")
    (tmp_path / "empty.c").write_text('#include "kernel.h"\n')
    wrapper = Path(sources.__file__).parent / "wrapper"
    told = ["-U__FLT_EVAL_METHOD__", f"-D__FLT_EVAL_METHOD__={method}", f"-I{wrapper}", "-fsyntax-only"]
    done = subprocess.run(["gcc", *told, tmp_path / "empty.c"], capture_output=True, text=True, check=False)
    assert (done.returncode == 0) == fits, done.stderr
    assert fits or "need IEEE 754's arithmetic" in done.stderr
