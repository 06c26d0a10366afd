"""What the functions of a block may say, and what their author is told, at the line, where they say something else."""

import importlib
import inspect
import pkgutil
import re

import numpy as np
import pytest

from cosim import Block, Input, Output
from cosim.authoring import authors
from cosim.errors import CosimError, DeclarationError, DiagramErrors, Position
from cosim.language.entry import BlockEntry
from cosim.language.source import Node
from cosim.wiring import library

HEAD = """
import math
import os
import random
import sys
import time as clock
from random import gauss

import numpy as np

from cosim import Block, CalculatedParameter, Dimension, Input, Local, Output, Parameter, State, rule

FEW = 1
LOG = [0.0]
TABLE = (1.0, 2.0)


def fill(array, value):
    for k in range(array.size):
        array[k] = value


def fill_some(array, value):
    for k in range(array.size):
        if value > 0.0:
            array[k] = value


def first(array):
    return array[0]


def row(matrix, i):
    return matrix[i]


def add_to(array, value):
    for k in range(array.size):
        array[k] += value


def text_of(value):
    return len(f"{value}")


class Own{bases}:
    u = Input("n", start=1.0)
    A = Input(2, 2, start=1.0)
    s = Input(start=1.0)
    p = Parameter("n", default=1.0)
    k = Parameter(default=1.0)
    c = CalculatedParameter()
    x = State("n")
    z = State()
    w = Local("n")
    y = Output("n")
    M = Output(2, 2)
{variables}
{functions}
"""
FUNCTIONS = {
    "calculate": "def calculate(k, c):\n    c[0] = 2.0 * k",
    "start": "def start(u, x):\n    for q in range(u.size):\n        x[q] = u[q]",
    "outputs": "def outputs(u, s, w, y):\n    for q in range(u.size):\n        w[q] = s\n        y[q] = u[q] + w[q]",
    "outputs_matrix": "def outputs_matrix(A, M):\n    for i in range(2):\n        for j in range(2):\n"
    "            M[i, j] = A[i, j]",
    "derivatives": "def derivatives(u, x, d_x):\n    for q in range(u.size):\n        d_x[q] = u[q] - x[q]",
    "update": "def update(s, next_z):\n    next_z[0] = s",
}


def source(*functions, variables="", bases="(Block)"):
    """The file of a block, with these functions instead of the usual ones of the same name."""
    own = {**FUNCTIONS, **{text.partition("(")[0].split()[-1]: text for text in functions}}
    texts = ["    " + text.replace("\n", "\n    ") for text in own.values() if text]
    indented = "".join(f"    {line}\n" for line in variables.splitlines())
    return HEAD.replace("{functions}", "\n\n".join(texts)).replace("{variables}", indented).replace("{bases}", bases)


def mistakes(folder, text):
    """The mistakes of a file that has this text, with the numbers of the lines that are marked in it."""
    file = folder / "own.py"
    file.write_text(text)
    marked = [number for number, line in enumerate(text.splitlines(), start=1) if "#!" in line]
    place = Position("d.yaml", 1, 1)
    entry = BlockEntry("b", "python", Node(f"{file}:Own", Position(f"{folder}/d.yaml", 1, 1)), place)
    try:
        library.find(entry)
    except DiagramErrors as error:
        return error.errors, marked
    except CosimError as error:
        return [error], marked
    return [], marked


def outputs(arguments, *lines):
    """An `outputs` function."""
    return f"def outputs({arguments}):\n" + "\n".join(f"    {line}" for line in lines)


def derivatives(*lines, arguments="u, x, d_x"):
    return f"def derivatives({arguments}):\n" + "\n".join(f"    {line}" for line in lines)


Y = "fill(y, 0.0)"
W = "fill(w, 0.0)"
READ = "an input, which it may only read"
# name: (functions, words, fix); the line that is named is marked by #!
WRITES = {
    "an input": (outputs("u, w, y", W, Y, "u[0] = 1.0  #!"), f"Own.outputs.. writes `u`, {READ}", "Local"),
    "a parameter": (outputs("p, w, y", W, Y, "p[0] = 1.0  #!"), "writes `p`, a parameter", ""),
    "a calculated parameter": (outputs("c, w, y", W, Y, "c += 1.0  #!"), "`c`, a calculated parameter", ""),
    "a state": (derivatives("fill(d_x, 0.0)", "x[0] = u[0]  #!"), "writes `x`, a state", "write d_x"),
    "a state in update": (
        "def update(s, x, z, next_z):\n    next_z[0] = z\n    x[0] = s  #!",
        "writes `x`, a state",
        "write next_x",
    ),
    "an input in place": (outputs("u, w, y", W, Y, "u += 1.0  #!"), f"writes `u`, {READ}", ""),
    "an element in place": (outputs("u, w, y", W, Y, "u[0] += 1.0  #!"), f"writes `u`, {READ}", ""),
    "a tuple target": (outputs("u, w, y", W, "y[0], u[0] = 1.0, 2.0  #!"), f"writes `u`, {READ}", ""),
    "a nested target": (outputs("u, w, y", W, Y, "(y[0], (u[0], a)) = 1.0, (2.0, 3.0)  #!"), f"writes `u`, {READ}", ""),
    "a for-target": (
        outputs("u, w, y", W, Y, "for u[0] in range(3):  #!", "    y[0] = 1.0"),
        f"writes `u`, {READ}",
        "",
    ),
    "a slice": (outputs("u, w, y", W, Y, "u[1:] = 0.0  #!"), f"writes `u`, {READ}", ""),
    "a view": (outputs("A, w, y", W, Y, "a = A[0]", "a[1] = 2.0  #!"), "writes `A`", ""),
    "a view of a view": (outputs("A, w, y", W, Y, "a = A.T", "b = a[0]", "b[1] += 2.0  #!"), "writes `A`", ""),
    "another name": (outputs("u, w, y", W, Y, "v = u", "v[0] = 1.0  #!"), f"writes `u`, {READ}", ""),
    "a view by a method": (outputs("u, w, y", W, Y, "u.reshape(-1)[0] = 1.0  #!"), f"writes `u`, {READ}", ""),
    "flat": (outputs("u, w, y", W, Y, "u.flat[0] = 1.0  #!"), f"writes `u`, {READ}", ""),
    "one of two": (outputs("u, s, w, y", W, Y, "v = u if s > 0.0 else y", "v[0] = 1.0  #!"), f"writes `u`, {READ}", ""),
    "rows of a loop": (outputs("A, w, y", W, Y, "for a in A:", "    a[0] = 1.0  #!"), "writes `A`", ""),
    "rows of zip": (outputs("A, u, w, y", W, Y, "for a, b in zip(A, u):", "    a[0] = b  #!"), "writes `A`", ""),
    "rows of enumerate": (
        outputs("A, w, y", W, Y, "for i, a in enumerate(A):", "    a[0] = i  #!"),
        "writes `A`",
        "",
    ),
    "a helper": (outputs("u, w, y", W, Y, "fill(u, 1.0)  #!"), f"writes `u`, {READ}", ""),
    "a helper on some path": (outputs("u, w, y", W, Y, "fill_some(u, 1.0)  #!"), f"writes `u`, {READ}", ""),
    "a helper by keyword": (outputs("u, w, y", W, Y, "fill(value=1.0, array=u)  #!"), f"writes `u`, {READ}", ""),
    "a row of a helper": (outputs("A, w, y", W, Y, "a = row(A, 0)", "a[0] = 1.0  #!"), "writes `A`", ""),
    "a method that writes": (outputs("u, w, y", W, Y, "u.fill(1.0)  #!"), f"writes `u`, {READ}", ""),
    "sort in place": (outputs("u, w, y", W, Y, "u.sort()  #!"), f"writes `u`, {READ}", ""),
    "a result of numpy": (outputs("u, w, y", W, Y, "np.add(y, y, u)  #!"), f"writes `u`, {READ}", ""),
    "out=": (outputs("u, w, y", W, Y, "np.add(y, y, out=u)  #!"), f"writes `u`, {READ}", ""),
    "copyto": (outputs("u, w, y", W, Y, "np.copyto(u, y)  #!"), f"writes `u`, {READ}", ""),
    "what an earlier function computes": (
        "def outputs_z(y, w):\n    y[0] = w[0]  #!",
        "writes `y`, an output",
        "outputs.. writes `y`",
    ),
    "work space in derivatives": (derivatives("w[0] = x[0]  #!", "fill(d_x, w[0])", arguments="x, w, d_x"), "`w`", ""),
}
REBINDS = {
    "an output": (outputs("u, w, y", W, "y = u  #!"), "gives the name `y` to another value", r"y\[q\] = …"),
    "a derivative": (derivatives("d_x = -x  #!"), "does not reach the derivative", r"d_x\[q\] = …"),
    "a next value": ("def update(s, next_z):\n    next_z = s  #!", "the next value", r"next_z\[0\] = …"),
    "a calculated parameter": ("def calculate(k, c):\n    c = 2.0 * k  #!", "the calculated", r"c\[0\] = …"),
    "a start value": ("def start(u, x):\n    x = u  #!", "does not reach the state", r"x\[q\] = …"),
    "an input": (outputs("u, s, w, y", W, Y, "s = 2.0 * s  #!"), "`s`, an input, to another value", "another name"),
    "an input in place": (outputs("u, s, w, y", W, Y, "s *= 2.0  #!"), "gives the name `s`", ""),
    "the time": (outputs("time, w, y", W, Y, "time = 0.0  #!"), "`time`, the simulated time", ""),
    "a tuple target": (outputs("u, w, y", W, Y, "a, u = 1.0, 2.0  #!"), "gives the name `u`", ""),
    "a for-target": (outputs("s, w, y", W, Y, "for s in range(3):  #!", "    y[0] = s"), "gives the name `s`", ""),
    "walrus": (outputs("s, w, y", W, Y, "if (s := 2.0) > 1.0:  #!", "    y[0] = s"), "gives the name `s`", ""),
    "del": (outputs("u, w, y", W, Y, "del u  #!"), "gives the name `u`", ""),
    "an annotated value": (outputs("s, w, y", W, Y, "s: float = 2.0  #!"), "gives the name `s`", ""),
    "a state in derivatives": (derivatives("fill(d_x, 0.0)", "x = u  #!"), "gives the name `x`, a state", "write d_x"),
    "a name of the block": (
        outputs("s, w, y", W, Y, "z = s  #!"),
        "its own, `z`, which is also a variable",
        "argument",
    ),
}
RETURNS = {
    "a number": (outputs("s, w, y", W, Y, "return s  #!"), "returns a value, which goes nowhere", "y"),
    "a derivative": (derivatives("fill(d_x, 0.0)", "return -x  #!"), "returns a value", r"d_x\[q\] = …"),
    "on some path": (
        outputs("s, w, y", W, Y, "if s > 0.0:", "    return 1.0  #!", "y[0] = s"),
        "returns a value",
        "in place",
    ),
    "nothing else": (
        "def calculate(k, c):\n    return 2.0 * k  #!",
        "returns a value",
        r"c\[0\] = …",
    ),
}
UNWRITTEN = {
    "never": (outputs("u, w, y  #!", W, "a = u[0]").replace("  #!):", "):  #!"), "never writes `y`", ""),
    "if without else": (
        outputs("u, s, w, y", W, "if s > 0.0:", "    fill(y, s)").replace("y):", "y):  #!"),
        "may leave `y` unwritten",
        "every path",
    ),
    "one branch": (
        outputs("s, w, y", W, "if s > 0.0:", "    fill(y, s)", "elif s < 0.0:", "    fill(y, s)").replace(
            "y):", "y):  #!"
        ),
        "may leave `y` unwritten",
        "",
    ),
    "early return": (
        outputs("s, w, y", W, "if s > 0.0:", "    return", Y).replace("y):", "y):  #!"),
        "may leave `y` unwritten",
        "",
    ),
    "while": (
        outputs("s, w, y", W, "a = s", "while a > 0.0:", "    fill(y, s)", "    a -= 1.0").replace("y):", "y):  #!"),
        "may leave `y` unwritten",
        "",
    ),
    "an empty range": (
        outputs("s, w, y", W, "for q in range(3, 0):", "    y[q] = s").replace("y):", "y):  #!"),
        "may leave `y` unwritten",
        "",
    ),
    "break": (
        outputs("s, w, y", W, "for q in range(y.size):", "    if s > q:", "        break", "    y[q] = s").replace(
            "y):", "y):  #!"
        ),
        "may leave `y` unwritten",
        "",
    ),
    "continue": (
        outputs("s, w, y", W, "for q in range(y.size):", "    if s > q:", "        continue", "    y[q] = s").replace(
            "y):", "y):  #!"
        ),
        "may leave `y` unwritten",
        "",
    ),
    "a short circuit": (
        outputs("s, w, y", W, "a = s > 0.0 and fill(y, s)").replace("y):", "y):  #!"),
        "may leave `y` unwritten",
        "",
    ),
    "a conditional expression": (
        outputs("s, w, y", W, "a = fill(y, s) if s > 0.0 else None").replace("y):", "y):  #!"),
        "may leave `y` unwritten",
        "",
    ),
    "a helper that may": (
        outputs("s, w, y", W, "fill_some(y, s)").replace("y):", "y):  #!"),
        "may leave `y` unwritten",
        "",
    ),
    "a helper that reads": (
        outputs("s, w, y", W, "a = first(y)").replace("y):", "y):  #!"),
        "never writes `y`",
        "do not name it",
    ),
    "a derivative": (
        derivatives("if u[0] > 0.0:", "    fill(d_x, 1.0)").replace("d_x):", "d_x):  #!"),
        "the derivative keeps",
        "",
    ),
    "an element": (
        "def outputs_matrix(A, M):  #!\n    M[0, 0] = A[0, 0]\n    M[0, 1] = 0.0\n    M[1, 0] = 0.0",
        r"may leave M\[1, 1\] of the output unwritten",
        "write M",
    ),
    "an element on some path": (
        "def outputs_matrix(A, M):  #!\n    M[0, 0] = M[0, 1] = M[1, 0] = 0.0\n    if A[0, 0] > 0.0:\n"
        "        M[1, -1] = 1.0",
        r"may leave M\[1, 1\]",
        "",
    ),
    "work space": (
        outputs("s, w, y", Y).replace("y):", "y):  #!"),
        "never writes `w`, the local",
        "",
    ),
    "a next value": ("def update(s, next_z):  #!\n    a = s", "never writes `next_z`", ""),
    "a start value": (
        "def start(u, x):  #!\n    if u[0] > 0.0:\n        fill(x, 1.0)",
        "may leave `x` unwritten",
        "",
    ),
    "read first": (
        outputs("u, w, y", W, "for q in range(y.size):", "    y[q] += u[q]  #!"),
        "reads `y` before it is written",
        r"y\[q\] = 0.0",
    ),
    "a number of its own that is kept": (
        "def outputs(s, w, y):\n    w[0] = w[0] + s  #!\n    w[1] = s\n    fill(y, w[0])",
        "reads `w` before it is written, when it holds what an earlier call left",
        "",
    ),
    "a sum in a work space": (
        "def outputs(u, s, w, y):\n    for q in range(2):\n        w[q] += u[q]  #!\n    fill(y, w[0])",
        "reads `w` before it is written, when it holds what an earlier call left",
        "",
    ),
    "read first as a whole": (outputs("u, w, y", W, "y += u  #!"), "reads `y` before it is written", ""),
    "read first to the left": (outputs("u, w, y", W, "y[:] = y * u  #!"), "reads `y` before it is written", ""),
    "read first to the right": (outputs("u, w, y", W, "y[:] = u * y  #!"), "reads `y` before it is written", ""),
    "read first, written out": (
        outputs("u, w, y", W, "for q in range(y.size):", "    y[q] = y[q] + u[q]  #!"),
        "reads `y` before it is written, when it holds what an earlier call left",
        r"y\[q\] = 0.0",
    ),
    "read first from the element before": (
        outputs("u, w, y", W, "for q in range(len(y)):", "    y[q] = u[q] + 2.0 * y[q - 1]  #!"),
        "reads `y` before it is written",
        "",
    ),
    "read first in a while": (
        outputs("u, w, y", W, "q = 0", "while q < y.size:", "    y[q] = abs(y[q]) + u[q]  #!", "    q += 1"),
        "reads `y` before it is written",
        "",
    ),
    "read first by a helper": (outputs("u, w, y", W, "add_to(y, 1.0)  #!"), "reads `y` before it is written", ""),
    "read first by numpy": (outputs("u, w, y", W, "y[:] = u - np.sum(y)  #!"), "reads `y` before it is written", ""),
    "read first by a method": (outputs("u, w, y", W, "y[:] = u - y.max()  #!"), "reads `y` before it is written", ""),
    "read first by Python": (outputs("u, w, y", W, "y[:] = u - sum(y)  #!"), "reads `y` before it is written", ""),
    "read first as it is": (outputs("u, w, y", W, "y[:] = y  #!"), "reads `y` before it is written", ""),
}
# loop: the element that it leaves out, and the fix
LEFT_OUT = {
    "for q in range(1, u.size):": (r"y\[0\]", r"range\(y.size\), or write y\[0\] too"),
    "for q in range(2, len(y)):": (r"y\[0\]", "too"),
    "for q in range(u.size - 1):": (r"y\[-1\]", "too"),
    "for q in range(len(y) - 1):": (r"y\[-1\]", "too"),
    "for q in range(u.shape[0] - 2):": (r"y\[-1\]", "too"),
    "for q in range(0, p.size - 1):": (r"y\[-1\]", "too"),
    "for q in range(0, y.size, 2):": (r"y\[1\]", "too"),
    "for q in range(y.size - 1, 0, -1):": (r"y\[0\]", "too"),
    "for q in range(y.size - 2, -1, -1):": (r"y\[-1\]", "too"),
    "for q in range(FEW, y.size):": (r"y\[0\]", "too"),
}
for _loop, (_element, _fix) in LEFT_OUT.items():
    _words = f"may leave `y` unwritten: {_element}, which this loop does not reach"
    UNWRITTEN[_loop] = outputs("u, p, s, w, y", W, f"{_loop}  #!", "    y[q] = s"), _words, _fix
UNWRITTEN |= {
    "all but the last, by a name": (
        outputs("u, s, w, y", W, "n = u.size - 1", "for q in range(n):  #!", "    y[q] = s"),
        r"y\[-1\], which",
        "",
    ),
    "all but the first, twice": (
        outputs("u, w, y", W, "for q in range(1, y.size):  #!", "    y[q] = 0.0", "    y[q] += u[q]"),
        r"y\[0\], which",
        "",
    ),
    "a fixed size": (
        "def outputs_matrix(A, M):\n    rows, columns = A.shape\n    for i in range(rows):\n"
        "        for j in range(columns - 1):  #!\n            M[i, j] = A[i, j]",
        r"M\[:, 1\], which",
        r"range\(M.shape\[1\]\)",
    ),
    "the elements of another size": (
        "def outputs_matrix(A, M):\n    for i in range(FEW):  #!\n        for j in range(2):\n"
        "            M[i, j] = A[i, j]",
        r"M\[1\], which",
        r"range\(M.shape\[0\]\)",
    ),
    "a derivative's first element": (
        derivatives("for q in range(1, x.size):  #!", "    d_x[q] = u[q]"),
        r"d_x\[0\], which",
        "",
    ),
}
SHARED = {
    "text": (outputs("time, w, y", W, 'fill(y, len(f"{time}"))  #!'), "formats text", "numbers"),
    "text in a helper": (outputs("time, w, y", W, "fill(y, text_of(time))"), r"text_of\(\), called by Own.outputs", ""),
    "str": (outputs("s, w, y", W, "fill(y, len(str(s)))  #!"), r"calls `str\(\)`", ""),
    "percent": (outputs("s, w, y", W, 'fill(y, len("%g" % s))  #!'), "formats text", ""),
    "print": (outputs("s, w, y", W, Y, "print(s)  #!"), "prints", "Local"),
    "the clock": (outputs("s, w, y", W, "fill(y, clock.time())  #!"), "asks the world outside", "`time`"),
    "random numbers": (outputs("s, w, y", W, "fill(y, random.random())  #!"), "draws random numbers", "study"),
    "random numbers by name": (outputs("s, w, y", W, "fill(y, gauss(0.0, 1.0))  #!"), "draws random numbers", ""),
    "random numbers of numpy": (outputs("w, y", W, "fill(y, np.random.normal())  #!"), "draws random numbers", ""),
    "the environment": (outputs("w, y", W, "fill(y, os.getpid())  #!"), "asks the world outside", "input"),
    "is": (outputs("s, w, y", W, Y, "if s is w:  #!", "    y[0] = s"), "for the same object", "=="),
    "id": (outputs("s, w, y", W, "fill(y, id(s))  #!"), r"calls `id\(\)`", ""),
    "hash": (outputs("s, w, y", W, "fill(y, hash(s))  #!"), r"calls `hash\(\)`", ""),
    "a dictionary": (outputs("s, w, y", W, "fill(y, {1: s}[1])  #!"), "makes a dictionary", "Local"),
    "a list": (outputs("s, w, y", W, "fill(y, [s, s][0])  #!"), "makes a list", "tuple"),
    "a comprehension": (outputs("u, w, y", W, "fill(y, max([a for a in u]))  #!"), "makes a list", ""),
    "a set": (outputs("s, w, y", W, "fill(y, len({s, 1.0}))  #!"), "makes a dictionary or a set", ""),
    "a new array": (outputs("u, w, y", W, "fill(y, np.sort(u)[0])  #!"), "makes a new array with `np.sort", "Local"),
    "a copy": (outputs("u, w, y", W, "fill(y, u.flatten()[0])  #!"), "makes a new array", ""),
    "a sum of numpy": (outputs("u, w, y", W, "fill(y, np.std(u))  #!"), r"calls `np.std\(\)`", "write the loop"),
    "a sum of an array": (outputs("u, w, y", W, "fill(y, u.var())  #!"), r"calls `.var\(\)`", "write the loop"),
    "a sum": (outputs("s, w, y", W, "fill(y, sum((s, s)))  #!"), r"calls `sum\(\)`", ""),
    "a product": (outputs("u, w, y", W, "fill(y, np.einsum('i,i', u, u))  #!"), r"calls `np.einsum\(\)`", ""),
    "a norm": (outputs("u, w, y", W, "fill(y, np.linalg.norm(u, 1))  #!"), r"calls `np.linalg.norm\(\)`", ""),
    "a function of numpy": (outputs("s, w, y", W, "fill(y, np.sinc(s))  #!"), "calls `np.sinc", ""),
    "try": (
        outputs("s, w, y", W, "try:  #!", f"    {Y}", "except ValueError:", f"    {Y}"),
        "catches exceptions",
        "if",
    ),
    "an import": (outputs("s, w, y", W, Y, "import math  #!"), "imports", "top of the file"),
    "a lambda": (outputs("s, w, y", W, Y, "a = lambda b: b  #!"), "a lambda inside", "outside"),
    "a function inside": (outputs("s, w, y", W, Y, "def a(b):  #!", "    return b"), "defines `a` inside", "outside"),
    "a list of the module": (outputs("s, w, y", W, Y, "LOG[0] = s  #!"), "writes `LOG`, which belongs", "State"),
    "global": (outputs("s, w, y", W, Y, "global LOG  #!"), "keeps `LOG` outside itself", "State"),
    "an unknown name": (outputs("s, w, y", W, "fill(y, mystery(s))  #!"), "`mystery`, which is defined nowhere", ""),
    "a misspelt name": (outputs("s, w, y", W, "fll(y, s)  #!"), "`fll`, which is defined nowhere", "`fill`"),
    "a variable that is no argument": (outputs("s, w, y", W, "fill(y, x[0])  #!"), "uses `x`, a variable", "add `x`"),
    "time that is no argument": (outputs("s, w, y", W, "fill(y, time)  #!"), "uses `time`", "add `time`"),
    "an index on a number": (outputs("s, w, y", W, "fill(y, s[0])  #!"), "an element of `s`, an input", "without"),
}
SIGNATURES = {
    "any number of arguments": ("def outputs(*u):  #!\n    pass", "any number of arguments", "plain def"),
    "keywords": ("def update(s, next_z, **more):  #!\n    next_z[0] = s", "any number of arguments", "plain def"),
    "a default": ("def update(next_z, s=1.0):  #!\n    next_z[0] = s", "defaults", "plain def"),
    "by keyword only": ("def update(next_z, *, s):  #!\n    next_z[0] = s", "by keyword only", "plain def"),
    "a generator": ("def update(s, next_z):  #!\n    next_z[0] = s\n    yield s", "yield", "plain def"),
    "async": ("async def update(s, next_z):  #!\n    next_z[0] = s", "asynchronous", "plain def"),
    "self": ("def update(self, s, next_z):  #!\n    next_z[0] = s", "names `self`", "remove it"),
    "an unknown argument": ("def update(s, next_zz):  #!\n    next_zz[0] = s", "names `next_zz`", "`next_z`"),
    "an input that has no value yet": (
        "def calculate(s, c):  #!\n    c[0] = s",
        "names `s`, which has no value yet",
        "",
    ),
    "a misspelt kind": ("def output_late(u, y):  #!\n    pass", "`output_late` is neither", "`outputs_…`"),
    "a rule that is not decorated": ("def positive(k):  #!\n    return k > 0.0", "`positive` is neither", "@rule"),
}
NAMES = {
    "time": ("time = Input(start=0.0)  #!", "`time` is the simulated time", "otherwise"),
    "a kind": ("outputs_late = Input(start=0.0)  #!", "`outputs_late` names a kind of function", "otherwise"),
    "a derivative": ("d_x = Input(start=0.0)  #!", "`d_x` is the name under which derivatives", "otherwise"),
    "a next value": ("next_z = Input(start=0.0)  #!", "`next_z` is the name under which update", "otherwise"),
    "a dimension": ("n = Parameter(default=1.0)  #!", "`n` is also the name of a dimension", "rename"),
    "what a class has": ("declaration = Input(start=0.0)  #!", "`declaration` has a meaning", "otherwise"),
    "a dunder": ("__gain__ = Parameter(default=1.0)  #!", "`__gain__` has a meaning", "otherwise"),
    "no brackets": ("late = Input  #!", "`late = Input` declares nothing", r"Input\(\)"),
    "twice": ("k = Parameter(default=2.0)  #!", "`k` is defined twice", "another name"),
    "a shape of no size": ("late = Input(0, start=1.0)  #!", "the shape of `late` has 0", "whole number|sizes"),
    "a shape that is a text": ("late = Input('2 n', start=1.0)  #!", "the shape of `late`", "sizes"),
    "a unit that is none": (
        "late = Input('n', unit='metre', start=1.0)  #!",
        "`late`: unknown unit `metre`",
        "`m`|such",
    ),
    "a broken unit": ("late = Input(unit='m//s', start=1.0)  #!", "`m//s` is not a unit", "such as"),
    "a broken unit of many": ("late = Input(2, unit=('m', 'metre'), start=1.0)  #!", "unknown unit `metre`", ""),
    "too many units": ("late = Input(2, unit=('m',) * 3, start=1.0)  #!", "3 units for the 2 elements", "one for each"),
    "units of a scalar": ("late = Input(unit=('m', 'm'), start=1.0)  #!", "of a scalar", "one unit"),
    "units of nothing": ("late = Input('n', unit=(), start=1.0)  #!", "0 units", "one for each"),
    "a list of units": ("late = Input(2, unit=['m', 'm'], start=1.0)  #!", "neither a text nor a tuple", "unit="),
    "a number for a unit": ("late = Input(unit=3, start=1.0)  #!", "3 is neither a text nor a tuple", "unit="),
    "a display unit of another dimension": (
        "late = Input(unit='rad', display='mm', start=1.0)  #!",
        "`mm` is of another dimension than `rad`",
        "deg",
    ),
    "a display unit that is none": (
        "late = Input(unit='m', display='yard', start=1.0)  #!",
        "unknown unit",
        "such as|mean",
    ),
    "a display unit without a unit": (
        "late = Input(display='mm', start=1.0)  #!",
        "no unit that it could stand",
        "unit=",
    ),
    "one display unit for several dimensions": (
        "late = Input(2, unit=('m', 'rad'), display='mm', start=1.0)  #!",
        "`mm` is of another dimension than `rad`",
        "",
    ),
    "too many names of components": (
        "late = Input(2, components=('x', 'y', 'z'), start=1.0)  #!",
        "3 names for the 2 elements",
        "components=",
    ),
    "components of a scalar": ("late = Input(components=('x',), start=1.0)  #!", "of a scalar", "components="),
    "components in one text": ("late = Input(2, components='xy', start=1.0)  #!", "no tuple of names", "components="),
    "a component twice": ("late = Input(2, components=('x', 'x'), start=1.0)  #!", "has a name twice", "once"),
    "a nominal value of zero": (
        "late = Input(nominal=0, start=1.0)  #!",
        "`nominal` of `late`: 0 is not above 0",
        "size",
    ),
    "a nominal text": ("late = Input(nominal='2', start=1.0)  #!", "'2' is no finite number", "nominal=2.5"),
    "a nominal integer": ("late = Input(dtype=int, nominal=2, start=1)  #!", "of the type int64 has none", "leave"),
    "an infinite limit": (
        "late = Input(max=float('inf'), start=1.0)  #!",
        "`max` of `late`: inf is no finite",
        "max=2.5",
    ),
    "a truth for a limit": ("late = Input(min=True, start=1.0)  #!", "True is no finite number", "min=2.5"),
    "limits of truths": (
        "late = Input(dtype=bool, min=0, start=True)  #!",
        "of the type bool has none",
        "leave it out",
    ),
    "half an integer": ("late = Input(dtype=int, max=2.5, start=1)  #!", "2.5 is no int64", "a whole number"),
    "a limit beyond its type": (
        "late = Input(dtype='uint8', max=300, start=1)  #!",
        "300 is no uint8",
        "a whole number from 0 to 255",
    ),
    "limits exchanged": (
        "late = Input(min=2, max=1, start=1.5)  #!",
        "`min` of `late`, 2, is above its `max`, 1",
        "exch",
    ),
    "limits exchanged in one element": (
        "late = Input(2, min=(0.0, 2.0), max=1.0, start=0.5)  #!",
        "`min` of `late`, 2, is above its `max`, 1",
        "exchange",
    ),
    "too many limits": (
        "late = Input(2, min=(0, 0, 0), start=1.0)  #!",
        "3 numbers for the 2 elements",
        "one for each",
    ),
    "limits of a scalar": ("late = Input(min=(0, 0), start=1.0)  #!", "for several elements of a scalar", "one number"),
    "a number for a description": (
        "late = Input(description=3, start=1.0)  #!",
        "`description` of `late` is 3",
        "text|…",
    ),
    "a text for a truth": ("late = Input(finite='no', start=1.0)  #!", "`finite` of `late` is 'no'", "finite=False"),
    "a text for another truth": ("late = State(output='no')  #!", "`output` of `late` is 'no'", "output=True"),
    "a truth for a text": ("late = Local(dtype=bool, event=True)  #!", "`event` of `late` is True", "event="),
    "a start of a parameter": ("late = Parameter(start=2.0)  #!", "parameter `late` has a `start`", "use default="),
    "complex numbers": ("late = Input(dtype=complex, start=1.0)  #!", "`late` is of the type complex128", "float64"),
    "texts": ("late = Parameter(dtype=str)  #!", "`late` is of the type", "bool, int8, .*uint64, float32, float64"),
    "objects": ("late = Parameter(dtype=object)  #!", "`late` is of the type object", "float64"),
    "half a float": ("late = Input(dtype='float16', start=1.0)  #!", "`late` is of the type float16", "float64"),
    "a long float": ("late = Input(dtype='longdouble', start=1.0)  #!", "`late` is of the type float128", "float64"),
    "another byte order": ("late = Input(dtype='>f8', start=1.0)  #!", "`late` is of the type >f8", "float64"),
    "a shape with a fraction": ("late = Input(2.5, start=1.0)  #!", "the shape of `late` has 2.5", "sizes"),
}
FUNCTION_MISTAKES = {
    f"{kind}: {name}": case
    for kind, table in (
        ("writes", WRITES),
        ("rebinds", REBINDS),
        ("returns", RETURNS),
        ("unwritten", UNWRITTEN),
        ("shared", SHARED),
        ("signature", SIGNATURES),
    )
    for name, case in table.items()
}


@pytest.mark.parametrize("mistake", FUNCTION_MISTAKES)
def test_a_mistake_in_a_function_is_named_with_its_line_and_its_fix(tmp_path, mistake):
    function, words, fix = FUNCTION_MISTAKES[mistake]
    found, marked = mistakes(tmp_path, source(function))
    said = [f"{e.position}: {e.message} / {e.fix}" for e in found]
    fitting = [e for e in found if re.search(words, e.message)]
    assert fitting, said
    assert isinstance(fitting[0], DeclarationError) and re.search(fix, fitting[0].fix) and fitting[0].fix, said
    if marked:
        assert (fitting[0].position.file, fitting[0].position.line) == (str(tmp_path / "own.py"), marked[0]), said
    assert fitting[0].position.column > 0


@pytest.mark.parametrize("mistake", NAMES)
def test_a_name_that_means_something_else(tmp_path, mistake):
    line, words, fix = NAMES[mistake]
    found, marked = mistakes(tmp_path, source(variables=line))
    said = [f"{e.position}: {e.message} / {e.fix}" for e in found]
    fitting = [e for e in found if re.search(words, e.message)]
    assert fitting and re.search(fix, fitting[0].fix), said
    assert fitting[0].position.line == marked[0]


def test_a_name_that_gets_another_value_is_one_mistake(tmp_path):
    """What was written under it before is no write to that other value."""
    text = source(outputs("u, s, k, w, y, s_out", W, Y, "s_out[0] = 1.0", "s_out = k"), variables="s_out = Output()")
    (only,), _ = mistakes(tmp_path, text)
    assert "gives the name `s_out` to another value" in only.message


def test_all_mistakes_of_a_file_come_at_once(tmp_path):
    wrong = [
        WRITES["an input"][0],
        REBINDS["a derivative"][0],
        RETURNS["nothing else"][0],
        UNWRITTEN["a start value"][0],
    ]
    text = source(*wrong, variables="time = Input(start=0.0)  #!\n")
    text += text.partition("class Own")[1] + "2" + text.partition("class Own")[2]
    found, marked = mistakes(tmp_path, text)
    lines = [e.position.line for e in found]
    assert lines == sorted(lines) and set(marked) <= set(lines) and len(marked) == 10


CORRECT = {
    "the usual": (),
    "every branch": (outputs("s, w, y", W, "if s > 0.0:", "    fill(y, s)", "else:", f"    {Y}"),),
    "elif and else": (outputs("s, w, y", W, "if s > 1:", f"    {Y}", "elif s > 0:", f"    {Y}", "else:", f"    {Y}"),),
    "an early return after the write": (outputs("s, w, y", W, Y, "if s > 0.0:", "    return", "y[0] = s"),),
    "return None": (outputs("s, w, y", W, Y, "return None"),),
    "a branch that raises": (
        outputs("s, w, y", W, "if s > 0.0:", "    fill(y, s)", "else:", '    raise ValueError("too small")'),
    ),
    "work space on one path": (outputs("s, w, y", Y, "if s > 0.0:", f"    {W}"),),
    "a slice": (outputs("s, w, y", W, "y[:] = s"),),
    "a tuple target": (outputs("s, w, y", "w[0], y[0] = 1.0, s"),),
    "an endless loop that ends": (
        outputs(
            "s, w, y", W, "a = s", "while True:", "    a *= 0.5", "    if a < 1.0:", f"        {Y}", "        break"
        ),
    ),
    "an endless loop that returns": (
        outputs(
            "s, w, y", W, "a = s", "while True:", "    a *= 0.5", "    if a < 1:", f"        {Y}", "        return"
        ),
    ),
    "a while that counts": (outputs("s, w, y", W, "q = 0", "while q < y.size:", "    y[q] = s", "    q += 1"),),
    "a while that counts to a name": (
        outputs("s, w, y", W, "n = y.shape[0]", "q = 0", "while q < n:", "    y[q] = s", "    q += 1"),
    ),
    "for and else": (
        outputs(
            "s, w, y", W, "for q in range(3):", "    if s > q:", f"        {Y}", "        break", "else:", f"    {Y}"
        ),
    ),
    "continue after the write": (
        outputs("s, w, y", W, "for q in range(y.size):", "    y[q] = s", "    if s > 0:", "        continue"),
    ),
    "the first differs": (
        outputs("u, w, y", W, "for q in range(u.size):", "    if q == 0:", "        y[q] = u[q]", "    else:")
        + "\n            y[q] = y[q - 1] + u[q]",
    ),
    "the first differs in an expression": (
        outputs("u, w, y", W, "for q in range(u.size):", "    y[q] = u[q] if q == 0 else y[q - 1] + u[q]"),
    ),
    "every size of the same dimension": (
        outputs("u, p, w, y", W, "n = p.shape[0]", "for q in range(n):", "    y[q] = u[q]"),
    ),
    "a constant that is the size": (
        "def outputs_matrix(A, M):\n    for i in range(FEW + 1):\n        for j in range(2):\n"
        "            M[i, j] = A[i, j]",
    ),
    "the last by itself": (
        outputs("u, w, y", W, "for q in range(y.size - 1):", "    y[q] = u[q + 1]", "y[y.size - 1] = u[0]"),
    ),
    "the last by itself, from the end": (
        outputs("u, w, y", W, "y[-1] = 0.0", "for q in range(y.size - 2, -1, -1):", "    y[q] = y[q + 1] + u[q]"),
    ),
    "the first inside the loop": (
        outputs("u, w, y", W, "for q in range(1, y.size):", "    y[q] = u[q]", "    if q == 1:", "        y[0] = 0.0"),
    ),
    "even and odd": (
        outputs("s, w, y", W, "for q in range(0, y.size, 2):", "    y[q] = s")
        + "\n    for q in range(1, y.size, 2):\n        y[q] = 0.0",
    ),
    "backwards": (outputs("s, w, y", W, "for q in range(y.size - 1, -1, -1):", "    y[q] = s"),),
    "both triangles": (
        "def outputs_matrix(A, M):\n    for i in range(2):\n        M[i, i] = A[i, i]\n"
        "        for j in range(i + 1, 2):\n            M[i, j] = A[i, j]\n            M[j, i] = A[i, j]",
    ),
    "a shifted index": (outputs("s, w, y", W, "for q in range(1, y.size + 1):", "    y[q - 1] = s"),),
    "a counter that is changed": (
        outputs("s, w, y", W, "for q in range(1, y.size + 1):", "    q -= 1", "    y[q] = s"),
    ),
    "a size of its own": (outputs("s, w, y", W, "for q in range(int(s)):", "    y[q] = s"),),
    "a running sum": (
        outputs("u, w, y", W, "y[0] = u[0]", "for q in range(1, u.size):", "    y[q] = y[q - 1] + u[q]"),
    ),
    "a sum after a zero": (outputs("u, w, y", W, Y, "for q in range(u.size):", "    y[q] += u[q]"),),
    "in place as a whole": (outputs("u, w, y", W, Y, "y += u"),),
    "a method that writes": (outputs("s, w, y", W, "y.fill(s)"),),
    "a result of numpy": (outputs("u, w, y", W, "np.add(u, u, y)"),),
    "out=": (outputs("u, w, y", W, "np.multiply(u, 2.0, out=y)"),),
    "a helper by keyword": (outputs("s, w, y", W, "fill(value=s, array=y)"),),
    "a view of the output": (
        "def outputs_matrix(A, M):\n    for i in range(2):\n        row = M[i]\n        row[0] = A[i, 0]\n"
        "        row[1] = 1.0",
    ),
    "a helper writes a row": ("def outputs_matrix(A, M):\n    for i in range(2):\n        fill(M[i], A[i, 0])",),
    "elements one by one": (
        "def outputs_matrix(A, M):\n    M[0, 0] = M[1, 1] = 1.0\n    M[0, -1], M[1, 0] = A[0, 1], 0.0",
    ),
    "elements by branch": (
        "def outputs_matrix(A, M):\n    M[0, 0] = M[0, 1] = M[1, 0] = 0.0\n    if A[0, 0] > 0:\n        M[1, 1] = 1.0\n"
        "    else:\n        fill(M[1], 2.0)",
    ),
    "a local copy of a number": (outputs("s, w, y", W, "a = s", "a *= 2.0", "fill(y, a)"),),
    "an element as a number": (outputs("u, w, y", W, "a = u[0]", "a += 1.0", "fill(y, a)"),),
    "two in one": (outputs("u, w, y", W, "a, b = u[0], u[1]", "a += b", "fill(y, a)"),),
    "a number of a helper": (outputs("u, w, y", W, "a = first(u)", "a += 1.0", "fill(y, a)"),),
    "constants in a list": (outputs("s, w, y", W, Y, "for q in [0, 1]:", "    if q in (1, 2):", "        y[q] = s"),),
    "a tuple": (outputs("s, w, y", W, "a = (s, 2.0 * s)", "fill(y, a[1])"),),
    "a constant of the module": (outputs("s, w, y", W, "fill(y, TABLE[1] * s)"),),
    "exact functions of numpy": (outputs("s, w, y", W, "fill(y, np.sqrt(np.abs(s)) + np.square(s) + np.pi)"),),
    "functions of math": (outputs("s, w, y", W, "fill(y, math.tanh(s) + math.atan2(s, 1.0) + math.inf)"),),
    "types of numpy": (outputs("s, w, y", W, "fill(y, np.float64(np.int64(s)))"),),
    "annotations": (outputs("s: float, w, y: list[float]", W, "a: dict = s", "fill(y, a)"),),
    "a docstring with words": (outputs("s, w, y", '"""Return `y = print(x)`."""', W, Y),),
    "an assertion": (outputs("s, w, y", W, Y, 'assert s > 0.0, "too small"'),),
    "a shadowed built-in": (outputs("s, w, y", W, "sum = s", "fill(y, sum)"),),
    "what stays need not be written": ("def update(s, next_z):\n    if s > 0.0:\n        next_z[0] = s",),
    "a static method": (
        "@staticmethod\ndef helper(a):\n    return a",
        "@staticmethod\ndef update(s, next_z):\n    next_z[0] = s",
    ),
    "a private function": ("def _helper(a):\n    return a",),
    "time": (outputs("time, w, y", W, "fill(y, time)"),),
    "min and max": (outputs("u, s, w, y", W, "fill(y, min(max(s, u[0]), abs(s)) + int(s) + round(s))"),),
    "a work space read beside where it is written": (
        "def outputs(u, w, y):\n    for q in range(2):\n        y[q] = w[q - 1] if q > 0 else 0.0\n        w[q] = u[q]",
    ),
    "if True": (outputs("s, w, y", W, "if True:", f"    {Y}"),),
}


@pytest.mark.parametrize("case", CORRECT)
def test_a_correct_function_passes(tmp_path, case):
    found, _ = mistakes(tmp_path, source(*CORRECT[case]))
    assert [str(e) for e in found] == []


def _all(cls):
    for child in cls.__subclasses__():
        yield child
        yield from _all(child)


def test_every_function_of_the_libraries_passes():
    import blocks
    from tests import signal_blocks
    from tests.export import blocks_for_tests
    from tests.fmu import partners

    for child in pkgutil.iter_modules(blocks.__path__):
        importlib.import_module(f"blocks.{child.name}")
    homes = {signal_blocks.__name__, blocks_for_tests.__name__, partners.__name__}
    known = [c for c in _all(Block) if c.__module__ in homes or c.__module__.startswith("blocks.")]
    functions = [f for c in known for f in c.declaration.functions]
    assert len(known) >= 45 and len(functions) >= 68
    assert [str(m) for c in known for m in (*c.declaration.mistakes, *authors.mistakes(c.declaration))] == []
    assert all(inspect.isfunction(f.python) for f in functions)


def test_plain_python_may_do_what_compiled_code_cannot(tmp_path):
    free = outputs(
        "u, s, w, y", "w[0] = sum(u) + np.sinc(s)", "try:", "    a = {1: [s]}", "finally:", "    y[:] = a[1]"
    )
    assert mistakes(tmp_path, source(free, bases="(Block, compiled=False)"))[0] == []


@pytest.mark.parametrize(
    ("table", "name"),
    [
        (WRITES, "an input"),
        (WRITES, "a helper"),
        (REBINDS, "an output"),
        (RETURNS, "a number"),
        (UNWRITTEN, "if without else"),
        (UNWRITTEN, "read first"),
    ],
)
def test_plain_python_is_no_excuse(tmp_path, table, name):
    found, marked = mistakes(tmp_path, source(table[name][0], bases="(Block, compiled=False)"))
    assert any(re.search(table[name][1], e.message) and e.position.line == marked[0] for e in found)


def test_compiled_is_inherited(tmp_path):
    class Plain(Block, compiled=False):
        pass

    class Heir(Plain):
        pass

    class Compiled(Heir, compiled=True):
        pass

    assert [c.declaration.compiled for c in (Plain, Heir, Compiled)] == [False, False, True]


def test_without_its_source_a_function_is_read_from_its_bytecode():
    scope = {}
    text = "from cosim import Block, Input, Output\nclass Own(Block):\n    u = Input(start=1.0)\n    y = Output()\n"
    exec(text + "    def outputs(u, y):\n        y[0] = u\n", scope)
    values = np.zeros(1)
    scope["Own"].outputs(2.0, values)
    assert values[0] == 2.0
    with pytest.raises(DeclarationError, match="gives the name `y` to another value") as caught:
        exec(text + "    def outputs(u, y):\n        y = u\n", scope)
    assert caught.value.position.line == 6
    with pytest.raises(DeclarationError, match="returns a value"):
        exec(text + "    def outputs(u, y):\n        y[0] = u\n        return u\n", scope)


def test_a_class_of_its_own_is_checked_where_it_is_declared():
    with pytest.raises(DeclarationError, match=r"outputs\(\) gives the name `y`") as caught:

        class Own(Block):
            u = Input(start=1.0)
            y = Output()

            def outputs(u, y):
                y = u  # noqa: F841

    assert caught.value.position.file.endswith("test_authors.py")
