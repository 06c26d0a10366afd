"""What a function could compute changes its fingerprint, and nothing else does; what cannot be followed has none."""

import argparse
import ast
import dis
import importlib
import os
import subprocess
import sys
import textwrap
import types
from pathlib import Path

import pytest

from cosim.compiling.fingerprint import bytecode, own_files
from cosim.compiling.fingerprint.text import fingerprint, obstacle
from cosim.machine import cache, installed

HEAD = """
import collections, ctypes, dataclasses, datetime, decimal, enum, fractions, functools, io, math, pathlib, re, threading
import numpy as np
import numba
from numpy import sin, sum as total
from scipy import special
"""
CONSTANTS = """
import numpy as np
import deeper
SCALE = 2.0
OTHER = 1.0
ARRAY = np.arange(5000.0)
def helper(x, k=1.0, *, q=2.0):
    return k * q * x * deeper.GAIN
"""
DEEPER = """
GAIN = 3.0
UNUSED = 4.0
class Gains:
    low = 1.0
    high = 2.0
"""
#: A function `f` of `own.py`, and what is changed in which file: (text before, text after).
FOLLOWED = {
    "an attribute of a module": ("def f(x): return constants.SCALE * x", "constants", "SCALE = 2.0", "SCALE = 2.5"),
    "a nested attribute": ("def f(x): return constants.deeper.GAIN * x", "deeper", "GAIN = 3.0", "GAIN = 3.5"),
    "an attribute by getattr": ("def f(x): return getattr(constants, 'SCALE') * x", "constants", "= 2.0", "= 2.5"),
    "a module in a local": ("def f(x):\n    m = constants\n    return m.SCALE * x", "constants", "= 2.0", "= 2.5"),
    "a module inside": ("def f(x):\n    import constants as c\n    return c.SCALE * x", "constants", "= 2.0", "= 2.5"),
    "one name inside": (
        "def f(x):\n    from constants import SCALE as s\n    return s * x",
        "constants",
        "= 2.0",
        "= 5.0",
    ),
    "inside a comprehension": ("def f(x): return sum([constants.SCALE * v for v in x])", "constants", "= 2.0", "= 9.0"),
    "inside a lambda": (
        "f = (lambda k: lambda x: constants.SCALE * x * k)(1)",
        "constants",
        "SCALE = 2.0",
        "SCALE = 9.0",
    ),
    "a module in a closure": ("f = (lambda m: lambda x: m.SCALE * x)(constants)", "constants", "= 2.0", "= 9.0"),
    "a module in a default": ("def f(x, m=constants): return m.SCALE * x", "constants", "= 2.0", "= 9.0"),
    "a class as a namespace": ("def f(x): return constants.deeper.Gains.low", "deeper", "low = 1.0", "low = 1.5"),
    "a large array": ("def f(x): return constants.ARRAY[2500]", "constants", "arange(5000.0)", "arange(5000.0)[::-1]"),
    "an array's order": ("A = np.ones((3, 3), order='C')\ndef f(x): return A[x]", "own", "order='C'", "order='F'"),
    "an array's type": ("A = np.ones(3, 'f8')\ndef f(x): return A[x]", "own", "'f8'", "'f4'"),
    "an array in a tuple": (
        "T = (np.arange(5000.0), 1)\ndef f(x): return T[0][x]",
        "own",
        "5000.0)",
        "5000.0) + (_ == 9)",
    ),
    "an array in a list": ("T = [np.zeros(5000)]\nT[0][2500] = 1\ndef f(x): return T[0][x]", "own", "] = 1", "] = 2"),
    "objects in an array": ("A = np.array([1, 'a', None], object)\ndef f(x): return A[x]", "own", "'a'", "'b'"),
    "a masked array": ("A = np.ma.array([1.0, 2.0], mask=[0, 1])\ndef f(x): return A[x]", "own", "[0, 1]", "[1, 0]"),
    "a dictionary": ("D = {'a': {'b': [1, 2]}}\ndef f(x): return D['a']['b'][x]", "own", "[1, 2]", "[1, 3]"),
    "the order of a dictionary": ("D = {1: 1, 2: 2}\ndef f(x): return [*D]", "own", "1: 1, 2: 2", "2: 2, 1: 1"),
    "a set": ("S = {'a', 'b', 'c'}\ndef f(x): return x in S", "own", "'c'", "'d'"),
    "an integer or a real": ("N = 1\ndef f(x): return x // N", "own", "N = 1", "N = 1.0"),
    "a truth or a number": ("N = True\ndef f(x): return x + N", "own", "N = True", "N = 1"),
    "a numpy number": ("N = 1.0\ndef f(x): return x + N", "own", "N = 1.0", "N = np.float64(1.0)"),
    "a sign of zero": ("N = (0.0,)\ndef f(x): return math.atan2(N[0], x)", "own", "(0.0", "(-0.0"),
    "the last bit": ("N = 0.1\ndef f(x): return x + N", "own", "N = 0.1", "N = 0.10000000000000002"),
    "a constant in the code": ("def f(x): return x * 2.0", "own", "x * 2.0", "x * 3.0"),
    "a nested constant": ("def f(x): return x in (1, (2, 3.0))", "own", "3.0", "4.0"),
    "an operator": ("def f(x): return x * 2.0", "own", "x * 2.0", "x / 2.0"),
    "a default": ("def f(x, k=1.0): return x * k", "own", "k=1.0", "k=2.0"),
    "a keyword's default": ("def f(x, *, k=1.0): return x * k", "own", "k=1.0", "k=2.0"),
    "a closure": ("f = (lambda k: lambda x: x * k)(2.0)", "own", "(2.0)", "(3.0)"),
    "a helper": ("def h(x): return 2.0 * x\ndef f(x): return h(x)", "own", "2.0 * x", "3.0 * x"),
    "a helper of a module": ("def f(x): return constants.helper(x)", "constants", "return k *", "return 2 * k *"),
    "what that helper reads": ("def f(x): return constants.helper(x)", "deeper", "GAIN = 3.0", "GAIN = 3.5"),
    "that helper's keywords": ("def f(x): return constants.helper(x)", "constants", "q=2.0", "q=3.0"),
    "helpers that call each other": (
        "def g(x): return f(x - N) if x else 0\ndef f(x): return g(x) + 1\nN = 1",
        "own",
        "N = 1",
        "N = 2",
    ),
    "a jitted helper": ("@numba.njit\ndef h(x): return 2.0 * x\ndef f(x): return h(x)", "own", "2.0 * x", "3.0 * x"),
    "what a jitted helper reads": (
        "@numba.njit\ndef h(x): return constants.SCALE * x\ndef f(x): return h(x)",
        "constants",
        "= 2.0",
        "= 2.5",
    ),
    "how a helper is jitted": (
        "@numba.njit(fastmath=False)\ndef h(x): return 2.0 * x\ndef f(x): return h(x)",
        "own",
        "False",
        "True",
    ),
    "the types that a helper is jitted for": (
        "@numba.njit('f8(f8)')\ndef h(x): return 2.0 * x\ndef f(x): return h(x)",
        "own",
        "'f8(f8)'",
        "'f4(f4)'",
    ),
    "a vectorized helper": (
        "@numba.vectorize\ndef h(x): return 2.0 * x\ndef f(x): return h(x)",
        "own",
        "2.0 *",
        "3.0 *",
    ),
    "its types": ("@numba.vectorize(['f8(f8)'])\ndef h(x): return x\ndef f(x): return h(x)", "own", "f8(f8)", "f4(f4)"),
    "a callback": ("@numba.cfunc('f8(f8)')\ndef h(x): return 2.0 * x\ndef f(x): return h(x)", "own", "2.0 *", "3.0 *"),
    "a class": ("class K:\n    gain = 1.0\ndef f(x): return K.gain * x", "own", "gain = 1.0", "gain = 2.0"),
    "a class's base": (
        "class B:\n    gain = 1.0\nclass K(B): pass\ndef f(x): return K.gain * x",
        "own",
        "gain = 1.0",
        "gain = 2.0",
    ),
    "a property": (
        "class K:\n    @property\n    def g(self): return constants.SCALE\nk = K()\ndef f(x): return k.g",
        "constants",
        "= 2.0",
        "= 2.5",
    ),
    "an object": (
        "class K:\n    def __init__(self): self.gain = 1.0\nk = K()\ndef f(x): return k.gain",
        "own",
        "gain = 1.0",
        "gain = 2.0",
    ),
    "an object with slots": (
        "class K:\n    __slots__ = ('gain',)\nk = K()\nk.gain = 1.0\ndef f(x): return k.gain",
        "own",
        "gain = 1.0",
        "gain = 2.",
    ),
    "an object that hides its state": (
        "class K:\n    def __reduce__(self): return K, ()\nk = K()\nk.gain = 1.0\ndef f(x): return k.gain",
        "own",
        "gain = 1.0",
        "gain = 2.0",
    ),
    "a list of one's own": ("class L(list): pass\nl = L([1.0])\ndef f(x): return l[0]", "own", "[1.0]", "[2.0]"),
    "an array of one's own": (
        "class A(np.ndarray): pass\na = np.ones(3).view(A)\ndef f(x): return a[0]",
        "own",
        "ones",
        "zeros",
    ),
    "a method": (
        "class K:\n    def m(self, x): return 2.0 * x\nm = K().m\ndef f(x): return m(x)",
        "own",
        "2.0 *",
        "3.0 *",
    ),
    "a named tuple": (
        "P = collections.namedtuple('P', 'a b')(1.0, 2.0)\ndef f(x): return P.a",
        "own",
        "(1.0,",
        "(3.0,",
    ),
    "a named tuple's fields": (
        "P = collections.namedtuple('P', 'a b')(1.0, 2.0)\ndef f(x): return P.a",
        "own",
        "a b",
        "b a",
    ),
    "a data class": (
        "@dataclasses.dataclass\nclass D:\n    a: float = 1.0\nd = D()\ndef f(x): return d.a",
        "own",
        "1.0",
        "2.0",
    ),
    "an enumeration": ("class E(enum.Enum):\n    A = 1\ndef f(x): return E.A.value", "own", "A = 1", "A = 2"),
    "a whole-number enumeration": (
        "class E(enum.IntEnum):\n    A = 1\ndef f(x): return E.A + x",
        "own",
        "A = 1",
        "A = 2",
    ),
    "a fraction": ("N = fractions.Fraction(1, 3)\ndef f(x): return N * x", "own", "(1, 3)", "(1, 4)"),
    "a decimal": ("N = decimal.Decimal('1.5')\ndef f(x): return N * x", "own", "'1.5'", "'1.6'"),
    "a pattern": ("R = re.compile('a+')\ndef f(x): return R.match(x)", "own", "'a+'", "'b+'"),
    "a partial function": ("p = functools.partial(math.pow, 2.0)\ndef f(x): return p(x)", "own", "2.0)", "3.0)"),
    "a remembering function": (
        "@functools.lru_cache\ndef h(x): return 2.0 * x\ndef f(x): return h(x)",
        "own",
        "2.0 * x",
        "3.0 * x",
    ),
    "a builtin replaced": ("def f(x): return abs(x)", "own", "def f", "abs = max\ndef f"),
    "a name that comes to be": ("def f(x): return mystery", "own", "def f", "mystery = 1\ndef f"),
    "another function of numpy": ("def f(x): return np.sin(x)", "own", "np.sin", "np.cos"),
    "another function by name": ("g = np.sin\ndef f(x): return g(x)", "own", "np.sin", "np.cos"),
    "a structured array": (
        "A = np.zeros(2, [('a', 'f8'), ('b', 'i4')])\ndef f(x): return A[0]['a']",
        "own",
        "('b', 'i4')",
        "('b', 'i2')",
    ),
}
FILES = {"constants": CONSTANTS, "deeper": DEEPER}


@pytest.fixture
def functions(tmp_path, monkeypatch):
    """The function `f` of an author's file, imported anew with its two modules as they are now."""
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)

    def load(text: str, **changed: str) -> types.FunctionType:
        files = {**FILES, "own": HEAD + "import constants\n_ = np.arange(5000)\n" + text, **changed}
        for name, content in files.items():
            (tmp_path / f"{name}.py").write_text(content)
            sys.modules.pop(name, None)
        importlib.invalidate_caches()
        return importlib.import_module("own").f

    yield load
    for name in ("own", *FILES):
        sys.modules.pop(name, None)


@pytest.mark.parametrize("name", FOLLOWED)
def test_what_a_function_reads_is_followed(functions, name):
    text, file, before, after = FOLLOWED[name]
    changed = HEAD + "import constants\n_ = np.arange(5000)\n" + text if file == "own" else FILES[file]
    assert before in changed
    first = fingerprint(functions(text))
    assert not obstacle(first)
    same = fingerprint(functions(text))
    other = fingerprint(functions(text, **{file: changed.replace(before, after)}))
    assert same == first != other


UNREAD = {
    "another attribute": ("def f(x): return constants.SCALE * x", "constants", "OTHER = 1.0", "OTHER = 5.0"),
    "another module's": ("def f(x): return constants.SCALE * x", "deeper", "UNUSED = 4.0", "UNUSED = 5.0"),
    "a comment": ("def f(x): return x", "own", "def f", "# a comment\n\n\ndef f"),
    "a docstring": ("class K:\n    'doc'\n    g = 1.0\ndef f(x): return K.g", "own", "'doc'", "'other'"),
}


@pytest.mark.parametrize("name", UNREAD)
def test_what_it_does_not_read_is_left_alone(functions, name):
    text, file, before, after = UNREAD[name]
    changed = HEAD + "import constants\n_ = np.arange(5000)\n" + text if file == "own" else FILES[file]
    assert before in changed
    first = fingerprint(functions(text))
    assert fingerprint(functions(text, **{file: changed.replace(before, after)})) == first


def test_lines_count_where_they_are_told(functions):
    here, there = "def f(x): return x", "\n\ndef f(x): return x"
    assert fingerprint(functions(here)) == fingerprint(functions(there))
    assert fingerprint(functions(here), lines=True) != fingerprint(functions(there), lines=True)


ENDLESS = {
    "a C library": ("lib = ctypes.CDLL(None).cos\ndef f(x): return lib(x)", "ctypes"),
    "a lock": ("lock = threading.Lock()\ndef f(x): return lock", "lock"),
    "a generator": ("g = (k for k in range(3))\ndef f(x): return next(g)", "generator"),
    "an open file": ("file = io.open(__file__)\ndef f(x): return file.read()", "TextIOWrapper"),
    "a module not imported yet": ("def f(x):\n    import this_is_not_there\n    return x", "this_is_not_there"),
    "an object that refuses": (
        "class K:\n    def __reduce_ex__(self, n): raise RuntimeError\nk = K()\ndef f(x): return k",
        "own.K",
    ),
    "a road without an end": ("t = ()\nfor _ in range(100_000): t = (t,)\ndef f(x): return t", "nested too deep"),
}


@pytest.mark.parametrize("name", ENDLESS)
def test_what_cannot_be_followed_is_like_nothing_else(functions, name):
    text, words = ENDLESS[name]
    f = functions(text)
    first = fingerprint(f)
    assert words in obstacle(first) and obstacle("before " + first + " after") == obstacle(first)
    assert first != fingerprint(f)


OUTSIDE = {
    "a file": "def f(x): return open('gains.csv').read()",
    "a file by numpy": "def f(x): return np.loadtxt('gains.csv')",
    "a path": "p = pathlib.Path('gains.csv')\ndef f(x): return p.read_text()",
    "the clock": "def f(x): return datetime.datetime.now()",
    "chance": "def f(x): return np.random.normal()",
    "a generator of chance": "r = np.random.default_rng(1)\ndef f(x): return r.normal()",
    "text that becomes code": "def f(x): return eval('constants.SCALE')",
    "the globals": "def f(x): return globals()['constants'].SCALE",
    "the globals by a function": "def g(): pass\ndef f(x): return g.__globals__['constants']",
    "numpy as a whole": "def f(x): return getattr(np, 'load')('gains.npy')",
}


@pytest.mark.parametrize("name", OUTSIDE)
def test_plain_python_may_look_elsewhere(functions, name):
    f = functions(OUTSIDE[name])
    assert obstacle(fingerprint(f, interpreted=True))


def test_plain_python_that_looks_at_its_arguments_only(functions):
    text = "def f(x):\n    return np.sin(x) + sin(x) + total(x) + special.erf(x) + min(x, np.pi) + len(x) + math.e\n"
    assert not obstacle(fingerprint(functions(text), interpreted=True))


def test_the_text_is_the_same_in_every_process(tmp_path):
    (tmp_path / "deeper.py").write_text(DEEPER)
    (tmp_path / "constants.py").write_text(CONSTANTS)
    body = "\n".join(
        text.replace("def f(", f"def f{k}(").replace("f = (", f"f{k} = (")
        for k, (text, *_) in enumerate(FOLLOWED.values())
    )
    (tmp_path / "own.py").write_text(HEAD + "import constants\n_ = np.arange(5000)\n" + body)
    code = (
        "import own; from cosim.compiling.fingerprint.text import fingerprint\n"
        f"print(*(fingerprint(getattr(own, f'f{{k}}'), lines=True) for k in range({len(FOLLOWED)})))"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path]), "PYTHONHASHSEED": "random"}
    texts = {
        subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=False
        ).stdout
        for _ in range(3)
    }  # the first one without bytecode on disk
    assert len(texts) == 1 and len(texts.pop().split()) == len(FOLLOWED)


def test_installed_packages_are_known_by_their_files(tmp_path, functions, monkeypatch):
    folder = tmp_path / "site"
    (folder / "gadgets").mkdir(parents=True)
    (folder / "gadgets-1.0.dist-info").mkdir()
    (folder / "gadgets" / "__init__.py").write_text("TABLE = {}\ndef gadget(x): return 2.0 * x\nGAIN = 1.0\n")
    (folder / "gadgets-1.0.dist-info" / "METADATA").write_text("Metadata-Version: 2.1\nName: gadgets\nVersion: 1.0\n")
    record = folder / "gadgets-1.0.dist-info" / "RECORD"
    monkeypatch.syspath_prepend(str(folder))
    texts = []
    for line in ("gadgets/__init__.py,sha256=a,30", "gadgets/__init__.py,sha256=b,30"):
        record.write_text(line + "\n")
        installed.text.cache_clear()
        texts.append(
            [fingerprint(functions(f"import gadgets\ndef f(x): return gadgets.{n}")) for n in ("gadget", "GAIN")]
        )
    assert texts[0][0] != texts[1][0]  # its function, as the package is another one
    assert texts[0][1] == texts[1][1]  # a number is what it is


def test_the_roads_of_bytecode_are_those_that_python_shows():
    def shown(code):
        roads, imports, road = set(), set(), ()
        lines = [i for i in dis.get_instructions(code) if i.opname not in ("EXTENDED_ARG", "CACHE")]
        for k, line in enumerate(lines):
            if road and line.opname in ("LOAD_ATTR", "LOAD_METHOD"):
                road = (*road, line.argval)
                continue
            roads |= {road} if road else set()
            road = (line.argval,) if line.opname in ("LOAD_GLOBAL", "LOAD_NAME") else ()
            if line.opname == "IMPORT_NAME":
                imports.add((line.argval, lines[k - 2].argval, lines[k - 1].argval or ()))
        return roads | ({road} if road else set()), imports

    seen = 0
    todo = [compile(Path(m.__file__).read_text(), m.__file__, "exec") for m in (argparse, textwrap, dis)]
    for code in todo:
        todo += [c for c in code.co_consts if isinstance(c, types.CodeType)]
        assert bytecode.reads(code) == shown(code)
        seen += 1
    assert seen > 200


def test_all_files_that_say_what_code_a_function_becomes_are_in_the_key():
    """They are `compiler` and `adapters`, and what these import of this package, also inside functions."""
    folder = Path(cache.__file__).parents[1]
    found, todo = set(), ["compiling/compiler", "compiling/adapters"]
    while todo:
        name = todo.pop()
        if name in found or not (folder / f"{name}.py").is_file():
            continue
        found.add(name)
        for node in ast.walk(ast.parse((folder / f"{name}.py").read_text())):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("cosim."):
                module = node.module.removeprefix("cosim.").replace(".", "/")
                todo += [module, *(f"{module}/{alias.name}" for alias in node.names)]
    assert found == set(cache.COMPILING)


def test_the_frameworks_own_code_is_known_by_all_files_that_it_imports(tmp_path, monkeypatch):
    """Beside those that the key has anyway: whatever of them is another, so is the text."""
    monkeypatch.setattr(own_files, "_ROOT", tmp_path)
    files = {
        "engine": "from cosim.near import one\nfrom cosim.house import (\n    inner,\n    other,\n)\n",
        "near": "def one():\n    from cosim.late import two\n    return two\n",
        "late": "two = 2\n",
        "house/inner": "",
        "house/other": "import math\n",
        "house/alone": "",
    }
    (tmp_path / "cosim" / "house").mkdir(parents=True)
    for name, text in files.items():
        (tmp_path / "cosim" / f"{name}.py").write_text(text)

    def text():
        own_files._digest.cache_clear()
        return own_files._digest(tmp_path / "cosim" / "engine.py")

    before, changing = text(), set()
    for name, content in files.items():
        (tmp_path / "cosim" / f"{name}.py").write_text(f"{content}# another\n")
        if text() != before:
            changing.add(name)
        (tmp_path / "cosim" / f"{name}.py").write_text(content)
    assert text() == before and changing == files.keys() - {"house/alone"}
    own_files._digest.cache_clear()
