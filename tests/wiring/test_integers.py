"""Integers of FMI 2 take the type of the ports that they are wired to, in whatever order the blocks stand."""

from __future__ import annotations

import re
from itertools import permutations

import numpy as np
import pytest

from cosim.engine import run
from cosim.errors import WrongDataType
from tests.fmu import machine

BLOCKS = {
    "one": "{{fmu: {fmu}, inputs: {{n: source.n}}}}",
    "two": "{{fmu: {fmu}, inputs: {{n: one.m}}}}",
    "three": "{{fmu: {fmu}, inputs: {{n: two.m}}}}",
    "sink": "{{type: Taker, inputs: {{n: two.m}}}}",
    "source": "{{type: Giver}}",
}
CODE = """
from cosim import Block, Input, Output


class Giver(Block):
    n = Output(dtype=int)

    def outputs(time, n):
        n[0] = int(time * 10.0 + 0.5)


class Taker(Block):
    n = Input(dtype=int)
    m = Output(dtype=int)

    def outputs(n, m):
        m[0] = n
"""


@pytest.fixture(scope="module")
def fmu(tmp_path_factory):
    return machine.build(tmp_path_factory.mktemp("integers"), 2)


@pytest.fixture
def wire(write, fmu):
    """Wire the blocks of these names, in this order."""

    def wire_blocks(*names: str, **other: str):
        code = write(CODE, "integers.py")
        blocks = {**BLOCKS, **other}
        rows = "".join(f"\n  {name}: {blocks[name].format(fmu=fmu)}" for name in names)
        text = f"run: {{stop: 0.5, step: 0.1}}\nblocks:{rows}\n".replace("type: ", f"python: {code}:")
        return run.load(write(text, "chain.yaml"))

    return wire_blocks


def test_a_net_has_one_type_whatever_the_order(wire):
    wide = {("one", "n"), ("two", "m"), ("three", "n")}  # as the blocks at the other ends
    for names in permutations(BLOCKS):
        components = wire(*names).components
        for name in ("one", "two", "three"):
            for port in "nm":
                expected = np.int64 if (name, port) in wide else np.int32
                assert components[name].declaration.variables[port].dtype == expected, (names, name, port)


def test_what_no_wire_says_is_an_integer_of_32_bits(wire):
    components = wire("one", "two", "three", one="{{fmu: {fmu}}}").components
    assert {components[n].declaration.variables[v].dtype for n in components for v in "nm"} == {np.dtype(np.int32)}


def test_values_pass_through_the_chain(wire, trajectories):
    """FMI 2's Co-Simulation shows n + 1 one step later, three times."""
    for names in (("three", "sink", "two", "one", "source"), tuple(BLOCKS)):
        got = trajectories(wire(*names), "source.n", "sink.m", "three.m")
        assert np.array_equal(got["source.n"].ravel(), np.arange(6))
        assert np.array_equal(got["three.m"].ravel()[3:], got["source.n"].ravel()[:3] + 3)
        assert np.array_equal(got["sink.m"].ravel()[2:], got["source.n"].ravel()[:4] + 2)


def test_two_types_on_one_net_are_refused_alike(write, fmu, tmp_path):
    """FMI 3's Int32 and a block's int64 at one output of FMI 2."""

    def narrow(xml):
        return re.sub(r"<Int64 (name=.n. [^>]*)></Int64>", r"<Int32 \1></Int32>", xml)

    three = machine.build(tmp_path, 3, edit=narrow)
    code = write(CODE, "integers.py")
    rows = [
        f"a: {{fmu: {fmu}}}",
        f"b: {{fmu: {three}, inputs: {{n: a.m}}}}",
        f"c: {{python: {code}:Taker, inputs: {{n: a.m}}}}",
    ]
    messages = set()
    for order in permutations(rows):
        text = "run: {stop: 0.5, step: 0.1}\nblocks:\n" + "".join(f"  {row}\n" for row in order)
        with pytest.raises(Exception, match=r"input `n` is int32, but a\.m is int64") as caught:
            run.load(write(text, "net.yaml"))
        (error,) = caught.value.errors
        assert isinstance(error, WrongDataType)
        messages.add(error.message)
    assert len(messages) == 1
