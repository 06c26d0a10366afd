"""The pieces of compiled code: each helper is compiled once, and linked once into whatever calls it."""

import re

from cosim.compiling import compiler, linking
from cosim.compiling.adapters import raw_source
from cosim.machine.memory import words_at


def lowest(address, index):
    return words_at(address, 64)[index]


def left(address, flag):
    return lowest(address, 1) + lowest(address, 2) + (1 if flag else 0)


def right(address, flag):
    return lowest(address, 3) - left(address, True) - (1 if flag else 0)


def both(time, address, frame):
    return left(address, False) + right(address, True) + lowest(frame, 4)


def test_a_helper_is_compiled_once_and_linked_once_whoever_calls_it_with_whatever_constants(monkeypatch):
    linked = []
    shared = linking._shared
    monkeypatch.setattr(linking, "_shared", lambda module: linked.append(str(module)) or shared(module))
    ir = compiler.compile_ir("pieces", [raw_source("engine", both)])
    for name in ("lowest", "left", "right"):
        symbol = rf"^define [^\n]*{name}[^\n]*i64"
        assert len(re.findall(symbol, ir, re.MULTILINE)) == 1, name
        assert sum(bool(re.search(symbol, text, re.MULTILINE)) for text in linked) == 1, name
