"""What is exchanged with an FMU: only what somebody wires, records or measures, in one call for each type.

The test FMU counts the calls of its functions, as its process sees them.
"""

from __future__ import annotations

import numpy as np
import pytest

from cosim.engine import run
from tests.fmu import feedthrough

STEPS = 20
KINDS = {
    "2 cs": (2, "co-simulation", ""),
    "3 cs": (3, "co-simulation", ""),
    "3 events": (3, "co-simulation", feedthrough.EVENTFUL),
    "2 me": (2, "model-exchange", 'completedIntegratorStepNotNeeded="true"'),
    "3 me": (3, "model-exchange", ""),
}
DIRECT = ["3 events", "2 me", "3 me"]
CODE = """
import math

from cosim import Block, Input, Output


class Source(Block):
    u1 = Output()
    u2 = Output()
    u3 = Output()
    i1 = Output(dtype=int)
    i2 = Output(dtype=int)
    b1 = Output(dtype=bool)
    b2 = Output(dtype=bool)
    a = Output(4)

    def outputs(time, u1, u2, u3, i1, i2, b1, b2, a):
        n = int(time * 10.0 + 0.5)
        u1[0] = math.sin(time)
        u2[0] = math.cos(time)
        u3[0] = float(n // 3)
        i1[0] = n
        i2[0] = -n
        b1[0] = n % 2 == 0
        b2[0] = n % 3 == 0
        for j in range(4):
            a[j] = float(j) + time


class Sum(Block):
    u = Input()
    v = Input()
    y = Output()

    def outputs(u, v, y):
        y[0] = u + 2.0 * v
"""
REAL, INTEGER = {2: "Real", 3: "Float64"}, {2: "Integer", 3: "Int64"}


@pytest.fixture(scope="module")
def fmus(tmp_path_factory):
    """The test FMU by kind."""
    folder = tmp_path_factory.mktemp("feedthrough")
    return {
        kind: feedthrough.build(folder / kind.replace(" ", ""), version, "me" if "me" in kind else "cs", flags)
        for kind, (version, _, flags) in KINDS.items()
    }


@pytest.fixture
def counted(write, tmp_path, monkeypatch):
    """Run a diagram in steps of 0.1 s; `type: Source` and `type: Sum` are blocks. Returns outcome and counts."""
    calls = tmp_path / "counts"
    monkeypatch.setenv("FEEDTHROUGH_COUNTS", str(calls))
    code = write(CODE, "blocks_here.py")

    def once(blocks: str, signals: str = "", *settings: str, engine: str = "native"):
        calls.unlink(missing_ok=True)
        text = f"run: {{stop: {STEPS / 10}, step: 0.1}}\n{blocks}\nrecord: {{period: 0.1, signals: [{signals}]}}\n"
        path = write(text.replace("type: ", f"python: {code}:"), "counted.yaml")
        outcome = run.Run(run.load(path, settings), engine).execute()
        assert outcome.status == "completed", outcome.error
        return feedthrough.counts(calls)

    return once


@pytest.mark.parametrize("kind", KINDS)
def test_what_nobody_looks_at_is_not_exchanged(counted, fmus, kind):
    """Neither outputs, nor inputs that hold a start value."""
    version = KINDS[kind][0]
    blocks = f"blocks:\n  source: {{type: Source}}\n  plant: {{fmu: {fmus[kind]}, inputs: {{u1: source.u1}}}}"
    calls = counted(blocks, "plant.u1_out")
    touched = {name for name in calls if name.startswith(("Set", "Get"))}
    assert touched == {f"Set{REAL[version]}", f"Get{REAL[version]}"}
    unseen = counted(blocks)
    assert {name for name in unseen if name.startswith("Get")} == set()
    if "me" not in kind:
        assert unseen["DoStep"] == STEPS
    started = counted(blocks.replace("inputs:", "start: {i1: 3}, inputs:"))
    assert started[f"Set{INTEGER[version]}"] == 1


@pytest.mark.parametrize("kind", KINDS)
def test_one_call_for_each_type(counted, fmus, kind):
    """At each of the n + 1 communication points one getter and two setters: for the outputs, and before the step.

    Model Exchange has three, as discrete inputs have changed, which wait for Event Mode: continuous ones, then both. At
    the beginning, each output is got once after its own inputs, and all inputs are set as that ends; with event mode,
    once more after the first event.
    """
    version, names = KINDS[kind][0], feedthrough.INPUTS
    wires = ", ".join(f"{name}: source.{name}" for name in names)
    calls = counted(
        f"blocks:\n  source: {{type: Source}}\n  plant: {{fmu: {fmus[kind]}, inputs: {{{wires}}}}}",
        ", ".join(f"plant.{feedthrough.output(name)}" for name in names),
    )
    for types, count in ((REAL, 3), (INTEGER, 2), ({2: "Boolean", 3: "Boolean"}, 2)):
        again = 1 if "events" in kind else 0
        assert STEPS + 1 <= calls[f"Get{types[version]}"] <= STEPS + 1 + count + again, types
        setters = 3 if "me" in kind else 2
        assert calls[f"Set{types[version]}"] <= setters * (STEPS + 1) + count + setters, types


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("isolated", ["false", "true"])
@pytest.mark.parametrize("kind", KINDS)
def test_values_of_all_types_arrive(write, fmus, trajectories, kind, isolated, engine):
    """Packed side by side, of each member of a fleet; plain Co-Simulation shows them a step later."""
    version = KINDS[kind][0]
    code = write(CODE, "blocks_here.py")
    names = [name for name in feedthrough.ALL[version] if name[0] not in "fs"]
    more = ["f1", "f2", "s1", "s2"] if version == 3 else []
    wires = ", ".join([f"{n}: source.{n}" for n in names] + [f"{n}: still.{feedthrough.output(n)}" for n in more])
    text = f"""
        run: {{stop: 2, step: 0.1}}
        fleets: {{robot: 3}}
        blocks:
          source: {{python: {code}:Source, per: robot}}
          still: {{fmu: {fmus[kind]}, per: robot, start: {{STARTS}}}}
          plant:
            fmu: {fmus[kind]}
            isolate: {isolated}
            per: robot
            inputs: {{{wires}}}
        """
    starts = 'f1: "i/2", f2: "-i/4", s1: "i-100", s2: "i+100"' if version == 3 else "u1: 2"
    network = run.load(write(text.replace("STARTS", starts)))
    every = [*names, *more]
    got = trajectories(
        network, *(f"source.{n}" for n in names), *(f"plant.{feedthrough.output(n)}" for n in every), engine=engine
    )
    late = 0 if kind in DIRECT else 1
    for name in names:
        there, here = got[f"source.{name}"], got[f"plant.{feedthrough.output(name)}"]
        assert np.array_equal(here[late:], there[: len(there) - late]), name
        assert np.array_equal(here[0], there[0]), name
    if version == 3:
        member = np.arange(1, 4)
        for name, value in (("f1", member / 2), ("f2", -member / 4), ("s1", member - 100), ("s2", member + 100)):
            assert np.array_equal(got[f"plant.{feedthrough.output(name)}"][2:], np.broadcast_to(value, (19, 3))), name


@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel"])
@pytest.mark.parametrize("kind", DIRECT)
def test_outputs_that_wait_for_each_other_are_not_got_together(write, fmus, trajectories, kind, method):
    """y = u1 + 2 u2 through five blocks and two FMUs, each of which comes before and after the other."""
    code, fmu, mode = write(CODE, "blocks_here.py"), fmus[kind], KINDS[kind][1]
    text = f"""
        run: {{stop: 2, step: 0.1, method: {method}}}
        blocks:
          last: {{python: {code}:Sum, inputs: {{u: one.u3_out, v: two.u2_out}}}}
          one: {{fmu: {fmu}, mode: {mode}, inputs: {{u1: source.u1, u2: two.u1_out, u3: first.y}}}}
          first: {{python: {code}:Sum, inputs: {{u: two.u3_out, v: one.u2_out}}}}
          two: {{fmu: {fmu}, mode: {mode}, inputs: {{u1: one.u1_out, u2: first.y, u3: source.u2}}}}
          source: {{python: {code}:Source}}
        """
    network = run.load(write(text))
    got = trajectories(network, "source.u1", "source.u2", "first.y", "last.y")
    first = got["source.u2"] + 2.0 * got["source.u1"]
    assert np.array_equal(got["first.y"], first)
    assert np.array_equal(got["last.y"], first + 2.0 * first)


def test_an_algebraic_loop_through_one_of_several_outputs_is_solved(write, fmus, trajectories):
    """y = u2 + 2 (y_1) with y_1 = -y/4 by another block: y = u2 - y/2, so y = 2/3 u2."""
    code, fmu = write(CODE, "blocks_here.py"), fmus["3 events"]
    quarter = write(
        "from cosim import Block, Input, Output\n\n\nclass Quarter(Block):\n    u = Input()\n    y = Output()\n\n"
        "    def outputs(u, y):\n        y[0] = -0.25 * u\n",
        "quarter.py",
    )
    text = f"""
        run: {{stop: 2, step: 0.1}}
        blocks:
          source: {{python: {code}:Source}}
          sum: {{python: {code}:Sum, inputs: {{u: plant.u2_out, v: less.y}}}}
          plant: {{fmu: {fmu}, inputs: {{u1: sum.y, u2: source.u2, u3: source.u3}}}}
          less: {{python: {quarter}:Quarter, inputs: {{u: plant.u1_out}}}}
        """
    got = trajectories(run.load(write(text)), "source.u2", "sum.y", "plant.u3_out", "source.u3")
    assert got["sum.y"] == pytest.approx(got["source.u2"] * 2.0 / 3.0, rel=1e-12, abs=1e-12)
    assert np.array_equal(got["plant.u3_out"], got["source.u3"])
