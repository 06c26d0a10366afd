"""Random programs over arrays: what is not refused gives numpy's figures, whatever stands for the same memory."""

import importlib.util
import random

import numpy as np
import pytest

from cosim.authoring.block import mistakes_wait
from cosim.authoring.lowering.block_functions import refusals
from tests.authoring import test_arrays

HELPERS = """
def h1(x, s):
    y = x * s
    y[0] = s
    return y


def h2(M):
    return M @ M.T + M


def h3(a, b):
    return a + b, np.sum(a), b * 1.0


def h4(M, x):
    if x[0] > 0.0:
        return M @ x
    return x - M[0]


def h5(out, x):
    out[:] = x[::-1]


"""
VECTORS = "{v} + {v}|{v} - {v}|{v} * {n}|{m} @ {v}|{v} @ {m}|{v}[::-1]|{m}[1]|{m}[:, -1]|np.array([{n}, {n}, 1.0])"
VECTORS += "|np.where({v} > {v}, {v}, 0.5)|np.sum({m}, axis=0)|h1({v}, {n})|h4({m}, {v})|np.cross({v}, {v})"
VECTORS += "|np.concatenate(({v}[:1], {v}[1:]))|np.clip({v}, -1.0, {n})|{v}.copy()|-{v}"
MATRICES = "{m}.T|{m} - {m}|{m} @ {m}|np.outer({v}, {v})|{v}[:, None] * {v}|np.array([{v}, {v}, {v}])|h2({m})"
NUMBERS = "{v}[1]|np.sum({v})|{v} @ {v}|np.max({v})|{m}[0, 2]|({n} if {n} > {n} else {n})"
GROWN = {"v": VECTORS.split("|"), "m": MATRICES.split("|"), "n": NUMBERS.split("|")}
LEAVES = {"v": ["u", "w", "e", "f", "g"], "m": ["A", "B", "C"], "n": ["k", "0.5", "2.0", "t"]}
STATEMENTS = "e = {v}|f = {v}|g = {v}|C = {m}|t = {n}|y[:] = {v}|e += {v}|f *= {n}|y -= {v}|g[0] = {n}|e[1:] = {v}[:2]"
STATEMENTS += "|f[:2] += {v}[1:]|C[1, :] = {v}|C[:, 2] = {v} * 1.0|e, f = {v}, {v}|e, t, g = h3({v}, {v})|h5(f, {v})"
STATEMENTS += "|y[-2:] = {v}[:2]|e, f = f, e"


class Author:
    """Writes programs."""

    def __init__(self, seed):
        self.random = random.Random(seed)  # noqa: S311  # a program is no secret

    def grown(self, text, depth=0):
        """A text with expressions in its places."""
        while (at := text.find("{")) >= 0:
            kind = text[at + 1]
            leaf = depth > 2 or self.random.random() < 0.35
            part = self.random.choice(LEAVES[kind]) if leaf else f"({self.grown(self.choice(kind), depth + 1)})"
            text = f"{text[:at]}{part}{text[at + 3 :]}"
        return text

    def choice(self, kind):
        return self.random.choice(GROWN[kind])

    def body(self, indent=2, depth=0):
        """Some statements, loops and branches among them."""
        lines = []
        for _ in range(self.random.randrange(2, 6)):
            kind = self.random.random()
            if depth < 2 and kind < 0.12:
                lines += [f"{'    ' * indent}for i{depth} in range(3):", *self.body(indent + 1, depth + 1)]
            elif depth < 2 and kind < 0.24:
                lines += [f"{'    ' * indent}if {self.grown('{n} > {n}')}:", *self.body(indent + 1, depth + 1)]
            else:
                lines.append("    " * indent + self.grown(self.random.choice(STATEMENTS.split("|"))))
        return lines


def block_text(seed, count):
    text = test_arrays.HEAD.replace("class Cases", HELPERS + "class Cases")
    first = ["y[:] = 0.0", "t = k * 1.0", "e = u * 1.0", "f = w - u", "g = u + w", "C = A + B"]
    author = Author(seed)
    for n in range(count):
        text += f"    y{n} = Output(3)\n    def outputs_{n}({test_arrays.ARGUMENTS}, y{n}):\n        y = y{n}\n"
        text += "\n".join(["        " + line for line in first] + author.body()) + "\n"
        text += "        y[:] = y + e + 2.0 * f - g + C[0] + C[:, 1] * t\n"
    return text


@pytest.mark.parametrize("seed", range(2))
def test_programs_give_what_numpy_gives(tmp_path, seed):
    (tmp_path / "programs.py").write_text(block_text(seed, 40))
    spec = importlib.util.spec_from_file_location("programs", tmp_path / "programs.py")
    module = importlib.util.module_from_spec(spec)
    with mistakes_wait():
        spec.loader.exec_module(module)
    declaration = module.Cases.declaration
    compared = 0
    for function in declaration.functions:
        refused, _ = refusals(declaration, function, complete=True)
        assert all("another name for memory" in refusal.what for _, refusal in refused), [r.what for _, r in refused]
        if refused:
            continue
        with np.errstate(all="ignore"):
            wanted = test_arrays.run_as_numpy_does(function, declaration)
        size = np.max(np.abs(wanted))
        if np.isfinite(size) and size < 1e6:  # what has not grown, of which rounding errors are known
            found = test_arrays.run_interpreted(declaration, function)
            np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-9 * (1.0 + size), err_msg=function.name)
            compared += 1
    assert compared > 10
