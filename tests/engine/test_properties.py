"""Any valid diagram runs alike compiled and interpreted; any mutation of one runs or ends in a typed error."""

import contextlib
import io
import re

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from cosim.engine import run
from cosim.errors import AlgebraicLoop, BlockFailed, CosimError, DiagramErrors
from cosim.terminal import cli
from cosim.wiring import order
from cosim.wiring.network import Loop
from tests.conftest import BLOCKS

SLOW = {"suppress_health_check": [HealthCheck.function_scoped_fixture, HealthCheck.too_slow]}
NUMBERS = st.floats(-2, 2, allow_nan=False).map(lambda x: round(x, 3))


@st.composite
def diagrams(draw):
    """Up to six blocks of two channels, wired at random, mapped over a fleet or not."""
    method = draw(st.sampled_from(["jacobi", "gauss-seidel", "joint"]))
    integrator = draw(st.sampled_from(["euler", "rk4"]))
    inner = draw(st.integers(1, 3))
    per = draw(st.booleans())
    lines = [f"run: {{stop: 0.2, step: 0.02, method: {method}, integrator: {integrator}, inner_steps: {inner}}}"]
    lines += ["fleets: {robot: 3}", "blocks:"]
    kinds = ["Sine", *draw(st.lists(st.sampled_from(["Lag", "Gain", "Integrator"]), min_size=1, max_size=5))]
    ports = {"Sine": ["y"], "Lag": ["x", "y"], "Gain": ["y"], "Integrator": ["x"]}
    sources = [f"b{n}.{port}" for n, kind in enumerate(kinds) for port in ports[kind]]
    for n, kind in enumerate(kinds):
        entry = {"python": f"{BLOCKS}:{kind}", **({"per": "robot"} if per else {})}
        if kind == "Sine":
            entry["parameters"] = {"f": draw(NUMBERS), "A": draw(NUMBERS)}
        else:
            entry["inputs"] = {"u": draw(st.sampled_from(sources))}
            entry["dimensions"] = {"n": 2}
        if kind == "Gain":
            entry["parameters"] = {"k": draw(NUMBERS)}
        if kind in ("Lag", "Integrator"):
            entry["start"] = {"x": [draw(NUMBERS), draw(NUMBERS)]}
        lines.append(f"  b{n}: {entry}".replace("'", '"'))
    return "\n".join(lines), sources


@given(diagrams())
@settings(max_examples=80, **SLOW)
def test_compiled_and_interpreted_agree_on_any_diagram(tmp_path, trajectories, diagram):
    text, names = diagram
    path = tmp_path / "any.yaml"
    path.write_text(text)
    try:
        network = run.load(path)
    except DiagramErrors as error:
        assert all(isinstance(e, AlgebraicLoop) for e in error.errors), error
        return
    try:
        compiled = trajectories(network, *names, engine="native")
    except BlockFailed as failed:  # a loop without a solution, or with many
        assert "the algebraic loop of" in failed.message
        with pytest.raises(BlockFailed, match=re.escape(failed.message)):
            trajectories(network, *names, engine="python")
        return
    interpreted = trajectories(network, *names, engine="python")
    for name in names:
        assert compiled[name].tobytes() == interpreted[name].tobytes(), name
        assert np.isfinite(compiled[name]).all()


@given(diagrams())
@settings(max_examples=80, **SLOW)
def test_evaluation_order_puts_writers_before_readers(tmp_path, diagram):
    path = tmp_path / "any.yaml"
    path.write_text(diagram[0])
    try:
        network = run.load(path)
    except DiagramErrors:
        return
    place = {
        (t.component, t.function): k
        for k, item in enumerate(order.evaluation_order(network))
        for t in order.flat([item])
    }
    looped = {(t.component, t.function) for item in network.evaluation if isinstance(item, Loop) for t in item.tasks}
    for component in network.components.values():
        for function in component.declaration.kind("outputs"):
            for name in set(function.reads) & set(component.wires):
                source = component.wires[name][0]
                writer = network.components[source.component].declaration.writer(source.variable)
                if writer:
                    first, then = place[source.component, writer.name], place[component.name, function.name]
                    assert first < then or (first == then and (component.name, function.name) in looped)


VALID = f"""title: mutated
run: {{stop: 0.1, step: 0.01, method: jacobi}}
fleets: {{robot: 2}}
blocks:
  source: {{python: "{BLOCKS}:Sine", per: robot, parameters: {{f: [1, 2], A: "i/2"}}}}
  lag:
    python: {BLOCKS}:Lag
    per: robot
    parameters: {{T: 0.5}}
    start: {{x: [[0, 1], [2, 3]]}}
    inputs: {{u: source.y}}
    integrator: rk4
  average: {{python: "{BLOCKS}:Average", inputs: {{u: lag.y}}}}
record: {{period: 0.02, signals: [lag.x, average.number]}}
metrics:
  largest: {{signal: lag.x, reduce: max, from: 0.05}}
"""
TOKENS = [
    "0",
    "-1",
    "1e308",
    "nan",
    "[]",
    "{}",
    "~",
    "'",
    "lag",
    "robot",
    "x",
    ":",
    ",",
    "\t",
    "[[1]]",
    "i",
    "1/0",
    "9" * 40,
]


@st.composite
def mutations(draw):
    """The valid diagram with a line or a word deleted, doubled or replaced, up to three times."""
    text = VALID
    for _ in range(draw(st.integers(1, 3))):
        lines = text.split("\n")
        n = draw(st.integers(0, len(lines) - 1))
        words = lines[n].split(" ")
        w = draw(st.integers(0, len(words) - 1))
        match draw(st.sampled_from(["drop line", "double line", "drop word", "double word", "replace word"])):
            case "drop line":
                del lines[n]
            case "double line":
                lines.insert(n, lines[n])
            case "drop word":
                lines[n] = " ".join(words[:w] + words[w + 1 :])
            case "double word":
                lines[n] = " ".join([*words[: w + 1], *words[w:]])
            case _:
                words[w] = draw(st.sampled_from(TOKENS))
                lines[n] = " ".join(words)
        text = "\n".join(lines)
    return text


@given(mutations())
@settings(max_examples=800, **SLOW)
def test_any_mutation_runs_or_ends_in_a_typed_error(tmp_path, text):
    path = tmp_path / "mutated.yaml"
    path.write_text(text)
    try:
        network = run.load(path)
    except CosimError as error:
        assert str(error)
        return
    if network.diagram.run.steps > 1000 or len(network.components) == 0:
        return
    outcome = run.Run(network, output=tmp_path / "mutated.nc").execute()
    assert outcome.status in ("completed", "diverged", "failed")
    assert (outcome.error is None) == (outcome.status == "completed")


def test_the_unmutated_diagram_completes(tmp_path):
    path = tmp_path / "valid.yaml"
    path.write_text(VALID)
    with contextlib.redirect_stdout(io.StringIO()):
        assert cli.main(["run", str(path), "-o", str(tmp_path / "valid.nc")]) == 0
