"""Nominal values, limits and display units of an exported FMU are those that the blocks declare."""

from __future__ import annotations

import logging
import math
import zipfile
from ctypes import c_double

import numpy as np
import pytest
from fmpy import read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu
from lxml import etree

from cosim.engine import program, run
from cosim.errors import NotExportable
from cosim.export.exporter import export_fmu
from tests.fmu.fmu_host import Host

OWN = """
from cosim import Block, Input, Output, Parameter, State

class Arm(Block):
    u = Input(unit="N.m", min=-5, max=5.0, nominal=2.0)
    q = State(
        2, output=True, unit=("rad", "degC"), display=("deg", "degF"), nominal=(0.1, 20.0), min=(-3.5, -100), max=200
    )
    w = State(2, unit="rad/s", display="rpm", nominal=0.5)
    lazy = State(min=2.0, max=3.0, dtype="float32")
    J = Parameter(2, unit="kg.m2", default=1.0, min=0.1, max=(10.0, 20.0))
    n = Parameter(dtype="int8", default=3, min=1, max=5)
    count = State(dtype=int, output=True, min=0, max=1)
    def start(u, lazy):
        lazy[0] = u
    def derivatives(u, w, J, d_q, d_w):
        for i in range(2):
            d_q[i] = w[i]
            d_w[i] = u / J[i]
    def update(lazy, n, count, next_lazy, next_count):
        next_lazy[0] = lazy
        next_count[0] = count + n

class Source(Block):
    y = Output()
    def outputs(time, y):
        y[0] = 7.0 + time
"""
DIAGRAM = """
run: {stop: 1, step: 0.1}
fleets: {arm: 2}
blocks:
  arm: {python: own.py:Arm, per: arm, period: 0.1, inputs: {u: source.y}}
  source: {python: own.py:Source}
"""
VERSIONS = ("2.0", "3.0")


@pytest.fixture(scope="module")
def network(tmp_path_factory):
    folder = tmp_path_factory.mktemp("quantities")
    (folder / "own.py").write_text(OWN)
    (folder / "d.yaml").write_text(DIAGRAM)
    return run.load(folder / "d.yaml")


@pytest.fixture(scope="module")
def fmus(network, tmp_path_factory):
    folder = tmp_path_factory.mktemp("fmus")
    kinds = {"2.0": ("2.0", False), "3.0": ("3.0", False), "scalars": ("3.0", True)}
    return {
        name: export_fmu(network, ["arm"], folder / f"a{name[0]}.fmu", v, scalars=s) for name, (v, s) in kinds.items()
    }


def told(variable) -> tuple:
    numbers = (variable.nominal, variable.min, variable.max)
    return variable.unit, variable.displayUnit, *(None if n is None else float(n) for n in numbers)


@pytest.mark.parametrize("kind", ["2.0", "scalars"])
def test_every_element_has_its_own(fmus, kind):
    description = read_model_description(fmus[kind])
    variables = {v.name: v for v in description.modelVariables}
    assert told(variables["u"]) == ("N.m", None, 2.0, -5.0, 5.0)
    assert told(variables["q[1]"]) == ("rad", "deg", 0.1, -3.5, 200.0)
    assert told(variables["q[2]"]) == ("degC", "degF", 20.0, -100.0, 200.0)
    assert told(variables["w[2]"]) == ("rad/s", "rpm", 0.5, None, None)
    assert [told(variables[f"J[{k}]"])[3:] for k in (1, 2)] == [(0.1, 10.0), (0.1, 20.0)]
    assert told(variables["n"]) == (None, None, None, 1.0, 5.0)
    assert told(variables["count"]) == (None,) * 5  # FMI would hold what is computed as an integer to its limits
    shown = {
        (u.name, d.name): (float(d.factor), float(d.offset))
        for u in description.unitDefinitions
        for d in u.displayUnits
    }
    assert shown["rad", "deg"] == pytest.approx((180.0 / math.pi, 0.0), rel=1e-15)
    assert shown["degC", "degF"] == pytest.approx((1.8, 32.0), rel=1e-12)
    assert shown["rad/s", "rpm"] == pytest.approx((30.0 / math.pi, 0.0), rel=1e-15)
    assert validate_fmu(str(fmus[kind])) == []


def test_an_array_of_fmi_3_has_what_its_elements_have_in_common(fmus):
    variables = {v.name: v for v in read_model_description(fmus["3.0"]).modelVariables}
    assert told(variables["q"]) == (None, None, None, None, 200.0)
    assert told(variables["w"]) == ("rad/s", "rpm", 0.5, None, None)
    assert told(variables["J"]) == ("kg.m2", None, None, 0.1, None)
    assert validate_fmu(str(fmus["3.0"])) == []


@pytest.mark.parametrize("kind", ["2.0", "3.0", "scalars"])
def test_solvers_get_the_nominal_values_of_the_states(fmus, kind):
    host = Host(fmus[kind], me=True).initialize()
    found = (c_double * 4)()
    host.fmu.getNominalsOfContinuousStates(found, 4)
    assert [*found] == [0.1, 20.0, 0.5, 0.5]
    host.free()


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("J", [10.0, 20.5], "`J` is 20.5, above its maximum, 20"),
        ("J", [0.05, 1.0], "`J` is 0.05, below its minimum, 0.1"),
        ("J", [math.nan, 1.0], "`J` is nan, below its minimum, 0.1"),
        ("n", 6, "`n` is 6, above its maximum, 5"),
        ("n", -1, "`n` is -1, below its minimum, 1"),
    ],
)
def test_a_parameter_beyond_its_limits_is_refused(fmus, version, name, value, said):
    host = Host(fmus[version])
    with pytest.raises(FMICallException):
        host.set(name, value)
    assert said in host.messages[-1]
    host.fmu.reset()
    host.initialize(J=[10.0, 0.1], n=5, u=50.0)  # an input may leave its limits while an importer iterates
    assert host.get("u") == 50.0
    host.free()


@pytest.mark.parametrize(("version", "large"), [*((version, program.LARGE) for version in VERSIONS), ("3.0", 0)])
def test_start_values_keep_the_limits(network, tmp_path, caplog, monkeypatch, version, large):
    """A wire brings 7 where the input takes 5 at most; a start function makes of it what the state does not take.

    Also of a program that keeps no arena until somebody asks for it.
    """
    monkeypatch.setattr(program, "LARGE", large)
    with caplog.at_level(logging.WARNING, "cosim"):
        path = export_fmu(network, ["arm"], tmp_path / "arm.fmu", version)
    assert "inputs that begin in the diagram as no number or beyond a limit" in caplog.text and "`arm.u`" in caplog.text
    starts = {v.name: v.start for v in read_model_description(path).modelVariables}
    assert (float(starts["u"]), float(starts["lazy"])) == (5.0, 3.0)
    host = Host(path).initialize()
    assert host.get("u") == 5.0 and host.get("lazy") == 5.0  # computed from the input, which is what it is
    host.step(0.0, 0.1)
    np.testing.assert_array_equal(host.get("w"), [0.5, 0.5])
    host.free()


WHOLE = """
from cosim import Block, Input, Output, Parameter

class Whole(Block):
    u = Input(dtype="uint64", max=2**64 - 1, start=2)
    k = Parameter(dtype="int64", min=-(2**63), max=2**53 + 1, default=1)
    f = Parameter(dtype="float32", min=0.1, max=0.3, default=0.1)
    y = Output(dtype="int64")
    def outputs(u, k, f, y):
        y[0] = u + k if f < 0.5 else 0
"""


def test_limits_of_whole_numbers_and_of_single_precision_are_exact(tmp_path):
    (tmp_path / "own.py").write_text(WHOLE)
    text = "run: {stop: 1, step: 0.1}\nblocks: {whole: {python: own.py:Whole, parameters: {f: 0.3}}}\n"
    (tmp_path / "d.yaml").write_text(text)
    network = run.load(tmp_path / "d.yaml")
    three, two = (export_fmu(network, [], tmp_path / f"w{v[0]}.fmu", v) for v in ("3.0", "2.0"))
    with zipfile.ZipFile(three) as archive:
        told = {v.get("name"): v for v in etree.fromstring(archive.read("modelDescription.xml")).find("ModelVariables")}
    assert (told["u"].get("min"), told["u"].get("max")) == (None, str(2**64 - 1))
    assert (told["k"].get("min"), told["k"].get("max")) == (str(-(2**63)), str(2**53 + 1))
    variables = {v.name: v for v in read_model_description(two).modelVariables}
    assert [variables[name].max for name in ("u", "k")] == [None, None]  # FMI 2's integers have 32 bits
    for path in (three, two):
        assert validate_fmu(str(path)) == []
        host = Host(path)
        for f in (0.1, 0.3):
            host.initialize(f=f, k=5)
            assert host.get("y") == 7
            host.fmu.reset()
        host.free()


def test_a_start_value_that_fmi_2_cannot_hold_is_named(tmp_path):
    (tmp_path / "own.py").write_text(WHOLE)
    text = "run: {stop: 1, step: 0.1}\nblocks: {whole: {python: own.py:Whole, parameters: {k: 3000000000}}}\n"
    (tmp_path / "d.yaml").write_text(text)
    network = run.load(tmp_path / "d.yaml")
    with pytest.raises(NotExportable, match="`k` starts as 3000000000, and FMI 2's integers have 32 bits") as caught:
        export_fmu(network, [], tmp_path / "no.fmu", "2.0")
    assert caught.value.fix == "export it as FMI 3.0" and not (tmp_path / "no.fmu").exists()
    assert Host(export_fmu(network, [], tmp_path / "w.fmu", "3.0")).initialize().get("y") == 3000000002
