"""Directional derivatives of exported FMUs have their closed forms, and leave the instance as it was."""

from __future__ import annotations

import math
import zipfile

import numpy as np
import pytest
from fmpy import read_model_description
from fmpy.fmi1 import FMICallException
from lxml import etree

from cosim.engine import run
from cosim.export.exporter import export_fmu
from tests.engine.test_loops import BLOCKS as LOOPED
from tests.fmu.fmu_host import Host

VERSIONS = ("2.0", "3.0")
RELATIVE = 2.0**-13  # of a known's size, see derivatives.c
EPS = 2.0**-52
OWN = '''
import math
from cosim import Block, CalculatedParameter, Input, Local, Output, Parameter, State

class Swing(Block):
    """Smooth, with all kinds of variables."""
    u = Input(2)
    far = Input(start=1e6, nominal=1e6)
    q = State(output=True)
    w = State(nominal=0.01)
    g = Parameter(default=9.81, min=9.81)
    scaled = CalculatedParameter()
    y = Output(2)
    big = Output()
    product = Local()
    def calculate(g, scaled):
        scaled[0] = g * g
    def outputs(u, q, time, y):
        y[0] = math.exp(u[0]) * math.sin(q) + time * time
        y[1] = u[0] * u[1] + q * q * q
    def outputs_big(far, big, product):
        product[0] = far * far
        big[0] = far * far
    def derivatives(w, q, u, g, scaled, d_q, d_w):
        d_q[0] = w
        d_w[0] = -g * math.sin(q) + u[1] + 1e-3 * scaled

class Edge(Block):
    u = Input(start=0.0)
    v = Input(start=0.0)
    y = Output()
    z = Output()
    def outputs(u, y):
        if u < 0.0:
            raise ValueError("negative")
        y[0] = u * math.sqrt(u) + u
    def outputs_z(v, z):
        z[0] = 3.0 * v + math.sqrt(-v) * v * v

class Point(Block):
    u = Input(start=0.0)
    y = Output()
    def outputs(u, y):
        if u != 0.0:
            raise ValueError("nowhere else")
        y[0] = 0.0

class Single(Block):
    u = Input(dtype="float32", start=0.5)
    n = Input(dtype=int, start=2)
    y = Output(dtype="float32")
    z = Output()
    def outputs(u, n, y, z):
        y[0] = u * u * u
        z[0] = n * u

class Scaled(Block):
    large = Input(start=1e6)
    small = Input(start=0.0, nominal=1e-3)
    y = Output()
    z = Output()
    def outputs(large, small, y, z):
        y[0] = large * large * large
        z[0] = math.sin(1e3 * small)

class Held(Block):
    u = Input(start=1.0)
    kept = State()
    y = Output()
    def outputs(u, kept, y):
        y[0] = u * u + kept
    def update(u, next_kept):
        next_kept[0] = 100.0 * u
'''
DIAGRAM = """
run: {stop: 1, step: 0.1}
fleets: {robot: 3}
blocks:
  swing: {python: own.py:Swing, start: {u: [0.5, -2], q: 0.3, w: 0.02}}
  edge: {python: own.py:Edge}
  point: {python: own.py:Point}
  single: {python: own.py:Single}
  scaled: {python: own.py:Scaled}
  held: {python: own.py:Held, period: 0.2}
  fleet: {python: own.py:Swing, per: robot, start: {u: ["0.1*i", 2], q: "0.2*i"}}
"""
RING = """
run: {stop: 1, step: 0.1}
blocks:
  cosine: {python: loops.py:Cosine, inputs: {u: line.y}}
  line: {python: loops.py:Plane, inputs: {u: cosine.y}, start: {v: 0.25}, parameters: {k: [0.5, 2]}}
"""


@pytest.fixture(scope="module")
def fmus(tmp_path_factory):
    """Exported on demand, each once."""
    folder = tmp_path_factory.mktemp("directional")
    (folder / "own.py").write_text(OWN)
    (folder / "loops.py").write_text(LOOPED)
    (folder / "d.yaml").write_text(DIAGRAM)
    (folder / "ring.yaml").write_text(RING)
    networks = {name: run.load(folder / f"{name}.yaml") for name in ("d", "ring")}
    made = {}

    def get(block: str, version: str, scalars: bool = False):
        key = (block, version, scalars)
        if key not in made:
            network, names = (networks["ring"], []) if block == "ring" else (networks["d"], block.split(","))
            path = folder / f"{block.replace(',', '_')}{version[0]}{scalars}.fmu"
            made[key] = export_fmu(network, names, path, version, member=1, scalars=scalars)
        return made[key]

    return get


@pytest.fixture
def begun(fmus):
    """An initialized instance, ready to be asked; freed at the end."""
    hosts = []

    def make(block: str, version: str, me: bool = False, **values) -> Host:
        host = Host(fmus(block, version), me=me)
        hosts.append(host)
        host.initialize(**values)
        if me:
            host.new_discrete_states()
            host.fmu.enterContinuousTimeMode()
        return host

    yield make
    for host in hosts:
        host.free()


def jacobian(host: Host, unknowns: list[str], knowns: list[str]) -> np.ndarray:
    """Column by column, as importers ask for it."""
    references = [[v.valueReference for n in names for v in elements(host, n)] for names in (unknowns, knowns)]
    sizes = [[int(np.prod(v.shape or 1)) for n in names for v in elements(host, n)] for names in (unknowns, knowns)]
    columns = [derivative(host, *references, seed, sum(sizes[0])) for seed in np.eye(sum(sizes[1]))]
    return np.array(columns).T


def elements(host: Host, name: str):
    return [host.variables[name]] if host.version == "3.0" else host._elements(name)


def derivative(host: Host, unknowns: list[int], knowns: list[int], seed, n: int) -> list[float]:
    if host.version == "2.0":
        return list(host.fmu.getDirectionalDerivative(unknowns, knowns, list(seed)))
    return list(host.fmu.getDirectionalDerivative(unknowns, knowns, list(seed), n))


def expected(u, q, t, far, g):
    """∂(y, big, der(q), der(w)) / ∂(u, far, q, w, g, time)."""
    e, s, c = math.exp(u[0]), math.sin(q), math.cos(q)
    return np.array(
        [
            [e * s, 0, 0, e * c, 0, 0, 2 * t],
            [u[1], u[0], 0, 3 * q * q, 0, 0, 0],
            [0, 0, 2 * far, 0, 0, 0, 0],
            [0, 0, 0, 0, 1, 0, 0],
            [0, 1, 0, -g * c, 0, -s + 2e-3 * g, 0],
        ]
    )


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("me", [False, True])
def test_the_jacobian_has_its_closed_form(begun, version, me):
    """Within the rounding errors of the functions over the steps, and h⁴ / 30 of the fifth derivative."""
    host = begun("swing", version, me)
    t = 0.0
    if me:
        host.fmu.setTime(t := 0.7)
    knowns = ["u", "far", "q", "w", "g", "time"]
    before = host.state()
    got = jacobian(host, ["y", "big", "der(q)", "der(w)"], knowns)
    assert host.state() == before, "to the last bit"
    want = expected([0.5, -2.0], 0.3, t, 1e6, 9.81)
    sizes = np.array([1, 2, 1e6, 1, 0.02, 9.81, t or 0.1])
    steps = RELATIVE * sizes / 2  # at least: powers of two
    values = np.array([2.0, 1.1, 1e12, 0.02, 5.0])  # of the unknowns, roughly
    tolerance = 4 * EPS * values[:, None] / steps + (2 * steps) ** 4 / 30 * 10
    assert (abs(got - want) <= tolerance).all(), abs(got - want) / tolerance
    assert abs(got - want)[:, :6].max() / abs(want).max() < 1e-11


@pytest.mark.parametrize("version", VERSIONS)
def test_steps_are_scaled_by_values_and_by_nominal_values(begun, version):
    """By one of them alone, the step would be too small for y, or too large for z, by a factor of 1000 or more."""
    host = begun("scaled", version)
    np.testing.assert_allclose(jacobian(host, ["y", "z"], ["large", "small"]), [[3e12, 0.0], [0.0, 1e3]], rtol=1e-11)


@pytest.mark.parametrize("version", VERSIONS)
def test_seeds_add_up(begun, version):
    host = begun("swing", version, True)
    names = (["y"], ["u", "q"])
    references = [[v.valueReference for n in part for v in elements(host, n)] for part in names]
    seed = [0.5, -3.0, 0.125]
    got = derivative(host, *references, seed, 2)
    np.testing.assert_allclose(got, jacobian(host, *names) @ seed, rtol=1e-10)
    assert derivative(host, *references, [0.0] * 3, 2) == [0.0, 0.0]


@pytest.mark.parametrize("version", VERSIONS)
def test_what_outputs_are_read_as_stays_as_it_was(begun, version):
    """Between two steps, after inputs were set, in which Co-Simulation reads no outputs."""
    one, other = begun("swing", version), begun("swing", version)
    for k in range(10):
        for host in (one, other):
            host.set("u", [0.1 * k, 1.0 - 0.1 * k])
        q = one.get("q")[0]
        got = jacobian(one, ["y"], ["u"])
        e, s = math.exp(0.1 * k), math.sin(q)
        np.testing.assert_allclose(got, [[e * s, 0], [1.0 - 0.1 * k, 0.1 * k]], atol=1e-11)
        for host in (one, other):
            host.step(0.1 * k, 0.1)
        assert one.state() == other.state()


@pytest.mark.parametrize("version", VERSIONS)
def test_initialization_mode(fmus, version):
    host = Host(fmus("swing", version))
    if version == "2.0":
        host.fmu.setupExperiment()
    host.fmu.enterInitializationMode()
    want = expected([0.5, -2.0], 0.3, 0.0, 1e6, 9.81)
    got = jacobian(host, ["y", "big", "der(q)", "der(w)"], ["u", "far", "q", "w", "g"])
    np.testing.assert_allclose(got, want[:, :6], atol=1e-10 * abs(want).max())
    host.fmu.exitInitializationMode()
    host.free()


@pytest.mark.parametrize("version", VERSIONS)
def test_a_function_that_ends_has_the_slope_of_its_side(begun, version):
    """y = u √u + u for u ≥ 0 raises below; z = 3 v + √-v v² for v ≤ 0 is NaN above."""
    host = begun("edge", version)
    # One-sided, of fourth order, of a power of 3/2 and of 5/2 over steps of h = 2^-13: some √h and h^(3/2).
    got = jacobian(host, ["y", "z"], ["u", "v"])
    np.testing.assert_allclose(got, [[1.0, 0.0], [0.0, 3.0]], atol=2 * RELATIVE**0.5)
    host.set("u", 4.0)
    assert jacobian(host, ["y"], ["u"]) == pytest.approx(1.5 * 2.0 + 1.0, rel=1e-11)
    host.step(0.0, 0.1)


@pytest.mark.parametrize("version", VERSIONS)
def test_where_there_is_no_derivative_the_call_is_discarded(begun, version):
    host = begun("point", version)
    with pytest.raises(FMICallException, match="discard"):
        jacobian(host, ["y"], ["u"])
    assert "cannot be computed on either side" in host.messages[-1] and not any("nowhere" in m for m in host.messages)
    assert host.get("y") == 0.0
    host.step(0.0, 0.1)  # and the instance goes on


@pytest.mark.parametrize("version", VERSIONS)
def test_a_parameter_at_its_limit_has_the_slope_within(begun, version):
    host = begun("swing", version)  # g is 9.81, its minimum
    assert jacobian(host, ["scaled"], ["g"]) == pytest.approx(2 * 9.81, rel=1e-11)
    assert not any("minimum" in message for message in host.messages)


@pytest.mark.parametrize("version", VERSIONS)
def test_single_precision(begun, version):
    host = begun("single", version)
    np.testing.assert_allclose(jacobian(host, ["y", "z"], ["u"]), [[0.75], [2.0]], rtol=1e-5)


@pytest.mark.parametrize("version", VERSIONS)
def test_a_sampled_block_holds_its_outputs_between_its_instants(begun, version):
    host = begun("held", version)
    assert jacobian(host, ["y"], ["u"]) == pytest.approx(2.0, rel=1e-11)
    before = host.state()
    host.step(0.0, 0.1)
    assert jacobian(host, ["y"], ["u"]) == 0.0
    host.step(0.1, 0.1)
    host.set("u", 3.0)
    assert jacobian(host, ["y"], ["u"]) == pytest.approx(6.0, rel=1e-11)
    host.restore(before)
    host.step(0.0, 0.1)
    host.step(0.1, 0.1)
    assert host.get("y") == 101.0  # what was sampled at 0 has not been touched


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("me", [False, True])
def test_through_an_algebraic_loop(begun, version, me):
    """c = cos(l), l = c / 2 + 2 v + 1: dl/dv = 2 / (1 + sin(l) / 2)."""
    host = begun("ring", version, me)
    line = host.get("line.y")[0]
    want = 2.0 / (1.0 + 0.5 * math.sin(line))
    before = host.state()
    got = jacobian(host, ["line.y", "cosine.y"], ["line.v"])[:, 0]
    assert host.state() == before
    np.testing.assert_allclose(got, [want, -math.sin(line) * want], rtol=1e-9)


@pytest.mark.parametrize(("version", "scalars"), [("2.0", True), ("3.0", False), ("3.0", True)])
def test_the_dependencies_are_where_derivatives_are_not_zero(fmus, version, scalars):
    """Of a fleet, element by element."""
    host = Host(fmus("fleet,held", version, scalars), me=True).initialize()
    host.new_discrete_states()
    host.fmu.enterContinuousTimeMode()
    description = read_model_description(fmus("fleet,held", version, scalars))
    knowns = [
        v for v in description.modelVariables if v.name.split("[")[0] in ("fleet.u", "fleet.q", "fleet.w", "time")
    ]
    for unknown in (u for u in description.outputs + description.derivatives if "fleet" in u.variable.name):
        for known in knowns:
            n, m = (int(np.prod(v.shape or 1)) for v in (unknown.variable, known))
            parts = [
                derivative(host, [unknown.variable.valueReference], [known.valueReference], seed, n)
                for seed in np.eye(m)
            ]
            if known.name not in {d.name for d in unknown.dependencies}:
                assert not np.array(parts).any(), (unknown.variable.name, known.name)
    u1, y2 = ({v.name: v for v in description.modelVariables}.get(n) for n in ("fleet.u[3,1]", "fleet.y[3,2]"))
    if scalars:
        got = derivative(host, [y2.valueReference], [u1.valueReference], [1.0], 1)
        assert got == pytest.approx([2.0], rel=1e-11)
    host.free()


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize(
    ("unknown", "known", "seed", "said"),
    [
        ("z", "n", [1.0], "no such variable"),
        ("time", "u", [1.0], "`time` is no unknown now"),
        ("y", "z", [1.0], "`z` is no known now"),
        ("y", "u", [math.nan], "a seed is not finite"),
    ],
)
def test_wrong_calls_are_refused(begun, version, unknown, known, seed, said):
    host = begun("single", version)
    references = [[host.variables[name].valueReference] for name in (unknown, known)]
    with pytest.raises(FMICallException):
        derivative(host, *references, seed, 1)
    assert said in host.messages[-1]


def test_arrays_need_as_many_numbers_as_they_have_elements(begun):
    host = begun("swing", "3.0")
    references = [host.variables[name].valueReference for name in ("y", "u")]
    for seed, n in (([1.0], 2), ([1.0, 0.0], 1)):
        with pytest.raises(FMICallException):
            host.fmu.getDirectionalDerivative([references[0]], [references[1]], seed, n)
        assert "there are 2 unknowns and 2 knowns" in host.messages[-1]
        host.fmu.reset()
        host.initialize()


@pytest.mark.parametrize("version", VERSIONS)
def test_they_are_promised(fmus, version):
    with zipfile.ZipFile(fmus("swing", version)) as archive:
        root = etree.fromstring(archive.read("modelDescription.xml"))
    name = "providesDirectionalDerivative" + ("s" if version == "3.0" else "")
    assert [root.find(tag).get(name) for tag in ("ModelExchange", "CoSimulation")] == ["true"] * 2
