"""Algebraic loops by the directional derivatives of FMUs: fewer evaluations, the same figures, whatever an FMU answers.

The test FMU computes what `slopes.c` says of itself, from inputs that are its own outputs here. It counts calls.
"""

from __future__ import annotations

from contextlib import closing

import numpy as np
import pytest

from cosim.engine import compilation, program, run
from cosim.engine.probes import Probes
from cosim.engine.simulation import Simulation
from cosim.errors import BlockFailed, FmuFailed
from cosim.export.exporter import export_fmu
from cosim.wiring.network import Signal
from cosim.wiring.overview import describe
from tests.engine.test_newton import BLOCKS
from tests.fmu import slopes

ENGINES = ("native", "python")
KINDS = {
    "2 me": (2, "model-exchange", "me", ""),
    "3 me": (3, "model-exchange", "me", ""),
    "3 cs": (3, "co-simulation", "cs", 'hasEventMode="true"'),
}
ALONE = """
run: {{stop: 0.5, step: 0.1}}
blocks:
  one: {{fmu: {fmu}, inputs: {{u1: one.y1}}, parameters: {{{parameters}}}}}
"""
PAIR = ALONE.replace("u1: one.y1", "u1: one.y1, u2: one.y2")
TIME = 0.1 * np.arange(6)


@pytest.fixture(scope="module")
def fmus(tmp_path_factory):
    """The test FMU by kind, and `plain`, which promises no derivatives."""
    folder = tmp_path_factory.mktemp("slopes")
    made = {name: slopes.build(folder / name, version, *more) for name, (version, _, *more) in KINDS.items()}
    made["2 cs"] = slopes.build(folder / "2 cs", 2, "cs")
    made["plain"] = slopes.build(folder / "plain", 3, "me", provides=False)
    return made


@pytest.fixture
def solved(fmus, tmp_path, monkeypatch):
    """Run the test FMU that reads itself: its outputs, (time, output), and how often what was called."""

    def solve(kind: str, engine: str = "native", text: str = ALONE, **parameters):
        path, counts = tmp_path / "d.yaml", tmp_path / "counts"
        counts.unlink(missing_ok=True)
        monkeypatch.setenv("SLOPES_COUNTS", str(counts))
        written = ", ".join(f"{name}: {value!r}" for name, value in parameters.items())
        path.write_text(text.format(fmu=fmus[kind], parameters=written))
        return simulated(path, engine), slopes.counts(counts)

    return solve


def simulated(path, engine: str = "native") -> np.ndarray:
    """Run a diagram to its end, where the test FMU writes its counts: the outputs of `one`, (time, output)."""
    built = program.build(run.load(path), "jacobi")
    kernels = compilation.compile_program(built) if engine == "native" else None
    outputs = tuple(Signal("one", name) for name in ("y1", "y2"))
    with closing(Simulation(built, kernels, [Probes(outputs)])) as one:
        one.initialize()
        rows = [np.stack([s.values[y].copy() for y in outputs], axis=1) for (s,) in one.batches()]
    return np.concatenate(rows)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("k", [0.25, 4.0, -3.0])
def test_a_linear_loop_has_its_closed_form(solved, kind, k, engine):
    """y = k y + 1 + t."""
    y, counts = solved(kind, engine, K11=k, b1=1.0)
    np.testing.assert_allclose(y[:, 0], (1.0 + TIME) / (1.0 - k), rtol=1e-12)
    assert counts["GetDirectionalDerivative"] >= 6


@pytest.mark.parametrize("kind", [*KINDS, "2 cs"])
def test_two_unknowns_that_are_not_linear(solved, kind):
    """The residual is that of rounding, with fewer evaluations than differences need, and in both engines as many.

    FMI 2's Co-Simulation solves it at initialization, and has its delay then.
    """
    K = np.array([[0.5, -0.7], [1.2, 0.4]])
    given = {"K11": 0.5, "K12": -0.7, "K21": 1.2, "K22": 0.4, "a": 0.3, "b1": 1.0, "b2": -0.5}
    one, other = (solved(kind, engine, PAIR, **given) for engine in ENGINES)
    y, points = one[0], 1 if kind == "2 cs" else 6
    f = y @ K.T + 0.3 * np.cos(y) + np.outer(1.0 + TIME, [1.0, -0.5])
    np.testing.assert_allclose(f[:points], y[:points], rtol=0, atol=1e-13)
    assert y.tobytes() == other[0].tobytes()
    assert one[1] == other[1]
    assert one[1]["GetDirectionalDerivative"] >= 2 * points
    if kind == "3 me":
        plain, counts = solved("plain", text=PAIR, **given)
        np.testing.assert_allclose(plain, y, rtol=1e-13)
        assert counts["Get"] > one[1]["Get"]


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("kind", KINDS)
def test_outputs_that_are_rounded(solved, kind, engine):
    """y = y / 2 + 1 + t, rounded to 1e-6: of that, differences of 1e-8 see steps of a stair.

    What is found rounds to itself, so it is right up to half a step over 1 - 1/2.
    """
    y, _ = solved(kind, engine, K11=0.5, b1=1.0, q=1e-6)
    np.testing.assert_allclose(y[:, 0], 2.0 * (1.0 + TIME), rtol=0, atol=1e-6 + 1e-15)
    with pytest.raises(BlockFailed, match="no solution was found"):
        solved("plain", engine, K11=0.5, b1=1.0, q=1e-6)


@pytest.mark.parametrize("engine", ENGINES)
def test_where_no_rounded_figure_comes_back_that_is_said(solved, engine):
    """y = 1/3 - 3 y: of multiples of 1e-6, none is its own; 1/12 lies a third of a step beside one."""
    with pytest.raises(BlockFailed, match=r"does not come back to itself, but .e-0[67] away") as error:
        solved("3 me", engine, K11=-3.0, b1=1.0 / 3.0, q=1e-6)
    assert "look whether one, an FMU, computes no better than that" in error.value.fix


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("lie", [3.0, -1.0, 0.0, 1e10])
@pytest.mark.parametrize("k", [-3.0, 0.5, 1.0 / 3.0, 0.9])
def test_a_wrong_derivative_costs_evaluations_and_no_figure(solved, kind, k, lie, engine):
    """Also where it says that the loop is singular: 3 times 1/3 is 1."""
    y, _ = solved(kind, engine, K11=k, b1=1.0, lie=lie)
    np.testing.assert_allclose(y[:, 0], (1.0 + TIME) / (1.0 - k), rtol=1e-12)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("lie", [1.0, 3.0, 0.0])
@pytest.mark.parametrize(
    "given",
    [
        {"K11": 1.0},
        {"K12": 1.0, "K21": 1.0},
        {"K11": 0.5, "K12": 2.0, "K21": 0.125, "K22": 0.5, "b1": 2.0, "b2": -0.5},
    ],
)
def test_what_nothing_determines_is_told_whatever_derivatives_say(solved, kind, given, lie, engine):
    """y1 = y1; y1 = y2 and y2 = y1; and, of two equations, one that is a multiple of the other."""
    with pytest.raises(BlockFailed, match="undetermined at t = 0 s"):
        solved(kind, engine, PAIR, **given, lie=lie)


@pytest.mark.parametrize("engine", ENGINES)
def test_derivatives_know_of_a_rounded_output_that_nothing_determines_it(solved, engine):
    """y = y, rounded: every multiple of 1e-6 comes back, and near by nothing else does."""
    with pytest.raises(BlockFailed, match="undetermined at t = 0 s"):
        solved("3 me", engine, K11=1.0, q=1e-6)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("answer", ["discard", "error", "nan"])
@pytest.mark.parametrize("nth", [1, 4])
def test_who_refuses_once_is_not_asked_again(solved, kind, answer, nth, engine):
    given = {"K11": 0.3, "a": 1.0, "b1": 1.0, "answer": slopes.ANSWERS.index(answer), "nth": nth}
    y, counts = solved(kind, engine, **given)
    np.testing.assert_allclose(0.3 * y[:, 0] + np.cos(y[:, 0]) + 1.0 + TIME, y[:, 0], rtol=1e-13)
    assert counts["GetDirectionalDerivative"] == nth


@pytest.mark.parametrize("engine", ENGINES)
def test_a_fatal_answer_ends_the_run(solved, engine):
    with pytest.raises(FmuFailed, match=r"fmi3GetDirectionalDerivative\(\) returned `fatal`"):
        solved("3 cs", engine, K11=0.3, b1=1.0, answer=slopes.ANSWERS.index("fatal"))


def test_a_warning_is_counted(fmus, tmp_path):
    path = tmp_path / "d.yaml"
    given = f"K11: 0.3, b1: 1, answer: {slopes.ANSWERS.index('warning')}"
    path.write_text(ALONE.format(fmu=fmus["3 me"], parameters=given))
    outcome = run.Run(run.load(path)).execute()
    assert outcome.status == "completed"
    assert any("returned a warning, first at t = 0 s" in str(warning) for warning in outcome.warnings)


STAIR = """
run: {{stop: 0.5, step: 0.1}}
blocks:
  one: {{fmu: {fmu}, inputs: {{u1: half.y, on: over.y}}, parameters: {{{parameters}}}}}
  half: {{block: Gain, parameters: {{k: 0.5}}, inputs: {{u: one.y1}}}}
  over: {{python: {own}:Over, inputs: {{u: one.y1}}}}
"""
OVER = """
from cosim import Block, Input, Output

class Over(Block):
    u = Input()
    y = Output(dtype=bool)
    def outputs(u, y):
        y[0] = u > 1.25
"""


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("kind", ["3 cs"])
def test_inputs_that_are_no_real_numbers_are_held_along_tangents(solved, tmp_path, kind, engine):
    """y = y / 4 + 1 + t + (1 if y > 1.25), among blocks of ours."""
    (tmp_path / "own.py").write_text(OVER)
    y, counts = solved(kind, engine, STAIR.replace("{own}", str(tmp_path / "own.py")), K11=0.5, b1=1.0)
    np.testing.assert_allclose(y[:, 0], (2.0 + TIME) / 0.75, rtol=1e-12)
    assert counts["GetDirectionalDerivative"] > 0


# ---- FMUs of ours ----

RINGS = """
run: {{stop: 0.5, step: 0.1, method: {method}}}
fleets: {{m: 3}}
blocks:
  turned: {{fmu: {folder}/turned{version}.fmu, mode: {mode}, isolate: {isolate}, inputs: {{u: turned.y}}}}
  narrow: {{fmu: {folder}/narrow{version}.fmu, mode: {mode}, isolate: {isolate}, inputs: {{u: wide.y}}}}
  wide: {{python: {folder}/own.py:Widened, inputs: {{u: narrow.y}}}}
  line: {{fmu: {folder}/line{version}.fmu, mode: {mode}, isolate: {isolate}, per: m,
          parameters: {{k: "i - 2.5"}}, inputs: {{u: line.y}}}}
"""
CUT = """
run: {stop: 0.5, step: 0.1}
blocks:
  turned: {python: own.py:Transposed, dimensions: {n: 2, p: 2}, parameters: {k: 0.25}, start: {u: 0.0}}
  narrow: {python: own.py:Coarse, parameters: {k: -2.0, c: 1.0}, start: {u: 0.0}}
  line: {python: own.py:Line, start: {u: 0.0}}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Blocks as FMUs of both versions."""
    made = tmp_path_factory.mktemp("own")
    (made / "own.py").write_text(BLOCKS)
    (made / "cut.yaml").write_text(CUT)
    network = run.load(made / "cut.yaml")
    for version in "23":
        blocks = ("turned", "narrow", "line") if version == "3" else ("turned", "line")
        for block in blocks:
            export_fmu(network, [block], made / f"{block}{version}.fmu", f"{version}.0")
    return made


def drawn(folder, version: str, **settings):
    """The diagram of rings; FMI 2 has no numbers of single precision."""
    text = RINGS.format(folder=folder, version=version, **settings)
    if version == "2":
        text = "\n".join(line for line in text.split("\n") if "narrow" not in line)
    (folder / "d.yaml").write_text(text)
    return run.load(folder / "d.yaml")


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("isolate", ["true", "false"])
@pytest.mark.parametrize(
    ("version", "mode", "method"),
    [
        *[(v, "model-exchange", m) for v in "23" for m in ("jacobi", "joint")],
        *[("3", "co-simulation", m) for m in ("jacobi", "gauss-seidel", "iterated")],
    ],
)
def test_exported_blocks(folder, trajectories, version, mode, method, isolate, engine):
    """Matrices, members of a fleet, and single precision: y = y^T / 4 + i + 2 j, y = k y + 1, y = 0.8 - 2 y."""
    network = drawn(folder, version, mode=mode, method=method, isolate=isolate)
    rings = {name for ring in describe(network).loops for name in ring.derived}
    assert rings == ({"turned", "narrow", "line"} if version == "3" else {"turned", "line"})
    got = trajectories(network, "turned.y", "line.y", *(["narrow.y"] if version == "3" else []), engine=engine)
    added = np.array([[0.0, 1.0], [2.0, 3.0]])
    solution = (added + 0.25 * added.T) / (1.0 - 0.25**2)
    np.testing.assert_allclose(got["turned.y"], np.broadcast_to(solution, (6, 2, 2)), rtol=1e-12)
    k = np.arange(1, 4) - 2.5
    np.testing.assert_allclose(got["line.y"], np.broadcast_to(1.0 / (1.0 - k), (6, 3)), rtol=1e-12)
    if version == "3":
        np.testing.assert_allclose(got["narrow.y"], np.full(6, 0.8 / 3.0), rtol=16 * 2.0**-23)


@pytest.mark.parametrize("mode", ["model-exchange", "co-simulation"])
def test_both_engines_and_a_process_of_its_own_have_the_same_bits(folder, trajectories, mode):
    names = ("turned.y", "line.y", "narrow.y")
    bits = set()
    for isolate in ("true", "false"):
        network = drawn(folder, "3", mode=mode, method="jacobi", isolate=isolate)
        for engine in ENGINES:
            got = trajectories(network, *names, engine=engine)
            bits.add(b"".join(got[name].tobytes() for name in names))
    assert len(bits) == 1


# ---- of what an FMU is asked ----


def test_who_is_asked_stands_in_the_overview(fmus, tmp_path):
    """FMI 2's Co-Simulation solves a loop at initialization only; who promises no derivatives is not asked."""
    found = {}
    for kind, fmu in fmus.items():
        path = tmp_path / "d.yaml"
        path.write_text(ALONE.format(fmu=fmu, parameters="K11: 0.3"))
        found[kind] = [(ring.derived, ring.first) for ring in describe(run.load(path)).loops]
    asked = [(("one",), False)]
    assert found == {**dict.fromkeys(KINDS, asked), "2 cs": [(("one",), True)], "plain": [((), False)]}


def test_discrete_inputs_of_model_exchange_are_set_and_not_asked_for(fmus, tmp_path, monkeypatch):
    """Where one changes there is an event; at initialization it is an input like others."""
    edited = slopes.build(tmp_path / "edited", 3, "me", discrete=True)
    path, counts = tmp_path / "d.yaml", tmp_path / "counts"
    monkeypatch.setenv("SLOPES_COUNTS", str(counts))
    path.write_text(ALONE.format(fmu=edited, parameters="K11: 0.3, b1: 1"))
    assert [ring.derived for ring in describe(run.load(path)).loops] == [()]
    np.testing.assert_allclose(simulated(path)[:, 0], (1.0 + TIME) / 0.7, rtol=1e-12)
    asked = slopes.counts(counts)["GetDirectionalDerivative"]
    counts.unlink()
    path.write_text(ALONE.format(fmu=edited, parameters="K11: 0.3, b1: 1").replace("0.5", "1.0", 1))
    simulated(path)
    assert slopes.counts(counts)["GetDirectionalDerivative"] == asked > 0
