"""Random diagrams under all methods: compiled, interpreted, and by an independent simulation, to the last bit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from cosim.engine import run
from cosim.errors import AlgebraicLoop, DiagramErrors
from cosim.language.source import dump
from cosim.wiring.network import Loop
from tests import oracle

BLOCKS = Path(__file__).parents[1] / "oracle_blocks.py"
METHODS = ("jacobi", "gauss-seidel", "joint")
STEP, STEPS, MEMBERS = 0.125, 9, 3
NUMBERS = st.integers(-8, 8).map(lambda n: n / 8)
PORTS = {
    **{kind: ["y"] for kind in ("Wave", "Sum", "Drift", "Sampled", "Mean")},
    **{
        "Integral": ["x"],
        "Hold": ["z"],
        "Mixed": ["x"],
        "Leak": ["x", "y"],
        "Chain": ["x", "p", "y"],
        "Pair": ["x", "f", "h"],
    },
}
STATES = {"Integral": "x", "Leak": "x", "Chain": "x", "Pair": "x", "Hold": "z", "Sampled": "z", "Mixed": "xz"}
PARAMETERS = {
    "Wave": "fA",
    "Sum": "ab",
    "Drift": "a",
    "Leak": "ab",
    "Chain": "a",
    "Pair": "a",
    "Sampled": "a",
    "Mixed": "a",
}
INPUTS = {"Wave": "", "Sum": "uw"}


@st.composite
def diagrams(draw):
    """A diagram as YAML says it, and the same for the oracle."""
    fleet = draw(st.booleans())
    integrator, inner = draw(st.sampled_from(["euler", "rk4"])), draw(st.integers(1, 3))
    kinds = draw(st.lists(st.sampled_from([k for k in PORTS if fleet or k != "Mean"]), min_size=2, max_size=7))
    names = [f"b{n}" for n in range(len(kinds))]
    sources = [(n, port) for n, kind in zip(names, kinds, strict=True) for port in PORTS[kind]]
    of = dict(zip(names, kinds, strict=True))
    written, blocks = {}, []
    for name, kind in of.items():
        mapped = fleet and kind != "Mean"
        entry = {"python": f"{BLOCKS}:{kind}", **({"per": "robot"} if mapped else {})}
        parameters = {p: draw(NUMBERS) for p in PARAMETERS.get(kind, "")}
        start = {s: [draw(NUMBERS), draw(NUMBERS)] for s in STATES.get(kind, "")}
        wires, read = {}, {}
        for port in INPUTS.get(kind, "u"):
            arrays = [s for s in sources if fleet and of[s[0]] != "Mean"]
            if kind == "Mean" and not arrays:
                return None
            source = draw(st.sampled_from(arrays if kind == "Mean" else sources))
            if mapped and of[source[0]] != "Mean" and draw(st.integers(0, 3)) == 0:  # two parts, the other way round
                wires[port] = [f"{source[0]}.{source[1]}[2..3]", f"{source[0]}.{source[1]}[1]"]
                read[port] = [(*source, slice(1, 3)), (*source, 0)]
            else:
                wires[port], read[port] = ".".join(source), [(*source, None)]
        for section, content in (("parameters", parameters), ("start", start), ("inputs", wires)):
            if content:
                entry[section] = content
        if mapped and parameters:  # each member has its own
            entry["parameters"] = {p: f"({value}) * i" for p, value in parameters.items()}
            numbers = np.arange(1.0, MEMBERS + 1)[:, None]
            parameters = {p: value * numbers for p, value in parameters.items()}
        block = oracle.Block(name, kind, parameters, read, MEMBERS if mapped else 0)
        block.integrator, block.inner_steps = integrator, inner
        shape = (MEMBERS, 2) if mapped else (2,)
        for state, value in start.items():
            setattr(block, state, np.broadcast_to(np.array(value), shape).copy())
        if kind in ("Hold", "Sampled", "Mixed"):
            block.every = draw(st.integers(1, 3))
            entry["period"] = block.every * STEP
        if block.turns and draw(st.integers(0, 3)) == 0:
            block.integrator, block.inner_steps = draw(st.sampled_from(["euler", "rk4"])), draw(st.integers(1, 2))
            entry["integrator"], entry["inner_steps"] = block.integrator, block.inner_steps
        written[name] = entry
        blocks.append(block)
    settings_ = {"stop": STEP * STEPS, "step": STEP, "integrator": integrator, "inner_steps": inner}
    return {"run": settings_, "fleets": {"robot": MEMBERS}, "blocks": written}, blocks, sources


def simulated(blocks, sources, content, method):
    """What the oracle says, on blocks of its own."""
    copies = [oracle.Block(**{**vars(b), "x": b.x if b.x is None else b.x.copy()}) for b in blocks]
    run_settings = content["run"]
    one = oracle.Oracle(copies, STEP, method, run_settings["integrator"], run_settings["inner_steps"])
    return one.run(STEPS, sources)


def check(path, trajectories, drawn):
    """All methods and engines against the oracle; returns whether the diagram could be run."""
    content, blocks, sources = drawn
    for method in METHODS:
        entries = content["blocks"]
        if method == "joint":  # a block's own integrator goes with the other methods only
            own = ("integrator", "inner_steps")
            entries = {n: {k: v for k, v in entry.items() if k not in own} for n, entry in entries.items()}
        path.write_text(dump({**content, "run": {**content["run"], "method": method}, "blocks": entries}))
        try:
            network = run.load(path)
        except DiagramErrors as error:
            assert all(isinstance(e, AlgebraicLoop) for e in error.errors), error
            return False
        if any(isinstance(item, Loop) for item in network.evaluation):
            return False  # the oracle knows no algebraic loops, which test_loops.py compares with linear algebra
        expected = simulated(blocks, sources, content, method)
        for engine in ("native", "python"):
            got = trajectories(network, *(".".join(s) for s in sources), engine=engine)
            for signal, values in expected.items():
                same = got[".".join(signal)]
                assert same.shape == values.shape
                np.testing.assert_array_equal(same, values, err_msg=f"{signal} {method} {engine}\n{path.read_text()}")
    return True


@pytest.mark.parametrize("part", range(2))
@given(drawn=diagrams())
@settings(
    max_examples=100,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow, HealthCheck.filter_too_much],
)
def test_any_diagram_does_what_the_methods_definition_says(tmp_path, trajectories, part, drawn):
    if drawn:
        check(tmp_path / "any.yaml", trajectories, drawn)
