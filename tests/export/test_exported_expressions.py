"""Expressions in FMUs: of either version and interface, and compiled from their C files, the bits of the diagram."""

import shutil

import numpy as np
import pytest
from fmpy import read_model_description
from fmpy.validation import validate_fmu

from cosim.engine import run
from cosim.export.exporter import export_fmu
from cosim.results.result_file import open_result
from tests.export.test_exported_sources import compiled

#: Words of C and of Python among the names, and all kinds of functions among the outputs.
DIAGRAM = """\
run: {stop: 1, step: 0.01}
blocks:
  wave: {block: Sine, parameters: {frequency: 0.7, amplitude: [2, 1]}}
  e:
    expression:
      int: k*u**3 - abs(u) + restrict**0.5
      double: if(u > 0.5 and not u > 1, exp(-u), hypot(u, 3) % 0.7)
      static: max(int, tanh(u), 0.1)**2.5 + 2**u + atan2(u, double) // 0.1
      up: u > 0
    parameters: {k: [0.5, 0.25], restrict: 2}
    inputs: {u: wave.y}
  held: {expression: "floor(10*x) + sign(x)*log(1 + x*x, 3)", period: 0.05, inputs: {x: e.int}}
record: {signals: [e.int, e.double, e.static, e.up, held.y]}
"""
SIGNALS = ["e.int", "e.double", "e.static", "e.up", "held.y"]


def results(path):
    outcome = run.Run(run.load(path), output=path.with_suffix(".nc")).execute()
    assert outcome.status == "completed", outcome.error
    return open_result(path.with_suffix(".nc"))


@pytest.fixture(scope="module")
def diagram(tmp_path_factory):
    path = tmp_path_factory.mktemp("expressions") / "d.yaml"
    path.write_text(DIAGRAM)
    return path


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_the_bits_of_the_diagram(diagram, tmp_path, version):
    fmu = export_fmu(run.load(diagram), [], tmp_path / "all.fmu", version, with_sources=True)
    assert validate_fmu(str(fmu)) == []
    again = compiled(fmu, tmp_path / "again", ["gcc", "-O2"]) if shutil.which("gcc") else fmu
    named = ", ".join(f"f.{s}" for s in SIGNALS)
    for k, (file, mode) in enumerate([(fmu, "co-simulation"), (fmu, "model-exchange"), (again, "co-simulation")]):
        path = tmp_path / f"f{k}.yaml"
        head = "run: {stop: 1, step: 0.01}\nblocks:\n"
        path.write_text(f"{head}  f: {{fmu: {file}, mode: {mode}}}\nrecord: {{signals: [{named}]}}\n")
        with results(diagram) as own, results(path) as found:
            for signal in SIGNALS:
                a, b = np.array(own[signal]), np.array(found[f"f.{signal}"])
                np.testing.assert_array_equal(a.reshape(len(a), -1), b.reshape(len(b), -1), err_msg=f"{signal}, {mode}")


def test_one_alone_says_what_it_computes_and_what_of(diagram, tmp_path):
    fmu = export_fmu(run.load(diagram), ["e"], tmp_path / "e.fmu", "3.0")
    described = read_model_description(str(fmu))
    variables = {v.name: v for v in described.modelVariables}
    assert variables["up"].description == "up = u > 0" and variables["k"].causality == "parameter"
    needed = {u.variable.name: [d.name for d in u.dependencies or ()] for u in described.outputs}
    assert needed["up"] == ["u"] and set(needed["static"]) == {"u"}
